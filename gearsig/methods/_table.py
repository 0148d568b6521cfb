"""A method of the table: its options, its answer, and its application to a part of one channel."""

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
"""Title with unit → column; all of equal length."""
Kind = Literal["choice", "switch", "number", "count", "span", "numbers", "name", "text"]


@dataclass(frozen=True)
class MethodOption:
    """An option of a method: an option of the command line, and a widget of the dashboard.

    Parameters
    ----------
    name : str
        Keyword of the method.
    label : str
        Label of the widget; not from a file.
    kind : str
        "choice" of few, "switch", "number", "count", a "span" of two numbers, several "numbers", the "name" of a shaft
        or pair, or "text".
    default : object
        None: the method decides, as described by `empty`.
    about, empty : str
    choices : mapping
        Value → text: all values of a choice, or those on the slider of a number or count.
    unit : str
        Of numbers.
    minimum, maximum : float or None
        Inclusive limits.
    known : callable or None
        Prepared recording and channel → what this recording offers: names, value → text for numbers, ends of a span;
        or the text for None in a number.
    more : bool
        Rarely needed.
    suggested : callable or None
        Analysis → value suggested by its findings or the machine's description; None: none.
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
        """Raise an `InputError` if the option does not allow a value."""
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
    """Signals of equal length, sampled at equal steps of time or angle.

    Parameters
    ----------
    columns : mapping
        Name → samples, (n_samples,): the signal, and signals derived from it.
    rate : float
        Samples per second, or per revolution of `shaft`.
    start : float
        Time or angle of the first sample.
    unit, quantity : str
    step : str
        Description of the processing, for the history of a file.
    axis : str
        "frequency" for signals over time, "order" for those over angle.
    shaft, residual, shown_first : str
        Residual: the column with the rest of the signal, if there is one. Shown first: the column that the answer
        refers to; empty: the first.
    first_length : float or None
        Length of the initial view, in s or revolutions; None: a few mesh cycles.
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
        """Number of samples of each."""
        return len(next(iter(self.columns.values())))

    @property
    def end(self) -> float:
        """Time or angle one step after the last sample."""
        return self.start + self.n_samples / self.rate

    def at(self, part: slice = slice(None)) -> FloatArray:
        """Return the time in s or angle in revolutions of some samples."""
        result: FloatArray = self.start + np.arange(self.n_samples)[part] / self.rate
        return result

    def table(self) -> dict[str, FloatArray]:
        """Return the columns, preceded by their time or angle."""
        return {at_label(self.axis, self.shaft): self.at(), **self.columns}

    def recording(self) -> Recording:
        """Return waveforms over time as a recording with one channel each; its time starts at 0."""
        return Recording(
            np.stack(list(self.columns.values())),
            self.rate,
            tuple(Channel(name, self.quantity, self.unit) for name in self.columns),
            provenance=Provenance(history=(self.step,)),
        )


@dataclass(frozen=True)
class MethodAnswer:
    """The result of a method for one channel.

    Parameters
    ----------
    channel, caption : str
    draw : callable
        Returns the figure.
    table : mapping
        Title with unit → column; all of equal length.
    tables : mapping
        Title → further table.
    matrices : mapping
        Name → two-dimensional array, for maps; `axes` names their rows and columns.
    axes : mapping
        Title with unit → positions of the rows or columns of the matrices.
    numbers : mapping
        Further values: settings, counts.
    panels : sequence of LinePanel or LevelPanel
        The figure as zoomable panels; empty: only a static figure.
    path : array, (n, 3), or None
        A path in space, to be rotated.
    facts, notes, warnings : sequence of str
        Findings, hints for interpretation, and points to check.
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
        Its name on a page, and a sentence on what it shows.
    answer : callable
        Prepared recording, channel and the options by name → answer.
    options : sequence of MethodOption
    view : str
        View of the chain that shows it; empty: a separate view shows the same.
    n_first, n_max : int
        Initial and maximum number of samples that a page analyses: a few seconds.
    limit : callable or None
        Options → maximum samples that a page can analyse, if it depends on them.
    bytes_per_sample : float or callable
        Maximum memory in addition to the recording, per sample of the part; or options → that.
    in_blocks : callable or None
        For records larger than memory: blocks, a prepared recording with only rig and angle, channel and the options
        by name → answer.
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
    """Return the channel of that name; by default the first acceleration, else the first that is not a tachometer."""
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
    """Return a part of a recording, with the angle of that part from the whole recording.

    Parameters
    ----------
    prepared : PreparedRecording
    start_s, end_s : float
    channel : str
        The only one to keep; empty: all.
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
    """Return the shaft's angle; None if the speed is not known."""
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
    """Return waveforms with the axis and unit of a signal derived from a channel."""
    measured = prepared.recording.channels[prepared.recording.index(channel)]
    same = signal.unit == measured.unit and signal.source == channel
    return Waveforms(
        columns, signal.rate, signal.start, signal.unit, measured.quantity if same else "unknown",
        f"{step}, of {channel}", signal.axis, signal.shaft, residual, shown_first, first_length,
    )  # fmt: skip


def verbatim(*values: Any) -> dict[Any, str]:
    """Return choices whose texts are the values themselves."""
    return {value: str(value) for value in values}


OVER_ANGLE = MethodOption(
    "over_angle", "Over", "switch", False,
    "Over the shaft's angle, lines are orders, which changes of speed do not smear.",
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
