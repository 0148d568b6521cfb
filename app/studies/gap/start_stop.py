"""Fit floors and probabilities of the start–stop diagnosis to blind cases reserved for this.

`python -m app.studies.gap.start_stop --cases 100 --seed 71` makes cases of the role calibration, which share no gears
with the evaluation, and writes `gearsig/gap/start_stop/floors.json`. Each case takes 3 s of processor time. The
provenance in the file states the cases: `--numbers` makes only some of those planned.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import typer

from app.benchmark.start_stop import labelled_recordings, needs_reference, planned
from app.studies import answers_of, run_study
from gearsig.checks import FloatArray
from gearsig.gap import NONE, UNKNOWN, Attribution, GapCalibration
from gearsig.gap.start_stop import (
    FLOORS_FILE,
    HALF,
    DriveEvidence,
    DriveFloor,
    FittedDriveCause,
    attribute_drive,
    compare_drive,
    predict,
    read_cycles,
)
from sims.forging import ForgingManipulator

ROLE = "calibration"
NEUTRAL_SHRINK = 0.3
RIDGE = 0.005
"""Pulls the weights towards their starting values, as some hundred cases do not determine them."""
START = (0.6, 1.0, 0.0, 0.0)
"""Starting values: sharpness, weight of the shrink, biases of none and of unknown."""
FALSE_ALARMS = 0.05
MIN_NAMED, MAX_NAMED, APART = 0.6, 0.95, 0.7
MIN_SHARE = 1e-6

Row = tuple[Mapping[str, Any], DriveEvidence]


def collect(job: tuple[int, int, tuple[str, str, float]]) -> list[Row]:
    """Make a case from seed, number and (kind, effect, level); return its rows with and without a reference."""
    seed, number, fault = job
    label, recording, healthy = labelled_recordings(ROLE, seed, number, fault)
    simulator = ForgingManipulator()
    rows: list[Row] = []
    now = read_cycles(recording)
    ways = [] if healthy is None else [[read_cycles(healthy)]]
    for references in ways if needs_reference(fault[1]) else [*ways, []]:
        compared = compare_drive(now, references, simulator)
        evidence = compared.evidence(predict(compared, simulator.gap_effects()))
        rows.append(({**label, "with_reference": bool(references)}, evidence))
    return rows


def truth_of(label: Mapping[str, Any]) -> str:
    """Return the correct cause of a label."""
    return str(label["effect"]) if label["kind"] == "single" else str(label["kind"])


def fit_part(rows: Sequence[Row]) -> dict[str, Any]:
    """Return floors and calibration for all cases with a reference, or for all without, as plain values."""
    healthy = [evidence for label, evidence in rows if label["kind"] == "none"]
    whole = DriveFloor.of_healthy(
        np.array([evidence.whole for evidence in healthy]), np.array([evidence.scatter for evidence in healthy])
    )
    halves = [(fold.fitted, HALF * evidence.scatter) for evidence in healthy for fold in evidence.folds]
    half = DriveFloor.of_healthy(np.array([change for change, _ in halves]), np.array([error for _, error in halves]))
    attributions = [
        (truth_of(label), attribute_drive([evidence], with_reference=label["with_reference"], floors=(whole, half)))
        for label, evidence in rows
    ]
    calibration = fit_calibration(attributions)
    return {
        "whole": whole.to_dict(),
        "half": half.to_dict(),
        **calibration.to_mapping(),
    }


def fit_calibration(attributions: Sequence[tuple[str, Attribution[FittedDriveCause]]]) -> GapCalibration:
    """Fit sharpness, weight of the shrink and both biases to the truth: minimum −log p plus a ridge to the start."""
    from scipy.optimize import minimize

    def loss(values: FloatArray) -> float:
        calibration = _calibration(values)
        logs = [np.log(max(w.probabilities(calibration).get(t, 0.0), MIN_SHARE)) for t, w in attributions]
        return float(-np.mean(logs) + RIDGE * np.sum((values - np.array(START)) ** 2))

    solution = minimize(loss, np.array(START), method="Nelder-Mead", options={"maxiter": 400, "xatol": 1e-3})
    calibration = _calibration(solution.x)
    healthy = [w.probabilities(calibration) for t, w in attributions if t == NONE]
    named = sorted(1.0 - p[NONE] - p[UNKNOWN] for p in healthy)
    limit = float(np.quantile(named, 1.0 - FALSE_ALARMS, method="higher")) if named else MIN_NAMED
    return _calibration(solution.x, float(np.clip(limit, MIN_NAMED, MAX_NAMED)))


def _calibration(values: FloatArray, named_from: float = MIN_NAMED) -> GapCalibration:
    sharpness, weight, none, unknown = (float(v) for v in values)
    return GapCalibration(max(sharpness, 0.05), weight, NEUTRAL_SHRINK, none, unknown, named_from, APART)


def main(
    cases: int = 100,
    seed: int = 71,
    processes: int = 2,
    numbers: Annotated[
        str, typer.Option(help="numbers of the planned cases to make, e.g. 0-38,140-177; default: all")
    ] = "",
) -> None:
    """Make the cases, fit and write the floors."""
    plan = planned(cases, seed)
    jobs = [(seed, i, plan[i]) for i in numbers_of(numbers, len(plan))]
    rows = [row for _, seen in answers_of(collect, jobs, processes) for row in seen]
    content = floors_of(rows, seed, f"{numbers or 'all'} of {len(plan)} planned")
    FLOORS_FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def numbers_of(text: str, n_planned: int) -> list[int]:
    """Return the numbers in a text such as "0-38,140-177"; all if it is empty."""
    if not text:
        return list(range(n_planned))
    ends = [part.partition("-") for part in text.split(",")]
    return [i for low, _, high in ends for i in range(int(low), int(high or low) + 1)]


def floors_of(rows: Sequence[Row], seed: int, drawn: str = "all") -> dict[str, Any]:
    """Return the content of the floors file."""
    parts = {
        name: [row for row in rows if bool(row[0]["with_reference"]) is with_reference]
        for name, with_reference in (("with_reference", True), ("without_reference", False))
    }
    n_cases = len(parts["with_reference"])
    n_healthy = sum(label["kind"] == "none" for label, _ in parts["with_reference"])
    provenance = {
        "n_cases": n_cases,
        "n_healthy": n_healthy,
        "role": ROLE,
        "seed": seed,
        "drawn": drawn,
        "made_by": "sims.blind_drive",
    }
    return {"provenance": provenance, **{name: fit_part(rows_of_part) for name, rows_of_part in parts.items()}}


if __name__ == "__main__":
    run_study(main)
