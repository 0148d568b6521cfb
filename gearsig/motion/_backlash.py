"""Backlash from load reversals of a gear pair: where the flanks would touch without load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion._measure import PairMotion, median_deviation
from gearsig.motion._segments import MotionSegments
from gearsig.results import Result

MIN_SAMPLES = 12
"""On each flank."""


@dataclass(frozen=True)
class BacklashEstimate(Result):
    """Backlash between the flanks.

    Parameters
    ----------
    backlash_um : float
        2a along the line of action, from flank to flank, without load.
    uncertainty_um : float
        One standard deviation, allowing for correlation between samples.
    datum_m : float
        Compression at the middle of the backlash.
    stiffness_n_per_m_lambda : float
        Stiffness of one tooth pair, from the same fit; nan where none was fitted.
    n_drive, n_back : int
        Number of samples on each flank.
    scatter_um : float
        Standard deviation of the samples around the fit.
    method : str
    """

    backlash_um: float
    uncertainty_um: float
    datum_m: float
    stiffness_n_per_m_lambda: float
    n_drive: int
    n_back: int
    scatter_um: float
    method: str


def estimate_backlash(motion: PairMotion) -> BacklashEstimate:
    """Estimate the backlash from a motion that loads both flanks.

    With torque, q = q₀ + s a + s κ (|F|/n)^{1/λ} is fitted to all loaded samples: s is the sign of
    F = (τ − J1 α1)/r_b1, n the number of pairs in contact, and κ = k^{−1/λ} a free parameter, so that the elastic part
    is measured and not taken from the rig. Outliers beyond four standard deviations are left out. Without torque, the
    result is the distance between the median positions on both flanks, which includes the deflection of both.

    Raises
    ------
    RefusalError
        If only one flank was loaded because there was no reversal, or neither because the machine stood still.

    Notes
    -----
    The uncertainty covers noise of the angles, but not eccentric gears or bent shafts, which vary q in a revolution.
    """
    force = motion.tooth_force_from_torque_n
    if force is None:
        return _lost_motion(motion)
    # Samples above a tenth of the typical load show where a flank is.
    loaded = np.abs(force) > 0.1 * float(np.quantile(np.abs(force), 0.9))
    side = np.sign(force)
    _check_sides(int(np.sum(loaded & (side > 0))), int(np.sum(loaded & (side < 0))))
    n_pairs = motion.path.n_pairs(motion.driver_angle_rad, side)
    elastic = side * (np.abs(force) / n_pairs) ** (1.0 / motion.contact.exponent)
    design = np.stack([np.ones(len(force)), side, elastic], axis=1)
    return _fitted(motion, design, loaded)


def _fitted(motion: PairMotion, design: FloatArray, loaded: NDArray[np.bool_]) -> BacklashEstimate:
    q = motion.compression_m
    keep = loaded
    for _ in range(20):
        x, *_ = np.linalg.lstsq(design[keep], q[keep], rcond=None)
        residual = q - design @ x
        scatter = median_deviation(residual[keep]) or float(np.finfo(float).tiny)
        # Leave out what is more than four standard deviations off: the middle of an impact, a slipped count.
        again = loaded & (np.abs(residual) < 4.0 * scatter)
        _check_sides(int(np.sum(again & (design[:, 1] > 0))), int(np.sum(again & (design[:, 1] < 0))))
        if np.array_equal(again, keep):
            break
        keep = again
    if not x[1] > 0.0:
        raise RefusalError(
            f"the estimated backlash is {2e6 * float(x[1]):.3g} µm: the torque does not show which flank carries",
            remedy="record a start and a braked stop: both flanks must carry",
        )
    inverse = np.linalg.pinv(design[keep].T @ design[keep])
    deviation = float(np.sqrt(np.mean(residual[keep] ** 2) * inverse[1, 1] * dependence(residual[keep])))
    stiffness = float(x[2]) ** -motion.contact.exponent if x[2] > 0.0 else float("nan")
    return BacklashEstimate(
        2e6 * float(x[1]),
        2e6 * deviation,
        float(x[0]),
        stiffness,
        int(np.sum(keep & (design[:, 1] > 0))),
        int(np.sum(keep & (design[:, 1] < 0))),
        1e6 * scatter,
        "both flanks under the measured torque, deflection taken out",
    )


def dependence(values: FloatArray) -> float:
    """Factor by which autocorrelation increases the variance of a mean: 1 + 2 Σ ρ_k up to the first ρ_k ≤ 0.

    Source: C. J. Geyer, Practical Markov chain Monte Carlo, Statistical Science 7 (1992), initial positive sequence.
    """
    centred = values - np.mean(values)
    power = float(np.mean(centred**2))
    if power == 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(200, len(values) - 1)):
        rho = float(np.mean(centred[:-lag] * centred[lag:])) / power
        if rho <= 0.0:
            break
        total += 2.0 * rho
    return total


def _lost_motion(motion: PairMotion) -> BacklashEstimate:
    """Return the distance between the median positions on both flanks while the gears turn."""
    speed = np.abs(motion.driver_speed_rad_s)
    turning = speed > 0.05 * float(np.quantile(speed, 0.95))
    q = motion.compression_m
    low, high = np.quantile(q[turning], [0.01, 0.99])
    middle = 0.5 * (low + high)
    near = 0.2 * (high - low)
    drive, back = q[turning & (q > high - near)], q[turning & (q < low + near)]
    _check_sides(len(drive), len(back))
    scatter = median_deviation(drive - np.median(drive))
    drawn = 2e-6 * motion.contact.half_backlash_um
    # Less than half of the rig's backlash is the deflection of one flank, not the distance to the other.
    if high - low < max(6.0 * scatter, 0.5 * drawn):
        raise RefusalError(
            f"the flanks move by {1e6 * (high - low):.3g} µm against each other, with {1e6 * drawn:.3g} µm of backlash "
            f"in the rig and {1e6 * scatter:.2g} µm of noise: only one flank was loaded, or noise hides the other",
            remedy="record a start and a braked stop; better with torque",
        )
    deviations = [1.25 * float(np.std(x)) * np.sqrt(dependence(x) / len(x)) for x in (drive, back)]
    return BacklashEstimate(
        1e6 * float(np.median(drive) - np.median(back)),
        1e6 * float(np.hypot(*deviations)),
        float(middle),
        float("nan"),
        len(drive),
        len(back),
        1e6 * scatter,
        "lost motion: distance between both flanks, with the deflection of both",
    )


def _check_sides(n_drive: int, n_back: int) -> None:
    if min(n_drive, n_back) < MIN_SAMPLES:
        raise RefusalError(
            f"{n_drive} samples load the drive flank and {n_back} the back flank: too few to show the backlash",
            remedy="record a reversal, or a stop with a brake: both flanks must carry",
        )


LIGHT = (0.1, 0.5)
"""Range of torque, relative to the typical one, in which flanks touch but hardly deflect."""


@dataclass(frozen=True)
class TorqueTwist(Result, columns=("twist_rad", "torque_nm")):
    """Hysteresis loop of torque over twist of the pair.

    Parameters
    ----------
    twist_rad : array, (n,)
        Driver's angle minus the driven gear's times the ratio, from the middle of the backlash.
    torque_nm : array, (n,)
        On the driver's shaft.
    lost_motion_rad : float
        Width of the loop at light load, between torques of opposite sign: the backlash at the driver's shaft; nan if
        the torque has one sign only.
    loss_per_cycle_j : float
        ∮ τ dδ per segment of motion: energy lost in tooth contact and friction; nan if the motion neither stops nor
        reverses, as the loop does not close then.
    loss_uncertainty_j : float
        Difference between two ways of integrating it, over compression and over its rate: noise if it exceeds the loss.
    work_per_cycle_j : float
        ∫ τ dθ1 per segment of motion: work transmitted through the shaft; nan in the same case.
    n_cycles : int
    """

    twist_rad: FloatArray
    torque_nm: FloatArray
    lost_motion_rad: float
    loss_per_cycle_j: float
    loss_uncertainty_j: float
    work_per_cycle_j: float
    n_cycles: int


def torque_twist(motion: PairMotion, segments: MotionSegments, datum_m: float) -> TorqueTwist:
    """Return the torque–twist loop of a start–stop motion, with its lost motion and losses.

    Raises
    ------
    RefusalError
        If no torque was measured.
    """
    torque, _ = motion.torque_and_tooth_force()
    r1 = motion.path.base_radii_m[0]
    twist = (motion.compression_m - datum_m) / r1
    n_cycles = len(segments.moving) if segments.stops_s or segments.n_reversals else 0
    share = 1.0 / (n_cycles * motion.sampling_rate_hz) if n_cycles else float("nan")
    by_rate = float(np.trapezoid(torque * motion.compression_rate_mps / r1, dx=share))
    by_compression = float(np.trapezoid(torque, twist)) / n_cycles if n_cycles else float("nan")
    return TorqueTwist(
        twist,
        torque,
        _width(twist, torque),
        by_rate,
        abs(by_rate - by_compression),
        float(np.trapezoid(torque * motion.driver_speed_rad_s, dx=share)),
        n_cycles,
    )


def _width(twist_rad: FloatArray, torque_nm: FloatArray) -> float:
    """Distance between the median twists at light torque of each sign."""
    ordinary = float(np.quantile(np.abs(torque_nm), 0.95))
    light = (np.abs(torque_nm) > LIGHT[0] * ordinary) & (np.abs(torque_nm) < LIGHT[1] * ordinary)
    sides = [twist_rad[light & (torque_nm > 0.0)], twist_rad[light & (torque_nm < 0.0)]]
    return float(np.median(sides[0]) - np.median(sides[1])) if all(len(side) for side in sides) else float("nan")
