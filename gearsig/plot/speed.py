"""Shaft speed over time."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from gearsig.angle.types import ShaftAngle
from gearsig.plot import style
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS = {
    "constant": "stated as constant",
    "pulses": "from tachometer pulses",
    "encoder": "from the encoder",
    "speed channel": "from a speed channel",
    "tachless": "found in the vibration, no tachometer",
}
LEAST_SPAN = 0.002
"""The speed axis spans at least this share of the mean: rounding at constant speed must not look like a fluctuation."""


def speed_figure(shaft_angle: ShaftAngle) -> Figure:
    """Draw the speed of a shaft over time, with how it was found.

    Parameters
    ----------
    shaft_angle : ShaftAngle

    Returns
    -------
    Figure
    """
    figure = style.new_figure(2.3)
    axes = style.panel(figure)
    time, speed = thin(shaft_angle.time_s, 60.0 * shaft_angle.speed_rev_per_s)
    axes.plot(time, speed, color=style.MEASURED, linewidth=1.2)
    low, high = float(speed.min()), float(speed.max())
    least = LEAST_SPAN * max(abs(shaft_angle.mean_speed_rpm), 1.0)
    margin = max(0.06 * (high - low), (least - (high - low)) / 2)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(shaft_angle.start_s, shaft_angle.end_s)
    name = f"speed of {shaft_angle.shaft}" if shaft_angle.shaft else "shaft speed"
    style.label_axes(axes, "time (s)", "speed (rpm)", name)
    uncertainty = shaft_angle.relative_speed_uncertainty
    known = f", mean ± {100 * uncertainty:.2g} %" if isfinite(uncertainty) else ""
    style.note(axes, METHODS[shaft_angle.method] + known)
    style.no_offset(axes)
    return figure
