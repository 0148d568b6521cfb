"""Benefit of labelled recordings of a rig: `python -m app.studies.gap.labelled simulate --to RAW`, then `score`.

Each machine is recorded several times with every effect, each time with another severity and location, on another day
with remounted sensors, and compared with one healthy reference. Learning from the population leaves out the simulator
of the machine; then one, two or four of the machine's own recordings of each effect are labelled, and the others are
diagnosed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from app.studies import answers_of, run_study
from app.studies.gap.by_hand import with_foreign_vibration
from app.studies.gap.gearboxes import (
    CRACKED,
    MOUNTED_ANEW_SHARE,
    Made,
    PopulationModel,
    PopulationSample,
    Recorded,
    one_rig,
    reduced_twin,
    samples_of,
    write,
)
from app.studies.gap.quasi_static import EFFECTS, QUASI_STATIC, QuasiStaticDay, StaticMachine, record
from gearsig.checks import FloatArray, one_of
from gearsig.gap import (
    INDEPENDENT,
    NONE,
    UNKNOWN,
    EffectClassifier,
    Features,
    clipped_discriminant_input,
    labelled_support,
    load_gap_calibration,
    load_learned,
    soft_size,
    with_labelled,
    without_machines_of,
)
from sims.blind import CATALOGUE, MECHANICAL, Scene, draw_case, measure, run, scene_of
from sims.blind import Fault as BlindFault

# --------------------
# Machines with several recordings of each effect.
# --------------------


SEED, FIRST_RIG = 77_013, 400_000
N_RUNS = 6
"""Recordings per machine: of each effect, healthy, and with vibration from outside the catalogue."""

MODEL = PopulationModel(CRACKED.name, FIRST_RIG, 0, N_RUNS, 0, (0.3, 0.35, 0.4, 0.5, 0.6, 0.7))


def static_machine(index: int) -> list[PopulationSample]:
    """Return the samples of one quasi-static machine."""
    rig = FIRST_RIG + 10_000 + index
    rng = np.random.default_rng([SEED, 1, index])
    machine = StaticMachine.of(rng)

    def made() -> Made:
        levels = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), None).samples[:-1].std(axis=1)
        reference = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), levels)
        return reference, reduced_twin(reference, rig, machine.drawn.torque_nm), recorded(levels)

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
        return reference, reduced_twin(reference, rig, torque_nm), recorded()

    return samples_of(INDEPENDENT, rig, made)


_MAKE: dict[str, Callable[[int], list[PopulationSample]]] = {
    CRACKED.name: partial(one_rig, MODEL),
    QUASI_STATIC: static_machine,
    INDEPENDENT: independent_machine,
}


def samples_of_job(job: tuple[str, int]) -> list[PopulationSample]:
    """Return the samples of a simulator's machine."""
    name, index = job
    return _MAKE[name](index)


# --------------------
# One, two, four of each effect labelled, the others diagnosed.
# --------------------


COUNTS, STRONG = (0, 1, 2, 4), 3.0
"""Numbers of labelled recordings of each effect; structural floors from which an effect counts as strong."""


def score(raw: Path) -> None:
    """Print how often the most probable effect is the true one, by the number of labelled recordings of each effect."""
    table = np.load(raw, allow_pickle=False)
    simulators = table["simulator"].astype(str)
    for simulator in np.unique(simulators):
        with without_machines_of(simulator):
            classifier = load_learned().classifiers[True]
        rows = np.flatnonzero(simulators == simulator)
        cases = [_case(table, int(row), classifier) for row in rows]
        for n in COUNTS:
            typer.echo(f"{simulator}, {n} labelled of each effect: {_scored(cases, classifier, n)}")


@dataclass(frozen=True, eq=False)
class _Case:
    machine: int
    cause: str
    size: float
    row: FloatArray
    probabilities: Mapping[str, float]


def _case(table: Mapping[str, Any], i: int, classifier: EffectClassifier) -> _Case:
    values, scatter = (table[key][i].astype(np.float64) for key in ("change", "change_scatter"))
    change, load = Features(classifier.floor.names, values, scatter), float(table["load_n_per_mm"][i])
    floor = classifier.floor
    size = soft_size(floor.names, floor.over(change)) / floor.floor_size(floor.names)
    calibration = load_gap_calibration(with_reference=True)
    probabilities = calibration.probabilities(classifier.probabilities(change, load), {}, size)
    row = clipped_discriminant_input(classifier.input_row(change, load))
    return _Case(int(table["rig"][i]), str(table["label"][i]), size, row, probabilities)


def _scored(cases: Sequence[_Case], classifier: EffectClassifier, n: int) -> str:
    rng = np.random.default_rng(SEED)
    right, sure, loss = list[bool](), list[bool](), list[float]()
    for case in cases:
        if case.cause in (NONE, UNKNOWN) or case.size < STRONG:
            continue
        ratios = {}
        for cause in {labelled_case.cause for labelled_case in cases} - {UNKNOWN}:
            same_cause = [
                labelled_case
                for labelled_case in cases
                if labelled_case.machine == case.machine and labelled_case.cause == cause and labelled_case is not case
            ]
            drawn = [same_cause[i] for i in rng.permutation(len(same_cause))[:n]]
            if drawn:
                rows = np.array([labelled_case.row for labelled_case in drawn])
                ratios[cause] = labelled_support(classifier.labels.log_ratios(case.row, rows, cause))
        posterior = with_labelled(case.probabilities, ratios, {})
        first = next(iter(posterior))
        right.append(first == case.cause)
        sure += [first == case.cause] if posterior[first] >= 0.9 else []
        loss.append(-np.log(max(posterior[case.cause], 1e-9)))
    return (
        f"likeliest right {np.mean(right):.2f} of {len(right)}; probability ≥ 0.9: {len(sure)}, right "
        f"{np.mean(sure) if sure else 0.0:.2f}; log loss {np.mean(loss):.2f}"
    )


def simulate(
    to: Annotated[Path, typer.Option()],
    machines: Annotated[int, typer.Option(help="of each simulator")] = 4,
    simulator: Annotated[list[str] | None, typer.Option(help=f"{', '.join(_MAKE)}; default: all of these")] = None,
) -> None:
    """Record machines and write their samples."""
    names = [one_of(name, "simulator", _MAKE) for name in simulator or _MAKE]
    samples: list[PopulationSample] = []
    for _, new_samples in answers_of(samples_of_job, [(name, i) for i in range(machines) for name in names], 2):
        samples += new_samples
        write(to, samples)


if __name__ == "__main__":
    run_study(simulate, score)
