"""Whether a rig file says enough for a gap diagnosis, and in which of its two ways it can be diagnosed."""

from __future__ import annotations

from gearsig.errors import RefusalError
from gearsig.rig.types import Bearing, GearPair, Rig

EXAMPLE = "`gearsig rig example` prints a file to start from"


def is_gearless(rig: Rig) -> bool:
    """Return whether the rig has bearings only, so that there is nothing to set a simulator to.

    Raises
    ------
    RefusalError
        If the rig's data suffice neither for a simulation nor for a search for the bearings, with all that is missing.
    """
    if rig.pairs:
        _check_teeth(rig)
        return False
    if not rig.bearings:
        raise RefusalError(
            "the rig file describes neither a gear pair nor a bearing: there is nothing to set a simulator to, and "
            "nothing to look for",
            remedy=f"describe the gear pair (teeth, module) or the bearings (geometry or orders); {EXAMPLE}",
        )
    if not known_bearings(rig):
        names = ", ".join(repr(bearing.name) for bearing in rig.bearings)
        raise RefusalError(
            f"the rig has no gear pair, and of no bearing ({names}) the orders and the speed of its shaft are known",
            remedy="give the bearings' geometry or orders, on the shaft whose speed is known",
        )
    return True


def known_bearings(rig: Rig) -> tuple[Bearing, ...]:
    """Return the bearings whose orders per revolution of the reference shaft are known."""
    return tuple(b for b in rig.bearings if b.orders() and rig.ratio(b.shaft) is not None)


def _check_teeth(rig: Rig) -> None:
    missing = [f"{' and '.join(names)} of pair {pair.name!r}" for pair in rig.pairs if (names := _unknown(pair))]
    if all(pair.driver_teeth and pair.driven_teeth for pair in rig.pairs):
        return  # what else a simulator needs, it says itself
    several = f"; the rig has {len(rig.pairs)} gear pairs, and the simulators have one" if len(rig.pairs) > 1 else ""
    raise RefusalError(
        f"the rig data are missing that a simulation needs: {', '.join(missing)}{several}",
        remedy="complete the rig file; `gearsig analyze` says what can be said without them",
    )


def _unknown(pair: GearPair) -> list[str]:
    gears = [name for name, teeth in (("driver", pair.driver_teeth), ("driven", pair.driven_teeth)) if teeth is None]
    teeth = {0: [], 1: [f"teeth of the {' '.join(gears)} gear"], 2: ["teeth of both gears"]}[len(gears)]
    return [*teeth, *(["module"] if pair.module_mm is None else [])]
