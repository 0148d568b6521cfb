"""Lines of a spectrum that stand above its noise floor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray, within
from gearsig.errors import InputError
from gearsig.spectra.floor import line_powers, noise_floor
from gearsig.spectra.types import Spectrum
from gearsig.spectra.window import window_response

SKIRT_BINS = 200
"""How far a strong line's leakage is followed."""

SKIRT_MARGIN = 2.0
"""Leakage is tested against this times its envelope, in amplitude: noise on top of a skirt is not a line."""


@dataclass(frozen=True)
class Line:
    """A line that stands above the noise floor.

    Parameters
    ----------
    position : float
        Frequency or order, interpolated between the spectrum's lines.
    value : float
        In the spectrum's scaling, corrected for the loss between two lines; a density's is that of its line.
    floor : float
        Mean noise there, in the same scaling.
    ratio_db : float
        20 lg of the amplitude ratio, 10 lg of the power ratio, of the highest line to the floor.
    """

    position: float
    value: float
    floor: float
    ratio_db: float


def find_lines(
    spectrum: Spectrum,
    floor: Spectrum | None = None,
    *,
    false_alarm: float = 0.01,
    threshold_db: float | None = None,
) -> tuple[Line, ...]:
    """Return the lines above the noise floor, in order of position.

    A line is a local maximum above floor + threshold that is not leakage of a stronger one. Without `threshold_db`,
    the threshold holds the probability of any false line in the whole spectrum at `false_alarm`: under Gaussian noise
    the power of one of n lines, averaged K times, exceeds t times its mean with probability Q(K, K t) (for K = 1,
    exp(-t)), so that Q(K, K t) = false_alarm/n.

    Parameters
    ----------
    spectrum : Spectrum
        Over frequency or order.
    floor : Spectrum or None
        From `noise_floor` of the same spectrum; None takes its defaults.
    false_alarm : float
        1e-12 to 0.5, for the whole spectrum.
    threshold_db : float or None
        Overrides `false_alarm`.

    Returns
    -------
    tuple of Line
        Positions are exact for a single steady tone without noise. They come from the ratio of the two highest lines
        and the window's transform; so does the correction of the value.

    Raises
    ------
    InputError
        On a floor that does not belong to the spectrum, or a cepstrum.

    Notes
    -----
    The rate holds for Gaussian noise with a floor that follows its density; impulses and a modulated carrier's skirts
    are neither. A floor from few lines scatters and raises the rate: 256 lines about 1.3 times, 64 lines 2.5 times.
    The lines at DC and Nyquist and the window's main lobe around DC are left out.

    References
    ----------
    D. C. Rife and G. A. Vincent, "Use of the discrete Fourier transform in the measurement of frequencies and levels
    of tones", 1970 (interpolation by the window's transform). C. E. Bonferroni's inequality bounds the rate.

    Examples
    --------
    >>> from gearsig.spectra.amplitude import amplitude_spectrum
    >>> t = np.arange(20000) / 1000
    >>> x = 0.3 * np.sin(2 * np.pi * 50.02 * t) + np.random.default_rng(1).normal(size=len(t))
    >>> [(round(line.position, 2), round(line.value, 1)) for line in find_lines(amplitude_spectrum(x, 1000.0))]
    [(50.02, 0.3)]
    """
    base = noise_floor(spectrum) if floor is None else floor
    if len(base.values) != len(spectrum.values) or base.scaling != spectrum.scaling:
        raise InputError("the floor does not belong to the spectrum", remedy="take noise_floor of the same spectrum")
    power, mean_noise = line_powers(spectrum), line_powers(base)
    first = 1 + int(np.ceil(_half_lobe(spectrum.window)))
    if threshold_db is not None:
        threshold = 10.0 ** (float(threshold_db) / 10.0)
    else:
        rate = within(false_alarm, "false_alarm", 1e-12, 0.5)
        threshold = false_alarm_ratio(rate / max(1, len(power) - first - 1), spectrum.n_averages)
    with np.errstate(divide="ignore", invalid="ignore"):  # a floor of zero: only what is above zero is infinite
        ratio = np.where(power > 0, power / mean_noise, 0.0)
    peaks = _local_maxima(power, first)
    peaks = peaks[ratio[peaks] > threshold]
    peaks = _without_leakage(peaks, power, mean_noise, spectrum.window)
    return tuple(_line(spectrum, power, base, int(k), float(ratio[k])) for k in peaks)


def false_alarm_ratio(probability: float, n_averages: int) -> float:
    """Return the ratio to its mean that a noise line's power exceeds with the given probability.

    Examples
    --------
    >>> round(false_alarm_ratio(1e-3, 1), 4)
    6.9078
    """
    from scipy.special import gammainccinv

    return float(gammainccinv(n_averages, probability)) / n_averages


def _local_maxima(power: FloatArray, first: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return indices of lines above both neighbours, from `first` to the last but one."""
    inner = power[1:-1]
    peaks = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    return peaks[peaks >= first]


def _without_leakage(
    peaks: np.ndarray[tuple[int], np.dtype[np.intp]], power: FloatArray, mean_noise: FloatArray, window: str
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Drop peaks that a stronger one's leakage explains: power below margin² · envelope² · that peak's power."""
    envelope = (SKIRT_MARGIN * _leakage_envelope(window)) ** 2
    explained = np.zeros_like(power)
    strong = peaks[power[peaks] * envelope[2] > mean_noise[peaks]]  # others leak less than the noise
    for k in strong[np.argsort(-power[strong])]:
        if power[k] <= explained[k]:
            continue
        low, high = max(0, k - SKIRT_BINS), min(len(power), k + SKIRT_BINS + 1)
        skirt = power[k] * envelope[np.abs(np.arange(low, high) - k)]
        skirt[k - low] = 0.0
        np.maximum(explained[low:high], skirt, out=explained[low:high])
    return peaks[power[peaks] > explained[peaks]]


def _line(spectrum: Spectrum, power: FloatArray, base: Spectrum, k: int, ratio: float) -> Line:
    offset, loss = _interpolate(power[k - 1 : k + 2], spectrum.window)
    is_density = spectrum.scaling == "power density"
    gain = 1.0 if is_density else 1.0 / loss if spectrum.scaling != "power" else 1.0 / loss**2
    return Line(
        position=float(spectrum.positions[0]) + (k + offset) * spectrum.resolution,
        value=float(spectrum.values[k]) * gain,
        floor=float(base.values[k]),
        ratio_db=float(10 * np.log10(ratio)),
    )


def _interpolate(three: FloatArray, window: str) -> tuple[float, float]:
    """Return (offset in lines from the middle one, window response there) from three lines' powers."""
    side = 1 if three[2] >= three[0] else -1
    offsets, ratios, responses = _ratio_table(window)
    ratio = np.sqrt(three[1 + side] / three[1])
    offset = float(np.interp(ratio, ratios, offsets))
    return side * offset, float(np.interp(offset, offsets, responses))


@lru_cache(maxsize=8)
def _ratio_table(window: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return offsets 0 … 0.5 of a tone from its highest line, neighbour-to-highest ratio, response at the highest."""
    offsets = np.linspace(0.0, 0.5, 501)
    own, neighbour = window_response(window, offsets), window_response(window, 1.0 - offsets)
    return offsets, neighbour / own, own


@lru_cache(maxsize=8)
def _leakage_envelope(window: str) -> FloatArray:
    """Return the largest response at or beyond each distance in lines, for a tone anywhere between two lines.

    Relative to the tone's highest line, which is up to half a line off.
    """
    fine = window_response(window, np.arange(0, 8 * (SKIRT_BINS + 9)) / 8.0)
    beyond = np.maximum.accumulate(fine[::-1])[::-1]
    distance = np.maximum(np.arange(SKIRT_BINS + 1) * 8 - 4, 0)
    envelope: FloatArray = beyond[distance] / fine[4]
    return envelope


def _half_lobe(window: str) -> float:
    """Return half the main lobe's width in lines: where the response first falls below 1 %."""
    fine = window_response(window, np.arange(0, 128) / 8.0)
    return float(np.argmax(fine < 0.01)) / 8.0
