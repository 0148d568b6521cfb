"""How much labelled recordings of a rig tell: `python -m app.studies.gap.labelled simulate --to RAW`, then `score`.

Each machine is recorded several times with every effect, of another severity and at another place each time, on another
day with sensors mounted anew, and compared with one healthy reference. What is learned of the population leaves out
the simulator that the machine is of; then one, two, four of its own recordings of each effect are labelled, and the
others are diagnosed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from app.studies.gap.by_hand import rig_of, with_foreign_vibration
from app.studies.gap.machines import MOUNTED_ANEW_SHARE
from app.studies.gap.quasi_static import EFFECTS, QUASI_STATIC, QuasiStaticDay, StaticMachine, record
from app.studies.gap.rows import (
    CRACKED,
    Made,
    PopulationModel,
    PopulationSample,
    Recorded,
    one_rig,
    reduced,
    samples_of,
    write,
)
from app.studies.pool import answers_of
from gearsig.gap import (
    INDEPENDENT,
    NONE,
    UNKNOWN,
    OperatingCondition,
    ReducedRecording,
    reduce_recording,
    run_length_s,
    with_channels_of,
)
from gearsig.recording import Recording
from sims.blind import CATALOGUE, MECHANICAL, Scene, draw_case, measure, run, scene_of
from sims.blind import Fault as BlindFault
from sims.cracked import CrackedTwin
from sims.machine import nominal_of

# --------------------
# Machines with several recordings of each effect.
# --------------------


SEED, FIRST_RIG = 77_013, 400_000
N_RUNS = 5
"""Recordings of each effect, healthy ones, and ones with vibration from outside the catalogue, of each machine."""

MODEL = PopulationModel(CRACKED.name, FIRST_RIG, 0, N_RUNS, 0, (0.3, 0.4, 0.5, 0.6, 0.7))


def static_machine(index: int) -> list[PopulationSample]:
    """Return the samples of one quasi-static machine."""
    rig = FIRST_RIG + 10_000 + index
    rng = np.random.default_rng([SEED, 1, index])
    machine = StaticMachine.of(rng)

    def made() -> Made:
        levels = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), None).samples[:-1].std(axis=1)
        reference = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), levels)
        return reference, _twin(reference, rig, machine.drawn.torque_nm), recorded(levels)

    def recorded(levels: np.ndarray) -> Iterator[Recorded]:
        for run_index in range(N_RUNS):
            for name in (NONE, UNKNOWN, *EFFECTS):
                state = machine.healthy()
                if name in EFFECTS:
                    EFFECTS[name](machine, state, rng)
                recording = record(machine, state, QuasiStaticDay.drawn(rng), levels)
                if name == UNKNOWN:
                    recording, _ = with_foreign_vibration(recording, rng)
                yield name, str(run_index), 0.0, recording, machine.drawn.torque_nm

    return samples_of(QUASI_STATIC, rig, made)


def independent_machine(index: int) -> list[PopulationSample]:
    """Return the samples of one machine of the independent rig, with development gears."""
    rig = FIRST_RIG + 20_000 + index
    rng = np.random.default_rng([SEED, 2, index])
    case = draw_case(rng, "development", kind=NONE, n_conditions=1, with_reference=True)
    first = scene_of(case.rig, case.conditions[0])
    motion = run(first)
    bare = measure(first, motion).samples[: len(case.rig.chains)]
    rms = tuple(bare.std(axis=1) / np.array([chain.gain for chain in case.rig.chains]))
    peak = tuple(np.abs(bare).max(axis=1))
    torque_nm = case.conditions[0].stated_nm

    def levelled(scene: Scene) -> Scene:
        scene.reference_rms, scene.reference_peak = rms, peak
        return scene

    def recorded() -> Iterator[Recorded]:
        for run_index in range(N_RUNS):
            for name in (NONE, UNKNOWN, *MECHANICAL):
                was = case.conditions[0]
                mount = int(rng.integers(2**62)) if rng.uniform() < MOUNTED_ANEW_SHARE else was.mount_seed
                day = replace(
                    was,
                    true_rpm=was.true_rpm * (1 + rng.normal(0, 0.004)),
                    true_nm=was.true_nm * (1 + rng.normal(0, 0.03)),
                    seed=int(rng.integers(2**62)),
                    mount_seed=mount,
                )
                scene = levelled(scene_of(case.rig, day))
                severity = 0.0
                if name in CATALOGUE:
                    level = float(rng.uniform(0.5, 1.0))
                    severity = CATALOGUE[name].severity(case.rig, level)
                    fault = BlindFault(name, severity, level, int(rng.integers(2**62)))
                    CATALOGUE[name].apply(scene, fault.severity, np.random.default_rng(fault.seed))
                recording = measure(scene, run(scene))
                if name == UNKNOWN:
                    recording, _ = with_foreign_vibration(recording, rng)
                yield name, str(run_index), severity, recording, torque_nm

    def made() -> Made:
        scene = levelled(scene_of(case.rig, case.references[0]))
        reference = measure(scene, run(scene))
        return reference, _twin(reference, rig, torque_nm), recorded()

    return samples_of(INDEPENDENT, rig, made)


def _twin(reference: Recording, rig: int, torque_nm: float) -> ReducedRecording:
    here, known = reduced(reference, rig), rig_of(reference)
    simulated = CrackedTwin(known, nominal_of(known)).run(
        OperatingCondition(60.0 * here.speed_hz, torque_nm),
        seed=rig,
        duration_s=run_length_s(here),
        sampling_rate_hz=reference.sampling_rate_hz,
        noise=1,
    )
    return with_channels_of(reduce_recording(simulated, known), here)


_MAKE: dict[str, Callable[[int], list[PopulationSample]]] = {
    CRACKED.name: partial(one_rig, MODEL),
    QUASI_STATIC: static_machine,
    INDEPENDENT: independent_machine,
}


def samples_of_job(job: tuple[str, int]) -> list[PopulationSample]:
    """Return the samples of a simulator's machine."""
    name, index = job
    return _MAKE[name](index)


def main() -> None:
    """Record machines."""
    from app.studies.gap.labelled import samples_of_job as of_job

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=4)
    parser.add_argument("--to", type=Path, required=True)
    given = parser.parse_args()
    jobs = [(name, i) for i in range(given.machines) for name in _MAKE]
    samples: list[PopulationSample] = []
    for _, found in answers_of(of_job, jobs, 2):
        samples += found
        write(given.to, samples)


if __name__ == "__main__":
    main()
