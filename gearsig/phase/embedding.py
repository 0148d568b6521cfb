"""Delay embedding: a path through phase space from one channel."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.phase.checked_series import checked_series
from gearsig.phase.types import PhasePortrait
from gearsig.recording.types import Recording


def delay_embedding(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    delay_samples: int | None = None,
    dimension: int | None = None,
    unit: str = "",
    source: str = "",
) -> PhasePortrait:
    """Return the path of delayed values: (x(t), x(t + τ), …, x(t + (d-1)τ)).

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    delay_samples : int or None
        None: the first minimum of the average mutual information.
    dimension : int or None
        1 to 20; None: from false nearest neighbours.
    unit, source : str

    Returns
    -------
    PhasePortrait
        Its points are a view into the signal: an embedding takes no memory of its own.

    Raises
    ------
    InputError
        On NaN, or if the signal is shorter than the embedding.
    RefusalError
        If the signal is constant; with dimension None also if no dimension unfolds it, as for noise.

    Source: F. Takens, *Detecting strange attractors in turbulence*, Lecture Notes in Mathematics 898 (1981).
    """
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    x = checked_series(values, minimum=16)
    tau = chosen_delay(x, rate) if delay_samples is None else count(delay_samples, "delay_samples")
    d = _chosen_dimension(x, rate, tau) if dimension is None else _checked_dimension(dimension)
    return PhasePortrait(
        points=delay_vectors(x, tau, d),
        sampling_rate_hz=rate,
        axis_names=tuple("x(t)" if k == 0 else f"x(t + {k * tau / rate:.4g} s)" for k in range(d)),
        units=(unit,) * d,
        kind="delay embedding",
        source=source,
        delay_samples=tau,
    )


def embed_channel(
    recording: Recording, channel: str, *, delay_samples: int | None = None, dimension: int | None = None
) -> PhasePortrait:
    """Return the delay embedding of a recording's channel; see `delay_embedding`."""
    unit = recording.channels[recording.index(channel)].unit
    return delay_embedding(
        recording.values(channel),
        recording.sampling_rate_hz,
        delay_samples=delay_samples,
        dimension=dimension,
        unit=unit,
        source=channel,
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
    from gearsig.phase.mutual_information import average_mutual_information

    return average_mutual_information(x, rate).delay_samples


def _checked_dimension(dimension: int) -> int:
    d = count(dimension, "dimension")
    if d > 20:
        raise InputError(f"dimension is {d}", allowed="1 to 20")
    return d


def _chosen_dimension(x: FloatArray, rate: float, tau: int) -> int:
    from gearsig.phase.dimension import embedding_dimension

    found = embedding_dimension(x, rate, delay_samples=tau)
    if found.dimension == 0:
        raise RefusalError(
            f"no dimension up to {found.dimensions[-1]} unfolds the signal (false neighbours "
            f"{100 * float(found.false_fraction.min()):.0f} % at best): it looks stochastic",
            remedy="filter to the motion of interest, average synchronously, or give dimension= knowingly",
        )
    return found.dimension
