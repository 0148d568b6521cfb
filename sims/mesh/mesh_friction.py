"""Friction of each tooth pair over the mesh at a steady load and speed."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, positive
from sims.mesh.friction import FrictionResult, friction_coefficient, line_contact_pressure_gpa, reduced_modulus_pa
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.stiffness import share_torque
from sims.mesh.table import MeshTable

LEAST_RADIUS = 1e-3
"""In modules: radius of curvature below which a contact, on the base circle, is taken as this curved."""

LEAST_PART = 0.2
"""Part of the load from which a contact's range is told."""


@dataclass(frozen=True)
class MeshFriction:
    """Friction over the mesh; column j is pair ⌊c + ramp/2⌋ − j, 0 where a pair does not touch.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c; pair k enters at c = k.
    coefficient : array, (n, n_slots)
        μ, not below 0.
    friction_n : array, (n, n_slots)
        μ N sgn(v_s): above 0 in approach, below 0 in recess. The driver receives −f across the line of action.
    normal_n : array, (n, n_slots)
        N.
    sliding_mps : array, (n, n_slots)
        v_s = ω2 ρ2 − ω1 ρ1.
    notes : tuple of str
        Where contacts that carry a fifth of the load or more leave the range of the friction regression.
    """

    mesh_cycles: FloatArray
    coefficient: FloatArray
    friction_n: FloatArray
    normal_n: FloatArray
    sliding_mps: FloatArray
    notes: tuple[str, ...] = ()


def friction_over_mesh(
    mesh: GearMesh,
    torque_nm: float,
    speed_rpm: float,
    viscosity_cp: float,
    roughness_um: float,
    mesh_cycles: FloatArray | None = None,
    *,
    table: MeshTable | None = None,
) -> MeshFriction:
    """Friction coefficient and force of each pair, with the load it carries in static equilibrium.

    Parameters
    ----------
    mesh : GearMesh
    torque_nm, speed_rpm : float
        Of the driver, above 0.
    viscosity_cp, roughness_um : float
        As for `friction_coefficient`.
    mesh_cycles : array or None
        c; None: 200 points of one cycle.
    table : MeshTable or None
        Of this mesh, if it is at hand.

    Notes
    -----
    Friction does not act back on the load sharing here. The pressure is that of smooth flanks of full width.
    """
    shared = share_torque(mesh, torque_nm, mesh_cycles, table=table)
    u_1, u_2, radius_m = _speeds_and_radius(mesh, shared.mesh_cycles, positive(speed_rpm, "speed_rpm", "rpm"))
    normal = shared.pair_forces_n
    sliding, entrainment = u_2 - u_1, 0.5 * (u_1 + u_2)
    pressure = line_contact_pressure_gpa(normal, mesh.face_width_m, radius_m, _reduced_modulus_pa(mesh))

    def found(where: NDArray[np.bool_]) -> FrictionResult:
        return friction_coefficient(
            (sliding / entrainment)[where],
            pressure[where],
            viscosity_cp=viscosity_cp,
            roughness_um=roughness_um,
            entrainment_mps=entrainment[where],
            radius_m=radius_m[where],
        )

    coefficient = found(np.ones(normal.shape, dtype=np.bool_)).coefficient.reshape(normal.shape)
    # A pair that takes up its load passes every small pressure, of which there is nothing to say.
    notes = found(normal >= LEAST_PART * normal.sum(axis=1, keepdims=True)).notes
    friction = coefficient * normal * np.sign(sliding)
    return MeshFriction(shared.mesh_cycles, coefficient, friction, normal, sliding, notes)


def _reduced_modulus_pa(mesh: GearMesh) -> float:
    one, two = mesh.material_1, mesh.material_2
    return reduced_modulus_pa(one.youngs_modulus_pa, one.poisson_ratio, two.youngs_modulus_pa, two.poisson_ratio)


def _speeds_and_radius(
    mesh: GearMesh, mesh_cycles: FloatArray, speed_rpm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rolling speeds of both flanks in m/s and the radius of relative curvature in m, (n, n_slots)."""
    pair, least = mesh.pair, LEAST_RADIUS * mesh.pair.driver.module_mm
    newest = np.floor(mesh_cycles + mesh.ramp / 2.0)
    progress = (mesh_cycles - newest)[:, None] + np.arange(mesh.n_slots)
    rho_1, rho_2 = (np.maximum(rho, least) * 1e-3 for rho in pair.contact_radii_mm(progress))
    omega_1 = speed_rpm * pi / 30.0
    omega_2 = omega_1 * pair.driver.teeth / pair.driven.teeth
    return omega_1 * rho_1, omega_2 * rho_2, rho_1 * rho_2 / (rho_1 + rho_2)
