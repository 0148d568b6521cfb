"""The parameters of the forging manipulator's drive: unit, range, meaning, default."""

from __future__ import annotations

from gearsig.rig.contact import DAMPING_LAWS
from sims.forging.drive import LEAST_CONTACT_RATIO, MESH_RAMP_RANGE, SPEED_BAND_RANGE, STATIC_RATIO_RANGE
from sims.forging.schedule import MODES
from sims.simulator import Parameter

STIFFNESSES = ("formula", "table")
"""Two that one source gives for one pair of gears: by its formula, and as its table prints it, a tenth of that."""
SAMPLINGS = ("instants", "filtered")
MOST_FRICTION = 0.5
"""Coefficient of the flanks."""


def _number(
    name: str, unit: str, meaning: str, low: float, high: float, default: float | None, *, whole: bool = False
) -> Parameter:
    return Parameter(name, unit, meaning, low, high, default, whole=whole)


def _word(name: str, meaning: str, choices: tuple[str, ...], default: str) -> Parameter:
    return Parameter(name, "", meaning, default=default, choices=choices)


_CYCLE = (
    _word("mode", "drive, stop, forge, again; or drive all the time", MODES, "start-stop"),
    _number("on_s", "s", "time the torque is on in each cycle", 0.01, 1e3, 1.0),
    _number("off_s", "s", "time the torque is off in each cycle", 0.01, 1e3, 2.0),
    _number("valve_rise_s", "s", "time in which the valve opens or closes", 1e-4, 10, 0.02),
    _number("brake_nm", "N m", "brake on the motor's shaft while the torque is off", 0, 1e5, 60.0),
    _number("brake_delay_s", "s", "from the closed valve to the brake", 0, 100, 0.0),
    _number("press_nm", "N m", "largest torque of the press blow on the wheel; 0: no blow", -1e6, 1e6, 1500.0),
    _number("press_delay_s", "s", "from the end of the torque to the blow", 0, 1e3, 1.0),
    _number("press_duration_s", "s", "length of the blow", 1e-3, 10, 0.02),
)

_GEARS = (
    _number("teeth_driver", "", "teeth of the pinion", 8, 200, 20, whole=True),
    _number("teeth_driven", "", "teeth of the wheel", 8, 1000, 100, whole=True),
    _number("module_mm", "mm", "module of both gears", 0.3, 50, 5.0),
    _number("pressure_angle_deg", "deg", "pressure angle", 14, 30, 20.0),
    _number("face_width_mm", "mm", "face width; for the rig file only", 1, 1000, 80.0),
    _number("contact_ratio", "", "mean pairs in contact; none: of standard teeth", LEAST_CONTACT_RATIO, 1.85, None),
    _number("mesh_ramp", "", "base pitches over which a pair takes up its load", *MESH_RAMP_RANGE, 0.05),
    _number("mesh_phase", "", "pinion's angle, in tooth pitches, at which a pair enters", 0, 1, 0.0),
)

_CONTACT = (
    _word(
        "contact_stiffness",
        "Hertzian point contact at the pitch point (1.8366e10 N/m^1.5 for the source's gears), or the source's table "
        "(1.72e9, printed as N/m)",
        STIFFNESSES,
        "formula",
    ),
    _number(
        "stiffness_n_per_m_lambda", "N/m^λ", "of one tooth pair, instead of either; none: as above", 1e5, 1e14, None
    ),
    _number("exponent", "", "λ: force grows as depth^λ", 1, 2, 1.5),
    _number("restitution", "", "speed after a free impact over speed before", 0.05, 1, 0.95),
    _word("damping_law", "damping that follows from the restitution", DAMPING_LAWS, DAMPING_LAWS[0]),
    _number("impact_speed_floor_mps", "m/s", "least speed of impact in the damping law", 1e-4, 10, 0.01),
    _number("half_backlash_um", "um", "half of the play along the line of action, new", 0, 5000, 150.0),
    _number("wear_um", "um", "worn off both drive flanks together, all over; it widens the play by that", 0, 5000, 0.0),
    _number(
        "sliding_wear_driver_um", "um", "worn off the pinion's drive flanks by sliding, where it is most", 0, 1000, 0.0
    ),
    _number(
        "sliding_wear_driven_um", "um", "worn off the wheel's drive flanks by sliding, where it is most", 0, 1000, 0.0
    ),
    _number("friction_coefficient", "", "sliding friction of the flanks", 0, MOST_FRICTION, 0.05),
    _number("flank_static_ratio", "", "static over sliding friction of the flanks", *STATIC_RATIO_RANGE, 1.2),
    _number("flank_stribeck_mps", "m/s", "sliding speed at which static friction has gone", 1e-4, 1, 0.005),
    _number("flank_presliding_um", "um", "deflection of the flanks' bristles at which they slide", 0.5, 1000, 10.0),
)

_MASSES = (
    _number("motor_inertia_kg_m2", "kg m^2", "motor, ahead of the torque sensor", 0, 1e4, 0.05),
    _number("pinion_inertia_kg_m2", "kg m^2", "pinion, behind the torque sensor", 1e-6, 1e4, 0.01),
    _number("wheel_inertia_kg_m2", "kg m^2", "wheel and gripper", 1e-5, 1e6, 42.0),
    _number("piece_mass_kg", "kg", "forge piece, a round bar", 0, 1e6, 290.0),
    _number("piece_radius_mm", "mm", "of the bar", 1, 5000, 150.0),
    _number("piece_offset_mm", "mm", "distance of the piece's centre from the axis", 0, 5000, 0.0),
    _number("piece_angle_deg", "deg", "where it hangs at the start, from below", -360, 360, 0.0),
)

_DRIVE = (
    _number(
        "motor_speed_band", "", "part of the speed limit over which the torque falls to nothing", *SPEED_BAND_RANGE, 0.3
    ),
    _number("torque_ripple", "", "ripple of the motor, part of its torque", 0, 1, 0.0),
    _number("torque_ripple_order", "", "ripples per revolution: pistons", 0.1, 1000, 9.0),
    _number("drag_nm", "N m", "sliding friction of motor and pinion shaft", 0, 1e5, 5.0),
    _number("drag_viscous_nm_s_per_rad", "N m s/rad", "viscous friction of them", 0, 1e5, 0.2),
    _number("load_friction_nm", "N m", "sliding friction of the gripper's bearings", 0, 1e6, 300.0),
    _number("load_viscous_nm_s_per_rad", "N m s/rad", "viscous friction of them", 0, 1e6, 20.0),
    _number("static_ratio", "", "static over sliding friction of both shafts", *STATIC_RATIO_RANGE, 1.3),
    _number("drag_stribeck_rad_per_s", "rad/s", "speed at which the motor's static friction has gone", 1e-4, 100, 0.1),
    _number("load_stribeck_rad_per_s", "rad/s", "the same of the gripper", 1e-4, 100, 0.02),
    _number("drag_presliding_rad", "rad", "deflection of the motor's bristles at which they slide", 1e-6, 0.1, 5e-4),
    _number("load_presliding_rad", "rad", "the same of the gripper", 1e-6, 0.1, 2e-4),
)

_CHAIN = (
    _word(
        "slow_channels",
        "torque, force, speeds and accelerations: instants, as a motion controller stores them and as forces from "
        "motion want them; or filtered below half the sampling rate, as a data logger does and as spectra want them",
        SAMPLINGS,
        "instants",
    ),
    _number(
        "encoder_counts", "", "counts per revolution of both encoders; 0: no rounding", 0, 2**30, 2**20, whole=True
    ),
    _number("angle_noise_urad", "urad", "rms noise of the angles", 0, 1e6, 1.0),
    _number("speed_noise_mrad_per_s", "mrad/s", "rms noise of the speeds", 0, 1e6, 1.0),
    _number("acceleration_noise_rad_per_s2", "rad/s^2", "rms noise of the angular accelerations", 0, 1e6, 0.5),
    _number("torque_noise_nm", "N m", "rms noise of the torque sensor", 0, 1e5, 0.2),
    _number("torque_gain", "", "reading of the torque sensor over the torque", 0.05, 20, 1.0),
    _number("vibration_noise_mps2", "m/s^2", "rms noise of the accelerometer", 0, 1e3, 0.05),
    _number("housing_mass_kg", "kg", "that moves with the pinion's bearing", 1, 1e5, 150.0),
    _number("housing_frequency_hz", "Hz", "its natural frequency on the frame", 20, 5000, 640.0),
    _number("housing_damping_ratio", "", "its damping ratio", 1e-3, 1, 0.03),
)

PARAMETERS: tuple[Parameter, ...] = (*_CYCLE, *_GEARS, *_CONTACT, *_MASSES, *_DRIVE, *_CHAIN)
"""All of them, by part of the machine."""
