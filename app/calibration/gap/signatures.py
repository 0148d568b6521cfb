"""The catalogue's effects as the literature describes them, put into recordings of sound machines.

The population's own simulator shows each effect in one way, with one balance between its lines, sidebands and noise.
Machines, and other simulators, agree with it on the signature and not on that balance: where a run-out modulates the
mesh in one, it shows as a line of the shaft in another. So each effect is also made by hand with its balance drawn
anew each time, and whoever learns from the population learns what the balances have in common.

Source of the signatures: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapters 2, 5 and 7;
ISO 13373-2:2016, annexes; P. D. McFadden, "Detecting fatigue cracks in gears by amplitude and phase demodulation of
the meshing vibration", J. Vib. Acoust. 108 (1986); J. E. Berry, *Illustrated Vibration Diagnostic Chart*, Technical
Associates of Charlotte, 1994 (misalignment: higher mesh harmonics with sidebands at running speed;
looseness: many harmonics of running speed, halves, a raised floor); S. He, S. Cho, R. Singh, "Prediction of dynamic
friction forces in spur gears using alternate sliding friction formulations", J. Sound Vib. 309 (2008); M. Tiwari,
K. Gupta, O. Prakash, "Effect of radial internal clearance of a ball bearing on the dynamics of a balanced horizontal
rotor", J. Sound Vib. 238 (2000) (a larger clearance makes the support softer).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from app.calibration.gap.chance import LARGEST_ADVANCE, balance, draw_side, partly, steeply
from app.calibration.gap.paths import draw_path_changes
from app.calibration.gap.scene import (
    Scene,
    band_noise,
    knocks,
    passings,
    rig_of,
    ring,
    scene_of,
    struck,
    tone,
)
from app.calibration.gap.tooth_signatures import chipped_tooth, root_crack, tooth_spall
from app.calibration.gap.vibration import N_MESH_HARMONICS, Signature, changed, vibrations
from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray
from gearsig.gap.tooth_load import LIGHT_LOAD_N_PER_MM, tooth_load_n_per_mm
from gearsig.recording.types import Recording

SIZES = (0.06, 2.5)
"""Of a signature: from what nobody sees to several floors. Effects reach about as far as each other; where one ended
before its look-alikes do, whatever is large would be one of those."""

MOST_CHANNELS = 2
"""Of vibration, in a simulated recording."""

LOOSE_ORDERS = 10
"""Of its shaft, up to which a loose bearing shows lines."""


def with_signature(recording: Recording, name: str, rng: np.random.Generator) -> tuple[Recording, float]:
    """Return the recording with an effect's signature, and how strong it is, 0 to 1."""
    scene = scene_of(recording)
    strength = float(rng.uniform())
    samples = recording.samples.copy()
    if name == "clipping":
        most = 10.0 ** (-3.0 + 2.5 * strength)  # share of the samples that are cut
        for i in vibrations(recording):
            low, high = np.quantile(samples[i], (most / 2.0, 1.0 - most / 2.0))
            samples[i] = np.clip(samples[i], low, high) if rng.uniform() < 0.5 else _cut_at(samples[i], most)
        return replace(recording, samples=samples), strength
    signature = SIGNATURES[name](scene, SIZES[0] * (SIZES[1] / SIZES[0]) ** strength, rng)
    for k, i in enumerate(vibrations(recording)):
        samples[i] = changed(samples[i], signature, scene, rng, float(samples[i].std()), k)
    return replace(recording, samples=samples), strength


def _cut_at(values: FloatArray, share: float) -> FloatArray:
    limit = float(np.quantile(np.abs(values), 1.0 - share))
    cut: FloatArray = np.clip(values, -limit, limit)
    return cut


def _uneven(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return what differs from tooth to tooth of both gears, of unit size."""
    total = np.zeros(len(scene.time_s))
    for side, weight in zip((0, 1), rng.uniform(0.0, 1.0, 2), strict=True):
        teeth = scene.teeth[side]
        own = rng.standard_normal(teeth)
        place = scene.revolutions * scene.shaft_orders[side] * teeth % teeth
        total += weight * np.interp(place, np.arange(teeth + 1), np.append(own, own[0]))
    return np.clip(total, -2.5, 2.5)


def _tooth_wear(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A profile that is worn away from the pitch line: mesh harmonics grow, the higher the more; rough flanks.

    What modulates the mesh grows less than the mesh does: all alike would be another path.
    """
    gains = 1.0 + 8.0 * size * np.abs(rng.standard_normal(N_MESH_HARMONICS)) * steeply(rng)[::-1]
    noise = size * rng.uniform() ** 2 * _at_the_mesh(scene, band_noise(scene, rng), rng)
    return Signature(
        added=(noise,),
        mesh_gains=tuple(gains.tolist()),
        paths_scatter=0.4 * min(size, 1.0) * partly(rng),
        around=0.5 * partly(rng),
        uneven=partly(rng) * _uneven(scene, rng),
    )


def _at_the_mesh(scene: Scene, noise: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return noise, of unit size, that swells with the mesh more or less."""
    swelling = 1.0 + rng.uniform(0.0, 0.9) * np.cos(2 * np.pi * scene.teeth[0] * scene.revolutions)
    found: FloatArray = noise / max(float(noise.std()), 1e-12) * swelling
    return found


def _pitch_error(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """Each tooth comes early or late by its own amount: lines at all orders of its shaft."""
    side = draw_side(rng)
    teeth, turn = scene.teeth[side], scene.revolutions * scene.shaft_orders[side]
    errors, gains = (rng.standard_normal(teeth) for _ in range(2))
    at, gain, slow = balance(rng, 3)
    place = turn * teeth % teeth
    nodes = np.arange(teeth + 1)
    early = np.interp(place, nodes, np.append(errors, errors[0]))
    louder = np.interp(place, nodes, np.append(gains, gains[0]))
    run = np.cumsum(errors - errors.mean())
    low = np.interp(place, nodes, np.append(run, run[0])) / max(float(run.std()), 1e-12)
    return Signature(
        np.maximum(1.0 + 0.6 * gain * size * louder, 0.0),
        0.3 * LARGEST_ADVANCE * min(at * size, 1.0) / scene.teeth[0] * np.clip(early, -2.5, 2.5),
        (0.5 * slow * size * low,),
    )


def _surface_roughness(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """Asperities that slide over each other: noise, in bands, more or less with the mesh."""
    loose, locked = balance(rng, 2)
    total = sum(
        (_at_the_mesh(scene, band_noise(scene, rng), rng) * rng.uniform(0.3, 1.0) for _ in range(3)),
        np.zeros(len(scene.time_s)),
    )
    sides = [_born_with(scene, side, rng) * rng.uniform(0.0, 1.0) for side in (0, 1)]
    return Signature(added=(0.8 * size * loose * total, 0.8 * size * locked * (sides[0] + sides[1])))


def _born_with(scene: Scene, side: int, rng: np.random.Generator) -> FloatArray:
    """Return a waveform, of unit size, that a gear repeats each turn: lines at all its orders in a broad band."""
    teeth = scene.teeth[side]
    low, high = teeth * rng.uniform(0.5, 3.0), teeth * rng.uniform(4.0, 9.0)
    n = 2 * int(high) + 2
    orders = np.arange(n // 2 + 1)
    lines = (rng.standard_normal(len(orders)) + 1j * rng.standard_normal(len(orders))) * (
        (orders > low) & (orders < high)
    )
    wave = np.fft.irfft(lines, 8 * n)
    places = scene.revolutions * scene.shaft_orders[side] % 1.0 * len(wave)
    found: FloatArray = np.interp(places, np.arange(len(wave) + 1), np.append(wave, wave[0]))
    return found / max(float(found.std()), 1e-12)


def _sliding_friction(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A force along the flanks that turns round at the pitch point, and some noise.

    Nearly a square wave of the mesh: its harmonics fall with their number. Across the line of action there is little
    besides, so that it may be far louder than what was there.
    """
    waves = np.abs(1.0 + 0.5 * rng.standard_normal(N_MESH_HARMONICS)) * steeply(rng)
    gains = 1.0 + size * 10.0 ** rng.uniform(0.0, 1.0) * waves
    gains *= np.exp(0.7 * min(size, 1.0) * rng.standard_normal(N_MESH_HARMONICS))  # it may be against what was there
    noise = 0.8 * size * rng.uniform(0.2, 1.0) * _at_the_mesh(scene, band_noise(scene, rng), rng)
    return Signature(
        added=(noise,),
        mesh_gains=tuple(gains.tolist()),
        paths_scatter=0.7 * min(size, 1.0) * partly(rng),
        around=0.5 * partly(rng),
        uneven=partly(rng) * _uneven(scene, rng),
    )


def _swing(scene: Scene, order: float, size: float, rng: np.random.Generator) -> FloatArray:
    wave: FloatArray = np.maximum(1.0 + size * tone(order, scene, rng), 0.0)
    return wave


def _modulated(
    scene: Scene, order: float, swings: tuple[float, float], lines: Sequence[float], rng: np.random.Generator
) -> Signature:
    """The mesh swings in size and in phase at an order, which shows with its multiples as lines as well."""
    gain, late = swings
    return Signature(
        _swing(scene, order, 0.8 * gain, rng),
        LARGEST_ADVANCE * min(late, 1.0) / scene.teeth[0] * tone(order, scene, rng),
        tuple(line * tone(n * order, scene, rng) for n, line in enumerate(lines, start=1)),
    )


def _eccentricity(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """Run-out: the mesh swings once per turn in size and phase; the shaft's own line, and its second, may show.

    The gear's mass is off the axis as well, so that the line may be as large as that of an unbalance: the mesh tells.
    """
    order = scene.shaft_orders[draw_side(rng)]
    gain, late = 10.0 ** (-rng.uniform(0.0, 0.9, 2))
    first = float(rng.choice((0.0, 1.0, 1.0))) * 10.0 ** rng.uniform(-1.0, 0.5)
    second = first * rng.uniform(0.0, 0.2)
    return _modulated(scene, order, (gain * size, late * size), (size * first, size * second), rng)


def _unbalance(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A force that turns with the shaft: its line, and hardly a sideband; a large one bends what holds the shaft."""
    order = scene.shaft_orders[draw_side(rng)]
    force = size * 10.0 ** rng.uniform(0.0, 0.8)
    lines = force * np.array([1.5, 0.15 * partly(rng), 0.15 * partly(rng)])
    gain, late = 0.03 * force * rng.uniform(0.0, 1.0, 2)
    return _modulated(scene, order, (gain, late), lines.tolist(), rng)


def _misalignment(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """Two stiffness swings per turn, or a load that wanders along the teeth.

    The shaft's second line, mesh harmonics from the second on, sidebands one and two apart: any of them may lead. The
    contact wanders along the teeth, which are not alike there; forces of a coupling reach one sensor more than another.
    """
    order = scene.shaft_orders[draw_side(rng)]
    lines, bands, mesh = balance(rng, 3)
    first, third = rng.uniform(0.0, 0.7, 2)
    line = size * max(lines, 0.2) * 10.0 ** rng.uniform(0.0, 0.5)
    waves = sum(
        (w * tone(n * order, scene, rng) for n, w in ((1.0, first), (2.0, 1.0), (3.0, third))),
        np.zeros(len(scene.time_s)),
    )
    once, twice = balance(rng, 2)
    swing = _swing(scene, 2.0 * order, bands * twice * size, rng)
    swing = swing * _swing(scene, order, bands * once * size, rng)
    higher = np.append(1.0, np.exp(2.0 * mesh * min(size, 1.0) * np.abs(rng.standard_normal(N_MESH_HARMONICS - 1))))
    return Signature(
        swing,
        None,
        (line * waves,),
        tuple(higher.tolist()),
        paths_scatter=0.7 * min(size, 1.0) * partly(rng),
        around=partly(rng),
        uneven=partly(rng) * _uneven(scene, rng),
    )


def _torque_ripple(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """The drive pulls n times per turn: that line, and sidebands of the mesh so far apart."""
    shaft = scene.shaft_orders[draw_side(rng)]
    pulls = log_uniform(rng, 1.5, 15.0)  # motors and engines pull twice to six times rather than fifteen times
    order = shaft * (float(round(pulls)) if rng.uniform() < 0.75 else pulls)
    gain, late, line = balance(rng, 3)
    return _modulated(scene, order, (gain * size, late * size), (size * max(line, 0.2),), rng)


def _backlash(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """Teeth that part and meet again: blows at the mesh or at its half, scattered in size and time; another mesh."""
    order = scene.teeth[0] * float(rng.choice((0.5, 1.0)))
    at = passings(scene, order, rng.uniform())
    kept = at[rng.uniform(size=len(at)) < rng.uniform(0.3, 1.0)]
    if len(kept) > 1:  # hardly loaded teeth meet when they happen to
        late = float(rng.choice((0.0, 0.5))) * rng.uniform() * float(np.median(np.diff(at)))
        kept = kept + late * rng.uniform(-1.0, 1.0, len(kept))
    sizes = rng.normal(1.0, rng.uniform(0.1, 0.6), len(kept))
    blows = np.zeros(len(scene.time_s))
    for _ in range(int(rng.integers(1, 4))):
        rung = struck(kept, sizes, scene, ring(scene, rng))
        blows += rung / max(float(rung.std()), 1e-12)
    gains = np.exp(1.5 * min(size, 1.0) * partly(rng) * rng.standard_normal(N_MESH_HARMONICS))
    half = 0.5 * size * rng.uniform() * tone(scene.teeth[0] / 2.0, scene, rng)
    restless = np.maximum(1.0 + size * rng.uniform(0.0, 1.5) * _slow_noise(scene, rng), 0.0)
    return Signature(
        gain=restless, added=(2.0 * size * blows, half), mesh_gains=tuple(gains.tolist()), around=partly(rng)
    )


def _slow_noise(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return noise, of unit size, that changes within a fraction of a turn."""
    turns = scene.revolutions[-1] - scene.revolutions[0]
    n = int(turns * rng.uniform(2.0, 0.5 * scene.teeth[0])) + 2
    nodes = np.linspace(scene.revolutions[0], scene.revolutions[-1], n)
    noise: FloatArray = np.interp(scene.revolutions, nodes, rng.standard_normal(n))
    return noise


def _race(scene: Scene, size: float, rng: np.random.Generator, name: str) -> Signature:
    """Knocks when elements pass the defect; on the inner race louder in the load zone, that is once per turn."""
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    order = bearing[name] * float(rng.uniform(0.985, 1.0))
    by = bearing["shaft"] if name == "BPFI" else 0.0
    vibration = knocks(order, log_uniform(rng, 0.001, 0.02), scene, rng, by=by)
    return Signature(added=(1.5 * size * vibration / max(float(vibration.std()), 1e-12),))


def _outer_race(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    return _race(scene, size, rng, "BPFO")


def _inner_race(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    return _race(scene, size, rng, "BPFI")


def _bearing_clearance(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A shaft that is held less: other paths from the mesh to each sensor, lines of elements passing.

    And what loose parts show: many orders of the shaft's turn, their halves, a mesh that swings with it, noise. A
    softer support moves the modes that all comes through, and lets less through at the higher mesh harmonics.
    """
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    mesh, passing, turn, loose = balance(rng, 4)
    turn = max(turn, float(rng.uniform(0.1, 0.5)))  # what tells it from another path
    limited = min(size, 1.0)
    softer = rng.standard_normal() - rng.uniform(0.0, 0.7) * np.arange(N_MESH_HARMONICS)
    gains = np.exp(1.4 * mesh * limited * (rng.standard_normal(N_MESH_HARMONICS) + softer))
    lines = [
        0.4 * passing * size / k * tone(k * bearing["BPFO"] * float(rng.uniform(0.99, 1.0)), scene, rng) for k in (1, 2)
    ]
    fall, halves = float(rng.uniform(0.2, 1.5)), 0.5 * partly(rng)
    lines += [0.4 * turn * size / k**fall * tone(k * bearing["shaft"], scene, rng) for k in range(1, LOOSE_ORDERS + 1)]
    lines += [0.4 * turn * halves * size / k * tone((k - 0.5) * bearing["shaft"], scene, rng) for k in (1, 2, 3)]
    noise = 0.4 * loose * size * _at_the_mesh(scene, band_noise(scene, rng), rng)
    return Signature(
        gain=_swing(scene, bearing["shaft"], 0.5 * turn * partly(rng) * size, rng),
        added=(*lines, noise),
        mesh_gains=tuple(gains.tolist()),
        paths_scatter=1.4 * mesh * limited,
        around=partly(rng),
        uneven=partly(rng) * _uneven(scene, rng),
        paths=draw_path_changes(MOST_CHANNELS, limited * partly(rng), scene.sampling_rate_hz, rng, everywhere=True),
    )


SIGNATURES: dict[str, Callable[[Scene, float, np.random.Generator], Signature]] = {
    "root_crack": root_crack,
    "tooth_spall": tooth_spall,
    "chipped_tooth": chipped_tooth,
    "tooth_wear": _tooth_wear,
    "pitch_error": _pitch_error,
    "surface_roughness": _surface_roughness,
    "sliding_friction": _sliding_friction,
    "eccentricity": _eccentricity,
    "unbalance": _unbalance,
    "misalignment": _misalignment,
    "torque_ripple": _torque_ripple,
    "backlash": _backlash,
    "bearing_outer_race": _outer_race,
    "bearing_inner_race": _inner_race,
    "bearing_clearance": _bearing_clearance,
}
HAND_MADE = (*SIGNATURES, "clipping")
"""Effects that have a signature here; the others are as the simulator makes them."""


def made_by_hand(sound: Recording, torque_nm: float) -> tuple[str, ...]:
    """Return whose signatures are put into a machine's sound recordings: no backlash where teeth never part."""
    light = tooth_load_n_per_mm(rig_of(sound).pairs[0], torque_nm) < LIGHT_LOAD_N_PER_MM
    return tuple(name for name in HAND_MADE if light or name != "backlash")
