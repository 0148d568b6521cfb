"""Amplitude and power spectra over frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from gearsig.checks import ComplexArray, FloatArray, one_of, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.spectra._types import (
    Axis,
    BlockPlan,
    Scaling,
    Spectrum,
    checked_signal,
    mean_power,
    named_signal,
    plan_blocks,
    scaled,
    scaled_unit,
    window_response,
)


def amplitude_spectrum(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    unit: str = "",
    source: str = "",
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    n_per_block: int | None = None,
    overlap: float = 0.5,
    transform: ComplexArray | None = None,
) -> Spectrum:
    """Return the amplitude or power spectrum of a signal, over one block or as the rms mean over blocks.

    A_k = 2 |Σ x[n] w[n] exp(-2πi k n/N)| / Σ w[n]; half of that at DC and at Nyquist.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
        The mean is not removed: it appears at line 0.
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    unit, source : str
        Of the signal; default: the channel's.
    window : str
        See `make_window`.
    scaling : str
        "amplitude peak" (a bin-centred sine of amplitude 1 reads 1), "amplitude rms" (1/√2) or "power" (1/2).
    n_per_block : int or None
        Block length; None takes the whole signal as one block, with the finest resolution and no averaging.
    overlap : float
        Fraction of a block shared with the next, 0 to 0.95.
    transform : array, (n_samples // 2 + 1,), or None
        The signal's `rfft`, if known; used only for a single block.

    Returns
    -------
    Spectrum
        Over frequency. Parseval: with a rectangular window and one block, the "power" lines add up to the mean square;
        with another window, the sum divided by the noise bandwidth in lines is the mean square of x·w over that of w.

    Raises
    ------
    InputError
        On a wrong shape, rate, window, scaling or block length.

    Notes
    -----
    Not for noise levels, which depend on the window and the block length here: use `power_density`.
    Not for a speed that changes by more than a line over the block: use an order spectrum.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> spectrum = amplitude_spectrum(3 * np.sin(2 * np.pi * 50 * t), 1000.0)
    >>> round(float(spectrum.values[50]), 9)
    3.0
    """
    one_of(scaling, "scaling", ("amplitude peak", "amplitude rms", "power"))
    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source)
    plan = plan_blocks(len(x), n_per_block, overlap, window)
    return spectrum_of_blocks(x, fs, plan, scaling, unit, source, transform=transform)


def power_density(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    unit: str = "",
    source: str = "",
    window: str = "hann",
    n_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return the one-sided power spectral density, averaged over windowed overlapping blocks.

    S_k = c_k mean |Σ x[n] w[n] exp(-2πi k n/N)|² / (fs Σ w[n]²); c_k = 2, but 1 at DC and Nyquist.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
        The mean is not removed.
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    unit, source : str
        Of the signal; default: the channel's.
    window : str
        See `make_window`.
    n_per_block : int or None
        Block length; None takes 8192 samples, or an eighth of a shorter signal.
    overlap : float
        0 to 0.95.

    Returns
    -------
    Spectrum
        Scaling "power density", unit e.g. "(m/s^2)^2/Hz"; its integral over frequency is the mean square.

    Raises
    ------
    InputError
        On a wrong shape, rate, window or block length.

    Notes
    -----
    Not for the level of a tone, whose density grows with the block length: use `amplitude_spectrum`.

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
    """
    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source)
    n = n_per_block if n_per_block is not None else min(8192, max(2, len(x) // 8))
    return spectrum_of_blocks(x, fs, plan_blocks(len(x), n, overlap, window), "power density", unit, source)


def spectrum_of_blocks(
    x: FloatArray,
    rate: float,
    plan: BlockPlan,
    scaling: Scaling,
    unit: str,
    source: str,
    *,
    axis: Axis = "frequency",
    highest: float = np.inf,
    shaft: str = "",
    transform: ComplexArray | None = None,
) -> Spectrum:
    """Return the spectrum of a block plan, averaged in power, up to `highest`; rate in Hz or samples per revolution."""
    resolution = rate / plan.n_per_block
    bandwidth = plan.window.noise_bandwidth_bins * resolution
    values = scaled(mean_power(x, plan, transform), scaling, bandwidth, plan.n_per_block)
    positions = np.arange(len(values)) * resolution
    n_kept = int(np.searchsorted(positions, highest * (1 + 1e-12), side="right"))
    return Spectrum(
        values=values[:n_kept],
        positions=positions[:n_kept],
        axis=axis,
        scaling=scaling,
        unit=scaled_unit(unit, scaling, per="order" if axis == "order" else "Hz"),
        resolution=resolution,
        noise_bandwidth=bandwidth,
        window=plan.window.name,
        n_averages=plan.n_averages,
        source=source,
        shaft=shaft,
    )


MIN_LINES = 16
"""Minimum lines per block for a floor: with fewer, the quantile is too uncertain (35 % with one average)."""


def noise_floor(
    spectrum: Spectrum, *, width: float | None = None, quantile: float = 0.5, highest: float | None = None
) -> Spectrum:
    """Return the mean noise level at each line of a spectrum, estimated from a quantile of its neighbourhood.

    Under Gaussian noise of smooth density, the power of a line averaged K times follows a gamma distribution of
    shape K (K = 1: exponential; the amplitude is then Rayleigh). Its quantile q is mean · G⁻¹(q; K)/K, so that
    floor = Q_q / (G⁻¹(q; K)/K) is the mean noise power; for K = 1 and the median the divisor is ln 2. Tones shift
    the quantile only by their share of the neighbourhood, whatever their height. Block quantiles every half width are
    interpolated linearly in log power; the blocks get shorter towards either end.

    Parameters
    ----------
    spectrum : Spectrum
        Of any scaling but "dimensionless".
    width : float or None
        Width of the neighbourhood in the axis' unit, at least 16 lines. It should hold many more noise lines than
        tones, and the density should change little over it. None takes 1/200 of the lines, but at least 256 lines
        (fewer, down to 48, for an averaged spectrum).
    quantile : float
        0.05 to 0.95. Lower ones tolerate more tones (at 0.25, three in four lines may be tones) but scatter more.
    highest : float or None
        Lines above it are left out, which saves time; the floor of the others stays the same.

    Returns
    -------
    Spectrum
        Same axis and scaling. For amplitudes, the floor is the root mean square amplitude, so that
        20 lg(amplitude/floor) = 10 lg(power/mean noise power).

    Raises
    ------
    RefusalError
        With fewer than 16 lines.
    InputError
        On a cepstrum, or a width below 16 lines.

    Notes
    -----
    Not for a noise-free spectrum, as of a simulation: the floor is then rounding or leakage. DC and the window's
    leakage around it count like any other lines.

    References
    ----------
    A. Leon-Garcia, *Probability, Statistics, and Random Processes for Electrical Engineering*, 3rd ed. (gamma
    distribution of averaged periodograms); the quantile's correction follows from it.
    """
    if spectrum.scaling == "dimensionless":
        raise InputError("a cepstrum has no noise floor", allowed="an amplitude or power spectrum")
    n_lines = len(spectrum.values)
    if n_lines < MIN_LINES:
        raise RefusalError(f"{n_lines} lines are too few for a floor", remedy="take a longer block")
    q = within(quantile, "quantile", 0.05, 0.95)
    block = _block_lines(spectrum, width)
    n_kept = n_lines if highest is None else spectrum.index_of(highest) + 1
    power = line_powers(spectrum.head(n_kept + 2 * block))  # reach of the last blocks
    floor = _running_quantile(power, block, q)[:n_kept] / gamma_quantile(q, spectrum.n_averages)
    is_amplitude = spectrum.scaling in ("amplitude peak", "amplitude rms")
    return replace(
        spectrum.head(n_kept),
        values=np.sqrt(floor) if is_amplitude else floor,
        source=f"noise floor of {spectrum.source or 'spectrum'}",
    )


def floor_of_powers(power: FloatArray) -> FloatArray:
    """Return the noise power at each line of a single block's power spectrum, from `noise_floor` with its defaults."""
    positions = np.arange(float(len(power)))
    return noise_floor(Spectrum(power, positions, "frequency", "power", "", 1.0, 1.0, "rectangular", 1, "")).values


def line_powers(spectrum: Spectrum) -> FloatArray:
    """Return the power of each line: the values, squared if they are amplitudes."""
    values: FloatArray = np.asarray(spectrum.values, dtype=np.float64)
    return values**2 if spectrum.scaling in ("amplitude peak", "amplitude rms") else values


def gamma_quantile(q: float, n_averages: int) -> float:
    """Return the quantile q of a noise line's power relative to its mean, for n independent averages.

    Examples
    --------
    >>> round(gamma_quantile(0.5, 1), 6)
    0.693147
    """
    from scipy.special import gammaincinv

    return float(gammaincinv(n_averages, q)) / n_averages


def _block_lines(spectrum: Spectrum, width: float | None) -> int:
    n_lines = len(spectrum.values)
    if width is None:
        # Scatter of the floor raises the false-alarm rate of a search above it; this many lines keep it small.
        return min(n_lines, max(48, 256 // spectrum.n_averages, n_lines // 200))
    block = round(positive(width, "width") / spectrum.resolution)
    if block < MIN_LINES:
        raise InputError(
            f"width {width:g} holds {block} lines of {spectrum.resolution:g}",
            allowed=f"at least {MIN_LINES * spectrum.resolution:g}",
            remedy="widen it, or take a longer block",
        )
    return min(block, n_lines)


def _running_quantile(power: FloatArray, block: int, q: float) -> FloatArray:
    """Return quantiles of blocks every half block, interpolated in log power to every line."""
    n = len(power)
    half = block // 2
    blocks = np.lib.stride_tricks.sliding_window_view(power, block)[::half]
    centres = np.arange(len(blocks)) * half + (block - 1) / 2
    levels = _quantiles(blocks, q)
    short = [s for s in (half, half // 2) if s >= MIN_LINES // 2]
    below = [(float(np.quantile(power[:s], q)), (s - 1) / 2) for s in reversed(short)]
    above = [(float(np.quantile(power[-s:], q)), n - (s + 1) / 2) for s in short]
    last = float(np.quantile(power[-block:], q)), n - (block + 1) / 2
    if last[1] > centres[-1]:
        above.insert(0, last)
    x = np.concatenate([[c for _, c in below], centres, [c for _, c in above]])
    y = np.concatenate([[v for v, _ in below], levels, [v for v, _ in above]])
    # Zeros (a dead segment of a simulated spectrum) have no logarithm; the smallest positive double replaces them.
    order = np.argsort(x, kind="stable")
    result = np.empty(n)
    _join_levels(x[order], np.log(np.maximum(y, np.finfo(np.float64).tiny))[order], result)
    return result


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _join_levels(x, logs, levels):  # type: ignore[no-untyped-def]
    """Evaluate exp of the linear interpolation between ascending points at 0, 1, …; constant beyond either end.

    Between two points, each level is the previous one times a factor; every 64th is computed by `exp` itself, so that
    rounding errors do not accumulate.
    """
    begin, last = 0, len(x) - 1
    for i in range(-1, len(x)):
        end = len(levels) if i == last else min(len(levels), int(np.floor(x[i + 1])) + 1)
        slope = 0.0 if i < 0 or i == last or x[i + 1] <= x[i] else (logs[i + 1] - logs[i]) / (x[i + 1] - x[i])
        at = max(i, 0)
        factor = np.exp(slope)
        for k in range(begin, end):
            if (k - begin) % 64 == 0:
                level = np.exp(logs[at] + slope * (k - x[at]))
            else:
                level *= factor
            levels[k] = level
        begin = max(begin, end)


def _quantiles(rows: FloatArray, q: float) -> FloatArray:
    """Return `np.quantile(rows, q, axis=1)`, six times as fast: it only partitions each row at one index."""
    at = q * (rows.shape[1] - 1)
    below = int(at)
    parted = np.partition(rows, below, axis=1)
    low = parted[:, below]
    high = parted[:, below + 1 :].min(axis=1) if below + 1 < rows.shape[1] else low
    return np.asarray(low + (at - below) * (high - low))


SKIRT_BINS = 200
"""Distance in lines up to which a strong line's leakage is considered."""


@dataclass(frozen=True)
class Line:
    """A spectral line above the noise floor.

    Parameters
    ----------
    position : float
        Frequency or order, interpolated between the spectrum's lines.
    value : float
        In the spectrum's scaling, corrected for scalloping loss; for a density, the uncorrected value of the line.
    floor : float
        Mean noise level there, in the same scaling.
    ratio_db : float
        Highest line over the floor: 20 lg of the amplitude ratio or 10 lg of the power ratio.
    """

    position: float
    value: float
    floor: float
    ratio_db: float


def find_lines(
    spectrum: Spectrum, floor: Spectrum | None = None, *, false_alarm: float = 0.01, threshold_db: float | None = None
) -> tuple[Line, ...]:
    """Return the lines above the noise floor, in order of position.

    A line is a local maximum that exceeds the floor by the threshold and is not leakage of a stronger one. Without
    `threshold_db`, the threshold keeps the probability of any false line in the whole spectrum at `false_alarm`: under
    Gaussian noise, the power of one of n lines, averaged K times, exceeds t times its mean with probability Q(K, K t)
    (for K = 1, exp(-t)), so that Q(K, K t) = false_alarm/n.

    Parameters
    ----------
    spectrum : Spectrum
        Over frequency or order.
    floor : Spectrum or None
        From `noise_floor` of the same spectrum; None computes it with the defaults.
    false_alarm : float
        1e-12 to 0.5, for the whole spectrum.
    threshold_db : float or None
        Overrides `false_alarm`.

    Returns
    -------
    tuple of Line
        Positions and values are interpolated from the ratio of the two highest lines and the window's transform;
        positions are exact for a single steady tone without noise.

    Raises
    ------
    InputError
        On a floor that does not belong to the spectrum, or a cepstrum.

    Notes
    -----
    The false-alarm rate holds for Gaussian noise and a floor that follows its density, so not for impulses or the
    skirts of a modulated carrier. A floor from few lines scatters and raises the rate: with 256 lines about 1.3 times,
    with 64 lines 2.5 times. DC, the window's main lobe around it, and Nyquist are left out.

    References
    ----------
    D. C. Rife and G. A. Vincent, "Use of the discrete Fourier transform in the measurement of frequencies and levels
    of tones", 1970 (interpolation by the window's transform). C. E. Bonferroni's inequality bounds the rate.

    Examples
    --------
    >>> from gearsig.spectra import amplitude_spectrum
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
    with np.errstate(divide="ignore", invalid="ignore"):  # over a zero floor, only lines above zero are infinite
        ratio = np.where(power > 0, power / mean_noise, 0.0)
    peaks = _local_maxima(power, first)
    peaks = peaks[ratio[peaks] > threshold]
    peaks = _without_leakage(peaks, power, mean_noise, spectrum.window)
    return tuple(_line(spectrum, power, base, int(k), float(ratio[k])) for k in peaks)


def false_alarm_ratio(probability: float, n_averages: int) -> float:
    """Return the ratio of a noise line's power to its mean that is exceeded with the given probability.

    Examples
    --------
    >>> round(false_alarm_ratio(1e-3, 1), 4)
    6.9078
    """
    from scipy.special import gammainccinv

    return float(gammainccinv(n_averages, probability)) / n_averages


def _local_maxima(power: FloatArray, first: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return indices of lines above both neighbours, from `first` to the second last."""
    inner = power[1:-1]
    peaks = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    return peaks[peaks >= first]


def _without_leakage(
    peaks: np.ndarray[tuple[int], np.dtype[np.intp]], power: FloatArray, mean_noise: FloatArray, window: str
) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Drop peaks explained by leakage of a stronger one: power below margin² · envelope² · that peak's power."""
    envelope = (2.0 * _leakage_envelope(window)) ** 2  # noise on top of a skirt is not a line
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
    """Return a tone's offsets 0 … 0.5 from its highest line, neighbour-to-highest ratios, responses at the highest."""
    offsets = np.linspace(0.0, 0.5, 501)
    line, neighbour = window_response(window, offsets), window_response(window, 1.0 - offsets)
    return offsets, neighbour / line, line


@lru_cache(maxsize=8)
def _leakage_envelope(window: str) -> FloatArray:
    """Return the largest response at or beyond each distance in lines, for a tone anywhere between two lines.

    It is relative to the tone's highest line, which is up to half a line away.
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


# --------------------
# Removal of steady tones, and whitening.
# --------------------

Preparation = Literal["none", "tones removed", "whitened"]


def prepared_signal(values: FloatArray, sampling_rate_hz: float, preparation: Preparation) -> FloatArray:
    """Return a signal with its steady tones removed, or whitened to equally strong lines.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    preparation : str
        "none"; "tones removed": lines of the whole signal's spectrum more than 13 dB above the floor are reduced to
        the floor with their phases kept, which removes mesh and shaft harmonics at steady speed; "whitened": every
        line is divided by its magnitude (cepstral prewhitening), which removes tones and resonances alike.

    Returns
    -------
    array, (n_samples,)
        In the signal's unit, or dimensionless with a mean square of 1 if whitened; unless "none", without the mean.

    Notes
    -----
    Impulses that repeat exactly are lines themselves and are removed with the tones; a bearing's impulses survive
    because of slip. If the speed drifts by more than a line, harmonics are not lines: use the residual of an average
    over the shaft angle.

    References
    ----------
    P. Borghesani, P. Pennacchi, R. B. Randall, N. Sawalhi and R. Ricci, "Application of cepstrum pre-whitening for
    the diagnosis of bearing faults under variable speed conditions", 2013.
    """
    from scipy.fft import irfft, rfft

    x = checked_signal(values, minimum=64)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if one_of(preparation, "preparation", get_args(Preparation)) == "none":
        return x
    return np.asarray(irfft(prepared_lines(rfft(x.astype(np.float64)), preparation), len(x), overwrite_x=True))


def prepared_lines(transform: ComplexArray, preparation: Preparation) -> ComplexArray:
    """Return the `rfft` of the prepared signal (see `prepared_signal`) from that of the signal itself.

    Parameters
    ----------
    transform : array, (n_samples // 2 + 1,)
    preparation : str
        As in `prepared_signal`.

    Returns
    -------
    array, (n_samples // 2 + 1,)
        A new array, in the transform's precision.
    """
    lines = transform.copy()
    if preparation == "none":
        return lines
    lines[0] = 0.0
    power = lines.real**2 + lines.imag**2
    if preparation == "tones removed":
        floor = floor_of_powers(power)
        tones = power > 20.0 * floor  # one noise line in e²⁰, half a billion, exceeds this
        lines[tones] *= np.sqrt(floor[tones] / power[tones])
    else:
        level = np.sqrt(2.0 * (len(lines) - 1.0))  # gives a mean square of about 1
        magnitude = np.abs(lines)
        lines *= np.divide(level, magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return lines
