"""Analytic wavelets, described by their response around a line's frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray, positive, within

TAIL = 1e-6
"""Share of the peak below which a wavelet is taken for zero, in time and in frequency."""


@dataclass(frozen=True)
class Morse:
    """Generalised Morse wavelet.

    Ψ(v) = 2 exp(β ln v - (β/γ)(v^γ - 1)) for v > 0, with v the frequency over the line's own; nothing for v < 0.

    Parameters
    ----------
    beta : float
        1 to 1000; with γ it sets the number of periods in the wavelet, √(βγ)/π.
    gamma : float
        1 to 10; 3 makes the wavelet most symmetric.

    Notes
    -----
    The factor 2 makes a unit sine read 1 on its line.

    Source: J. M. Lilly, S. C. Olhede, *Generalized Morse wavelets as a superfamily of analytic wavelets*, IEEE
    Transactions on Signal Processing 60 (2012).
    """

    beta: float = 20.0
    gamma: float = 3.0

    def __post_init__(self) -> None:
        within(self.beta, "beta", 1.0, 1000.0)
        within(self.gamma, "gamma", 1.0, 10.0)

    @property
    def duration(self) -> float:
        """P = √(βγ): P/π periods lie in the central window."""
        return float(np.sqrt(self.beta * self.gamma))

    @property
    def name(self) -> str:
        """Kind and parameters."""
        return f"Morse wavelet, β {self.beta:g}, γ {self.gamma:g}"

    def response(self, v: FloatArray) -> FloatArray:
        """Ψ(v)."""
        v = np.asarray(v, dtype=np.float64)
        safe = np.where(v > 0, v, 1.0)
        value = 2.0 * np.exp(self.beta * np.log(safe) - self.beta / self.gamma * (safe**self.gamma - 1.0))
        return np.where(v > 0, value, 0.0)


@dataclass(frozen=True)
class Morlet:
    """Analytic Morlet wavelet: a Gaussian in frequency.

    Ψ(v) = 2 exp(-ω₀² (v - 1)² / 2) for v > 0.

    Parameters
    ----------
    omega0 : float
        5 to 100; below 5 the Gaussian would reach to negative frequencies.

    Notes
    -----
    The complex Morlet with bandwidth B and centre C (cycles) has ω₀ = 2πC √(B/2).

    Source: S. Mallat, *A Wavelet Tour of Signal Processing*, 3rd ed. (2009), section 4.3.
    """

    omega0: float = 6.0

    def __post_init__(self) -> None:
        within(self.omega0, "omega0", 5.0, 100.0)

    @property
    def duration(self) -> float:
        """P = ω₀: P/π periods lie in the central window."""
        return float(self.omega0)

    @property
    def name(self) -> str:
        """Kind and parameter."""
        return f"Morlet wavelet, ω₀ {self.omega0:g}"

    def response(self, v: FloatArray) -> FloatArray:
        """Ψ(v)."""
        v = np.asarray(v, dtype=np.float64)
        return np.where(v > 0, 2.0 * np.exp(-0.5 * (self.omega0 * (v - 1.0)) ** 2), 0.0)


Wavelet = Morse | Morlet
DEFAULT = Morse()


@lru_cache(maxsize=64)
def band(wavelet: Wavelet, share: float = TAIL) -> tuple[float, float]:
    """Return the lowest and highest v at which the response exceeds `share` of its peak."""
    positive(share, "share")
    v = np.geomspace(1e-4, 1e3, 400_001)
    inside = v[wavelet.response(v) > 2.0 * share]
    return float(inside[0]), float(inside[-1])


@lru_cache(maxsize=64)
def half_support(wavelet: Wavelet) -> float:
    """Return how many periods of its line a wavelet reaches to either side before it falls below `TAIL`."""
    step = 1.0 / (32.0 * wavelet.duration + 64.0)
    v = np.arange(0.0, band(wavelet)[1], step)
    shape = np.abs(np.fft.ifft(wavelet.response(v), 1 << int(np.ceil(np.log2(len(v))) + 2)))
    n = len(shape)
    half = shape[: n // 2]
    last = int(np.flatnonzero(half > TAIL * half[0])[-1])
    return (last + 1) / (n * step)


@lru_cache(maxsize=64)
def admissibility(wavelet: Wavelet) -> float:
    """C = ∫ Ψ(v)/v dv, the gain of the sum over lines at equal steps of ln v."""
    low, high = band(wavelet, 1e-16)
    s = np.linspace(np.log(low), np.log(high), 20_001)
    return float(np.trapezoid(wavelet.response(np.exp(s)), s))
