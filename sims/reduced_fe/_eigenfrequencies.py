"""Eigenfrequencies of the pair over the mesh angle, as a linear system about its loaded state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.fe_gear import MeshSize, ReductionPlan, Spread, reduce_gear
from sims.machine import Operation
from sims.mesh import one_mesh_cycle
from sims.reduced_fe._contact import contact_state
from sims.reduced_fe._pair import MIN_FORCE_N, FlexiblePair, FlexiblePairConstants, constants

MIN_TORSIONAL_HZ = 200.0
"""Modes below it are those of rotors on their couplings."""


def eigenfrequencies_hz(
    pair: FlexiblePair,
    operation: Operation,
    mesh_cycles: FloatArray | None = None,
    *,
    ready: FlexiblePairConstants | None = None,
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
    ready : FlexiblePairConstants or None
        Where they are at hand.
    """
    pair_constants = constants(pair, operation) if ready is None else ready
    cycles = one_mesh_cycle(50) if mesh_cycles is None else mesh_cycles
    return np.array(
        [np.sqrt(np.maximum(_squares(pair, pair_constants, operation, c)[0], 0.0)) / (2.0 * pi) for c in cycles]
    )


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
    pair: FlexiblePair, operation: Operation, *, ready: FlexiblePairConstants | None = None
) -> TorsionalMode:
    """Return the torsional mode of the pair about its loaded state, mean over 20 mesh angles of a cycle.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its greatest torque loads the contact.
    ready : FlexiblePairConstants or None
        Where they are at hand.
    """
    pair_constants = constants(pair, operation) if ready is None else ready
    modes = _torsional(pair, pair_constants, operation, one_mesh_cycle(20))
    return TorsionalMode(*(float(mean) for mean in modes.mean(axis=0)))


def torsional_curve_hz(pair: FlexiblePair, operation: Operation, mesh_cycles: FloatArray) -> FloatArray:
    """Frequency of the torsional mode at each mesh angle, (n_c,)."""
    return _torsional(pair, constants(pair, operation), operation, mesh_cycles)[:, 0]


def _torsional(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, mesh_cycles: FloatArray
) -> FloatArray:
    """Frequency, contact part and damping ratio of others at each mesh angle, (n_c, 3)."""
    rates = np.concatenate([side.damping_rate for side in pair_constants.sides])
    modes = []
    for c in mesh_cycles:
        squares, shapes, rows, stiff = _squares(pair, pair_constants, operation, c)
        energy = np.einsum("ij,ik,kj->j", rows @ shapes, stiff, rows @ shapes)
        part = energy / np.maximum(squares, (2.0 * pi * MIN_TORSIONAL_HZ) ** 2)
        mode = int(np.argmax(part))
        omega = float(np.sqrt(squares[mode]))
        modes.append((omega / (2.0 * pi), part[mode], float(rates @ shapes[:, mode] ** 2) / (2.0 * omega)))
    return np.array(modes)


def _squares(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Squared angular frequencies, shapes, and what `contact_rows` returns, at one mesh angle."""
    rows, stiff = contact_rows(pair, pair_constants, operation, cycles)
    k = np.diag(np.concatenate([side.omega_rad_s for side in pair_constants.sides]) ** 2) + rows.T @ stiff @ rows
    squares, shapes = np.linalg.eigh(k)
    return squares, shapes, rows, stiff


def contact_rows(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray]:
    """Return ∂D/∂η of the points that touch under the set torque, (n, n_modes), and their stiffness, (n, n)."""
    force = max(operation.torque_nm.largest / pair_constants.base_radius_m[0], MIN_FORCE_N)
    at = contact_state(pair_constants.table, pair.machine.mesh, force, cycles)
    driver, driven = pair_constants.sides
    turn, n = pair_constants.turn(), driver.n_modes
    rows = np.zeros((len(at.force_n), 2 * n))
    for point, (number, column, part) in enumerate(zip(at.pair, at.column, at.part, strict=True)):
        for index, side in enumerate((driver, driven)):
            tooth = int(number % pair_constants.record["teeth"][index])
            s = point % pair_constants.table.n_slices
            in_sector = (1.0 - part) * side.rows[column, s] + part * side.rows[column + 1, s]
            cosine, sine = turn[index, tooth]
            c, d = np.split(in_sector[side.n_single :], 2)
            full = np.concatenate((in_sector[: side.n_single], cosine * c - sine * d, sine * c + cosine * d))
            rows[point, index * n : index * n + len(full)] = full
    touching = at.force_n > 0.0
    rows = rows[touching]
    stiff: FloatArray = np.linalg.inv(at.compliance[np.ix_(touching, touching)])
    return rows, stiff


# --------------------
# What the way a contact force is spread over nodes does to them: the check of RBE3 patches.
# --------------------


SPREADS: tuple[Spread, ...] = ("node", "patch", "section")
SIZE = MeshSize(n_across=3, n_gap=1, n_up=6, n_rim=2, n_body=2, n_along=1)
"""A coarse mesh shows best what nodes do: some six rows of cells up the flank."""
N_HEIGHTS = 41
"""Some three points between two rows of nodes."""
DEGREE = 4
"""Of the polynomial in the mesh angle that is taken as smooth."""


@dataclass(frozen=True)
class SpreadingCheck:
    """The torsional mode over the mesh angle, by how contact forces reach the nodes.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    frequency_hz : mapping of "node", "patch", "section" to arrays, (n_c,)
    ripple : mapping
        Part by which a tooth's compliance departs from a smooth curve over the height of its flank, rms.
    """

    mesh_cycles: FloatArray
    frequency_hz: dict[Spread, FloatArray]
    ripple: dict[Spread, float]


def spreading_check(pair: FlexiblePair, operation: Operation, mesh_cycles: FloatArray) -> SpreadingCheck:
    """Reduce the pair's gears anew, coarsely, once per way of spreading, and follow the torsional mode.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its greatest torque loads the contact.
    mesh_cycles : array

    Notes
    -----
    "node": force and motion of one line of nodes across the face, interpolated between lines: the local indentation
    depends on where between nodes the contact is. "patch": RBE3 over the flank's nodes around the point. "section": the
    whole cross-section at that height, what the simulations use; its frequencies are higher, as Hertz alone is the
    indentation there, while nodes and patches add one of their own.
    """
    frequency: dict[Spread, FloatArray] = {}
    ripple: dict[Spread, float] = {}
    first, second = (gear.blank for gear in pair.gears)
    for spread in SPREADS:
        plan = ReductionPlan(SIZE, n_heights=N_HEIGHTS, n_slices=1, spread=spread)
        reduced = reduce_gear(first, plan)
        gears = (reduced, reduced if second == first else reduce_gear(second, plan))
        respread = replace(pair, gears=gears)
        frequency[spread] = torsional_curve_hz(respread, operation, mesh_cycles)
        inner = slice(2, N_HEIGHTS - 2)  # the ends of the involute have neighbours on one side only
        compliance = np.log(np.diag(reduced.clamped_compliance_m_per_n[0])[:N_HEIGHTS][inner])
        roll = reduced.grid.roll_rad[inner]
        smooth = np.polyval(np.polyfit(roll, compliance, DEGREE), roll)
        ripple[spread] = float(np.std(compliance - smooth))
    return SpreadingCheck(mesh_cycles, frequency, ripple)
