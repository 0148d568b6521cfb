"""The stretch of one channel that a method works on, limited so that the answer comes at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.cached import safe_file_name
from app.dashboard.theme import as_plot_text, as_typed, palette
from app.dashboard.widgets.charts import CONFIG, Axes, choose_range
from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import RefusalError
from gearsig.plot import thin, with_unit
from gearsig.recording import Channel, Provenance, Recording
from gearsig.report import bearing_cursors, line_cursors, speed_is_constant

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.plot import Cursor
    from gearsig.spectra import Spectrum
    from gearsig.timefreq import Axis, UniformSignal


N_FEWEST = 16


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
        Of the reference shaft, on the stretch's own time axis; None where the speed is not known there.
    key : str
        Stands for all of the above in caches.
    """

    recording: Recording
    channel: str
    start_s: float
    angle: ShaftAngle | None
    key: str

    @property
    def end_s(self) -> float:
        """End in the time of the whole recording."""
        return self.start_s + self.recording.duration_s

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return self.recording.channels[0].unit


def choose_stretch(
    analysis: Analysis, channel: ChannelAnalysis, name: str, *, n_first: int, n_most: int = 1_000_000
) -> SignalSegment:
    """Let the user choose what is analysed, and say what it is.

    Parameters
    ----------
    analysis : Analysis
    channel : ChannelAnalysis
    name : str
        Of the method, for the key.
    n_first : int
        Samples from the start that are chosen at first.
    n_most : int
        Samples that can be analysed in a few seconds: a longer choice is cut, which is said.
    """
    recording = analysis.recording
    rate = recording.sampling_rate_hz
    shown = (0.0, min(recording.duration_s, n_first / rate))
    low, high = choose_range("Stretch analysed (s)", analysis, recording.duration_s, shown=shown, name=name)
    start = min(round(low * rate), max(0, recording.n_samples - N_FEWEST))
    stop = min(max(round(high * rate), start + N_FEWEST), recording.n_samples)
    cut = stop - start > n_most
    found = stretch_of(analysis, channel.channel, start, min(stop, start + n_most))
    n = found.recording.n_samples
    said = f"Analysed: {found.start_s:.4g} to {found.end_s:.4g} s of {recording.duration_s:.4g} s, {n} samples"
    st.caption(said + ("; a longer one would take too long." if cut else "."))
    return found


def stretch_of(analysis: Analysis, channel: str, start: int, stop: int) -> SignalSegment:
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
    start_s = start / recording.sampling_rate_hz
    angle = _angle_of(analysis, start_s, stop / recording.sampling_rate_hz)
    return SignalSegment(part, channel, start_s, angle, _key(part, start_s, angle))


def _angle_of(analysis: Analysis, start_s: float, end_s: float) -> ShaftAngle | None:
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle):
        return None
    try:
        inside = angle.between(start_s, end_s)
    except RefusalError:
        return None
    return replace(inside, time_s=inside.time_s - start_s)


def _key(part: Recording, start_s: float, angle: ShaftAngle | None) -> str:
    """Hash whatever an answer may rest on: rig, speed and rate may change while the file stays the same."""
    digest = blake2b(np.ascontiguousarray(part.samples).data, digest_size=16)
    digest.update(repr((part.sampling_rate_hz, part.channels, start_s, part.samples.dtype.str)).encode())
    if angle is not None:
        digest.update(angle.shaft.encode())
        for values in (angle.time_s, angle.revolutions, angle.speed_rev_per_s):
            digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()


# --------------------
# Several curves in one chart with a legend: plain lines of the user's zoom, coloured by their place in the list.
# --------------------


LEGEND_PX = 40
LEFT_PX = 76
"""The same for all charts, so that those below each other share their axis."""


@dataclass(frozen=True)
class Curve:
    """A curve, already thinned; nan where it has a gap.

    Parameters
    ----------
    x, y : array, (n,)
    name : str
        In the legend.
    colour : int
        Which of the page's colours; -1 is grey.
    dotted : bool
    """

    x: FloatArray
    y: FloatArray
    name: str
    colour: int = 0
    dotted: bool = False


def show_curves(curves: Sequence[Curve], axes: Axes, key: str, *, height_px: int = 320) -> None:
    """Show curves; `key` is the widget's, unique on the page."""
    from plotly.graph_objects import Figure

    colours, figure = palette(), Figure()
    cycle = (colours.measured, colours.fault, *(colours.cursors[kind] for kind in ("mesh", "bearing", "shaft")))
    for curve in curves:
        colour = colours.quiet if curve.colour < 0 else cycle[curve.colour % len(cycle)]
        figure.add_scatter(
            x=curve.x,
            y=curve.y,
            name=as_plot_text(curve.name),
            mode="lines",
            line={"color": colour, "width": 1.3, "dash": "dot" if curve.dotted else "solid"},
            hovertemplate="%{x:.5g}, %{y:.4g}",
        )
    figure.update_layout(
        height=height_px + LEGEND_PX,
        margin={"l": LEFT_PX, "r": 8, "t": 8, "b": 8},
        hovermode="closest",
        showlegend=len(curves) > 1,
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0, "xanchor": "left"},
        xaxis={"title": as_plot_text(axes.x), "range": axes.x_limits, "exponentformat": "none"},
        yaxis={
            "title": as_plot_text(axes.y),
            "range": axes.y_limits,
            "exponentformat": "e",
            "minexponent": 4,
            "automargin": False,
        },
    )
    st.plotly_chart(figure, width="stretch", key=key, config=CONFIG, alt=as_typed(f"{axes.y} over {axes.x}"))


# --------------------
# Whole waveforms that a method found, and the part of them that is drawn.
# --------------------


N_SHOWN = 3000
"""Samples at first."""


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
        What was done to the stretch, for the history of a file.
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


def waveforms_of(
    stretch: SignalSegment, columns: Mapping[str, FloatArray], step: str, *, unit: str | None = None
) -> Waveforms:
    """Return waveforms over the time of a stretch, in its channel's unit unless another one is given."""
    channel = stretch.recording.channels[0]
    own = unit is None or unit == channel.unit
    return Waveforms(
        columns,
        stretch.recording.sampling_rate_hz,
        stretch.start_s,
        channel.unit if unit is None else unit,
        channel.quantity if own else "unknown",
        f"{step}, of {stretch.channel} from {stretch.start_s:.6g} to {stretch.end_s:.6g} s",
    )


def choose_window(
    analysis: Analysis, waveforms: Waveforms, name: str, *, shown: float | None = None, in_middle: bool = False
) -> tuple[float, float]:
    """Return the time or angle that is drawn.

    Parameters
    ----------
    analysis : Analysis
    waveforms : Waveforms
    name : str
        Of the view, for the key.
    shown : float or None
        Length at first, in s or revolutions; None: `N_SHOWN` samples.
    in_middle : bool
        Begin in the middle instead of at the start.
    """
    start, end = waveforms.start, waveforms.end
    length = min(N_SHOWN / waveforms.rate if shown is None else shown, end - start)
    first = (start + end - length) / 2.0 if in_middle else start
    unit = "s" if waveforms.axis == "frequency" else "revolutions"
    return choose_range(
        f"Waveforms shown ({unit})", analysis, end, start=start, shown=(first, first + length), name=name
    )


def show_waveforms(
    analysis: Analysis,
    waveforms: Waveforms,
    limits: tuple[float, float],
    looks: Mapping[str, int],
    name: str,
    *,
    label: str = "signal",
    last: bool = True,
    height_px: int = 240,
) -> None:
    """Draw some of the waveforms in one chart.

    Parameters
    ----------
    analysis : Analysis
    waveforms : Waveforms
    limits : (float, float)
        From `choose_window`.
    looks : mapping
        Column → colour as in `Curve`.
    name : str
        Of the chart, for the key.
    label : str
        Of the value axis.
    last : bool
        Whether the lower axis is named.
    height_px : int
    """
    part = _part(waveforms, limits)
    at = waveforms.at(part)
    curves = [Curve(*thin(at, waveforms.columns[column][part]), column, colour) for column, colour in looks.items()]
    from gearsig.timefreq import at_label

    below = at_label(waveforms.axis, waveforms.shaft) if last else ""
    axes = Axes(below, with_unit(label, waveforms.unit), limits)
    show_curves(curves, axes, state.view_key(f"{name} waveforms", analysis), height_px=height_px)


def _part(waveforms: Waveforms, limits: tuple[float, float]) -> slice:
    """Return the samples between limits, two at least."""
    start = max(0, int((limits[0] - waveforms.start) * waveforms.rate))
    start = min(start, max(0, waveforms.n_samples - 2))
    return slice(start, start + max(2, int(np.ceil((limits[1] - limits[0]) * waveforms.rate)) + 1))


# --------------------
# A choice of one among few, always made and kept while another view is shown.
# --------------------


def choose_one(
    label: str, options: Sequence[str], key: str, *, default: str = "", about: str = "", named: bool = True
) -> str:
    """Return the chosen option, `default` or else the first one at first.

    Parameters
    ----------
    label : str
    options : sequence of str
    key : str
        Of the widget.
    default : str
    about : str
        Shown on demand.
    named : bool
        Whether the label is shown; screen readers get it in any case.
    """
    first = default or options[0]
    chosen = st.segmented_control(
        label,
        list(options),
        default=first,
        format_func=_capitalised,
        key=key,
        help=about or None,
        label_visibility="visible" if named else "collapsed",
        persist_state="session",
        required=True,
    )
    return str(chosen or first)


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]


# --------------------
# What transforms work on: the stretch over time, or resampled over the shaft's angle.
# --------------------


def choose_over_angle(analysis: Analysis, view: str, *, first: str = "Time") -> bool:
    """Return whether a view runs over the shaft's angle; only where the speed is known is there a choice.

    Parameters
    ----------
    analysis : Analysis
    view : str
        For the key.
    first : str
        "Time" or "Shaft angle", chosen at first.
    """
    if not isinstance(analysis.shaft_angle, ShaftAngle):
        st.caption("Over time: there is no shaft angle, as the speed is not known.")
        return False
    about = "Over the shaft's angle, lines are orders: a change of speed does not smear them."
    key = state.view_key(f"{view} over", analysis)
    return choose_one("Over", ("Time", "Shaft angle"), key, default=first, about=about) == "Shaft angle"


def signal_of(stretch: SignalSegment, *, over_angle: bool) -> UniformSignal:
    """Return the samples over time, or resampled over the shaft's angle.

    Raises
    ------
    RefusalError
        If the angle is asked for and not known in the stretch.
    """
    from gearsig.timefreq import UniformSignal

    if over_angle:
        return _over_angle(f"{stretch.key} angle", stretch)
    recording = stretch.recording
    return UniformSignal(
        recording.values(stretch.channel),
        recording.sampling_rate_hz,
        start=stretch.start_s,
        unit=stretch.unit,
        source=stretch.channel,
    )


@st.cache_resource(max_entries=2, show_spinner=False)
def _over_angle(key: str, _stretch: SignalSegment) -> UniformSignal:
    """Resample once; the answer is frozen, so that sessions may share it."""
    from gearsig.angle import PASSBAND, resample_to_angle
    from gearsig.timefreq import uniform

    del key
    if _stretch.angle is None:
        raise RefusalError(
            "the shaft's angle is not known in this stretch", remedy="choose another stretch, or look over time"
        )
    # As many samples as there are at the highest speed: what goes beyond at lower ones is not valid at all speeds.
    fastest = max(_stretch.angle.speed_range_rpm[1] / 60.0, 1e-9)
    highest = PASSBAND * _stretch.recording.sampling_rate_hz / fastest
    signal = resample_to_angle(_stretch.recording, _stretch.angle, channels=[_stretch.channel], highest_order=highest)
    return uniform(signal, _stretch.channel)


def waveforms_over(
    signal: UniformSignal, stretch: SignalSegment, columns: Mapping[str, FloatArray], step: str
) -> Waveforms:
    """Return waveforms on the axis of a signal."""
    return Waveforms(
        columns,
        signal.rate,
        signal.start,
        signal.unit,
        stretch.recording.channels[0].quantity,
        f"{step}, of {stretch.channel} from {stretch.start_s:.6g} to {stretch.end_s:.6g} s",
        signal.axis,
        signal.shaft,
    )


# --------------------
# What a method shows, to take along: whole, not thinned as on the page.
# --------------------


Table = Callable[[], "Mapping[str, ArrayLike]"]
OVER_TIME = (".csv", ".h5", ".wav", ".parquet", ".mat")
"""What recordings are written to; `gearsig.recording` reads all of them."""
OVER_ANGLE = (".csv",)
"""A recording runs over time: signals over angle are plain columns."""
MIME = {".csv": "text/csv", ".wav": "audio/wav"}
LARGE_CSV = 2_000_000
"""Numbers beyond which a CSV file takes tens of megabytes."""


def offer_downloads(
    analysis: Analysis, name: str, waveforms: Waveforms | None = None, tables: Mapping[str, Table] | None = None
) -> None:
    """Offer waveforms in a choice of formats, and tables as CSV.

    Parameters
    ----------
    analysis : Analysis
    name : str
        Of the method, for the keys and the names of the files.
    waveforms : Waveforms or None
    tables : mapping or None
        What the table holds → function that returns its columns; called only on download.
    """
    with (
        st.container(horizontal=True, horizontal_alignment="right"),
        st.popover("Download", icon=":material/download:"),
    ):
        if waveforms is not None:
            _offer_waveforms(analysis, name, waveforms)
        for what, table in (tables or {}).items():
            _button(analysis, name, f"{what} (CSV)", partial(_table_file, table), f"{name}-{what}", ".csv")


def _offer_waveforms(analysis: Analysis, name: str, waveforms: Waveforms) -> None:
    endings = OVER_TIME if waveforms.axis == "frequency" else OVER_ANGLE
    key = state.view_key(f"{name} format {endings[-1]}", analysis)
    ending = st.selectbox("Format", endings, key=key, persist_state="session")
    n = len(waveforms.columns) * waveforms.n_samples
    label = f"Waveforms: {len(waveforms.columns)} × {waveforms.n_samples} samples"
    _button(analysis, name, label, lambda: waveforms_file(waveforms, ending), f"{name}-waveforms", ending)
    if ending == ".csv" and n > LARGE_CSV:
        st.caption(f"About {20e-6 * n:.0f} MB as CSV; .h5 is less than half of it.")


def _button(analysis: Analysis, name: str, label: str, content: Callable[[], bytes], stem: str, ending: str) -> None:
    source = safe_file_name(analysis.recording.provenance.source).split(".")[0]
    st.download_button(
        label,
        data=content,
        file_name=f"{source}-{safe_file_name(stem)}{ending}",
        mime=MIME.get(ending, "application/octet-stream"),
        on_click="ignore",
        icon=":material/download:",
        key=state.view_key(f"{name} download {stem}", analysis),
    )


def waveforms_file(waveforms: Waveforms, ending: str) -> bytes:
    """Return a recording of the waveforms in a file's format, or columns over angle.

    Raises
    ------
    InputError
        If the format cannot hold them.
    """
    if waveforms.axis == "order":
        from gearsig.timefreq import at_label

        return table_csv({at_label("order", waveforms.shaft): waveforms.at(), **waveforms.columns})
    from gearsig.recording import write_recording

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


def _table_file(table: Table) -> bytes:
    return table_csv(table())


def table_csv(columns: Mapping[str, ArrayLike]) -> bytes:
    """Return columns of equal length as CSV, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv

    buffer = BytesIO()
    csv.write_csv(pa.table({name: pa.array(np.asarray(values)) for name, values in columns.items()}), buffer)
    return buffer.getvalue()


# --------------------
# What a method says about its own answer.
# --------------------


def show_notes(notes: Sequence[str], *, quiet: bool = False) -> None:
    """Show notes as one warning, or quietly as small print; names in them come from files."""
    if not notes:
        return
    text = as_typed(notes[0]) if len(notes) == 1 else "\n".join(f"- {as_typed(note)}" for note in notes)
    if quiet:
        st.caption(text)
    else:
        st.warning(text, icon=":material/warning:")


# --------------------
# How much of a waveform is drawn at first: a few mesh cycles, in which its shape is seen.
# --------------------


N_CYCLES = 5.0
"""Of the mesh, or of whatever else is looked at."""
N_REVOLUTIONS = 3.0
"""Of the reference shaft, where no mesh is known or an envelope is drawn."""


def length_shown(analysis: Analysis, stretch: SignalSegment, *, over_angle: bool, of_mesh: bool = True) -> float | None:
    """Return the length of a waveform's first view in s, or in revolutions; None where the speed is not known."""
    if stretch.angle is None:
        return None
    revolutions = N_REVOLUTIONS
    if of_mesh and analysis.rig is not None and analysis.rig.shafts:
        orders = [analysis.rig.mesh_order(pair, stretch.angle.shaft) for pair in analysis.rig.pairs]
        revolutions = next((N_CYCLES / order for order in orders if order), N_REVOLUTIONS)
    return revolutions if over_angle else revolutions * 60.0 / max(stretch.angle.mean_speed_rpm, 1e-9)


# --------------------
# Which modulation frequencies or orders a machine's bearings and gears may show, and how high they reach.
# --------------------


N_HARMONICS = 3.3
"""Of bearing lines: three, and what slip makes of the last."""
OF_SHAFT = 12.0
"""Orders of the reference shaft, where no bearing is known."""
WITHOUT_SPEED = 1.0 / 128.0
"""Of the sampling rate, where the speed is not known."""


def of_stretch(analysis: Analysis, stretch: SignalSegment) -> Analysis:
    """Return the analysis with the speed of the stretch: its mean is what lines over frequency follow."""
    return analysis if stretch.angle is None else replace(analysis, shaft_angle=stretch.angle)


def modulation_cursors(analysis: Analysis, stretch: SignalSegment, spectrum: Spectrum) -> tuple[Cursor, ...]:
    """Return lines of shafts, bearings and meshes on the axis of an envelope's spectrum; none where they would smear.

    Parameters
    ----------
    analysis : Analysis
    stretch : Stretch
    spectrum : Spectrum
        Over modulation frequency or order.
    """
    here = of_stretch(analysis, stretch)
    if stretch.angle is None or (spectrum.axis == "frequency" and not speed_is_constant(here)):
        return ()
    meshes = [cursor for cursor in line_cursors(here, spectrum, n_sidebands=0) if cursor.kind == "mesh"]
    return (*bearing_cursors(here, spectrum), *meshes)


def highest_of_interest(analysis: Analysis, stretch: SignalSegment, *, of_orders: bool) -> float:
    """Return the highest modulation frequency in Hz, or order of the reference shaft, worth a look at first."""
    rate = stretch.recording.sampling_rate_hz
    if stretch.angle is None:
        return WITHOUT_SPEED * rate
    order = max(_bearing_orders(analysis), default=OF_SHAFT / N_HARMONICS) * N_HARMONICS
    per_order_hz = max(stretch.angle.mean_speed_rpm / 60.0, 1e-9)
    order = min(order, rate / 16.0 / per_order_hz)
    return order if of_orders else order * per_order_hz


def _bearing_orders(analysis: Analysis) -> list[float]:
    if analysis.rig is None or not analysis.rig.shafts:
        return []
    from gearsig.rig import order_lines

    return [line.order for line in order_lines(analysis.rig, n_sidebands=0) if line.kind == "bearing"]
