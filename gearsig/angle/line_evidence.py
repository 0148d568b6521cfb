"""How much each frequency looks like a line: height over the local floor, as log likelihood ratio by rank."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearsig.angle.comb_lines import PRESENCE
from gearsig.checks import FloatArray

_FLOOR_BINS = 96  # the floor is a median over so many bins
_HIGHEST_LOG_RATIO = 9.0  # 78 dB in power; beyond it a line is no more of a line
# A line that is there stands among the top ranks: density a·q^(a-1) of its rank q, with this a.
_RANK_EXPONENT = 0.3


@dataclass(frozen=True)
class LineEvidence:
    """Log likelihood ratio of "a line of the comb is here" for each interval between two bins.

    Parameters
    ----------
    ratios : array, (n_classes, n_intervals)
        For each class of `comb_lines.PRESENCE`; interval i spans i to i + 1 bins.
    log_ratio : array, (n_bins,)
        ln(power / floor), mean over the channels.
    bin_width : float
        Hz, or orders.
    top : float
        Upper end of what is looked at.
    """

    ratios: FloatArray
    log_ratio: FloatArray
    bin_width: float
    top: float


def line_evidence(samples: FloatArray, rate: float, n_segment: int, top: float) -> LineEvidence:
    """Return the evidence for lines in all channels together.

    Hann windows of `n_segment` samples at half overlap; mean power over them; heights over the floor averaged over
    channels.

    Parameters
    ----------
    samples : array, (n_channels, n_samples)
    rate : float
        Samples per second, or per revolution.
    n_segment : int
        Shortened a little to a length that transforms fast.
    top : float
        In the unit of `rate`.
    """
    from scipy.fft import prev_fast_len

    n_segment = prev_fast_len(n_segment, real=True)
    n_keep = min(n_segment // 2, int(top / rate * n_segment) + 4)
    ratios = [_log_ratio(_mean_power(row, n_segment)[:n_keep]) for row in samples]
    log_ratio = np.mean(ratios, axis=0)
    peaks = _only_peaks(log_ratio)
    # Interval i holds the higher of its two ends, so that a candidate may miss a line's middle by half a bin.
    height = np.maximum(peaks[:-1], peaks[1:])
    rank = _tail_share(height)
    return LineEvidence(
        np.array([_log_likelihood_ratio(rank, present) for present in PRESENCE]),
        log_ratio,
        rate / n_segment,
        top,
    )


@lru_cache(maxsize=8)
def _hann(n: int) -> FloatArray:
    """Hann window for spectra; kept, as many blocks of one length follow each other."""
    window: FloatArray = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    return window


def _mean_power(x: FloatArray, n_segment: int) -> FloatArray:
    from scipy.fft import rfft

    window = _hann(n_segment)
    step = max(1, n_segment // 2)
    power = np.zeros(n_segment // 2 + 1)
    for start in range(0, len(x) - n_segment + 1, step):
        segment = x[start : start + n_segment]
        power += np.square(np.abs(rfft((segment - segment.mean()) * window)))
    return power


def _log_ratio(power: FloatArray) -> FloatArray:
    """ln(power/floor); the floor is the median in blocks, straight lines (in decibels) between their middles."""
    tiny = max(float(power.max()) * 1e-24, 1e-300)
    log_power = np.log(np.maximum(power, tiny))
    length = min(_FLOOR_BINS, len(power))
    n_blocks = len(power) // length
    medians = np.median(log_power[: n_blocks * length].reshape(n_blocks, length), axis=1)
    middles = (np.arange(n_blocks) + 0.5) * length
    over: FloatArray = log_power - np.interp(np.arange(len(power)), middles, medians)
    return np.clip(over, -2.0, _HIGHEST_LOG_RATIO)


def _only_peaks(x: FloatArray) -> FloatArray:
    """Keep values that are the largest within two bins each way; the flanks of a line are not lines."""
    largest = x.copy()
    for k in (1, 2):
        largest[k:] = np.maximum(largest[k:], x[:-k])
        largest[:-k] = np.maximum(largest[:-k], x[k:])
    return np.where((x >= largest) & (x > 0), x, 0.0)


def _tail_share(x: FloatArray) -> FloatArray:
    """Share of values at least as large as each one."""
    ordered = np.sort(x)
    share: FloatArray = (len(x) - np.searchsorted(ordered, x, side="left")) / len(x)
    return share


def _log_likelihood_ratio(rank: FloatArray, present: float) -> FloatArray:
    """ln(1 - p + p·a·q^(a-1)): a line missing costs little, a line of high rank gives a lot, none decides alone."""
    ratio: FloatArray = np.log(1.0 - present + present * _RANK_EXPONENT * rank ** (_RANK_EXPONENT - 1.0))
    return ratio
