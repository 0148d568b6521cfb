"""Calibrated probabilities: of one condition, of several, and of effects that the forests do not know."""

from __future__ import annotations

from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import (
    NONE,
    UNKNOWN,
    GapCalibration,
    GapEffect,
    GapOutcome,
    joint_probabilities,
    load_gap_calibration,
    with_unknown_distributed,
)

PLAIN = GapCalibration(1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.65)
FOREST = {"root_crack": 0.5, "eccentricity": 0.2, NONE: 0.2, UNKNOWN: 0.1}


def test_without_calibration_probabilities_stay() -> None:
    assert PLAIN.probabilities(FOREST, {}) == pytest.approx(FOREST)


@given(st.floats(0.2, 3.0), st.floats(0.0, 5.0), st.floats(-1.0, 1.0))
def test_probabilities_add_up_and_are_in_order(sharpness: float, weight: float, score: float) -> None:
    found = GapCalibration(sharpness, weight, 0.1, 0.3, -0.2, 0.5, 0.65).probabilities(FOREST, {"eccentricity": score})
    assert sum(found.values()) == pytest.approx(1.0)
    assert list(found.values()) == sorted(found.values(), reverse=True)


def test_what_shrinks_the_gap_gains() -> None:
    weighed = GapCalibration(1.0, 3.0, 0.0, 0.0, 0.0, 0.5, 0.65).probabilities(FOREST, {"eccentricity": 0.9})
    assert next(iter(weighed)) == "eccentricity"


def test_of_a_large_gap_more_is_said_and_less_that_it_is_none() -> None:
    calibration = GapCalibration(1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.65, sharper=0.3, none_slope=-1.0)
    small, usual, large = (calibration.probabilities(FOREST, {}, size) for size in (0.5, 1.0, 4.0))
    assert usual == pytest.approx(FOREST)
    assert small["root_crack"] < usual["root_crack"] < large["root_crack"]
    assert small[NONE] > usual[NONE] > large[NONE]
    assert GapCalibration.from_mapping(calibration.to_mapping()) == calibration


def test_outcomes() -> None:
    def outcome(**given: float) -> GapOutcome:
        rest = 1.0 - sum(given.values())
        return PLAIN.outcome({NONE: 0.0, UNKNOWN: 0.0, "unbalance": rest, **given})

    assert outcome(root_crack=0.8) is GapOutcome.EFFECT
    assert outcome(root_crack=0.5) is GapOutcome.CANNOT_SEPARATE
    assert PLAIN.outcome(probabilities(root_crack=0.45, unbalance=0.1)) is GapOutcome.CANNOT_SEPARATE
    assert PLAIN.outcome(probabilities(root_crack=0.4, unbalance=0.05)) is GapOutcome.UNDECIDED
    assert outcome(none=0.7) is GapOutcome.NO_GAP
    assert outcome(unknown=0.7) is GapOutcome.UNKNOWN


def test_a_certain_kind_is_told_where_no_effect_of_it_is() -> None:
    teeth = dict.fromkeys(("root_crack", "tooth_spall", "chipped_tooth", "pitch_error"), 0.19)
    found = {**teeth, "unbalance": 0.2, NONE: 0.02, UNKNOWN: 0.02}
    of_teeth = ("root_crack", "tooth_spall", "chipped_tooth")
    known = {name: GapEffect(name, "tooth-local", name, "depth", "mm") for name in of_teeth}
    assert PLAIN.outcome(found) is GapOutcome.UNDECIDED
    assert PLAIN.outcome(found, known) is GapOutcome.CANNOT_SEPARATE


def test_several_conditions_say_more_than_one_by_the_calibrated_factor() -> None:
    sharper = GapCalibration(1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.65, several=2.0)
    assert sharper.probabilities(FOREST, {}) == pytest.approx(FOREST)
    squared = {name: p**2 for name, p in FOREST.items()}
    expected = {name: p / sum(squared.values()) for name, p in squared.items()}
    assert sharper.probabilities(FOREST, {}, n_conditions=2) == pytest.approx(expected)
    assert GapCalibration.from_mapping(sharper.to_mapping()) == sharper


def probabilities(**given: float) -> dict[str, float]:
    """Many further effects share the rest."""
    rest = 1.0 - sum(given.values())
    return {NONE: 0.0, UNKNOWN: 0.0, **{f"effect {i}": rest / 20 for i in range(20)}, **given}


@pytest.mark.parametrize("with_reference", [True, False])
def test_the_shipped_calibration_is_sane(with_reference: bool) -> None:
    found = load_gap_calibration(with_reference=with_reference)
    assert found.sharpness > 0
    assert found.shrink_weight >= 0
    assert 0 < found.named_from < 1
    assert 0.5 <= found.apart < 1


# --------------------
# Several operating conditions together.
# --------------------


SURE = {"backlash": 0.8, "wear": 0.1, NONE: 0.1}
NOTHING = {"backlash": 0.05, "wear": 0.05, NONE: 0.9}
LIGHT, LOADED = 5.0, 120.0


def test_one_condition_says_what_it_says() -> None:
    assert joint_probabilities([SURE], [LOADED], SURE) == pytest.approx(SURE)


def test_causes_that_may_not_be_named_share_nothing() -> None:
    assert joint_probabilities([SURE], [LIGHT], ["wear", NONE]) == pytest.approx({"wear": 0.5, NONE: 0.5})


def test_an_effect_may_be_unseen_at_one_of_two() -> None:
    found = joint_probabilities([SURE, NOTHING], [LOADED, LOADED], SURE)
    pooled = {name: (SURE[name] * NOTHING[name]) ** 0.5 for name in SURE}
    assert found["backlash"] > pooled["backlash"] / sum(pooled.values())
    by_hand = {n: ((0.8 * SURE[n] + 0.2 * 0.1) * (0.8 * NOTHING[n] + 0.2 * 0.9)) ** 0.5 for n in SURE}
    assert found == pytest.approx({n: p / sum(by_hand.values()) for n, p in by_hand.items()})


def test_load_that_keeps_the_flanks_together_does_not_speak_against_backlash() -> None:
    kept_together = joint_probabilities([SURE, NOTHING], [LIGHT, LOADED], SURE)
    both_light = joint_probabilities([SURE, NOTHING], [LIGHT, LIGHT], SURE)
    assert kept_together["backlash"] > 1.05 * both_light["backlash"]


def test_loads_that_never_let_them_part_or_are_not_known_change_nothing() -> None:
    loaded, unknown = (joint_probabilities([SURE, NOTHING], [load, load], SURE) for load in (LOADED, nan))
    assert loaded == pytest.approx(unknown)


def test_the_same_said_twice_is_no_surer() -> None:
    joint = joint_probabilities([SURE, SURE, SURE], [LOADED] * 3, SURE)
    once = {name: 0.8 * SURE[name] + 0.2 * SURE[NONE] for name in SURE}
    assert joint == pytest.approx({name: p / sum(once.values()) for name, p in once.items()})


# --------------------
# Effects that the forests do not know: their share of what is unknown.
# --------------------


FOUND = {UNKNOWN: 0.5, "clipping": 0.3, NONE: 0.2}
SCORES = st.dictionaries(st.sampled_from(["a", "b", "c"]), st.floats(-1.0, 1.0), max_size=3)


def test_one_takes_of_unknown_what_it_explains() -> None:
    found = with_unknown_distributed(FOUND, {"mine": 0.8})
    assert found == pytest.approx({"mine": 0.4, "clipping": 0.3, NONE: 0.2, UNKNOWN: 0.1})
    assert list(found) == ["mine", "clipping", NONE, UNKNOWN]


def test_what_does_not_shrink_the_gap_has_no_share() -> None:
    assert with_unknown_distributed(FOUND, {"mine": -0.3}) == {**FOUND, "mine": 0.0}
    assert with_unknown_distributed(FOUND, {}) == FOUND


@given(scores=SCORES)
def test_nothing_is_lost_and_only_unknown_gives(scores: dict[str, float]) -> None:
    found = with_unknown_distributed(FOUND, scores)
    assert sum(found.values()) == pytest.approx(1.0)
    assert all(p >= 0.0 for p in found.values())
    assert (found["clipping"], found[NONE]) == (0.3, 0.2)
    best = max(scores, key=scores.__getitem__, default="")
    assert all(found[best] >= found[name] for name in scores)
