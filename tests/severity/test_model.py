"""The calibration file is whole, and its models cannot fall where a deeper crack would raise a feature."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.severity import ALONE, FEATURES, FILE, RISING, WITH_REFERENCE, Calibration, DepthModel, load_calibration

MODELS = pytest.mark.parametrize("name", [WITH_REFERENCE, ALONE])


def model(name: str) -> DepthModel:
    return load_calibration().models[name]


@MODELS
def test_the_file_is_whole(name: str) -> None:
    m = model(name)
    assert m.quantiles[0] < 0 < m.quantiles[1]
    assert np.all(np.diff(m.healthy_scores) >= 0)
    assert np.all(np.linalg.eigvalsh(m.precision) > -1e-9)
    assert np.all(m.lowest < m.highest)
    assert 0 < m.percent_range[0] < m.percent_range[1] < 100
    # The threshold leaves the stated part of the healthy pairs above it.
    above = np.mean(m.healthy_scores > m.threshold)
    assert above == pytest.approx(load_calibration().provenance["false_alarms"], abs=1.0 / len(m.healthy_scores))


def test_the_file_says_where_it_comes_from() -> None:
    provenance = load_calibration().provenance
    assert {"made_by", "version", "simulator", "seed", "n_used", "modules_mm", "crack"} <= set(provenance)
    assert provenance["n_used"] <= provenance["n_drawn"]


@MODELS
@given(st.sampled_from(RISING), st.floats(0.01, 5.0), st.integers(0, 2**31))
def test_depth_and_score_do_not_fall_with_a_rising_event(name: str, feature: str, rise: float, seed: int) -> None:
    m = model(name)
    features = np.random.default_rng(seed).uniform(m.lowest, m.highest)
    more = features.copy()
    more[FEATURES.index(feature)] += rise
    assert m.log_percent(more) >= m.log_percent(features) - 1e-12
    assert m.score(more) >= m.score(features) - 1e-12


@MODELS
def test_the_least_visible_crack_is_just_visible(name: str) -> None:
    m = model(name)
    features = np.array(m.lowest)
    assert m.score(features) < m.threshold
    assert m.score(m.at_threshold(features)) == pytest.approx(m.threshold)


@MODELS
def test_p_values_count_healthy_pairs(name: str) -> None:
    m = model(name)
    n = len(m.healthy_scores)
    assert m.p_value(np.inf) == pytest.approx(1 / (n + 1))
    assert m.p_value(-np.inf) == 1.0
    assert m.p_value(float(m.healthy_scores[-1])) == pytest.approx(2 / (n + 1))


def test_what_is_unlike_the_calibration_is_named() -> None:
    m = model(WITH_REFERENCE)
    assert m.unlike(m.mean) == ""
    far = np.array(m.mean)
    far[FEATURES.index("event_slope")] = 50.0
    assert "217.1 dB" in m.unlike(far)  # 50 in ln of energy


def test_a_falling_model_is_refused() -> None:
    values = json.loads(FILE.read_text(encoding="utf-8"))
    values["models"][ALONE]["slopes"][0][1] = -1.0
    with pytest.raises(InputError, match="would fall"):
        Calibration.from_mapping(values)


def test_a_calibration_of_other_features_is_refused() -> None:
    values = json.loads(FILE.read_text(encoding="utf-8"))
    values["features"] = values["features"][1:]
    with pytest.raises(InputError, match="other features"):
        Calibration.from_mapping(values)


def test_the_reach_names_what_is_outside() -> None:
    calibration = load_calibration()
    inside = {name: (low + high) / 2 for name, (low, high) in calibration.reach.items()}
    calibration.check_reach(inside)
    with pytest.raises(RefusalError, match="module in mm is 20"):
        calibration.check_reach(inside | {"module_mm": 20.0})
