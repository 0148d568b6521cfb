"""Where two branches of a bifurcation diagram hold different motions, as ranges of what is varied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.phase.bifurcation import DIFFERS, values_apart
from gearsig.phase.types import BifurcationDiagram


@dataclass(frozen=True)
class TwoMotions:
    """Neighbouring values at which two branches are apart.

    Parameters
    ----------
    first, last : float
        The lowest and the highest of them, out of the values tried.
    low, high : float
        Half way to the values where the branches agree, never more than half a step of the sweep.
    begins_with_sweep, ends_with_sweep : bool
        Whether it reaches an end of the values tried: it may go on beyond.
    """

    first: float
    last: float
    low: float
    high: float
    begins_with_sweep: bool
    ends_with_sweep: bool


def coexistence_ranges(
    up: BifurcationDiagram, down: BifurcationDiagram, *, differs: float = DIFFERS
) -> tuple[TwoMotions, ...]:
    """Return the ranges in which two motions coexist, ascending; see `values_apart` for when they do.

    Where a range begins and ends is known to half a step only, and how wide it is depends on the sweep: a jump back
    needs a sweep that goes far enough to lose each motion.

    Raises
    ------
    InputError
        As `values_apart`.
    """
    values = np.intersect1d(up.values, down.values)
    apart = np.isin(values, values_apart(up, down, differs=differs))
    steps = np.diff(np.concatenate([[False], apart, [False]]).astype(int))
    half = 0.5 * step_of(up, down)
    found = []
    for start, stop in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1) - 1, strict=True):
        first, last = float(values[start]), float(values[stop])
        at_start, at_end = bool(start == 0), bool(stop == len(values) - 1)
        low = first if at_start else first - min(half, 0.5 * (first - float(values[start - 1])))
        high = last if at_end else last + min(half, 0.5 * (float(values[stop + 1]) - last))
        found.append(TwoMotions(first, last, low, high, at_start, at_end))
    return tuple(found)


def step_of(up: BifurcationDiagram, down: BifurcationDiagram) -> float:
    """Return the step between the values that both branches have, the median one; 0 for a single value."""
    values = np.intersect1d(up.values, down.values)
    return float(np.median(np.diff(values))) if len(values) > 1 else 0.0
