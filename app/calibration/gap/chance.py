"""What is drawn of a signature: sides, signs, balances, shares."""

from __future__ import annotations

import numpy as np

from app.calibration.gap.vibration import N_MESH_HARMONICS
from gearsig.checks import FloatArray

LARGEST_ADVANCE = 0.35
"""Of a mesh period, by which a tooth comes too early or too late."""


def draw_side(rng: np.random.Generator) -> int:
    """Return 0, driver, or 1, driven gear."""
    return int(rng.integers(2))


def sign(rng: np.random.Generator) -> float:
    """Return 1 or −1."""
    return float(rng.choice((-1.0, 1.0)))


def balance(rng: np.random.Generator, n: int) -> FloatArray:
    """Return n weights, the largest 1, any of the others nearly nothing."""
    weights = 10.0 ** (-rng.uniform(0.0, 1.5, n))
    weights[rng.uniform(size=n) < 0.25] = 0.0
    weights[int(rng.integers(n))] = 1.0
    found: FloatArray = weights
    return found


def steeply(rng: np.random.Generator) -> FloatArray:
    """Return shares of the mesh harmonics that fall with their number, from nearly not to steeply."""
    shares: FloatArray = np.arange(1.0, N_MESH_HARMONICS + 1.0) ** -rng.uniform(0.2, 2.0)
    return shares


def partly(rng: np.random.Generator) -> float:
    """Return 0, 1 or anything between."""
    return float(np.clip(rng.uniform(-0.5, 1.5), 0.0, 1.0))
