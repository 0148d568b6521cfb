"""Spalls: lost width in closed form, sinking by curvature, where and on which tooth, limits, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    GearGeometry,
    GearMesh,
    MeshTable,
    PairGeometry,
    RootCrack,
    ToothSpall,
    arc_length_mm,
    check_spall,
    curvature_radius_mm,
    flank_length_mm,
    involute_outline,
    mesh_stiffness,
    mesh_table,
    part_inside,
    share_torque,
    spans_face,
)
from tests.sims.mesh.meshes import MESH, PAIR, PITCH_POINT, SINGLE, own_compliance, own_separation, own_stretch

DRIVER = PAIR.driver
AT_PITCH = np.array([PITCH_POINT])


def spalled(**values: float) -> GearMesh:
    return replace(MESH, spalls_1=(ToothSpall(**values),))  # type: ignore[arg-type]  # numbers of both kinds


def largest_change(one: MeshTable, two: MeshTable) -> tuple[float, float]:
    """Greatest relative change of compliance and absolute one of separation of tooth 0."""
    compliance = np.abs(own_compliance(two, own_stretch(MESH)) / own_compliance(one, own_stretch(MESH)) - 1).max()
    separation = np.abs(own_separation(two, own_stretch(MESH)) - own_separation(one, own_stretch(MESH))).max()
    return float(compliance), float(separation)


def test_arc_length_is_that_of_the_outline() -> None:
    roll = np.linspace(DRIVER.form_roll_rad, DRIVER.tip_roll_rad, 20001)
    flank = involute_outline(DRIVER, roll)
    travelled = np.sum(np.hypot(np.diff(flank.x_mm), np.diff(flank.y_mm)))
    ends = arc_length_mm(DRIVER, DRIVER.base_radius_mm * roll[[0, -1]])
    assert ends[1] - ends[0] == pytest.approx(travelled, rel=1e-8)
    assert flank_length_mm(DRIVER) == pytest.approx(travelled, rel=1e-8)


@pytest.mark.parametrize("width_mm", [2.0, 10.0, 18.0])
def test_contact_over_a_spall_is_softer_by_the_width_that_is_lost(width_mm: float) -> None:
    """c_h grows to c_h/(1 − w/b) in the middle of a spall that is longer than the zone of contact."""
    healthy, damaged = (mesh_table(m) for m in (MESH, spalled(length_mm=1.0, width_mm=width_mm)))
    contact = 4 * (1 - 0.3**2) / (np.pi * 206e9 * 0.02)
    extra = own_compliance(damaged, AT_PITCH) - own_compliance(healthy, AT_PITCH)
    assert extra == pytest.approx(contact * (1 / (1 - width_mm / 20.0) - 1), rel=1e-6)


def test_load_dependent_contact_over_a_spall() -> None:
    """The secant of the law at 1 GPa, where the line load is π a p/2."""
    law = replace(MESH, contact_law="load-dependent")
    mesh = replace(law, spalls_1=(ToothSpall(1.0, 10.0),))
    radius, modulus = 1e-3 * float(curvature_radius_mm(PAIR, PAIR.pitch_point_radius_mm)), 206e9 / (2 * 0.91)
    force = np.pi * radius * 0.02 * 1e18 / modulus
    extra = own_compliance(mesh_table(mesh), AT_PITCH) - own_compliance(mesh_table(law), AT_PITCH)
    assert extra == pytest.approx(mesh.contact_coefficient * force**-0.1, rel=1e-6)


@pytest.mark.parametrize("turn", [0, 55, -110])
def test_stiffness_drops_only_while_the_spall_of_its_tooth_is_touched(turn: int) -> None:
    mesh = replace(MESH, spalls_1=(ToothSpall(1.0, 16.0, tooth=7),))
    cycles = np.linspace(-1.0, 3.0, 2001)
    c = cycles + 7 + turn
    ratio = mesh_stiffness(mesh, c).total_n_per_m / mesh_stiffness(MESH, c).total_n_per_m
    # From the spall's ends on the involute, half a zone of contact more on either side.
    middle = PAIR.pitch_point_radius_mm**2 / (2 * DRIVER.base_radius_mm)
    reach = 0.5 + 0.1918
    ends = np.sqrt(2 * DRIVER.base_radius_mm * (middle + np.array([-reach, reach])))
    low, high = (ends - PAIR.start_radius_mm) / PAIR.base_pitch_mm
    columns = 0.008  # two of the table's, which the interpolation reaches beyond
    inside = (cycles > low - columns) & (cycles < high + columns)
    assert ratio[~inside] == pytest.approx(1.0, abs=1e-9)
    assert ratio[inside].min() < 0.9
    assert np.all(ratio[(cycles > low + 0.05) & (cycles < high - 0.05)] < 1.0)


def test_a_wider_spall_is_softer() -> None:
    means = [mesh_stiffness(spalled(length_mm=1.0, width_mm=w), SINGLE).mean_n_per_m for w in (0.0, 4.0, 8.0, 16.0)]
    assert np.all(np.diff(means) < 0)


def test_spall_of_the_driven_gear_comes_with_its_tooth_and_counts_from_its_own_root() -> None:
    """The driven gear's flank is touched from tip to root: its root end is where the pair leaves."""
    at_root = replace(MESH, spalls_2=(ToothSpall(0.6, 10.0, tooth=3, centre=0.0),))
    at_tip = replace(MESH, spalls_2=(ToothSpall(0.6, 10.0, tooth=3, centre=1.0),))
    healthy = own_compliance(mesh_table(MESH), own_stretch(MESH))
    late, early = (
        own_stretch(MESH)[own_compliance(mesh_table(m), own_stretch(MESH), pair=78) > healthy * 1.001]
        for m in (at_root, at_tip)
    )
    assert late.min() > 0.6 * PAIR.contact_ratio
    assert early.max() < 0.4 * PAIR.contact_ratio
    assert own_compliance(mesh_table(at_root), own_stretch(MESH), pair=4) == pytest.approx(healthy, rel=1e-12)


def test_shallow_spall_over_the_face_adds_its_depth_to_the_error() -> None:
    """In single contact, well inside the spall, the driver runs ahead by the depth."""
    mesh = spalled(length_mm=3.0, width_mm=20.0, depth_um=5.0)
    extra = (
        share_torque(mesh, 110.0, SINGLE).transmission_error_m - share_torque(MESH, 110.0, SINGLE).transmission_error_m
    )
    assert extra == pytest.approx(5e-6, rel=1e-6)
    assert mesh_stiffness(mesh, SINGLE).total_n_per_m == pytest.approx(mesh_stiffness(MESH, SINGLE).total_n_per_m)


@given(st.floats(0.1, 3.5), st.floats(1.0, 200.0), st.floats(0.4, 1.4))
@settings(max_examples=30, deadline=None)  # kernels compile in the first example
def test_mate_sinks_in_until_it_rests_on_edge_or_floor(length: float, depth: float, progress: float) -> None:
    """Against the least gap of a parabola over a flat with a pit, point by point."""
    rho = PAIR.contact_radii_mm(progress)[0]
    place = float(arc_length_mm(DRIVER, rho) - arc_length_mm(DRIVER, PAIR.pitch_point_radius_mm))
    radius = float(curvature_radius_mm(PAIR, rho))
    flank = np.linspace(-6.0, 6.0, 120001)
    floor = np.where(np.abs(flank) < length / 2, depth * 1e-3, 0.0)
    expected = np.min(floor + (flank - place) ** 2 / (2 * radius))
    mesh = spalled(length_mm=length, width_mm=20.0, depth_um=depth)
    found = own_separation(mesh_table(mesh, 4096), np.array([progress]))
    assert found == pytest.approx(expected * 1e-3, abs=5e-8)


@given(st.sampled_from([(0.0, 10.0, 50.0), (1.0, 0.0, 50.0), (1.0, 10.0, 0.0), (0.0, 20.0, 50.0), (1.0, 20.0, 0.0)]))
@settings(deadline=None)  # kernels compile in the first example
def test_spall_of_no_size_changes_nothing(size: tuple[float, float, float]) -> None:
    one, two = mesh_table(MESH), mesh_table(replace(MESH, spalls_1=(ToothSpall(*size),)))
    assert largest_change(one, two) == (0.0, 0.0)
    for number in (1, 2):
        assert np.all(two.compliance.gear(number) == one.compliance.gear(number)[0])
        assert np.all(two.separation.gear(number) == one.separation.gear(number)[0])


@pytest.mark.parametrize("size", [(1e-3, 10.0, 50.0), (1.0, 1e-3, 50.0), (1.0, 10.0, 1e-4), (0.2, 20.0, 1e-4)])
def test_small_spalls_change_little(size: tuple[float, float, float]) -> None:
    compliance, separation = largest_change(mesh_table(MESH), mesh_table(replace(MESH, spalls_1=(ToothSpall(*size),))))
    assert compliance < 1e-3
    assert separation < 1e-9
    assert compliance + separation > 0.0


def test_crack_and_spall_on_one_tooth_add() -> None:
    crack, spall = RootCrack(2.0, tooth=5), ToothSpall(1.0, 10.0, tooth=5)
    meshes = (MESH, replace(MESH, cracks_1=(crack,)), replace(MESH, spalls_1=(spall,)))
    both = replace(MESH, cracks_1=(crack,), spalls_1=(spall, ToothSpall(1.0, 5.0, tooth=6)))
    healthy, cracked, pitted = (own_compliance(mesh_table(m), SINGLE, pair=5) for m in meshes)
    found = own_compliance(mesh_table(both), SINGLE, pair=5)
    assert found - healthy == pytest.approx((cracked - healthy) + (pitted - healthy), rel=1e-9)
    assert mesh_table(both).compliance.gear(1).shape[0] == 3


@given(st.floats(-1.0, 5.0), st.floats(0.0, 3.0))
def test_part_of_the_zone_of_contact(place: float, length: float) -> None:
    """Never above 1 nor what the stretch can take; inside a long stretch 1, outside 0, half at its end."""
    part = float(part_inside(np.array([place]), 0.0, length, 0.2)[0])
    assert -1e-12 <= part <= min(1.0, length * 1.875 / 0.4) + 1e-12
    if 0.2 <= place <= length - 0.2:
        assert part == pytest.approx(1.0, abs=1e-12)
    if place <= -0.2 or place >= length + 0.2:
        assert part == pytest.approx(0.0, abs=1e-12)
    assert float(part_inside(np.array([0.0]), 0.0, 1.0, 0.2)[0]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"length_mm": -1.0, "width_mm": 1.0}, "length_mm"),
        ({"length_mm": 1.0, "width_mm": -1.0}, "width_mm"),
        ({"length_mm": 1.0, "width_mm": 1.0, "depth_um": -1.0}, "depth_um"),
        ({"length_mm": 1.0, "width_mm": 1.0, "tooth": -1}, "tooth"),
        ({"length_mm": 1.0, "width_mm": 1.0, "centre": 1.5}, "centre"),
        ({"length_mm": 5.0, "width_mm": 1.0}, r"0 to 3\.96 mm"),
        ({"length_mm": 1.0, "width_mm": 21.0}, r"0 to 18 mm, or 20 mm"),
        ({"length_mm": 1.0, "width_mm": 19.0}, "whole face"),
        ({"length_mm": 1.0, "width_mm": 1.0, "tooth": 55}, "tooth of the spall"),
    ],
)
def test_spalls_that_cannot_be(values: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        spalled(**values)


@given(st.floats(0.5, 200.0), st.floats(1.0, 90.0), st.booleans())
def test_every_part_up_to_nine_tenths_and_the_whole_face_fit(face_mm: float, percent: float, whole: bool) -> None:
    pair = PairGeometry(*(GearGeometry(z, 2.0, face_width_mm=face_mm) for z in (55, 75)))
    for part in (percent, 90.0, 100.0):
        check_spall(pair, 1, ToothSpall(1.0, part / 100.0 * face_mm if whole else face_mm * part / 100.0))
    assert spans_face(100.0 / 100.0 * face_mm, face_mm)


def test_one_spall_per_tooth() -> None:
    with pytest.raises(InputError, match="two spalls on one tooth"):
        replace(MESH, spalls_2=(ToothSpall(1.0, 2.0), ToothSpall(2.0, 2.0)))
