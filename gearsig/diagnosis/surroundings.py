"""Whether a line stands out of what lies right beside it: the foot of a strong line is above the floor, and no line."""

from __future__ import annotations

from math import log

import numpy as np

from gearsig.checks import FloatArray
from gearsig.spectra.types import Spectrum

INNER_LINES = 3
"""Nearer lines belong to the line itself: two by the Hann window, one because it may lie between two."""

OUTER_LINES = 12
FEWEST_LINES = 6
"""Of fewer lines the median says too little."""

RUN_UP_FOOT_ORDERS = 0.1
"""Width of a line's foot over a run-up, where its level changes from resonance to resonance."""


def level_beside(spectrum: Spectrum, position: float, outer_lines: float = OUTER_LINES) -> float | None:
    """Return the amplitude (root of the mean power) of what lies beside a line, None if that is too few lines.

    The mean is taken from the median, P = median/ln 2 for lines of noise: then a neighbouring line does not raise it.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes.
    position : float
    outer_lines : float
        How far the surroundings reach, in lines.
    """
    i, n = spectrum.index_of(position), len(spectrum.values)
    reach = int(min(outer_lines, OUTER_LINES))
    below = spectrum.values[max(i - reach, 0) : max(i - INNER_LINES + 1, 0)]
    above = spectrum.values[min(i + INNER_LINES, n) : min(i + reach + 1, n)]
    beside = np.concatenate([below, above])
    if len(beside) < FEWEST_LINES:
        return None
    return float(np.sqrt(np.sort(beside**2)[len(beside) // 2] / log(2)))


def levels_beside(spectrum: Spectrum) -> FloatArray:
    """Return `level_beside` at every line; the ends are mirrored."""
    from scipy.ndimage import median_filter

    footprint = np.ones(2 * OUTER_LINES + 1, dtype=np.bool_)
    footprint[OUTER_LINES - INNER_LINES + 1 : OUTER_LINES + INNER_LINES] = False
    power = np.asarray(spectrum.values, dtype=np.float64) ** 2
    # As a single row: in one dimension SciPy's filter takes the whole width, holes of the footprint included.
    medians = median_filter(power[None, :], footprint=footprint[None, :], mode="reflect")[0]
    return np.asarray(np.sqrt(medians / log(2)))
