"""Which places of a gap come first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gearsig.gap import (
    UNKNOWN,
    GapCause,
    GapEffect,
    GapPlace,
    PlaceKind,
    gear_frame,
    likely_beside,
    ranked_places,
    with_dominant_order_counted,
)
from tests.gap.synthetic import RIG, TEETH

NAN = float("nan")


def place(kind: PlaceKind, share: float, order: float = 0.0, *, follows: bool = False) -> GapPlace:
    orders = (order,) if order else ()
    return GapPlace(
        kind, f"{kind.value} {share}", 10.0, 9.0, 2.0, NAN if follows else share, orders=orders, follows=follows
    )


MESH, TAIL = place(PlaceKind.MESH, 0.1, 23.0), place(PlaceKind.TAIL, 0.6, follows=True)
LINES, ENVELOPE = place(PlaceKind.LINE, 0.2, 5.15), place(PlaceKind.ENVELOPE, 0.05, 5.11)
IMPACTS = GapPlace(PlaceKind.ENVELOPE, "impacts", 20.0, NAN, NAN, NAN, orders=(5.148,))


def test_what_only_follows_comes_last_however_large() -> None:
    assert ranked_places([TAIL, MESH, LINES]) == (LINES, MESH, TAIL)


def test_impacts_that_stand_out_come_first_and_take_the_sizes_of_their_family() -> None:
    first, *others = ranked_places([TAIL, LINES, MESH, ENVELOPE], [IMPACTS])
    assert first.title == "impacts"
    assert first.share == LINES.share + ENVELOPE.share
    assert first.structural == LINES.structural
    assert others == [MESH, TAIL]


def test_impacts_without_such_a_place_have_no_share() -> None:
    assert ranked_places([MESH], [IMPACTS]) == (IMPACTS, MESH)


EFFECTS = {
    "misalignment": GapEffect("misalignment", "", "", "", "", shows_in=("shaft_orders", "mesh_sidebands")),
    "bearing": GapEffect("bearing", "", "", "", "", shows_in=("envelope_orders",)),
    "of my own": GapEffect("of my own", "", "", "", ""),
}
FOUND = {"misalignment": 0.8, "bearing": 0.05, "of my own": 0.05, "none": 0.05, UNKNOWN: 0.05}


def against(place: GapPlace) -> dict[str, float]:
    return with_dominant_order_counted(FOUND, EFFECTS, [place], gear_frame(RIG))


def test_an_order_that_is_most_of_the_gap_counts_against_what_cannot_make_it() -> None:
    strange = against(place(PlaceKind.LINE, 0.98, 3.35))
    assert strange["misalignment"] == pytest.approx(0.04 * 0.8)
    assert strange[UNKNOWN] == pytest.approx(0.05 + 0.96 * 0.8)
    assert [strange[name] for name in ("bearing", "of my own", "none")] == [0.05, 0.05, 0.05]
    far = replace(place(PlaceKind.LINE, 0.98, 3.35), structural=4.0)  # healthy machines do not have it either
    assert against(far)["none"] == pytest.approx(0.04 * 0.05 / (1.0 - 0.96 * 0.05))
    second = against(replace(place(PlaceKind.SHAFT, 0.98, 2.0), structural=4.0))
    assert second[UNKNOWN] < 0.01  # nothing beside the machine turns along
    assert second["misalignment"] > 0.9
    seventh = against(replace(place(PlaceKind.SHAFT, 0.98, 7.0), structural=4.0))
    assert seventh[UNKNOWN] > 0.05
    assert against(place(PlaceKind.SHAFT, 0.98, 2.0))["misalignment"] == 0.8
    assert against(place(PlaceKind.SHAFT, 0.98, 2.0))["bearing"] < 0.01


def test_what_is_less_than_half_or_follows_from_much_counts_against_nothing() -> None:
    nothing = [
        place(PlaceKind.LINE, 0.4, 3.35),
        place(PlaceKind.BAND, 0.98),
        place(PlaceKind.ENVELOPE, 0.98, 3.0 * TEETH[0] / TEETH[1]),
        replace(place(PlaceKind.LINE, 0.98, 3.35), share=float("nan")),
    ]
    assert all(against(one) == pytest.approx(FOUND) for one in nothing)
    assert against(place(PlaceKind.ENVELOPE, 0.98, 3.35))["misalignment"] < 0.05


def test_what_makes_an_order_that_the_first_cannot_may_be_there_beside_it() -> None:
    causes = [GapCause(name, name, name, "", p) for name, p in (("bearing", 0.9), ("misalignment", 0.02))]

    def beside(*places: GapPlace) -> str | None:
        cause = likely_beside(causes, EFFECTS, places, gear_frame(RIG))
        return None if cause is None else cause.name

    order = place(PlaceKind.SHAFT, 0.1, 2.0)
    assert beside(MESH, order) == "misalignment"
    assert beside(MESH, ENVELOPE) is None  # it makes that, and the mesh is no order that speaks against it
    assert beside(replace(order, structural=0.9)) is None
    causes[1] = replace(causes[1], group="bearing")
    assert beside(order) is None  # of one kind one is there instead of the other
