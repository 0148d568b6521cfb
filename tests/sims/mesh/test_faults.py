"""Spalls, chips and corners of teeth."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from gearsig.errors import InputError
from sims.mesh import (
    GearGeometry,
    GearMesh,
    MeshTable,
    PairGeometry,
    RootCrack,
    ToothChip,
    ToothSpall,
    arc_length_mm,
    check_spall,
    corner_separation_m,
    curvature_radius_mm,
    flank_length_mm,
    highest_chip_mm,
    involute_outline,
    mesh_stiffness,
    mesh_table,
    part_inside,
    share_torque,
    spans_face,
    tooth_compliance,
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


# Chipped teeth: the edge that is left carries as a corner, lost width in closed form, limits, refusals.

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


# Where flanks touch and how far corners are apart, against the geometry done another way.

PAIRS = (
    PairGeometry(GearGeometry(50, 3.0, bore_radius_mm=20.0), GearGeometry(50, 3.0, bore_radius_mm=20.0)),
    PairGeometry(GearGeometry(30, 2.0), GearGeometry(75, 2.0)),
)


@pytest.mark.parametrize("pair", PAIRS)
def test_flanks_touch_all_along_the_path_of_contact(pair):
    inside = np.linspace(0.0, pair.contact_ratio, 50)
    assert np.all(corner_separation_m(pair, inside) == 0.0)
    assert np.all(corner_separation_m(pair, np.array([-0.01, pair.contact_ratio + 0.01])) > 0.0)


def test_equal_gears_enter_as_they_leave():
    pair = PAIRS[0]
    early = np.linspace(-0.3, 0.0, 31)
    late = pair.contact_ratio - early
    assert corner_separation_m(pair, early) == pytest.approx(corner_separation_m(pair, late), abs=1e-15)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("progress", [-0.05, -0.12, -0.25])
def test_entry_separation_is_the_turn_until_the_corner_meets_the_flank(pair, progress):
    """Turn the driver on until a polyline of its involute runs through the driven gear's tip corner."""
    rb1, rb2, length = pair.driver.base_radius_mm, pair.driven.base_radius_mm, pair.action_length_mm
    before = -progress * pair.base_pitch_mm
    back = before / rb2  # the driven gear, turned back against its cw motion
    start = np.array([-rb2, pair.start_radius_mm - length])
    rotation = np.array([[np.cos(back), -np.sin(back)], [np.sin(back), np.cos(back)]])
    corner = np.array([rb2, length]) + rotation @ start
    base = (pair.start_radius_mm - before) / rb1  # where the flank starts on the base circle

    def distance(turn):
        def off(u):
            angle = base + turn - u  # of the tangent point, from which the string of length rb1·u runs ahead
            x = rb1 * np.cos(angle) - rb1 * u * np.sin(angle) - rb1
            y = rb1 * np.sin(angle) + rb1 * u * np.cos(angle)
            return (x - corner[0]) ** 2 + (y - corner[1]) ** 2

        return minimize_scalar(off, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-13}).fun

    def side(turn):  # the derivative of the squared distance changes its sign where it is 0
        return distance(turn + 1e-7) - distance(turn - 1e-7)

    turn = brentq(side, -1e-4, 5e-2, xtol=1e-12)
    assert distance(turn) < 1e-10
    expected_mm = rb1 * turn
    assert 1e3 * corner_separation_m(pair, np.array([progress]))[0] == pytest.approx(expected_mm, rel=1e-3)


@pytest.mark.parametrize("lost", [(0.5, 0.0), (0.0, 0.5)])
def test_what_a_chip_leaves_is_the_corner_of_a_shorter_tooth(lost):
    """The entry of a driven gear whose teeth are shorter is later, by what the driver's contact then has behind it."""
    pair = PAIRS[1]
    shorter = PairGeometry(*(GearGeometry(z, 2.0, addendum=1.0 - h / 2.0) for z, h in zip((30, 75), lost, strict=True)))
    late = (shorter.start_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm
    progress = np.linspace(-0.3, pair.contact_ratio + 0.3, 41)
    chipped = corner_separation_m(pair, progress, lost)
    assert chipped == pytest.approx(corner_separation_m(shorter, progress - late), abs=1e-15)
    assert np.all(chipped >= corner_separation_m(pair, progress))
