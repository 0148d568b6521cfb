"""Which modulation frequencies or orders a machine's bearings and gears may show, and how high they reach."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from app.dashboard.widgets.methods.stretch import Stretch
from gearsig.diagnosis.types import Analysis
from gearsig.report.lines import bearing_cursors, line_cursors, speed_is_constant

if TYPE_CHECKING:
    from gearsig.plot.cursors import Cursor
    from gearsig.spectra.types import Spectrum

N_HARMONICS = 3.3
"""Of bearing lines: three, and what slip makes of the last."""
OF_SHAFT = 12.0
"""Orders of the reference shaft, where no bearing is known."""
WITHOUT_SPEED = 1.0 / 128.0
"""Of the sampling rate, where the speed is not known."""


def of_stretch(analysis: Analysis, stretch: Stretch) -> Analysis:
    """Return the analysis with the speed of the stretch: its mean is what lines over frequency follow."""
    return analysis if stretch.angle is None else replace(analysis, shaft_angle=stretch.angle)


def modulation_cursors(analysis: Analysis, stretch: Stretch, spectrum: Spectrum) -> tuple[Cursor, ...]:
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


def highest_of_interest(analysis: Analysis, stretch: Stretch, *, of_orders: bool) -> float:
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
    from gearsig.rig.orders import order_lines

    return [line.order for line in order_lines(analysis.rig, n_sidebands=0) if line.kind == "bearing"]
