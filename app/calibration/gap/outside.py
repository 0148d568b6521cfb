"""Vibration that no effect of the catalogue makes, added to recordings of sound machines: what "unknown" looks like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording.types import Recording

LEVELS = (0.04, 1.5)
"""Of what is added, over the vibration's standard deviation."""

_RINGS = 6.0


@dataclass(frozen=True)
class Scene:
    """What a foreign vibration is made for.

    Parameters
    ----------
    revolutions : array, (n,)
        Of the driver at each sample.
    time_s : array, (n,)
    sampling_rate_hz : float
    teeth : (int, int)
    ball, cage : float
        Orders of a rolling element's spin and of its cage.
    """

    revolutions: FloatArray
    time_s: FloatArray
    sampling_rate_hz: float
    teeth: tuple[int, int]
    ball: float
    cage: float


def with_foreign_vibration(recording: Recording, rng: np.random.Generator) -> tuple[Recording, str]:
    """Return the recording with one foreign vibration, the same on all channels up to gain, and its name."""
    from gearsig.angle.shaft import find_shaft_angle

    rig = recording.rig
    if rig is None:
        raise ValueError("a simulated recording has its rig")
    n = recording.samples.shape[1]
    time = np.arange(n) / recording.sampling_rate_hz
    orders = rig.bearings[int(rng.integers(len(rig.bearings)))].orders()
    pair = rig.pairs[0]
    scene = Scene(
        find_shaft_angle(recording, rig).revolutions_at(time),
        time,
        recording.sampling_rate_hz,
        (int(pair.driver_teeth or 0), int(pair.driven_teeth or 0)),
        orders["BSF"],
        orders["FTF"],
    )
    name = str(rng.choice(list(FOREIGN)))
    added = FOREIGN[name](scene, rng)
    added = added / max(float(added.std()), 1e-12)
    samples = recording.samples.copy()
    level = float(np.exp(rng.uniform(*np.log(LEVELS))))
    for i, channel in enumerate(recording.channels):
        if channel.is_vibration:
            samples[i] += added * level * samples[i].std() * rng.uniform(0.4, 1.0)
    return replace(recording, samples=samples), name


def _ring(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A housing mode's answer to a knock."""
    rate = scene.sampling_rate_hz
    frequency, damping = float(np.exp(rng.uniform(np.log(700.0), np.log(0.4 * rate)))), float(rng.uniform(0.02, 0.1))
    time = np.arange(int(rate * _RINGS / (2 * np.pi * frequency * damping)) + 2) / rate
    ring: FloatArray = np.exp(-2 * np.pi * frequency * damping * time) * np.sin(2 * np.pi * frequency * time)
    return ring


def _struck(places: FloatArray, sizes: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    from scipy.signal import oaconvolve

    n = len(scene.time_s)
    force = np.zeros(n)
    np.add.at(force, np.clip(places.astype(np.intp), 0, n - 1), sizes)
    answer: FloatArray = oaconvolve(force, _ring(scene, rng))[:n]
    return answer


def _knocks(order: float, jitter: float, scene: Scene, rng: np.random.Generator, by: float = 0.0) -> FloatArray:
    """Knocks `order` times per revolution, their size swinging at the order `by`."""
    phase = scene.revolutions * order + rng.uniform()
    places = np.flatnonzero(np.diff(np.floor(phase)) > 0).astype(np.float64)
    if len(places) > 1:
        places += jitter * float(np.median(np.diff(places))) * rng.standard_normal(len(places))
    depth = float(rng.uniform(0.3, 0.9)) if by else 0.0
    swing = 1.0 + depth * np.cos(2 * np.pi * by * scene.revolutions)
    kept = np.clip(places.astype(np.intp), 0, len(scene.time_s) - 1)
    return _struck(places, swing[kept] * rng.normal(1.0, 0.1, len(places)), scene, rng)


def _strange_order(rng: np.random.Generator, low: float, high: float) -> float:
    """An order that is no whole number and no half of one."""
    whole = float(rng.integers(int(low), int(high) + 1))
    return whole + float(rng.choice((rng.uniform(0.07, 0.43), rng.uniform(0.57, 0.93))))


def _rolling_element(scene: Scene, rng: np.random.Generator) -> FloatArray:
    slip = 1.0 - rng.uniform(0.0, 0.015)
    return _knocks(2.0 * scene.ball * slip, 0.02, scene, rng, by=scene.cage * slip)


def _strange_knocks(scene: Scene, rng: np.random.Generator) -> FloatArray:
    return _knocks(_strange_order(rng, 1, 12), float(rng.uniform(0.002, 0.05)), scene, rng)


def _once_per_revolution(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A loose key or coupling: longer than a tooth, and not of one mesh."""
    order = 1.0 if rng.uniform() < 0.5 else scene.teeth[0] / scene.teeth[1]
    return _knocks(order * float(rng.choice((1.0, 2.0))), 0.01, scene, rng)


def _strange_tone(scene: Scene, rng: np.random.Generator) -> FloatArray:
    order = _strange_order(rng, 1, 150)
    tone: FloatArray = np.sin(2 * np.pi * order * scene.revolutions)
    return tone


def _ghost(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A ghost line: a whole order of one shaft that the cutting machine left."""
    ghost = float(rng.integers(20, 4 * scene.teeth[0]))
    order = ghost if rng.uniform() < 0.5 else ghost * scene.teeth[0] / scene.teeth[1]
    line: FloatArray = np.sin(2 * np.pi * order * scene.revolutions) * (
        1.0 + 0.2 * np.cos(2 * np.pi * scene.revolutions)
    )
    return line


def _whirl(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Oil whirl or a rub below the shaft's order."""
    order = float(rng.uniform(0.38, 0.49))
    waves = [np.sin(2 * np.pi * k * order * scene.revolutions + rng.uniform(0, 6)) / k**2 for k in (1, 2, 3)]
    whirl: FloatArray = np.sum(waves, axis=0)
    return whirl


def _looseness(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Many multiples of a shaft's order or of its half."""
    order = (1.0, scene.teeth[0] / scene.teeth[1])[int(rng.integers(2))] * float(rng.choice((0.5, 1.0)))
    waves = [
        np.sin(2 * np.pi * k * order * scene.revolutions + rng.uniform(0, 6)) * float(rng.uniform(0.3, 1.0))
        for k in range(1, 14)
    ]
    loose: FloatArray = np.sum(waves, axis=0)
    return loose


def _other_machine(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Lines at fixed frequencies, and their multiples."""
    first = float(np.exp(rng.uniform(np.log(17.0), np.log(900.0))))
    waves = [np.sin(2 * np.pi * k * first * scene.time_s + rng.uniform(0, 6)) / k for k in range(1, 6)]
    machine: FloatArray = np.sum(waves, axis=0)
    return machine


def _inverter(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A carrier at a fixed frequency with pairs of lines about it."""
    carrier, apart = float(rng.uniform(2000.0, 0.45 * scene.sampling_rate_hz)), float(rng.uniform(30.0, 250.0))
    wave: FloatArray = np.sin(2 * np.pi * carrier * scene.time_s) * (
        1.0 + rng.uniform(0.3, 1.0) * np.cos(2 * np.pi * apart * scene.time_s)
    )
    return wave


def _random_knocks(scene: Scene, rng: np.random.Generator) -> FloatArray:
    n = max(3, int(scene.time_s[-1] * rng.uniform(1.0, 20.0)))
    places = rng.integers(0, len(scene.time_s), n).astype(np.float64)
    return _struck(places, np.abs(rng.standard_normal(n)) + 0.2, scene, rng)


def _swelling_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Noise of a band that swells with an order: a pump, a rub, lacking oil."""
    from scipy.signal import oaconvolve

    noise = oaconvolve(rng.standard_normal(len(scene.time_s)), _ring(scene, rng), mode="same")
    order = float(rng.choice((1.0, scene.teeth[0] / scene.teeth[1], _strange_order(rng, 2, 9))))
    swelling: FloatArray = noise * (1.0 + rng.uniform(0.3, 1.0) * np.cos(2 * np.pi * order * scene.revolutions))
    return swelling


def _steady_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Noise of a band: flow, cavitation, a neighbour."""
    from scipy.signal import oaconvolve

    noise: FloatArray = oaconvolve(rng.standard_normal(len(scene.time_s)), _ring(scene, rng), mode="same")
    return noise


FOREIGN: dict[str, Callable[[Scene, np.random.Generator], FloatArray]] = {
    "rolling element": _rolling_element,
    "knocks at a strange order": _strange_knocks,
    "knocks once per revolution": _once_per_revolution,
    "tone at a strange order": _strange_tone,
    "ghost line": _ghost,
    "whirl": _whirl,
    "looseness": _looseness,
    "another machine": _other_machine,
    "inverter": _inverter,
    "random knocks": _random_knocks,
    "swelling noise": _swelling_noise,
    "steady noise": _steady_noise,
}
