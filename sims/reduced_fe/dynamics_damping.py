"""Whether the contact's damping can be marched: it must not throw back more than it takes within a step."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.machine.operation import Operation
from sims.mesh.stiffness import one_mesh_cycle
from sims.reduced_fe.dynamics_constants import Constants, FlexiblePair
from sims.reduced_fe.dynamics_linear import contact_rows
from sims.reduced_fe.dynamics_side import hub_inertia
from sims.reduced_fe.integrate_coefficients import Method

MOST_GAIN: dict[Method, float] = {"exponential": 1.0 / 3.0, "newmark": 1.0}
"""Change g of a contact force over the force that the step was taken with. Repeated passes settle where g < 1. One pass
with the force extrapolated, e' = −g (2e − e"), keeps errors from growing where z² + 2gz − g has its roots in the unit
circle, g < 1/3; as found: at 0.33 the reference's result, at 0.35 bursts of the solver's own, like impacts."""
N_POINTS = 5
USUAL_HUB = 2.0
"""Inertia of a hub over its toothed body's."""


def check_damping(
    pair: FlexiblePair, own: Constants, operation: Operation, coefficients: FloatArray, method: Method
) -> None:
    """Refuse a contact whose damping is stronger than the inertia behind it lets a step follow.

    A step moves the modes with an extrapolated force f, by b f in place and β f in speed; the contact answers by
    −S (b + τβ) f seen from its points, with stiffness S and time τ of its damping. It must not grow, see `MOST_GAIN`.

    Parameters
    ----------
    pair : FlexiblePair
    own : Constants
    operation : Operation
    coefficients : array, (2, 8, n_modes)
        See `step_coefficients`.
    method : str
        "exponential" or "newmark".

    Raises
    ------
    InputError
        Where hubs are too heavy for their teeth, or the damping ratio is too great.
    """
    moved = np.concatenate(coefficients[:, 5] + float(own.record["damping_time"]) * coefficients[:, 7])
    gain = 0.0
    for cycles in one_mesh_cycle(N_POINTS):
        rows, stiff = contact_rows(pair, own, operation, cycles)
        gain = max(gain, float(np.abs(np.linalg.eigvals(stiff @ (rows * moved) @ rows.T)).max(initial=0.0)))
    if gain <= MOST_GAIN[method]:
        return
    hubs = [hub_inertia(pair.machine, i, gear)[1] / gear.polar_inertia_kg_m2 for i, gear in enumerate(pair.gears)]
    worst = int(np.argmax(hubs))
    raise InputError(
        f"the contact is damped more than its gears can follow: hubs turn with {hubs[0]:.2g} and {hubs[1]:.2g} times "
        f"the inertia of the toothed bodies, the damping ratio is {pair.machine.mesh_damping_ratio:g}",
        where=f"hub_inertia_{('driver', 'driven')[worst]}_kg_m2" if hubs[worst] > USUAL_HUB else "mesh_damping_ratio",
        allowed="6 times at a damping ratio of 0.08, 0.25 with lighter hubs, or so",
        remedy="give hubs that suit the gears, or lower mesh_damping_ratio",
    )
