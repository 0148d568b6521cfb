"""The delay of an embedding: first minimum of the average mutual information."""

from __future__ import annotations

from math import ceil

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import RefusalError
from gearsig.phase.checked_series import checked_series, mean_period_samples
from gearsig.phase.measures import MutualInformation

N_SAMPLES = 200_000
"""Longer signals are looked at in their first so many samples: the estimate's error is below 1e-3 nats by then."""

MOST_DELAYS = 400
MOST_BINS = 48
SAMPLES_PER_CELL = 12
PERIODIC_SHARE = 0.4
"""A periodic signal tells its own future at every delay: its information stays above this share of its entropy."""


def average_mutual_information(
    values: FloatArray, sampling_rate_hz: float, *, longest_delay_samples: int | None = None, source: str = ""
) -> MutualInformation:
    """Return the average mutual information over delay, and the delay at its first minimum.

    I(τ) = Σ p(x(t), x(t+τ)) ln[ p(x(t), x(t+τ)) / (p(x(t)) p(x(t+τ))) ], from a histogram whose bins hold equally many
    samples each (adaptive to the signal's distribution), about 12 samples per cell, less the bias of counting.

    Parameters
    ----------
    values : array, (n_samples,)
        At least 64.
    sampling_rate_hz : float
    longest_delay_samples : int or None
        None: two mean periods, at most a quarter of the signal.
    source : str

    Returns
    -------
    MutualInformation
        Its rule is "first minimum": the first delay that is followed by a rise larger than the scatter of the estimate.
        Where that has no meaning: "one step" for a signal without memory, a map or a section, whose neighbouring values
        lie farther apart than one standard deviation; "quarter period" for a periodic signal, whose information does
        not fall below 0.4 of its entropy at any delay; "1/e" of the first value where there is no minimum.

    Raises
    ------
    InputError
        On NaN, too few samples, a delay longer than the signal allows.
    RefusalError
        If the signal is constant, or the information has no minimum and does not fall to 1/e of its first value.

    Notes
    -----
    For a signal of one sine the first minimum lies near a quarter of its period.

    Source: A. M. Fraser, H. L. Swinney, *Independent coordinates for strange attractors from mutual information*,
    Physical Review A 33 (1986).
    """
    from gearsig.phase.counting_kernel import mutual_information

    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    x = checked_series(values, minimum=64)[:N_SAMPLES]
    longest = _longest_delay(x, longest_delay_samples)
    step = max(1, ceil(longest / MOST_DELAYS))
    delays = np.arange(0, longest + 1, step)
    bins, n_bins = equally_filled_bins(x)
    information = np.empty(len(delays))
    mutual_information(bins, n_bins, delays, information)
    delay, rule = _choose(information, _scatter(len(x) - longest, n_bins), step, x)
    return MutualInformation(information, step, rate, delay, rule, n_bins, source)


def equally_filled_bins(x: FloatArray) -> tuple[np.ndarray, int]:
    """Return each sample's bin, bounded by quantiles; equal samples always share one (quantised signals)."""
    n_bins = int(np.clip(np.sqrt(len(x) / SAMPLES_PER_CELL), 4, MOST_BINS))
    inner = np.quantile(x, np.arange(1, n_bins) / n_bins)
    return np.searchsorted(inner, x, side="right").astype(np.int64), n_bins


def _longest_delay(x: FloatArray, asked: int | None) -> int:
    if asked is None:
        return int(np.clip(2.0 * mean_period_samples(x), 4, len(x) // 4))
    longest = count(asked, "longest_delay_samples", minimum=2)
    if longest > len(x) // 2:
        raise RefusalError(
            f"{len(x)} samples are too few for delays up to {longest}", remedy=f"ask for at most {len(x) // 2}"
        )
    return longest


def _scatter(n: int, n_bins: int) -> float:
    """Standard deviation of the estimate for independent samples: 2N·I follows a χ² of (B - 1)² degrees."""
    return float((n_bins - 1) / (np.sqrt(2.0) * max(n, 1)))


def _choose(information: FloatArray, scatter: float, step: int, x: FloatArray) -> tuple[int, str]:
    """Return the delay in samples and the rule that found it."""
    if information[1] < 4.0 * scatter or float(np.mean(np.square(np.diff(x)))) > float(np.var(x)):
        return 1, "one step"
    if information.min() > PERIODIC_SHARE * information[0]:
        return max(1, round(mean_period_samples(x) / 4.0)), "quarter period"
    at = first_minimum(information, scatter)
    if at:
        return at * step, "first minimum"
    below = np.flatnonzero(information < information[1] / np.e)
    if len(below) == 0:
        raise RefusalError(
            "the mutual information has no minimum and does not fall to 1/e within the delays looked at",
            remedy="give a longer longest_delay_samples, or take the trend out of the signal",
        )
    return int(below[0]) * step, "1/e"


def first_minimum(information: FloatArray, scatter: float) -> int:
    """Return the index of the first minimum that a rise above the scatter follows; 0 if there is none."""
    at = 1
    for k in range(2, len(information)):
        if information[k] < information[at]:
            at = k
        elif information[k] > information[at] + max(4.0 * scatter, 0.02 * information[at]):
            return at
    return 0
