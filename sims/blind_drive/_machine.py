"""One drive: what its drawing says, what it really is, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import acos, cos, pi, radians, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.rig import (
    EncoderChannel,
    GearPair,
    OperatingPoint,
    Rig,
    Sensor,
    Shaft,
    ToothContact,
    hertz_stiffness_n_per_m1p5,
)

ROLES = ("development", "calibration", "evaluation")
GEARS = {
    "development": ((20, 100, 5.0), (19, 95, 6.0), (22, 88, 5.0)),
    "calibration": ((18, 90, 6.0), (23, 92, 4.5), (21, 63, 6.0), (25, 110, 4.0)),
    "evaluation": ((21, 105, 5.0), (24, 84, 5.0), (20, 76, 6.0), (26, 117, 4.0)),
}
"""Teeth and module in mm; no pair is in two roles."""
TOLERANCE = 0.15
PRESSURE_ANGLE = radians(20.0)
SHAFTS = ("pinion", "wheel")


@dataclass(frozen=True)
class Drawing:
    """What somebody knows who has the drawing.

    Parameters
    ----------
    z1, z2 : int
    module_mm : float
    torque_nm, speed_limit_rpm : float
        Of the motor.
    on_s, off_s : float
    load_inertia_kg_m2 : float
        Of wheel, gripper and piece.
    pinion_inertia_kg_m2, motor_inertia_kg_m2 : float
    half_backlash_um : float
    friction_coefficient : float
    """

    z1: int
    z2: int
    module_mm: float
    torque_nm: float
    speed_limit_rpm: float
    on_s: float
    off_s: float
    load_inertia_kg_m2: float
    pinion_inertia_kg_m2: float
    motor_inertia_kg_m2: float
    half_backlash_um: float
    friction_coefficient: float

    @property
    def base_radii_m(self) -> tuple[float, float]:
        """Of pinion and wheel."""
        r1, r2 = (0.5e-3 * self.module_mm * z * cos(PRESSURE_ANGLE) for z in (self.z1, self.z2))
        return r1, r2

    @property
    def tooth_force_n(self) -> float:
        """Under the motor's full torque."""
        return self.torque_nm / self.base_radii_m[0]

    @property
    def hertz_n_per_m1p5(self) -> float:
        """Stiffness of a pair by the textbook, as the drawing's owner computes it."""
        return hertz_stiffness_n_per_m1p5(self.z2 / self.z1, 0.5e-3 * self.module_mm * self.z1, PRESSURE_ANGLE)

    def rig(self, channels: tuple[Sensor, ...]) -> Rig:
        """Return the rig file's content."""
        pair = GearPair("stage 1", *SHAFTS, self.z1, self.z2, self.module_mm, 20.0, 16.0 * self.module_mm)
        return Rig(
            name="forging drive",
            shafts=(Shaft(SHAFTS[0], "ccw"), Shaft(SHAFTS[1], "cw")),
            pairs=(pair,),
            sensors=channels,
            operating_point=OperatingPoint(SHAFTS[0], torque_nm=self.torque_nm),
            speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft=SHAFTS[0]),
            contact=ToothContact(
                self.hertz_n_per_m1p5,
                "stage 1",
                half_backlash_um=self.half_backlash_um,
                restitution=0.9,
                friction_coefficient=self.friction_coefficient,
                driver_inertia_kg_m2=self.pinion_inertia_kg_m2,
                driven_inertia_kg_m2=self.load_inertia_kg_m2,
                motor_inertia_kg_m2=self.motor_inertia_kg_m2,
            ),
        )


@dataclass(frozen=True)
class BlindDrive:
    """One drive as it is.

    Parameters
    ----------
    drawing : Drawing
    numbers : mapping
        Every number of the kernel and the sensors by name, in SI units: always the same names, or the kernel would be
        compiled anew.
    errors : (array, array)
        Deviations in m of each tooth's drive and back flank, (2, z1) and (2, z2); above 0: material is missing.
    """

    drawing: Drawing
    numbers: dict[str, float]
    errors: tuple[FloatArray, FloatArray] = field(repr=False)

    def record(self) -> np.recarray:
        """Return the numbers as the kernel reads them."""
        kind = np.dtype([(name, np.float64) for name in sorted(self.numbers)])
        r = np.zeros(1, dtype=kind)
        for name, value in self.numbers.items():
            r[name] = value
        numbers: np.recarray = r.view(np.recarray)[0]
        return numbers


def draw_drawing(rng: np.random.Generator, role: str) -> Drawing:
    """Draw a machine's drawing."""
    one_of(role, "role", ROLES)
    z1, z2, module = GEARS[role][int(rng.integers(len(GEARS[role])))]
    size = module * z1 / 100.0
    torque = 95.0 * size**2 * rng.uniform(0.8, 1.5)
    ratio = z2 / z1
    load = 1.7 * size**2 * ratio**2 * rng.uniform(0.7, 1.4)
    return Drawing(
        z1,
        z2,
        module,
        torque,
        rng.uniform(70.0, 110.0),
        rng.uniform(0.9, 1.5),
        rng.uniform(1.0, 1.8),
        load,
        0.01 * size**4 * rng.uniform(0.8, 1.3),
        0.05 * size**2 * rng.uniform(0.7, 1.3),
        30.0 * module * rng.uniform(0.7, 1.2),
        rng.uniform(0.04, 0.07),
    )


def build(rng: np.random.Generator, drawing: Drawing) -> BlindDrive:
    """Build a machine by its drawing, within its tolerances."""
    d = drawing
    depth = (d.tooth_force_n / d.hertz_n_per_m1p5) ** (2.0 / 3.0)
    k0 = _about(rng, d.tooth_force_n / depth) / 0.9
    load = _about(rng, d.load_inertia_kg_m2)
    wheel_part = rng.uniform(0.3, 0.5)
    holding = d.torque_nm * d.z2 / d.z1
    load_level = _about(rng, 0.5 * holding)
    shafts = _shafts(rng, d, load * wheel_part * (1.0 - wheel_part))
    pitch_um = rng.uniform(1.0, 3.0)
    numbers = {
        **_path(d),
        **_flanks(rng, d, k0, load, depth),
        "j_motor": d.motor_inertia_kg_m2 * rng.uniform(0.9, 1.1),
        "j_pinion": d.pinion_inertia_kg_m2 * rng.uniform(0.95, 1.05),
        "j_wheel": wheel_part * load,
        "j_load": (1.0 - wheel_part) * load,
        **shafts,
        **_motor(rng, d),
        "load_level": load_level,
        "load_viscous": 0.04 * load_level,
        "off_centre": rng.uniform(0.0, 0.01) * holding,
        "off_centre_phase": rng.uniform(0.0, 2.0 * pi),
        "blow": float(rng.random() < 0.5) * 3.0 * holding,
        "blow_delay": 0.6 * d.off_s,
        "blow_lasts": 0.02,
        "gain": 1.0,
        "slip": 0.0,
    }
    errors = tuple(1e-6 * rng.normal(0.0, pitch_um, (2, z)) for z in (d.z1, d.z2))
    return BlindDrive(d, numbers, (errors[0], errors[1]))


def _about(rng: np.random.Generator, value: float) -> float:
    return value * rng.uniform(1.0 - TOLERANCE, 1.0 + TOLERANCE)


def _shafts(rng: np.random.Generator, d: Drawing, swing_kg_m2: float) -> dict[str, float]:
    """Torque sensor's shaft, and the one between wheel and gripper, on which both swing."""
    kt = _about(rng, 6e4) * (d.torque_nm / 95.0)
    kw = swing_kg_m2 * (2.0 * pi * rng.uniform(50.0, 90.0)) ** 2
    return {
        "kt": kt,
        "ct": 0.02 * sqrt(kt * d.pinion_inertia_kg_m2),
        "kw": kw,
        "cw": 0.06 * sqrt(kw * swing_kg_m2),
    }


def _flanks(rng: np.random.Generator, d: Drawing, k0: float, load: float, depth_m: float) -> dict[str, float]:
    """Stiffness, damping, play, relief and friction of the teeth; nothing worn, nothing cracked."""
    rb1, rb2 = d.base_radii_m
    per_mass = rb1**2 / d.motor_inertia_kg_m2 + rb2**2 / load
    return {
        "phase": rng.normal(0.0, 0.01),
        "half_play": _about(rng, d.half_backlash_um) * 1e-6,
        "k0": k0,
        "k_curve": rng.uniform(0.2, 0.4),
        "c0": 2.0 * rng.uniform(0.02, 0.06) * sqrt(k0 / per_mass),
        "soft": 3e-6,
        "relief": 0.8 * depth_m,
        "relief_length": 0.1,
        "wear": 0.0,
        "crack": 0.0,
        "cracked": -1.0,
        "mu": _about(rng, d.friction_coefficient),
        "mu_rise": 0.25,
        "mu_stribeck": 0.01,
        "mu_near": 1e-3,
        "run_out": rng.uniform(1e-6, 6e-6),
        "run_out_phase": rng.uniform(0.0, 2.0 * pi),
    }


def _motor(rng: np.random.Generator, d: Drawing) -> dict[str, float]:
    """Valve, flow, brake, ripple and drag."""
    return {
        "torque": d.torque_nm,
        "speed_limit": d.speed_limit_rpm * pi / 30.0 * rng.uniform(0.95, 1.05),
        "on": d.on_s,
        "period": d.on_s + d.off_s,
        "valve_lag": rng.uniform(0.01, 0.03),
        "brake": d.torque_nm * rng.uniform(0.4, 0.8),
        "brake_lag": rng.uniform(0.01, 0.03),
        "brake_delay": rng.uniform(0.02, 0.1),
        "ripple": rng.uniform(0.0, 0.004),
        "ripple_order": float(rng.choice([5, 7, 9, 11])),
        "ripple_phase": rng.uniform(0.0, 2.0 * pi),
        "motor_level": 0.05 * d.torque_nm,
        "motor_viscous": 0.002 * d.torque_nm,
    }


def _path(d: Drawing) -> dict[str, float]:
    """Path of contact of standard teeth, in base pitches from where a pair enters."""
    rb = d.base_radii_m
    out = [1e-3 * d.module_mm * (0.5 * z + 1.0) for z in (d.z1, d.z2)]
    rho = [ra * sin(acos(b / ra)) for ra, b in zip(out, rb, strict=True)]
    length = 0.5e-3 * d.module_mm * (d.z1 + d.z2) * sin(PRESSURE_ANGLE)
    pitch = pi * 1e-3 * d.module_mm * cos(PRESSURE_ANGLE)
    start, ratio = length - rho[1], (rho[0] + rho[1] - length) / pitch
    pitch_point = (length * rb[0] / (rb[0] + rb[1]) - start) / pitch
    return {
        "z1": float(d.z1),
        "z2": float(d.z2),
        "rb1": rb[0],
        "rb2": rb[1],
        "pressure_angle": PRESSURE_ANGLE,
        "start": start,
        "length": length,
        "base_pitch": pitch,
        "ratio": ratio,
        "pitch_point": pitch_point,
        "wear_span": max(0.5 * max(pitch_point, ratio - pitch_point), 0.5 * (2.0 - ratio)),
    }


# --------------------
# What can be wrong with a drive: each a change of its numbers, in this rig's own way.
# --------------------


Applied = tuple[dict[str, float], dict[str, float]]
"""Numbers that change, and where it sits."""


@dataclass(frozen=True)
class DriveChange:
    """One thing that can be wrong.

    Parameters
    ----------
    low, high : float
        Severity, from barely noticeable to strong.
    unit : str
    apply : callable
        Machine, severity, generator → numbers that change, place.
    needs_reference : bool
        Whether no drawing states the healthy value.
    """

    low: float
    high: float
    unit: str
    apply: Callable[[BlindDrive, float, np.random.Generator], Applied]
    needs_reference: bool = False


def _backlash(m: BlindDrive, added_um: float, _: np.random.Generator) -> Applied:
    """Wheels that moved apart: both flanks give way, and pairs touch a little shorter."""
    apart = added_um * 1e-6 / (2.0 * np.sin(m.numbers["pressure_angle"]))
    shorter = 2.0 * apart * np.cos(m.numbers["pressure_angle"]) / m.numbers["base_pitch"] * 0.5
    return {"half_play": m.numbers["half_play"] + 0.5e-6 * added_um, "ratio": m.numbers["ratio"] - shorter}, {}


def _wear(_: BlindDrive, depth_um: float, __: np.random.Generator) -> Applied:
    return {"wear": depth_um * 1e-6}, {}


def _flank_friction(m: BlindDrive, percent: float, _: np.random.Generator) -> Applied:
    return {"mu": m.numbers["mu"] * (1.0 + 0.01 * percent)}, {}


def _load_friction(m: BlindDrive, percent: float, _: np.random.Generator) -> Applied:
    factor = 1.0 + 0.01 * percent
    return {name: m.numbers[name] * factor for name in ("load_level", "load_viscous")}, {}


def _crack(m: BlindDrive, depth_mm: float, rng: np.random.Generator) -> Applied:
    """A tooth's root as a cantilever: compliance with the third power of what is left of its thickness."""
    thickness_share = 1.0 - depth_mm / (2.2 * m.drawing.module_mm)
    tooth = int(rng.integers(m.drawing.z1))
    return {"crack": 0.12 * (thickness_share**-3 - 1.0), "cracked": float(tooth)}, {"tooth": tooth + 1}


def _inertia(m: BlindDrive, percent: float, rng: np.random.Generator) -> Applied:
    """A heavier piece; in one case of three a lighter one."""
    whole = m.numbers["j_wheel"] + m.numbers["j_load"]
    part = -0.45 * percent if rng.random() < 1.0 / 3.0 else percent
    return {"j_load": max(m.numbers["j_load"] + 0.01 * part * whole, 0.1 * whole)}, {}


def _ripple(_: BlindDrive, percent: float, rng: np.random.Generator) -> Applied:
    order = int(rng.choice([5, 6, 7, 9, 11, 13]))
    return {"ripple": 0.01 * percent, "ripple_order": float(order)}, {"order": order}


def _run_out(_: BlindDrive, um: float, __: np.random.Generator) -> Applied:
    return {"run_out": um * 1e-6}, {}


def _off_centre(m: BlindDrive, percent: float, _: np.random.Generator) -> Applied:
    """A piece that is not gripped in the middle."""
    return {"off_centre": 0.01 * percent * m.drawing.torque_nm * m.drawing.z2 / m.drawing.z1}, {}


def _torque_gain(_: BlindDrive, percent: float, rng: np.random.Generator) -> Applied:
    return {"gain": 1.0 + 0.01 * percent * float(rng.choice([-1.0, 1.0]))}, {}


def _slip(_: BlindDrive, um: float, __: np.random.Generator) -> Applied:
    """A wheel encoder whose coupling slips a little at each start."""
    return {"slip": um * 1e-6}, {}


CATALOGUE = {
    "backlash": DriveChange(30.0, 250.0, "um", _backlash),
    "tooth_wear": DriveChange(20.0, 120.0, "um", _wear),
    "sliding_friction": DriveChange(60.0, 300.0, "%", _flank_friction),
    "load_friction": DriveChange(12.0, 40.0, "%", _load_friction, needs_reference=True),
    "root_crack": DriveChange(2.5, 7.5, "mm", _crack),
    "load_inertia": DriveChange(20.0, 100.0, "%", _inertia),
    "torque_gain": DriveChange(12.0, 40.0, "%", _torque_gain),
    "torque_ripple": DriveChange(1.5, 10.0, "%", _ripple),
}
"""What a diagnosis may name."""
OUTSIDE = {
    "run_out": DriveChange(30.0, 150.0, "um", _run_out),
    "off_centre": DriveChange(8.0, 40.0, "%", _off_centre),
    "encoder_slip": DriveChange(30.0, 200.0, "um", _slip),
}
"""What it must call unknown."""


def changed(
    machine: BlindDrive, name: str, severity: float, rng: np.random.Generator
) -> tuple[BlindDrive, dict[str, float]]:
    """Return the machine with something wrong, and where it sits."""
    change = (CATALOGUE | OUTSIDE)[name]
    numbers, place = change.apply(machine, severity, rng)
    return replace(machine, numbers=machine.numbers | numbers), place
