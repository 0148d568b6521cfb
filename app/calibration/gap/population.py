"""Simulate the population of the gap diagnosis: `python -m app.calibration.gap.population --rigs N --to FILE`.

Each drawn gearbox is recorded sound as the reference, sound again on other days, with each effect, with foreign
vibration, and with each effect's signature by hand; what differs goes into the table, with its label.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from zlib import crc32

import numpy as np
import typer

from app.calibration.gap.machines import Day, another_day, draw_machine, first_day
from app.calibration.gap.ordinary import Ordinary, mounted_anew
from app.calibration.gap.outside import with_foreign_vibration
from app.calibration.gap.paths import draw_path_changes
from app.calibration.gap.signatures import HAND_MADE, with_signature
from app.calibration.gap.vibration import vibrations
from app.calibration.rigs import DrawnRig
from app.calibration.simulate import SAMPLING_RATE_HZ, simulate_rig, turns_before
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap.change import change_features
from gearsig.gap.features import features_of
from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.gap.simulator import Point
from gearsig.gap.tooth_load import LIGHT_LOAD_N_PER_MM, tooth_load_n_per_mm
from gearsig.gap.types import NONE, UNKNOWN
from gearsig.recording.types import Recording
from sims.cracked.twin import STEP_ANGLE_RAD, CrackedTwin
from sims.effects import EffectSetting, effects
from sims.gear_pair.usual import nominal_of

SEED = 4107
N_SOUND, N_MOUNTED_ANEW, N_FOREIGN, N_BY_HAND = 3, 6, 10, 4

ONE_SENSOR_SHARE = 0.4
"""Machines of which one sensor's signal is known."""

SIMULATED_SHARE = 0.5
"""Of the effects with a signature by hand that are simulated on a machine as well."""

AT_THE_END = ("clipping", "transfer_path")
"""Effects of what records: made by hand only, since what a machine's tolerances do comes before."""


@dataclass(frozen=True)
class Sample:
    """One recording, reduced.

    Parameters
    ----------
    rig : int
    label, detail : str
        Effect, "none" or "unknown"; options or the foreign vibration's name.
    severity : float
    torque_nm : float
    load_n_per_mm : float
        Of the teeth.
    change, change_scatter : arrays, (n_changes,)
        Against the sound reference.
    features, feature_scatter : arrays, (n_features,)
        Of the recording itself.
    simulated, simulated_scatter : arrays, (n_features,)
        Of the twin that knows the rig file only.
    """

    rig: int
    label: str
    detail: str
    severity: float
    torque_nm: float
    load_n_per_mm: float
    change: FloatArray
    change_scatter: FloatArray
    features: FloatArray
    feature_scatter: FloatArray
    simulated: FloatArray
    simulated_scatter: FloatArray


def main() -> None:
    """Simulate, reduce, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=120)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--to", type=Path, required=True)
    given = parser.parse_args()
    samples: list[Sample] = []
    names: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    with ProcessPoolExecutor(given.processes) as pool:
        for done, (found, found_names) in enumerate(
            pool.map(one_rig, range(given.first, given.first + given.rigs)), start=1
        ):
            samples += found
            names = found_names or names
            if names is not None and (done % 10 == 0 or done == given.rigs):
                write(given.to, samples, names)
            typer.echo(f"{done} of {given.rigs} gearboxes, {len(samples)} recordings")


def write(path: Path, samples: list[Sample], names: tuple[tuple[str, ...], tuple[str, ...]]) -> None:
    """Write the table as arrays of numbers and text."""
    rows = {
        key: np.array([getattr(s, key) for s in samples])
        for key in ("rig", "label", "detail", "severity", "torque_nm", "load_n_per_mm")
    }
    tables = {
        key: np.array([getattr(s, key) for s in samples], dtype=np.float32)
        for key in ("change", "change_scatter", "features", "feature_scatter", "simulated", "simulated_scatter")
    }
    part = path.with_suffix(".part.npz")
    np.savez_compressed(
        part,
        allow_pickle=False,
        change_names=np.array(names[0]),
        feature_names=np.array(names[1]),
        **rows,
        **tables,
    )
    part.replace(path)


def one_rig(index: int) -> tuple[list[Sample], tuple[tuple[str, ...], tuple[str, ...]] | None]:
    """Return the samples of one drawn gearbox, with the features' names; none where its teeth cannot be made."""
    rng = np.random.default_rng([SEED, index])
    drawn = draw_machine(rng)
    try:
        new = _record(first_day(drawn, rng), 0)
    except (InputError, RefusalError):
        return [], None
    ordinary = Ordinary.of(new, index)
    reference = ordinary.on(new, 0, rng)
    if reference.rig is None:
        raise InputError("a simulated recording has no rig")
    try:
        twin = CrackedTwin(reference.rig, nominal_of(reference.rig))
        sound, simulated = reduced(reference, index), reduced(_run(twin, drawn, index), index)
    except RefusalError:
        return [], None
    samples = []
    for label, detail, severity, recording, torque_nm in _recordings(drawn, twin, ordinary, index):
        try:
            samples.append(_sample(index, label, detail, severity, torque_nm, recording, (sound, simulated)))
        except (InputError, RefusalError) as error:
            typer.echo(f"gearbox {index}, {label}: {error}")
    names = change_features(sound, sound).names, features_of(simulated).names
    return samples, names


def _sample(
    rig: int,
    label: str,
    detail: str,
    severity: float,
    torque_nm: float,
    recording: Recording,
    others: tuple[Gathered, Gathered],
) -> Sample:
    now = reduced(recording, rig)
    change, own, twin = change_features(now, others[0]), features_of(now), features_of(others[1])
    return Sample(
        rig,
        label,
        detail,
        severity,
        torque_nm,
        tooth_load_n_per_mm(now.frame.pair, torque_nm),
        change.values,
        change.scatter,
        own.values,
        own.scatter,
        twin.values,
        twin.scatter,
    )


def reduced(recording: Recording, rig: int) -> Gathered:
    """Return a recording's sums, with the channels that are known of its machine."""
    if recording.rig is None:
        raise InputError("a simulated recording has no rig")
    found = gather(recording, recording.rig)
    draw = np.random.default_rng([SEED, rig, 1])
    if draw.uniform() >= ONE_SENSOR_SHARE:
        return found
    name = str(draw.choice(sorted(found.channels)))
    return found.with_channels({name: found.channels[name]})


def _run(twin: CrackedTwin, drawn: DrawnRig, index: int) -> Recording:
    point = Point(drawn.speed_rpm, drawn.torque_nm)
    return twin.run(point, seed=index, duration_s=drawn.duration_s, sampling_rate_hz=SAMPLING_RATE_HZ, noise=1)


def _recordings(
    drawn: DrawnRig, twin: CrackedTwin, ordinary: Ordinary, index: int
) -> Iterator[tuple[str, str, float, Recording, float]]:
    """Yield label, detail, severity, recording and torque of everything that is recorded of one gearbox.

    Each draws from a seed of its own: where one effect is drawn otherwise, the others stay as they are.
    """
    bare: list[Recording] = []
    sound: list[Recording] = []
    for run in range(1, N_SOUND + 1):
        rng = _chance(index, NONE, run)
        day = another_day(drawn, rng)
        bare.append(_record(day, run))
        sound.append(ordinary.on(bare[-1], turns_before(drawn, run), rng))
        yield NONE, "", 0.0, sound[-1], drawn.torque_nm * day.torque_factor
    for i in range(N_MOUNTED_ANEW):
        recording = mounted_anew(sound[i % N_SOUND], _chance(index, "mounted anew", i))
        yield NONE, "mounted anew", 0.0, recording, drawn.torque_nm
    for i in range(N_FOREIGN):
        recording, name = with_foreign_vibration(sound[i % N_SOUND], _chance(index, UNKNOWN, i))
        yield UNKNOWN, name, 0.0, recording, drawn.torque_nm
    for name in made_by_hand(sound[0], drawn.torque_nm):
        for i in range(N_BY_HAND):
            recording, strength = with_signature(sound[i % N_SOUND], name, _chance(index, f"{name} by hand", i))
            yield name, "by hand", strength, recording, drawn.torque_nm
    for i in range(N_BY_HAND):
        turns, rng = turns_before(drawn, i % N_SOUND + 1), _chance(index, "transfer_path by hand", i)
        recording, strength = _with_changed_path(ordinary, bare[i % N_SOUND], turns, rng)
        yield "transfer_path", "by hand", strength, recording, drawn.torque_nm
    for run, name in enumerate((e for e in effects() if e not in AT_THE_END), start=N_SOUND + 1):
        rng = _chance(index, name, run)
        if name in HAND_MADE and rng.uniform() > SIMULATED_SHARE:
            continue
        day = another_day(drawn, rng)
        try:
            added = twin.draw(name, rng)
            setting = EffectSetting(name, added.severity, dict(added.options))
            recording = ordinary.on(_record(day, run, setting), turns_before(drawn, run), rng)
        except (InputError, RefusalError) as error:
            typer.echo(f"{name}: {error}")
            continue
        detail = ", ".join(f"{k}={v}" for k, v in setting.options.items())
        yield name, detail, setting.severity, recording, drawn.torque_nm * day.torque_factor


def _chance(index: int, name: str, i: int) -> np.random.Generator:
    return np.random.default_rng([SEED, index, crc32(name.encode()), i])


def _with_changed_path(
    ordinary: Ordinary, bare: Recording, turns: int, rng: np.random.Generator
) -> tuple[Recording, float]:
    """Return a recording that came through other paths, and how much other, 0 to 1."""
    strength = float(rng.uniform())
    size = 10.0 ** (0.8 * (strength - 1.0))
    paths = draw_path_changes(len(vibrations(bare)), size, bare.sampling_rate_hz, rng)
    return ordinary.on(bare, turns, rng, paths), strength


def made_by_hand(sound: Recording, torque_nm: float) -> tuple[str, ...]:
    """Return whose signatures are put into a machine's sound recordings: no backlash where teeth never part."""
    if sound.rig is None:
        raise InputError("a simulated recording has no rig")
    light = tooth_load_n_per_mm(sound.rig.pairs[0], torque_nm) < LIGHT_LOAD_N_PER_MM
    return tuple(name for name in HAND_MADE if light or name != "backlash")


def _record(day: Day, run: int, setting: EffectSetting | None = None) -> Recording:
    recording = simulate_rig(
        day.drawn,
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


if __name__ == "__main__":
    main()
