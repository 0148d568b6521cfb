"""The parameters of a spur pair, and the machine, rig and measurement chain that they define."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, degrees, radians, sin

import numpy as np

from gearsig.checks import within
from gearsig.errors import InputError
from gearsig.rig import (
    SIDES,
    Bearing,
    EncoderChannel,
    GearPair,
    OperatingPoint,
    Rig,
    Sensor,
    Shaft,
    SpeedSource,
    TachometerChannel,
)
from sims.gear_pair._installed import HousingMode, Installed, Pickup, SensorSeat
from sims.machine import (
    BEARING_LAWS,
    MAX_DRY_FRICTION,
    BearingSupport,
    Drive,
    Lubrication,
    Machine,
    Operation,
    Profile,
    Roughness,
    ShaftLine,
    Wheel,
)
from sims.measure import (
    Accelerometer,
    AntiAlias,
    ColouredNoise,
    Converter,
    Encoder,
    MainsHum,
    MeasuredChannel,
    MeasurementChain,
    ModalPath,
    PathMode,
    Tachometer,
)
from sims.mesh import (
    BODIES,
    MAX_SLICES,
    FlankDeviation,
    GearGeometry,
    GearMesh,
    Lead,
    Material,
    PairGeometry,
    RootCrack,
    disc_inertia_kg_m2,
    disc_mass_kg,
    transverse_section,
)
from sims.simulator import Parameter, ParameterValues, Values

# --------------------
# The parameters: unit, meaning, range, default.
# --------------------


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
    Parameter("tool_tip_radius", "", "tip radius of the rack, in modules; it cuts the fillet", 0, 1, 0.38),
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
        "Hertzian contact: stiffness constant or increasing with the load",
        ("linear", "load-dependent"),
        "linear",
    ),
    Parameter("mesh_ramp", "", "base pitches over which a tooth pair takes up or gives up its load", 0, 0.1, 0.05),
    Parameter.choice(
        "gear_body",
        "whether neighbouring teeth move each other through the body, as in finite elements (a quarter softer)",
        BODIES,
        "separate",
    ),
    Parameter("mesh_damping_ratio", "", "damping ratio of the mesh on its mean stiffness", 0, 1, 0.06),
    Parameter("half_backlash_um", "um", "half of the backlash along the line of action", 0, 2000, 20.0),
    Parameter("tip_relief_um", "um", "metal removed at the tips of both gears", 0, 500, 0.0),
    Parameter("tip_relief_length_mm", "mm", "length of the relief along the line of action", 0.01, 100, 1.0),
    Parameter("crowning_um", "um", "metal removed at both ends of the face, a parabola from its middle", 0, 500, 0.0),
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
        "pitch_deviation_um", "um", "rms deviation of the teeth from their positions, a usual tolerance", 0, 50, 0.0
    ),
    Parameter("tolerance_seed", "", "specimen: seed of the teeth's deviations", 0, 1e6, 0, whole=True),
    Parameter("roughness_um", "um", "composite rms roughness of both flanks", 0, 5, 0.0),
    Parameter.choice("roughness_locked_to", "what the rough profile follows", ("flank", "time", "none"), "flank"),
    Parameter("roughness_dimension", "", "fractal dimension of the rough profile", 1.001, 1.999, 1.5),
    Parameter.choice("friction", "sliding friction of the flanks", _SWITCH, "on"),
    Parameter("friction_factor", "", "factor on the coefficient of friction", 0, 20, 1.0),
    Parameter(
        "dry_friction",
        "",
        "coefficient added at every sliding speed: starved flanks",
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
    Parameter("runout_angle_driver_deg", "deg", "angle of the driver's eccentricity, from tooth 1", -360, 360, 0.0),
    Parameter("runout_angle_driven_deg", "deg", "angle of the driven gear's eccentricity", -360, 360, 0.0),
    Parameter("unbalance_driver_g_mm", "g mm", "unbalance of the driver", 0, 1e6, 0.0),
    Parameter("unbalance_driven_g_mm", "g mm", "unbalance of the driven gear", 0, 1e6, 0.0),
    Parameter("unbalance_angle_driver_deg", "deg", "angle of the driver's unbalance", -360, 360, 0.0),
    Parameter("unbalance_angle_driven_deg", "deg", "angle of the driven gear's unbalance", -360, 360, 0.0),
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
        "gain of the drive's speed control, which holds the mean speed; none: recovers in 0.06 s",
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
    Parameter("bearing_mass_kg", "kg", "mass that moves with each bearing", 1e-3, 1e4, 0.3),
    Parameter.choice(
        "bearing_law",
        "one spring for each bearing, or a Hertzian contact for each of its balls, with the stiffness of their size",
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
    Parameter("noise_mps2", "m/s^2", "ambient vibration, rms in the recording's band", 0, 1000, 0.05),
    Parameter("noise_slope", "", "its power density is proportional to 1/f^slope: 0 white, 1 pink, 2 red", -2, 3, 0.0),
    Parameter("sensor_noise_mps2_per_sqrt_hz", "m/s^2/√Hz", "white noise of the accelerometers", 0, 10, 2e-4),
    Parameter("sensor_resonance_hz", "Hz", "of the mounted accelerometers; 0: flat", 0, 1e5, 25000.0),
    Parameter("sensor_bias_mps2", "m/s^2", "offset of the accelerometers at the recording's start", -1e3, 1e3, 0.0),
    Parameter("sensor_drift_mps2_per_s", "m/s^2/s", "change of that offset, as from warming up", -1e3, 1e3, 0.0),
    Parameter("sensor_range_mps2", "m/s^2", "range (±) of accelerometers and converter", 0.1, 1e6, 500.0),
    Parameter("converter_bits", "", "bits of the converter", 8, 32, 24, whole=True),
    Parameter(
        "tachometer_pulses",
        "",
        "pulses per revolution of the input shaft, the first when tooth 1 engages; 0: none",
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
"""All parameters, grouped by part of the machine."""


# --------------------
# The machine that they define.
# --------------------


# The measurement chain of the cracked spur pair: accelerometers at the bearings, a tachometer at the input shaft.

_PLACES = (
    (1, "input shaft, drive end"),
    (3, "output shaft, drive end"),
    (2, "input shaft, free end"),
    (4, "output shaft, free end"),
)
"""Bearings in the order of their channels, with their positions."""

_HOUSING = (
    HousingMode(1150.0, 0.03, 0.06, (1.0, 0.8, 0.9, 0.7)),
    HousingMode(2900.0, 0.02, 0.05, (1.0, -0.7, 0.6, -0.8)),
    HousingMode(6300.0, 0.02, 0.04, (1.0, 0.5, -0.9, -0.4)),
)
"""Default modes of the housing: plausible for a small cast housing; no housing was measured."""
_HORIZONTAL = 0.85
"""Factor on the frequencies of horizontal modes, which are lower because a housing stands on its feet."""


def build_chain(
    values: ParameterValues,
    line_of_action_deg: float,
    first_pulse_rev: tuple[float, float],
    sampling_rate_hz: float,
    installed: Installed | None = None,
) -> MeasurementChain:
    """Return the measurement chain that the parameters define.

    Parameters
    ----------
    values : ParameterValues
    line_of_action_deg : float
        β: the upward direction is x sin β + y cos β, to the right is x cos β − y sin β.
    first_pulse_rev : (float, float)
        Angle of the driver's and the driven shaft at a rising edge of a tachometer on it.
    sampling_rate_hz : float
    installed : Installed or None
        Its sensors, housing and tachometer replace the usual ones.
    """
    beta = radians(line_of_action_deg)
    directions = {"vertical": (sin(beta), cos(beta)), "horizontal": (cos(beta), -sin(beta))}
    modes = _HOUSING if installed is None else installed.modes
    channels = [
        _channel(seat, values, directions[seat.direction], modes if values.is_on("path_modes") else ())
        for seat in (_usual_seats(values) if installed is None else installed.sensors)
    ]
    names, pickup = (("input", "output"), Pickup()) if installed is None else (installed.shafts, installed.pickup)
    return MeasurementChain(
        sampling_rate_hz,
        tuple(channels),
        AntiAlias(),
        _tachometer(values, pickup, names[pickup.side], first_pulse_rev[pickup.side], installed is None),
        _encoders(values, names),
    )


def _usual_seats(values: ParameterValues) -> tuple[SensorSeat, ...]:
    everything = values.word("channels") == "all"
    seats = [(*place, "vertical") for place in (_PLACES if everything else _PLACES[:2])]
    if everything:
        seats += [(*place, "horizontal") for place in _PLACES]
    return tuple(
        SensorSeat(f"a{i}", bearing, direction, f"bearing {bearing}, {where}, {direction}")
        for i, (bearing, where, direction) in enumerate(seats, 1)
    )


def _channel(
    seat: SensorSeat, values: ParameterValues, direction: tuple[float, float], housing: tuple[HousingMode, ...]
) -> MeasuredChannel:
    range_mps2 = values.number("sensor_range_mps2")
    hum = values.number("hum_mps2")
    return MeasuredChannel(
        seat.channel,
        _path(seat.bearing, direction, _HORIZONTAL if seat.direction == "horizontal" else 1.0, housing),
        Accelerometer(
            resonance_hz=values.number("sensor_resonance_hz") or None,
            lower_limit_hz=0.5,
            range_mps2=range_mps2,
            noise_mps2_per_sqrt_hz=values.number("sensor_noise_mps2_per_sqrt_hz"),
            bias_mps2=values.number("sensor_bias_mps2"),
            drift_mps2_per_s=values.number("sensor_drift_mps2_per_s"),
        ),
        MainsHum((hum, 0.3 * hum, 0.2 * hum) if hum else (), values.number("hum_frequency_hz")),
        ColouredNoise(values.number("noise_mps2"), values.number("noise_slope")),
        Converter(range_mps2, values.whole("converter_bits")),
        seat.position,
    )


def _path(bearing: int, direction: tuple[float, float], factor: float, housing: tuple[HousingMode, ...]) -> ModalPath:
    """Path from the bearing under the sensor directly, and from the forces of all four through the housing's modes."""
    modes = [
        PathMode(
            factor * mode.frequency_hz,
            mode.damping_ratio,
            {
                name: gain
                for i, at_bearing in enumerate(mode.shape)
                for name, gain in _along(
                    i + 1, direction, mode.gain * mode.shape[bearing - 1] * at_bearing, " yield"
                ).items()
            },
        )
        for mode in housing
    ]
    return ModalPath(_along(bearing, direction, 1.0), tuple(modes))


def _along(bearing: int, direction: tuple[float, float], gain: float, suffix: str = "") -> dict[str, float]:
    return {f"bearing {bearing} {axis}{suffix}": gain * part for axis, part in zip("xy", direction, strict=True)}


def _tachometer(
    values: ParameterValues, pickup: Pickup, shaft: str, first_pulse_rev: float, usual: bool
) -> Tachometer | None:
    pulses = values.whole("tachometer_pulses") if usual else pickup.pulses_per_revolution
    if not pulses:
        return None
    jitter_s = 1e-6 * values.number("tachometer_jitter_us")
    return Tachometer(shaft, pulses, pickup.channel, jitter_s=jitter_s, first_pulse_rev=first_pulse_rev, noise_v=0.01)


def _encoders(values: ParameterValues, shafts: tuple[str, str]) -> tuple[Encoder, ...]:
    """One encoder at each gear: their difference is the transmission error."""
    counts, noise_deg = values.whole("encoder_counts"), values.number("encoder_noise_arcsec") / 3600.0
    return tuple(Encoder(f"{shaft} encoder", shaft, counts, noise_deg=noise_deg) for shaft in shafts if counts)


SHAFTS = ("input", "output")
"""Default names of the driver's and the driven shaft."""


def build_machine(values: Values, *, sampling_rate_hz: float = 20480.0, installed: Installed | None = None) -> Machine:
    """Return the machine defined by complete values of `PARAMETERS`, with its fittings.

    Raises
    ------
    InputError
        If parameters are inconsistent: teeth that interfere, a crack beyond the tooth, balls that overlap.
    """
    parameters = ParameterValues(values)
    mesh = build_mesh(parameters)
    line_deg = parameters.optional("line_of_action_deg")
    if line_deg is None:  # the line of centres, α_w ahead of x, is horizontal
        line_deg = -degrees(mesh.pair.working_pressure_angle_rad)
    return Machine(
        mesh=mesh,
        wheels=(_wheel(parameters, mesh, 0), _wheel(parameters, mesh, 1)),
        shafts=(_shaft(parameters, 0, installed), _shaft(parameters, 1, installed)),
        bearings=(
            _bearing(parameters, 1, installed),
            _bearing(parameters, 2, installed),
            _bearing(parameters, 3, installed),
            _bearing(parameters, 4, installed),
        ),
        chain=build_chain(parameters, line_deg, _first_pulse_rev(mesh.pair), sampling_rate_hz, installed),
        mesh_damping_ratio=parameters.number("mesh_damping_ratio"),
        half_backlash_um=parameters.number("half_backlash_um"),
        lubrication=Lubrication(
            parameters.is_on("friction"),
            parameters.number("viscosity_cp"),
            parameters.number("friction_factor"),
            parameters.number("dry_friction"),
        ),
        roughness=Roughness(
            parameters.number("roughness_um"),
            parameters.word("roughness_locked_to"),
            parameters.number("roughness_dimension"),
        ),
        drive=Drive(parameters.optional("governor_nm_s_per_rad")),
        gravity_mps2=parameters.number("gravity_mps2"),
        line_of_action_deg=line_deg,
    )


def build_mesh(values: ParameterValues) -> GearMesh:
    """Return geometry, material, crack and flanks of the pair."""
    pair = PairGeometry(gear_geometry(values, 0), gear_geometry(values, 1), values.optional("centre_distance_mm"))
    material = Material(
        values.number("youngs_modulus_gpa"), values.number("poisson_ratio"), values.number("density_kg_m3")
    )
    return GearMesh(
        pair,
        material,
        material,
        contact_law=values.word("contact_law"),
        cracks_1=_cracks(values, 0),
        cracks_2=_cracks(values, 1),
        flank_1=_flank(values, pair.driver, 0),
        flank_2=_flank(values, pair.driven, 1),
        ramp=values.number("mesh_ramp"),
        body=values.word("gear_body"),
        lead=_lead(values),
    )


def _lead(values: ParameterValues) -> Lead:
    lead = Lead(
        values.number("helix_angle_deg"), values.number("crowning_um"), values.number("lead_error_um"), n_slices=1
    )
    return lead if lead.even else replace(lead, n_slices=values.whole("face_slices"))


def build_rig(machine: Machine, operation: Operation, *, name: str = "", sources: Sequence[str] = ()) -> Rig:
    """Return the rig as it would be described from the machine's drawing, without any damage.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Speed and torque are stated if they are constant.
    name : str
    sources : sequence of str
    """
    pair = machine.mesh.pair
    first, second = machine.shaft_names
    return Rig(
        name=name,
        shafts=(Shaft(first, "ccw"), Shaft(second, "cw")),
        pairs=(
            GearPair(
                "stage 1",
                first,
                second,
                pair.driver.teeth,
                pair.driven.teeth,
                pair.driver.module_mm,
                pair.driver.pressure_angle_deg,
                pair.face_width_mm,
            ),
        ),
        bearings=tuple(support.bearing for support in machine.bearings),
        sensors=_sensors(machine.chain, first),
        operating_point=OperatingPoint(
            first, speed_rpm=_constant(operation.speed_rpm), torque_nm=_constant(operation.torque_nm)
        ),
        speed=_speed_source(machine.chain, first),
        sources=tuple(sources),
    )


def _first_pulse_rev(pair: PairGeometry) -> tuple[float, float]:
    """Angles of the tachometer's rising edge: half a tooth pitch later, tooth 0 is halfway through its contact.

    Tooth 0 is thus engaged during the first pitch after the edge and tooth 1 during the next, as diagnoses number
    teeth. One angle for a disc on the driver's shaft, one for the driven shaft.
    """
    pitches = pair.contact_ratio / 2.0 - 0.5
    return pitches / pair.driver.teeth, pitches / pair.driven.teeth


def gear_geometry(values: ParameterValues, side: int) -> GearGeometry:
    """Return the driver's (0) or the driven gear's (1) geometry."""
    name = SIDES[side]
    return transverse_section(
        values.whole(f"teeth_{name}"),
        values.number("module_mm"),
        values.number("pressure_angle_deg"),
        values.number("helix_angle_deg"),
        profile_shift=values.number(f"profile_shift_{name}"),
        face_width_mm=values.number("face_width_mm"),
        addendum=values.number("addendum"),
        dedendum=values.number("dedendum"),
        tool_tip_radius=values.number("tool_tip_radius"),
        bore_radius_mm=values.optional(f"bore_radius_{name}_mm"),
    )


def _cracks(values: ParameterValues, side: int) -> tuple[RootCrack, ...]:
    depth_mm, percent = values.number("crack_depth_mm"), values.number("crack_width_percent")
    if depth_mm == 0.0 or values.word("crack_gear") != SIDES[side]:
        return ()
    width_mm = None if percent == 100.0 else percent / 100.0 * values.number("face_width_mm")
    tooth = int(within(values.whole("crack_tooth"), "crack_tooth", 1, values.whole(f"teeth_{SIDES[side]}"))) - 1
    return (RootCrack(depth_mm, values.number("crack_angle_deg"), tooth, width_mm),)


def _flank(values: ParameterValues, gear: GearGeometry, side: int) -> FlankDeviation:
    return FlankDeviation(
        tip_relief_um=values.number("tip_relief_um"),
        tip_relief_length_mm=values.number("tip_relief_length_mm"),
        pitch_um=_pitch_um(values, gear.teeth, side),
    )


def _pitch_um(values: ParameterValues, teeth: int, side: int) -> tuple[float, ...]:
    """Deviations of one specimen's teeth, with the given rms and zero mean; the same in every run."""
    rms_um = values.number("pitch_deviation_um")
    if rms_um == 0.0:
        return ()
    drawn = np.random.default_rng([values.whole("tolerance_seed"), side]).standard_normal(teeth)
    drawn -= drawn.mean()
    return tuple(float(v) for v in rms_um * drawn / np.sqrt(np.mean(drawn**2)))


def _wheel(values: ParameterValues, mesh: GearMesh, side: int) -> Wheel:
    name, gear = SIDES[side], (mesh.pair.driver, mesh.pair.driven)[side]
    density = values.number("density_kg_m3")
    mass, inertia = values.optional(f"mass_{name}_kg"), values.optional(f"inertia_{name}_kg_m2")
    return Wheel(
        disc_mass_kg(gear, density) if mass is None else mass,
        disc_inertia_kg_m2(gear, density) if inertia is None else inertia,
        values.number(f"runout_{name}_um"),
        values.number(f"runout_angle_{name}_deg"),
        values.number(f"unbalance_{name}_g_mm"),
        values.number(f"unbalance_angle_{name}_deg"),
    )


def _shaft(values: ParameterValues, side: int, installed: Installed | None) -> ShaftLine:
    return ShaftLine(
        SHAFTS[side] if installed is None else installed.shafts[side],
        values.number("bending_stiffness_n_per_m"),
        values.number("bending_damping_n_s_per_m"),
        values.number("torsional_stiffness_nm_per_rad"),
        values.number("torsional_damping_nm_s_per_rad"),
        values.number(f"rotor_inertia_{SHAFTS[side]}_kg_m2"),
        bearing_distance_m=1e-3 * values.number("bearing_distance_mm"),
        coupling_bending_nm_per_rad=values.number("coupling_bending_nm_per_rad"),
    )


def _bearing(values: ParameterValues, number: int, installed: Installed | None) -> BearingSupport:
    bearing = _usual_bearing(values, number) if installed is None else installed.bearings[number - 1]
    _check_balls(bearing)
    return BearingSupport(
        bearing,
        values.number("bearing_mass_kg"),
        values.number("bearing_stiffness_n_per_m"),
        values.number("bearing_damping_n_s_per_m"),
        values.number("bearing_clearance_um"),
        law=values.word("bearing_law"),
    )


def _usual_bearing(values: ParameterValues, number: int) -> Bearing:
    return Bearing(
        f"bearing {number}",
        SHAFTS[(number - 1) // 2],
        values.whole("n_balls"),
        values.number("ball_diameter_mm"),
        values.number("ball_pitch_diameter_mm"),
        values.number("ball_contact_angle_deg"),
    )


def _check_balls(bearing: Bearing) -> None:
    n, ball, pitch = bearing.n_rolling_elements, bearing.rolling_element_diameter_mm, bearing.pitch_diameter_mm
    if n is not None and ball is not None and pitch is not None and ball >= pitch * np.sin(np.pi / n):
        raise InputError(
            f"{n} balls of {ball:g} mm do not fit on a pitch diameter of {pitch:g} mm",
            where="n_balls",
            allowed=f"balls below {pitch * np.sin(np.pi / n):.3g} mm",
        )


def _sensors(chain: MeasurementChain, shaft: str) -> tuple[Sensor, ...]:
    sensors = [Sensor(c.name, "acceleration", "m/s^2", c.position) for c in chain.channels]
    if chain.tachometer is not None:
        sensors.append(Sensor(chain.tachometer.channel, "tachometer", "V", f"{chain.tachometer.shaft or shaft} shaft"))
    sensors += [Sensor(e.channel, "encoder", "deg", e.shaft or shaft, wraps=e.wraps) for e in chain.encoders]
    return tuple(sensors)


def _speed_source(chain: MeasurementChain, shaft: str) -> SpeedSource | None:
    tacho = chain.tachometer
    if tacho is not None:
        return TachometerChannel(tacho.channel, tacho.pulses_per_revolution, shaft=tacho.shaft or shaft)
    for encoder in chain.encoders[:1]:
        return EncoderChannel(encoder.channel, 360.0, wraps=encoder.wraps, shaft=encoder.shaft or shaft)
    return None


def _constant(profile: Profile) -> float | None:
    return float(profile.values[0]) if np.ptp(profile.values) == 0.0 else None
