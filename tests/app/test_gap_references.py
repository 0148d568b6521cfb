"""Which reference a recording is compared with."""

from __future__ import annotations

from functools import cache

import pytest

from gearsig.gap import (
    HealthyReference,
    ReducedRecording,
    change_features,
    gap_size,
    load_learned,
    matching_reference,
    reduce_recording,
)
from gearsig.prepared import PreparedRecording
from tests.gap.synthetic import RIG, record


@cache
def run(seed: int) -> ReducedRecording:
    return reduce_recording(record(seed=seed), RIG)


def healthy(gathered: ReducedRecording) -> list[HealthyReference]:
    return [HealthyReference(gathered, PreparedRecording(record(seed=1)))]


def named(seed: int, *names: str) -> ReducedRecording:
    return run(seed).with_channels(dict(zip(names, run(seed).channels.values(), strict=False)))


def test_equal_names_are_compared_as_they_are() -> None:
    assert matching_reference(run(0), RIG, healthy(run(1))) == (healthy(run(1))[0], "")


@pytest.mark.slow
def test_few_revolutions_are_compared_with_as_many_of_a_longer_reference() -> None:
    short = reduce_recording(record(seed=0).between(1.0, 1.65), RIG)
    found, _ = matching_reference(short, RIG, healthy(run(1)))
    assert found is not None
    assert found.reduced.n_revolutions == pytest.approx(short.n_revolutions, abs=2.0)
    floor = load_learned().floor(with_reference=True)
    same, longer = (
        gap_size(change_features(short, reference), floor).structural.value for reference in (found.reduced, run(1))
    )
    assert same < 0.75 * longer


def test_the_only_channel_of_each_is_the_same_whatever_its_name() -> None:
    found, why = matching_reference(named(0, "ch1"), RIG, healthy(named(1, "a1")))
    assert found is not None
    assert why == ""
    assert tuple(found.reduced.channels) == ("ch1",)
    assert found.reduced.channels["ch1"] is run(1).channels["a1"]


def test_channels_that_only_one_of_them_has_are_left_out() -> None:
    both, one = run(1), named(0, "a1")
    found, _ = matching_reference(one, RIG, healthy(both))
    assert found is not None
    assert tuple(found.reduced.channels) == ("a1",)
    assert matching_reference(run(0), RIG, healthy(named(1, "a1")))[0] is not None


def test_of_several_channels_with_other_names_nobody_knows_which_is_which() -> None:
    found, why = matching_reference(named(0, "left", "right"), RIG, healthy(run(1)))
    assert found is None
    assert "a1, a2" in why
