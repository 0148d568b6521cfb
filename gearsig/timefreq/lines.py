"""Where the lines of a transform lie, and whether the signal is long enough for them."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError, RefusalError
from gearsig.timefreq.uniform import UniformSignal
from gearsig.timefreq.wavelets import Wavelet, band

N_OCTAVES = 10
"""Octaves that the default lines span at most."""


def footprint_periods(wavelet: Wavelet) -> float:
    """Return the periods that hold most of a wavelet's energy, 2√2 P / 2π.

    Source: J. M. Lilly, *Element analysis: a wavelet-based method for analysing time-localized events in noisy time
    series*, Proceedings of the Royal Society A 473 (2017).
    """
    return float(np.sqrt(2.0) * wavelet.duration / np.pi)


def lowest_possible(signal: UniformSignal, wavelet: Wavelet) -> float:
    """Return the frequency or order whose wavelet just fits into the signal."""
    return footprint_periods(wavelet) / signal.length


def logarithmic_lines(
    signal: UniformSignal, wavelet: Wavelet, lowest: float | None, highest: float | None, n_per_octave: int
) -> FloatArray:
    """Return frequencies or orders at equal ratios, 2^(1/n_per_octave), `highest` among them.

    Parameters
    ----------
    signal : UniformSignal
    wavelet : Wavelet
    lowest, highest : float or None
        In Hz or orders. None: ten octaves down, or twice the lowest possible; as high as the
        wavelet's response leaves a hundredth beyond what the samples carry.
    n_per_octave : int

    Raises
    ------
    InputError
        If they are not positive, in the wrong order, or beyond what the samples carry.
    RefusalError
        If the signal is too short for the lowest line.
    """
    count(n_per_octave, "n_per_octave")
    top = signal.highest_valid / band(wavelet, 0.01)[1] if highest is None else positive(highest, "highest")
    _check_highest(top, signal)
    fits = lowest_possible(signal, wavelet)
    low = max(top / 2**N_OCTAVES, 2.0 * fits) if lowest is None else positive(lowest, "lowest")
    low = min(low, top) if lowest is None else low
    if low > top:
        raise InputError(f"lowest is {low:g}, highest is {top:g} {signal.position_unit}", allowed="lowest < highest")
    _check_lowest(low, signal, wavelet)
    n = int(np.floor(n_per_octave * np.log2(top / low) * (1 + 1e-12))) + 1
    return top * 2.0 ** (np.arange(1 - n, 1) / n_per_octave)


def given_lines(positions: FloatArray, signal: UniformSignal, wavelet: Wavelet) -> FloatArray:
    """Return the asked frequencies or orders after checking them as `logarithmic_lines` does."""
    lines = frozen_array(positions, "positions", ndim=1)
    if len(lines) == 0 or lines[0] <= 0 or np.any(np.diff(lines) <= 0):
        raise InputError("positions are not positive and increasing", allowed="at least one, each above the last")
    _check_highest(float(lines[-1]), signal)
    _check_lowest(float(lines[0]), signal, wavelet)
    return lines


def _check_highest(highest: float, signal: UniformSignal) -> None:
    if highest > signal.highest_valid * (1 + 1e-9):
        raise InputError(
            f"the highest line is {highest:g} {signal.position_unit}",
            where="highest",
            allowed=f"at most {signal.highest_valid:g} {signal.position_unit}",
            remedy="lower it, or sample faster",
        )


def _check_lowest(lowest: float, signal: UniformSignal, wavelet: Wavelet) -> None:
    fits = lowest_possible(signal, wavelet)
    if lowest < fits * (1 - 1e-9):
        length = "s" if signal.axis == "frequency" else "revolutions"
        raise RefusalError(
            f"the signal of {signal.length:.4g} {length} is shorter than the wavelet at {lowest:.4g} "
            f"{signal.position_unit}, which lasts {footprint_periods(wavelet) / lowest:.4g} {length}",
            remedy=f"set lowest to {fits:.4g} {signal.position_unit} or more, take a shorter wavelet, or record longer",
        )
