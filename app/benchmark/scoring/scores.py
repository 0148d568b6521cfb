"""The benchmark's figures, each from a list of judged cases, with a 90 % interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import TypeVar

import numpy as np

from app.benchmark.cases import BLIND, SAME
from app.benchmark.run import BenchmarkRequest, Done
from app.benchmark.scoring.judged import STRONG, Row, group_of, known_floors, rows_of
from gearsig.checks import FloatArray
from gearsig.gap import GapOutcome, Shrinkage
from sims.blind import MECHANICAL

# --------------------
# 90 % intervals of shares and of anything that is computed from a list of cases.
# --------------------


Z = 1.6448536269514722
"""Two-sided 90 % of the normal distribution."""

N_RESAMPLES = 500

T = TypeVar("T")


@dataclass(frozen=True)
class Score:
    """A figure with its 90 % interval and the number of cases it is made of.

    Parameters
    ----------
    value, low, high : float
        nan without cases.
    n : int
    """

    value: float
    low: float
    high: float
    n: int


NOTHING = Score(float("nan"), float("nan"), float("nan"), 0)


def share(n_hits: int, n: int) -> Score:
    """Return a share with Wilson's score interval.

    (p + z²/2n ± z √(p(1−p)/n + z²/4n²))/(1 + z²/n).

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference* (J. Am. Stat. Assoc.,
    1927).
    """
    if n == 0:
        return NOTHING
    p, z2 = n_hits / n, Z**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = Z * sqrt(p * (1 - p) / n + z2 / (4 * n**2)) / (1 + z2 / n)
    # Rounding may leave 1e-17 beyond the ends.
    return Score(p, max(0.0, min(middle - half, p)), min(1.0, max(middle + half, p)), n)


def resampled(
    rows: Sequence[T],
    statistic: Callable[[Sequence[T]], float],
    rng: np.random.Generator,
    *,
    centred: bool = False,
) -> Score:
    """Return a statistic with the 5 and 95 % quantiles over cases drawn with replacement.

    `centred` is for a sum of absolute errors, to which drawing adds errors of its own: the quantiles are moved by the
    difference of their mean from the value, not below 0.

    Source: B. Efron, R. J. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.
    """
    value = statistic(rows) if rows else float("nan")
    if not isfinite(value):
        return NOTHING
    picks = rng.integers(len(rows), size=(N_RESAMPLES, len(rows)))
    resamples = [resampled_value for pick in picks if isfinite(resampled_value := statistic([rows[i] for i in pick]))]
    low, high = np.quantile(resamples, (0.05, 0.95))
    if centred:
        low, high = (max(0.0, value + q - float(np.mean(resamples))) for q in (low, high))
    return Score(value, float(low), float(high), len(rows))


def median_of(values: Sequence[float], rng: np.random.Generator) -> Score:
    """Return the median of the finite values, with its interval by `resampled`."""
    return resampled([v for v in values if isfinite(v)], lambda drawn: float(np.median(drawn)), rng)


# --------------------
# Whether probabilities are worth what they say: Brier score, calibration error, calibration curve.
# --------------------


N_BINS = 10
N_DRAWS = 500


@dataclass(frozen=True)
class CalibrationBin:
    """Answers of nearly the same confidence.

    Parameters
    ----------
    confidence : float
        Mean probability of the likeliest cause.
    accuracy : float
        Share of those that were right.
    n : int
    """

    confidence: float
    accuracy: float
    n: int


def brier(probabilities: Mapping[str, float], truth: str) -> float:
    """Return Σ_k (p_k − y_k)² over all causes, 0 (sure and right) to 2 (sure and wrong).

    Source: G. W. Brier, *Verification of forecasts expressed in terms of probability* (Monthly Weather Review, 1950).
    """
    names = {*probabilities, truth}
    return float(sum((probabilities.get(name, 0.0) - (name == truth)) ** 2 for name in names))


def bins_of(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> list[CalibrationBin]:
    """Return bins with equally many answers, by rising confidence."""
    order = np.argsort(confidence, kind="stable")
    parts = np.array_split(order, min(n_bins, len(order))) if len(order) else []
    c, r = np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return [CalibrationBin(float(c[part].mean()), float(r[part].mean()), len(part)) for part in parts]


def calibration_error(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> float:
    """Return Σ_b (n_b/n) |accuracy_b − confidence_b| over bins of equal mass.

    It is above 0 by chance even if every probability is true: see `error_by_chance`.

    Source: M. P. Naeini, G. F. Cooper, M. Hauskrecht, *Obtaining well calibrated probabilities using Bayesian binning*
    (AAAI, 2015), with bins of equal mass.
    """
    bins = bins_of(confidence, right, n_bins)
    total = sum(b.n for b in bins)
    return sum(b.n * abs(b.accuracy - b.confidence) for b in bins) / total if total else float("nan")


def error_by_chance(confidence: Sequence[float], rng: np.random.Generator) -> float:
    """Return the calibration error that true probabilities would show with so many answers, on average."""
    if not len(confidence):
        return float("nan")
    values: FloatArray = np.asarray(confidence, dtype=np.float64)
    drawn = rng.random((N_DRAWS, len(values))) < values
    return float(np.mean([calibration_error(confidence, row.tolist()) for row in drawn]))


Rows = Sequence[Row]
Measure = Callable[[Rows, np.random.Generator], Score]


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Parameters
    ----------
    key : str
        In scores.json.
    title : str
    measure : callable
        (rows, rng) → Score.
    is_share : bool
        Shown in per cent; False: as a number.
    targets : (float, float) or None
        Without and with reference, for strong faults.
    is_least : bool
        Whether the target is the least (True) or the most that is allowed.
    """

    key: str
    title: str
    measure: Measure
    is_share: bool = True
    targets: tuple[float, float] | None = None
    is_least: bool = True


def counted(of: Callable[[Row], bool], hit: Callable[[Row], bool]) -> Measure:
    """Return the measure that counts hits among the rows it applies to."""

    def measure(rows: Rows, rng: np.random.Generator) -> Score:  # noqa: ARG001 - all measures have one form
        applicable = [row for row in rows if of(row)]
        return share(sum(hit(row) for row in applicable), len(applicable))

    return measure


def _resampled(of: Callable[[Row], bool], statistic: Callable[[Rows], float], *, centred: bool = False) -> Measure:
    def measure(rows: Rows, rng: np.random.Generator) -> Score:
        return resampled([row for row in rows if of(row)], statistic, rng, centred=centred)

    return measure


def mean_of(value: Callable[[Row], float]) -> Measure:
    """Return the mean over the rows that have the value."""

    def measure(rows: Rows, rng: np.random.Generator) -> Score:
        values = [x for row in rows if isfinite(x := value(row))]
        return resampled(values, lambda drawn: float(np.mean(drawn)), rng)

    return measure


def _median(value: Callable[[Row], float]) -> Measure:
    return lambda rows, rng: median_of([value(row) for row in rows], rng)


def _of_place(part: str) -> Measure:
    """Return the share of faults whose place of this kind was found."""

    def at(row: Row) -> bool | None:
        is_right: bool | None = getattr(row.located, part)
        return is_right

    return counted(lambda r: r.is_mechanical and at(r) is not None, lambda r: bool(at(r)))


def is_one_answer(row: Row) -> bool:
    """Whether exactly one cause is right, so that a probability can be judged."""
    return row.kind != "pair" and bool(row.ranked)


def macro_f1(rows: Rows) -> float:
    """Return the mean over the mechanical effects of 2 TP/(2 TP + FP + FN), of the likeliest causes.

    Healthy, unknown and chain cases count as what they are: an effect named there is a false positive. Effects without
    a case are left out.
    """
    true = Counter(name for row in rows for name in row.truths)
    answered = Counter(row.first for row in rows)
    hits = Counter(row.first for row in rows if row.first in row.truths)
    f1_scores = [2.0 * hits[name] / (true[name] + answered[name]) for name in MECHANICAL if true[name]]
    return sum(f1_scores) / len(f1_scores) if f1_scores else float("nan")


def ece(rows: Rows) -> float:
    """Return the calibration error of the likeliest causes."""
    return calibration_error([r.confidence for r in rows], [r.first in r.truths for r in rows])


def brier_of(row: Row) -> float:
    """Return the Brier score of a case with one right answer; nan for the others."""
    if not is_one_answer(row):
        return float("nan")
    return brier({c.name: c.probability for c in row.answer.causes}, row.truths[0])


def shrink_of(row: Row, name: str) -> float:
    """Return the held-out shrink of a cause; nan where it was not tried."""
    shrinkage = row.answer.shrinkage(name)
    return float("nan") if shrinkage is None else shrinkage.shrink.value


def _shrink_true(row: Row) -> float:
    return shrink_of(row, row.effects[0]) if row.is_mechanical else float("nan")


def _shrink_named(row: Row) -> float:
    return shrink_of(row, row.named) if row.named and row.is_mechanical else float("nan")


def _closed_beyond_wrong(row: Row) -> float:
    """Return the share of the gap that the true effect closes, less the best wrong one's, on all tried features.

    nan where the true effect, or no other one, was tried.
    """
    shares = {
        cause.name: cause.shrinkage.of_all
        for cause in row.answer.causes
        if cause.shrinkage is not None and cause.shrinkage.of_all is not None
    }
    true = shares.pop(row.effects[0], None) if row.is_mechanical else None
    return float("nan") if true is None or not shares else true - max(shares.values())


def _placebo(row: Row) -> float:
    shrinkage = _of_true(row)
    return shrinkage.placebo if shrinkage is not None and shrinkage.n_placebos else float("nan")


def _slope(row: Row) -> float:
    shrinkage = _of_true(row)
    return shrinkage.slope if shrinkage is not None else float("nan")


def _of_true(row: Row) -> Shrinkage | None:
    return row.answer.shrinkage(row.effects[0]) if row.is_mechanical else None


def _regret(row: Row) -> float:
    """Return by how much the named effect shrinks the gap less than the true one; 0 where it does no worse."""
    return float(np.maximum(0.0, _shrink_true(row) - _shrink_named(row)))  # nan stays nan


FIGURES: tuple[Figure, ...] = (
    Figure(
        "top_1",
        "likeliest cause right (16 mechanical effects)",
        counted(lambda r: r.is_mechanical, lambda r: r.first in r.truths),
        targets=(0.80, 0.90),
    ),
    Figure(
        "top_2",
        "among the two likeliest",
        counted(lambda r: r.is_mechanical, lambda r: r.truths[0] in r.ranked[:2]),
        targets=(0.92, 0.97),
    ),
    Figure(
        "group",
        "right group",
        counted(lambda r: r.is_mechanical, lambda r: group_of(r.first) == group_of(r.truths[0])),
        targets=(0.90, 0.96),
    ),
    Figure(
        "top_1_of_16",
        "likeliest right if only the 16 could be",
        counted(lambda r: r.is_mechanical, lambda r: r.first_mechanical in r.truths),
    ),
    Figure(
        "named",
        "mechanical effect there: one is named",
        counted(lambda r: r.is_mechanical, lambda r: bool(r.named)),
    ),
    Figure(
        "macro_f1", "macro-F1 of the 16 (no pairs)", _resampled(lambda r: r.kind != "pair", macro_f1), is_share=False
    ),
    Figure(
        "named_on_none",
        "healthy: an effect is named",
        counted(lambda r: r.kind == "none", lambda r: bool(r.named)),
        targets=(0.05, 0.05),
        is_least=False,
    ),
    Figure(
        "named_on_unknown",
        "unknown: an effect is named all the same",
        counted(lambda r: r.kind == "unknown", lambda r: bool(r.named)),
        targets=(0.20, 0.15),
        is_least=False,
    ),
    Figure(
        "unknown_recognised",
        "unknown: recognised",
        counted(lambda r: r.kind == "unknown", lambda r: r.answer.outcome == GapOutcome.UNKNOWN.value),
    ),
    Figure(
        "named_on_chain",
        "measurement chain only: a mechanical effect is named",
        counted(lambda r: r.is_nuisance, lambda r: bool(r.named)),
    ),
    Figure(
        "chain_right",
        "measurement chain only: likeliest cause right",
        counted(lambda r: r.is_nuisance, lambda r: r.first in r.truths),
    ),
    Figure(
        "pair_top_1",
        "two effects: likeliest is one of them",
        counted(lambda r: r.kind == "pair", lambda r: r.first in r.truths),
    ),
    Figure(
        "pair_top_2",
        "two effects: both are the two likeliest",
        counted(lambda r: r.kind == "pair", lambda r: set(r.ranked[:2]) == set(r.truths)),
    ),
    Figure(
        "ece",
        "calibration error, 10 equal bins",
        _resampled(is_one_answer, ece, centred=True),
        is_share=False,
        targets=(0.06, 0.06),
        is_least=False,
    ),
    Figure("brier", "Brier score (0 to 2)", mean_of(brier_of), is_share=False),
    Figure("tooth", "right tooth, within one", _of_place("tooth")),
    Figure("shaft", "right shaft", _of_place("shaft")),
    Figure("bearing", "right bearing", _of_place("bearing")),
    Figure("order", "right order", _of_place("order")),
    Figure(
        "shrink_true",
        "held-out shrink by the true effect, median",
        _median(_shrink_true),
        is_share=False,
        targets=(0.60, 0.70),
    ),
    Figure("shrink_named", "held-out shrink by the named effect, median", _median(_shrink_named), is_share=False),
    Figure(
        "placebo",
        "held-out shrink by its placebos, median",
        _median(_placebo),
        is_share=False,
        targets=(0.10, 0.10),
        is_least=False,
    ),
    Figure(
        "regret",
        "regret of shrink, mean",
        mean_of(_regret),
        is_share=False,
        targets=(0.08, 0.05),
        is_least=False,
    ),
    Figure(
        "closed",
        "share closed on all tried features, held out: true less best wrong effect, median",
        _median(_closed_beyond_wrong),
        is_share=False,
        targets=(0.20, 0.20),
    ),
    Figure("slope", "observed over predicted change, median", _median(_slope), is_share=False),
    Figure("answered", "answered at all", counted(lambda _: True, lambda r: bool(r.answer.outcome))),
)


def scores(rows: Rows, seed: int, figures: Sequence[Figure] = FIGURES) -> dict[str, Score]:
    """Return every figure of these rows; nothing where no row applies."""
    return {f.key: f.measure(rows, np.random.default_rng(seed)) if rows else NOTHING for f in figures}


def strong_only(rows: Rows, min_strength: float) -> list[Row]:
    """Return the cases whose fault is this strong, and those without one."""
    return [row for row in rows if row.kind == "none" or row.strength >= min_strength]


def judgement(score: Score, target: float, *, is_least: bool) -> str:
    """Return "met", "missed", or "open" where the interval holds the target; empty without cases."""
    if not score.n:
        return ""
    if score.low < target < score.high:
        return "open"
    return "met" if score.value == target or (score.value > target) == is_least else "missed"


# --------------------
# The parts of the cases that are scored one by one, and the whole result.
# --------------------


WITHOUT, WITH = "without reference", "with reference"
PARTS: dict[str, Callable[[Row], bool]] = {
    "all": lambda _: True,
    WITHOUT: lambda row: not row.has_reference,
    WITH: lambda row: row.has_reference,
    "one condition": lambda row: row.n_conditions == 1,
    "two conditions": lambda row: row.n_conditions == 2,
}
"""Name → whether a case belongs to it."""


@dataclass(frozen=True)
class Part:
    """The figures of one part of the cases.

    Parameters
    ----------
    diagnoser, source, name : str
    strong : bool
        Whether faults below `STRONG` are left out.
    n : int
        Cases.
    scores : mapping of str to Score
    """

    diagnoser: str
    source: str
    name: str
    strong: bool
    n: int
    scores: Mapping[str, Score]


@dataclass(frozen=True)
class BenchmarkResult:
    """A benchmark's outcome.

    Parameters
    ----------
    request : BenchmarkRequest
    rows : mapping
        Diagnoser → its rows.
    parts : tuple of Part
    chance_error : float
        Calibration error that true probabilities would show with so many cases.
    figures : tuple of Figure
    """

    request: BenchmarkRequest
    rows: Mapping[str, Sequence[Row]]
    parts: tuple[Part, ...]
    chance_error: float
    figures: Sequence[Figure] = FIGURES

    @property
    def judged(self) -> str:
        """The diagnoser under judgement."""
        return self.request.diagnosers[0]

    @property
    def strengths_known(self) -> bool:
        """Whether faults have a strength in floors; if not, figures are of all faults."""
        return any(isfinite(row.strength) for row in self.rows[self.judged])

    def part(self, name: str, *, diagnoser: str = "", source: str = BLIND, strong: bool | None = None) -> Part:
        """Return a part; `strong` None: strong faults only, where strength is known."""
        strong_only_part = self.strengths_known if strong is None else strong
        chosen_diagnoser = diagnoser or self.judged
        return next(
            p
            for p in self.parts
            if (p.diagnoser, p.source, p.name, p.strong) == (chosen_diagnoser, source, name, strong_only_part)
        )


def judge(request: BenchmarkRequest, cases: Sequence[Done]) -> BenchmarkResult:
    """Score all answers."""
    floors = known_floors()
    rows = {name: rows_of(cases, name, floors) for name in request.diagnosers}
    first = rows[request.diagnosers[0]]
    parts = score_parts(request, rows, PARTS, FIGURES, (True, False))
    confidence = [r.confidence for r in first if r.source == BLIND and is_one_answer(r)]
    chance_error = error_by_chance(confidence, np.random.default_rng(request.plan.seed))
    return BenchmarkResult(request, rows, parts, chance_error)


def score_parts(
    request: BenchmarkRequest,
    rows: Mapping[str, Rows],
    parts: Mapping[str, Callable[[Row], bool]],
    figures: Sequence[Figure],
    strengths: Sequence[bool],
) -> tuple[Part, ...]:
    """Return the figures of every part of the cases, by diagnoser and source, of strong faults only and of all."""
    scored = []
    for name, of_all in rows.items():
        for source in (BLIND, SAME) if request.plan.same_simulator else (BLIND,):
            for part, belongs in parts.items():
                rows_of_part = [row for row in of_all if row.source == source and belongs(row)]
                for strong in strengths:
                    chosen = strong_only(rows_of_part, STRONG) if strong else rows_of_part
                    figured = scores(chosen, request.plan.seed, figures)
                    scored.append(Part(name, source, part, strong, len(chosen), figured))
    return tuple(scored)
