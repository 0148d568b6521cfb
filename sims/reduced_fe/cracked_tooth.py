"""A cracked tooth: nodes doubled along the crack in one sector, the other sectors sound."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import radians, sin
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.mesh.crack import RootCrack, check_crack, crack_mouth_mm, crack_tip_mm
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.cyclic import factorised
from sims.reduced_fe.elements import sector_matrices
from sims.reduced_fe.flank_rows import Spread, flank_rows
from sims.reduced_fe.mesh_size import MeshSize
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.reduced_gear import FlankGrid
from sims.reduced_fe.sector_mesh import SectorMesh, sector_mesh
from sims.reduced_fe.sector_plane import CrackLine, IntArray

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


def crack_compliance_m_per_n(
    blank: GearBlank, crack: RootCrack, grid: FlankGrid, spread: Spread = "section", size: MeshSize = CRACK_SIZE
) -> FloatArray:
    """What a root crack adds to the compliance between the flank points of its tooth, (n_points, n_points), m/N.

    The difference of two static solutions of the whole gear, bore held, on the same mesh: with the nodes on the crack
    doubled, and without. For a gear that is not held at its bore it is nearly the same: a crack acts on its tooth.

    Parameters
    ----------
    blank : GearBlank
    crack : RootCrack
        From the middle of the fillet of flank 0. Its width is rounded to whole cells.
    grid : FlankGrid
    spread : str
    size : MeshSize

    Returns
    -------
    array, (n_points, n_points)
        Rows and columns of flank 1 are zero: pushed from the back, the crack is closed.

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
    if crack.front != "straight":
        raise InputError("front of the crack is 'parabolic'", allowed="straight", remedy="give the mean depth")
    opened = open_crack(blank, replace(crack, width_mm=None), grid, spread, size)
    added = np.zeros((grid.n_points, grid.n_points))
    half = grid.n_points // 2
    added[:half, :half] = opened.added_m_per_n(front_layer(blank, crack.width_mm, size))
    return added


def open_crack(
    blank: GearBlank, crack: RootCrack, grid: FlankGrid, spread: Spread = "section", size: MeshSize = CRACK_SIZE
) -> OpenCrack:
    """Solve the gear with the crack open, once for all widths; see `crack_compliance_m_per_n`."""
    sound, cracked = crack_meshes(blank, crack, size)
    n_new = cracked.n_nodes - sound.n_nodes
    old = sound.tooth[0, sound.tooth.shape[1] - n_new // sound.tooth.shape[2] :].ravel()
    opening = sparse.csr_array(sparse.eye_array(3 * cracked.n_nodes, format="csr")[3 * sound.n_nodes :])
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
    layer = np.repeat(np.tile(np.arange(sound.tooth.shape[2]), n_new // sound.tooth.shape[2]), 3)
    return OpenCrack(flank @ moved, gap @ moved, layer, sound.tooth.shape[2] - 1)


def front_layer(blank: GearBlank, width_mm: float | None, size: MeshSize = CRACK_SIZE) -> int | None:
    """Layer of nodes between cells where the crack's front lies, from the end at z < 0; None: through the width."""
    if width_mm is None:
        return None
    return 2 * (int(np.argmin(np.abs(front_widths_mm(blank, size) - width_mm))) + 1)


def crack_meshes(blank: GearBlank, crack: RootCrack, size: MeshSize = CRACK_SIZE) -> tuple[SectorMesh, SectorMesh]:
    """Return the mesh along the crack's line, closed and open."""
    g = blank.geometry
    check_crack(g, crack)
    part = crack.depth_mm * sin(radians(crack.angle_deg)) / (2.0 * crack_mouth_mm(g)[1])
    n_cells = min(max(1, round(part * size.n_across)), size.n_across - 1)
    line = CrackLine(crack_tip_mm(g, crack.depth_mm, crack.angle_deg), n_cells)
    try:
        sound = sector_mesh(blank, size, line)
    except InputError as error:
        raise InputError(
            f"the mesh cannot follow a crack of {crack.depth_mm:g} mm at {crack.angle_deg:g}° ({error.what})",
            allowed="angles from about 35°",
            remedy="take a larger angle or a shallower crack",
        ) from error
    return sound, _opened(sound, n_cells)


def tooth_compliance_with(mesh: SectorMesh, chain: FloatArray, grid: FlankGrid, spread: Spread) -> FloatArray:
    """Compliance between the flank points of the tooth of a sector that is closed to a ring by others."""
    stiffness, kept = _ring(mesh, chain)
    rows = flank_rows(mesh, grid, spread, np.arange(mesh.n_nodes), 3 * mesh.n_nodes)[:, kept]
    compliance: FloatArray = rows @ factorised(stiffness)(rows.T)
    return compliance


def _ring(mesh: SectorMesh, chain: FloatArray) -> tuple[sparse.csc_array, IntArray]:
    """Stiffness of a sector, closed to a ring by others, over its degrees of freedom that are not held."""
    own = sector_matrices(mesh)[0]
    ends = np.concatenate((_free_side(mesh, mesh.high_side), _free_side(mesh, mesh.low_side)))
    places = (np.repeat(ends, len(ends)), np.tile(ends, len(ends)))
    stiffness = own + sparse.csr_array(sparse.coo_array((chain.ravel(), places), shape=own.shape))
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
    one = _condensed(sector_matrices(mesh)[0], mesh)
    n_sectors = blank.n_teeth - 1
    chain: FloatArray | None = None
    power = one
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
    dof: IntArray = (3 * free[:, None] + np.arange(3)).ravel()
    return dof
