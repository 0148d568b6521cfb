"""A method of the table: its options, its answer, how it is applied to a part of one channel."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray, count, one_of, within
from gearsig.diagnosis import Analysis
from gearsig.errors import InputError, RefusalError
from gearsig.plot import LevelPanel, LinePanel
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Provenance, Recording
from gearsig.timefreq import Axis, UniformSignal, at_label, uniform

Table = Mapping[str, NDArray[Any]]
"""Title with unit → column; all of one length."""
Kind = Literal["choice", "switch", "number", "count", "span", "numbers", "name", "text"]


@dataclass(frozen=True)
class MethodOption:
    """Something that a method is asked for: an option of the command line, a widget of the dashboard.

    Parameters
    ----------
    name : str
        Keyword of the method.
    label : str
        Of the widget; not from a file.
    kind : str
        "choice" of few, "switch", "number", "count", a "span" of two numbers, several "numbers", the "name" of a shaft
        or pair, or "text".
    default : object
        None: as the method decides, which `empty` says in words.
    about, empty : str
    choices : mapping
        Value → text: of a choice all there are, of a number or count those of a slider.
    unit : str
        Of numbers.
    minimum, maximum : float or None
        Both included.
    known : callable or None
        Prepared recording and channel → what this recording offers: names, value → text of numbers, ends of a span;
        or the text that stands for None in a number.
    more : bool
        Seldom needed.
    suggested : callable or None
        Analysis → the value that what it found, or the machine's description, suggests; None: none.
    """

    name: str
    label: str
    kind: Kind
    default: Any = None
    about: str = ""
    empty: str = ""
    choices: Mapping[Any, str] = field(default_factory=dict)
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    known: Callable[[PreparedRecording, str], Any] | None = None
    more: bool = False
    suggested: Callable[[Analysis], Any] | None = None

    def check(self, value: Any) -> None:
        """Raise an `InputError` for a value that the option does not allow."""
        if value is None:
            return
        if self.kind == "choice":
            one_of(value, self.name, self.choices)
        elif self.kind == "count":
            count(value, self.name, minimum=int(1 if self.minimum is None else self.minimum))
        if self.kind in ("number", "count"):
            low, high = (
                end if end is not None else far
                for end, far in zip((self.minimum, self.maximum), (-np.inf, np.inf), strict=True)
            )
            within(value, self.name, low, high, self.unit)


@dataclass(frozen=True)
class Waveforms:
    """Signals of equal length at equal steps of time or angle.

    Parameters
    ----------
    columns : mapping
        Name → samples, (n_samples,): the signal, and what was made of it.
    rate : float
        Samples per second, or per revolution of `shaft`.
    start : float
        Time or angle of the first sample.
    unit, quantity : str
    step : str
        What was done to the signal, for the history of a file.
    axis : str
        "frequency" for signals over time, "order" for those over angle.
    shaft, residual, shown_first : str
        Residual: the column that remains of the signal, if there is one. Shown first: the column that the answer
        speaks of; empty: the first.
    first_length : float or None
        Of the first view, in s or revolutions; None: a few mesh cycles.
    """

    columns: Mapping[str, FloatArray]
    rate: float
    start: float
    unit: str
    quantity: str
    step: str
    axis: Axis = "frequency"
    shaft: str = ""
    residual: str = ""
    shown_first: str = ""
    first_length: float | None = None

    @property
    def n_samples(self) -> int:
        """Samples of each."""
        return len(next(iter(self.columns.values())))

    @property
    def end(self) -> float:
        """Time or angle one step after the last sample."""
        return self.start + self.n_samples / self.rate

    def at(self, part: slice = slice(None)) -> FloatArray:
        """Return time in s or angle in revolutions of some samples."""
        result: FloatArray = self.start + np.arange(self.n_samples)[part] / self.rate
        return result

    def table(self) -> dict[str, FloatArray]:
        """Return the columns with their time or angle before them."""
        return {at_label(self.axis, self.shaft): self.at(), **self.columns}

    def recording(self) -> Recording:
        """Return waveforms over time as a recording, one channel each; its time begins at 0."""
        return Recording(
            np.stack(list(self.columns.values())),
            self.rate,
            tuple(Channel(name, self.quantity, self.unit) for name in self.columns),
            provenance=Provenance(history=(self.step,)),
        )


@dataclass(frozen=True)
class MethodAnswer:
    """What a method found in one channel.

    Parameters
    ----------
    channel, caption : str
    draw : callable
        Returns the figure.
    table : mapping
        Title with unit → column; all of one length.
    tables : mapping
        What it holds → another table.
    matrices : mapping
        Name → array of two dimensions, for maps: their rows and columns are named by `axes`.
    axes : mapping
        Title with unit → positions of the rows or columns of the matrices.
    numbers : mapping
        What else is known: settings, counts.
    panels : sequence of LinePanel or LevelPanel
        The figure, to be zoomed; empty: the figure is a picture.
    path : array, (n, 3), or None
        In space, to be turned.
    facts, notes, warnings : sequence of str
        What was found, how it is read, what to check.
    waveforms : Waveforms or None
    method : str
        Set by `apply_method`.
    """

    channel: str
    caption: str
    draw: Callable[[], Any]
    table: Table
    tables: Mapping[str, Table] = field(default_factory=dict)
    matrices: Mapping[str, FloatArray] = field(default_factory=dict)
    axes: Mapping[str, FloatArray] = field(default_factory=dict)
    numbers: Mapping[str, Any] = field(default_factory=dict)
    panels: Sequence[LinePanel | LevelPanel] = ()
    path: FloatArray | None = None
    facts: Sequence[str] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    waveforms: Waveforms | None = None
    method: str = ""


@dataclass(frozen=True)
class Method:
    """One row of the table of methods.

    Parameters
    ----------
    title, about : str
        Its name on a page; what it shows, in a sentence.
    answer : callable
        Prepared recording, channel and the options by name → answer.
    options : sequence of MethodOption
    view : str
        View of the chain that shows it; empty: a view of its own shows the same.
    n_first, n_max : int
        Samples that a page analyses at first, and at most: a few seconds.
    limit : callable or None
        Options → samples, where they decide how many a page can analyse.
    bytes_per_sample : float or callable
        What it takes of memory besides the recording, at most, for each sample of the part; or options → that.
    in_blocks : callable or None
        Of records longer than memory: blocks, a prepared recording that knows rig and angle alone, channel and the
        options by name → answer.
    """

    title: str
    about: str
    answer: Callable[..., MethodAnswer]
    options: Sequence[MethodOption] = ()
    view: str = ""
    n_first: int = 200_000
    n_max: int = 1_000_000
    limit: Callable[[Mapping[str, Any]], int] | None = None
    bytes_per_sample: float | Callable[[Mapping[str, Any]], float] = 400.0
    in_blocks: Callable[..., MethodAnswer] | None = None


def usual_channel(recording: Recording, name: str = "") -> str:
    """Return the channel of that name; by default the first acceleration, else the first that is no tachometer's."""
    if name:
        return recording.channels[recording.index(name)].name
    order = ("acceleration", "velocity", "displacement", "transmission_error", "sound_pressure")
    for quantity in order:
        for channel in recording.channels:
            if channel.quantity == quantity:
                return channel.name
    vibration_channels = [c.name for c in recording.channels if c.quantity != "tachometer"]
    return vibration_channels[0] if vibration_channels else recording.channels[0].name


def part_of(prepared: PreparedRecording, start_s: float, end_s: float, channel: str = "") -> PreparedRecording:
    """Return a part of a recording, with the whole recording's angle of that time.

    Parameters
    ----------
    prepared : PreparedRecording
    start_s, end_s : float
    channel : str
        The only one that is kept; empty: all.
    """
    whole = prepared.recording
    part = whole.between(start_s, end_s)
    if channel:
        row = whole.index(channel)
        part = replace(part, samples=part.samples[row : row + 1], channels=(whole.channels[row],), speed=None)
    cut = PreparedRecording(part)

    def angle() -> ShaftAngle:
        inside = prepared.shaft_angle.between(start_s, min(end_s, start_s + part.duration_s))
        return replace(inside, time_s=inside.time_s - start_s)

    cut.keep_angle(angle)
    return cut


def angle_or_none(prepared: PreparedRecording) -> ShaftAngle | None:
    """Return the shaft's angle; None where the speed is not known."""
    try:
        return prepared.shaft_angle
    except (InputError, RefusalError):
        return None


def unit_of(prepared: PreparedRecording, channel: str) -> str:
    """Return the unit of a channel."""
    recording = prepared.recording
    return recording.channels[recording.index(channel)].unit


def signal_of(prepared: PreparedRecording, channel: str, *, over_angle: bool = False, shaft: str = "") -> UniformSignal:
    """Return a channel over time, or over a shaft's angle."""
    if over_angle:
        return uniform(prepared.over_angle(shaft, [channel]), channel)
    return uniform(prepared.recording, channel)


def waveforms_of(
    prepared: PreparedRecording,
    channel: str,
    signal: UniformSignal,
    columns: Mapping[str, FloatArray],
    step: str,
    *,
    residual: str = "",
    shown_first: str = "",
    first_length: float | None = None,
) -> Waveforms:
    """Return waveforms on the axis and in the unit of a signal that was made of a channel."""
    measured = prepared.recording.channels[prepared.recording.index(channel)]
    same = signal.unit == measured.unit and signal.source == channel
    return Waveforms(
        columns, signal.rate, signal.start, signal.unit, measured.quantity if same else "unknown",
        f"{step}, of {channel}", signal.axis, signal.shaft, residual, shown_first, first_length,
    )  # fmt: skip


def verbatim(*values: Any) -> dict[Any, str]:
    """Return choices that are shown as they are written."""
    return {value: str(value) for value in values}


OVER_ANGLE = MethodOption(
    "over_angle", "Over", "switch", False,
    "Over the shaft's angle lines are orders: a change of speed does not smear.",
)  # fmt: skip
SHAFT = MethodOption(
    "shaft", "Shaft", "name", "", empty="the reference shaft", more=True,
    known=lambda prepared, _: prepared.rig.shaft_names,
)  # fmt: skip
LOWEST = MethodOption("lowest", "Lowest line (Hz or order)", "number", None, empty="all", minimum=0.0)
HIGHEST = MethodOption("highest", "Highest line (Hz or order)", "number", None, empty="all", minimum=0.0)
LINES = (LOWEST, HIGHEST)
IN_HZ = tuple(
    replace(line, label=line.label.replace("line (Hz or order)", "frequency (Hz)"), unit="Hz") for line in LINES
)


def top_hz(prepared: PreparedRecording, channel: str) -> tuple[float, float]:
    """Return the ends of a span over frequency."""
    del channel
    return 0.0, prepared.recording.sampling_rate_hz / 2.0
