"""Mesh vibration: harmonics of the tooth passage, modulated once per revolution and from tooth to tooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, within
from gearsig.errors import InputError


@dataclass(frozen=True)
class MeshHarmonics:
    """Harmonics of a pair's mesh order, before modulation and transfer path.

    Parameters
    ----------
    pair : str
    amplitudes_mps2 : tuple of float
        Peak amplitude of harmonics 1, 2, …; independent of speed and load.
    phases_rad : tuple of float
        Of the cosine at angle 0; missing ones are 0.
    """

    pair: str
    amplitudes_mps2: tuple[float, ...]
    phases_rad: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.amplitudes_mps2 or len(self.phases_rad) > len(self.amplitudes_mps2):
            raise InputError(
                f"mesh of pair {self.pair!r} has {len(self.amplitudes_mps2)} amplitudes, {len(self.phases_rad)} phases",
                allowed="at least one amplitude, and no more phases than amplitudes",
            )
        for amplitude in self.amplitudes_mps2:
            not_negative(amplitude, f"mesh amplitude of pair {self.pair!r}", "m/s^2")


@dataclass(frozen=True)
class Modulation:
    """A gear's once-per-revolution (or `order` times) modulation of its mesh, as eccentricity causes it.

    The amplitude is multiplied by 1 + a cos(2π k θ + φ), and harmonic h of the mesh is shifted by h b sin(2π k θ + φ).

    Parameters
    ----------
    pair, shaft : str
        The gear.
    amplitude_fraction : float
        a, 0 to 1: each first-order sideband is a/2 of its carrier.
    phase_deviation_rad : float
        b, of the first mesh harmonic. Run-out e of the pitch circle gives about b = e/(m/2) rad for module m.
    order : int
        k, cycles per revolution of the gear.
    angle_rad : float
        φ.
    """

    pair: str
    shaft: str
    amplitude_fraction: float = 0.0
    phase_deviation_rad: float = 0.0
    order: int = 1
    angle_rad: float = 0.0

    def __post_init__(self) -> None:
        within(self.amplitude_fraction, f"amplitude_fraction of the modulation by {self.shaft!r}", 0.0, 1.0)


@dataclass(frozen=True)
class ToothVariation:
    """Ordinary differences between the teeth of a gear, as manufacture leaves them.

    Each tooth gets a Gaussian amplitude factor and phase; between teeth they are interpolated by the gear's own
    Fourier series up to half the tooth number.

    Parameters
    ----------
    pair, shaft : str
        The gear.
    amplitude_fraction_rms, phase_rms_rad : float
        Standard deviation over the teeth.
    """

    pair: str
    shaft: str
    amplitude_fraction_rms: float = 0.02
    phase_rms_rad: float = 0.02

    def __post_init__(self) -> None:
        within(self.amplitude_fraction_rms, f"amplitude_fraction_rms of gear {self.shaft!r}", 0.0, 1.0)
        not_negative(self.phase_rms_rad, f"phase_rms_rad of gear {self.shaft!r}", "rad")


def harmonic_sum(
    mesh: MeshHarmonics, mesh_cycles: FloatArray, amplitude_factor: FloatArray, phase_rad: FloatArray
) -> FloatArray:
    """Σ_h A_h g(t) cos(2π h c(t) + φ_h + h ψ(t)).

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c, mesh cycles since angle 0.
    amplitude_factor, phase_rad : arrays, (n,)
        g and ψ.
    """
    phases = (*mesh.phases_rad, *(0.0,) * (len(mesh.amplitudes_mps2) - len(mesh.phases_rad)))
    total = np.zeros_like(mesh_cycles)
    for h, (amplitude, phase) in enumerate(zip(mesh.amplitudes_mps2, phases, strict=True), start=1):
        total += amplitude * np.cos(h * (2 * np.pi * mesh_cycles + phase_rad) + phase)
    return amplitude_factor * total


def modulation_terms(modulation: Modulation, shaft_rev: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(a cos, b sin) of a modulation at the given angles of its shaft."""
    angle = 2 * np.pi * modulation.order * shaft_rev + modulation.angle_rad
    return modulation.amplitude_fraction * np.cos(angle), modulation.phase_deviation_rad * np.sin(angle)


def tooth_values(n_teeth: int, standard_deviation: float, rng: np.random.Generator) -> FloatArray:
    """Zero-mean Gaussian value for each tooth, (n_teeth,)."""
    values = rng.standard_normal(n_teeth)
    result: FloatArray = standard_deviation * (values - values.mean())
    return result


def between_teeth(values: FloatArray | Sequence[float], shaft_rev: FloatArray) -> FloatArray:
    """Trigonometric interpolation of one value per tooth, at any angle.

    Tooth k stands at angle (k + ½)/Z, the middle of its engagement.
    """
    v = np.asarray(values, dtype=np.float64)
    z = len(v)
    coefficients = np.fft.rfft(v) / z
    total = np.full(np.shape(shaft_rev), coefficients[0].real)
    for m in range(1, len(coefficients)):
        # An even tooth number has one term at half the tooth number, which counts once.
        weight = 1.0 if 2 * m == z else 2.0
        phase = 2 * np.pi * m * (shaft_rev - 0.5 / z)
        total += weight * (coefficients[m].real * np.cos(phase) - coefficients[m].imag * np.sin(phase))
    return total
