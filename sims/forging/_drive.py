"""The parts of a forging manipulator's rotary drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, radians, sqrt

import numpy as np

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError
from gearsig.rig import (
    DAMPING_LAWS,
    SIDES,
    EncoderChannel,
    GearPair,
    OperatingPoint,
    PathOfContact,
    Rig,
    Sensor,
    Shaft,
    ToothContact,
    hertz_stiffness_n_per_m1p5,
    standard_path,
)
from sims.machine import Operation, Profile, WeakTooth
from sims.mesh import GearGeometry, PairGeometry, wear_profile
from sims.simulator import Parameter, ParameterValues

STATIC_RATIO_RANGE = (1.0, 10.0)
MESH_RAMP_RANGE = (0.005, 0.1)
MIN_CONTACT_RATIO = 1.1


@dataclass(frozen=True)
class Bristle:
    """LuGre friction: elastic bristles that deflect, then slide; static friction exceeds sliding friction.

    z' = (v − |v| z/h(v))/x₀,  F = L (z + τ z' e^{−(v/v_s)²}) + c v,  h = 1 + (r − 1) e^{−(v/v_s)²}

    Parameters
    ----------
    level : float
        L, sliding friction in N m (for tooth flanks: 1, times μN).
    static_ratio : float
        r, static over sliding friction, at least 1.
    stribeck_speed : float
        v_s, above 0, in rad/s (flanks: m/s).
    presliding : float
        x₀, deflection at which a bristle slides, in rad (flanks: m). The stiffness near rest is L/x₀.
    damping_time_s : float
        τ of the bristles.
    viscous : float
        c in N m s/rad.

    Notes
    -----
    Source: C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, A new model for control of systems with friction,
    IEEE Transactions on Automatic Control 40 (1995). The bristle state z is in units of the sliding friction, so that a
    variable level (a brake, a normal force) scales its force.
    """

    level: float
    static_ratio: float
    stribeck_speed: float
    presliding: float
    damping_time_s: float = 0.0
    viscous: float = 0.0


@dataclass(frozen=True)
class ForgingDrive:
    """Pinion with hydraulic motor, wheel with gripper and piece; one rotational degree of freedom each.

    A motor with a proportional valve gives torque up to the speed that its flow allows:

        T = T_set(t) · (1 + ε cos(n θ1)) · clip((ω_lim − ω1)/(b ω_lim), −1, 1)

    Parameters
    ----------
    path : PathOfContact
    contact : ToothContact
        Its inertias are those of the motor, of the pinion, and of the wheel with gripper and piece.
    flanks : Bristle
        Of the tooth flanks, with level 1: their friction is μN.
    drag : Bristle
        Friction of motor and bearings; the brake adds to its level.
    load_friction : Bristle
        Of the gripper's bearings.
    speed_limit_rad_s : float
        ω_lim of the pinion; 0: no limit.
    speed_band : float
        b: fraction of the speed limit over which the torque falls from full to zero.
    ripple_fraction, ripple_order : float
        ε and n: torque ripple caused by pistons.
    unbalance_nm : float
        Weight of an off-centre piece times its distance from the axis.
    unbalance_angle_rad : float
        Its angle from the lowest position when the wheel is at 0.
    weak_tooth : WeakTooth or None
    wear_um : tuple of float
        Total wear of both drive flanks, at equal steps of the path of contact from a pair's entry to its exit; empty:
        none. The same for all teeth; the pitch point is crossed smoothly over a 64th of the path.

    Notes
    -----
    Neglected: bending of shafts and of the torque sensor (the paper assumes them rigid), bearings, profile errors, wear
    that differs between teeth or grows during a run (the paper assumes equal teeth), oil between the flanks. Teeth
    never break or yield, however large the torque, as neither strength nor hardness of the teeth is stated.
    """

    path: PathOfContact
    contact: ToothContact
    flanks: Bristle
    drag: Bristle
    load_friction: Bristle
    speed_limit_rad_s: float = 0.0
    speed_band: float = 0.3
    ripple_fraction: float = 0.0
    ripple_order: float = 9.0
    unbalance_nm: float = 0.0
    unbalance_angle_rad: float = 0.0
    weak_tooth: WeakTooth | None = None
    wear_um: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        highest = 1.9 - self.path.ramp
        within(
            self.path.contact_ratio,
            "contact_ratio",
            MIN_CONTACT_RATIO,
            highest,
            remedy="one to two pairs are in contact",
        )
        if self.contact.driven_inertia_kg_m2 is None or self.pinion_side_inertia_kg_m2 <= 0.0:
            raise InputError("an inertia is missing", where="forging drive", allowed="above 0 kg m^2 on both sides")

    @property
    def pinion_side_inertia_kg_m2(self) -> float:
        """Moment of inertia of motor and pinion."""
        return self.contact.motor_inertia_kg_m2 + self.contact.driver_inertia_kg_m2

    @property
    def reduced_mass_kg(self) -> float:
        """1/(rb1²/J1 + rb2²/J2), the effective mass for an impact along the line of action."""
        r1, r2 = self.path.base_radii_m
        driven = self.contact.driven_inertia_kg_m2 or 0.0
        return 1.0 / (r1**2 / self.pinion_side_inertia_kg_m2 + r2**2 / driven)


# Timing of motor, brake and press.

START_STOP, CONTINUOUS = MODES = ("start-stop", "continuous")


@dataclass(frozen=True)
class Cycle:
    """Working cycle of the manipulator: drive, stop, forge, repeat; or drive continuously.

    Parameters
    ----------
    mode : str
        One of `MODES`.
    on_s, off_s : float
        Times for which the torque is on, then off; above 0.
    rise_s : float
        Time in which the valve opens or closes; above 0.
    brake_nm : float
        Brake torque on the motor's shaft while the torque is off.
    brake_delay_s : float
        From closed valve to brake.
    press_nm : float
        Maximum torque of a press blow on the wheel, positive forwards; parabolic over time.
    press_delay_s, press_duration_s : float
        From the end of the torque to the blow, and duration of the blow.
    """

    mode: str = START_STOP
    on_s: float = 1.0
    off_s: float = 2.0
    rise_s: float = 0.02
    brake_nm: float = 0.0
    brake_delay_s: float = 0.0
    press_nm: float = 0.0
    press_delay_s: float = 1.0
    press_duration_s: float = 0.02

    def __post_init__(self) -> None:
        if self.mode == CONTINUOUS:
            return
        if self.rise_s >= min(self.on_s, self.off_s):
            raise InputError(f"rise_s is {self.rise_s:g} s", allowed="less than on_s and off_s")
        if self.press_nm and self.press_delay_s + self.press_duration_s > self.off_s:
            raise InputError(
                f"the press blow ends {self.press_delay_s + self.press_duration_s:g} s after the torque",
                allowed=f"within off_s, {self.off_s:g} s",
            )
        if self.brake_nm and self.brake_delay_s + 2.0 * self.rise_s >= self.off_s:
            raise InputError(f"brake_delay_s is {self.brake_delay_s:g} s", allowed=f"well within {self.off_s:g} s")

    def starts_s(self, duration_s: float) -> FloatArray:
        """Times at which the torque is switched on."""
        if self.mode == CONTINUOUS:
            return np.zeros(1)
        return np.arange(0.0, duration_s, self.on_s + self.off_s)


@dataclass(frozen=True)
class Schedule:
    """Profiles of a run: torque and brake of the motor, torque of the press on the wheel, in N m."""

    torque_nm: Profile
    brake_nm: Profile
    press_nm: Profile

    def segments(self, duration_s: float) -> FloatArray:
        """Times between which all profiles are linear, from 0 to `duration_s`."""
        knots = np.concatenate([c.times_s for c in (self.torque_nm, self.brake_nm, self.press_nm)])
        inside = knots[(knots > 0.0) & (knots < duration_s)]
        return np.unique(np.round(np.concatenate([[0.0], inside, [duration_s]]), 12))

    def straight(self, start_s: float, end_s: float) -> FloatArray:
        """Start time, then value and slope of torque, brake and press over one segment."""
        values = [start_s]
        for profile in (self.torque_nm, self.brake_nm, self.press_nm):
            first, last = (float(profile.at(time)) for time in (start_s, end_s))
            values += [first, (last - first) / (end_s - start_s)]
        return np.array(values)


def schedule(cycle: Cycle, torque_nm: Profile, duration_s: float) -> Schedule:
    """Return the profiles of a run from rest; a stop must fit within the record.

    Raises
    ------
    InputError
        If a stop is longer than the record.
    """
    positive(duration_s, "duration_s", "s")
    if cycle.mode == CONTINUOUS:
        gate = Profile.of([0.0, cycle.rise_s], [0.0, 1.0])
        nothing = Profile.constant(0.0)
        return Schedule(_product(torque_nm, gate), nothing, nothing)
    if cycle.off_s >= duration_s:
        raise InputError(
            f"a stop of off_s = {cycle.off_s:g} s is longer than the record of {duration_s:g} s",
            allowed="a stop that ends within the record",
            remedy="raise --duration or lower off_s",
        )
    starts = cycle.starts_s(duration_s)
    ends = starts + cycle.on_s
    gate = _pulses(starts, ends, cycle.rise_s)
    brake_on = ends + cycle.rise_s + cycle.brake_delay_s
    brake = _pulses(brake_on, starts + cycle.on_s + cycle.off_s - cycle.rise_s, cycle.rise_s, cycle.brake_nm)
    return Schedule(_product(torque_nm, gate), brake, _blows(ends + cycle.press_delay_s, cycle))


def _pulses(starts: FloatArray, ends: FloatArray, rise_s: float, height: float = 1.0) -> Profile:
    """Trapezoidal pulses that rise at each start and fall at each end, in `rise_s`."""
    if height == 0.0:
        return Profile.constant(0.0)
    times = np.stack([starts, starts + rise_s, ends, ends + rise_s], axis=1).ravel()
    values = np.tile([0.0, height, height, 0.0], len(starts))
    keep = np.concatenate([[True], np.diff(times) > 1e-12])
    return Profile.of(times[keep], values[keep])


def _blows(starts: FloatArray, cycle: Cycle) -> Profile:
    """Parabolas of the press torque, piecewise linear."""
    if cycle.press_nm == 0.0:
        return Profile.constant(0.0)
    x = np.linspace(0.0, 1.0, 9)
    times = (starts[:, None] + cycle.press_duration_s * x).ravel()
    return Profile.of(times, np.tile(4.0 * cycle.press_nm * x * (1.0 - x), len(starts)))


def _product(first: Profile, second: Profile) -> Profile:
    """Product of two profiles at the knots of both, linear in between."""
    times = np.unique(np.concatenate([first.times_s, second.times_s]))
    return Profile.of(times, first.at(times) * second.at(times))


# The parameters of the forging manipulator's drive: unit, meaning, range, default.

STIFFNESSES = ("formula", "table")
"""Two stiffnesses that one source gives for the same gears: by its formula, and in its table, a tenth of that."""
SAMPLINGS = ("instants", "filtered")


_CYCLE = (
    Parameter.choice("mode", "drive, stop, forge, repeat; or drive continuously", MODES, "start-stop"),
    Parameter("on_s", "s", "time the torque is on in each cycle", 0.01, 1e3, 1.0),
    Parameter("off_s", "s", "time the torque is off in each cycle", 0.01, 1e3, 2.0),
    Parameter("valve_rise_s", "s", "time in which the valve opens or closes", 1e-4, 10, 0.02),
    Parameter("brake_nm", "N m", "brake on the motor's shaft while the torque is off", 0, 1e5, 60.0),
    Parameter("brake_delay_s", "s", "from the closed valve to the brake", 0, 100, 0.0),
    Parameter("press_nm", "N m", "maximum torque of the press blow on the wheel; 0: no blow", -1e6, 1e6, 1500.0),
    Parameter("press_delay_s", "s", "from the end of the torque to the blow", 0, 1e3, 1.0),
    Parameter("press_duration_s", "s", "duration of the blow", 1e-3, 10, 0.02),
)

_GEARS = (
    Parameter("teeth_driver", "", "teeth of the pinion", 8, 200, 20, whole=True),
    Parameter("teeth_driven", "", "teeth of the wheel", 8, 1000, 100, whole=True),
    Parameter("module_mm", "mm", "module of both gears", 0.3, 50, 5.0),
    Parameter("pressure_angle_deg", "deg", "pressure angle", 14, 30, 20.0),
    Parameter("face_width_mm", "mm", "face width; for the rig file only", 1, 1000, 80.0),
    Parameter("contact_ratio", "", "mean number of pairs in contact; none: standard", MIN_CONTACT_RATIO, 1.85, None),
    Parameter("mesh_ramp", "", "base pitches over which a pair takes up or gives up its load", *MESH_RAMP_RANGE, 0.05),
    Parameter("mesh_phase", "", "pinion's angle, in tooth pitches, at which a pair enters", 0, 1, 0.0),
)

_CONTACT = (
    Parameter.choice(
        "contact_stiffness",
        "Hertzian point contact at the pitch point (1.8366e10 N/m^1.5 for the source's gears), or the value of the "
        "source's table (1.72e9, printed as N/m)",
        STIFFNESSES,
        "formula",
    ),
    Parameter("stiffness_n_per_m_lambda", "N/m^λ", "of one tooth pair, replaces both; none: as above", 1e5, 1e14, None),
    Parameter("exponent", "", "λ: force grows as depth^λ", 1, 2, 1.5),
    Parameter("restitution", "", "speed after a free impact over speed before", 0.05, 1, 0.95),
    Parameter.choice("damping_law", "damping that follows from the restitution", DAMPING_LAWS, DAMPING_LAWS[0]),
    Parameter("impact_speed_floor_mps", "m/s", "minimum impact speed in the damping law", 1e-4, 10, 0.01),
    Parameter("half_backlash_um", "um", "half of the backlash along the line of action, unworn", 0, 5000, 150.0),
    Parameter(
        "wear_um", "um", "uniform wear of both drive flanks together; increases the backlash by as much", 0, 5000, 0.0
    ),
    Parameter("sliding_wear_driver_um", "um", "maximum wear of the pinion's drive flanks by sliding", 0, 1000, 0.0),
    Parameter("sliding_wear_driven_um", "um", "maximum wear of the wheel's drive flanks by sliding", 0, 1000, 0.0),
    Parameter("friction_coefficient", "", "sliding friction of the flanks", 0, 0.5, 0.05),
    Parameter("flank_static_ratio", "", "static over sliding friction of the flanks", *STATIC_RATIO_RANGE, 1.2),
    Parameter("flank_stribeck_mps", "m/s", "sliding speed at which static friction has decayed", 1e-4, 1, 0.005),
    Parameter("flank_presliding_um", "um", "deflection of the flanks' bristles at which they slide", 0.5, 1000, 10.0),
)

_MASSES = (
    Parameter("motor_inertia_kg_m2", "kg m^2", "motor, before the torque sensor", 0, 1e4, 0.05),
    Parameter("pinion_inertia_kg_m2", "kg m^2", "pinion, after the torque sensor", 1e-6, 1e4, 0.01),
    Parameter("wheel_inertia_kg_m2", "kg m^2", "wheel and gripper", 1e-5, 1e6, 42.0),
    Parameter("piece_mass_kg", "kg", "workpiece, a round bar", 0, 1e6, 290.0),
    Parameter("piece_radius_mm", "mm", "of the bar", 1, 5000, 150.0),
    Parameter("piece_offset_mm", "mm", "distance of the piece's centre from the axis", 0, 5000, 0.0),
    Parameter("piece_angle_deg", "deg", "its angle at the start, from the lowest position", -360, 360, 0.0),
)

_DRIVE = (
    Parameter("motor_speed_band", "", "part of the speed limit over which the torque falls to zero", 0.01, 1.0, 0.3),
    Parameter("torque_ripple", "", "ripple of the motor as a fraction of its torque", 0, 1, 0.0),
    Parameter("torque_ripple_order", "", "ripples per revolution (pistons)", 0.1, 1000, 9.0),
    Parameter("drag_nm", "N m", "sliding friction of motor and pinion shaft", 0, 1e5, 5.0),
    Parameter("drag_viscous_nm_s_per_rad", "N m s/rad", "viscous friction of motor and pinion shaft", 0, 1e5, 0.2),
    Parameter("load_friction_nm", "N m", "sliding friction of the gripper's bearings", 0, 1e6, 300.0),
    Parameter("load_viscous_nm_s_per_rad", "N m s/rad", "viscous friction of the gripper's bearings", 0, 1e6, 20.0),
    Parameter("static_ratio", "", "static over sliding friction of both shafts", *STATIC_RATIO_RANGE, 1.3),
    Parameter(
        "drag_stribeck_rad_per_s", "rad/s", "speed at which the motor's static friction has decayed", 1e-4, 100, 0.1
    ),
    Parameter("load_stribeck_rad_per_s", "rad/s", "the same for the gripper", 1e-4, 100, 0.02),
    Parameter("drag_presliding_rad", "rad", "deflection of the motor's bristles at which they slide", 1e-6, 0.1, 5e-4),
    Parameter("load_presliding_rad", "rad", "the same for the gripper", 1e-6, 0.1, 2e-4),
)

_CHAIN = (
    Parameter.choice(
        "slow_channels",
        "torque, force, speeds and accelerations: instantaneous, as stored by a motion controller and needed for "
        "forces from motion; or filtered below half the sampling rate, as by a data logger and needed for spectra",
        SAMPLINGS,
        "instants",
    ),
    Parameter(
        "encoder_counts", "", "counts per revolution of both encoders; 0: no rounding", 0, 2**30, 2**20, whole=True
    ),
    Parameter("angle_noise_urad", "urad", "rms noise of the angles", 0, 1e6, 1.0),
    Parameter("speed_noise_mrad_per_s", "mrad/s", "rms noise of the speeds", 0, 1e6, 1.0),
    Parameter("acceleration_noise_rad_per_s2", "rad/s^2", "rms noise of the angular accelerations", 0, 1e6, 0.5),
    Parameter("torque_noise_nm", "N m", "rms noise of the torque sensor", 0, 1e5, 0.2),
    Parameter("torque_gain", "", "reading of the torque sensor over the true torque", 0.05, 20, 1.0),
    Parameter("vibration_noise_mps2", "m/s^2", "rms noise of the accelerometer", 0, 1e3, 0.05),
    Parameter("housing_mass_kg", "kg", "mass that moves with the pinion's bearing", 1, 1e5, 150.0),
    Parameter("housing_frequency_hz", "Hz", "its natural frequency on the frame", 20, 5000, 640.0),
    Parameter("housing_damping_ratio", "", "its damping ratio", 1e-3, 1, 0.03),
)

PARAMETERS: tuple[Parameter, ...] = (*_CYCLE, *_GEARS, *_CONTACT, *_MASSES, *_DRIVE, *_CHAIN)
"""All parameters, grouped by part of the machine."""

# Wear of the drive flanks by sliding, over the path of contact.

N_PLACES = 65


def gear_pair(values: ParameterValues) -> PairGeometry:
    """Return the geometry of both gears for `sims.mesh`."""
    module, angle, width = (values.number(n) for n in ("module_mm", "pressure_angle_deg", "face_width_mm"))
    gears = [GearGeometry(values.whole(f"teeth_{side}"), module, angle, face_width_mm=width) for side in SIDES]
    return PairGeometry(gears[0], gears[1])


def worn_um(values: ParameterValues, path: PathOfContact) -> tuple[float, ...]:
    """Return the total wear depth of both drive flanks of a pair over its path of contact, (N_PLACES,).

    Each gear's share has the shape of Archard's law, see `sims.mesh.wear_profile`: maximum at the ends of the path, 0
    at the pitch point. Empty if there is no wear.
    """
    deepest = [values.number(f"sliding_wear_{side}_um") for side in SIDES]
    if not any(deepest):
        return ()
    pair = gear_pair(values)
    driver_mm = 1e3 * path.driver_lever_m(np.linspace(0.0, path.contact_ratio, N_PLACES))
    rolls = (driver_mm, 1e3 * path.length_m - driver_mm)
    shares = [
        depth * wear_profile(pair, side, roll)
        for side, depth, roll in zip((1, 2), deepest, rolls, strict=True)
        if depth
    ]
    return tuple(float(depth) for depth in np.sum(shares, axis=0))


# From parameter values to the drive, its cycle, and its rig.

TABLE_STIFFNESS = 1.72e9
"""Value of the source's table, printed there in N/m; taken in N/m^1.5."""
SHAFTS = ("pinion", "wheel")
GRAVITY_MPS2 = 9.81
BRISTLE_DAMPING = 0.5
"""Damping ratio of an inertia that oscillates on its bristles at rest."""


def build_drive(values: ParameterValues, speed_limit_rpm: float, weak_tooth: WeakTooth | None = None) -> ForgingDrive:
    """Return the drive defined by complete values of `PARAMETERS`."""
    path = standard_path(
        (values.whole("teeth_driver"), values.whole("teeth_driven")),
        values.number("module_mm") * 1e-3,
        radians(values.number("pressure_angle_deg")),
        phase=values.number("mesh_phase"),
        contact_ratio=values.optional("contact_ratio"),
        ramp=values.number("mesh_ramp"),
    )
    contact = build_contact(values, path)
    brake = values.number("brake_nm")
    drag, held = values.number("drag_nm"), values.number("load_friction_nm")
    pinion_side = contact.motor_inertia_kg_m2 + contact.driver_inertia_kg_m2
    flanks = Bristle(
        1.0,
        values.number("flank_static_ratio"),
        values.number("flank_stribeck_mps"),
        values.number("flank_presliding_um") * 1e-6,
    )
    return ForgingDrive(
        path,
        contact,
        flanks,
        _bristle(values, "drag", drag, drag + brake, pinion_side),
        _bristle(values, "load", held, held, contact.driven_inertia_kg_m2 or 0.0),
        speed_limit_rpm * pi / 30.0,
        values.number("motor_speed_band"),
        values.number("torque_ripple"),
        values.number("torque_ripple_order"),
        values.number("piece_mass_kg") * GRAVITY_MPS2 * values.number("piece_offset_mm") * 1e-3,
        radians(values.number("piece_angle_deg")),
        weak_tooth,
        worn_um(values, path),
    )


def build_contact(values: ParameterValues, path: PathOfContact) -> ToothContact:
    """Return the contact of the flanks, with the inertias of both sides."""
    piece = 0.5 * values.number("piece_mass_kg") * (values.number("piece_radius_mm") * 1e-3) ** 2
    offset = values.number("piece_mass_kg") * (values.number("piece_offset_mm") * 1e-3) ** 2
    return ToothContact(
        _stiffness(values, path),
        "stage 1",
        values.number("exponent"),
        values.number("half_backlash_um") + 0.5 * values.number("wear_um"),
        values.number("restitution"),
        values.word("damping_law"),
        values.number("impact_speed_floor_mps"),
        values.number("friction_coefficient"),
        values.number("pinion_inertia_kg_m2"),
        values.number("wheel_inertia_kg_m2") + piece + offset,
        path.phase,
        path.contact_ratio,
        values.number("motor_inertia_kg_m2"),
        path.ramp,
    )


def build_cycle(values: ParameterValues) -> Cycle:
    """Return the working cycle defined by the parameters."""
    return Cycle(
        values.word("mode"),
        values.number("on_s"),
        values.number("off_s"),
        values.number("valve_rise_s"),
        values.number("brake_nm"),
        values.number("brake_delay_s"),
        values.number("press_nm"),
        values.number("press_delay_s"),
        values.number("press_duration_s"),
    )


def build_rig(
    drive: ForgingDrive,
    values: ParameterValues,
    operation: Operation,
    sensors: Sequence[Sensor],
    *,
    name: str = "",
    sources: Sequence[str] = (),
) -> Rig:
    """Return the rig as it would be described from the machine's drawing, without wear."""
    contact = build_contact(ParameterValues(values.values | {"wear_um": 0.0}), drive.path)
    torque = operation.torque_nm
    pair = GearPair(
        "stage 1",
        *SHAFTS,
        *drive.path.teeth,
        values.number("module_mm"),
        values.number("pressure_angle_deg"),
        values.number("face_width_mm"),
    )
    return Rig(
        name=name,
        shafts=(Shaft(SHAFTS[0], "ccw"), Shaft(SHAFTS[1], "cw")),
        pairs=(pair,),
        sensors=tuple(sensors),
        operating_point=OperatingPoint(SHAFTS[0], torque_nm=torque.largest if len(torque.values) == 1 else None),
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft=SHAFTS[0]),
        sources=tuple(sources),
        contact=contact,
    )


def _stiffness(values: ParameterValues, path: PathOfContact) -> float:
    stated = values.optional("stiffness_n_per_m_lambda")
    if stated is not None:
        return stated
    if values.number("exponent") != 1.5:
        raise InputError(
            f"exponent is {values.number('exponent'):g}, but both named stiffnesses are for 1.5",
            remedy="give stiffness_n_per_m_lambda",
        )
    if values.word("contact_stiffness") == "table":
        return TABLE_STIFFNESS
    z1, z2 = path.teeth
    return hertz_stiffness_n_per_m1p5(
        z2 / z1, 0.5 * z1 * values.number("module_mm") * 1e-3, radians(values.number("pressure_angle_deg"))
    )


def _bristle(values: ParameterValues, name: str, level: float, held: float, inertia_kg_m2: float) -> Bristle:
    """Friction of a shaft; its bristles are damped for the inertia that oscillates on them at rest."""
    presliding = values.number(f"{name}_presliding_rad")
    swing = sqrt(held / presliding / inertia_kg_m2) if held > 0.0 else 0.0
    return Bristle(
        level,
        values.number("static_ratio"),
        values.number(f"{name}_stribeck_rad_per_s"),
        presliding,
        2.0 * BRISTLE_DAMPING / swing if swing > 0.0 else 0.0,
        values.number(f"{name}_viscous_nm_s_per_rad"),
    )
