"""Calibrated probabilities and what may be said of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import NONE, UNKNOWN, GapCalibration, GapEffect, GapOutcome, load_gap_calibration, score_of

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


def test_a_placebo_that_does_as_well_leaves_no_score() -> None:
    assert score_of(0.8, 0.8) == 0.0
    assert score_of(0.8, -0.5) == 0.8
    assert score_of(-7.0, 0.0) == -1.0


@pytest.mark.parametrize("with_reference", [True, False])
def test_the_shipped_calibration_is_sane(with_reference: bool) -> None:
    found = load_gap_calibration(with_reference=with_reference)
    assert found.sharpness > 0
    assert found.shrink_weight >= 0
    assert 0 < found.named_from < 1
    assert 0.5 <= found.apart < 1
