"""Whether channels changed alike: a gain of one does not look like a stronger excitation."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gearsig.gap import apart_features, change_features, change_once, reduce_recording, soft_size
from tests.gap.synthetic import RIG, record

HEALTHY = record()


def louder(first: float, second: float):
    gained = replace(HEALTHY, samples=HEALTHY.samples * [[first], [second]])
    return reduce_recording(gained, RIG)


@pytest.mark.parametrize(("gains", "apart_db"), [((2.0, 1.0), 3.01), ((2.0, 2.0), 0.0), ((1.0, 1.0), 0.0)])
def test_one_channel_louder_is_apart_by_half_of_it(gains: tuple[float, float], apart_db: float) -> None:
    found = dict(apart_features(louder(*gains), reduce_recording(HEALTHY, RIG)))
    assert found == pytest.approx({"apart.mesh": apart_db, "apart.floor": apart_db}, abs=0.01)


def test_a_single_channel_has_nothing_to_differ_from() -> None:
    one = reduce_recording(HEALTHY, RIG)
    one = one.with_channels({"a1": one.channels["a1"]})
    assert dict(apart_features(one, one)) == {"apart.mesh": 0.0, "apart.floor": 0.0}


@pytest.mark.slow
def test_it_is_a_feature_of_a_change_and_no_part_of_its_size() -> None:
    change = change_features(louder(2.0, 1.0), reduce_recording(HEALTHY, RIG))
    own = [change.names.index(f"apart.{name}") for name in ("mesh", "floor")]
    names, values = change_once(louder(2.0, 1.0), reduce_recording(HEALTHY, RIG))
    values = values.copy()
    before = soft_size(names, values)
    values[own] = 99.0
    assert soft_size(names, values) == before
