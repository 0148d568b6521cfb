"""The parts of a forging manipulator's rotary drive."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.checks import not_negative, positive, within
from gearsig.errors import InputError
from gearsig.rig.contact import ToothContact
from gearsig.rig.tooth_pairs import PathOfContact

STATIC_RATIO_RANGE = (1.0, 10.0)
SPEED_BAND_RANGE = (0.01, 1.0)
MESH_RAMP_RANGE = (0.005, 0.1)
LEAST_CONTACT_RATIO = 1.1


@dataclass(frozen=True)
class Bristle:
    """LuGre friction: elastic bristles that bend, then slide; static friction above sliding friction.

    z' = (v − |v| z/h(v))/x₀,  F = L (z + τ z' e^{−(v/v_s)²}) + c v,  h = 1 + (r − 1) e^{−(v/v_s)²}

    Parameters
    ----------
    level : float
        L, sliding friction in N m (for tooth flanks: 1, times μN).
    static_ratio : float
        r, static over sliding friction; 1 or more.
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
    IEEE Transactions on Automatic Control 40 (1995). The bristle is counted in units of the sliding friction, so that a
    level that changes (a brake, a normal force) scales its force.
    """

    level: float
    static_ratio: float
    stribeck_speed: float
    presliding: float
    damping_time_s: float = 0.0
    viscous: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.level, "level of the friction")
        within(self.static_ratio, "static_ratio of the friction", *STATIC_RATIO_RANGE)
        positive(self.stribeck_speed, "stribeck_speed of the friction")
        positive(self.presliding, "presliding of the friction")
        not_negative(self.damping_time_s, "damping_time_s of the friction", "s")
        not_negative(self.viscous, "viscous friction")


@dataclass(frozen=True)
class HydraulicMotor:
    """A hydraulic motor behind a proportional valve: torque up to the speed that its flow allows.

    T = T_set(t) · (1 + ε cos(n θ1)) · clip((ω_lim − ω1)/(b ω_lim), −1, 1)

    Parameters
    ----------
    inertia_kg_m2 : float
        Of the motor, ahead of the torque sensor.
    drag : Bristle
        Friction of motor and bearings; the brake adds to its level.
    speed_band : float
        b: part of the speed limit over which the torque falls from full to none.
    ripple_fraction, ripple_order : float
        ε and n: pistons make the torque ripple.
    """

    inertia_kg_m2: float
    drag: Bristle
    speed_band: float = 0.3
    ripple_fraction: float = 0.0
    ripple_order: float = 9.0

    def __post_init__(self) -> None:
        not_negative(self.inertia_kg_m2, "inertia_kg_m2 of the motor", "kg m^2")
        within(self.speed_band, "speed_band of the motor", *SPEED_BAND_RANGE)
        within(self.ripple_fraction, "ripple_fraction of the motor", 0.0, 1.0)
        positive(self.ripple_order, "ripple_order of the motor")


@dataclass(frozen=True)
class GrippedLoad:
    """What the wheel turns besides its inertia: friction of the gripper's bearings, weight of a piece off centre.

    Parameters
    ----------
    friction : Bristle
    unbalance_nm : float
        Weight times distance from the axis.
    unbalance_angle_rad : float
        Angle from below at which the piece hangs when the wheel is at 0.
    """

    friction: Bristle
    unbalance_nm: float = 0.0
    unbalance_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.unbalance_nm, "unbalance_nm", "N m")


@dataclass(frozen=True)
class WeakTooth:
    """A tooth that yields more than the others on its drive flank.

    Parameters
    ----------
    gear : int
        0: pinion, 1: wheel.
    tooth : int
        From 0 at the angles' zero.
    loss : float
        Part of a pair's stiffness that is gone, 0 to below 1.
    """

    gear: int
    tooth: int
    loss: float

    def __post_init__(self) -> None:
        within(self.gear, "gear of the weak tooth", 0, 1)
        not_negative(self.tooth, "tooth of the weak tooth")
        within(self.loss, "loss of the weak tooth", 0.0, 0.99)


@dataclass(frozen=True)
class ForgingDrive:
    """Pinion with motor, wheel with gripper and piece; one turning freedom each.

    Parameters
    ----------
    path : PathOfContact
    contact : ToothContact
        Its inertias are those of the pinion and of the wheel with gripper and piece.
    motor : HydraulicMotor
    load : GrippedLoad
    flanks : Bristle
        Of the tooth flanks, level 1: their friction is μN.
    speed_limit_rad_s : float
        ω_lim of the pinion that the flow allows; 0: no limit.
    mesh_ramp : float
        Base pitches over which a pair takes up its load, 0.005 to 0.1.
    weak_tooth : WeakTooth or None
    wear_um : tuple of float
        Worn off both drive flanks together, at equal steps of the path of contact from where a pair enters to where it
        leaves; empty: nothing. All teeth alike; the pitch point is crossed smoothly over a 64th of the path.

    Notes
    -----
    Left out: bending of shafts and of the torque sensor (the paper takes them as stiff), bearings, profile errors, wear
    that differs from tooth to tooth or grows while the drive runs (the paper takes all teeth alike), oil between the
    flanks; teeth never break or
    yield, however large the torque: neither strength nor hardness of the teeth is stated.
    """

    path: PathOfContact
    contact: ToothContact
    motor: HydraulicMotor
    load: GrippedLoad
    flanks: Bristle
    speed_limit_rad_s: float = 0.0
    mesh_ramp: float = 0.05
    weak_tooth: WeakTooth | None = None
    wear_um: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        not_negative(self.speed_limit_rad_s, "speed_limit_rad_s", "rad/s")
        within(self.mesh_ramp, "mesh_ramp", *MESH_RAMP_RANGE)
        for depth in self.wear_um:
            not_negative(depth, "wear_um", "um")
        highest = 1.9 - self.mesh_ramp
        within(self.path.contact_ratio, "contact_ratio", LEAST_CONTACT_RATIO, highest, remedy="one to two pairs touch")
        if self.contact.driven_inertia_kg_m2 is None or self.pinion_side_inertia_kg_m2 <= 0.0:
            raise InputError("an inertia is missing", where="forging drive", allowed="above 0 kg m^2 on either side")

    @property
    def pinion_side_inertia_kg_m2(self) -> float:
        """Of motor and pinion."""
        return self.motor.inertia_kg_m2 + self.contact.driver_inertia_kg_m2

    @property
    def reduced_mass_kg(self) -> float:
        """1/(rb1²/J1 + rb2²/J2): the mass that an impact along the line of action feels."""
        r1, r2 = self.path.base_radii_m
        driven = self.contact.driven_inertia_kg_m2 or 0.0
        return 1.0 / (r1**2 / self.pinion_side_inertia_kg_m2 + r2**2 / driven)
