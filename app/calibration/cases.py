"""One case of the calibration: a drawn rig, its recording and its reference, and what they show of either gear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.calibration.rigs import DrawnRig, draw_rig
from app.calibration.simulate import simulate_rig
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.severity.calibration import ALONE, WITH_REFERENCE
from gearsig.severity.estimate import reach_of
from gearsig.severity.evidence import GearEvidence, gear_evidence, pair_lines
from gearsig.severity.kind import CHIPPED, CRACKED, SPALLED
from gearsig.severity.machine import pair_facts
from gearsig.severity.reference import LARGEST_SPEED_DIFFERENCE
from gearsig.severity.same_machine import LARGEST_TORQUE_CHANGE
from gearsig.severity.shaft_lines import ShaftLines
from gearsig.severity.tooth_root import percent_per_mm

SPEED_DIFFERENCE = LARGEST_SPEED_DIFFERENCE
TORQUE_DIFFERENCE = LARGEST_TORQUE_CHANGE
"""Between a recording and its reference, relative: as far as the estimator takes them."""

OTHER_FLANKS_SHARE = 0.15
"""Sound machines whose flanks are others than in the reference: run in, or ground again."""

RELIEF_ERROR = 0.2
"""Largest one of the tip relief that the estimator is told, relative: tips are never ground as they were drawn."""

CHIP_HEIGHT_MODULES = (0.25, 1.5)
SPALL_WIDTH_PERCENT, SPALL_LENGTH_MODULES = (20.0, 90.0), (0.3, 1.2)


@dataclass(frozen=True)
class Case:
    """A drawn rig with its recording, a reference of the sound gears, and the sound gears once more."""

    drawn: DrawnRig
    recording: Recording
    reference: Recording
    sound: Recording


@dataclass(frozen=True)
class OtherFault:
    """A chip or spall on the tooth that has the crack otherwise, as its size was drawn.

    Parameters
    ----------
    kind : str
        "chipped" or "spalled".
    recording : Recording
    """

    kind: str
    recording: Recording


@dataclass(frozen=True)
class Looks:
    """What one gear shows: its features, and its event's shape; arrays, (n_features,) and (n_shape,)."""

    features: FloatArray
    shape: FloatArray


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
    with_reference, alone, sound, sound_with_reference : arrays, (2, n_features)
        Of both gears: the recording against its reference, by itself, the reference by itself, and the sound gears once
        more against the reference.
    looks : mapping
        (kind, "with_reference" or "alone") → Looks of the cracked gear, and of the gear with the other fault.
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
    sound_with_reference: FloatArray
    looks: dict[tuple[str, str], Looks]
    lag_pitches: float
    reach: dict[str, float]


def draw_case(seed: int, index: int, *, for_the_check: bool, even: bool = False) -> Case | None:
    """Draw and simulate a case; None where the drawn gears cannot be made (undercut, a crack past the tooth)."""
    rng = np.random.default_rng([seed, index, int(for_the_check)])
    drawn = draw_rig(rng, for_the_check=for_the_check, even=even)
    speed = float(rng.uniform(1.0 - SPEED_DIFFERENCE, 1.0 + SPEED_DIFFERENCE))
    torque = float(rng.uniform(1.0 - TORQUE_DIFFERENCE, 1.0 + TORQUE_DIFFERENCE))
    flanks = 1 if rng.uniform() < OTHER_FLANKS_SHARE else 0
    try:
        return Case(
            drawn,
            simulate_rig(drawn),
            simulate_rig(drawn, severity=0.0, run=1, speed_factor=speed, torque_factor=torque),
            simulate_rig(drawn, severity=0.0, run=2, flanks=flanks),
        )
    except (InputError, RefusalError):
        return None


def draw_other_fault(drawn: DrawnRig, rng: np.random.Generator) -> OtherFault | None:
    """Draw and simulate a chip or a spall instead of the crack; None where the gears do not allow its size."""
    module = float(drawn.parameters["module_mm"])
    if rng.uniform() < 0.5:
        kind, effect = CHIPPED, "chipped_tooth"
        severity = module * float(np.exp(rng.uniform(*np.log(CHIP_HEIGHT_MODULES))))
        options = {"width_percent": 100.0 if rng.uniform() < 0.4 else float(rng.uniform(30.0, 90.0))}
    else:
        kind, effect = SPALLED, "tooth_spall"
        severity = float(rng.uniform(*SPALL_WIDTH_PERCENT))
        options = {"length_mm": module * float(rng.uniform(*SPALL_LENGTH_MODULES)), "depth_um": 100.0}
    try:
        return OtherFault(kind, simulate_rig(drawn, effect=effect, severity=severity, options=options))
    except (InputError, RefusalError):
        return None


def observe(case: Case, other: OtherFault | None = None, relief_error: float = 0.0) -> Observed:
    """Return what a case shows, without any fitted model.

    Parameters
    ----------
    case : Case
    other : OtherFault or None
    relief_error : float
        Of the tip relief that the estimator is told, relative.
    """
    drawn, rig = case.drawn, case.recording.rig
    if rig is None:
        raise InputError("a simulated recording has no rig")
    facts = pair_facts(rig, None)
    relief_um = float(drawn.parameters["tip_relief_um"]) * (1.0 + relief_error)

    def lines(recording: Recording) -> tuple[ShaftLines, ...]:
        return pair_lines(recording, rig, facts.pair, case.recording.vibration_names())

    def seen(a: tuple[ShaftLines, ...], b: tuple[ShaftLines, ...] | None) -> tuple[GearEvidence, ...]:
        return gear_evidence(a, b, facts.module_mm, facts.load_mpa, relief_um)

    now, sound = lines(case.recording), lines(case.reference)
    compared, alone, good = seen(now, sound), seen(now, None), seen(sound, None)
    gear = ("driver", "driven").index(drawn.gear)
    looks = {(CRACKED, WITH_REFERENCE): _looks(compared[gear]), (CRACKED, ALONE): _looks(alone[gear])}
    if other is not None:
        damaged = lines(other.recording)
        looks[other.kind, WITH_REFERENCE] = _looks(seen(damaged, sound)[gear])
        looks[other.kind, ALONE] = _looks(seen(damaged, None)[gear])
    return Observed(
        drawn=drawn,
        gear=gear,
        percent=drawn.depth_mm * percent_per_mm(drawn.teeth[gear], facts.module_mm),
        with_reference=np.stack([e.features for e in compared]),
        alone=np.stack([e.features for e in alone]),
        sound=np.stack([e.features for e in good]),
        sound_with_reference=np.stack([e.features for e in seen(lines(case.sound), sound)]),
        looks=looks,
        lag_pitches=_lag(compared[gear], drawn.tooth),
        reach=reach_of(facts, now[0].order_hz * facts.driver_teeth),
    )


def _looks(evidence: GearEvidence) -> Looks:
    return Looks(evidence.features, evidence.shape)


def _lag(evidence: GearEvidence, tooth: int) -> float:
    if not evidence.shaft.has_mark:
        return float("nan")
    z = evidence.shaft.teeth
    return (evidence.event.centre_rev * z - tooth - 0.5 + z / 2) % z - z / 2
