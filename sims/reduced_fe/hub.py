"""Mean motion of the bore: one node at the hub, spread over the bore's surface (RBE3)."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.line_weights import whole_weights
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray

ComplexArray = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


def hub_rows(mesh: SectorMesh, n_dof: int, places: IntArray) -> FloatArray:
    """Return a sector's share of the bore's mean motion, (6, n_dof), from cylindrical components.

    The rigid motion closest to that of the bore's surface, weighted by area:

        t = Σ w u / Σ w,   θ_x = Σ w (y u_z − z u_y)/Σ w (y² + z²),  …,  θ_z = Σ w r u_θ/Σ w r²

    (over the whole bore the first moments vanish, so that the six are independent). Forces at the hub are spread by the
    transpose: nothing is stiffened.

    Parameters
    ----------
    mesh : SectorMesh
    n_dof : int
    places : array of int
        Place of each of the sector's nodes among those of the degrees of freedom.
    """
    nodes = mesh.bore[:-1]  # the high side belongs to the next sector
    weight = _surface_weights(mesh) / mesh.blank.n_teeth
    points = mesh.points_m[nodes.ravel()]
    x, y, z = points.T
    radius = np.hypot(x, y)
    radial, around = np.column_stack((x, y, 0 * x)) / radius[:, None], np.column_stack((-y, x, 0 * x)) / radius[:, None]
    axes = np.stack((radial, around, np.broadcast_to([0.0, 0.0, 1.0], points.shape)), axis=1)  # (node, component, xyz)
    about = np.cross(points[:, None, :], axes)  # moment of each component's unit force
    square = np.array([np.sum(weight * (radius**2 / 2.0 + z**2))] * 2 + [np.sum(weight * radius**2)])
    square *= mesh.blank.n_teeth
    share = np.concatenate((axes, about / square), axis=2) * weight[:, None, None]
    rows = np.zeros((6, n_dof))
    dof = 3 * places[nodes.ravel()][:, None] + np.arange(3)
    for motion in range(6):
        np.add.at(rows[motion], dof, share[:, :, motion])
    return rows


def hub_sum(n: int, n_sectors: int) -> ComplexArray:
    """Σ_k R(2πk/z) e^{2πink/z}, (6, 6): what the shares of all sectors add up to; 0 unless n is 0 or 1."""
    total = np.zeros((6, 6), dtype=np.complex128)
    for k in range(n_sectors):
        angle = 2.0 * pi * k / n_sectors
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        total += np.kron(np.eye(2), turn) * np.exp(1j * n * angle)
    total[np.abs(total) < 1e-9 * n_sectors] = 0.0
    return total


def _surface_weights(mesh: SectorMesh) -> FloatArray:
    """Part of the sector's bore area that belongs to each own node, raveled; they add up to 1."""
    around = whole_weights(np.linspace(0.0, 1.0, mesh.bore.shape[0]), mesh.size.order)
    around[0] += around[-1]
    along = whole_weights(mesh.points_m[mesh.bore[0], 2], mesh.size.order)
    weights: FloatArray = np.outer(around[:-1], along).ravel()
    return weights
