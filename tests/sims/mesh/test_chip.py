"""Chipped teeth: the edge that is left carries as a corner, lost width in closed form, limits, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    RootCrack,
    ToothChip,
    ToothSpall,
    corner_separation_m,
    highest_chip_mm,
    mesh_table,
    share_torque,
    tooth_compliance,
)
from tests.sims.mesh.meshes import MESH, PAIR, own_compliance, own_separation, own_stretch

ENDS = own_stretch(MESH)
COLUMNS = 0.008
"""Two columns of the table, by which the interpolation reaches beyond an edge."""


def touched_radius_mm(progress: np.ndarray) -> np.ndarray:
    """Distance from the driver's axis of the point that is touched."""
    return np.hypot(PAIR.driver.base_radius_mm, PAIR.contact_radii_mm(progress)[0])


@pytest.mark.parametrize("height_mm", [0.3, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("torque_nm", [1.0, 110.0, 500.0])
def test_beyond_a_chip_over_the_face_its_edge_carries_what_the_neighbours_leave(
    height_mm: float, torque_nm: float
) -> None:
    """A pair alone follows its edge; of two, the chipped one carries less, and nothing once its edge is too far off."""
    mesh = replace(MESH, chips_1=(ToothChip(height_mm, tooth=9),))
    cycles = 9 + np.linspace(-0.5, 2.5, 1501)
    healthy, chipped = (share_torque(m, torque_nm, cycles) for m in (MESH, mesh))
    gap = corner_separation_m(PAIR, np.clip(cycles - 9, 0.0, PAIR.contact_ratio), (height_mm, 0.0))
    column = np.floor(cycles + MESH.ramp / 2).astype(int) - 9
    here = (column >= 0) & (column < MESH.n_slots)
    forces = np.where(here, chipped.pair_forces_n[np.arange(len(cycles)), np.clip(column, 0, 1)], 0.0)
    double = (cycles > 10.05) & (cycles < 9 + PAIR.contact_ratio - 0.05)
    jump = chipped.transmission_error_m - healthy.transmission_error_m
    off = double & (gap > chipped.transmission_error_m)
    assert np.all(forces[off] == 0.0)
    assert off.any() or height_mm < 2.0
    near = double & (gap > 0.0) & ~off
    assert np.all(forces[near] > 0.0)
    assert np.all(jump[double] >= -1e-8)  # the table rounds over the edge
    alone = (cycles > 9.85) & (cycles < 9.95)
    assert jump[alone] == pytest.approx(gap[alone], abs=1e-8)
    whole = touched_radius_mm(cycles - 9 + COLUMNS) <= PAIR.driver.tip_radius_mm - height_mm
    assert jump[whole | (cycles < 9)] == pytest.approx(0.0, abs=1e-9)


def test_chip_of_the_driven_gear_lets_its_pair_enter_late() -> None:
    mesh = replace(MESH, chips_2=(ToothChip(1.0, tooth=4),))
    shared = share_torque(mesh, 110.0, np.array([79.1, 79.3, 79.7]))
    healthy = share_torque(MESH, 110.0, np.array([79.1, 79.3, 79.7]))
    left = shared.pair_forces_n[:, 0] / healthy.pair_forces_n[:, 0]
    assert left[0] == 0.0
    assert 0.2 < left[1] < 0.8
    assert left[2] > 0.95
    assert shared.pair_forces_n[2, 0] > 500.0
    at_other_tooth = share_torque(mesh, 110.0, np.array([80.1])).pair_forces_n
    assert at_other_tooth[0, 0] > 500.0


@pytest.mark.parametrize("width_mm", [2.0, 10.0, 18.0])
def test_chip_over_part_of_the_face_softens_tooth_and_contact(width_mm: float) -> None:
    """Before the edge not at all, far beyond it by what is lost, and never the other way."""
    mesh = replace(MESH, chips_1=(ToothChip(3.5, width_mm),))
    extra = own_compliance(mesh_table(mesh), ENDS) - own_compliance(mesh_table(MESH), ENDS)
    roll = PAIR.contact_radii_mm(ENDS)[0] / PAIR.driver.base_radius_mm
    own = tooth_compliance(PAIR.driver, MESH.material_1, roll).total / 0.02 + 4 * 0.91 / (np.pi * 206e9 * 0.02)
    lost = corner_separation_m(PAIR, ENDS, (3.5, 0.0)) > 200e-6
    whole = touched_radius_mm(ENDS + COLUMNS) < PAIR.driver.tip_radius_mm - 3.5
    expected = own * (1 / (1 - width_mm / 20.0) - 1)
    assert lost.any()
    assert whole.any()
    assert extra[lost] == pytest.approx(expected[lost], rel=1e-6)
    assert extra[whole] == pytest.approx(0.0, abs=1e-9 * expected.min())
    assert np.all(extra / own > -1e-3)  # the table rounds over the edge
    assert np.all(extra < 1.001 * expected)
    assert np.all(own_separation(mesh_table(mesh), ENDS) == 0.0)


def test_whole_width_given_as_a_number_is_the_whole_width() -> None:
    one, two = (mesh_table(replace(MESH, chips_1=(ToothChip(1.0, w),))) for w in (None, 20.0))
    np.testing.assert_array_equal(one.separation.gear(1), two.separation.gear(1))
    at = one.start + one.step * np.arange(one.separation.rows.shape[1])
    edge = corner_separation_m(PAIR, at, (1.0, 0.0)) - corner_separation_m(PAIR, at)
    np.testing.assert_allclose(one.separation.gear(1)[1], edge, atol=1e-18)
    assert edge.max() > 0.05e-3
    assert np.all(one.compliance.gear(1)[1] == one.compliance.gear(1)[0])


@given(st.floats(0.0, 3.7), st.floats(1.0, 600.0))
@settings(max_examples=30, deadline=None)  # kernels compile in the first example
def test_load_stays_balanced(height_mm: float, torque_nm: float) -> None:
    mesh = replace(MESH, chips_1=(ToothChip(height_mm),))
    shared = share_torque(mesh, torque_nm, np.linspace(0.0, 2.0, 101))
    force = torque_nm / (PAIR.driver.base_radius_mm * 1e-3)
    assert shared.pair_forces_n.sum(axis=1) == pytest.approx(force, rel=1e-10)


@pytest.mark.parametrize("width_mm", [None, 8.0])
def test_small_chips_change_little_and_none_changes_nothing(width_mm: float | None) -> None:
    beyond = np.linspace(0.0, PAIR.contact_ratio + 0.025, 400)
    healthy, none, small = (
        mesh_table(replace(MESH, chips_1=chips))
        for chips in ((), (ToothChip(0.0, width_mm),), (ToothChip(1e-4, width_mm),))
    )
    assert np.all(own_separation(none, beyond) == 0.0)
    assert np.all(own_compliance(none, beyond) == own_compliance(healthy, beyond))
    change = own_compliance(small, beyond) / own_compliance(healthy, beyond) - 1
    assert np.abs(change).max() < 1e-3
    assert own_separation(small, beyond).max() < 1e-6
    assert np.abs(change).max() + own_separation(small, beyond).max() > 0.0


def test_chip_of_no_width_changes_nothing() -> None:
    table = mesh_table(replace(MESH, chips_1=(ToothChip(1.0, 0.0),)))
    assert np.all(table.compliance.gear(1)[1] == table.compliance.gear(1)[0])
    assert np.all(table.separation.gear(1) == 0.0)


def test_chip_and_spall_over_the_face_add_on_one_tooth() -> None:
    chip, spall = ToothChip(1.0, tooth=2), ToothSpall(2.0, 20.0, 10.0, tooth=2)
    tables = [
        mesh_table(replace(MESH, **more))  # type: ignore[arg-type]  # tuples of faults
        for more in ({"chips_1": (chip,)}, {"spalls_1": (spall,)}, {"chips_1": (chip,), "spalls_1": (spall,)})
    ]
    one, two, both = (own_separation(t, ENDS, pair=2) for t in tables)
    assert both == pytest.approx(one + two, abs=1e-15)
    assert own_separation(tables[2], ENDS, pair=3) == pytest.approx(0.0, abs=1e-18)


def test_cracked_and_chipped_tooth() -> None:
    """The cracked tooth's own compliance grows by the lost width."""
    mesh = replace(MESH, cracks_1=(RootCrack(2.0),), chips_1=(ToothChip(3.5, 10.0),))
    cracked = replace(MESH, cracks_1=(RootCrack(2.0),))
    tip = np.array([1.7])
    extra = own_compliance(mesh_table(mesh), tip) - own_compliance(mesh_table(cracked), tip)
    plain = own_compliance(mesh_table(replace(MESH, chips_1=mesh.chips_1)), tip) - own_compliance(mesh_table(MESH), tip)
    grown = own_compliance(mesh_table(cracked), tip) - own_compliance(mesh_table(MESH), tip)
    assert extra == pytest.approx(plain + grown, rel=1e-9)


@pytest.mark.parametrize(
    ("chips", "words"),
    [
        ((ToothChip(3.8),), r"0 to 3\.72 mm"),
        ((ToothChip(1.0, 19.0),), "whole face"),
        ((ToothChip(1.0, 25.0),), "width_mm of the chip"),
        ((ToothChip(1.0, tooth=55),), "tooth of the chip"),
        ((ToothChip(1.0), ToothChip(0.5)), "two chips on one tooth"),
    ],
)
def test_chips_that_do_not_fit(chips: tuple[ToothChip, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(MESH, chips_1=chips)


def test_chips_that_cannot_be() -> None:
    assert highest_chip_mm(PAIR.driver) == PAIR.driver.tip_radius_mm - PAIR.driver.form_radius_mm
    for values, words in (((-1.0,), "height_mm"), ((1.0, -1.0), "width_mm"), ((1.0, None, -1), "tooth")):
        with pytest.raises(InputError, match=words):
            ToothChip(*values)
