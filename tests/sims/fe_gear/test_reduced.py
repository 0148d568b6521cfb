"""Reduced gears: static compliance and modes at the flanks against the whole gear; files; potential energy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.cache import OtherVersionError
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.fe_gear import (
    PLAN,
    READY,
    CyclicGear,
    MeshSize,
    ReducedGear,
    ReductionPlan,
    cached_gear,
    factorised,
    flank_grid,
    flank_rows,
    forget_other_versions,
    gear_name,
    hub_rows,
    line_weights,
    parabolic_weights,
    read_gear,
    ready_gear,
    reduce_gear,
    sector_mesh,
    static_compliance,
    write_gear,
)
from sims.mesh import foundation_compliance, tooth_compliance
from sims.reduced_fe import residual_compliance
from tests.sims.fe_gear.fe_gears import COARSE, PAPER, SMALL, full_matrices, small_cyclic, small_reduced

ARRAYS = ("frequencies_hz", "flank_modes", "free_compliance_m_per_n", "clamped_compliance_m_per_n", "hub_compliance")


def rigid_masses(gear):
    """m, m, m, J_d, J_d, J_p of the six motions of a rigid gear."""
    m, j = gear.mass_kg, gear.diametral_inertia_kg_m2
    return np.array([m, m, m, j, j, gear.polar_inertia_kg_m2])


def whole_rows(gear: CyclicGear, teeth: list[int]) -> FloatArray:
    """Flank rows over all degrees of freedom of the whole gear."""
    n_own = 3 * len(gear.own_nodes)
    one = flank_rows(gear.mesh, small_reduced().grid, "section", gear.own_places, n_own)
    rows = np.zeros((len(teeth), len(one), 12, n_own))
    for k, tooth in enumerate(teeth):
        rows[k, :, tooth] = one
    return rows.reshape(-1, 12 * n_own)


def test_clamped_compliance_is_that_of_the_whole_gear() -> None:
    gear, teeth = small_cyclic(), [3, 5, 4]
    stiffness, _ = full_matrices(gear)
    n_own = stiffness.shape[0] // 12
    held = (np.arange(12)[:, None] * n_own + gear.bore_dof).ravel()
    kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    rows = whole_rows(gear, teeth)[:, kept]
    whole = rows @ factorised(stiffness.tocsr()[kept][:, kept].tocsc())(rows.T)
    found = small_reduced().compliance_m_per_n(teeth, "bore_clamped")
    np.testing.assert_allclose(found, whole, atol=1e-9 * np.abs(whole).max())


def test_holding_the_hub_is_the_limit_of_stiff_springs() -> None:
    gear, reduced = small_cyclic(), small_reduced()
    rows = flank_rows(gear.mesh, reduced.grid, "section", gear.own_places, 3 * len(gear.own_nodes))
    stiff = CyclicGear(gear.mesh, 1e15 * np.array([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4]))
    sprung = static_compliance(stiff, rows, reduced.grid, 1).flanks[0]
    held = reduced.compliance_m_per_n([0], "hub_held")
    np.testing.assert_allclose(held, sprung, atol=3e-5 * np.abs(held).max())


@pytest.mark.parametrize("teeth", [[0, 1, 2], [7, 6], [11, 0, 1]])
@pytest.mark.parametrize("support", ["free", "hub_held", "bore_clamped"])
def test_compliance_is_symmetric_and_never_negative(teeth: list[int], support: str) -> None:
    matrix = small_reduced().compliance_m_per_n(teeth, support)  # type: ignore[arg-type]
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-10 * matrix.max())
    assert np.linalg.eigvalsh(matrix)[0] > -1e-10 * matrix.max()


@pytest.mark.parametrize("tooth", [1, 5, 11, -3])
def test_modes_turn_with_the_teeth(tooth: int) -> None:
    """What modes leave of the compliance does not depend on the tooth, and is never negative; nor what they carry."""
    gear = small_reduced()
    at_zero, there = (residual_compliance(gear, [t, t + 1], np.arange(gear.n_modes)) for t in (0, tooth))
    scale = gear.free_compliance_m_per_n.max()
    np.testing.assert_allclose(there, at_zero, atol=1e-10 * scale)
    assert np.linalg.eigvalsh(there)[0] > -1e-9 * scale
    np.testing.assert_allclose(gear.modes_at(12 + tooth), gear.modes_at(tooth), atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slow_motion_is_that_of_the_whole_gear(sign: float) -> None:
    """Rigid motion, modes and residual against (K − λM)⁻¹ of the whole gear, λ = ±(ω₁/10)²."""
    from scipy.sparse.linalg import splu

    gear, reduced, teeth = small_cyclic(), small_reduced(), [2, 4]
    stiffness, mass = full_matrices(gear)
    square = sign * (0.1 * reduced.angular_frequencies_rad_s[0]) ** 2
    rows = whole_rows(gear, teeth)
    whole = rows @ splu((stiffness - square * mass).tocsc()).solve(rows.T)
    rigid = np.hstack([reduced.rigid_at(t) for t in teeth])
    modes = np.hstack([reduced.modes_at(t) for t in teeth])
    dynamic = 1.0 / (reduced.angular_frequencies_rad_s**2 - square)
    elastic = residual_compliance(reduced, teeth, np.arange(reduced.n_modes)) + modes.T @ (dynamic[:, None] * modes)
    expected = whole + rigid.T @ (rigid / (square * rigid_masses(reduced)[:, None]))
    np.testing.assert_allclose(elastic, expected, atol=1e-3 * np.abs(elastic).max())


def test_rows_give_rigid_motions_exactly() -> None:
    gear = small_cyclic()
    mesh, n = gear.mesh, 3 * len(gear.own_nodes)
    points = mesh.points_m[gear.own_nodes]
    radius, angle = np.hypot(points[:, 0], points[:, 1]), gear.mesh.angles_rad[gear.own_nodes]
    for spread in ("section", "patch", "node"):
        rows = flank_rows(mesh, small_reduced().grid, spread, gear.own_places, n)
        expected = small_reduced().rigid_at(0)
        turning = np.column_stack((0 * radius, radius, 0 * radius)).ravel()
        np.testing.assert_allclose(rows @ turning, expected[5], rtol=1e-9)
        sideways = np.column_stack((np.cos(angle), -np.sin(angle), 0 * radius)).ravel()
        np.testing.assert_allclose(rows @ sideways, expected[0], atol=1e-9)
        tilt = points[:, 2:] * np.column_stack((np.cos(angle), -np.sin(angle), 0 * radius))
        np.testing.assert_allclose(rows @ tilt.ravel(), expected[4], atol=1e-9)


@pytest.mark.slow
def test_patches_remove_the_ripple_of_single_nodes() -> None:
    """Stiffness over the flank's height: a single line of nodes follows the mesh, a patch or section hardly does."""
    mesh = sector_mesh(PAPER, MeshSize(3, 1, 6, 2, 2, 1))
    gear = CyclicGear(mesh)
    grid = flank_grid(PAPER.geometry, 25, 1)
    ripple, found = {}, {}
    for spread in ("section", "patch", "node"):
        rows = flank_rows(mesh, grid, spread, gear.own_places, 3 * len(gear.own_nodes))
        found[spread] = np.diag(static_compliance(gear, rows, grid, 1, "bore").flanks[0])[:25]
        logarithm, roll = np.log(found[spread][2:23]), grid.roll_rad[2:23]
        ripple[spread] = np.std(logarithm - np.polyval(np.polyfit(roll, logarithm, 4), roll))
    assert ripple["node"] > 4.0 * ripple["patch"]
    assert ripple["section"] < 0.01
    assert ripple["patch"] < 0.01
    # Up to the tip's edge, where a line of nodes yields without bound as the mesh is refined.
    indentation = {spread: found[spread] - found["section"] for spread in ("patch", "node")}
    assert np.ptp(indentation["patch"]) < 0.15 * found["section"].mean()
    assert np.ptp(indentation["node"]) > 0.5 * found["section"].mean()


def test_the_mean_motion_of_the_bore_is_that_of_a_rigid_gear() -> None:
    gear = small_cyclic()
    rows = hub_rows(gear.mesh, 3 * len(gear.own_nodes), gear.own_places)
    points, angle = gear.mesh.points_m[gear.own_nodes], gear.mesh.angles_rad[gear.own_nodes]
    radius = np.hypot(points[:, 0], points[:, 1])
    total = np.zeros(6)
    motion = np.array([0.3, -0.2, 0.5, 0.1, 0.7, -0.4])
    for k in range(12):
        turn = 2 * np.pi * k / 12
        c, s = np.cos(turn), np.sin(turn)
        rotate = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        at = points @ rotate.T
        moved = motion[:3] + np.cross(motion[3:], at)
        e_r = np.column_stack((np.cos(angle + turn), np.sin(angle + turn), 0 * angle))
        e_t = np.column_stack((-np.sin(angle + turn), np.cos(angle + turn), 0 * angle))
        local = np.column_stack((np.sum(moved * e_r, axis=1), np.sum(moved * e_t, axis=1), moved[:, 2]))
        total += np.kron(np.eye(2), rotate) @ (rows @ local.ravel())
    np.testing.assert_allclose(total, motion, atol=1e-4)
    assert radius.min() == pytest.approx(0.006)


def test_line_weights_integrate_parabolas() -> None:
    nodes = np.array([0.0, 0.5, 1.0, 2.0, 3.0, 3.25, 3.5])
    for low, high in ((0.2, 3.1), (1.0, 3.0), (-1.0, 9.0)):
        a, b = max(low, 0.0), min(high, 3.5)
        weights = line_weights(nodes, low, high)
        assert weights @ nodes**2 == pytest.approx((b**3 - a**3) / 3 / (b - a))
        assert weights.sum() == pytest.approx(1.0)
    assert line_weights(nodes, 2.3, 2.3) @ nodes**2 == pytest.approx(2.3**2)
    even = np.linspace(0.0, 1.0, 7)
    assert parabolic_weights(7) @ even**2 == pytest.approx(6 * (1 / 4 - 1 / 5))


def test_a_gear_survives_its_file(tmp_path: Path) -> None:
    gear = small_reduced()
    write_gear(tmp_path / "gear.npz", gear)
    again = read_gear(tmp_path / "gear.npz")
    assert (again.blank, again.key, again.n_dof, again.spread) == (gear.blank, gear.key, gear.n_dof, gear.spread)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(gear, name))


def flip(path: Path) -> None:
    """Damage two bytes of the packed data, right after the first entry's header and name."""
    data = bytearray(path.read_bytes())
    place = 30 + int.from_bytes(data[26:28], "little") + int.from_bytes(data[28:30], "little")
    data[place : place + 2] = b"\xff\xff"
    path.write_bytes(data)


def test_files_that_do_not_fit_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "gear.npz"
    with pytest.raises(InputError, match="no such file"):
        read_gear(path)
    path.write_bytes(b"not an archive")
    with pytest.raises(InputError, match="is not a reduced gear"):
        read_gear(path)
    write_gear(path, small_reduced())
    flip(path)
    with pytest.raises(InputError, match="is not a reduced gear"):
        read_gear(path)
    monkeypatch.setattr("sims.fe_gear._reduced_gear.FORMAT", 999)
    write_gear(path, small_reduced())
    monkeypatch.undo()
    with pytest.raises(InputError, match="is of format 999: another version of gearsig wrote it"):
        read_gear(path)


def test_the_cache_keeps_a_gear_and_remakes_a_damaged_one(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path))
    folder = tmp_path / "gears"
    plan = ReductionPlan(COARSE, n_modes=4, n_heights=2, n_slices=1, n_offsets=2)
    first = cached_gear(SMALL, plan)
    (kept,) = folder.iterdir()
    marked = replace(first, mass_kg=9.0)
    write_gear(kept, marked)
    assert cached_gear(SMALL, plan).mass_kg == 9.0
    kept.write_bytes(b"torn")
    assert cached_gear(SMALL, plan).mass_kg == pytest.approx(first.mass_kg)
    assert cached_gear(SMALL, replace(plan, n_modes=6)).key != first.key
    assert len(list(folder.iterdir())) == 2


def test_a_gear_that_another_version_kept_is_named_and_can_be_cleared_away(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path))
    folder = tmp_path / "gears"
    plan = ReductionPlan(COARSE, n_modes=4, n_heights=2, n_slices=1, n_offsets=2)
    first, other = cached_gear(SMALL, plan), cached_gear(SMALL, replace(plan, n_modes=6))
    kept = folder / f"{gear_name(SMALL, plan)}.npz"
    write_gear(kept, replace(first, key=first.key[:-16] + 16 * "0"))
    with pytest.raises(OtherVersionError) as caught:
        cached_gear(SMALL, plan)
    assert str(caught.value).startswith(f"{kept}: this reduced gear was made by another version of gearsig")
    assert "--fresh" in caught.value.remedy
    assert kept.is_file()
    assert forget_other_versions() == (kept,)
    assert cached_gear(SMALL, plan).key == first.key
    assert {read_gear(path).key for path in folder.iterdir()} == {first.key, other.key}


@pytest.mark.parametrize("name", READY)
def test_ready_made_gears_are_small_and_whole(name: str) -> None:
    gear = ready_gear(name)
    assert gear.blank == READY[name]
    assert 250_000 < gear.n_dof < 460_000
    assert gear.compliance_m_per_n([0, 1, 2]).shape == (270, 270)
    matrix = residual_compliance(gear, [0, 1], np.arange(gear.n_modes))
    assert np.linalg.eigvalsh(matrix)[0] > -1e-9 * matrix.max()
    modes = gear.modes_at(0)
    assert modes.shape == (gear.n_modes, gear.grid.n_points)


@pytest.mark.study
def test_a_ready_made_gear_is_what_its_script_makes() -> None:
    kept, again = ready_gear("z50_m3"), reduce_gear(PAPER, PLAN)
    for name in ARRAYS:
        if name != "flank_modes":  # defined up to a turn within each pair
            value = getattr(kept, name)
            np.testing.assert_allclose(getattr(again, name), value, atol=1e-6 * np.abs(value).max())


def slice_stiffness(gear: ReducedGear, height: int, support: str) -> float:
    """Stiffness of flank 0 at one height, all slices pushed alike by one rigid line."""
    _, heights, slices = gear.grid.shape
    matrix = gear.compliance_m_per_n([0], support).reshape(2, heights, slices, 2, heights, slices)  # type: ignore[arg-type]
    return float(np.linalg.inv(matrix[0, height, :, 0, height, :]).sum())


@pytest.mark.slow
def test_compliance_agrees_with_potential_energy() -> None:
    """Tooth and body at five flank heights within 4 %: bending, shear, compression, foundation."""
    mesh = sector_mesh(PAPER, MeshSize(4, 1, 12, 3, 3, 1))
    gear = CyclicGear(mesh)
    g = PAPER.geometry
    grid = flank_grid(g, 7, 1)
    rows = flank_rows(mesh, grid, "section", gear.own_places, 3 * len(gear.own_nodes))
    found = np.diag(static_compliance(gear, rows, grid, 1, "bore").flanks[0])[1:6]
    roll = grid.roll_rad[1:6]
    beam = tooth_compliance(g, PAPER.material, roll).total
    body = foundation_compliance(g, PAPER.material, roll - g.base_half_angle_rad)
    np.testing.assert_allclose(found, (beam + body) / 0.02, rtol=0.04)


def test_the_ready_made_gear_agrees_with_potential_energy() -> None:
    """Five heights between foot and tip within 3 %, all within 5 %; stiffer near the tip, where the beam is short."""
    gear, g = ready_gear("z50_m3"), PAPER.geometry
    roll = gear.grid.roll_rad
    beam = tooth_compliance(g, PAPER.material, roll).total
    body = foundation_compliance(g, PAPER.material, roll - g.base_half_angle_rad)
    found = [1.0 / slice_stiffness(gear, k, "hub_held") for k in range(9)]
    np.testing.assert_allclose(found, (beam + body) / 0.02, rtol=0.05)
    np.testing.assert_allclose(found[1:6], ((beam + body) / 0.02)[1:6], rtol=0.03)
