"""Spectra with cursors, thinned to the range that is shown; the synchronous average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import streamlit as st

from app.dashboard import address, state
from app.dashboard.theme import palette
from app.dashboard.widgets.charts import (
    N_COLUMNS,
    Ring,
    offer_picture,
    show_lines,
    show_svg,
    zoomed_range,
)
from app.dashboard.widgets.texts import as_typed, capitalised
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis
from gearsig.formatting import axis_unit, readable, unit_text
from gearsig.orders import SynchronousAverage
from gearsig.plot import (
    AngleMark,
    ChartLine,
    Cursor,
    LinePanel,
    Scale,
    decibel_text,
    displayed_values,
    is_sound_pressure,
    level_name,
    marks_of,
    polar_figure,
    svg_ring,
    value_limits,
    with_unit,
)
from gearsig.report import circle_legend, speed_is_constant, verdict_picture, zero_text
from gearsig.spectra import LARGEST_SLIP, Spectrum

SCALES: dict[str, Scale] = {"Logarithmic": "log", "Linear": "linear", "dB": "decibel"}
KIND_NAMES = {
    "mesh": "mesh",
    "sideband": "sidebands",
    "shaft": "shafts",
    "bearing": "bearings",
    "hunting": "hunting tooth",
    "finding": "mains",
}


def show_spectrum(
    source: Analysis | str,
    spectra: Spectrum | Sequence[Spectrum],
    cursors: Sequence[Cursor],
    name: str,
    *,
    names: Sequence[str] = (),
    marked: Sequence[float] = (),
    shown: tuple[float, float] | None = None,
    scale: str = "Logarithmic",
    quantity: str = "",
    plain: bool = False,
) -> tuple[float, float]:
    """Show overlaid spectra and the settings of the view; return the range that is shown.

    Parameters
    ----------
    source : Analysis or str
        What the view is of, see `state.view_key`.
    spectra : Spectrum, or sequence of them
        Of one axis and unit; the first is in front.
    cursors : sequence of Cursor
        On the spectra's axis.
    name : str
        Of the view, for the keys of its widgets.
    names : sequence of str
        Of several spectra.
    marked : sequence of float
        Positions that findings name.
    shown : (float, float) or None
        Range shown at first.
    scale : str
        Chosen at first, one of `SCALES`.
    quantity : str
        Name of the values; empty: by their scaling.
    plain : bool
        Show the figure alone, beside a verdict.
    """
    spectra = (spectra,) if isinstance(spectra, Spectrum) else spectra
    first = spectra[0]
    if scale == "Logarithmic" and is_sound_pressure(first.unit):
        scale = "dB"  # as is usual for sound
    label, chosen = scale, list(KIND_NAMES)
    if not plain:
        label, chosen = _choose_looks(source, cursors, name, scale)
    chart, scaled = state.view_key(f"{name} chart", source), SCALES[label]
    whole = (float(first.positions[0]), float(first.positions[-1]))
    low, high = zoomed_range(chart, whole, shown)
    lines, shown_values = [], []
    for i, spectrum in enumerate(spectra):
        values = displayed_values(spectrum.values, spectrum.scaling, scaled, spectrum.unit)
        # of several spectra, a band would hide the other lines
        line_name = names[i] if names else spectrum.source
        lines.append(ChartLine(spectrum.positions, values, line_name, i, peaks=len(spectra) == 1))
        start, stop = spectrum.index_of(low), max(spectrum.index_of(high) + 1, spectrum.index_of(low) + 4)
        # the lines at zero are an offset or a drift, not vibration: they must not squeeze the rest
        n_offset = max(3, int(0.005 * (stop - start))) if start == 0 and stop - start > 9 else 0
        shown_values.append(values[start + n_offset : stop])
    text = quantity or ("value" if first.scaling == "dimensionless" else first.scaling)
    in_db = f"{level_name(text, first.unit)} ({decibel_text(first.unit)})"
    values = displayed_values(first.values, first.scaling, scaled, first.unit)
    # a finding's order may be off by a line or two: the tallest line near it is meant
    places = [(p, max(first.index_of(p) - 2, 0)) for p in marked]
    shafts = [cursor.position for cursor in cursors if cursor.kind == "shaft"]
    panel = LinePanel(
        lines[::-1],
        first.axis_label,
        in_db if scaled == "decibel" else with_unit(text, first.unit),
        value_limits(np.concatenate(shown_values), scaled),
        logarithmic=scaled == "log",
        cursors=[_first_if_found(cursor, marked) for cursor in cursors if cursor.kind in chosen],
        x_limits=shown or whole,
    )
    show_lines(
        panel,
        chart,
        marked=[(p, float(values[start : start + 5].max())) for p, start in places],
        height_px=258 if plain else 340,
        legend=bool(names),
        front_first=True,
        whole=whole,
        per_unit=_other_unit(source, first),
        step=min(shafts, default=None),
    )
    if plain:
        return low, high
    averages = f", {first.n_averages} averages" if first.n_averages > 1 else ""
    joined = " Peaks are joined; the pale band reaches down to the lowest line of each pixel."
    many = len(spectra) == 1 and first.index_of(high) - first.index_of(low) > 2 * N_COLUMNS
    st.caption(
        f"Resolution {first.resolution:.4g} {first.axis_unit}, {capitalised(first.window)} window{averages}."
        f"{joined if many else ''}{circle_legend(marked)} "
        "Drag to zoom, double-click to show all."
    )
    return low, high


def _other_unit(source: Analysis | str, spectrum: Spectrum) -> tuple[float, str] | None:
    """Return Hz per order, or orders per hertz, for the readout of cursors, if the speed is constant."""
    if isinstance(source, str) or isinstance(source.shaft_angle, CannotTell) or not speed_is_constant(source):
        return None
    turns_hz = source.shaft_angle.mean_speed_rpm / 60.0
    return (turns_hz, "Hz") if spectrum.axis == "order" else (1.0 / turns_hz, axis_unit("order"))


def _choose_looks(source: Analysis | str, cursors: Sequence[Cursor], name: str, scale: str) -> tuple[str, list[str]]:
    """Return the scale and the kinds of cursors that the user chose."""
    kinds = [kind for kind in KIND_NAMES if any(cursor.kind == kind for cursor in cursors)]
    row = st.container(horizontal=True, vertical_alignment="bottom")  # which wraps where it is narrow
    key = state.view_key(f"{name} scale", source)
    label = address.ask_one(row.segmented_control, "Amplitude", list(SCALES), first=scale, key=key, name="amplitude")
    if not kinds:
        return label, kinds
    chosen = address.ask(
        row.pills,
        "Cursors",
        kinds,
        key=state.view_key(f"{name} cursors {kinds}", source),
        name="cursors",
        first=[kind for kind in kinds if kind != "hunting"],
        read=address.some_of(kinds),
        selection_mode="multi",
        format_func=KIND_NAMES.__getitem__,
    )
    return label, list(chosen)


def _first_if_found(cursor: Cursor, marked: Sequence[float]) -> Cursor:
    """Give the cursors of a finding priority for their labels, for a bearing including its multiples."""
    return replace(cursor, number=0) if any(_is_of(cursor, position) for position in marked) else cursor


def _is_of(cursor: Cursor, position: float) -> bool:
    if cursor.kind != "bearing":  # only bearings slip
        return abs(cursor.position - position) <= 1e-3 * position
    return abs(cursor.position - max(cursor.number, 1) * position) <= LARGEST_SLIP * cursor.position


KINDS = {
    "change": "What differs from the reference at the same angle: what both share, such as the mesh, is removed.",
    "residual": "Without the mesh harmonics: a single damaged tooth stands out here.",
    "difference": "Without the mesh harmonics and their first sidebands: what is left is local.",
    "average": "The mean revolution: mesh cycles, and whatever repeats every revolution.",
    "regular": "What was removed to obtain the difference signal.",
}


def show_average(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the mean revolution of a chosen shaft, at first the signal that shows the verdict best."""
    averages, picture = channel.averages, verdict_picture(analysis)
    shown = picture if picture is not None and picture.about == "tooth" and picture.channel is channel else None
    shafts = list(dict.fromkeys(shaft for shaft, _ in channel.averages))
    if not shafts:
        st.info("There is no synchronous average: it needs a known speed and enough revolutions.")
        return
    left, right = st.columns((1, 2), vertical_alignment="bottom")
    key, first = state.view_key("average shaft", analysis), shown.shaft if shown is not None else shafts[0]
    looks = {"key": key, "name": "shaft", "format_func": lambda name: name or "the shaft"}
    shaft = address.ask_one(left.selectbox, "Shaft", shafts, first=first, **looks)
    kinds = [kind for kind in KINDS if (shaft, kind) in averages]
    key = state.view_key(f"average kind {kinds}", analysis)
    looks = {"key": key, "name": "signal", "format_func": str.capitalize}
    average = averages[shaft, address.ask_one(right.segmented_control, "Signal", kinds, **looks)]
    is_above = shown is not None and average is shown.average
    _show(analysis, average, teeth_choice(analysis, shaft), is_above=is_above)
    words = KINDS[average.kind]
    if average.kind != "change":
        words += " Band: ± 2 standard errors of the mean, from the scatter of the revolutions."
    st.caption(f"{words} The same signal is shown as a ring beside the verdict." if is_above else words)


def show_revolutions(curves: Mapping[str, FloatArray], shaft: str, y: str, key: str) -> None:
    """Show named mean revolutions of a shaft, overlaid; the first is in front."""
    lines = [
        ChartLine(np.arange(len(values)) * 360.0 / len(values), values, name, colour)
        for colour, (name, values) in enumerate(curves.items())
    ]
    panel = LinePanel(lines[::-1], f"angle of {shaft} (deg)", y, x_limits=(0.0, 360.0))
    show_lines(panel, key, legend=True, height_px=260, front_first=True)


def teeth_choice(analysis: Analysis, shaft: str) -> int | None:
    """Return the number of teeth of the gear on a shaft; the user chooses if there are several gears."""
    gears = analysis.rig.gear_teeth(shaft) if analysis.rig is not None else {}
    if len(gears) < 2:
        return next(iter(gears.values()), None)
    named = [f.where.gear.rpartition("/")[0] for f in analysis.findings if f.where.gear.rpartition("/")[2] == shaft]
    first = next((list(gears).index(name) for name in named if name in gears), 0)
    key = state.view_key(f"average gear {list(gears)}", analysis)
    looks = {"key": key, "name": "gear", "format_func": lambda pair: f"{pair}: {gears[pair]} teeth"}
    return gears[address.ask_one(st.selectbox, "Gear", list(gears), first=list(gears)[first], **looks)]


def _show(analysis: Analysis, average: SynchronousAverage, n_teeth: int | None, *, is_above: bool) -> None:
    """Show the ring of teeth beside the average over the angle; without the ring if the page already shows it."""
    marks = marks_of(analysis.findings, average.shaft, n_teeth)
    cursors = [Cursor(mark.angle_deg, "finding", mark.label) for mark in marks]
    if is_above:
        _show_unrolled(analysis, average, n_teeth, cursors)
        return
    seen = f"; marked: {', '.join(mark.label for mark in marks)}" if marks else ""
    words = f"Polar plot: {average.kind} of {average.channel} over one revolution of {average.shaft}{seen}"
    with st.container(key="average"):
        polar, unrolled = st.columns((6, 7), vertical_alignment="center")
        with polar:
            key = f"ring of {average.channel} {average.shaft} {average.kind}"
            numbered = analysis.has_mark(average.shaft)
            ring = show_ring(average, n_teeth, marks, words, state.view_key(key, analysis), numbered=numbered)
            offer_ring(ring, average, n_teeth, marks, numbered=numbered)
            st.caption(as_typed(zero_text(analysis, average.shaft)))
        with unrolled:
            _show_unrolled(analysis, average, n_teeth, cursors)


def show_ring(
    average: SynchronousAverage,
    n_teeth: int | None,
    marks: Sequence[AngleMark],
    words: str,
    key: str,
    *,
    numbered: bool,
) -> str:
    """Show the ring of teeth, zoomable and with a readout, in the page's colours; return it as SVG."""
    colours = palette()
    looks = {"ink": colours.quiet, "line": colours.measured}
    svg = svg_ring(average, n_teeth=n_teeth, marks=marks, numbered=numbered, **looks)
    # a value for each pixel of the ring, not for each sample
    values = average.values[:: max(len(average.values) // N_COLUMNS, 1)]
    show_svg(svg, words, key, ring=Ring({"": values}, (n_teeth or 0) * numbered, unit_text(average.unit)))
    return svg


def offer_ring(
    svg: str, average: SynchronousAverage, n_teeth: int | None, marks: Sequence[AngleMark], *, numbered: bool
) -> None:
    """Offer the ring of teeth as files."""
    drawn = partial(polar_figure, average, n_teeth=n_teeth, marks=marks, numbered=numbered)
    offer_picture(svg, drawn, f"ring-{average.shaft} of {average.channel} {average.kind}")


def _show_unrolled(analysis: Analysis, average: SynchronousAverage, n_teeth: int | None, marks: list[Cursor]) -> None:
    """Show the average over the angle, with its largest swing in words."""
    values, error = average.values, 2 * average.standard_error
    angle = np.arange(len(values)) * 360 / len(values)
    # a change has the scatter of two recordings, of which only this one's is known here
    band = None if average.kind == "change" else (values - error, values + error)
    line = ChartLine(angle, values, average.kind, band=band)
    key = state.view_key(f"average {average.channel} {average.shaft} {average.kind}", analysis)
    x, y = f"angle of {average.shaft or 'the shaft'} (deg)", with_unit(average.kind, average.unit)
    show_lines(LinePanel([line], x, y, cursors=marks, x_limits=(0.0, 360.0)), key, height_px=360)
    largest = int(np.argmax(np.abs(average.values)))
    degrees = 360 * largest / len(average.values)
    value = f"{readable(average.values[largest])} {unit_text(average.unit)}".strip()
    tooth = ""
    if n_teeth and analysis.has_mark(average.shaft):
        tooth = f", tooth {int(degrees * n_teeth / 360) + 1} of {n_teeth}"
    st.markdown(f"Largest swing **{as_typed(value)}** at **{degrees:.1f}°**{tooth}")
