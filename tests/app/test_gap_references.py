"""Which reference a recording is compared with."""

from __future__ import annotations

from functools import cache

from gearsig.gap import HealthyReference, ReducedRecording, matching_reference, reduce_recording
from tests.gap.synthetic import RIG, record


@cache
def run(seed: int) -> ReducedRecording:
    return reduce_recording(record(seed=seed), RIG)


def healthy(gathered: ReducedRecording) -> list[HealthyReference]:
    return [HealthyReference(gathered, RIG, "healthy.h5")]


def named(seed: int, *names: str) -> ReducedRecording:
    return run(seed).with_channels(dict(zip(names, run(seed).channels.values(), strict=False)))


def test_equal_names_are_compared_as_they_are() -> None:
    assert matching_reference(run(0), RIG, healthy(run(1))) == (HealthyReference(run(1), RIG, "healthy.h5"), "")


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
