"""Depth of a root crack beside the other findings: one statement per tooth, and silence where nobody asked."""

from dataclasses import replace

import pytest

from gearsig.diagnosis import CannotTell, Finding, Kind, Outcome, Where, crack_depth, outcome_of, ranked, with_crack
from gearsig.rig import GearPair, Rig, Shaft
from gearsig.severity import CrackEstimate, NoCrackSeen
from tests.diagnosis.machines import RIG, record

PAIR = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("stage", "in", "out", 20, 40),))
CRACK = CrackEstimate(
    shaft="in",
    gear="stage/in",
    tooth=5,
    angle_deg=81.0,
    gear_is_certain=True,
    depth_mm=2.0,
    depth_percent=30.0,
    interval_mm=(1.5, 2.5),
    interval_percent=(22.0, 38.0),
    p_value=0.01,
    with_reference=True,
    reasons=("Compared with a reference.",),
)
TOOTH = Finding(
    "tooth-local-damage",
    Kind.FAULT,
    "Local tooth damage at 75°.",
    Where(("a1",), shaft="in", gear="stage/in", angle_deg=75.0, tooth=5),
    confidence=0.86,
    evidence=("It comes back.",),
)
UNDECIDED = Finding("tooth-damage-undecided", Kind.CANNOT_TELL, "Nothing shows, but noise would hide it.")
NOTHING = Finding("no-tooth-local-damage", Kind.INFORMATION, "Nothing shows.", Where(shaft="in"))
GOOD_BEARINGS = Finding("no-bearing-damage", Kind.INFORMATION, "No damage shows in the bearings.")


def none_seen(below_percent: float) -> NoCrackSeen:
    return NoCrackSeen(below_percent / 15.0, below_percent, 0.4, True)


def codes(findings: list[Finding]) -> list[str]:
    return [f.code for f in findings]


def test_a_tooth_found_both_ways_is_one_fault_with_its_depth() -> None:
    found = with_crack([TOOTH, GOOD_BEARINGS], CRACK, PAIR)
    assert codes(found) == ["tooth-local-damage", "no-bearing-damage"]
    assert "2.0 mm (1.5 to 2.5 mm)" in found[0].title
    assert "tooth 5" in found[0].title
    assert found[0].kind is Kind.FAULT
    assert found[0].confidence >= TOOTH.confidence
    assert {"It comes back.", "Compared with a reference."} <= set(found[0].evidence)


def test_a_chipped_tooth_is_not_called_cracked() -> None:
    chipped = replace(CRACK, kind_probabilities={"cracked": 0.1, "chipped": 0.7, "spalled": 0.2})
    merged = with_crack([TOOTH], chipped, PAIR)[0]
    assert "chipped or spalled rather than cracked" in merged.title
    assert any("chipped 70 %" in text for text in merged.evidence)
    assert codes(with_crack([], chipped, PAIR)) == ["tooth-local-damage"]
    likelier = replace(CRACK, kind_probabilities={"cracked": 0.25, "chipped": 0.7, "spalled": 0.05})
    assert likelier.text.startswith("Damage at tooth 5 of stage/in: chipped or spalled (75 %), or a crack of 2.0 mm")
    assert ": chipped or spalled, or a root crack of 2.0 mm" in with_crack([TOOTH], likelier, PAIR)[0].title
    undecided = replace(CRACK, kind_probabilities={"cracked": 0.5, "chipped": 0.3, "spalled": 0.2})
    assert "or it is chipped or spalled" in with_crack([TOOTH], undecided, PAIR)[0].title


def test_two_damaged_teeth_stay_two_findings() -> None:
    elsewhere = replace(TOOTH, where=replace(TOOTH.where, angle_deg=200.0))
    assert codes(with_crack([elsewhere], CRACK, PAIR)) == ["tooth-local-damage", "root-crack"]


def test_a_crack_put_down_to_the_mate_of_the_damaged_gear_is_the_same_where_both_show_it_alike() -> None:
    on_mate = replace(TOOTH, where=replace(TOOTH.where, shaft="out"))
    assert len(with_crack([on_mate], replace(CRACK, gear_is_certain=False), PAIR)) == 1
    assert len(with_crack([on_mate], CRACK, PAIR)) == 2


def test_a_crack_takes_back_that_nothing_shows_at_its_teeth() -> None:
    assert codes(with_crack([NOTHING, UNDECIDED], CRACK, PAIR)) == ["root-crack"]
    other = replace(NOTHING, where=Where(shaft="out"))
    assert codes(with_crack([other], CRACK, PAIR)) == ["no-tooth-local-damage", "root-crack"]


def test_an_unlikely_crack_is_a_suspicion_with_a_reference_and_nothing_without() -> None:
    unlikely = replace(CRACK, p_value=0.1)
    assert with_crack([], unlikely, PAIR)[0].kind is Kind.SUSPICION
    assert with_crack([NOTHING], replace(unlikely, with_reference=False), PAIR) == [NOTHING]


def test_a_damaged_bearing_makes_a_small_change_no_crack() -> None:
    bearing = Finding("bearing-outer-race", Kind.FAULT, "Damage at the outer race.", Where(bearing="front"))
    kinds = [with_crack([bearing], replace(CRACK, p_value=p), PAIR)[1].kind for p in (0.01, 0.04)]
    assert kinds == [Kind.SUSPICION, Kind.NOTICE]


def test_assumed_data_make_no_fault() -> None:
    assert with_crack([], CRACK, replace(PAIR, assumed=("module",)))[0].kind is Kind.SUSPICION


@pytest.mark.parametrize(("below_percent", "outcome"), [(20.0, Outcome.NO_FAULT), (80.0, Outcome.CANNOT_TELL)])
def test_teeth_without_a_crack_are_settled_only_if_one_would_have_shown(below_percent: float, outcome: Outcome) -> None:
    short = Finding("tooth-not-examined", Kind.CANNOT_TELL, "Teeth on shaft out cannot be examined.")
    found = with_crack([UNDECIDED, short, GOOD_BEARINGS], none_seen(below_percent), PAIR)
    assert outcome_of(ranked(found)) is outcome
    assert any(f"({below_percent:.0f} % of the root)" in f.title for f in found)


def test_a_refusal_is_told_only_to_who_asked() -> None:
    recording = record()  # its rig gives no module, face width or torque
    assert crack_depth(recording, RIG, None, None) is None
    answer = crack_depth(recording, RIG, record(seed=1), None)
    assert isinstance(answer, CannotTell)
    assert "module_mm" in answer.reason
    assert with_crack([], answer, RIG)[0].kind is Kind.INFORMATION  # without the teeth's size nobody asks for a depth
    sized = replace(RIG, pairs=tuple(replace(pair, module_mm=2.0, face_width_mm=20.0) for pair in RIG.pairs))
    assert with_crack([], answer, sized)[0].kind is Kind.CANNOT_TELL  # a torque, or another reference, would do
    two_pairs = replace(RIG, shafts=(*RIG.shafts, Shaft("end")), pairs=(*sized.pairs, GearPair("second", "out", "end")))
    assert with_crack([], answer, two_pairs)[0].kind is Kind.INFORMATION  # no reference would help, and none is wanted
