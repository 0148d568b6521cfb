"""What the loaded flanks tell: play, deflection, single teeth, the shape of worn flanks, run-out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.cycles import CycledMotion
from gearsig.motion.types import PairMotion

Mask = NDArray[np.bool_]
LOADED = 0.1
"""Part of the ordinary load from which on a sample tells where a flank is."""
LEAST_SAMPLES, LEAST_OF_A_TOOTH, LEAST_OF_A_PLACE = 12, 3, 5
EDGE = 0.07
"""Base pitches around the entry and exit of pairs that are left out."""
FAR, MOST_ROUNDS = 4.0, 4
PARTED_M = 5e-5
"""A sample further from one level for all places lies in the play: the flanks have just parted. Worn flanks differ by
less from place to place, as the least worn pair decides."""
FULL_TURN = 0.7
"""Revolutions from which on a wave of one cycle per revolution is told from a straight line."""
N_PLACES = 20
"""Parts of the mesh cycle."""


@dataclass(frozen=True)
class Flanks:
    """Samples that tell where the flanks are, prepared once per recording.

    Parameters
    ----------
    design : array, (n, k)
        Columns: side, deflection (0 without torque), and waves of the shafts.
    loaded, alone : array of bool, (n,)
        One of the flanks carries; a single pair carries on the drive flank.
    place : array of int, (n,)
        Of a sample within the mesh cycle, 0 to `N_PLACES` − 1.
    tooth : array of int, (n,)
        Of the driver, from 0.
    """

    motion: PairMotion
    design: FloatArray
    loaded: Mask
    alone: Mask
    place: NDArray[np.int64]
    tooth: NDArray[np.int64]


@dataclass(frozen=True)
class ContactPart:
    """What was found; lengths in µm along the line of action, nan where it cannot be told.

    Parameters
    ----------
    play_um, deflection_um : float
        Without load; of one pair under the ordinary load.
    teeth_um : array, (n_teeth,)
        How much further each tooth of the driver lets the gears turn than the middling one, while it carries alone.
    waves_um : array, (4,)
        Cosine and sine of the driver's revolution, then of the driven gear's.
    curve_um : array, (N_PLACES,)
        Course of the compression over the mesh cycle on the drive flank, its mean taken off.
    scatter_um : float
        Root mean square of what is left over.
    zero_m : float
        Compression in the middle of the play.
    """

    play_um: float
    deflection_um: float
    teeth_um: FloatArray
    waves_um: FloatArray
    curve_um: FloatArray
    scatter_um: float
    zero_m: float = float("nan")


def prepare_flanks(cycles: CycledMotion) -> Flanks:
    """Find the samples that tell where the flanks are."""
    m = cycles.motion
    force = m.tooth_force_from_torque_n
    side, loaded, elastic = _by_load(m, force) if force is not None else _by_place(m)
    speed = np.abs(m.driver_speed_rad_s)
    path = m.path
    u = path.position(m.driver_angle_rad, side)
    clear = (u > EDGE) & (u < 1.0 - EDGE) & (np.abs(u - (path.contact_ratio - 1.0)) > EDGE)
    alone = loaded & clear & (side > 0.0) & (u > path.contact_ratio - 1.0)
    alone &= speed > 0.05 * float(np.quantile(speed, 0.95))
    columns = [side, elastic, np.cos(m.driver_angle_rad), np.sin(m.driver_angle_rad)]
    turned = float(np.ptp(m.driven_angle_rad)) / (2.0 * np.pi)
    if turned > FULL_TURN:
        columns += [np.cos(m.driven_angle_rad), np.sin(m.driven_angle_rad)]
    place = np.clip((u * N_PLACES).astype(np.int64), 0, N_PLACES - 1)
    tooth = (path.tooth(m.driver_angle_rad) - 1.0).astype(np.int64)
    return Flanks(m, np.stack(columns, axis=1), loaded & clear, alone, place, tooth)


def contact_part(flanks: Flanks, wanted: Mask) -> ContactPart:
    """Fit q = b on the back flank, d_p at place p of the mesh cycle on the drive flank, deflection and waves to both.

    q = b [s < 0] + Σ_p d_p [s > 0, p] + s κ (|F|/n)^{1/λ} + waves; what is left is sorted by tooth. Play is d̄ − b. A
    level for each place leaves the deflection to what the load changes there, and shows the shape of worn flanks.
    """
    m, q = flanks.motion, flanks.motion.compression_m
    drive = flanks.design[:, 0] > 0.0
    keep = flanks.loaded & wanted
    keep &= _touching(flanks, q, keep, drive)
    back = keep & ~drive
    has_torque, has_back = bool(np.any(flanks.design[keep, 1])), np.sum(back) >= LEAST_SAMPLES
    counts = np.bincount(flanks.place[keep & drive], minlength=N_PLACES)
    places = np.flatnonzero(counts >= LEAST_OF_A_PLACE)
    if len(places) < N_PLACES // 3:
        return _nothing(m)
    known = np.isin(flanks.place, places)
    keep = keep & ((drive & known) | (~drive & has_back))
    levels = (drive[:, None] & (flanks.place[:, None] == places)).astype(np.float64)
    others = [c for c in range(1, flanks.design.shape[1]) if c != 1 or has_torque]
    columns = [levels, flanks.design[:, others]] + ([(~drive)[:, None].astype(np.float64)] if has_back else [])
    design = np.concatenate(columns, axis=1)
    x, keep = _robust(design, q, keep, drive)
    left = q - design @ x
    of = dict(zip(others, x[len(places) : len(places) + len(others)], strict=True))
    middle = float(np.mean(x[: len(places)]))
    play = middle - float(x[-1]) if has_back else np.nan
    curve = np.full(N_PLACES, np.nan)
    curve[places] = x[: len(places)] - middle
    alone = flanks.alone & known & wanted & (np.abs(left) < PARTED_M)
    ordinary = float(np.median(np.abs(flanks.design[alone, 1]))) if np.any(alone) else np.nan
    deflection = 1e6 * of.get(1, np.nan) * ordinary
    return ContactPart(
        1e6 * play if play > 0.0 else float("nan"),
        deflection if deflection > 0.0 else float("nan"),
        1e6 * _by_tooth(flanks, left, alone),
        1e6 * np.array([of.get(c, np.nan) for c in (2, 3, 4, 5)]),
        1e6 * curve,
        1e6 * float(np.sqrt(np.mean(left[keep] ** 2))),
        middle - 0.5 * play if has_back else float("nan"),
    )


def _by_load(m: PairMotion, force: FloatArray) -> tuple[FloatArray, Mask, FloatArray]:
    """Side, loaded samples and (|F|/n)^{1/λ} from the torque."""
    loaded = np.abs(force) > LOADED * float(np.quantile(np.abs(force), 0.95))
    side = np.where(force < 0.0, -1.0, 1.0)
    n_pairs = m.path.n_pairs(m.driver_angle_rad, side)
    return side, loaded, side * (np.abs(force) / n_pairs) ** (1.0 / m.contact.exponent)


def _by_place(m: PairMotion) -> tuple[FloatArray, Mask, FloatArray]:
    """The same without torque: a flank carries where the compression is near the ends of its range."""
    q, speed = m.compression_m, np.abs(m.driver_speed_rad_s)
    turning = speed > 0.05 * float(np.quantile(speed, 0.95))
    low, high = np.quantile(q[turning], [0.01, 0.99])
    drawn = 2e-6 * m.contact.half_backlash_um
    side = np.where(q > 0.5 * (low + high), 1.0, -1.0)
    loaded = turning & (np.minimum(high - q, q - low) < 0.25 * (high - low))
    if high - low < 0.5 * drawn:  # only one flank: the motion goes forwards, so it drives
        side, loaded = np.ones(len(q)), turning
    return side, loaded, np.zeros(len(q))


def _touching(flanks: Flanks, q: FloatArray, keep: Mask, drive: Mask) -> Mask:
    """Say which samples are near one level for each flank: a place's own level would follow what flies past it."""
    has_torque = bool(np.any(flanks.design[keep, 1]))
    others = [c for c in range(1, flanks.design.shape[1]) if c != 1 or has_torque]
    design = np.concatenate([np.stack([drive, ~drive], axis=1).astype(np.float64), flanks.design[:, others]], axis=1)
    if np.sum(keep) < 4 * design.shape[1]:
        return keep
    x, near = _robust(design, q, keep, drive)
    left = np.abs(q - design @ x)
    limits = [max(PARTED_M, FAR * _spread(left[near & f])) for f in (drive, ~drive)]
    return left < np.where(drive, *limits)


def _spread(left: FloatArray) -> float:
    return 1.4826 * float(np.median(left)) if len(left) else 0.0


def _robust(design: FloatArray, q: FloatArray, keep: Mask, drive: Mask) -> tuple[FloatArray, Mask]:
    """Least squares without samples far off: blows, slipped counts.

    Far off is said by the scatter of a sample's own flank: the back flank knocks while the drive flank runs smoothly,
    and without noise all of it would lie far off.
    """
    wanted = keep
    size = np.sqrt(np.mean(design[keep] ** 2, axis=0)) + 1e-30
    scaled, least = design / size, 1e-12 * np.eye(design.shape[1])
    for _ in range(MOST_ROUNDS):
        a = scaled[keep]
        x: FloatArray = np.linalg.solve(a.T @ a / len(a) + least, a.T @ q[keep] / len(a)) / size
        left = np.abs(q - design @ x)
        limits = [FAR * (_spread(left[keep & f]) + 1e-12) for f in (drive, ~drive)]
        again = wanted & (left < np.where(drive, *limits))
        if np.array_equal(again, keep) or np.sum(again) < 4 * len(x):
            break
        keep = again
    return x, keep


def _by_tooth(flanks: Flanks, left: FloatArray, alone: Mask) -> FloatArray:
    """Median of what is left of each tooth of the driver, less that of the middling tooth."""
    teeth = np.full(flanks.motion.path.teeth[0], np.nan)
    for j in range(len(teeth)):
        here = alone & (flanks.tooth == j)
        if np.sum(here) >= LEAST_OF_A_TOOTH:
            teeth[j] = np.median(left[here])
    if np.any(np.isfinite(teeth)):
        teeth -= np.nanmedian(teeth)
    return teeth


def _nothing(m: PairMotion) -> ContactPart:
    nan = float("nan")
    return ContactPart(nan, nan, np.full(m.path.teeth[0], nan), np.full(4, nan), np.full(N_PLACES, nan), nan)
