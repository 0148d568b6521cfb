"""The mesh of one sector in space: 27-node hexahedra, and which nodes lie where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.mesh_size import MeshSize, along_cells, check_fillet
from sims.reduced_fe.sector_plane import CrackLine, IntArray, SectorPlane, sector_plane


@dataclass(frozen=True)
class SectorMesh:
    """One tooth's sector of a gear.

    Parameters
    ----------
    blank : GearBlank
    size : MeshSize
    points_m : array, (n_nodes, 3)
        x outwards through the tooth's middle, y, z along the shaft from the middle of the face.
    cells : array of int, (n_cells, 3, 3, 3)
        Node at [row, column, layer].
    low_side, high_side : arrays of int
        Nodes on the sides at −π/z and +π/z, pairwise: the high side of a sector is the low side of the next.
    bore : array of int, (n_across, n_layers)
        Nodes on the bore.
    tooth : array of int, (2 n_up + 1, 2 n_across + 1, n_layers)
        Nodes of the tooth at [row, column, layer]; row 0 is at the fillets' middles, the last column on flank 0.
    """

    blank: GearBlank
    size: MeshSize
    points_m: FloatArray
    cells: IntArray
    low_side: IntArray
    high_side: IntArray
    bore: IntArray
    tooth: IntArray

    @property
    def n_nodes(self) -> int:
        """Of the sector, with both of its sides."""
        return len(self.points_m)

    @property
    def n_dof(self) -> int:
        """Of the whole gear."""
        return 3 * (self.n_nodes - len(self.high_side)) * self.blank.n_teeth

    @property
    def angles_rad(self) -> FloatArray:
        """Polar angle of each node."""
        angle: FloatArray = np.arctan2(self.points_m[:, 1], self.points_m[:, 0])
        return angle


def sector_mesh(blank: GearBlank, size: MeshSize, crack: CrackLine | None = None) -> SectorMesh:
    """Mesh one sector; with a crack, along its line, without opening it.

    Raises
    ------
    InputError
        If the mesh is too coarse for the fillet or has a folded cell.
    """
    from sims.reduced_fe.mesh_quality import check_jacobians

    check_fillet(blank, size)
    plane = sector_plane(blank, size, crack)
    layers_mm, web = _layers(blank, size)
    n_layers = len(layers_mm)
    in_plane = np.repeat(plane.points_mm, n_layers, axis=0)
    points = np.column_stack((in_plane, np.tile(layers_mm, len(plane.points_mm)))) * 1e-3
    every = _extruded(plane.cells, n_layers, range(0, n_layers - 1, 2))
    cells = every
    if web != (0, n_layers - 1):
        web_cells = _extruded(plane.cells[: plane.n_web_cells], n_layers, range(web[0], web[1], 2))
        cells = np.concatenate(
            (web_cells, _extruded(plane.cells[plane.n_web_cells :], n_layers, range(0, n_layers - 1, 2)))
        )
    mesh = _without_loose_nodes(blank, size, points, cells, plane, n_layers)
    if size.order == 1:
        mesh = _corners_alone(mesh)
    check_jacobians(mesh)
    return mesh


def _layers(blank: GearBlank, size: MeshSize) -> tuple[FloatArray, tuple[int, int]]:
    """Heights z of the layers of nodes in mm, and the first and last layer of the web."""
    beside, inside = along_cells(blank, size.n_along)
    face = blank.geometry.face_width_mm
    web = face if blank.web_thickness_mm is None else blank.web_thickness_mm
    middle = np.linspace(-web / 2.0, web / 2.0, 2 * inside + 1)
    low = np.linspace(-face / 2.0, -web / 2.0, 2 * beside + 1)[:-1] if beside else np.empty(0)
    return np.concatenate((low, middle, -low[::-1])), (2 * beside, 2 * (beside + inside))


def _extruded(plane_cells: IntArray, n_layers: int, starts: range) -> IntArray:
    layers = np.array(list(starts))[:, None] + np.arange(3)
    cells: IntArray = plane_cells[:, None, :, :, None] * n_layers + layers[None, :, None, None, :]
    return cells.reshape(-1, 3, 3, 3)


def _without_loose_nodes(
    blank: GearBlank, size: MeshSize, points: FloatArray, cells: IntArray, plane: SectorPlane, n_layers: int
) -> SectorMesh:
    """Renumber so that only nodes that belong to a cell are left: beside a web there are none."""
    used = np.zeros(len(points), dtype=bool)
    used[cells] = True
    number = np.cumsum(used) - 1

    def place(nodes: IntArray) -> IntArray:
        spread: IntArray = nodes[..., None] * n_layers + np.arange(n_layers)
        return spread

    low, high = place(plane.low_side).ravel(), place(plane.high_side).ravel()
    return SectorMesh(
        blank,
        size,
        points[used],
        number[cells],
        number[low[used[low]]],
        number[high[used[high]]],
        number[place(plane.bore)],
        number[place(plane.tooth)],
    )


def _corners_alone(mesh: SectorMesh) -> SectorMesh:
    """Return the mesh of eight-node cells between the corners of the 27-node ones."""
    corners = mesh.cells[:, ::2, ::2, ::2]
    used = np.zeros(mesh.n_nodes, dtype=bool)
    used[corners] = True
    number = np.cumsum(used) - 1
    return SectorMesh(
        mesh.blank,
        mesh.size,
        mesh.points_m[used],
        number[corners],
        number[mesh.low_side[used[mesh.low_side]]],
        number[mesh.high_side[used[mesh.high_side]]],
        number[mesh.bore[::2, ::2]],
        number[mesh.tooth[::2, ::2, ::2]],
    )
