"""Where a run starts: the static balance at the first torque, so that no blow has to die out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from sims.machine.operation import Operation
from sims.reduced_fe.dynamics_constants import Constants, FlexiblePair

if TYPE_CHECKING:
    from sims.reduced_fe.dynamics_respond import FlexState

DEEPEST_M = 1e-3
"""Beyond any approach of flanks."""
LEAST_HZ = 1.0
"""Of modes that the balance bends; slower ones are rigid motion."""


def start_state(pair: FlexiblePair, own: Constants, operation: Operation, start_s: float) -> FlexState:
    """Return the state in which the flanks carry the first torque, everything turning evenly, tooth 0 at its entry.

    The modes take the deflection of the mean contact force; the driven side is turned back until the contact carries.
    """
    from sims.reduced_fe.dynamics_respond import FlexState

    torque = float(operation.torque_nm.at(start_s))
    q = np.zeros((2, own.sides[0].n_modes))
    force = torque / own.base_radius_m[0]
    column = own.table.column(0.0)
    for index, side in enumerate(own.sides):
        drive = torque if index == 0 else -torque * float(own.record["ratio"])
        load = side.inputs[0] * drive
        load[: side.rows.shape[-1]] -= force * side.rows[column].mean(axis=0)
        soft = side.omega_rad_s > 2.0 * np.pi * LEAST_HZ
        q[index, soft] = load[soft] / side.omega_rad_s[soft] ** 2
    shape = own.table.n_slots, own.table.n_slices
    small = float(own.record["small"])
    state = FlexState(
        q,
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros_like(q),
        np.zeros(shape),
        np.full(shape, small**-0.1),
        np.full(own.table.n_slots, -1e9),
        np.zeros(3),
    )
    return state if force <= 0.0 else _closed(pair, own, state, force)


def _closed(pair: FlexiblePair, own: Constants, state: FlexState, force: float) -> FlexState:
    """Turn the driven side as a whole until the flanks carry `force` at ζ = 0."""
    from dataclasses import replace

    from scipy.optimize import brentq

    from sims.reduced_fe.maps_static import force_map

    table = own.table
    rigid = own.sides[1]
    free = np.flatnonzero(rigid.omega_rad_s == 0.0)
    free = free[np.abs(rigid.hub[free]) > 0.0][0]
    column = table.column(0.0)

    def approach(q: FloatArray) -> float:
        total = 0.0
        for index, side in enumerate(own.sides):
            n = side.rows.shape[-1]
            total += float(side.rows[column].mean(axis=0) @ q[index, :n])
        return total

    def missing(depth: float) -> float:
        return float(force_map(table, pair.machine.mesh, np.array([depth]), np.zeros(1)).force_n[0, 0]) - force

    # Below 0: a tooth that stands ahead of its place carries before the others would touch.
    depth = float(brentq(missing, -DEEPEST_M, DEEPEST_M, xtol=1e-12))
    q = state.q.copy()
    per_unit = float(rigid.rows[column].mean(axis=0)[free])
    q[1, free] += (depth - approach(q)) / per_unit
    return replace(state, q=q)
