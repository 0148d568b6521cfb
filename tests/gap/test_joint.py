"""Several operating conditions together."""

from __future__ import annotations

from math import nan

import pytest

from gearsig.gap import NONE, joint_probabilities

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
