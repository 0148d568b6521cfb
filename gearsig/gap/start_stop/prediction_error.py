"""How far motion and torque are from what known play, inertia and friction predict: by phase of motion and by flank."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.contact_part import Flanks
from gearsig.gap.start_stop.cycles import PHASES
from gearsig.gap.start_stop.load_part import LoadEquation
from gearsig.gap.start_stop.told import Examined, Told

LEAST_SAMPLES = 20
COMPRESSION, TORQUE = "compression", "torque"
UNITS = {COMPRESSION: "µm", TORQUE: "N·m"}
MEDIAN_OF_SQUARES = 0.455
"""Of a normal variable of variance 1: single blows do not decide."""


def prediction_errors(examined: Examined, known: Told) -> dict[tuple[str, str, str], float]:
    """Return the root mean square error of prediction by quantity, phase and flank.

    Compression: q − q₀ − s(a + κ(|F|/n)^{1/λ}), a and κ those known, q₀ so that the drive flank lies right on average.
    Keys are "compression" (µm along the line of action) or "torque" (of the driver's shaft, N m); a phase of
    `gearsig.gap.start_stop.cycles.PHASES`; "drive", "back" or, for either, nothing.

    Torque: τ − J1 α1 − (r_b1/r_b2)(J2 α2 + T sgn ω2)/(1 + μ G) within 40 Hz, while the load turns.

    Parameters
    ----------
    examined : Examined
        Whose motion is predicted.
    known : Told
        Of the sound machine, or of its simulation.
    """
    found = _compressions(examined, examined.flanks, known)
    if examined.equation is not None:
        found |= _torques(examined, examined.equation, known)
    return found


def _compressions(examined: Examined, flanks: Flanks, known: Told) -> dict[tuple[str, str, str], float]:
    play = known.contact.play_um
    if not np.isfinite(play):
        return {}
    q, side, elastic = 1e6 * flanks.motion.compression_m, flanks.design[:, 0], flanks.design[:, 1]
    ordinary = float(np.median(np.abs(elastic[flanks.alone]))) if np.any(flanks.alone) else 0.0
    per_load = known.contact.deflection_um / ordinary if ordinary > 0.0 else 0.0
    left = q - side * 0.5 * play - np.nan_to_num(per_load) * elastic
    drive = flanks.loaded & (side > 0.0)
    if np.sum(drive) < LEAST_SAMPLES:
        return {}
    left = left - float(np.median(left[drive]))
    rows = {"drive": drive, "back": flanks.loaded & (side < 0.0)}
    return _by_phase(examined, COMPRESSION, left, rows)


def _torques(examined: Examined, equation: LoadEquation, known: Told) -> dict[tuple[str, str, str], float]:
    load = known.load
    if not np.isfinite(load.inertia_kg_m2):
        return {}
    r1, r2 = equation.motion.path.base_radii_m
    drive, per_friction, against = (equation.columns[:, i] for i in (0, 1, 2))
    needed = load.inertia_kg_m2 * equation.response - load.friction_nm * against
    left = (drive + load.flank_friction * per_friction - needed) * r1 / r2
    return _by_phase(examined, TORQUE, left, {"": equation.turning})


def _by_phase(
    examined: Examined, quantity: str, left: FloatArray, rows: dict[str, np.ndarray]
) -> dict[tuple[str, str, str], float]:
    found = {}
    for flank, wanted in rows.items():
        for number, phase in enumerate(PHASES):
            here = wanted & (examined.cycles.phase == number) & (examined.cycles.number >= 0)
            if np.sum(here) >= LEAST_SAMPLES:
                found[quantity, phase, flank] = _root_mean_square(left[here])
    return found


def _root_mean_square(left: FloatArray) -> float:
    """Return it of an offset and a normal scatter about it, both by medians."""
    offset = float(np.median(left))
    return float(np.sqrt(offset**2 + np.median((left - offset) ** 2) / MEDIAN_OF_SQUARES))
