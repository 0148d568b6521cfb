"""Whether the fault was put where it is: tooth, shaft, bearing, order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.benchmark.answer import Answer, AnsweredPlace
from gearsig.gap.types import PlaceKind

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
    cause = answer.cause(effect)
    options, places = (cause.options if cause is not None else {}), answer.places
    shaft = str(place.get("shaft", ""))
    per_input = pair["z1"] / pair["z2"] if shaft == "output" else 1.0
    return Located(
        tooth=_tooth(float(place["angle_deg"]), options, places, int(pair["z1"])) if "angle_deg" in place else None,
        shaft=_shaft(options, places) == shaft if shaft else None,
        bearing=_bearing_shaft(options) == shaft if "bearing" in place else None,
        order=_order(float(place["order"]) * per_input, options, places) if "order" in place else None,
    )


def _tooth(angle_deg: float, options: Mapping[str, Any], places: tuple[AnsweredPlace, ...], n_teeth: int) -> bool:
    pitch = 360.0 / n_teeth
    angles = [p.angle_deg for p in places if p.kind == PlaceKind.TOOTH.value and p.shaft == "input"]
    found = next((a for a in angles if a is not None), None)
    if found is None and options.get("gear") == "driver" and "tooth" in options:
        found = (float(options["tooth"]) - 0.5) * pitch
    if found is None:
        return False
    apart = abs((found - angle_deg + 180.0) % 360.0 - 180.0)
    return apart <= 1.5 * pitch


def _shaft(options: Mapping[str, Any], places: tuple[AnsweredPlace, ...]) -> str:
    for name in ("gear", "shaft"):
        if name in options:
            return SHAFT_OF.get(str(options[name]), str(options[name]))
    return _bearing_shaft(options) or next((p.shaft for p in places if p.shaft), "")


def _bearing_shaft(options: Mapping[str, Any]) -> str:
    """Shaft of the bearing that is named: the blind rig has 1 and 2 on its input shaft, 3 and 4 on the other."""
    number = str(options.get("bearing", "")).rpartition(" ")[2]
    return ("input" if int(number) <= 2 else "output") if number.isdigit() else ""


def _order(order: float, options: Mapping[str, Any], places: tuple[AnsweredPlace, ...]) -> bool:
    """Orders of the input shaft: of the setting, or of the first place."""
    said = [float(options["order"])] if "order" in options else [o for p in places[:1] for o in p.orders]
    return any(abs(value - order) <= ORDER_TOLERANCE * order for value in said)
