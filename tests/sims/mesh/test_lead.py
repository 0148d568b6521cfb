"""Helical, crowned and misaligned flanks: slices against closed forms of ISO 6336-1 and the spur pair."""

from dataclasses import replace
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.mesh import (
    GearGeometry,
    GearMesh,
    Lead,
    PairGeometry,
    mesh_stiffness,
    normal_section,
    one_mesh_cycle,
    share_torque,
    transverse_section,
)

CYCLES = one_mesh_cycle(40)


def helical(
    helix_angle_deg: float, *, width_mm: float = 20.0, teeth: tuple[int, int] = (29, 47), n: int = 16
) -> GearMesh:
    gears = [transverse_section(z, 3.0, 20.0, helix_angle_deg, face_width_mm=width_mm) for z in teeth]
    return GearMesh(PairGeometry(*gears), lead=Lead(helix_angle_deg, n_slices=n))


def standard_stiffness(pair: PairGeometry, helix_angle_deg: float = 0.0) -> tuple[float, float]:
    """c′ and c_γα of a pair of solid steel gears by method B of ISO 6336-1, at 100 N/mm or more; N/(mm µm).

    c′ = 0.8 C_B cos β/q′,  c_γα = c′ (0.75 ε_α + 0.25),
    q′ = 0.04723 + 0.15551/z_n1 + 0.25791/z_n2 − 0.00635 x1 − 0.11654 x1/z_n1 − 0.00193 x2 − 0.24188 x2/z_n2
    + 0.00529 x1² + 0.00182 x2²,  C_B = [1 + 0.5 (1.2 − h_fP/m_n)] [1 − 0.02 (20° − α_n)]

    Source: ISO 6336-1:2006, *Calculation of load capacity of spur and helical gears – Basic principles*, clause 9.3.
    """
    beta = radians(helix_angle_deg)
    gear_1, gear_2 = sorted((pair.driver, pair.driven), key=lambda gear: gear.teeth)
    z1, z2 = (gear.teeth / cos(beta) ** 3 for gear in (gear_1, gear_2))
    x1, x2 = (gear.profile_shift / cos(beta) for gear in (gear_1, gear_2))
    q = 0.04723 + 0.15551 / z1 + 0.25791 / z2 - 0.00635 * x1 - 0.11654 * x1 / z1 - 0.00193 * x2
    q += -0.24188 * x2 / z2 + 0.00529 * x1**2 + 0.00182 * x2**2
    normal = normal_section(gear_1, helix_angle_deg)
    rack = (1.0 + 0.5 * (1.2 - normal.dedendum)) * (1.0 - 0.02 * (20.0 - normal.pressure_angle_deg))
    single = 0.8 * rack * cos(beta) / q
    return single, single * (0.75 * pair.contact_ratio + 0.25)


def test_the_spur_pair_is_the_limit_of_no_helix() -> None:
    spur = mesh_stiffness(GearMesh(helical(0.0).pair), CYCLES).total_n_per_m
    assert mesh_stiffness(helical(0.0), CYCLES).total_n_per_m == pytest.approx(spur, rel=1e-12)
    assert mesh_stiffness(helical(1e-7), CYCLES).total_n_per_m == pytest.approx(spur, rel=1e-6)


def test_sections_of_a_helical_gear_are_those_of_the_standard() -> None:
    """ISO 21771: m_t = m_n/cos β, tan α_t = tan α_n/cos β, z_n = z/(cos² β_b cos β); and back to the rack."""
    gear = transverse_section(40, 3.0, 20.0, 25.0, profile_shift=0.2)
    assert gear.pitch_radius_mm == pytest.approx(40 * 3.0 / cos(radians(25.0)) / 2.0)
    assert tan(gear.pressure_angle_rad) == pytest.approx(tan(radians(20.0)) / cos(radians(25.0)))
    assert gear.tip_radius_mm - gear.pitch_radius_mm == pytest.approx(3.0 * 1.2)
    virtual = normal_section(gear, 25.0)
    assert (virtual.module_mm, virtual.pressure_angle_deg) == pytest.approx((3.0, 20.0))
    assert (virtual.addendum, virtual.dedendum, virtual.profile_shift) == pytest.approx((1.0, 1.25, 0.2))
    base = np.arcsin(sin(radians(25.0)) * cos(radians(20.0)))  # sin β_b = sin β cos α_n
    assert virtual.teeth == pytest.approx(40 / (cos(base) ** 2 * cos(radians(25.0))))


@pytest.mark.parametrize("beta", [0.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("teeth", [(29, 47), (20, 60)])
def test_stiffness_of_teeth_and_mesh_is_near_that_of_the_standard(beta: float, teeth: tuple[int, int]) -> None:
    """c′ within 7 %, c_γα within 10 % of method B of ISO 6336-1, spur to 30°; with the constant contact stiffness."""
    mesh = helical(beta, teeth=teeth)
    progress = np.linspace(0.0, mesh.pair.contact_ratio, 41)
    whole = mesh.gear_compliance(1, progress) + mesh.gear_compliance(2, progress) + mesh.contact_compliance
    per_width = 1e-9 / mesh.face_width_m
    single, mean = standard_stiffness(mesh.pair, beta)
    assert per_width / whole.min() == pytest.approx(single, rel=0.07)
    assert per_width * mesh_stiffness(mesh).mean_n_per_m == pytest.approx(mean, rel=0.10)


def test_published_stiffness_of_the_standard() -> None:
    """c′ = 14 and c_γ = 20 N/(mm µm) are what the standard takes of steel gears where nothing else is known.

    That is of a contact ratio of 1.57; these have 1.77.
    """
    single, mean = standard_stiffness(
        PairGeometry(GearGeometry(40, 3.0, dedendum=1.2), GearGeometry(80, 3.0, dedendum=1.2))
    )
    assert single == pytest.approx(14.0, rel=0.06)
    assert mean / single == pytest.approx(0.75 * 1.77 + 0.25, abs=0.01)


def test_ripple_vanishes_at_whole_overlap_ratios() -> None:
    """At ε_β = 1, 2 the contact lines have the same length at every angle: ∫ over one pitch of a periodic sum."""

    def ripple(overlap: float) -> float:
        mesh = helical(20.0, width_mm=overlap * pi * 3.0 / sin(radians(20.0)), n=64)
        assert mesh.overlap_ratio == pytest.approx(overlap)
        found = mesh_stiffness(mesh, CYCLES)
        return float(np.ptp(found.total_n_per_m) / found.mean_n_per_m)

    found = {overlap: ripple(overlap) for overlap in (0.25, 0.5, 0.75, 0.9, 1.0, 1.5, 2.0)}
    assert found[1.0] < 2e-3
    assert found[2.0] < 5e-3
    assert found[0.25] > found[0.5] > found[0.75] > found[0.9] > 10 * found[1.0]
    assert found[1.5] < 0.5 * found[0.5]


def test_axial_force_is_the_tangential_one_times_the_tangent_of_the_helix() -> None:
    mesh, torque = helical(18.0), 120.0
    tangential = torque / (mesh.pair.driver.pitch_radius_mm * 1e-3)
    along = share_torque(mesh, torque, CYCLES).pair_forces_n.sum(axis=1)
    assert along * mesh.axial_share == pytest.approx(tangential * tan(radians(18.0)), rel=1e-9)
    mirrored = replace(mesh, lead=replace(mesh.lead, helix_angle_deg=-18.0))
    assert mirrored.axial_share == -mesh.axial_share
    assert mesh_stiffness(mirrored, CYCLES).total_n_per_m == pytest.approx(mesh_stiffness(mesh, CYCLES).total_n_per_m)


def face_load_factor(shared):
    """Greatest over mean force of the slices at the angle where it is greatest, K_Hβ of ISO 6336-1 for spur gears."""
    along = shared.slice_forces_n.sum(axis=1)
    return float(np.max(along.max(axis=1) / along.mean(axis=1)))


@pytest.mark.parametrize("error_um", [5.0, 10.0, 18.0, -10.0])
def test_misaligned_flanks_carry_as_in_the_standard(error_um: float) -> None:
    """K_Hβ = 1 + F_β c_γ/(2 F_m/b) while all of the face carries; the outermost slice's middle is (1 − 1/n) of that."""
    n, force = 32, 2500.0
    base = GearMesh(helical(0.0).pair)
    mesh = replace(base, lead=Lead(error_um=error_um, n_slices=n))
    single = np.array([0.85])
    shared = share_torque(mesh, force * base.pair.driver.base_radius_mm * 1e-3, single)
    slope = abs(error_um) * 1e-6 * mesh_stiffness(base, single).total_n_per_m[0] / force
    assert slope < 2.0
    assert face_load_factor(shared) == pytest.approx(1.0 + 0.5 * slope * (1.0 - 1.0 / n), rel=1e-9)
    along = shared.slice_forces_n[0].sum(axis=0)
    assert np.all(np.diff(along) * np.sign(error_um) < 0.0)  # open towards the far end


def test_badly_misaligned_flanks_carry_over_part_of_the_face() -> None:
    """b_cal/b = √(2 F_m/b/(F_β c_γ)), K_Hβ = √(2 F_β c_γ/(F_m/b)), to the width of a slice."""
    n, force, error_um = 64, 2000.0, 60.0
    base = GearMesh(helical(0.0).pair)
    mesh = replace(base, lead=Lead(error_um=error_um, n_slices=n))
    single = np.array([0.85])
    shared = share_torque(mesh, force * base.pair.driver.base_radius_mm * 1e-3, single)
    ratio = error_um * 1e-6 * mesh_stiffness(base, single).total_n_per_m[0] / force
    carrying = np.count_nonzero(shared.slice_forces_n[0].sum(axis=0)) / n
    assert carrying == pytest.approx(sqrt(2.0 / ratio), abs=1.0 / n)
    assert face_load_factor(shared) == pytest.approx(sqrt(2.0 * ratio), rel=0.03)


def test_crowned_flanks_carry_as_a_parabola() -> None:
    """w(y) = c (δ − C 4y²/b²) over 2y₀, ∫w = F: y₀³ = 3 F b²/(16 c C) where the ends stay free."""
    n, force, crowning_um = 64, 800.0, 20.0
    base = GearMesh(helical(0.0).pair)
    mesh = replace(base, lead=Lead(crowning_um=crowning_um, n_slices=n))
    single = np.array([0.85])
    along = share_torque(mesh, force * base.pair.driver.base_radius_mm * 1e-3, single).slice_forces_n[0].sum(axis=0)
    per_width = mesh_stiffness(base, single).total_n_per_m[0] / 0.02
    half = (3.0 * force * 0.02**2 / (16.0 * per_width * crowning_um * 1e-6)) ** (1.0 / 3.0)
    assert half < 0.01
    assert np.count_nonzero(along) / n == pytest.approx(2.0 * half / 0.02, abs=1.5 / n)
    assert along.max() * n / 0.02 == pytest.approx(0.75 * force / half, rel=0.01)


def test_what_no_face_can_have_is_refused() -> None:
    for values in ({"helix_angle_deg": 60.0}, {"crowning_um": -1.0}, {"n_slices": 0}, {"n_slices": 1000}):
        with pytest.raises(InputError):
            Lead(**values)
