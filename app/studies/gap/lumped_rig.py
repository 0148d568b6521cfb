"""A fifth simulator of a gear pair: eleven degrees of freedom, each tooth an individual spring.

It was written from the literature by somebody who had not seen the others, so its effects are another engineer's
interpretation; its pitch error, for example, is one displaced tooth. It models rotations of motor, pinion, gear and
load, and the motion of both gears and the housing in the plane of rotation. Each pair of teeth that may touch is a
one-sided spring along the path of contact, with individual compliance (parabolic over tooth height) and gap (relief,
profile, pitch); friction reverses at the pitch point; bearings at the drive end are rings of balls with Hertzian
contact, F = K δ^1.5, that turn with the cage, those at the far end are linear. Integration: semi-implicit Euler at 8 or
6 times the sampling rate. Sensors measure bearing forces through random modes, and the motion of the housing.

It does not represent axial motion, tilting of gears, load sharing along the face, or dynamics of tooth bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import cos, pi, radians, sin, tan
from typing import NamedTuple

import numpy as np
from scipy import signal

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft, TachometerChannel

N_PATH = 160
"""Number of points of a tooth's tables along the path of contact."""
PRESSURE_ANGLE = radians(20.0)
TAN = tan(PRESSURE_ANGLE)
SETTLING_S = 0.7
SLOW = 32
"""Steps between two points of slowly changing quantities."""
OVERSAMPLING = {25600: 6, 20000: 8}

# --------------------
# Inputs of the kernel, and the kernel.
# --------------------


class LumpedBearings(NamedTuple):
    """Drive-end bearings of both shafts, and the linear far-end bearings.

    Parameters
    ----------
    n_balls : tuple of int
    ball_n_per_m15, far_n_per_m : tuple of float
        Hertz coefficient of one ball; stiffness of the far end.
    clearance_m, far_play_m : tuple of float
    damping : tuple of float
        Damping of both ends, N s/m.
    cage : tuple of float
        Revolutions of the cage per revolution of the shaft.
    defect : tuple of float
        Kind (0 none, 1 outer, 2 inner), shaft (1, 2), angle and half-width (rad), depth (m).
    """

    n_balls: tuple[int, int]
    ball_n_per_m15: tuple[float, float]
    far_n_per_m: tuple[float, float]
    clearance_m: tuple[float, float]
    far_play_m: tuple[float, float]
    damping: tuple[float, float]
    cage: tuple[float, float]
    defect: tuple[float, float, float, float, float]


class LumpedMesh(NamedTuple):
    """The mesh: base radii, pitch and path in m; backlash; damping; friction; direction of the line of action."""

    base_radii_m: tuple[float, float]
    base_pitch_m: float
    before_m: float
    after_m: float
    beyond_m: float
    backlash_m: float
    back_n_per_m: float
    damping_s: float
    usual_m: float
    friction: float
    turning_m: float
    normal: tuple[float, float]
    hertz_m_per_n: float
    softened: float
    wobble: float
    wobble_phase: float


class LumpedBodies(NamedTuple):
    """Inertias, masses, shafts and housing; run-out (m) and unbalance (kg m) of the shafts with their phases."""

    inertia: tuple[float, float, float, float]
    shaft_n_m: tuple[float, float]
    shaft_damping: tuple[float, float]
    mass: tuple[float, float]
    housing_mass: float
    housing_inertia: float
    mount_n_per_m: tuple[float, float, float]
    mount_damping: tuple[float, float, float]
    places_m: tuple[tuple[float, float], tuple[float, float]]
    runout: tuple[tuple[float, float], tuple[float, float]]
    unbalance: tuple[tuple[float, float], tuple[float, float]]


class LumpedDrive(NamedTuple):
    """External torques (N m) and forces on the machine; see `LumpedFault` for their meaning."""

    motor_nm: float
    load_nm: float
    follows: float
    ripple_nm: float
    ripple_order: float
    ripple_phase: float
    load_swing_nm: float
    load_phase: float
    coupling_n: float
    coupling_nm: float
    coupling_phase: float
    whirl_order: float
    whirl_n: float
    loose: float
    lifted_m: float


@njit(cache=True, nogil=True, fastmath=True)
def _balls(x, y, cage, n, stiffness, clearance, kind, angle, half_width, depth):  # type: ignore[no-untyped-def]
    """Return the force of a ring of balls displaced by (x, y)."""
    fx, fy = 0.0, 0.0
    for i in range(n):
        place = cage + 2.0 * np.pi * i / n
        c, s = np.cos(place), np.sin(place)
        pressed = x * c + y * s - clearance
        if pressed > 0.0 and kind > 0.0:
            off = place - angle
            off -= 2.0 * np.pi * np.floor(off / (2.0 * np.pi) + 0.5)
            part = abs(off) / half_width
            if part < 1.0:
                pressed -= depth * min(1.0, 3.0 * (1.0 - part))
        if pressed > 0.0:
            force = stiffness * pressed * np.sqrt(pressed)
            fx -= force * c
            fy -= force * s
    return fx, fy


@njit(cache=True, nogil=True, fastmath=True)
def _far_end(x, y, stiffness, play):  # type: ignore[no-untyped-def]
    """Return the force of a spring with play displaced by (x, y)."""
    share = stiffness * max(0.0, 1.0 - play / (np.sqrt(x * x + y * y) + 1e-15))
    return -share * x, -share * y


@njit(cache=True, nogil=True, fastmath=True)
def march(  # type: ignore[no-untyped-def]  # noqa: PLR0915  one step after the other: mesh, shafts, bearings, housing
    n, keep, step, mesh, bearings, bodies, drive, q, v, gaps, compliances, set_speed, motor, load, cage, on_housing
):  # fmt: skip
    """Return means over `keep` steps: bearing forces (4), housing accelerations (3), pinion angle."""
    out = np.zeros((n // keep, 8))
    a = np.zeros(11)
    rb1, rb2 = mesh.base_radii_m
    nx, ny = mesh.normal
    z1, z2 = gaps[0].shape[0], gaps[1].shape[0]
    before = mesh.before_m + mesh.beyond_m
    after = mesh.after_m + mesh.beyond_m
    per_m = (gaps[0].shape[1] - 1) / (before + after)
    n_out, n_mean = 0, 0
    for i in range(n):
        k, part = i // SLOW, (i % SLOW) / SLOW
        set_now = set_speed[k] + part * (set_speed[k + 1] - set_speed[k])
        # mesh
        th1, th2, w1, w2 = q[1], q[2], v[1], v[2]
        e1, e1_phase = bodies.runout[0]
        e2, e2_phase = bodies.runout[1]
        runout = e1 * np.sin(th1 + e1_phase) + e2 * np.sin(th2 + e2_phase)
        runout_rate = e1 * np.cos(th1 + e1_phase) * w1 + e2 * np.cos(th2 + e2_phase) * w2
        nearer = rb1 * th1 - rb2 * th2 + nx * (q[4] - q[6]) + ny * (q[5] - q[7]) + runout
        rate = rb1 * w1 - rb2 * w2 + nx * (v[4] - v[6]) + ny * (v[5] - v[7]) + runout_rate
        softened = mesh.softened * (1.0 + mesh.wobble * np.cos(th1 + mesh.wobble_phase))
        pitches = rb1 * th1 / mesh.base_pitch_m
        newest = int(np.floor(pitches))
        force, rubbing, moment_1, moment_2 = 0.0, 0.0, 0.0, 0.0
        for d in range(-2, 3):
            pair = newest + d
            s = (pitches - pair) * mesh.base_pitch_m
            if s <= -before or s >= after:
                continue
            place = (s + before) * per_m
            at = int(place)
            t = place - at
            t1, t2 = pair % z1, pair % z2
            g1, g2, c1, c2 = gaps[0][t1], gaps[1][t2], compliances[0][t1], compliances[1][t2]
            deflection = nearer - (g1[at] + t * (g1[at + 1] - g1[at]) + g2[at] + t * (g2[at + 1] - g2[at]))
            if deflection <= 0.0:
                continue
            soft = c1[at] + t * (c1[at + 1] - c1[at]) + c2[at] + t * (c2[at + 1] - c2[at]) + mesh.hertz_m_per_n
            stiffness = softened / soft
            pair_force = stiffness * deflection * (0.93 + 0.07 * min(deflection / mesh.usual_m, 3.0))
            pair_force += mesh.damping_s * stiffness * rate * min(1.0, deflection * 1e6)
            if pair_force > 0.0:
                friction = mesh.friction * pair_force * s / np.sqrt(s * s + mesh.turning_m**2)
                force += pair_force
                rubbing += friction
                moment_1 += friction * (rb1 * TAN + s)
                moment_2 += friction * (rb2 * TAN - s)
        back = -nearer - mesh.backlash_m
        if back > 0.0:
            push = mesh.back_n_per_m * (back - mesh.damping_s * rate * min(1.0, back * 1e6))
            force -= max(push, 0.0)
        # shafts
        twist_in = bodies.shaft_n_m[0] * (q[0] - th1) + bodies.shaft_damping[0] * (v[0] - w1)
        twist_out = bodies.shaft_n_m[1] * (th2 - q[3]) + bodies.shaft_damping[1] * (w2 - v[3])
        torque = drive.motor_nm + drive.follows * (set_now - v[0]) + motor[k] + part * (motor[k + 1] - motor[k])
        torque += drive.ripple_nm * np.cos(drive.ripple_order * q[0] + drive.ripple_phase)
        twist_in += drive.coupling_nm * np.cos(2.0 * q[0] + drive.coupling_phase)
        braking = drive.load_nm + load[k] + part * (load[k + 1] - load[k])
        braking += drive.load_swing_nm * np.cos(q[3] + drive.load_phase)
        a[0] = (torque - twist_in) / bodies.inertia[0]
        a[1] = (twist_in - rb1 * force - moment_1) / bodies.inertia[1]
        a[2] = (rb2 * force + moment_2 - twist_out) / bodies.inertia[2]
        a[3] = (twist_out - braking) / bodies.inertia[3]
        # bearings
        pressed_x, pressed_y, moment = 0.0, 0.0, 0.0
        for side in range(2):
            rx, ry = bodies.places_m[side]
            x, y = q[4 + 2 * side] - q[8] + q[10] * ry, q[5 + 2 * side] - q[9] - q[10] * rx
            vx, vy = v[4 + 2 * side] - v[8] + v[10] * ry, v[5 + 2 * side] - v[9] - v[10] * rx
            turned = th1 if side == 0 else -th2
            kind, shaft, angle, half_width, depth = bearings.defect
            shaft_kind = kind if shaft == side + 1 else 0.0
            fx, fy = _balls(
                x,
                y,
                bearings.cage[side] * turned + cage[side, k] + part * (cage[side, k + 1] - cage[side, k]),
                bearings.n_balls[side],
                bearings.ball_n_per_m15[side],
                bearings.clearance_m[side],
                shaft_kind,
                angle + (turned if kind == 2.0 else 0.0),
                half_width,
                depth,
            )
            far_x, far_y = _far_end(x, y, bearings.far_n_per_m[side], bearings.far_play_m[side])
            fx += far_x - bearings.damping[side] * vx
            fy += far_y - bearings.damping[side] * vy
            sign = -1.0 if side == 0 else 1.0
            size, phase = bodies.unbalance[side]
            speed = v[1 + side]
            other_force_x = sign * (force * nx - rubbing * ny) + size * speed * speed * np.cos(turned + phase)
            other_force_y = sign * (force * ny + rubbing * nx) + size * speed * speed * np.sin(turned + phase)
            if side == 0:
                c = drive.coupling_phase
                other_force_x += drive.coupling_n * (
                    0.5 * np.cos(th1 + c) + np.cos(2 * th1 + c) + 0.3 * np.cos(3 * th1 + c)
                )
                other_force_y += drive.coupling_n * (
                    0.5 * np.sin(th1 + c) + np.sin(2 * th1 + c) + 0.3 * np.sin(3 * th1 + c)
                )
                other_force_x += drive.whirl_n * np.cos(drive.whirl_order * th1)
                other_force_y += drive.whirl_n * np.sin(drive.whirl_order * th1)
            a[4 + 2 * side] = (fx + other_force_x) / bodies.mass[side]
            a[5 + 2 * side] = (fy + other_force_y) / bodies.mass[side] - 9.81
            pressed_x -= fx
            pressed_y -= fy
            moment -= rx * fy - ry * fx
            if n_out < len(out):
                out[n_out, 2 * side] += fx / keep
                out[n_out, 2 * side + 1] += fy / keep
        # housing
        kx, ky, k_roll = bodies.mount_n_per_m
        cx, cy, c_roll = bodies.mount_damping
        yielding = ky * (1.0 - drive.loose) if q[9] > -drive.lifted_m else ky
        support_force = ky * drive.lifted_m - yielding * (q[9] + drive.lifted_m)
        a[8] = (pressed_x - kx * q[8] - cx * v[8] + on_housing[0, i]) / bodies.housing_mass
        a[9] = (pressed_y + support_force - cy * v[9] + on_housing[1, i]) / bodies.housing_mass
        a[10] = (moment - k_roll * q[10] - c_roll * v[10]) / bodies.housing_inertia
        for d in range(11):
            v[d] += step * a[d]
            q[d] += step * v[d]
        if n_out < len(out):
            out[n_out, 4] += a[8] / keep
            out[n_out, 5] += a[9] / keep
            out[n_out, 6] += a[10] / keep
            out[n_out, 7] += q[1] / keep
            n_mean += 1
            if n_mean == keep:
                n_out, n_mean = n_out + 1, 0
    return out


# --------------------
# A random machine of this kind.
# --------------------


DIRECTIONS = {"vertical": (0.1, 1.0, 0.3), "horizontal": (1.0, 0.1, 0.3), "axial": (0.25, 0.2, 0.5)}
"""Sensitivity of a sensor to the motion of the housing: x, y, roll."""
PROFILE_UM = np.array([0.9, 0.7, 0.5, 0.35, 0.3, 0.25])


@dataclass(frozen=True)
class LumpedRig:
    """A random machine: its nameplate data, and what only its maker knows.

    Parameters
    ----------
    teeth, module_mm, face_mm : of the gears
    speeds_rpm, loads_nm : tuple of float
        Input speed and output torque at two operating points.
    rate_hz : int
    line_hz : float
        Supply frequency.
    balls : tuple of (n, diameter, pitch diameter), mm
    directions : tuple of str
        Directions of the sensors.
    numbers : mapping
        All other values, by short names that `drawn` explains.
    """

    teeth: tuple[int, int]
    module_mm: float
    face_mm: float
    speeds_rpm: tuple[float, float]
    loads_nm: tuple[float, float]
    rate_hz: int
    line_hz: float
    balls: tuple[tuple[int, float, float], ...]
    directions: tuple[str, ...]
    numbers: dict[str, FloatArray]

    @classmethod
    def drawn(cls, rng: np.random.Generator, *, light: bool = False) -> LumpedRig:
        """Draw a machine; `light`: hardly loaded, by a load that oscillates once per revolution, so flanks separate."""
        # A seed identifies a machine, also in the shipped numbers: the order of the draws must not change.
        u = rng.uniform
        # Nameplate data: teeth, module, face, and two operating points by speed and load per face width. Loads follow
        # the size of the teeth: drawn independently, most machines would idle or break.
        z1 = int(rng.integers(17, 41))
        teeth = z1, int(rng.integers(max(20, int(0.8 * z1)), 61))
        module_mm = float(rng.choice([1.5, 2.0, 2.5, 3.0, 4.0]))
        face_mm = float(np.round(module_mm * u(6, 11)))
        speed = float(np.exp(u(np.log(400.0), np.log(2400.0)))) if not light else u(500, 1400)
        line_load = float(np.exp(u(np.log(30.0), np.log(300.0)))) if not light else u(8, 22)
        radii = np.array(teeth) * module_mm / 2e3
        load = line_load * face_mm * radii[1]
        second_speed = speed * rng.choice([u(0.55, 0.8), u(1.25, 1.5)])
        second_load = load * (u(1.2, 1.5) if light else rng.choice([u(0.5, 0.75), u(1.3, 1.6)]))
        # One quality factor for all teeth of a machine: accurate pitch comes with accurate profiles.
        quality = u(0.6, 1.3)

        def pitches(z: int) -> FloatArray:
            """Return single errors plus a part that accumulates from tooth to tooth and closes after a revolution."""
            single = rng.standard_normal(z)
            adding = np.cumsum(single - single.mean())
            return np.asarray((0.6 * single + 0.35 * (adding - adding.mean())) * quality * 1.1e-6)

        # Masses of steel discs, the module representing the shaft's share; the inertias of motor and load grow with the
        # torque, and the shaft stiffness gives either end natural frequencies typical of test rigs.
        mass = 7800.0 * pi * radii**2 * face_mm * 1.2e-3 + u(0.4, 0.8, 2) * module_mm / 2
        inertia = 0.55 * mass * radii**2
        ratio = teeth[0] / teeth[1]
        ends = np.array(
            [
                u(3, 8) * (inertia[0] + inertia[1] * ratio**2) + 0.003 + 6e-4 * load * ratio,
                u(3, 9) * inertia[1] + 0.006 + 6e-4 * load,
            ]
        )
        coupled_inertia = 3.0 * inertia
        shafts = (
            (2.0 * pi * np.array([u(60, 180), u(40, 140)])) ** 2 * ends * coupled_inertia / (ends + coupled_inertia)
        )
        # Bearings sized for the greater load; their pitch leaves a gap between the balls.
        size = max(1.0, (max(load, second_load) / radii[1] / 1500.0) ** 0.5)
        balls = []
        for _ in range(2):
            n, d = int(rng.integers(8, 12)), u(7, 10) * min(size, 2.2)
            balls.append((n, round(d, 2), round(d * n / pi * u(1.45, 1.75), 2)))
        # The housing outweighs its gears; numbers of modes and sensors are typical of measurements on a small gearbox.
        housing = u(4, 9) * mass.sum() + 3.0
        n_modes, n_sensors = int(rng.integers(6, 13)), int(rng.integers(1, 4))
        numbers = {
            "centre_line_rad": u(-0.6, 0.6) + rng.choice([0.0, pi]),
            "mesh_damping_ratio": u(0.06, 0.11),
            "friction": u(0.035, 0.06),
            "backlash_m": u(0.03, 0.045) * module_mm * 1e-3,
            "stiffer": u(0.9, 1.1),
            "design_n_per_mm": u(1.0, 1.5) * max(line_load, 40.0),
            "relief_length": u(0.22, 0.38),
            "line_load_n_per_mm": line_load,
            "pitch_1_m": pitches(teeth[0]),
            "pitch_2_m": pitches(teeth[1]),
            "profile_1_m": rng.standard_normal((teeth[0], 6)) * quality * 1e-6 * PROFILE_UM,
            "profile_2_m": rng.standard_normal((teeth[1], 6)) * quality * 1e-6 * PROFILE_UM,
            "profile_of_all_m": rng.standard_normal((2, 6)) * 1e-6 * quality,
            "runout_m": u(5, 15, 2) * 1e-6 * np.exp(1j * u(0, 2 * pi, 2)),
            "balance_mps": u(1.5, 5, 2) * 1e-3 * np.exp(1j * u(0, 2 * pi, 2)),
            "mass_kg": mass,
            "inertia": np.array([ends[0], *inertia, ends[1]]),
            "shafts": shafts,
            "ball_n_per_m15": u(0.8, 1.2, 2) * 1e10 * size,
            "far_n_per_m": u(0.8, 1.4, 2) * 1e8 * size,
            "clearance_m": u(1, 5, 2) * 1e-6,
            "bearing_damping_ratio": u(0.05, 0.09),
            "slip": u(0.003, 0.012, 2),
            "housing_kg": housing,
            "mount_hz": np.array([u(60, 160), u(70, 220), u(120, 320)]),
            "mount_damping_ratio": u(0.03, 0.07, 3),
            "mode_hz": np.sort(np.exp(u(np.log(300.0), np.log(9000.0), n_modes))),
            "mode_damping_ratio": u(0.015, 0.06, n_modes),
            "mode_kg": housing * u(1.5, 5, n_modes),
            "mode_at_bearings": rng.standard_normal((n_modes, 4)),
            "mode_at_sensors": rng.normal(0, 0.6, (n_sensors, n_modes)),
            "mode_at_foot": rng.standard_normal(n_modes),
            "noise": u(0.006, 0.02, n_sensors),
            "pink": 0.5 * u(0.004, 0.012, n_sensors),
            "hum": u(0.002, 0.006, n_sensors),
            "mark_rad": u(0, 2 * pi),
            "rolling_noise": u(0.01, 0.03),
            "load_swing": u(1.5, 2.4) if light else 0.0,
            "load_phase": u(0, 2 * pi),
        }
        return cls(
            teeth,
            module_mm,
            face_mm,
            (speed, float(second_speed)),
            (float(load), float(second_load)),
            int(rng.choice([20000, 25600])),
            float(rng.choice([50.0, 50.0, 60.0])),
            tuple(balls),
            ("vertical", *map(str, rng.permutation(["horizontal", "axial"])))[:n_sensors],
            {name: np.asarray(value) for name, value in numbers.items()},
        )

    def rig(self, point: int) -> Rig:
        """Return the rig as the operator knows it, at one of the two operating points."""
        names = "input", "output"
        return Rig(
            "lumped rig",
            tuple(Shaft(name) for name in names),
            (GearPair("stage 1", *names, *self.teeth, self.module_mm, 20.0, self.face_mm),),
            tuple(Bearing(f"{name}, drive end", name, *balls) for name, balls in zip(names, self.balls, strict=True)),
            tuple(
                Sensor(f"a{i + 1}", "acceleration", "m/s^2", f"gearbox housing, {direction}")
                for i, direction in enumerate(self.directions)
            ),
            OperatingPoint("input", self.speeds_rpm[point], torque_nm=self.torque_nm(point)),
            TachometerChannel("tach", shaft="input"),
            float(self.rate_hz),
        )

    def torque_nm(self, point: int) -> float:
        """Return the input torque in N m."""
        return self.loads_nm[point] * self.teeth[0] / self.teeth[1]


@dataclass(frozen=True)
class LumpedDay:
    """Differences on another day: speed, load, temperature, disturbed sensors, tachometer mark."""

    speed: float
    load: float
    stiffness: float
    damping: float
    friction: float
    mounts: float
    clearance_m: float
    mode_hz: FloatArray
    mode_damping: FloatArray
    mode_shape: FloatArray
    gain: FloatArray
    mark_rad: float

    @classmethod
    def drawn(cls, rig: LumpedRig, rng: np.random.Generator, touched: float = 1.0) -> LumpedDay:
        """Draw a day; `touched`: disturbance of the sensors relative to the usual one."""
        shape = rig.numbers["mode_at_sensors"].shape
        normal, u = rng.standard_normal, rng.uniform
        return cls(
            1.0 + 0.01 * u(-1, 1),
            1.0 + 0.05 * u(-1, 1),
            1.0 + 0.01 * normal(),
            float(np.exp(0.1 * normal())),
            float(np.exp(0.05 * normal())),
            1.0 + 0.01 * float(normal()),
            u(-0.5, 0.5) * 1e-6,
            np.asarray((1.0 + 0.004 * touched * normal()) * (1.0 + 0.002 * normal(shape[1]))),
            np.asarray(np.exp(0.08 * normal(shape[1]))),
            np.asarray(1.0 + 0.03 * touched * normal(shape)),
            np.asarray(1.0 + 0.1 * u(-1, 1, shape[0])),
            radians(0.7 * normal()),
        )


@dataclass
class LumpedFault:
    """Changes made by an effect; by default none.

    Parameters
    ----------
    gaps_m, compliances : list of (gear, tooth or None, array (N_PATH,) or (teeth, N_PATH))
        Added gap (m) and compliance (m/N).
    friction, softened, wobble : float
        Coefficient (0: that of the machine); remaining share of the mesh stiffness, and its variation over a
        revolution.
    backlash : float
        Factor on the backlash of the machine.
    further_backlash_m : float
    runout_m, unbalance_kg_m : dict
        Gear → added complex value.
    clearance_m : dict
        Gear → radial clearance of both ends.
    defect : tuple
        See `LumpedBearings`.
    ripple : tuple of float
        Share of the torque, order, phase.
    wander : tuple of float
        Share of the speed, Hz.
    drive : dict
        Fields of `LumpedDrive`.
    loose_sensor : tuple of float
        Row, resonance (Hz), damping ratio of its mount.
    moved_modes, damped_modes : factors on frequency and damping of the housing modes
    hum : float
        Share of the healthy level.
    clipped : tuple of float
        Row, share of the healthy peak.
    foreign : callable or None
        (time, slow time, rng) → forces (2, n) on the housing, motor torque.
    """

    gaps_m: list[tuple[int, int | None, FloatArray]] = field(default_factory=list)
    compliances: list[tuple[int, int | None, FloatArray]] = field(default_factory=list)
    friction: float = 0.0
    softened: float = 1.0
    wobble: float = 0.0
    phase: float = 0.0
    backlash: float = 1.0
    further_backlash_m: float = 0.0
    runout_m: dict[int, complex] = field(default_factory=dict)
    unbalance_kg_m: dict[int, complex] = field(default_factory=dict)
    clearance_m: dict[int, float] = field(default_factory=dict)
    defect: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 1.0, 0.0)
    ripple: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wander: tuple[float, float] = (0.0, 1.0)
    drive: dict[str, float] = field(default_factory=dict)
    loose_sensor: tuple[int, float, float] | None = None
    moved_modes: FloatArray | float = 1.0
    damped_modes: float = 1.0
    hum: float = 0.0
    clipped: tuple[int, float] | None = None
    foreign: Callable[..., tuple[FloatArray, FloatArray]] | None = None


@dataclass(frozen=True)
class LumpedGeometry:
    """Radii (m), base pitch, path before and after the pitch point, heights and nominal compliances along it."""

    radii: tuple[float, float]
    base_radii: tuple[float, float]
    base_pitch: float
    before: float
    after: float
    beyond: float
    path: FloatArray
    heights: tuple[FloatArray, FloatArray]
    pair_m_per_n: float
    hertz_m_per_n: float
    teeth_m_per_n: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, rig: LumpedRig, stiffer: float = 1.0) -> LumpedGeometry:
        """Return the geometry of a rig; `stiffer` is the day's factor on the stiffness."""
        m = rig.module_mm * 1e-3
        r = tuple(m * z / 2.0 for z in rig.teeth)
        rb = tuple(x * cos(PRESSURE_ANGLE) for x in r)
        after = ((r[0] + m) ** 2 - rb[0] ** 2) ** 0.5 - rb[0] * TAN
        before = min(((r[1] + m) ** 2 - rb[1] ** 2) ** 0.5 - rb[1] * TAN, 0.98 * rb[0] * TAN)
        pitch = pi * m * cos(PRESSURE_ANGLE)
        beyond = 0.06 * pitch
        path = np.linspace(-before - beyond, after + beyond, N_PATH)
        # single stiffness c' of about 14 N/(mm µm) at the pitch point, which hardly increases with load
        by_teeth = 1.0 + 0.105 * (1.0 - 25.0 / (rig.teeth[0] + 8.0))
        by_load = (max(float(rig.numbers["line_load_n_per_mm"]), 5.0) / 100.0) ** 0.06
        stiffness = 14e9 * float(rig.numbers["stiffer"]) * stiffer * by_teeth * by_load * rig.face_mm * 1e-3
        height = (path + before) / (before + after)
        shapes = [0.4 + 0.6 * np.clip(h, 0, 1.2) ** 2 + 0.05 * h for h in (height, 1.0 - height)]
        at_pitch = sum(float(np.interp(0.0, path, shape)) for shape in shapes)
        teeth = tuple(0.7 / stiffness * shape / at_pitch for shape in shapes)
        return cls(
            (r[0], r[1]),
            (rb[0], rb[1]),
            pitch,
            before,
            after,
            beyond,
            path,
            (height, 1.0 - height),
            1.0 / stiffness,
            0.3 / stiffness,
            (teeth[0], teeth[1]),
        )


def tooth_tables(
    rig: LumpedRig, shape: LumpedGeometry, fault: LumpedFault
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Return gap (m) and compliance (m/N) of each tooth of both gears along the path, (teeth, N_PATH)."""
    s, n = shape.path, rig.numbers
    whole = shape.before + shape.after
    deflection = float(n["design_n_per_mm"]) * 1e3 * rig.face_mm * 1e-3 * shape.pair_m_per_n / cos(PRESSURE_ANGLE)
    relief, length = 0.8 * deflection + 2e-6, float(n["relief_length"]) * whole
    xi = np.clip(2.0 * shape.heights[0] - 1.0, -1.2, 1.2)
    basis = np.array([xi, xi**2 - 0.33, *(np.cos(pi * k * (xi + 1.0) / 2.0) for k in (3, 5, 8, 12))])
    gaps, compliances = [], []
    for side in range(2):
        past = s - shape.after if side == 0 else -shape.before - s
        tip = relief * np.clip(past / length + 1.0, 0, None) ** 1.6
        tip = tip + 4.0 * relief * np.clip(past / shape.beyond, 0, None) ** 2
        profile = (n[f"profile_{side + 1}_m"] + n["profile_of_all_m"][side]) @ basis
        gaps.append(np.ascontiguousarray(tip - n[f"pitch_{side + 1}_m"][:, None] + profile))
        compliances.append(np.tile(shape.teeth_m_per_n[side], (rig.teeth[side], 1)))
    for table, added in ((gaps, fault.gaps_m), (compliances, fault.compliances)):
        for side, tooth, values in added:
            if tooth is None:
                table[side] += values
            else:
                table[side][tooth % rig.teeth[side]] += values
    return (gaps[0], gaps[1]), (compliances[0], compliances[1])


# --------------------
# A recording of the machine.
# --------------------


def record(
    rig: LumpedRig,
    point: int,
    day: LumpedDay,
    fault: LumpedFault,
    rng: np.random.Generator,
    *,
    duration_s: float = 4.5,
    healthy_levels: FloatArray | None = None,
) -> Recording:
    """Run the machine and measure it.

    Parameters
    ----------
    rig : LumpedRig
    point : int
        Operating point, 0 or 1.
    day : LumpedDay
    fault : LumpedFault
    rng : Generator
        Generator of noise and of everything that never repeats.
    duration_s : float
    healthy_levels : array, (n_sensors,) or None
        Levels, rms in m/s², to which noise and hum are relative; None: those of this recording.
    """
    forces, turned = _motion(rig, point, day, fault, rng, duration_s)
    rate = rig.rate_hz * OVERSAMPLING[rig.rate_hz] / (OVERSAMPLING[rig.rate_hz] // 2)
    sensed = _sensed_motion(rig, day, fault, forces, rate, rng)
    lead, n = round(SETTLING_S * rate), round(duration_s * rig.rate_hz)
    values = signal.resample_poly(sensed[lead - 400 :], 1, 2, axis=0, window=("kaiser", 9.0))[200 : 200 + n].T
    values = values * day.gain[:, None]
    levels = values.std(axis=1) if healthy_levels is None else healthy_levels
    values = values + levels[:, None] * _noise_and_hum(rig, fault, n, rng)
    if fault.clipped is not None:
        row, share = fault.clipped
        largest = share * float(np.quantile(np.abs(values[row % len(values)]), 0.9999))
        values[row % len(values)] = np.clip(values[row % len(values)], -largest, largest)
    voltage = _tachometer(rig, day, turned[lead::2][:n], rng)
    channels = [Channel(f"a{i + 1}", "acceleration", "m/s^2") for i in range(len(values))]
    described = rig.rig(point)
    return Recording(
        np.vstack([values, voltage]).astype(np.float32),
        float(rig.rate_hz),
        (*channels, Channel("tach", "tachometer", "V")),
        described.speed,
        described,
    )


def _slow(n: int, rate: float, size: float, corner_hz: float, rng: np.random.Generator) -> FloatArray:
    """Return noise below a corner frequency, with standard deviation `size`."""
    values = signal.lfilter(*signal.butter(2, 2.0 * corner_hz / rate), rng.standard_normal(n))
    return np.asarray(size * values / values.std())


def _motion(
    rig: LumpedRig, point: int, day: LumpedDay, fault: LumpedFault, rng: np.random.Generator, duration_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return bearing forces (4), housing accelerations (3), housing forces (2) and the pinion angle per interval."""
    n, shape = rig.numbers, LumpedGeometry.of(rig, day.stiffness)
    gaps, compliances = tooth_tables(rig, shape, fault)
    fine_hz = rig.rate_hz * OVERSAMPLING[rig.rate_hz]
    n_steps = round((SETTLING_S + duration_s) * fine_hz)
    n_slow, slow_hz = n_steps // SLOW + 3, fine_hz / SLOW
    time = np.arange(n_slow) / slow_hz
    ratio = rig.teeth[0] / rig.teeth[1]
    speed, load = rig.speeds_rpm[point] * day.speed * pi / 30.0, rig.loads_nm[point] * day.load
    motor = load * ratio
    force = load / shape.base_radii[1]
    inertia = n["inertia"]
    mean_stiffness = 1.4 / shape.pair_m_per_n
    moved = 1.0 / (shape.base_radii[0] ** 2 / inertia[1] + shape.base_radii[1] ** 2 / inertia[2])

    # slowly changing quantities: set speed, torques, cage slip
    share, wander_hz = fault.wander
    phase = rng.uniform(0, 2 * pi)
    swing = np.sin(2 * pi * wander_hz * time + phase) + 0.25 * np.sin(4.6 * pi * wander_hz * time + 2 * phase)
    set_speed = speed * (1.0 + _slow(n_slow, slow_hz, 7e-4, 0.8, rng) + _slow(n_slow, slow_hz, 2e-4, 6.0, rng))
    set_speed = set_speed * (1.0 + share * swing)
    turning = inertia[0] + inertia[1] + (inertia[2] + inertia[3]) * ratio**2
    torque = motor * _slow(n_slow, slow_hz, 2e-3, 60.0, rng)
    if share:  # motor torque that makes the machine follow
        torque = torque + turning * np.gradient(set_speed) * slow_hz
    braking = load * (_slow(n_slow, slow_hz, 6e-3, 1.5, rng) + _slow(n_slow, slow_hz, 4e-3, 20.0, rng))
    on_housing: FloatArray = np.zeros((2, n_steps))
    if fault.foreign is not None:
        on_housing, more = fault.foreign(np.arange(n_steps) / fine_hz, time, max(force, 150.0), rng)
        torque = torque + motor * more

    cage = [0.5 * (1.0 - d / pitch) for _, d, pitch in rig.balls]
    slips = np.array(
        [
            rng.uniform(0, 2 * pi)
            - cage[side] * n["slip"][side] * turn * time
            + _slow(n_slow, slow_hz, 6e-3, 3.0, rng)
            + 4e-5 * np.cumsum(rng.standard_normal(n_slow))
            for side, turn in enumerate((speed, -speed * ratio))
        ]
    )
    # the machine in the form for the kernel
    bearings, bodies = _bearings_of(rig, day, fault, cage), _bodies_of(rig, day, fault)
    direction = float(n["centre_line_rad"]) - PRESSURE_ANGLE
    normal = -sin(direction), cos(direction)
    damping = 2.0 * float(n["mesh_damping_ratio"]) * day.damping / (mean_stiffness / moved) ** 0.5
    mesh = LumpedMesh(
        shape.base_radii,
        shape.base_pitch,
        shape.before,
        shape.after,
        0.98 * shape.beyond,
        float(n["backlash_m"]) * fault.backlash + fault.further_backlash_m,
        1.0 / shape.pair_m_per_n,
        float(damping),
        max(force / mean_stiffness, 1e-6),
        fault.friction or float(n["friction"]) * day.friction,
        0.03 * shape.base_pitch,
        normal,
        shape.hertz_m_per_n,
        fault.softened,
        fault.wobble,
        fault.phase,
    )
    ripple, order, ripple_phase = fault.ripple
    usual = LumpedDrive(
        motor_nm=motor,
        load_nm=load,
        follows=max(float(turning) / 0.15, motor / (0.03 * speed)),
        ripple_nm=ripple * motor if ripple else 0.003 * motor,
        ripple_order=order if ripple else 4.0,
        ripple_phase=ripple_phase,
        load_swing_nm=float(n["load_swing"]) * load,
        load_phase=float(n["load_phase"]),
        coupling_n=0.0,
        coupling_nm=0.0,
        coupling_phase=fault.phase,
        whirl_order=1.0,
        whirl_n=0.0,
        loose=0.0,
        lifted_m=float(9.81 * sum(bodies.mass) / bodies.mount_n_per_m[1]),
    )
    shares = {"coupling_nm": motor, "whirl_n": max(force, 150.0)}
    drive = usual._replace(**{name: value * shares.get(name, 1.0) for name, value in fault.drive.items()})

    # start in equilibrium under load, at a random tooth, already turning
    angle = 2 * pi * rng.integers(rig.teeth[1]) + rng.uniform(0, 2 * pi)
    bent = force / (2.0 * bearings.far_n_per_m[0])
    q = np.zeros(11)
    q[4:8] = -normal[0] * bent, -normal[1] * bent, normal[0] * bent, normal[1] * bent
    driven = (shape.base_radii[0] * angle - force / mean_stiffness - 2.0 * bent) / shape.base_radii[1]
    q[:4] = angle + motor / n["shafts"][0], angle, driven, driven - load / n["shafts"][1]
    v = np.zeros(11)
    v[:4] = speed, speed, speed * ratio, speed * ratio
    keep = OVERSAMPLING[rig.rate_hz] // 2
    out = march(
        n_steps, keep, 1.0 / fine_hz, mesh, bearings, bodies, drive, q, v, gaps, compliances, set_speed, torque,
        braking, slips, on_housing,
    )  # fmt: skip
    pushed = on_housing[:, : len(out) * keep].T.reshape(len(out), keep, 2).mean(axis=1)
    return np.column_stack([out[:, :7], pushed]), out[:, 7]


def _bearings_of(rig: LumpedRig, day: LumpedDay, fault: LumpedFault, cage: Sequence[float]) -> LumpedBearings:
    n, loose = rig.numbers, [fault.clearance_m.get(side) for side in range(2)]
    far, clearance = n["far_n_per_m"] * day.stiffness, n["clearance_m"] + day.clearance_m
    return LumpedBearings(
        (rig.balls[0][0], rig.balls[1][0]),
        _pair(n["ball_n_per_m15"] * day.stiffness),
        _pair(far),
        _pair([c if c is not None else usual for c, usual in zip(loose, clearance, strict=True)]),
        _pair([c or 0.0 for c in loose]),
        _pair(2.0 * n["bearing_damping_ratio"] * np.sqrt(2.0 * far * n["mass_kg"])),
        _pair(cage),
        fault.defect,
    )


def _bodies_of(rig: LumpedRig, day: LumpedDay, fault: LumpedFault) -> LumpedBodies:
    n, inertia, mass, ratio = rig.numbers, rig.numbers["inertia"], rig.numbers["mass_kg"], rig.teeth[0] / rig.teeth[1]
    housing = float(n["housing_kg"])
    apart = sum(LumpedGeometry.of(rig).radii)
    roll = housing * (1.2 * apart) ** 2 * 0.5
    mounts = np.array([housing, housing, roll]) * (2 * pi * n["mount_hz"] * [day.mounts, day.mounts, 1.0]) ** 2
    mount_damping = 2.0 * n["mount_damping_ratio"] * np.sqrt(mounts * [housing, housing, roll])
    half = 0.5 * apart * cos(float(n["centre_line_rad"])), 0.5 * apart * sin(float(n["centre_line_rad"]))
    coupled_inertia = 3.0 * inertia[1:3]
    reduced = inertia[[0, 3]] * coupled_inertia / (inertia[[0, 3]] + coupled_inertia)
    balance = mass * n["balance_mps"] / (rig.speeds_rpm[0] * pi / 30.0 * np.array([1.0, ratio]))
    runout = [n["runout_m"][side] + fault.runout_m.get(side, 0.0) for side in range(2)]
    unbalance = [balance[side] + fault.unbalance_kg_m.get(side, 0.0) for side in range(2)]
    return LumpedBodies(
        (float(inertia[0]), float(inertia[1]), float(inertia[2]), float(inertia[3])),
        _pair(n["shafts"]),
        _pair(0.06 * np.sqrt(n["shafts"] * reduced)),
        _pair(mass),
        housing,
        roll,
        (float(mounts[0]), float(mounts[1]), float(mounts[2])),
        (float(mount_damping[0]), float(mount_damping[1]), float(mount_damping[2])),
        ((-half[0], -half[1]), half),
        (_polar(runout[0]), _polar(runout[1])),
        (_polar(unbalance[0]), _polar(unbalance[1])),
    )


def _pair(values: FloatArray | Sequence[float]) -> tuple[float, float]:
    first, second = values
    return float(first), float(second)


def _polar(value: complex) -> tuple[float, float]:
    return float(abs(value)), float(np.angle(value))


def _sensed_motion(
    rig: LumpedRig, day: LumpedDay, fault: LumpedFault, motion: FloatArray, rate: float, rng: np.random.Generator
) -> FloatArray:
    """Return sensor signals from the bearing forces through the modes and from the housing, (n, n_sensors)."""
    n = rig.numbers
    moved = np.broadcast_to(fault.moved_modes, n["mode_hz"].shape)
    mode_hz, ratio = n["mode_hz"] * day.mode_hz * moved, n["mode_damping_ratio"] * day.mode_damping * fault.damped_modes
    forces = motion[:, :4] - motion[:, :4].mean(axis=0)
    forces = forces + float(n["rolling_noise"]) * forces.std() * rng.standard_normal(forces.shape) * (1, 0.8, 1, 0.8)
    foot = motion[:, 8] + 0.6 * motion[:, 7]
    sensed = np.zeros((len(motion), len(rig.directions)))
    for k, f in enumerate(mode_hz):
        omega = 2.0 * rate * tan(pi * f / rate)
        filtered = signal.bilinear([1.0, 0.0, 0.0], [1.0, 2.0 * ratio[k] * omega, omega**2], rate)
        pushed = n["mode_at_foot"][k] * foot - forces @ n["mode_at_bearings"][k]
        answer = signal.lfilter(*filtered, pushed / n["mode_kg"][k])
        sensed += answer[:, None] * (n["mode_at_sensors"] * day.mode_shape)[:, k]
    apart = rig.module_mm * 1e-3 * sum(rig.teeth) / 2.0
    for i, direction in enumerate(rig.directions):
        x, y, roll = DIRECTIONS[direction]
        sensed[:, i] += x * motion[:, 4] + y * motion[:, 5] + roll * apart * motion[:, 6]
    if fault.loose_sensor is not None:
        row, f, damping = fault.loose_sensor
        omega = 2 * pi * f
        mount = signal.bilinear([2 * damping * omega, omega**2], [1.0, 2 * damping * omega, omega**2], rate)
        sensed[:, row % sensed.shape[1]] = signal.lfilter(*mount, sensed[:, row % sensed.shape[1]])
    return sensed


def _noise_and_hum(rig: LumpedRig, fault: LumpedFault, n: int, rng: np.random.Generator) -> FloatArray:
    """Return noise and mains hum as shares of a sensor's level, (n_sensors, n)."""
    time, frequency = np.arange(n) / rig.rate_hz, np.fft.rfftfreq(n, 1.0 / rig.rate_hz)
    falling = np.where(frequency < 0.5, 0.0, np.maximum(frequency, 0.5) ** -0.5)
    rows = []
    for i in range(len(rig.directions)):
        drawn = rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))
        pink = np.fft.irfft(falling * drawn, n)
        turns, phase = rig.line_hz * (1.0 + 2e-4 * rng.standard_normal()) * time, rng.uniform(0, 2 * pi)
        wave = np.cos(2 * pi * turns + phase) + 0.35 * np.cos(6 * pi * turns + 3 * phase)
        wave += 0.12 * np.cos(10 * pi * turns) + 0.15 * np.cos(4 * pi * turns + 1.0)
        hum = float(rig.numbers["hum"][i]) + fault.hum * (1.0, 0.8, 0.6)[i]
        white = float(rig.numbers["noise"][i]) * rng.standard_normal(n)
        rows.append(white + float(rig.numbers["pink"][i]) * pink / pink.std() + hum * 2**0.5 * wave)
    return np.array(rows)


def _tachometer(rig: LumpedRig, day: LumpedDay, angle: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the voltage of one pulse per revolution, 6 % long, with 3 µs jitter."""
    turns = (angle - float(rig.numbers["mark_rad"]) - day.mark_rad) / (2 * pi)
    samples_per_turn = 2 * pi / (np.gradient(angle) + 1e-30)
    number = np.round(turns).astype(int)
    jitter = 3e-6 * rig.rate_hz * rng.standard_normal(number.max() - number.min() + 1)
    after = (turns - number) * samples_per_turn + jitter[number - number.min()]
    pulse = np.clip(after + 0.5, 0, 1) * np.clip(0.06 * samples_per_turn - after + 0.5, 0, 1)
    return np.asarray(5.0 * pulse + 0.03 + 0.02 * rng.standard_normal(len(angle)))
