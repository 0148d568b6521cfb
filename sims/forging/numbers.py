"""The drive as plain numbers, which compiled code reads."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.rig.contact import damping_ratio_s_per_m

if TYPE_CHECKING:
    from sims.forging.drive import ForgingDrive

STATES = ("θ1", "ω1", "q", "q̇", "tooth bristle A", "tooth bristle B", "motor bristle", "load bristle")
"""What is integrated: angle and speed of the pinion, compression and its rate, four bristles; then three energies."""
ENERGIES = ("work put in", "lost in contact", "lost in friction")
N_STATES = len(STATES) + len(ENERGIES)

SIGNALS = (
    "pinion angle", "pinion speed", "pinion acceleration",
    "wheel angle", "wheel speed", "wheel acceleration",
    "torque", "interaction force", "compression", "compression rate", "pairs in contact", "tooth friction",
    "motor torque", "energy", "work put in", "lost in contact", "lost in friction",
)  # fmt: skip
"""What a run returns, in rad, s, N m, N, m, J. "torque" is that of a sensor between motor and pinion."""

CONTACT_COLUMNS = (
    "start_s", "flank", "start_speed_mps", "pitch", "driver_angle_rad", "end_s", "end_speed_mps", "peak_force_n",
    "lost_j", "is_latched_at_floor",
)  # fmt: skip
"""What is kept of every contact: from when its flanks touched to when they parted (nan: still touching)."""

_FIELDS = (
    "motor_inertia", "pinion_inertia", "wheel_inertia", "rb1", "rb2", "half_backlash", "stiffness", "exponent",
    "damping_at_1_mps", "speed_floor", "cycles_per_rad", "phase", "contact_ratio", "ramp", "start", "base_pitch",
    "length", "mirror", "tooth_friction", "tooth_static_ratio", "tooth_stribeck", "tooth_presliding", "speed_limit",
    "speed_band", "ripple_fraction", "ripple_order", "drag", "drag_viscous", "motor_static_ratio", "motor_stribeck",
    "motor_presliding", "motor_bristle_time", "load_friction", "load_viscous", "load_static_ratio", "load_stribeck",
    "load_presliding", "load_bristle_time", "unbalance_torque", "unbalance_angle", "weak_teeth", "weak_tooth",
    "weak_loss", "is_worn",
)  # fmt: skip
N_WEAR = 65
"""Points of the table of wear over the path of contact."""
RECORD = np.dtype(
    [(name, np.float64) for name in _FIELDS] + [(name, np.float64, (N_WEAR,)) for name in ("wear", "wear_slope")]
)
"""Numbers in SI units by name; compiled code reads them as attributes."""


def drive_numbers(drive: ForgingDrive) -> Any:
    """Return the drive as a record of `RECORD`."""
    path, contact = drive.path, drive.contact
    motor, load, flanks = drive.motor, drive.load, drive.flanks
    k = np.zeros(1, dtype=RECORD).view(np.recarray)[0]
    k["motor_inertia"], k["pinion_inertia"] = motor.inertia_kg_m2, contact.driver_inertia_kg_m2
    k["wheel_inertia"] = contact.driven_inertia_kg_m2
    k["rb1"], k["rb2"] = path.base_radii_m
    k["half_backlash"] = contact.half_backlash_um * 1e-6
    k["stiffness"], k["exponent"] = contact.stiffness_n_per_m_lambda, contact.exponent
    k["damping_at_1_mps"] = damping_ratio_s_per_m(contact.damping_law, contact.restitution, 1.0)
    k["speed_floor"] = contact.impact_speed_floor_mps
    k["cycles_per_rad"], k["phase"] = path.teeth[0] / (2.0 * pi), path.phase
    k["contact_ratio"], k["ramp"] = path.contact_ratio, drive.mesh_ramp
    k["start"], k["base_pitch"], k["length"] = path.start_m, path.base_pitch_m, path.length_m
    k["mirror"] = 2.0 * path.pitch_point + 0.5
    k["tooth_friction"] = contact.friction_coefficient
    k["tooth_static_ratio"], k["tooth_stribeck"] = flanks.static_ratio, flanks.stribeck_speed
    k["tooth_presliding"] = flanks.presliding
    k["speed_limit"], k["speed_band"] = drive.speed_limit_rad_s, motor.speed_band
    k["ripple_fraction"], k["ripple_order"] = motor.ripple_fraction, motor.ripple_order
    k["drag"], k["drag_viscous"] = motor.drag.level, motor.drag.viscous
    k["load_friction"], k["load_viscous"] = load.friction.level, load.friction.viscous
    for name, bristle in (("motor", motor.drag), ("load", load.friction)):
        k[f"{name}_static_ratio"], k[f"{name}_stribeck"] = bristle.static_ratio, bristle.stribeck_speed
        k[f"{name}_presliding"], k[f"{name}_bristle_time"] = bristle.presliding, bristle.damping_time_s
    k["unbalance_torque"], k["unbalance_angle"] = load.unbalance_nm, load.unbalance_angle_rad
    weak = drive.weak_tooth
    k["weak_teeth"] = path.teeth[0 if weak is None else weak.gear]
    depths = drive.wear_um
    if len(depths):
        k["is_worn"] = 1.0
        table = np.interp(np.linspace(0.0, 1.0, N_WEAR), np.linspace(0.0, 1.0, len(depths)), 1e-6 * np.asarray(depths))
        k["wear"], k["wear_slope"] = table, np.gradient(table)
    k["weak_tooth"], k["weak_loss"] = (0.0, 0.0) if weak is None else (weak.tooth, weak.loss)
    return k
