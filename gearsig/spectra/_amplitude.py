"""Amplitude and power spectra over frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, one_of, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.spectra._types import (
    Axis,
    BlockPlan,
    ComplexArray,
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
    """Return the amplitude or power spectrum of a signal, of one block or as the rms mean over blocks.

    A_k = 2 |Σ x[n] w[n] exp(-2πi k n/N)| / Σ w[n]; half of that at DC and at Nyquist.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
        The mean is not removed: it stands at line 0.
    channel_or_rate_hz : str or float
        The channel of a recording; of an array its sampling rate in Hz.
    unit, source : str
        Of the signal; default: the channel's.
    window : str
        See `make_window`.
    scaling : str
        "amplitude peak" (a bin-centred sine of amplitude 1 reads 1), "amplitude rms" (1/√2) or "power" (1/2).
    n_per_block : int or None
        Block length; None takes the whole signal as one block, with the finest resolution and no averaging.
    overlap : float
        0 to 0.95, the part of a block that the next one repeats.
    transform : array, (n_samples // 2 + 1,), or None
        The signal's `rfft`, where it is known; of use to a single block.

    Returns
    -------
    Spectrum
        Over frequency. Parseval: with a rectangular window and one block, the sum of "power" is the mean square;
        with another window, the sum over the noise bandwidth in lines is the mean square of x·w over that of w.

    Raises
    ------
    InputError
        On a wrong shape, rate, window, scaling or block length.

    Notes
    -----
    Not for noise levels: they depend on the window and the block length here. Use `power_density`.
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

    S_k = c_k mean |Σ x[n] w[n] exp(-2πi k n/N)|² / (fs Σ w[n]²), c_k = 2 but at DC and Nyquist 1.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
        The mean is not removed.
    channel_or_rate_hz : str or float
        The channel of a recording; of an array its sampling rate in Hz.
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
    Not for the level of a tone: its density grows with the block length. Use `amplitude_spectrum`.

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
    """Return the mean power over blocks in a scaling, up to `highest`; rate in Hz, or samples per revolution."""
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
"""Fewer lines than that per block make a floor's quantile too uncertain (35 % with one average)."""


def noise_floor(
    spectrum: Spectrum, *, width: float | None = None, quantile: float = 0.5, highest: float | None = None
) -> Spectrum:
    """Return the mean noise at each line of a spectrum, estimated from a quantile of its neighbourhood.

    Under Gaussian noise of smooth density, the power of a line averaged K times follows a gamma distribution of
    shape K (K = 1: exponential; the amplitude's is Rayleigh). Its quantile q is mean · G⁻¹(q; K)/K, so that
    floor = Q_q / (G⁻¹(q; K)/K) is the mean noise power; for K = 1 and the median the divisor is ln 2. Lines of tones
    only shift the quantile by their share of the neighbourhood, whatever their height. Block quantiles every half
    width are joined by straight lines over log power; towards either end the blocks get shorter.

    Parameters
    ----------
    spectrum : Spectrum
        Of any scaling but "dimensionless".
    width : float or None
        Of the neighbourhood, in the axis' unit; at least 16 lines. It should hold many more noise lines than
        tones, and the density should change little over it. None takes 1/200 of the lines, but at least 256 lines
        (fewer, down to 48, where the spectrum is an average).
    quantile : float
        0.05 to 0.95. Lower ones bear more tones (at 0.25, three in four lines may be tones) but scatter more.
    highest : float or None
        Lines above it are left out, which spares the time for them; the floor of the others is the same.

    Returns
    -------
    Spectrum
        Same axis and scaling. For amplitudes, it is the root of the mean squared amplitude, so that
        20 lg(amplitude/floor) = 10 lg(power/mean noise power).

    Raises
    ------
    RefusalError
        With fewer than 16 lines.
    InputError
        On a cepstrum, or a width below 16 lines.

    Notes
    -----
    Not for a spectrum without noise (a simulation's): the floor is then its rounding or leakage. DC and the window's
    leakage around it count as lines do.

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
    power = line_powers(spectrum.head(n_kept + 2 * block))  # so far the blocks at the end reach
    floor = _running_quantile(power, block, q)[:n_kept] / gamma_quantile(q, spectrum.n_averages)
    is_amplitude = spectrum.scaling in ("amplitude peak", "amplitude rms")
    return replace(
        spectrum.head(n_kept),
        values=np.sqrt(floor) if is_amplitude else floor,
        source=f"noise floor of {spectrum.source or 'spectrum'}",
    )


def floor_of_powers(power: FloatArray) -> FloatArray:
    """Return the floor that `noise_floor` finds by default under the powers of a single block's lines."""
    positions = np.arange(float(len(power)))
    return noise_floor(Spectrum(power, positions, "frequency", "power", "", 1.0, 1.0, "rectangular", 1, "")).values


def line_powers(spectrum: Spectrum) -> FloatArray:
    """Return the values, squared if they are amplitudes."""
    values: FloatArray = np.asarray(spectrum.values, dtype=np.float64)
    return values**2 if spectrum.scaling in ("amplitude peak", "amplitude rms") else values


def gamma_quantile(q: float, n_averages: int) -> float:
    """Return the quantile q of a line's power over its mean, for n independent averages; ln 2 for the median and one.

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
        # The floor's own scatter multiplies the false-alarm rate of a search above it; so many lines keep that small.
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
    """Return block quantiles every half block, interpolated over log power at every line."""
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
    # Zeros (a dead segment of a simulated spectrum) have no logarithm; the smallest positive double stands for them.
    order = np.argsort(x, kind="stable")
    result = np.empty(n)
    _join_levels(x[order], np.log(np.maximum(y, np.finfo(np.float64).tiny))[order], result)
    return result


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _join_levels(x, logs, levels):  # type: ignore[no-untyped-def]
    """`exp(interp(…))` at 0, 1, … of straight lines between ascending points; level beyond either end.

    Between two points each level is the one before times a factor; from the start of every 64 by `exp` itself, so that
    rounding errors do not add up.
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
    """Return `np.quantile(rows, q, axis=1)`, six times as fast: a single place is sought in each row."""
    at = q * (rows.shape[1] - 1)
    below = int(at)
    parted = np.partition(rows, below, axis=1)
    low = parted[:, below]
    high = parted[:, below + 1 :].min(axis=1) if below + 1 < rows.shape[1] else low
    return np.asarray(low + (at - below) * (high - low))


SKIRT_BINS = 200
"""How far a strong line's leakage is followed."""


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
    spectrum: Spectrum, floor: Spectrum | None = None, *, false_alarm: float = 0.01, threshold_db: float | None = None
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
    """Return offsets 0 … 0.5 of a tone from its highest line, neighbour-to-highest ratio, response at the highest."""
    offsets = np.linspace(0.0, 0.5, 501)
    line, neighbour = window_response(window, offsets), window_response(window, 1.0 - offsets)
    return offsets, neighbour / line, line


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


# --------------------
# A signal without its steady tones, or with all lines equally strong.
# --------------------

Preparation = Literal["none", "tones removed", "whitened"]


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
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if one_of(preparation, "preparation", get_args(Preparation)) == "none":
        return x
    return np.asarray(irfft(prepared_lines(rfft(x.astype(np.float64)), preparation), len(x), overwrite_x=True))


def prepared_lines(transform: ComplexArray, preparation: Preparation) -> ComplexArray:
    """Return the `rfft` of what `prepared_signal` makes of a signal, from the signal's own.

    Parameters
    ----------
    transform : array, (n_samples // 2 + 1,)
    preparation : str
        As of `prepared_signal`.

    Returns
    -------
    array, (n_samples // 2 + 1,)
        Another array, in the transform's precision.
    """
    lines = transform.copy()
    if preparation == "none":
        return lines
    lines[0] = 0.0
    power = lines.real**2 + lines.imag**2
    if preparation == "tones removed":
        floor = floor_of_powers(power)
        tones = power > 20.0 * floor  # of noise, one line in e²⁰, half a billion, gets there
        lines[tones] *= np.sqrt(floor[tones] / power[tones])
    else:
        level = np.sqrt(2.0 * (len(lines) - 1.0))  # gives a mean square of about 1
        magnitude = np.abs(lines)
        lines *= np.divide(level, magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return lines
