"""The mesh of one sector in space, 27-node hexahedra, and its stiffness and mass by scikit-fem's elements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.fe_gear._blank import (
    Curve,
    GearBlank,
    MeshSize,
    along_cells,
    body_cells,
    check_fillet,
    fillet_split,
    gap_curve,
    outline_error_mm,
    row_places,
    side_curve,
    with_middles,
)
from sims.mesh import GearGeometry, Material, fillet_outline, involute_outline, root_half_angle_rad

# The transverse plane of one sector: nine-node quadrilaterals in five blocks.
#
# Columns run across the sector from the ray at −π/z to that at +π/z: gap, tooth, gap. Rows run outwards. Gap and tooth
# columns stand on the same rows below the fillets' middles; only the tooth's columns go on up to the tip. Three cells
# meet at the middle of a fillet, each with about 60°.

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
    radii.append(with_middles(start * (end / start) ** (np.arange(web + 1) / web)))
    radius = np.concatenate(radii)
    # Columns stand as at the rim there, and evenly at the bore.
    part = ((radius - g.bore_mm) / (radius[-1] - g.bore_mm))[:, None]
    body_angles = angles * part + np.linspace(angles[0], angles[-1], len(angles)) * (1.0 - part)
    body = radius[:, None, None] * np.stack((np.cos(body_angles), np.sin(body_angles)), axis=-1)
    return np.concatenate((body, rim))


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
        return np.arctan2(self.points_m[:, 1], self.points_m[:, 0])


def sector_mesh(blank: GearBlank, size: MeshSize, crack: CrackLine | None = None) -> SectorMesh:
    """Mesh one sector; with a crack, along its line, without opening it.

    Raises
    ------
    InputError
        If the mesh is too coarse for the fillet or has an inverted cell.
    """
    check_fillet(blank, size)
    plane = sector_plane(blank, size, crack)
    layers_mm, web = _layers(blank, size)
    n_layers = len(layers_mm)
    in_plane = np.repeat(plane.points_mm, n_layers, axis=0)
    points = np.column_stack((in_plane, np.tile(layers_mm, len(plane.points_mm)))) * 1e-3
    web_cells = _extruded(plane.cells[: plane.n_web_cells], n_layers, range(web[0], web[1], 2))
    other_cells = _extruded(plane.cells[plane.n_web_cells :], n_layers, range(0, n_layers - 1, 2))
    cells = np.concatenate((web_cells, other_cells))

    def place(nodes: IntArray) -> IntArray:
        return nodes[..., None] * n_layers + np.arange(n_layers)

    low, high, bore, tooth = (place(nodes) for nodes in (plane.low_side, plane.high_side, plane.bore, plane.tooth))
    step = 3 - size.order  # eight-node cells stand between the corners of the 27-node ones
    mesh = _of_used_nodes(
        SectorMesh(
            blank,
            size,
            points,
            cells[:, ::step, ::step, ::step],
            low.ravel(),
            high.ravel(),
            bore[::step, ::step],
            tooth[::step, ::step, ::step],
        )
    )
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


def _of_used_nodes(mesh: SectorMesh) -> SectorMesh:
    """Renumber so that only nodes that belong to a cell are left: beside a web there are none."""
    used = np.zeros(mesh.n_nodes, dtype=bool)
    used[mesh.cells] = True
    number = np.cumsum(used) - 1
    return replace(
        mesh,
        points_m=mesh.points_m[used],
        cells=number[mesh.cells],
        low_side=number[mesh.low_side[used[mesh.low_side]]],
        high_side=number[mesh.high_side[used[mesh.high_side]]],
        bore=number[mesh.bore],
        tooth=number[mesh.tooth],
    )


# What is seen of a gear's mesh from one end of the shaft: faces, their outlines, triangles for colours.

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
        return at_nodes[:, self.nodes].ravel()


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
    of_sector = np.concatenate((_walls(flat, local), _triangles(local)))
    triangles = (of_sector[None] + (len(nodes) * np.arange(len(shown)))[:, None, None]).reshape(-1, 3)
    return FaceView(np.concatenate(points), triangles, np.concatenate(outlines), np.tile(cells, len(shown)), nodes)


def outer_faces(mesh: SectorMesh) -> IntArray:
    """Corners of the faces that a sector shows in its gear, (n, 4), counter-clockwise seen from outside.

    A face of two cells is inside; the sides towards the neighbouring sectors are not shown either.
    """
    last = mesh.cells.shape[1] - 1
    corners = mesh.cells[:, ::last, ::last, ::last]
    sides = []
    for axis in range(3):
        low, high = (np.take(corners, end, axis=axis + 1).reshape(-1, 4)[:, [0, 1, 3, 2]] for end in (0, 1))
        sides += [low, high]
    every = np.concatenate(sides)
    _, first, times = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
    outer = every[first[times == 1]]
    beside = np.isin(outer, mesh.low_side).all(axis=1) | np.isin(outer, mesh.high_side).all(axis=1)
    free: IntArray = outer[~beside]
    # Outwards is away from the middle of the face's own cell.
    owner = np.tile(np.arange(len(mesh.cells)), 6)[first[times == 1]][~beside]
    middle = mesh.points_m[mesh.cells[owner].reshape(len(owner), -1)].mean(axis=1)
    p = mesh.points_m[free]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    inwards = np.einsum("ni,ni->n", normal, p.mean(axis=1) - middle) < 0.0
    free[inwards] = free[inwards][:, ::-1]
    return free


def _foremost(mesh: SectorMesh) -> IntArray:
    """Cells with none before them along z: the web lies further back than rim and hub."""
    middle = mesh.points_m[mesh.cells].mean(axis=(1, 2, 3))
    _, column = np.unique(np.round(middle[:, :2], 9), axis=0, return_inverse=True)
    order = np.lexsort((middle[:, 2], column.ravel()))
    last = np.append(np.diff(column.ravel()[order]) != 0, True)
    return np.sort(order[last])


def _walls(points_mm: FloatArray, local: IntArray) -> IntArray:
    """Two triangles between edges that lie at one place, one behind the other."""
    place = np.unique(np.round(points_mm, 6), axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(place, kind="stable")
    equal = np.flatnonzero(np.diff(place[order]) == 0)
    behind = np.full(len(points_mm), -1, dtype=np.int64)
    behind[order[equal]], behind[order[equal + 1]] = order[equal + 1], order[equal]
    ends = np.concatenate([np.column_stack((local[:, r, :-1].ravel(), local[:, r, 1:].ravel())) for r in (0, -1)])
    a, b = ends[np.all(behind[ends] >= 0, axis=1)].T
    return np.concatenate(
        (np.column_stack((a, b, behind[b])), np.column_stack((a, behind[b], behind[a]))), dtype=np.int64
    )


def _triangles(local: IntArray) -> IntArray:
    """Two triangles between any four neighbours of each face."""
    triangles = []
    for r in range(local.shape[1] - 1):
        for q in range(local.shape[2] - 1):
            a, b, c, d = local[:, r, q], local[:, r + 1, q], local[:, r + 1, q + 1], local[:, r, q + 1]
            triangles += [np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)]
    return np.concatenate(triangles)


# Weights of nodes for means along a line of cells of three nodes (order 2) or two (order 1).


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


GAUSS_ORDER = 5
"""Integrates polynomials up to this degree exactly: three points each way, exact for the mass of a cell with parallel
faces and the usual full integration of its stiffness."""


class CellFields(NamedTuple):
    """Shape functions and their gradients at the Gauss points of each cell, in `SectorMesh`'s order of nodes.

    Attributes
    ----------
    values : array, (n_local, n_points)
        n_local is 27, or 8 in a mesh of first order.
    gradients : array, (n_cells, n_points, 3, n_local)
        1/m.
    volumes : array, (n_cells, n_points)
        Weight times Jacobian determinant, m³.
    determinants : array, (n_cells, n_points)
        m³ per unit cube.
    """

    values: FloatArray
    gradients: FloatArray
    volumes: FloatArray
    determinants: FloatArray


def cell_fields(points_m: FloatArray, cells: IntArray) -> CellFields:
    """Evaluate the isoparametric cells at their Gauss points."""
    local, weights = _gauss()
    values, slopes = _shape_functions(local, cells.shape[1])
    gradients, determinants = _gradients(points_m, cells, slopes)
    return CellFields(values, gradients, weights * determinants, determinants)


def cell_gradients_at_nodes(points_m: FloatArray, cells: IntArray) -> FloatArray:
    """Gradients of the shape functions at each cell's own nodes, (n_cells, n_local, 3, n_local); 1/m."""
    places = np.linspace(0.0, 1.0, cells.shape[1])
    local = np.array([[x, y, z] for x in places for y in places for z in places]).T
    return _gradients(points_m, cells, _shape_functions(local, cells.shape[1])[1])[0]


def sector_matrices(mesh: SectorMesh) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness (N/m) and consistent mass (kg) of one sector in cylindrical components.

    K_e[(a,i),(b,j)] = ∫ λ ∂_i N_a ∂_j N_b + μ (∂_j N_a ∂_i N_b + δ_ij ∇N_a·∇N_b) dV,  M_e = ρ ∫ N_a N_b dV

    Degrees of freedom are 3·node + component; the components of every node are radial, tangential, axial, so that
    neighbouring sectors have the same matrices.

    Eight-node cells have the incompatible modes 4t(1 − t) of each direction besides, eliminated cell by cell: without
    them they would be far too stiff in bending.

    Source: T. J. R. Hughes, *The Finite Element Method*, 1987, ch. 2 and 3; R. L. Taylor, P. J. Beresford,
    E. L. Wilson, A non-conforming element for stress analysis, International Journal for Numerical Methods in
    Engineering 10 (1976).
    """
    used = mesh.blank.material
    fields = cell_fields(mesh.points_m, mesh.cells)
    nodes = mesh.cells.reshape(len(mesh.cells), -1)
    turn = cylindrical_turn(mesh)
    if nodes.shape[1] == 27:
        cells = _cell_stiffness(fields.gradients, fields.volumes, used)
    else:
        cells = _incompatible_stiffness(mesh, fields, used)
    stiffness = _assembled(cells, nodes, mesh.n_nodes)
    mass = _assembled(_cell_mass(fields, used.density_kg_m3), nodes, mesh.n_nodes)
    return sparse.csr_array(turn @ stiffness @ turn.T), sparse.csr_array(turn @ mass @ turn.T)


def cylindrical_turn(mesh: SectorMesh) -> sparse.csr_array:
    """T: cylindrical = T · Cartesian components, for all nodes of the sector."""
    angle = mesh.angles_rad
    c, s = np.cos(angle), np.sin(angle)
    blocks = np.zeros((mesh.n_nodes, 3, 3))
    blocks[:, 0, 0], blocks[:, 0, 1], blocks[:, 1, 0], blocks[:, 1, 1], blocks[:, 2, 2] = c, s, -s, c, 1.0
    n = mesh.n_nodes
    return sparse.csr_array(sparse.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)))


def lame_pa(material: Material) -> tuple[float, float]:
    """λ and μ."""
    e, nu = material.youngs_modulus_pa, material.poisson_ratio
    return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))


def _gradients(points_m: FloatArray, cells: IntArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients in space (n_cells, n_points, 3, n_local) and Jacobian determinants (n_cells, n_points)."""
    corners = points_m[cells.reshape(len(cells), -1)]
    jacobian = np.einsum("qin,cnj->cqij", slopes, corners, optimize=True)
    gradients = np.linalg.solve(jacobian, np.broadcast_to(slopes, (len(cells), *slopes.shape)))
    return gradients, np.linalg.det(jacobian)


def _cell_stiffness(gradients: FloatArray, volumes: FloatArray, material: Material) -> FloatArray:
    lam, mu = lame_pa(material)
    n, n_local = len(volumes), gradients.shape[3]
    weighted = gradients * volumes[:, :, None, None]  # (cell, point, i, a)
    flat = gradients.reshape(n, -1, 3 * n_local)
    products = np.matmul(weighted.reshape(flat.shape).transpose(0, 2, 1), flat).reshape(n, 3, n_local, 3, n_local)
    # products[c, i, a, j, b] = ∫ ∂_i N_a ∂_j N_b
    trace = np.einsum("ciaib->cab", products)
    cells = lam * products + mu * products.transpose(0, 3, 2, 1, 4)
    for i in range(3):
        cells[:, i, :, i, :] += mu * trace
    ordered: FloatArray = cells.transpose(0, 2, 1, 4, 3).reshape(n, 3 * n_local, 3 * n_local)
    return ordered


def _incompatible_stiffness(mesh: SectorMesh, fields: CellFields, material: Material) -> FloatArray:
    """K_uu − K_ua K_aa⁻¹ K_au; gradients of the modes by the Jacobian of the cell's middle, so that patches pass."""
    local, _ = _gauss()
    middle = _shape_functions(np.full((3, 1), 0.5), 2)[1][0]
    jacobian = np.einsum("in,cnj->cij", middle, mesh.points_m[mesh.cells.reshape(len(mesh.cells), -1)])
    slopes = np.einsum("iq,ia->qia", 4.0 * (1.0 - 2.0 * local), np.eye(3))
    modes = np.linalg.solve(jacobian[:, None], np.broadcast_to(slopes, (len(jacobian), *slopes.shape)))
    modes = modes * (np.linalg.det(jacobian)[:, None] / fields.determinants)[:, :, None, None]
    whole = _cell_stiffness(np.concatenate((fields.gradients, modes), axis=3), fields.volumes, material)
    inner = whole[:, 24:, 24:]
    return whole[:, :24, :24] - whole[:, :24, 24:] @ np.linalg.solve(inner, whole[:, 24:, :24])


def _cell_mass(fields: CellFields, density: float) -> FloatArray:
    n, n_local = len(fields.volumes), len(fields.values)
    weighted = density * fields.volumes[:, None, :] * fields.values[None]
    scalar = weighted @ fields.values.T
    cells = np.zeros((n, n_local, 3, n_local, 3))
    for i in range(3):
        cells[:, :, i, :, i] = scalar
    return cells.reshape(n, 3 * n_local, 3 * n_local)


def _assembled(cell_matrices: FloatArray, nodes: IntArray, n_nodes: int) -> sparse.csr_array:
    dof = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
    rows, columns = np.repeat(dof, dof.shape[1], axis=1).ravel(), np.tile(dof, (1, dof.shape[1])).ravel()
    size = 3 * n_nodes
    summed = sparse.coo_array((cell_matrices.ravel(), (rows, columns)), shape=(size, size)).tocsr()
    summed.data[np.abs(summed.data) < 1e-16 * np.abs(summed.data).max()] = 0.0
    summed.eliminate_zeros()
    return summed


def _gauss() -> tuple[FloatArray, FloatArray]:
    """Gauss points (3, n) and weights on the unit cube."""
    from skfem.element import ElementHex2
    from skfem.quadrature import get_quadrature

    local, weights = get_quadrature(ElementHex2, GAUSS_ORDER)
    return local, weights


def _shape_functions(local: FloatArray, n_each_way: int) -> tuple[FloatArray, FloatArray]:
    """Values (n_local, n) and slopes (n, 3, n_local) at local points, in the order of the cells' nodes."""
    from skfem.element import ElementHex1, ElementHex2

    element: Any = ElementHex2() if n_each_way == 3 else ElementHex1()
    n_local = n_each_way**3
    values, slopes = np.empty((n_local, local.shape[1])), np.empty((local.shape[1], 3, n_local))
    order = n_each_way ** np.array([2, 1, 0])
    for k, place in enumerate(np.rint((n_each_way - 1) * np.asarray(element.doflocs)).astype(int)):
        node = int(place @ order)
        value, slope = element.lbasis(local, k)
        values[node], slopes[:, :, node] = value, np.asarray(slope).T
    return values, slopes


# Is a mesh good enough: folded cells, the fillet's shape, volume and inertia.


class MeshQuality(NamedTuple):
    """Quality of a mesh, and its mass properties.

    Attributes
    ----------
    scaled_jacobian : array, (n_cells,)
        Least over mean Jacobian determinant at the Gauss points of each cell: 1 for a parallelepiped, 0 where it folds.
    outline_error_mm : float
        Largest distance of the cells' edges from the true outline.
    volume_m3, mass_kg, polar_inertia_kg_m2, diametral_inertia_kg_m2 : float
        Of the whole gear.
    true_volume_m3, true_polar_inertia_kg_m2 : float
        Of the true outline, by an integral along it.
    """

    scaled_jacobian: FloatArray
    outline_error_mm: float
    volume_m3: float
    mass_kg: float
    polar_inertia_kg_m2: float
    diametral_inertia_kg_m2: float
    true_volume_m3: float
    true_polar_inertia_kg_m2: float


def mesh_quality(mesh: SectorMesh) -> MeshQuality:
    """Jacobians, outline and mass properties of a mesh."""
    blank, fields = mesh.blank, cell_fields(mesh.points_m, mesh.cells)
    places = np.einsum(
        "nq,cnj->cqj", fields.values, mesh.points_m[mesh.cells.reshape(len(mesh.cells), -1)], optimize=True
    )
    weight = fields.volumes * blank.n_teeth
    density = blank.material.density_kg_m3
    in_plane = float(np.sum(weight * (places[..., 0] ** 2 + places[..., 1] ** 2)))
    along = float(np.sum(weight * places[..., 2] ** 2))
    volume = float(weight.sum())
    true_volume, true_inertia = true_mass_properties(blank)
    return MeshQuality(
        fields.determinants.min(axis=1) / fields.determinants.mean(axis=1),
        outline_error_mm(blank.geometry, mesh.size.n_gap, mesh.size.n_up, mesh.size.order),
        volume,
        volume * density,
        in_plane * density,
        (in_plane / 2.0 + along) * density,
        true_volume,
        true_inertia,
    )


def check_jacobians(mesh: SectorMesh) -> None:
    """Refuse a mesh with an inverted cell."""
    determinants = cell_fields(mesh.points_m, mesh.cells).determinants
    folded = int(np.count_nonzero(determinants.min(axis=1) <= 0.0))
    if folded:
        raise InputError(
            f"{folded} of {len(determinants)} cells are inverted",
            allowed="none",
            remedy="change the numbers of cells, or the rim and hub thickness",
        )


def true_mass_properties(blank: GearBlank) -> tuple[float, float]:
    """Volume (m³) and polar moment of inertia (kg m²) of the true outline, by integrals along it.

    A = ½ ∮ r² dφ and ∫ r² dA = ¼ ∮ r⁴ dφ, less bore and what the web leaves out.
    """
    g = blank.geometry
    area, second = _tooth_integrals(g)
    face = g.face_width_mm
    ring = 0.0 if blank.web_thickness_mm is None else face - blank.web_thickness_mm
    outer, inner, bore = blank.rim_radius_mm, blank.hub_radius_mm, g.bore_mm
    volume = (area - np.pi * bore**2) * face - np.pi * (outer**2 - inner**2) * ring
    inertia = (second - np.pi / 2.0 * bore**4) * face - np.pi / 2.0 * (outer**4 - inner**4) * ring
    return float(volume * 1e-9), float(inertia * 1e-15 * blank.material.density_kg_m3)


def _tooth_integrals(g: GearGeometry) -> tuple[float, float]:
    """∫ dA and ∫ r² dA inside the gear's outline, mm² and mm⁴."""
    node, weight = np.polynomial.legendre.leggauss(60)
    area, second = 0.0, 0.0
    for outline, low, high in (
        (fillet_outline, np.pi / 2.0, g.pressure_angle_rad),
        (involute_outline, g.form_roll_rad, g.tip_roll_rad),
    ):
        t = (low + high) / 2.0 + (high - low) / 2.0 * node
        at, step = outline(g, t), 1e-6
        before, after = outline(g, t - step), outline(g, t + step)
        dy = (after.y_mm - before.y_mm) / (2.0 * step)
        swept = -(at.x_mm * dy - at.y_mm * at.dx_mm) * weight * (high - low) / 2.0
        square = at.x_mm**2 + at.y_mm**2
        area, second = area + float(np.sum(swept)) / 2.0, second + float(np.sum(swept * square)) / 4.0
    land = np.pi / g.teeth - root_half_angle_rad(g)
    tip = g.tip_thickness_mm / (2.0 * g.tip_radius_mm)
    area += g.root_radius_mm**2 * land / 2.0 + g.tip_radius_mm**2 * tip / 2.0
    second += g.root_radius_mm**4 * land / 4.0 + g.tip_radius_mm**4 * tip / 4.0
    return 2.0 * g.teeth * area, 2.0 * g.teeth * second
