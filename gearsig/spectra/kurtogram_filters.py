"""Filters that split a complex band into halves and thirds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray


@dataclass(frozen=True)
class Splitter:
    """A low-pass turned to the middle of each part of the band 0 to 1/2 (cycles per sample).

    The parts' middles lie symmetrically about 1/4, so that the products with the cosines and sines of the first part
    serve the last one too, with the signs of the odd taps reversed; the middle of three lies at 1/4 itself.

    Parameters
    ----------
    n_parts : int
        2 or 3; also the factor by which the rate falls.
    cosine, sine : arrays, (n_side + 1,)
        Taps 0 … n_side of the first part's filter; the cosine continues evenly to negative ones, the sine oddly.
    middle : array, (n_side + 1,)
        Taps of the middle part: even ones real, odd ones imaginary. Zero for halves.
    """

    n_parts: int
    cosine: FloatArray
    sine: FloatArray
    middle: FloatArray

    @property
    def n_taps(self) -> int:
        """Length of the filters."""
        return 2 * len(self.cosine) - 1

    def responses(self, frequencies: FloatArray) -> FloatArray:
        """Return the magnitude of each part's filter, (n_parts, n), at `frequencies` in cycles per sample."""
        k = np.arange(1 - len(self.cosine), len(self.cosine))
        low_pass = np.hypot(self.cosine, self.sine)[np.abs(k)] * _sign(self, np.abs(k))
        middles = (2 * np.arange(self.n_parts) + 1) / (4.0 * self.n_parts)
        turned = low_pass * np.exp(2j * np.pi * middles[:, None] * k)
        result: FloatArray = np.abs(turned @ np.exp(-2j * np.pi * np.outer(k, frequencies)))
        return result


@lru_cache(maxsize=2)
def splitter(n_parts: int) -> Splitter:
    """Return the filters for halves or thirds.

    h(k) = w(k) sin(2π f_c k)/(πk), f_c = 1/(4 n_parts), w Hamming's window up to the sine's third zero on either
    side. The response is 1/2 at a part's borders and below 0.3 % from 0.35 of its width beyond them; sampled at twice
    its width, it does not alias.
    """
    n_side = 6 * n_parts - 1  # the next tap is a zero of the sine
    k = np.arange(n_side + 1)
    window = 0.54 + 0.46 * np.cos(np.pi * k / (n_side + 1))
    h = window * np.sinc(k / (2.0 * n_parts)) / (2.0 * n_parts)
    h[2 * n_parts :: 2 * n_parts] = 0.0
    h /= h[0] + 2.0 * h[1:].sum()
    turn = np.pi * k / (2 * n_parts)
    quarter = np.where(k % 4 < 2, 1.0, -1.0) * (n_parts == 3)  # cos(πk/2) of even, sin(πk/2) of odd taps
    return Splitter(n_parts, h * np.cos(turn), h * np.sin(turn), h * quarter)


def _sign(split: Splitter, k: FloatArray) -> FloatArray:
    """Return the sign of the low-pass at taps k: that of the sine over k, which changes every 2 n_parts taps."""
    result: FloatArray = np.where((k // (2 * split.n_parts)) % 2 == 0, 1.0, -1.0)
    return result
