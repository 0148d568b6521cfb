"""Which places of a gap come first."""

from __future__ import annotations

from gearsig.gap import GapPlace, PlaceKind, ranked_places

NAN = float("nan")


def place(kind: PlaceKind, share: float, order: float = 0.0, *, follows: bool = False) -> GapPlace:
    orders = (order,) if order else ()
    return GapPlace(
        kind, f"{kind.value} {share}", 10.0, 9.0, 3.0, NAN if follows else share, orders=orders, follows=follows
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
