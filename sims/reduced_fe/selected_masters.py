"""Master degrees of freedom of a Craig–Bampton reduction: hub, contact patches, and auxiliary nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.cyclic import CyclicGear
from sims.reduced_fe.cyclic_modes import CyclicModes
from sims.reduced_fe.flank_rows import flank_grid, height_nodes, plane_row, point_and_push, slice_weights
from sims.reduced_fe.hub import ComplexArray, hub_sum
from sims.reduced_fe.sector_plane import IntArray

N_HUB = 6


class Masters(NamedTuple):
    """Masters besides the six of the hub, which always come first.

    Attributes
    ----------
    rows : array, (n_rows, n_own_dof)
        Different rows over a sector's own degrees of freedom.
    row_of : array of int, (n,)
        Row of each master.
    tooth_of : array of int, (n,)
        Sector of each master.
    """

    rows: FloatArray
    row_of: IntArray
    tooth_of: IntArray

    @property
    def n_masters(self) -> int:
        """With the hub's."""
        return N_HUB + len(self.row_of)


def contact_masters(gear: CyclicGear, teeth: Sequence[int] = (0, 1, 2, 3), n_slices: int = 5) -> Masters:
    """Contact patches in the middle of the flanks of some teeth: per slice the motion along the push, the flank and z.

    Parameters
    ----------
    gear : CyclicGear
    teeth : sequence of int
    n_slices : int
    """
    mesh, n_dof = gear.mesh, 3 * len(gear.own_nodes)
    roll = float(np.mean(flank_grid(mesh.blank.geometry, 2, 1).roll_rad))
    point, push = point_and_push(mesh.blank.geometry, roll, 1.0)
    nodes = height_nodes(mesh, roll, "patch", 0)
    along_flank = np.array([-push[1], push[0]])
    axial = np.column_stack((np.zeros((len(nodes.weights), 2)), nodes.weights))
    planes = (plane_row(mesh, nodes, point, push), plane_row(mesh, nodes, point, along_flank), axial)
    dof = 3 * gear.own_places[nodes.nodes][..., None] + np.arange(3)
    rows = np.zeros((n_slices, 3, n_dof))
    for k, z in enumerate(flank_grid(mesh.blank.geometry, 2, n_slices).z_m):
        weights = slice_weights(mesh, float(z), n_slices, "patch")
        for component, plane in enumerate(planes):
            np.add.at(rows[k, component], dof, plane[:, None, :] * weights[None, :, None])
    n = 3 * n_slices
    row_of, tooth_of = np.tile(np.arange(n), len(teeth)), np.repeat(np.asarray(teeth, dtype=np.int64), n)
    return Masters(rows.reshape(n, n_dof), row_of, tooth_of)


def with_auxiliary(gear: CyclicGear, masters: Masters, modes: CyclicModes, n_nodes: int) -> Masters:
    """Add the nodes of the whole gear that tell its modes apart best, three degrees of freedom each.

    One after the other, the node that most increases det(Q), Q = Σ over masters of aᵀa, a a master's motion in the
    modes (each scaled to its largest motion).

    Source: D. C. Kammer, Sensor placement for on-orbit modal identification and correlation of large space structures,
    Journal of Guidance, Control, and Dynamics 14 (1991), for the determinant as the criterion.
    """
    if not n_nodes:
        return masters
    at_nodes = _real_motion(gear, modes)  # (sector, node, 3, mode)
    scale = np.abs(at_nodes).max(axis=(0, 1, 2))
    at_nodes = at_nodes / scale
    at_masters = motion_at(masters, gear, modes)[N_HUB:] / scale
    information = at_masters.T @ at_masters + 1e-6 * np.eye(len(scale))
    flat = at_nodes.reshape(-1, 3, len(scale))
    chosen: list[int] = []
    for _ in range(n_nodes):
        small = np.eye(3) + flat @ np.linalg.inv(information) @ flat.transpose(0, 2, 1)
        gain = np.linalg.det(small)
        gain[chosen] = 0.0
        best = int(np.argmax(gain))
        chosen.append(best)
        information += flat[best].T @ flat[best]
    return _with_nodes(masters, np.array(chosen), len(gear.own_nodes))


def phased_rows(masters: Masters, gear: CyclicGear, n: int) -> tuple[ComplexArray, ComplexArray]:
    """Rows of nodal diameter n and how masters follow from them.

    Returns
    -------
    rows : array, (n_rows + 6, n_own_dof)
        Hub first.
    turn : array, (n_masters, n_rows + 6)
        Master = turn · rows · U; a force on it acts as the conjugate transpose, divided by z.
    """
    z, n_rows = gear.n_sectors, len(masters.rows)
    hub = hub_sum(n, z) @ gear.hub if n <= 1 else np.zeros((N_HUB, masters.rows.shape[1]))
    turn = np.zeros((masters.n_masters, N_HUB + n_rows), dtype=np.complex128)
    turn[:N_HUB, :N_HUB] = np.eye(N_HUB)
    place = np.arange(N_HUB, masters.n_masters)
    turn[place, N_HUB + masters.row_of] = np.exp(1j * gear.phase_rad(n) * masters.tooth_of)
    return np.vstack((hub, masters.rows)).astype(np.complex128), turn


def _with_nodes(masters: Masters, chosen: IntArray, n_own: int) -> Masters:
    sectors, nodes = np.divmod(chosen, n_own)
    rows = np.zeros((3 * len(chosen), 3 * n_own))
    for k, node in enumerate(nodes):
        rows[3 * k + np.arange(3), 3 * node + np.arange(3)] = 1.0
    return Masters(
        np.vstack((masters.rows, rows)),
        np.concatenate((masters.row_of, len(masters.rows) + np.arange(len(rows)))),
        np.concatenate((masters.tooth_of, np.repeat(sectors, 3))),
    )


def _real_motion(gear: CyclicGear, modes: CyclicModes) -> FloatArray:
    """Motion of all nodes in the real modes (sector, node, component, mode)."""
    columns = []
    for k, n in enumerate(modes.nodal_diameters):
        waves = np.exp(1j * gear.phase_rad(int(n)) * np.arange(gear.n_sectors))[:, None] * modes.shapes[:, k]
        columns += [waves.real, waves.imag][: int(modes.multiplicity(gear.n_sectors)[k])]
    motion = np.stack(columns, axis=-1)
    return motion.reshape(gear.n_sectors, -1, 3, motion.shape[-1])


def motion_at(masters: Masters, gear: CyclicGear, modes: CyclicModes) -> FloatArray:
    """Motion of the masters in the real modes, (n_masters, n_modes)."""
    columns = []
    for k, n in enumerate(modes.nodal_diameters):
        rows, turn = phased_rows(masters, gear, int(n))
        moved = turn @ (rows @ modes.shapes[:, k])
        columns += [moved.real, moved.imag][: int(modes.multiplicity(gear.n_sectors)[k])]
    return np.column_stack(columns)
