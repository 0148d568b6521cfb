"""One run of a rig: all inputs of the time integration, which can be changed before it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import gcd, pi, sin
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording import Channel, Recording
from gearsig.rig import Sensor
from sims.blind._march import NUMBERS, march
from sims.blind._rig import (
    N_PATH,
    SHAFTS,
    BlindRig,
    Matrix,
    ModalForm,
    SensorResonance,
    SpurPair,
    modes_of,
    static_shape,
    step_coefficients,
)

WARM_UP_S = 0.5
LEAD_S = 0.15
"""Last part of the warm-up, kept because paths are already ringing when a recording begins."""
GRID_S = 1e-3
SUB_STEPS = 4
"""Steps per sample; every second one is kept, and the anti-alias filter removes the rest."""
Rows = list[tuple[float, ...]]
Stage = Callable[["BlindMotion", FloatArray, np.random.Generator], FloatArray]


@dataclass(frozen=True)
class RunCondition:
    """Operating condition of a run, as stated and in truth."""

    stated_rpm: float
    stated_nm: float
    true_rpm: float
    true_nm: float
    duration_s: float
    seed: int
    mount_seed: int


@dataclass(frozen=True)
class BlindMotion:
    """Results of a run at twice the sampling rate; `lead_n` are the bearing forces just before it."""

    rate_hz: float
    lead_n: FloatArray
    bearing_n: FloatArray
    casing: FloatArray
    theta: FloatArray
    squeeze_m: FloatArray
    mesh_n: FloatArray


@dataclass(frozen=True)
class Train:
    """Half-sine pulses at shaft angles: kind 0 or 1 is a force of that bearing, 2 a torque at the shaft's end."""

    shaft: int
    kind: int
    angle: FloatArray
    force: FloatArray
    turn: FloatArray
    width_s: float


@dataclass
class Scene:
    """A run before it starts, to which changes are applied. For the lists of rows see `march`."""

    rig: BlindRig
    condition: RunCondition
    rng: np.random.Generator
    gap_m: list[FloatArray]
    weak: list[FloatArray]
    base_gap_m: FloatArray
    pair_stiffness: FloatArray
    slip: FloatArray
    runout: Rows
    wobble: Rows
    torque: Rows
    unbalance: list[tuple[float, float]]
    wedge_m: float
    backlash_m: float
    clearance_m: list[float]
    ball_ripple: float
    speed: Matrix
    offsets: tuple[int, int]
    start: float
    sway: Rows = field(default_factory=list)
    trains: list[Train] = field(default_factory=list)
    paths: list[list[SensorResonance]] = field(default_factory=list)
    stages: list[Stage] = field(default_factory=list)
    late_stages: list[Stage] = field(default_factory=list)
    reference_rms: tuple[float, ...] = ()
    reference_peak: tuple[float, ...] = ()

    @property
    def omega(self) -> tuple[float, float]:
        """Mean speeds of both shafts, rad/s."""
        w = self.condition.true_rpm * pi / 30
        return w, w * self.rig.pair.z1 / self.rig.pair.z2

    @property
    def mesh_force_n(self) -> float:
        """Mean force along the line of action."""
        return self.condition.true_nm / self.rig.pair.base_radii_m[0]

    @property
    def turns(self) -> tuple[float, float]:
        """Upper bound of the revolutions of both shafts in the run."""
        n = (self.condition.duration_s + WARM_UP_S + 1) * 1.2 * self.omega[0] / (2 * pi)
        return n, n * self.rig.pair.z1 / self.rig.pair.z2


def friction_table(rig: BlindRig, omega_1: float, force_n: float) -> FloatArray:
    """Signed friction coefficient over the path, positive in approach.

    μ = 0.0127 · 1.13/(1.13 − S) · log10(29700 w / (η v_s v_t²)); Coulomb's law with the sign of the sliding speed.

    Source: G. H. Benedict and B. W. Kelley, Instantaneous coefficients of gear tooth friction,
    *ASLE Trans.* 4 (1961), with S in µm, w in N/mm, η in cP, speeds in m/s.
    """
    pair = rig.pair
    rho1, rho2 = pair.rho_m(pair.path)
    ratio = pair.z1 / pair.z2
    sliding, rolling = omega_1 * (rho2 * ratio - rho1), omega_1 * np.abs(rho2 * ratio + rho1)
    floor = 0.05 * rolling
    load = max(force_n / pair.face_mm, 1.0)
    argument = 29700 * load / (rig.viscosity_cp * np.maximum(np.abs(sliding), floor) * rolling**2)
    mu = 0.0127 * 1.13 / (1.13 - rig.finish_um) * np.log10(np.maximum(argument, 1.0))
    return np.asarray(np.clip(mu, 0.01, 0.2) * np.tanh(sliding / floor))


def relief_gap(rig: BlindRig) -> FloatArray:
    """Tip relief of both gears over the path, (N_PATH,)."""
    pair = rig.pair
    s = pair.path / pair.contact_ratio
    start = rig.relief_start
    end = np.clip((s - (1 - start)) / start, 0, None) ** 1.5 * rig.relief_m[0]
    return np.asarray(end + np.clip((start - s) / start, 0, None) ** 1.5 * rig.relief_m[1])


def scene_of(rig: BlindRig, condition: RunCondition) -> Scene:
    """The healthy rig at a condition; all randomness comes from the condition's seed."""
    rng = np.random.default_rng(condition.seed)
    made, pair = rig.tolerances, rig.pair
    omega_1 = condition.true_rpm * pi / 30
    force_n = condition.true_nm / pair.base_radii_m[0]
    speed = _speed_profile(rig, condition, omega_1, rng)
    torque = [
        (where, order, share * rig.rated_nm * (pair.z2 / pair.z1 if where else 1.0), phase)
        for where, order, share, phase in made.torque_share
    ]
    return Scene(
        rig=rig,
        condition=condition,
        rng=rng,
        gap_m=[np.array(g) for g in made.gap_m],
        weak=[np.zeros((z, N_PATH)) for z in (pair.z1, pair.z2)],
        base_gap_m=pair.end_gap_m() + relief_gap(rig),
        pair_stiffness=pair.pair_stiffness_n_per_m() * rig.stiffness_factor,
        slip=friction_table(rig, omega_1, force_n),
        runout=list(made.runout),
        wobble=list(made.wobble),
        torque=list(torque),
        unbalance=list(made.unbalance),
        wedge_m=made.wedge_m,
        backlash_m=rig.backlash_m,
        clearance_m=list(rig.clearance_m),
        ball_ripple=0.02,
        speed=speed,
        offsets=_meeting_teeth(pair, rng),
        start=rng.uniform(0, 2 * pi),
        paths=_mounted_paths(rig, condition),
    )


def _meeting_teeth(pair: SpurPair, rng: np.random.Generator) -> tuple[int, int]:
    """Teeth of the two gears that meet first; if tooth numbers have a common divisor, each tooth keeps its mates.

    The gears stay in mesh between recordings of a rig, so only positions reachable by rotation are drawn.
    """
    tooth = int(rng.integers(pair.z2))
    return 0, tooth - tooth % gcd(pair.z1, pair.z2)


def _mounted_paths(rig: BlindRig, condition: RunCondition) -> list[list[SensorResonance]]:
    """The paths of this mounting: each time sensors are mounted, frequencies shift by about 0.3 %, gains by 2 %."""
    rng = np.random.default_rng(condition.mount_seed)
    return [
        [
            SensorResonance(
                m.frequency_hz * (1 + rng.normal(0, 0.003)), m.damping_ratio, m.mass_kg * (1 + rng.normal(0, 0.02))
            )
            for m in chain.path
        ]
        for chain in rig.chains
    ]


def _speed_profile(rig: BlindRig, condition: RunCondition, omega_1: float, rng: np.random.Generator) -> Matrix:
    """Slowly wandering reference speed and its rate of change, (n, 2), every GRID_S."""
    t = np.arange(0, condition.duration_s + WARM_UP_S + 1, GRID_S)
    profile, later = np.ones_like(t), rng.uniform(0, 20)
    for frequency_hz, share, phase in rig.wander:
        profile += share * np.sin(2 * pi * frequency_hz * (t + later) + phase)
    return np.column_stack([omega_1 * profile, np.gradient(omega_1 * profile, GRID_S)])


def with_speed_profile(scene: Scene, factor: Callable[[FloatArray], FloatArray]) -> None:
    """Multiply the reference speed by a function of time."""
    t = np.arange(len(scene.speed)) * GRID_S
    omega = scene.speed[:, 0] * factor(t)
    scene.speed = np.column_stack([omega, np.gradient(omega, GRID_S)])


def run(scene: Scene, *, sub_steps: int = SUB_STEPS) -> BlindMotion:
    """Integrate the scene through its warm-up and its duration."""
    rate_hz = 2 * scene.rig.sampling_rate_hz
    n_lead = round(LEAD_S * rate_hz)
    n_out, n_before, *state = march_arguments(scene, sub_steps)
    whole = march(n_out + n_lead, n_before - n_lead, *state)
    out = whole[n_lead:]
    return BlindMotion(rate_hz, whole[:n_lead, :4].T, out[:, :4].T, out[:, 4:7].T, out[:, 7:9].T, out[:, 9], out[:, 10])


def march_arguments(scene: Scene, sub_steps: int, **numbers: float) -> tuple[Any, ...]:
    """Return the arguments of `march` in order, with `sub_steps` steps per sample, an even number.

    `numbers` replace single values of `NUMBERS` by name, e.g. `mesh_damping=0.0`.
    """
    rig, condition = scene.rig, scene.condition
    rate_hz, step_s = 2 * rig.sampling_rate_hz, 1 / (rig.sampling_rate_hz * sub_steps)
    modes = modes_of(rig.parts)
    q, p, steady = _start(scene, modes)
    number = np.zeros((), NUMBERS)
    for name, value in (_numbers(scene) | numbers).items():
        number[name] = value
    return (
        2 * round(condition.duration_s * rig.sampling_rate_hz),
        round(WARM_UP_S * rate_hz),
        sub_steps // 2,
        step_s,
        number[()],
        (step_coefficients(modes, step_s), modes.shapes, modes.outputs, modes.omega, modes.zeta),
        q,
        p,
        (steady, np.array(rig.parts.bearing_n_per_m), np.array(scene.clearance_m), np.array(scene.unbalance)),
        (scene.base_gap_m, scene.pair_stiffness, scene.slip, *scene.gap_m, *scene.weak),
        np.array(scene.offsets),
        (_rows(scene.runout, 4), _rows(scene.wobble, 4), _rows(scene.torque, 4), _rows(scene.sway, 5)),
        scene.speed,
        _train_arrays(scene),
    )


def _start(scene: Scene, modes: ModalForm) -> tuple[Matrix, Matrix, Matrix]:
    """Modal displacements and velocities in steady rotation under load, and the steady forces (weight)."""
    rig = scene.rig
    w1, w2 = float(scene.speed[0, 0]), float(scene.speed[0, 0]) * rig.pair.z1 / rig.pair.z2
    steady = np.zeros(len(modes.omega))
    steady[[5, 7]] = [-9.81 * m for m in rig.parts.rotor_mass_kg]
    forces = steady.copy()
    forces[[0, 3]] += scene.condition.true_nm, -scene.condition.true_nm * rig.pair.z2 / rig.pair.z1
    u = static_shape(modes, rig.mesh_stiffness_n_per_m(), forces)
    turn = np.zeros_like(u)
    turn[[0, 1]], turn[[2, 3]] = 1.0, rig.pair.z1 / rig.pair.z2
    into = modes.shapes.T @ modes.mass
    velocity = np.zeros_like(u)
    velocity[[0, 1]], velocity[[2, 3]] = w1, w2
    return into @ (u + scene.start * turn), into @ velocity, steady


def _friction_nm(scene: Scene) -> float:
    """Mean friction torque on the driver, by which the motor torque is corrected; its controller does the rest."""
    pair = scene.rig.pair
    inside = (pair.path >= 0) & (pair.path <= pair.contact_ratio)
    rho1, rho2 = pair.rho_m(pair.path)
    lever = (scene.slip * (rho2 * pair.z1 / pair.z2 - rho1))[inside]
    return float(scene.mesh_force_n * lever.mean())


def _numbers(scene: Scene) -> dict[str, Any]:
    """Values of `NUMBERS`."""
    rig, pair, parts = scene.rig, scene.rig.pair, scene.rig.parts
    j = parts.inertia_kgm2
    ratio = pair.z1 / pair.z2
    line_inertia = j[0] + j[1] + (j[2] + j[3]) * ratio**2
    effective = 1 / (pair.base_radii_m[0] ** 2 / j[1] + pair.base_radii_m[1] ** 2 / j[2])
    end_a, end_e = pair.end_shift_per_m()
    return {
        "rb": pair.base_radii_m,
        "line_x": np.cos(parts.line_angle),
        "line_y": np.sin(parts.line_angle),
        "base_pitch": pair.base_pitch_m,
        "contact_ratio": pair.contact_ratio,
        "rho_start": pair.rho_start_m,
        "rho_sum": pair.centre_distance_m * sin(pair.alpha),
        "soft_m": rig.soft_m,
        "wedge_m": scene.wedge_m,
        "backlash_m": scene.backlash_m,
        "mesh_damping": 2 * rig.mesh_damping_ratio * np.sqrt(effective / rig.mesh_stiffness_n_per_m()),
        "back_stiffness": rig.mesh_stiffness_n_per_m(),
        "load_nm": scene.condition.true_nm / ratio,
        "load_slope": rig.load_slope * scene.condition.true_nm / ratio / scene.omega[1],
        "motor_nm": scene.condition.true_nm + _friction_nm(scene),
        "line_inertia": line_inertia,
        "motor_memory": 0.5 / rig.motor_time_s,
        "motor_gain": line_inertia / rig.motor_time_s,
        "grid_s": GRID_S,
        "omega": scene.omega,
        "cage_ratio": [rig.bearing(i).orders()["FTF"] for i in range(2)],
        "n_balls": [rig.bearings[i][0] for i in range(2)],
        "end_a": end_a,
        "end_e": end_e,
        "ball_ripple": scene.ball_ripple,
        "phase_2": 2 * pi * scene.offsets[1] / pair.z2,
        "seat": parts.seat_x_m,
        "height": parts.height_m,
    }


def _rows(rows: Rows, width: int) -> Matrix:
    return np.array(rows, dtype=float).reshape(len(rows), width)


def _train_arrays(scene: Scene) -> tuple[Matrix, Matrix, Matrix, Matrix, Matrix]:
    trains = scene.trains
    return (
        _padded([t.angle for t in trains], 1e12),
        _padded([t.force for t in trains], 0.0),
        _padded([t.turn for t in trains], 0.0),
        _rows([(float(t.shaft), float(t.kind)) for t in trains], 2),
        np.array([t.width_s for t in trains], dtype=float),
    )


def _padded(arrays: list[FloatArray], fill: float) -> Matrix:
    padded = np.full((len(arrays), max((len(a) for a in arrays), default=1)), fill)
    for row, values in zip(padded, arrays, strict=True):
        row[: len(values)] = values
    return padded


# --------------------
# From motion to a recording: path to the sensor, noise, tachometer, sampling.
# --------------------


TACH_VOLTS = 5.0
ENCODER_NOISE_REV = 4e-7
"""Standard deviation of one reading: half a second of arc."""


def path_response(force_n: FloatArray, rate_hz: float, path: list[SensorResonance]) -> FloatArray:
    """Acceleration of parallel oscillators, Σ s²/(s² + 2ζω s + ω²) / m, by the bilinear transform with pre-warping."""
    from scipy.signal import lfilter

    total = np.zeros_like(force_n)
    for mode in path:
        warp = 2 * pi * mode.frequency_hz / np.tan(pi * mode.frequency_hz / rate_hz)
        w = 2 * pi * mode.frequency_hz
        a = np.array([warp**2 + 2 * mode.damping_ratio * w * warp + w**2, 2 * (w**2 - warp**2), 0.0])
        a[2] = warp**2 - 2 * mode.damping_ratio * w * warp + w**2
        total += lfilter(warp**2 * np.array([1.0, -2.0, 1.0]) / a[0], a / a[0], force_n) / mode.mass_kg
    return total


def accelerations(scene: Scene, motion: BlindMotion) -> FloatArray:
    """Acceleration at each sensor, without noise, (n_chains, n) at the motion's rate."""
    parts = scene.rig.parts
    n_lead = motion.lead_n.shape[1]
    force = np.hstack([motion.lead_n, motion.bearing_n]) - motion.bearing_n.mean(axis=1, keepdims=True)
    x_c, y_c, rock = motion.casing
    rows = []
    for i, chain in enumerate(scene.rig.chains):
        c, s = np.cos(chain.angle), np.sin(chain.angle)
        along, across = (c * force[2 * k] + s * force[2 * k + 1] for k in (i, 1 - i))
        body = c * (x_c - parts.height_m * rock) + s * (y_c + parts.seat_x_m[i] * rock)
        through = path_response(along + chain.crosstalk * across, motion.rate_hz, scene.paths[i])
        rows.append(body + through[n_lead:])
    return np.array(rows)


def coloured_noise(rng: np.random.Generator, n: int, rate_hz: float, colour: float) -> FloatArray:
    """Noise of unit rms with a power density proportional to f^-colour above 20 Hz."""
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    long = next_fast_len(n, real=True)
    f = np.maximum(rfftfreq(long, 1 / rate_hz), 20.0)
    x = irfft(rfft(rng.standard_normal(long)) * f ** (-colour / 2), long)[:n]
    return np.asarray(x / x.std())


def tachometer(scene: Scene, motion: BlindMotion, rng: np.random.Generator) -> FloatArray:
    """One pulse per revolution of the input shaft, in volts; edges last two samples and have jitter."""
    theta, fs = motion.theta[0], scene.rig.sampling_rate_hz
    n = len(theta) // 2
    turns = np.arange(np.floor(theta[0] / (2 * pi)), np.ceil(theta[-1] / (2 * pi)) + 1)
    jitter = rng.normal(0, scene.rig.tach_jitter_s, (2, len(turns)))
    times = np.arange(len(theta)) / motion.rate_hz
    slope = 2 * pi * motion.rate_hz / max(theta[-1] - theta[0], 1e-9) * len(theta) / motion.rate_hz

    def when(angle: FloatArray) -> FloatArray:
        inside = np.interp(angle, theta, times)
        before, after = angle < theta[0], angle > theta[-1]
        inside[before] = (angle[before] - theta[0]) * slope / (2 * pi * motion.rate_hz)
        inside[after] = times[-1] + (angle[after] - theta[-1]) * slope / (2 * pi * motion.rate_hz)
        return inside

    rise, fall = when(2 * pi * turns) + jitter[0], when(2 * pi * (turns + 0.08)) + jitter[1]
    t = np.arange(n) / fs
    edges = np.stack([rise - 1 / fs, rise + 1 / fs, fall - 1 / fs, fall + 1 / fs], axis=1).ravel()
    levels = np.tile([0.0, TACH_VOLTS, TACH_VOLTS, 0.0], len(turns))
    return np.asarray(np.interp(t, edges, levels) + rng.normal(0, 0.01, n))


def encoders_deg(scene: Scene, motion: BlindMotion, counts_per_revolution: int) -> FloatArray:
    """Readings of an encoder at each gear, (2, n) at the sampling rate: the last count passed."""
    n = motion.theta.shape[1] // 2
    turned = motion.theta[:, : 2 * n : 2] / (2 * pi)
    noise = np.random.default_rng([scene.condition.seed, 4]).normal(0, ENCODER_NOISE_REV, turned.shape)
    passed = np.floor((turned + noise) * counts_per_revolution) % counts_per_revolution
    return np.asarray(passed * (360.0 / counts_per_revolution))


def measure(scene: Scene, motion: BlindMotion, *, encoder_counts: int = 0) -> Recording:
    """Sample sensors, tachometer and, if `encoder_counts` is given, an encoder at each gear."""
    from scipy.signal import butter, resample_poly, sosfilt

    rig = scene.rig
    rng = np.random.default_rng([scene.condition.seed, 1])
    signal = accelerations(scene, motion)
    for stage in scene.stages:
        signal = stage(motion, signal, np.random.default_rng([scene.condition.seed, 2]))
    signal = np.asarray(resample_poly(signal, 1, 2, axis=1))
    signal = sosfilt(butter(2, 1.0, "highpass", fs=rig.sampling_rate_hz, output="sos"), signal, axis=1)
    level = scene.reference_rms or tuple(float(x.std()) for x in signal)
    n = signal.shape[1]
    t = np.arange(n) / rig.sampling_rate_hz
    hum = np.sin(2 * pi * 50.0 * t + rng.uniform(0, 2 * pi))
    rows = [
        (x + level[i] * (chain.noise_share * coloured_noise(rng, n, rig.sampling_rate_hz, chain.noise_colour)))
        + level[i] * rig.hum_share * hum
        for i, (x, chain) in enumerate(zip(signal, rig.chains, strict=True))
    ]
    tacho = tachometer(scene, motion, rng)
    signal = np.array([row * chain.gain for row, chain in zip(rows, rig.chains, strict=True)])
    for stage in scene.late_stages:
        signal = stage(motion, signal, np.random.default_rng([scene.condition.seed, 3]))
    samples = np.vstack([signal, tacho]).astype(np.float32)
    described = rig.description(scene.condition.stated_rpm, scene.condition.stated_nm)
    if encoder_counts:
        samples = np.vstack([samples, encoders_deg(scene, motion, encoder_counts).astype(np.float32)])
        fitted = tuple(Sensor(f"{shaft} encoder", "encoder", "deg", shaft, wraps=True) for shaft in SHAFTS)
        described = replace(described, sensors=(*described.sensors, *fitted))
    channels = tuple(Channel(s.channel, s.quantity, s.unit, s.position) for s in described.sensors)
    return Recording(samples, rig.sampling_rate_hz, channels, rig=described)
