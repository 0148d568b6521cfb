"""The parameters of the cracked spur pair: unit, range, meaning, default."""

from __future__ import annotations

from gearsig.rig import SIDES
from sims.machine import BEARING_LAWS, MAX_DRY_FRICTION
from sims.mesh import BODIES, MAX_SLICES
from sims.simulator import Parameter

_SWITCH = ("on", "off")


_GEARS = (
    Parameter("teeth_driver", "", "teeth of the driving gear", 5, 400, 29, whole=True),
    Parameter("teeth_driven", "", "teeth of the driven gear", 5, 400, 47, whole=True),
    Parameter("module_mm", "mm", "module of both gears", 0.3, 30, 2.0),
    Parameter("pressure_angle_deg", "deg", "pressure angle of the rack", 10, 30, 20.0),
    Parameter("face_width_mm", "mm", "face width of both gears", 1, 500, 20.0),
    Parameter(
        "helix_angle_deg",
        "deg",
        "helix angle, above 0: the driver is right-handed; module, pressure angle and tool are of the normal section",
        -45,
        45,
        0.0,
    ),
    Parameter("profile_shift_driver", "", "profile shift of the driver, in modules", -1, 1, 0.0),
    Parameter("profile_shift_driven", "", "profile shift of the driven gear, in modules", -1, 1, 0.0),
    Parameter("addendum", "", "addendum of both gears, in modules", 0.2, 2, 1.0),
    Parameter("dedendum", "", "dedendum of both gears, in modules", 0.2, 2.5, 1.25),
    Parameter("tool_tip_radius", "", "radius of the rack's tip, in modules; it makes the fillet", 0, 1, 0.38),
    Parameter("centre_distance_mm", "mm", "centre distance; none: without backlash", 3, 12000, None),
    Parameter("bore_radius_driver_mm", "mm", "bore radius; none: 0.35 of the root radius", 0.1, 5000, None),
    Parameter("bore_radius_driven_mm", "mm", "bore radius; none: 0.35 of the root radius", 0.1, 5000, None),
    Parameter("mass_driver_kg", "kg", "mass of the driver; none: of a disc with bore", 1e-3, 1e5, None),
    Parameter("mass_driven_kg", "kg", "mass of the driven gear; none: of a disc with bore", 1e-3, 1e5, None),
    Parameter("inertia_driver_kg_m2", "kg m^2", "moment of inertia; none: of a disc with bore", 1e-8, 1e5, None),
    Parameter("inertia_driven_kg_m2", "kg m^2", "moment of inertia; none: of a disc with bore", 1e-8, 1e5, None),
    Parameter("youngs_modulus_gpa", "GPa", "Young's modulus of both gears", 1, 500, 206.0),
    Parameter("poisson_ratio", "", "Poisson's ratio of both gears", 0, 0.49, 0.3),
    Parameter("density_kg_m3", "kg/m^3", "density, where masses come from the geometry", 500, 20000, 7850.0),
)

_MESH = (
    Parameter.choice(
        "contact_law",
        "Hertz contact: constant stiffness or growing with the load",
        ("linear", "load-dependent"),
        "linear",
    ),
    Parameter("mesh_ramp", "", "base pitches over which a tooth pair takes up its load", 0, 0.1, 0.05),
    Parameter.choice(
        "gear_body",
        "whether neighbouring teeth move each other through the body, as in finite elements: a quarter softer",
        BODIES,
        "separate",
    ),
    Parameter("mesh_damping_ratio", "", "damping ratio of the mesh on its mean stiffness", 0, 1, 0.06),
    Parameter("half_backlash_um", "um", "half of the play along the line of action", 0, 2000, 20.0),
    Parameter("tip_relief_um", "um", "metal taken off at the tips of both gears", 0, 500, 0.0),
    Parameter("tip_relief_length_mm", "mm", "length of the relief along the line of action", 0.01, 100, 1.0),
    Parameter("crowning_um", "um", "metal taken off at both ends of the face, a parabola from its middle", 0, 500, 0.0),
    Parameter("lead_error_um", "um", "misalignment of the flanks over the face width", -500, 500, 0.0),
    Parameter(
        "face_slices",
        "",
        "slices of the face width where it is helical, crowned or misaligned",
        2,
        MAX_SLICES,
        16,
        whole=True,
    ),
    Parameter(
        "pitch_deviation_um", "um", "rms deviation of the teeth from their places, an ordinary tolerance", 0, 50, 0.0
    ),
    Parameter("tolerance_seed", "", "which specimen: seed of the teeth's deviations", 0, 1e6, 0, whole=True),
    Parameter("roughness_um", "um", "composite rms roughness of both flanks", 0, 5, 0.0),
    Parameter.choice("roughness_locked_to", "what the rough profile follows", ("flank", "time", "none"), "flank"),
    Parameter("roughness_dimension", "", "fractal dimension of the rough profile", 1.001, 1.999, 1.5),
    Parameter.choice("friction", "sliding friction of the flanks", _SWITCH, "on"),
    Parameter("friction_factor", "", "multiplies the coefficient of friction", 0, 20, 1.0),
    Parameter(
        "dry_friction",
        "",
        "coefficient that is added at every sliding speed: starved flanks",
        0,
        MAX_DRY_FRICTION,
        0.0,
    ),
    Parameter("viscosity_cp", "cP", "dynamic viscosity of the oil at the inlet", 0.1, 1e4, 17.6),
)

_CRACK = (
    Parameter("crack_depth_mm", "mm", "length of a root crack; 0: none", 0, 100, 0.0),
    Parameter("crack_angle_deg", "deg", "between the crack and the tooth's centre line", 15, 90, 45.0),
    Parameter.choice("crack_gear", "gear with the crack", SIDES, "driver"),
    Parameter("crack_tooth", "", "tooth with the crack, from 1 at the mark", 1, 400, 1, whole=True),
    Parameter("crack_width_percent", "%", "part of the face width that the crack covers", 1, 100, 100.0),
)

_SHAFTS = (
    Parameter("runout_driver_um", "um", "eccentricity of the driver (half its run-out)", 0, 2000, 0.0),
    Parameter("runout_driven_um", "um", "eccentricity of the driven gear (half its run-out)", 0, 2000, 0.0),
    Parameter("runout_angle_driver_deg", "deg", "where the driver's eccentricity lies, from tooth 1", -360, 360, 0.0),
    Parameter("runout_angle_driven_deg", "deg", "where the driven gear's eccentricity lies", -360, 360, 0.0),
    Parameter("unbalance_driver_g_mm", "g mm", "unbalance of the driver", 0, 1e6, 0.0),
    Parameter("unbalance_driven_g_mm", "g mm", "unbalance of the driven gear", 0, 1e6, 0.0),
    Parameter("unbalance_angle_driver_deg", "deg", "where the driver's unbalance lies", -360, 360, 0.0),
    Parameter("unbalance_angle_driven_deg", "deg", "where the driven gear's unbalance lies", -360, 360, 0.0),
    Parameter("bending_stiffness_n_per_m", "N/m", "of each shaft, gear to bearings", 1e5, 1e12, 2e8),
    Parameter("bending_damping_n_s_per_m", "N s/m", "of each shaft, gear to bearings", 0, 1e6, 600.0),
    Parameter("torsional_stiffness_nm_per_rad", "N m/rad", "of each shaft, gear to rotor", 1, 1e9, 4e4),
    Parameter("torsional_damping_nm_s_per_rad", "N m s/rad", "of each shaft, gear to rotor", 0, 1e5, 8.0),
    Parameter("rotor_inertia_input_kg_m2", "kg m^2", "moment of inertia of the motor", 1e-7, 1e5, 2e-3),
    Parameter("rotor_inertia_output_kg_m2", "kg m^2", "moment of inertia of the load", 1e-7, 1e5, 1e-2),
    Parameter("bearing_distance_mm", "mm", "between the two bearings of a shaft", 5, 10000, 100.0),
    Parameter("coupling_bending_nm_per_rad", "N m/rad", "of each coupling, about its stiff axis", 0, 1e7, 0.0),
    Parameter(
        "governor_nm_s_per_rad",
        "N m s/rad",
        "of the drive; it holds the mean speed; none: recovers in 0.06 s",
        1e-6,
        1e5,
        None,
    ),
    Parameter("gravity_mps2", "m/s^2", "gravity", 0, 100, 9.81),
    Parameter(
        "line_of_action_deg",
        "deg",
        "of the line of action to the vertical; none: centres side by side",
        -180,
        180,
        None,
    ),
)

_BEARINGS = (
    Parameter("bearing_stiffness_n_per_m", "N/m", "of each bearing, to the ground", 1e5, 1e12, 2e8),
    Parameter("bearing_damping_n_s_per_m", "N s/m", "of each bearing, to the ground", 0, 1e6, 1500.0),
    Parameter("bearing_mass_kg", "kg", "moving with each bearing", 1e-3, 1e4, 0.3),
    Parameter.choice(
        "bearing_law",
        "one spring for each bearing, or Hertzian contacts of its balls one by one, as stiff as their size makes them",
        BEARING_LAWS,
        "linear",
    ),
    Parameter("bearing_clearance_um", "um", "radial clearance of each bearing, half of the play", 0, 500, 0.0),
    Parameter("n_balls", "", "rolling elements of each bearing", 3, 100, 9, whole=True),
    Parameter("ball_diameter_mm", "mm", "diameter of the rolling elements", 0.5, 300, 7.94),
    Parameter("ball_pitch_diameter_mm", "mm", "pitch diameter of the rolling elements", 2, 3000, 39.04),
    Parameter("ball_contact_angle_deg", "deg", "contact angle of the bearings", 0, 60, 0.0),
)

_CHAIN = (
    Parameter.choice(
        "channels", "a1 and a2, vertical at bearings 1 and 3; or vertical and horizontal at all", ("two", "all"), "two"
    ),
    Parameter.choice("path_modes", "modes of the housing between bearing and sensor", _SWITCH, "on"),
    Parameter("noise_mps2", "m/s^2", "vibration of the surroundings, rms in the band of the recording", 0, 1000, 0.05),
    Parameter("noise_slope", "", "power density of it goes as 1/f^slope: 0 white, 1 pink, 2 red", -2, 3, 0.0),
    Parameter("sensor_noise_mps2_per_sqrt_hz", "m/s^2/√Hz", "white noise of the accelerometers", 0, 10, 2e-4),
    Parameter("sensor_resonance_hz", "Hz", "of the mounted accelerometers; 0: flat", 0, 1e5, 25000.0),
    Parameter("sensor_bias_mps2", "m/s^2", "offset of the accelerometers at the recording's start", -1e3, 1e3, 0.0),
    Parameter("sensor_drift_mps2_per_s", "m/s^2/s", "change of that offset, as from warming up", -1e3, 1e3, 0.0),
    Parameter("sensor_range_mps2", "m/s^2", "range of accelerometers and converter, either way", 0.1, 1e6, 500.0),
    Parameter("converter_bits", "", "bits of the converter", 8, 32, 24, whole=True),
    Parameter(
        "tachometer_pulses",
        "",
        "pulses per revolution of the input shaft, the first where tooth 1 comes in; 0: none",
        0,
        1024,
        1,
        whole=True,
    ),
    Parameter("tachometer_jitter_us", "us", "standard deviation of the time of a pulse", 0, 1e4, 2.0),
    Parameter(
        "encoder_counts",
        "",
        "counts per revolution of the encoders, one at each gear; 0: none",
        0,
        2**30,
        0,
        whole=True,
    ),
    Parameter("encoder_noise_arcsec", "arcsec", "standard deviation of an encoder's reading", 0, 3600, 0.5),
    Parameter("hum_mps2", "m/s^2", "mains hum, peak of its first harmonic", 0, 1000, 0.0),
    Parameter("hum_frequency_hz", "Hz", "frequency of the mains", 10, 400, 50.0),
)

PARAMETERS: tuple[Parameter, ...] = (*_GEARS, *_MESH, *_CRACK, *_SHAFTS, *_BEARINGS, *_CHAIN)
"""All of them, by part of the machine."""
