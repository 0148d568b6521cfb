"""Weighing causes of start–stop changes: closed forms on made-up floors and predictions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import NONE, UNKNOWN, shares_of
from gearsig.gap.start_stop import (
    NAMES,
    DriveFloor,
    PredictedCause,
    affected_features,
    evidences,
    fit,
    load_floors,
    shrink,
)

N = len(NAMES)
FLOOR_OF_ONE = DriveFloor(np.zeros(N), np.ones(N), 1.0)


def direction(place: int, size: float = 1.0) -> np.ndarray:
    found = np.zeros(N)
    found[place] = size
    return found


def cause(name: str, place: int) -> PredictedCause:
    severities = np.array([10.0, 20.0, 40.0])
    changes = np.array([direction(place, 0.5 * s) for s in severities])
    return PredictedCause(name, severities, changes, np.zeros(N, dtype=bool))


def test_a_severity_is_recovered():
    found = fit(cause("a", 0), direction(0, 14.0), FLOOR_OF_ONE)
    assert found.severity.value == pytest.approx(28.0, rel=0.05)
    assert found.severity.low < 28.0 < found.severity.high


def test_what_measures_the_severity_decides_how_much_and_not_whether():
    """The second change asks for twice the severity; a quarter more or less is the model's own error."""
    plain = cause("a", 0)
    both = replace(plain, changes=plain.changes + 0.5 * plain.changes[:, [0]] * direction(1))
    change = direction(0, 14.0) + direction(1, 14.0)
    between = fit(both, change, FLOOR_OF_ONE)
    direct = fit(replace(both, direct=direction(0) > 0.0), change, FLOOR_OF_ONE)
    assert direct.severity.value == pytest.approx(28.0, rel=0.08)
    assert abs(direct.severity.value - 28.0) < abs(between.severity.value - 28.0)
    assert direct.log_evidence == between.log_evidence


def test_two_signs_have_two_sides():
    both = PredictedCause(
        "a", np.array([-40.0, 40.0]), np.array([direction(0, -20.0), direction(0, 20.0)]), np.zeros(N, bool)
    )
    assert fit(both, direction(0, -10.0), FLOOR_OF_ONE).severity.value == pytest.approx(-20.0, rel=0.1)


def test_no_change_is_none():
    fits = [fit(cause(str(i), i), np.zeros(N), FLOOR_OF_ONE) for i in range(4)]
    assert max(evidences(np.zeros(N), FLOOR_OF_ONE, fits).items(), key=lambda one: one[1])[0] == NONE


def test_a_change_of_its_own_is_named_and_a_strange_one_is_not():
    fits = [fit(cause(str(i), i), direction(2, 15.0), FLOOR_OF_ONE) for i in range(4)]
    found = shares_of(evidences(direction(2, 15.0), FLOOR_OF_ONE, fits))
    assert found["2"] > 0.5
    strange = shares_of(
        evidences(direction(9, 15.0), FLOOR_OF_ONE, [fit(cause("0", 0), direction(9, 15.0), FLOOR_OF_ONE)])
    )
    assert strange[UNKNOWN] > 0.9
    assert sum(found.values()) == pytest.approx(1.0)


def test_what_cannot_be_told_says_nothing():
    change = np.full(N, np.nan)
    found = evidences(change, FLOOR_OF_ONE, [fit(cause("a", 0), change, FLOOR_OF_ONE)])
    assert found["a"] == pytest.approx(found[NONE])
    assert FLOOR_OF_ONE.size(change) == 0.0


@given(st.floats(0.1, 30.0))
def test_a_right_prediction_takes_all_away(size):
    change = direction(3, size)
    own = affected_features(change, change, FLOOR_OF_ONE)
    before, after, taken, slope = shrink(change, change, FLOOR_OF_ONE, own)
    assert (after, taken) == (0.0, 1.0)
    assert before == pytest.approx(size / 1.96)  # floors are where 95 % of a normal distribution end
    assert slope == pytest.approx(1.0)


def test_a_floor_of_healthy_drives_keeps_nineteen_of_twenty():
    rows = np.random.default_rng(1).normal(2.0, 3.0, (400, N))
    floor = DriveFloor.of_healthy(rows)
    assert np.mean([floor.size(row) > 1.0 for row in rows]) == pytest.approx(0.05, abs=0.01)
    assert floor.scale == pytest.approx(np.full(N, 3.0), rel=0.15)
    again = DriveFloor.from_dict(floor.to_dict())
    assert again.size(rows[0]) == pytest.approx(floor.size(rows[0]), rel=1e-3)


@pytest.mark.parametrize("with_reference", [True, False])
def test_the_shipped_floors_are_whole(with_reference):
    floors, calibration = load_floors(with_reference=with_reference)
    assert all(np.all(floor.scale > 0.0) for floor in floors)
    assert calibration.sharpness > 0.0


def test_what_a_recording_itself_scatters_by_is_no_property_of_other_drives():
    """Half of the drives have coarse encoders: their scatter is known, and the floor is that of the others."""
    rng = np.random.default_rng(2)
    scatters = np.where(np.arange(400)[:, None] % 2, 12.0, 0.1) * np.ones(N)
    rows = 1.0 + rng.normal(0.0, np.hypot(2.0, scatters))
    floor = DriveFloor.of_healthy(rows, scatters)
    assert floor.scale == pytest.approx(np.full(N, 2.0), rel=0.35)
    assert DriveFloor.of_healthy(rows).scale.min() > 4.0
    assert np.mean([floor.widened(e).size(row) > 1.0 for row, e in zip(rows, scatters, strict=True)]) == pytest.approx(
        0.05, abs=0.01
    )
    assert floor.widened(np.full(N, np.nan)).scale == pytest.approx(floor.scale)
