"""Calibrate the gap's probabilities on simulators left out of learning: `python -m app.studies.gap.calibrate`.

A user's machine differs from all simulators as each of them differs from the others. So the machines of each simulator
in the population are diagnosed after learning only from the other simulators; nothing is simulated again. The output,
by simulator, is the accuracy on machines of a kind not used for learning. The biases and the sharpness are fitted to
the same cases: a dozen numbers for some thousand cases.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.studies import run_study
from app.studies.gap.lumped import LUMPED
from gearsig.checks import FloatArray
from gearsig.gap import (
    CALIBRATION_FILE,
    INDEPENDENT,
    NAMING,
    NONE,
    UNKNOWN,
    EffectClassifier,
    Features,
    GapCalibration,
    GapEffect,
    Learned,
    Population,
    gap_size,
    group_probabilities,
    joint_probabilities,
    load_learned,
    load_population,
    without_machines_of,
)
from sims.cracked import CrackedPair

# --------------------
# From cases with known causes to the numbers that make the probabilities of the gap diagnosis right on average.
# --------------------


FALSE_ON_NONE, FALSE_ON_UNKNOWN = 0.05, 0.15
"""Maximum shares of healthy cases, and of cases outside the catalogue, for which an effect is named."""

THRESHOLDS = tuple(round(0.5 + 0.01 * i, 2) for i in range(46))

APART = 0.75
"""The more probable of two effects is named alone from odds of three to one: below that it was right in three of
twelve development and calibration cases."""
_START = np.array([1.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
_BOUNDS = ((0.1, 5.0), (0.0, 10.0), (-1.0, 1.0), (-4.0, 4.0), (-4.0, 4.0), (0.0, 1.0), (-4.0, 0.0))
_BIAS_BOUNDS = (-2.0, 2.0)
_SEVERAL_BOUNDS = (0.5, 4.0)
_PRIOR = 0.5
"""Weight of the starting values, at which trials have no influence, relative to one case."""
BIAS_SCATTER = 0.3
"""Prior scatter of the effects' biases, which prevents overfitting to a handful of cases each."""


@dataclass(frozen=True)
class AttributedCase:
    """One case: results of the forests and the trials, and the truth.

    Parameters
    ----------
    truths : tuple of str
        Correct causes; two for a pair.
    forest, scores : mapping
    size : float
        See `gearsig.gap.Attribution`.
    n_conditions : int
    simulator : str
        Simulator that made it.
    """

    truths: tuple[str, ...]
    forest: Mapping[str, float]
    scores: Mapping[str, float]
    size: float = 1.0
    n_conditions: int = 1
    simulator: str = ""

    def by(self, calibration: GapCalibration) -> dict[str, float]:
        """Return cause → probability, most probable first."""
        return calibration.probabilities(self.forest, self.scores, self.size, self.n_conditions)


def fit_calibration(cases: Sequence[AttributedCase], several: Sequence[AttributedCase] = ()) -> GapCalibration:
    """Fit sharpness, weight of trials and all biases by maximum likelihood; then the threshold for naming an effect.

    Parameters
    ----------
    cases : sequence of AttributedCase
        Cases of one operating condition each.
    several : sequence of AttributedCase
        Cases of several conditions; their extra weight over one condition is fitted to these, all else fixed.

    J. C. Platt, "Probabilistic outputs for support vector machines", 1999; C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger,
    "On calibration of modern neural networks", 2017 (one temperature for all classes, a bias for each).
    """
    from scipy.optimize import minimize, minimize_scalar

    effects = sorted({t for c in cases for t in c.truths} - {NONE, UNKNOWN})
    start = np.append(_START, np.zeros(len(effects)))
    weights = np.append(np.full(len(_START), _PRIOR), np.full(len(effects), 0.5 / BIAS_SCATTER**2))

    def loss(x: FloatArray) -> float:
        return log_loss(_calibration(x, effects), cases) + float(weights @ (x - start) ** 2) / len(cases)

    best = minimize(loss, start, method="L-BFGS-B", bounds=[*_BOUNDS, *[_BIAS_BOUNDS] * len(effects)]).x
    fitted = _calibration(np.round(best, 3), effects)
    if several:
        sharper = minimize_scalar(
            lambda factor: log_loss(replace(fitted, several=factor), several), bounds=_SEVERAL_BOUNDS, method="bounded"
        )
        fitted = replace(fitted, several=round(float(sharper.x), 3))
    return replace(fitted, named_from=_named_from(fitted, cases))


def log_loss(calibration: GapCalibration, cases: Sequence[AttributedCase]) -> float:
    """Return −mean ln p of the true causes."""
    right = [sum(p.get(t, 0.0) for t in c.truths) for c in cases for p in (c.by(calibration),)]
    return float(-np.mean(np.log(np.maximum(right, 1e-9))))


def _calibration(x: FloatArray, effects: Sequence[str]) -> GapCalibration:
    sharpness, weight, neutral, none, unknown, sharper, none_slope, *biases = (float(v) for v in x)
    named = dict(zip(effects, biases, strict=True))
    return GapCalibration(
        sharpness, weight, neutral, none, unknown, 0.5, APART, named, sharper=sharper, none_slope=none_slope
    )


def _named_from(fitted: GapCalibration, cases: Sequence[AttributedCase]) -> float:
    """Return the minimum total probability of effects at which naming keeps both false rates."""
    without = [
        (rate, [c.by(fitted) for c in cases if c.truths == (cause,)])
        for cause, rate in ((NONE, FALSE_ON_NONE), (UNKNOWN, FALSE_ON_UNKNOWN))
    ]
    for threshold in THRESHOLDS:
        named = replace(fitted, named_from=threshold)
        if all(
            sum(named.outcome(p, known_effects()) in NAMING for p in healthy_cases) <= rate * len(healthy_cases)
            for rate, healthy_cases in without
        ):
            return threshold
    return THRESHOLDS[-1]


@cache
def known_effects() -> Mapping[str, GapEffect]:
    """Return the effects that the twin of a gear pair can simulate."""
    return CrackedPair().gap_effects()


# --------------------
# The machines of the population as cases, diagnosed by forests that have not learned from their simulator.
# --------------------


SEED = 9203
AT_TWO_POINTS = (INDEPENDENT, LUMPED)
PER_EFFECT, PER_NO_EFFECT = 24, 96
"""Rows of each simulator: per effect, and for healthy machines and unknown changes, together one case in five."""


def cases_of(population: Population, simulator: str, *, with_reference: bool) -> tuple[list[AttributedCase], ...]:
    """Return the cases of one simulator, by forests trained without it: with one condition, and with two.

    Only some simulators have machines recorded at two operating points with the same effect.
    """
    rng = np.random.default_rng(SEED)
    rows_of_simulator = np.flatnonzero((population.simulators == simulator) & ~population.by_hand)
    drawn = []
    for cause in np.unique(population.causes[rows_of_simulator]):
        rows = rows_of_simulator[population.causes[rows_of_simulator] == cause]
        n = PER_NO_EFFECT if cause in (NONE, UNKNOWN) else PER_EFFECT
        drawn += rng.permutation(rows)[:n].tolist()
    pairs = two_conditions(population, rng.permutation(rows_of_simulator)) if simulator in AT_TWO_POINTS else []
    with without_machines_of(simulator):
        single = [_attributed(population, (row,), simulator, with_reference=with_reference) for row in drawn]
        pairs_of_conditions = [
            _attributed(population, rows, simulator, with_reference=with_reference) for rows in pairs
        ]
    return single, pairs_of_conditions


def two_conditions(population: Population, rows: Iterable[int]) -> list[tuple[int, int]]:
    """Return pairs of rows of one machine with the same cause at both points: machines 2k and 2k + 1.

    Healthy machines and unknown changes each have as many as four effects, as among the cases of one condition.
    """
    at = {(int(population.rigs[row]), str(population.causes[row])): row for row in rows}
    pairs = {
        key: (row, at[key[0] + 1, key[1]]) for key, row in at.items() if key[0] % 2 == 0 and (key[0] + 1, key[1]) in at
    }
    effects = [pair for (_, cause), pair in pairs.items() if cause not in (NONE, UNKNOWN)]
    n = round(len(effects) * PER_NO_EFFECT / PER_EFFECT / len({cause for _, cause in pairs} - {NONE, UNKNOWN}))
    return effects + [
        pair for cause in (NONE, UNKNOWN) for pair in [p for (_, c), p in pairs.items() if c == cause][:n]
    ]


def _attributed(
    population: Population, rows: tuple[int, ...], simulator: str, *, with_reference: bool
) -> AttributedCase:
    learned = load_learned()
    changes = [_change(population, learned, row, with_reference=with_reference) for row in rows]
    loads = [float(population.loads_n_per_mm[row]) for row in rows]
    classifier = learned.classifiers[with_reference]
    return attributed_case(str(population.causes[rows[0]]), changes, loads, classifier, simulator)


def attributed_case(
    cause: str, changes: Sequence[Features], loads: Sequence[float], classifier: EffectClassifier, simulator: str
) -> AttributedCase:
    """Return the forests' result for one machine's change at one or several operating points, without trials.

    Parameters
    ----------
    cause : str
    changes, loads : sequences
        For each point: change of the features; tooth load in N/mm.
    classifier : EffectClassifier
    simulator : str
    """
    effects = CrackedPair().gap_effects().values()
    by_condition = [classifier.probabilities(c, load, effects) for c, load in zip(changes, loads, strict=True)]
    forest = joint_probabilities(by_condition, list(loads), classifier.causes)
    size = max(gap_size(change, classifier.floor).structural.value for change in changes)
    return AttributedCase((cause,), forest, {}, size, len(changes), simulator)


def _change(population: Population, learned: Learned, row: int, *, with_reference: bool) -> Features:
    """Return the change of a row's machine, with the twin's credibility taken from the other simulators' machines."""
    if with_reference:
        return Features(population.change_names, population.changes[row], population.change_scatter[row])
    values = population.features[row] - learned.credibility * population.simulated[row]
    scatter = np.hypot(population.feature_scatter[row], learned.credibility * population.simulated_scatter[row])
    return Features(population.feature_names, values, scatter)


# --------------------
# Accuracy by simulator.
# --------------------


STRONG = 3.0
"""Structural floors from which an effect counts as strong."""


def table(calibration: GapCalibration, cases: Sequence[AttributedCase]) -> list[str]:
    """Return a line for each simulator and one for all, with figures for strong effects and for all."""
    named = [*dict.fromkeys(case.simulator for case in cases)]
    rows = [(name, [case for case in cases if case.simulator == name]) for name in named]
    return [_line(name, calibration, some) for name, some in [*rows, ("all", list(cases))]]


def _line(name: str, calibration: GapCalibration, cases: Sequence[AttributedCase]) -> str:
    known = known_effects()
    answers = [(case, case.by(calibration)) for case in cases]
    strong = [(c, p) for c, p in answers if c.size >= STRONG and c.truths[0] not in (NONE, UNKNOWN)]
    first = [next(iter(p)) == c.truths[0] for c, p in strong]
    two = [c.truths[0] in list(p)[:2] for c, p in strong]
    group = [_most_probable_group(p, known) == known[c.truths[0]].group for c, p in strong]
    sure = [next(iter(p)) in c.truths for c, p in answers if max(p.values()) >= 0.9]
    healthy, unknown = (
        [calibration.outcome(p, known) in NAMING for c, p in answers if c.truths == (cause,)]
        for cause in (NONE, UNKNOWN)
    )
    return (
        f"{name}: strong {len(strong)}: likeliest {_share(first)}, two {_share(two)}, group {_share(group)}; "
        f"probability ≥ 0.9: {len(sure)}, right {_share(sure)}; calibration error {calibration_error(answers):.3f}; "
        f"named on healthy {_share(healthy)}, on unknown {_share(unknown)}; log loss {log_loss(calibration, cases):.3f}"
    )


def _share(values: Sequence[bool]) -> str:
    return f"{np.mean(values):.2f}" if values else "-"


def _most_probable_group(probabilities: Mapping[str, float], known: Mapping[str, GapEffect]) -> str:
    together = group_probabilities(probabilities, known)
    return max(together, key=together.__getitem__)


def calibration_error(answers: Sequence[tuple[AttributedCase, Mapping[str, float]]], n_bins: int = 10) -> float:
    """Return Σ_b n_b/n |share right − mean probability| of the most probable cause, over equal probability bins."""
    largest = np.array([max(p.values()) for _, p in answers])
    right = np.array([next(iter(p)) in case.truths for case, p in answers], dtype=float)
    bins = np.minimum((largest * n_bins).astype(int), n_bins - 1)
    parts = [abs(float(np.sum(right[bins == b] - largest[bins == b]))) for b in range(n_bins)]
    return sum(parts) / len(largest) if len(largest) else 0.0


def main(to: Path = CALIBRATION_FILE) -> None:
    """Diagnose the machines of the population, fit the calibration, write it, and print its accuracy."""
    population = load_population()
    values: dict[str, Any] = {}
    n_cases = 0
    for name, with_reference in (("with_reference", True), ("without_reference", False)):
        by_simulator = [
            cases_of(population, s, with_reference=with_reference) for s in np.unique(population.simulators)
        ]
        single, several = ([case for cases in by_simulator for case in cases[i]] for i in (0, 1))
        fitted = fit_calibration(single, several)
        values[name] = fitted.to_mapping()
        n_cases += len(single) + len(several)
        typer.echo(f"{name.replace('_', ' ')}, one condition, the simulator left out:")
        typer.echo("\n".join(table(fitted, single)))
        typer.echo("two conditions:\n" + "\n".join(table(fitted, several)))
    values["provenance"] = {"made_by": "python -m app.studies.gap.calibrate", "seed": SEED, "n_cases": n_cases}
    to.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run_study(main)
