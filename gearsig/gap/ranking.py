"""Which places of a gap come first: what stands out by itself, then by share, last what only follows from others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gearsig.gap.types import GapPlace, PlaceKind

SAME_ORDER = 0.02
"""Relative: of one family of lines, however they were found."""


def ranked_places(places: Sequence[GapPlace], standing: Sequence[GapPlace] = ()) -> tuple[GapPlace, ...]:
    """Return the places in the order in which somebody at the machine should read them.

    Families of impacts that stand out by themselves come first: no tolerance of a simulator makes them. A place of the
    gap at the same order is the same family, and gives its sizes to it. Then come the other places, largest share
    first; last those that say nothing of where or what to look for, since other places make them.

    Parameters
    ----------
    places : sequence of GapPlace
        Of the gap, with sizes and shares.
    standing : sequence of GapPlace
        Found without a simulation, surest first.
    """
    left, first = list(places), []
    for one in standing:
        same = [place for place in left if _same_family(place, one)]
        first.append(_joined(one, same))
        left = [place for place in left if place not in same]
    return (*first, *sorted(left, key=_rank))


def _rank(place: GapPlace) -> tuple[bool, float]:
    return place.follows, -(place.structural if place.follows else place.share)


def _same_family(place: GapPlace, standing: GapPlace) -> bool:
    """Whether a line or an envelope's line lies at the family's order."""
    if place.kind not in (PlaceKind.ENVELOPE, PlaceKind.LINE) or not place.orders:
        return False
    return abs(place.orders[0] / standing.orders[0] - 1.0) < SAME_ORDER


def _joined(standing: GapPlace, same: Sequence[GapPlace]) -> GapPlace:
    """Return what stands out with the sizes of the largest place of the same family, and their shares together."""
    if not same:
        return standing
    largest = max(same, key=lambda place: place.share)
    share = sum(place.share for place in same)
    return replace(standing, repeatability=largest.repeatability, structural=largest.structural, share=share)
