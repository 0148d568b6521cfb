"""Answer and truth side by side: what a case was, what was said of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.cases import Truth
from app.benchmark.run import Done
from gearsig.gap import NONE, UNKNOWN, GapOutcome, GapPlace, PlaceKind, StructuralFloor, load_learned, soft_size
from sims.blind import CATALOGUE, MECHANICAL

# --------------------
# Whether the fault was put where it is: tooth, shaft, bearing, order.
# --------------------


SHAFT_OF = {"pinion": "input", "wheel": "output", "driver": "input", "driven": "output"}
"""Shaft of a gear, in the labels' words and in the answers'."""

ORDER_TOLERANCE = 0.02
"""Relative: slipping bearings stay within it."""


@dataclass(frozen=True)
class Located:
    """True, false, or None where the case has no such place.

    Parameters
    ----------
    tooth : bool or None
        Within one tooth; only teeth of a shaft with a mark have an angle that can be known.
    shaft : bool or None
    bearing : bool or None
        The two bearings of a shaft are alike on the blind rig: either counts.
    order : bool or None
    """

    tooth: bool | None = None
    shaft: bool | None = None
    bearing: bool | None = None
    order: bool | None = None


def located(place: Mapping[str, Any], effect: str, answer: Answer, pair: Mapping[str, float]) -> Located:
    """Compare a label's place with what was answered.

    The fitted setting of the true effect counts, if it was tried; what it does not say is sought in the places of the
    gap, the one of largest share first. What is said nowhere is wrong.

    Parameters
    ----------
    place : mapping
        Of the label.
    effect : str
    answer : Answer
    pair : mapping
        Teeth: z1 on the input shaft, z2 on the output shaft.
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
    """Shaft of the bearing that is named: the blind rig has 1 and 2 on its input shaft, 3 and 4 on the other."""
    number = str(options.get("bearing", "")).rpartition(" ")[2]
    return ("input" if int(number) <= 2 else "output") if number.isdigit() else ""


def _order(order: float, options: Mapping[str, Any], places: tuple[GapPlace, ...]) -> bool:
    """Orders of the input shaft: of the setting, or of the first place."""
    stated_orders = [float(options["order"])] if "order" in options else [o for p in places[:1] for o in p.orders]
    return any(abs(value - order) <= ORDER_TOLERANCE * order for value in stated_orders)


# --------------------
# How strong a case's fault is, measured by its twin: the same run from the same seeds without the fault.
# --------------------


STRONG = 3.0
"""Structural floors from which on a fault should be found."""

Floors = Mapping[bool, StructuralFloor]
"""With a reference (True) and without (False)."""


def known_floors() -> Floors:
    """Return the floors that the diagnosis itself uses."""
    learned = load_learned()
    return {with_reference: learned.floor(with_reference=with_reference) for with_reference in (False, True)}


def strength(truth: Truth, floors: Floors) -> float:
    """Return the size of the change that the fault alone makes, in structural floors; nan where it cannot be said.

    It is measured like the whole gap, see `gearsig.gap.gap_size`; of two conditions the larger counts.
    """
    floor = floors[bool(truth.labels["has_reference"])]
    known = [name for name in floor.names if all(name in change for change in truth.fault_changes)]
    floors_of_known = floor.of(known)
    sizes = [
        soft_size(known, np.array([change[name] for name in known]) / floors_of_known) / floor.whole_of(known)
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
        What was wrong.
    truths : tuple of str
        Causes that are right: the effects; "none"; "unknown".
    level, strength : float
        Of the fault: 0 to 1 in its span; structural floors.
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
        """Causes, likeliest first."""
        return tuple(c.name for c in self.answer.ranked)

    @property
    def first(self) -> str:
        """The likeliest cause; empty where there is no answer."""
        return self.ranked[0] if self.ranked else ""

    @property
    def confidence(self) -> float:
        """Probability of the likeliest cause; nan where there is no answer."""
        return self.answer.probability(self.first) if self.ranked else float("nan")

    @property
    def first_mechanical(self) -> str:
        """The likeliest of the mechanical effects."""
        return next((name for name in self.ranked if name in MECHANICAL), "")

    @property
    def named(self) -> str:
        """The mechanical effect that the verdict names: as the cause, or as one of those that cannot be separated."""
        first = tuple(c.name for c in self.answer.causes[:1])
        several = self.answer.inseparable or first
        named = {GapOutcome.EFFECT.value: first, GapOutcome.CANNOT_SEPARATE.value: several}
        return next((name for name in named.get(self.answer.outcome, ()) if name in MECHANICAL), "")

    @property
    def is_mechanical(self) -> bool:
        """Whether exactly one mechanical effect was wrong."""
        return self.kind == "single" and self.effects[0] in MECHANICAL

    @property
    def is_nuisance(self) -> bool:
        """Whether nothing but the measurement chain was wrong."""
        return self.kind == "single" and not self.is_mechanical


def rows_of(cases: Sequence[Done], diagnoser: str, floors: Floors) -> list[Row]:
    """Return one row per case."""

    def on_gears(done: Done) -> Callable[[Mapping[str, Any], str, Answer], Located]:
        return lambda place, effect, answer: located(place, effect, answer, done.truth.labels["pair"])

    return [row_of(done, done.answers[diagnoser], strength(done.truth, floors), on_gears(done)) for done in cases]


def row_of(
    done: Done, answer: Answer, strength_floors: float, placed: Callable[[Mapping[str, Any], str, Answer], Located]
) -> Row:
    """Return a case with an answer; `placed` says of the label's place, the effect and the answer what was right."""
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
    """Group of an effect; "none" and "unknown" are their own."""
    return CATALOGUE[cause].group if cause in CATALOGUE else cause
