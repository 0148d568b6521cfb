"""Stiffness and mass of one sector: hexahedra of scikit-fem with 27 or eight nodes, three Gauss points each way."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.mesh import GearGeometry, Material, fillet_outline, involute_outline, root_half_angle_rad
from sims.reduced_fe._blank import GearBlank, outline_error_mm
from sims.reduced_fe._mesh import IntArray, SectorMesh

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


def sector_matrices(mesh: SectorMesh, material: Material | None = None) -> tuple[sparse.csr_array, sparse.csr_array]:
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
    used = mesh.blank.material if material is None else material
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
    condensed: FloatArray = whole[:, :24, :24] - whole[:, :24, 24:] @ np.linalg.solve(inner, whole[:, 24:, :24])
    return condensed


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
        own = int(place @ order)
        value, slope = element.lbasis(local, k)
        values[own], slopes[:, :, own] = value, np.asarray(slope).T
    return values, slopes


# --------------------
# Is a mesh good enough: folded cells, the fillet's shape, volume and inertia.
# --------------------


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
    """Refuse a mesh with a folded cell."""
    determinants = cell_fields(mesh.points_m, mesh.cells).determinants
    folded = int(np.count_nonzero(determinants.min(axis=1) <= 0.0))
    if folded:
        raise InputError(
            f"{folded} of {len(determinants)} cells are folded",
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
