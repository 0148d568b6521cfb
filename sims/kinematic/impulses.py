"""Trains of decaying oscillations: what a structure answers to short knocks."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray

_LOWEST_RELATIVE_LEVEL = 1e-7  # where a decayed oscillation is cut off


def ring_down(
    n_samples: int,
    start_s: float,
    sampling_rate_hz: float,
    times_s: FloatArray,
    amplitudes: FloatArray,
    resonance_hz: float,
    damping_ratio: float,
) -> FloatArray:
    """Σ_k A_k exp(-ζ ω (t - t_k)) sin(ω_d (t - t_k)) for t ≥ t_k, evaluated exactly at the sampling instants.

    ω = 2π `resonance_hz`, ω_d = ω √(1 - ζ²): the impulse response of one mode, its envelope starting at A_k.

    Parameters
    ----------
    n_samples, start_s, sampling_rate_hz
        The sampling instants: start_s + i/sampling_rate_hz.
    times_s, amplitudes : arrays, (n_impulses,)
    resonance_hz : float
        ω/2π.
    damping_ratio : float
        ζ, between 0 and 1.

    Returns
    -------
    array, (n_samples,)
    """
    omega = 2 * np.pi * resonance_hz
    decay, omega_d = damping_ratio * omega, omega * np.sqrt(1 - damping_ratio**2)
    n_ring = min(n_samples, int(np.ceil(-np.log(_LOWEST_RELATIVE_LEVEL) / decay * sampling_rate_hz)) + 1)
    total = np.zeros(n_samples + n_ring)
    steps = np.arange(n_ring) / sampling_rate_hz
    for t_k, a_k in zip(times_s, amplitudes, strict=True):
        first = int(np.ceil((t_k - start_s) * sampling_rate_hz))
        if 0 <= first < n_samples:
            since = steps + (start_s + first / sampling_rate_hz - t_k)
            total[first : first + n_ring] += a_k * np.exp(-decay * since) * np.sin(omega_d * since)
    return total[:n_samples]
