"""The transverse plane of one sector: nine-node quadrilaterals in five blocks.

Columns run across the sector from the ray at −π/z to that at +π/z: gap, tooth, gap. Rows run outwards. Gap and tooth
columns stand on the same rows below the fillets' middles; only the tooth's columns go on up to the tip. Three cells
meet at the middle of a fillet, each with about 60°.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.geometry import GearGeometry
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.mesh_size import MeshSize, body_cells
from sims.reduced_fe.tooth_side import Curve, fillet_split, gap_curve, row_places, side_curve, with_middles

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


class SectorPlane(NamedTuple):
    """Nodes and cells of the plane.

    Attributes
    ----------
    points_mm : array, (n_nodes, 2)
        x outwards through the tooth's middle, y.
    cells : array of int, (n_cells, 3, 3)
        Node at [row, column] of each nine-node cell.
    n_web_cells : int
        The first cells are those of the web, which may be thinner than the face.
    low_side, high_side : arrays of int
        Nodes on the rays at −π/z and +π/z, pairwise.
    bore : array of int
        Nodes on the bore, from the low to the high side.
    tooth : array of int, (2 n_up + 1, 2 n_across + 1)
        Nodes of the tooth, [row, column]; row 0 is at the fillets' middles, column −1 on flank 0 (y > 0).
    """

    points_mm: FloatArray
    cells: IntArray
    n_web_cells: int
    low_side: IntArray
    high_side: IntArray
    bore: IntArray
    tooth: IntArray


class CrackLine(NamedTuple):
    """A straight line from the middle of the fillet of flank 0 that the lowest row of the tooth's nodes follows.

    Attributes
    ----------
    tip_mm : tuple
        x and y of its end.
    n_cells : int
        Columns of cells along it.
    """

    tip_mm: tuple[float, float]
    n_cells: int


def sector_plane(blank: GearBlank, size: MeshSize, crack: CrackLine | None = None) -> SectorPlane:
    """Mesh the transverse plane of one sector; with a crack, along its line (the nodes on it are not doubled here)."""
    foot = _foot(blank.geometry, size) if crack is None else _cracked_foot(blank.geometry, size, crack)
    below, above = _body_grid(blank, size, foot), _tooth_grid(blank.geometry, size, foot)
    n_columns = below.shape[1]
    first, last = 2 * size.n_gap, 2 * size.n_gap + 2 * size.n_across
    below_nodes = np.arange(below.shape[0] * n_columns).reshape(below.shape[:2])
    top = below_nodes[-1, first : last + 1]
    above_nodes = below_nodes.size + np.arange((above.shape[0] - 1) * above.shape[1]).reshape(-1, above.shape[1])
    tooth = np.vstack((top[None], above_nodes))
    points = np.vstack((below.reshape(-1, 2), above[1:].reshape(-1, 2)))
    in_hub, in_web = body_cells(blank, size.n_body)
    web = _cells(below_nodes[2 * in_hub : 2 * (in_hub + in_web) + 1])
    hub = _cells(below_nodes[: 2 * in_hub + 1])
    cells = np.concatenate((web, hub, _cells(below_nodes[2 * (in_hub + in_web) :]), _cells(tooth)))
    return SectorPlane(
        points, cells, len(web), below_nodes[:, 0].copy(), below_nodes[:, -1].copy(), below_nodes[0].copy(), tooth
    )


def _cells(nodes: IntArray) -> IntArray:
    """Nine-node cells of a grid of nodes [row, column], as (n, row, column)."""
    rows, columns = (np.arange(0, n - 1, 2) for n in nodes.shape)
    if not len(rows):
        return np.empty((0, 3, 3), dtype=np.int64)
    step = np.arange(3)
    r = rows[:, None, None, None] + step[None, None, :, None]
    c = columns[None, :, None, None] + step[None, None, None, :]
    cells: IntArray = nodes[r, c].reshape(-1, 3, 3)
    return cells


def _body_grid(blank: GearBlank, size: MeshSize, foot: FloatArray) -> FloatArray:
    """Points [row, column, xy] from the bore to the root circle and the line between the fillets' middles."""
    g = blank.geometry
    top = _top_line(g, size, foot)
    angles = _rim_angles(g, size)
    ring = blank.rim_radius_mm * np.column_stack((np.cos(angles), np.sin(angles)))
    # Closer below the teeth, where the fillets press into the body.
    out = with_middles(1.0 - (1.0 - np.arange(size.n_rim + 1) / size.n_rim) ** 1.7)[1:, None, None]
    rim = ring[None] * (1.0 - out) + top[None] * out
    hub, web = body_cells(blank, size.n_body)
    radii = [g.bore_mm + (blank.hub_radius_mm - g.bore_mm) * _even(hub)[:-1]] if hub else []
    # Cells of a disc grow from the bore with the radius; a web is divided evenly.
    start, end = blank.hub_radius_mm, blank.rim_radius_mm
    radii.append(_graded(start, end, web))
    body_angles = _eased(angles, radii, g)
    radius = np.concatenate(radii)
    body = radius[:, None, None] * np.stack((np.cos(body_angles), np.sin(body_angles)), axis=-1)
    return np.concatenate((body, rim))


def _graded(start: float, end: float, n_cells: int) -> FloatArray:
    """2n + 1 radii; corners in geometric progression (cells as square as they can be), middles halfway."""
    return with_middles(start * (end / start) ** (np.arange(n_cells + 1) / n_cells))


def _eased(angles: FloatArray, radii: list[FloatArray], gear: GearGeometry) -> FloatArray:
    """Angles of columns [row, column]: as at the rim there, even at the bore."""
    radius = np.concatenate(radii)
    part = ((radius - gear.bore_mm) / (radius[-1] - gear.bore_mm))[:, None]
    even = np.linspace(angles[0], angles[-1], len(angles))
    eased: FloatArray = angles * part + even * (1.0 - part)
    return eased


def _rim_angles(gear: GearGeometry, size: MeshSize) -> FloatArray:
    """Angles of the columns at the rim's inner radius: between even cells and straight below the fillets' middles."""
    half = pi / gear.teeth
    split = fillet_split(gear)
    straight = np.arctan2(split.y_mm, split.x_mm)
    even = half * size.n_across / (size.n_across + 2 * size.n_gap)
    corner = (straight + min(even, straight)) / 2.0
    gap = -half + (half - corner) * _even(size.n_gap)[:-1]
    return np.concatenate((gap, corner * (2.0 * _even(size.n_across) - 1.0), -gap[::-1]))


def _top_line(gear: GearGeometry, size: MeshSize, foot: FloatArray) -> FloatArray:
    """Points (n_columns, 2): root circle and half fillet, across below the tooth, half fillet and root circle."""
    right = gap_curve(gear)[0](_even(size.n_gap))[:, ::-1].T
    left = right[::-1] * np.array([1.0, -1.0])
    return np.concatenate((left[:-1], foot, right[1:]))


def _foot(gear: GearGeometry, size: MeshSize) -> FloatArray:
    """Across from one fillet's middle to the other's, sagging a little so that three equal angles meet there."""
    split = fillet_split(gear)
    place = 2.0 * _even(size.n_across) - 1.0
    sag = 0.12 * split.y_mm
    return np.column_stack((split.x_mm - sag * (1.0 - place**2), split.y_mm * place))


def _cracked_foot(gear: GearGeometry, size: MeshSize, crack: CrackLine) -> FloatArray:
    """Across from the fillet's middle opposite the crack to its tip, and along the crack to its mouth."""
    split = fillet_split(gear)
    ends = np.array([[split.x_mm, -split.y_mm], crack.tip_mm, [split.x_mm, split.y_mm]])
    rest, along = _even(size.n_across - crack.n_cells)[:, None], _even(crack.n_cells)[1:, None]
    return np.concatenate((ends[0] + (ends[1] - ends[0]) * rest, ends[1] + (ends[2] - ends[1]) * along))


def _tooth_grid(gear: GearGeometry, size: MeshSize, foot: FloatArray) -> FloatArray:
    """Points [row, column, xy] from between the fillets' middles to the tip, by transfinite interpolation."""
    side: Curve = side_curve(gear)[0]
    up, across = _even(size.n_up), 2.0 * _even(size.n_across) - 1.0
    right = side(row_places(gear, size.n_up)).T
    left = right * np.array([1.0, -1.0])
    half = np.arctan2(right[-1, 1], right[-1, 0])
    tip = gear.tip_radius_mm * np.column_stack((np.cos(half * across), np.sin(half * across)))
    w, s = ((across + 1.0) / 2.0)[None, :, None], up[:, None, None]
    sides = left[:, None] * (1.0 - w) + right[:, None] * w
    ends = foot[None] * (1.0 - s) + tip[None] * s
    corners = (1.0 - s) * ((1.0 - w) * left[0] + w * right[0]) + s * ((1.0 - w) * left[-1] + w * right[-1])
    grid: FloatArray = sides + ends - corners
    return grid


def _even(n_cells: int) -> FloatArray:
    """2n + 1 even places, 0 to 1."""
    return np.linspace(0.0, 1.0, 2 * n_cells + 1)
