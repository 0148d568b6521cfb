"""Where a recording differs from what it is compared with, place by place, each with its share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.change import change_features, difference_features
from gearsig.gap.channels import APART
from gearsig.gap.families import Family, family_members
from gearsig.gap.features import Features
from gearsig.gap.floors import REPEATABLE, StructuralFloor, family_size, pooled_scatter
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.ranking import ranked_places
from gearsig.gap.relative import beyond_the_mesh
from gearsig.gap.spots import Comparison, Spot
from gearsig.gap.spots_cyclic import envelope_spot, line_spot
from gearsig.gap.spots_gear import mesh_spot, shaft_spot, sideband_spot
from gearsig.gap.spots_other import band_spot, speed_spot, tail_spot
from gearsig.gap.spots_tooth import tooth_spot
from gearsig.gap.types import GapPlace, PlaceKind

LEAST_SHARE = 0.01

REPEATED = ("floor.to_signal", "floor.total", "raw.level")
"""Features that only repeat what others say of a place."""


def gap_places(
    now: Gathered,
    other: Gathered,
    structural: StructuralFloor,
    *,
    is_reference: bool,
    change: Features | None = None,
) -> tuple[GapPlace, ...]:
    """Return where a recording differs, largest share first; last what only follows from other places.

    A place is a family of features; its size s_f is their mean of high order over the floors, and its share
    max(s_f² − 1, 0)/Σ max(s² − 1, 0): what does not exceed the larger floor has none, nor has what only follows from
    other places (nan), which is not in the sum. Shares add up to less than 1
    where some of what changed is no more than noise and leakage in a place, or below 1 % of the whole.

    Parameters
    ----------
    now : Gathered
    other : Gathered
        A sound recording of the same machine, or its simulation.
    structural : StructuralFloor
    is_reference : bool
        Whether `other` is a recording of the same machine: the teeth's patterns can then be subtracted.
    change : Features or None
        What `change_features` or `difference_features` made of the two; None: made here.

    Raises
    ------
    RefusalError
        If the reference was taken at another speed.
    """
    if change is None:
        change = change_features(now, other) if is_reference else difference_features(now, other)
    distances = structural.from_centre(change.names, change.values)
    if is_reference:
        distances = beyond_the_mesh(change.names, distances)
    floors = structural.of(change.names), REPEATABLE * pooled_scatter(change)
    # Healthy machines' differences hold their scatter already; a shorter record's may be larger.
    both = distances / np.maximum(*floors)
    comparison = Comparison(now, other, is_reference, _named(change.names, distances), _named(change.names, both))
    members = {family: _telling(change.names, rows) for family, rows in family_members(change.names).items()}
    energies = {family: max(family_size(both[rows]) ** 2 - 1.0, 0.0) for family, rows in members.items()}
    least = LEAST_SHARE * sum(energies.values())
    spots = {family: _spot(comparison, family) for family, energy in energies.items() if energy > least}
    following = {family for family, spot in spots.items() if spot is not None and spot.follows}
    total = sum(energy for family, energy in energies.items() if family not in following)
    found = []
    for family, spot in spots.items():
        if spot is not None:
            sizes = [family_size(distances[members[family]] / floor[members[family]]) for floor in floors]
            share = float("nan") if family in following else energies[family] / total
            found.append(_place(family, spot, (sizes[0], sizes[1]), share, now))
    return ranked_places(_merged(found))


def _merged(places: list[GapPlace]) -> list[GapPlace]:
    """Return the places with those put together to which two families of features led."""
    merged: dict[tuple[PlaceKind, str, bool], GapPlace] = {}
    for place in sorted(places, key=lambda one: -one.structural):
        key = (place.kind, place.shaft, place.follows)
        if key in merged:
            merged[key] = replace(merged[key], share=merged[key].share + place.share)
        else:
            merged[key] = place
    return list(merged.values())


def _telling(names: tuple[str, ...], rows: np.ndarray) -> np.ndarray:
    kept = [row for row in rows if names[row] not in REPEATED and not names[row].startswith(APART)]
    return np.array(kept, dtype=np.intp)


def _named(names: tuple[str, ...], values: FloatArray) -> Mapping[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _spot(comparison: Comparison, family: Family) -> Spot | None:
    kind, shaft = family
    of_a_shaft = {PlaceKind.SIDEBANDS: sideband_spot, PlaceKind.SHAFT: shaft_spot, PlaceKind.TOOTH: tooth_spot}
    plain = {
        PlaceKind.MESH: mesh_spot,
        PlaceKind.ENVELOPE: envelope_spot,
        PlaceKind.LINE: line_spot,
        PlaceKind.BAND: band_spot,
        PlaceKind.SPEED: speed_spot,
        PlaceKind.TAIL: tail_spot,
    }
    return of_a_shaft[kind](comparison, SIDES.index(shaft)) if kind in of_a_shaft else plain[kind](comparison)


def _place(family: Family, spot: Spot, sizes: tuple[float, float], share: float, now: Gathered) -> GapPlace:
    kind, side = family
    return GapPlace(
        spot.kind or kind,
        spot.title,
        spot.change_db,
        repeatability=sizes[1],
        structural=sizes[0],
        share=share,
        shaft=now.frame.shafts[SIDES.index(side)] if side else "",
        orders=spot.orders,
        band_hz=spot.band_hz,
        angle_deg=spot.angle_deg,
        tooth=spot.tooth,
        channel=spot.channel,
        follows=spot.follows,
    )
