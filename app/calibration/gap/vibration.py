"""What an effect does to a vibration: modulation, advance, mesh harmonics with what surrounds them, what is added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.calibration.gap.paths import PathChange
from app.calibration.gap.scene import Scene
from gearsig.checks import FloatArray
from gearsig.recording.types import Recording

N_MESH_HARMONICS = 6
LOWEST_ABOUT_MESH = 0.3
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
    values: FloatArray, signature: Signature, scene: Scene, rng: np.random.Generator, size: float, channel: int = 0
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


def _gears_change(values: FloatArray, gains: FloatArray, signature: Signature, scene: Scene) -> FloatArray:
    """Return what must be added for the mesh harmonics, and what surrounds them, to be larger."""
    around = gains**signature.around
    wide = _about_the_mesh(values, around, scene) if signature.around else values
    change = _mesh_change(wide, gains / around, scene)
    return wide - values + (change if signature.uneven is None else change * (1.0 + signature.uneven))


def _about_the_mesh(values: FloatArray, gains: FloatArray, scene: Scene) -> FloatArray:
    """Return a vibration with each stretch about a mesh harmonic `gains` times as large; shaft lines as they are."""
    turns_hz = (scene.revolutions[-1] - scene.revolutions[0]) / (scene.time_s[-1] - scene.time_s[0])
    mesh_orders = np.fft.rfftfreq(len(values), 1.0 / scene.sampling_rate_hz) / (turns_hz * scene.teeth[0])
    logs = np.interp(mesh_orders, [LOWEST_ABOUT_MESH, *range(1, len(gains) + 1)], [0.0, *np.log(gains)])
    found: FloatArray = np.fft.irfft(np.fft.rfft(values) * np.exp(logs), len(values))
    return found


def _mesh_change(values: FloatArray, gains: FloatArray, scene: Scene) -> FloatArray:
    """Return what must be added for the mesh harmonics to be `gains` times as large."""
    change = np.zeros_like(values)
    for k, gain in enumerate(gains, start=1):
        wave = np.exp(2j * np.pi * k * scene.teeth[0] * scene.revolutions)
        change += (gain - 1.0) * 2.0 * np.real(np.mean(values * np.conj(wave)) * wave)
    return change
