"""Scores of a benchmark: comparison of answer and truth, and figures over many cases with 90 % intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.cases import BLIND, SAME, Truth
from app.benchmark.run import BenchmarkRequest, Done
from gearsig.checks import FloatArray
from gearsig.gap import (
    NONE,
    UNKNOWN,
    GapOutcome,
    GapPlace,
    PlaceKind,
    Shrinkage,
    StructuralFloor,
    load_learned,
    soft_size,
)
from sims.blind import CATALOGUE, MECHANICAL

# --------------------
# Whether the fault was located correctly: tooth, shaft, bearing, order.
# --------------------


SHAFT_OF = {"pinion": "input", "wheel": "output", "driver": "input", "driven": "output"}
"""Shaft of a gear, under the names used by the labels and by the answers."""

ORDER_TOLERANCE = 0.02
"""Relative tolerance of an order; wide enough for slip in bearings."""


@dataclass(frozen=True)
class Located:
    """Whether each part of the location is right; None if the case has no such location.

    Parameters
    ----------
    tooth : bool or None
        Within one tooth; the angle can be known only for teeth of a shaft with a mark.
    shaft : bool or None
    bearing : bool or None
        The two bearings of a shaft are identical on the blind rig: either counts.
    order : bool or None
    """

    tooth: bool | None = None
    shaft: bool | None = None
    bearing: bool | None = None
    order: bool | None = None


def located(place: Mapping[str, Any], effect: str, answer: Answer, pair: Mapping[str, float]) -> Located:
    """Compare the location in the label with the answer.

    The fitted setting of the true effect counts, if it was tried; what it does not state is taken from the places of
    the gap, the one with the largest share first. What neither states counts as wrong.

    Parameters
    ----------
    place : mapping
        Location in the label.
    effect : str
    answer : Answer
    pair : mapping
        Tooth counts: z1 on the input shaft, z2 on the output shaft.
    """
    options, places = answer.options(effect), answer.places
    shaft = str(place.get("shaft", ""))
    per_input = pair["z1"] / pair["z2"] if shaft == "output" else 1.0
    return Located(
        tooth=_tooth(float(place["angle_deg"]), options, places, int(pair["z1"])) if "angle_deg" in place else None,
        shaft=_shaft(options, places) == shaft if shaft else None,
        bearing=_bearing_shaft(options) == shaft if "bearing" in place else None,
        order=_order(float(place["order"]) * per_input, options, places) if "order" in place else None,
    )


def _tooth(angle_deg: float, options: Mapping[str, Any], places: tuple[GapPlace, ...], n_teeth: int) -> bool:
    pitch = 360.0 / n_teeth
    angles = [p.angle_deg for p in places if p.kind is PlaceKind.TOOTH and p.shaft == "input"]
    answered_deg = next((a for a in angles if a is not None), None)
    if answered_deg is None and options.get("gear") == "driver" and "tooth" in options:
        answered_deg = (float(options["tooth"]) - 0.5) * pitch
    if answered_deg is None:
        return False
    apart = abs((answered_deg - angle_deg + 180.0) % 360.0 - 180.0)
    return apart <= 1.5 * pitch


def _shaft(options: Mapping[str, Any], places: tuple[GapPlace, ...]) -> str:
    for name in ("gear", "shaft"):
        if name in options:
            return SHAFT_OF.get(str(options[name]), str(options[name]))
    return _bearing_shaft(options) or next((p.shaft for p in places if p.shaft), "")


def _bearing_shaft(options: Mapping[str, Any]) -> str:
    """Return the shaft of the named bearing: the blind rig has 1 and 2 on its input shaft, 3 and 4 on the output."""
    number = str(options.get("bearing", "")).rpartition(" ")[2]
    return ("input" if int(number) <= 2 else "output") if number.isdigit() else ""


def _order(order: float, options: Mapping[str, Any], places: tuple[GapPlace, ...]) -> bool:
    """Return whether the order (of the input shaft) of the setting, else of the first place, is right."""
    stated_orders = [float(options["order"])] if "order" in options else [o for p in places[:1] for o in p.orders]
    return any(abs(value - order) <= ORDER_TOLERANCE * order for value in stated_orders)


# --------------------
# Strength of a case's fault, measured against its twin: the same run from the same seeds without the fault.
# --------------------


STRONG = 3.0
"""Strength, in structural floors, from which a fault should be found."""

Floors = Mapping[bool, StructuralFloor]
"""Structural floors with a reference (True) and without (False)."""


def known_floors() -> Floors:
    """Return the structural floors that the diagnosis uses."""
    learned = load_learned()
    return {with_reference: learned.floor(with_reference=with_reference) for with_reference in (False, True)}


def strength(truth: Truth, floors: Floors) -> float:
    """Return the size of the change caused by the fault alone, in structural floors; nan if it cannot be measured.

    It is measured like the whole gap, see `gearsig.gap.gap_size`; with two conditions the larger value counts.
    """
    floor = floors[bool(truth.labels["has_reference"])]
    known = [name for name in floor.names if all(name in change for change in truth.fault_changes)]
    floors_of_known = floor.of(known)
    sizes = [
        soft_size(known, np.array([change[name] for name in known]) / floors_of_known) / floor.floor_size(known)
        for change in truth.fault_changes
        if change
    ]
    return max(sizes, default=float("nan"))


@dataclass(frozen=True)
class Row:
    """One case with one diagnoser's answer.

    Parameters
    ----------
    number : int
    source, kind : str
    effects : tuple of str
        Simulated effects.
    truths : tuple of str
        Correct causes: the effects, "none" or "unknown".
    level, strength : float
        Of the fault: 0 to 1 within its span, and in structural floors.
    has_reference : bool
    n_conditions : int
    answer : Answer
    located : Located
    """

    number: int
    source: str
    kind: str
    effects: tuple[str, ...]
    truths: tuple[str, ...]
    level: float
    strength: float
    has_reference: bool
    n_conditions: int
    answer: Answer
    located: Located

    @cached_property
    def ranked(self) -> tuple[str, ...]:
        """Causes, most probable first."""
        return tuple(c.name for c in self.answer.ranked)

    @property
    def first(self) -> str:
        """The most probable cause; empty if there is no answer."""
        return self.ranked[0] if self.ranked else ""

    @property
    def confidence(self) -> float:
        """Probability of the most probable cause; nan if there is no answer."""
        return self.answer.probability(self.first) if self.ranked else float("nan")

    @property
    def first_mechanical(self) -> str:
        """The most probable mechanical effect."""
        return next((name for name in self.ranked if name in MECHANICAL), "")

    @property
    def named(self) -> str:
        """The mechanical effect that the verdict names, as the cause or as one of several inseparable causes."""
        first = tuple(c.name for c in self.answer.causes[:1])
        several = self.answer.inseparable or first
        named = {GapOutcome.EFFECT.value: first, GapOutcome.CANNOT_SEPARATE.value: several}
        return next((name for name in named.get(self.answer.outcome, ()) if name in MECHANICAL), "")

    @property
    def is_right(self) -> bool:
        """Whether the most probable cause is a correct one."""
        return self.first in self.truths

    @property
    def says_unknown(self) -> bool:
        """Whether the verdict is a cause outside the catalogue."""
        return self.answer.outcome == GapOutcome.UNKNOWN.value

    @property
    def is_mechanical(self) -> bool:
        """Whether the case has exactly one effect, and it is mechanical."""
        return self.kind == "single" and self.effects[0] in MECHANICAL

    @property
    def is_nuisance(self) -> bool:
        """Whether the only fault is in the measurement chain."""
        return self.kind == "single" and not self.is_mechanical


def rows_of(cases: Sequence[Done], diagnoser: str, floors: Floors) -> list[Row]:
    """Return one row per case for one diagnoser."""

    def on_gears(done: Done) -> Callable[[Mapping[str, Any], str, Answer], Located]:
        return lambda place, effect, answer: located(place, effect, answer, done.truth.labels["pair"])

    return [row_of(done, done.answers[diagnoser], strength(done.truth, floors), on_gears(done)) for done in cases]


def row_of(
    done: Done, answer: Answer, strength_floors: float, placed: Callable[[Mapping[str, Any], str, Answer], Located]
) -> Row:
    """Return the row of a case; `placed` compares the label's location with the answer, given the effect."""
    labels = done.truth.labels
    effects = tuple(e["name"] for e in labels["effects"])
    truths = {"none": (NONE,), "unknown": (UNKNOWN,)}.get(labels["kind"], effects)
    place = labels["effects"][0]["place"] if len(effects) == 1 else {}
    return Row(
        number=done.planned.number,
        source=done.planned.source,
        kind=labels["kind"],
        effects=effects,
        truths=truths,
        level=labels["effects"][0]["level"] if effects else float("nan"),
        strength=strength_floors,
        has_reference=labels["has_reference"],
        n_conditions=len(labels["conditions"]),
        answer=answer,
        located=placed(place, effects[0] if effects else "", answer),
    )


def group_of(cause: str) -> str:
    """Return the group of an effect; "none" and "unknown" are groups of their own."""
    return CATALOGUE[cause].group if cause in CATALOGUE else cause


# --------------------
# 90 % intervals of shares and of statistics computed from a list of cases.
# --------------------


N_RESAMPLES = 500

T = TypeVar("T")


@dataclass(frozen=True)
class Score:
    """A figure with its 90 % interval and the number of cases it is based on.

    Parameters
    ----------
    value, low, high : float
        nan if there are no cases.
    n : int
    """

    value: float
    low: float
    high: float
    n: int


NO_SCORE = Score(float("nan"), float("nan"), float("nan"), 0)


def share(n_hits: int, n: int) -> Score:
    """Return the share n_hits/n with Wilson's 90 % score interval.

    Source: E. B. Wilson, *Probable inference, the law of succession, and statistical inference* (J. Am. Stat. Assoc.,
    1927).
    """
    from scipy.stats import binomtest

    if n == 0:
        return NO_SCORE
    interval = binomtest(n_hits, n).proportion_ci(0.9, method="wilson")
    return Score(n_hits / n, float(interval.low), float(interval.high), n)


def resampled(
    rows: Sequence[T],
    statistic: Callable[[Sequence[T]], float],
    rng: np.random.Generator,
    *,
    centred: bool = False,
) -> Score:
    """Return a statistic with its 5 and 95 % quantiles over cases drawn with replacement (bootstrap).

    `centred` is for a sum of absolute errors, which resampling increases: the quantiles are shifted by the difference
    between the resampled mean and the value, but not below 0.

    Source: B. Efron, R. J. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.
    """
    value = statistic(rows) if rows else float("nan")
    if not isfinite(value):
        return NO_SCORE
    picks = rng.integers(len(rows), size=(N_RESAMPLES, len(rows)))
    resamples = [resampled_value for pick in picks if isfinite(resampled_value := statistic([rows[i] for i in pick]))]
    low, high = np.quantile(resamples, (0.05, 0.95))
    if centred:
        low, high = (max(0.0, value + q - float(np.mean(resamples))) for q in (low, high))
    return Score(value, float(low), float(high), len(rows))


def median_of(values: Sequence[float], rng: np.random.Generator) -> Score:
    """Return the median of the finite values, with its bootstrap interval from `resampled`."""
    return resampled([v for v in values if isfinite(v)], lambda drawn: float(np.median(drawn)), rng)


# --------------------
# Quality of the probabilities: Brier score, calibration error, calibration curve.
# --------------------


N_BINS = 10
N_DRAWS = 500


@dataclass(frozen=True)
class CalibrationBin:
    """Answers of similar confidence.

    Parameters
    ----------
    confidence : float
        Mean probability of the most probable cause.
    accuracy : float
        Share of correct answers.
    n : int
    """

    confidence: float
    accuracy: float
    n: int


def brier(probabilities: Mapping[str, float], truth: str) -> float:
    """Return Σ_k (p_k − y_k)² over all causes, 0 (certain and right) to 2 (certain and wrong).

    Source: G. W. Brier, *Verification of forecasts expressed in terms of probability* (Monthly Weather Review, 1950).
    """
    names = {*probabilities, truth}
    return float(sum((probabilities.get(name, 0.0) - (name == truth)) ** 2 for name in names))


def bins_of(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> list[CalibrationBin]:
    """Return bins with equal numbers of answers, in order of confidence."""
    order = np.argsort(confidence, kind="stable")
    parts = np.array_split(order, min(n_bins, len(order))) if len(order) else []
    c, r = np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=np.float64)
    return [CalibrationBin(float(c[part].mean()), float(r[part].mean()), len(part)) for part in parts]


def calibration_error(confidence: Sequence[float], right: Sequence[bool], n_bins: int = N_BINS) -> float:
    """Return Σ_b (n_b/n) |accuracy_b − confidence_b| over bins of equal mass.

    It exceeds 0 by chance even if every probability is correct: see `error_by_chance`.

    Source: M. P. Naeini, G. F. Cooper, M. Hauskrecht, *Obtaining well calibrated probabilities using Bayesian binning*
    (AAAI, 2015), with bins of equal mass.
    """
    bins = bins_of(confidence, right, n_bins)
    total = sum(b.n for b in bins)
    return sum(b.n * abs(b.accuracy - b.confidence) for b in bins) / total if total else float("nan")


def error_by_chance(confidence: Sequence[float], rng: np.random.Generator) -> float:
    """Return the expected calibration error of correct probabilities for this number of answers."""
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
        Key in scores.json.
    title : str
    measure : callable
        (rows, rng) → Score.
    is_share : bool
        True: shown in per cent; False: as a number.
    targets : (float, float) or None
        Targets without and with reference, for strong faults.
    is_least : bool
        Whether the target is a minimum (True) or a maximum.
    """

    key: str
    title: str
    measure: Measure
    is_share: bool = True
    targets: tuple[float, float] | None = None
    is_least: bool = True


def counted(of: Callable[[Row], bool], hit: Callable[[Row], object]) -> Measure:
    """Return a measure: the share of hits among the rows selected by `of`."""

    def measure(rows: Rows, rng: np.random.Generator) -> Score:  # noqa: ARG001 - all measures have one form
        applicable = [row for row in rows if of(row)]
        return share(sum(bool(hit(row)) for row in applicable), len(applicable))

    return measure


def _resampled(of: Callable[[Row], bool], statistic: Callable[[Rows], float], *, centred: bool = False) -> Measure:
    def measure(rows: Rows, rng: np.random.Generator) -> Score:
        return resampled([row for row in rows if of(row)], statistic, rng, centred=centred)

    return measure


def mean_of(value: Callable[[Row], float]) -> Measure:
    """Return a measure: the mean over the rows that have a finite value."""

    def measure(rows: Rows, rng: np.random.Generator) -> Score:
        values = [x for row in rows if isfinite(x := value(row))]
        return resampled(values, lambda drawn: float(np.mean(drawn)), rng)

    return measure


def _median(value: Callable[[Row], float]) -> Measure:
    return lambda rows, rng: median_of([value(row) for row in rows], rng)


def _of_place(part: str) -> Measure:
    """Return a measure: the share of faults whose location of this kind was found."""
    at = attrgetter(f"located.{part}")
    return counted(lambda r: r.is_mechanical and at(r) is not None, at)


def is_one_answer(row: Row) -> bool:
    """Return whether exactly one cause is correct, so that a probability can be judged."""
    return row.kind != "pair" and bool(row.ranked)


def macro_f1(rows: Rows) -> float:
    """Return the mean over the mechanical effects of 2 TP/(2 TP + FP + FN), based on the most probable causes.

    An effect named for a healthy, unknown or measurement-chain case is a false positive. Effects without a case are
    left out.
    """
    true = Counter(name for row in rows for name in row.truths)
    answered = Counter(row.first for row in rows)
    hits = Counter(row.first for row in rows if row.is_right)
    f1_scores = [2.0 * hits[name] / (true[name] + answered[name]) for name in MECHANICAL if true[name]]
    return sum(f1_scores) / len(f1_scores) if f1_scores else float("nan")


def confidence_of(rows: Rows) -> tuple[list[float], list[bool]]:
    """Return the probability of each most probable cause, and whether it was right."""
    return [row.confidence for row in rows], [row.is_right for row in rows]


def ece(rows: Rows) -> float:
    """Return the calibration error of the most probable causes."""
    return calibration_error(*confidence_of(rows))


def brier_of(row: Row) -> float:
    """Return the Brier score of a case with one correct answer; nan for the others."""
    if not is_one_answer(row):
        return float("nan")
    return brier({c.name: c.probability for c in row.answer.causes}, row.truths[0])


def shrink_of(row: Row, name: str) -> float:
    """Return the held-out shrink of a cause; nan if it was not tried."""
    shrinkage = row.answer.shrinkage(name)
    return float("nan") if shrinkage is None else shrinkage.shrink.value


def _of_true(row: Row) -> Shrinkage | None:
    return row.answer.shrinkage(row.effects[0]) if row.is_mechanical else None


def _shrink_true(row: Row) -> float:
    return shrink_of(row, row.effects[0]) if row.is_mechanical else float("nan")


def _shrink_named(row: Row) -> float:
    return shrink_of(row, row.named) if row.named and row.is_mechanical else float("nan")


def _closed_beyond_wrong(row: Row) -> float:
    """Return the share of the gap that the true effect closes minus that of the best wrong one, on all tried features.

    nan if the true effect was not tried, or no other one.
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


def _regret(row: Row) -> float:
    """Return by how much the named effect shrinks the gap less than the true one; 0 if it does as well or better."""
    return float(np.maximum(0.0, _shrink_true(row) - _shrink_named(row)))  # nan stays nan


def is_kind(kind: str) -> Callable[[Row], bool]:
    """Return a predicate that selects cases of this kind."""
    return lambda row: row.kind == kind


is_right, says_unknown = attrgetter("is_right"), attrgetter("says_unknown")
_is_mechanical, _is_nuisance, _is_named = (attrgetter(name) for name in ("is_mechanical", "is_nuisance", "named"))


FIGURES: tuple[Figure, ...] = (
    Figure(
        "top_1",
        "likeliest cause right (16 mechanical effects)",
        counted(_is_mechanical, is_right),
        targets=(0.80, 0.90),
    ),
    Figure(
        "top_2",
        "among the two likeliest",
        counted(_is_mechanical, lambda r: r.truths[0] in r.ranked[:2]),
        targets=(0.92, 0.97),
    ),
    Figure(
        "group",
        "right group",
        counted(_is_mechanical, lambda r: group_of(r.first) == group_of(r.truths[0])),
        targets=(0.90, 0.96),
    ),
    Figure(
        "top_1_of_16",
        "likeliest right if only the 16 were possible",
        counted(_is_mechanical, lambda r: r.first_mechanical in r.truths),
    ),
    Figure("named", "mechanical effect present: one is named", counted(_is_mechanical, _is_named)),
    Figure(
        "macro_f1", "macro-F1 of the 16 (no pairs)", _resampled(lambda r: r.kind != "pair", macro_f1), is_share=False
    ),
    Figure(
        "named_on_none",
        "healthy: an effect is named",
        counted(is_kind("none"), _is_named),
        targets=(0.05, 0.05),
        is_least=False,
    ),
    Figure(
        "named_on_unknown",
        "unknown: an effect is named",
        counted(is_kind("unknown"), _is_named),
        targets=(0.20, 0.15),
        is_least=False,
    ),
    Figure("unknown_recognised", "unknown: recognised", counted(is_kind("unknown"), says_unknown)),
    Figure("named_on_chain", "measurement chain only: a mechanical effect is named", counted(_is_nuisance, _is_named)),
    Figure("chain_right", "measurement chain only: likeliest cause right", counted(_is_nuisance, is_right)),
    Figure("pair_top_1", "two effects: the likeliest is one of them", counted(is_kind("pair"), is_right)),
    Figure(
        "pair_top_2",
        "two effects: both are the two likeliest",
        counted(is_kind("pair"), lambda r: set(r.ranked[:2]) == set(r.truths)),
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
    Figure("regret", "regret of shrink, mean", mean_of(_regret), is_share=False, targets=(0.08, 0.05), is_least=False),
    Figure(
        "closed",
        "held-out share closed on all tried features: true minus best wrong effect, median",
        _median(_closed_beyond_wrong),
        is_share=False,
        targets=(0.20, 0.20),
    ),
    Figure("slope", "observed over predicted change, median", _median(_slope), is_share=False),
    Figure("answered", "answered", counted(lambda _: True, lambda r: r.answer.outcome)),
)


def scores(rows: Rows, seed: int, figures: Sequence[Figure] = FIGURES) -> dict[str, Score]:
    """Return every figure of these rows, without those to which no row applies."""
    return {f.key: f.measure(rows, np.random.default_rng(seed)) if rows else NO_SCORE for f in figures}


def strong_only(rows: Rows, min_strength: float) -> list[Row]:
    """Return the cases whose fault has at least this strength, and those without a fault."""
    return [row for row in rows if row.kind == "none" or row.strength >= min_strength]


def judgement(score: Score, target: float, *, is_least: bool) -> str:
    """Return "met", "missed", or "open" if the interval contains the target; empty if there are no cases."""
    if not score.n:
        return ""
    if score.low < target < score.high:
        return "open"
    return "met" if score.value == target or (score.value > target) == is_least else "missed"


# --------------------
# The parts of the cases, each scored separately, and the whole result.
# --------------------


WITHOUT, WITH = "without reference", "with reference"
PARTS: dict[str, Callable[[Row], bool]] = {
    "all": lambda _: True,
    WITHOUT: lambda row: not row.has_reference,
    WITH: lambda row: row.has_reference,
    "one condition": lambda row: row.n_conditions == 1,
    "two conditions": lambda row: row.n_conditions == 2,
}
"""Name → predicate that selects the cases of the part."""


@dataclass(frozen=True)
class Part:
    """The figures of one part of the cases.

    Parameters
    ----------
    diagnoser, source, name : str
    strong : bool
        Whether faults below `STRONG` are left out.
    n : int
        Number of cases.
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
        Expected calibration error of correct probabilities for this number of cases.
    figures : tuple of Figure
    """

    request: BenchmarkRequest
    rows: Mapping[str, Sequence[Row]]
    parts: tuple[Part, ...]
    chance_error: float
    figures: Sequence[Figure] = FIGURES

    @property
    def judged(self) -> str:
        """The diagnoser that is judged."""
        return self.request.diagnosers[0]

    @property
    def strengths_known(self) -> bool:
        """Whether fault strengths in floors are known; if not, figures cover all faults."""
        return any(isfinite(row.strength) for row in self.rows[self.judged])

    def part(self, name: str, *, diagnoser: str = "", source: str = BLIND, strong: bool | None = None) -> Part:
        """Return a part; `strong` None: only strong faults, if strength is known."""
        strong_only_part = self.strengths_known if strong is None else strong
        chosen_diagnoser = diagnoser or self.judged
        return next(
            p
            for p in self.parts
            if (p.diagnoser, p.source, p.name, p.strong) == (chosen_diagnoser, source, name, strong_only_part)
        )


def judge(request: BenchmarkRequest, cases: Sequence[Done]) -> BenchmarkResult:
    """Score all answers of a benchmark."""
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
    """Return the figures of every part by diagnoser and source, for strong faults only and for all faults."""
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
