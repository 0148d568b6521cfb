"""The pair as a linear system about its loaded state: eigenfrequencies over the mesh angle."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.machine.operation import Operation
from sims.mesh.stiffness import one_mesh_cycle
from sims.reduced_fe.dynamics_constants import LEAST_FORCE_N, Constants, FlexiblePair, constants
from sims.reduced_fe.maps_static import contact_state

LEAST_HZ = 200.0
"""Modes below it are those of rotors on their couplings."""


def eigenfrequencies_hz(
    pair: FlexiblePair,
    operation: Operation,
    mesh_cycles: FloatArray | None = None,
    *,
    ready: Constants | None = None,
) -> FloatArray:
    """Undamped eigenfrequencies of small motions about the loaded state at each mesh angle, (n_c, n), rising.

    K = diag(ω²) + Σ rows S rowsᵀ with S = (R + h'(N))⁻¹ over the points that touch at the set torque.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its greatest torque loads the contact.
    mesh_cycles : array or None
        None: 50 points of a cycle.
    ready : Constants or None
        Where they are at hand.
    """
    own = constants(pair, operation) if ready is None else ready
    cycles = one_mesh_cycle(50) if mesh_cycles is None else mesh_cycles
    return np.array([np.sqrt(np.maximum(_squares(pair, own, operation, c)[0], 0.0)) / (2.0 * pi) for c in cycles])


@dataclass(frozen=True)
class TorsionalMode:
    """The mode in which the flanks move most against each other, mean over a mesh cycle.

    Parameters
    ----------
    frequency_hz : float
    contact_part : float
        Part of its energy that lies in the compliance of the contact.
    other_damping_ratio : float
        ζ by shafts, bearings and gear bodies alone.
    """

    frequency_hz: float
    contact_part: float
    other_damping_ratio: float

    def damping_time_s(self, damping_ratio: float) -> float:
        """Time τ of the contact's damping, with which the mode has a damping ratio in all; 0 if it has more without.

        2ζω = 2ζ₀ω + τ ω² · contact part
        """
        omega = 2.0 * pi * self.frequency_hz
        return max(2.0 * (damping_ratio - self.other_damping_ratio) / (omega * self.contact_part), 0.0)


def torsional_mode(
    pair: FlexiblePair, operation: Operation, *, ready: Constants | None = None, n_points: int = 20
) -> TorsionalMode:
    """Return the torsional mode of the pair about its loaded state.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its greatest torque loads the contact.
    ready : Constants or None
        Where they are at hand.
    n_points : int
        Mesh angles in a cycle.
    """
    own = constants(pair, operation) if ready is None else ready
    frequency, contact, other = _torsional(pair, own, operation, one_mesh_cycle(n_points)).mean(axis=0)
    return TorsionalMode(float(frequency), float(contact), float(other))


def torsional_curve_hz(pair: FlexiblePair, operation: Operation, mesh_cycles: FloatArray) -> FloatArray:
    """Frequency of the torsional mode at each mesh angle, (n_c,)."""
    return _torsional(pair, constants(pair, operation), operation, mesh_cycles)[:, 0]


def _torsional(pair: FlexiblePair, own: Constants, operation: Operation, mesh_cycles: FloatArray) -> FloatArray:
    """Frequency, contact part and damping ratio of others at each mesh angle, (n_c, 3)."""
    rates = np.concatenate([side.damping_rate for side in own.sides])
    found = []
    for c in mesh_cycles:
        squares, shapes, rows, stiff = _squares(pair, own, operation, c)
        energy = np.einsum("ij,ik,kj->j", rows @ shapes, stiff, rows @ shapes)
        part = energy / np.maximum(squares, (2.0 * pi * LEAST_HZ) ** 2)
        mode = int(np.argmax(part))
        omega = float(np.sqrt(squares[mode]))
        found.append((omega / (2.0 * pi), part[mode], float(rates @ shapes[:, mode] ** 2) / (2.0 * omega)))
    return np.array(found)


def _squares(
    pair: FlexiblePair, own: Constants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Squared angular frequencies, shapes, and what `contact_rows` returns, at one mesh angle."""
    rows, stiff = contact_rows(pair, own, operation, cycles)
    k = np.diag(np.concatenate([side.omega_rad_s for side in own.sides]) ** 2) + rows.T @ stiff @ rows
    squares, shapes = np.linalg.eigh(k)
    return squares, shapes, rows, stiff


def contact_rows(
    pair: FlexiblePair, own: Constants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray]:
    """Return ∂D/∂η of the points that touch under the set torque, (n, n_modes), and their stiffness, (n, n)."""
    force = max(operation.torque_nm.largest / own.base_radius_m[0], LEAST_FORCE_N)
    at = contact_state(own.table, pair.machine.mesh, force, cycles)
    one, two = own.sides
    turn, n = own.turn(), one.n_modes
    rows = np.zeros((len(at.force_n), 2 * n))
    for point, (number, column, part) in enumerate(zip(at.pair, at.column, at.part, strict=True)):
        for index, side in enumerate((one, two)):
            tooth = int(number % own.record["teeth"][index])
            s = point % own.table.n_slices
            seen = (1.0 - part) * side.rows[column, s] + part * side.rows[column + 1, s]
            cosine, sine = turn[index, tooth]
            c, d = np.split(seen[side.n_single :], 2)
            full = np.concatenate((seen[: side.n_single], cosine * c - sine * d, sine * c + cosine * d))
            rows[point, index * n : index * n + len(full)] = full
    touching = at.force_n > 0.0
    rows = rows[touching]
    stiff: FloatArray = np.linalg.inv(at.compliance[np.ix_(touching, touching)])
    return rows, stiff
