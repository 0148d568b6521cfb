"""Borders between the lines of a squeezed transform, and where to look a frequency up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.timefreq.types import Spacing

_N_CELLS = 4096


@dataclass(frozen=True)
class SqueezeLines:
    """Borders of the lines in radians per sample, (n_lines + 1,), and the line at the left end of equal cells."""

    borders: FloatArray
    lookup: NDArray[np.int64]


def squeeze_lines(lines: FloatArray, rate: float, spacing: Spacing) -> SqueezeLines:
    """Return borders half-way between the lines, on the logarithm where they are spaced on it."""
    logarithmic = spacing == "logarithmic"
    places = np.log(lines) if logarithmic else np.asarray(lines)
    half = np.diff(places) / 2 if len(places) > 1 else np.array([0.5 if not logarithmic else 0.02])
    borders = np.concatenate([[places[0] - half[0]], places[:-1] + half[: len(places) - 1], [places[-1] + half[-1]]])
    borders = (np.exp(borders) if logarithmic else borders) * (2 * np.pi / rate)
    return SqueezeLines(borders, _lookup(borders))


def _lookup(borders: FloatArray) -> NDArray[np.int64]:
    # One cell more than used: the highest frequency may round into it.
    cells = borders[0] + np.arange(_N_CELLS + 1) * (borders[-1] - borders[0]) / (_N_CELLS + 1)
    found = np.searchsorted(borders, cells, side="right") - 1
    result: NDArray[np.int64] = np.clip(found, 0, len(borders) - 2).astype(np.int64)
    return result
