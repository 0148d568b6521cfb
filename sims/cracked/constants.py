"""The machine as plain numbers, which compiled code reads."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, floor, pi, radians, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from sims.cracked.contact_kernel import MOST_LATE
from sims.gear_pair.bearing import BEARING_FIELDS, bearing_fields
from sims.gear_pair.drive import DRIVE_FIELDS, DRIVE_SCALARS, drive_fields
from sims.gear_pair.friction import FRICTION_SCALARS, friction_fields
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.mesh import back_stiffness_n_per_m, mesh_stiffness, mesh_table
from sims.mesh.table import MeshTable

DAMPING_RAMP_M = 2e-7
"""Depth over which the contact's damping comes in."""
SCALARS = (
    "table_start",
    "table_step",
    "contact_coefficient",
    "contact_ratio",
    "ramp",
    "cycles_per_rad",
    "damping_time",
    "damping_ramp",
    "backlash",
    "back_stiffness",
    "late_x",
    "late_y",
    "turn_x",
    "cos_back",
    "sin_back",
    *FRICTION_SCALARS,
    "gravity_x",
    "gravity_y",
    *DRIVE_SCALARS,
)
PER_SIDE = (
    "base_radius",
    "mass",
    "inertia",
    "per_mass",
    "per_inertia",
    "per_rotor",
    "mass_offset",
    "mass_angle",
    "runout",
    "runout_angle",
    "bending_stiffness",
    "bending_damping",
    "torsional_stiffness",
    "torsional_damping",
    "rotor_inertia",
    "hooke",
    "hooke_force",
    "coupling_bending",
)
RECORD = np.dtype(
    [(name, np.float64) for name in SCALARS]
    + [(name, np.float64, (2,)) for name in PER_SIDE]
    + [
        ("load_dependent", np.bool_),
        ("friction", np.bool_),
        ("turns", np.bool_),
        ("n_slots", np.int64),
        ("teeth", np.int64, (2,)),
    ]
    + DRIVE_FIELDS
    + BEARING_FIELDS,
    align=True,
)
"""Numbers in SI units, those of a side in pairs (driver, driven), those of bearings in fours;
per_… are reciprocals, since compiled code multiplies faster than it divides. A record, since compiled
code passes one by its address, while it copies every member of a tuple at each call."""


@dataclass(frozen=True)
class Constants:
    """What compiled code reads.

    Parameters
    ----------
    record : one `RECORD`
    curves : array, (n_curves, n)
        Compliance (m/N) and separation (m) of single teeth over the progress of contact, see `MeshTable`.
    rows : int array, (4, z)
        Which curve holds the compliance of each tooth of the driver, of the driven gear, then their separations.
    pitch : array, (2, z)
        Pitch deviation of each tooth, in m. One array of each kind, since compiled code counts its references to every
        array in a tuple, which took as long as the mechanics.
    """

    record: Any
    curves: FloatArray
    rows: NDArray[np.int64]
    pitch: FloatArray

    @property
    def arguments(self) -> tuple[Any, FloatArray, NDArray[np.int64], FloatArray]:
        """The four, as kernels take them."""
        return self.record, self.curves, self.rows, self.pitch


def constants(machine: Machine, operation: Operation, rng: np.random.Generator) -> Constants:
    """Turn a machine into plain numbers; draws the places of rolling elements in bearings with a defect."""
    pair, mesh = machine.mesh.pair, machine.mesh
    table = mesh_table(mesh)
    base_radius = np.array([pair.driver.base_radius_mm, pair.driven.base_radius_mm]) * 1e-3
    force = operation.torque_nm.largest / base_radius[0]
    mean_stiffness = mean_stiffness_n_per_m(machine, force)
    inertia = np.array([w.inertia_kg_m2 for w in machine.wheels])
    mass = np.array([w.mass_kg for w in machine.wheels])
    alpha, beta = pair.working_pressure_angle_rad, radians(machine.line_of_action_deg)
    hooke_rad = np.array([radians(s.coupling_angle_deg) for s in machine.shafts])
    rotors = np.array([s.rotor_inertia_kg_m2 for s in machine.shafts])
    values: dict[str, Any] = {
        "table_start": table.start,
        "table_step": table.step,
        "contact_coefficient": table.contact_coefficient,
        "load_dependent": table.load_dependent,
        "contact_ratio": table.contact_ratio,
        "ramp": table.ramp,
        "n_slots": floor(table.contact_ratio + table.ramp + 2.0 * MOST_LATE) + 1,
        "teeth": (pair.driver.teeth, pair.driven.teeth),
        "base_radius": base_radius,
        "cycles_per_rad": pair.driver.teeth / (2.0 * pi),
        "damping_time": 2.0 * machine.mesh_damping_ratio * sqrt(mesh_mass_kg(machine) / mean_stiffness),
        "damping_ramp": DAMPING_RAMP_M,
        "backlash": 2e-6 * machine.half_backlash_um,
        "back_stiffness": back_stiffness_n_per_m(mesh),
        # Base pitches per metre that the gears stand apart along their line of centres, (cos α, sin α).
        "late_x": cos(alpha) / (sin(alpha) * pair.base_pitch_mm * 1e-3),
        "late_y": 1.0 / (pair.base_pitch_mm * 1e-3),
        "turn_x": base_radius[0] / (pair.action_length_mm * pair.base_pitch_mm * 1e-6),
        "cos_back": cos(2.0 * alpha),
        "sin_back": sin(2.0 * alpha),
        "mass": mass,
        "inertia": inertia,
        "per_mass": 1.0 / mass,
        "per_inertia": 1.0 / inertia,
        "per_rotor": 1.0 / rotors,
        "mass_offset": np.array([w.mass_offset_m for w in machine.wheels]),
        "mass_angle": np.radians([w.unbalance_angle_deg for w in machine.wheels]),
        "runout": np.array([w.runout_um * 1e-6 for w in machine.wheels]),
        "runout_angle": np.radians([w.runout_angle_deg for w in machine.wheels]),
        "turns": any(w.runout_um > 0 or w.unbalance_g_mm > 0 for w in machine.wheels),
        "bending_stiffness": np.array([s.bending_stiffness_n_per_m for s in machine.shafts]),
        "bending_damping": np.array([s.bending_damping_n_s_per_m for s in machine.shafts]),
        "torsional_stiffness": np.array([s.torsional_stiffness_nm_per_rad for s in machine.shafts]),
        "torsional_damping": np.array([s.torsional_damping_nm_s_per_rad for s in machine.shafts]),
        "rotor_inertia": rotors,
        "hooke": hooke_rad**2 / 4.0,
        "hooke_force": hooke_rad / np.array([2.0 * s.bearing_distance_m for s in machine.shafts]),
        "coupling_bending": np.array([s.coupling_bending_nm_per_rad for s in machine.shafts]),
        "gravity_x": -machine.gravity_mps2 * sin(beta),
        "gravity_y": -machine.gravity_mps2 * cos(beta),
    }
    record = np.zeros((), RECORD)
    values |= drive_fields(machine) | friction_fields(machine, operation, force) | bearing_fields(machine, force, rng)
    for name, value in values.items():
        record[name] = value
    curves, rows, pitch = _stacked(table)
    return Constants(record[()], curves, rows, pitch)


def mesh_mass_kg(machine: Machine) -> float:
    """Mass that the two gears put against each other along the line of action, 1/(r_b1²/J1 + r_b2²/J2)."""
    pair = machine.mesh.pair
    radii = (pair.driver.base_radius_mm * 1e-3, pair.driven.base_radius_mm * 1e-3)
    return 1.0 / sum(r**2 / w.inertia_kg_m2 for r, w in zip(radii, machine.wheels, strict=True))


def mean_stiffness_n_per_m(machine: Machine, force_n: float) -> float:
    """Mean mesh stiffness over a cycle of sound teeth, at the set force where contact stiffens with the load."""
    from dataclasses import replace

    sound = replace(machine.mesh, cracks_1=(), cracks_2=(), spalls_1=(), spalls_2=(), chips_1=(), chips_2=())
    if sound.contact_law == "linear":
        return mesh_stiffness(sound).mean_n_per_m
    return mesh_stiffness(sound, force_n=max(force_n, 1.0)).mean_n_per_m


def _stacked(table: MeshTable) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Curves, rows and pitch of a table; see `Constants`."""
    kinds = (
        (table.compliance_1, table.variant_1),
        (table.compliance_2, table.variant_2),
        (table.separation_1_m, table.surface_1),
        (table.separation_2_m, table.surface_2),
    )
    most = max(len(which) for _, which in kinds)
    rows, first = np.zeros((4, most), dtype=np.int64), 0
    for kind, (curves, which) in enumerate(kinds):
        rows[kind, : len(which)] = first + which
        first += len(curves)
    pitch = np.zeros((2, most))
    for side, values in enumerate((table.pitch_1_m, table.pitch_2_m)):
        pitch[side, : len(values)] = values
    return np.ascontiguousarray(np.vstack([curves for curves, _ in kinds])), rows, pitch
