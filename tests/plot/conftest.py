"""Small results to draw."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gearsig.orders import SynchronousAverage
from gearsig.recording import Channel, Recording
from gearsig.spectra import Spectrum


@pytest.fixture
def spectrum_of() -> Callable[..., Spectrum]:
    def make(values: np.ndarray, scaling: str = "amplitude peak", axis: str = "order") -> Spectrum:
        positions = np.arange(len(values)) * 0.1
        return Spectrum(values, positions, axis, scaling, "m/s^2", 0.1, 0.15, "hann", 1, "a1", "input")

    return make


@pytest.fixture
def recording_of() -> Callable[..., Recording]:
    def make(samples: np.ndarray, *names: str) -> Recording:
        return Recording(np.atleast_2d(samples), 1000.0, tuple(Channel(n, "acceleration", "m/s^2") for n in names))

    return make


@pytest.fixture
def average_of() -> Callable[..., SynchronousAverage]:
    def make(values: np.ndarray, error: float = 0.1, kind: str = "residual") -> SynchronousAverage:
        return SynchronousAverage(values, np.full(len(values), error), 40, "input", "a1", "m/s^2", kind, 100.0)

    return make
