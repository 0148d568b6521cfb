"""Shaft speed over time, and how it was found."""

from __future__ import annotations

from math import isfinite

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis, CannotTell
from gearsig.plot.speed import LEAST_SPAN, METHODS
from gearsig.plot.thin import thin


def show_speed(analysis: Analysis) -> None:
    """Show the speed of the reference shaft, or why it is not known."""
    angle = analysis.shaft_angle
    if isinstance(angle, CannotTell):
        show_unknown_speed(angle)
        return
    _show_numbers(angle)
    _show_curve(analysis, angle)
    if angle.notes:
        st.markdown("\n".join(f"- {as_typed(note)}" for note in angle.notes))


def show_unknown_speed(reason: CannotTell) -> None:
    """Say why there is no speed and what would give it."""
    remedy = f"\n\nWhat would give it: {as_typed(reason.remedy)}" if reason.remedy else ""
    hint = "\n\nA constant speed can be given under *Not in the file?*"
    st.info(f"The speed is not known: {as_typed(reason.reason)}{remedy}{hint}", icon=":material/help:")


def _show_numbers(angle: ShaftAngle) -> None:
    low, high = angle.speed_range_rpm
    uncertainty = angle.relative_speed_uncertainty
    numbers = (
        ("Mean speed", f"{angle.mean_speed_rpm:.6g} rpm"),
        ("Lowest to highest", f"{low:.5g} – {high:.5g} rpm"),
        ("Uncertainty of the mean", f"± {100 * uncertainty:.2g} %" if isfinite(uncertainty) else "not known"),
        ("Revolutions", f"{angle.n_revolutions:.5g}"),
        ("Quality", f"{angle.quality:.2f} of 1"),
    )
    for column, (name, text) in zip(st.columns(len(numbers)), numbers, strict=True):
        column.caption(name)
        column.markdown(f"**{text}**")
    st.caption(f"Shaft {as_typed(angle.shaft or 'of reference')}, {METHODS[angle.method]}.")


def _show_curve(analysis: Analysis, angle: ShaftAngle) -> None:
    time, speed = thin(angle.time_s, 60 * angle.speed_rev_per_s)
    low, high = float(speed.min()), float(speed.max())
    # rounding at constant speed must not look like a fluctuation
    margin = max(0.06 * (high - low), (LEAST_SPAN * max(abs(angle.mean_speed_rpm), 1) - (high - low)) / 2)
    axes = Axes("time (s)", "speed (rpm)", (angle.start_s, angle.end_s), (low - margin, high + margin))
    show_lines([Line(time, speed, "speed")], axes, state.view_key("speed chart", analysis))
