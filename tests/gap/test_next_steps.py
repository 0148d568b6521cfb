"""What would help most, by code: where it does, and where it was done already."""

from __future__ import annotations

import pytest

from gearsig.gap import GapCause, GapOutcome, OperatingCondition, next_steps

FAST = [OperatingCondition(1500.0, 60.0)]
TWO_SPEEDS = [OperatingCondition(700.0, 60.0), *FAST]
SLOW = [OperatingCondition(200.0, 60.0), OperatingCondition(200.0, 20.0)]


def codes(
    *names: str,
    outcome=GapOutcome.CANNOT_SEPARATE,
    points=FAST,
    reference=True,
    encoders=False,
    labelled=True,
    run_up=True,
):
    causes = [GapCause(name, "", name, "", 0.9 / len(names)) for name in names]
    found = next_steps(
        outcome,
        causes,
        points,
        has_reference=reference,
        has_encoders=encoders,
        is_labelled=labelled,
        has_run_up=run_up,
    )
    return [step.code for step in found]


def test_a_healthy_reference_comes_first_and_nothing_is_needed_without_a_gap() -> None:
    assert codes("root_crack", "tooth_spall", reference=False)[0] == "healthy"
    assert codes("none", outcome=GapOutcome.NO_GAP, reference=False) == []


def test_damaged_teeth_ask_for_encoders_and_two_slow_loads() -> None:
    assert codes("root_crack", "tooth_spall") == ["encoders", "slow_loads"]
    assert codes("root_crack", "pitch_error", encoders=True) == ["slow_loads"]
    assert codes("root_crack", "tooth_spall", points=SLOW) == ["encoders"]
    assert codes("root_crack", "unbalance", run_up=False) == []
    assert codes("root_crack", "tooth_spall", encoders=True, points=SLOW, run_up=False) == ["run_up"]
    assert "run_up" not in codes("root_crack", "tooth_spall", reference=False, run_up=False)  # nothing would pass it


@pytest.mark.parametrize("both", [("unbalance", "eccentricity"), ("transfer_path", "tooth_wear")])
def test_paths_and_shafts_ask_for_another_speed_where_the_speed_was_not_varied(both: tuple[str, str]) -> None:
    assert codes(*both) == ["other_speed"]
    assert codes(*both, points=TWO_SPEEDS) == []


def test_labels_are_asked_for_where_it_is_not_settled() -> None:
    assert codes("root_crack", labelled=False) == ["label"]
    assert codes("root_crack", labelled=False, outcome=GapOutcome.EFFECT) == []
    assert codes("unknown", labelled=False, outcome=GapOutcome.UNKNOWN) == []  # there is no likely cause to label
