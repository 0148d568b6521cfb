"""A cracked tooth: nodes doubled along the crack in one sector, the other sectors healthy."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from hashlib import sha256
from math import radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.cache import FRESH, OtherVersionError, cache_folder, keep, modules_digest, read_arrays, write_whole
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.fe_gear._blank import GearBlank, MeshSize, one_thread
from sims.fe_gear._cyclic import factorised
from sims.fe_gear._mesh import CrackLine, IntArray, SectorMesh, sector_matrices, sector_mesh
from sims.fe_gear._reduced_gear import (
    FOLDER,
    READY,
    FlankGrid,
    ReducedGear,
    Spread,
    code_digest,
    flank_rows,
    is_of_this_code,
    ready_gear,
)
from sims.mesh import (
    CRACK_LAWS,
    RootCrack,
    check_crack,
    crack_mouth_mm,
    crack_tip_mm,
    deepest_crack_mm,
    tooth_compliance,
)

CRACK_SIZE = MeshSize(n_across=8, n_gap=1, n_up=9, n_rim=3, n_body=2, n_along=4)
"""Finer across the root than the whole gear needs: the crack ends in the middle of it."""


class OpenCrack(NamedTuple):
    """Flank 0 of a tooth with a crack that is open through the whole width, and what would close it.

    Attributes
    ----------
    across : array, (n_points, n_closing)
        Opening of the crack at its nodes, by components, for unit pushes at the flank: R K⁻¹ Gᵀ, m/N.
    closing : array, (n_closing, n_closing)
        Opening for unit pairs of forces that open it: G K⁻¹ Gᵀ, m/N.
    layer : array of int, (n_closing,)
        Layer of nodes along the face, from the end at z < 0, of each of them.
    last_layer : int
    """

    across: FloatArray
    closing: FloatArray
    layer: IntArray
    last_layer: int

    def added_m_per_n(self, front_layer: int | None = None) -> FloatArray:
        """What the crack adds to the compliance between the flank's points, (n_points, n_points).

        A B⁻¹ Aᵀ closes the crack altogether; less A_S B_SS⁻¹ A_Sᵀ, what closes it beyond the front.
        """
        added = self._closed(np.full(len(self.layer), True))
        if front_layer is not None and front_layer < self.last_layer:
            added = added - self._closed(self.layer >= front_layer)
        return added

    def _closed(self, which: IntArray | np.ndarray[Any, np.dtype[np.bool_]]) -> FloatArray:
        part = self.across[:, which]
        whole: FloatArray = part @ np.linalg.solve(self.closing[np.ix_(which, which)], part.T)
        return (whole + whole.T) / 2.0


def open_crack(
    blank: GearBlank, crack: RootCrack, grid: FlankGrid, spread: Spread = "section", size: MeshSize = CRACK_SIZE
) -> OpenCrack:
    """Solve the gear with the crack open, once for all widths.

    The difference of two static solutions of the whole gear, bore held, on the same mesh: with the nodes on the crack
    doubled, and without. For a gear that is not held at its bore it is nearly the same: a crack acts on its tooth.

    Parameters
    ----------
    blank : GearBlank
    crack : RootCrack
        From the middle of the fillet of flank 0, through the whole width.
    grid : FlankGrid
    spread : str
    size : MeshSize

    Raises
    ------
    InputError
        If the crack goes past the tooth, or runs so steeply into the body that the mesh cannot follow it.

    Notes
    -----
    The crack's faces do not touch, and it does not grow. Its tip is not resolved: twice as many cells across the root
    add 2 to 5 % more. Near the tooth's tip this agrees with the potential energy of sections behind a limiting line to
    5 %; halfway up the flank that method finds only half as much.
    """
    healthy, cracked = crack_meshes(blank, crack, size)
    n_new = cracked.n_nodes - healthy.n_nodes
    old = healthy.tooth[0, healthy.tooth.shape[1] - n_new // healthy.tooth.shape[2] :].ravel()
    opening = sparse.csr_array(sparse.eye_array(3 * cracked.n_nodes, format="csr")[3 * healthy.n_nodes :])
    opening = opening - sparse.csr_array(
        (
            np.ones(3 * n_new),
            ((3 * np.arange(n_new)[:, None] + np.arange(3)).ravel(), (3 * old[:, None] + np.arange(3)).ravel()),
        ),
        shape=opening.shape,
    )
    with one_thread():
        stiffness, kept = _ring(cracked, other_sectors(blank, size))
        rows = flank_rows(cracked, grid, spread, np.arange(cracked.n_nodes), 3 * cracked.n_nodes)
        flank, gap = rows[: grid.n_points // 2, kept], opening[:, kept].toarray()
        moved = factorised(stiffness)(gap.T)
    layer = np.repeat(np.tile(np.arange(healthy.tooth.shape[2]), n_new // healthy.tooth.shape[2]), 3)
    return OpenCrack(flank @ moved, gap @ moved, layer, healthy.tooth.shape[2] - 1)


def crack_meshes(blank: GearBlank, crack: RootCrack, size: MeshSize = CRACK_SIZE) -> tuple[SectorMesh, SectorMesh]:
    """Return the mesh along the crack's line, closed and open."""
    g = blank.geometry
    check_crack(g, crack)
    part = crack.depth_mm * sin(radians(crack.angle_deg)) / (2.0 * crack_mouth_mm(g)[1])
    n_cells = min(max(1, round(part * size.n_across)), size.n_across - 1)
    line = CrackLine(crack_tip_mm(g, crack.depth_mm, crack.angle_deg), n_cells)
    try:
        healthy = sector_mesh(blank, size, line)
    except InputError as error:
        raise InputError(
            f"the mesh cannot follow a crack of {crack.depth_mm:g} mm at {crack.angle_deg:g}° ({error.what})",
            allowed="angles from about 35°",
            remedy="take a larger angle or a shallower crack",
        ) from error
    return healthy, _opened(healthy, n_cells)


def tooth_compliance_with(mesh: SectorMesh, chain: FloatArray, grid: FlankGrid, spread: Spread) -> FloatArray:
    """Compliance between the flank points of the tooth of a sector that is closed to a ring by others, m/N, (n, n).

    The direct solution, for any one sector; `open_crack` solves once for all widths of a crack.

    Parameters
    ----------
    mesh : SectorMesh
        E.g. a cracked one of `crack_meshes`.
    chain : array
        Of `other_sectors`, N/m.
    grid : FlankGrid
        The n points.
    spread : str
        See `ReducedGear.spread`.
    """
    stiffness, kept = _ring(mesh, chain)
    rows = flank_rows(mesh, grid, spread, np.arange(mesh.n_nodes), 3 * mesh.n_nodes)[:, kept]
    return rows @ factorised(stiffness)(rows.T)


def _ring(mesh: SectorMesh, chain: FloatArray) -> tuple[sparse.csc_array, IntArray]:
    """Stiffness of a sector, closed to a ring by others, over its degrees of freedom that are not held."""
    sector_stiffness = sector_matrices(mesh)[0]
    ends = np.concatenate((_free_side(mesh, mesh.high_side), _free_side(mesh, mesh.low_side)))
    places = (np.repeat(ends, len(ends)), np.tile(ends, len(ends)))
    stiffness = sector_stiffness + sparse.csr_array(
        sparse.coo_array((chain.ravel(), places), shape=sector_stiffness.shape)
    )
    kept = _free_dof(mesh)
    return sparse.csc_array(stiffness[kept][:, kept]), kept


def front_widths_mm(blank: GearBlank, size: MeshSize = CRACK_SIZE) -> FloatArray:
    """Widths over which a crack can reach without rounding, from one cell to the whole face."""
    mesh = sector_mesh(blank, size)
    z = mesh.points_m[mesh.tooth[0, 0], 2]
    widths: FloatArray = 1e3 * (z[2::2] - z[0])
    return widths


@lru_cache(maxsize=4)
def other_sectors(blank: GearBlank, size: MeshSize) -> FloatArray:
    """Stiffness of all sectors but one at the sides of that one, high and low, the bore held; cracks leave it be."""
    mesh = sector_mesh(blank, size)
    condensed = _condensed(sector_matrices(mesh)[0], mesh)
    n_sectors = blank.n_teeth - 1
    chain: FloatArray | None = None
    power = condensed
    while n_sectors:
        if n_sectors % 2:
            chain = power if chain is None else _joined(chain, power)
        n_sectors //= 2
        power = _joined(power, power)
    assert chain is not None  # noqa: S101  # a gear has more than one tooth
    return chain


def _condensed(stiffness: sparse.csr_array, mesh: SectorMesh) -> FloatArray:
    """Stiffness at the two sides of one sector: K_bb − K_bi K_ii⁻¹ K_ib."""
    sides = np.concatenate((_free_side(mesh, mesh.low_side), _free_side(mesh, mesh.high_side)))
    inner = np.setdiff1d(_free_dof(mesh), sides)
    across = stiffness[inner][:, sides].toarray()
    answer = factorised(sparse.csc_array(stiffness[inner][:, inner]))(across)
    condensed: FloatArray = stiffness[sides][:, sides].toarray() - across.T @ answer
    return (condensed + condensed.T) / 2.0


def _joined(first: FloatArray, second: FloatArray) -> FloatArray:
    """Two chains in a row; what they share in the middle moves as it likes."""
    q = len(first) // 2
    middle = first[q:, q:] + second[:q, :q]
    across = np.hstack((first[q:, :q], second[:q, q:]))
    outer = np.zeros((2 * q, 2 * q))
    outer[:q, :q], outer[q:, q:] = first[:q, :q], second[q:, q:]
    joined: FloatArray = outer - across.T @ np.linalg.solve(middle, across)
    return (joined + joined.T) / 2.0


def _opened(mesh: SectorMesh, n_cells: int) -> SectorMesh:
    """Double the nodes of the tooth's lowest row from the crack's mouth up to, without, its tip."""
    old = mesh.tooth[0, -2 * n_cells :].ravel()
    new = mesh.n_nodes + np.arange(len(old))
    number = np.arange(mesh.n_nodes)
    number[old] = new
    in_tooth = np.isin(mesh.cells, mesh.tooth).all(axis=(1, 2, 3))
    cells = mesh.cells.copy()
    cells[in_tooth] = number[cells[in_tooth]]
    tooth = mesh.tooth.copy()
    tooth[0] = number[tooth[0]]
    return replace(mesh, points_m=np.vstack((mesh.points_m, mesh.points_m[old])), cells=cells, tooth=tooth)


def _free_dof(mesh: SectorMesh) -> IntArray:
    held: Any = (3 * mesh.bore.ravel()[:, None] + np.arange(3)).ravel()
    return np.setdiff1d(np.arange(3 * mesh.n_nodes), held)


def _free_side(mesh: SectorMesh, side: IntArray) -> IntArray:
    free = side[~np.isin(side, mesh.bore)]
    return (3 * free[:, None] + np.arange(3)).ravel()


# What cracks add to the compliance of a reduced gear's tooth, from finite elements, kept over depth and width.

DEPTH_PARTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Of the deepest crack: depths that are solved. What lies between follows from added compliance over squared depth."""
COARSE_SIZE, COARSE_DOF = MeshSize(n_across=6, n_gap=1, n_up=6, n_rim=2, n_body=1, n_along=2), 4_000
"""For gears with fewer degrees of freedom per tooth, whose teeth are not known better either: adds 4 to 9 % less than
`CRACK_SIZE`."""
READY_ANGLE_DEG = 45.0
READY_FILE = FOLDER / "cracks.npz"
MAX_BYTES = 100_000_000
"""Of a kept crack's arrays; a usual one has less than one."""


def crack_added_m_per_n(gear: ReducedGear, crack: RootCrack) -> FloatArray:
    """What a crack adds to the compliance between the slices of flank 0, (n_heights, n_slices, n_slices), m/N.

    Between solved depths a < q < b, and likewise between widths (straight, 0 at no width):

        C(q) = q² [(b − q) C(a)/a² + (q − a) C(b)/b²]/(b − a)

    A shallow crack adds as its depth squared; every C stays symmetric and positive.

    Parameters
    ----------
    gear : ReducedGear
    crack : RootCrack
        Its tooth does not matter.

    Raises
    ------
    InputError
        If the crack goes past the tooth, or the mesh cannot follow it.

    Notes
    -----
    Cracks of the ready-made gears at 45° come with the product. Others take seconds once and are kept on disk.
    """
    check_crack(gear.blank.geometry, crack)
    added = _at_depth(gear, crack)
    face_mm = gear.blank.geometry.face_width_mm
    if crack.width_mm is None or crack.width_mm >= face_mm:
        through: FloatArray = added[-1]
        return through
    widths = np.concatenate(([0.0], front_widths_mm(gear.blank, crack_size(gear))))
    k = int(np.searchsorted(widths, crack.width_mm))
    part = (crack.width_mm - widths[k - 1]) / (widths[k] - widths[k - 1])
    narrower = added[k - 2] if k > 1 else np.zeros_like(added[0])
    between: FloatArray = (1.0 - part) * narrower + part * added[k - 1]
    return between


class CrackLaws(NamedTuple):
    """What a crack through the whole face adds to the compliance of a tooth, by several laws.

    Attributes
    ----------
    depth_mm : array, (n_depths,)
    roll_rad : array, (n_heights,)
        Where on the flank the tooth is loaded.
    added_m_per_n : mapping
        Law → (n_depths, n_heights), "finite elements" first.
    """

    depth_mm: FloatArray
    roll_rad: FloatArray
    added_m_per_n: dict[str, FloatArray]


def compare_crack_laws(gear: ReducedGear, depth_mm: FloatArray) -> CrackLaws:
    """Compare the lines behind a crack, by which models of the literature cut its tooth, with finite elements.

    Parameters
    ----------
    gear : ReducedGear
    depth_mm : array, (n_depths,)
        Above 0; of cracks at `READY_ANGLE_DEG`.

    Notes
    -----
    Halfway up the flank of 55 teeth of 2 mm finite elements add twice what any of the lines does; near the tip, where
    teeth enter and leave, they agree to 10 to 30 %. Cells of 0.06 and 0.1 mm taken out of a plane grid along the crack,
    an independent solution, add 10 to 20 % more than these finite elements.
    """
    g, material = gear.blank.geometry, gear.blank.material
    roll, width = gear.grid.roll_rad, g.face_width_mm * 1e-3
    cracks = [RootCrack(float(q), READY_ANGLE_DEG) for q in np.atleast_1d(depth_mm)]
    added = {"finite elements": np.array([crack_added_m_per_n(gear, crack).mean(axis=(1, 2)) for crack in cracks])}
    whole = tooth_compliance(g, material, roll).total
    for law in CRACK_LAWS:
        lines = [tooth_compliance(g, material, roll, (c.depth_mm, c.angle_deg), law).total - whole for c in cracks]
        added[law] = np.array(lines) / width
    return CrackLaws(np.atleast_1d(depth_mm), roll, added)


@lru_cache(maxsize=64)
def deepest_followed_mm(blank: GearBlank, size: MeshSize, angle_deg: float) -> float:
    """Deepest crack for which a mesh along its line is found; 0 if there is none.

    Parameters
    ----------
    blank : GearBlank
    size : MeshSize
        `crack_size` of the gear.
    angle_deg : float
        ϑ between the crack and the tooth's centre line.
    """
    deepest = deepest_crack_mm(blank.geometry, angle_deg)
    for part in reversed(DEPTH_PARTS):
        try:
            crack_meshes(blank, RootCrack(part * deepest, angle_deg), size)
        except InputError:
            continue
        return part * deepest
    return 0.0


def crack_size(gear: ReducedGear) -> MeshSize:
    """Mesh on which a gear's cracks are solved."""
    return COARSE_SIZE if gear.n_dof < COARSE_DOF * gear.blank.n_teeth else CRACK_SIZE


def _at_depth(gear: ReducedGear, crack: RootCrack) -> FloatArray:
    """For all widths; below the least solved depth the compliance over squared depth stays."""
    depths = deepest_crack_mm(gear.blank.geometry, crack.angle_deg) * np.array(DEPTH_PARTS)
    k = int(np.searchsorted(depths, crack.depth_mm * (1.0 - 1e-12)))
    if k == 0:
        shallow: FloatArray = (crack.depth_mm / depths[0]) ** 2 * _solved(gear, crack.angle_deg, 0)
        return shallow
    deepest = deepest_followed_mm(gear.blank, crack_size(gear), crack.angle_deg)
    if crack.depth_mm > deepest * (1.0 + 1e-9):
        raise InputError(
            f"the mesh cannot follow a crack of {crack.depth_mm:g} mm at {crack.angle_deg:g}°",
            allowed=f"up to {deepest:.3g} mm, or a greater angle",
            remedy="take a shallower crack or one that runs less steeply into the body",
        )
    above = _solved(gear, crack.angle_deg, k) / depths[k] ** 2
    below = _solved(gear, crack.angle_deg, k - 1) / depths[k - 1] ** 2
    part = (crack.depth_mm - depths[k - 1]) / (depths[k] - depths[k - 1])
    between: FloatArray = crack.depth_mm**2 * ((1.0 - part) * below + part * above)
    return between


def _solved(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray:
    """At a depth that is solved, (n_widths, n_heights, n_slices, n_slices): shipped, kept, or solved now."""
    shipped = _shipped(gear, angle_deg, place)
    if shipped is not None:
        return shipped
    made_of = [gear.blank.as_text(), gear.spread, angle_deg, DEPTH_PARTS[place], repr(crack_size(gear)), gear.n_dof]
    grid = np.concatenate((gear.grid.roll_rad, gear.grid.z_m)).tobytes()
    path = cache_folder("cracks") / f"{sha256(json.dumps(made_of).encode() + grid).hexdigest()[:32]}.npz"
    return _kept(path, lambda: solved_crack_m_per_n(gear, angle_deg, place), gear.grid.shape)


def solved_crack_m_per_n(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray:
    """Solve a crack of depth `DEPTH_PARTS[place]`: (n_widths, n_heights, n_slices, n_slices), the whole face last.

    Of each width the blocks of flank 0 at equal heights: a tooth touches its mate at one height at a time.
    """
    spread: Spread = gear.spread  # type: ignore[assignment]  # checked by the gear
    depth = DEPTH_PARTS[place] * deepest_crack_mm(gear.blank.geometry, angle_deg)
    opened = open_crack(gear.blank, RootCrack(depth, angle_deg), gear.grid, spread, crack_size(gear))
    n_heights, n_slices = gear.grid.shape[1:]
    heights = np.arange(n_heights)
    by_width = [
        opened.added_m_per_n(layer).reshape(n_heights, n_slices, n_heights, n_slices)[heights, :, heights, :]
        for layer in range(2, opened.last_layer + 1, 2)
    ]
    return np.array(by_width)


@lru_cache(maxsize=1)
def _ready_cracks() -> dict[str, FloatArray]:
    with np.load(READY_FILE, allow_pickle=False) as data:
        return {name: data[name] for name in data.files}


def _shipped(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray | None:
    """Return the crack of a ready-made gear, if that is what this is."""
    name = next((name for name, blank in READY.items() if blank == gear.blank), None)
    if name is None or angle_deg != READY_ANGLE_DEG or gear.spread != "section":
        return None
    cracks = _ready_cracks()
    same = all(
        np.array_equal(cracks[f"{name}_{axis}"], points)
        for axis, points in (("roll_rad", gear.grid.roll_rad), ("z_m", gear.grid.z_m))
    )
    return cracks[name][place] if same and place < len(cracks[name]) else None


def _kept(path: Path, solve: Callable[[], FloatArray], grid: tuple[int, int, int]) -> FloatArray:
    """Return what a file keeps, or solve and keep it; a damaged one is made again."""
    code, added = _read(path)
    if added is not None and code != _code():
        raise OtherVersionError("this crack was solved by another version of gearsig", where=str(path), remedy=FRESH)
    if added is not None and added.shape[1:] == (grid[1], grid[2], grid[2]) and np.isfinite(added).all():
        return added
    solved = solve()
    keep(path, lambda file: np.savez(file, code=np.array(_code()), added=solved))
    return solved


def _read(path: Path) -> tuple[str, FloatArray | None]:
    """Code that made a file, and what it keeps; None if it is not there or damaged."""
    data = read_arrays(path, MAX_BYTES)
    return (str(data["code"]), data["added"]) if data is not None and {"code", "added"} <= set(data) else ("", None)


@cache
def _code() -> str:
    """Digest of the code that meshes a gear, opens and solves a crack."""
    return f"{code_digest()}-{modules_digest(('sims.fe_gear._crack',))}"


def forget_other_versions() -> tuple[Path, ...]:
    """Delete reduced gears and cracks that another version kept, and damaged ones, from this user's cache.

    Returns
    -------
    tuple of Path
        The files that are gone. What is needed of them is made again when it is next asked for.
    """
    gone = [path for path in sorted(cache_folder("gears").glob("*.npz")) if not is_of_this_code(path)]
    gone += [path for path in sorted(cache_folder("cracks").glob("*.np[yz]")) if _read(path)[0] != _code()]
    for path in gone:
        path.unlink(missing_ok=True)
    return tuple(gone)


if __name__ == "__main__":  # solve the cracks of all ready-made gears, each as deep as the mesh can follow
    arrays: dict[str, Any] = {}
    for name in READY:
        gear, solved = ready_gear(name), []
        for place in range(len(DEPTH_PARTS)):
            try:
                solved.append(solved_crack_m_per_n(gear, READY_ANGLE_DEG, place))
            except InputError:
                break
        arrays |= {name: np.array(solved), f"{name}_roll_rad": gear.grid.roll_rad, f"{name}_z_m": gear.grid.z_m}
    write_whole(READY_FILE, lambda file: np.savez_compressed(file, **arrays))
