"""A cracked tooth: the ring of sectors, what a crack adds, and the potential-energy method."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse

from gearsig.cache import OtherVersionError
from gearsig.errors import InputError
from sims.fe_gear import (
    MeshSize,
    crack_added_m_per_n,
    crack_meshes,
    factorised,
    flank_grid,
    flank_rows,
    forget_other_versions,
    mesh_quality,
    open_crack,
    other_sectors,
    ready_gear,
    sector_matrices,
    sector_mesh,
    tooth_compliance_with,
)
from sims.mesh import RootCrack, deepest_crack_mm, tooth_compliance
from tests.sims.fe_gear.fe_gears import COARSE, PAPER, SMALL, small_cyclic, small_reduced

SIZE = MeshSize(4, 1, 4, 2, 1, 2)


def test_a_ring_of_healthy_sectors_is_the_cyclic_gear() -> None:
    mesh, reduced = small_cyclic().mesh, small_reduced()
    chain = other_sectors(SMALL, COARSE)
    found = tooth_compliance_with(mesh, chain, reduced.grid, "section")
    expected = reduced.compliance_m_per_n([0], "bore_clamped")
    np.testing.assert_allclose(found, expected, atol=1e-9 * expected.max())


def test_an_open_crack_keeps_the_body_and_doubles_nodes() -> None:
    healthy, cracked = crack_meshes(SMALL, RootCrack(1.5, 60.0), SIZE)
    assert mesh_quality(cracked).volume_m3 == pytest.approx(mesh_quality(healthy).volume_m3, rel=1e-12)
    assert cracked.n_nodes > healthy.n_nodes


def test_closing_a_crack_leaves_what_two_solutions_differ_by() -> None:
    """Healthy and cracked gear solved apart, cracked through the width and over half of it."""
    grid, crack = flank_grid(SMALL.geometry, 3, 2), RootCrack(1.5, 60.0)
    chain = other_sectors(SMALL, SIZE)
    healthy, cracked = crack_meshes(SMALL, crack, SIZE)
    apart = [tooth_compliance_with(mesh, chain, grid, "section")[:6, :6] for mesh in (healthy, cracked)]
    opened = open_crack(SMALL, crack, grid, size=SIZE)
    np.testing.assert_allclose(opened.added_m_per_n(), apart[1] - apart[0], atol=1e-9 * apart[0].max())
    # Over half of the width: the same mesh with the nodes from the front on not doubled.
    n_layers = healthy.tooth.shape[2]
    number = np.arange(cracked.n_nodes)
    pairs = np.column_stack((cracked.tooth[0].ravel(), healthy.tooth[0].ravel()))
    shut = pairs[(np.tile(np.arange(n_layers), len(pairs) // n_layers) >= 2)]
    number[shut[:, 0]] = shut[:, 1]
    used = np.unique(number)
    packed = np.searchsorted(used, number)
    half = replace(
        cracked,
        points_m=cracked.points_m[used],
        cells=packed[cracked.cells],
        tooth=packed[cracked.tooth],
        bore=packed[cracked.bore],
        low_side=packed[cracked.low_side],
        high_side=packed[cracked.high_side],
    )
    found = tooth_compliance_with(half, chain, grid, "section")[:6, :6] - apart[0]
    np.testing.assert_allclose(opened.added_m_per_n(2), found, atol=1e-9 * apart[0].max())


@pytest.mark.slow
def test_the_whole_gear_with_one_cracked_sector_agrees() -> None:
    """Every sector assembled, one of them cracked, the bore held: compliance of the tooth, to the solver's rounding."""
    cracked = crack_meshes(SMALL, RootCrack(1.5, 60.0), SIZE)[1]
    plain, grid = sector_mesh(SMALL, SIZE), flank_grid(SMALL.geometry, 2, 1)
    meshes = [cracked] + [plain] * (SMALL.n_teeth - 1)
    first = np.cumsum([0] + [m.n_nodes for m in meshes])
    number = np.arange(first[-1])
    for k, mesh in enumerate(meshes):  # a sector's high side is the next one's low side
        following = (k + 1) % SMALL.n_teeth
        number[first[k] + mesh.high_side] = first[following] + meshes[following].low_side
    size = 3 * first[-1]
    stiffness = sparse.csr_array((size, size))
    dof = (3 * number[:, None] + np.arange(3)).ravel()
    for k, mesh in enumerate(meshes):
        own = sector_matrices(mesh)[0].tocoo()
        places = dof[3 * first[k] : 3 * first[k + 1]]
        stiffness = stiffness + sparse.csr_array((own.data, (places[own.row], places[own.col])), shape=(size, size))
    held = np.concatenate([first[k] + mesh.bore.ravel() for k, mesh in enumerate(meshes)])
    free = np.setdiff1d(np.unique(number), number[held])
    kept = (3 * free[:, None] + np.arange(3)).ravel()
    rows = flank_rows(cracked, grid, "section", number[: cracked.n_nodes], size)[:2, kept]
    whole = rows @ factorised(sparse.csc_array(stiffness[kept][:, kept]))(rows.T)
    ring = tooth_compliance_with(cracked, other_sectors(SMALL, SIZE), grid, "section")[:2, :2]
    np.testing.assert_allclose(ring, whole, rtol=1e-8)


@pytest.mark.study
def test_between_solved_depths_and_widths_the_table_is_that_of_the_crack() -> None:
    """A ready-made gear's shipped table against solutions of its own, between depths: within 2 %."""
    gear = ready_gear("z50_m3")
    crack = RootCrack(3.2, 45.0)
    alone = open_crack(gear.blank, crack, gear.grid).added_m_per_n()
    shape = (gear.grid.shape[1], gear.grid.shape[2]) * 2
    expected = np.array([alone.reshape(shape)[h, :, h] for h in range(shape[0])])
    np.testing.assert_allclose(crack_added_m_per_n(gear, crack), expected, atol=0.02 * expected.max())
    narrow, half = (crack_added_m_per_n(gear, RootCrack(2.0, 45.0, width_mm=w)) for w in (2.5, 5.0))
    np.testing.assert_allclose(narrow, half / 2.0)
    parts = [crack_added_m_per_n(gear, RootCrack(2.0, 45.0, width_mm=w))[5].sum() for w in (4.0, 9.0, 14.0, 19.0, None)]
    assert np.all(np.diff(parts) > 0.0)
    tiny = crack_added_m_per_n(gear, RootCrack(0.1, 45.0))
    np.testing.assert_allclose(tiny, crack_added_m_per_n(gear, RootCrack(0.2, 45.0)) / 4.0)


def test_cracks_of_other_gears_are_kept_on_disk(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path))
    monkeypatch.setattr("sims.fe_gear._crack.COARSE_SIZE", SIZE)
    gear, crack = small_reduced(), RootCrack(1.3, 60.0)
    first = crack_added_m_per_n(gear, crack)
    kept = sorted((tmp_path / "cracks").iterdir())
    assert len(kept) == 2  # the depths beside it
    again = crack_added_m_per_n(gear, crack)
    np.testing.assert_array_equal(first, again)
    kept[0].write_bytes(b"damaged")
    np.testing.assert_allclose(crack_added_m_per_n(gear, crack), first, rtol=1e-12)
    with np.load(kept[1]) as data:
        np.savez(kept[1], code=np.array("of another version"), added=data["added"])
    with pytest.raises(OtherVersionError, match="solved by another version of gearsig; add --fresh"):
        crack_added_m_per_n(gear, crack)
    assert forget_other_versions() == (kept[1],)
    np.testing.assert_allclose(crack_added_m_per_n(gear, crack), first, rtol=1e-12)
    with pytest.raises(InputError, match=r"cannot follow a crack of 9 mm .*allowed: up to 8\.17 mm"):
        crack_added_m_per_n(ready_gear("z50_m3"), RootCrack(9.0, 45.0))


@pytest.mark.study
def test_shipped_cracks_are_what_their_script_makes() -> None:
    gear = ready_gear("z50_m3")
    n_heights, n_slices = gear.grid.shape[1:]
    for part in (0.05, 0.4, 0.9):  # depths that were solved, over the deepest
        crack = RootCrack(part * deepest_crack_mm(gear.blank.geometry, 45.0), 45.0)
        opened = open_crack(gear.blank, crack, gear.grid)
        for width_mm, layer in ((None, None), (5.0, 2)):  # one of four cells along the face
            added = opened.added_m_per_n(layer).reshape(n_heights, n_slices, n_heights, n_slices)
            again = np.array([added[h, :, h] for h in range(n_heights)])
            kept = crack_added_m_per_n(gear, replace(crack, width_mm=width_mm))
            np.testing.assert_allclose(kept, again, atol=1e-6 * again.max())


@pytest.mark.parametrize("angle", [45.0, 60.0, 90.0])
def test_a_deeper_crack_adds_more(angle: float) -> None:
    grid = flank_grid(SMALL.geometry, 3, 2)
    added = [open_crack(SMALL, RootCrack(d, angle), grid, size=SIZE).added_m_per_n() for d in (0.5, 1.2, 2.0)]
    for less, more in pairwise(added):
        assert np.linalg.eigvalsh(more - less)[0] > -1e-3 * more.max()
    assert np.linalg.eigvalsh(added[0])[0] > -1e-9 * added[0].max()
    assert np.diag(added[2])[4] > np.diag(added[2])[2]  # a force further out bends the crack open more


def test_part_of_the_width_adds_less_and_most_at_its_end() -> None:
    grid = flank_grid(SMALL.geometry, 2, 4)
    opened = open_crack(SMALL, RootCrack(1.5, 60.0), grid, size=SIZE)
    through, part = opened.added_m_per_n(), opened.added_m_per_n(2)  # its front one of two cells in: 6 mm
    assert np.linalg.eigvalsh(through - part)[0] > -1e-9 * through.max()
    tip = np.diag(part)[4:8]
    assert np.all(np.diff(tip) < 0.0)


def test_a_force_near_the_tip_agrees_with_potential_energy() -> None:
    """What 2 and 4 mm at 45° add for a force near the tip of the paper gear's tooth, within 8 %."""
    g, grid = PAPER.geometry, flank_grid(PAPER.geometry, 2, 1)
    healthy = tooth_compliance(g, PAPER.material, grid.roll_rad[1:]).total
    for depth in (2.0, 4.0):
        opened = open_crack(
            PAPER,
            RootCrack(depth, 45.0),
            grid,
            size=MeshSize(n_across=8, n_gap=1, n_up=9, n_rim=3, n_body=2, n_along=1),
        )
        beam = tooth_compliance(g, PAPER.material, grid.roll_rad[1:], (depth, 45.0)).total - healthy
        assert opened.added_m_per_n()[1, 1] == pytest.approx(float(beam[0]) / 0.02, rel=0.08)


def test_cracks_that_cannot_be_are_refused() -> None:
    grid = flank_grid(SMALL.geometry, 2, 1)
    with pytest.raises(InputError, match="goes past the tooth"):
        open_crack(SMALL, RootCrack(12.0, 60.0), grid, size=SIZE)
    with pytest.raises(InputError, match="the mesh cannot follow a crack of"):
        open_crack(SMALL, RootCrack(3.0, 15.0), grid, size=SIZE)
