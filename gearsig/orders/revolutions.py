"""Whole revolutions of an angle signal."""

from __future__ import annotations

import numpy as np

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError


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
    from gearsig.angle.inversion import times_at

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
