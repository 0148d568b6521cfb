"""The synchronous average of a shaft as a polar tooth picture, and unrolled over the angle."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.formatting import readable
from gearsig.orders.types import SynchronousAverage
from gearsig.plot.cursors import Cursor
from gearsig.plot.display import unit_text, with_unit

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
    from gearsig.plot.marks import marks_of
    from gearsig.plot.polar import polar_figure

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
    line = Line(angle, values, average.kind, (values - error, values + error))
    key = state.view_key(f"average {average.channel} {average.shaft} {average.kind}", analysis)
    show_lines([line], axes, key, cursors=marks, height_px=360)
    largest = int(np.argmax(np.abs(average.values)))
    degrees = 360 * largest / len(average.values)
    value = f"{readable(average.values[largest])} {unit_text(average.unit)}".strip()
    tooth = f", tooth {int(degrees * n_teeth / 360) + 1} of {n_teeth}" if n_teeth else ""
    st.markdown(f"Largest swing **{as_typed(value)}** at **{degrees:.1f}°**{tooth}")
