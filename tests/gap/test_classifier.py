"""What is learned of a population, a small one here and the one that was made; and the textbook's rules."""

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
    balanced_source_weights,
    columns_with_shafts_swapped,
    contrast_rows,
    learn,
    load_learned,
    load_population,
    population_file,
    read_learned,
    textbook_rules,
    textbook_strengths,
    without_machines_of,
    write_learned,
)
from sims.effects import as_gap_effect, effects

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
    classifier = learned.classifiers[with_reference]
    found = [classifier.probabilities(change, 100.0) for change in rows(others, with_reference=with_reference)]
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
            before, after = (one.classifiers[flag].probabilities(change, 50.0) for one in (learned, again))
            assert after == pytest.approx(before, abs=0.02)
            assert max(after, key=after.__getitem__) == max(before, key=before.__getitem__)
    path.write_bytes(path.read_bytes()[:-300])
    assert read_learned(path) is None


def test_other_features_than_were_learned_of_are_an_error(learned: Learned) -> None:
    change = rows(drawn(1, 3), with_reference=True)[0]
    with pytest.raises(InputError, match="belongs to other features"):
        learned.classifiers[True].probabilities(replace(change, names=change.names[::-1]))


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
    weights = balanced_source_weights(sources, causes)
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


# --------------------
# What the forest sees: bounded shares, differences of the right sign, and shafts that can be exchanged.
# --------------------


NAMES = load_learned().change_names
FEATURES = load_learned().feature_names


@pytest.mark.parametrize("names", [NAMES, FEATURES])
def test_exchanging_the_shafts_twice_changes_nothing(names: tuple[str, ...]) -> None:
    exchanged = columns_with_shafts_swapped(names)
    np.testing.assert_array_equal(exchanged[exchanged], np.arange(len(names)))
    assert names[exchanged[names.index("sideband.driver.1")]] == "sideband.driven.1"
    assert names[exchanged[names.index("mesh.total")]] == "mesh.total"


@pytest.mark.parametrize("names", [NAMES, FEATURES])
def test_shares_do_not_depend_on_the_size_of_the_whole_change_much(names: tuple[str, ...]) -> None:
    n = len(names)
    rows = np.zeros((2, n))
    rows[:, names.index("sideband.driver.1")] = 10.0, 40.0
    rows[:, names.index("shaft.driver.1")] = -5.0, -20.0
    seen = contrast_rows(names, rows)
    shares = seen[:, n : 2 * n]
    assert np.abs(shares).max() == 1.0
    assert shares[0] == pytest.approx(shares[1], abs=0.1)


def test_what_did_not_change_is_zero() -> None:
    assert not contrast_rows(NAMES, np.zeros((1, len(NAMES)))).any()


# --------------------
# The textbook's rules.
# --------------------


RULES = textbook_rules(map(as_gap_effect, effects().values()))


def test_every_effect_has_a_rule_of_features_that_there_are() -> None:
    assert {cause for cause, _ in RULES} >= set(effects())
    names = load_learned().feature_names
    for _, signs in RULES:
        for name, _ in signs:
            assert name.format(side="driven") in names


@pytest.mark.parametrize("side", ["driver", "driven"])
def test_either_shaft_speaks_for_its_effect(side: str) -> None:
    said = textbook_strengths(
        RULES, {f"shaft.{side}.2": 4.0, f"sideband.{side}.2": 6.0} | dict.fromkeys(_others(side), 0.0)
    )
    assert said["misalignment"] == pytest.approx(5.0)
    assert max(said, key=said.__getitem__) == "misalignment"
    assert NONE not in said


def _others(side: str) -> list[str]:
    """All features of the table but those of a misaligned shaft."""
    known = {name.format(side=s) for _, signs in RULES for name, _ in signs for s in ("driver", "driven")}
    return sorted(known - {f"shaft.{side}.2", f"sideband.{side}.2"})


def test_one_sign_alone_does_not_carry_a_rule() -> None:
    names = {name.format(side=s) for _, signs in RULES for name, _ in signs for s in ("driver", "driven")}
    said = textbook_strengths(RULES, dict.fromkeys(names, 0.0) | {"mesh.total": 50.0})
    assert said["tooth_wear"] == pytest.approx(8.0 / 3.0)
