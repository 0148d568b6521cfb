"""Clipping: a signal that was held at a limit instead of turning round there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.recording.levels import Levels

MIN_RUN = 3
CORNER_DROP = 8.0
"""Twice the drop of a parabola, see below."""
HELD_RATIO = 3.0
PAIR_RATIO = 20.0
"""How much more frequent than the average value the extreme must be for pairs to count as runs. A tone whose period
is a whole number of samples has equal pairs too, but of all its values."""
PILE_WIDTH = 0.005
"""Width of the bands in the pile-up test, in parts of the range."""
PILE_RATIO = 6.0
MIN_PILE_SAMPLES = 20
MAX_REST_SHARE = 0.48
"""A level that holds half of the samples is where the signal rests (a pulse train's base, a square wave's level), not
a limit that it runs into."""


@dataclass(frozen=True)
class Clipping:
    """Samples held at a limit, and at which."""

    n_samples: int
    place: str


def find_clipping(x: FloatArray, levels: Levels, *, rest: float | None = None) -> Clipping | None:
    r"""Return where a channel is clipped, or None.

    A smooth peak is a parabola: what stays within a width w of the top for ±h samples has fallen by about 4 w after
    ±2 h. A run of at least three samples has a *corner* where the signal has fallen by more than 8 w there, on both
    sides: it was cut, not rounded. Two tests per end of the range look for such runs; either is enough.

    - *Held samples.* Runs of samples equal to the extreme, w being one step of the converter. They must hold three
      times as many samples as the next step below, as no noise does.
    - *Pile-up.* Runs in the last 0.5 % of the range, w. That band must hold 6 times as many samples as the 0.5 %
      before. Near a parabolic maximum, time goes with the square root of the distance from it, so that this ratio
      is at most

      .. math:: 1 / (\sqrt{2} - 1) = 2.41,

      which a sine reaches; noise stays below 1. It finds limits with a little noise on them, as an amplifier's.

    Parameters
    ----------
    x : array, (n_samples,)
    levels : Levels
        Those of `x`.
    rest : float or None
        Level at which the quantity itself stays for a time, e.g. 0 of a force between parts that come apart: an end of
        the range there is no limit of the measurement.
    """
    low, high = float(x.min()), float(x.max())
    ends = {}
    for sign, extreme in ((1.0, high), (-1.0, low)):
        if extreme == rest:
            continue
        distance = sign * (extreme - x)  # 0 at the extreme, positive elsewhere
        n = max(_n_held(distance, levels), _n_piled(distance, high - low, levels.step))
        if n and n < MAX_REST_SHARE * len(x):
            ends[extreme] = n
    if not ends:
        return None
    place = " and ".join(f"{extreme:.4g}" for extreme in ends)
    return Clipping(sum(ends.values()), place)


def _n_held(distance: FloatArray, levels: Levels) -> int:
    """Count the samples held exactly at the extreme, 0 if they are not more than noise would put there."""
    q = levels.step if levels.step is not None else float(np.finfo(distance.dtype).eps) * float(distance.max())
    held = distance == 0
    usual = len(held) / levels.n_used
    min_run = MIN_RUN if np.count_nonzero(held) < PAIR_RATIO * usual else 2
    n = _n_in_cornered_runs(held, distance, q, min_run)
    n_next = int(np.count_nonzero((distance > 0) & (distance <= 1.5 * q)))
    return int(np.count_nonzero(held)) if n > HELD_RATIO * n_next else 0


def _n_piled(distance: FloatArray, span: float, step: float | None) -> int:
    """Count the samples in the last band, 0 if it holds not far more than the one before."""
    width = PILE_WIDTH * span
    if step is not None and width < 2 * step:
        return 0  # the bands would hold one level or none
    in_last = distance < width
    n_last = _n_in_cornered_runs(in_last, distance, width, MIN_RUN)
    n_before = int(np.count_nonzero((distance >= width) & (distance < 2 * width)))
    return int(np.count_nonzero(in_last)) if n_last >= max(MIN_PILE_SAMPLES, PILE_RATIO * n_before) else 0


def _n_in_cornered_runs(at_limit: NDArray[np.bool_], distance: FloatArray, width: float, min_run: int) -> int:
    """Count the samples in runs of a length that end in corners."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], at_limit, [False]))))
    starts, stops = edges[::2], edges[1::2]
    long = stops - starts >= min_run
    starts, stops = starts[long], stops[long]
    half = -(-(stops - starts) // 2)
    before, after = starts - half, stops - 1 + half
    inside = (before >= 0) & (after < len(distance))
    drop = np.minimum(distance[before[inside]], distance[after[inside]])
    return int((stops - starts)[inside][drop > CORNER_DROP * width].sum())
