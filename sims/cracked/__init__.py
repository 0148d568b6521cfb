"""The cracked spur pair: 16 degrees of freedom, contact per tooth pair, cracks, friction and backlash."""

from sims.cracked._kernels import contact_forces, derivative, integrate, late_entry, place_of_entry, potential_energy
from sims.cracked._respond import (
    SIGNALS,
    PairConstants,
    PairState,
    Response,
    check_convergence,
    default_step_s,
    eigenfrequencies_hz,
    matrices,
    mean_stiffness_n_per_m,
    mesh_mass_kg,
    prepare,
    respond,
    slowest_decay_s,
)
from sims.cracked._simulator import (
    NAME,
    STEP_ANGLE_RAD,
    CrackedPair,
    CrackedTwin,
    simulate_with_motion,
)

__all__ = [
    "NAME",
    "SIGNALS",
    "STEP_ANGLE_RAD",
    "CrackedPair",
    "CrackedTwin",
    "PairConstants",
    "PairState",
    "Response",
    "check_convergence",
    "contact_forces",
    "default_step_s",
    "derivative",
    "eigenfrequencies_hz",
    "integrate",
    "late_entry",
    "matrices",
    "mean_stiffness_n_per_m",
    "mesh_mass_kg",
    "place_of_entry",
    "potential_energy",
    "prepare",
    "respond",
    "simulate_with_motion",
    "slowest_decay_s",
]
