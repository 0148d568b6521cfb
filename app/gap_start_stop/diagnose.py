"""The gap between start–stop recordings and the simulated drive: where, which cause, how far it shrinks, what next.

Orders and sidebands mean nothing where the speed crosses zero. What a start–stop machine tells is in its equations:
play and deflection of the flanks, tooth by tooth and over the mesh cycle, under a torque that is measured; inertia and
friction of the load from torque against acceleration; ripple of the torque over the pinion's angle; impacts. They hold
whatever the valve and the brake do, so that a simulated drive need not repeat the very motion.

1. `gearsig.gap` fits those equations to the cycles of a recording, to a sound recording's, or to a
   run of `sims.forging` by the rig's drawing (its valve, brake and load friction read off the recording: nuisances).
2. Each cause is run in the simulated drive at some severities; between them runs a straight line. What it changes is
   compared with what changed, over the floor: what sound drives of another make differ by (`floors.json`).
3. Severity and evidence come from all cycles; the shrink from every second cycle checked on the others and the other
   way round, against the same cause at wrong teeth and orders. Both go into probabilities calibrated on blind cases.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.gap_start_stop.predict import TRIED, DriveComparison, Predictions, drive_effects, predict, seen_of, weigh
from app.gap_start_stop.report import Diagnosis, report_of
from app.gap_start_stop.twin import drive_twin
from gearsig.errors import GearsigError, InputError, RefusalError
from gearsig.gap import GapReport, PreparedCycles, cut_cycles, is_drive_calibrated, load_drive_calibration, load_floor
from gearsig.motion import check_turns, find_roles, measure_motion
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
    *,
    rigs: Sequence[Rig],
    references: Sequence[Recording] = (),
    reference_rigs: Sequence[Rig] = (),
    names: Sequence[str] = (),
    reference_names: Sequence[str] = (),
    on_stage: Stage | None = None,
) -> GapReport:
    """Diagnose the gap between start–stop recordings of one machine and the simulated forging drive.

    Parameters
    ----------
    recordings : sequence of Recording
        With the angles (or speeds) of pinion and wheel, better with the torque between motor and pinion.
    rigs : sequence of Rig
        One per recording, with a [contact] table.
    references : sequence of Recording
        Of the same machine when it was sound; each recording is compared with the one at the nearest torque.
    reference_rigs : sequence of Rig
    names, reference_names : sequence of str
    on_stage : callable or None
        Is told what is being done, and which share of the whole is complete.

    Raises
    ------
    InputError
        If there is no recording, or no rig for one.
    RefusalError
        If a recording holds no start and stop, or no motion of both gears, or the rig no contact.
    """
    tell = on_stage or (lambda _what, _done: None)
    if not recordings or len(rigs) != len(recordings) or len(reference_rigs) != len(references):
        raise InputError(f"{len(rigs)} rigs for {len(recordings)} recordings", allowed="one each, at least one")
    called = tuple(names) or tuple(f"recording {i + 1}" for i in range(len(recordings)))
    tell("reading the motion", 0.02)
    sound = [examined(*one) for one in zip(references, reference_rigs, strict=True)]
    compared = tuple(
        _compared(name, examined(recording, rig), sound)
        for name, recording, rig in zip(called, recordings, rigs, strict=True)
    )
    predictions = []
    for i, one in enumerate(compared):
        begun, part = 0.1 + 0.7 * i / len(compared), 0.7 / len(compared)

        def simulating(name: str, done: float, begun: float = begun, part: float = part) -> None:
            tell(f"simulating {name.replace('_', ' ')}", begun + part * done)

        predictions.append(predictions_of(one, simulating))
    tell("weighing", 0.85)
    seen = tuple(seen_of(one, found.causes) for one, found in zip(compared, predictions, strict=True))
    with_reference = bool(references)
    whole, half = (load_floor(with_reference=with_reference, part=part) for part in ("whole", "half"))
    weighed = weigh(seen, (whole, half))
    calibration = load_drive_calibration(with_reference=with_reference)
    probabilities = calibration.probabilities(weighed.shares, weighed.scores)
    return report_of(
        Diagnosis(
            rigs[0].name,
            compared,
            seen,
            tuple(predictions),
            weighed,
            probabilities,
            calibration.outcome(probabilities),
            (tuple(reference_names) or tuple(f"reference {i + 1}" for i in range(len(references))))
            if references
            else (),
            tuple(_notices(compared)),
        )
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


def compared_of(recording: Recording, reference: Recording | None, name: str) -> DriveComparison:
    """Set a recording beside its sound reference, or beside the drive simulated by its rig."""
    return _compared(name, examined(recording), [] if reference is None else [examined(reference)])


def _compared(name: str, now: PreparedCycles, sound: Sequence[PreparedCycles]) -> DriveComparison:
    told = now.tell(now.every)
    if not sound:
        return DriveComparison(name, now, None, drive_twin(now.cycles, told, None))
    nearest = min(sound, key=lambda one: _apart(one, now))
    return DriveComparison(name, now, nearest, drive_twin(now.cycles, told, nearest.tell(nearest.every)))


def _apart(one: PreparedCycles, other: PreparedCycles) -> float:
    """Return by how much the largest torques differ; where one has none, the top speeds rank recordings likewise."""
    a, b = (each.cycles.motion for each in (one, other))
    first, second = a.torque_nm, b.torque_nm
    if first is None or second is None:
        first, second = a.driver_speed_rad_s, b.driver_speed_rad_s
    return float(abs(abs(first).max() - abs(second).max()))


def predictions_of(compared: DriveComparison, tell: Callable[[str, float], object] = lambda *_: None) -> Predictions:
    """Simulate every cause that the recording can tell."""
    order = int(compared.now.orders[compared.spot.order])
    return predict(
        compared.twin,
        compared.spot,
        order,
        tellable(compared),
        tell,
        with_reference=compared.reference is not None,
    )


def tellable(compared: DriveComparison) -> tuple[str, ...]:
    """Causes that the channels and the reference there are can tell."""
    has_torque = compared.now.cycles.motion.torque_nm is not None
    return tuple(
        name
        for name, tried in TRIED.items()
        if (has_torque or tried.needs != "torque") and (compared.reference is not None or not tried.needs_reference)
    )


def _notices(compared: Sequence[DriveComparison]) -> list[str]:
    """Say what could not be told, and what was taken for granted."""
    found = [] if is_drive_calibrated() else [UNCALIBRATED]
    known, effects = set.intersection(*(set(tellable(one)) for one in compared)), drive_effects()
    missing = [effects[name].title for name in TRIED if name not in known]
    if missing:
        lacking = [one.name for one in compared if one.now.cycles.motion.torque_nm is None]
        why = "only a healthy reference tells what is ordinary"
        if lacking:
            why = f"no torque was recorded in {', '.join(lacking)}"
        found.append(f"Not weighed, as {why}: {', '.join(missing)}. Such a cause ends in none or unknown.")
    if compared[0].reference is not None:
        found.append(LIKE_CYCLES)
    for one in compared:
        if one.now.cycles.n_cycles < FEW:
            found.append(
                f"{one.name} has {one.now.cycles.n_cycles} starts: how far the gap shrinks rests on few cycles."
            )
        if not one.told.contact.play_um > 0.0:
            found.append(f"{one.name} loads one flank only: its play cannot be told; record a stop with the brake.")
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
    from gearsig.motion import is_start_stop, measure_motion, motion_segments

    if rig.contact is None:
        return False
    try:
        motion = measure_motion(recording, rig)
        return is_start_stop(motion_segments(motion.driver_angle_rad, motion.sampling_rate_hz))
    except GearsigError:
        return False
