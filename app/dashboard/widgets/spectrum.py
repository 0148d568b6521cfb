"""A spectrum with cursors, thinned to the stretch that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from app.dashboard.widgets.range_slider import choose_range
from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis
from gearsig.plot.cursors import Cursor
from gearsig.plot.display import Scale, above_zero, decibels, unit_text, with_unit
from gearsig.plot.thin import envelope
from gearsig.spectra.types import Spectrum

SCALES: dict[str, Scale] = {"Logarithmic": "log", "Linear": "linear", "dB": "decibel"}
N_COLUMNS = 1600
"""Points of a line sent to the browser: more than a page has pixel columns."""
N_OFFSET_LINES = 3
"""Lines over which a window spreads a constant."""
OFFSET_SHARE = 0.005
FOUND_SHARE = 0.01
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
    """Show a spectrum and what can be changed about its view; return the stretch that is shown.

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
        Stretch shown at first.
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
    found = any(abs(cursor.position - position) <= FOUND_SHARE * position for position in marked)
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
        [Line(at, top, spectrum.source, (low, top) if thinned else None)],
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
