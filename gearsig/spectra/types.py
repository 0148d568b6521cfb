"""A spectrum that knows its scaling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError

Scaling = Literal["amplitude peak", "amplitude rms", "power", "power density", "dimensionless"]
Axis = Literal["frequency", "order", "quefrency"]


@dataclass(frozen=True)
class Spectrum:
    """Values over frequency (Hz), order (cycles per revolution) or quefrency (s).

    Parameters
    ----------
    values : array, (n_lines,)
    positions : array, (n_lines,)
        Equally spaced, from zero.
    axis : str
        "frequency", "order" or "quefrency".
    scaling : str
        "amplitude peak": a bin-centred sine of amplitude 1 reads 1; "amplitude rms": it reads 1/√2; "power": 1/2 (mean
        square); "power density": mean square per unit of the axis; "dimensionless" for cepstra.
    unit : str
        Of the values, written out with the scaling, e.g. "m/s^2", "(m/s^2)^2/Hz".
    resolution : float
        Spacing of the lines.
    noise_bandwidth : float
        Equivalent noise bandwidth of the window, in the axis' unit.
    window : str
    n_averages : int
    source : str
        The signal it was computed on: channel, and what was done to it.
    shaft : str
        The shaft that orders are counted on; empty for frequencies.
    """

    values: FloatArray
    positions: FloatArray
    axis: Axis
    scaling: Scaling
    unit: str
    resolution: float
    noise_bandwidth: float
    window: str
    n_averages: int
    source: str
    shaft: str = ""

    def __post_init__(self) -> None:
        for name in ("values", "positions"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=1))
        if len(self.values) != len(self.positions):
            raise InputError(f"{len(self.values)} values for {len(self.positions)} positions")

    @property
    def axis_label(self) -> str:
        """Axis with unit, for figures and tables."""
        if self.axis == "order":
            return f"order (cycles per revolution of {self.shaft or 'the shaft'})"
        return {"frequency": "frequency (Hz)", "quefrency": "quefrency (s)"}[self.axis]

    def index_of(self, position: float) -> int:
        """Index of the line nearest to `position`."""
        return int(np.clip(round((position - float(self.positions[0])) / self.resolution), 0, len(self.values) - 1))

    def largest_near(self, position: float, half_width: float) -> tuple[float, float]:
        """Return (position, value) of the largest line within `half_width` of `position`."""
        low, high = self.index_of(position - half_width), self.index_of(position + half_width)
        best = low + int(np.argmax(self.values[low : high + 1]))
        return float(self.positions[best]), float(self.values[best])
