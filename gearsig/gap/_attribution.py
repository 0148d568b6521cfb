"""Calibrated probabilities of the causes: from the forests or, for effects unknown to them, from a trial.

Trials of effects that the forests know show how far the gap shrinks. How well such an effect explains the gap could
count as well, but the calibration gives it the weight 0: on blind cases look-alikes shrink the gap as far as the true
effect does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from math import exp, log
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from gearsig.gap._conditions import LIGHT_LOAD_N_PER_MM, Condition
from gearsig.gap._floors import kinds_of
from gearsig.gap._labelled import LabelledChange, LabelledEvidence, labelled_evidence, with_labelled
from gearsig.gap._places import SAME_ORDER
from gearsig.gap._reduction import GearFrame
from gearsig.gap._report import (
    LIKELIER_THAN_NOT,
    NONE,
    SETTLED,
    UNKNOWN,
    GapCause,
    GapOutcome,
    GapPlace,
    Interval,
    PlaceKind,
    Shrinkage,
    group_probabilities,
    likeliest_first,
    scaled,
    shares_of,
)
from gearsig.gap._simulator import GapEffect, Twin
from gearsig.gap._trials import TriedEffect, try_effects
from gearsig.severity import OTHER, SINGLE_TOOTH_FAULTS, TOOTH_FAULTS

CALIBRATION_FILE = Path(__file__).with_name("calibration.json")

SIZES = (0.3, 6.0)
"""Limits of the gap's size in the calibration, in structural floors."""


@dataclass(frozen=True)
class GapCalibration:
    """p ∝ exp(a m s^κ ln p_forest + b (score − s0) + c[kind] + d[kind] ln s), s: the gap's size; fitted to known cases.

    Parameters
    ----------
    sharpness : float
        a.
    shrink_weight : float
        b; the score is the held-out shrink less that of the placebos. Only for effects that were tried.
    neutral_shrink : float
        s0, the score that is evidence neither for nor against the effect.
    none_bias, unknown_bias : float
        c of the two causes that are not effects.
    named_from : float
        Total probability of the machine's effects from which one is named.
    apart : float
        The most probable effect's share of the first two together from which it is named alone.
    effect_biases : mapping
        c of effects, 0 where missing. It corrects for effects that resemble the population's features more, or less,
        often on machines that others built.
    sharper, none_slope : float
        κ, and d of no gap: a large gap allows more certain statements, and makes "no gap" improbable.
    several : float
        m where there are several operating conditions, else 1: how much more evidence they give than one.
    """

    sharpness: float
    shrink_weight: float
    neutral_shrink: float
    none_bias: float
    unknown_bias: float
    named_from: float
    apart: float
    effect_biases: Mapping[str, float] = field(default_factory=dict)
    sharper: float = 0.0
    none_slope: float = 0.0
    several: float = 1.0

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> GapCalibration:
        """Build the calibration from the contents of a JSON file."""
        return cls(**{field.name: values[field.name] for field in fields(cls) if field.name in values})

    def to_mapping(self) -> dict[str, Any]:
        """Return plain values for a JSON file."""
        numbers = asdict(self)
        biases = numbers.pop("effect_biases")
        return {name: round(float(value), 4) for name, value in numbers.items()} | (
            {"effect_biases": biases} if biases else {}
        )

    def probabilities(
        self, forest: Mapping[str, float], scores: Mapping[str, float], size: float = 1.0, n_conditions: int = 1
    ) -> dict[str, float]:
        """Return cause → probability, most probable first.

        Parameters
        ----------
        forest : mapping
            Cause → probability from the forest.
        scores : mapping
            Effect → score, of the effects that were tried.
        size : float
            Size of the gap in structural floors.
        n_conditions : int
            Number of conditions joined in `forest`.
        """
        counted = float(np.clip(size, *SIZES))
        sharpness = self.sharpness * counted**self.sharper * (self.several if n_conditions > 1 else 1.0)
        levels = {
            name: sharpness * float(np.log(max(p, 1e-9)))
            + self.shrink_weight * (scores.get(name, self.neutral_shrink) - self.neutral_shrink)
            + self.effect_biases.get(name, 0.0)
            for name, p in forest.items()
        }
        levels[NONE] += self.none_bias + self.none_slope * float(np.log(counted))
        levels[UNKNOWN] += self.unknown_bias
        return shares_of(levels)

    def outcome(
        self, probabilities: Mapping[str, float], known: Mapping[str, GapEffect] = MappingProxyType({})
    ) -> GapOutcome:
        """Return the outcome; nothing is named that is less probable than all else together.

        Parameters
        ----------
        probabilities : mapping
            Cause → probability.
        known : mapping
            Effects by name. If the effects of one group are together more probable than all else, the kind of fault is
            named even where the effect is uncertain.
        """
        none, unknown = probabilities[NONE], probabilities[UNKNOWN]
        if max(none, unknown) >= LIKELIER_THAN_NOT:
            return GapOutcome.NO_GAP if none >= unknown else GapOutcome.UNKNOWN
        if 1.0 - none - unknown < self.named_from:
            return GapOutcome.UNDECIDED
        effects = {name: p for name, p in probabilities.items() if name not in (NONE, UNKNOWN)}
        first, *remaining = sorted(effects.values(), reverse=True)
        second = remaining[0] if remaining else 0.0
        if max(first + second, *group_probabilities(effects, known).values()) < LIKELIER_THAN_NOT:
            return GapOutcome.UNDECIDED
        alone = first >= LIKELIER_THAN_NOT and first / (first + second) >= self.apart
        return GapOutcome.EFFECT if alone else GapOutcome.CANNOT_SEPARATE


def score_of(shrink: float, placebo: float) -> float:
    """Return an effect's evidence from its held-out shrinkage s and that of its placebos p: s − max(p, 0) in −1 … 1.

    Parameters
    ----------
    shrink : float
        Share of the gap that the effect closes on held-out data, 1 − after²/before²; negative where the gap grows.
    placebo : float
        The same for the effect at wrong orders or on wrong shafts, which close part of it by chance.
    """
    return float(np.clip(shrink - max(placebo, 0.0), -1.0, 1.0))


@cache
def load_gap_calibration(*, with_reference: bool) -> GapCalibration:
    """Return the calibration shipped with this version."""
    return GapCalibration.from_mapping(
        calibration_values()["with_reference" if with_reference else "without_reference"]
    )


@cache
def calibration_values(file: Path = CALIBRATION_FILE) -> dict[str, Any]:
    """Return the contents of a calibration file: "with_reference", "without_reference" and "provenance"."""
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return values


NOT_SEEN = 0.2
"""Probability that an effect is too weak to be seen at one of several conditions: the most likely of 0, 0.1, 0.2 and
0.4 on the independent rig's machines at two points each, learned from the other simulators."""

NOT_SEEN_LOADED = {"backlash": 0.9}
"""The same at a condition whose load keeps the flanks in contact while another condition lets them separate."""


def joint_probabilities(
    per_condition: Sequence[Mapping[str, float]], loads_n_per_mm: Sequence[float], allowed: Collection[str]
) -> dict[str, float]:
    """Return the joint probabilities of n conditions, p ∝ Π p_i^(1/n): the logarithmic opinion pool.

    The conditions of one machine are strongly dependent: three carry little more log evidence than one, so their
    product is overconfident. The calibration holds how much more they carry. With several conditions an effect may be
    invisible at one of them with probability q: p_i(x|e) = (1 − q) p_forest(x|e) + q p_forest(x|none).

    Source: C. Genest, J. V. Zidek, "Combining probability distributions", Statistical Science 1 (1986).

    Parameters
    ----------
    per_condition : sequence of mapping
        Cause → probability, for each condition.
    loads_n_per_mm : sequence of float
        Tooth load at each condition; nan where not known.
    allowed : collection of str
        Allowed causes, including "none" and "unknown".
    """
    parts_somewhere = any(load <= LIGHT_LOAD_N_PER_MM for load in loads_n_per_mm)
    joint = dict.fromkeys(sorted(allowed), 1.0)
    for at, load in zip(per_condition, loads_n_per_mm, strict=True):
        loaded = parts_somewhere and load > LIGHT_LOAD_N_PER_MM
        for name in joint:
            unseen = 0.0 if len(per_condition) == 1 else NOT_SEEN_LOADED.get(name, NOT_SEEN) if loaded else NOT_SEEN
            joint[name] *= ((1.0 - unseen) * at[name] + unseen * at[NONE]) ** (1.0 / len(per_condition))
    total = sum(joint.values())
    return {name: p / total for name, p in joint.items()}


class Tried(Protocol):
    """A cause that was simulated and fitted."""

    @property
    def shrinkage(self) -> Shrinkage | None:
        """How far the gap shrinks with it, on held-out data."""
        ...


TriedT = TypeVar("TriedT", bound=Tried)


@dataclass(frozen=True)
class Attribution(Generic[TriedT]):
    """The evidence from which calibrated probabilities are computed.

    Parameters
    ----------
    uncalibrated : mapping
        Cause → probability, from the forests or from likelihoods.
    tried : dict
        Effect → its trial.
    calibration : GapCalibration
        The calibration for this kind of baseline.
    size : float
        Size of the gap in structural floors; with several conditions the largest.
    n_conditions : int
    untrained : tuple of str
        Effects unknown to the forests (the user's own), each of which should be tried.
    labelled : LabelledEvidence or None
        Evidence from labelled recordings of the rig.
    tooth_error_log_likelihoods : mapping
        Tooth fault or `OTHER` → log-likelihood of the change in transmission error; empty without encoders.
    """

    uncalibrated: Mapping[str, float]
    tried: dict[str, TriedT]
    calibration: GapCalibration
    size: float = 1.0
    n_conditions: int = 1
    untrained: tuple[str, ...] = ()
    labelled: LabelledEvidence | None = None
    tooth_error_log_likelihoods: Mapping[str, float] = field(default_factory=dict)

    @property
    def scores(self) -> dict[str, float]:
        """Effect → score from its held-out shrink."""
        known = ((name, tried.shrinkage) for name, tried in self.tried.items())
        return {name: score_of(s.shrink.value, s.placebo) for name, s in known if s is not None}

    @property
    def matches(self) -> dict[str, float]:
        """Tooth fault → log-likelihood of its waveform, of those that were tried."""
        known = ((name, getattr(tried, "match", None)) for name, tried in self.tried.items())
        return {name: match.log_likelihood for name, match in known if match is not None}

    def probabilities(self, calibration: GapCalibration | None = None) -> dict[str, float]:
        """Return cause → probability, most probable first; not calibrated for effects unknown to the forests."""
        posterior = (calibration or self.calibration).probabilities(
            self.uncalibrated, self.scores, self.size, self.n_conditions
        )
        if self.labelled is not None:
            posterior = with_labelled(posterior, self.labelled.ratios, self.labelled.alike)
        posterior = with_likelihoods(with_likelihoods(posterior, self.matches), self.tooth_error_log_likelihoods)
        return with_unknown_distributed(posterior, {n: self.scores[n] for n in self.untrained if n in self.tried})

    def outcome(
        self, probabilities: Mapping[str, float], known: Mapping[str, GapEffect] = MappingProxyType({})
    ) -> GapOutcome:
        """Return the outcome, see `GapCalibration.outcome`; a gap within its floor is none, if nothing is likelier.

        Healthy machines differ by as much.
        """
        outcome = self.calibration.outcome(probabilities, known)
        is_none = self.size <= 1.0 and probabilities[NONE] >= max(probabilities.values())
        return GapOutcome.NO_GAP if outcome is GapOutcome.UNDECIDED and is_none else outcome


MAX_TRIED, MIN_TRIED_PROBABILITY = 3, 0.06
"""The most probable effects to simulate: the maximum number, and the minimum probability."""


def with_likelihoods(probabilities: Mapping[str, float], matches: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities with those of tooth faults redistributed by likelihood, most probable first.

    p_i ∝ p_i L_i among those that have a likelihood; their sum is kept. The waveform distinguishes how a tooth is
    damaged; that a tooth is damaged follows from the features. The transmission error shows that as well: `OTHER` gives
    the likelihood of all causes without one of their own, and the sum changes. An unknown cause may be on a tooth or
    not: its likelihood is the mean of both.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    matches : mapping
        Effect → ln L.
    """
    likelihoods = dict(matches)
    if OTHER in matches:
        of_teeth = [value for name, value in matches.items() if name in SINGLE_TOOTH_FAULTS] or [matches[OTHER]]
        unknown = log(0.5 * (float(np.mean(np.exp(of_teeth))) + exp(matches[OTHER])))
        likelihoods = {**dict.fromkeys(probabilities, matches[OTHER]), UNKNOWN: unknown, **matches}
    counted = {name: value for name, value in likelihoods.items() if name in probabilities}
    if len(counted) < 2:
        return dict(probabilities)
    together = sum(probabilities[name] for name in counted)
    top = max(counted.values())
    weights = {name: probabilities[name] * exp(value - top) for name, value in counted.items()}
    total = sum(weights.values())
    parted = {name: together * weight / total for name, weight in weights.items()} if total > 0.0 else {}
    return likeliest_first({**probabilities, **parted})


def with_unknown_distributed(probabilities: Mapping[str, float], scores: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities including effects that only a trial supports, most probable first.

    They receive max_i s_i of the unknown probability, each in proportion to its s_i = max(score, 0): to the forests, a
    gap that none of their effects explains is unknown, even if another effect explains it.
    """
    positive = {name: max(score, 0.0) for name, score in scores.items()}
    total = sum(positive.values())
    passed_on = probabilities[UNKNOWN] * max(positive.values(), default=0.0)
    shared = {**probabilities, UNKNOWN: probabilities[UNKNOWN] - passed_on}
    shared |= {name: passed_on * score / total if total else 0.0 for name, score in positive.items()}
    return likeliest_first(shared)


def attribute(
    conditions: Sequence[Condition],
    known: Mapping[str, GapEffect],
    effects: Sequence[str],
    twin: Twin,
    cache: Path | None,
    on_progress: Callable[[str, float], object],
    *,
    max_tried: int = MAX_TRIED,
    fresh: bool = False,
    labelled: Sequence[LabelledChange] = (),
    tooth_error_log_likelihoods: Mapping[str, float] = MappingProxyType({}),
) -> Attribution[TriedEffect]:
    """Evaluate the forests and labelled recordings, then simulate, fit and score the `max_tried` likeliest effects.

    Effects unknown to the forests are tried as well, unless `max_tried` is 0.

    Parameters
    ----------
    conditions : sequence of Condition
        Of one machine, at one or several operating points.
    known : mapping
        Effect → `GapEffect` of the simulator.
    effects : sequence of str
        Effects that may be named; empty: all known ones.
    twin : Twin
        The simulator, set to the rig.
    cache : path or None
        Folder of simulated banks; None: nothing is kept.
    on_progress : callable
        Called with the current step in words and the fraction completed, 0 to 1.
    max_tried : int
        Number of effects to simulate, most probable first; 0: none, only the forests decide.
    fresh : bool
        Whether to simulate kept banks again.
    labelled : sequence of LabelledChange
        Changes in labelled recordings of the same rig.
    tooth_error_log_likelihoods : mapping
        Tooth fault or `OTHER` → ln L of the change in transmission error; empty without encoders.

    Returns
    -------
    Attribution
        Probabilities are computed on demand, see `Attribution.probabilities`.

    Raises
    ------
    RefusalError
        If the rig has a place for some of the most probable effects, but none of them can be simulated there.
    """
    forest = _forest(conditions, effects, known)
    with_reference = all(c.has_reference for c in conditions)
    size = max(condition.size.structural.value for condition in conditions)
    calibration = load_gap_calibration(with_reference=with_reference)
    evidence = labelled_evidence(conditions, labelled) if labelled else None
    log_likelihoods = {n: value for n, value in tooth_error_log_likelihoods.items() if n in forest or n == OTHER}
    attribution = Attribution[TriedEffect](
        forest, {}, calibration, size, len(conditions), labelled=evidence, tooth_error_log_likelihoods=log_likelihoods
    )
    first = attribution.probabilities()
    likely = [name for name, p in first.items() if name in known and p >= MIN_TRIED_PROBABILITY][:max_tried]
    trained = conditions[0].learned.causes
    untrained = [name for name in effects or known if name not in trained] if max_tried else []
    if max_tried and any(name in TOOTH_FAULTS for name in likely):
        # Waveforms distinguish them, so that all are tried; only encoders, which show the tooth itself, rule one out.
        least = SETTLED if log_likelihoods else 0.0
        siblings = [name for name in TOOTH_FAULTS if name in known and first.get(name, -1.0) >= least]
        likely += [name for name in siblings if name not in likely]
    likely += untrained
    tried = try_effects([known[name] for name in likely], twin, conditions, cache, on_progress, fresh=fresh)
    return replace(attribution, tried=tried, untrained=tuple(untrained))


def _forest(
    conditions: Sequence[Condition], effects: Sequence[str], known: Mapping[str, GapEffect]
) -> dict[str, float]:
    """Return the forests' joint probabilities over the causes that may be named."""
    allowed = {NONE, UNKNOWN, *(effects or known)} & set(conditions[0].learned.causes)
    per_condition = [c.classifier.probabilities(c.change, c.tooth_load_n_per_mm, known.values()) for c in conditions]
    return joint_probabilities(per_condition, [c.tooth_load_n_per_mm for c in conditions], allowed)


def with_unknown_within_floor(probabilities: Mapping[str, float], size: Interval) -> dict[str, float]:
    """Move the probability of an unknown cause to "none" where the whole gap is within its floor.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    size : Interval
        Size of the whole gap, in structural floors.
    """
    if size.high > 1.0:
        return dict(probabilities)
    moved = {NONE: probabilities[NONE] + probabilities[UNKNOWN], UNKNOWN: 0.0}
    return likeliest_first({**probabilities, **moved})


# --------------------
# Evidence from an order that dominates the gap against effects that cannot cause it.
# --------------------


MAX_SHARE_OF_REST = 0.5
"""Share of the gap above which one order outweighs all else."""

FAR_FROM_HEALTHY = 3.0
"""Structural floors of an order beyond which differences between healthy machines do not explain it."""

N_FIRST_ORDERS = 2
"""Multiples of a shaft's order that, on their own, hardly anything but that shaft's faults raises: any other cause
would have to turn with it."""


def with_dominant_order_counted(
    probabilities: Mapping[str, float], effects: Mapping[str, GapEffect], places: Sequence[GapPlace], frame: GearFrame
) -> dict[str, float]:
    """Lower the probabilities of causes that cannot produce the order that dominates the gap.

    A cause that explains 2 % of a gap is hardly its cause: p → 2 (1 − s) p for a share s of more than one half; the
    difference goes to "unknown". Only orders count against an effect, that is, lines at their place in the spectrum:
    noise, tails and envelopes at a shaft's multiples follow from much that theory does not list. Orders far from those
    of healthy machines count against "none" as well, and the first orders of a shaft against "unknown"; the other
    causes share that probability.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    effects : mapping
        Effect → its `GapEffect`, which states where it shows.
    places : sequence of GapPlace
        Places of the gap with their shares.
    frame : GearFrame
    """
    lowered = dict(probabilities)
    largest = [place for place in places if place.share > MAX_SHARE_OF_REST and _is_an_order(place, frame)]
    for place in largest:
        for name in probabilities.keys() & effects.keys():
            if not _can_make(effects[name].shows_in, place):
                lowered[name] *= 2.0 * (1.0 - place.share)
    lowered[UNKNOWN] += 1.0 - sum(lowered.values())
    for place in largest:
        if place.structural >= FAR_FROM_HEALTHY:
            for name in (NONE, *([UNKNOWN] if _is_first_of_a_shaft(place, frame) else [])):
                lowered[name] *= 2.0 * (1.0 - place.share)
    return scaled(lowered)


def likely_beside(
    causes: Sequence[GapCause], effects: Mapping[str, GapEffect], places: Sequence[GapPlace], frame: GearFrame
) -> GapCause | None:
    """Return the likeliest effect that explains an order beyond its floor which the first cannot; None: there is none.

    It accompanies the first effect and is no alternative to it: it is of another group, and the two are not both tooth
    faults.
    """
    first = causes[0]
    if first.name not in effects:
        return None
    orders = [
        place
        for place in places
        if place.structural > 1.0 and _is_an_order(place, frame) and not _can_make(effects[first.name].shows_in, place)
    ]
    return next(
        (
            cause
            for cause in causes
            if cause.name in effects
            and cause.group != first.group
            and not {cause.name, first.name}.issubset(TOOTH_FAULTS)
            and any(_can_make(effects[cause.name].shows_in, place) for place in orders)
        ),
        None,
    )


def _is_first_of_a_shaft(place: GapPlace, frame: GearFrame) -> bool:
    return place.kind is PlaceKind.SHAFT and any(
        1 <= round(turns) <= N_FIRST_ORDERS and abs(turns - round(turns)) <= SAME_ORDER * round(turns)
        for order in place.orders[:1]
        for turns in np.divide(order, frame.shaft_orders)
    )


def _is_an_order(place: GapPlace, frame: GearFrame) -> bool:
    """Whether a place consists of lines: a shaft's, those of the residual, or an envelope's at no shaft's order."""
    if place.kind is PlaceKind.ENVELOPE and place.orders:
        return all(
            abs(turns - round(turns)) > SAME_ORDER * turns for turns in np.divide(place.orders[0], frame.shaft_orders)
        )
    return place.kind in (PlaceKind.LINE, PlaceKind.SHAFT, PlaceKind.SIDEBANDS)


def _can_make(shows_in: Sequence[str], place: GapPlace) -> bool:
    kinds = kinds_of(shows_in)
    if place.kind is PlaceKind.LINE:  # mains, or a bearing with lines in envelope and spectrum
        return not kinds or "mains_lines" in shows_in or PlaceKind.ENVELOPE in kinds
    return not kinds or place.kind in kinds
