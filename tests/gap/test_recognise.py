"""What is learned of a population: a small one here, and of the one that was made, where it is kept."""

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
    Learned,
    Population,
    even_weights,
    learn,
    load_learned,
    load_population,
    population_file,
    read_learned,
    without_machines_of,
    write_learned,
)
from sims.effects import effects

SHIFTS = {"tooth_wear": {"mesh.total": 9.0}, "mains_hum": {"hum": 12.0}, UNKNOWN: {"line.strange": 12.0}, NONE: {}}
KEPT = population_file()
made = pytest.mark.skipif(not KEPT.exists(), reason="the population is made by hours of simulation")


def drawn(n_machines: int, seed: int) -> Population:
    """Machines whose effects shift one feature each, three recordings of every cause."""
    rng = np.random.default_rng(seed)
    learned = load_learned()
    causes = np.tile(np.repeat(list(SHIFTS), 3), n_machines)
    rigs = np.repeat(np.arange(n_machines), 3 * len(SHIFTS))
    tables = []
    for names in (learned.change_names, learned.feature_names):
        table = rng.normal(size=(len(causes), len(names)))
        for i, cause in enumerate(causes):
            for name, shift in SHIFTS[cause].items():
                table[i, names.index(name)] += shift + 2.0 * np.sin(rigs[i])
        tables += [table, np.full(table.shape, 0.3)]
    simulators = np.where(rigs % 2 == 0, "even", "odd")
    simulated = [np.zeros(tables[2].shape), np.full(tables[2].shape, 0.1)]
    by_hand = np.zeros(len(causes), dtype=bool)
    names = learned.change_names, learned.feature_names
    return Population(rigs, simulators, causes, by_hand, *names, *tables, *simulated, np.full(len(causes), 100.0))


@pytest.fixture(scope="module")
def learned() -> Learned:
    return learn(drawn(20, 1), n_trees=20)


def rows(population: Population, *, with_reference: bool) -> list[Features]:
    if with_reference:
        names, values, scatter = population.change_names, population.changes, population.change_scatter
    else:
        names, values, scatter = population.feature_names, population.gaps, population.gap_scatter
    return [Features(names, *both) for both in zip(values, scatter, strict=True)]


@pytest.mark.parametrize("with_reference", [True, False])
def test_machines_that_nothing_was_learned_from_are_recognised(learned: Learned, *, with_reference: bool) -> None:
    others = drawn(4, 2)
    recogniser = learned.recognisers[with_reference]
    found = [recogniser.probabilities(change, 100.0) for change in rows(others, with_reference=with_reference)]
    right = [max(p, key=p.__getitem__) == cause for p, cause in zip(found, others.causes, strict=True)]
    assert np.mean(right) > 0.8
    assert all(sum(p.values()) == pytest.approx(1.0) for p in found)


def test_a_file_says_the_same(learned: Learned, tmp_path: Path) -> None:
    path = tmp_path / "learned.npz"
    write_learned(learned, path)
    again = read_learned(path)
    assert again is not None
    assert (again.feature_names, again.change_names) == (learned.feature_names, learned.change_names)
    for flag in (True, False):
        for change in rows(drawn(1, 3), with_reference=flag):
            before, after = (one.recognisers[flag].probabilities(change, 50.0) for one in (learned, again))
            assert after == pytest.approx(before, abs=0.02)
            assert max(after, key=after.__getitem__) == max(before, key=before.__getitem__)
    path.write_bytes(path.read_bytes()[:-300])
    assert read_learned(path) is None


def test_other_features_than_were_learned_of_are_an_error(learned: Learned) -> None:
    change = rows(drawn(1, 3), with_reference=True)[0]
    with pytest.raises(InputError, match="belongs to other features"):
        learned.recognisers[True].probabilities(replace(change, names=change.names[::-1]))


def test_what_ships_knows_every_effect_and_is_small() -> None:
    shipped = load_learned()
    assert set(effects()) | {NONE, UNKNOWN} == set(shipped.causes)
    assert shipped.change_names[: len(shipped.feature_names)] == shipped.feature_names
    from gearsig.gap import LEARNED_FILE

    assert LEARNED_FILE.stat().st_size < 2_000_000


def test_a_reference_lowers_the_floor() -> None:
    shipped = load_learned()
    with_it, without = (shipped.floor(with_reference=flag).of(shipped.feature_names) for flag in (True, False))
    assert np.median(without / with_it) > 1.5


def test_rarer_sources_count_more_each_and_less_together() -> None:
    sources, causes = np.array(["a"] * 9 + ["b"] + ["a"] * 5), np.array(["x"] * 10 + ["y"] * 5)
    weights = even_weights(sources, causes)
    assert weights[9] == pytest.approx(3.0 * weights[0])
    assert weights[:9].sum() > weights[9]
    assert weights.mean() == pytest.approx(1.0)


def test_a_missing_population_says_how_to_make_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSIG_POPULATION", str(tmp_path / "none.npz"))
    with pytest.raises(InputError, match=r"python -m app\.studies\.gap\.population make"):
        load_population()
    with without_machines_of(INDEPENDENT), pytest.raises(InputError, match="population make"):
        load_learned()


AT_THE_END = {"clipping", "transfer_path"}


@made
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
def test_every_source_shows_every_effect_that_it_can(source: str, cannot: set[str]) -> None:
    population = load_population(KEPT)
    missing = set(effects()) - set(population.causes[population.sources == source])
    assert missing <= cannot


@made
def test_machines_can_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSIG_POPULATION", str(KEPT))
    population = load_population()
    with without_machines_of(INDEPENDENT):
        rest = load_population()
    assert set(population.simulators) - set(rest.simulators) == {INDEPENDENT}
    assert load_population() is population
