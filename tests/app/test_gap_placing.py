"""Where a fitted effect sits, in words, and which tooth its simulation gets."""

from __future__ import annotations

from dataclasses import replace

from gearsig.gap import Added, BearingFrame, GapPlace, GearFrame, PlaceKind, at_its_tooth, place_of
from gearsig.rig import GearPair

FRAME = GearFrame(GearPair("stage 1", "input", "output", 29, 47), ("input", "output"), (29, 47), ())
CRACK = Added("root_crack", 2.0, {"gear": "driver", "tooth": 1.0})


def tooth_place(tooth: int | None, shaft: str = "input") -> GapPlace:
    return GapPlace(PlaceKind.TOOTH, "a burst", 20.0, 9.0, 5.0, 0.9, shaft=shaft, angle_deg=87.0, tooth=tooth)


def test_the_tooth_is_the_recordings() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(8)]) == "tooth 8 of the gear on the input shaft"
    assert at_its_tooth(CRACK, FRAME, [tooth_place(8)]).options == {"gear": "driver", "tooth": 8.0}


def test_without_a_mark_there_is_an_angle_and_the_simulated_tooth_stays() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(None)]) == "87° of the input shaft"
    assert at_its_tooth(CRACK, FRAME, [tooth_place(None)]) == CRACK


def test_a_burst_on_the_other_shaft_says_nothing() -> None:
    assert place_of(CRACK, FRAME, [tooth_place(8, "output")]) == "one tooth of the gear on the input shaft"
    assert at_its_tooth(CRACK, FRAME, [tooth_place(8, "output")]) == CRACK


def test_bearings_of_one_type_on_a_shaft_cannot_be_told_apart() -> None:
    alike = [BearingFrame(name, 0, 3.5, 5.5, 2.3, 0.4) for name in ("near", "far")]
    frame = replace(FRAME, bearings=(*alike, BearingFrame("wheel", 1, 2.2, 3.4, 1.4, 0.25)))
    race = Added("bearing_outer_race", 0.3, {"bearing": "near"})
    assert place_of(race, frame, ()) == "near or far"
    seen = GapPlace(PlaceKind.ENVELOPE, "envelope lines", 20.0, 9.0, 5.0, 0.9, orders=(2.203,))
    assert place_of(race, frame, [seen]) == "wheel"
    assert place_of(race, frame, [replace(seen, orders=(7.7,))]) == "near or far"
    assert place_of(replace(race, options={"bearing": "of unknown size"}), frame, ()) == "of unknown size"


def test_other_places() -> None:
    assert place_of(Added("eccentricity", 30.0, {"gear": "driven"}), FRAME, ()) == "the gear on the output shaft"
    assert place_of(Added("misalignment", 1.0, {"shaft": "driven"}), FRAME, ()) == "the output shaft"
    assert place_of(Added("bearing_clearance", 9.0, {"bearing": "NDE"}), FRAME, ()) == "NDE"
    assert place_of(Added("torque_ripple", 5.0, {"order": 6.0}), FRAME, ()) == "order 6"
    assert place_of(Added("backlash", 100.0), FRAME, ()) == ""
    assert at_its_tooth(Added("backlash", 100.0), FRAME, [tooth_place(3)]) == Added("backlash", 100.0)
