"""A spectrum with cursors, thinned to the segment that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import Axes, ChartLine, choose_range, show_lines, show_picture
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.formatting import readable
from gearsig.orders import SynchronousAverage
from gearsig.plot import Cursor, Scale, above_zero, decibels, envelope, unit_text, with_unit
from gearsig.spectra import Spectrum

SCALES: dict[str, Scale] = {"Logarithmic": "log", "Linear": "linear", "dB": "decibel"}
N_COLUMNS = 1600
"""Points of a line sent to the browser: more than a page has pixel columns."""
N_OFFSET_LINES = 3
"""Lines over which a window spreads a constant."""
OFFSET_SHARE = 0.005
SLIP_SHARE = 0.01
"""Bearings slip by a percent or so: a finding that near to a cursor is the cursor's."""
KIND_NAMES = {
    "mesh": "mesh",
    "sideband": "sidebands",
    "shaft": "shafts",
    "bearing": "bearings",
    "hunting": "hunting tooth",
}


def show_spectrum(
    analysis: Analysis,
    spectrum: Spectrum,
    cursors: Sequence[Cursor],
    name: str,
    *,
    marked: Sequence[float] = (),
    shown: tuple[float, float] | None = None,
    scale: str = "Logarithmic",
    quantity: str = "",
) -> tuple[float, float]:
    """Show a spectrum and what can be changed about its view; return the segment that is shown.

    Parameters
    ----------
    analysis : Analysis
    spectrum : Spectrum
    cursors : sequence of Cursor
        On the spectrum's axis.
    name : str
        Of the view, for the keys of its widgets.
    marked : sequence of float
        Positions that findings name.
    shown : (float, float) or None
        Segment shown at first.
    scale : str
        Chosen at first, one of `SCALES`.
    quantity : str
        Name of the values; empty: by their scaling.
    """
    kinds = [kind for kind in KIND_NAMES if any(cursor.kind == kind for cursor in cursors)]
    left, right = st.columns((2, 3), vertical_alignment="bottom")
    with left:
        label = st.segmented_control(
            "Amplitude", list(SCALES), default=scale, key=state.view_key(f"{name} scale", analysis)
        )
    with right:
        chosen = kinds
        if kinds:
            chosen = st.pills(
                "Cursors",
                kinds,
                default=[kind for kind in kinds if kind != "hunting"],
                selection_mode="multi",
                format_func=KIND_NAMES.__getitem__,
                key=state.view_key(f"{name} cursors {kinds}", analysis),
            )
    unit = {"frequency": "Frequency shown (Hz)", "order": "Orders shown"}.get(spectrum.axis, "Quefrency shown (s)")
    limits = choose_range(f"{unit}", analysis, float(spectrum.positions[-1]), shown=shown, name=name)
    shown_cursors = [_first_if_found(cursor, marked) for cursor in cursors if cursor.kind in chosen]
    _draw(analysis, spectrum, SCALES[label or scale], limits, shown_cursors, marked, name, quantity)
    return limits


def _first_if_found(cursor: Cursor, marked: Sequence[float]) -> Cursor:
    """Give the cursor of a finding the first right to its label."""
    found = any(abs(cursor.position - position) <= SLIP_SHARE * position for position in marked)
    return replace(cursor, number=0) if found else cursor


def _draw(
    analysis: Analysis,
    spectrum: Spectrum,
    scale: Scale,
    limits: tuple[float, float],
    cursors: Sequence[Cursor],
    marked: Sequence[float],
    name: str,
    quantity: str,
) -> None:
    start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
    values = _displayed(spectrum, scale)
    x, high = spectrum.positions[start:stop], values[start:stop]
    at, low, top = envelope(x, high, N_COLUMNS)
    thinned = len(at) < len(x)
    points = [(p, float(values[spectrum.index_of(p)])) for p in marked if limits[0] <= p <= limits[1]]
    # the lines at zero are an offset or a drift, not vibration: they must not squeeze the rest
    n_offset = max(N_OFFSET_LINES, int(OFFSET_SHARE * len(high))) if start == 0 and len(high) > 9 else 0
    y_limits = _value_limits(high[n_offset:], scale)
    show_lines(
        [ChartLine(at, top, spectrum.source, (low, top) if thinned else None)],
        Axes(
            spectrum.axis_label, _value_label(spectrum, scale, quantity), limits, y_limits, logarithmic=scale == "log"
        ),
        state.view_key(f"{name} chart", analysis),
        cursors=cursors,
        marked=points,
    )
    resolution = f"{spectrum.resolution:.4g} {'Hz' if spectrum.axis == 'frequency' else 'orders'}"
    more = " Peaks are joined; the pale band reaches down to the lowest line of each pixel." if thinned else ""
    averages = f", {spectrum.n_averages} averages" if spectrum.n_averages > 1 else ""
    st.caption(f"Resolution {resolution}, {spectrum.window} window{averages}.{more}")


def _displayed(spectrum: Spectrum, scale: Scale) -> FloatArray:
    if scale == "decibel":
        return decibels(spectrum.values, spectrum.scaling)
    return above_zero(spectrum.values) if scale == "log" else spectrum.values


def _value_limits(values: FloatArray, scale: Scale) -> tuple[float, float]:
    """Return limits that show the peaks and the floor, without the bottomless notches between the lines."""
    high, low = float(values.max()), float(np.percentile(values, 5))
    if scale == "linear":
        return min(0.0, float(values.min())), high * 1.06 or 1.0
    if scale == "log":
        return max(low, high * 1e-8) / 2, high * 2
    return max(low, high - 160) - 6, high + 6


def _value_label(spectrum: Spectrum, scale: Scale, quantity: str) -> str:
    name = quantity or ("value" if spectrum.scaling == "dimensionless" else spectrum.scaling)
    if scale == "decibel":
        return f"{name} (dB re 1 {unit_text(spectrum.unit)}".rstrip() + ")"
    return with_unit(name, spectrum.unit)


# --------------------
# The synchronous average of a shaft as a polar tooth picture, and unrolled over the angle.
# --------------------


N_ANGLES = 2000

KINDS = {
    "residual": "Without the mesh harmonics: a single damaged tooth stands out here.",
    "difference": "Without the mesh harmonics and their first sidebands: what is left is local.",
    "average": "The mean revolution: mesh cycles, and whatever returns every turn.",
    "regular": "What was taken out for the difference signal.",
}


def show_average(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show one mean revolution of a chosen shaft."""
    shafts = list(dict.fromkeys(shaft for shaft, _ in channel.averages))
    if not shafts:
        st.info("There is no synchronous average: it takes a known speed and enough revolutions.")
        return
    left, right = st.columns((1, 2), vertical_alignment="bottom")
    shaft = left.selectbox("Shaft", shafts, key=state.view_key("average shaft", analysis))
    kinds = [kind for kind in KINDS if (shaft, kind) in channel.averages]
    key = state.view_key(f"average kind {kinds}", analysis)
    kind = right.segmented_control("Signal", kinds, default=kinds[0], format_func=str.capitalize, key=key) or kinds[0]
    n_teeth = teeth_choice(analysis, shaft)
    _show(analysis, channel.averages[shaft, kind], n_teeth)
    st.caption(f"{KINDS[kind]} Band: ± 2 standard errors of the mean, from the scatter of the revolutions.")


def teeth_choice(analysis: Analysis, shaft: str) -> int | None:
    """Return the teeth of the gear on a shaft; the user chooses where there are several."""
    pairs = analysis.rig.pairs if analysis.rig is not None else ()
    gears = {
        pair.name: teeth
        for pair in pairs
        if shaft in (pair.driver, pair.driven) and (teeth := pair.teeth(shaft)) is not None
    }
    if len(gears) < 2:
        return next(iter(gears.values()), None)
    named = [f.where.gear.rpartition("/")[0] for f in analysis.findings if f.where.gear.rpartition("/")[2] == shaft]
    first = next((list(gears).index(name) for name in named if name in gears), 0)
    key = state.view_key(f"average gear {list(gears)}", analysis)
    chosen = st.selectbox(
        "Gear", list(gears), index=first, format_func=lambda pair: f"{pair}: {gears[pair]} teeth", key=key
    )
    return gears[chosen]


def _show(analysis: Analysis, average: SynchronousAverage, n_teeth: int | None) -> None:
    from gearsig.plot import marks_of, polar_figure

    marks = marks_of(analysis.findings, average.shaft, n_teeth)
    seen = f"; marked: {', '.join(mark.label for mark in marks)}" if marks else ""
    words = f"Polar picture: {average.kind} of {average.channel} over one revolution of {average.shaft}{seen}"
    polar, unrolled = st.columns((6, 7), vertical_alignment="center")
    with polar:
        show_picture(polar_figure(average, n_teeth=n_teeth, marks=marks), words)
    with unrolled:
        _show_unrolled(analysis, average, n_teeth, [Cursor(m.angle_deg, "finding", m.label) for m in marks])


def _show_unrolled(analysis: Analysis, average: SynchronousAverage, n_teeth: int | None, marks: list[Cursor]) -> None:
    """Show the same over the angle, with its largest swing in words."""
    chosen = np.arange(0, len(average.values), max(1, len(average.values) // N_ANGLES))
    values, error = average.values[chosen], 2 * average.standard_error[chosen]
    angle = chosen * 360 / len(average.values)
    axes = Axes(
        f"angle of {average.shaft or 'the shaft'} (deg)", with_unit(average.kind, average.unit), (0.0, 360.0), x_step=45
    )
    line = ChartLine(angle, values, average.kind, (values - error, values + error))
    key = state.view_key(f"average {average.channel} {average.shaft} {average.kind}", analysis)
    show_lines([line], axes, key, cursors=marks, height_px=360)
    largest = int(np.argmax(np.abs(average.values)))
    degrees = 360 * largest / len(average.values)
    value = f"{readable(average.values[largest])} {unit_text(average.unit)}".strip()
    tooth = f", tooth {int(degrees * n_teeth / 360) + 1} of {n_teeth}" if n_teeth else ""
    st.markdown(f"Largest swing **{as_typed(value)}** at **{degrees:.1f}°**{tooth}")
