"""A gear pair between two rotors and its operation, shared by the simulators; the effects change it."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, isfinite, pi, radians, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, not_negative, one_of, positive, within
from gearsig.compiled import UNCOUNTED, njit
from gearsig.errors import InputError, RefusalError
from gearsig.rig import Bearing, Rig
from sims.measure import MeasurementChain
from sims.mesh import GearMesh

# The parts of a geared drive, common to its simulators, with the faults each can have.

MAX_DRY_FRICTION = 0.6
"""Friction coefficient of clean, dry steel on steel."""
RACE_EDGE_MM = 0.3
"""Distance from either edge of a race spall at which a rolling element begins to feel it."""


@dataclass(frozen=True)
class Wheel:
    """The body of a gear.

    Parameters
    ----------
    mass_kg, inertia_kg_m2 : float
        About the centre of mass.
    runout_um : float
        Distance of the pitch circle's centre from the axis of rotation (half of the measured run-out).
    runout_angle_deg : float
        Angle of that centre from the middle of tooth 0, in the gear's direction of rotation.
    unbalance_g_mm : float
        Mass times distance of the centre of mass from the axis of rotation.
    unbalance_angle_deg : float
        Angle of the centre of mass, measured in the same way.
    """

    mass_kg: float
    inertia_kg_m2: float
    runout_um: float = 0.0
    runout_angle_deg: float = 0.0
    unbalance_g_mm: float = 0.0
    unbalance_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        positive(self.mass_kg, "mass_kg of a gear", "kg")
        positive(self.inertia_kg_m2, "inertia_kg_m2 of a gear", "kg m^2")
        not_negative(self.runout_um, "runout_um of a gear", "µm")
        not_negative(self.unbalance_g_mm, "unbalance_g_mm of a gear", "g mm")
        _finite(self.runout_angle_deg, "runout_angle_deg")
        _finite(self.unbalance_angle_deg, "unbalance_angle_deg")

    @property
    def mass_offset_m(self) -> float:
        """Distance of the centre of mass from the axis."""
        return self.unbalance_g_mm * 1e-6 / self.mass_kg


@dataclass(frozen=True)
class ShaftLine:
    """A shaft with the rotor (motor or load) at its end.

    Parameters
    ----------
    name : str
    bending_stiffness_n_per_m, bending_damping_n_s_per_m : float
        Between the gear and the mean of its two bearings, the same in every direction.
    torsional_stiffness_nm_per_rad, torsional_damping_nm_s_per_rad : float
        Between gear and rotor.
    rotor_inertia_kg_m2 : float
    coupling_angle_deg : float
        Angle between rotor axis and shaft axis in the coupling, 0 to 5.
    coupling_bending_nm_per_rad : float
        Bending stiffness of the coupling about its stiff axis. About the perpendicular axis it has none, so an angle
        bends the shaft twice per revolution, however low the torque.
    bearing_distance_m : float
        Between the two bearings; it converts the coupling's bending moments into bearing forces.
    """

    name: str
    bending_stiffness_n_per_m: float
    bending_damping_n_s_per_m: float
    torsional_stiffness_nm_per_rad: float
    torsional_damping_nm_s_per_rad: float
    rotor_inertia_kg_m2: float
    coupling_angle_deg: float = 0.0
    bearing_distance_m: float = 0.1
    coupling_bending_nm_per_rad: float = 0.0

    def __post_init__(self) -> None:
        positive(self.bending_stiffness_n_per_m, "bending_stiffness_n_per_m", "N/m")
        not_negative(self.bending_damping_n_s_per_m, "bending_damping_n_s_per_m", "N s/m")
        positive(self.torsional_stiffness_nm_per_rad, "torsional_stiffness_nm_per_rad", "N m/rad")
        not_negative(self.torsional_damping_nm_s_per_rad, "torsional_damping_nm_s_per_rad", "N m s/rad")
        positive(self.rotor_inertia_kg_m2, "rotor_inertia_kg_m2", "kg m^2")
        within(self.coupling_angle_deg, "coupling_angle_deg", 0.0, 5.0, "°")
        positive(self.bearing_distance_m, "bearing_distance_m", "m")
        not_negative(self.coupling_bending_nm_per_rad, "coupling_bending_nm_per_rad", "N m/rad")


@dataclass(frozen=True)
class WeakTooth:
    """A tooth that is more compliant than the others on its drive flank.

    Parameters
    ----------
    gear : int
        0: pinion, 1: wheel.
    tooth : int
        From 0 at the angles' zero.
    loss : float
        Fraction of the pair's stiffness that is lost, 0 to below 1.
    """

    gear: int
    tooth: int
    loss: float

    def __post_init__(self) -> None:
        within(self.gear, "gear of the weak tooth", 0, 1)
        not_negative(self.tooth, "tooth of the weak tooth")
        within(self.loss, "loss of the weak tooth", 0.0, 0.99)


@dataclass(frozen=True)
class RaceDefect:
    """A spall on a raceway of a rolling-element bearing: rolling elements sink into it and strike its far edge.

    Parameters
    ----------
    race : str
        "outer" (stationary) or "inner" (rotating).
    length_mm : float
        Along the raceway.
    angle_deg : float
        Outer: from the middle of the load zone. Inner: from tooth 0 at time 0.
    spacing_jitter : float
        Standard deviation of each element's position in the cage, in element spacings; 0 to 0.1.
    slip : float
        Fraction of the cage rotation that is lost to slip; 0 to 0.05.
    """

    race: str
    length_mm: float
    angle_deg: float = 0.0
    spacing_jitter: float = 0.01
    slip: float = 0.01

    def __post_init__(self) -> None:
        one_of(self.race, "race of the defect", ("outer", "inner"))
        positive(self.length_mm, "length_mm of the race defect", "mm")
        _finite(self.angle_deg, "angle_deg of the race defect")
        within(self.spacing_jitter, "spacing_jitter of the race defect", 0.0, 0.1)
        within(self.slip, "slip of the race defect", 0.0, 0.05)


BEARING_LAWS = ("linear", "hertzian")
"""Load–deflection laws of a bearing; see `BearingSupport`."""


@dataclass(frozen=True)
class BearingSupport:
    """A bearing with its housing.

    Parameters
    ----------
    bearing : gearsig.rig.Bearing
        Name, shaft, and the geometry that determines its orders.
    mass_kg : float
        Mass that moves with the bearing.
    stiffness_n_per_m, damping_n_s_per_m : float
        To ground, the same in x and y.
    clearance_um : float
        Radial distance that the shaft moves from the centre before the bearing carries load.
    defect : RaceDefect or None
    law : str
        "linear": one spring. "hertzian": each rolling element carries through its own contact, with ball passage; the
        stiffness then follows from the balls (Palmgren) and `stiffness_n_per_m` is not used.
    """

    bearing: Bearing
    mass_kg: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    clearance_um: float = 0.0
    defect: RaceDefect | None = None
    law: str = "linear"

    def __post_init__(self) -> None:
        one_of(self.law, "bearing_law", BEARING_LAWS)
        positive(self.mass_kg, "mass_kg of a bearing", "kg")
        positive(self.stiffness_n_per_m, "stiffness_n_per_m of a bearing", "N/m")
        not_negative(self.damping_n_s_per_m, "damping_n_s_per_m of a bearing", "N s/m")
        not_negative(self.clearance_um, "clearance_um of a bearing", "µm")
        if self.elements_pass and self.bearing.n_rolling_elements is None:
            raise InputError(
                f"{self.bearing.name!r} has a defect, clearance or the Hertzian law, but no geometry",
                allowed="n_rolling_elements, rolling_element_diameter_mm and pitch_diameter_mm",
                remedy="give the bearing's geometry",
            )

    @property
    def elements_pass(self) -> bool:
        """Whether passing rolling elements move the shaft: a defect, clearance, or the Hertzian law."""
        return self.defect is not None or self.clearance_um > 0 or self.law == "hertzian"

    def element_spacing_mm(self, race: str) -> float | None:
        """Element spacing along a race, π (D ± d cos α)/n; a longer defect would hold two elements at once.

        None if the bearing's geometry is not known.
        """
        b = self.bearing
        if b.n_rolling_elements is None or b.pitch_diameter_mm is None or b.rolling_element_diameter_mm is None:
            return None
        across = b.rolling_element_diameter_mm * cos(radians(b.contact_angle_deg))
        diameter = b.pitch_diameter_mm + across if race == "outer" else b.pitch_diameter_mm - across
        return pi * diameter / b.n_rolling_elements


@dataclass(frozen=True)
class Lubrication:
    """Oil and friction of the flanks.

    Parameters
    ----------
    friction : bool
        False: no friction at all. (The regression does not give 0 for smooth flanks.)
    viscosity_cp : float
        Dynamic viscosity at the oil inlet.
    factor : float
        Multiplies the regression's coefficient: above 1 for starved or aged oil; 0 to 20.
    dry_coefficient : float
        Added where the film does not separate the flanks, the same at every sliding speed; 0 to 0.6.
    """

    friction: bool = True
    viscosity_cp: float = 17.6
    factor: float = 1.0
    dry_coefficient: float = 0.0

    def __post_init__(self) -> None:
        positive(self.viscosity_cp, "viscosity_cp", "cP")
        within(self.factor, "factor of the friction coefficient", 0.0, 20.0)
        within(self.dry_coefficient, "coefficient of dry friction", 0.0, MAX_DRY_FRICTION)


@dataclass(frozen=True)
class Roughness:
    """Microscopic shape of the flanks.

    Parameters
    ----------
    rms_um : float
        Composite rms roughness of both flanks; it affects friction and the fractal profile.
    locked_to : str
        "time": one endless profile that runs at a fixed speed, as in the source paper; "flank": each tooth of both
        gears has its own profile, which repeats with that tooth; "none": roughness affects friction only.
    dimension : float
        Fractal dimension, 1.001 to 1.999.
    """

    rms_um: float = 0.0
    locked_to: str = "flank"
    dimension: float = 1.5

    def __post_init__(self) -> None:
        not_negative(self.rms_um, "rms_um of the roughness", "µm")
        one_of(self.locked_to, "locked_to of the roughness", ("time", "flank", "none"))
        within(self.dimension, "dimension of the roughness", 1.001, 1.999)


@dataclass(frozen=True)
class TorqueRipple:
    """Drive torque × (1 + fraction · cos(order · θ + phase)), θ the angle of the input rotor."""

    order: float
    fraction: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        positive(self.order, "order of the torque ripple")
        within(self.fraction, "fraction of the torque ripple", 0.0, 1.0)
        _finite(self.phase_rad, "phase_rad of the torque ripple")


@dataclass(frozen=True)
class SpeedSwing:
    """Set speed × (1 + fraction · sin(2πft + phase)): hunting of the drive, caused by the mains or the load."""

    fraction: float
    frequency_hz: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        within(self.fraction, "fraction of the speed swing", 0.0, 0.5)
        positive(self.frequency_hz, "frequency_hz of the speed swing", "Hz")
        _finite(self.phase_rad, "phase_rad of the speed swing")


RECOVERY_S = 0.06
"""Time constant with which an ordinary drive corrects a speed deviation."""


@dataclass(frozen=True)
class Drive:
    """What turns the input rotor.

    T_i = T(t)·ripple + J ω̇_set + g (ω_set − θ̇_i) + g²/4J (θ_set − θ_i): the set torque, the torque for the set
    acceleration, and a governor that compensates friction without a steady speed error. J is the total inertia
    referred to the input. The load takes T(t) z2/z1.

    Parameters
    ----------
    governor_nm_s_per_rad : float or None
        g, above 0; 2J/g is the decay time of a speed deviation. None: g such that it is `RECOVERY_S`.
    ripples : tuple of TorqueRipple
    swings : tuple of SpeedSwing
    """

    governor_nm_s_per_rad: float | None = None
    ripples: tuple[TorqueRipple, ...] = ()
    swings: tuple[SpeedSwing, ...] = ()

    def __post_init__(self) -> None:
        if self.governor_nm_s_per_rad is not None:
            positive(self.governor_nm_s_per_rad, "governor_nm_s_per_rad", "N m s/rad")
        count(len(self.ripples), "number of torque ripples", minimum=0)


def _finite(value: float, name: str) -> None:
    if not isfinite(value):
        raise InputError(f"{name} is {value}", allowed="a finite number")


@dataclass(frozen=True)
class Machine:
    """A spur gear pair, its shafts, bearings, drive and measurement chain. Index 0 is the driver, 1 the driven side.

    Frame: y along the line of action, in the direction in which the driver's tooth pushes; x perpendicular to it. The
    driver turns counter-clockwise, the driven gear clockwise; angles are positive in each gear's own direction.

    Parameters
    ----------
    mesh : GearMesh
        Geometry, stiffness, tooth faults and flank deviations.
    wheels : tuple of two Wheel
    shafts : tuple of two ShaftLine
    bearings : tuple of four BearingSupport
        Two on the driver's shaft (the first on the coupling side), then two on the driven shaft.
    mesh_damping_ratio : float
        ζ of the pair on its mean mesh stiffness; the damping of each tooth pair is proportional to its stiffness.
    half_backlash_um : float
        b; the total backlash along the line of action is 2b.
    lubrication : Lubrication
    roughness : Roughness
    drive : Drive
    chain : MeasurementChain
    gravity_mps2 : float
    line_of_action_deg : float
        β, angle between the line of action and the vertical: the upward direction is x sin β + y cos β.

    Notes
    -----
    Shafts are mirror-symmetric: each bearing takes half of the gear force.
    """

    mesh: GearMesh
    wheels: tuple[Wheel, Wheel]
    shafts: tuple[ShaftLine, ShaftLine]
    bearings: tuple[BearingSupport, BearingSupport, BearingSupport, BearingSupport]
    chain: MeasurementChain
    mesh_damping_ratio: float = 0.06
    half_backlash_um: float = 20.0
    lubrication: Lubrication = field(default_factory=Lubrication)
    roughness: Roughness = field(default_factory=Roughness)
    drive: Drive = field(default_factory=Drive)
    gravity_mps2: float = 9.81
    line_of_action_deg: float = 20.0

    def __post_init__(self) -> None:
        within(self.mesh_damping_ratio, "mesh_damping_ratio", 0.0, 1.0)
        not_negative(self.half_backlash_um, "half_backlash_um", "µm")
        not_negative(self.gravity_mps2, "gravity_mps2", "m/s^2")
        within(self.line_of_action_deg, "line_of_action_deg", -180.0, 180.0, "°")
        for name, n_expected in (("wheels", 2), ("shafts", 2), ("bearings", 4)):
            if len(getattr(self, name)) != n_expected:
                raise InputError(f"{len(getattr(self, name))} {name}", where="machine", allowed=str(n_expected))

    @property
    def shaft_names(self) -> tuple[str, str]:
        """Names of the driver's and the driven shaft."""
        return self.shafts[0].name, self.shafts[1].name

    @property
    def ratio(self) -> float:
        """Revolutions of the driver per revolution of the driven gear, z2/z1."""
        return self.mesh.pair.driven.teeth / self.mesh.pair.driver.teeth


# --------------------
# How a machine is run: speed and torque over time.
# --------------------


@dataclass(frozen=True)
class Profile:
    """A quantity over time: linear between given points, constant before the first and after the last.

    Parameters
    ----------
    times_s : array, (n,)
        Rising; time 0 is the start of the recording.
    values : array, (n,)

    Examples
    --------
    >>> run_up = Profile.of([0.0, 10.0], [300.0, 1500.0])
    >>> float(run_up.at(2.5))
    600.0
    """

    times_s: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        times = frozen_array(self.times_s, "times_s of a profile", ndim=1)
        values = frozen_array(self.values, "values of a profile", ndim=1)
        if len(times) != len(values) or len(times) == 0 or np.any(np.diff(times) <= 0):
            raise InputError(
                f"{len(times)} times for {len(values)} values of a profile, or times that do not increase",
                allowed="one value per time, increasing times",
            )
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "values", values)

    def as_dict(self) -> dict[str, list[float]]:
        """Times and values as plain numbers."""
        return {"times_s": self.times_s.tolist(), "values": self.values.tolist()}

    @classmethod
    def constant(cls, value: float) -> Profile:
        """Return a profile of constant value."""
        return cls(np.zeros(1), np.array([float(value)]))

    @classmethod
    def of(cls, times_s: object, values: object) -> Profile:
        """Return a profile through points given as any sequences."""
        return cls(np.asarray(times_s, dtype=np.float64), np.asarray(values, dtype=np.float64))

    @property
    def largest(self) -> float:
        """Largest absolute value."""
        return float(np.max(np.abs(self.values)))

    def at(self, time_s: FloatArray | float) -> FloatArray:
        """Value at the given times."""
        return np.asarray(np.interp(time_s, self.times_s, self.values))


@dataclass(frozen=True)
class Operation:
    """Set speed and set torque of the input shaft.

    Parameters
    ----------
    speed_rpm : Profile
        Not below 0.
    torque_nm : Profile
        Not below 0; the load torque at the output is this times the ratio. At 0 the teeth rattle.
    """

    speed_rpm: Profile
    torque_nm: Profile

    def __post_init__(self) -> None:
        for name, profile, unit in (("speed_rpm", self.speed_rpm, "rpm"), ("torque_nm", self.torque_nm, "N m")):
            if np.min(profile.values) < 0.0:
                raise InputError(f"{name} falls to {np.min(profile.values):g} {unit}", allowed=f"at least 0 {unit}")

    @classmethod
    def steady(cls, speed_rpm: float, torque_nm: float) -> Operation:
        """Return constant speed and torque."""
        return cls(Profile.constant(speed_rpm), Profile.constant(torque_nm))


# Compiled: set speed and torque over time.


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def profile(points, t):
    """Value and slope at t: linear between points, constant outside; `points` is (2, n), times and values."""
    n = points.shape[1]
    if t <= points[0, 0]:
        return points[1, 0], 0.0
    if t >= points[0, n - 1]:
        return points[1, n - 1], 0.0
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if points[0, middle] <= t:
            low = middle
        else:
            high = middle
    slope = (points[1, high] - points[1, low]) / (points[0, high] - points[0, low])
    return points[1, low] + slope * (t - points[0, low]), slope


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def profile_value(points, t):
    """Value at t."""
    return profile(points, t)[0]


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def set_speed(k, speed, t):
    """Set speed in rad/s and its slope, swings included."""
    value, slope = profile(speed, t)
    factor, rate = 1.0, 0.0
    for i in range(k.n_swings):
        amplitude, omega, phase = k.swings[i, 0], k.swings[i, 1], k.swings[i, 2]
        factor += amplitude * sin(omega * t + phase)
        rate += amplitude * omega * cos(omega * t + phase)
    return value * factor, slope * factor + value * rate


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def torque_ripple(k, theta):
    """Ratio of drive torque to its set value at the rotor angle."""
    factor = 1.0
    for i in range(k.n_ripples):
        factor += k.ripples[i, 1] * cos(k.ripples[i, 0] * theta + k.ripples[i, 2])
    return factor


# --------------------
# What a rig states of its gear pair, completed with values usual for its size, and the tolerances of such gears.
# --------------------


USUAL_LOAD_N_PER_MM2 = 50.0
"""Tangential force per face width and module, assumed where the torque is unknown; rated gears carry 20 to 120."""
LARGEST_LOAD_N_PER_MM2 = 500.0
"""With a form factor of 3 this is a root bending stress of 1500 N/mm², more than hardened steel withstands."""
USUAL_WIDTH_MODULES = 10.0
USUAL_MESH_HZ = 540.0
"""Mesh frequency assumed where the speed is unknown."""
STIFFNESS_N_PER_MM_UM = 14.0
"""Usual mesh stiffness of a steel pair per face width."""


@dataclass(frozen=True)
class Nominal:
    """What a rig states of its pair, completed with usual values.

    Parameters
    ----------
    teeth : (int, int)
    module_mm, face_width_mm, pressure_angle_deg : float
    speed_rpm, torque_nm : float
        Of the driver.
    assumed : tuple of str
        Quantities that the rig does not state.
    """

    teeth: tuple[int, int]
    module_mm: float
    face_width_mm: float
    pressure_angle_deg: float
    speed_rpm: float
    torque_nm: float
    assumed: tuple[str, ...] = ()

    @property
    def size(self) -> float:
        """Size of the machine relative to module 2 mm."""
        return self.module_mm / 2.0

    @property
    def pitch_diameters_mm(self) -> tuple[float, float]:
        """Pitch diameters of driver and driven gear."""
        return self.module_mm * self.teeth[0], self.module_mm * self.teeth[1]

    @property
    def mesh_force_n(self) -> float:
        """Static tangential tooth force."""
        return 2e3 * self.torque_nm / self.pitch_diameters_mm[0]

    @property
    def deflection_um(self) -> float:
        """Deflection of the teeth under the nominal load."""
        return self.mesh_force_n / self.face_width_mm / STIFFNESS_N_PER_MM_UM

    @property
    def mesh_hz(self) -> float:
        """Mesh frequency."""
        return self.speed_rpm / 60.0 * self.teeth[0]


def nominal_of(rig: Rig) -> Nominal:
    """Return the nominal data of a rig's only pair, with usual values for what it does not state.

    Raises
    ------
    RefusalError
        If there is no pair or more than one, or if teeth or module are not known.
    """
    if len(rig.pairs) != 1:
        have = "no gear pair" if not rig.pairs else f"{len(rig.pairs)} gear pairs"
        raise RefusalError(f"the rig has {have}; the model has one", remedy="describe one pair in the rig file")
    pair = rig.pairs[0]
    missing = [name for name in ("driver_teeth", "driven_teeth", "module_mm") if getattr(pair, name) is None]
    if missing or not (pair.driver_teeth and pair.driven_teeth and pair.module_mm):
        raise RefusalError(
            f"{', '.join(missing)} of pair {pair.name!r} must be known for a model of it",
            remedy="complete the rig file",
        )
    teeth, module = (pair.driver_teeth, pair.driven_teeth), pair.module_mm
    width = pair.face_width_mm or USUAL_WIDTH_MODULES * module
    torque, speed = rig.nominal_torque_nm(pair.driver), rig.nominal_speed_rpm(pair.driver)
    largest_nm = LARGEST_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0]
    if torque and abs(torque) > largest_nm:
        raise RefusalError(
            f"{torque:g} N·m on shaft {pair.driver!r} would break teeth of module {module:g} mm, {width:g} mm wide",
            remedy=f"state the torque in N·m; up to {largest_nm:.3g} is possible",
        )
    stated = {
        "face_width_mm": pair.face_width_mm,
        "pressure_angle_deg": pair.pressure_angle_deg,
        "speed_rpm": speed,
        "torque_nm": torque,
    }
    return Nominal(
        teeth,
        module,
        width,
        pair.pressure_angle_deg or 20.0,
        speed or 60.0 * USUAL_MESH_HZ / teeth[0],
        torque or USUAL_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0],
        tuple(name for name, value in stated.items() if not value),
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw from a log-uniform distribution."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def pitch_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Single pitch deviation f_pt of class 5, 0.3 (m + 0.4 √d) + 4; each further class is a factor of √2.

    ISO 1328-1:1995, *Cylindrical gears: ISO system of accuracy*.
    """
    return 0.3 * (module_mm + 0.4 * sqrt(diameter_mm)) + 4.0


def runout_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Radial run-out F_r of class 5, 0.8 (0.3 m + 1.25 √d + 7), of which half is the eccentricity; same source."""
    return 0.8 * (0.3 * module_mm + 1.25 * sqrt(diameter_mm) + 7.0)


def profile_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Total profile deviation F_α of class 5, 3.2 √m + 0.22 √d + 0.7; same source."""
    return 3.2 * sqrt(module_mm) + 0.22 * sqrt(diameter_mm) + 0.7


def usual_mass_kg(nominal: Nominal, side: int) -> float:
    """Mass of a steel disc of the pitch diameter, with the model's default bore."""
    radius = 0.5 * nominal.pitch_diameters_mm[side]
    bore = 0.35 * (radius - 1.25 * nominal.module_mm)
    return 7850e-9 * pi * (radius**2 - bore**2) * nominal.face_width_mm
