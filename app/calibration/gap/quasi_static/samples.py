"""Rows of the population from drawn machines of the quasi-static simulator."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import typer

from app.calibration.gap.outside import with_foreign_vibration
from app.calibration.gap.paths import draw_path_changes, size_of
from app.calibration.gap.quasi_static.effects import EFFECTS
from app.calibration.gap.quasi_static.machine import N_CHANNELS, StaticMachine
from app.calibration.gap.quasi_static.record import Day, record
from app.calibration.gap.sample import SEED, Compared, Sample, reduced
from app.calibration.gap.signatures import made_by_hand, with_signature
from gearsig.errors import InputError, RefusalError
from gearsig.gap.population import BY_HAND
from gearsig.gap.simulator import Point
from gearsig.gap.types import NONE, UNKNOWN
from gearsig.recording.types import Recording
from sims.cracked.twin import CrackedTwin

QUASI_STATIC = "quasi-static"
FIRST_RIG = 200_000
N_SOUND, N_EACH, N_FOREIGN, N_BY_HAND, N_PATHS = 2, 1, 2, 3, 2


def one_static(index: int) -> list[Sample]:
    """Return the samples of one drawn machine."""
    rng, rig = np.random.default_rng([SEED, 3, index]), FIRST_RIG + index
    machine = StaticMachine.of(rng)
    torque_nm = machine.drawn.torque_nm
    levels = record(machine, machine.sound(), Day.drawn(rng), None).samples[:-1].std(axis=1)
    try:
        reference = record(machine, machine.sound(), Day.drawn(rng), levels)
        twin = CrackedTwin(machine.rig, machine.nominal).run(
            Point(machine.drawn.speed_rpm, torque_nm),
            seed=rig,
            duration_s=machine.drawn.duration_s,
            sampling_rate_hz=machine.rate_hz,
            noise=1,
        )
        compared = Compared(QUASI_STATIC, rig, reduced(reference, rig), reduced(twin, rig))
    except (InputError, RefusalError) as error:
        typer.echo(f"machine {rig}: {error}")
        return []
    samples = []
    for label, detail, recording in (*_recordings(machine, levels, rng), *_changed_paths(machine, levels)):
        try:
            samples.append(compared.sample(label, detail, 0.0, recording, torque_nm))
        except (InputError, RefusalError) as error:
            typer.echo(f"machine {rig}, {label}: {error}")
    return samples


def _recordings(
    machine: StaticMachine, levels: np.ndarray, rng: np.random.Generator
) -> Iterator[tuple[str, str, Recording]]:
    """Yield label, detail and recording."""
    sound = [record(machine, machine.sound(), Day.drawn(rng), levels) for _ in range(N_SOUND)]
    for recording in sound:
        yield NONE, "", recording
    for name, effect in EFFECTS.items():
        for _ in range(N_EACH):
            state = machine.sound()
            effect(machine, state, rng)
            yield name, "", record(machine, state, Day.drawn(rng), levels)
    for i in range(N_FOREIGN):
        recording, name = with_foreign_vibration(sound[i % N_SOUND], rng)
        yield UNKNOWN, name, recording
    for i, name in enumerate(rng.choice(made_by_hand(sound[0], machine.drawn.torque_nm), N_BY_HAND, replace=False)):
        yield str(name), BY_HAND, with_signature(sound[i % N_SOUND], str(name), rng)[0]


def _changed_paths(machine: StaticMachine, levels: np.ndarray) -> Iterator[tuple[str, str, Recording]]:
    """Yield recordings that come through other paths, from a seed of their own."""
    rng = np.random.default_rng([machine.seed, 5])
    for _ in range(N_PATHS):
        state = machine.sound()
        state.paths = draw_path_changes(N_CHANNELS, size_of(rng.uniform()), machine.rate_hz, rng)
        yield "transfer_path", "", record(machine, state, Day.drawn(rng), levels)
