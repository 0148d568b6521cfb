"""Speed ratios of all shafts, from the teeth along the gear train."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.rig.types import GearPair, Rig


def shaft_ratios(rig: Rig) -> dict[str, float]:
    """Return revolutions of each shaft per revolution of the reference shaft.

    A shaft that cannot be reached because a tooth count is missing is left out. Exact fractions are carried through the
    train, so that a loop of pairs is checked without rounding.

    Raises
    ------
    InputError
        If the pairs fall into parts that share no shaft, or a loop of pairs contradicts itself.
    """
    if not rig.shafts:
        return {}
    known: dict[str, Fraction] = {rig.reference_shaft: Fraction(1)}
    reached = {rig.reference_shaft}
    if rig.pairs and rig.reference_shaft not in {s for p in rig.pairs for s in (p.driver, p.driven)}:
        reached = set()
    waiting = list(rig.pairs)
    while waiting:
        touching = [p for p in waiting if not reached or p.driver in reached or p.driven in reached]
        if not touching:
            names = ", ".join(repr(p.name) for p in waiting)
            raise InputError(
                f"pair(s) {names} share no shaft with the rest of the gear train",
                where="rig",
                remedy="use the same shaft name where two gears sit on one shaft, or describe two rigs",
            )
        # A pair with a known shaft first, so that a chain is followed outwards and a loop is closed last.
        pair = next((p for p in touching if p.driver in known or p.driven in known), touching[0])
        waiting.remove(pair)
        reached |= {pair.driver, pair.driven}
        _follow(pair, known)
    return {name: float(ratio) for name, ratio in known.items()}


def _follow(pair: GearPair, known: dict[str, Fraction]) -> None:
    """Add the shaft at the other end of one pair, or check it if both are known."""
    driver, driven, z1, z2 = pair.driver, pair.driven, pair.driver_teeth, pair.driven_teeth
    if z1 is None or z2 is None:
        return
    ratio = Fraction(z1, z2)
    if driver in known and driven in known:
        if known[driven] != known[driver] * ratio:
            raise InputError(
                f"pair {pair.name!r} ({z1}/{z2}) contradicts the ratio of its shafts by the other pairs",
                where="rig",
                allowed=f"a ratio of {known[driven] / known[driver]}",
                remedy="check the teeth",
            )
    elif driver in known:
        known[driven] = known[driver] * ratio
    elif driven in known:
        known[driver] = known[driven] / ratio
