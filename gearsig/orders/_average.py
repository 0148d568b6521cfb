"""Time-synchronous average of a shaft: one mean revolution, with its standard error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, count
from gearsig.errors import RefusalError
from gearsig.orders._types import SynchronousAverage

# --------------------
# Whole revolutions of an angle signal.
# --------------------


def first_whole_sample(signal: AngleSignal) -> tuple[int, int]:
    """Return (index of the first sample of a whole revolution, that revolution).

    The index is exact where the samples lie on multiples of 1/samples_per_revolution; else it is off by at most half
    a sample.
    """
    per_rev = signal.samples_per_revolution
    first = int(np.ceil(signal.start_revolution - 0.5 / per_rev))
    return round((first - signal.start_revolution) * per_rev), first


def whole_revolutions(signal: AngleSignal, channel: str, *, at_least: int = 1) -> FloatArray:
    """Return a channel as (n_revolutions, samples_per_revolution), partial revolutions at either end left out.

    Raises
    ------
    RefusalError
        If there are fewer than `at_least` whole revolutions.
    """
    x = signal.values(channel)
    start, _ = first_whole_sample(signal)
    per_rev = signal.samples_per_revolution
    n_rev = max(0, (len(x) - start) // per_rev)
    if n_rev < at_least:
        raise RefusalError(
            f"only {n_rev} whole revolution(s) of shaft {signal.shaft_angle.shaft!r}, {at_least} needed",
            remedy="record longer or at a higher speed",
        )
    revolutions: FloatArray = x[start : start + n_rev * per_rev].reshape(n_rev, per_rev)
    return revolutions


def unit_of(signal: AngleSignal, channel: str) -> str:
    """Return the unit of a channel."""
    signal.values(channel)  # raises where there is no such channel
    return signal.units[signal.channel_names.index(channel)]


def times_of_revolutions(angle: ShaftAngle, first: float, step: float, n: int) -> FloatArray:
    """Return the times at which the shaft passes `first`, `first` + `step`, … revolutions: n times."""
    from gearsig.angle import times_at

    out = np.empty(n)
    interval = int(np.searchsorted(angle.revolutions, first, side="right")) - 1
    times_at(
        angle.time_s,
        angle.revolutions,
        angle.speed_rev_per_s,
        min(max(interval, 0), len(angle.time_s) - 2),
        float(first),
        float(step),
        out,
    )
    return out


def block_times(
    signal: AngleSignal, first_sample: int, n_per_block: int, step: int, n_blocks: int
) -> tuple[FloatArray, FloatArray]:
    """Return (time of the middle, mean speed in rpm) of blocks of an angle signal."""
    per_rev = signal.samples_per_revolution
    start = signal.start_revolution + first_sample / per_rev
    length = n_per_block / per_rev
    begin, middle, end = (
        times_of_revolutions(signal.shaft_angle, start + part * length, step / per_rev, n_blocks)
        for part in (0.0, 0.5, 1.0)
    )
    return middle, 60.0 * length / (end - begin)


DEFAULT_JACKKNIFE_BLOCKS = 32


def synchronous_average(
    signal: AngleSignal, channel: str, *, n_jackknife_blocks: int = DEFAULT_JACKKNIFE_BLOCKS
) -> SynchronousAverage:
    """Return the mean over whole revolutions of the shaft that the signal was resampled on.

    a(θ) = 1/N Σ_r x(θ + r). Over N revolutions, the shaft's whole orders stay, noise falls as 1/√N, and order o is
    multiplied by |sin(πNo)/(N sin πo)|: other shafts' orders fall as 1/N, but are only gone where N·o is whole.

    Parameters
    ----------
    signal : AngleSignal
        Resampled on the angle of the shaft in question.
    channel : str
    n_jackknife_blocks : int
        At least 2. Revolutions are grouped in so many blocks (or as many as there are revolutions) before their
        scatter is taken, so that a correlation between neighbouring revolutions does not make the error too small.

    Returns
    -------
    SynchronousAverage
        From shaft angle 0, with the standard error of the mean at each angle.

    Raises
    ------
    RefusalError
        With fewer than two whole revolutions.
    InputError
        On an unknown channel.

    References
    ----------
    P. D. McFadden, "A revised model for the extraction of periodic waveforms by time domain averaging", 1987.
    S. Braun, "The synchronous (time domain) average revisited", 2011.
    M. H. Quenouille, "Notes on bias in estimation", 1956 (jackknife).
    """
    count(n_jackknife_blocks, "n_jackknife_blocks", minimum=2)
    revolutions = whole_revolutions(signal, channel, at_least=2)
    mean, standard_error = mean_and_error(revolutions, n_jackknife_blocks)
    return SynchronousAverage(
        values=mean,
        standard_error=standard_error,
        n_revolutions=len(revolutions),
        shaft=signal.shaft_angle.shaft,
        channel=channel,
        unit=unit_of(signal, channel),
        kind="average",
        highest_order=signal.highest_order,
    )


def mean_and_error(revolutions: FloatArray, n_blocks: int) -> tuple[FloatArray, FloatArray]:
    """Return mean over rows and its standard error by the delete-one-block jackknife.

    With B blocks, block sums s_b of n_b rows out of N: m_(b) = (Σs - s_b)/(N - n_b),
    SE² = (B - 1)/B Σ_b (m_(b) - mean of m_(b))².
    """
    n = len(revolutions)
    b = min(n, n_blocks)
    edges = np.linspace(0, n, b + 1).round().astype(np.intp)
    # Row blocks are summed one by one: no copy of the whole signal in double precision is made.
    sums = np.stack([revolutions[i:j].sum(axis=0, dtype=np.float64) for i, j in pairwise(edges)])
    total = sums.sum(axis=0)
    without = (total - sums) / (n - np.diff(edges))[:, None]
    standard_error: FloatArray = np.sqrt((b - 1.0) * without.var(axis=0))
    mean: FloatArray = total / n
    return mean, standard_error
