"""Recordings by order, computed here from the tachometer: independent of the chain that the product uses."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import welch

from gearsig.recording import Recording

PER_TURN = 512
TURNS = 8


def pulse_times_s(recording: Recording) -> np.ndarray:
    """Times at which the tachometer rises through half its height."""
    x = recording.values("tacho").astype(float)
    i = np.flatnonzero((x[:-1] < 2.5) & (x[1:] >= 2.5))
    return (i + (2.5 - x[i]) / (x[i + 1] - x[i])) / recording.sampling_rate_hz


def by_angle(recording: Recording, channel: str = "a1") -> np.ndarray:
    """Samples at even angles of the input shaft, `PER_TURN` each turn, (n_turns, PER_TURN)."""
    pulses = pulse_times_s(recording)
    angle = CubicSpline(np.arange(len(pulses)), pulses)
    n = len(pulses) - 1
    times = angle(np.arange(n * PER_TURN) / PER_TURN)
    x = CubicSpline(recording.time_s(), recording.values(channel).astype(float))(times)
    return x.reshape(n, PER_TURN)


def order_power(recording: Recording, channel: str = "a1") -> tuple[np.ndarray, np.ndarray]:
    """Orders of the input shaft and power at each, an eighth of an order apart."""
    return welch(by_angle(recording, channel).ravel(), PER_TURN, "hann", TURNS * PER_TURN, scaling="spectrum")


def distance_db(a: Recording, b: Recording, channel: str = "a1") -> float:
    """Rms difference of two recordings' levels over all orders."""
    (_, x), (_, y) = order_power(a, channel), order_power(b, channel)
    floor = 1e-9 * max(x.max(), y.max())
    return float(np.sqrt(np.mean((10 * np.log10((x + floor) / (y + floor))) ** 2)))
