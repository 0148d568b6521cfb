"""Drawn gearboxes for the population of the gap diagnosis: healthy, with effects, with signatures by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from zlib import crc32

import numpy as np
import typer

from app.studies.drawn_rigs import SAMPLING_RATE_HZ, DrawnRig, simulate_rig, turns_before
from app.studies.gap.by_hand import made_by_hand, rig_of, vibrations, with_foreign_vibration, with_signature
from app.studies.gap.machines import OperatingDay, Ordinary, another_day, draw_machine, first_day, mounted_anew
from gearsig.cache import write_whole
from gearsig.errors import InputError, RefusalError
from gearsig.gap import (
    BY_HAND,
    INDEPENDENT,
    NONE,
    UNKNOWN,
    Features,
    OperatingCondition,
    ReducedRecording,
    change_features,
    features_of,
    reduce_recording,
    run_length_s,
    tooth_load_n_per_mm,
    with_channels_of,
)
from gearsig.recording import Recording
from sims.blind import CATALOGUE, draw_case, record_case
from sims.cracked import STEP_ANGLE_RAD, CrackedTwin
from sims.effects import EffectSetting, effects, largest_runout_um, textbook
from sims.machine import nominal_of

# --------------------
# One recording of the population, reduced and compared, and how all of them are written.
# --------------------


SEED = 4107

ONE_SENSOR_SHARE = 0.4
"""Machines of which one sensor's signal is known."""

Recorded = tuple[str, str, float, Recording, float]
"""Label, detail, severity, recording and torque."""
Made = tuple[Recording, ReducedRecording, Iterable[Recorded]]


@dataclass(frozen=True)
class PopulationSample:
    """One recording, reduced.

    Parameters
    ----------
    simulator : str
        Of the machine.
    rig : int
    label, detail : str
        Effect, "none" or "unknown"; `BY_HAND`, options, or the foreign vibration's name.
    severity, torque_nm : float
    load_n_per_mm : float
        Of the teeth.
    change, features, simulated : Features
        Against the healthy reference; of the recording itself; of the twin that knows the rig file only.
    """

    simulator: str
    rig: int
    label: str
    detail: str
    severity: float
    torque_nm: float
    load_n_per_mm: float
    change: Features
    features: Features
    simulated: Features


def samples_of(simulator: str, rig: int, made: Callable[[], Made]) -> list[PopulationSample]:
    """Return what the recordings of a simulator's machine show; what cannot be made or reduced is told and left out.

    Parameters
    ----------
    simulator : str
    rig : int
    made : callable
        Makes the healthy reference, the reduced run of the twin that knows the rig file only, and all recordings.
    """
    samples: list[PopulationSample] = []
    try:
        reference, run, recordings = made()
        healthy, twin = reduced(reference, rig), _alone(features_of(run))
    except (InputError, RefusalError) as error:
        typer.echo(f"machine {rig}: {error}")
        return samples
    for label, detail, severity, recording, torque_nm in recordings:
        try:
            now = reduced(recording, rig)
            load = tooth_load_n_per_mm(now.frame.pair, torque_nm)
            shown = _alone(change_features(now, healthy)), _alone(features_of(now)), twin
        except (InputError, RefusalError) as error:
            typer.echo(f"machine {rig}, {label}: {error}")
            continue
        samples.append(PopulationSample(simulator, rig, label, detail, severity, torque_nm, load, *shown))
    return samples


def _alone(features: Features) -> Features:
    return replace(features, left_out=())


def reduced(recording: Recording, rig: int) -> ReducedRecording:
    """Return a recording's sums, with the channels that are known of its machine."""
    reduced_recording = reduce_recording(recording, rig_of(recording))
    draw = np.random.default_rng([SEED, rig, 1])
    if draw.uniform() >= ONE_SENSOR_SHARE:
        return reduced_recording
    name = str(draw.choice(sorted(reduced_recording.channels)))
    return reduced_recording.of_channels([name])


def put_in_by_hand(
    healthy: Sequence[Recording], n_foreign: int, n_by_hand: int, torque_nm: float, rng: np.random.Generator
) -> Iterator[Recorded]:
    """Yield healthy recordings, in turn, with foreign vibration, then with as many effects' signatures, each once."""
    for i in range(n_foreign):
        recording, foreign = with_foreign_vibration(healthy[i % len(healthy)], rng)
        yield UNKNOWN, foreign, 0.0, recording, torque_nm
    names = rng.choice(made_by_hand(healthy[0], torque_nm), n_by_hand, replace=False)
    for i, name in enumerate(map(str, names)):
        yield name, BY_HAND, 0.0, with_signature(healthy[i % len(healthy)], name, rng)[0], torque_nm


def write(path: Path, samples: Sequence[PopulationSample]) -> None:
    """Write the table as arrays of numbers and text."""
    columns = ("simulator", "rig", "label", "detail", "severity", "torque_nm", "load_n_per_mm")
    rows = {key: np.array([getattr(s, key) for s in samples]) for key in columns}
    for name, stem in (("change", "change"), ("features", "feature"), ("simulated", "simulated")):
        figures = [getattr(s, name) for s in samples]
        rows[name] = np.array([f.values for f in figures], dtype=np.float32)
        rows[f"{stem}_scatter"] = np.array([f.scatter for f in figures], dtype=np.float32)
    names = {"change_names": np.array(samples[0].change.names), "feature_names": np.array(samples[0].features.names)}
    write_whole(path, lambda file: np.savez_compressed(file, allow_pickle=False, **names, **rows))


AT_THE_END = ("clipping", "transfer_path")
"""Effects of what records: made by hand only, since what a machine's tolerances do comes before."""


@dataclass(frozen=True)
class PopulationModel:
    """A simulator's part of the population.

    Parameters
    ----------
    name : str
    first_rig : int
        Number of its first gearbox.
    n_mounted_anew, n_foreign, n_by_hand : int
        Recordings of each gearbox: healthy with sensors mounted anew, with foreign vibration, of each signature.
    simulated : tuple of float
        Of each recording with a simulated effect the share of the range of severities, see `PairTwin.draw`, that is
        left out: what hardly shows tells nothing, and beside what is usual most does not.
    """

    name: str
    first_rig: int
    n_mounted_anew: int
    n_foreign: int
    n_by_hand: int
    simulated: tuple[float, ...]


CRACKED = PopulationModel("cracked", 0, 4, 7, 3, (0.3, 0.6))
REDUCED = PopulationModel("reduced-fe", 50_000, 3, 4, 1, (0.3, 0.6))
PLAY_SHARE = 0.5
"""That a run-out may take away: others, and pitch errors, need some as well."""
N_HEALTHY = 3
N_PATHS = 2
"""Changed paths for each signature: nothing else shows them."""


def one_rig(model: PopulationModel, index: int) -> list[PopulationSample]:
    """Return the samples of one drawn gearbox; none where its teeth cannot be made."""
    rig = model.first_rig + index

    def made() -> Made:
        rng = np.random.default_rng([SEED, rig])
        drawn = draw_machine(rng)
        new = _record(model, first_day(drawn, rng), 0)
        ordinary = Ordinary.of(new, rig)
        reference = ordinary.on(new, 0, rng)
        known = rig_of(reference)
        twin = CrackedTwin(known, nominal_of(known))
        point = OperatingCondition(drawn.speed_rpm, drawn.torque_nm)
        run = twin.run(point, seed=rig, duration_s=drawn.duration_s, sampling_rate_hz=SAMPLING_RATE_HZ, noise=1)
        return reference, reduced(run, rig), _recordings(model, drawn, twin, ordinary, rig)

    return samples_of(model.name, rig, made)


def _recordings(
    model: PopulationModel, drawn: DrawnRig, twin: CrackedTwin, ordinary: Ordinary, rig: int
) -> Iterator[Recorded]:
    """Yield everything that is recorded of one gearbox.

    Each draws from a seed of its own: where one effect is drawn otherwise, the others stay as they are.
    """
    bare: list[Recording] = []
    healthy: list[Recording] = []
    for run in range(1, N_HEALTHY + 1):
        rng = _chance(rig, NONE, run)
        day = another_day(drawn, rng)
        bare.append(_record(model, day, run))
        healthy.append(ordinary.on(bare[-1], turns_before(drawn, run), rng))
        yield NONE, "", 0.0, healthy[-1], drawn.torque_nm * day.torque_factor
    for i in range(model.n_mounted_anew):
        recording = mounted_anew(healthy[i % N_HEALTHY], _chance(rig, "mounted anew", i))
        yield NONE, "mounted anew", 0.0, recording, drawn.torque_nm
    for i in range(model.n_foreign):
        recording, name = with_foreign_vibration(healthy[i % N_HEALTHY], _chance(rig, UNKNOWN, i))
        yield UNKNOWN, name, 0.0, recording, drawn.torque_nm
    for name in made_by_hand(healthy[0], drawn.torque_nm):
        for i in range(model.n_by_hand):
            recording, strength = with_signature(healthy[i % N_HEALTHY], name, _chance(rig, f"{name} {BY_HAND}", i))
            yield name, BY_HAND, strength, recording, drawn.torque_nm
    for i in range(N_PATHS * model.n_by_hand):
        turns, rng = turns_before(drawn, i % N_HEALTHY + 1), _chance(rig, f"transfer_path {BY_HAND}", i)
        healthy_now, strength = bare[i % N_HEALTHY], float(rng.uniform())
        size, rate_hz = textbook.path_size(strength), healthy_now.sampling_rate_hz
        paths = textbook.draw_path_changes(len(vibrations(healthy_now)), size, rate_hz, rng)
        yield "transfer_path", BY_HAND, strength, ordinary.on(healthy_now, turns, rng, paths), drawn.torque_nm
    names = [e for e in effects() if e not in AT_THE_END]
    for run, (above, name) in enumerate(((a, e) for a in model.simulated for e in names), start=N_HEALTHY + 1):
        rng = _chance(rig, name, run)
        day = another_day(drawn, rng)
        try:
            added = twin.draw(name, rng, above=above)
            setting = EffectSetting(name, _turning(name, added.severity, drawn, twin), dict(added.options))
            recording = ordinary.on(_record(model, day, run, setting), turns_before(drawn, run), rng)
        except (InputError, RefusalError) as error:
            typer.echo(f"{name}: {error}")
            continue
        detail = ", ".join(f"{k}={v}" for k, v in setting.options.items())
        yield name, detail, setting.severity, recording, drawn.torque_nm * day.torque_factor


def _turning(name: str, severity: float, drawn: DrawnRig, twin: CrackedTwin) -> float:
    """Return a severity with which this machine, whose play the twin does not know, turns freely at any load."""
    if name != "eccentricity":
        return severity
    play_um = 2.0 * float(drawn.parameters["half_backlash_um"])
    return min(severity, largest_runout_um(play_um, twin.nominal.pressure_angle_deg, PLAY_SHARE))


def _chance(rig: int, name: str, i: int) -> np.random.Generator:
    return np.random.default_rng([SEED, rig, crc32(name.encode()), i])


def _record(model: PopulationModel, day: OperatingDay, run: int, setting: EffectSetting | None = None) -> Recording:
    recording = simulate_rig(
        day.drawn,
        model=model.name,
        severity=0.0,
        run=run,
        speed_factor=day.speed_factor,
        torque_factor=day.torque_factor,
        further=[day.wander, *([setting] if setting is not None else [])],
        step_angle_rad=STEP_ANGLE_RAD,
    )
    gains = iter(day.gains)
    factors = np.array([next(gains) if c.is_vibration else 1.0 for c in recording.channels])
    return replace(recording, samples=recording.samples * factors[:, None])


# --------------------
# Cases of the independent rig's development gears for the population of the gap diagnosis.
#
# How an effect looks differs from simulator to simulator: what is learned from several holds better for one that none
# of them is. Gears of the calibration and evaluation cases are not among these, nor is what the independent rig has
# outside the catalogue: what nothing explains must be told by being like nothing.
# --------------------


FIRST_RIG, MAX_CONDITIONS = 100_000, 2
MIN_LEVEL = 0.25
"""0 (barely noticeable) to 1 (strong)."""
ROUND = (*CATALOGUE, NONE)
N_BY_HAND = 2


def one_case(index: int) -> list[PopulationSample]:
    """Return the samples of one case: its effect, the same without it, and a few made by hand of the latter."""
    rng = np.random.default_rng([SEED, 2, index])
    cause = ROUND[index % len(ROUND)]
    case = draw_case(
        rng,
        "development",
        kind=NONE if cause == NONE else "single",
        effect=None if cause == NONE else cause,
        level=None if cause == NONE else float(rng.uniform(MIN_LEVEL, 1.0)),
        with_reference=True,
    )
    recorded = record_case(case)
    severity = case.faults[0].severity if case.faults else 0.0
    samples: list[PopulationSample] = []
    for i, now in enumerate(recorded.conditions):
        rig, healthy = FIRST_RIG + MAX_CONDITIONS * index + i, (recorded.twins or recorded.conditions)[i]
        three = now, healthy, recorded.references[i]
        made = partial(_condition, rig, cause, severity, case.conditions[i].stated_nm, three, rng)
        samples += samples_of(INDEPENDENT, rig, made)
    return samples


def _condition(
    rig: int,
    cause: str,
    severity: float,
    torque_nm: float,
    recordings: tuple[Recording, Recording, Recording],
    rng: np.random.Generator,
) -> Made:
    """Return what one condition is compared with, the twin at its speed and stated torque, and what is compared."""
    now, healthy, reference = recordings

    def compared() -> Iterator[Recorded]:
        yield NONE, "", 0.0, healthy, torque_nm
        if cause != NONE:
            yield cause, "", severity, now, torque_nm
        for name, detail, _, recording, torque in put_in_by_hand([healthy], 1, N_BY_HAND, torque_nm, rng):
            yield name, detail, severity if name == cause else 0.0, recording, torque

    return reference, reduced_twin(now, rig, torque_nm), compared()


def reduced_twin(recording: Recording, rig: int, torque_nm: float) -> ReducedRecording:
    """Return the run of the twin at a recording's speed and the stated torque, reduced, under its channels' names."""
    reduced_recording, known = reduced(recording, rig), rig_of(recording)
    simulated = CrackedTwin(known, nominal_of(known)).run(
        OperatingCondition(60.0 * reduced_recording.speed_hz, torque_nm),
        seed=rig,
        duration_s=run_length_s(reduced_recording),
        sampling_rate_hz=recording.sampling_rate_hz,
        noise=1,
    )
    return with_channels_of(reduce_recording(simulated, known), reduced_recording)
