"""The levels a channel's samples take: a converter's steps, if there are any."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

GRID_TOLERANCE = 0.02
"""Largest distance of a level from the grid, in steps: scaling in float32 moves levels a little."""


@dataclass(frozen=True)
class Levels:
    """Distinct values of a channel.

    Parameters
    ----------
    n_used : int
        Distinct values.
    step : float or None
        Distance of the converter's levels; None if the values lie on no grid.
    n_spanned : int
        Levels from lowest to highest, both counted; `n_used` if they lie on no grid.
    """

    n_used: int
    step: float | None
    n_spanned: int


def find_levels(x: FloatArray) -> Levels:
    """Return the levels of a channel, (n_samples,).

    The step is the smallest distance between two distinct values if all values are whole multiples of it apart. A
    signal that never takes neighbouring levels has no step here, and a long float signal has none either.
    """
    values = np.unique(x).astype(np.float64)
    if len(values) < 2:
        return Levels(1, None, 1)
    step = float(np.diff(values).min())
    span = float(values[-1] - values[0])
    if step < 1e-7 * span:  # finer than 23 bits: rounding of floats, no converter
        return Levels(len(values), None, len(values))
    numbers = (values - values[0]) / step
    # The smallest distance is one of many and a little wrong; the span divided by its number of steps is not.
    step = span / round(span / step)
    numbers = (values - values[0]) / step
    if np.abs(numbers - np.round(numbers)).max() > GRID_TOLERANCE:
        return Levels(len(values), None, len(values))
    return Levels(len(values), step, round(span / step) + 1)
