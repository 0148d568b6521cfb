"""Windows with their coherent gain, equivalent noise bandwidth and transform."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, count, frozen_array, not_negative
from gearsig.errors import InputError

# Coefficients a_m of w[n] = sum over m of (-1)^m a_m cos(2 pi m n / N).
COSINE_SUMS: dict[str, tuple[float, ...]] = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman-harris": (0.35875, 0.48829, 0.14128, 0.01168),
    "flat top": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
}
WINDOW_NAMES = (*COSINE_SUMS, "kaiser BETA")


@dataclass(frozen=True)
class Window:
    """A window of n samples, periodic: the sample after the last would equal the first.

    Parameters
    ----------
    name : str
    values : array, (n,)
    coherent_gain : float
        Mean of the values: what a bin-centred sine is multiplied by.
    noise_bandwidth_bins : float
        Equivalent noise bandwidth in lines, n Σw² / (Σw)²: 1 for rectangular, 1.5 for Hann.
    """

    name: str
    values: FloatArray
    coherent_gain: float
    noise_bandwidth_bins: float


def make_window(name: str, n_samples: int) -> Window:
    """Return the window called `name` with `n_samples` samples.

    Rectangular for what repeats exactly in the block, Hann for all else, flat top to read levels off a spectrum
    without interpolation, Blackman–Harris or Kaiser for a weak line beside a strong one.

    Parameters
    ----------
    name : str
        "rectangular", "hann", "hamming", "blackman-harris", "flat top", or "kaiser BETA", e.g. "kaiser 9".
    n_samples : int
        At least 1.

    Raises
    ------
    InputError
        On an unknown name or a length below 1.

    References
    ----------
    F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", 1978.
    The flat top is that of G. D'Antona and A. Ferrero, *Digital Signal Processing for Measurement Systems*, 2006.

    Examples
    --------
    >>> make_window("hann", 1024).noise_bandwidth_bins
    1.5
    """
    return _make_window(checked_window_name(name), count(n_samples, "number of window samples"))


def checked_window_name(name: str) -> str:
    """Return `name` if there is such a window."""
    if name in COSINE_SUMS:
        return name
    if name.startswith("kaiser "):
        not_negative(_kaiser_beta(name), "beta of the Kaiser window")
        return name
    hint = closest_match_hint(name, WINDOW_NAMES) if name != "kaiser" else "give its beta: 'kaiser 9'"
    raise InputError(f"window is {name!r}", allowed=", ".join(WINDOW_NAMES), remedy=hint)


@lru_cache(maxsize=8)
def _make_window(name: str, n: int) -> Window:
    w = _window_values(name, n)
    gain = float(w.mean())
    bandwidth = float(n * np.dot(w, w) / w.sum() ** 2)
    return Window(name, frozen_array(w, "window", ndim=1), gain, round(bandwidth, 12))


def _window_values(name: str, n: int) -> FloatArray:
    if name in COSINE_SUMS:
        return _cosine_sum(COSINE_SUMS[name], n)
    kaiser: FloatArray = np.kaiser(n + 1, _kaiser_beta(name))[:n]
    return kaiser


def _cosine_sum(coefficients: tuple[float, ...], n: int) -> FloatArray:
    """Return Σ (-1)^m a_m cos(2π m k/n), by Chebyshev's recurrence so that one cosine is enough."""
    w = np.full(n, coefficients[0])
    if len(coefficients) == 1:
        return w
    c = np.cos(2 * np.pi / n * np.arange(n))
    before, now = np.ones(n), c
    for m, a in enumerate(coefficients[1:], start=1):
        w += (-1) ** m * a * now
        before, now = now, 2 * c * now - before
    return w


def _kaiser_beta(name: str) -> float:
    try:
        return float(name.removeprefix("kaiser "))
    except ValueError:
        raise InputError(f"window is {name!r}", allowed=", ".join(WINDOW_NAMES), remedy="e.g. 'kaiser 9'") from None


def window_response(name: str, offset_bins: FloatArray) -> FloatArray:
    """Return the window's transform at `offset_bins` lines from its centre, relative to the centre.

    W(d) = |Σ w[n] exp(-2πi d n/N)| / Σ w[n]. It is what a sine between two lines loses (scalloping), and what it
    leaks elsewhere. The response hardly depends on N; it is evaluated at N = 512.
    """
    n = 512
    w = _window_values(checked_window_name(name), n)
    k = np.arange(n) - n / 2
    offsets = np.atleast_1d(np.asarray(offset_bins, dtype=np.float64))
    response: FloatArray = np.abs(np.exp(-2j * np.pi / n * np.outer(offsets, k)) @ w) / w.sum()
    return response
