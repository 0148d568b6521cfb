"""Meshes, modes and stresses for other finite-element programs, through meshio."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray

SUFFIXES = (".vtu", ".vtk")
"""Formats that hold 27-node cells."""

_CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]])
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_FACES = np.array([[0, 1, 1], [2, 1, 1], [1, 0, 1], [1, 2, 1], [1, 1, 0], [1, 1, 2]])


def write_vtk(
    path: str | Path, mesh: SectorMesh, values: Mapping[str, FloatArray] | None = None, *, n_sectors: int | None = None
) -> Path:
    """Write sectors of a gear, with values at their nodes, as hexahedra of 27 nodes (VTK type 29) or eight (12).

    Parameters
    ----------
    path : path
        Ends in .vtu or .vtk.
    mesh : SectorMesh
    values : mapping or None
        Name → array of (n_sectors, n_nodes) or (n_sectors, n_nodes, 3), e.g. displacement in m, stress in Pa; vectors
        in the axes of each sector, turned here.
    n_sectors : int or None
        From sector 0 counter-clockwise; None: the whole gear. Nodes that two sectors share are written once.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the name has another ending, an array has another shape, or the file cannot be written.
    """
    import meshio

    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise InputError(f"extension {target.suffix or '(none)'!r}", where=target.name, allowed=" ".join(SUFFIXES))
    n = mesh.blank.n_teeth if n_sectors is None else count(n_sectors, "n_sectors")
    if n > mesh.blank.n_teeth:
        raise InputError(f"n_sectors is {n}", allowed=f"at most {mesh.blank.n_teeth}")
    number = _shared_numbers(mesh, n)
    turns = _turns(mesh, n)
    points = _merged(np.einsum("kij,aj->kai", turns, mesh.points_m), number)
    kind, order = ("hexahedron27", _vtk_order()) if mesh.size.order == 2 else ("hexahedron", _CORNERS // 2 @ [4, 2, 1])
    cells = number[:, mesh.cells.reshape(len(mesh.cells), -1)[:, order]].reshape(-1, len(order))
    point_data = {name: _merged(_turned(name, v, turns, mesh), number) for name, v in (values or {}).items()}
    try:
        meshio.Mesh(points, [(kind, cells)], point_data=point_data).write(target)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", where=str(target)) from None
    return target


def _vtk_order() -> IntArray:
    """Places in `SectorMesh.cells`, raveled, of VTK's nodes: corners, edges, faces, middle."""
    edges = np.array([(_CORNERS[a] + _CORNERS[b]) // 2 for a, b in _EDGES])
    order: IntArray = np.vstack((_CORNERS, edges, _FACES, [[1, 1, 1]])) @ np.array([9, 3, 1])
    return order


def _shared_numbers(mesh: SectorMesh, n_sectors: int) -> IntArray:
    """Number of each sector's nodes, (n_sectors, n_nodes): the high side is the low side of the next sector."""
    own = np.setdiff1d(np.arange(mesh.n_nodes), mesh.high_side)
    number = np.empty((n_sectors + 1, mesh.n_nodes), dtype=np.int64)
    number[:, own] = np.arange(len(own)) + len(own) * np.arange(n_sectors + 1)[:, None]
    last = 0 if n_sectors == mesh.blank.n_teeth else n_sectors
    number[:-1, mesh.high_side] = number[[*range(1, n_sectors), last]][:, mesh.low_side]
    shared = number[:-1]
    _, packed = np.unique(shared, return_inverse=True)
    return packed.reshape(shared.shape)


def _turns(mesh: SectorMesh, n_sectors: int) -> FloatArray:
    angle = mesh.blank.pitch_angle_rad * np.arange(n_sectors)
    c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 0.0 * angle + 1.0
    rows = ((c, -s, zero), (s, c, zero), (zero, zero, one))
    return np.array([[list(column) for column in row] for row in rows]).transpose(2, 0, 1)


def _turned(name: str, values: FloatArray, turns: FloatArray, mesh: SectorMesh) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)[: len(turns)]
    if array.shape[:2] != (len(turns), mesh.n_nodes) or array.shape[2:] not in ((), (3,)):
        raise InputError(
            f"{name} has shape {np.shape(values)}",
            allowed=f"({len(turns)}, {mesh.n_nodes}) or ({len(turns)}, {mesh.n_nodes}, 3)",
        )
    return np.einsum("kij,kaj->kai", turns, array) if array.ndim == 3 else array


def _merged(values: FloatArray, number: IntArray) -> FloatArray:
    merged = np.empty((int(number.max()) + 1, *values.shape[2:]))
    merged[number.ravel()] = values.reshape(-1, *values.shape[2:])
    return merged
