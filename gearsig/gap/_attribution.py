"""Calibrated probabilities of the causes: by the forests; of effects that they do not know, by a trial.

The trials of effects that they do know say how far the gap shrinks. How well one explains it can weigh as well, and the
calibration gives that the weight 0: on blind cases look-alikes shrink the gap as far as the true effect does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from math import exp
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from gearsig.gap._conditions import LIGHT_LOAD_N_PER_MM, Condition
from gearsig.gap._evidence import TOOTH_FAULTS
from gearsig.gap._floors import kinds_of
from gearsig.gap._labelled import LabelledChange, LabelledEvidence, labelled_evidence, with_labelled
from gearsig.gap._places import SAME_ORDER
from gearsig.gap._reduction import GearFrame
from gearsig.gap._report import (
    LIKELIER_THAN_NOT,
    NONE,
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

CALIBRATION_FILE = Path(__file__).with_name("calibration.json")

SIZES = (0.3, 6.0)
"""Structural floors that a gap's size counts from and to."""


@dataclass(frozen=True)
class GapCalibration:
    """p ∝ exp(a m s^κ ln p_forest + b (score − s0) + c[kind] + d[kind] ln s), s the gap's size, fitted to known cases.

    Parameters
    ----------
    sharpness : float
        a.
    shrink_weight : float
        b; the score is the held-out shrink less that of placebos. Only for effects that were tried.
    neutral_shrink : float
        s0, the score that says nothing for the effect nor against it.
    none_bias, unknown_bias : float
        c of both causes that are no effect.
    named_from : float
        Probability of the machine's effects together from which one is named.
    apart : float
        The likeliest effect's share, of the first two together, from which it stands alone.
    effect_biases : mapping
        c of effects: of machines that others built some look more often, some less often, like what the population
        shows than that says. 0 where it is missing.
    sharper, none_slope : float
        κ, and d of no gap: of a large gap more can be said, and hardly that it is none.
    several : float
        m where there is more than one operating condition, else 1: by how much more they say than one of them does.
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
        """Build it from what a JSON file holds."""
        return cls(**{field.name: values[field.name] for field in fields(cls) if field.name in values})

    def to_mapping(self) -> dict[str, Any]:
        """Return plain values, for a JSON file."""
        numbers = asdict(self)
        biases = numbers.pop("effect_biases")
        return {name: round(float(value), 4) for name, value in numbers.items()} | (
            {"effect_biases": biases} if biases else {}
        )

    def probabilities(
        self, forest: Mapping[str, float], scores: Mapping[str, float], size: float = 1.0, n_conditions: int = 1
    ) -> dict[str, float]:
        """Return cause → probability, likeliest first.

        Parameters
        ----------
        forest : mapping
            Cause → probability by the forest.
        scores : mapping
            Effect → score of those that were tried.
        size : float
            Of the gap, in structural floors.
        n_conditions : int
            That were joined in `forest`.
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
        """Return what may be said; nothing that is less likely than all else together.

        Parameters
        ----------
        probabilities : mapping
            Cause → probability.
        known : mapping
            Effects by name. Where those of one group are likelier than all else, the kind of fault is told, whichever
            of them it is.
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
    """Return what an effect's held-out shrinkage says for it: s − max(p, 0), cut to −1 … 1.

    Parameters
    ----------
    shrink : float
        Share of the gap that the effect closes on held-out data, 1 − after²/before²; below 0 where the gap grows.
    placebo : float
        The same of the effect at wrong orders or on wrong shafts, which close a part by chance.
    """
    return float(np.clip(shrink - max(placebo, 0.0), -1.0, 1.0))


@cache
def load_gap_calibration(*, with_reference: bool) -> GapCalibration:
    """Return the calibration that comes with this version."""
    return GapCalibration.from_mapping(
        calibration_values()["with_reference" if with_reference else "without_reference"]
    )


@cache
def calibration_values(file: Path = CALIBRATION_FILE) -> dict[str, Any]:
    """Return what a calibration's file holds, "with_reference", "without_reference" and "provenance"."""
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return values


NOT_SEEN = 0.2
"""Probability that an effect is too weak to be seen at one of several conditions: of 0, 0.1, 0.2, 0.4 the likeliest, by
the independent rig's machines at two points each, learned from the other simulators."""

NOT_SEEN_LOADED = {"backlash": 0.9}
"""The same at a condition whose load keeps the flanks together, where another one lets them part."""


def joint_probabilities(
    per_condition: Sequence[Mapping[str, float]], loads_n_per_mm: Sequence[float], allowed: Collection[str]
) -> dict[str, float]:
    """Return the joint probabilities of n conditions, p ∝ Π p_i^(1/n): the logarithmic opinion pool.

    One machine's conditions say nearly the same: three of them carry the log evidence of little more than one, and
    their product is far too sure. How much more than one they say is in the calibration. At one of several conditions
    an effect may not show, q: p_i(x|e) = (1 − q) p_forest(x|e) + q p_forest(x|none).

    Source: C. Genest, J. V. Zidek, "Combining probability distributions", Statistical Science 1 (1986).

    Parameters
    ----------
    per_condition : sequence of mapping
        Cause → probability, of each condition.
    loads_n_per_mm : sequence of float
        Of the teeth, at each; nan where it is not known.
    allowed : collection of str
        Causes, those of no effect among them.
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
    """What calibrated probabilities are made of.

    Parameters
    ----------
    uncalibrated : mapping
        Cause → probability: by the forests, or by likelihood.
    tried : dict
        Effect → how it was tried.
    calibration : GapCalibration
        The one that belongs to this way of comparing.
    size : float
        Of the gap in structural floors; of several conditions the largest.
    n_conditions : int
    untrained : tuple of str
        Effects that the forests do not know, the user's own: each was to be tried.
    labelled : LabelledEvidence or None
        What labelled recordings of the rig say.
    tooth_error_log_likelihoods : mapping
        Effect → log-likelihood of the transmission error's change, of faults of teeth; empty without encoders.
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
        """Effect → what its held-out shrink says for it."""
        known = ((name, tried.shrinkage) for name, tried in self.tried.items())
        return {name: score_of(s.shrink.value, s.placebo) for name, s in known if s is not None}

    @property
    def matches(self) -> dict[str, float]:
        """Effect → log-likelihood of its waveform, of the faults of teeth that were tried."""
        known = ((name, getattr(tried, "match", None)) for name, tried in self.tried.items())
        return {name: match.log_likelihood for name, match in known if match is not None}

    def probabilities(self, calibration: GapCalibration | None = None) -> dict[str, float]:
        """Return cause → probability, likeliest first; calibrated, but for effects that the forests do not know."""
        posterior = (calibration or self.calibration).probabilities(
            self.uncalibrated, self.scores, self.size, self.n_conditions
        )
        if self.labelled is not None:
            posterior = with_labelled(posterior, self.labelled.ratios, self.labelled.alike)
        posterior = with_likelihoods(with_likelihoods(posterior, self.matches), self.tooth_error_log_likelihoods)
        return with_unknown_distributed(posterior, {n: self.scores[n] for n in self.untrained if n in self.tried})


MAX_TRIED, MIN_TRIED_PROBABILITY = 3, 0.06
"""Effects that are simulated: so many of the likeliest, none less likely than this."""


def with_likelihoods(probabilities: Mapping[str, float], matches: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities with those of faults of teeth parted anew by what tells them apart, likeliest first.

    p_i ∝ p_i L_i among those that have a likelihood; what they have together stays: a waveform tells how a tooth is
    damaged, and that one is, the features tell.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    matches : mapping
        Effect → ln L.
    """
    if len(matches) < 2:
        return dict(probabilities)
    together = sum(probabilities[name] for name in matches)
    top = max(matches.values())
    weights = {name: probabilities[name] * exp(value - top) for name, value in matches.items()}
    total = sum(weights.values())
    parted = {name: together * weight / total for name, weight in weights.items()} if total > 0.0 else {}
    return likeliest_first({**probabilities, **parted})


def with_unknown_distributed(probabilities: Mapping[str, float], scores: Mapping[str, float]) -> dict[str, float]:
    """Return the probabilities with those of effects that only a trial speaks for, likeliest first.

    They share max_i s_i of what is unknown, each in proportion to its own s_i = max(score, 0): to the forests, a gap
    that none of their effects explains is unknown, whoever else explains it.
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
    """Ask the forests and what is labelled, then simulate, fit and score the likeliest effects, `max_tried` at most.

    Effects that the forests do not know are tried as well, unless nothing is.

    Parameters
    ----------
    conditions : sequence of Condition
        Of one machine, at one or several operating points.
    known : mapping
        Effect → `GapEffect`, of the simulator.
    effects : sequence of str
        Those that may be named; empty: all that are known.
    twin : Twin
        The simulator, set to the rig.
    cache : path or None
        Folder of simulated banks; None: nothing is kept.
    on_progress : callable
        Takes what is done, in words, and the part of it that is, 0 to 1.
    max_tried : int
        Effects to simulate, likeliest first; 0: none, the forests alone decide.
    fresh : bool
        Whether kept banks are made anew.
    labelled : sequence of LabelledChange
        Of the same rig.
    tooth_error_log_likelihoods : mapping
        Fault of a tooth → ln L of the transmission error's change; empty without encoders.

    Returns
    -------
    Attribution
        Probabilities are computed on demand, see `Attribution.probabilities`.

    Raises
    ------
    RefusalError
        If the rig has a place for some of the likeliest effects, and none of them can be simulated there.
    """
    forest = _forest(conditions, effects, known)
    with_reference = all(c.has_reference for c in conditions)
    size = max(condition.size.structural.value for condition in conditions)
    calibration = load_gap_calibration(with_reference=with_reference)
    evidence = labelled_evidence(conditions, labelled) if labelled else None
    log_likelihoods = {name: value for name, value in tooth_error_log_likelihoods.items() if name in forest}
    attribution = Attribution[TriedEffect](
        forest, {}, calibration, size, len(conditions), labelled=evidence, tooth_error_log_likelihoods=log_likelihoods
    )
    first = attribution.probabilities()
    likely = [name for name, p in first.items() if name in known and p >= MIN_TRIED_PROBABILITY][:max_tried]
    trained = conditions[0].learned.causes
    untrained = [name for name in effects or known if name not in trained] if max_tried else []
    if max_tried and any(name in TOOTH_FAULTS for name in likely):  # waveforms part them: all are tried, or none
        likely += [name for name in TOOTH_FAULTS if name in first and name in known and name not in likely]
    likely += untrained
    tried = try_effects([known[name] for name in likely], twin, conditions, cache, on_progress, fresh=fresh)
    return replace(attribution, tried=tried, untrained=tuple(untrained))


def _forest(
    conditions: Sequence[Condition], effects: Sequence[str], known: Mapping[str, GapEffect]
) -> dict[str, float]:
    """Return the forests' joint probabilities over what may be named."""
    allowed = {NONE, UNKNOWN, *(effects or known)} & set(conditions[0].learned.causes)
    per_condition = [c.classifier.probabilities(c.change, c.tooth_load_n_per_mm, known.values()) for c in conditions]
    return joint_probabilities(per_condition, [c.tooth_load_n_per_mm for c in conditions], allowed)


def with_unknown_within_floor(probabilities: Mapping[str, float], size: Interval) -> dict[str, float]:
    """Return the probabilities with that of an unknown cause given to none, where the whole gap is within its floor.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    size : Interval
        Of the whole gap, in structural floors.
    """
    if size.high > 1.0:
        return dict(probabilities)
    moved = {NONE: probabilities[NONE] + probabilities[UNKNOWN], UNKNOWN: 0.0}
    return likeliest_first({**probabilities, **moved})


# --------------------
# What an order that is most of the gap says against effects that cannot make it.
# --------------------


MAX_SHARE_OF_REST = 0.5
"""Share of the gap from which one order is more of it than all else."""

FAR_FROM_HEALTHY = 3.0
"""Structural floors of an order from which it is no matter of healthy machines' differences."""

N_FIRST_ORDERS = 2
"""Multiples of a shaft that hardly anything but its own faults raises alone: it would have to turn along."""


def with_dominant_order_counted(
    probabilities: Mapping[str, float], effects: Mapping[str, GapEffect], places: Sequence[GapPlace], frame: GearFrame
) -> dict[str, float]:
    """Return the probabilities with those of causes lowered that cannot make the order that is most of the gap.

    A cause of 2 % of a gap is hardly its cause: p → 2 (1 − s) p for a share s of more than a half; unknown gets the
    rest. Only orders count against an effect, lines at their place in the spectrum: noise, tails and envelopes at a
    shaft's multiples follow from much that theory does not list. Where healthy machines are far from them they count
    against no gap as well, and the first orders of a shaft against unknown; the others share that.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    effects : mapping
        Effect → where it shows.
    places : sequence of GapPlace
        Of the gap, with their shares.
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
    """Return the likeliest effect that makes an order beyond its floor which the first cannot make; None: none does.

    It is no rival of the first, that is there instead of it: of another kind, and not a fault of a tooth as well.
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
    """Whether a place is one of lines: a shaft's, those of the residual, or an envelope's at no shaft's order."""
    if place.kind is PlaceKind.ENVELOPE and place.orders:
        return all(
            abs(turns - round(turns)) > SAME_ORDER * turns for turns in np.divide(place.orders[0], frame.shaft_orders)
        )
    return place.kind in (PlaceKind.LINE, PlaceKind.SHAFT, PlaceKind.SIDEBANDS)


def _can_make(shows_in: Sequence[str], place: GapPlace) -> bool:
    kinds = kinds_of(shows_in)
    if place.kind is PlaceKind.LINE:  # of the supply, or of a bearing, whose lines stand in envelope and spectrum
        return not kinds or "mains_lines" in shows_in or PlaceKind.ENVELOPE in kinds
    return not kinds or place.kind in kinds
