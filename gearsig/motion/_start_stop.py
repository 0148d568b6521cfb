"""All results from the start–stop motion of a gear pair."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from gearsig.errors import answer_or_none
from gearsig.indicators import Indicator
from gearsig.motion._backlash import BacklashEstimate, TorqueTwist, estimate_backlash, torque_twist
from gearsig.motion._force import find_datum
from gearsig.motion._identify import ToothYielding, tooth_compliance
from gearsig.motion._impacts import Impact, find_impacts
from gearsig.motion._measure import PairMotion, check_turns
from gearsig.motion._segments import MotionSegments, motion_segments
from gearsig.phase import PhasePortrait
from gearsig.results import Result


@dataclass(frozen=True)
class StartStop(Result, rows="impacts"):
    """All results from a start–stop motion.

    Parameters
    ----------
    motion : PairMotion
    segments : MotionSegments
        Of the driver.
    backlash : BacklashEstimate or None
    impacts : tuple of Impact
    loop : TorqueTwist or None
    portrait : PhasePortrait or None
        Compression and its rate, from the middle of the backlash.
    teeth : ToothYielding or None
        Of each tooth of the driver.
    indicators : tuple of Indicator
    refusals : tuple of str
        Results that the record does not allow, with the reason.
    notes : tuple of str
        Limitations of the results.
    """

    motion: PairMotion
    segments: MotionSegments
    backlash: BacklashEstimate | None
    impacts: tuple[Impact, ...]
    loop: TorqueTwist | None
    portrait: PhasePortrait | None
    teeth: ToothYielding | None
    indicators: tuple[Indicator, ...]
    refusals: tuple[str, ...]
    notes: tuple[str, ...] = ()


def examine_start_stop(motion: PairMotion) -> StartStop:
    """Find segments, backlash, impacts, the torque–twist loop and the phase plane of a pair's motion.

    Results that the record does not allow are listed in `refusals` instead.

    Raises
    ------
    RefusalError
        If the machine is at rest in the whole record.
    """
    check_turns(motion)
    segments = motion_segments(motion.driver_angle_rad, motion.sampling_rate_hz)
    refusals: list[str] = []
    backlash = answer_or_none(lambda: estimate_backlash(motion), "backlash", refusals)
    datum = answer_or_none(
        lambda: find_datum(motion).compression_m if backlash is None else backlash.datum_m,
        "impacts and phase plane",
        refusals,
    )
    impacts: tuple[Impact, ...] = ()
    loop: TorqueTwist | None = None
    portrait: PhasePortrait | None = None
    if datum is not None:
        portrait = phase_plane_of_teeth(motion, datum)
        half = None if backlash is None else 0.5e-6 * backlash.backlash_um
        find = partial(find_impacts, motion, datum, half_backlash_m=half)
        impacts = answer_or_none(find, "impacts", refusals) or ()
        if motion.torque_nm is not None:
            loop = torque_twist(motion, segments, datum)
    teeth: ToothYielding | None = None
    if motion.torque_nm is not None:
        teeth = answer_or_none(lambda: tooth_compliance(motion), "stiffness of single teeth", refusals)
    indicators = start_stop_indicators(motion, segments, backlash, impacts, loop)
    return StartStop(
        motion,
        segments,
        backlash,
        impacts,
        loop,
        portrait,
        teeth,
        indicators,
        tuple(refusals),
        _notes(impacts, motion.sampling_rate_hz),
    )


def phase_plane_of_teeth(motion: PairMotion, datum_m: float) -> PhasePortrait:
    """Return the phase plane of compression and its rate: two flanks a backlash apart, with flights between them."""
    points = np.stack([motion.compression_m - datum_m, motion.compression_rate_mps], axis=1)
    return PhasePortrait(
        points, motion.sampling_rate_hz, ("compression", "compression rate"), ("m", "m/s"), "states", motion.source
    )


def start_stop_indicators(
    motion: PairMotion,
    segments: MotionSegments,
    backlash: BacklashEstimate | None,
    impacts: tuple[Impact, ...],
    loop: TorqueTwist | None,
) -> tuple[Indicator, ...]:
    """Return indicators that need no steady speed.

    Starts, stops, rests, reversals; run-down; backlash; number of impacts, hardest impact, energy lost per cycle,
    restitution; loss and work per cycle, lost motion.
    """
    n_cycles = max(1, len(segments.moving))
    top_rpm = segments.top_speed_rpm
    rows: list[tuple[str, float, str, str]] = [
        ("starts", float(len(segments.starts_s)), "", "motion"),
        ("stops", float(len(segments.stops_s)), "", "motion"),
        ("reversals", float(segments.n_reversals), "", "motion"),
        ("standing part", segments.standing_part, "", "motion"),
        ("highest speed", top_rpm, "rpm", "motion"),
        ("run-down", run_down_rad_s2(motion, segments), "rad/s^2", "motion"),
    ]
    if backlash is not None:
        rows.append(("backlash", backlash.backlash_um, "um", "compression"))
    speeds = np.array([i.speed_mps for i in impacts])
    lost = np.array([i.energy_j if np.isnan(i.lost_j) else i.lost_j for i in impacts])
    bounces = np.array([i.restitution for i in impacts if not np.isnan(i.restitution)])
    rows += [
        ("impacts per cycle", len(impacts) / n_cycles, "", "compression"),
        ("back impacts per cycle", sum(i.flank < 0 for i in impacts) / n_cycles, "", "compression"),
        ("hardest impact", float(speeds.max()) if len(speeds) else 0.0, "m/s", "compression"),
        ("impact loss per cycle", float(lost.sum()) / n_cycles if len(lost) else 0.0, "J", "compression"),
        ("restitution", float(np.median(bounces)) if len(bounces) else float("nan"), "", "compression"),
    ]
    if loop is not None:
        rows += [
            ("lost motion", np.degrees(loop.lost_motion_rad), "deg", "torque over twist"),
            ("loop loss per cycle", loop.loss_per_cycle_j, "J", "torque over twist"),
            ("work per cycle", loop.work_per_cycle_j, "J", "torque over angle"),
        ]
    return tuple(
        Indicator(name, float(value), unit, computed_on=on, note="" if np.isfinite(value) else "not defined here")
        for name, value, unit, on in rows
    )


def run_down_rad_s2(motion: PairMotion, segments: MotionSegments) -> float:
    """Median over stops of the driver's mean deceleration from 80 to 20 % of its top speed; nan without stops."""
    slopes = []
    for segment in segments.moving:
        speed = np.abs(motion.driver_speed_rad_s[segment.first : segment.last])
        top = int(np.argmax(speed))
        falling = speed[top:]
        high, low = np.flatnonzero(falling < 0.8 * speed[top]), np.flatnonzero(falling < 0.2 * speed[top])
        if len(high) and len(low) and low[0] > high[0]:
            slopes.append(0.6 * speed[top] * motion.sampling_rate_hz / (low[0] - high[0]))
    return float(np.median(slopes)) if slopes else float("nan")


def _notes(impacts: tuple[Impact, ...], rate_hz: float) -> tuple[str, ...]:
    """Say for how many bounces the restitution cannot be estimated."""
    n = sum(bool(i.note) for i in impacts)
    if not n:
        return ()
    known = n + sum(not np.isnan(i.restitution) for i in impacts)
    # From 4 kHz, all hard impacts of the manipulator are found.
    remedy = "; record at 4 kHz or more" if rate_hz < 4000.0 else ""
    text = (
        f"The restitution of {n} of {known} bounces cannot be estimated: separation is faster than approach, as there "
        f"is too much noise or too few samples per flight at {rate_hz:g} Hz{remedy}."
    )
    return (text,)
