"""From motion to a recording: the way to the sensor, noise, tachometer, sampling."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording.types import Channel, Recording
from sims.blind.rig import Resonance
from sims.blind.scene import Motion, Scene

TACH_VOLTS = 5.0


def path_response(force_n: FloatArray, rate_hz: float, path: list[Resonance]) -> FloatArray:
    """Acceleration at the end of parallel oscillators: Σ s²/(s² + 2ζω s + ω²) / m, bilinear with pre-warping."""
    from scipy.signal import lfilter

    total = np.zeros_like(force_n)
    for mode in path:
        warp = 2 * pi * mode.frequency_hz / np.tan(pi * mode.frequency_hz / rate_hz)
        w = 2 * pi * mode.frequency_hz
        a = np.array([warp**2 + 2 * mode.damping_ratio * w * warp + w**2, 2 * (w**2 - warp**2), 0.0])
        a[2] = warp**2 - 2 * mode.damping_ratio * w * warp + w**2
        total += lfilter(warp**2 * np.array([1.0, -2.0, 1.0]) / a[0], a / a[0], force_n) / mode.mass_kg
    return total


def accelerations(scene: Scene, motion: Motion) -> FloatArray:
    """What each sensor's place does, (n_chains, n) at the motion's rate; no noise yet."""
    parts = scene.rig.parts
    n_lead = motion.lead_n.shape[1]
    force = np.hstack([motion.lead_n, motion.bearing_n]) - motion.bearing_n.mean(axis=1, keepdims=True)
    x_c, y_c, rock = motion.casing
    rows = []
    for i, chain in enumerate(scene.rig.chains):
        c, s = np.cos(chain.angle), np.sin(chain.angle)
        own, other = (c * force[2 * k] + s * force[2 * k + 1] for k in (i, 1 - i))
        body = c * (x_c - parts.height_m * rock) + s * (y_c + parts.seat_x_m[i] * rock)
        through = path_response(own + chain.crosstalk * other, motion.rate_hz, scene.paths[i])
        rows.append(body + through[n_lead:])
    return np.array(rows)


def coloured_noise(rng: np.random.Generator, n: int, rate_hz: float, colour: float) -> FloatArray:
    """Noise of unit rms whose power falls as f^-colour from 20 Hz on."""
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    long = next_fast_len(n, real=True)
    f = np.maximum(rfftfreq(long, 1 / rate_hz), 20.0)
    x = irfft(rfft(rng.standard_normal(long)) * f ** (-colour / 2), long)[:n]
    return np.asarray(x / x.std())


def tachometer(scene: Scene, motion: Motion, rng: np.random.Generator) -> FloatArray:
    """One pulse per turn of the input shaft, in volts at the sampling rate; edges last two samples and jitter."""
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


def measure(scene: Scene, motion: Motion) -> Recording:
    """Sample the sensors and the tachometer as the rig's front end would."""
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
    channels = tuple(Channel(s.channel, s.quantity, s.unit, s.position) for s in described.sensors)
    return Recording(samples, rig.sampling_rate_hz, channels, rig=described)
