"""Is a mesh good enough: folded cells, the fillet's shape, volume and inertia."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.mesh.geometry import GearGeometry
from sims.mesh.profile import fillet_outline, involute_outline, root_half_angle_rad
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.elements import cell_fields
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.tooth_side import outline_error_mm


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
