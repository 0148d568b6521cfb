"""Standardised moments, the kernel of kurtosis, FM4, M6A and M8A."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError

_ROUNDING = 1e-12  # scatter below this part of the signal's size is rounding, not signal


def checked_values(values: FloatArray, name: str = "values") -> FloatArray:
    """Return the values as float64, one-dimensional, finite and at least one."""
    x = frozen_array(values, name, ndim=1)
    if x.size == 0:
        raise InputError(f"{name} is empty", allowed="at least one value")
    return x.astype(np.float64, copy=False)


def is_constant(x: FloatArray, size: float | None = None) -> bool:
    """Whether the scatter of `x` is only rounding against `size` (default: its own largest magnitude)."""
    scale = float(np.abs(x).max()) if size is None else size
    largest_deviation = float(np.abs(x - x.mean()).max())
    return largest_deviation <= _ROUNDING * scale or largest_deviation == 0.0


def standardised_moment(x: FloatArray, order: int, size: float | None = None) -> float:
    """N^(k/2 - 1) Σ (x - x̄)^k / (Σ (x - x̄)²)^(k/2), i.e. the k-th central moment over σ^k, σ² with divisor N.

    nan for a constant; see `is_constant` for `size`.
    """
    if is_constant(x, size):
        return float("nan")
    d = x - x.mean()
    d = d / np.abs(d).max()  # powers up to 8 neither overflow nor vanish
    return float(np.mean(d**order) / np.mean(d * d) ** (order / 2))
