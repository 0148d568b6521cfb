"""Spectral correlation and coherence of cyclostationary signals at constant speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import ShaftAngle
from gearsig.checks import ComplexArray, FloatArray, count, freeze, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra._amplitude import Preparation, prepared_signal
from gearsig.spectra._types import Spectrum, checked_signal, make_window, named_signal, scaled_unit

MAX_CELLS = 1 << 26
"""1.6 GB of results; more is more likely a mistyped parameter than intended."""
MIN_PRODUCTS = 8
"""Minimum independent products per cell: with fewer, coherence near 1 occurs by chance."""
FIRST_LINE = 4
"""First line of α: below it, the main lobe of the Hann window alone makes neighbouring lines coherent."""


@dataclass(frozen=True)
class CarrierBands:
    """Bands of 2·`half` - 1 lines every `half` lines; band i is centred on line (first + i)·half.

    Parameters
    ----------
    half, first, n_bands : int
    weight : array, (2·half - 1,)
        Raised cosine, 1 in the middle; the bands' weights add up to 1.
    """

    half: int
    first: int
    n_bands: int
    weight: FloatArray

    @property
    def centres(self) -> np.ndarray[tuple[int], np.dtype[np.signedinteger[Any]]]:
        """Middle lines, (n_bands,)."""
        return (self.first + np.arange(self.n_bands)) * self.half

    @property
    def products_per_band(self) -> float:
        """Equivalent number of equally weighted lines: (ΣG)²/ΣG²."""
        return float(self.weight.sum() ** 2 / np.dot(self.weight, self.weight))


def lay_bands(n_lines: int, n_bands: int, n_highest: float, inflation: float, n_alphas: int) -> CarrierBands:
    """Divide `n_lines` lines into `n_bands` spacings and keep the bands that cyclic shifts of `n_highest` lines allow.

    Bands below half the highest shift are left out: there, the lines of a real signal and their shifted counterparts
    are mirror images of each other, and cells repeat or correlate with themselves.
    """
    half = (n_lines - 1) // count(n_bands, "n_bands", minimum=2)
    weight = 0.5 + 0.5 * np.cos(np.pi * np.arange(1 - half, half) / max(half, 1))
    first = max(1, int(np.ceil(n_highest / 2 / half)) + 1) if half else 1
    bands = CarrierBands(half, first, (n_lines - 1) // half - first if half else 0, weight)
    if half < 1 or bands.products_per_band / inflation < MIN_PRODUCTS:
        n_max = int((n_lines - 1) / (MIN_PRODUCTS * inflation) * 1.3)
        raise RefusalError(
            f"{n_bands} bands of {n_lines} lines leave fewer than {MIN_PRODUCTS} independent products in a cell",
            remedy=f"take at most {n_max} bands, or record longer" if n_max >= 2 else "record longer",
        )
    if bands.n_bands < 1:
        raise InputError(
            "the highest cyclic frequency is so high that no carrier band is left above half of it",
            remedy="lower it, or take more bands",
        )
    if bands.n_bands * n_alphas > MAX_CELLS:
        raise InputError(
            f"{n_alphas} cyclic frequencies × {bands.n_bands} bands are too many cells",
            allowed=f"at most {MAX_CELLS}",
            remedy="lower the highest cyclic frequency, take fewer bands or a shorter segment",
        )
    return bands


@dataclass(frozen=True)
class SpectralCoherence(Result, matrix=("coherence_squared", "alpha", "frequency_hz")):
    """How strongly each carrier band is modulated at each cyclic frequency.

    γ²(α, f) = |S(α, f)|² / (S(0, f) S(0, f - α)): 0 for stationary noise, 1 where the band's content at f is a copy
    of that at f - α.

    Parameters
    ----------
    coherence_squared : array, (n_alphas, n_bands)
    correlation : complex array, (n_alphas, n_bands)
        S(α, f), the one-sided spectral correlation density; at α = 0 it would be the power density.
    alpha : array, (n_alphas,)
        Cyclic frequencies (Hz) or orders (cycles per revolution of `shaft`), equally spaced.
    alpha_axis : str
        "frequency" or "order".
    frequency_hz : array, (n_bands,)
        Centres of the carrier bands, equally spaced; each is two spacings wide, with a raised-cosine weight.
    n_independent : float
        Independent products averaged in a cell.
    alpha_resolution : float
        Spacing of `alpha`: the reciprocal of the length.
    unit : str
        Of the correlation, e.g. "(m/s^2)^2/Hz".
    source, shaft : str
    """

    coherence_squared: FloatArray
    correlation: NDArray[np.complexfloating[Any, Any]]
    alpha: FloatArray
    alpha_axis: Literal["frequency", "order"]
    frequency_hz: FloatArray
    n_independent: float
    alpha_resolution: float
    unit: str
    source: str
    shaft: str = ""

    def __post_init__(self) -> None:
        freeze(self, "coherence_squared", ndim=2)
        freeze(self, "alpha", "frequency_hz")
        freeze(self, "correlation", ndim=None)
        shape = (len(self.alpha), len(self.frequency_hz))
        if not self.coherence_squared.shape == self.correlation.shape == shape:
            raise InputError(f"values of shape {self.coherence_squared.shape} for {shape[0]} α × {shape[1]} bands")

    @property
    def alpha_label(self) -> str:
        """Label of the α axis, with its unit."""
        if self.alpha_axis == "frequency":
            return "cyclic frequency (Hz)"
        return f"cyclic order (per revolution of {self.shaft or 'the shaft'})"

    def level(self, probability: float = 0.05) -> float:
        """Return the squared coherence that stationary Gaussian noise exceeds in a cell with the given probability.

        P(γ² > t) = (1 - t)^(M-1) for M independent products, hence t = 1 - P^(1/(M-1)).
        """
        p = within(probability, "probability", 1e-12, 0.5)
        return float(-np.expm1(np.log(p) / (self.n_independent - 1.0)))


@dataclass(frozen=True)
class EnhancedEnvelope(Result):
    """Squared coherence averaged over a range of carriers: an envelope spectrum in which all bands count equally.

    Parameters
    ----------
    spectrum : Spectrum
        Dimensionless, over cyclic frequency or order; its first line is not at zero.
    level : float
        Value that stationary noise exceeds in one line with `probability`.
    probability : float
    band_hz : (float, float)
        Centres of the first and last carrier band.
    """

    spectrum: Spectrum
    level: float
    probability: float
    band_hz: tuple[float, float]


def enhanced_envelope(
    coherence: SpectralCoherence, band_hz: tuple[float, float] | None = None, *, probability: float = 0.05
) -> EnhancedEnvelope:
    """Return the mean of the squared coherence over the carriers of a band, and the level that noise reaches.

    E(α) = (1/n) Σ_f γ²(α, f). Under stationary noise, each γ² is nearly exponentially distributed with mean 1/M; the
    mean over n bands nearly follows a gamma distribution of shape n/(1 + 2/36), as neighbouring bands half overlap.

    Parameters
    ----------
    coherence : SpectralCoherence
    band_hz : (float, float) or None
        Carriers whose centres lie in it: the "improved" spectrum. None takes all, the "enhanced" one.
    probability : float
        Probability that noise exceeds the level in one line. For all lines at once, divide it by their number.

    Raises
    ------
    RefusalError
        If no carrier lies in the band.

    References
    ----------
    J. Antoni, G. Xin and N. Hamzaoui, "Fast computation of the spectral correlation", 2017.
    """
    from scipy.special import gammainccinv

    f = coherence.frequency_hz
    low, high = (f[0], f[-1]) if band_hz is None else (float(band_hz[0]), float(band_hz[1]))
    inside = (f >= low) & (f <= high)
    n = int(inside.sum())
    if n == 0:
        raise RefusalError(
            f"no carrier lies from {low:g} to {high:g} Hz; they go from {f[0]:g} to {f[-1]:g} Hz",
            remedy="widen the band, or lower the highest cyclic frequency, which sets the lowest carrier",
        )
    p = within(probability, "probability", 1e-12, 0.5)
    shape = n / (1.0 + 2.0 / 36.0) if n > 1 else 1.0
    level = coherence.level(p) if n == 1 else float(gammainccinv(shape, p)) / shape / coherence.n_independent
    spectrum = Spectrum(
        values=coherence.coherence_squared[:, inside].mean(axis=1),
        positions=coherence.alpha,
        axis=coherence.alpha_axis,
        scaling="dimensionless",
        unit="",
        resolution=coherence.alpha_resolution,
        noise_bandwidth=coherence.alpha_resolution,
        window="hann",
        n_averages=max(1, int(coherence.n_independent)),
        source=f"mean squared coherence {f[inside][0]:g}-{f[inside][-1]:g} Hz of {coherence.source}",
        shaft=coherence.shaft,
    )
    return EnhancedEnvelope(spectrum, level, p, (float(f[inside][0]), float(f[inside][-1])))


def spectral_coherence(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    highest_alpha_hz: float,
    n_bands: int = 64,
    preparation: Preparation = "none",
    unit: str = "",
    source: str = "",
) -> SpectralCoherence:
    """Return the spectral correlation and coherence up to a cyclic frequency.

    S(α, f) = Σ_ν G(ν - f) X(ν) X*(ν - α) / ΣG: the cyclic periodogram of the whole signal (Hann window), averaged over
    the carriers of a band. γ² is |S|² divided by the same averages of |X(ν)|² and |X(ν - α)|², so that γ² ≤ 1. One
    FFT correlation of the lines gives all α of a band.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    highest_alpha_hz : float
        The highest cyclic frequency: a few times the fastest modulation of interest.
    n_bands : int
        Carrier bands from 0 to half the sampling rate. Fewer bands average more and reveal weaker modulation; more
        bands locate its carrier better. Bands below half of `highest_alpha_hz` are left out.
    preparation : str
        "none", "tones removed" (gears) or "whitened", see `prepared_signal`.
    unit, source : str
        Of the signal; default: the channel's.

    Returns
    -------
    SpectralCoherence
        α in steps of 1/length, from 4/length on. A modulation between two lines of α loses up to 7 % of γ.

    Raises
    ------
    InputError
        On a wrong shape or rate, or bands and cyclic frequencies that do not fit.
    RefusalError
        On a signal that is constant, or too short for the bands.

    Notes
    -----
    The noise level assumes a stationary signal: one strong modulation slightly raises the cells of all other α.
    A steady tone is coherent with every other tone: remove synchronous parts first, see `prepared_signal`. If the
    speed changes by more than one part in α times length, use `order_coherence`.

    References
    ----------
    W. A. Gardner, "Measurement of spectral correlation", 1986 (frequency smoothing). J. Antoni, "Cyclic spectral
    analysis in practice", 2007. J. Antoni, G. Xin and N. Hamzaoui, "Fast computation of the spectral correlation",
    2017, reach nearly the same average by short-time transforms.
    """
    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=64)
    if preparation != "none":
        x, source = prepared_signal(x, fs, preparation), f"{source or 'signal'}, {preparation}"
        unit = "" if preparation == "whitened" else unit
    n_alphas = int(np.floor(positive(highest_alpha_hz, "highest_alpha_hz", "Hz") * len(x) / fs * (1 + 1e-12)))
    if not FIRST_LINE < n_alphas < len(x) // 2:
        raise InputError(
            f"highest_alpha_hz is {highest_alpha_hz:g} Hz",
            allowed=f"{(FIRST_LINE + 1) * fs / len(x):g} to below {fs / 2:g} Hz for this signal",
            remedy="record longer for lower ones",
        )
    window = make_window("hann", len(x)).values
    energy = float(np.dot(window, window))
    # Σ|R(d)|² of the correlation that the window causes between lines d apart.
    inflation = len(x) * float(np.sum(window**4)) / energy**2
    n_lines = (len(x) + 1) // 2  # without Nyquist
    bands = lay_bands(n_lines, n_bands, n_alphas, inflation, n_alphas - FIRST_LINE + 1)
    lines = transform_of(x, window)
    S, gamma = correlate_lines(lines, bands, n_alphas)
    S *= 2.0 / (fs * energy)
    return SpectralCoherence(
        coherence_squared=gamma,
        correlation=S,
        alpha=np.arange(FIRST_LINE, n_alphas + 1) * (fs / len(x)),
        alpha_axis="frequency",
        frequency_hz=bands.centres * (fs / len(x)),
        n_independent=bands.products_per_band / inflation,
        alpha_resolution=fs / len(x),
        unit=scaled_unit(unit, "power density"),
        source=source or "signal",
    )


def transform_of(x: FloatArray, window: FloatArray) -> ComplexArray:
    """Return the Fourier lines of the windowed signal, mean removed, from 0 to below half the sampling rate."""
    from scipy.fft import rfft

    y = x.astype(np.float64)
    largest = float(np.abs(y).max())
    y -= y.mean()
    if float(np.abs(y).max()) <= 1e-7 * largest:
        raise RefusalError("the signal is constant: it has no modulation", remedy="check the channel")
    y *= window
    lines: ComplexArray = rfft(y, overwrite_x=True)[: (len(x) + 1) // 2]
    return lines


def correlate_lines(lines: ComplexArray, bands: CarrierBands, n_alphas: int) -> tuple[ComplexArray, FloatArray]:
    """Return Σ G X(ν) X*(ν - α)/ΣG and its squared coherence for α = 4 … n_alphas lines, (n, n_bands) each."""
    from scipy.fft import fft, ifft, next_fast_len

    G, half = bands.weight, bands.half
    n_band = len(G)
    n_fft = next_fast_len(n_band + n_alphas)
    # Lines below zero are the mirror image of those above it.
    lines = np.concatenate([np.conj(lines[1 : n_alphas + 1][::-1]), lines])
    weight = np.conj(fft(G, n_fft))
    S = np.empty((n_alphas - FIRST_LINE + 1, bands.n_bands), dtype=np.complex128)
    gamma = np.empty(S.shape)
    for i, centre in enumerate(bands.centres):
        start = int(centre) - half + 1 + n_alphas  # the band's first line in the extended array
        u = lines[start : start + n_band]
        v = lines[start - n_alphas : start + n_band]
        # d[m] = Σ_i G u[i] v*[i + m] for v shifted down by α = n_alphas - m lines.
        d = np.conj(ifft(np.conj(fft(u * G, n_fft)) * fft(v, n_fft), overwrite_x=True))
        power = v.real**2 + v.imag**2
        shifted = ifft(weight * fft(power, n_fft), overwrite_x=True).real
        m = n_alphas - np.arange(FIRST_LINE, n_alphas + 1)
        carrier_power = float(np.dot(G, power[n_alphas:]))
        S[:, i] = d[m] / G.sum()
        below = carrier_power * np.maximum(shifted[m], 1e-14 * float(power.max()))
        square = d[m].real ** 2 + d[m].imag ** 2
        gamma[:, i] = np.divide(square, below, out=np.zeros(len(m)), where=below > 0)
    return S, gamma


_SPREAD = 8
"""Grid points on either side of a sample: error about 1e-8 of the sum of magnitudes."""


class NonuniformTransform:
    """c[k] = Σ_j p_j exp(-2πi k θ_j) for k = 0 … n, with θ as a fraction of the whole angle, 0 ≤ θ < 1.

    Samples are spread over a uniform grid by a Gaussian and transformed; the Gaussian's transform is divided out.

    References
    ----------
    L. Greengard and J.-Y. Lee, "Accelerating the nonuniform fast Fourier transform", 2004.
    """

    def __init__(self, theta: FloatArray, n: int) -> None:
        from scipy.fft import next_fast_len

        self.n = n
        n_modes = 2 * n + 1
        self.n_grid = next_fast_len(2 * n_modes + 2 * _SPREAD)
        ratio = self.n_grid / n_modes
        self._tau = np.pi * _SPREAD / (n_modes**2 * ratio * (ratio - 0.5))
        self._spread = self._spreading(theta)

    def __call__(self, p: ComplexArray) -> ComplexArray:
        """Return the sums for one set of values, (n + 1,)."""
        from scipy.fft import fft

        k = np.arange(self.n + 1)
        lines: ComplexArray = fft(self._spread @ p)[: self.n + 1]
        lines *= np.sqrt(np.pi / self._tau) * np.exp(self._tau * k.astype(np.float64) ** 2) / self.n_grid
        return lines

    def _spreading(self, theta: FloatArray) -> Any:
        from scipy.sparse import csr_array

        nearest = np.floor(theta * self.n_grid).astype(np.int64)
        offsets = np.arange(1 - _SPREAD, _SPREAD + 1)
        points = nearest[:, None] + offsets
        distance = 2.0 * np.pi * (points / self.n_grid - theta[:, None])
        weights = np.exp(-(distance**2) / (4.0 * self._tau))
        rows = (points % self.n_grid).ravel()
        columns = np.repeat(np.arange(len(theta)), 2 * _SPREAD)
        return csr_array((weights.ravel(), (rows, columns)), shape=(self.n_grid, len(theta)))


def order_coherence(
    recording: Recording, channel: str, shaft_angle: ShaftAngle, *, highest_order: float, n_bands: int = 64
) -> SpectralCoherence:
    """Return the order–frequency spectral correlation and coherence of a channel.

    S(α, f) = ∫ y_f(t) x*(t) exp(-2πi α θ(t)) w(θ) θ̇ dt / ∫ w(θ) θ̇ dt, with y_f the signal's part in the carrier band
    around f (Hz), θ the shaft angle in revolutions and w the squared Hann window over the angle. Modulation locked to
    the shaft stays on one line, while resonances stay in their band. γ² = |S(α, f)|²/S(0, f)², computed from the
    signal whitened by its mean density over time.

    Parameters
    ----------
    recording : Recording
    channel : str
    shaft_angle : ShaftAngle
        On the recording's time axis; only the part of the recording that it covers is used.
    highest_order : float
        Cycles per revolution of the angle's shaft.
    n_bands : int
        Carrier bands from 0 to half the sampling rate. Bands below half of the highest order at the highest speed are
        left out.

    Returns
    -------
    SpectralCoherence
        Over order, in steps of 1/revolutions from 4/revolutions on.

    Raises
    ------
    InputError, RefusalError
        As `spectral_coherence`; also if the angle covers fewer than 8 revolutions.

    Notes
    -----
    Since the power at f - α is taken from the whitened signal's mean, γ² may exceed 1 by chance where few products are
    averaged. The noise level assumes a signal level that is steady over the run; a level that rises with speed
    averages over fewer independent products than stated, and its slow change appears as coherence at the lowest orders.

    References
    ----------
    D. Abboud, S. Baudin, J. Antoni, D. Rémond, M. Eltabach and O. Sauvage, "The spectral analysis of
    cyclo-non-stationary signals", 2016.
    """
    values, angle, start_s = _covered(recording, channel, shaft_angle)
    fs = recording.sampling_rate_hz
    order = positive(highest_order, "highest_order")
    n_alphas = int(np.floor(order * angle.n_revolutions * (1 + 1e-12)))
    if n_alphas <= FIRST_LINE:
        raise InputError(
            f"highest_order is {order:g}",
            allowed=f"above {(FIRST_LINE + 1) / angle.n_revolutions:g}, 5 over the revolutions",
        )
    n_shift = order * angle.speed_range_rpm[1] / 60.0 * len(values) / fs
    n_lines = (len(values) + 1) // 2
    if n_shift > 0.9 * n_lines:
        raise InputError(
            f"highest_order is {order:g}",
            allowed=f"up to {0.9 * order * n_lines / n_shift:.4g}, where it nears half the sampling rate at full speed",
        )
    seconds = np.arange(len(values)) / fs + start_s
    weight = _weight(angle, seconds)
    # Factor by which the weight over time reduces the independent products: T ∫W²/(∫W)².
    inflation = float(len(weight) * np.dot(weight, weight) / weight.sum() ** 2)
    bands = lay_bands(n_lines, n_bands, n_shift, inflation, n_alphas - FIRST_LINE + 1)
    lines = transform_of(values, np.ones(len(values)))
    density = _whiten(lines, bands.half)
    S, gamma = _correlate_over_angle(lines, bands, angle, start_s, len(values) / fs, int(np.ceil(n_shift)), n_alphas)
    unit = recording.channels[recording.index(channel)].unit
    return SpectralCoherence(
        coherence_squared=gamma,
        correlation=S * density[bands.centres] * (2.0 / (fs * len(values))),
        alpha=np.arange(FIRST_LINE, n_alphas + 1) / angle.n_revolutions,
        alpha_axis="order",
        frequency_hz=bands.centres * (fs / len(values)),
        n_independent=bands.products_per_band / inflation,
        alpha_resolution=1.0 / angle.n_revolutions,
        unit=scaled_unit(unit, "power density"),
        source=channel,
        shaft=angle.shaft,
    )


def _covered(recording: Recording, channel: str, shaft_angle: ShaftAngle) -> tuple[FloatArray, ShaftAngle, float]:
    """Return the samples that the angle covers, the angle over them, and the time of the first sample in seconds."""
    fs = recording.sampling_rate_hz
    x = recording.values(channel)
    angle = shaft_angle.between(0.0, (len(x) - 1) / fs)
    first, last = int(np.ceil(angle.start_s * fs - 1e-6)), int(np.floor(angle.end_s * fs + 1e-6))
    if angle.n_revolutions < 8.0:
        raise RefusalError(
            f"the angle covers {angle.n_revolutions:.3g} revolutions of the recording",
            remedy="record at least 8 revolutions",
        )
    return checked_signal(x[first : last + 1], minimum=64), angle, first / fs


def _weight(angle: ShaftAngle, seconds: FloatArray) -> FloatArray:
    """Return the squared Hann window over the angle times the speed in rev/s; zero outside the angle."""
    turn = (angle.revolutions_at(seconds) - float(angle.revolutions[0])) / angle.n_revolutions
    window = np.where((turn >= 0) & (turn < 1), 0.5 - 0.5 * np.cos(2 * np.pi * turn), 0.0)
    result: FloatArray = window**2 * (angle.speed_rpm_at(seconds) / 60.0)
    return result


def _whiten(lines: ComplexArray, half: int) -> FloatArray:
    """Divide the lines by the root of their mean power over about two bands, in place, and return that power."""
    from scipy.ndimage import uniform_filter1d

    power = lines.real**2 + lines.imag**2
    smooth = uniform_filter1d(uniform_filter1d(power, half, mode="mirror"), half, mode="mirror")
    smooth = np.maximum(smooth, 1e-14 * float(smooth.max()))
    lines /= np.sqrt(smooth)
    return smooth


def _correlate_over_angle(
    lines: ComplexArray,
    bands: CarrierBands,
    angle: ShaftAngle,
    start_s: float,
    duration_s: float,
    n_shift: int,
    n_alphas: int,
) -> tuple[ComplexArray, FloatArray]:
    """Return S and γ² of the whitened signal, (n_alphas, n_bands) each; envelopes have their own sampling rate.

    The weight is the squared Hann window over the angle times the speed over the mean speed.
    """
    from scipy.fft import next_fast_len

    # Products extend to ±(2 half + shift); at this rate, aliases fall beyond the shift.
    n_envelope = next_fast_len(2 * (bands.half + n_shift) + 8)
    if n_envelope > 1 << 22:  # spreading them over the angles would take more than 2 GB
        raise InputError(
            f"{n_envelope} envelope samples are too many", remedy="take more bands, a lower order or a shorter segment"
        )
    envelope_s = start_s + np.arange(n_envelope) * (duration_s / n_envelope)
    weight = _weight(angle, envelope_s)
    inside = weight > 0.0
    turn = (angle.revolutions_at(envelope_s[inside]) - float(angle.revolutions[0])) / angle.n_revolutions
    sums, weight = NonuniformTransform(turn, n_alphas), weight[inside] / weight.sum()
    n_wide = bands.half + n_shift
    lines = np.concatenate([lines, np.zeros(max(0, n_wide + 1 - len(lines)), dtype=lines.dtype)])
    lines = np.concatenate([np.conj(lines[1 : n_wide + 1][::-1]), lines, np.zeros(n_wide, dtype=lines.dtype)])
    S = np.empty((n_alphas - FIRST_LINE + 1, bands.n_bands), dtype=np.complex128)
    gamma = np.empty(S.shape)
    for i, centre in enumerate(bands.centres):
        around = lines[int(centre) : int(centre) + 2 * n_wide + 1]  # line `centre` is its middle
        narrow = np.zeros(len(around), dtype=np.complex128)
        low = n_wide - bands.half + 1
        narrow[low : low + len(bands.weight)] = around[low : low + len(bands.weight)] * bands.weight
        product = _at_rate(narrow, n_envelope) * np.conj(_at_rate(around, n_envelope))
        c = sums(product[inside] * weight) * (n_envelope**2 / bands.weight.sum())
        S[:, i] = c[FIRST_LINE:]
        carrier_power = abs(float(c[0].real))
        square = S[:, i].real ** 2 + S[:, i].imag ** 2
        gamma[:, i] = square / carrier_power**2 if carrier_power > 0 else 0.0
    return S, gamma


def _at_rate(around: ComplexArray, n: int) -> ComplexArray:
    """Transform lines -m … m to n ≥ 2m + 1 samples of a complex envelope."""
    from scipy.fft import ifft

    m = len(around) // 2
    spectrum = np.zeros(n, dtype=np.complex128)
    spectrum[: m + 1] = around[m:]
    spectrum[n - m :] = around[:m]
    result: ComplexArray = ifft(spectrum, overwrite_x=True)
    return result
