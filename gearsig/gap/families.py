"""Which features say the same thing about which place of the spectrum, angle or signal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from gearsig.gap.gear_lines import SIDES
from gearsig.gap.types import PlaceKind

Family = tuple[PlaceKind, str]
"""The kind of place and "driver", "driven" or nothing."""

_PLAIN = {
    "mesh": PlaceKind.MESH,
    "alike": PlaceKind.MESH,
    "envelope": PlaceKind.ENVELOPE,
    "line": PlaceKind.LINE,
    "hum": PlaceKind.LINE,
    "floor": PlaceKind.BAND,
    "speed": PlaceKind.SPEED,
    "raw": PlaceKind.TAIL,
}
_APART = {"mesh": PlaceKind.MESH, "floor": PlaceKind.BAND}

UNFORETOLD = ("surprise.", "apart.", "alike.")
"""Features, the last ones, that hang on noise and sensors: no simulation foretells them, no size is made of them."""

_OF_A_SHAFT = {
    "sideband": PlaceKind.SIDEBANDS,
    "shaft": PlaceKind.SHAFT,
    "tooth": PlaceKind.TOOTH,
    "change": PlaceKind.TOOTH,
    "surprise": PlaceKind.TOOTH,
}


_ALL_ROUND = ("level", "elsewhere")
"""Features of a shaft's pattern that speak of all its orders and not of one tooth."""

_KINDS = {
    "mesh_harmonics": (PlaceKind.MESH,),
    "mesh_sidebands": (PlaceKind.SIDEBANDS,),
    "shaft_orders": (PlaceKind.SHAFT,),
    "tooth_window": (PlaceKind.TOOTH,),
    "envelope_orders": (PlaceKind.ENVELOPE,),
    "broadband": (PlaceKind.BAND,),
    "resonances": (PlaceKind.BAND, PlaceKind.MESH),
    "amplitude_tail": (PlaceKind.TAIL,),
    "speed": (PlaceKind.SPEED,),
}
"""What an effect says it shows in (`gearsig.gap.simulator.GapEffect.shows_in`), as kinds of places."""


def shown_in(names: Sequence[str], shows_in: Sequence[str]) -> np.ndarray:
    """Return which features are of the kinds that an effect says it shows in; all, if it says none that is known.

    Parameters
    ----------
    names : sequence of str
    shows_in : sequence of str
        See `gearsig.gap.simulator.GapEffect.shows_in`.

    Returns
    -------
    array of bool, (n,)
    """
    kinds = {kind for shown in shows_in for kind in _KINDS.get(shown, ())}
    found = np.array([_is_shown(name, kinds, shows_in) for name in names], dtype=np.bool_)
    return found if found.any() else np.ones(len(names), dtype=np.bool_)


def _is_shown(name: str, kinds: set[PlaceKind], shows_in: Sequence[str]) -> bool:
    kind = family_of(name)[0]
    if name == "hum":
        return "mains_lines" in shows_in
    if kind is PlaceKind.TOOTH and "shaft_orders" in shows_in and name.rpartition(".")[2] in _ALL_ROUND:
        return True
    return kind in kinds


def family_of(name: str) -> Family:
    """Return the family of a feature.

    Examples
    --------
    >>> family_of("sideband.driven.3to5")
    (<PlaceKind.SIDEBANDS: 'sidebands'>, 'driven')
    """
    first, _, rest = name.partition(".")
    if name == "line.half_mesh":
        return PlaceKind.MESH, ""
    if first == "apart":
        return _APART[rest], ""
    if first in _PLAIN:
        return _PLAIN[first], ""
    side = rest.partition(".")[0]
    return _OF_A_SHAFT[first], side if side in SIDES else ""


def family_members(names: Sequence[str]) -> dict[Family, np.ndarray]:
    """Return for each family the positions of its features."""
    return _members(tuple(names))


def sized_members(names: Sequence[str]) -> dict[Family, np.ndarray]:
    """Return for each family the positions of those of its features that the size of a gap is made of."""
    return _sized(tuple(names))


@cache
def _sized(names: tuple[str, ...]) -> dict[Family, np.ndarray]:
    kept = {
        family: np.array([i for i in rows if not names[i].startswith(UNFORETOLD)], dtype=np.intp)
        for family, rows in _members(names).items()
    }
    return {family: rows for family, rows in kept.items() if len(rows)}


@cache
def _members(names: tuple[str, ...]) -> dict[Family, np.ndarray]:
    found: dict[Family, list[int]] = {}
    for i, name in enumerate(names):
        found.setdefault(family_of(name), []).append(i)
    return {family: np.array(members, dtype=np.intp) for family, members in found.items()}
