"""How well tooth faults are distinguished, and their severities estimated, with a good simulator.

`python -m app.studies.gap.tooth_faults [--source same] [--rigs 6] [--seed 8101] [--role development]` draws rigs,
records a specimen of each, healthy and with every tooth fault, and runs the diagnosis with the 16-degree-of-freedom
pair as twin, a different specimen with another housing, flanks and tolerances. `--source blind` and `--source
reduced-fe` record the independent rig and the pair of finite-element gears instead; for these the twin is poor, and its
trials must do no harm. With `--run-up` a run-up of each healthy specimen measures the path.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from app.benchmark.cases import Plan, PlannedCase
from app.studies import run_study
from app.studies.gap.calibrate import STRONG
from gearsig.errors import GearsigError, RefusalError
from gearsig.gap import AddedEffect, Interval, OperatingCondition, attribute, conditions_of, tooth_load_n_per_mm
from gearsig.prepared import PreparedRecording
from gearsig.processes import one_pool
from gearsig.recording import Recording
from gearsig.rig import Rig
from gearsig.severity import TOOTH_FAULTS, CrackEstimate, estimate_crack
from sims.blind import BlindCase, labels, record_case
from sims.cracked import CrackedPair
from sims.reduced_fe import ReducedPair

LEVELS = (0.25, 0.6)
"""Minimum severities of each fault, as shares of the logarithmic range of plausible severities."""
BLIND_LEVELS = (0.5, 0.9)
MIN_LOAD_N_PER_MM = 30.0
"""Minimum load; below it, flanks separate and dominate the vibration."""
LONGEST_S = 4.0
RUN_UP_S, RUN_UP = 20.0, (0.3, 1.1)
"""Length of the healthy run-up, and its speeds relative to those of the recordings."""


@dataclass(frozen=True)
class RecordedFault:
    """One recording with its healthy reference and its fault; severity is nan if the units differ."""

    name: str
    severity: float
    now: Recording
    reference: Recording
    run_up: Recording | None = None


@dataclass(frozen=True)
class Answered:
    """Diagnosis of one recording.

    Parameters
    ----------
    name : str
        The true fault.
    severity : float
    forests, with_waveforms : mapping
        Tooth fault → probability among tooth faults, without and with waveforms.
    correlation : float
        Correlation with the waveform of the true fault.
    size : float
        Size of the gap, in structural floors.
    stated : Interval or None
        Stated severity of the true fault; None if the twin does not show it.
    """

    name: str
    severity: float
    forests: dict[str, float]
    with_waveforms: dict[str, float]
    correlation: float
    size: float
    stated: Interval | None


def drawn_cases(plan: Plan, n_rigs: int) -> Iterator[tuple[int, BlindCase]]:
    """Yield `n_rigs` numbered cases, each of another rig under load, shortened to `LONGEST_S`."""
    number = n_drawn = 0
    while n_drawn < n_rigs:
        number += 1
        case = plan.draw(PlannedCase(number, "blind", "single", TOOTH_FAULTS[0], LEVELS[0], True, 1))
        first = case.conditions[0]
        rig = case.rig.description(first.stated_rpm, first.stated_nm)
        if tooth_load_n_per_mm(rig.pairs[0], first.true_nm) >= MIN_LOAD_N_PER_MM:
            n_drawn += 1
            yield number, case


def simulated(case: BlindCase, source: str, seed: int, *, with_run_up: bool = False) -> Iterator[RecordedFault]:
    """Yield recordings of a simulator's specimen with each fault."""
    rng = np.random.default_rng(seed)
    first, healthy = case.conditions[0], case.references[0]
    simulator = CrackedPair() if source == "same" else ReducedPair()
    twin = simulator.twin_of(case.rig.description(first.stated_rpm, first.stated_nm))
    specimen = int(rng.integers(1, 2**31))

    def run(rpm: float, nm: float, added: Sequence[AddedEffect], noise: int) -> Recording:
        made = twin.run(
            OperatingCondition(rpm, nm),
            added,
            seed=specimen,
            duration_s=min(first.duration_s, LONGEST_S),
            sampling_rate_hz=case.rig.sampling_rate_hz,
            noise=noise,
        )
        return made.with_rig(case.rig.description(first.stated_rpm, first.stated_nm))

    reference = run(healthy.true_rpm, healthy.true_nm, (), 1)
    run_up = None
    if with_run_up:
        run_up = twin.run_up(
            RUN_UP[0] * healthy.true_rpm,
            RUN_UP[1] * healthy.true_rpm,
            healthy.true_nm,
            seed=specimen,
            duration_s=RUN_UP_S,
            sampling_rate_hz=case.rig.sampling_rate_hz,
        ).with_name("run-up")
    for name in TOOTH_FAULTS:
        for k, level in enumerate(LEVELS, 2):
            added = twin.draw(name, rng, above=level)
            try:
                now = run(first.true_rpm, first.true_nm, (added,), k)
            except GearsigError as error:
                typer.echo(f"left out: {name} {added.severity:.3g}: {error}")
                continue
            now = now.with_name(f"{name} {k}")
            yield RecordedFault(name, added.severity, now, reference.with_name("healthy"), run_up)


def independent(plan: Plan, number: int) -> Iterator[RecordedFault]:
    """Yield recordings of the independent rig with each fault."""
    for name in TOOTH_FAULTS:
        for level in BLIND_LEVELS:
            case = plan.draw(PlannedCase(number, "blind", "single", name, level, True, 1))
            made = record_case(case)
            severity = float(labels(case, made)["effects"][0]["severity"])
            now, reference = made.conditions[0], made.references[0]
            yield RecordedFault(name, severity, now.with_name(f"{name} {level}"), reference.with_name("healthy"))


def answered(recorded: RecordedFault, rig: Rig, cache: Path) -> Answered:
    """Diagnose one recording up to its most probable causes."""
    simulator = CrackedPair()
    known, twin = simulator.gap_effects(), simulator.twin_of(rig)
    now, reference = PreparedRecording(recorded.now.with_rig(rig)), PreparedRecording(recorded.reference.with_rig(rig))
    run_up = None if recorded.run_up is None else PreparedRecording(recorded.run_up.with_rig(rig))
    conditions, _ = conditions_of([now], [reference], twin, run_up=run_up)
    attribution = attribute(conditions, known, TOOTH_FAULTS, twin, cache, lambda _what, _done: None)
    before, after = (a.probabilities() for a in (replace(attribution, tried={}), attribution))
    trial = attribution.tried.get(recorded.name)
    severity = trial.severity if trial is not None and trial.explains else None
    if recorded.name == "root_crack" and isinstance(depth := _crack(now, reference), CrackEstimate):
        severity = Interval(depth.depth_mm, *depth.interval_mm)
    match = None if trial is None else trial.match
    return Answered(
        recorded.name,
        recorded.severity,
        _among(before),
        _among(after),
        0.0 if match is None else match.correlation,
        attribution.size,
        severity,
    )


def _crack(now: PreparedRecording, reference: PreparedRecording) -> object:
    try:
        return estimate_crack(now, reference=reference)
    except GearsigError:
        return None


def _among(probabilities: dict[str, float]) -> dict[str, float]:
    total = sum(probabilities[name] for name in TOOTH_FAULTS)
    return {name: probabilities[name] / total for name in TOOTH_FAULTS}


def report_lines(rows: Sequence[Answered]) -> Iterator[str]:
    """Yield the table by fault, for all and for strong ones, with forests alone and with waveforms."""
    groups = {name: [row for row in rows if row.name == name] for name in TOOTH_FAULTS}
    groups |= {"all": [*rows], f"{STRONG:g} floors": [row for row in rows if row.size >= STRONG]}
    for name, of_effect in groups.items():
        if not of_effect:
            continue
        parts = []
        for probabilities in ([row.forests for row in of_effect], [row.with_waveforms for row in of_effect]):
            right = sum(max(p, key=p.__getitem__) == row.name for p, row in zip(probabilities, of_effect, strict=True))
            loss = float(
                np.mean([-np.log(max(p[row.name], 1e-9)) for p, row in zip(probabilities, of_effect, strict=True)])
            )
            parts.append(f"{right:3} of {len(of_effect):3}, log loss {loss:.2f}")
        held = [row.stated.low <= row.severity <= row.stated.high for row in of_effect if row.stated is not None]
        yield (f"{name:14} forests {parts[0]}; with waveforms {parts[1]}; severity held {sum(held)} of {len(held)}")


@one_pool(2)
def main(
    source: Literal["same", "blind", "reduced-fe"] = "same",
    rigs: int = 6,
    seed: int = 8101,
    role: str = "development",
    run_up: Annotated[bool, typer.Option("--run-up", help="measure the path by a run-up; simulators only")] = False,
) -> None:
    """Record the rigs, diagnose them and print the table."""
    plan, rows = Plan(1000, seed, role, reference="with", longest_s=LONGEST_S), []
    for number, case in drawn_cases(plan, rigs):
        first = case.conditions[0]
        rig = case.rig.description(first.stated_rpm, first.stated_nm)
        if source == "blind":
            recorded = independent(plan, number)
        else:
            recorded = simulated(case, source, seed + number, with_run_up=run_up)
        with tempfile.TemporaryDirectory() as cache:
            for recorded_fault in recorded:
                try:
                    row = answered(recorded_fault, rig, Path(cache))
                except RefusalError as error:
                    typer.echo(f"refused: {recorded_fault.name}: {error}")
                    continue
                rows.append(row)
                interval = (
                    ""
                    if row.stated is None
                    else f"{row.stated.value:.3g} ({row.stated.low:.3g} to {row.stated.high:.3g})"
                )
                p = ", ".join(f"{name} {value:.2f}" for name, value in row.with_waveforms.items())
                true = f"{number:3} {row.name:14}{row.severity:8.3g}"
                typer.echo(f"{true}  {interval:28} {row.size:4.1f} floors  ρ {row.correlation:.2f}  {p}")
    for line in report_lines(rows):
        typer.echo(line)


if __name__ == "__main__":
    run_study(main)
