"""Where on the machine a fitted effect sits, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.gap.candidates import Tried, n_compared
from app.gap.conditions import Condition, observed
from gearsig.gap.frame import GearFrame
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.prediction import INTERVAL_COST, EffectPath, fit_effect
from gearsig.gap.ranking import SAME_ORDER
from gearsig.gap.simulator import Added
from gearsig.gap.spots import shaft_words
from gearsig.gap.types import GapPlace, PlaceKind
from gearsig.gap.which_shaft import ONE_TOOTH, SIGNS, told_options

RACES = {"bearing_outer_race": "outer", "bearing_inner_race": "inner"}
"""Effect → the order of its bearing that it shows at, see `BearingFrame`."""


def place_of(added: Added, frame: GearFrame, places: Sequence[GapPlace]) -> str:
    """Return "tooth 7 of the gear on the input shaft", "bearing 2", "order 6"; empty where the effect has no place.

    The tooth is that of the recording, not of the simulation, which stands for all.
    """
    options = added.options
    if "bearing" in options:
        return " or ".join(_bearings(added.name, str(options["bearing"]), frame, places))
    if "order" in options:
        return _order(frame, places, float(options["order"]))
    side = options.get("gear", options.get("shaft"))
    if side not in SIDES:
        return ""
    shaft = frame.shafts[SIDES.index(str(side))]
    words = shaft_words(frame, SIDES.index(str(side)))
    if "tooth" not in options:
        return f"the gear on {words}" if "gear" in options else words
    found = _tooth_place(shaft, places)
    if found is None or (found.tooth is None and found.angle_deg is None):
        return f"one tooth of the gear on {words}"
    tooth = f"tooth {found.tooth} of the gear on"
    return f"{tooth} {words}" if found.tooth is not None else f"{found.angle_deg:.0f}° of {words}"


def _bearings(name: str, fitted: str, frame: GearFrame, places: Sequence[GapPlace]) -> list[str]:
    """Return the bearings whose race stands out of the recording, or else those that look like the fitted one."""
    race = RACES.get(name)
    if race is None:
        return [fitted]
    orders = {bearing.name: float(getattr(bearing, race)) for bearing in frame.bearings}
    seen = [place.orders[0] for place in places if place.kind is PlaceKind.ENVELOPE and place.orders]
    for one in (*seen, orders.get(fitted, np.nan)):
        if alike := [other for other, order in orders.items() if abs(one / order - 1.0) < SAME_ORDER]:
            return alike
    return [fitted]


def cause_place(name: str, tried: Tried | None, conditions: Sequence[Condition], places: Sequence[GapPlace]) -> str:
    """Return where a cause sits, in words; empty where it has no place or nothing is known of it.

    Which shaft, the recordings tell by themselves. Where they do not, a fit tells that is clearly better on one of them
    than on the other; else that is what it says.
    """
    frame = conditions[0].now.frame
    changes = [condition.over_floors for condition in conditions]
    told: dict[str, float | str] = {**told_options(name, changes, frame.teeth)}
    if told or name not in SIGNS:
        added = tried.fit.added if tried is not None else Added(name, 0.0, _with_a_tooth(name, told))
        return place_of(added, frame, places)
    if tried is not None and _is_clear(tried, conditions):
        return place_of(tried.fit.added, frame, places)
    either = " or ".join(shaft_words(frame, side) for side in range(len(SIDES)))
    return f"{either} (which cannot be told)"


def _with_a_tooth(name: str, told: dict[str, float | str]) -> dict[str, float | str]:
    return {**told, "tooth": 1.0} if name in ONE_TOOTH else told


def _is_clear(tried: Tried, conditions: Sequence[Condition]) -> bool:
    """Whether the fit is worse on the other shaft by more than chance."""
    n = n_compared(conditions)
    seen = [observed(condition, k, n) for k, condition in enumerate(conditions)]
    costs = [fit_effect(paths, seen).cost for paths in _by_shaft(tried.paths)]
    return len(costs) < len(SIDES) or max(costs) - min(costs) > INTERVAL_COST


def _by_shaft(paths: Sequence[EffectPath]) -> list[list[EffectPath]]:
    both = [[path for path in paths if path.options.get("gear", path.options.get("shaft")) == side] for side in SIDES]
    return [some for some in both if some]


def at_its_tooth(added: Added, frame: GearFrame, places: Sequence[GapPlace]) -> Added:
    """Return the setting with the recording's tooth in place of the simulated one, where a mark gives it a number."""
    if "tooth" not in added.options:
        return added
    found = _tooth_place(frame.shafts[SIDES.index(str(added.options["gear"]))], places)
    if found is None or found.tooth is None:
        return added
    return replace(added, options={**added.options, "tooth": float(found.tooth)})


def _tooth_place(shaft: str, places: Sequence[GapPlace]) -> GapPlace | None:
    return next((p for p in places if p.kind is PlaceKind.TOOTH and p.shaft == shaft), None)


def _order(frame: GearFrame, places: Sequence[GapPlace], fitted: float) -> str:
    """Return the order that the recording shows, or else the fitted one."""
    for place in places:
        if place.kind is PlaceKind.SHAFT and place.shaft == frame.shafts[0] and place.orders:
            return f"order {place.orders[0]:.3g}"
    return f"order {fitted:.3g}"
