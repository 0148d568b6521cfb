"""What the driven gear's motion tells: inertia, friction of its bearings and of the flanks, a load off centre."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.contact_part import FULL_TURN
from gearsig.gap.start_stop.cycles import CycledMotion
from gearsig.motion.contact_force import friction_share
from gearsig.motion.derivatives import local_polynomial
from gearsig.motion.types import PairMotion

Mask = NDArray[np.bool_]
BANDWIDTH_HZ = 40.0
"""Of the equation: masses that swing behind the driven gear are stiff below it."""
TURNING = 0.15
"""Part of the ordinary speed from which on friction slides."""
UNIT_FRICTION = 0.05
FAR, MOST_ROUNDS = 5.0, 3


@dataclass(frozen=True)
class LoadEquation:
    """α2 = (r_b2 F (1 + μ G) − T sgn ω2 − c ω2 − U sin θ2 − V cos θ2)/J2, smoothed on both sides alike.

    Parameters
    ----------
    motion : PairMotion
    response : array, (n,)
        α2.
    columns : array, (n, 6)
        What 1/J2, μ/J2, T/J2, c/J2, U/J2, V/J2 multiply.
    turning : array of bool, (n,)
    flank_loss : array or None
        (τ − J1 α1)/r_b1 less the measured force, over it, per unit of μ; where a force was measured.
    """

    motion: PairMotion
    response: FloatArray
    columns: FloatArray
    turning: Mask
    flank_loss: tuple[FloatArray, FloatArray] | None


@dataclass(frozen=True)
class LoadPart:
    """What was found; nan where it cannot be told.

    Parameters
    ----------
    inertia_kg_m2 : float
    friction_nm : float
        Of the load at half the ordinary speed, sliding and viscous together.
    flank_friction : float
        μ.
    off_centre_nm : array, (2,)
        U and V.
    drive_nm : float
        Ordinary torque on the driven gear, for comparison.
    scatter_nm : float
        Root mean square of what is left over, as a torque.
    """

    inertia_kg_m2: float
    friction_nm: float
    flank_friction: float
    off_centre_nm: FloatArray
    drive_nm: float
    scatter_nm: float


def prepare_load(cycles: CycledMotion) -> LoadEquation | None:
    """Return the equation of the driven gear; None without torque."""
    m = cycles.motion
    if m.torque_nm is None:
        return None
    smoother = local_polynomial(m.sampling_rate_hz, min(BANDWIDTH_HZ, 0.1 * m.sampling_rate_hz))
    force = m.tooth_force_from_torque_n
    assert force is not None  # noqa: S101  there is a torque
    unit = replace(m, contact=replace(m.contact, friction_coefficient=UNIT_FRICTION))
    shares = [friction_share(unit, force, gear) for gear in (0, 1)]
    drive = m.path.base_radii_m[1] * force
    w, angle = m.driven_speed_rad_s, m.driven_angle_rad
    columns = (
        drive,
        drive * (shares[1] / shares[0] - 1.0) / UNIT_FRICTION,
        -np.tanh(w / (0.02 * float(np.quantile(np.abs(w), 0.95)) + 1e-12)),
        -w,
        -np.sin(angle),
        -np.cos(angle),
    )
    speed = np.abs(smoother.apply(w))
    slow = speed < TURNING * float(np.quantile(speed, 0.95))
    reach = smoother.window // 2
    near = np.convolve(slow, np.ones(2 * reach + 1), "same") > 0.5
    loss = None
    if m.force_n is not None:
        loss = (force - m.force_n, m.force_n * (shares[0] - 1.0) / UNIT_FRICTION)
    return LoadEquation(
        m,
        smoother.apply(m.driven_acceleration_rad_s2),
        np.stack([smoother.apply(column) for column in columns], axis=1),
        ~near,
        loss,
    )


def load_part(equation: LoadEquation | None, wanted: Mask) -> LoadPart:
    """Solve the equation on the samples wanted."""
    nan = float("nan")
    nothing = LoadPart(nan, nan, nan, np.full(2, nan), nan, nan)
    if equation is None:
        return nothing
    keep = wanted & equation.turning
    if np.sum(keep) < 100:
        return nothing
    m = equation.motion
    turned = float(np.ptp(m.driven_angle_rad)) / (2.0 * np.pi)
    used = [0, 1, 2, 3, 4, 5] if turned > FULL_TURN else [0, 1, 2, 3]
    x = _robust(equation.columns[:, used], equation.response, keep)
    if not x[0] > 0.0:
        return nothing
    inertia = 1.0 / x[0]
    half = 0.5 * float(np.quantile(np.abs(m.driven_speed_rad_s), 0.95))
    left = equation.response[keep] - equation.columns[keep][:, used] @ x
    drive = float(np.quantile(np.abs(equation.columns[keep, 0]), 0.9))
    off_centre = inertia * x[4:6] if len(used) > 4 else np.full(2, nan)
    return LoadPart(
        float(inertia),
        float(inertia * (x[2] + x[3] * half)),
        _flank_friction(equation, keep, float(inertia * x[1])),
        off_centre,
        drive,
        float(inertia * 1.4826 * np.median(np.abs(left))),
    )


def _flank_friction(equation: LoadEquation, keep: Mask, from_load: float) -> float:
    """μ from the measured force where there is one, which feels the driver's side alone; else from the load."""
    if equation.flank_loss is None:
        return from_load
    y, per_friction = (values[keep] for values in equation.flank_loss)
    near = np.abs(y - np.median(y)) < FAR * (1.4826 * float(np.median(np.abs(y - np.median(y)))) + 1e-12)
    power = float(np.sum(per_friction[near] ** 2))
    return float(np.sum(y[near] * per_friction[near]) / power) if power > 0.0 else from_load


def _robust(columns: FloatArray, response: FloatArray, keep: Mask) -> FloatArray:
    scale = np.sqrt(np.mean(columns[keep] ** 2, axis=0)) + 1e-30
    wanted, least = keep, 1e-12 * np.eye(columns.shape[1])
    for _ in range(MOST_ROUNDS):
        a = columns[keep] / scale
        x: FloatArray = np.linalg.solve(a.T @ a / len(a) + least, a.T @ response[keep] / len(a)) / scale
        left = np.abs(response - columns @ x)
        keep = wanted & (left < FAR * (1.4826 * float(np.median(left[keep])) + 1e-12))
    return x
