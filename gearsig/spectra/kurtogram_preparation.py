"""What a signal may be rid of before its kurtogram: steady tones, or the colour of its spectrum."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, one_of, positive
from gearsig.spectra.blocks import ComplexArray, checked_signal
from gearsig.spectra.floor import noise_floor
from gearsig.spectra.types import Spectrum

Preparation = Literal["none", "tones removed", "whitened"]
PREPARATIONS = ("none", "tones removed", "whitened")
TONE_LIMIT = 20.0
"""Power over the floor from which on a line is a tone: of noise, one line in e²⁰, half a billion, gets there."""


def prepared_signal(values: FloatArray, sampling_rate_hz: float, preparation: Preparation) -> FloatArray:
    """Return a signal without its steady tones, or with all lines equally strong.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    preparation : str
        "none"; "tones removed": lines of the whole signal's spectrum more than 13 dB above the floor are cut down to
        the floor, phases kept, which takes out mesh and shaft harmonics of a steady speed; "whitened": every line is
        divided by its magnitude (cepstral prewhitening), which takes out tones and resonances alike.

    Returns
    -------
    array, (n_samples,)
        In the signal's unit; dimensionless with a mean square of 1 where whitened. Without mean.

    Notes
    -----
    Impulses that repeat exactly are lines themselves and go with the tones; a bearing's slip keeps them. Where the
    speed drifts by more than a line, harmonics are no lines: average over the shaft angle, and take the residual.

    References
    ----------
    P. Borghesani, P. Pennacchi, R. B. Randall, N. Sawalhi and R. Ricci, "Application of cepstrum pre-whitening for
    the diagnosis of bearing faults under variable speed conditions", 2013.
    """
    from scipy.fft import irfft, rfft

    x = checked_signal(values, minimum=64)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if one_of(preparation, "preparation", PREPARATIONS) == "none":
        return x
    lines: ComplexArray = rfft(x.astype(np.float64))
    lines[0] = 0.0
    lines *= _tone_gain(lines, fs / len(x)) if preparation == "tones removed" else _white_gain(lines)
    result: FloatArray = irfft(lines, len(x), overwrite_x=True)
    return result


def _tone_gain(lines: ComplexArray, resolution: float) -> FloatArray:
    power = lines.real**2 + lines.imag**2
    positions = np.arange(len(power)) * resolution
    raw = Spectrum(power, positions, "frequency", "power", "", resolution, resolution, "rectangular", 1, "")
    floor = noise_floor(raw).values
    gain = np.ones(len(power))
    tones = power > TONE_LIMIT * floor
    gain[tones] = np.sqrt(floor[tones] / power[tones])
    return gain


def _white_gain(lines: ComplexArray) -> FloatArray:
    magnitude = np.abs(lines)
    level = np.sqrt(len(lines) - 1.0)  # gives a mean square of about 1
    result: FloatArray = np.divide(level * np.sqrt(2.0), magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return result
