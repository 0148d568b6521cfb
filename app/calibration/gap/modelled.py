"""Drawn gearboxes of a model for the population of the gap diagnosis: sound, with effects, with signatures by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np
import typer

from app.calibration.gap.machines import Day, another_day, draw_machine, first_day
from app.calibration.gap.ordinary import Ordinary, mounted_anew
from app.calibration.gap.outside import with_foreign_vibration
from app.calibration.gap.paths import draw_path_changes, size_of
from app.calibration.gap.sample import SEED, Compared, Sample, reduced
from app.calibration.gap.scene import rig_of
from app.calibration.gap.signatures import made_by_hand, with_signature
from app.calibration.gap.vibration import vibrations
from app.calibration.rigs import DrawnRig
from app.calibration.simulate import SAMPLING_RATE_HZ, simulate_rig, turns_before
from gearsig.errors import InputError, RefusalError
from gearsig.gap.population import BY_HAND
from gearsig.gap.simulator import Point
from gearsig.gap.types import NONE, UNKNOWN
from gearsig.recording.types import Recording
from sims.cracked.twin import STEP_ANGLE_RAD, CrackedTwin
from sims.effects import EffectSetting, effects
from sims.gear_pair.usual import nominal_of

AT_THE_END = ("clipping", "transfer_path")
"""Effects of what records: made by hand only, since what a machine's tolerances do comes before."""


@dataclass(frozen=True)
class Model:
    """A simulator's part of the population.

    Parameters
    ----------
    name : str
    first_rig : int
        Number of its first gearbox.
    n_mounted_anew, n_foreign, n_by_hand : int
        Recordings of each gearbox: sound with sensors mounted anew, with foreign vibration, of each signature.
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


CRACKED = Model("cracked", 0, 4, 7, 3, (0.3, 0.6))
REDUCED = Model("reduced-fe", 50_000, 3, 4, 1, (0.3, 0.6))
N_SOUND = 3
N_PATHS = 2
"""Changed paths for each signature: nothing else shows them."""


def one_rig(model: Model, index: int) -> list[Sample]:
    """Return the samples of one drawn gearbox; none where its teeth cannot be made."""
    rig = model.first_rig + index
    rng = np.random.default_rng([SEED, rig])
    drawn = draw_machine(rng)
    try:
        new = _record(model, first_day(drawn, rng), 0)
        ordinary = Ordinary.of(new, rig)
        reference = ordinary.on(new, 0, rng)
        rig_file = rig_of(reference)
        twin = CrackedTwin(rig_file, nominal_of(rig_file))
        compared = Compared(model.name, rig, reduced(reference, rig), reduced(_run(twin, drawn, rig), rig))
    except (InputError, RefusalError) as error:
        typer.echo(f"gearbox {rig}: {error}")
        return []
    samples = []
    for label, detail, severity, recording, torque_nm in _recordings(model, drawn, twin, ordinary, rig):
        try:
            samples.append(compared.sample(label, detail, severity, recording, torque_nm))
        except (InputError, RefusalError) as error:
            typer.echo(f"gearbox {rig}, {label}: {error}")
    return samples


def _run(twin: CrackedTwin, drawn: DrawnRig, rig: int) -> Recording:
    point = Point(drawn.speed_rpm, drawn.torque_nm)
    return twin.run(point, seed=rig, duration_s=drawn.duration_s, sampling_rate_hz=SAMPLING_RATE_HZ, noise=1)


def _recordings(
    model: Model, drawn: DrawnRig, twin: CrackedTwin, ordinary: Ordinary, rig: int
) -> Iterator[tuple[str, str, float, Recording, float]]:
    """Yield label, detail, severity, recording and torque of everything that is recorded of one gearbox.

    Each draws from a seed of its own: where one effect is drawn otherwise, the others stay as they are.
    """
    bare: list[Recording] = []
    sound: list[Recording] = []
    for run in range(1, N_SOUND + 1):
        rng = _chance(rig, NONE, run)
        day = another_day(drawn, rng)
        bare.append(_record(model, day, run))
        sound.append(ordinary.on(bare[-1], turns_before(drawn, run), rng))
        yield NONE, "", 0.0, sound[-1], drawn.torque_nm * day.torque_factor
    for i in range(model.n_mounted_anew):
        recording = mounted_anew(sound[i % N_SOUND], _chance(rig, "mounted anew", i))
        yield NONE, "mounted anew", 0.0, recording, drawn.torque_nm
    for i in range(model.n_foreign):
        recording, name = with_foreign_vibration(sound[i % N_SOUND], _chance(rig, UNKNOWN, i))
        yield UNKNOWN, name, 0.0, recording, drawn.torque_nm
    for name in made_by_hand(sound[0], drawn.torque_nm):
        for i in range(model.n_by_hand):
            recording, strength = with_signature(sound[i % N_SOUND], name, _chance(rig, f"{name} {BY_HAND}", i))
            yield name, BY_HAND, strength, recording, drawn.torque_nm
    for i in range(N_PATHS * model.n_by_hand):
        turns, rng = turns_before(drawn, i % N_SOUND + 1), _chance(rig, f"transfer_path {BY_HAND}", i)
        recording, strength = _with_changed_path(ordinary, bare[i % N_SOUND], turns, rng)
        yield "transfer_path", BY_HAND, strength, recording, drawn.torque_nm
    names = [e for e in effects() if e not in AT_THE_END]
    for run, (above, name) in enumerate(((a, e) for a in model.simulated for e in names), start=N_SOUND + 1):
        rng = _chance(rig, name, run)
        day = another_day(drawn, rng)
        try:
            added = twin.draw(name, rng, above=above)
            setting = EffectSetting(name, added.severity, dict(added.options))
            recording = ordinary.on(_record(model, day, run, setting), turns_before(drawn, run), rng)
        except (InputError, RefusalError) as error:
            typer.echo(f"{name}: {error}")
            continue
        detail = ", ".join(f"{k}={v}" for k, v in setting.options.items())
        yield name, detail, setting.severity, recording, drawn.torque_nm * day.torque_factor


def _chance(rig: int, name: str, i: int) -> np.random.Generator:
    return np.random.default_rng([SEED, rig, crc32(name.encode()), i])


def _with_changed_path(
    ordinary: Ordinary, bare: Recording, turns: int, rng: np.random.Generator
) -> tuple[Recording, float]:
    """Return a recording that came through other paths, and how much other, 0 to 1."""
    strength = float(rng.uniform())
    paths = draw_path_changes(len(vibrations(bare)), size_of(strength), bare.sampling_rate_hz, rng)
    return ordinary.on(bare, turns, rng, paths), strength


def _record(model: Model, day: Day, run: int, setting: EffectSetting | None = None) -> Recording:
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
