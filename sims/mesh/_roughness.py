"""Fractal roughness of tooth flanks: a Weierstrass–Mandelbrot profile, locked to time or to the flank.

Source of the profile: A. Majumdar, B. Bhushan, *Role of fractal geometry in roughness characterization and contact
mechanics of surfaces*, Journal of Tribology 112 (1990).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearsig.checks import FloatArray, count, frozen_array, not_negative, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError

LISTED_TRAVEL_MPS = 1.0312
"""Speed along the profile that puts lines 7 … 18 at 17.6 … 1524 Hz: γⁿ cycles per metre times this.

Derived from a published list of lines, whose lowest is 17.9 Hz. It is near the entrainment speed of a 55/75 pair of
module 2 at 500 rpm, 0.95 to 1.02 m/s.
"""


@dataclass(frozen=True)
class FractalSurface:
    """z(h) = G^(D-1) Σ γ^(-(2-D)n) cos(2πγⁿh + κ_n), n = n_first … n_last.

    Parameters
    ----------
    scale_m : float
        G, not below 0; 0 is a smooth flank.
    dimension : float
        D, above 1 and below 2: low for wavy, high for jagged profiles.
    n_first, n_last : int
        Lines; γⁿ is in cycles per metre, so that 7 … 18 are wavelengths of 59 mm … 0.68 mm.
    gamma : float
        γ, 1.5 unless there is a reason.
    """

    scale_m: float
    dimension: float = 1.5
    n_first: int = 7
    n_last: int = 18
    gamma: float = 1.5

    def __post_init__(self) -> None:
        not_negative(self.scale_m, "scale_m of the roughness", "m")
        within(self.dimension, "dimension of the roughness", 1.001, 1.999)
        within(self.gamma, "gamma of the roughness", 1.01, 10.0)
        if not (isinstance(self.n_first, int) and isinstance(self.n_last, int) and self.n_first <= self.n_last):
            raise InputError(
                f"lines {self.n_first} to {self.n_last} of the roughness",
                allowed="whole numbers, the first not above the last",
            )

    @classmethod
    def of_roughness(cls, rms_um: float, dimension: float = 1.5) -> FractalSurface:
        """Return the surface whose rms height is `rms_um` (Rq); solves the rms formula for G.

        G = (Rq √2/√Σγ^(-2(2-D)n))^(1/(D-1)).

        Examples
        --------
        >>> f"{FractalSurface.of_roughness(0.45).scale_m:.3g}"
        '2.32e-12'
        """
        unit = cls(1.0, dimension)
        rms_m = 1e-6 * not_negative(rms_um, "rms_um of the roughness", "um")
        return cls((rms_m / unit.rms_m) ** (1.0 / (dimension - 1.0)), dimension)

    @property
    def cycles_per_metre(self) -> FloatArray:
        """γⁿ, (n_lines,)."""
        lines: FloatArray = self.gamma ** np.arange(self.n_first, self.n_last + 1, dtype=np.float64)
        return lines

    @property
    def amplitudes_m(self) -> FloatArray:
        """Peak amplitude of each line, (n_lines,)."""
        amplitudes: FloatArray = self.scale_m ** (self.dimension - 1) * self.cycles_per_metre ** -(2 - self.dimension)
        return amplitudes

    @property
    def rms_m(self) -> float:
        """Root mean square height, √(G^(2(D-1))/2 · Σγ^(-2(2-D)n)): of a long profile, or over phases."""
        return float(np.sqrt(0.5 * np.sum(self.amplitudes_m**2)))

    def draw_phases(self, rng: np.random.Generator, n_profiles: int = 1) -> FloatArray:
        """Uniform phases κ, (n_profiles, n_lines)."""
        n_lines = self.n_last - self.n_first + 1
        phases: FloatArray = rng.uniform(0.0, 2 * np.pi, (n_profiles, n_lines))
        return phases


@dataclass(frozen=True)
class TimeLockedRoughness:
    """Δb(t) = z(vt): the flanks met one after the other, spliced to one endless profile.

    Its lines stand at fixed frequencies γⁿv, whatever the shaft does, and it never comes back with a tooth: it shows a
    roughness's strength, not its place. Where a line must follow a gear, use `FlankRoughness`.

    Parameters
    ----------
    surface : FractalSurface
    phases_rad : array, (n_lines,)
    travel_mps : float
        v, above 0.
    """

    surface: FractalSurface
    phases_rad: FloatArray
    travel_mps: float = LISTED_TRAVEL_MPS

    def __post_init__(self) -> None:
        positive(self.travel_mps, "travel_mps of the roughness", "m/s")
        object.__setattr__(self, "phases_rad", _phases(self.phases_rad, 1, len(self.surface.amplitudes_m)))

    @classmethod
    def draw(cls, surface: FractalSurface, rng: np.random.Generator) -> TimeLockedRoughness:
        """Draw the phases."""
        return cls(surface, surface.draw_phases(rng)[0])

    @property
    def frequencies_hz(self) -> FloatArray:
        """γⁿ v, (n_lines,)."""
        return self.surface.cycles_per_metre * self.travel_mps

    def height_m(self, time_s: ArrayLike) -> FloatArray:
        """Δb at the given times."""
        return _cosines(self.surface.amplitudes_m, 2 * np.pi * self.frequencies_hz, self.phases_rad, time_s)

    def phasors(self, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """What `roughness_kernel.height_now` and `advance` work on, from time 0.

        Returns
        -------
        real, imaginary, omega_rad_s, step_cos, step_sin : arrays, (n_lines,)
            For steps of `step_s`, which is half the solver's step for a fourth-order Runge–Kutta method.
        """
        positive(step_s, "step_s", "s")
        omega, a = 2 * np.pi * self.frequencies_hz, self.surface.amplitudes_m
        return (
            a * np.cos(self.phases_rad),
            a * np.sin(self.phases_rad),
            omega,
            np.cos(omega * step_s),
            np.sin(omega * step_s),
        )


@dataclass(frozen=True, eq=False)  # two drawn profiles are never the same, and arrays compare element by element
class FlankRoughness:
    """z of every tooth of one gear over the position on its flank: it returns with the tooth.

    The lines of a whole gear are orders of its shaft. Wavelengths longer than the flank act as pitch errors.

    Parameters
    ----------
    surface : FractalSurface
    phases_rad : array, (n_teeth, n_lines)
    """

    surface: FractalSurface
    phases_rad: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "phases_rad", _phases(self.phases_rad, 2, len(self.surface.amplitudes_m)))

    @classmethod
    def draw(cls, surface: FractalSurface, n_teeth: int, rng: np.random.Generator) -> FlankRoughness:
        """Draw the phases of every tooth."""
        return cls(surface, surface.draw_phases(rng, count(n_teeth, "n_teeth")))

    @property
    def n_teeth(self) -> int:
        """Teeth of the gear."""
        return int(self.phases_rad.shape[0])

    def height_m(self, tooth: NDArray[np.integer] | int, position_m: ArrayLike) -> FloatArray:
        """Height of a tooth's flank, above 0 into the gap; tooth numbers count on through revolutions.

        Parameters
        ----------
        tooth : int or array
            Any whole number; taken modulo the number of teeth.
        position_m : array
            Arc length along the flank, from the root end of the contact, in the shape of `tooth` or one that goes with
            it.
        """
        s = np.asarray(position_m, dtype=np.float64)
        row = np.mod(tooth, self.n_teeth)
        total = np.zeros(np.broadcast_shapes(np.shape(row), s.shape))
        # cos(ks + φ) by the cosines and sines of both: one profile of positions serves all teeth.
        for n, cycles in enumerate(self.surface.cycles_per_metre):
            place, phase = 2 * np.pi * cycles * s, self.phases_rad[row, n]
            a = self.surface.amplitudes_m[n]
            total += a * np.cos(phase) * np.cos(place)
            total -= a * np.sin(phase) * np.sin(place)
        return total


def _cosines(amplitudes: FloatArray, omega: FloatArray, phases: FloatArray, time_s: ArrayLike) -> FloatArray:
    t = np.asarray(time_s, dtype=np.float64)
    total = np.zeros(t.shape)
    for a, w, phase in zip(amplitudes, omega, phases, strict=True):  # line by line: no (time × line) matrix
        total += a * np.cos(w * t + phase)
    return total


def _phases(phases_rad: FloatArray, ndim: int, n_lines: int) -> FloatArray:
    phases = frozen_array(phases_rad, "phases_rad of the roughness", ndim=ndim)
    if phases.shape[-1] != n_lines:
        raise InputError(
            f"{phases.shape[-1]} phases", where="phases_rad of the roughness", allowed=f"{n_lines}, per line"
        )
    return phases


# Compiled roughness for right-hand sides: phasors stepped in time, tables looked up on the flank.


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def height_now(real, imaginary, omega_rad_s):  # type: ignore[no-untyped-def]
    """(Σ Re p_n, -Σ ω_n Im p_n): height and its rate from the phasors p_n = a_n exp(i(ω_n t + κ_n))."""
    height, rate = 0.0, 0.0
    for n in range(real.shape[0]):
        height += real[n]
        rate -= omega_rad_s[n] * imaginary[n]
    return height, rate


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def advance(real, imaginary, step_cos, step_sin):  # type: ignore[no-untyped-def]
    """Turn the phasors by one step, in place; exact up to rounding, about 1e-16 per step."""
    for n in range(real.shape[0]):
        re = real[n] * step_cos[n] - imaginary[n] * step_sin[n]
        imaginary[n] = real[n] * step_sin[n] + imaginary[n] * step_cos[n]
        real[n] = re
