"""Curves of a gap against signals of which they are known."""

from functools import cache

import numpy as np
import pytest

from gearsig.gap import (
    ReducedRecording,
    SpectrumCurves,
    StructuralFloor,
    against_reference,
    angle_curves,
    average_curves,
    difference_features,
    gap_by_order,
    lines_beyond,
    reduce_recording,
    spectrum_curves,
)
from tests.gap.synthetic import MESH_AMPLITUDES, RIG, TEETH, record, ringing

RATIO = TEETH[0] / TEETH[1]


@cache
def healthy() -> ReducedRecording:
    return reduce_recording(record(), RIG)


@cache
def knocking(size: float = 1.5, seed: int = 1) -> ReducedRecording:
    return reduce_recording(record(lambda _, r: size * ringing(r - 0.4), seed=seed), RIG)


def test_spectra_are_peak_amplitudes_over_the_drivers_order() -> None:
    curves = spectrum_curves(healthy(), knocking(), knocking(seed=2))
    assert len(curves) == 3
    for average, step in zip(curves[:2], (1.0, RATIO), strict=True):
        assert np.diff(average.orders) == pytest.approx(np.full(len(average.orders) - 1, step))
        for k, amplitude in enumerate(MESH_AMPLITUDES, 1):
            at = int(np.argmin(np.abs(average.orders - k * TEETH[0])))
            assert average.orders[at] == pytest.approx(k * TEETH[0])
            assert average.measured[at] == pytest.approx(amplitude, rel=0.02)
        assert len(average.after) == len(average.orders)
    assert not len(spectrum_curves(healthy(), knocking())[0].after)


def test_noise_stays_below_the_floor() -> None:
    """One line of noise in twenty is above it."""
    average = spectrum_curves(healthy(), reduce_recording(record(seed=5), RIG))[0]
    empty = (average.orders > 80) & (average.orders < 140)
    assert np.mean(average.measured[empty] > average.floor[empty]) < 0.1


def test_each_line_has_the_floor_of_its_feature() -> None:
    change = difference_features(knocking(), healthy())
    table = dict(zip(change.names, range(1, len(change.names) + 1), strict=True))
    floor = StructuralFloor(change.names, np.array(list(table.values()), dtype=float))
    driver, driven, residual = spectrum_curves(knocking(), healthy(), structural=floor)
    assert driver.structural_db[2 * TEETH[0]] == table["mesh.share.2"]
    assert driver.structural_db[2 * TEETH[0] - 4] == table["sideband.driver.3to5"]
    assert driven.structural_db[TEETH[1] + 1] == table["sideband.driven.1"]
    assert driven.structural_db[2] == table["shaft.driven.2"]
    assert residual.structural_db[-1] >= table["floor.band.1"]


def test_the_gap_by_order_ignores_what_lies_below_the_floor() -> None:
    orders = np.arange(4.0)
    curves = SpectrumCurves(
        "a", "m/s^2", orders, np.array([10.0, 1.0, 0.1, 0.1]), np.array([1.0, 10.0, 0.2, 2.0]), np.zeros(0), np.ones(4)
    )
    assert gap_by_order(curves, curves.before) == pytest.approx([20.0, -20.0, np.nan, -6.02], nan_ok=True, abs=0.01)


def test_a_line_that_moved_by_one_is_the_same() -> None:
    measured, before = np.ones(20), np.ones(20)
    measured[8], before[9] = 100.0, 100.0
    curves = SpectrumCurves("a", "", 0.05 * np.arange(20), measured, before, np.zeros(0), 0.5 * np.ones(20))
    assert gap_by_order(curves, before) == pytest.approx(np.zeros(20))


def test_energy_peaks_at_the_tooth_and_is_over_the_median_one() -> None:
    driver, driven = angle_curves(knocking(), healthy())
    place = driver.angle_deg[np.argmax(driver.measured)]
    assert place == pytest.approx(0.4 * 360, abs=360 / TEETH[0])
    assert np.median(driver.measured) == pytest.approx(1.0)
    assert driver.has_mark
    assert not driven.has_mark
    assert np.all(np.diff(driver.angle_deg) > 0)
    assert 0.0 <= driver.angle_deg[0] < 360 / TEETH[0]


def test_the_simulated_change_has_the_size_of_the_measured_one() -> None:
    """Half the impact has a quarter of the energy, in the units of the measured median tooth."""
    simulated = knocking(0.75, seed=2)
    driver = angle_curves(knocking(), healthy(), simulated, healthy=healthy())[0]
    assert driver.after.max() / driver.measured.max() == pytest.approx(0.25, rel=0.1)
    assert not driver.before.any()  # compared with itself


def test_without_a_mark_simulated_curves_are_turned_to_the_measured() -> None:
    measured = reduce_recording(record(lambda _, r: 1.5 * ringing(RATIO * r - 0.3), seed=1), RIG)
    simulated = reduce_recording(record(lambda _, r: 1.5 * ringing(RATIO * r - 0.7), seed=2), RIG)
    driven = angle_curves(measured, simulated)[1]
    assert abs(int(np.argmax(driven.measured)) - int(np.argmax(driven.before))) <= 1


def test_the_reference_stands_beside_recording_and_simulation() -> None:
    reference = reduce_recording(record(seed=7), RIG)
    change = difference_features(knocking(), healthy())
    floor = StructuralFloor(change.names, np.full(len(change.names), 2.0))
    for curves in spectrum_curves(knocking(), healthy(), reference=reference, reference_structural=floor):
        assert len(curves.reference) == len(curves.reference_floor) == len(curves.orders)
        assert len(curves.reference_structural_db) == len(curves.orders)
        assert not len(curves.structural_db)
        view = against_reference(curves)
        np.testing.assert_array_equal(view.before, curves.reference)
        assert not len(view.after)
    without = spectrum_curves(knocking(), healthy())[0]
    assert not len(without.reference)
    assert not len(without.reference_floor)
    driver = spectrum_curves(healthy(), knocking(), reference=reference)[0]  # it is the simulation that has impacts
    assert np.nanmax(np.abs(gap_by_order(against_reference(driver), driver.reference))) < 6.0
    assert np.nanmax(np.abs(gap_by_order(driver, driver.before))) > 10.0


def test_lines_beyond_their_floor_are_counted_of_those_that_are_seen() -> None:
    orders, floor = np.arange(5.0), np.full(5, 0.1)
    measured, before = np.array([10.0, 1.1, 1.0, 0.05, 0.01]), np.array([1.0, 1.0, 4.0, 0.01, 0.01])
    curves = SpectrumCurves("a", "", orders, measured, before, np.zeros(0), floor, structural_db=np.full(5, 6.0))
    assert lines_beyond(curves) == (2, 3)


def test_averages_differ_where_the_knock_is() -> None:
    curves = average_curves(knocking(), healthy(), unit="m/s^2")[0]
    changed = np.abs(curves.measured - curves.reference)
    away = (curves.angle_deg[np.argmax(changed)] - 0.4 * 360 + 180) % 360 - 180
    assert abs(away) < 360 / TEETH[0]
    assert (curves.shaft, curves.teeth, curves.unit) == ("in", TEETH[0], "m/s^2")
    assert curves.channel in ("a1", "a2")
    elsewhere = np.abs((curves.angle_deg - 0.4 * 360 + 180) % 360 - 180) > 120
    assert changed[elsewhere].max() < 0.3 * changed.max()


def test_averages_are_peak_amplitudes_of_what_was_put_in() -> None:
    """A line between the mesh harmonics, 1.5 m/s² in the recording and none in the reference."""
    order = TEETH[0] + 9
    added = reduce_recording(record(lambda _, r: 1.5 * np.cos(2 * np.pi * order * r), seed=3), RIG)
    curves = average_curves(added, healthy())[0]
    change = curves.measured - curves.reference
    assert np.sqrt(2.0 * np.mean(change**2)) == pytest.approx(1.5, rel=0.05)
