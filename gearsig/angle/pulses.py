"""Pulse edges in a tachometer channel: Schmitt trigger with sub-sample edge times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from gearsig.checks import FloatArray, frozen_array, one_of, positive
from gearsig.errors import InputError, RefusalError

# The levels are read at these percentiles: 0.05 % of spikes do no harm, and pulses may be as short as 0.1 % of a
# period.
_LOW_PERCENTILE, _HIGH_PERCENTILE = 0.05, 99.95
# Share of samples in the middle half between the levels: pulses 0 to 0.1, a sine 0.33, uniform noise 0.5, Gaussian 0.9.
_MOST_IN_THE_MIDDLE = 0.45


@dataclass(frozen=True)
class PulseEdges:
    """Edges found in a tachometer channel.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        On the recording's time axis.
    tick_s : float
        Time step that the edges are quantised to: the sampling interval if the signal jumps from level to level within
        one sample, 0 if the edges are resolved by interpolation.
    threshold, hysteresis : float
        As used, in the channel's unit.
    low, high : float
        Levels of the signal.
    """

    times_s: FloatArray
    tick_s: float
    threshold: float
    hysteresis: float
    low: float
    high: float


def find_pulse_edges(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    threshold: float | None = None,
    hysteresis: float | None = None,
    edge: str = "rising",
) -> PulseEdges:
    """Find the edges of a pulse signal.

    The trigger is armed below threshold - hysteresis/2 and fires above threshold + hysteresis/2; the edge lies where
    the straight line between the two samples around the last crossing meets the threshold.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    threshold : float, optional
        Default: half way between the low and the high level, the 0.05 and the 99.95 percentile.
    hysteresis : float, optional
        Full width; default: a quarter of the step from low to high.
    edge : str
        "rising" or "falling".

    Returns
    -------
    PulseEdges
        May hold no pulse at all: the pulse train's own check speaks about that.

    Raises
    ------
    RefusalError
        If the levels are to be found and the channel has no two levels: constant, or noise.

    Notes
    -----
    Not for a channel that holds an analogue speed or an angle.
    """
    x = frozen_array(values, "tachometer channel", ndim=1)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    one_of(edge, "edge", ("rising", "falling"))
    low, high = (float(v) for v in np.percentile(x, (_LOW_PERCENTILE, _HIGH_PERCENTILE)))
    if high - low < 0.1 * float(np.ptp(x)):  # pulses so short or few that the percentiles pass them by
        low, high = float(x.min()), float(x.max())
    if threshold is None:
        _check_two_levels(x, low, high)
        threshold = 0.5 * (low + high)
    if hysteresis is None:
        hysteresis = 0.25 * (high - low)
    if hysteresis < 0:
        raise InputError(f"hysteresis is {hysteresis:g}", where="tachometer", allowed=">= 0")
    sign = 1.0 if edge == "rising" else -1.0
    positions, jumps = _schmitt(x, sign, sign * threshold, hysteresis / 2, 0.1 * (high - low))
    tick_s = 0.0
    if len(jumps) and np.mean(jumps) > 0.8:
        # A jump within one sample says only between which samples the edge lies; the middle is the best guess.
        positions = np.where(jumps, np.ceil(positions) - 0.5, positions)
        tick_s = 1.0 / sampling_rate_hz
    return PulseEdges(positions / sampling_rate_hz, tick_s, threshold, hysteresis, low, high)


def _check_two_levels(x: FloatArray, low: float, high: float) -> None:
    step = high - low
    remedy = "check which channel carries the pulses, or give threshold and hysteresis"
    if step <= 1e-12 * max(abs(low), abs(high)):
        raise RefusalError(f"the tachometer channel stays at {low:g}: there are no pulses", remedy=remedy)
    middle = float(np.mean((x > low + 0.25 * step) & (x < low + 0.75 * step)))
    if middle > _MOST_IN_THE_MIDDLE:
        raise RefusalError(
            f"the tachometer channel has no two levels: {100 * middle:.0f} % of its samples lie in the middle "
            f"between {low:g} and {high:g}",
            remedy=remedy,
        )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _schmitt(x, sign, threshold, half_width, near):  # type: ignore[no-untyped-def]
    """Return positions (in samples) of upward edges of sign·x, and whether each is a jump from level to level.

    At a jump the two samples around the edge differ by most of the step between the levels (ten times `near`), and the
    samples before and after change by less than `near`.
    """
    n = x.shape[0]
    positions = np.empty(n // 2 + 1)
    jumps = np.zeros(n // 2 + 1, dtype=np.bool_)
    count = 0
    armed = False
    crossing = -1.0
    at = 0
    for i in range(n):
        value = sign * x[i]
        if value < threshold - half_width:
            armed = True
        if i > 0 and armed:
            before = sign * x[i - 1]
            if before < threshold <= value:
                crossing = i - 1 + (threshold - before) / (value - before)
                at = i
            if value >= threshold + half_width and crossing >= 0.0:
                positions[count] = crossing
                flat_before = at < 2 or abs(x[at - 1] - x[at - 2]) < near
                flat_after = at + 1 >= n or abs(x[at + 1] - x[at]) < near
                high_step = abs(x[at] - x[at - 1]) > 7 * near
                jumps[count] = high_step and flat_before and flat_after
                count += 1
                armed = False
                crossing = -1.0
    return positions[:count], jumps[:count]
