"""Loaded contact: closed forms, equilibrium, what the source study shows, stiffness as a derivative."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from gearsig.errors import InputError
from sims.mesh import GearGeometry, GearMesh, Lead, PairGeometry, RootCrack, load_dependent_contact_coefficient
from sims.reduced_fe import (
    MeshMaps,
    folded,
    force_map,
    hertz_energy,
    mesh_maps,
    mirror_groups,
    mirrors,
    rolls_rad,
    root,
    solve_contacts,
    static_table,
)
from tests.sims.reduced_fe.flexible_pairs import ready_mesh
from tests.sims.reduced_fe.synthetic import synthetic_gear

HERTZ, SMALL = 2e-9, 1e-2


def solve(r, approach, hertz=HERTZ, enough=1e-7, start=0.0):
    n = len(approach)
    force, w = np.full(n, start), np.full(n, SMALL**-0.1)
    order, a, x = np.empty(n, dtype=np.int64), np.empty((n, n)), np.empty(n)
    done, _ = solve_contacts(r, n, approach, np.full(1, hertz), SMALL, force, w, enough, order, a, x)
    assert done > 0
    return force


def local_approach(force, hertz=HERTZ):
    return np.where(force > SMALL, hertz * np.maximum(force, 1e-300) ** 0.9, hertz * SMALL**-0.1 * force)


def test_one_point_yields_as_spring_and_hertz_in_series():
    c, depth = 4e-9, 1e-5
    expected = brentq(lambda n: c * n + HERTZ * n**0.9 - depth, 1.0, 1e5, xtol=1e-12)
    assert solve(np.array([[c]]), np.array([depth]))[0] == pytest.approx(expected, rel=1e-10)


def test_a_point_that_its_neighbour_lifts_off_carries_nothing():
    # The first point pushes the second away by more than it approaches.
    r = np.array([[4e-9, 3e-9], [3e-9, 4e-9]])
    force = solve(r, np.array([1e-5, 2e-6]))
    assert force[1] == 0.0
    assert force[0] == pytest.approx(solve(r[:1, :1], np.array([1e-5]))[0], rel=1e-10)


@settings(max_examples=60)
@given(st.integers(1, 12), st.integers(0, 2**31 - 1), st.floats(1e-7, 5e-5))
def test_forces_do_not_pull_and_points_do_not_overlap(n, seed, scale):
    rng = np.random.default_rng(seed)
    mixed = rng.standard_normal((n, n))
    r = 1e-9 * (mixed @ mixed.T / n + 0.3 * np.eye(n))
    approach = scale * rng.standard_normal(n)
    force = solve(r, approach, start=float(rng.uniform(0.0, 100.0)))
    gap = approach - r @ force - local_approach(force)
    tiny = 1e-9 * scale + 1e-15
    assert np.all(force >= 0.0)
    assert np.all(np.abs(gap[force > 0.0]) <= tiny)
    assert np.all(gap[force == 0.0] <= tiny)


def test_the_tenth_root_follows_from_any_guess():
    for force in (1e-6, 0.5, 3.0, 4e4):
        for guess in (0.1, 1.0, max(force, SMALL) ** -0.1 * 1.01):
            found = root(force, SMALL, guess)
            assert found == pytest.approx(max(force, SMALL) ** -0.1, rel=3e-4)
            assert root(force, SMALL, found) == pytest.approx(max(force, SMALL) ** -0.1, rel=1e-7)


def test_energy_of_the_local_approach_is_the_work_done_on_it():
    force = np.linspace(0.0, 200.0, 200_001)
    h = local_approach(force)
    work = float(np.trapezoid(force, h))
    assert hertz_energy(200.0, HERTZ, SMALL) == pytest.approx(work, rel=1e-6)


# Loaded contact over angle and torque: equilibrium, what the source study shows, and stiffness as a derivative.

TORQUES = np.array([10.0, 85.0, 170.0, 340.0, 500.0])
GEARS, MESH = ready_mesh()
RB_M = MESH.pair.driver.base_radius_mm * 1e-3
SINGLE = (0.80, 0.95)
"""Mesh cycles in the middle of the single-pair region: pair 0 alone."""


@pytest.fixture(scope="module")
def maps():
    return mesh_maps(GEARS, MESH, TORQUES)


def single(maps):
    return (maps.mesh_cycles > SINGLE[0]) & (maps.mesh_cycles < SINGLE[1])


def test_rolls_meet_on_the_line_of_action():
    pair = PairGeometry(GearGeometry(30, 2.0), GearGeometry(75, 2.0))
    one, two = rolls_rad(pair, np.linspace(0.0, pair.contact_ratio, 9))
    total = one * pair.driver.base_radius_mm + two * pair.driven.base_radius_mm
    assert total == pytest.approx(pair.action_length_mm)
    assert rolls_rad(pair, np.array([-0.2]))[0] == rolls_rad(pair, np.array([0.0]))[0]


def test_pairs_carry_the_load_together_and_never_pull(maps):
    total = maps.pair_forces_n.sum(axis=2)
    assert total == pytest.approx(np.broadcast_to(TORQUES / RB_M, total.shape), rel=1e-8)
    assert np.all(maps.force_n >= 0.0)
    assert maps.load_sharing.sum(axis=2) == pytest.approx(1.0)


def test_one_pair_in_the_middle_two_elsewhere_at_light_load(maps):
    touching = (maps.pair_forces_n[:, 0] > 0.0).sum(axis=1)
    assert set(touching[single(maps)]) == {1}
    double = (maps.mesh_cycles > 0.1) & (maps.mesh_cycles < 0.65)
    assert set(touching[double]) == {2}


def test_transmission_error_peaks_in_the_single_pair_region_and_grows_with_torque(maps):
    error = maps.transmission_error_m
    inside = (maps.mesh_cycles >= MESH.pair.contact_ratio - 1.0) & (maps.mesh_cycles <= 1.0)
    peaks = error.argmax(axis=0)
    assert np.all(inside[peaks])
    assert np.all(np.diff(error.max(axis=0)) > 0.0)
    # Up to 340 N m the step between one pair and two grows as well; then corners begin to fill it.
    steps = np.ptp(error, axis=0)
    assert np.all(np.diff(steps[:4]) > 0.0)


def test_stiffness_grows_with_load_and_the_tangent_exceeds_the_secant(maps):
    tangent, secant = maps.tangent_stiffness_n_per_m, maps.secant_stiffness_n_per_m
    assert np.all(np.diff(tangent.mean(axis=0)) > 0.0)
    assert np.all(tangent > secant)
    assert tangent[single(maps), 0].max() < 0.8 * tangent[~single(maps), 0].max()
    assert maps.contact_tangent_n_per_m.sum(axis=2) == pytest.approx(tangent)


def test_corner_contact_lengthens_the_path_with_load(maps):
    alone = (maps.pair_forces_n > 0.0).sum(axis=2) == 1
    assert np.all(np.diff(alone.mean(axis=0)) <= 0.0)
    assert alone[:, 0].mean() == pytest.approx(2.0 - MESH.pair.contact_ratio, abs=0.1)
    assert alone[:, -1].mean() < 0.1


def test_tabulated_force_has_the_tangent_as_its_derivative():
    table = static_table(GEARS, MESH)
    depth = np.linspace(2e-6, 3e-5, 1401)
    tabulated = force_map(table, MESH, depth, np.array([0.1, 0.4, 0.85]))
    slope = np.gradient(tabulated.force_n, depth, axis=1)[:, 1:-1]
    # At c = 0.85 a corner comes in at some depth: a kink, of which a difference sees the mean of both sides.
    off = np.abs(slope / tabulated.tangent_n_per_m[:, 1:-1] - 1.0)
    assert np.quantile(off, 0.99, axis=1).max() < 2e-4


def test_a_tooth_whose_slices_move_as_one_is_spring_and_hertz_in_series():
    """δ = C F + B F^0.9 where one pair carries, with C of the gears' own points."""
    gear = synthetic_gear(GearGeometry(30, 2.0), even_slices=True)
    mesh = GearMesh(PairGeometry(gear.blank.geometry, gear.blank.geometry))
    table = static_table((gear, gear), mesh, support="free")
    column = table.column((mesh.pair.contact_ratio - 1.0 + 1.0) / 2.0)
    force = 5.0 / (mesh.pair.driver.base_radius_mm * 1e-3)
    found = mesh_maps((gear, gear), mesh, np.array([5.0]), table.progress[column : column + 1], support="free")
    assert np.count_nonzero(found.pair_forces_n) == 1
    hertz = load_dependent_contact_coefficient(mesh.material_1, mesh.material_2, mesh.face_width_m)
    expected = table.direct[column].mean() * force + hertz * force**0.9
    assert found.transmission_error_m[0, 0] == pytest.approx(expected, rel=1e-4)


def test_a_crack_softens_its_tooth_alone():
    cracked = replace(MESH, cracks_1=(RootCrack(2.5, 45.0, 7),))
    cycles = np.array([7.85, 8.85, 20.85, 57.85])
    torque = np.array([170.0])

    def error(mesh):
        return mesh_maps(GEARS, mesh, torque, cycles).transmission_error_m[:, 0]

    healthy, found = error(MESH), error(cracked)
    assert found[0] > 1.02 * healthy[0]
    assert found[3] == pytest.approx(found[0])  # the same tooth a revolution later
    assert found[1:3] == pytest.approx(healthy[1:3], rel=1e-9)
    assert error(replace(MESH, cracks_1=(RootCrack(3.5, 45.0, 7),)))[0] > found[0]


def test_a_crack_over_part_of_the_width_moves_the_load_to_the_healthy_slices():
    half = replace(MESH, cracks_1=(RootCrack(3.0, 45.0, 0, 8.0),))
    force = mesh_maps(GEARS, half, np.array([170.0]), np.array([0.85])).force_n[0, 0, 1]
    healthy = mesh_maps(GEARS, MESH, np.array([170.0]), np.array([0.85])).force_n[0, 0, 1]
    assert np.all(force[:2] < healthy[:2])
    assert np.all(force[2:] > healthy[2:])


def test_misaligned_flanks_carry_at_one_end():
    askew = replace(MESH, lead=Lead(error_um=25.0))
    force = mesh_maps(GEARS, askew, np.array([50.0]), np.array([0.85])).force_n[0, 0, 1]
    assert np.all(np.diff(force) <= 0.0)
    assert force[0] > 4.0 * force[-1]


@pytest.mark.slow
def test_helical_slices_of_a_spur_gear_run_into_each_other():
    """β → 0 is the spur pair; with an overlap the transmission error varies less, for the same mean stiffness."""
    cycles = (np.arange(40) + 0.5) / 40

    def maps_of(overlap_ratio: float) -> MeshMaps:
        helix_deg = float(np.degrees(np.arctan(overlap_ratio * np.pi * 3.0 / 20.0)))
        return mesh_maps(GEARS, replace(MESH, lead=Lead(helix_deg)), np.array([340.0]), cycles)

    spur, limit, helical = maps_of(0.0), maps_of(1e-9), maps_of(1.0)
    assert limit.tangent_stiffness_n_per_m == pytest.approx(spur.tangent_stiffness_n_per_m, rel=1e-3)
    assert np.ptp(helical.transmission_error_m) < 0.25 * np.ptp(spur.transmission_error_m)
    assert helical.tangent_stiffness_n_per_m.mean() == pytest.approx(spur.tangent_stiffness_n_per_m.mean(), rel=0.03)


def test_crowning_takes_load_from_the_ends_of_the_face():
    crowned = replace(MESH, lead=Lead(crowning_um=15.0))
    assert mirrors(static_table(GEARS, crowned))
    force = mesh_maps(GEARS, crowned, np.array([100.0]), np.array([0.85])).force_n[0, 0, 1]
    assert force[2] == force.max()
    assert force[[0, 1]] == pytest.approx(force[[4, 3]], rel=1e-4)
    assert force[0] < 0.5 * force[2]


def test_mirrored_slices_give_the_same_as_all():
    table = static_table(GEARS, MESH)
    assert mirrors(table)
    depth = np.array([5e-6, 1.5e-5])
    cycles = np.linspace(0.0, 0.99, 12)
    whole = force_map(table, MESH, depth, cycles)
    halved = force_map(folded(table), MESH, depth, cycles)
    assert halved.force_n == pytest.approx(whole.force_n, rel=1e-6)
    assert halved.tangent_n_per_m == pytest.approx(whole.tangent_n_per_m, rel=1e-4)
    assert not mirrors(static_table(GEARS, replace(MESH, lead=Lead(error_um=1.0))))
    assert not mirrors(static_table(GEARS, replace(MESH, cracks_1=(RootCrack(3.0, 45.0, 0, 8.0),))))
    assert mirror_groups(4).sum(axis=0).tolist() == [2.0, 2.0]


def test_bad_torques_and_gears_are_refused():
    with pytest.raises(InputError, match="ascend"):
        mesh_maps(GEARS, MESH, np.array([100.0, 50.0]))
    other = GearMesh(PairGeometry(GearGeometry(49, 3.0), GEARS[1].blank.geometry))
    with pytest.raises(InputError, match="driver's reduced gear"):
        mesh_maps(GEARS, other, TORQUES)
