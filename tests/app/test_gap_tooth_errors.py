"""Changes of transmission errors that simulators teach hold for one that is left out; what they have to share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.studies.gap.tooth_errors import (
    CORNERS,
    SIMULATORS,
    evidence_on,
    known_tooth_errors_of,
    named,
    separations_with_corners,
    table_with_corners,
    together,
)
from gearsig.checks import FloatArray
from gearsig.severity import OTHER, SINGLE_TOOTH_FAULTS, KnownToothErrors
from sims.fe_gear import ready_gear
from sims.mesh import FlankDeviation, GearMesh, PairGeometry, ToothChip, share_torque
from sims.reduced_fe import mesh_maps, static_table

CYCLES = np.arange(-1.5, 4.0, 1.0 / 32.0)
TORQUE_NM = 110.0


def mesh() -> GearMesh:
    gears = ready_gear("z55_m2"), ready_gear("z75_m2")
    return GearMesh(PairGeometry(*(gear.blank.geometry for gear in gears)), contact_law="load-dependent")


def error_um(of: GearMesh, cycles: FloatArray = CYCLES, torque_nm: float = TORQUE_NM) -> FloatArray:
    return 1e6 * share_torque(of, torque_nm, cycles + CORNERS, table=table_with_corners(of)).transmission_error_m


def with_one_tooth_off(of: GearMesh, error: float) -> GearMesh:
    return replace(of, flank_1=FlankDeviation(pitch_um=tuple((error * np.eye(55)[0]).tolist())))


def test_corners_change_nothing_amid_single_and_double_contact() -> None:
    """At a light load; at a heavy one neighbours touch by their corners all through the single contact of ε = 1.78."""
    healthy = mesh()
    middle = 0.5 * healthy.pair.contact_ratio
    cycles = np.array([middle, middle + 0.5, middle + 5.0])
    bare = 1e6 * share_torque(healthy, 5.0, cycles).transmission_error_m
    assert error_um(healthy, cycles, 5.0) == pytest.approx(bare, rel=1e-9)


@pytest.mark.parametrize("error_of_tooth_um", [-15.0, 15.0])
def test_a_tooth_out_of_its_place_is_that_of_finite_elements(error_of_tooth_um: float) -> None:
    """Within a third of what is missed where no corner touches: there a tooth that lags looks like a cracked one."""
    healthy = mesh()
    faulty, gears = with_one_tooth_off(healthy, error_of_tooth_um), (ready_gear("z55_m2"), ready_gear("z75_m2"))
    elements = [
        1e6 * mesh_maps(gears, of, np.array([TORQUE_NM]), CYCLES, table=static_table(gears, of)).transmission_error_m
        for of in (faulty, healthy)
    ]
    change = error_um(faulty) - error_um(healthy)
    expected = (elements[0] - elements[1])[:, 0]
    assert np.corrcoef(change, expected)[0, 1] > 0.97
    bare = [1e6 * share_torque(of, TORQUE_NM, CYCLES).transmission_error_m for of in (faulty, healthy)]
    assert np.abs(change - expected).max() < 0.35 * np.abs(bare[0] - bare[1] - expected).max()


def test_a_pair_leaves_a_chip_as_it_leaves_a_tip() -> None:
    """Some µm within a tenth of a pitch, and all of the tooth alike before the edge."""
    healthy = mesh()
    chipped = replace(healthy, chips_1=(ToothChip(1.0, tooth=0),))
    driver, pair = healthy.pair.driver, healthy.pair
    edge_mm = np.sqrt((driver.tip_radius_mm - 1.0) ** 2 - driver.base_radius_mm**2)
    edge = (edge_mm - pair.start_radius_mm) / pair.base_pitch_mm
    whole, damaged = (separations_with_corners(of, edge + np.array([-0.2, -0.01, 0.1])) for of in (healthy, chipped))
    added_um = 1e6 * (damaged.gear(1)[1] - whole.gear(1)[0])
    assert added_um[:2] == pytest.approx(0.0, abs=1e-9)
    assert 1.0 < added_um[2] < 10.0


@pytest.fixture(scope="module")
def known() -> dict[str, KnownToothErrors]:
    return {name: known_tooth_errors_of(name, 100) for name in SIMULATORS}


@pytest.mark.study
@pytest.mark.parametrize("left_out", [*SIMULATORS])
def test_faults_of_a_simulator_left_out_are_named(known: dict[str, KnownToothErrors], left_out: str) -> None:
    """By chance one in four; with 600 of each see docs/how_good.md, a third of the pitch errors of one tooth."""
    taught = together([errors for name, errors in known.items() if name != left_out])
    is_fault = known[left_out].causes != OTHER
    rows, causes = known[left_out].descriptors[is_fault], known[left_out].causes[is_fault]
    likeliest, probability = named(evidence_on(taught, rows))
    right = likeliest == causes
    assert right.mean() > 0.8
    assert right[probability >= 0.9].mean() > 0.9
    assert np.mean(right[causes == "pitch_error"]) > 0.75


@pytest.mark.study
@pytest.mark.parametrize("left_out", [*SIMULATORS])
def test_other_changes_are_not_taken_for_a_damaged_tooth(known: dict[str, KnownToothErrors], left_out: str) -> None:
    """Another load, wear of all teeth and run-out; cracks, chips and spalls are, with 600 of each 0.91 of them."""
    taught = together([errors for name, errors in known.items() if name != left_out])
    odds = np.array([one.odds_of_a_tooth for one in evidence_on(taught, known[left_out].descriptors)])
    causes = known[left_out].causes
    assert np.mean(odds[~np.isin(causes, SINGLE_TOOTH_FAULTS)] > 20.0) <= 0.02
    assert np.mean(odds[np.isin(causes, SINGLE_TOOTH_FAULTS)] > 20.0) > 0.6
