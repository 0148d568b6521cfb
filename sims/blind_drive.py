"""A second forging drive that makes blind cases of start–stop motion, for the benchmark and the tests only.

It differs from `sims.forging` and shares no code with it: four masses (motor, pinion, wheel, gripper with piece) on two
elastic shafts; fixed steps of the classical Runge–Kutta method without event detection; linear tooth pairs with a
parabolic stiffness over the path, each with its own separation, tip relief and pitch errors on both flanks;
Kelvin–Voigt damping that increases smoothly with depth; Coulomb–Stribeck friction; first-order valves. It has its own
form of every effect.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import acos, ceil, cos, exp, floor, pi, radians, sin, sqrt, tanh
from typing import Any

import numpy as np
from numba import njit

from gearsig.checks import FloatArray, one_of
from gearsig.recording import Channel, Provenance, Recording
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
"""Teeth, and module in mm; no pair is in two roles."""
TOLERANCE = 0.15
PRESSURE_ANGLE = radians(20.0)
SHAFTS = ("pinion", "wheel")


@dataclass(frozen=True)
class Drawing:
    """The data in a machine's drawing.

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
        """Base radii of pinion and wheel."""
        r1, r2 = (0.5e-3 * self.module_mm * z * cos(PRESSURE_ANGLE) for z in (self.z1, self.z2))
        return r1, r2

    @property
    def tooth_force_n(self) -> float:
        """Tooth force at the motor's full torque."""
        return self.torque_nm / self.base_radii_m[0]

    @property
    def hertz_n_per_m1p5(self) -> float:
        """Textbook stiffness of a tooth pair, as computed from the drawing."""
        return hertz_stiffness_n_per_m1p5(self.z2 / self.z1, 0.5e-3 * self.module_mm * self.z1, PRESSURE_ANGLE)

    def rig(self, channels: tuple[Sensor, ...]) -> Rig:
        """Return the content of the rig file."""
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
    """An actual drive.

    Parameters
    ----------
    drawing : Drawing
    numbers : mapping
        All numbers of the kernel and the sensors by name, in SI units; the names are always the same, as otherwise the
        kernel would be recompiled.
    errors : (array, array)
        Deviations in m of each tooth's drive and back flank, (2, z1) and (2, z2); above 0: material is missing.
    """

    drawing: Drawing
    numbers: dict[str, float]
    errors: tuple[FloatArray, FloatArray] = field(repr=False)

    def record(self) -> np.recarray:
        """Return the numbers as a record for the kernel."""
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
    """Build a machine from its drawing, within its tolerances."""
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
    """Shaft of the torque sensor, and shaft between wheel and gripper, on which both oscillate."""
    kt = _about(rng, 6e4) * (d.torque_nm / 95.0)
    kw = swing_kg_m2 * (2.0 * pi * rng.uniform(50.0, 90.0)) ** 2
    return {
        "kt": kt,
        "ct": 0.02 * sqrt(kt * d.pinion_inertia_kg_m2),
        "kw": kw,
        "cw": 0.06 * sqrt(kw * swing_kg_m2),
    }


def _flanks(rng: np.random.Generator, d: Drawing, k0: float, load: float, depth_m: float) -> dict[str, float]:
    """Stiffness, damping, backlash, relief and friction of the teeth, without wear or crack."""
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
    """Path of contact of standard teeth, in base pitches from the entry of a pair."""
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
# Faults of a drive: each changes its numbers, in this rig's own way.
# --------------------


Applied = tuple[dict[str, float], dict[str, float]]
"""Numbers that change, and the location."""


@dataclass(frozen=True)
class DriveChange:
    """A possible fault.

    Parameters
    ----------
    low, high : float
        Severities, barely noticeable and strong.
    unit : str
    apply : callable
        Machine, severity, generator → numbers that change, place.
    needs_reference : bool
        Whether the healthy value is stated in no drawing.
    """

    low: float
    high: float
    unit: str
    apply: Callable[[BlindDrive, float, np.random.Generator], Applied]
    needs_reference: bool = False


def _backlash(m: BlindDrive, added_um: float, _: np.random.Generator) -> Applied:
    """Gears that moved apart: both flanks recede, and pairs are in contact for slightly less of the path."""
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
    """A tooth's root as a cantilever: compliance with the third power of its remaining thickness."""
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
"""Faults that a diagnosis can name."""
OUTSIDE = {
    "run_out": DriveChange(30.0, 150.0, "um", _run_out),
    "off_centre": DriveChange(8.0, 40.0, "%", _off_centre),
    "encoder_slip": DriveChange(30.0, 200.0, "um", _slip),
}
"""Faults that it must call unknown."""


def changed(
    machine: BlindDrive, name: str, severity: float, rng: np.random.Generator
) -> tuple[BlindDrive, dict[str, float]]:
    """Return the machine with a fault, and the fault's location."""
    change = (CATALOGUE | OUTSIDE)[name]
    numbers, place = change.apply(machine, severity, rng)
    return replace(machine, numbers=machine.numbers | numbers), place


# --------------------
# Motion of the drive.
# --------------------


N_STATES = 10
"""Angle and speed of motor, pinion, wheel and load; opening of the valve; grip of the brake."""
N_OUT = 8
"""Angle, speed and acceleration of pinion and wheel; sensor torque; tooth force."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _relief(r, p):
    """Tip relief at both ends of the path, so that pairs engage and disengage without a step."""
    if p < r.relief_length:
        x = (r.relief_length - p) / r.relief_length
        return r.relief * x * x
    if p > r.ratio - r.relief_length:
        x = (p - r.ratio + r.relief_length) / r.relief_length
        return r.relief * x * x
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _worn(r, p):
    """Depth of wear over the path: pressure times sliding, with half the load where two pairs share it."""
    if r.wear == 0.0:
        return 0.0
    share = 1.0 if r.ratio - 1.0 < p < 1.0 else 0.5
    return r.wear * share * abs(p - r.pitch_point) / r.wear_span


@njit(cache=True, nogil=True, error_model="numpy")
def _friction(speed, level, rise, stribeck, near, viscous):
    return level * (1.0 + rise * exp(-abs(speed) / stribeck)) * tanh(speed / near) + viscous * speed


@njit(cache=True, nogil=True, error_model="numpy")
def _teeth(r, flank, y, errors_1, errors_2):
    """Force of one flank's pairs and their torques on pinion and wheel, friction included.

    N = max(k(p) δ + c δ̇ δ/(δ + δ₀), 0),  k(p) = k₀ (1 − κ (2p/ε − 1)²)
    """
    x = y[2] * r.z1 / (2.0 * pi) - r.phase
    run_out = r.run_out * sin(y[2] + r.run_out_phase + (0.0 if flank > 0.0 else -2.0 * r.pressure_angle))
    q = flank * (r.rb1 * y[2] - r.rb2 * y[4] - run_out) - r.half_play
    rate = flank * (r.rb1 * y[3] - r.rb2 * y[5])
    along = x if flank > 0.0 else 2.0 * r.pitch_point + 0.5 - x
    young = floor(along)
    force, on_1, on_2 = 0.0, 0.0, 0.0
    for i in range(2):
        p = along - young + i
        if p > r.ratio:
            continue
        number = young - i
        j1 = int(number - floor(number / r.z1) * r.z1)
        j2 = int(number - floor(number / r.z2) * r.z2)
        row = 0 if flank > 0.0 else 1
        gap = errors_1[row, j1] + errors_2[row, j2] + _relief(r, p)
        if flank > 0.0:
            gap += _worn(r, p)
        depth = q - gap
        if depth <= 0.0:
            continue
        middle = 2.0 * p / r.ratio - 1.0
        k = r.k0 * (1.0 - r.k_curve * middle * middle)
        if flank > 0.0 and j1 == r.cracked:
            k /= 1.0 + r.crack * (0.3 + 0.7 * p / r.ratio) * 1.5
        n = max(k * depth + r.c0 * rate * depth / (depth + r.soft), 0.0)
        rho_1 = r.start + p * r.base_pitch
        rho_2 = r.length - rho_1
        v = rho_2 * y[5] - rho_1 * y[3]
        f = n * r.mu * (1.0 + r.mu_rise * exp(-abs(v) / r.mu_stribeck)) * tanh(v / r.mu_near)
        force += n
        on_1 += -flank * n * r.rb1 + f * rho_1
        on_2 += flank * n * r.rb2 - f * rho_2
    return force, on_1, on_2


@njit(cache=True, nogil=True, error_model="numpy")
def _rates(r, t, y, errors_1, errors_2, dy, out):
    within = t - floor(t / r.period) * r.period
    opened = 1.0 if within < r.on else 0.0
    gripped = 1.0 if within > r.on + r.brake_delay and within < r.period - 0.1 else 0.0
    dy[8] = (opened - y[8]) / r.valve_lag
    dy[9] = (gripped - y[9]) / r.brake_lag
    share = y[1] / r.speed_limit
    motor = r.torque * y[8] * min(max(1.0 - share**5, -1.0), 1.0)
    motor *= 1.0 + r.ripple * (cos(r.ripple_order * y[0] + r.ripple_phase) + 0.3 * cos(2.0 * r.ripple_order * y[0]))
    motor -= _friction(y[1], r.motor_level + r.brake * y[9], 0.2, 0.2, 0.05, r.motor_viscous)
    shaft_1 = r.kt * (y[0] - y[2]) + r.ct * (y[1] - y[3])
    shaft_2 = r.kw * (y[4] - y[6]) + r.cw * (y[5] - y[7])
    drive, d1, d2 = _teeth(r, 1.0, y, errors_1, errors_2)
    back, b1, b2 = _teeth(r, -1.0, y, errors_1, errors_2)
    load = _friction(y[7], r.load_level, 0.25, 0.03, 0.002, r.load_viscous)
    load += r.off_centre * sin(y[6] + r.off_centre_phase)
    blow = within - r.on - r.blow_delay
    if r.blow > 0.0 and 0.0 < blow < r.blow_lasts:
        load -= r.blow * sin(pi * blow / r.blow_lasts)
    dy[0], dy[2], dy[4], dy[6] = y[1], y[3], y[5], y[7]
    dy[1] = (motor - shaft_1) / r.j_motor
    dy[3] = (shaft_1 + d1 + b1) / r.j_pinion
    dy[5] = (d2 + b2 - shaft_2) / r.j_wheel
    dy[7] = (shaft_2 - load) / r.j_load
    out[0], out[1], out[2] = y[2], y[3], dy[3]
    out[3], out[4], out[5] = y[4], y[5], dy[5]
    out[6], out[7] = shaft_1, drive - back


@njit(cache=True, nogil=True, error_model="numpy")
def march(r, y, errors_1, errors_2, n_samples, interval, longest_step):
    """Run with the classical Runge–Kutta method from state y; return (n_samples, N_OUT)."""
    n_steps = ceil(interval / longest_step)
    h = interval / n_steps
    rows = np.empty((n_samples, N_OUT))
    slopes, at, out = np.empty((4, N_STATES)), np.empty(N_STATES), np.empty(N_OUT)
    for sample in range(n_samples):
        t = sample * interval
        _rates(r, t, y, errors_1, errors_2, slopes[0], rows[sample])
        for i in range(n_steps):
            s = t + i * h
            _rates(r, s, y, errors_1, errors_2, slopes[0], out)
            for stage in range(1, 4):
                ahead = h if stage == 3 else 0.5 * h
                for m in range(N_STATES):
                    at[m] = y[m] + ahead * slopes[stage - 1, m]
                _rates(r, s + ahead, at, errors_1, errors_2, slopes[stage], out)
            for m in range(N_STATES):
                y[m] += h / 6.0 * (slopes[0, m] + 2.0 * slopes[1, m] + 2.0 * slopes[2, m] + slopes[3, m])
    return rows


# --------------------
# From a drive's motion to a recording: encoder rounding, noise, missing sensors.
# --------------------


INTERVAL_S, STEP_S = 1e-3, 5e-5
ALL = (
    Channel("torque", "torque", "N m", "between motor and pinion"),
    Channel("pinion angle", "angle", "rad", "pinion"),
    Channel("wheel angle", "angle", "rad", "wheel"),
    Channel("pinion speed", "rotational_speed", "rad/s", "pinion"),
    Channel("wheel speed", "rotational_speed", "rad/s", "wheel"),
    Channel("pinion acceleration", "angular_acceleration", "rad/s^2", "pinion"),
    Channel("wheel acceleration", "angular_acceleration", "rad/s^2", "wheel"),
    Channel("interaction force", "force", "N", "tooth flanks"),
)


@dataclass(frozen=True)
class Chain:
    """The measurement chain of a machine.

    Parameters
    ----------
    counts : int
        Of both encoders per revolution.
    n_channels : int
        Number of channels from `ALL`: 3 (torque and angles), 7 or 8.
    torque_noise, torque_offset : float
        As a fraction of the motor's torque.
    speed_noise, acceleration_noise : float
        rad/s, rad/s².
    force_gain : float
    wheel_zero_rad : float
        Zero position of the wheel's encoder.
    """

    counts: int
    n_channels: int
    torque_noise: float
    torque_offset: float
    speed_noise: float
    acceleration_noise: float
    force_gain: float
    wheel_zero_rad: float

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The recorded channels."""
        return ALL[: self.n_channels]

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors for the rig file."""
        return tuple(Sensor(c.name, c.quantity, c.unit, c.position) for c in self.channels)


def draw_chain(rng: np.random.Generator) -> Chain:
    """Draw a measurement chain."""
    return Chain(
        2 ** int(rng.choice([16, 18, 20])),
        int(rng.choice([3, 7, 8])),
        rng.uniform(0.001, 0.005),
        rng.normal(0.0, 0.003),
        rng.uniform(0.5e-3, 2e-3),
        rng.uniform(0.2, 0.8),
        rng.normal(1.0, 0.01),
        rng.uniform(0.0, 2.0 * pi),
    )


def run(machine: BlindDrive, chain: Chain, duration_s: float, rng: np.random.Generator) -> Recording:
    """Run a machine from rest and measure it; the pinion starts at a random angle."""
    n = machine.numbers
    y = np.zeros(N_STATES)
    y[0] = y[2] = rng.uniform(0.0, 2.0 * pi)
    y[4] = y[6] = y[0] * n["rb1"] / n["rb2"]
    rows_of_run = march(machine.record(), y, *machine.errors, round(duration_s / INTERVAL_S), INTERVAL_S, STEP_S)
    rows = _readings(machine, chain, rows_of_run, rng)
    return Recording(
        np.vstack(rows[: chain.n_channels]),
        1.0 / INTERVAL_S,
        chain.channels,
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft="pinion"),
        rig=machine.drawing.rig(chain.sensors),
        provenance=Provenance(source="forging drive"),
    )


def _readings(machine: BlindDrive, chain: Chain, motion: FloatArray, rng: np.random.Generator) -> list[FloatArray]:
    def noise(level: float) -> FloatArray:
        return level * rng.standard_normal(len(motion))

    def read(angle: FloatArray) -> FloatArray:
        step = 2.0 * pi / chain.counts
        return np.asarray(np.round((angle + noise(0.3 * step)) / step) * step)

    full = machine.drawing.torque_nm
    torque = machine.numbers["gain"] * motion[:, 6] + chain.torque_offset * full
    wheel = motion[:, 3] + chain.wheel_zero_rad + _slips(machine, motion, rng)
    return [
        torque + noise(chain.torque_noise * full),
        read(motion[:, 0]),
        read(wheel),
        motion[:, 1] + noise(chain.speed_noise),
        motion[:, 4] + noise(chain.speed_noise),
        motion[:, 2] + noise(chain.acceleration_noise),
        motion[:, 5] + noise(chain.acceleration_noise),
        chain.force_gain * motion[:, 7] + noise(0.005 * machine.drawing.tooth_force_n),
    ]


def _slips(machine: BlindDrive, motion: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Slip of the wheel's encoder by a random distance in each start."""
    angle = np.zeros(len(motion))
    slip, n = machine.numbers["slip"], machine.numbers
    if slip == 0.0:
        return angle
    time = np.arange(len(motion)) * INTERVAL_S
    for start in np.arange(0.0, time[-1], n["period"]):
        way = slip * rng.uniform(0.3, 1.7) / n["rb2"]
        angle -= way * np.clip((time - start - 0.1) / (0.5 * n["on"]), 0.0, 1.0)
    return angle


# --------------------
# One blind case: a machine built from a drawing, with or without a fault, recorded now and when it was healthy.
# --------------------


KINDS = ("none", "single", "unknown")
DAILY = {"load_level": 0.05, "mu": 0.05, "torque": 0.02, "motor_level": 0.1, "brake": 0.05}
"""Relative day-to-day changes of a healthy machine."""


@dataclass(frozen=True)
class DriveCase:
    """A drawn case.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    effect : str
        Empty: none.
    level, severity : float
        0 (barely noticeable) to 1 (strong), and in the effect's unit.
    place : mapping
        Tooth (from 1) or order, if it has one.
    machine, healthy : BlindDrive
        The present machine, and the healthy one of the reference.
    chain : Chain
    duration_s : float
    with_reference : bool
    seed : int
        Of the noise.
    """

    kind: str
    effect: str
    level: float
    severity: float
    place: dict[str, float]
    machine: BlindDrive
    healthy: BlindDrive
    chain: Chain
    duration_s: float
    with_reference: bool
    seed: int


@dataclass(frozen=True)
class MadeCase:
    """Recordings of the present machine and, if there is one, of the healthy machine."""

    recording: Recording
    reference: Recording | None


def draw_case(
    rng: np.random.Generator, role: str, *, kind: str, effect: str = "", level: float = 0.5, with_reference: bool = True
) -> DriveCase:
    """Draw a case.

    Parameters
    ----------
    rng : numpy.random.Generator
    role : str
        "development", "calibration" or "evaluation"; they share no gears.
    kind : str
        "none", "single" (from `CATALOGUE`) or "unknown" (from `OUTSIDE`).
    effect : str
        Empty for none.
    level : float
        0 to 1.
    with_reference : bool
    """
    one_of(kind, "kind", KINDS)
    drawing = draw_drawing(rng, role)
    healthy = build(rng, drawing)
    chain = draw_chain(rng)
    now = _another_day(healthy, rng)
    severity = 0.0
    place: dict[str, float] = {}
    if effect:
        change = (CATALOGUE | OUTSIDE)[effect]
        severity = float(change.low * (change.high / change.low) ** level)
        now, place = changed(now, effect, severity, rng)
    n_cycles = int(rng.integers(5, 8))
    duration = n_cycles * (drawing.on_s + drawing.off_s)
    return DriveCase(
        kind, effect, level, severity, place, now, healthy, chain, duration, with_reference, int(rng.integers(2**31))
    )


def record_case(case: DriveCase) -> MadeCase:
    """Record a case and, if it has one, its reference."""
    rng, reference_rng = np.random.default_rng(case.seed).spawn(2)
    reference = run(case.healthy, case.chain, case.duration_s, reference_rng) if case.with_reference else None
    return MadeCase(run(case.machine, case.chain, case.duration_s, rng), reference)


def label_of(case: DriveCase) -> dict[str, Any]:
    """Return the true answers of a case as plain values."""
    return {
        "kind": case.kind,
        "effect": case.effect,
        "level": case.level,
        "severity": case.severity,
        "unit": (CATALOGUE | OUTSIDE)[case.effect].unit if case.effect else "",
        "place": case.place,
        "with_reference": case.with_reference,
        "n_channels": case.chain.n_channels,
        "encoder_counts": case.chain.counts,
        "teeth": [case.machine.drawing.z1, case.machine.drawing.z2],
    }


def _another_day(machine: BlindDrive, rng: np.random.Generator) -> BlindDrive:
    """Return the machine with day-to-day changes of friction, torque and brake."""
    today = {name: machine.numbers[name] * rng.uniform(1.0 - part, 1.0 + part) for name, part in DAILY.items()}
    return replace(machine, numbers=machine.numbers | today)
