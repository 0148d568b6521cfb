"""How much of what a simulation says of a feature is subtracted."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.gap import NONE, credibility_of, load_population, population_file


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
