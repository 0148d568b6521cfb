"""From parameter values to a machine, and from a machine to its rig."""

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
from sims.machine import BearingSupport, Drive, Lubrication, Machine, Operation, Profile, Roughness, ShaftLine, Wheel
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
from sims.simulator import ParameterValues, Values

# The measurement chain of the cracked spur pair: accelerometers at the bearings, a tachometer at the input shaft.

_PLACES = (
    (1, "input shaft, drive end"),
    (3, "output shaft, drive end"),
    (2, "input shaft, free end"),
    (4, "output shaft, free end"),
)
"""Bearings in the order of their channels."""

_HOUSING = (
    HousingMode(1150.0, 0.03, 0.06, (1.0, 0.8, 0.9, 0.7)),
    HousingMode(2900.0, 0.02, 0.05, (1.0, -0.7, 0.6, -0.8)),
    HousingMode(6300.0, 0.02, 0.04, (1.0, 0.5, -0.9, -0.4)),
)
"""The housing's modes where none are given: plausible for a small cast housing; no housing was measured."""
_HORIZONTAL = 0.85
"""Horizontal modes lie lower by this factor: a housing stands on its feet."""


def build_chain(
    values: ParameterValues,
    line_of_action_deg: float,
    first_pulse_rev: tuple[float, float],
    sampling_rate_hz: float,
    installed: Installed | None = None,
) -> MeasurementChain:
    """Return the chain that the parameters describe.

    Parameters
    ----------
    values : ParameterValues
    line_of_action_deg : float
        β: upwards is x sin β + y cos β, to the right x cos β − y sin β.
    first_pulse_rev : (float, float)
        Angle of the driver's and the driven shaft at a rising edge of a tachometer on it.
    sampling_rate_hz : float
    installed : Installed or None
        Its sensors, housing and tachometer take the place of the usual ones.
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
    """Straight from the bearing under the sensor, and by the housing's modes from the forces of all four."""
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
    """One at each gear: what lies between both is the transmission error."""
    counts, noise_deg = values.whole("encoder_counts"), values.number("encoder_noise_arcsec") / 3600.0
    return tuple(Encoder(f"{shaft} encoder", shaft, counts, noise_deg=noise_deg) for shaft in shafts if counts)


SHAFTS = ("input", "output")
"""Names of the driver's and the driven shaft where none are given."""


def build_machine(values: Values, *, sampling_rate_hz: float = 20480.0, installed: Installed | None = None) -> Machine:
    """Return the machine that complete values of `PARAMETERS` describe, with what is fitted to it.

    Raises
    ------
    InputError
        If parameters do not fit each other: teeth that interfere, a crack past the tooth, balls that overlap.
    """
    parameters = ParameterValues(values)
    mesh = build_mesh(parameters)
    line_deg = parameters.optional("line_of_action_deg")
    if line_deg is None:  # the line of centres, α_w ahead of x, lies level
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
    """Return what somebody who knows the machine's drawing would write into a rig file; no damage is in it.

    Parameters
    ----------
    machine : Machine
    operation : Operation
        Speed and torque are stated where they are constant.
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
    """Angle at which the tachometer's disc is fitted: half a tooth pitch later, tooth 0 is half through its contact.

    So tooth 0 is engaged during the first pitch after the edge, tooth 1 during the next: as diagnoses count teeth.
    One for a disc on the driver's shaft, one for the driven shaft.
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
    """Deviations of one specimen's teeth from their places, of the wanted rms and zero mean; the same in every run."""
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
    if isinstance(chain.tachometer, Tachometer):
        sensors.append(Sensor(chain.tachometer.channel, "tachometer", "V", f"{chain.tachometer.shaft or shaft} shaft"))
    sensors += [Sensor(e.channel, "encoder", "deg", e.shaft or shaft, wraps=e.wraps) for e in chain.encoders]
    return tuple(sensors)


def _speed_source(chain: MeasurementChain, shaft: str) -> SpeedSource | None:
    tacho = chain.tachometer
    if isinstance(tacho, Tachometer):
        return TachometerChannel(tacho.channel, tacho.pulses_per_revolution, shaft=tacho.shaft or shaft)
    for encoder in chain.encoders[:1] if tacho is None else ():
        return EncoderChannel(encoder.channel, 360.0, wraps=encoder.wraps, shaft=encoder.shaft or shaft)
    return None  # a counter's pulse times belong to the recording


def _constant(profile: Profile) -> float | None:
    return float(profile.values[0]) if np.ptp(profile.values) == 0.0 else None
