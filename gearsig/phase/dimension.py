"""The dimension of an embedding: false nearest neighbours, with Cao's test for randomness beside it."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, positive, within
from gearsig.errors import RefusalError
from gearsig.phase.checked_series import checked_series, mean_period_samples
from gearsig.phase.embedding import chosen_delay, delay_vectors
from gearsig.phase.measures import EmbeddingDimension
from gearsig.phase.neighbours import nearest_apart, spaced

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
    """Return the smallest dimension at which (nearly) no nearest neighbour is a false one.

    Kennel: with R_d the distance to the nearest neighbour in d dimensions and Δ that of the next coordinate, the
    neighbour is false if Δ / R_d > 15 or √(R_d² + Δ²) > 2 σ. Cao: E(d) = mean of ‖·‖_{d+1} / ‖·‖_d (largest
    coordinate), E1 = E(d+1)/E(d); E*(d) = mean of Δ, E2 = E*(d+1)/E*(d).

    Parameters
    ----------
    values : array, (n_samples,)
        At least 200. Of longer signals 20 000 points serve as neighbours, 2000 as references, evenly spread.
    sampling_rate_hz : float
    delay_samples : int or None
        None: first minimum of the mutual information.
    largest : int
        Largest dimension tried, 2 to 15.
    threshold : float
        Share of false neighbours that counts as none. Noise leaves some: 0.02 allows for noise of about 3 % of the
        signal's standard deviation.
    theiler_samples : int or None
        Points nearer in time are no neighbours; None: one mean period.
    source : str

    Returns
    -------
    EmbeddingDimension
        Dimension 0 and verdict "stochastic" where no dimension reaches the threshold. Cao's E2 is for reading: near 1
        at every dimension says random too.

    Notes
    -----
    Noise in a narrow band looks like a motion of few dimensions to both criteria; the divergence curve tells it apart,
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
    within(count(largest, "largest", minimum=2), "largest", 2, 15)
    within(threshold, "threshold", 0.0, 0.5)
    window = round(mean_period_samples(x)) if theiler_samples is None else count(theiler_samples, "theiler_samples")
    n = len(x) - largest * tau
    if n < 100 + 2 * window:
        raise RefusalError(
            f"{len(x)} samples leave {max(n, 0)} points in {largest} dimensions at a delay of {tau} samples",
            remedy=f"record at least {100 + 2 * window + largest * tau} samples, or lower the largest dimension",
        )
    x = (x - x.mean()) / x.std()
    library, references = spaced(n, N_LIBRARY), spaced(n, N_REFERENCES)
    finest = _resolution(x[library])
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
    x: FloatArray,
    tau: int,
    d: int,
    library: np.ndarray,
    references: np.ndarray,
    window: int,
    finest: float,
) -> tuple[float, float, float]:
    """Return the share of false neighbours, Cao's E and E* at dimension d; x has a standard deviation of one.

    Distances below the signal's resolution are taken as that: a coarse converter makes many points equal.
    """
    vectors = delay_vectors(x, tau, d)
    distance, near = nearest_apart(vectors, library, references, window, equal_counts=True)
    found = near >= 0
    here, there, r = references[found], near[found], np.maximum(distance[found], finest)
    step = np.abs(x[here + d * tau] - x[there + d * tau])
    false = (step > DISTANCE_RATIO * r) | (np.hypot(r, step) > SIZE_RATIO)
    largest, near = nearest_apart(vectors, library, references, window, np.inf, equal_counts=True)
    found = near >= 0
    here, there, r = references[found], near[found], np.maximum(largest[found], finest)
    change = np.abs(x[here + d * tau] - x[there + d * tau])
    return float(false.mean()), float(np.mean(np.maximum(r, change) / r)), float(change.mean())


def _resolution(x: FloatArray) -> float:
    """Return the smallest step between different values."""
    return float(np.diff(np.unique(x)).min())


def _ratios(values: list[float]) -> FloatArray:
    v = np.asarray(values)
    ratios: FloatArray = v[1:] / np.maximum(v[:-1], np.finfo(float).tiny)
    return ratios
