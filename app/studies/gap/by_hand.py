"""Synthetic signatures of effects, from the literature, added to healthy recordings; foreign vibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap import LIGHT_LOAD_N_PER_MM, tooth_load_n_per_mm
from gearsig.recording import MAINS_HZ, Recording
from gearsig.rig import Rig
from sims.effects import effects, textbook
from sims.machine import log_uniform


def rig_of(recording: Recording) -> Rig:
    """Return the rig of a simulated recording, which always has one."""
    if recording.rig is None:
        raise ValueError("a simulated recording has its rig")
    return recording.rig


def scene_of(recording: Recording) -> textbook.SyntheticScene:
    """Return the scene of a simulated recording with one gear pair."""
    from gearsig.angle import find_shaft_angle

    rig = rig_of(recording)
    time = np.arange(recording.samples.shape[1]) / recording.sampling_rate_hz
    pair = rig.pairs[0]
    teeth = int(pair.driver_teeth or 0), int(pair.driven_teeth or 0)
    bearings = []
    for bearing in rig.bearings:
        shaft = 1.0 if bearing.shaft == pair.driver else teeth[0] / teeth[1]
        bearings.append({"shaft": shaft} | {name: order * shaft for name, order in bearing.orders().items()})
    return textbook.SyntheticScene(
        find_shaft_angle(recording, rig).revolutions_at(time),
        time,
        recording.sampling_rate_hz,
        teeth,
        tuple(bearings),
        len(vibrations(recording)),
    )


def vibrations(recording: Recording) -> list[int]:
    """Return the row numbers of a recording's vibration channels."""
    return [i for i, channel in enumerate(recording.channels) if channel.is_vibration]


AS_SHIPPED = (
    "root_crack",
    "tooth_spall",
    "chipped_tooth",
    "tooth_wear",
    "pitch_error",
    "surface_roughness",
    "sliding_friction",
    "eccentricity",
    "unbalance",
    "misalignment",
    "torque_ripple",
    "backlash",
    "bearing_outer_race",
    "bearing_inner_race",
    "bearing_clearance",
    "clipping",
)
"""Order in which the seeds of the shipped population draw; effects added later follow automatically."""
_BOOKS = {name: effect.textbook.draw for name, effect in effects().items() if effect.textbook and effect.textbook.draw}
SIGNATURES = {name: _BOOKS[name] for name in dict.fromkeys((*AS_SHIPPED, *_BOOKS))}
"""Effect → function that draws its signature; other effects come only from the simulators."""


def with_signature(recording: Recording, name: str, rng: np.random.Generator) -> tuple[Recording, float]:
    """Return the recording with an effect's signature added, and its strength, 0 to 1."""
    scene, strength = scene_of(recording), float(rng.uniform())
    signature = SIGNATURES[name](scene, textbook.SIZES[0] * (textbook.SIZES[1] / textbook.SIZES[0]) ** strength, rng)
    samples = recording.samples.copy()
    for k, i in enumerate(vibrations(recording)):
        samples[i] = signature.on(samples[i], scene, rng, float(samples[i].std()), k)
    return replace(recording, samples=samples), strength


def made_by_hand(healthy: Recording, torque_nm: float) -> tuple[str, ...]:
    """Return the effects whose signatures are added to healthy recordings; no backlash if teeth never separate."""
    light = tooth_load_n_per_mm(rig_of(healthy).pairs[0], torque_nm) < LIGHT_LOAD_N_PER_MM
    return tuple(name for name in SIGNATURES if light or name != "backlash")


# --------------------
# Vibration that no effect of the catalogue causes, added to recordings of healthy machines: examples of "unknown".
# --------------------


def with_foreign_vibration(recording: Recording, rng: np.random.Generator) -> tuple[Recording, str]:
    """Return the recording with one foreign vibration, the same on all channels up to gain, and its name."""
    scene = scene_of(recording)
    name = str(rng.choice(list(FOREIGN)))
    added = FOREIGN[name](scene, rng)
    added = added / max(float(added.std()), 1e-12)
    samples = recording.samples.copy()
    level = log_uniform(rng, 0.04, 1.5)  # of the standard deviation
    for i in vibrations(recording):
        samples[i] += added * level * samples[i].std() * rng.uniform(0.4, 1.0)
    return replace(recording, samples=samples), name


def _strange_order(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a random order that is neither an integer nor a half-integer."""
    whole = float(rng.integers(int(low), int(high) + 1))
    return whole + float(rng.choice((rng.uniform(0.07, 0.43), rng.uniform(0.57, 0.93))))


def _rolling_element(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    slip = 1.0 - rng.uniform(0.0, 0.015)
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    return textbook.impact_train(2.0 * bearing["BSF"] * slip, 0.02, scene, rng, by=bearing["FTF"] * slip)


def _strange_impacts(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    return textbook.impact_train(_strange_order(rng, 1, 12), float(rng.uniform(0.002, 0.05)), scene, rng)


def _once_per_revolution(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A loose key or coupling: longer than one tooth, and unrelated to the mesh."""
    order = 1.0 if rng.uniform() < 0.5 else scene.teeth[0] / scene.teeth[1]
    return textbook.impact_train(order * float(rng.choice((1.0, 2.0))), 0.01, scene, rng)


def _strange_tone(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    return textbook.tone(_strange_order(rng, 1, 150), scene, rng)


def _ghost(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A ghost line: an integer order of one shaft left by the cutting machine."""
    ghost = float(rng.integers(20, 4 * scene.teeth[0]))
    order = ghost if rng.uniform() < 0.5 else ghost * scene.teeth[0] / scene.teeth[1]
    line: FloatArray = np.sin(2 * np.pi * order * scene.revolutions) * (
        1.0 + 0.2 * np.cos(2 * np.pi * scene.revolutions)
    )
    return line


def _whirl(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Oil whirl or a rub, below the shaft order."""
    order = float(rng.uniform(0.38, 0.49))
    waves = [np.sin(2 * np.pi * k * order * scene.revolutions + rng.uniform(0, 6)) / k**2 for k in (1, 2, 3)]
    return np.asarray(np.sum(waves, axis=0))


def _neighbouring_machine(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Lines at fixed frequencies and their multiples."""
    first = log_uniform(rng, 17.0, 900.0)
    waves = [np.sin(2 * np.pi * k * first * scene.time_s + rng.uniform(0, 6)) / k for k in range(1, 6)]
    return np.asarray(np.sum(waves, axis=0))


def _inverter(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A carrier at a fixed frequency with pairs of sidebands."""
    carrier, apart = float(rng.uniform(2000.0, 0.45 * scene.sampling_rate_hz)), float(rng.uniform(30.0, 250.0))
    wave: FloatArray = np.sin(2 * np.pi * carrier * scene.time_s) * (
        1.0 + rng.uniform(0.3, 1.0) * np.cos(2 * np.pi * apart * scene.time_s)
    )
    return wave


def _asynchronous(scene: textbook.SyntheticScene, turn_hz: float, rng: np.random.Generator) -> FloatArray:
    """Return the revolutions of a neighbouring machine's shaft, whose speed wanders slightly."""
    unsteady = rng.uniform(0.0, 0.004) * np.sin(2 * np.pi * rng.uniform(0.05, 1.0) * scene.time_s + rng.uniform(0, 6))
    return np.asarray(np.cumsum(turn_hz * (1.0 + unsteady)) * (scene.time_s[1] - scene.time_s[0]))


def _neighbouring_gear(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A neighbouring gear, pump or fan: tooth or blade multiples modulated by its shaft, and that shaft's line."""
    turns = _asynchronous(scene, log_uniform(rng, 4.0, 60.0), rng)
    teeth, steep = float(rng.integers(3, 60)), rng.uniform(0.5, 2.0)
    waves = [np.cos(2 * np.pi * k * teeth * turns + rng.uniform(0, 6)) / k**steep for k in range(1, 5)]
    swell = 1.0 + rng.uniform(0.0, 0.8) * np.cos(2 * np.pi * turns + rng.uniform(0, 6))
    return np.asarray(swell * np.sum(waves, axis=0) + log_uniform(rng, 0.03, 1.0) * np.cos(2 * np.pi * turns))


def _loose_foot(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A foot or a pedestal that lifts: many multiples of a shaft order, in half the cases of half that order."""
    first = scene.shaft_orders[textbook.draw_side(rng)] * float(rng.choice((0.5, 1.0)))
    steep = rng.uniform(0.3, 1.2)
    waves = [textbook.tone(k * first, scene, rng) / k**steep * rng.uniform(0.3, 1.0) for k in range(1, 13)]
    return np.asarray(np.sum(waves, axis=0))


def _belt(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Slaps of a belt with an independent clock, nearly regular and nearly equal in strength."""
    passed = _asynchronous(scene, log_uniform(rng, 3.0, 60.0), rng)
    at = np.flatnonzero(np.diff(np.floor(passed)) > 0).astype(np.float64)
    scatter = rng.uniform(0.0, 0.02) * float(np.median(np.diff(at))) if len(at) > 1 else 0.0
    at = at + scatter * rng.standard_normal(len(at))
    return textbook.struck(at, rng.normal(1.0, 0.2, len(at)), scene, textbook.ring(scene, rng))


def _motor_field(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """The field of a motor: twice the line frequency and its multiples, beating at twice the slip."""
    line_hz, slip_hz = float(rng.choice(MAINS_HZ)) * rng.uniform(0.998, 1.002), rng.uniform(0.3, 4.0)
    waves = [np.cos(4 * np.pi * k * line_hz * scene.time_s + rng.uniform(0, 6)) / k**1.5 for k in (1, 2, 3)]
    beat = 1.0 + rng.uniform(0.2, 0.9) * np.cos(2 * np.pi * slip_hz * scene.time_s + rng.uniform(0, 6))
    return np.asarray(beat * np.sum(waves, axis=0))


def _random_impacts(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Random impacts: occasional, as of loose parts, or numerous, as of collapsing bubbles."""
    n = max(3, int(scene.time_s[-1] * log_uniform(rng, 1.0, 400.0)))
    places = rng.integers(0, len(scene.time_s), n).astype(np.float64)
    return textbook.struck(places, np.abs(rng.standard_normal(n)) + 0.2, scene, textbook.ring(scene, rng))


def _swelling_noise(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Band noise modulated by an order: a pump, a rub, lack of oil."""
    order = float(rng.choice((1.0, scene.teeth[0] / scene.teeth[1], _strange_order(rng, 2, 9))))
    swelling: FloatArray = textbook.band_noise(scene, rng) * (
        1.0 + rng.uniform(0.3, 1.0) * np.cos(2 * np.pi * order * scene.revolutions)
    )
    return swelling


def _steady_noise(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Steady band noise: flow, cavitation, a neighbouring machine."""
    return textbook.band_noise(scene, rng)


def _bad_contact(scene: textbook.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """A loose plug: the signal jumps occasionally, and the AC coupling of the amplifier lets each jump decay."""
    n = max(2, int(scene.time_s[-1] * log_uniform(rng, 1.0, 60.0)))
    places = rng.integers(0, len(scene.time_s), n).astype(np.float64)
    back = np.exp(-np.arange(int(scene.sampling_rate_hz)) / (log_uniform(rng, 0.001, 0.2) * scene.sampling_rate_hz))
    return textbook.struck(places, rng.standard_normal(n), scene, back)


FOREIGN: dict[str, Callable[[textbook.SyntheticScene, np.random.Generator], FloatArray]] = {
    "rolling element": _rolling_element,
    "impacts at a strange order": _strange_impacts,
    "impacts once per revolution": _once_per_revolution,
    "tone at a strange order": _strange_tone,
    "ghost line": _ghost,
    "whirl": _whirl,
    "another machine": _neighbouring_machine,
    "inverter": _inverter,
    "gear of another machine": _neighbouring_gear,
    "loose foot": _loose_foot,
    "belt": _belt,
    "motor field": _motor_field,
    "random impacts": _random_impacts,
    "swelling noise": _swelling_noise,
    "steady noise": _steady_noise,
    "bad contact": _bad_contact,
}
