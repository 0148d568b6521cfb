"""Simulated changes on another machine's baseline, by closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.gap import feature_values, load_learned, predicted_on_baseline, reduce_recording
from tests.gap.synthetic import RIG, record

LEARNED = load_learned()
FEATURES, NAMES = LEARNED.feature_names, LEARNED.change_names
USUAL = dict(zip(NAMES, np.asarray(LEARNED.floor(with_reference=True).centres).tolist(), strict=True))
ONLY = len(FEATURES)


@cache
def healthy() -> dict[str, float]:
    return dict(zip(*feature_values(reduce_recording(record(), RIG)), strict=True))


def moved(change: dict[str, float], real: dict[str, float], level_db: float = 0.0) -> dict[str, float]:
    row = np.array([change.get(name, 0.0) for name in FEATURES])
    return dict(
        zip(FEATURES, predicted_on_baseline(FEATURES, row, healthy(), real, USUAL, level_db).tolist(), strict=True)
    )


def of_harmonics(levels_db: dict[str, float], powers: dict[str, float]) -> dict[str, float]:
    """Return the change of the mesh's features that such changes of single harmonics make."""
    after = {name: power * 10 ** (levels_db.get(name, 0.0) / 10.0) for name, power in powers.items()}
    total = float(10 * np.log10(sum(after.values()) / sum(powers.values())))
    return {"mesh.total": total} | {name: levels_db.get(name, 0.0) - total for name in powers}


@given(st.floats(0.0, 30.0))
def test_on_its_own_baseline_a_change_of_power_stays(change_db: float) -> None:
    for name in ("sideband.driven.3to5", "shaft.driver.1", "floor.band.2", "line.outer"):
        assert moved({name: change_db}, healthy())[name] == pytest.approx(change_db, abs=1e-9)


def test_many_changes_at_once_are_each_as_alone() -> None:
    names = (*FEATURES, *NAMES)
    changes = np.random.default_rng(3).normal(0.0, 8.0, (4, len(names)))
    real = {name: value + 2.0 for name, value in healthy().items()}
    together = predicted_on_baseline(names, changes, healthy(), real, USUAL, 3.0, -6.0)
    for change, row in zip(changes, together, strict=True):
        assert predicted_on_baseline(names, change, healthy(), real, USUAL, 3.0, -6.0) == pytest.approx(row, rel=1e-12)


@given(st.floats(-20.0, 0.0))
def test_what_falls_falls_alike_on_any_baseline(change_db: float) -> None:
    name = "sideband.driver.1"
    assert moved({name: change_db}, {**healthy(), name: healthy()[name] + 12.0})[name] == change_db


def test_on_a_quieter_baseline_the_same_power_shows_more() -> None:
    name = "sideband.driver.6to12"
    quieter = {**healthy(), name: healthy()[name] - 20.0}
    # 3 dB more is as much again, which is a hundred times the quieter baseline.
    assert moved({name: 10 * np.log10(2.0)}, quieter)[name] == pytest.approx(10 * np.log10(101.0))


def test_a_harmonic_rises_by_as_much_on_a_machine_that_has_little_of_it() -> None:
    names = [name for name in FEATURES if name.startswith("mesh.share.")]
    powers = {name: 10 ** (healthy()[name] / 10.0) for name in names}
    rises = {names[1]: 15.0, names[2]: -4.0}
    given_db = of_harmonics(rises, powers)
    found = moved(given_db, healthy())
    assert {name: found[name] for name in given_db} == pytest.approx(given_db)
    weaker = {**healthy(), names[1]: healthy()[names[1]] - 20.0}
    expected = of_harmonics(rises, {**powers, names[1]: powers[names[1]] / 100.0})
    found = moved(given_db, weaker)
    assert {name: found[name] for name in given_db} == pytest.approx(expected)
    assert found["mesh.total"] < given_db["mesh.total"]


def test_what_an_effect_adds_to_the_mesh_comes_louder_and_what_it_takes_does_not() -> None:
    names = [name for name in FEATURES if name.startswith("mesh.share.")]
    powers = {name: 10 ** (healthy()[name] / 10.0) for name in names}
    # As much again, ten times as loud, is eleven times the power.
    expected = of_harmonics({names[1]: 10 * np.log10(11.0), names[2]: -4.0}, powers)
    found = moved(of_harmonics({names[1]: 10 * np.log10(2.0), names[2]: -4.0}, powers), healthy(), 10.0)
    assert {name: found[name] for name in expected} == pytest.approx(expected)


def test_absolute_levels_follow_the_gain_of_the_path() -> None:
    name = "floor.total"
    louder = {**healthy(), "mesh.total": healthy()["mesh.total"] + 10.0, name: healthy()[name] + 10.0}
    assert moved({name: 6.0}, louder)[name] == pytest.approx(6.0)


def test_only_the_lowest_shaft_orders_hang_on_what_a_machine_stands_on() -> None:
    names = ("shaft.driver.1", "shaft.driver.2.to_mesh", "sideband.driver.1", "shaft.driver.low")
    change = np.array([20.0 * (name in names) for name in FEATURES])
    rigid = dict(
        zip(
            FEATURES,
            predicted_on_baseline(FEATURES, change, healthy(), healthy(), USUAL, 0.0, -40.0).tolist(),
            strict=True,
        )
    )
    assert rigid["shaft.driver.1"] == pytest.approx(10 * np.log10(1.0 + 99e-4))
    assert rigid["shaft.driver.2.to_mesh"] == pytest.approx(rigid["shaft.driver.1"])
    assert rigid["sideband.driver.1"] == rigid["shaft.driver.low"] == pytest.approx(20.0)


def test_the_strongest_line_stands_out_no_further_than_it_rose_on_the_real_machine() -> None:
    """A twin with even gears has nothing beside an effect's line; the real one has."""
    line, rose = "shaft.driver.strongest", "shaft.driver.strongest.to_mesh"
    louder = {**healthy(), rose: healthy()[rose] + 20.0}
    found = moved({line: 30.0, rose: 23.0}, louder)
    assert found[line] == pytest.approx(found[rose])
    assert found[rose] == pytest.approx(10 * np.log10(1.0 + (10**2.3 - 1.0) / 100.0))
    assert moved({line: -3.0, rose: 0.0}, healthy())[line] == 0.0


def test_prominence_is_that_of_the_moved_peak() -> None:
    quieter = {**healthy(), "tooth.driver.peak": healthy()["tooth.driver.peak"] - 10.0}
    found = moved({"tooth.driver.peak": 3.0, "tooth.driver.prominence": 3.0}, quieter)
    assert found["tooth.driver.prominence"] == pytest.approx(found["tooth.driver.peak"])
    assert found["tooth.driver.peak"] > 9.0


def test_nothing_changed_is_nothing_but_repetition() -> None:
    change = np.array([0.0] * ONLY + [USUAL[name] - 200.0 * name.endswith(("level", "peak")) for name in NAMES[ONLY:]])
    found = predicted_on_baseline(NAMES, change, healthy(), healthy(), USUAL)
    named = dict(zip(NAMES, found.tolist(), strict=True))
    assert named["change.driver.level"] == pytest.approx(0.0, abs=1e-6)
    assert named["change.driver.kurtosis"] == pytest.approx(0.0, abs=1e-6)
    assert named["change.driver.agreement"] == pytest.approx(0.0, abs=1e-6)
    assert np.abs(found[:ONLY]).max() == 0.0


def test_the_lowest_orders_do_not_get_quieter_with_the_mesh() -> None:
    """The machine moves as a whole there; the same force adds the same power, whatever the path from the mesh is."""
    quieter = {**healthy(), "mesh.total": healthy()["mesh.total"] - 20.0, "shaft.driver.1.to_mesh": -50.0}
    added = moved({"shaft.driver.1": 12.0, "shaft.driver.1.to_mesh": 12.0}, quieter)
    assert added["shaft.driver.1"] == pytest.approx(12.0)
    born = 10.0 ** ((healthy()["shaft.driver.1.to_mesh"] + 20.0) / 10.0) * (10.0**1.2 - 1.0)
    assert added["shaft.driver.1.to_mesh"] == pytest.approx(10.0 * np.log10(1.0 + born / 1e-5))
