"""Limits, change points and alarms: their stated rates by simulation, closed forms, hysteresis."""

import numpy as np
import pytest

from gearsig.fleet import (
    ALARM,
    OK,
    WARNING,
    alarm_levels,
    change_points,
    cusum_threshold,
    prediction_limits,
    regressors,
    standardised_innovations,
)

N_SERIES = 20_000


@pytest.mark.parametrize("n_baseline", [7, 20])
def test_an_unchanged_machine_leaves_its_limits_as_often_as_stated(n_baseline):
    """For a short baseline as well: the parameters are not taken as known."""
    rng, rate = np.random.default_rng(1), 0.02
    y = 3.0 + 0.7 * rng.normal(size=(n_baseline + 1, N_SERIES))
    baseline = np.arange(n_baseline + 1) < n_baseline
    expected, reach = prediction_limits(y, np.ones((n_baseline + 1, 1)), baseline, rate)
    outside = np.abs(y[-1] - expected[-1]) > reach[-1]
    assert outside.mean() == pytest.approx(rate, abs=4 * np.sqrt(rate / N_SERIES))


def test_limits_follow_speed_and_load_with_the_same_rate():
    rng, rate, n = np.random.default_rng(2), 0.02, 25
    speed, load = rng.uniform(900, 1500, n), rng.uniform(40, 160, n)
    baseline = np.arange(n) < n - 1
    speed[-1], load[-1] = 1450.0, 60.0
    x, inside, names = regressors(speed, load, baseline)
    assert names == ("speed", "load")
    assert inside[-1]
    y = (40 * np.log10(speed) + 10 * np.log10(load))[:, None] + 0.8 * rng.normal(size=(n, N_SERIES))
    expected, reach = prediction_limits(y, x, baseline, rate)
    outside = np.abs(y[-1] - expected[-1]) > reach[-1]
    assert outside.mean() == pytest.approx(rate, abs=4 * np.sqrt(rate / N_SERIES))
    assert np.allclose(expected[-1].mean(), 40 * np.log10(1450) + 10 * np.log10(60), atol=0.05)


def test_a_speed_far_from_the_baselines_is_not_judged():
    speed = np.array([1000.0] * 10 + [1200.0, 1300.0, 700.0, np.nan])
    _, inside, names = regressors(speed, np.full(14, np.nan), np.arange(14) < 10)
    assert names == ()
    assert list(inside[10:]) == [True, False, False, True]


def test_innovations_of_an_unchanged_machine_are_independent_and_standard_normal():
    from scipy.stats import kstest

    rng = np.random.default_rng(3)
    x = np.column_stack([np.ones(40), rng.normal(size=40)])
    q = standardised_innovations(rng.normal(size=(40, 3000)) * 2.0 + 5.0, x)
    assert np.isnan(q[:3]).all()
    assert kstest(q[3:].ravel(), "norm").pvalue > 1e-3
    assert abs(np.mean(q[4:] * q[3:-1])) < 4 / np.sqrt(36 * 3000)


def test_a_gap_in_a_series_changes_nothing_else():
    rng = np.random.default_rng(4)
    y = rng.normal(size=(30, 3))
    whole = standardised_innovations(y, np.ones((30, 1)))
    y[12, 1] = np.nan
    with_gap = standardised_innovations(y, np.ones((30, 1)))
    assert np.array_equal(whole[:, [0, 2]], with_gap[:, [0, 2]], equal_nan=True)
    assert np.isnan(with_gap[12, 1])


def test_false_changes_come_as_seldom_as_stated():
    """Over its first `run_length` values a CUSUM without a change raises about as many alarms as 1 - 1/e of series."""
    run_length = 300.0
    q = np.random.default_rng(5).normal(size=(int(run_length), 4000))
    _, noticed = change_points(q, run_length)
    assert (noticed >= 0).mean() == pytest.approx(1 - np.exp(-1), abs=0.04)


@pytest.mark.parametrize(("threshold", "run_length"), [(4.0, 168.0), (5.0, 465.0)])
def test_thresholds_agree_with_tables(threshold, run_length):
    """D. C. Montgomery, Introduction to Statistical Quality Control, table 9.3: two-sided, k = 1/2."""
    assert cusum_threshold(run_length) == pytest.approx(threshold, abs=0.03)


def test_a_change_is_dated_where_it_began():
    rng = np.random.default_rng(6)
    y = rng.normal(size=(80, 400))
    y[50:] += 2.0
    began, noticed = change_points(standardised_innovations(y, np.ones((80, 1))), 1e4)
    assert (noticed >= 0).mean() > 0.97
    assert np.median(began[noticed >= 50]) == pytest.approx(50, abs=1)


def test_an_alarm_is_raised_at_once_and_cleared_after_calm_values_on_end():
    sample = np.array([0, 1, 0, 0, 1, 2, 0, 0, 0, -1, 0])[:, None]
    calm = np.array([1, 0, 1, 0, 0, 0, 1, 1, 1, 0, 1], dtype=bool)[:, None]
    levels = alarm_levels(sample, calm, 3)[:, 0]
    assert list(levels) == [OK, WARNING, WARNING, WARNING, WARNING, ALARM, ALARM, ALARM, OK, OK, OK]
