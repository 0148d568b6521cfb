"""What vibration is made of when it is made by hand: rings, knocks, tones, over the angle of a recording's shafts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

_RINGS = 6.0


@dataclass(frozen=True)
class Scene:
    """What a vibration is made for.

    Parameters
    ----------
    revolutions : array, (n,)
        Of the driver at each sample.
    time_s : array, (n,)
    sampling_rate_hz : float
    teeth : (int, int)
    bearings : tuple of mapping
        Orders BPFO, BPFI, BSF, FTF of each bearing, in cycles per revolution of the driver; and "shaft", that of its
        own shaft.
    """

    revolutions: FloatArray
    time_s: FloatArray
    sampling_rate_hz: float
    teeth: tuple[int, int]
    bearings: tuple[dict[str, float], ...]

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of either shaft per revolution of the driver."""
        return 1.0, self.teeth[0] / self.teeth[1]


def rig_of(recording: Recording) -> Rig:
    """Return the rig of a simulated recording, which always has one."""
    if recording.rig is None:
        raise ValueError("a simulated recording has its rig")
    return recording.rig


def scene_of(recording: Recording) -> Scene:
    """Return the scene of a simulated recording with one gear pair."""
    from gearsig.angle.shaft import find_shaft_angle

    rig = rig_of(recording)
    time = np.arange(recording.samples.shape[1]) / recording.sampling_rate_hz
    pair = rig.pairs[0]
    teeth = int(pair.driver_teeth or 0), int(pair.driven_teeth or 0)
    bearings = []
    for bearing in rig.bearings:
        shaft = 1.0 if bearing.shaft == pair.driver else teeth[0] / teeth[1]
        bearings.append({"shaft": shaft} | {name: order * shaft for name, order in bearing.orders().items()})
    return Scene(
        find_shaft_angle(recording, rig).revolutions_at(time),
        time,
        recording.sampling_rate_hz,
        teeth,
        tuple(bearings),
    )


def ring(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return a housing mode's answer to a knock."""
    rate = scene.sampling_rate_hz
    frequency, damping = log_uniform(rng, 700.0, 0.4 * rate), float(rng.uniform(0.02, 0.1))
    time = np.arange(int(rate * _RINGS / (2 * np.pi * frequency * damping)) + 2) / rate
    answer: FloatArray = np.exp(-2 * np.pi * frequency * damping * time) * np.sin(2 * np.pi * frequency * time)
    return answer


def struck(places: FloatArray, sizes: FloatArray, scene: Scene, answer: FloatArray) -> FloatArray:
    """Return the answer to knocks at samples `places`."""
    from scipy.signal import oaconvolve

    n = len(scene.time_s)
    force = np.zeros(n)
    np.add.at(force, np.clip(places.astype(np.intp), 0, n - 1), sizes)
    vibration: FloatArray = oaconvolve(force, answer)[:n]
    return vibration


def passings(scene: Scene, order: float, phase: float = 0.0) -> FloatArray:
    """Return the samples at which revolutions · order + phase passes a whole number."""
    return np.flatnonzero(np.diff(np.floor(scene.revolutions * order + phase)) > 0).astype(np.float64)


def knocks(order: float, jitter: float, scene: Scene, rng: np.random.Generator, by: float = 0.0) -> FloatArray:
    """Return knocks `order` times per revolution, their size swinging at the order `by`."""
    places = passings(scene, order, rng.uniform())
    if len(places) > 1:
        places += jitter * float(np.median(np.diff(places))) * rng.standard_normal(len(places))
    depth = float(rng.uniform(0.3, 0.9)) if by else 0.0
    swing = 1.0 + depth * np.cos(2 * np.pi * by * scene.revolutions)
    kept = np.clip(places.astype(np.intp), 0, len(scene.time_s) - 1)
    return struck(places, swing[kept] * rng.normal(1.0, 0.1, len(places)), scene, ring(scene, rng))


def tone(order: float, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return a sine of an order, with any phase."""
    sine: FloatArray = np.sin(2 * np.pi * (order * scene.revolutions + rng.uniform()))
    return sine


def band_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return noise through a housing mode."""
    from scipy.signal import oaconvolve

    noise: FloatArray = oaconvolve(rng.standard_normal(len(scene.time_s)), ring(scene, rng), mode="same")
    return noise
