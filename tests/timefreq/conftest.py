"""Signals in closed form."""

import numpy as np
import pytest

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.timefreq import UniformSignal

RATE = 2000.0


@pytest.fixture
def sine():
    """Return a factory: frequency, amplitude → (signal of 4 s, analytic signal)."""

    def make(frequency_hz, amplitude=1.0, n=8001, dtype=np.float64):
        t = np.arange(n) / RATE
        z = amplitude * np.exp(1j * (2 * np.pi * frequency_hz * t + 0.7))
        return UniformSignal(z.real.astype(dtype), RATE, unit="m/s^2", source="a"), z

    return make


@pytest.fixture
def crossing():
    """Return a factory: level of the second chirp, noise → (signal, frequencies of both at given times)."""

    def make(second=1.0, noise=0.0, seed=0):
        t = np.arange(20_001) / RATE
        x = np.cos(2 * np.pi * (100 * t + 15 * t**2)) + second * np.cos(2 * np.pi * (400 * t - 15 * t**2) + 1.0)
        x = x + noise * np.random.default_rng(seed).normal(size=len(t))
        return UniformSignal(x, RATE), (lambda at: 100 + 30 * at, lambda at: 400 - 30 * at)

    return make


@pytest.fixture
def swept_angle_signal():
    """Order 7 at unit amplitude over 200 revolutions of a shaft that runs up from 10 to 30 rev/s."""
    revolutions = np.arange(200 * 64) / 64
    knots = np.linspace(0, 10, 101)
    angle = ShaftAngle("pinion", knots, 10 * knots + knots**2, 10 + 2 * knots, "pulses")
    return AngleSignal(np.cos(2 * np.pi * 7 * revolutions)[None, :], 64, angle, 0.0, ("a",), ("g",), 25.0)
