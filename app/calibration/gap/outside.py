"""Vibration that no effect of the catalogue makes, added to recordings of sound machines: what "unknown" looks like."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.calibration.gap.scene import Scene, band_noise, knocks, ring, scene_of, struck, tone
from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray
from gearsig.recording.types import Recording

LEVELS = (0.04, 1.5)
"""Of what is added, over the vibration's standard deviation."""


def with_foreign_vibration(recording: Recording, rng: np.random.Generator) -> tuple[Recording, str]:
    """Return the recording with one foreign vibration, the same on all channels up to gain, and its name."""
    scene = scene_of(recording)
    name = str(rng.choice(list(FOREIGN)))
    added = FOREIGN[name](scene, rng)
    added = added / max(float(added.std()), 1e-12)
    samples = recording.samples.copy()
    level = log_uniform(rng, *LEVELS)
    for i, channel in enumerate(recording.channels):
        if channel.is_vibration:
            samples[i] += added * level * samples[i].std() * rng.uniform(0.4, 1.0)
    return replace(recording, samples=samples), name


def _strange_order(rng: np.random.Generator, low: float, high: float) -> float:
    """An order that is no whole number and no half of one."""
    whole = float(rng.integers(int(low), int(high) + 1))
    return whole + float(rng.choice((rng.uniform(0.07, 0.43), rng.uniform(0.57, 0.93))))


def _rolling_element(scene: Scene, rng: np.random.Generator) -> FloatArray:
    slip = 1.0 - rng.uniform(0.0, 0.015)
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    return knocks(2.0 * bearing["BSF"] * slip, 0.02, scene, rng, by=bearing["FTF"] * slip)


def _strange_knocks(scene: Scene, rng: np.random.Generator) -> FloatArray:
    return knocks(_strange_order(rng, 1, 12), float(rng.uniform(0.002, 0.05)), scene, rng)


def _once_per_revolution(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A loose key or coupling: longer than a tooth, and not of one mesh."""
    order = 1.0 if rng.uniform() < 0.5 else scene.teeth[0] / scene.teeth[1]
    return knocks(order * float(rng.choice((1.0, 2.0))), 0.01, scene, rng)


def _strange_tone(scene: Scene, rng: np.random.Generator) -> FloatArray:
    return tone(_strange_order(rng, 1, 150), scene, rng)


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
    return struck(places, np.abs(rng.standard_normal(n)) + 0.2, scene, ring(scene, rng))


def _swelling_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Noise of a band that swells with an order: a pump, a rub, lacking oil."""
    order = float(rng.choice((1.0, scene.teeth[0] / scene.teeth[1], _strange_order(rng, 2, 9))))
    swelling: FloatArray = band_noise(scene, rng) * (
        1.0 + rng.uniform(0.3, 1.0) * np.cos(2 * np.pi * order * scene.revolutions)
    )
    return swelling


def _steady_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Noise of a band: flow, cavitation, a neighbour."""
    return band_noise(scene, rng)


def _bad_contact(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """A plug that works loose: the signal jumps now and then, and what couples it to the amplifier takes that back."""
    n = max(2, int(scene.time_s[-1] * log_uniform(rng, 1.0, 60.0)))
    places = rng.integers(0, len(scene.time_s), n).astype(np.float64)
    back = np.exp(-np.arange(int(scene.sampling_rate_hz)) / (log_uniform(rng, 0.001, 0.2) * scene.sampling_rate_hz))
    return struck(places, rng.standard_normal(n), scene, back)


FOREIGN: dict[str, Callable[[Scene, np.random.Generator], FloatArray]] = {
    "rolling element": _rolling_element,
    "knocks at a strange order": _strange_knocks,
    "knocks once per revolution": _once_per_revolution,
    "tone at a strange order": _strange_tone,
    "ghost line": _ghost,
    "whirl": _whirl,
    "another machine": _other_machine,
    "inverter": _inverter,
    "random knocks": _random_knocks,
    "swelling noise": _swelling_noise,
    "steady noise": _steady_noise,
    "bad contact": _bad_contact,
}
