"""Friction between the teeth as plain numbers, which compiled code reads."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from sims.machine import Machine
from sims.machine.operation import Operation
from sims.mesh.friction import reduced_modulus_pa
from sims.mesh.friction_kernel import oil_terms

STICKING, STICKING_S = 0.1, 1e-5
"""Friction coefficient, and time within which it must not turn a gear's sliding round: near standstill the smoothed
sign is as stiff as a spring, and a fixed step would chatter."""
SIGN_THRESHOLD = 0.01
"""Sliding speed below which the sign of friction is smoothed, over the mesh's greatest sliding speed."""
FRICTION_SCALARS = (
    "start_radius",
    "base_pitch",
    "action_length",
    "friction_factor",
    "dry_friction",
    "width",
    "reduced_modulus",
    "log10_oil",
    "oil_constant",
    "sign_threshold",
)
"""Of the record: what `sims.mesh.friction_kernel.contact_friction_n` needs."""


def friction_fields(machine: Machine, operation: Operation, force_n: float) -> dict[str, Any]:
    """Values of `FRICTION_SCALARS`, and whether there is friction, at the set mesh force."""
    mesh, pair = machine.mesh, machine.mesh.pair
    log10_oil, oil_constant = oil_terms(machine.lubrication.viscosity_cp, machine.roughness.rms_um)
    one, two = mesh.material_1, mesh.material_2
    sliding = greatest_sliding_mps(machine, operation.speed_rpm.largest * pi / 30.0)
    lightest = min(w.mass_kg for w in machine.wheels)
    return {
        "friction": machine.lubrication.friction,
        "start_radius": pair.start_radius_mm * 1e-3,
        "base_pitch": pair.base_pitch_mm * 1e-3,
        "action_length": pair.action_length_mm * 1e-3,
        "friction_factor": machine.lubrication.factor,
        "dry_friction": machine.lubrication.dry_coefficient,
        "width": mesh.face_width_m,
        "reduced_modulus": reduced_modulus_pa(
            one.youngs_modulus_pa, one.poisson_ratio, two.youngs_modulus_pa, two.poisson_ratio
        ),
        "log10_oil": log10_oil,
        "oil_constant": oil_constant,
        "sign_threshold": max(SIGN_THRESHOLD * sliding, STICKING * force_n * STICKING_S / lightest, 1e-6),
    }


def greatest_sliding_mps(machine: Machine, omega_rad_s: float) -> float:
    """Sliding speed at the end of the path of contact where it is greatest."""
    pair = machine.mesh.pair
    cycles = np.array([0.0, pair.contact_ratio])
    return float(np.max(np.abs(pair.sliding_speed_m_s(cycles, omega_rad_s * 30.0 / pi))))
