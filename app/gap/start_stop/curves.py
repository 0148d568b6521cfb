"""Curves of a start–stop gap: the torque by order of the pinion, and what its teeth yield, one by one."""

from __future__ import annotations

import numpy as np

from app.gap.start_stop.compare import Compared
from gearsig.checks import FloatArray
from gearsig.gap.curve_types import AngleCurves, SpectrumCurves
from gearsig.gap.simulator import Added
from gearsig.gap.start_stop.floors import FLOOR
from gearsig.gap.start_stop.told import NAMES

RIPPLE, CRACK = "torque_ripple", "root_crack"


def torque_curves(compared: Compared, fitted: Added | None) -> tuple[SpectrumCurves, ...]:
    """Return the torque by order of the pinion while running; none without torque."""
    m, now, other = compared.now.cycles.motion, compared.told.ripple, compared.other.ripple
    if m.torque_nm is None or not np.all(np.isfinite(now)) or not np.all(np.isfinite(other)):
        return ()
    mean_nm = float(np.quantile(np.abs(m.torque_nm), 0.9))
    every = compared.now.every
    rows = np.array([compared.now.tell(tuple(c for c in every if c != one)).ripple for one in every])
    scatter = np.sqrt((len(rows) - 1.0) * np.var(rows, axis=0))
    after = other.copy() if fitted is not None else np.zeros(0)
    if fitted is not None and fitted.name == RIPPLE:
        after[compared.spot.order] = np.hypot(after[compared.spot.order], 0.01 * fitted.severity)
    return (
        SpectrumCurves(
            "torque while running, over the pinion's revolution",
            "N m",
            compared.now.orders.astype(np.float64),
            mean_nm * now,
            mean_nm * other,
            mean_nm * after,
            mean_nm * FLOOR * np.maximum(scatter, 1e-5),
            _ripple_floor_db(compared, other),
        ),
    )


def _ripple_floor_db(compared: Compared, other: FloatArray) -> FloatArray:
    """Return how far a line of sound drives may rise, in dB: the floor of the ripple, from its scale back to a part."""
    floor = compared.floor()
    limit = FLOOR * float(floor.scale[NAMES.index("ripple")])
    part = 2.0 * compared.spot.ripple_step * float(np.sinh(limit * np.log(10.0) / 20.0))
    found: FloatArray = 20.0 * np.log10(1.0 + part / np.maximum(other, 1e-5))
    return found


def tooth_curves(compared: Compared, fitted: Added | None, predicted_um: float) -> tuple[AngleCurves, ...]:
    """Return what each tooth of the pinion yields beyond the middling one, 1 + (extra/floor)²: sound ones are 1."""
    now, other = compared.told.contact, compared.other.contact
    if np.sum(np.isfinite(now.teeth_um)) < 0.8 * len(now.teeth_um):
        return ()
    step = compared.spot.tooth_step_um

    def energy(extra_um: FloatArray) -> FloatArray:
        found: FloatArray = 1.0 + (np.maximum(np.nan_to_num(extra_um), 0.0) / step) ** 2
        return found

    after: FloatArray = np.zeros(0)
    if fitted is not None:
        teeth = np.nan_to_num(other.teeth_um)
        if fitted.name == CRACK:
            teeth[compared.spot.tooth] += predicted_um
        after = energy(teeth)
    n = len(now.teeth_um)
    angle = 360.0 * (np.arange(n) + 0.5) / n
    return (AngleCurves("pinion", "µm²", n, True, angle, energy(now.teeth_um), energy(other.teeth_um), after),)
