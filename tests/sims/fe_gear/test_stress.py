"""Stress under a tooth load, fields of modes, files for other programs."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from gearsig.errors import InputError
from sims.fe_gear import (
    GearBlank,
    MeshSize,
    cyclic_modes,
    face_view,
    load_tooth,
    mesh_quality,
    mode_field,
    sector_mesh,
    von_mises_pa,
    write_vtk,
)
from sims.mesh import GearGeometry
from tests.sims.fe_gear.fe_gears import COARSE, SMALL, full_matrices, small_cyclic, small_reduced


def test_uniaxial_tension_has_its_own_stress() -> None:
    """Stretched along x, free across: σ = E ε everywhere."""
    mesh, e, nu = small_cyclic().mesh, SMALL.material.youngs_modulus_pa, SMALL.material.poisson_ratio
    moved = 1e-4 * mesh.points_m * np.array([1.0, -nu, -nu])
    np.testing.assert_allclose(von_mises_pa(mesh, moved), 1e-4 * e, rtol=1e-9)
    sheared = 1e-4 * mesh.points_m[:, [1, 0, 2]] * np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(von_mises_pa(mesh, sheared), np.sqrt(3.0) * 1e-4 * e / (2 * (1 + nu)), rtol=1e-9)


def test_a_loaded_tooth_moves_as_the_reduced_gear_says() -> None:
    grid = small_reduced().grid
    load = load_tooth(small_cyclic().mesh, 500.0, float(grid.roll_rad[2]), spread="section")
    matrix = small_reduced().compliance_m_per_n([0], "bore_clamped").reshape(2, 4, 3, 2, 4, 3)
    assert load.push_m == pytest.approx(500.0 * matrix[0, 2, :, 0, 2, :].mean(), rel=1e-9)
    assert np.abs(load.displacement_m[6]).max() < 0.1 * np.abs(load.displacement_m[0]).max()
    other = load_tooth(small_cyclic().mesh, 500.0, float(grid.roll_rad[2]), flank=1, spread="section")
    mirrored = other.displacement_m[0][:, 1]
    assert mirrored.mean() == pytest.approx(-load.displacement_m[0][:, 1].mean(), rel=1e-6)


@pytest.mark.slow
def test_root_stress_is_that_of_a_loaded_cantilever_with_a_notch() -> None:
    """Highest stress in the fillet: bending by a force at mid-flank times 1 to 2.5 for the notch, and it converges."""
    blank = GearBlank(GearGeometry(24, 3.0, face_width_mm=10.0, bore_radius_mm=12.0))
    g, peaks = blank.geometry, []
    for n in (8, 12):
        mesh = sector_mesh(blank, MeshSize(4, 2, n, 2, 2, 1))
        load = load_tooth(mesh, 1000.0)
        low = np.unique(mesh.tooth[: 2 * n // 2, [0, -1]])
        peaks.append(load.von_mises_pa()[low].max())
    root = mesh.points_m[mesh.tooth[0, -1, 0]] * 1e3
    roll = load.roll_rad
    angle = roll - g.base_half_angle_rad
    arm = g.base_radius_mm / np.cos(angle) - root[0]
    nominal = 6.0 * 1000.0 * np.cos(angle) * arm / (10.0 * (2.0 * root[1]) ** 2) * 1e6
    assert 1.0 < peaks[-1] / nominal < 2.5
    assert peaks[0] == pytest.approx(peaks[1], rel=0.05)


def test_wrong_loads_are_refused() -> None:
    mesh = small_cyclic().mesh
    with pytest.raises(InputError, match="force_n is -1 N"):
        load_tooth(mesh, -1.0)
    with pytest.raises(InputError, match="roll_rad is 3 rad"):
        load_tooth(mesh, 1.0, 3.0)


def test_a_field_is_the_mode_of_the_whole_gear() -> None:
    gear = small_cyclic()
    modes = cyclic_modes(gear, 4, elastic=True)
    stiffness, _ = full_matrices(gear)
    square = (2 * np.pi * modes.frequencies_hz[0]) ** 2
    for sine in (False, True):
        field = mode_field(gear, modes, 0, sine=sine)
        turned = []
        for k in range(12):
            own = field[k][gear.own_nodes]
            angle = gear.mesh.angles_rad[gear.own_nodes]
            c, s = np.cos(angle), np.sin(angle)
            turned.append(np.column_stack((c * own[:, 0] + s * own[:, 1], -s * own[:, 0] + c * own[:, 1], own[:, 2])))
        vector = np.array(turned).ravel()
        assert vector @ (stiffness @ vector) == pytest.approx(square, rel=1e-8)
    with pytest.raises(InputError, match="which is 99"):
        mode_field(gear, modes, 99)


def test_a_whole_gear_is_written_as_cells_of_its_volume(tmp_path: Path) -> None:
    mesh = small_cyclic().mesh
    load = load_tooth(mesh, 100.0)
    stress = np.array([load.von_mises_pa(k) for k in range(12)])
    path = write_vtk(tmp_path / "gear.vtu", mesh, {"displacement_m": load.displacement_m, "von_mises_pa": stress})
    read = meshio.read(path)
    (cells,) = read.cells
    assert cells.type == "hexahedron27"
    assert len(cells.data) == 12 * len(mesh.cells)
    assert len(read.points) == 12 * (mesh.n_nodes - len(mesh.high_side))
    corners = read.points[cells.data[:, :8]]
    edges = corners[:, [1, 3, 4]] - corners[:, :1]
    assert np.all(np.linalg.det(edges) > 0.0)  # VTK's order of corners
    middles = read.points[cells.data[:, 26]]
    assert np.linalg.norm(middles - corners.mean(axis=1), axis=1).max() < 1e-3
    first_edge = read.points[cells.data[:, 8]]
    assert np.linalg.norm(first_edge - corners[:, :2].mean(axis=1), axis=1).max() < 5e-4
    assert read.point_data["von_mises_pa"].max() == pytest.approx(stress.max())
    moved = np.linalg.norm(read.point_data["displacement_m"], axis=1).max()
    assert moved == pytest.approx(np.linalg.norm(load.displacement_m, axis=2).max())


def test_the_view_along_the_shaft_shows_every_cell_once() -> None:
    mesh = small_cyclic().mesh
    view = face_view(mesh)
    corners = view.points_mm[view.triangles]
    (x1, y1), (x2, y2) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    area = 0.5 * (x1 * y2 - x2 * y1)
    assert np.all(area > 0.0)
    volume = mesh_quality(mesh).volume_m3 * 1e9
    assert area.sum() * SMALL.geometry.face_width_mm == pytest.approx(volume, rel=0.01)
    assert len(view.outlines_mm) == 12 * len(mesh.cells)
    web = sector_mesh(replace(SMALL, web_thickness_mm=4.0, rim_thickness_mm=3.0, hub_thickness_mm=3.0), COARSE)
    stepped = face_view(web, (0,))
    assert len(stepped.cells) < len(web.cells)
    walls = stepped.triangles[: len(stepped.triangles) - 8 * len(stepped.cells)]
    assert len(walls) > 0  # where the web meets rim and hub: of no area, between faces one behind the other
    x, y = stepped.points_mm[walls].transpose(2, 0, 1)
    twice = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    np.testing.assert_allclose(twice, 0.0, atol=1e-9)
    behind = web.points_m[stepped.nodes[walls], 2]
    assert np.all(np.ptp(behind, axis=1) == pytest.approx(0.5 * (SMALL.geometry.face_width_mm - 4.0) * 1e-3))


def test_files_that_cannot_be_are_refused(tmp_path: Path) -> None:
    mesh = small_cyclic().mesh
    with pytest.raises(InputError, match=r"extension '\.stl'"):
        write_vtk(tmp_path / "gear.stl", mesh)
    with pytest.raises(InputError, match="stress has shape"):
        write_vtk(tmp_path / "gear.vtu", mesh, {"stress": np.zeros((12, 3))})
