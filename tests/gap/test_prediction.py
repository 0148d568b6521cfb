"""Paths over severity, fits and held-out shrinkage, by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import (
    AddedEffect,
    EffectPath,
    Fold,
    ObservedChange,
    closed_shares,
    fit_effect,
    fit_path,
    paths_of,
    shrinkage,
)

NAMES = ("mesh.total", "mesh.share.1", "sideband.driver.1", "sideband.driven.1", "shaft.driver.1", "hum")
FLOORS = np.array([2.0, 1.0, 3.0, 3.0, 2.0, 1.0])
SHAPE = np.array([0.0, 0.0, 12.0, 0.0, 8.0, 0.0])
SEVERITIES = np.array([1.0, 2.0, 4.0])


def path(shape: np.ndarray = SHAPE, n_conditions: int = 1, **options: float | str) -> EffectPath:
    """An effect whose change is proportional to the logarithm of its severity, from 1 on."""
    table = np.outer(1.0 + np.log2(SEVERITIES), shape)
    return EffectPath("eccentricity", options, SEVERITIES, (table[None],) * n_conditions, NAMES)


def predicted(effect: EffectPath, severity: float, condition: int = 0, level: int = 0) -> np.ndarray:
    return effect.at(np.array([severity]), condition)[level, 0]


def seen(distances: np.ndarray, condition: int = 0) -> ObservedChange:
    return ObservedChange(condition, distances, FLOORS)


@given(st.floats(1.0, 4.0))
def test_a_path_is_straight_over_the_logarithm(severity: float) -> None:
    assert predicted(path(), severity) == pytest.approx((1.0 + np.log2(severity)) * SHAPE)


@given(st.floats(0.01, 1.0))
def test_below_the_least_simulated_severity_it_is_proportional(severity: float) -> None:
    assert predicted(path(), severity) == pytest.approx(severity * SHAPE)


@given(st.floats(1.0, 4.0))
def test_the_true_severity_is_found_within_its_interval(severity: float) -> None:
    fit = fit_path(path(), [seen(predicted(path(), severity))])
    assert fit.severity.value == pytest.approx(severity, rel=0.08)
    assert fit.severity.low <= severity * 1.05
    assert severity <= fit.severity.high * 1.05
    assert fit.cost < 0.5  # the grid of severities


def test_the_right_options_are_found() -> None:
    driver, driven = path(gear="driver"), path(SHAPE[[0, 1, 3, 2, 4, 5]], gear="driven")
    fit = fit_effect([driver, driven], [seen(predicted(driven, 3.0))])
    assert fit.added.options == {"gear": "driven"}


def test_candidates_become_one_path_for_each_set_of_options() -> None:
    added = [AddedEffect("unbalance", s, {"gear": g}) for g in ("driver", "driven") for s in (9.0, 3.0)]
    table = np.arange(4.0)[:, None] * np.ones(len(NAMES))
    found = paths_of(NAMES, added, [table[None]])
    assert [p.options["gear"] for p in found] == ["driver", "driven"]
    assert found[0].severities.tolist() == [3.0, 9.0]
    assert found[1].distances[0][0, :, 0].tolist() == [3.0, 2.0]


def test_a_true_effect_shrinks_the_gap_and_its_placebo_does_not() -> None:
    driver, driven = path(gear="driver"), path(SHAPE[[0, 1, 3, 2, 5, 4]], gear="driven")
    rng = np.random.default_rng(1)
    noisy = [seen(predicted(driver, 2.0) + 0.3 * FLOORS * rng.standard_normal(len(NAMES))) for _ in range(3)]
    result = shrinkage([driver, driven], [Fold((noisy[0],), noisy[1], ((noisy[1], noisy[2]),))])
    assert result.shrink.value > 0.9
    assert result.slope == pytest.approx(1.0, abs=0.15)
    assert result.placebo < 0.1
    assert result.after.value < 1.0 < result.before.value
    assert result.shrink.low <= result.shrink.value <= result.shrink.high


def test_on_all_features_a_flexible_wrong_effect_closes_less_than_the_true_one() -> None:
    """It has the same course on part of what changes, and fits that as well."""
    part = np.where(np.abs(SHAPE) == np.abs(SHAPE).max(), SHAPE, 0.0)
    shapes = {"true": SHAPE, "wrong": part, "idle": 0.01 * SHAPE}
    true, wrong, idle = (replace(path(shape), name=name) for name, shape in shapes.items())
    now = seen(predicted(true, 3.0))
    folds = [Fold((now,), now)]
    fits = {one.name: [fit_effect([one], fold.fitted) for fold in folds] for one in (true, wrong, idle)}
    own = {one.name: shrinkage([one], folds, fits=fits[one.name]).shrink.value for one in (true, wrong)}
    shares = closed_shares(fits, folds)
    assert own["true"] == pytest.approx(own["wrong"], abs=0.05)
    assert shares["true"] > 0.95
    assert shares["wrong"] < shares["true"] - 0.2
    assert shares["idle"] < 0.1
    assert closed_shares({"idle": fits["idle"]}, folds) == {}


def test_an_effect_that_was_fitted_to_one_condition_and_fails_at_the_other_does_not_shrink_the_gap() -> None:
    one = path(n_conditions=2)
    nothing = np.zeros(len(NAMES))
    result = shrinkage([one], [Fold((seen(predicted(one, 4.0)),), seen(nothing, 1))])
    assert result.shrink.value <= 0.0
    assert result.slope == pytest.approx(0.0)


def test_a_condition_at_which_the_effect_does_nothing_does_not_count() -> None:
    one = path(n_conditions=2)
    idle = replace(one, distances=(one.distances[0], np.zeros_like(one.distances[1])))
    loud, nothing = seen(predicted(idle, 2.0)), seen(0.5 * FLOORS, 1)
    folds = [Fold((loud, nothing), loud), Fold((loud, nothing), nothing)]
    assert shrinkage([idle], folds).shrink.value == pytest.approx(1.0, abs=0.01)
    assert shrinkage([idle], folds[1:]).shrink.value <= 0.0  # there is no other


def test_where_there_was_no_gap_none_shrinks_nor_grows() -> None:
    effect = path(0.1 * SHAPE)
    quiet = seen(np.array([0.3, -0.2, 0.5, 0.4, -0.6, 0.1]))
    assert shrinkage([effect], [Fold((quiet,), quiet)]).shrink.value == 0.0


def test_the_severity_lies_in_its_interval_nine_times_out_of_ten() -> None:
    """With features of one standard deviation of noise each; the two that change are of different families."""
    rng = np.random.default_rng(3)
    n, true = 300, 2.0
    inside = 0
    for _ in range(n):
        noise = FLOORS / 1.96 * rng.standard_normal(len(NAMES))
        severity = fit_path(path(), [seen(predicted(path(), true) + noise)]).severity
        inside += severity.low <= true <= severity.high
    assert inside / n == pytest.approx(0.9, abs=0.045)  # 2.6 standard errors


def test_the_reference_s_scatter_widens_the_interval() -> None:
    rng = np.random.default_rng(4)
    fitted, truth = predicted(path(), 2.0), predicted(path(), 4.0)

    def blocks() -> tuple[ObservedChange, ...]:
        return tuple(seen(truth + 0.2 * FLOORS * rng.standard_normal(len(NAMES))) for _ in range(6))

    recording, reference = blocks(), blocks()
    narrow, wide = (
        shrinkage([path()], [Fold((seen(fitted),), seen(truth), again)]).shrink
        for again in ((recording,), (recording, reference))
    )
    assert wide.value == narrow.value < 1.0
    assert wide.low < narrow.low
    assert wide.high <= 1.0


def test_an_effect_without_another_place_has_no_placebo() -> None:
    truth = seen(predicted(path(), 2.0))
    assert shrinkage([path()], [Fold((truth,), truth)]).n_placebos == 0
    other = path(SHAPE[[0, 1, 3, 2, 5, 4]], gear="driven")
    assert shrinkage([path(gear="driver"), other], [Fold((truth,), truth)]).n_placebos == 1


LEVELS = (-10.0, 0.0, 10.0, 20.0)


def louder(n_conditions: int = 1, **options: float | str) -> EffectPath:
    """The same where the machine's path may differ: what the effect adds is so many decibels more."""
    tables = [np.where(SHAPE > 0.0, np.outer(1.0 + np.log2(SEVERITIES), SHAPE) + level, 0.0) for level in LEVELS]
    return EffectPath("eccentricity", options, SEVERITIES, (np.array(tables),) * n_conditions, NAMES, LEVELS)


def test_an_effect_that_is_louder_on_the_machine_is_fitted_at_its_level() -> None:
    effect = louder(n_conditions=2)
    at_two_levels = [seen(predicted(effect, 2.0, 0, level=2)), seen(predicted(effect, 2.0, 1, level=0), 1)]
    fit = fit_path(effect, at_two_levels)
    first, second = (fit.path.levels_db[fit.ways[condition]] for condition in (0, 1))
    assert first - second == pytest.approx(20.0)
    assert fit.at(0) == pytest.approx(at_two_levels[0].distances, abs=1.5)
    assert fit.at(1) == pytest.approx(at_two_levels[1].distances, abs=1.5)


def test_the_twin_s_own_level_is_the_likeliest() -> None:
    """What fits as well with a larger severity as at a higher level is a larger severity."""
    effect = louder()
    fit = fit_path(effect, [seen(predicted(effect, 4.0, 0, level=1))])
    assert fit.path.levels_db[fit.ways[0]] == pytest.approx(0.0)
    assert fit.severity.value == pytest.approx(4.0, rel=0.1)


def test_two_places_that_predict_the_same_are_no_placebos() -> None:
    first, twin = path(bearing="bearing 1"), path(1.1 * SHAPE, bearing="bearing 2")
    truth = seen(predicted(first, 2.0))
    assert shrinkage([first, twin], [Fold((truth,), truth)]).n_placebos == 0


def test_a_severity_from_one_condition_is_tried_at_the_other() -> None:
    """The level may differ; what the effect changes may not."""
    effect = louder(n_conditions=2)
    first = seen(predicted(effect, 2.0, 0, level=1))
    second = seen(predicted(effect, 2.0, 1, level=2), 1)
    other_features = seen(predicted(effect, 2.0, 1, level=2)[::-1], 1)
    right, wrong = (shrinkage([effect], [Fold((first, one), one)]) for one in (second, other_features))
    assert right.elsewhere is not None
    assert wrong.elsewhere is not None
    assert right.elsewhere > 0.9
    assert wrong.elsewhere < 0.3
    assert shrinkage([effect], [Fold((first,), first)]).elsewhere is None


def test_what_the_simulator_hardly_shows_is_said() -> None:
    """A table that moves nothing by more than a tenth of a floor."""
    truth = seen(predicted(path(), 4.0))
    shows = shrinkage([path()], [Fold((truth,), truth)])
    assert shows.is_predicted
    assert shows.predicted == pytest.approx(np.abs(predicted(path(), 4.0) / FLOORS).max(), rel=0.3)
    loudest = float(np.abs(predicted(path(), path().severities[-1]) / FLOORS).max())
    faint = replace(path(), distances=tuple(0.1 / loudest * table for table in path().distances))
    hardly = shrinkage([faint], [Fold((truth,), truth)])
    assert not hardly.is_predicted


def test_a_fit_that_misses_has_a_wider_interval() -> None:
    """What the simulation does not predict is as large as what it does."""
    near, wrong = predicted(path(), 2.0), predicted(path(), 2.0)
    wrong = wrong + 3.0 * FLOORS * np.where(np.arange(len(NAMES)) % 2, 1.0, -1.0)
    sure, unsure = (fit_path(path(), [seen(values)]).severity for values in (near, wrong))
    assert unsure.high / unsure.low > 1.5 * sure.high / sure.low


def test_what_no_simulated_severity_bounds_has_no_end() -> None:
    """The largest that was simulated fits; and a change that any small severity makes as well."""
    largest = fit_path(path(), [seen(predicted(path(), 4.0))]).severity
    assert largest.high == np.inf
    assert largest.low > 1.0
    least = fit_path(path(), [seen(predicted(path(), 0.1))]).severity
    assert least.low == 0.0
    assert least.high < 1.0
    between = fit_path(path(), [seen(predicted(path(), 1.5))]).severity
    assert 1.0 < between.low < 1.5 < between.high < 4.0


def test_an_effect_is_not_fitted_where_the_recordings_tell_that_it_is_not() -> None:
    here, there = path(gear="driver"), path(SHAPE[[0, 1, 3, 2, 4, 5]], gear="driven")
    truth = seen(predicted(there, 3.0))
    free = shrinkage([here, there], [Fold((truth,), truth)])
    told = shrinkage([here], [Fold((truth,), truth)], [there])
    assert free.shrink.value > 0.9
    assert told.shrink.value < 0.5
    assert (free.n_placebos, told.n_placebos) == (1, 1)
