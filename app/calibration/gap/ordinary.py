"""What every machine has, sound or not: run-out, unbalance, uneven pitch, a housing that swallows high frequencies.

The simulated machines are too good: few lines of their shafts, few sidebands, most of the vibration at high multiples
of the mesh. Measured ones have sidebands 15 to 35 dB below the mesh and most energy at its first two harmonics. So each
machine of the population gets tolerances and paths of its own, the same on every day; the twin knows nothing of them.

Source of what is usual: ISO 21940-11:2016 (unbalance), ISO 1328-1:2013 (run-out and pitch, grades 5 to 8);
R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.calibration.gap.chance import LARGEST_ADVANCE
from app.calibration.gap.paths import PathChange
from app.calibration.gap.scene import Scene, scene_of, tone
from app.calibration.gap.signatures import SIGNATURES
from app.calibration.gap.vibration import N_MESH_HARMONICS, Signature, changed, vibrations
from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray
from gearsig.recording.types import Recording

SWINGS, LINES, PITCH, PULLS = (0.005, 0.2), (0.0006, 0.1), (0.006, 0.4), (0.003, 0.1)
"""Sizes, as in `app.calibration.gap.signatures`: of a swing of the mesh per turn, of a shaft's line, of uneven pitch
(what the teeth repeat by themselves is 30 dB below the mesh with good ones, as loud as the mesh at light load), of the
drive's pulling."""

CORNER_MESH_ORDERS, STEEPEST, FLAT_SHARE = (0.4, 4.0), 3, 0.2
"""Where a path begins to fall, in mesh frequencies; by how many 6 dB per octave; paths that do not."""

NOISE, HUM = (0.0004, 0.1), (0.0005, 0.05)
"""Of a sensor, over the vibration."""

MAINS_HZ = (50.0, 60.0)

MOUNTING_GAIN, MOUNTING_CORNER, MOUNTING_LINES = 0.12, 0.05, 0.08
"""Standard deviations of the logarithms of what a sensor that was mounted anew changes: its gain, its path's corner,
each mesh harmonic by itself."""

TACHOMETER_REV = (5e-6, 1e-3)
"""By which a mark comes too early or too late, in revolutions: marks, thresholds and clocks are not exact."""


@dataclass(frozen=True)
class Ordinary:
    """The tolerances of one machine.

    Parameters
    ----------
    seed : int
        Of the machine.
    scales : tuple of float
        The channels' standard deviations when the machine was new, which all sizes are relative to.
    paths : tuple of (int, float)
        Each channel's steepness, 0: flat, and corner frequency in Hz, the same whatever the day's speed.
    """

    seed: int
    scales: tuple[float, ...]
    paths: tuple[tuple[int, float], ...]

    @classmethod
    def of(cls, reference: Recording, seed: int) -> Ordinary:
        """Draw the tolerances of the machine of a sound recording."""
        scene = scene_of(reference)
        paths = _paths(seed, scene, len(reference.channels))
        return cls(
            seed,
            tuple(
                float(_through(row, path, reference.sampling_rate_hz).std())
                for row, path in zip(reference.samples, paths, strict=True)
            ),
            tuple(paths),
        )

    def on(
        self, recording: Recording, turns: int, rng: np.random.Generator, changed_paths: Sequence[PathChange] = ()
    ) -> Recording:
        """Return a recording as this machine makes it; noise and the phase of the hum are that day's.

        Parameters
        ----------
        recording : Recording
        turns : int
            Of the driver, before the recording begins: what belongs to the driven shaft comes at its own place.
        rng : numpy.random.Generator
        changed_paths : sequence of PathChange
            One for each vibration channel; none: they are as ever.
        """
        scene = scene_of(recording)
        scene = replace(scene, revolutions=scene.revolutions + turns)
        mains_hz = _mains_hz(self.seed)
        signatures = _tolerances(scene, np.random.default_rng([self.seed, 11]))
        samples = recording.samples.copy()
        for k, i in enumerate(vibrations(recording)):
            own, scale = np.random.default_rng([self.seed, 12, i]), self.scales[i]
            values = _through(samples[i], self.paths[i], recording.sampling_rate_hz)
            for signature in signatures:
                values = changed(values, signature, scene, own, scale)
            if changed_paths:
                values = changed_paths[k].of(values, recording.sampling_rate_hz)
            values = values + log_uniform(own, *NOISE) * scale * rng.standard_normal(len(values))
            for n in (1, 2, 3):
                hum = np.sin(2 * np.pi * (n * mains_hz * scene.time_s + rng.uniform()))
                values = values + log_uniform(own, *HUM) / n * scale * hum
            samples[i] = values
        for i, channel in enumerate(recording.channels):
            if channel.quantity == "tachometer":
                samples[i] = self._jittered(samples[i], scene, rng)
        return replace(recording, samples=samples)

    def _jittered(self, pulses: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
        """Return a tachometer's signal with each of its pulses a little off."""
        from scipy.ndimage import map_coordinates

        spread_rev = log_uniform(np.random.default_rng([self.seed, 14]), *TACHOMETER_REV)
        turn = np.floor(scene.revolutions - np.floor(scene.revolutions[0]) + 0.5).astype(np.intp)
        late_rev = spread_rev * rng.standard_normal(turn[-1] + 1)[turn]
        turns_per_sample = (scene.revolutions[-1] - scene.revolutions[0]) / (len(pulses) - 1)
        places = np.arange(len(pulses)) + late_rev / turns_per_sample
        found: FloatArray = map_coordinates(pulses, [places], order=1, mode="nearest")
        return found


def mounted_anew(recording: Recording, rng: np.random.Generator) -> Recording:
    """Return a recording as sensors would give it that were taken off and put back."""
    scene = scene_of(recording)
    samples = recording.samples.copy()
    for i in vibrations(recording):
        gains = np.exp(MOUNTING_LINES * rng.standard_normal(N_MESH_HARMONICS))
        signature = Signature(mesh_gains=tuple(gains.tolist()))
        corner_hz = 0.2 * recording.sampling_rate_hz
        moved = corner_hz * float(np.exp(MOUNTING_CORNER * rng.standard_normal()))
        values = changed(samples[i], signature, scene, rng, 0.0)
        values = _shelf(values, corner_hz, moved, recording.sampling_rate_hz)
        samples[i] = values * float(np.exp(MOUNTING_GAIN * rng.standard_normal()))
    return replace(recording, samples=samples)


def _shelf(values: FloatArray, corner_hz: float, moved_hz: float, rate_hz: float) -> FloatArray:
    """Return values through a path whose corner moved: (1 + jf/f0)/(1 + jf/f1)."""
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
    answer = (1.0 + 1j * frequency / corner_hz) / (1.0 + 1j * frequency / moved_hz)
    found: FloatArray = np.fft.irfft(np.fft.rfft(values) * answer, len(values))
    return found


def _mains_hz(seed: int) -> float:
    return float(np.random.default_rng([seed, 13]).choice(MAINS_HZ))


def _paths(seed: int, scene: Scene, n_channels: int) -> list[tuple[int, float]]:
    """Return each channel's steepness, 0: flat, and corner frequency in Hz."""
    rng = np.random.default_rng([seed, 10])
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_hz = scene.teeth[0] * turns_hz
    flat, steep = rng.uniform() < FLAT_SHARE, int(rng.integers(1, STEEPEST + 1))
    corner = log_uniform(rng, *CORNER_MESH_ORDERS)
    # Sensors on one housing differ less than housings do.
    return [(0 if flat else steep, mesh_hz * corner * log_uniform(rng, 0.6, 1.6)) for _ in range(n_channels)]


def _through(values: FloatArray, path: tuple[int, float], rate_hz: float) -> FloatArray:
    from scipy.signal import butter, sosfilt

    steep, corner_hz = path
    if not steep or corner_hz >= 0.45 * rate_hz:
        return values
    found: FloatArray = sosfilt(butter(steep, corner_hz, fs=rate_hz, output="sos"), values)
    return found


def _tolerances(scene: Scene, rng: np.random.Generator) -> list[Signature]:
    """Return what the machine's own shafts, gears and drive do."""
    found = []
    for order in scene.shaft_orders:
        swing, late = log_uniform(rng, *SWINGS), log_uniform(rng, *SWINGS)
        lines = [log_uniform(rng, *LINES) * tone(n * order, scene, rng) for n in (1, 2, 3)]
        found.append(
            Signature(
                1.0 + swing * tone(order, scene, rng),
                LARGEST_ADVANCE * late / scene.teeth[0] * tone(order, scene, rng),
                tuple(lines),
            )
        )
    found += [SIGNATURES["pitch_error"](scene, log_uniform(rng, *PITCH), rng) for _ in scene.shaft_orders]
    found.append(SIGNATURES["torque_ripple"](scene, log_uniform(rng, *PULLS), rng))
    return found
