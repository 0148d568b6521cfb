"""What the catalogue does not hold: some of it easily taken for something that it does."""

from __future__ import annotations

from dataclasses import replace
from math import gcd, lcm, log10, pi

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.bearing import add_blows, blow_n, load_direction, slipping_angles
from sims.blind.changes.change import GEARS, Change, Place, Span, deflection_um, steady
from sims.blind.geometry import SpurPair
from sims.blind.rig import SHAFTS, Resonance
from sims.blind.scene import Motion, Scene, Train
from sims.blind.sensing import coloured_noise, path_response

OUTSIDE = "outside"


def _by_load(low: float, high: float) -> Span:
    """Give a span in parts of the rated mesh force."""
    return lambda rig: (low * rig.rated_nm / rig.pair.base_radii_m[0], high * rig.rated_nm / rig.pair.base_radii_m[0])


def _rub(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A loose foot or seal that is touched over a few degrees of each turn."""
    shaft, at, arc, way = (
        int(choice.integers(2)),
        choice.uniform(0, 2 * pi),
        choice.uniform(0.06, 0.3),
        choice.uniform(0, 2 * pi),
    )
    n_turns = int(scene.turns[shaft]) + 2
    n_touches = int(choice.integers(2, 6))
    angle = (
        2 * pi * np.arange(n_turns)[:, None] + at + np.sort(scene.rng.uniform(0, arc, (n_turns, n_touches)))
    ).ravel()
    force = severity * np.clip(scene.rng.normal(0.8, 0.3, len(angle)), 0, 2)
    scene.trains.append(Train(shaft, shaft, angle, force, np.full(len(angle), way), 0.25e-3))
    return {"shaft": SHAFTS[shaft]}


def _knock(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A worn coupling that takes up its play once or twice a turn."""
    shaft, per_turn, at = int(choice.integers(2)), int(choice.integers(1, 3)), choice.uniform(0, 2 * pi)
    n = int(scene.turns[shaft] * per_turn) + 2
    angle = at + 2 * pi * np.arange(n) / per_turn + scene.rng.normal(0, 0.004, n)
    torque = severity * np.clip(scene.rng.normal(1, 0.12, n), 0.3, 2)
    scene.trains.append(Train(shaft, 2, angle, torque, np.zeros(n), choice.uniform(0.3e-3, 1e-3)))
    # The drive line's spring keeps most of it from the teeth; the coupling's own bearing does not.
    arm_m = scene.rig.pair.pitch_radii_m[shaft]
    scene.trains.append(
        Train(
            shaft,
            shaft,
            angle,
            torque / arm_m * 0.4,
            np.full(n, choice.uniform(0, 2 * pi)),
            choice.uniform(0.3e-3, 0.8e-3),
        )
    )
    return {"shaft": SHAFTS[shaft], "order": per_turn}


def _ball(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A damaged rolling element: two blows per spin, strong while the cage holds it in the loaded zone."""
    shaft, slip = int(choice.integers(2)), choice.uniform(0.002, 0.015)
    bearing = scene.rig.bearing(shaft)
    spin, cage = bearing.orders()["BSF"], bearing.orders()["FTF"]
    angle = slipping_angles(scene, shaft, 2 * spin, slip)
    mid = load_direction(scene, shaft)
    turn = mid + cage * angle
    zone = np.maximum(np.cos(turn - mid), 0.0) ** 1.5
    inner_or_outer = np.where(np.arange(len(angle)) % 2, 1.0, 0.7)
    force = blow_n(scene, severity) * zone * inner_or_outer * np.clip(scene.rng.normal(1, 0.25, len(angle)), 0.2, 2)
    add_blows(scene, shaft, angle, force, turn, width_mm=severity, race_mm=(bearing.pitch_diameter_mm or 40.0) / 2)
    return {"shaft": SHAFTS[shaft], "bearing": bearing.name, "order": round(2 * spin, 4)}


def _field(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A motor's field that pulls at twice the line frequency, with slip sidebands; it shakes the whole bed."""
    slip_hz, depth = choice.uniform(0.3, 2.5), choice.uniform(0.1, 0.6)

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:
        t = np.arange(signal.shape[1]) / motion.rate_hz
        line_hz, phase = 100 + rng.normal(0, 0.04), rng.uniform(0, 2 * pi, 3)
        pull = (
            severity * (1 + depth * np.cos(2 * pi * slip_hz * t + phase[0])) * np.cos(2 * pi * line_hz * t + phase[1])
        )
        pull += 0.15 * severity * np.cos(4 * pi * line_hz * t + phase[2])
        share = np.linspace(1.0, 0.6, signal.shape[0])[:, None]
        return np.asarray(signal + share * pull)

    scene.stages.append(stage)
    return {"frequency_hz": 100.0}


def _cavitation(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A pump on the same bed: collapsing bubbles in a wide band, a vane tone, swelling with the vanes."""
    vanes, shaft = int(choice.integers(5, 10)), int(choice.integers(2))
    ways = [Resonance(10 ** choice.uniform(log10(1500), log10(9000)), choice.uniform(0.05, 0.2), 1.0) for _ in range(4)]
    tone, depth = choice.uniform(0.1, 0.4), choice.uniform(0.3, 0.9)
    swell_phase = choice.uniform(0, 2 * pi, len(scene.rig.chains))

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:
        theta = motion.theta[shaft]
        changed = np.array(signal)
        for i in range(signal.shape[0]):
            swell = 1 + depth * np.cos(vanes * theta + swell_phase[i])
            wide = path_response(coloured_noise(rng, len(theta), motion.rate_hz, 0.0) * swell, motion.rate_hz, ways)
            changed[i] += severity * (wide / wide.std() + tone * np.cos(vanes * theta))
        return changed

    scene.stages.append(stage)
    return {"shaft": SHAFTS[shaft], "order": vanes}


def _belt(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A belt or fan beside the drive: lines at an order that no part of the gear pair has."""
    shaft, way, phases = int(choice.integers(2)), choice.uniform(0, 2 * pi), choice.uniform(0, 2 * pi, 4)
    order = float(choice.choice([choice.uniform(0.31, 0.48), choice.uniform(0.53, 0.93), choice.uniform(2.1, 7.9)]))
    for k, part in enumerate((1.0, 0.7, 0.4, 0.25)):
        # Light masses move with it: the force grows with the harmonic's frequency.
        scene.sway.append((float(shaft), order * (k + 1), severity * part, phases[k], way))
    return {"shaft": SHAFTS[shaft], "order": round(order, 4)}


def _cable(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A loose cable: now and then the signal jumps, fades and comes back."""
    channel = int(choice.integers(len(scene.rig.chains)))
    depth, step = choice.uniform(0.4, 0.95), choice.uniform(1, 10)

    def stage(motion: Motion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        fs = scene.rig.sampling_rate_hz
        n, changed = signal.shape[1], np.array(signal)
        level = float(signal[channel].std())
        for _ in range(1 + rng.poisson(severity * n / fs)):
            start, length = int(rng.integers(n)), int(fs * rng.uniform(0.005, 0.06))
            end = min(start + length, n)
            changed[channel, start:end] *= 1 - depth
            decay = np.exp(-np.arange(n - start) / (fs * rng.uniform(0.002, 0.02)))
            changed[channel, start:] += rng.choice([-1, 1]) * step * level * decay
        return changed

    scene.late_stages.append(stage)
    return {"channels": f"a{channel + 1}"}


def _warm(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A warm housing: its resonances come down in frequency, their damping goes up."""
    spread = choice.uniform(0.6, 1.4, (len(scene.paths), 8))
    scene.paths = [
        [
            replace(
                mode,
                frequency_hz=mode.frequency_hz * (1 - severity / 100 * s),
                damping_ratio=mode.damping_ratio * (1 + severity / 30),
            )
            for mode, s in zip(path, row, strict=False)
        ]
        for path, row in zip(scene.paths, spread, strict=True)
    ]
    return {"channels": "all"}


def _turns_to_tooth(pair: SpurPair, tooth: int) -> int:
    """Turns of gear 1 after which its tooth 0 meets tooth 0 of gear 2, if now it meets `tooth`."""
    g = gcd(pair.z1, pair.z2)
    others = pair.z2 // g
    return -tooth // g * pow(pair.z1 // g, -1, others) % others


def _stain(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Teeth that marked each other at standstill and hit the mark whenever they meet again.

    Where that is rare, the machine stood still more often: a mark at least every eight turns.
    """
    pair = scene.rig.pair
    meeting = lcm(pair.z1, pair.z2) // pair.z1
    period = meeting / -(-meeting // 8)
    n = int(scene.turns[0] / period) + 2
    # The mark is on the same teeth whichever of them met when the recording began.
    first = (choice.random() * meeting + _turns_to_tooth(pair, scene.offsets[1])) % period
    angle = 2 * pi * (first + period * np.arange(n))
    for shaft, way in ((0, scene.rig.parts.line_angle + pi), (1, scene.rig.parts.line_angle)):
        # Both trains follow the input shaft's angle, so that the gears are pushed apart at the same instant.
        scene.trains.append(Train(0, shaft, angle, np.full(n, severity), np.full(n, way), 0.3e-3))
    return {"gear": "both", "order": 1 / period}


def _ghost(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """What the index wheel of the machine that cut the gear left on it: a wave with more or fewer cycles than teeth."""
    gear = int(choice.integers(2))
    teeth = (scene.rig.pair.z1, scene.rig.pair.z2)
    order = round(teeth[gear] * choice.uniform(1.15, 2.3))
    while order % teeth[gear] == 0:
        order += 1
    scene.runout.append((float(gear), float(order), severity * 1e-6, choice.uniform(0, 2 * pi)))
    return {"gear": GEARS[gear], "shaft": SHAFTS[gear], "order": order}


CHANGES = (
    Change("foundation_rub", OUTSIDE, "N", _by_load(0.005, 0.4), _rub, "chipped_tooth"),
    Change(
        "coupling_knock", OUTSIDE, "N m", lambda rig: (0.006 * rig.rated_nm, 0.4 * rig.rated_nm), _knock, "root_crack"
    ),
    Change("ball_defect", OUTSIDE, "mm", steady(0.08, 4.0), _ball, "bearing_inner_race"),
    Change("electromagnetic_line", OUTSIDE, "m/s^2", steady(0.02, 12.0), _field, "mains_hum"),
    Change("temperature_shift", OUTSIDE, "%", steady(3.0, 25.0), _warm, "transfer_path"),
    Change("hunting_stain", OUTSIDE, "N", _by_load(0.02, 0.9), _stain, "tooth_spall"),
    Change("ghost_component", OUTSIDE, "um", lambda rig: (0.03 * deflection_um(rig), 1.2 * deflection_um(rig)), _ghost),
    Change("pump_cavitation", OUTSIDE, "m/s^2", steady(0.05, 8.0), _cavitation),
    Change("belt_line", OUTSIDE, "N", _by_load(0.001, 0.15), _belt),
    Change("loose_cable", OUTSIDE, "bursts/s", steady(0.2, 8.0), _cable),
)
