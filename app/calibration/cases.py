"""One case of the calibration: a drawn rig, its recording and its reference, and what they show of either gear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.calibration.rigs import DrawnRig, draw_rig
from app.calibration.simulate import simulate_rig
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.severity.estimate import reach_of
from gearsig.severity.evidence import GearEvidence, gear_evidence, pair_lines
from gearsig.severity.machine import pair_facts
from gearsig.severity.tooth_root import percent_per_mm

SPEED_DIFFERENCE = 0.01
TORQUE_DIFFERENCE = 0.03
"""Largest ones between a recording and its reference: nobody meets a speed and a load exactly."""


@dataclass(frozen=True)
class Case:
    """A drawn rig with its two recordings; the reference is of the sound gears."""

    drawn: DrawnRig
    recording: Recording
    reference: Recording


@dataclass(frozen=True)
class Observed:
    """What a case shows.

    Parameters
    ----------
    drawn : DrawnRig
    gear : int
        0 or 1: which gear has the crack.
    percent : float
        Depth of the crack in percent of the root; 0: none.
    with_reference, alone, sound : arrays, (2, n_features)
        Of both gears: the recording against its reference, by itself, and the reference by itself.
    lag_pitches : float
        By how much the event, with a reference, follows the middle of the cracked tooth's engagement; nan where no
        mark tells.
    reach : mapping
        Quantities that limit the calibration.
    """

    drawn: DrawnRig
    gear: int
    percent: float
    with_reference: FloatArray
    alone: FloatArray
    sound: FloatArray
    lag_pitches: float
    reach: dict[str, float]


def draw_case(seed: int, index: int, *, for_the_check: bool, even: bool = False) -> Case | None:
    """Draw and simulate a case; None where the drawn gears cannot be made (undercut, a crack past the tooth)."""
    rng = np.random.default_rng([seed, index, int(for_the_check)])
    drawn = draw_rig(rng, for_the_check=for_the_check, even=even)
    speed = float(rng.uniform(1.0 - SPEED_DIFFERENCE, 1.0 + SPEED_DIFFERENCE))
    torque = float(rng.uniform(1.0 - TORQUE_DIFFERENCE, 1.0 + TORQUE_DIFFERENCE))
    try:
        return Case(
            drawn,
            simulate_rig(drawn),
            simulate_rig(drawn, severity=0.0, run=1, speed_factor=speed, torque_factor=torque),
        )
    except (InputError, RefusalError):
        return None


def observe(case: Case) -> Observed:
    """Return what a case shows, without any fitted model."""
    drawn, rig = case.drawn, case.recording.rig
    if rig is None:
        raise InputError("a simulated recording has no rig")
    facts = pair_facts(rig, None)
    channels = case.recording.vibration_names()
    now = pair_lines(case.recording, rig, facts.pair, channels)
    sound = pair_lines(case.reference, rig, facts.pair, channels)
    compared = gear_evidence(now, sound, facts.module_mm, facts.load_mpa)
    alone = gear_evidence(now, None, facts.module_mm, facts.load_mpa)
    good = gear_evidence(sound, None, facts.module_mm, facts.load_mpa)
    gear = ("driver", "driven").index(drawn.gear)
    return Observed(
        drawn=drawn,
        gear=gear,
        percent=drawn.depth_mm * percent_per_mm(drawn.teeth[gear], facts.module_mm),
        with_reference=np.stack([e.features for e in compared]),
        alone=np.stack([e.features for e in alone]),
        sound=np.stack([e.features for e in good]),
        lag_pitches=_lag(compared[gear], drawn.tooth),
        reach=reach_of(facts, now[0].order_hz * facts.driver_teeth),
    )


def _lag(evidence: GearEvidence, tooth: int) -> float:
    if not evidence.shaft.has_mark:
        return float("nan")
    z = evidence.shaft.teeth
    return (evidence.event.centre_rev * z - tooth - 0.5 + z / 2) % z - z / 2
