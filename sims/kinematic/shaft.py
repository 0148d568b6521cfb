"""Vibration at low multiples of shaft speed: unbalance, misalignment, looseness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive


@dataclass(frozen=True)
class ShaftOrder:
    """One shaft order.

    Parameters
    ----------
    shaft : str
    amplitude_mps2 : float
        Peak amplitude at `at_rpm`, or at every speed where that is None.
    order : float
        Cycles per revolution of `shaft`; 1 for unbalance.
    phase_rad : float
    at_rpm : float or None
        Speed of `shaft` at which the amplitude holds; elsewhere it goes with speed squared, as unbalance does.
    """

    shaft: str
    amplitude_mps2: float
    order: float = 1.0
    phase_rad: float = 0.0
    at_rpm: float | None = None

    def __post_init__(self) -> None:
        not_negative(self.amplitude_mps2, f"amplitude_mps2 of the shaft order of {self.shaft!r}", "m/s^2")
        positive(self.order, f"order of shaft {self.shaft!r}")
        if self.at_rpm is not None:
            positive(self.at_rpm, f"at_rpm of the shaft order of {self.shaft!r}", "rpm")


def shaft_vibration(part: ShaftOrder, shaft_rev: FloatArray, speed_rpm: FloatArray) -> FloatArray:
    """A (n/n₀)² cos(2π k θ + φ), (n_samples,) in m/s²."""
    growth = 1.0 if part.at_rpm is None else (speed_rpm / part.at_rpm) ** 2
    wave: FloatArray = part.amplitude_mps2 * growth * np.cos(2 * np.pi * part.order * shaft_rev + part.phase_rad)
    return wave
