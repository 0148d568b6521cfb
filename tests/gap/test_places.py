"""Places of gaps that were put there."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.gap import (
    DRIVEN,
    DRIVER,
    Condition,
    ConditionFacts,
    Features,
    GapPlace,
    OperatingCondition,
    PlaceKind,
    ReducedRecording,
    StructuralFloor,
    change_features,
    change_relative_to_mesh,
    difference_features,
    distributed_place,
    gap_places,
    reduce_recording,
    with_unchanged_races_lowered,
    without_multiples,
)
from sims.effects import as_gap_effect, effect
from tests.gap.synthetic import RIG, SPEED_HZ, TEETH, record, ringing

AddedEffect = Callable[[FloatArray, FloatArray], FloatArray]
RATIO = TEETH[0] / TEETH[1]
OUTER = 9 / 2 * (1 - 7.94 / 39.04)
FACTS = ConditionFacts("now", OperatingCondition(60.0 * SPEED_HZ, 50.0), 100.0, 4.0, 20480.0)


@cache
def healthy(seed: int = 0) -> ReducedRecording:
    return reduce_recording(record(seed=seed), RIG)


@cache
def floor(is_reference: bool) -> StructuralFloor:
    """Healthy records differ by noise here: three times their scatter, 2 dB at least."""
    compare = change_features if is_reference else difference_features
    changes = [compare(healthy(seed), healthy()) for seed in (2, 3, 4)]
    values = np.stack([one.values for one in changes])
    centres = np.median(values, axis=0)
    return StructuralFloor(changes[0].names, np.maximum(3.0 * np.abs(values - centres).max(axis=0), 2.0), centres)


def condition_of(now: ReducedRecording, *, is_reference: bool = True) -> Condition:
    """Return a recording beside a healthy one, which stands for the simulation as well."""
    floors = {flag: SimpleNamespace(floor=floor(flag)) for flag in (is_reference,)}
    learned = SimpleNamespace(credibility=1.0, classifiers=floors)
    return Condition(FACTS, now, healthy(), healthy() if is_reference else None, learned)


def places_of(
    added: AddedEffect | None = None, *, is_reference: bool = True, **settings: float
) -> tuple[GapPlace, ...]:
    now = reduce_recording(record(added, seed=1, **settings), RIG)
    return gap_places(condition_of(now, is_reference=is_reference))


def tone(order: float, amplitude: float) -> AddedEffect:
    return lambda _, r: amplitude * np.cos(2 * np.pi * order * r + 0.3)


@pytest.mark.slow
def test_only_a_race_with_lines_of_its_own_is_not_counted_against() -> None:
    """A tooth strikes once a turn, a ball at the race's order: both make the envelope's features of bearings rise."""

    def struck(order: float, level: float) -> Condition:
        return condition_of(reduce_recording(record(lambda _, r: level * ringing(order * r), seed=1), RIG))

    rolling, striking = struck(OUTER, 2.0), struck(1.0, 4.0)
    found = {"bearing_outer_race": 0.5, "root_crack": 0.3, "none": 0.2}
    assert (
        with_unchanged_races_lowered(found, [rolling])
        == with_unchanged_races_lowered(found, [striking, rolling])
        == found
    )
    assert with_unchanged_races_lowered(found, [striking])["bearing_outer_race"] == pytest.approx(0.1 / 0.6)


@pytest.mark.slow
@pytest.mark.parametrize(("multiples", "expected"), [((1.0,), 0.5), ((1.0, 3.0), 0.1 / 0.6)])
def test_a_force_that_turns_makes_no_multiples(multiples: tuple[float, ...], expected: float) -> None:
    now = reduce_recording(record(lambda _, r: sum(2.0 * np.cos(2 * np.pi * k * r) for k in multiples), seed=1), RIG)
    found, known = {"unbalance": 0.5, "misalignment": 0.3, "unknown": 0.2}, {"unbalance", "misalignment"}
    lowered = without_multiples(found, {name: as_gap_effect(effect(name)) for name in known}, [condition_of(now)])
    assert lowered["unbalance"] == pytest.approx(expected)


def test_a_mesh_that_swells_and_fades_is_no_line_that_belongs_to_no_shaft() -> None:
    places = places_of(lambda t, r: np.cos(2 * np.pi * t) * tone(2 * TEETH[0], 0.4)(t, r))
    (left_over,) = [place for place in places if "that of the mesh" in place.title]
    assert left_over.kind is PlaceKind.BAND
    assert PlaceKind.LINE not in [place.kind for place in places]


@pytest.mark.slow
def test_another_record_of_the_same_machine_differs_nowhere() -> None:
    assert places_of() == ()


@pytest.mark.parametrize(("side", "shaft"), [(DRIVER, "in"), (DRIVEN, "out")])
@pytest.mark.parametrize("is_reference", [True, False])
def test_sidebands_are_those_of_their_shaft_and_carrier(side: int, shaft: str, *, is_reference: bool) -> None:
    order, carrier = (1.0, RATIO)[side], 2 * TEETH[0]
    first = places_of(
        lambda t, r: tone(carrier - order, 0.2)(t, r) + tone(carrier + order, 0.2)(t, r), is_reference=is_reference
    )[0]
    assert (first.kind, first.shaft) == (PlaceKind.SIDEBANDS, shaft)
    assert sorted(first.orders) == pytest.approx([carrier - order, carrier + order])
    assert "about 2 × mesh" in first.title
    # 0.02 of amplitude on each side before, 0.22 or 0.18 with it: 10 lg of the powers' ratio.
    assert first.change_db == pytest.approx(20.0, abs=1.5)


@pytest.mark.parametrize(("side", "shaft"), [(DRIVER, "in"), (DRIVEN, "out")])
def test_an_unbalance_is_order_one_of_its_shaft(side: int, shaft: str) -> None:
    order = (1.0, RATIO)[side]
    first = places_of(tone(order, 0.3))[0]
    assert (first.kind, first.shaft) == (PlaceKind.SHAFT, shaft)
    assert first.orders == pytest.approx((order,))


@pytest.mark.slow
@pytest.mark.parametrize("where", [0.1, 0.4, 0.83])
@pytest.mark.parametrize("is_reference", [True, False])
def test_a_knock_is_at_its_tooth(where: float, *, is_reference: bool) -> None:
    first = places_of(lambda _, r: 1.5 * ringing(r - where), is_reference=is_reference)[0]
    assert (first.kind, first.shaft) == (PlaceKind.TOOTH, "in")
    assert first.angle_deg is not None
    assert first.tooth is not None
    assert abs((first.angle_deg - 360 * where + 180) % 360 - 180) < 360 / TEETH[0]
    assert first.tooth == int(first.angle_deg / 360 * TEETH[0]) + 1


def test_a_gear_without_a_mark_has_an_angle_and_no_number() -> None:
    first = places_of(lambda _, r: 1.5 * ringing(RATIO * r - 0.3))[0]
    assert (first.kind, first.shaft, first.tooth) == (PlaceKind.TOOTH, "out", None)
    assert first.angle_deg == pytest.approx(108.0, abs=360 / TEETH[1])


def test_a_race_is_named_with_its_bearing() -> None:
    places = places_of(lambda _, r: 0.6 * ringing(0.99 * OUTER * r))
    envelope = next(place for place in places if place.kind is PlaceKind.ENVELOPE)
    assert "outer race of bearing b1" in envelope.title
    assert envelope.orders[0] == pytest.approx(0.99 * OUTER, rel=0.01)
    assert envelope.structural > 3.0


def test_a_strange_train_gets_its_order() -> None:
    places = places_of(lambda _, r: 0.6 * ringing(2.37 * r))
    envelope = next(place for place in places if place.kind is PlaceKind.ENVELOPE)
    assert "belongs to no shaft" in envelope.title
    assert envelope.orders == pytest.approx((2.37,), abs=0.03)


@pytest.mark.parametrize("order", [3.35, 10.3])
def test_a_strange_tone_gets_its_order(order: float) -> None:
    first = places_of(tone(order, 0.3))[0]
    assert first.kind is PlaceKind.LINE
    assert first.orders == pytest.approx((order,), abs=0.05)


@pytest.mark.slow
def test_a_tone_that_fills_a_band_is_no_noise() -> None:
    places = places_of(tone(41.41, 1.0))
    assert places[0].kind is PlaceKind.LINE
    assert places[0].orders == pytest.approx((41.41,), abs=0.05)
    assert not [place for place in places if place.kind is PlaceKind.BAND]


@pytest.mark.slow
def test_hum_swing_and_noise_are_named() -> None:
    hum = places_of(lambda t, _: 0.1 * np.sin(2 * np.pi * 50.0 * t))[0]
    assert (hum.kind, "50 Hz" in hum.title) == (PlaceKind.LINE, True)
    assert hum.orders[0] == pytest.approx(50.0 / SPEED_HZ)
    assert places_of(swing=0.01)[0].kind is PlaceKind.SPEED
    rng = np.random.default_rng(5)
    noise = places_of(lambda t, _: 0.3 * rng.standard_normal(len(t)))[0]
    assert (noise.kind, "noise between" in noise.title) == (PlaceKind.BAND, True)


def test_the_mesh_alone_is_the_mesh_alone() -> None:
    """What is counted relative to the mesh rises when the mesh falls, and is no place of the gap."""
    mesh = [4.0, 2.0, 1.0]
    places = places_of(
        lambda _, r: -0.6 * np.sum([a * np.cos(2 * np.pi * (k + 1) * 23 * r + k) for k, a in enumerate(mesh)], axis=0)
    )
    assert [place.kind for place in places] == [PlaceKind.MESH]
    assert places[0].change_db == pytest.approx(20 * np.log10(0.4), abs=0.2)


def test_a_gain_moves_no_ratio() -> None:
    names = ("mesh.total", "sideband.driver.1", "shaft.driver.1", "shaft.driver.1.to_mesh")
    assert change_relative_to_mesh(names, np.array([6.0, 0.0, 6.0, 0.0])) == pytest.approx([6.0, 0.0, 0.0, 0.0])
    assert change_relative_to_mesh(names, np.array([-6.0, 6.0, 0.0, 6.0])) == pytest.approx([-6.0, 0.0, 0.0, 0.0])
    assert change_relative_to_mesh(names, np.array([1.0, 9.0, 8.0, 7.0])) == pytest.approx([1.0, 9.0, 7.0, 7.0])


def test_shares_add_up_to_one_at_most() -> None:
    places = places_of(lambda t, r: 1.5 * ringing(r - 0.4) + tone(10.3, 0.3)(t, r) + tone(1.0, 0.3)(t, r))
    assert {PlaceKind.TOOTH, PlaceKind.LINE, PlaceKind.SHAFT} <= {place.kind for place in places}
    assert 0.9 < sum(place.share for place in places) <= 1.0 + 1e-9
    assert [place.share for place in places] == sorted((place.share for place in places), reverse=True)


def test_what_leaks_into_an_average_is_not_its_own() -> None:
    held = reduce_recording(record(tone(7.43, 3.0), seed=1), RIG).average("a1", DRIVER).is_synchronous
    assert held[TEETH[0]]
    assert held[TEETH[0] + 1]
    assert not held[6:9].any()


def test_few_lines_of_noise_pass_for_a_shafts_own() -> None:
    rng = np.random.default_rng(1)
    sums = healthy().channels["a1"]
    shape = sums.lines[0].shape
    noise = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    counts = np.ones(len(noise))
    noisy = healthy().with_channels({"a1": replace(sums, lines=(noise, noise), counts=(counts, counts))})
    held = noisy.average("a1", DRIVER).is_synchronous
    assert held.mean() < 0.005


def test_clipping_is_told_from_a_stray_peak() -> None:
    recording = record(seed=1)
    clipped = reduce_recording(replace(recording, samples=np.clip(recording.samples, -4.0, 4.0)), RIG)
    figures = {"raw.near_the_extreme": 20.0, "raw.kurtosis": -1.0}
    assert "as clipping causes them" in gap_places(compared(figures, clipped))[0].title
    assert "clipping" not in gap_places(compared(figures))[0].title


def compared(change_db: dict[str, float], now: ReducedRecording | None = None) -> Condition:
    """Return two records that differ by noise, with features that are said to have changed; floors of 1 dB."""
    condition = condition_of(now or healthy(1))
    names, values = tuple(change_db), np.array([*change_db.values()])
    vars(condition)["change"] = Features(names, values, np.zeros(len(values)))
    vars(condition)["floor"] = StructuralFloor(names, np.ones(len(values)))
    return condition


def test_the_figure_of_a_place_is_the_one_that_was_scored() -> None:
    """The level of a pattern hardly moved; what exceeds its floor is how much the patterns differ."""
    level, apart = "tooth.driven.level", "change.driven.elsewhere"
    round_it = distributed_place(compared({level: 0.18, apart: 6.0}), DRIVEN, "shaft out", "a1")
    assert round_it.change_db == 6.0
    assert "up by 6 dB relative to changes of healthy machines" in round_it.title
    assert "0.18" not in round_it.title
    louder = distributed_place(compared({level: -4.0, apart: 2.0}), DRIVEN, "shaft out", "a1")
    assert louder.title == "tooth pattern of shaft out all round, down by 4 dB"
    shape = distributed_place(compared({level: 0.5, "tooth.driven.kurtosis": 3.0}), DRIVEN, "shaft out", "a1")
    assert shape.follows
    assert "dB" not in shape.title


def test_mesh_lines_that_hardly_moved_give_way_to_what_was_scored() -> None:
    (spot,) = gap_places(compared({"mesh.total": 0.2, "mesh.share.2": -4.0, "line.half_mesh": 0.0}))
    assert (spot.title, spot.change_db) == ("mesh harmonic 2 over all, down by 4 dB", -4.0)
    assert spot.orders == (2.0 * TEETH[0],)
    (spread,) = gap_places(compared({"mesh.total": 0.2, "alike.mesh.spread": 3.0, "line.half_mesh": 0.0}))
    assert spread.title == "orders around the mesh harmonics, which themselves hardly changed"
