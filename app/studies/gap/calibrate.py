"""Calibrate the gap's probabilities on blind cases: `python -m app.studies.gap.calibrate --cases N --work FILE`.

Cases of the role "calibration" differ in gear geometry from those that the benchmark judges by. Each is weighed twice:
as the shipped population has it, which knows the independent rig's development gears, and without any machine of that
rig, since a user's machine may be as strange to all simulators as it is to the others then. What a case says is
kept in the work file, a line each, so that a stopped run goes on. The forests are asked about every case, which takes
some seconds; effects are tried on the twin for the first `--tried` cases only, a minute each. From what probability on
an effect is named hangs on the few cases from outside the catalogue: `--strange` further ones tell that alone.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.studies.gap.by_hand import rig_of
from app.studies.pool import answers_of
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap import (
    CALIBRATION_FILE,
    INDEPENDENT,
    MAX_TRIED,
    NAMING,
    NONE,
    UNKNOWN,
    GapCalibration,
    without_machines_of,
)

# --------------------
# From blind cases with known causes to the numbers that make the gap's probabilities right on the average.
# --------------------


FALSE_ON_NONE, FALSE_ON_UNKNOWN = 0.05, 0.15
"""Parts of the healthy cases, and of those outside the catalogue, on which an effect may be named."""

THRESHOLDS = tuple(round(0.5 + 0.01 * i, 2) for i in range(46))

APART = 0.75
"""The likeliest of two effects is named alone from three to one: below that it was right three times in twelve, on
development and calibration cases."""
_START = np.array([1.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
_BOUNDS = ((0.1, 5.0), (0.0, 10.0), (-1.0, 1.0), (-4.0, 4.0), (-4.0, 4.0), (0.0, 1.0), (-4.0, 0.0))
_BIAS_BOUNDS = (-2.0, 2.0)
_PRIOR = 0.5
"""Weight of the start, at which trials say nothing, beside that of one case."""
BIAS_SCATTER = 0.3
"""Of effects' biases, in which a handful of cases each must not be learned by heart."""


@dataclass(frozen=True)
class WeighedCase:
    """One blind case: what the forests and the trials said, and the truth.

    Parameters
    ----------
    truths : tuple of str
        Causes that are right; two for a pair.
    forest, scores : mapping
    size : float
        See `gearsig.gap.Attribution`.
    """

    truths: tuple[str, ...]
    forest: Mapping[str, float]
    scores: Mapping[str, float]
    size: float = 1.0


def fit_calibration(cases: Sequence[WeighedCase], strange: Sequence[WeighedCase] = ()) -> GapCalibration:
    """Fit sharpness, what trials say and all biases by likelihood; then the threshold for naming an effect.

    Parameters
    ----------
    cases : sequence of WeighedCase
    strange : sequence of WeighedCase
        Further ones from outside the catalogue, for the threshold only: as many in the likelihood would make whatever
        is diagnosed look strange.

    J. C. Platt, "Probabilistic outputs for support vector machines", 1999; C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger,
    "On calibration of modern neural networks", 2017 (one temperature for all classes, a bias for each).
    """
    from scipy.optimize import minimize

    effects = sorted({t for c in cases for t in c.truths} - {NONE, UNKNOWN})
    start = np.append(_START, np.zeros(len(effects)))
    weights = np.append(np.full(len(_START), _PRIOR), np.full(len(effects), 0.5 / BIAS_SCATTER**2))

    def loss(x: FloatArray) -> float:
        fitted = _calibration(x, effects)
        right = [sum(fitted.probabilities(c.forest, c.scores, c.size)[t] for t in c.truths) for c in cases]
        return float(-np.mean(np.log(np.maximum(right, 1e-9))) + weights @ (x - start) ** 2 / len(cases))

    best = minimize(loss, start, method="L-BFGS-B", bounds=[*_BOUNDS, *[_BIAS_BOUNDS] * len(effects)]).x
    fitted = _calibration(np.round(best, 3), effects)
    return replace(fitted, named_from=_named_from(fitted, [*cases, *strange]))


def _calibration(x: FloatArray, effects: Sequence[str]) -> GapCalibration:
    sharpness, weight, neutral, none, unknown, sharper, none_slope, *biases = (float(v) for v in x)
    named = dict(zip(effects, biases, strict=True))
    return GapCalibration(
        sharpness, weight, neutral, none, unknown, 0.5, APART, named, sharper=sharper, none_slope=none_slope
    )


def _named_from(fitted: GapCalibration, cases: Sequence[WeighedCase]) -> float:
    """Return the least probability of effects together from which naming keeps both false rates."""
    without = [
        (rate, [fitted.probabilities(c.forest, c.scores, c.size) for c in cases if c.truths == (cause,)])
        for cause, rate in ((NONE, FALSE_ON_NONE), (UNKNOWN, FALSE_ON_UNKNOWN))
    ]
    for threshold in THRESHOLDS:
        named = replace(fitted, named_from=threshold)
        if all(sum(named.outcome(p) in NAMING for p in found) <= rate * len(found) for rate, found in without):
            return threshold
    return THRESHOLDS[-1]


SEED = 9202
MIN_LEVEL = 0.4
"""Of effects' severities, 0 to 1: nothing can be learned from those that nobody could see."""
ROUND = 27
"""Cases of a round: each effect once, four healthy ones, four from outside the catalogue."""
FIRST_STRANGE = 10_000
"""Number of the first of the cases from outside the catalogue that only tell from what probability on to name."""


def main() -> None:
    """Make cases, weigh them, fit, write."""
    from app.studies.gap.calibrate import weigh_case

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=216)
    parser.add_argument("--strange", type=int, default=64)
    parser.add_argument("--tried", type=int, default=27)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--work", type=Path, required=True, help="keeps what the cases say")
    parser.add_argument("--to", type=Path, default=CALIBRATION_FILE)
    given = parser.parse_args()
    done = _read(given.work)
    wanted = [*range(given.cases), *range(FIRST_STRANGE, FIRST_STRANGE + given.strange)]
    missing = [i for i in wanted if i not in done]
    jobs = [(i, MAX_TRIED if i < given.tried else 0) for i in missing]
    with given.work.open("a", encoding="utf-8") as file:
        for (i, _), rows in answers_of(weigh_case, jobs, given.processes):
            file.write(json.dumps({"case": i, "rows": rows}) + "\n")
            file.flush()
            typer.echo(f"case {i}: {', '.join(rows[0]['truths']) if rows else 'refused'}")
    kept = {i: found for i, found in _read(given.work).items() if i in wanted}
    values: dict[str, Any] = {
        name: fit_calibration(*(_cases(kept, flag, strange=strange) for strange in (False, True))).to_mapping()
        for name, flag in (("with_reference", True), ("without_reference", False))
    }
    values["provenance"] = {
        "made_by": "python -m app.studies.gap.calibrate",
        "seed": SEED,
        "n_cases": len(kept),
    }
    given.to.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    typer.echo(json.dumps(values, indent=1))


def weigh_case(job: tuple[int, int]) -> list[dict[str, Any]]:
    """Return what is said of a blind case with its reference and without, and the truth; less where it is refused.

    Each by all that is known, and by what is known without the machines of the rig that made the case. A job is the
    case's number and how many effects are tried at most.
    """
    from gearsig.gap import attribute, conditions_of, load_population
    from gearsig.prepared import PreparedRecording
    from sims.blind import CATALOGUE, draw_case, record_case
    from sims.cracked import cracked_gap_simulator

    index, max_tried = job
    rng = np.random.default_rng([SEED, index])
    place, names = index % ROUND, list(CATALOGUE)
    kind = "single" if place < len(names) else "none" if place < len(names) + 4 else "unknown"
    if index >= FIRST_STRANGE:
        kind = "unknown"
    wanted = {"effect": names[place], "level": float(rng.uniform(MIN_LEVEL, 1.0))} if kind == "single" else {}
    case = draw_case(rng, "calibration", kind=kind, with_reference=True, **wanted)  # type: ignore[arg-type]  # as drawn
    truths = [wanted["effect"]] if wanted else [NONE if kind == "none" else UNKNOWN]
    recorded = record_case(case)
    simulator = cracked_gap_simulator()
    rows = []
    for references in (recorded.references, ()):
        try:
            twin = simulator.twin_of(rig_of(recorded.conditions[0]))
            prepared = [[PreparedRecording(r) for r in given] for given in (recorded.conditions, references)]
            conditions, _ = conditions_of(*prepared, twin)
            for left_out in ("", INDEPENDENT):
                with without_machines_of(left_out):
                    known = [replace(c, population=load_population()) for c in conditions]
                    weighed = attribute(
                        known, simulator.gap_effects(), (), twin, None, lambda *_: None, max_tried=max_tried
                    )
                rows.append(
                    {
                        "truths": truths,
                        "level": wanted.get("level"),
                        "left_out": left_out,
                        "with_reference": all(condition.reference is not None for condition in known),
                        "size": weighed.size,
                        "forest": dict(weighed.evidence),
                        "scores": weighed.scores,
                    }
                )
        except GearsigError as error:
            typer.echo(f"case {index}: {error}")
    return rows


def _read(path: Path) -> dict[int, list[dict[str, Any]]]:
    if not path.exists():
        return {}
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {line["case"]: line["rows"] for line in lines}


def _cases(kept: dict[int, list[dict[str, Any]]], with_reference: bool, *, strange: bool) -> list[WeighedCase]:
    rows = [row for i, found in kept.items() if (i >= FIRST_STRANGE) == strange for row in found]
    return [
        WeighedCase(tuple(row["truths"]), row["forest"], row["scores"], row["size"])
        for row in rows
        if row["with_reference"] == with_reference
    ]


if __name__ == "__main__":
    main()
