"""The frame of every method's page: segment, settings, cached answers, waveforms, downloads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.cached import safe_file_name
from app.dashboard.theme import capitalised
from app.dashboard.widgets import charts
from app.dashboard.work import Kept, kept
from gearsig.angle import PASSBAND, ShaftAngle, resample_to_angle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import RefusalError
from gearsig.plot import with_unit
from gearsig.recording import Channel, Provenance, Recording, write_recording
from gearsig.timefreq import Axis, UniformSignal, at_label, uniform

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

P = ParamSpec("P")
R = TypeVar("R")
Columns = Mapping[str, "ArrayLike"]
"""A table to take along: title → values."""
MIN_SAMPLES = 16
OVER_TIME, OVER_ANGLE = (".csv", ".h5", ".wav", ".parquet", ".mat"), (".csv",)
"""What waveforms are written to: recordings, which run over time; signals over angle are plain columns."""


def cached(n_kept: int, words: str) -> Callable[[Callable[P, R]], Kept[P, R]]:
    """Compute a function beside the page and keep its last answers, told apart by the content of its arguments.

    Answers are frozen, so that sessions may share them. Streamlit's own hash samples large arrays, and two segments of
    one recording could be taken for each other: arguments are hashed whole here, about 1 GB/s.

    Parameters
    ----------
    n_kept : int
        Answers kept; most are several times as long as the segment.
    words : str
        Shown while it computes.

    Examples
    --------
    >>> separated = cached(4, "Separating the orders …")(track_vold_kalman)  # doctest: +SKIP
    """
    return kept(n_kept, words, key=lambda *arguments, **named: content_key((arguments, named)))


def content_key(value: object) -> str:
    """Return a text that stands for the content of settings, arrays and dataclasses of them."""
    digest = blake2b(digest_size=16)
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: blake2b, value: object) -> None:
    if isinstance(value, np.ndarray):
        digest.update(repr((value.shape, value.dtype.str)).encode())
        digest.update(np.ascontiguousarray(value).data)
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__name__.encode())
        for part in fields(value):
            _feed(digest, getattr(value, part.name))
    elif isinstance(value, tuple | list):
        digest.update(f"{len(value)} of".encode())
        for part in value:
            _feed(digest, part)
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))
    else:
        digest.update(f"{value!r};".encode())


@dataclass(frozen=True)
class SignalSegment:
    """Part of one channel, on a time axis of its own.

    Parameters
    ----------
    recording : Recording
        That channel alone; its first sample lies at `start_s` of the whole recording.
    channel : str
    start_s : float
    angle : ShaftAngle or None
        Of the reference shaft, on the segment's own time axis; None where the speed is not known there.
    """

    recording: Recording
    channel: str
    start_s: float
    angle: ShaftAngle | None

    @property
    def end_s(self) -> float:
        """End in the time of the whole recording."""
        return self.start_s + self.recording.duration_s

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return self.recording.channels[0].unit

    @property
    def values(self) -> FloatArray:
        """The samples."""
        return self.recording.values(self.channel)


def segment_of(analysis: Analysis, channel: str, start: int, stop: int) -> SignalSegment:
    """Return the samples `start` to `stop` of a channel with the shaft angle of that time."""
    recording = analysis.recording
    row = recording.index(channel)
    part = replace(
        recording,
        samples=recording.samples[row : row + 1, start:stop],
        channels=(recording.channels[row],),
        speed=None,
        truth=None,
    )
    start_s, end_s = start / recording.sampling_rate_hz, stop / recording.sampling_rate_hz
    angle = analysis.shaft_angle
    if isinstance(angle, ShaftAngle):
        try:
            inside = angle.between(start_s, end_s)
        except RefusalError:
            pass
        else:
            return SignalSegment(part, channel, start_s, replace(inside, time_s=inside.time_s - start_s))
    return SignalSegment(part, channel, start_s, None)


def signal_of(segment: SignalSegment, *, over_angle: bool = False) -> UniformSignal:
    """Return the samples over time, or resampled over the shaft's angle.

    Raises
    ------
    RefusalError
        If the angle is asked for and not known in the segment.
    """
    if over_angle:
        return _over_angle(segment)
    rate = segment.recording.sampling_rate_hz
    return UniformSignal(segment.values, rate, start=segment.start_s, unit=segment.unit, source=segment.channel)


@cached(2, "Resampling over the shaft's angle …")
def _over_angle(segment: SignalSegment) -> UniformSignal:
    if segment.angle is None:
        raise RefusalError(
            "the shaft's angle is not known in this segment", remedy="choose another segment, or look over time"
        )
    # As many samples as there are at the highest speed: what goes beyond at lower ones is not valid at all speeds.
    fastest = max(segment.angle.speed_range_rpm[1] / 60.0, 1e-9)
    highest = PASSBAND * segment.recording.sampling_rate_hz / fastest
    signal = resample_to_angle(segment.recording, segment.angle, channels=[segment.channel], highest_order=highest)
    return uniform(signal, segment.channel)


def of_segment(analysis: Analysis, segment: SignalSegment) -> Analysis:
    """Return the analysis with the speed of the segment: its mean is what lines over frequency follow."""
    return analysis if segment.angle is None else replace(analysis, shaft_angle=segment.angle)


@dataclass(frozen=True)
class Waveforms:
    """Signals of equal length at equal steps of time or angle.

    Parameters
    ----------
    columns : mapping
        Name → samples, (n_samples,).
    rate : float
        Samples per second, or per revolution of `shaft`.
    start : float
        Time or angle of the first sample.
    unit, quantity : str
    step : str
        What was done to the segment, for the history of a file.
    axis : str
        "frequency" for signals over time, "order" for those over angle.
    shaft : str
    """

    columns: Mapping[str, FloatArray]
    rate: float
    start: float
    unit: str
    quantity: str
    step: str
    axis: Axis = "frequency"
    shaft: str = ""

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

    def part(self, limits: tuple[float, float]) -> slice:
        """Return the samples between limits, two at least."""
        start = max(0, int((limits[0] - self.start) * self.rate))
        start = min(start, max(0, self.n_samples - 2))
        return slice(start, start + max(2, int(np.ceil((limits[1] - limits[0]) * self.rate)) + 1))


def waveforms_of(
    segment: SignalSegment, signal: UniformSignal, columns: Mapping[str, FloatArray], step: str
) -> Waveforms:
    """Return waveforms on the axis and in the unit of a signal that was made of the segment."""
    channel = segment.recording.channels[0]
    quantity = channel.quantity if signal.unit == channel.unit and signal.source == channel.name else "unknown"
    step = f"{step}, of {segment.channel} from {segment.start_s:.6g} to {segment.end_s:.6g} s"
    return Waveforms(columns, signal.rate, signal.start, signal.unit, quantity, step, signal.axis, signal.shaft)


def waveforms_file(waveforms: Waveforms, ending: str) -> bytes:
    """Return a recording of the waveforms in a file's format, or columns over angle.

    Raises
    ------
    InputError
        If the format cannot hold them.
    """
    if waveforms.axis == "order":
        return table_csv({at_label("order", waveforms.shaft): waveforms.at(), **waveforms.columns})
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / f"waveforms{ending}"
        write_recording(recording_of(waveforms), path)
        return path.read_bytes()


def recording_of(waveforms: Waveforms) -> Recording:
    """Return waveforms over time as a recording, one channel each; its time begins at 0."""
    return Recording(
        np.stack(list(waveforms.columns.values())),
        waveforms.rate,
        tuple(Channel(name, waveforms.quantity, waveforms.unit) for name in waveforms.columns),
        provenance=Provenance(history=(waveforms.step,)),
    )


def table_csv(columns: Mapping[str, ArrayLike]) -> bytes:
    """Return columns of equal length as CSV, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv

    buffer = BytesIO()
    csv.write_csv(pa.table({name: pa.array(np.asarray(values)) for name, values in columns.items()}), buffer)
    return buffer.getvalue()


def show_table(columns: Mapping[str, Any]) -> None:
    """Show a table whose first column is text and whose others are numbers."""
    number = st.column_config.NumberColumn(format="%.4g")
    config = dict.fromkeys(list(columns)[1:], number)
    st.dataframe(columns, hide_index=True, width="stretch", column_config=config)


@dataclass(frozen=True)
class MethodPage:
    """A method's page for one channel; `name` tells its widgets and files from those of other methods."""

    analysis: Analysis
    channel: ChannelAnalysis
    name: str

    def key(self, widget: str) -> str:
        """Key of a widget: its choice lasts while another method is shown, not when another recording is open."""
        return state.view_key(f"{self.name} {widget}", self.analysis)

    def ask(
        self, widget: Callable[..., Any], label: str, *values: Any, key: str = "", about: str = "", **looks: Any
    ) -> Any:
        """Return what a widget of Streamlit gives, e.g. `page.ask(column.slider, "Levels", 1, 8, 4)`.

        Parameters
        ----------
        widget : callable
        label : str
        *values, **looks
            As the widget takes them.
        key : str
            Within the page, where the label is not enough to know its state by.
        about : str
            Shown on demand.
        """
        return widget(label, *values, key=self.key(key or label), help=about or None, persist_state="session", **looks)

    def choose(
        self,
        place: Any,
        label: str,
        options: Sequence[str] | Mapping[str, Any],
        *,
        default: str = "",
        key: str = "",
        about: str = "",
        named: bool = True,
        as_written: bool = False,
    ) -> Any:
        """Return the option chosen among few, `default` or else the first one at first.

        Parameters
        ----------
        place : container
        label : str
        options : sequence of str, or mapping
            A mapping gives the value of what is chosen.
        default, key, about : str
            See `ask`.
        named : bool
            Whether the label is shown; screen readers get it in any case.
        as_written : bool
            Show the options as they are, without a capital first letter.
        """
        first = default or next(iter(options))
        chosen = self.ask(
            place.segmented_control,
            label,
            list(options),
            key=key,
            about=about,
            default=first,
            format_func=str if as_written else capitalised,
            label_visibility="visible" if named else "collapsed",
            required=True,
        )
        return options[chosen or first] if isinstance(options, Mapping) else str(chosen or first)

    def asked(self, name: str, content: object, label: str, *, icon: str, about: str) -> bool:
        """Return whether the user has asked a slow question of this content; where not, show the button that asks."""
        key, question = self.key(name), content_key(content)
        if st.session_state.get(key) == question:
            return True
        ask = st.session_state.__setitem__
        st.button(label, icon=icon, key=f"{key} button", on_click=ask, args=(key, question), help=about)
        return False

    def range(
        self, label: str, end: float, *, start: float = 0.0, shown: tuple[float, float] | None = None, name: str = ""
    ) -> tuple[float, float]:
        """Return a range of an axis that the user chooses; see `charts.choose_range`."""
        name = f"{self.name} {name}".strip()
        return charts.choose_range(label, self.analysis, end, start=start, shown=shown, name=name)

    def segment(self, *, n_first: int, n_max: int = 1_000_000) -> SignalSegment:
        """Let the user choose what is analysed, and say what it is.

        Parameters
        ----------
        n_first : int
            Samples from the start that are chosen at first.
        n_max : int
            Samples that can be analysed in a few seconds: a longer choice is cut, which is said.
        """
        recording = self.analysis.recording
        rate = recording.sampling_rate_hz
        shown = (0.0, min(recording.duration_s, n_first / rate))
        low, high = self.range("Segment analysed (s)", recording.duration_s, shown=shown)
        start = min(round(low * rate), max(0, recording.n_samples - MIN_SAMPLES))
        stop = min(max(round(high * rate), start + MIN_SAMPLES), recording.n_samples)
        segment = segment_of(self.analysis, self.channel.channel, start, min(stop, start + n_max))
        n = segment.recording.n_samples
        text = f"Analysed: {segment.start_s:.4g} to {segment.end_s:.4g} s of {recording.duration_s:.4g} s, {n} samples"
        st.caption(text + ("; a longer one would take too long." if stop - start > n_max else "."))
        return segment

    def choose_over_angle(self, place: Any) -> bool:
        """Return whether the page runs over the shaft's angle; only where the speed is known is there a choice."""
        if not isinstance(self.analysis.shaft_angle, ShaftAngle):
            place.caption("Over time: there is no shaft angle, as the speed is not known.")
            return False
        about = "Over the shaft's angle, lines are orders: a change of speed does not smear them."
        return bool(self.choose(place, "Over", {"Time": False, "Shaft angle": True}, about=about))

    def first_length(self, segment: SignalSegment, *, over_angle: bool, of_mesh: bool = True) -> float | None:
        """Return the length of a waveform's first view in s, or in revolutions; None where the speed is not known.

        Five mesh cycles, so that their shape is seen; three revolutions where no mesh is known or an envelope is drawn.
        """
        if segment.angle is None:
            return None
        revolutions, rig = 3.0, self.analysis.rig
        if of_mesh and rig is not None and rig.shafts:
            orders = [rig.mesh_order(pair, segment.angle.shaft) for pair in rig.pairs]
            revolutions = next((5.0 / order for order in orders if order), revolutions)
        return revolutions if over_angle else revolutions * 60.0 / max(segment.angle.mean_speed_rpm, 1e-9)

    def draw(
        self,
        waveforms: Waveforms,
        chosen: str,
        residual: str = "",
        *,
        shown: float | None = None,
        in_middle: bool = False,
        place: Any = st,
    ) -> None:
        """Draw one waveform over the signal, and what remains of the signal below.

        Parameters
        ----------
        waveforms : Waveforms
        chosen, residual : str
            Columns; an empty one is not drawn.
        shown : float or None
            Length shown at first, in s or revolutions; None: 3000 samples.
        in_middle : bool
            Begin in the middle instead of at the start.
        place : container
            Of the range that is shown.
        """
        start, end = waveforms.start, waveforms.end
        length = min(3000 / waveforms.rate if shown is None else shown, end - start)
        first = (start + end - length) / 2.0 if in_middle else start
        with place.container():
            label = f"Waveforms shown ({'s' if waveforms.axis == 'frequency' else 'revolutions'})"
            limits = self.range(label, end, start=start, shown=(first, first + length))
        part = waveforms.part(limits)
        at, axis = waveforms.at(part), at_label(waveforms.axis, waveforms.shaft)
        rows = [("signal", {"signal": charts.QUIET, chosen: charts.MEASURED}, 240)]
        if residual:
            rows.append((residual.split(maxsplit=1)[0], {residual: charts.FAULT}, 180))
        for label, colours, height_px in rows:
            lines = [charts.ChartLine(at, waveforms.columns[c][part], c, colours[c]) for c in colours]
            below = axis if label == rows[-1][0] else ""
            axes = charts.Axes(below, with_unit(label, waveforms.unit), limits)
            charts.show_lines(lines, axes, self.key(f"waveforms {label}"), height_px=height_px, legend=True)

    def offer(self, waveforms: Waveforms | None, tables: Mapping[str, Columns] | None = None) -> None:
        """Offer waveforms in a choice of formats, and tables as CSV: whole, not thinned as on the page.

        Parameters
        ----------
        waveforms : Waveforms or None
        tables : mapping or None
            What the table holds → its columns.
        """
        with (
            st.container(horizontal=True, horizontal_alignment="right"),
            st.popover("Download", icon=":material/download:"),
        ):
            if waveforms is not None:
                endings = OVER_TIME if waveforms.axis == "frequency" else OVER_ANGLE
                ending = self.ask(st.selectbox, "Format", endings, key=f"format {endings[-1]}")
                n = len(waveforms.columns) * waveforms.n_samples
                label = f"Waveforms: {len(waveforms.columns)} × {waveforms.n_samples} samples"
                self._offer_file(label, partial(waveforms_file, waveforms, ending), "waveforms", ending)
                if ending == ".csv" and n > 2_000_000:
                    st.caption(f"About {20e-6 * n:.0f} MB as CSV; .h5 is less than half of it.")
            for what, columns in (tables or {}).items():
                self._offer_file(f"{what} (CSV)", partial(table_csv, columns), what, ".csv")

    def _offer_file(self, label: str, content: Callable[[], bytes], what: str, ending: str) -> None:
        source = safe_file_name(self.analysis.recording.provenance.source).split(".")[0]
        st.download_button(
            label,
            data=content,
            file_name=f"{source}-{safe_file_name(f'{self.name}-{what}')}{ending}",
            mime={".csv": "text/csv", ".wav": "audio/wav"}.get(ending, "application/octet-stream"),
            on_click="ignore",
            icon=":material/download:",
            key=self.key(f"download {what}"),
        )
