"""The mesh of one sector in space: 27-node hexahedra, and which nodes lie where."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh import GearGeometry
from sims.reduced_fe._blank import (
    Curve,
    GearBlank,
    MeshSize,
    along_cells,
    body_cells,
    check_fillet,
    fillet_split,
    gap_curve,
    row_places,
    side_curve,
    with_middles,
)

# --------------------
# The transverse plane of one sector: nine-node quadrilaterals in five blocks.
#
# Columns run across the sector from the ray at −π/z to that at +π/z: gap, tooth, gap. Rows run outwards. Gap and tooth
# columns stand on the same rows below the fillets' middles; only the tooth's columns go on up to the tip. Three cells
# meet at the middle of a fillet, each with about 60°.
# --------------------


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
    from sims.reduced_fe._elements import check_jacobians

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


# --------------------
# What is seen of a gear's mesh from one end of the shaft: faces, their outlines, triangles for colours.
# --------------------


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


# --------------------
# Weights of nodes for means along a line of cells of three nodes (order 2) or two (order 1).
# --------------------


def line_weights(nodes: FloatArray, low: float, high: float, order: int = 2) -> FloatArray:
    """Weights of the nodes of cells, whose middle nodes lie halfway, for the mean from `low` to `high`.

    Ends beyond the line are moved to its ends; low = high interpolates. The weights add up to 1.
    """
    low, high = max(low, float(nodes[0])), min(high, float(nodes[-1]))
    weights = np.zeros(len(nodes))
    gauss, gauss_weight = np.polynomial.legendre.leggauss(2)
    for k in range(0, len(nodes) - order, order):
        start, end = nodes[k], nodes[k + order]
        a, b = max(low, start), min(high, end)
        if low == high and start <= low <= end:
            at, share = np.array([low]), np.array([1.0])
        elif b > a:
            at, share = (a + b) / 2.0 + (b - a) / 2.0 * gauss, gauss_weight / 2.0 * (b - a) / (high - low)
        else:
            continue
        weights[k : k + order + 1] += _shape((at - start) / (end - start), order) @ share
        if low == high:
            break
    return weights


def whole_weights(places: FloatArray, order: int = 2) -> FloatArray:
    """Weights of the integral over a whole line, divided by its length: they add up to 1. Simpson's or trapezoids."""
    weights = np.zeros(len(places))
    share = np.array([1.0, 4.0, 1.0]) / 6.0 if order == 2 else np.array([0.5, 0.5])
    for k in range(0, len(places) - order, order):
        weights[k : k + order + 1] += (places[k + order] - places[k]) * share
    weights /= places[-1] - places[0]
    return weights


def parabolic_weights(n_nodes: int, order: int = 2) -> FloatArray:
    """Weights of the mean over equal cells from 0 to 1 with the density 6t(1 − t); they add up to 1."""
    weights = np.zeros(n_nodes)
    gauss, gauss_weight = np.polynomial.legendre.leggauss(3)
    n_cells = (n_nodes - 1) // order
    for k in range(n_cells):
        t = (k + (gauss + 1.0) / 2.0) / n_cells
        share = gauss_weight / 2.0 / n_cells * 6.0 * t * (1.0 - t)
        weights[order * k : order * (k + 1) + 1] += _shape((gauss + 1.0) / 2.0, order) @ share
    return weights


def _shape(t: FloatArray, order: int) -> FloatArray:
    """Shape functions of a cell at 0 ≤ t ≤ 1, (order + 1, n)."""
    if order == 1:
        return np.array([1 - t, t])
    return np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
