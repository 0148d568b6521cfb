"""Clipping: a signal that was held at a limit instead of turning round there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

MIN_RUN = 3
EDGE_DROP_STEPS = 8.0
PILE_WIDTH = 0.005
"""Width of the bands in the pile-up test, in parts of the range."""
PILE_RATIO = 6.0
MIN_PILE_SAMPLES = 20
MAX_REST_SHARE = 0.45
"""A level that holds nearly half of the samples or more is where the signal rests (a pulse train's base, a square
wave's level), not a limit that it runs into."""


@dataclass(frozen=True)
class Clipping:
    """Samples held at a limit, and at which."""

    n_samples: int
    place: str


def find_clipping(x: FloatArray, step: float | None) -> Clipping | None:
    r"""Return where a channel is clipped, or None.

    Two tests per end, either is enough:

    - *Held samples.* Three or more equal samples in a row at the extreme, with a corner at the run's ends. A smooth
      peak is a parabola: rounded to steps of size q it stays within one step for ±h samples, and has then fallen by
      about 4 q after ±2 h. Where the signal has fallen by more than 8 q, on either side, it was cut, not rounded.
      Runs like these must also outnumber the samples in the next step below, as no noise does.
    - *Pile-up.* The last 0.5 % of the range holds 6 times as many samples as the 0.5 % before. Near a parabolic
      maximum, time goes with the square root of the distance from it, so that ratio is at most

      .. math:: 1 / (\sqrt{2} - 1) = 2.41,

      which a sine reaches; noise stays below 1. It finds limits with a little noise on them, as an amplifier's.

    Parameters
    ----------
    x : array, (n_samples,)
    step : float or None
        Step of the converter, if known.
    """
    low, high = float(x.min()), float(x.max())
    ends = {}
    for sign, extreme in ((1.0, high), (-1.0, low)):
        distance = sign * (extreme - x)  # 0 at the extreme, positive elsewhere
        n = max(_n_held(distance, step), _n_piled(distance, high - low))
        if n and n < MAX_REST_SHARE * len(x):
            ends[extreme] = n
    if not ends:
        return None
    place = " and ".join(f"{extreme:.4g}" for extreme in ends)
    return Clipping(sum(ends.values()), place)


def _n_held(distance: FloatArray, step: float | None) -> int:
    """Count samples in runs at the extreme that end in a corner."""
    at_limit = np.concatenate(([False], distance == 0, [False]))
    edges = np.flatnonzero(np.diff(at_limit))
    starts, stops = edges[::2], edges[1::2]
    long = stops - starts >= MIN_RUN
    starts, stops = starts[long], stops[long]
    if not len(starts):
        return 0
    q = step if step is not None else float(np.finfo(distance.dtype).eps) * float(distance.max())
    half = -(-(stops - starts) // 2)
    before, after = starts - half, stops - 1 + half
    inside = (before >= 0) & (after < len(distance))
    drop = np.maximum(distance[before[inside]], distance[after[inside]])
    cornered = drop > EDGE_DROP_STEPS * q
    n = int((stops - starts)[inside][cornered].sum())
    n_next = int(np.count_nonzero((distance > 0) & (distance <= 1.5 * q)))
    return n if n > n_next else 0


def _n_piled(distance: FloatArray, span: float) -> int:
    """Count samples in the last band if it holds far more than the one before."""
    width = PILE_WIDTH * span
    n_last = int(np.count_nonzero(distance < width))
    n_before = int(np.count_nonzero((distance >= width) & (distance < 2 * width)))
    return n_last if n_last >= max(MIN_PILE_SAMPLES, PILE_RATIO * n_before) else 0
