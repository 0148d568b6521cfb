"""On which shaft a cause sits: simulated on either one, by hand, and where it cannot be told; and at which tooth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import (
    SIDES,
    SIGNS,
    AddedEffect,
    BearingFrame,
    Condition,
    ConditionFacts,
    GapPlace,
    GearFrame,
    OperatingCondition,
    PlaceKind,
    ReducedRecording,
    at_recorded_tooth,
    cause_place,
    determined_options,
    gear_frame,
    load_learned,
    place_of,
    reduce_recording,
)
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft
from sims.registry import gap_simulator
from tests.marks import further

TEETH = (23, 37)


def risen(cause: str, side: str, by: float) -> dict[str, float]:
    """Return changes in floors: nothing but a cause's signs on one shaft."""
    own = {sign.format(side) for sign in SIGNS[cause]}
    return {sign.format(s): by * (sign.format(s) in own) for sign in SIGNS[cause] for s in SIDES}


def on_both(cause: str) -> dict[str, float]:
    return {sign.format(side): 4.0 for sign in SIGNS[cause] for side in SIDES}


@pytest.mark.parametrize("cause", SIGNS)
@pytest.mark.parametrize("side", SIDES)
def test_signs_that_rose_on_one_shaft_put_it_there(cause: str, side: str) -> None:
    (option,) = determined_options(cause, [risen(cause, side, 2.0)], TEETH).items()
    assert option == ("shaft" if cause == "misalignment" else "gear", side)
    assert determined_options(cause, [risen(cause, side, 0.9)], TEETH) == {}
    assert determined_options(cause, [risen(cause, side, -5.0)], TEETH) == {}


def test_what_no_shaft_has_to_itself_cannot_be_told() -> None:
    assert determined_options("tooth_wear", [on_both("unbalance")], TEETH) == {}
    assert determined_options("backlash", [{}], TEETH) == {}


@given(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
def test_exchanged_shafts_exchange_the_answer(one: float, other: float) -> None:
    def put_on(*rises: float) -> str:
        change = {sign.format(side): by for side, by in zip(SIDES, rises, strict=True) for sign in SIGNS["unbalance"]}
        return determined_options("unbalance", [change], TEETH).get("gear", "")

    assert {put_on(one, other), put_on(other, one)} in ({""}, set(SIDES))


def test_signs_on_both_shafts_cannot_be_told_but_for_an_order_that_one_shaft_cannot_have() -> None:
    both = on_both("eccentricity")
    assert determined_options("eccentricity", [both], TEETH) == {}
    # Two turns of the driver are one of the driven shaft: only the latter makes half an order of the driver.
    assert determined_options("eccentricity", [both], (23, 46)) == {"gear": "driven"}
    assert determined_options("eccentricity", [risen("eccentricity", "driver", 4.0)], (23, 46)) == {"gear": "driver"}
    # Its second order is the driver's first.
    assert determined_options("misalignment", [on_both("misalignment")], (23, 46)) == {}
    assert determined_options("misalignment", [on_both("misalignment")], (69, 23)) == {"shaft": "driver"}


def test_a_tooth_that_stands_out_on_one_shaft_alone_puts_a_tooths_fault_there() -> None:
    condition = SimpleNamespace(now=SimpleNamespace(frame=gear_frame(PAIR)), over_floors={})
    bursts = [GapPlace(PlaceKind.TOOTH, "", 9.0, shaft=name, angle_deg=50.0, tooth=4) for name in ("output", "input")]
    all_round = replace(bursts[1], angle_deg=None)
    assert cause_place("tooth_spall", None, [condition], bursts[:1]) == "tooth 4 of the gear on the output shaft"
    assert cause_place("tooth_spall", None, [condition], [all_round, bursts[0]]).endswith("on the output shaft")
    told = SimpleNamespace(now=condition.now, over_floors=risen("pitch_error", "driven", 2.0))
    assert cause_place("pitch_error", None, [told], bursts) == "tooth 4 of the gear on the output shaft"
    assert cause_place("pitch_error", None, [told], bursts[1:]) == "the gear on the output shaft"
    for name, places in (("tooth_spall", bursts), ("eccentricity", bursts[:1]), ("tooth_spall", [all_round])):
        assert cause_place(name, None, [condition], places).endswith("(which one is not known)")


def test_every_sign_is_a_feature() -> None:
    names = load_learned().change_names
    assert {sign.format(side) for signs in SIGNS.values() for sign in signs for side in SIDES} <= set(names)


POINT = OperatingCondition(1500.0, 50.0)
PAIR = Rig(
    name="pair",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 29, 47, 2.0, 20.0, 20.0),),
    operating_point=OperatingPoint("input", POINT.speed_rpm, torque_nm=POINT.torque_nm),
)


@cache
def twin():
    return gap_simulator("cracked").twin_of(PAIR)


def run(*added: AddedEffect, noise: int, point: OperatingCondition) -> ReducedRecording:
    recording = twin().run(point, added, seed=0, duration_s=1.5, sampling_rate_hz=12800.0, noise=noise)
    assert recording.rig is not None
    return reduce_recording(recording, recording.rig)


@cache
def healthy(point: OperatingCondition) -> ReducedRecording:
    return run(noise=1, point=point)


def simulated(*added: AddedEffect, point: OperatingCondition = POINT) -> dict[str, float]:
    now, reference = run(*added, noise=2, point=point), healthy(point)
    return Condition(ConditionFacts("now", point, 0.0, 0.0, 0.0), now, reference, reference, load_learned()).over_floors


@pytest.mark.slow
@pytest.mark.parametrize(
    "cause", ["root_crack", further("tooth_spall"), further("chipped_tooth"), "pitch_error", "eccentricity"]
)
@pytest.mark.parametrize("side", SIDES)
def test_a_simulated_effect_is_put_on_its_shaft(cause: str, side: str) -> None:
    *_, strong = (added for added in twin().candidates(cause) if added.options["gear"] == side)
    assert determined_options(cause, [simulated(strong)], (29, 47)) == {"gear": side}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "point"),
    [("unbalance", OperatingCondition(4500.0, 50.0)), ("misalignment", OperatingCondition(3000.0, 200.0))],
)
@pytest.mark.parametrize("side", SIDES)
def test_what_shows_at_speed_or_load_only_is_put_on_its_shaft_there(
    cause: str, point: OperatingCondition, side: str
) -> None:
    *_, strong = (a for a in twin().candidates(cause) if a.options.get("gear", a.options.get("shaft")) == side)
    assert list(determined_options(cause, [simulated(strong, point=point)], (29, 47)).values()) == [side]


@pytest.mark.slow
def test_a_healthy_machine_has_no_signs_on_either_shaft() -> None:
    again = simulated()
    assert all(determined_options(cause, [again], (29, 47)) == {} for cause in SIGNS)


# --------------------
# Where a fitted effect sits, in words, and which tooth its simulation gets.
# --------------------


FRAME = GearFrame(GearPair("stage 1", "input", "output", 29, 47), ("input", "output"), (29, 47), ())
CRACK = AddedEffect("root_crack", 2.0, {"gear": "driver", "tooth": 1.0})


def tooth_place(tooth: int | None, shaft: str = "input") -> GapPlace:
    return GapPlace(PlaceKind.TOOTH, "a burst", 20.0, 9.0, 5.0, 0.9, shaft=shaft, angle_deg=87.0, tooth=tooth)


def test_the_tooth_is_the_recordings() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(8)]) == "tooth 8 of the gear on the input shaft"
    assert at_recorded_tooth(CRACK, FRAME, [tooth_place(8)]).options == {"gear": "driver", "tooth": 8.0}


def test_gears_of_equal_teeth_meet_the_same_mate_and_cannot_be_told_apart() -> None:
    equal = replace(FRAME, teeth=(50, 50))
    assert place_of(CRACK, equal, [tooth_place(8)]) == "tooth 8 of the gear on the input shaft or its mate"
    unround = AddedEffect("eccentricity", 30.0, {"gear": "driven"})
    assert place_of(unround, equal, ()) == "the gear on the output shaft or its mate"


def test_without_a_mark_there_is_an_angle_and_the_simulated_tooth_stays() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(None)]) == "87° of the input shaft"
    assert at_recorded_tooth(CRACK, FRAME, [tooth_place(None)]) == CRACK


def test_a_burst_on_the_other_shaft_says_nothing() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(8, "output")]) == "one tooth of the gear on the input shaft"
    assert at_recorded_tooth(CRACK, FRAME, [tooth_place(8, "output")]) == CRACK


def test_bearings_of_one_type_on_a_shaft_cannot_be_told_apart() -> None:
    alike = [BearingFrame(name, 0, 3.5, 5.5, 2.3, 0.4) for name in ("near", "far")]
    frame = replace(FRAME, bearings=(*alike, BearingFrame("wheel", 1, 2.2, 3.4, 1.4, 0.25)))
    race = AddedEffect("bearing_outer_race", 0.3, {"bearing": "near"})
    assert place_of(race, frame, ()) == "near or far"
    seen = GapPlace(PlaceKind.ENVELOPE, "envelope lines", 20.0, 9.0, 5.0, 0.9, orders=(2.203,))
    assert place_of(race, frame, [seen]) == "wheel"
    assert place_of(race, frame, [replace(seen, orders=(7.7,))]) == "near or far"
    assert place_of(replace(race, options={"bearing": "of unknown size"}), frame, ()) == "of unknown size"


def test_other_places() -> None:
    assert place_of(AddedEffect("eccentricity", 30.0, {"gear": "driven"}), FRAME, ()) == "the gear on the output shaft"
    assert place_of(AddedEffect("misalignment", 1.0, {"shaft": "driven"}), FRAME, ()) == "the output shaft"
    assert place_of(AddedEffect("bearing_clearance", 9.0, {"bearing": "NDE"}), FRAME, ()) == "NDE"
    assert place_of(AddedEffect("torque_ripple", 5.0, {"order": 6.0}), FRAME, ()) == "order 6"
    assert place_of(AddedEffect("backlash", 100.0), FRAME, ()) == ""
    assert at_recorded_tooth(AddedEffect("backlash", 100.0), FRAME, [tooth_place(3)]) == AddedEffect("backlash", 100.0)
