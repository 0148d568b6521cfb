"""The catalogue's effects as the literature describes them, put into recordings of healthy machines.

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
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap import LIGHT_LOAD_N_PER_MM, tooth_load_n_per_mm
from gearsig.recording import Recording
from gearsig.rig import Rig
from sims.machine import log_uniform

# --------------------
# What vibration is made of when it is made by hand: rings, knocks, tones, over the angle of a recording's shafts.
# --------------------


_RINGS = 6.0


@dataclass(frozen=True)
class SyntheticScene:
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


def scene_of(recording: Recording) -> SyntheticScene:
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
    return SyntheticScene(
        find_shaft_angle(recording, rig).revolutions_at(time),
        time,
        recording.sampling_rate_hz,
        teeth,
        tuple(bearings),
    )


def ring(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return a housing mode's answer to a knock."""
    rate = scene.sampling_rate_hz
    frequency, damping = log_uniform(rng, 700.0, 0.4 * rate), float(rng.uniform(0.02, 0.1))
    time = np.arange(int(rate * _RINGS / (2 * np.pi * frequency * damping)) + 2) / rate
    answer: FloatArray = np.exp(-2 * np.pi * frequency * damping * time) * np.sin(2 * np.pi * frequency * time)
    return answer


def struck(places: FloatArray, sizes: FloatArray, scene: SyntheticScene, answer: FloatArray) -> FloatArray:
    """Return the answer to knocks at samples `places`."""
    from scipy.signal import oaconvolve

    n = len(scene.time_s)
    force = np.zeros(n)
    np.add.at(force, np.clip(places.astype(np.intp), 0, n - 1), sizes)
    vibration: FloatArray = oaconvolve(force, answer)[:n]
    return vibration


def passings(scene: SyntheticScene, order: float, phase: float = 0.0) -> FloatArray:
    """Return the samples at which revolutions · order + phase passes a whole number."""
    return np.flatnonzero(np.diff(np.floor(scene.revolutions * order + phase)) > 0).astype(np.float64)


def knocks(order: float, jitter: float, scene: SyntheticScene, rng: np.random.Generator, by: float = 0.0) -> FloatArray:
    """Return knocks `order` times per revolution, their size swinging at the order `by`."""
    places = passings(scene, order, rng.uniform())
    if len(places) > 1:
        places += jitter * float(np.median(np.diff(places))) * rng.standard_normal(len(places))
    depth = float(rng.uniform(0.3, 0.9)) if by else 0.0
    swing = 1.0 + depth * np.cos(2 * np.pi * by * scene.revolutions)
    kept = np.clip(places.astype(np.intp), 0, len(scene.time_s) - 1)
    return struck(places, swing[kept] * rng.normal(1.0, 0.1, len(places)), scene, ring(scene, rng))


def tone(order: float, scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return a sine of an order, with any phase."""
    sine: FloatArray = np.sin(2 * np.pi * (order * scene.revolutions + rng.uniform()))
    return sine


def band_noise(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return noise through a housing mode."""
    from scipy.signal import oaconvolve

    noise: FloatArray = oaconvolve(rng.standard_normal(len(scene.time_s)), ring(scene, rng), mode="same")
    return noise


# --------------------
# Paths from the gears to a sensor that have changed: everything that comes through changes with them.
#
# Mesh harmonics, sidebands, teeth and the noise of the machine go through the same path; what the sensor itself adds
# does not. A fault of the flanks changes the mesh and leaves its neighbourhood. So a path is changed behind all that a
# machine does, its tolerances included, and before the sensor's own noise.
#
# Source: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 3 (separation of force and
# path).
# --------------------


MIN_HZ, HIGHEST_OF_RATE = 150.0, 0.45
DAMPING_RATIOS = (0.01, 0.2)
MAX_MODES = 3
PEAK, SHIFT, GAIN = 3.0, 0.3, 0.3
"""Logarithms: by how much a mode is louder or softer at its frequency, how far it moves, what all is multiplied by; at
the largest size, the latter two as standard deviations."""

ONE_CHANNEL_SHARE = 0.4
"""Changes that one sensor alone sees: it came loose; the others are of the housing."""


@dataclass(frozen=True)
class ModeChange:
    """A mode that is louder at its frequency by a factor, and moved from there.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
    factor : float
        At its frequency.
    moved_hz : float
        Where it is now.
    """

    frequency_hz: float
    damping_ratio: float
    factor: float
    moved_hz: float

    def answer(self, frequency_hz: FloatArray) -> np.ndarray:
        """Return by what vibration of each frequency is multiplied, (f0² + 2jAζff0 − f²)/(f1² + 2jζff1 − f²)."""
        f, old, new, zeta = frequency_hz, self.frequency_hz, self.moved_hz, self.damping_ratio
        above = old**2 - f**2 + 2j * zeta * self.factor * f * old
        below = new**2 - f**2 + 2j * zeta * f * new
        found: np.ndarray = above / below * (new / old) ** 2
        return found


@dataclass(frozen=True)
class PathChange:
    """What one channel's path is multiplied by."""

    gain: float = 1.0
    modes: tuple[ModeChange, ...] = ()

    def of(self, values: FloatArray, rate_hz: float) -> FloatArray:
        """Return a vibration as it comes through the changed path."""
        frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
        answer = np.full(len(frequency), self.gain, dtype=np.complex128)
        for mode in self.modes:
            answer *= mode.answer(frequency)
        found: FloatArray = np.fft.irfft(np.fft.rfft(values) * answer, len(values))
        return found


def size_of(strength: float) -> float:
    """Return the size, 0.16 to 1, of a change of a strength from 0 to 1: as many per decade."""
    size: float = 10.0 ** (0.8 * (strength - 1.0))
    return size


def draw_path_changes(
    n_channels: int, size: float, rate_hz: float, rng: np.random.Generator, *, everywhere: bool = False
) -> Sequence[PathChange]:
    """Draw each channel's change, of size 0 to 1; modes of a housing are the same for all, their shares are not.

    Unless it is everywhere, one channel alone may change.
    """
    places = [
        (log_uniform(rng, MIN_HZ, HIGHEST_OF_RATE * rate_hz), log_uniform(rng, *DAMPING_RATIOS))
        for _ in range(int(rng.integers(1, MAX_MODES + 1)))
    ]
    shifts = np.exp(SHIFT * size * rng.standard_normal(len(places)))
    only = int(rng.integers(n_channels)) if not everywhere and rng.uniform() < ONE_CHANNEL_SHARE else None
    found = []
    for i in range(n_channels):
        modes = tuple(
            ModeChange(f, zeta, float(np.exp(PEAK * size * rng.uniform(-1.0, 1.0))), min(f * shift, 0.49 * rate_hz))
            for (f, zeta), shift in zip(places, shifts.tolist(), strict=True)
        )
        gain = float(np.exp(GAIN * size * rng.standard_normal()))
        found.append(PathChange() if only not in (None, i) else PathChange(gain, modes))
    return found


# --------------------
# What an effect does to a vibration: modulation, advance, mesh harmonics with what surrounds them, what is added.
# --------------------


N_MESH_HARMONICS = 6
MIN_MESH_ORDER = 0.3
"""Mesh orders below which nothing goes with the mesh."""


@dataclass(frozen=True)
class Signature:
    """What an effect does to every vibration channel: y(t) = m(t) x(t + τ(t)) + Σ of what is added.

    Parameters
    ----------
    gain : array, (n,), or None
        m, of the whole vibration.
    advance_rev : array, (n,), or None
        τ, in revolutions of the driver.
    added : tuple of arrays, (n,)
        In standard deviations of the channel.
    mesh_gains : tuple of float
        By which the mesh harmonics are multiplied.
    paths_scatter : float
        Standard deviation of the logarithm of what each channel's own mesh gains differ by.
    around : float
        How far sidebands and noise about a mesh harmonic change with it, 0 to 1: a force that grows takes what
        modulates it along.
    uneven : array, (n,), or None
        By which share the change of the harmonics is larger at some teeth than at others.
    paths : sequence of PathChange
        Of each channel, for all that was there before; none: they are as ever.
    """

    gain: FloatArray | None = None
    advance_rev: FloatArray | None = None
    added: tuple[FloatArray, ...] = ()
    mesh_gains: tuple[float, ...] = ()
    paths_scatter: float = 0.0
    around: float = 0.0
    uneven: FloatArray | None = None
    paths: Sequence[PathChange] = ()


def vibrations(recording: Recording) -> list[int]:
    """Return the rows of a recording that hold vibration."""
    return [i for i, channel in enumerate(recording.channels) if channel.is_vibration]


def changed(
    values: FloatArray,
    signature: Signature,
    scene: SyntheticScene,
    rng: np.random.Generator,
    size: float,
    channel: int = 0,
) -> FloatArray:
    """Return one channel with an effect's signature; what is added is in units of `size`."""
    if signature.paths:
        values = signature.paths[channel].of(values, scene.sampling_rate_hz)
    found = values
    if signature.advance_rev is not None:
        speed = np.gradient(scene.revolutions, scene.time_s)
        found = _at(found, signature.advance_rev / speed * scene.sampling_rate_hz)
    if signature.gain is not None:
        found = found * (1.0 + (signature.gain - 1.0) * rng.uniform(0.5, 1.0))
    if signature.mesh_gains:
        own = np.exp(signature.paths_scatter * rng.standard_normal(len(signature.mesh_gains)))
        found = found + _gears_change(values, np.array(signature.mesh_gains) * own, signature, scene)
    for added in signature.added:
        found = found + added * size * rng.uniform(0.3, 1.0)
    return found


def _at(values: FloatArray, advance_samples: FloatArray) -> FloatArray:
    from scipy.ndimage import map_coordinates

    moved: FloatArray = map_coordinates(values, [np.arange(len(values)) + advance_samples], order=3, mode="nearest")
    return moved


def _gears_change(values: FloatArray, gains: FloatArray, signature: Signature, scene: SyntheticScene) -> FloatArray:
    """Return what must be added for the mesh harmonics, and what surrounds them, to be larger."""
    around = gains**signature.around
    wide = _about_the_mesh(values, around, scene) if signature.around else values
    change = _mesh_change(wide, gains / around, scene)
    return wide - values + (change if signature.uneven is None else change * (1.0 + signature.uneven))


def _about_the_mesh(values: FloatArray, gains: FloatArray, scene: SyntheticScene) -> FloatArray:
    """Return a vibration with each stretch about a mesh harmonic `gains` times as large; shaft lines as they are."""
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_orders = np.fft.rfftfreq(len(values), 1.0 / scene.sampling_rate_hz) / (turns_hz * scene.teeth[0])
    logs = np.interp(mesh_orders, [MIN_MESH_ORDER, *range(1, len(gains) + 1)], [0.0, *np.log(gains)])
    found: FloatArray = np.fft.irfft(np.fft.rfft(values) * np.exp(logs), len(values))
    return found


def _mesh_change(values: FloatArray, gains: FloatArray, scene: SyntheticScene) -> FloatArray:
    """Return what must be added for the mesh harmonics to be `gains` times as large."""
    change = np.zeros_like(values)
    for k, gain in enumerate(gains, start=1):
        wave = np.exp(2j * np.pi * k * scene.teeth[0] * scene.revolutions)
        change += (gain - 1.0) * 2.0 * np.real(np.mean(values * np.conj(wave)) * wave)
    return change


# --------------------
# What is drawn of a signature: sides, signs, balances, shares.
# --------------------


MAX_ADVANCE = 0.35
"""Of a mesh period, by which a tooth comes too early or too late."""


def draw_side(rng: np.random.Generator) -> int:
    """Return 0, driver, or 1, driven gear."""
    return int(rng.integers(2))


def sign(rng: np.random.Generator) -> float:
    """Return 1 or −1."""
    return float(rng.choice((-1.0, 1.0)))


def balance(rng: np.random.Generator, n: int) -> FloatArray:
    """Return n weights, the largest 1, any of the others nearly nothing."""
    weights = 10.0 ** (-rng.uniform(0.0, 1.5, n))
    weights[rng.uniform(size=n) < 0.25] = 0.0
    weights[int(rng.integers(n))] = 1.0
    found: FloatArray = weights
    return found


def steeply(rng: np.random.Generator) -> FloatArray:
    """Return shares of the mesh harmonics that fall with their number, from nearly not to steeply."""
    shares: FloatArray = np.arange(1.0, N_MESH_HARMONICS + 1.0) ** -rng.uniform(0.2, 2.0)
    return shares


def partly(rng: np.random.Generator) -> float:
    """Return 0, 1 or anything between."""
    return float(np.clip(rng.uniform(-0.5, 1.5), 0.0, 1.0))


# --------------------
# Signatures of one damaged tooth, see `app.studies.gap.signatures`.
# --------------------


def _tooth_window(
    scene: SyntheticScene, side: int, width_teeth: float, rng: np.random.Generator
) -> tuple[FloatArray, float]:
    """Return 1 in the middle of one tooth's mesh, 0 away from it, and that tooth's place in revolutions."""
    place, teeth = float(rng.uniform()), scene.teeth[side]
    off = (scene.revolutions * scene.shaft_orders[side] - place + 0.5) % 1.0 - 0.5
    reach = np.clip(off * teeth / width_teeth, -1.0, 1.0)
    window: FloatArray = 0.5 + 0.5 * np.cos(np.pi * reach)
    return window, place


def _tooth_knocks(
    scene: SyntheticScene, side: int, place: float, scatter: float, rng: np.random.Generator, of: int = 1
) -> FloatArray:
    """Return knocks when a tooth meshes, `of` of them a fraction of a pitch apart, in standard deviations at most 1."""
    answer, order, total = ring(scene, rng), scene.shaft_orders[side], np.zeros(len(scene.time_s))
    for _ in range(of):
        at = passings(scene, order, -place - float(rng.uniform(0.0, 0.7)) / scene.teeth[side])
        total += struck(at, np.maximum(rng.normal(1.0, scatter, len(at)), 0.0) * sign(rng), scene, answer)
    return total / max(float(np.abs(total).max()), 1e-12)


def root_crack(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """A softer tooth: it comes late and gives way while it carries, slower than the mesh; the mesh swings on.

    A deep crack lets the next tooth strike.
    """
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.8, 2.0)), rng)
    gain, late = rng.uniform(0.0, 1.0, 2)
    blow, slow = balance(rng, 2) * (4.0, 2.0)
    knock = _tooth_knocks(scene, side, place, 0.03, rng)
    giving_way = np.gradient(np.gradient(window))
    giving_way /= max(float(np.abs(giving_way).max()), 1e-12)
    return Signature(
        _swollen(sign(rng) * gain * size, window),
        _late(scene, late * size, window, rng),
        (blow * size * knock, slow * size * giving_way),
    )


def _swollen(share: float, window: FloatArray) -> FloatArray:
    swollen: FloatArray = np.maximum(1.0 + share * window, 0.0)
    return swollen


def _late(scene: SyntheticScene, share: float, window: FloatArray, rng: np.random.Generator) -> FloatArray:
    late: FloatArray = sign(rng) * MAX_ADVANCE * min(share, 1.0) / scene.teeth[0] * window
    return late


def tooth_spall(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """A pit: short blows when the flank enters and leaves it, different each time; the mesh hardly notices."""
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.3, 0.8)), rng)
    blows = _tooth_knocks(scene, side, place, float(rng.uniform(0.05, 0.4)), rng, of=2)
    return Signature(_swollen(sign(rng) * 0.4 * size * rng.uniform(), window), None, (4.0 * size * blows,))


def chipped_tooth(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """A missing corner: load is lost, the next tooth takes it with a blow."""
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.5, 1.2)), rng)
    blow = _tooth_knocks(scene, side, place, 0.08, rng)
    return Signature(
        _swollen(sign(rng) * size * rng.uniform(0.3, 1.2), window),
        _late(scene, size * rng.uniform(0.3, 1.2), window, rng),
        (4.0 * size * 10.0 ** -rng.uniform(0.0, 0.7) * blow,),
    )


SIZES = (0.06, 2.5)
"""Of a signature: from what nobody sees to several floors. Effects reach about as far as each other; where one ended
before its look-alikes do, whatever is large would be one of those."""

MAX_CHANNELS = 2
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


def _uneven(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return what differs from tooth to tooth of both gears, of unit size."""
    total = np.zeros(len(scene.time_s))
    for side, weight in zip((0, 1), rng.uniform(0.0, 1.0, 2), strict=True):
        teeth = scene.teeth[side]
        own = rng.standard_normal(teeth)
        place = scene.revolutions * scene.shaft_orders[side] * teeth % teeth
        total += weight * np.interp(place, np.arange(teeth + 1), np.append(own, own[0]))
    return np.clip(total, -2.5, 2.5)


def _tooth_wear(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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


def _at_the_mesh(scene: SyntheticScene, noise: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return noise, of unit size, that swells with the mesh more or less."""
    swelling = 1.0 + rng.uniform(0.0, 0.9) * np.cos(2 * np.pi * scene.teeth[0] * scene.revolutions)
    found: FloatArray = noise / max(float(noise.std()), 1e-12) * swelling
    return found


def _pitch_error(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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
        0.3 * MAX_ADVANCE * min(at * size, 1.0) / scene.teeth[0] * np.clip(early, -2.5, 2.5),
        (0.5 * slow * size * low,),
    )


def _surface_roughness(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Asperities that slide over each other: noise, in bands, more or less with the mesh."""
    loose, locked = balance(rng, 2)
    total = sum(
        (_at_the_mesh(scene, band_noise(scene, rng), rng) * rng.uniform(0.3, 1.0) for _ in range(3)),
        np.zeros(len(scene.time_s)),
    )
    sides = [_born_with(scene, side, rng) * rng.uniform(0.0, 1.0) for side in (0, 1)]
    return Signature(added=(0.8 * size * loose * total, 0.8 * size * locked * (sides[0] + sides[1])))


def _born_with(scene: SyntheticScene, side: int, rng: np.random.Generator) -> FloatArray:
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


def _sliding_friction(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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


def _swing(scene: SyntheticScene, order: float, size: float, rng: np.random.Generator) -> FloatArray:
    wave: FloatArray = np.maximum(1.0 + size * tone(order, scene, rng), 0.0)
    return wave


def _modulated(
    scene: SyntheticScene, order: float, swings: tuple[float, float], lines: Sequence[float], rng: np.random.Generator
) -> Signature:
    """The mesh swings in size and in phase at an order, which shows with its multiples as lines as well."""
    gain, late = swings
    return Signature(
        _swing(scene, order, 0.8 * gain, rng),
        MAX_ADVANCE * min(late, 1.0) / scene.teeth[0] * tone(order, scene, rng),
        tuple(line * tone(n * order, scene, rng) for n, line in enumerate(lines, start=1)),
    )


def _eccentricity(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Run-out: the mesh swings once per turn in size and phase; the shaft's own line, and its second, may show.

    The gear's mass is off the axis as well, so that the line may be as large as that of an unbalance: the mesh tells.
    """
    order = scene.shaft_orders[draw_side(rng)]
    gain, late = 10.0 ** (-rng.uniform(0.0, 0.9, 2))
    first = float(rng.choice((0.0, 1.0, 1.0))) * 10.0 ** rng.uniform(-1.0, 0.5)
    second = first * rng.uniform(0.0, 0.2)
    return _modulated(scene, order, (gain * size, late * size), (size * first, size * second), rng)


def _unbalance(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """A force that turns with the shaft: its line, and hardly a sideband; a large one bends what holds the shaft."""
    order = scene.shaft_orders[draw_side(rng)]
    force = size * 10.0 ** rng.uniform(0.0, 0.8)
    lines = force * np.array([1.5, 0.15 * partly(rng), 0.15 * partly(rng)])
    gain, late = 0.03 * force * rng.uniform(0.0, 1.0, 2)
    return _modulated(scene, order, (gain, late), lines.tolist(), rng)


def _misalignment(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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


def _torque_ripple(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """The drive pulls n times per turn: that line, and sidebands of the mesh so far apart."""
    shaft = scene.shaft_orders[draw_side(rng)]
    pulls = log_uniform(rng, 1.5, 15.0)  # motors and engines pull twice to six times rather than fifteen times
    order = shaft * (float(round(pulls)) if rng.uniform() < 0.75 else pulls)
    gain, late, line = balance(rng, 3)
    return _modulated(scene, order, (gain * size, late * size), (size * max(line, 0.2),), rng)


def _backlash(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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


def _slow_noise(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return noise, of unit size, that changes within a fraction of a turn."""
    turns = scene.revolutions[-1] - scene.revolutions[0]
    n = int(turns * rng.uniform(2.0, 0.5 * scene.teeth[0])) + 2
    nodes = np.linspace(scene.revolutions[0], scene.revolutions[-1], n)
    noise: FloatArray = np.interp(scene.revolutions, nodes, rng.standard_normal(n))
    return noise


def _race(scene: SyntheticScene, size: float, rng: np.random.Generator, name: str) -> Signature:
    """Knocks when elements pass the defect; on the inner race louder in the load zone, that is once per turn."""
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    order = bearing[name] * float(rng.uniform(0.985, 1.0))
    by = bearing["shaft"] if name == "BPFI" else 0.0
    vibration = knocks(order, log_uniform(rng, 0.001, 0.02), scene, rng, by=by)
    return Signature(added=(1.5 * size * vibration / max(float(vibration.std()), 1e-12),))


def _outer_race(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    return _race(scene, size, rng, "BPFO")


def _inner_race(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    return _race(scene, size, rng, "BPFI")


def _bearing_clearance(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
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
        paths=draw_path_changes(MAX_CHANNELS, limited * partly(rng), scene.sampling_rate_hz, rng, everywhere=True),
    )


SIGNATURES: dict[str, Callable[[SyntheticScene, float, np.random.Generator], Signature]] = {
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


def made_by_hand(healthy: Recording, torque_nm: float) -> tuple[str, ...]:
    """Return whose signatures are put into a machine's healthy recordings: no backlash where teeth never part."""
    light = tooth_load_n_per_mm(rig_of(healthy).pairs[0], torque_nm) < LIGHT_LOAD_N_PER_MM
    return tuple(name for name in HAND_MADE if light or name != "backlash")
