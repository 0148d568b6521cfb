"""Static contact of all tooth pairs at once: transmission error under load, and what each pair carries."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sqrt, tan

import numpy as np

from gearsig.checks import FloatArray

REACH = 0.35
"""Base pitches off either end of the path of contact at which a loaded pair may still touch."""
N_PATH = 96
"""Points of a table over the path."""
N_PAIRS = 4
"""Of teeth that may touch at an instant: contact ratios reach 2."""


@dataclass(frozen=True)
class Path:
    """The path of contact of a pair without profile shift, in base pitches from its start.

    Parameters
    ----------
    ratio : float
        Contact ratio: where the path ends.
    pitch_point : float
    base_pitch_m : float
    """

    ratio: float
    pitch_point: float
    base_pitch_m: float

    @classmethod
    def of(cls, teeth: tuple[int, int], module_mm: float, pressure_angle_deg: float) -> Path:
        """Return that of standard teeth, whose addendum is one module."""
        alpha, module = radians(pressure_angle_deg), 1e-3 * module_mm
        pitch_m = pi * module * cos(alpha)
        base = [0.5 * z * module * cos(alpha) for z in teeth]
        beyond = [
            sqrt((0.5 * z * module + module) ** 2 - b**2) - b * tan(alpha) for z, b in zip(teeth, base, strict=True)
        ]
        # An undercut mate ends the path where its involute begins.
        beyond = [min(own, other * tan(alpha)) for own, other in zip(beyond, reversed(base), strict=True)]
        return cls(sum(beyond) / pitch_m, beyond[1] / pitch_m, pitch_m)

    @property
    def places(self) -> FloatArray:
        """Of a table's points."""
        return np.linspace(-REACH, self.ratio + REACH, N_PATH)


def meeting(cycle: FloatArray, path: Path, tables: tuple[FloatArray, FloatArray], first: tuple[int, int]) -> FloatArray:
    """Return the sum of both gears' tables where each pair meets, (N_PAIRS, n).

    Parameters
    ----------
    cycle : array, (n,)
        Mesh cycles since the teeth `first` began to meet.
    path : Path
    tables : (array, array)
        (teeth, N_PATH) of either gear.
    first : (int, int)
    """
    number, spot = _pairs(cycle, path)
    low = np.clip(spot.astype(np.intp), 0, N_PATH - 2)
    part = np.clip(spot - low, 0.0, 1.0)
    total = np.zeros(spot.shape)
    for table, offset in zip(tables, first, strict=True):
        flat, row = table.ravel(), (number + offset) % len(table) * N_PATH + low
        total += (1.0 - part) * flat[row] + part * flat[row + 1]
    return total


def at_places(cycle: FloatArray, path: Path, table: FloatArray) -> FloatArray:
    """Return a table over the path where each pair is, (N_PAIRS, n)."""
    _, spot = _pairs(cycle, path)
    values: FloatArray = np.interp(spot, np.arange(N_PATH), table)
    return values


def _pairs(cycle: FloatArray, path: Path) -> tuple[np.ndarray, FloatArray]:
    """Return the numbers of the pairs that may touch and where they are, in points of a table."""
    newest = np.floor(cycle + REACH).astype(np.intp)
    number = newest[None] - np.arange(N_PAIRS)[:, None]
    spot = (cycle[None] - number + REACH) * ((N_PATH - 1) / (path.ratio + 2.0 * REACH))
    return number, spot


def is_in_reach(cycle: FloatArray, path: Path) -> np.ndarray:
    """Return which pairs are between the table's ends."""
    _, spot = _pairs(cycle, path)
    inside: np.ndarray = (spot >= 0.0) & (spot <= N_PATH - 1)
    return inside


def static_contact(stiffness: FloatArray, gaps: FloatArray, load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the transmission error x with Σ kᵢ max(x − gᵢ, 0) = F, and what each pair carries.

    Of the pairs with the m smallest gaps alone, x_m = (F + Σ kᵢ gᵢ)/Σ kᵢ; the left side is convex, so x is the
    smallest of them.

    Parameters
    ----------
    stiffness, gaps : arrays, (N_PAIRS, n)
        N/m, m.
    load : array, (n,)
        N, above 0.

    Returns
    -------
    array, (n,), m
    array, (N_PAIRS, n), N
    """
    order = np.argsort(gaps, axis=0)
    k, g = np.take_along_axis(stiffness, order, axis=0), np.take_along_axis(gaps, order, axis=0)
    error = ((load + np.cumsum(k * g, axis=0)) / np.cumsum(k, axis=0)).min(axis=0)
    return error, stiffness * np.maximum(error - gaps, 0.0)
