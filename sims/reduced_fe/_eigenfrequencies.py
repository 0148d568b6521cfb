"""Eigenfrequencies of the pair over the mesh angle, as a linear system about its loaded state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.fe_gear import MeshSize, ReductionPlan, Spread, reduce_gear
from sims.machine import Operation
from sims.mesh import one_mesh_cycle
from sims.reduced_fe._pair import FlexiblePair, FlexiblePairConstants, constants, torsional_over_cycle, undamped_modes


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
        [np.sqrt(np.maximum(undamped_modes(pair, pair_constants, operation, c)[0], 0.0)) / (2.0 * pi) for c in cycles]
    )


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
        frequency[spread] = torsional_over_cycle(respread, constants(respread, operation), operation, mesh_cycles)[:, 0]
        inner = slice(2, N_HEIGHTS - 2)  # the ends of the involute have neighbours on one side only
        compliance = np.log(np.diag(reduced.clamped_compliance_m_per_n[0])[:N_HEIGHTS][inner])
        roll = reduced.grid.roll_rad[inner]
        smooth = np.polyval(np.polyfit(roll, compliance, DEGREE), roll)
        ripple[spread] = float(np.std(compliance - smooth))
    return SpreadingCheck(mesh_cycles, frequency, ripple)
