"""The transfer path from the mesh to a sensor: a gain and a few resonances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError


@dataclass(frozen=True)
class Resonance:
    """One mode of the path: adds `gain` times the direct signal at its frequency, in phase.

    Parameters
    ----------
    frequency_hz : float
    damping_ratio : float
        Half the relative half-power bandwidth.
    gain : float
    """

    frequency_hz: float
    damping_ratio: float
    gain: float

    def __post_init__(self) -> None:
        positive(self.frequency_hz, "frequency_hz of a resonance", "Hz")
        within(self.damping_ratio, "damping_ratio of a resonance", 1e-4, 0.5)


@dataclass(frozen=True)
class TransferPath:
    """H(f) = G (1 + Σ g_i R_i(f)), R_i a resonator with R_i(f_i) = 1.

    Parameters
    ----------
    gain : float
        G.
    resonances : tuple of Resonance
    """

    gain: float = 1.0
    resonances: tuple[Resonance, ...] = ()

    def apply(self, signal: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Filter a signal causally, (n,) → (n,)."""
        from scipy.signal import lfilter

        total = np.array(signal, dtype=np.float64)
        for mode in self.resonances:
            b, a = _resonator(mode, sampling_rate_hz)
            total += mode.gain * lfilter(b, a, signal)
        return self.gain * total

    def response(self, frequency_hz: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Complex H at the given frequencies, as `apply` realises it."""
        from scipy.signal import freqz

        total = np.ones(np.shape(frequency_hz), dtype=complex)
        for mode in self.resonances:
            b, a = _resonator(mode, sampling_rate_hz)
            total += mode.gain * freqz(b, a, worN=np.asarray(frequency_hz), fs=sampling_rate_hz)[1]
        result: FloatArray = self.gain * total
        return result


def _resonator(mode: Resonance, sampling_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Second-order peak filter: gain 1 and phase 0 at its frequency, -3 dB bandwidth 2 ζ f."""
    from scipy.signal import iirpeak

    if mode.frequency_hz >= sampling_rate_hz / 2:
        raise InputError(
            f"a resonance at {mode.frequency_hz:g} Hz lies above half the sampling rate",
            allowed=f"below {sampling_rate_hz / 2:g} Hz",
        )
    b, a = iirpeak(mode.frequency_hz, 1 / (2 * mode.damping_ratio), fs=sampling_rate_hz)
    return b, a
