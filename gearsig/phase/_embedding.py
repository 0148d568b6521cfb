"""Delay embedding: a path through phase space from a single channel, with its delay and dimension."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, count, freeze, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import percent, seconds_text
from gearsig.phase._neighbours import IndexArray, evenly_spaced_indices, nearest_beyond_theiler_window
from gearsig.phase._plane import PhasePortrait, checked_series, mean_period_samples
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import named_signal


@dataclass(frozen=True)
class MutualInformation(Result, columns=("delays_s", "information_nats")):
    """Average mutual information of a signal and its delayed copy, and the delay chosen from it.

    Parameters
    ----------
    information_nats : array, (n_delays,)
        At delays of 0, 1, 2, … × `step_samples`.
    step_samples : int
    sampling_rate_hz : float
    delay_samples : int
        The chosen delay.
    rule : str
        Rule by which it was chosen: "first minimum", or its substitute.
    n_bins : int
        Bins of the histogram per axis.
    source : str
    """

    information_nats: FloatArray
    step_samples: int
    sampling_rate_hz: float
    delay_samples: int
    rule: str
    n_bins: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "information_nats")

    @property
    def delays_s(self) -> FloatArray:
        """Delays in s, (n_delays,)."""
        return np.arange(len(self.information_nats)) * (self.step_samples / self.sampling_rate_hz)

    @property
    def delay_s(self) -> float:
        """The chosen delay, in s."""
        return self.delay_samples / self.sampling_rate_hz


@dataclass(frozen=True)
class EmbeddingDimension(Result):
    """Number of delayed values that unfold a signal's path.

    Parameters
    ----------
    dimensions : tuple of int
        1, 2, …
    false_fraction : array, (n_dimensions,)
        Share of nearest neighbours that are false at each dimension (Kennel).
    growth : array, (n_dimensions - 1,)
        Cao's E1(d): reaches 1 where the path is unfolded.
    determinism : array, (n_dimensions - 1,)
        Cao's E2(d): 1 at every d for a random signal.
    dimension : int
        The chosen dimension; 0 if no dimension unfolds the path.
    verdict : str
        "deterministic", or "stochastic" if no dimension up to the largest tried unfolds the path.
    threshold : float
        Maximum share of false neighbours at which the path counts as unfolded.
    delay_samples : int
    source : str
    """

    dimensions: tuple[int, ...]
    false_fraction: FloatArray
    growth: FloatArray
    determinism: FloatArray
    dimension: int
    verdict: Literal["deterministic", "stochastic"]
    threshold: float
    delay_samples: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "false_fraction", "growth", "determinism")


def delay_embedding(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    delay_samples: int | None = None,
    dimension: int | None = None,
    unit: str = "",
    source: str = "",
) -> PhasePortrait:
    """Return the path of delayed values: (x(t), x(t + τ), …, x(t + (d-1)τ)).

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    delay_samples : int or None
        None: the first minimum of the average mutual information.
    dimension : int or None
        1 to 20; None: from false nearest neighbours.
    unit, source : str
        Of the signal; default: the channel's.

    Returns
    -------
    PhasePortrait
        Its points are a view of the signal, so the embedding needs no extra memory.

    Raises
    ------
    InputError
        On NaN, or if the signal is shorter than the embedding.
    RefusalError
        If the signal is constant; if `dimension` is None, also if no dimension unfolds it, as for noise.

    Source: F. Takens, *Detecting strange attractors in turbulence*, Lecture Notes in Mathematics 898 (1981).
    """
    values, rate, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=1)
    x = checked_series(values, minimum=16)
    tau = chosen_delay(x, rate) if delay_samples is None else count(delay_samples, "delay_samples")
    d = _chosen_dimension(x, rate, tau) if dimension is None else count(dimension, "dimension", maximum=20)
    return PhasePortrait(
        points=delay_vectors(x, tau, d),
        sampling_rate_hz=rate,
        axis_names=tuple("x(t)" if k == 0 else f"x(t + {seconds_text(k * tau / rate)})" for k in range(d)),
        units=(unit,) * d,
        kind="delay embedding",
        source=source,
        delay_samples=tau,
    )


def delay_vectors(x: FloatArray, delay: int, dimension: int) -> FloatArray:
    """Return the delayed values as a view, (n - (d-1)τ, d).

    Raises
    ------
    InputError
        If fewer than 16 points are left.
    """
    n = len(x) - (dimension - 1) * delay
    if n < 16:
        raise InputError(
            f"{len(x)} samples are too few for dimension {dimension} at a delay of {delay} samples",
            allowed=f"at least {(dimension - 1) * delay + 16} samples",
            remedy="record longer, or take a smaller delay or dimension",
        )
    step = x.strides[0]
    vectors: FloatArray = np.lib.stride_tricks.as_strided(
        x, shape=(n, dimension), strides=(step, delay * step), writeable=False
    )
    return vectors


def chosen_delay(x: FloatArray, rate: float) -> int:
    """Return the delay at the first minimum of the mutual information."""
    return average_mutual_information(x, rate).delay_samples


def _chosen_dimension(x: FloatArray, rate: float, tau: int) -> int:
    embedding = embedding_dimension(x, rate, delay_samples=tau)
    if embedding.dimension == 0:
        raise RefusalError(
            f"no dimension up to {embedding.dimensions[-1]} unfolds the signal (false neighbours "
            f"{percent(float(embedding.false_fraction.min()))} at best): it looks stochastic",
            remedy="filter to the motion of interest, average synchronously, or set dimension= deliberately",
        )
    return embedding.dimension


N_SAMPLES = 200_000
"""Maximum number of samples used, from the start: the estimate's error is then below 1e-3 nats."""

MAX_DELAYS = 400
MAX_BINS = 48
SAMPLES_PER_CELL = 12
PERIODIC_SHARE = 0.4
"""A periodic signal predicts its future at every delay: its information stays above this share of its entropy."""


def average_mutual_information(
    values: FloatArray, sampling_rate_hz: float, *, longest_delay_samples: int | None = None, source: str = ""
) -> MutualInformation:
    """Return the average mutual information over delay, and the delay at its first minimum.

    I(τ) = Σ p(x(t), x(t+τ)) ln[ p(x(t), x(t+τ)) / (p(x(t)) p(x(t+τ))) ], from a histogram with equally filled bins
    (adaptive to the signal's distribution) and about 12 samples per cell, corrected for the counting bias.

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
        Its rule is "first minimum": the first minimum followed by a rise larger than the scatter of the estimate. Where
        this is not meaningful: "one step" for a signal without memory, a map or a section, whose neighbouring values
        differ by more than one standard deviation (rms); "quarter period" for a periodic signal, whose information does
        not fall below 0.4 of its entropy at any delay; "1/e" of the first value if there is no minimum.

    Raises
    ------
    InputError
        On NaN, too few samples, or a `longest_delay_samples` below 2.
    RefusalError
        If the signal is constant or too short for the longest delay, or the information has no minimum and does not
        fall to 1/e of its first value.

    Notes
    -----
    For a signal of one sine the first minimum lies near a quarter of its period.

    Source: A. M. Fraser, H. L. Swinney, *Independent coordinates for strange attractors from mutual information*,
    Physical Review A 33 (1986).
    """
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    x = checked_series(values, minimum=64)[:N_SAMPLES]
    longest = _longest_delay(x, longest_delay_samples)
    step = max(1, ceil(longest / MAX_DELAYS))
    delays = np.arange(0, longest + 1, step)
    bins, n_bins = equally_filled_bins(x)
    information = np.array([mutual_information(bins, n_bins, int(delay)) for delay in delays])
    delay, rule = _choose(information, _scatter(len(x) - longest, n_bins), step, x)
    return MutualInformation(information, step, rate, delay, rule, n_bins, source)


def equally_filled_bins(x: FloatArray) -> tuple[IndexArray, int]:
    """Return each sample's bin and the number of bins, bounded by quantiles; equal samples always share a bin."""
    n_bins = int(np.clip(np.sqrt(len(x) / SAMPLES_PER_CELL), 4, MAX_BINS))
    inner = np.quantile(x, np.arange(1, n_bins) / n_bins)
    return np.searchsorted(inner, x, side="right"), n_bins


def _longest_delay(x: FloatArray, max_delay: int | None) -> int:
    if max_delay is None:
        return int(np.clip(2.0 * mean_period_samples(x), 4, len(x) // 4))
    longest = count(max_delay, "longest_delay_samples", minimum=2)
    if longest > len(x) // 2:
        raise RefusalError(
            f"{len(x)} samples are too few for delays up to {longest}", remedy=f"ask for at most {len(x) // 2}"
        )
    return longest


def _scatter(n: int, n_bins: int) -> float:
    """Return the standard deviation of the estimate for independent samples: 2N·I is χ² with (B - 1)² degrees."""
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
            "the mutual information has no minimum and does not fall to 1/e within the delays examined",
            remedy="give a longer longest_delay_samples, or remove the trend from the signal",
        )
    return int(below[0]) * step, "1/e"


def first_minimum(information: FloatArray, scatter: float) -> int:
    """Return the index of the first minimum followed by a rise above the scatter; 0 if there is none."""
    at = 1
    for k in range(2, len(information)):
        if information[k] < information[at]:
            at = k
        elif information[k] > information[at] + max(4.0 * scatter, 0.02 * information[at]):
            return at
    return 0


def mutual_information(bins: IndexArray, n_bins: int, delay: int) -> float:
    """Return Σ p(i, j) ln(p(i, j) / (p(i) p(j))) of bins[t], bins[t + delay] in nats, corrected for bias.

    Counting makes the estimate too large by (filled cells - filled rows - filled columns + 1) / 2N.

    Source of the correction: M. S. Roulston, *Estimating the errors on measured entropy and mutual information*,
    Physica D 125 (1999).
    """
    n = len(bins) - delay
    cells = np.bincount(bins[:n] * n_bins + bins[delay:], minlength=n_bins**2).reshape(n_bins, n_bins)
    rows, columns = cells.sum(axis=1), cells.sum(axis=0)
    filled = cells > 0
    counts = cells[filled]
    total = float(np.sum(counts * np.log(counts * float(n) / np.multiply.outer(rows, columns)[filled])))
    bias = (np.count_nonzero(filled) - np.count_nonzero(rows) - np.count_nonzero(columns) + 1) / (2.0 * n)
    return max(total / n - bias, 0.0)


N_LIBRARY, N_REFERENCES = 20_000, 2_000
DISTANCE_RATIO, SIZE_RATIO = 15.0, 2.0  # Kennel's R_tol and A_tol


def embedding_dimension(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    delay_samples: int | None = None,
    largest: int = 10,
    threshold: float = 0.02,
    theiler_samples: int | None = None,
    source: str = "",
) -> EmbeddingDimension:
    """Return the smallest dimension at which (nearly) no nearest neighbour is false.

    Kennel: with R_d the distance to the nearest neighbour in d dimensions and Δ that along the next coordinate, the
    neighbour is false if Δ / R_d > 15 or √(R_d² + Δ²) > 2 σ. Cao: E(d) = mean of ‖·‖_{d+1} / ‖·‖_d (largest
    coordinate), E1 = E(d+1)/E(d); E*(d) = mean of Δ, E2 = E*(d+1)/E*(d).

    Parameters
    ----------
    values : array, (n_samples,)
        At least 200. From long signals, 20 000 evenly spread points serve as neighbours and 2000 as references.
    sampling_rate_hz : float
    delay_samples : int or None
        None: first minimum of the mutual information.
    largest : int
        Largest dimension tried, 2 to 15.
    threshold : float
        Share of false neighbours that counts as none. Noise causes some: 0.02 allows for noise of about 3 % of the
        signal's standard deviation.
    theiler_samples : int or None
        Points closer in time do not count as neighbours; None: one mean period.
    source : str

    Returns
    -------
    EmbeddingDimension
        Dimension 0 and verdict "stochastic" if no dimension reaches the threshold. Cao's E2 is informative only: near 1
        at every dimension also indicates a random signal.

    Notes
    -----
    To both criteria, narrow-band noise looks like a motion of few dimensions; the divergence curve distinguishes it,
    see `largest_lyapunov_exponent`.

    Raises
    ------
    InputError, RefusalError
        On NaN, a constant, or a signal too short for the largest dimension.

    Source: M. B. Kennel, R. Brown, H. D. I. Abarbanel, *Determining embedding dimension for phase-space reconstruction
    using a geometrical construction*, Physical Review A 45 (1992). L. Cao, *Practical method for determining the
    minimum embedding dimension of a scalar time series*, Physica D 110 (1997).
    """
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    x = checked_series(values, minimum=200)
    tau = chosen_delay(x, rate) if delay_samples is None else count(delay_samples, "delay_samples")
    count(largest, "largest", minimum=2, maximum=15)
    within(threshold, "threshold", 0.0, 0.5)
    window = round(mean_period_samples(x)) if theiler_samples is None else count(theiler_samples, "theiler_samples")
    n = len(x) - largest * tau
    if n < 100 + 2 * window:
        raise RefusalError(
            f"{len(x)} samples leave {max(n, 0)} points in {largest} dimensions at a delay of {tau} samples",
            remedy=f"record at least {100 + 2 * window + largest * tau} samples, or lower the largest dimension",
        )
    x = (x - x.mean()) / x.std()
    library, references = evenly_spaced_indices(n, N_LIBRARY), evenly_spaced_indices(n, N_REFERENCES)
    finest = float(np.diff(np.unique(x[library])).min())
    steps = [_step(x, tau, d, library, references, window, finest) for d in range(1, largest + 1)]
    false_fraction = np.array([step[0] for step in steps])
    growth, determinism = _ratios([step[1] for step in steps]), _ratios([step[2] for step in steps])
    below = np.flatnonzero(false_fraction <= threshold)
    dimension = int(below[0]) + 1 if len(below) else 0
    return EmbeddingDimension(
        dimensions=tuple(range(1, largest + 1)),
        false_fraction=false_fraction,
        growth=growth,
        determinism=determinism,
        dimension=dimension,
        verdict="deterministic" if dimension else "stochastic",
        threshold=threshold,
        delay_samples=tau,
        source=source,
    )


def _step(
    x: FloatArray, tau: int, d: int, library: np.ndarray, references: np.ndarray, window: int, finest: float
) -> tuple[float, float, float]:
    """Return the share of false neighbours, Cao's E and E* at dimension d; x has a standard deviation of one.

    Distances below the signal's resolution are set to it, since a coarse converter makes many points equal.
    """
    vectors = delay_vectors(x, tau, d)
    steps = []
    for norm in (2.0, np.inf):  # Kennel's distance, then Cao's
        distance, near = nearest_beyond_theiler_window(vectors, library, references, window, norm, equal_counts=True)
        known = near >= 0
        r = np.maximum(distance[known], finest)
        steps.append((r, np.abs(x[references[known] + d * tau] - x[near[known] + d * tau])))
    (r, step), (largest, change) = steps
    false = (step > DISTANCE_RATIO * r) | (np.hypot(r, step) > SIZE_RATIO)
    return float(false.mean()), float(np.mean(np.maximum(largest, change) / largest)), float(change.mean())


def _ratios(values: list[float]) -> FloatArray:
    v = np.asarray(values)
    ratios: FloatArray = v[1:] / np.maximum(v[:-1], np.finfo(float).tiny)
    return ratios
