"""Blank and mesh: what is refused, the outline, mass properties, elements."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gearsig.errors import InputError
from sims.fe_gear import (
    READY,
    CyclicGear,
    GearBlank,
    MeshSize,
    check_memory,
    craig_bampton_bytes,
    cyclic_modes,
    cylindrical_turn,
    discretisation_error,
    load_tooth,
    mesh_quality,
    mesh_size_for,
    n_dof_of,
    outline_error_mm,
    sector_bytes,
    sector_matrices,
    sector_mesh,
)
from sims.mesh import GearGeometry, Material
from tests.sims.fe_gear.fe_gears import COARSE, PAPER, SMALL

WEB = GearBlank(
    GearGeometry(30, 3.0, bore_radius_mm=12.0), web_thickness_mm=6.0, rim_thickness_mm=5.0, hub_thickness_mm=6.0
)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"web_thickness_mm": 21.0}, "web_thickness_mm is 21 mm, thicker than the face"),
        ({"rim_thickness_mm": 5.0}, "rim_thickness_mm is 5 mm, but a full disc has none"),
        ({"web_thickness_mm": 5.0, "rim_thickness_mm": 1.0}, "rim_thickness_mm is 1 mm"),
        ({"web_thickness_mm": 5.0, "rim_thickness_mm": 30.0, "hub_thickness_mm": 21.0}, "for the web"),
        ({"geometry": GearGeometry(12, 3.0, profile_shift=0.4, bore_radius_mm=13.0)}, "bore_radius_mm is 13 mm"),
    ],
)
def test_a_blank_that_cannot_be_made_is_refused(change: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        replace(PAPER, **change)  # type: ignore[arg-type]


def test_undercut_and_pointed_teeth_and_large_fillets_are_refused() -> None:
    with pytest.raises(InputError, match="undercuts"):
        GearBlank(GearGeometry(12, 3.0))
    with pytest.raises(InputError, match="pointed"):
        GearBlank(GearGeometry(12, 3.0, profile_shift=0.8, addendum=1.3))
    with pytest.raises(InputError, match=r"tool_tip_radius is 0\.6"):
        GearBlank(GearGeometry(50, 3.0, tool_tip_radius=0.6))


@pytest.mark.parametrize("blank", [PAPER, WEB, SMALL])
def test_a_blank_survives_its_text(blank: GearBlank) -> None:
    assert GearBlank.from_text(blank.as_text()) == blank


@pytest.mark.parametrize("blank", [PAPER, WEB, SMALL])
@pytest.mark.parametrize("n_dof", [60_000, 277_200, 947_000])
def test_sizes_come_close_to_what_is_asked_for(blank: GearBlank, n_dof: int) -> None:
    found = n_dof_of(blank, mesh_size_for(blank, n_dof))
    assert 0.75 < found / n_dof < 1.34


def test_too_coarse_for_the_fillet() -> None:
    with pytest.raises(InputError, match=r"too coarse for the fillet: .*ask for more degrees"):
        sector_mesh(PAPER, MeshSize(n_up=1))
    many = GearBlank(GearGeometry(150, 1.0, bore_radius_mm=20.0))
    with pytest.raises(InputError, match="n_dof is 5000: too few for 150 teeth"):
        mesh_size_for(many, 5000)
    assert n_dof_of(SMALL, mesh_size_for(SMALL, 8000)) < 9000


@pytest.mark.parametrize("tip_radius", [0.05, 0.1, 0.2])
def test_sharp_fillets_get_the_cells_that_follow_them(tip_radius: float) -> None:
    blank = GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0, tool_tip_radius=tip_radius))
    size = mesh_size_for(blank, 100_000)
    assert size.order == 2
    assert outline_error_mm(blank.geometry, size.n_gap, size.n_up) <= 0.01 * 3.0


@pytest.mark.parametrize("blank", READY.values(), ids=READY)
def test_five_thousand_degrees_of_freedom_are_a_gear_of_first_order(blank: GearBlank) -> None:
    """Coarse, but a gear: its mass to 1 %."""
    size = mesh_size_for(blank, 5000)
    mesh = sector_mesh(blank, size)
    assert size.order == 1
    assert mesh.n_dof == n_dof_of(blank, size)
    assert 4500 < mesh.n_dof < 5500
    quality = mesh_quality(mesh)
    assert quality.volume_m3 == pytest.approx(quality.true_volume_m3, rel=0.01)


@pytest.mark.slow
def test_what_a_coarse_mesh_misses_is_measured_against_a_finer_one() -> None:
    """75 teeth with 5000 degrees of freedom, the coarsest: first frequency within 8 %, teeth too stiff by a quarter."""
    gear = CyclicGear(sector_mesh(READY["z75_m2"], mesh_size_for(READY["z75_m2"], 5000)))
    error = discretisation_error(gear, cyclic_modes(gear, 8, elastic=True), load_tooth(gear.mesh, 1000.0))
    assert error.finer_dof > 120_000
    assert 0.0 < error.frequency[0] < 0.08
    assert -0.35 < error.compliance < 0.0


def lame_pa() -> tuple[float, float]:
    e, nu = SMALL.material.youngs_modulus_pa, SMALL.material.poisson_ratio
    return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))


def test_eight_node_cells_pass_the_patch() -> None:
    """Constant strain has its own energy in every direction, whatever the cells' shape: the modes stay at rest."""
    mesh = sector_mesh(SMALL, MeshSize(2, 1, 3, 1, 1, 1, order=1))
    stiffness = sector_matrices(mesh)[0]
    turn = cylindrical_turn(mesh)
    volume = mesh_quality(mesh).volume_m3 / SMALL.n_teeth
    lam, mu = lame_pa()
    for i in range(3):
        strain = np.zeros((3, 3))
        strain[i, i] = 1e-3
        field = turn @ (mesh.points_m @ strain).ravel()
        assert field @ (stiffness @ field) == pytest.approx((lam + 2.0 * mu) * 1e-6 * volume, rel=1e-9)


@pytest.mark.parametrize(
    ("blank", "size"), [(PAPER, mesh_size_for(PAPER, 60_000)), (WEB, MeshSize(n_along=3)), (SMALL, COARSE)]
)
def test_volume_and_inertia_are_those_of_the_outline(blank: GearBlank, size: MeshSize) -> None:
    mesh = sector_mesh(blank, size)
    quality = mesh_quality(mesh)
    assert mesh.n_dof == n_dof_of(blank, size)
    assert quality.volume_m3 == pytest.approx(quality.true_volume_m3, rel=3e-4)
    assert quality.polar_inertia_kg_m2 == pytest.approx(quality.true_polar_inertia_kg_m2, rel=4e-4)
    assert quality.mass_kg == pytest.approx(7850.0 * quality.volume_m3)
    assert quality.scaled_jacobian.min() > 0.3


def test_inertia_of_the_paper_gear() -> None:
    """0.00768 kg m² was measured with 7800 kg/m³; a disc out to the pitch circle has 0.7 % more."""
    lighter = replace(PAPER, material=Material(density_kg_m3=7800.0))
    quality = mesh_quality(sector_mesh(lighter, mesh_size_for(lighter, 60_000)))
    assert quality.polar_inertia_kg_m2 == pytest.approx(0.00768, abs=5e-6)


def test_volume_converges() -> None:
    errors = []
    for n in (6, 12):
        quality = mesh_quality(sector_mesh(SMALL, MeshSize(2, 2, n, 1, 2, 1)))
        errors.append(abs(quality.volume_m3 / quality.true_volume_m3 - 1.0))
    assert errors[1] < errors[0] / 2.0


def test_linear_motions_are_exact() -> None:
    """Patch test: a linear field has its own strain energy, rigid motions none, whatever the cells' shape."""
    mesh, material = sector_mesh(SMALL, COARSE), SMALL.material
    stiffness, mass = sector_matrices(mesh)
    turn = cylindrical_turn(mesh)
    volume = mesh_quality(mesh).volume_m3 / SMALL.n_teeth
    lam, mu = lame_pa()
    gradient = np.random.default_rng(4).standard_normal((3, 3))
    strain = (gradient + gradient.T) / 2.0
    field = turn @ (mesh.points_m @ gradient.T).ravel()
    energy = volume * (lam * np.trace(strain) ** 2 + 2.0 * mu * np.sum(strain**2))
    assert field @ (stiffness @ field) == pytest.approx(energy, rel=1e-10)
    spin = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    rigid = turn @ (mesh.points_m @ (spin - spin.T).T + [1.0, 2.0, 3.0]).ravel()
    assert abs(rigid @ (stiffness @ rigid)) < 1e-10 * np.abs(stiffness.data).max()
    shift = turn @ np.tile([0.0, 0.0, 1.0], mesh.n_nodes)
    assert shift @ (mass @ shift) == pytest.approx(volume * material.density_kg_m3, rel=1e-12)


def test_memory_is_refused_with_its_number() -> None:
    with pytest.raises(InputError, match=r"mesh: takes about .* up to 0\.09 GB on this machine now"):
        check_memory(sector_bytes(PAPER, mesh_size_for(PAPER, 947_000)), free_bytes=1e8)
    assert craig_bampton_bytes(PAPER, mesh_size_for(PAPER, 277_200), 20) == pytest.approx(0.95e9, rel=0.15)
    with pytest.raises(InputError, match=r"takes about 25 GB of memory \(allowed: up to 3\.6 GB"):
        check_memory(25e9, free_bytes=4e9)
