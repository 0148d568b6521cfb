"""Whether a step can be followed: errors must not grow from step to step.

A contact that is stiff or strongly damped against the light parts behind it answers a step by more than it was taken
with. What comes of it is bounded by the loss of contact and looks like impacts.
"""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.machine.operation import Operation
from sims.mesh.stiffness import one_mesh_cycle
from sims.reduced_fe.dynamics_constants import Constants, FlexiblePair
from sims.reduced_fe.dynamics_linear import contact_rows
from sims.reduced_fe.dynamics_side import hub_inertia
from sims.reduced_fe.integrate_coefficients import Method, step_coefficients

MOST_GROWTH = 1e-4
"""Of errors in a step. Without any damping steps of 5 µs have 4e-7; those that cannot be followed 1e-2 and more."""
N_POINTS = 5
MOST_HALVINGS = 3
USUAL_HUB = 2.0
"""Inertia of a hub over its toothed body's."""


def followed_step_s(pair: FlexiblePair, own: Constants, operation: Operation, longest_s: float) -> float:
    """Return the step, or its half, quarter or eighth, that the contact can be followed with in one pass.

    Where none can, the longest: `check_step` then says why.
    """
    for halvings in range(MOST_HALVINGS + 1):
        step = longest_s * 0.5**halvings
        coefficients = np.array([step_coefficients(s.omega_rad_s, s.damping_rate, step) for s in own.sides])
        if growth(pair, own, operation, coefficients) <= MOST_GROWTH:
            return step
    return longest_s


def growth(pair: FlexiblePair, own: Constants, operation: Operation, coefficients: FloatArray) -> float:
    """Return by how much errors of the loaded, linear pair grow in a step of one pass, at the worst of some angles.

    The spectral radius, less 1, of the map of (q, v, f, f of the step before) that `integrate_kernel.march` makes, with
    the contact as springs S and dampers τS between ∂D/∂η·q.

    Parameters
    ----------
    pair : FlexiblePair
    own : Constants
    operation : Operation
    coefficients : array, (2, 8, n_modes)
        See `step_coefficients`.
    """
    qq, qv, vq, vv, q0, q1, v0, v1 = (np.diag(np.concatenate(c)) for c in np.moveaxis(coefficients, 1, 0))
    nothing, same = np.zeros_like(qq), np.eye(len(qq))
    extrapolated = np.hstack((nothing, nothing, 2.0 * same, -same))
    free_q, free_v = np.hstack((qq, qv, q0, nothing)), np.hstack((vq, vv, v0, nothing))
    seen = free_q + q1 @ extrapolated + float(own.record["damping_time"]) * (free_v + v1 @ extrapolated)
    found = 0.0
    for cycles in one_mesh_cycle(N_POINTS):
        rows, stiff = contact_rows(pair, own, operation, cycles)
        force = -rows.T @ stiff @ rows @ seen
        step = np.vstack(
            (free_q + q1 @ force, free_v + v1 @ force, force, np.hstack((nothing, nothing, same, nothing)))
        )
        found = max(found, float(np.abs(np.linalg.eigvals(step)).max()))
    return found - 1.0


def check_step(
    pair: FlexiblePair, own: Constants, operation: Operation, coefficients: FloatArray, method: Method
) -> None:
    """Refuse a step in which errors grow, or, of the method that repeats its passes, one whose passes do not settle.

    Raises
    ------
    InputError
        Where hubs are too heavy for their teeth, the damping ratio is too great, or the step too long.
    """
    if method == "exponential" and growth(pair, own, operation, coefficients) <= MOST_GROWTH:
        return
    if method == "newmark" and _pass_gain(pair, own, operation, coefficients) <= 1.0:
        return
    hubs = [hub_inertia(pair.machine, i, gear)[1] / gear.polar_inertia_kg_m2 for i, gear in enumerate(pair.gears)]
    worst = int(np.argmax(hubs))
    raise InputError(
        f"the contact is stiffer or damped more than its gears can follow: hubs turn with {hubs[0]:.2g} and "
        f"{hubs[1]:.2g} times the inertia of the toothed bodies, damping ratio {pair.machine.mesh_damping_ratio:g}",
        where=f"hub_inertia_{('driver', 'driven')[worst]}_kg_m2" if hubs[worst] > USUAL_HUB else "mesh_damping_ratio",
        allowed="6 times at a damping ratio of 0.08, or 0.2 with lighter hubs, or so",
        remedy="give hubs that suit the gears, lower mesh_damping_ratio, or give a shorter step",
    )


def _pass_gain(pair: FlexiblePair, own: Constants, operation: Operation, coefficients: FloatArray) -> float:
    """Change of a contact force over that of the force that a pass was made with: below 1 passes settle."""
    moved = np.concatenate(coefficients[:, 5] + float(own.record["damping_time"]) * coefficients[:, 7])
    gain = 0.0
    for cycles in one_mesh_cycle(N_POINTS):
        rows, stiff = contact_rows(pair, own, operation, cycles)
        gain = max(gain, float(np.abs(np.linalg.eigvals(stiff @ (rows * moved) @ rows.T)).max(initial=0.0)))
    return gain
