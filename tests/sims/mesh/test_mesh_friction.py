"""Friction over the mesh, stiffness of the back flanks, tables that are at hand."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.mesh import (
    FlankDeviation,
    Material,
    RootCrack,
    ToothChip,
    ToothSpall,
    back_stiffness_n_per_m,
    contact_friction_n,
    friction_over_mesh,
    mesh_stiffness,
    mesh_table,
    oil_terms,
    reduced_modulus_pa,
    share_torque,
)
from tests.sims.mesh.meshes import MESH, PAIR, PITCH_POINT

OIL = (17.6, 0.45)


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
    found = friction_over_mesh(MESH, 110.0, 500.0, *OIL, cycles)
    modulus = reduced_modulus_pa(Material(), Material())
    terms = oil_terms(*OIL)
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
    found = friction_over_mesh(MESH, 110.0, 500.0, *OIL, around)
    assert found.friction_n[0, 0] > 0 > found.friction_n[2, 0]
    assert found.coefficient[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert np.all(found.friction_n * found.sliding_mps >= 0.0)
    assert np.all(found.coefficient[found.normal_n == 0.0] == 0.0)


def test_friction_follows_the_load_of_a_chipped_tooth() -> None:
    chipped = replace(MESH, chips_1=(ToothChip(1.0),))
    found = friction_over_mesh(chipped, 110.0, 500.0, *OIL, np.array([1.6]))
    assert found.friction_n[0, 1] == 0.0
    assert found.friction_n[0, 0] != 0.0
    for speed in (0.0, -5.0):
        with pytest.raises(InputError, match="speed_rpm"):
            friction_over_mesh(MESH, 110.0, speed, *OIL)


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
    stiff, shared = mesh_stiffness(mesh, cycles), share_torque(mesh, 50.0, cycles)
    rubbed = friction_over_mesh(mesh, 50.0, 500.0, *OIL, cycles)
    table = mesh_table(mesh)
    healthy = replace(mesh, cracks_1=())
    np.testing.assert_array_equal(mesh_stiffness(healthy, cycles, table=table).total_n_per_m, stiff.total_n_per_m)
    again = share_torque(healthy, 50.0, cycles, table=table)
    np.testing.assert_array_equal(again.pair_forces_n, shared.pair_forces_n)
    found = friction_over_mesh(healthy, 50.0, 500.0, *OIL, cycles, table=table)
    np.testing.assert_array_equal(found.friction_n, rubbed.friction_n)
    assert np.any(mesh_stiffness(healthy, cycles).total_n_per_m != stiff.total_n_per_m)
