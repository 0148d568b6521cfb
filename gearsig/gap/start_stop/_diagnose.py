"""The gap between start–stop recordings and a simulated drive: where, which cause, how far it shrinks, what next.

Orders and sidebands mean nothing where the speed crosses zero. What a start–stop machine tells is in its equations:
play and deflection of the flanks, tooth by tooth and over the mesh cycle, under a torque that is measured; inertia and
friction of the load from torque against acceleration; ripple of the torque over the pinion's angle; impacts. They hold
whatever the valve and the brake do, so that a simulated drive need not repeat the very motion.

1. Those equations are fitted to the cycles of a recording, to a healthy recording's, or to a run of the simulated drive
   by the rig's drawing (its valve, brake and load friction read off the recording: nuisances).
2. Each cause is run in the simulated drive at some severities; between them runs a straight line. What it changes is
   compared with what changed, over the floor: what healthy drives of another make differ by (`floors.json`).
3. Severity and evidence come from all cycles; the shrink from every second cycle checked on the others and the other
   way round, against the same cause at wrong teeth and orders. Both go into probabilities calibrated on blind cases.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from gearsig.errors import GearsigError, RefusalError
from gearsig.gap._simulator import DriveSimulator, GapEffect
from gearsig.gap._types import GapReport
from gearsig.gap.start_stop._attribution import (
    attribute_drive,
    is_drive_calibrated,
    load_drive_calibration,
    load_floor,
)
from gearsig.gap.start_stop._comparison import (
    TRIED,
    DriveComparison,
    Predictions,
    evidence_of_drive,
    predict,
    simulated_drive,
)
from gearsig.gap.start_stop._features import PreparedCycles, cut_cycles
from gearsig.gap.start_stop._report import DriveDiagnosis, drive_report
from gearsig.motion import check_turns, find_roles, is_start_stop, measure_motion, motion_segments
from gearsig.recording import Recording
from gearsig.rig import Rig, contact_pair

Stage = Callable[[str, float], object]
UNCALIBRATED = "The probabilities are not calibrated yet: take them as a ranking only."
LIKE_CYCLES = (
    "Tooth and order count from the zero of the pinion's encoder, which must be the same in both recordings. In the "
    "figures of torque and teeth the healthy reference stands for the simulation before."
)
FEW = 4
"""Cycles below which a hold-out says little."""


def diagnose_start_stop(
    recordings: Sequence[Recording],
    rigs: Sequence[Rig],
    references: Sequence[Recording],
    reference_rigs: Sequence[Rig],
    simulator: DriveSimulator,
    effects: Mapping[str, GapEffect],
    names: Sequence[str],
    reference_names: Sequence[str],
    tell: Stage,
) -> GapReport:
    """Diagnose the gap between start–stop recordings of one machine and its simulated drive; see `diagnose_gap`.

    Parameters
    ----------
    recordings, references : sequence of Recording
        With the angles (or speeds) of pinion and wheel, better with the torque between motor and pinion. Each is
        compared with the reference at the nearest torque.
    rigs, reference_rigs : sequence of Rig
        With a [contact] table.
    simulator : DriveSimulator
    effects : mapping
        Those that may be named.
    names, reference_names : sequence of str
    tell : callable

    Raises
    ------
    RefusalError
        If a recording holds no start and stop, or no motion of both gears, or the rig no contact.
    """
    return drive_report(
        attributed_drive(recordings, rigs, references, reference_rigs, simulator, effects, names, reference_names, tell)
    )


def attributed_drive(
    recordings: Sequence[Recording],
    rigs: Sequence[Rig],
    references: Sequence[Recording],
    reference_rigs: Sequence[Rig],
    simulator: DriveSimulator,
    effects: Mapping[str, GapEffect],
    names: Sequence[str],
    reference_names: Sequence[str],
    tell: Stage,
) -> DriveDiagnosis:
    """Return all that the report is made of, see `diagnose_start_stop`."""
    tell("reading the motion", 0.02)
    healthy = [examined(*each) for each in zip(references, reference_rigs, strict=True)]
    compared = tuple(
        _compared(name, examined(recording, rig), healthy, simulator)
        for name, recording, rig in zip(names, recordings, rigs, strict=True)
    )
    predictions = []
    for i, each in enumerate(compared):
        begun, part = 0.1 + 0.7 * i / len(compared), 0.7 / len(compared)

        def simulating(name: str, done: float, begun: float = begun, part: float = part) -> None:
            tell(f"simulating {name.replace('_', ' ')}", begun + part * done)

        predictions.append(predictions_of(each, effects, simulating))
    tell("weighing", 0.85)
    seen = tuple(evidence_of_drive(a, b.causes) for a, b in zip(compared, predictions, strict=True))
    with_reference = bool(references)
    whole, half = (load_floor(with_reference=with_reference, part=part) for part in ("whole", "half"))
    weighed = attribute_drive(seen, (whole, half))
    calibration = load_drive_calibration(with_reference=with_reference)
    probabilities = calibration.probabilities(weighed.shares, weighed.scores)
    return DriveDiagnosis(
        rigs[0].name,
        simulator.name,
        effects,
        compared,
        seen,
        tuple(predictions),
        weighed,
        probabilities,
        calibration.outcome(probabilities),
        tuple(reference_names),
        tuple(_notices(compared, effects)),
    )


def examined(recording: Recording, rig: Rig | None = None) -> PreparedCycles:
    """Measure a recording's motion and cut it into cycles.

    Raises
    ------
    RefusalError
        If neither gear's motion was recorded: vibration alone.
    """
    known = rig or recording.rig
    if known is not None and known.pairs:
        roles = find_roles(recording, contact_pair(known)) if known.contact or len(known.pairs) == 1 else {}
        if not any(role.endswith((" angle", " speed")) for role in roles):
            raise RefusalError(
                f"{recording.provenance.source or 'the recording'} holds no angle or speed of pinion and wheel, and "
                "the model forging compares their starts and stops",
                remedy="compare vibration of stationary running with --model cracked; else name the channels' shafts "
                "in the rig file's [[sensor]] tables",
            )
    motion = measure_motion(recording, known)
    check_turns(motion)
    return PreparedCycles(cut_cycles(motion))


def compared_of(
    recording: Recording, reference: Recording | None, simulator: DriveSimulator, name: str = "recording"
) -> DriveComparison:
    """Set a recording beside its healthy reference, or beside the drive simulated by its rig."""
    return _compared(name, examined(recording), [] if reference is None else [examined(reference)], simulator)


def _compared(
    name: str, now: PreparedCycles, healthy: Sequence[PreparedCycles], simulator: DriveSimulator
) -> DriveComparison:
    features = now.features(now.every)
    nearest = min(healthy, key=lambda each: _apart(each, now), default=None)
    known = None if nearest is None else nearest.features(nearest.every)
    return DriveComparison(name, now, nearest, simulated_drive(simulator, now.cycles, features, known))


def _apart(one: PreparedCycles, other: PreparedCycles) -> float:
    """Return by how much the largest torques differ; where one has none, the top speeds rank recordings likewise."""
    a, b = (each.cycles.motion for each in (one, other))
    first, second = a.torque_nm, b.torque_nm
    if first is None or second is None:
        first, second = a.driver_speed_rad_s, b.driver_speed_rad_s
    return float(abs(abs(first).max() - abs(second).max()))


def predictions_of(
    compared: DriveComparison, effects: Mapping[str, GapEffect], tell: Stage = lambda *_: None
) -> Predictions:
    """Simulate every cause that the recording can tell."""
    order = int(compared.now.orders[compared.spot.order])
    return predict(
        compared.drive,
        compared.spot,
        order,
        {name: effects[name] for name in tellable(compared, effects)},
        tell,
        with_reference=compared.reference is not None,
    )


def tellable(compared: DriveComparison, effects: Mapping[str, GapEffect]) -> tuple[str, ...]:
    """Causes that the channels and the reference there are can tell."""
    has_torque = compared.now.cycles.motion.torque_nm is not None
    return tuple(
        name
        for name, tried in TRIED.items()
        if name in effects
        and (has_torque or tried.needs != "torque")
        and (compared.reference is not None or not tried.needs_reference)
    )


def _notices(compared: Sequence[DriveComparison], effects: Mapping[str, GapEffect]) -> list[str]:
    """Say what could not be told, and what was taken for granted."""
    found = [] if is_drive_calibrated() else [UNCALIBRATED]
    known = set.intersection(*(set(tellable(each, effects)) for each in compared))
    missing = [effects[name].title for name in TRIED if name in effects and name not in known]
    if missing:
        lacking = [each.name for each in compared if each.now.cycles.motion.torque_nm is None]
        why = "only a healthy reference tells what is ordinary"
        if lacking:
            why = f"no torque was recorded in {', '.join(lacking)}"
        found.append(f"Not weighed, as {why}: {', '.join(missing)}. Such a cause ends in none or unknown.")
    if compared[0].reference is not None:
        found.append(LIKE_CYCLES)
    for each in compared:
        if each.now.cycles.n_cycles < FEW:
            found.append(
                f"{each.name} has {each.now.cycles.n_cycles} starts: how far the gap shrinks rests on few cycles."
            )
        if not each.features.contact.play_um > 0.0:
            found.append(f"{each.name} loads one flank only: its play cannot be told; record a stop with the brake.")
    return found


# --------------------
# Which diagnosis a recording is for: starts and stops, or running that goes on.
# --------------------


MODEL = "forging"


def refuse_start_stop(recordings: Sequence[Recording], rigs: Sequence[Rig], names: Sequence[str], model: str) -> None:
    """Refuse recordings of starts and stops for a model of running that goes on.

    Raises
    ------
    RefusalError
        With the model that they are for.
    """
    for recording, rig, name in zip(recordings, rigs, names, strict=True):
        if is_start_stop_recording(recording, rig):
            raise RefusalError(
                f"{name} starts and stops: orders, which the model {model} is compared by, need a shaft that goes on "
                "turning",
                remedy=f"--model {MODEL}",
            )


def is_start_stop_recording(recording: Recording, rig: Rig) -> bool:
    """Whether a recording holds the motion of both gears of a machine that starts and stops."""
    if rig.contact is None:
        return False
    try:
        motion = measure_motion(recording, rig)
        return is_start_stop(motion_segments(motion.driver_angle_rad, motion.sampling_rate_hz))
    except GearsigError:
        return False
