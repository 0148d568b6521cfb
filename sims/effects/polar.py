"""Sum of two vectors that turn with a shaft: run-outs, unbalances."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, degrees, radians

import numpy as np

from sims.effects.effect import Option, OptionValue

ANGLE_OPTION = Option(
    "angle_deg", None, "where it lies, from the middle of tooth 1 the way the gear turns", "deg", -360.0, 360.0
)
"""Drawn where it is not given."""


def angle_or_drawn_deg(options: Mapping[str, OptionValue], rng: np.random.Generator) -> float:
    """Return `angle_deg`, or one drawn evenly from the circle."""
    drawn = float(rng.uniform(0.0, 360.0))
    return float(options.get("angle_deg", drawn))


def vector_sum(length: float, angle_deg: float, other_length: float, other_angle_deg: float) -> tuple[float, float]:
    """Length and angle of the sum; the angle from 0 to 360°.

    Examples
    --------
    >>> [round(x, 9) for x in vector_sum(3.0, 0.0, 4.0, 90.0)]
    [5.0, 53.130102354]
    """
    total = _vector(length, angle_deg) + _vector(other_length, other_angle_deg)
    return abs(total), degrees(atan2(total.imag, total.real)) % 360.0


def _vector(length: float, angle_deg: float) -> complex:
    return complex(length * np.exp(1j * radians(angle_deg)))
