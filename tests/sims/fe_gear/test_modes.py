"""Modes by cyclic symmetry against the whole gear, scaling laws, and published frequencies."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.fe_gear import (
    CyclicGear,
    CyclicModes,
    GearBlank,
    cyclic_modes,
    mesh_quality,
    mesh_size_for,
    mode_field,
    modes_of_diameter,
    sector_mesh,
)
from sims.mesh import Material
from tests.marks import further
from tests.sims.fe_gear.fe_gears import COARSE, PAPER, SMALL, full_matrices, full_modes, small_cyclic


def repeated(modes: CyclicModes, n_sectors: int) -> FloatArray:
    return np.repeat(modes.frequencies_hz, modes.multiplicity(n_sectors))


def test_cyclic_symmetry_equals_the_whole_gear() -> None:
    gear = small_cyclic()
    cyclic = repeated(cyclic_modes(gear, 26), 12)[:26]
    whole, _ = full_modes(gear, 26)
    assert cyclic[:6].max() < 0.1
    assert whole[:6].max() < 0.1
    np.testing.assert_allclose(cyclic[6:], whole[6:], rtol=1e-9)


def test_the_clamped_gear_equals_the_whole_one() -> None:
    from scipy.sparse.linalg import eigsh

    gear = small_cyclic()
    stiffness, mass = full_matrices(gear)
    n_own = stiffness.shape[0] // 12
    held = (np.arange(12)[:, None] * n_own + gear.bore_dof).ravel()
    kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    inner_k, inner_m = (matrix.tocsr()[kept][:, kept].tocsc() for matrix in (stiffness, mass))
    values = eigsh(inner_k, 9, M=inner_m, sigma=0.0)[0]
    cyclic = repeated(cyclic_modes(gear, 9, "bore"), 12)[:9]
    np.testing.assert_allclose(cyclic, np.sqrt(values) / (2 * np.pi), rtol=1e-9)


def test_shapes_are_modes_of_the_whole_gear_with_unit_mass() -> None:
    gear = small_cyclic()
    stiffness, mass = full_matrices(gear)
    modes = cyclic_modes(gear, 16, elastic=True)
    columns, squares = [], []
    for k, n in enumerate(modes.nodal_diameters):
        waves = np.exp(1j * gear.phase_rad(int(n)) * np.arange(12))[:, None] * modes.shapes[:, k]
        for part in (waves.real, waves.imag)[: int(modes.multiplicity(12)[k])]:
            columns.append(part.ravel())
            squares.append((2 * np.pi * modes.frequencies_hz[k]) ** 2)
    vectors = np.column_stack(columns)
    np.testing.assert_allclose(vectors.T @ (mass @ vectors), np.eye(len(squares)), atol=1e-9)
    np.testing.assert_allclose(vectors.T @ (stiffness @ vectors) / squares, np.eye(len(squares)), atol=1e-8)


def test_rigid_motions_keep_a_gear_rigid() -> None:
    modes = cyclic_modes(small_cyclic(), 6)
    for k, n in enumerate(modes.nodal_diameters):
        for sine in (False, True)[: 1 + int(n > 0)]:
            field = mode_field(small_cyclic(), modes, k, sine=sine)[0]
            at = small_cyclic().mesh.points_m
            rows = [np.column_stack((np.tile(e, (len(at), 1)), np.cross(e, at))) for e in np.eye(3)]
            basis = np.column_stack([r[:, :3].ravel() for r in rows] + [r[:, 3:].ravel() for r in rows])
            _, rest, *_ = np.linalg.lstsq(basis, field.ravel(), rcond=None)
            assert rest[0] < 1e-9 * np.sum(field**2)


def test_springs_at_the_hub_carry_the_gear_as_a_rigid_body() -> None:
    """Soft springs: six frequencies √(k/m), √(k/J) of a rigid gear."""
    mesh = sector_mesh(SMALL, COARSE)
    springs = np.array([2e5, 2e5, 1e5, 10.0, 10.0, 20.0])
    mounted = repeated(cyclic_modes(CyclicGear(mesh, springs), 6), 12)
    q = mesh_quality(mesh)
    masses = np.array([q.mass_kg] * 3 + [q.diametral_inertia_kg_m2] * 2 + [q.polar_inertia_kg_m2])
    np.testing.assert_allclose(mounted, np.sort(np.sqrt(springs / masses)) / (2 * np.pi), rtol=2e-4)


@pytest.mark.parametrize("springs", [[1e8] * 5, [1e8, 2e8, 1e8, 1e4, 1e4, 1e4], [1e8, 1e8, 0.0, 1e4, 1e4, 1e4]])
def test_springs_that_are_not_alike_all_round_are_refused(springs: list[float]) -> None:
    with pytest.raises(InputError, match="hub_stiffness is"):
        CyclicGear(small_cyclic().mesh, np.array(springs))


def test_stiffer_springs_approach_the_clamped_hub() -> None:
    mesh = sector_mesh(SMALL, COARSE)
    soft, stiff = (
        modes_of_diameter(CyclicGear(mesh, k * np.array([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4])), 0, 1)[0][0]
        for k in (1e7, 1e9)
    )
    clamped = modes_of_diameter(CyclicGear(mesh), 0, 1, "bore")[0][0]
    assert soft < stiff < clamped


def test_frequencies_scale_with_size_and_material() -> None:
    """All lengths doubled halve every frequency; E fourfold doubles them."""
    gear = small_cyclic()
    base = cyclic_modes(gear, 6, elastic=True).frequencies_hz
    g = SMALL.geometry
    double = replace(SMALL, geometry=replace(g, module_mm=2 * g.module_mm, face_width_mm=24.0, bore_radius_mm=12.0))
    stiff = replace(SMALL, material=Material(youngs_modulus_gpa=4 * 206.0))
    for blank, factor in ((double, 0.5), (stiff, 2.0)):
        found = cyclic_modes(CyclicGear(sector_mesh(blank, COARSE)), 6, elastic=True).frequencies_hz
        np.testing.assert_allclose(found, factor * base, rtol=1e-7)


PUBLISHED_HZ = (3910.1, 6616.2, 8915.0, 11038.1, 12641.4)
PUBLISHED_DIAMETERS = [2, 0, 3, 2, 1]
"""50 teeth, module 3, of a mesh with 277 200 degrees of freedom; its inertia tells 7800 kg/m³, its E is not known."""


@pytest.mark.parametrize("n_dof", [70_000, further(277_200)])
def test_frequencies_of_the_paper_gear(n_dof: int) -> None:
    blank = replace(PAPER, material=Material(density_kg_m3=7800.0))
    modes = cyclic_modes(CyclicGear(sector_mesh(blank, mesh_size_for(blank, n_dof))), 9, elastic=True)
    assert modes.nodal_diameters.tolist() == PUBLISHED_DIAMETERS
    np.testing.assert_allclose(modes.frequencies_hz, PUBLISHED_HZ, rtol=0.013 if n_dof > 200_000 else 0.02)


@pytest.mark.slow
def test_the_first_frequency_converges() -> None:
    found = [
        modes_of_diameter(CyclicGear(sector_mesh(PAPER, mesh_size_for(PAPER, n))), 2, 1)[0][0]
        for n in (144_000, 277_200, 518_000)
    ]
    assert found[0] > found[1] > found[2]
    assert found[0] / found[2] - 1 < 0.003


@pytest.mark.slow
def test_a_web_brings_a_mode_into_the_range_of_mesh_frequencies() -> None:
    """A 12 mm web instead of the full disc gave 2658 Hz (2)."""
    blank = GearBlank(PAPER.geometry, web_thickness_mm=12.0, material=Material(density_kg_m3=7800.0))
    found = modes_of_diameter(CyclicGear(sector_mesh(blank, mesh_size_for(blank, 277_200))), 2, 1)[0][0]
    assert 2400.0 < found < 3200.0
