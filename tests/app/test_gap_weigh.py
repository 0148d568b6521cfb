"""Effects that the forests do not know: their share of what is unknown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.gap import NONE, UNKNOWN, Added, refuse_where_none_ran, with_unknown_shared

FOUND = {UNKNOWN: 0.5, "clipping": 0.3, NONE: 0.2}
SCORES = st.dictionaries(st.sampled_from(["a", "b", "c"]), st.floats(-1.0, 1.0), max_size=3)


def test_one_takes_of_unknown_what_it_explains() -> None:
    found = with_unknown_shared(FOUND, {"mine": 0.8})
    assert found == pytest.approx({"mine": 0.4, "clipping": 0.3, NONE: 0.2, UNKNOWN: 0.1})
    assert list(found) == ["mine", "clipping", NONE, UNKNOWN]


def test_what_does_not_shrink_the_gap_has_no_share() -> None:
    assert with_unknown_shared(FOUND, {"mine": -0.3}) == {**FOUND, "mine": 0.0}
    assert with_unknown_shared(FOUND, {}) == FOUND


@given(scores=SCORES)
def test_nothing_is_lost_and_only_unknown_gives(scores: dict[str, float]) -> None:
    found = with_unknown_shared(FOUND, scores)
    assert sum(found.values()) == pytest.approx(1.0)
    assert all(p >= 0.0 for p in found.values())
    assert (found["clipping"], found[NONE]) == (0.3, 0.2)
    best = max(scores, key=scores.__getitem__, default="")
    assert all(found[best] >= found[name] for name in scores)


class OnlyGears:
    """A twin whose rig names no bearing."""

    def candidates(self, effect: str) -> list[Added]:
        return [] if effect.startswith("bearing") else [Added(effect, 1.0)]


def test_effects_that_the_rig_has_no_place_for_are_no_reason_to_refuse() -> None:
    refuse_where_none_ran({}, ["bearing_clearance"], OnlyGears())  # type: ignore[arg-type]  # asked for candidates alone
    with pytest.raises(RefusalError, match="none of tooth_wear can be simulated"):
        refuse_where_none_ran({}, ["bearing_clearance", "tooth_wear"], OnlyGears())  # type: ignore[arg-type]  # the same
