"""What is seen of a gear's mesh from one end of the shaft: faces, their outlines, triangles for colours."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray

_OUTLINES = {
    3: ((0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)),
    2: ((0, 0), (1, 0), (1, 1), (0, 1)),
}
"""Nodes round a face, by nodes each way."""


@dataclass(frozen=True)
class FaceView:
    """Cells' faces towards +z of sectors side by side.

    Parameters
    ----------
    points_mm : array, (n_sectors · n_points, 2)
        x, y.
    triangles : array of int, (n, 3)
        Into the points; eight to each face, or two in a mesh of first order. Before them walls between rim or hub and
        the web further back: without area, until the points are moved.
    outlines_mm : array, (n_faces, 8, 2)
        Round each face, with the middles of its curved edges; (n_faces, 4, 2) in a mesh of first order.
    cells : array of int, (n_faces,)
        Cell of the sector that each face belongs to.
    nodes : array of int, (n_points,)
        Node of the sector behind each of its points; the same for every sector.
    """

    points_mm: FloatArray = field(repr=False)
    triangles: IntArray = field(repr=False)
    outlines_mm: FloatArray = field(repr=False)
    cells: IntArray = field(repr=False)
    nodes: IntArray = field(repr=False)

    def values(self, at_nodes: FloatArray) -> FloatArray:
        """Values at the points, from values at the nodes of as many sectors, (n_sectors, n_nodes)."""
        flat: FloatArray = at_nodes[:, self.nodes].ravel()
        return flat


def face_view(mesh: SectorMesh, sectors: tuple[int, ...] | None = None) -> FaceView:
    """Return the faces that are seen; None: the whole gear."""
    shown = tuple(range(mesh.blank.n_teeth)) if sectors is None else sectors
    cells = _foremost(mesh)
    faces = mesh.cells[cells][:, :, :, -1]  # (n, row, column)
    nodes, inverse = np.unique(faces, return_inverse=True)
    local = inverse.reshape(faces.shape)
    flat = mesh.points_m[nodes, :2] * 1e3
    points, outlines = [], []
    for k in shown:
        c, s = np.cos(k * mesh.blank.pitch_angle_rad), np.sin(k * mesh.blank.pitch_angle_rad)
        turned = flat @ np.array([[c, s], [-s, c]])
        points.append(turned)
        outlines.append(turned[np.stack([local[:, r, q] for r, q in _OUTLINES[faces.shape[1]]], axis=1)])
    one = np.concatenate((_walls(flat, local), _triangles(local)))
    triangles = (one[None] + (len(nodes) * np.arange(len(shown)))[:, None, None]).reshape(-1, 3)
    return FaceView(np.concatenate(points), triangles, np.concatenate(outlines), np.tile(cells, len(shown)), nodes)


def _foremost(mesh: SectorMesh) -> IntArray:
    """Cells with none before them along z: the web lies further back than rim and hub."""
    middle = mesh.points_m[mesh.cells].mean(axis=(1, 2, 3))
    _, column = np.unique(np.round(middle[:, :2], 9), axis=0, return_inverse=True)
    order = np.lexsort((middle[:, 2], column.ravel()))
    last = np.append(np.diff(column.ravel()[order]) != 0, True)
    foremost: IntArray = np.sort(order[last])
    return foremost


def _walls(points_mm: FloatArray, local: IntArray) -> IntArray:
    """Two triangles between edges that lie at one place, one behind the other."""
    place = np.unique(np.round(points_mm, 6), axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(place, kind="stable")
    equal = np.flatnonzero(np.diff(place[order]) == 0)
    behind = np.full(len(points_mm), -1, dtype=np.int64)
    behind[order[equal]], behind[order[equal + 1]] = order[equal + 1], order[equal]
    ends = np.concatenate([np.column_stack((local[:, r, :-1].ravel(), local[:, r, 1:].ravel())) for r in (0, -1)])
    a, b = ends[np.all(behind[ends] >= 0, axis=1)].T
    walls: IntArray = np.concatenate(
        (np.column_stack((a, b, behind[b])), np.column_stack((a, behind[b], behind[a]))), dtype=np.int64
    )
    return walls


def _triangles(local: IntArray) -> IntArray:
    """Two triangles between any four neighbours of each face."""
    found = []
    for r in range(local.shape[1] - 1):
        for q in range(local.shape[2] - 1):
            a, b, c, d = local[:, r, q], local[:, r + 1, q], local[:, r + 1, q + 1], local[:, r, q + 1]
            found += [np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)]
    return np.concatenate(found)
