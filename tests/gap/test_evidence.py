"""What speaks for an effect: its own features, predicted beside observed; and what features are called."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap import (
    EffectPath,
    Evidence,
    Fit,
    Interval,
    ObservedChange,
    evidence_of,
    evidence_of_feature,
    family_of,
    feature_text,
    gear_frame,
    load_learned,
)
from tests.gap.synthetic import RIG

NAMES = (*(f"change.driver.{what}" for what in ("level", "peak", "prominence", "second", "kurtosis")), "hum")


def told(predicted: list[float], observed: list[float]) -> tuple[Evidence, ...]:
    table: FloatArray = np.array([predicted])
    path = EffectPath("root_crack", {}, np.array([1.0]), (table[None],), NAMES)
    seen = ObservedChange(0, np.array(observed), np.ones(len(NAMES)))
    return evidence_of(Fit(path, Interval(1.0, 1.0, 1.0), 0.0, {0: 0}), [seen], gear_frame(RIG))


def test_a_burst_is_told_by_more_than_one_of_its_figures() -> None:
    found = told([2.0, 9.0, 10.0, 8.0, 3.0, 0.0], [2.0, 8.0, 9.0, 8.0, 3.0, 0.0])
    assert len(found) == 3
    assert all(one.speaks_for for one in found)
    assert "burst over the median tooth" in found[0].feature


def test_what_it_would_change_comes_before_a_change_that_is_not_its_own() -> None:
    found = told([0.0, 0.0, 5.0, 0.0, 0.0, 0.0], [0.0, 7.0, 5.0, 0.0, 0.0, 8.0])
    assert [one.predicted_db for one in found] == [5.0, 0.0, 0.0]
    assert [one.speaks_for for one in found] == [True, False, False]


def test_what_stays_within_the_floor_on_both_sides_says_nothing() -> None:
    assert told([0.6] * 6, [0.9] * 6) == ()


def test_what_moved_further_than_predicted_is_not_against_it() -> None:
    said = {
        (5.0, 12.0): (False, True),  # the right way, more than twice as far
        (-5.0, -12.0): (False, True),
        (5.0, 9.0): (True, False),
        (5.0, 1.0): (False, False),  # it did not come
        (5.0, -12.0): (False, False),  # the other way
        (0.7, 1.5): (False, True),  # what it leaves is within the floor
        (0.5, 12.0): (False, False),  # not predicted beyond the floor, and much is left
        (0.1, 1.05): (False, False),  # hardly predicted
        (0.0, 12.0): (False, False),
    }
    for (predicted, observed), stance in said.items():
        one = evidence_of_feature("kurtosis", predicted, observed, 1.0)
        assert (one.speaks_for, one.is_further) == stance, (predicted, observed)


def test_small_predictions_speak_for_an_effect_by_their_size_alone() -> None:
    """Where they count from 0.3 floors on, the other sign is within the floor, and no agreement."""
    assert evidence_of_feature("level", 0.4, 0.6, 1.0, min_floors=0.3).speaks_for
    for observed in (-0.5, 5.0):
        one = evidence_of_feature("level", 0.4, observed, 1.0, min_floors=0.3)
        assert (one.speaks_for, one.is_further) == (False, False)


# --------------------
# Features in words.
# --------------------


def test_every_feature_has_words_of_its_own_and_a_family() -> None:
    names = load_learned().change_names
    words = [feature_text(name, gear_frame(RIG)) for name in names]
    assert len(set(words)) == len(names)
    assert all(family_of(name) for name in names)
