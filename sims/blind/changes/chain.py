"""The measurement chain: a resonance of housing or mounting, mains hum, clipping."""

from __future__ import annotations

from math import log10, pi

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.change import Change, Place, steady
from sims.blind.scene import Motion, Scene


def _channels(scene: Scene, choice: np.random.Generator) -> list[int]:
    """Return all sensors, or one of them."""
    n = len(scene.rig.chains)
    one = int(choice.integers(n))
    return [one] if choice.random() < 0.5 else list(range(n))


def _path(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Add the response of a sensor on a soft foot: 1 + (g − 1) × band-pass."""
    channels = _channels(scene, choice)
    f_hz, quality = 10 ** choice.uniform(log10(900), log10(8000)), choice.uniform(4, 15)
    gain = 10 ** (severity / 20) - 1

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        from scipy.signal import iirpeak, lfilter

        b, a = iirpeak(f_hz, quality, fs=motion.rate_hz)
        changed = np.array(signal)
        for i in channels:
            changed[i] += gain * lfilter(b, a, signal[i])
        return changed

    scene.stages.append(stage)
    return {"frequency_hz": round(float(f_hz), 1), "channels": " ".join(f"a{i + 1}" for i in channels)}


def _hum(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    channels, parts = _channels(scene, choice), np.array([1.0, choice.uniform(0.05, 0.4), choice.uniform(0.1, 0.5)])

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        t = np.arange(signal.shape[1]) / scene.rig.sampling_rate_hz
        grid_hz, phase, changed = 50 + rng.normal(0, 0.02), rng.uniform(0, 2 * pi, 3), np.array(signal)
        hum = severity * sum(a * np.sin(2 * pi * grid_hz * (k + 1) * t + phase[k]) for k, a in enumerate(parts))
        changed[channels] += hum
        return changed

    scene.late_stages.append(stage)
    return {"frequency_hz": 50.0, "channels": " ".join(f"a{i + 1}" for i in channels)}


def _clip(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Hold the signal at a limit, a share below the loudest healthy recording's peak."""
    channels = _channels(scene, choice)

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        changed = np.array(signal)
        for i in channels:
            peak = scene.reference_peak[i] if scene.reference_peak else float(np.abs(signal[i]).max())
            limit = (1 - severity / 100) * peak
            changed[i] = np.clip(signal[i], -limit, limit)
        return changed

    scene.late_stages.append(stage)
    return {"channels": " ".join(f"a{i + 1}" for i in channels)}


CHANGES = (
    Change("transfer_path", "measurement chain", "dB", steady(8.0, 32.0), _path),
    Change("mains_hum", "measurement chain", "m/s^2", steady(0.02, 12.0), _hum),
    Change("clipping", "measurement chain", "% of peak cut off", steady(10.0, 92.0), _clip),
)
