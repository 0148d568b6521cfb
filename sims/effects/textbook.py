"""Signatures of effects in the literature: signs in the features of a diagnosis, and synthetic vibration.

A simulator shows each effect in one way, with one balance between its lines, sidebands and noise. Machines, and other
simulators, agree on the signature but not on that balance: where run-out modulates the mesh in one, it shows as a shaft
line in another. Each effect therefore also draws its signature with a different balance every time, and a classifier
trained on recordings with added signatures learns what the balances have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from sims.machine import log_uniform

UP, DOWN, EITHER = 1, -1, 0

HANDBOOKS = (
    "R. B. Randall, Vibration-based Condition Monitoring, 2nd ed., 2021, chapters 2, 5, 6 and 7; ISO 13373-2:2016, "
    "annexes"
)
"""Which most of how effects show is from."""


@dataclass(frozen=True)
class Textbook:
    """The signature of an effect in the literature.

    Parameters
    ----------
    signs : tuple of (str, int)
        Features of `gearsig.gap` that rise (`UP`), fall (`DOWN`) or change (`EITHER`); ``{side}`` is driver or driven,
        whichever shows more.
    words : str
        The same in the words of the literature.
    draw : callable or None
        (scene, size, rng) → `Signature` with a drawn balance; its size is within `SIZES`. None: no synthetic recording
        is made, as the simulators show the effect completely.
    source : str
        Of the ways in which it shows: in addition to the handbooks, or these alone.
    """

    signs: tuple[tuple[str, int], ...]
    words: str
    draw: Callable[[SyntheticScene, float, np.random.Generator], Signature] | None = None
    source: str = HANDBOOKS


# --------------------
# Components of synthetic vibration: ringing, impacts and tones over the shaft angles of a recording.
# --------------------


@dataclass(frozen=True)
class SyntheticScene:
    """The recording for which synthetic vibration is made.

    Parameters
    ----------
    revolutions : array, (n,)
        Of the driver at each sample.
    time_s : array, (n,)
    sampling_rate_hz : float
    teeth : (int, int)
    bearings : tuple of mapping
        Orders BPFO, BPFI, BSF, FTF of each bearing, in cycles per revolution of the driver; and "shaft", the order of
        its shaft.
    n_channels : int
        Number of vibration channels.
    """

    revolutions: FloatArray
    time_s: FloatArray
    sampling_rate_hz: float
    teeth: tuple[int, int]
    bearings: tuple[dict[str, float], ...]
    n_channels: int = 2

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of each shaft per revolution of the driver."""
        return 1.0, self.teeth[0] / self.teeth[1]


def ring(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return the impulse response of a random housing mode."""
    rate = scene.sampling_rate_hz
    frequency, damping = log_uniform(rng, 700.0, 0.4 * rate), float(rng.uniform(0.02, 0.1))
    time = np.arange(int(rate * 6.0 / (2 * np.pi * frequency * damping)) + 2) / rate
    return np.asarray(np.exp(-2 * np.pi * frequency * damping * time) * np.sin(2 * np.pi * frequency * time))


def struck(places: FloatArray, sizes: FloatArray, scene: SyntheticScene, answer: FloatArray) -> FloatArray:
    """Return the response `answer` to impacts of the given sizes at samples `places`."""
    from scipy.signal import oaconvolve

    n = len(scene.time_s)
    force = np.zeros(n)
    np.add.at(force, np.clip(places.astype(np.intp), 0, n - 1), sizes)
    return np.asarray(oaconvolve(force, answer)[:n])


def passings(scene: SyntheticScene, order: float, phase: float = 0.0) -> FloatArray:
    """Return the samples at which revolutions · order + phase passes an integer."""
    return np.flatnonzero(np.diff(np.floor(scene.revolutions * order + phase)) > 0).astype(np.float64)


def impact_train(
    order: float, jitter: float, scene: SyntheticScene, rng: np.random.Generator, by: float = 0.0
) -> FloatArray:
    """Return impacts `order` times per revolution, amplitude-modulated at the order `by`."""
    places = passings(scene, order, rng.uniform())
    if len(places) > 1:
        places += jitter * float(np.median(np.diff(places))) * rng.standard_normal(len(places))
    depth = float(rng.uniform(0.3, 0.9)) if by else 0.0
    swing = 1.0 + depth * np.cos(2 * np.pi * by * scene.revolutions)
    kept = np.clip(places.astype(np.intp), 0, len(scene.time_s) - 1)
    return struck(places, swing[kept] * rng.normal(1.0, 0.1, len(places)), scene, ring(scene, rng))


def tone(order: float, scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return a sine of an order, with random phase."""
    return np.asarray(np.sin(2 * np.pi * (order * scene.revolutions + rng.uniform())))


def band_noise(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return noise filtered by a random housing mode."""
    from scipy.signal import oaconvolve

    return np.asarray(oaconvolve(rng.standard_normal(len(scene.time_s)), ring(scene, rng), mode="same"))


# --------------------
# Changes of the transfer path from the gears to a sensor.
#
# Mesh harmonics, sidebands, single teeth and the noise of the machine pass through the same path; the sensor's own
# noise does not. A flank fault changes the mesh but not its neighbourhood. A path change therefore applies to
# everything the machine does, its tolerances included, but not to the sensor's own noise.
#
# Source: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 3 (separation of force and
# path).
# --------------------


@dataclass(frozen=True)
class ModeChange:
    """A mode whose amplitude changes by a factor and whose frequency shifts.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
    factor : float
        At its frequency.
    moved_hz : float
        Its new frequency.
    """

    frequency_hz: float
    damping_ratio: float
    factor: float
    moved_hz: float

    def answer(self, frequency_hz: FloatArray) -> np.ndarray:
        """Return the factor on vibration of each frequency, (f0² + 2jAζff0 − f²)/(f1² + 2jζff1 − f²) · (f1/f0)²."""
        f, old, new, zeta = frequency_hz, self.frequency_hz, self.moved_hz, self.damping_ratio
        above = old**2 - f**2 + 2j * zeta * self.factor * f * old
        below = new**2 - f**2 + 2j * zeta * f * new
        return np.asarray(above / below * (new / old) ** 2)


@dataclass(frozen=True)
class PathChange:
    """Change of one channel's transfer path: a gain and modes."""

    gain: float = 1.0
    modes: tuple[ModeChange, ...] = ()

    def of(self, values: FloatArray, rate_hz: float) -> FloatArray:
        """Return a vibration after the changed path."""
        frequency = np.fft.rfftfreq(len(values), 1.0 / rate_hz)
        answer = np.full(len(frequency), self.gain, dtype=np.complex128)
        for mode in self.modes:
            answer *= mode.answer(frequency)
        return np.asarray(np.fft.irfft(np.fft.rfft(values) * answer, len(values)))


def path_size(strength: float) -> float:
    """Return the size, 0.16 to 1, of a change of strength 0 to 1; log-uniform if the strength is uniform."""
    return float(10.0 ** (0.8 * (strength - 1.0)))


def draw_path_changes(
    n_channels: int, size: float, rate_hz: float, rng: np.random.Generator, *, everywhere: bool = False
) -> Sequence[PathChange]:
    """Draw each channel's path change, of size 0 to 1; the housing modes are common to all, their factors are not.

    In natural logarithms, at size 1: a mode's factor is within ±3; mode frequencies and channel gains change with a
    standard deviation of 0.3. Unless `everywhere`, two changes in five affect a single sensor, which came loose.
    """
    modes = [
        (log_uniform(rng, 150.0, 0.45 * rate_hz), log_uniform(rng, 0.01, 0.2)) for _ in range(int(rng.integers(1, 4)))
    ]
    shifts = np.exp(0.3 * size * rng.standard_normal(len(modes))).tolist()
    only = int(rng.integers(n_channels)) if not everywhere and rng.uniform() < 0.4 else None
    changes = []
    for i in range(n_channels):
        changed = tuple(
            ModeChange(f, zeta, float(np.exp(3.0 * size * rng.uniform(-1.0, 1.0))), min(f * shift, 0.49 * rate_hz))
            for (f, zeta), shift in zip(modes, shifts, strict=True)
        )
        gain = float(np.exp(0.3 * size * rng.standard_normal()))
        changes.append(PathChange() if only not in (None, i) else PathChange(gain, changed))
    return changes


# --------------------
# What an effect does to a vibration: modulation, advance, change of mesh harmonics and their surroundings, additions.
# --------------------


N_MESH_HARMONICS = 6


@dataclass(frozen=True)
class Signature:
    """What an effect does to every vibration channel: y(t) = m(t) x(t + τ(t)) + Σ of the added signals.

    Parameters
    ----------
    gain : array, (n,), or None
        m, of the whole vibration.
    advance_rev : array, (n,), or None
        τ, in revolutions of the driver.
    added : tuple of arrays, (n,)
        In standard deviations of the channel.
    mesh_gains : tuple of float
        Factors on the mesh harmonics.
    paths_scatter : float
        Standard deviation of the logarithm of each channel's own factors on the mesh harmonics.
    around : float
        How far sidebands and noise about a mesh harmonic change with it, 0 to 1: the modulation of a force grows with
        the force.
    uneven : array, (n,), or None
        Relative variation from tooth to tooth of the change of the harmonics.
    paths : sequence of PathChange
        For each channel, applied to the original vibration; empty: unchanged.
    cut_share : float
        Fraction of the samples that are beyond the sensor's range.
    """

    gain: FloatArray | None = None
    advance_rev: FloatArray | None = None
    added: tuple[FloatArray, ...] = ()
    mesh_gains: tuple[float, ...] = ()
    paths_scatter: float = 0.0
    around: float = 0.0
    uneven: FloatArray | None = None
    paths: Sequence[PathChange] = ()
    cut_share: float = 0.0

    def on(
        self, values: FloatArray, scene: SyntheticScene, rng: np.random.Generator, size: float, channel: int = 0
    ) -> FloatArray:
        """Return one channel with the signature; `size` scales the added signals."""
        if self.paths:
            values = self.paths[channel].of(values, scene.sampling_rate_hz)
        shown = values
        if self.advance_rev is not None:
            speed = np.gradient(scene.revolutions, scene.time_s)
            shown = _at(shown, self.advance_rev / speed * scene.sampling_rate_hz)
        if self.gain is not None:
            shown = shown * (1.0 + (self.gain - 1.0) * rng.uniform(0.5, 1.0))
        if self.mesh_gains:
            of_channel = np.exp(self.paths_scatter * rng.standard_normal(len(self.mesh_gains)))
            shown = shown + _gears_change(values, np.array(self.mesh_gains) * of_channel, self, scene)
        for added in self.added:
            shown = shown + added * size * rng.uniform(0.3, 1.0)
        return _cut(shown, self.cut_share, rng) if self.cut_share else shown


def _cut(values: FloatArray, share: float, rng: np.random.Generator) -> FloatArray:
    """Return a channel with its extreme samples clipped, at equal shares on both sides or at one level."""
    if rng.uniform() < 0.5:
        low, high = np.quantile(values, (share / 2.0, 1.0 - share / 2.0))
    else:
        high = np.quantile(np.abs(values), 1.0 - share)
        low = -high
    return np.asarray(np.clip(values, low, high))


def _at(values: FloatArray, advance_samples: FloatArray) -> FloatArray:
    from scipy.ndimage import map_coordinates

    return np.asarray(map_coordinates(values, [np.arange(len(values)) + advance_samples], order=3, mode="nearest"))


def _gears_change(values: FloatArray, gains: FloatArray, signature: Signature, scene: SyntheticScene) -> FloatArray:
    """Return the change of the mesh harmonics and their surroundings, to be added to the vibration."""
    around = gains**signature.around
    wide = _about_the_mesh(values, around, scene) if signature.around else values
    change = _mesh_change(wide, gains / around, scene)
    return wide - values + (change if signature.uneven is None else change * (1.0 + signature.uneven))


def _about_the_mesh(values: FloatArray, gains: FloatArray, scene: SyntheticScene) -> FloatArray:
    """Return a vibration with the spectrum about each mesh harmonic multiplied by `gains`, shaft lines unchanged."""
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_orders = np.fft.rfftfreq(len(values), 1.0 / scene.sampling_rate_hz) / (turns_hz * scene.teeth[0])
    logs = np.interp(mesh_orders, [0.3, *range(1, len(gains) + 1)], [0.0, *np.log(gains)])
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * np.exp(logs), len(values)))


def _mesh_change(values: FloatArray, gains: FloatArray, scene: SyntheticScene) -> FloatArray:
    """Return the signal that multiplies the mesh harmonics by `gains` when added."""
    change = np.zeros_like(values)
    for k, gain in enumerate(gains, start=1):
        wave = np.exp(2j * np.pi * k * scene.teeth[0] * scene.revolutions)
        change += (gain - 1.0) * 2.0 * np.real(np.mean(values * np.conj(wave)) * wave)
    return change


# --------------------
# Random parts of a signature (sides, signs, balances, shares), and parts common to several effects.
# --------------------


MAX_ADVANCE = 0.35
"""Maximum shift of a tooth's engagement, in mesh periods."""

SIZES = (0.06, 2.5)
"""Sizes of a signature, from invisible to several times the noise floor. The range is similar for all effects: if one
ended earlier than its look-alikes, every large change would be attributed to those."""


def draw_side(rng: np.random.Generator) -> int:
    """Return 0 (driver) or 1 (driven gear) at random."""
    return int(rng.integers(2))


def sign(rng: np.random.Generator) -> float:
    """Return 1 or −1 at random."""
    return float(rng.choice((-1.0, 1.0)))


def balance(rng: np.random.Generator, n: int) -> FloatArray:
    """Return n random weights, the largest 1, each of the others possibly near or at 0."""
    weights = 10.0 ** (-rng.uniform(0.0, 1.5, n))
    weights[rng.uniform(size=n) < 0.25] = 0.0
    weights[int(rng.integers(n))] = 1.0
    return np.asarray(weights)


def steeply(rng: np.random.Generator) -> FloatArray:
    """Return shares of the mesh harmonics that decrease with their number, slightly to steeply."""
    return np.asarray(np.arange(1.0, N_MESH_HARMONICS + 1.0) ** -rng.uniform(0.2, 2.0))


def partly(rng: np.random.Generator) -> float:
    """Return 0, 1 or a random number between."""
    return float(np.clip(rng.uniform(-0.5, 1.5), 0.0, 1.0))


def tooth_window(
    scene: SyntheticScene, side: int, width_teeth: float, rng: np.random.Generator
) -> tuple[FloatArray, float]:
    """Return a window, 1 in the middle of a random tooth's mesh and 0 away from it, and its place in revolutions."""
    place, teeth = float(rng.uniform()), scene.teeth[side]
    off = (scene.revolutions * scene.shaft_orders[side] - place + 0.5) % 1.0 - 0.5
    reach = np.clip(off * teeth / width_teeth, -1.0, 1.0)
    window: FloatArray = 0.5 + 0.5 * np.cos(np.pi * reach)
    return window, place


def tooth_impacts(
    scene: SyntheticScene, side: int, place: float, scatter: float, rng: np.random.Generator, of: int = 1
) -> FloatArray:
    """Return impacts when a tooth meshes, `of` of them a fraction of a pitch apart, with a peak of 1."""
    answer, order, total = ring(scene, rng), scene.shaft_orders[side], np.zeros(len(scene.time_s))
    for _ in range(of):
        at = passings(scene, order, -place - float(rng.uniform(0.0, 0.7)) / scene.teeth[side])
        total += struck(at, np.maximum(rng.normal(1.0, scatter, len(at)), 0.0) * sign(rng), scene, answer)
    return total / max(float(np.abs(total).max()), 1e-12)


def swollen(share: float, window: FloatArray) -> FloatArray:
    """Return a gain that is increased by `share` where the window is 1."""
    return np.asarray(np.maximum(1.0 + share * window, 0.0))


def late_tooth(scene: SyntheticScene, share: float, window: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the advance, in revolutions, of a tooth that is late or early by a share of `MAX_ADVANCE`."""
    return np.asarray(sign(rng) * MAX_ADVANCE * min(share, 1.0) / scene.teeth[0] * window)


def over_teeth(scene: SyntheticScene, side: int, of_teeth: FloatArray) -> FloatArray:
    """Return values per tooth of a gear over the angle: each tooth's at its mesh, linear in between."""
    teeth = scene.teeth[side]
    place = scene.revolutions * scene.shaft_orders[side] * teeth % teeth
    return np.asarray(np.interp(place, np.arange(teeth + 1), np.append(of_teeth, of_teeth[0])))


def uneven(scene: SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return a random variation from tooth to tooth of both gears, of unit size."""
    total = np.zeros(len(scene.time_s))
    for side, weight in zip((0, 1), rng.uniform(0.0, 1.0, 2), strict=True):
        of_teeth = rng.standard_normal(scene.teeth[side])
        total += weight * over_teeth(scene, side, of_teeth)
    return np.clip(total, -2.5, 2.5)


def at_the_mesh(scene: SyntheticScene, noise: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return noise of unit size, more or less modulated by the mesh."""
    swelling = 1.0 + rng.uniform(0.0, 0.9) * np.cos(2 * np.pi * scene.teeth[0] * scene.revolutions)
    return np.asarray(noise / max(float(noise.std()), 1e-12) * swelling)


def swing(scene: SyntheticScene, order: float, size: float, rng: np.random.Generator) -> FloatArray:
    """Return a gain modulated at an order."""
    return np.asarray(np.maximum(1.0 + size * tone(order, scene, rng), 0.0))


def mesh_louder(
    scene: SyntheticScene, gains: FloatArray, noise: FloatArray, scatter: float, rng: np.random.Generator
) -> Signature:
    """Larger mesh harmonics and surroundings, with `scatter` in logarithms between paths, and added noise."""
    return Signature(
        added=(noise,),
        mesh_gains=tuple(gains.tolist()),
        paths_scatter=scatter * partly(rng),
        around=0.5 * partly(rng),
        uneven=partly(rng) * uneven(scene, rng),
    )


def modulated(
    scene: SyntheticScene, order: float, swings: tuple[float, float], lines: Sequence[float], rng: np.random.Generator
) -> Signature:
    """Amplitude and phase modulation of the mesh at an order, with lines at that order and its multiples."""
    gain, late = swings
    return Signature(
        swing(scene, order, 0.8 * gain, rng),
        MAX_ADVANCE * min(late, 1.0) / scene.teeth[0] * tone(order, scene, rng),
        tuple(line * tone(n * order, scene, rng) for n, line in enumerate(lines, start=1)),
    )


def race_impacts(scene: SyntheticScene, size: float, rng: np.random.Generator, name: str) -> Signature:
    """Impacts when elements pass the defect; on the inner race louder in the load zone, so once per revolution."""
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    order = bearing[name] * float(rng.uniform(0.985, 1.0))
    by = bearing["shaft"] if name == "BPFI" else 0.0
    vibration = impact_train(order, log_uniform(rng, 0.001, 0.02), scene, rng, by=by)
    return Signature(added=(1.5 * size * vibration / max(float(vibration.std()), 1e-12),))
