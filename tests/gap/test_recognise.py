"""The population that is shipped, its floors, and the forest over it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.gap import (
    BY_HAND,
    INDEPENDENT,
    NONE,
    UNKNOWN,
    Features,
    Population,
    Recogniser,
    even_weights,
    fit_recogniser,
    keep_fitted,
    load_population,
    load_recogniser,
    without_machines_of,
)
from sims.effects import effects


@pytest.fixture(scope="module")
def population() -> Population:
    return load_population()


@pytest.fixture(scope="module")
def on_half(population: Population) -> Recogniser:
    """A forest, smaller than the shipped one, that has seen the machines of even number only."""
    return fit_recogniser(population.of_rows(population.rigs % 2 == 0), with_reference=True, n_trees=60)


def row(population: Population, i: int) -> Features:
    return Features(population.change_names, population.changes[i], population.change_scatter[i])


def test_every_effect_is_in_the_population(population: Population) -> None:
    assert set(effects()) | {NONE, UNKNOWN} == set(population.causes)
    assert len(set(population.rigs)) >= 20
    assert population.change_names[: len(population.feature_names)] == population.feature_names


AT_THE_END = {"clipping", "transfer_path"}


@pytest.mark.parametrize(
    ("source", "cannot"),
    [
        (BY_HAND, {"mains_hum", "speed_fluctuation"}),
        ("cracked", AT_THE_END),
        ("reduced-fe", AT_THE_END),
        ("quasi-static", AT_THE_END | {"backlash", "mains_hum"}),
        (INDEPENDENT, set()),
    ],
)
def test_every_source_shows_every_effect_that_it_can(population: Population, source: str, cannot: set[str]) -> None:
    missing = set(effects()) - set(population.causes[population.sources == source])
    assert missing <= cannot


def test_machines_can_be_left_out(population: Population) -> None:
    with without_machines_of(INDEPENDENT):
        rest = load_population()
    assert set(population.simulators) - set(rest.simulators) == {INDEPENDENT}
    assert np.array_equal(rest.changes, population.changes[population.simulators != INDEPENDENT])
    assert load_population() is population


def test_rarer_sources_count_more_each_and_less_together() -> None:
    sources, causes = np.array(["a"] * 9 + ["b"] + ["a"] * 5), np.array(["x"] * 10 + ["y"] * 5)
    weights = even_weights(sources, causes)
    assert weights[9] == pytest.approx(3.0 * weights[0])
    assert weights[:9].sum() > weights[9]
    assert weights.mean() == pytest.approx(1.0)


def test_a_reference_lowers_the_floor(population: Population) -> None:
    names = population.feature_names
    with_it, without = (population.floor(with_reference=flag).of(names) for flag in (True, False))
    assert np.median(without / with_it) > 1.5


def test_machines_that_the_forest_never_saw_are_recognised_far_above_chance(
    population: Population, on_half: Recogniser
) -> None:
    others = np.flatnonzero(population.rigs % 2 == 1)[::9]
    found = [on_half.probabilities(row(population, int(i))) for i in others]
    right = np.mean([max(p, key=p.__getitem__) == population.causes[i] for p, i in zip(found, others, strict=True)])
    assert right > 0.4
    assert all(sum(p.values()) == pytest.approx(1.0) for p in found)


def test_other_features_than_the_population_has_are_an_error(population: Population, on_half: Recogniser) -> None:
    change = row(population, 0)
    with pytest.raises(InputError, match="belongs to other features"):
        on_half.probabilities(replace(change, names=change.names[::-1]))


def test_a_missing_population_says_how_to_make_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"python -m app\.studies\.gap\.population"):
        load_population(tmp_path / "none.npz")


@pytest.mark.slow
def test_the_forest_is_fitted_once() -> None:
    assert load_recogniser(with_reference=False) is load_recogniser(with_reference=False)


def test_a_kept_one_says_the_same(
    population: Population, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, on_half: Recogniser
) -> None:
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path))
    keep_fitted("with_reference_nobody", (on_half.causes, on_half.trees, None))
    with without_machines_of("nobody"):
        kept = load_recogniser(with_reference=True)
    change = row(population, 5)
    assert kept.probabilities(change, 100.0).keys() == on_half.probabilities(change, 100.0).keys()
    assert np.array_equal(kept.trees.shares, on_half.trees.shares)
