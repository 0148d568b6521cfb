"""Friction of a contact and of the mesh."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    MAX_FRICTION,
    FlankDeviation,
    Material,
    RootCrack,
    ToothChip,
    ToothSpall,
    back_stiffness_n_per_m,
    contact_friction_n,
    friction_coefficient,
    friction_over_mesh,
    line_contact_pressure_gpa,
    mesh_stiffness,
    mesh_table,
    oil_terms,
    reduced_modulus_pa,
    share_torque,
)
from tests.sims.mesh.meshes import MESH, PAIR, PITCH_POINT

STEEL_PA = reduced_modulus_pa(Material(), Material())
OIL = {"viscosity_cp": 10.0, "roughness_um": 0.4}

ratios = st.floats(1e-6, 2.0)
pressures = st.floats(0.05, 3.0)
speeds = st.floats(0.01, 50.0)
radii = st.floats(1e-3, 0.2)
oils = st.floats(1.0, 300.0)
roughnesses = st.floats(0.0, 3.0)


def plain(sr, p, nu, s, v, r):
    return float(
        friction_coefficient(sr, p, viscosity_cp=nu, roughness_um=s, entrainment_mps=v, radius_m=r).coefficient
    )


def test_check_value_of_the_regression():
    found = friction_coefficient(0.3, 1.0, entrainment_mps=10.0, radius_m=0.01, **OIL)
    assert found.coefficient == pytest.approx(0.0190746, abs=5e-8)
    assert found.notes == ()


def mesh_55_75(n_points=2001):
    """Contact from root to tip of a 55/75 pair, module 2, at 500 rpm and 110 N m; load halved in double contact."""
    alpha, module = np.radians(20.0), 2e-3
    r1, r2 = 0.5 * module * 55, 0.5 * module * 75
    rb1, rb2 = r1 * np.cos(alpha), r2 * np.cos(alpha)
    line = (r1 + r2) * np.sin(alpha)
    start = line - np.sqrt((r2 + module) ** 2 - rb2**2)
    end = np.sqrt((r1 + module) ** 2 - rb1**2)
    rho1 = np.linspace(start, end, n_points)
    rho2, pitch = line - rho1, np.pi * module * np.cos(alpha)
    u1 = 500 * 2 * np.pi / 60 * rho1
    u2 = 500 * 2 * np.pi / 60 * 55 / 75 * rho2
    single = (rho1 > end - pitch) & (rho1 < start + pitch)
    load = 110 / rb1 * np.where(single, 1.0, 0.5)
    return load, u1, u2, rho1 * rho2 / line


@pytest.mark.parametrize(("roughness", "maximum"), [(0.0, 0.022), (0.45, 0.031), (0.84, 0.050), (1.40, 0.147)])
def test_maxima_over_the_mesh_at_four_roughnesses(roughness, maximum):
    load, u1, u2, radius = mesh_55_75()
    v = 0.5 * (u1 + u2)
    found = friction_coefficient(
        np.abs(u1 - u2) / v,
        line_contact_pressure_gpa(load, 0.02, radius, STEEL_PA),
        viscosity_cp=17.6,
        roughness_um=roughness,
        entrainment_mps=v,
        radius_m=radius,
    )
    assert found.coefficient.max() == pytest.approx(maximum, rel=0.02)
    assert any("roughness_um" in note for note in found.notes) == (roughness > 0.6)


@settings(deadline=None)  # kernels compile in the first example
@given(ratios, pressures, oils, roughnesses, speeds, radii)
def test_kernel_agrees_with_the_formula(sr, p, nu, s, v, r):
    """A vibration that is far faster than any sliding takes the smoothed sign out: what is left is μ N."""
    load = np.pi * 0.02 * r * (1e9 * p) ** 2 / STEEL_PA
    force = contact_friction_n(
        load, v * (1 - sr / 2), v * (1 + sr / 2), 1e6, r, 0.02, STEEL_PA, *oil_terms(nu, s), 1e-3
    )
    assert force / load == pytest.approx(plain(sr, p, nu, s, v, r), rel=1e-9)
    assert 0.0 < force / load <= MAX_FRICTION


@settings(deadline=None)  # kernels compile in the first example
@given(st.floats(0.4, 1.4), ratios)
def test_powers_of_speed_and_radius_stand_alone(p, sr):
    """Below the cap μ goes as V^b6 and R^b8."""
    base, faster, wider = (plain(sr, p, 20.0, 0.2, v, r) for v, r in ((2.0, 0.01), (8.0, 0.01), (2.0, 0.02)))
    assert faster / base == pytest.approx(4.0**-0.100601, rel=1e-12)
    assert wider / base == pytest.approx(2.0**-0.390958, rel=1e-12)


def test_cap_holds_and_is_told():
    found = friction_coefficient(0.5, 1.0, viscosity_cp=20.0, roughness_um=2.5, entrainment_mps=1.0, radius_m=0.01)
    assert found.coefficient == MAX_FRICTION
    assert "0.6" in found.notes[0]
    rough = friction_coefficient(0.5, 1.0, viscosity_cp=20.0, roughness_um=900.0, entrainment_mps=1.0, radius_m=0.01)
    assert rough.coefficient == MAX_FRICTION


def test_smooth_flanks_still_rub_but_rolling_and_unloaded_ones_do_not():
    assert plain(0.3, 1.0, 10.0, 0.0, 10.0, 0.01) > 0.01
    assert plain(0.0, 1.0, 10.0, 0.4, 10.0, 0.01) == 0.0
    assert plain(0.3, 0.0, 10.0, 0.4, 10.0, 0.01) == 0.0
    where = (0.01, 0.02, STEEL_PA, *oil_terms(10.0, 0.4), 1e-4)
    assert contact_friction_n(1e3, 10.0, 10.0, 1.0, *where) == 0.0
    assert contact_friction_n(0.0, 9.0, 10.0, 1.0, *where) == 0.0


@settings(deadline=None)  # kernels compile in the first example
@given(*[st.floats(-5.0, 5.0)] * 2, st.floats(-1.0, 1.0), st.floats(-100.0, 1e5), st.floats(0.0, 0.6))
def test_friction_takes_energy_out_at_any_motion(u1, u2, vibration, normal, dry):
    """The force on body 1 is -f, on body 2 +f: their power is -f v_s, never above zero."""
    terms = oil_terms(17.6, 0.45)
    f = contact_friction_n(normal, u1, u2, vibration, 0.01, 0.02, STEEL_PA, *terms, 1e-3, 1.0, dry)
    sliding = u2 - u1 + vibration
    assert -f * sliding <= 0.0
    assert abs(f) <= (MAX_FRICTION + dry) * max(normal, 0.0)


def test_dry_friction_is_the_same_at_every_sliding_speed():
    terms = oil_terms(17.6, 0.45)
    slow, fast = (
        contact_friction_n(1e3, u, 3.0, 0.0, 0.01, 0.02, STEEL_PA, *terms, 1e-4, 0.0, 0.2) for u in (2.9, 0.5)
    )
    assert slow == pytest.approx(200.0, rel=1e-5)
    assert fast == pytest.approx(200.0, rel=1e-5)


def test_force_is_positive_in_approach_and_turns_at_the_pitch_point():
    load, u1, u2, radius = mesh_55_75(401)
    terms = oil_terms(17.6, 0.45)
    force = np.array(
        [
            contact_friction_n(n, a, b, 0.0, r, 0.02, STEEL_PA, *terms, 1e-4)
            for n, a, b, r in zip(load, u1, u2, radius, strict=True)
        ]
    )
    assert (np.sign(force) == np.sign(u2 - u1)).all()
    assert force[0] > 0 > force[-1]
    # The plain formula with the same load and speeds.
    i = 20
    v = 0.5 * (u1[i] + u2[i])
    mu = plain(
        (u2[i] - u1[i]) / v,
        float(line_contact_pressure_gpa(load[i], 0.02, radius[i], STEEL_PA)),
        17.6,
        0.45,
        v,
        radius[i],
    )
    assert force[i] == pytest.approx(mu * load[i] * (u2[i] - u1[i]) / np.hypot(u2[i] - u1[i], 1e-4), rel=1e-10)


def test_hertz_pressure_of_steel_cylinders():
    # p = 0.418 √(F E/(b R)) is the form for equal bodies with ν = 0.3 found in design books.
    expected = 0.418 * np.sqrt(2128.0 * 206e9 / (0.02 * 0.011)) * 1e-9
    found = float(line_contact_pressure_gpa(2128.0, 0.02, 0.011, STEEL_PA))
    assert found == pytest.approx(expected, rel=1e-3)
    assert line_contact_pressure_gpa(-5.0, 0.02, 0.011, STEEL_PA) == 0.0


@settings(deadline=None)  # kernels compile in the first example
@given(st.floats(-10, 10), st.floats(1e-6, 1.0))
def test_smooth_sign_is_odd_bounded_and_steepest_at_rest(v, threshold):
    def sign(sliding):  # of dry friction, μ = 1, under a load of 1 N
        return contact_friction_n(1.0, 0.0, 0.0, sliding, 0.01, 0.02, STEEL_PA, 1.0, 0.0, threshold, 0.0, 1.0)

    s = sign(v)
    assert s == -sign(-v)
    assert abs(s) <= min(1.0, abs(v) / threshold)
    assert s == pytest.approx(v / np.hypot(v, threshold), rel=1e-12, abs=1e-300)


@pytest.mark.parametrize(
    ("change", "name"),
    [({"radius_m": 0.0}, "radius_m"), ({"entrainment_mps": -1.0}, "entrainment_mps"), ({"viscosity_cp": 0}, "visc")],
)
def test_values_without_meaning_are_refused(change, name):
    good = {"viscosity_cp": 10.0, "roughness_um": 0.4, "entrainment_mps": 1.0, "radius_m": 0.01}
    with pytest.raises(InputError, match=name):
        friction_coefficient(0.3, 1.0, **(good | change))


# Friction over the mesh, stiffness of the back flanks, tables that are at hand.

THIN_OIL = (17.6, 0.45)


@pytest.mark.parametrize(("roughness", "maximum"), [(0.0, 0.022), (0.45, 0.031), (0.84, 0.050), (1.40, 0.147)])
def test_maxima_with_the_computed_load_sharing(roughness: float, maximum: float) -> None:
    """The published maxima halve the load in double contact; a pair that enters at its soft end carries less than half.

    That lowers them by 3 to 4 %.
    """
    found = friction_over_mesh(MESH, 110.0, 500.0, 17.6, roughness)
    assert found.coefficient.max() == pytest.approx(maximum, rel=0.05)
    assert any("roughness_um" in note for note in found.notes) == (roughness > 0.6)
    assert not any("pressure" in note for note in found.notes)


def test_each_pair_as_the_compiled_friction_has_it() -> None:
    cycles = np.linspace(0.0, 3.0, 61)
    found = friction_over_mesh(MESH, 110.0, 500.0, *THIN_OIL, cycles)
    modulus = reduced_modulus_pa(Material(), Material())
    terms = oil_terms(*THIN_OIL)
    omega = 500.0 * np.pi / 30.0
    for row, c in enumerate(cycles):
        for j in range(MESH.n_slots):
            k = int(np.floor(c + MESH.ramp / 2)) - j
            rho_1, rho_2 = (float(r) * 1e-3 for r in PAIR.contact_radii_mm(c, k))
            u_1, u_2 = omega * rho_1, omega * 55 / 75 * rho_2
            radius = rho_1 * rho_2 / (rho_1 + rho_2)
            force = contact_friction_n(found.normal_n[row, j], u_1, u_2, 0.0, radius, 0.02, modulus, *terms, 1e-12)
            assert found.friction_n[row, j] == pytest.approx(force, rel=1e-9, abs=1e-9)
            assert found.sliding_mps[row, j] == pytest.approx(float(PAIR.sliding_speed_m_s(c, 500.0, k)), abs=1e-12)


def test_friction_pushes_in_approach_and_pulls_in_recess() -> None:
    around = PITCH_POINT + np.array([-0.02, 0.0, 0.02])
    found = friction_over_mesh(MESH, 110.0, 500.0, *THIN_OIL, around)
    assert found.friction_n[0, 0] > 0 > found.friction_n[2, 0]
    assert found.coefficient[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.all(found.friction_n * found.sliding_mps >= 0.0)
    assert np.all(found.coefficient[found.normal_n == 0.0] == 0.0)


def test_friction_follows_the_load_of_a_chipped_tooth() -> None:
    chipped = replace(MESH, chips_1=(ToothChip(1.0),))
    found = friction_over_mesh(chipped, 110.0, 500.0, *THIN_OIL, np.array([1.6]))
    assert found.friction_n[0, 1] == 0.0
    assert found.friction_n[0, 0] != 0.0
    for speed in (0.0, -5.0):
        with pytest.raises(InputError, match="speed_rpm"):
            friction_over_mesh(MESH, 110.0, speed, *THIN_OIL)


def test_back_flanks_are_healthy_whatever_ails_the_drive_flanks() -> None:
    """Mean of the healthy mesh by the linear law: 3.79e8 N/m of the trial program."""
    assert back_stiffness_n_per_m(MESH) == pytest.approx(mesh_stiffness(MESH).mean_n_per_m, rel=1e-12)
    assert back_stiffness_n_per_m(MESH) == pytest.approx(3.79e8, rel=0.015)
    ailing = replace(
        MESH,
        contact_law="load-dependent",
        cracks_1=(RootCrack(4.0),),
        spalls_2=(ToothSpall(1.0, 10.0),),
        chips_1=(ToothChip(1.0, 5.0, tooth=2),),
        flank_1=FlankDeviation(30.0, 2.0, wear_um=20.0),
    )
    assert back_stiffness_n_per_m(ailing) == pytest.approx(back_stiffness_n_per_m(MESH), rel=1e-12)


def test_a_table_at_hand_is_read() -> None:
    """Given the table of the cracked mesh, the healthy one yields as the cracked: nothing else of it is asked."""
    mesh = replace(MESH, cracks_1=(RootCrack(2.0),), flank_1=FlankDeviation(10.0, 2.0))
    cycles = np.linspace(0.0, 2.0, 41)
    shared = share_torque(mesh, 50.0, cycles)
    table = mesh_table(mesh)
    healthy = replace(mesh, cracks_1=())
    again = share_torque(healthy, 50.0, cycles, table=table)
    np.testing.assert_array_equal(again.pair_forces_n, shared.pair_forces_n)
    assert np.any(share_torque(healthy, 50.0, cycles).pair_forces_n != shared.pair_forces_n)
