"""The size of a gap: what one number must do with a hundred; and how far a simulation is believed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.gap import (
    NONE,
    Features,
    PlaceKind,
    StructuralFloor,
    credibility_of,
    family_members,
    family_of,
    family_size,
    gap_size,
    independent_floor_size,
    load_population,
    pooled_scatter,
    population_file,
    soft_size,
)

NAMES = tuple(
    f"{family}.{side}.{i}"
    for family in ("sideband", "shaft", "tooth")
    for side in ("driver", "driven")
    for i in range(15)
)
FLOOR = StructuralFloor(NAMES, np.full(90, 2.0))


def features(values: np.ndarray, scatter_db: float = 0.1, n_blocks: int = 8, seed: int = 0) -> Features:
    """Return features whose blocks scatter as they say: a block more or less moves a mean of B by 1/(B − 1)."""
    rng = np.random.default_rng(seed)
    rows = values + scatter_db / np.sqrt(n_blocks - 1.0) * rng.standard_normal((n_blocks, len(values)))
    return Features(NAMES, values, np.full(len(values), scatter_db), (rows,))


def test_an_order_of_the_families() -> None:
    assert family_of("mesh.share.3") == family_of("line.half_mesh") == (PlaceKind.MESH, "")
    assert family_of("change.driver.peak") == family_of("tooth.driver.level") == (PlaceKind.TOOTH, "driver")
    assert sorted(np.concatenate(list(family_members(NAMES).values()))) == list(range(90))


def test_a_handful_of_large_changes_is_not_drowned() -> None:
    few, none = np.zeros(90), np.zeros(90)
    few[3:6] = 20.0
    size = soft_size(NAMES, few / 2.0)
    assert size == pytest.approx(10.0 * (3 / 15) ** (1 / 8))  # one family: [(mean u⁸)^(4/8)]^(1/4)
    assert size > 3.0 * np.sqrt(np.mean((few / 2.0) ** 2))
    assert soft_size(NAMES, none) == 0.0


def test_features_that_say_the_same_count_once() -> None:
    """Copies of a family's features change nothing; the same change in another family does."""
    change = np.zeros(90)
    change[:15] = 4.0
    once = soft_size(NAMES, change)
    thrice = soft_size(NAMES * 2 + NAMES, np.concatenate([change] * 3))
    assert thrice == pytest.approx(once)
    change[15:30] = 4.0
    assert soft_size(NAMES, change) == pytest.approx(2 ** (1 / 4) * once)


@given(st.lists(st.floats(-50, 50), min_size=90, max_size=90), st.floats(0.1, 10))
def test_the_size_scales_and_lies_between_mean_and_sum(values: list[float], factor: float) -> None:
    change = np.array(values)
    size = soft_size(NAMES, change)
    assert soft_size(NAMES, factor * change) == pytest.approx(factor * size)
    largest = np.abs(change).max()
    assert largest * 15 ** (-1 / 8) * (1 - 1e-9) <= size <= largest * 6 ** (1 / 4) * (1 + 1e-9)
    assert family_size(change) <= largest * (1 + 1e-9)


def test_one_healthy_machine_in_twenty_is_beyond_one() -> None:
    rng = np.random.default_rng(3)
    healthy, fresh = rng.standard_normal((400, 90)) + 5.0, rng.standard_normal((400, 90)) + 5.0
    floor = StructuralFloor.of_healthy(NAMES, healthy)
    assert floor.values == pytest.approx(np.full(90, 1.96), rel=0.25)
    sizes = [gap_size(features(row), floor).structural.value for row in fresh]
    assert 0.02 < np.mean(np.array(sizes) > 1.0) < 0.10


def test_the_whole_of_independent_features_is_that_of_draws() -> None:
    rng = np.random.default_rng(11)
    sizes = [soft_size(NAMES, row / 1.96) for row in rng.standard_normal((1000, 90))]
    assert np.mean(np.array(sizes) > independent_floor_size(NAMES)) == pytest.approx(0.05, abs=0.025)


def test_the_interval_holds_the_size_without_scatter() -> None:
    """Features of the truth plus scatter: nine in ten intervals hold the size of the truth."""
    truth, held = np.zeros(90), 0
    truth[:15] = 12.0
    value = soft_size(NAMES, truth / 2.0) / independent_floor_size(NAMES)
    for seed in range(100):
        drawn = truth + 0.5 * np.random.default_rng([seed, 1]).standard_normal(90)
        interval = gap_size(features(drawn, 0.5, seed=seed), FLOOR).structural
        held += interval.low <= value <= interval.high
        assert interval.low <= interval.value <= interval.high
    assert 60 <= held <= 100


def test_both_floors_are_used() -> None:
    size = gap_size(features(np.full(90, 6.0), scatter_db=1.0), FLOOR)
    whole = independent_floor_size(NAMES)
    assert size.structural.value == pytest.approx(3.0 * 6 ** (1 / 4) / whole)
    assert size.repeatability.value == pytest.approx(6.0 / 1.96 * 6 ** (1 / 4) / whole)


def test_scatter_is_drawn_towards_that_of_the_family() -> None:
    one = features(np.zeros(90), n_blocks=3)
    scatter = one.scatter.copy()
    scatter[0] = 1e-4
    drawn = pooled_scatter(Features(NAMES, one.values, scatter, one.left_out))
    assert drawn[0] == pytest.approx(np.sqrt((4 * 0.01 + 2 * 0.05**2) / 6))
    assert drawn[1:] == pytest.approx(np.full(89, 0.1))


def test_an_unknown_feature_is_an_error() -> None:
    with pytest.raises(InputError, match=r"lacks mesh\.new"):
        FLOOR.of(("mesh.new",))
    with pytest.raises(InputError, match="above 0"):
        StructuralFloor(("a",), np.zeros(1))
    with pytest.raises(InputError, match="repeat"):
        StructuralFloor(("a", "a"), np.ones(2))
    with pytest.raises(InputError, match="2 numbers for 1"):
        StructuralFloor(("a",), np.ones(2))


# --------------------
# How much of what a simulation says of a feature is subtracted.
# --------------------


def test_what_a_simulation_knows_is_subtracted_and_what_it_guesses_is_not() -> None:
    rng = np.random.default_rng(0)
    truth, guess = rng.standard_normal((2, 4000))
    simulated = np.column_stack([truth, guess, truth + guess, -truth])
    features = np.column_stack([truth + 7.0, truth, truth, truth])
    assert credibility_of(features, simulated) == pytest.approx([1.0, 0.0, 0.5, 0.0], abs=0.05)


def test_a_figure_that_no_simulation_changes_is_not_divided_by() -> None:
    features = np.random.default_rng(1).standard_normal((50, 2))
    assert credibility_of(features, np.ones((50, 2))) == pytest.approx([0.0, 0.0])


KEPT = population_file()


@pytest.mark.skipif(not KEPT.exists(), reason="the population is made by hours of simulation")
def test_healthy_machines_scatter_less_about_what_is_credible_than_about_all_or_nothing_of_it() -> None:
    population = load_population(KEPT)
    healthy = population.causes == NONE
    own, simulated = population.features[healthy], population.simulated[healthy]
    left = population.gaps[healthy].std(axis=0)
    assert np.all(left <= np.minimum(own.std(axis=0), (own - simulated).std(axis=0)) + 1e-9)
    assert np.median(left / (own - simulated).std(axis=0)) < 0.95
