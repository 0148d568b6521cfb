"""Drive and inertias of a pair as plain numbers, which compiled code reads."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.machine import RECOVERY_S, Machine, Operation
from sims.mesh import FlankRoughness, FractalSurface, TimeLockedRoughness, oil_terms, reduced_modulus_pa

MAX_LINES = 8
"""Torque ripples, or speed swings, at once."""
MACHINE_FIELDS: list[Any] = [
    *(
        (name, np.float64)
        for name in (
            *("governor", "governor_spring", "total_inertia", "ratio"),
            *("cycles_per_rad", "backlash", "gravity_x", "gravity_y"),
        )
    ),
    *(
        (name, np.float64, (2,))
        for name in (
            *("mass", "mass_angle", "runout", "runout_angle"),
            *("torsional_stiffness", "torsional_damping", "hooke", "hooke_force", "coupling_bending"),
        )
    ),
    ("n_ripples", np.int64),
    ("ripples", np.float64, (MAX_LINES, 3)),
    ("n_swings", np.int64),
    ("swings", np.float64, (MAX_LINES, 3)),
]
"""Of the record of either model, in SI units; those of a side in pairs (driver, driven)."""


def machine_fields(machine: Machine) -> dict[str, Any]:
    """Values of `MACHINE_FIELDS`."""
    wheels, shafts, beta = machine.wheels, machine.shafts, radians(machine.line_of_action_deg)
    hooke_rad = np.array([radians(s.coupling_angle_deg) for s in shafts])
    drive, governor, total = machine.drive, governor_nm_s_per_rad(machine), total_inertia_kg_m2(machine)
    swings = [(s.fraction, 2.0 * pi * s.frequency_hz, s.phase_rad) for s in drive.swings]
    return {
        "governor": governor,
        "governor_spring": governor**2 / (4.0 * total),
        "total_inertia": total,
        "ratio": machine.ratio,
        "cycles_per_rad": machine.mesh.pair.driver.teeth / (2.0 * pi),
        "backlash": 2e-6 * machine.half_backlash_um,
        "gravity_x": -machine.gravity_mps2 * sin(beta),
        "gravity_y": -machine.gravity_mps2 * cos(beta),
        "mass": [w.mass_kg for w in wheels],
        "mass_angle": np.radians([w.unbalance_angle_deg for w in wheels]),
        "runout": [w.runout_um * 1e-6 for w in wheels],
        "runout_angle": np.radians([w.runout_angle_deg for w in wheels]),
        "torsional_stiffness": [s.torsional_stiffness_nm_per_rad for s in shafts],
        "torsional_damping": [s.torsional_damping_nm_s_per_rad for s in shafts],
        "hooke": hooke_rad**2 / 4.0,
        "hooke_force": hooke_rad / np.array([2.0 * s.bearing_distance_m for s in shafts]),
        "coupling_bending": [s.coupling_bending_nm_per_rad for s in shafts],
        "n_ripples": len(drive.ripples),
        "n_swings": len(drive.swings),
        "ripples": _rows([(r.order, r.fraction, r.phase_rad) for r in drive.ripples], "torque ripples"),
        "swings": _rows(swings, "speed swings"),
    }


def total_inertia_kg_m2(machine: Machine) -> float:
    """Everything that turns, as the input shaft feels it."""
    (input_shaft, output_shaft), (driver, driven) = machine.shafts, machine.wheels
    far = driven.inertia_kg_m2 + output_shaft.rotor_inertia_kg_m2
    return input_shaft.rotor_inertia_kg_m2 + driver.inertia_kg_m2 + far / machine.ratio**2


def governor_nm_s_per_rad(machine: Machine) -> float:
    """G of the drive; an ordinary one suits what it turns."""
    stated = machine.drive.governor_nm_s_per_rad
    return 2.0 * total_inertia_kg_m2(machine) / RECOVERY_S if stated is None else stated


def _rows(items: list[tuple[float, float, float]], kind: str) -> FloatArray:
    if len(items) > MAX_LINES:
        raise InputError(f"{len(items)} {kind}", allowed=f"at most {MAX_LINES}")
    rows = np.zeros((MAX_LINES, 3))
    rows[: len(items)] = np.array(items, dtype=np.float64).reshape(-1, 3)
    return rows


# Friction between the teeth as plain numbers, which compiled code reads.

STICKING, STICKING_S = 0.1, 1e-5
"""Friction coefficient, and time within which it must not turn a gear's sliding round: near standstill the smoothed
sign is as stiff as a spring, and a fixed step would chatter."""
SIGN_THRESHOLD = 0.01
"""Sliding speed below which the sign of friction is smoothed, over the mesh's greatest sliding speed."""
FRICTION_FIELDS: list[Any] = [
    ("friction", np.bool_),
    *(
        (name, np.float64)
        for name in (
            *("start_radius", "base_pitch", "action_length", "contact_ratio"),
            *("friction_factor", "dry_friction", "width", "reduced_modulus"),
            *("log10_oil", "oil_constant", "sign_threshold"),
        )
    ),
]
"""Of the record: what `sims.mesh.contact_friction_n` needs."""


def friction_fields(machine: Machine, operation: Operation, force_n: float) -> dict[str, Any]:
    """Values of `FRICTION_FIELDS` at the set mesh force."""
    mesh, pair = machine.mesh, machine.mesh.pair
    log10_oil, oil_constant = oil_terms(machine.lubrication.viscosity_cp, machine.roughness.rms_um)
    sliding = greatest_sliding_mps(machine, operation.speed_rpm.largest * pi / 30.0)
    lightest = min(w.mass_kg for w in machine.wheels)
    return {
        "friction": machine.lubrication.friction,
        "start_radius": pair.start_radius_mm * 1e-3,
        "base_pitch": pair.base_pitch_mm * 1e-3,
        "action_length": pair.action_length_mm * 1e-3,
        "contact_ratio": pair.contact_ratio,
        "friction_factor": machine.lubrication.factor,
        "dry_friction": machine.lubrication.dry_coefficient,
        "width": mesh.face_width_m,
        "reduced_modulus": reduced_modulus_pa(mesh.material_1, mesh.material_2),
        "log10_oil": log10_oil,
        "oil_constant": oil_constant,
        "sign_threshold": max(SIGN_THRESHOLD * sliding, STICKING * force_n * STICKING_S / lightest, 1e-6),
    }


def greatest_sliding_mps(machine: Machine, omega_rad_s: float) -> float:
    """Sliding speed at the end of the path of contact where it is greatest."""
    pair = machine.mesh.pair
    cycles = np.array([0.0, pair.contact_ratio])
    return float(np.max(np.abs(pair.sliding_speed_m_s(cycles, omega_rad_s * 30.0 / pi))))


# Roughness of a pair's flanks, drawn.


def draw_roughness(machine: Machine, rng: np.random.Generator) -> tuple[Machine, TimeLockedRoughness]:
    """Give every tooth its profile, or the backlash its endless one; returns what the mesh and the kernel need.

    Composite roughness S is shared evenly by the two flanks of a pair: each has S/√2.
    """
    rough, pair = machine.roughness, machine.mesh.pair
    endless = FractalSurface.of_roughness(rough.rms_um if rough.locked_to == "time" else 0.0, rough.dimension)
    profile = TimeLockedRoughness.draw(endless, rng)
    if rough.locked_to == "flank" and rough.rms_um > 0.0:
        surface = FractalSurface.of_roughness(rough.rms_um / np.sqrt(2.0), rough.dimension)
        flanks = [FlankRoughness.draw(surface, gear.teeth, rng) for gear in (pair.driver, pair.driven)]
        machine = replace(machine, mesh=replace(machine.mesh, roughness_1=flanks[0], roughness_2=flanks[1]))
    return machine, profile
