"""Synchronous averages of a shaft as complex lines: of both halves of a record, and of all of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.angle.types import AngleSignal
from gearsig.checks import FloatArray
from gearsig.orders.revolutions import whole_revolutions

ComplexArray = NDArray[np.complex128]

NEIGHBOURS = 9
"""Lines over which noise is averaged: one line's own scatter of two halves says little."""

SEEN = 3.0
"""A line is seen where its amplitude exceeds so many times its noise: noise alone does so in one line of 8000."""


@dataclass(frozen=True)
class HalvedLines:
    """Complex rms amplitudes of the whole orders of a shaft, from order 0.

    Parameters
    ----------
    first, second : complex array, (n_channels, n_orders)
        Of the halves.
    n_revolutions : int
        In both together.
    """

    first: ComplexArray
    second: ComplexArray
    n_revolutions: int

    @property
    def whole(self) -> ComplexArray:
        """Of the whole record: the mean of its halves."""
        return 0.5 * (self.first + self.second)

    def turned(self, shift_rev: float) -> HalvedLines:
        """Return the lines of the average turned forward by `shift_rev`."""
        phase = np.exp(-2j * np.pi * np.arange(self.first.shape[1]) * shift_rev)
        return replace(self, first=self.first * phase, second=self.second * phase)

    def up_to(self, highest: int) -> HalvedLines:
        """Return the lines up to an order."""
        return replace(self, first=self.first[:, : highest + 1], second=self.second[:, : highest + 1])

    def noise(self) -> FloatArray:
        """Return the standard error of `whole`, rms over both quadratures, (n_channels, n_orders).

        |a - b|/2 of the halves' amplitudes, or its rms over neighbouring lines where that is larger.
        """
        own = 0.25 * np.abs(self.first - self.second) ** 2
        own[:, 0] = own[:, 1]  # a sensor's drift is no measure of what surrounds the shaft's lines
        reach = NEIGHBOURS // 2
        padded = np.pad(own, ((0, 0), (reach, reach)), mode="reflect" if own.shape[1] > reach else "edge")
        kernel = np.ones(NEIGHBOURS) / NEIGHBOURS
        smooth = np.stack([np.convolve(row, kernel, mode="valid") for row in padded])
        result: FloatArray = np.sqrt(np.maximum(own, smooth))
        return result


def halved_lines(halves: Sequence[AngleSignal]) -> HalvedLines:
    """Return the lines of the averages of two halves.

    The revolutions are weighted by a Hann window before they are averaged: a(θ) = Σ w_r x(θ + r)/Σ w_r. Another
    shaft's order that lies d orders from a whole one then leaks as 1/(N d)³ of it instead of 1/(N d), and a
    comparison of records of different lengths compares lines, not leakage. Noise grows by 1.8 dB.
    """
    first, second = (_weighted_lines(half) for half in halves)
    n = sum(half.samples.shape[1] // half.samples_per_revolution for half in halves)
    return HalvedLines(first, second, n)


def _weighted_lines(signal: AngleSignal) -> ComplexArray:
    rows = []
    for name in signal.channel_names:
        revolutions = whole_revolutions(signal, name)
        n = len(revolutions)
        weights = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
        average = (weights / weights.sum()) @ revolutions
        lines = np.fft.rfft(average) * (np.sqrt(2.0) / len(average))
        lines[0] /= np.sqrt(2.0)
        rows.append(lines)
    highest = min(int(signal.highest_order), (signal.samples_per_revolution - 1) // 2)
    return np.stack(rows)[:, : highest + 1]


def waveform(lines: ComplexArray, n_angles: int) -> FloatArray:
    """Return one revolution, (n_angles,), of one channel's rms amplitudes, without its mean."""
    full = np.zeros(n_angles // 2 + 1, dtype=np.complex128)
    full[1 : len(lines)] = lines[1:]
    values: FloatArray = np.fft.irfft(full, n_angles) * (n_angles / np.sqrt(2.0))
    return values
