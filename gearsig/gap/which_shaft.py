"""Which of the two shafts a cause sits on, by what changed on either; or that it cannot be told.

What turns with a shaft shows at that shaft's own orders and sidebands and in its own synchronous average. Each cause
has its signs there; those of both shafts are compared. It needs no simulation, so that it serves any way of naming
causes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, StructuralFloor, pooled_scatter
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.relative import beyond_the_mesh

ONE_TOOTH = ("root_crack", "tooth_spall", "chipped_tooth")
"""Causes on a single tooth."""

_BURST = ("change.{}.peak", "change.{}.prominence", "tooth.{}.peak", "tooth.{}.prominence", "tooth.{}.kurtosis")
_ALL_ROUND = ("change.{}.level", "change.{}.elsewhere", "tooth.{}.level", "tooth.{}.elsewhere", "shaft.{}.low")

SIGNS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(ONE_TOOTH, _BURST),
    "pitch_error": _ALL_ROUND,
    "eccentricity": ("sideband.{}.1", "sideband.{}.own", "shaft.{}.1", "shaft.{}.1.to_mesh"),
    "unbalance": ("shaft.{}.1", "shaft.{}.1.to_mesh"),
    "misalignment": ("shaft.{}.2", "shaft.{}.2.to_mesh", "sideband.{}.2"),
}
"""Cause → features that rise on its shaft. Wear and friction change the mesh, which both shafts share."""

FIRST_ORDER = {"misalignment": 2}
"""Cause → the order of its shaft that it makes first, where it is not 1."""

CLEAR = 1.0
"""Floors by which the signs must rise on one shaft."""

MOST = 6.0
"""Floors that one sign counts for."""

TIMES = 1.5
"""The signs on the one shaft over those on the other."""


@dataclass(frozen=True)
class ShaftSigns:
    """How far a cause's signs rose on either shaft.

    Parameters
    ----------
    rise : (float, float)
        Root mean square of the signs that rose, in floors: driver, driven.
    slow : int or None
        The shaft whose sign the other cannot make, while its own sign falls on an order of this one; see `_slow`.
    """

    rise: tuple[float, float]
    slow: int | None = None

    @property
    def side(self) -> int | None:
        """0: driver, 1: driven, None: cannot be told."""
        if self.slow is not None and TIMES * self.rise[self.slow] > self.rise[1 - self.slow]:
            return self.slow if self.rise[self.slow] >= CLEAR else None
        larger = int(np.argmax(self.rise))
        most, least = self.rise[larger], self.rise[1 - larger]
        return larger if most >= CLEAR and most >= TIMES * least else None


def shaft_signs(cause: str, changes: Sequence[Mapping[str, float]], teeth: tuple[int, int]) -> ShaftSigns | None:
    """Compare a cause's signs on both shafts; None for a cause that no shaft has to itself.

    r_s = √(mean over conditions and signs of min(max(u, 0), 6)²), u a sign's change on shaft s in floors.

    Parameters
    ----------
    cause : str
        Name of an effect.
    changes : sequence of mappings
        Feature → change over its floor, see `over_floors`; one per operating condition.
    teeth : (int, int)
        Of driver and driven gear.
    """
    if cause not in SIGNS:
        return None
    rises = ([rise for change in changes for rise in _rises(SIGNS[cause], side, change)] for side in SIDES)
    driver, driven = (float(np.sqrt(np.mean(np.square(rise)))) if rise else 0.0 for rise in rises)
    return ShaftSigns((driver, driven), _slow(cause, teeth))


def _slow(cause: str, teeth: tuple[int, int]) -> int | None:
    """Return the slower shaft where it turns once for a whole number of turns of the other; None elsewhere.

    The faster one's orders are orders of it, too; but its own first is none of the other's, nor is one tooth of it.
    """
    slow = int(np.argmax(teeth))
    ratio, rest = divmod(teeth[slow], teeth[1 - slow])
    return slow if not rest and FIRST_ORDER.get(cause, 1) % ratio else None


def told_options(cause: str, changes: Sequence[Mapping[str, float]], teeth: tuple[int, int]) -> dict[str, str]:
    """Return the option of the effect that says which shaft it is on, {"gear": "driven"}, say; empty: cannot be told.

    Parameters
    ----------
    cause, changes, teeth
        As of `shaft_signs`.
    """
    signs = shaft_signs(cause, changes, teeth)
    if signs is None or signs.side is None:
        return {}
    return {"shaft" if cause == "misalignment" else "gear": SIDES[signs.side]}


def over_floors(change: Features, floor: StructuralFloor, *, is_reference: bool) -> dict[str, float]:
    """Return each feature's change over the larger of both floors, with its sign.

    Parameters
    ----------
    change : Features
        Against a reference or a simulation.
    floor : StructuralFloor
        Of that comparison.
    is_reference : bool
        Whether it is a reference: a level relative to the mesh then counts as far as it changed by itself.
    """
    distances = floor.from_centre(change.names, change.values)
    if is_reference:
        distances = beyond_the_mesh(change.names, distances)
    floors = np.maximum(floor.of(change.names), REPEATABLE * pooled_scatter(change))
    return dict(zip(change.names, (distances / floors).tolist(), strict=True))


def _rises(signs: Sequence[str], side: str, change: Mapping[str, float]) -> list[float]:
    """Return how far each sign that the comparison has rose on one shaft, `MOST` at most."""
    names = [sign.format(side) for sign in signs]
    return [float(np.clip(change[name], 0.0, MOST)) for name in names if name in change]
