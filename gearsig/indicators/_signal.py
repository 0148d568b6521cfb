"""Indicators of a whole signal: of its amplitude distribution, and overall values of a band.

Indicators of the amplitude distribution are computed from the raw signal, including the mean except for skewness and
kurtosis. Averages have divisor N. MATLAB's `rms`, `peak2rms`, `kurtosis` and `skewness` (with their default flags)
agree; `gearConditionMetrics` applies RMS, Kurtosis and CrestFactor to the synchronous average, not the raw signal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor, sqrt

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, frozen_array, read_only
from gearsig.compiled import njit
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.results import Result
from gearsig.rig import SI_FACTORS, si_factor
from gearsig.spectra import Spectrum, amplitude_spectrum, array_rate_hz, joined_length, with_continuous_ends

# --------------------
# The amplitude distribution.
# --------------------


def checked_values(values: FloatArray, name: str = "values") -> FloatArray:
    """Return the values as a one-dimensional, finite float64 array of at least one value."""
    x = frozen_array(values, name, ndim=1)
    if x.size == 0:
        raise InputError(f"{name} is empty", allowed="at least one value")
    return x.astype(np.float64, copy=False)


CONSTANT = 1e-12
"""Scatter relative to size below which it is only rounding."""


def is_constant(x: FloatArray, size: float | None = None) -> bool:
    """Whether the scatter of `x` is only rounding relative to `size` (default: its largest magnitude)."""
    scale = float(np.abs(x).max()) if size is None else size
    largest_deviation = float(np.abs(x - x.mean()).max())
    return largest_deviation <= CONSTANT * scale


def standardised_moment(x: FloatArray, order: int, size: float | None = None) -> float:
    """Return the k-th central moment over σ^k, N^(k/2 - 1) Σ (x - x̄)^k / (Σ (x - x̄)²)^(k/2); σ² has divisor N.

    nan for a constant; see `is_constant` for `size`.
    """
    if is_constant(x, size):
        return float("nan")
    d = x - x.mean()
    d = d / np.abs(d).max()  # powers up to 8 neither overflow nor vanish
    square = d * d
    power = square ** (order // 2)  # an array to an integer power above two takes thirty times as long
    return float(np.mean(power * d if order % 2 else power) / np.mean(square) ** (order / 2))


@dataclass(frozen=True)
class Indicator(Result):
    """A condition indicator with everything needed to interpret it.

    Parameters
    ----------
    name : str
        As in the literature: "FM4", "sideband index", …
    value : float
        nan if it is undefined (e.g. the kurtosis of a constant); `note` says why.
    unit : str
        Empty if dimensionless.
    channel : str
    computed_on : str
        "raw", "synchronous average", "residual", "difference", "regular", "band-passed mesh", "envelope", …
    shaft, gear, bearing : str
        The component it belongs to: a shaft's name, a gear as "pair/shaft", a bearing's name; all empty if it belongs
        to the channel.
    band : str
        Frequency or order band, with unit.
    note : str
    """

    name: str
    value: float
    unit: str = ""
    channel: str = ""
    computed_on: str = "raw"
    shaft: str = ""
    gear: str = ""
    band: str = ""
    note: str = ""
    bearing: str = ""


class Amplitudes:
    """Shared statistics for the indicators of a signal's amplitudes, computed once for all of them.

    Parameters
    ----------
    values : array, (n_samples,)
    """

    def __init__(self, values: FloatArray) -> None:
        self.x = checked_values(values)
        self.mean, low, high = (float(f()) for f in (self.x.mean, self.x.min, self.x.max))
        self.peak, self.peak_to_peak = max(-low, high) + 0.0, high - low  # no -0
        self.largest_deviation = max(high - self.mean, self.mean - low)

    @cached_property
    def means(self) -> tuple[float, ...]:
        """Means of |y|, √|y|, y² and d², d³, d⁴, with y = x/peak and d the deviation from the mean over its maximum.

        Powers of values up to one neither overflow nor vanish.
        """
        scales = (1.0 / s if s > 1e-300 else 0.0 for s in (self.peak, self.largest_deviation))
        sums: tuple[float, ...] = _power_sums(read_only(self.x), self.mean, *scales)
        return tuple(s / len(self.x) for s in sums)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"})  # type: ignore[untyped-decorator,unused-ignore]
def _power_sums(x, mean, per_peak, per_deviation):  # type: ignore[no-untyped-def]
    size, root, square, second, third, fourth = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(x.shape[0]):
        y, d = abs(x[i]) * per_peak, (x[i] - mean) * per_deviation
        size += y
        root += np.sqrt(y)
        square += y * y
        second += d * d
        third += d * d * d
        fourth += (d * d) * (d * d)
    return size, root, square, second, third, fourth


Values = FloatArray | Amplitudes


def _of(values: Values) -> Amplitudes:
    return values if isinstance(values, Amplitudes) else Amplitudes(values)


def rms(values: Values) -> float:
    """Return √(mean x²), in the signal's unit."""
    a = _of(values)
    return a.peak * sqrt(a.means[2])


def peak(values: Values) -> float:
    """Return the largest |x|, in the signal's unit."""
    return _of(values).peak


def peak_to_peak(values: Values) -> float:
    """Return the largest minus the smallest value, in the signal's unit."""
    return _of(values).peak_to_peak


def crest_factor(values: Values) -> float:
    """Return peak over rms; √2 for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(a.peak, rms(a))


def skewness(values: Values) -> float:
    """Return the third central moment over σ³; 0 for a symmetric distribution, nan for a constant."""
    return _standardised(_of(values), 3)


def kurtosis(values: Values) -> float:
    """Return the fourth central moment over σ⁴; 3 for a normal distribution, 1.5 for a sine, nan for a constant.

    The excess kurtosis is this minus 3.
    """
    return _standardised(_of(values), 4)


def shape_factor(values: Values) -> float:
    """Return rms over mean |x|; π/(2√2) for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(rms(a), a.peak * a.means[0])


def impulse_factor(values: Values) -> float:
    """Return peak over mean |x|; π/2 for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(a.peak, a.peak * a.means[0])


def clearance_factor(values: Values) -> float:
    """Return peak over (mean √|x|)², also called margin factor; nan for zeros."""
    a = _of(values)
    return _ratio(a.peak, a.peak * a.means[1] ** 2)


def _standardised(a: Amplitudes, order: int) -> float:
    """Return the central moment of order 3 or 4 over the same power of σ."""
    if a.largest_deviation <= CONSTANT * a.peak:
        return float("nan")
    return a.means[order + 1] / float(a.means[3] ** (order / 2))


def time_indicators(
    signal: FloatArray | Recording,
    channel: str | float = "",
    unit: str = "",
    *,
    computed_on: str = "raw",
    shaft: str = "",
) -> tuple[Indicator, ...]:
    """Return rms, peaks, moments and factors of a signal's amplitudes.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel : str or float
        A recording's channel. For an array: its sampling rate in Hz, as in other methods, though no indicator depends
        on it; or a channel name for the indicators.
    unit : str
        Unit stated in the indicators; default: that of the recording's channel.
    computed_on : str
        "raw", "synchronous average", …
    shaft : str
        The shaft, if the values are its average.

    Returns
    -------
    tuple of Indicator
        Undefined ones are nan, with a note.

    Raises
    ------
    InputError
        On an empty array or one with NaN, or a sampling rate that is not above zero.

    References
    ----------
    M. Lebold et al., "Review of vibration analysis methods for gearbox diagnostics and prognostics", 2000.
    """
    if not isinstance(channel, str):
        if isinstance(signal, Recording):
            raise InputError(f"channel of a recording is {channel!r}", allowed=", ".join(signal.channel_names))
        array_rate_hz(channel, "channel")
        channel = ""
    if isinstance(signal, Recording):
        unit = unit or signal.channels[signal.index(channel)].unit
        signal = signal.values(channel)
    amplitudes = Amplitudes(signal)
    offset = ""
    if abs(amplitudes.mean) > 0.1 * rms(amplitudes):  # the indicators then reflect the offset rather than the vibration
        offset = f"the signal has a mean of {amplitudes.mean:.4g} {unit}, which is included".replace(" ,", ",")
    indicators = []
    for name, function in _OF_AMPLITUDE.items():
        value = function(amplitudes)
        note = "undefined: the signal is constant" if np.isnan(value) else offset
        if name in ("skewness", "kurtosis") and note == offset:
            note = ""  # central moments exclude the mean
        own_unit = unit if function in (rms, peak, peak_to_peak) else ""
        indicators.append(Indicator(name, value, own_unit, channel, computed_on, shaft, note=note))
    return tuple(indicators)


_OF_AMPLITUDE: dict[str, Callable[[Values], float]] = {
    "rms": rms,
    "peak": peak,
    "peak-to-peak": peak_to_peak,
    "crest factor": crest_factor,
    "skewness": skewness,
    "kurtosis": kurtosis,
    "shape factor": shape_factor,
    "impulse factor": impulse_factor,
    "clearance factor": clearance_factor,
}


def _ratio(numerator: float, denominator: float) -> float:
    return numerator / denominator if denominator > 0 else float("nan")


# --------------------
# Overall values of a band: the velocity used in maintenance, and the impulsiveness at high frequencies.
# --------------------


VELOCITY_BAND_HZ = (10.0, 1000.0)
"""Band of the overall velocity, ISO 20816-1."""

SLOW_RPM, SLOW_LOWEST_HZ = 600.0, 2.0
"""Below this speed the band begins at 2 Hz, ISO 20816-3."""

MIN_PERIODS = 10
"""Minimum periods of the lowest frequency in a recording, so that its lines are separate from the mean."""

SAME_FREQUENCY = 0.005
"""Relative tolerance of frequencies, for a speed that is only stated or varies slightly."""

HIGH_BAND_HZ = (1000.0, 10_000.0)
"""Band in which bearings ring, but gears and unbalance hardly contribute."""

ZONE_LIMITS_MM_PER_S = {
    (1, "rigid"): (2.3, 4.5, 7.1),
    (1, "flexible"): (3.5, 7.1, 11.0),
    (2, "rigid"): (1.4, 2.8, 4.5),
    (2, "flexible"): (2.3, 4.5, 7.1),
}
"""Boundaries A/B, B/C, C/D of the rms velocity by machine group and mounting: ISO 20816-3:2022, annex A."""


def overall_velocity_mm_per_s(
    values: FloatArray,
    sampling_rate_hz: float,
    channel: Channel,
    band_hz: tuple[float, float] = VELOCITY_BAND_HZ,
    *,
    spectrum: Spectrum | None = None,
) -> float:
    r"""Return the rms vibration velocity in a band, in mm/s.

    It follows from the Hann-windowed amplitude spectrum A of acceleration, with a noise bandwidth of 1.5 lines:

    .. math:: v_{rms}^2 = \frac{1}{1.5} \sum_{f \in band} \frac{A(f)^2}{2 (2 \pi f)^2}

    Parameters
    ----------
    values : array, (n_samples,)
        In the channel's unit.
    sampling_rate_hz : float
    channel : Channel
        An acceleration or a velocity in a known unit.
    band_hz : (float, float)
    spectrum : Spectrum or None
        The `amplitude_spectrum` of the values, if known.

    Raises
    ------
    InputError
        If the channel is neither, its unit is not known, or the recording is too short or sampled too slowly.
    """
    quantity = "velocity" if channel.quantity == "velocity" else "acceleration"
    factor = si_factor(quantity, channel.unit) if channel.quantity in ("velocity", "acceleration") else None
    where = f"channel {channel.name!r}"
    if factor is None:
        raise InputError(
            f"its unit is {channel.unit or 'not known'!r}, its quantity {channel.quantity}",
            where=where,
            allowed=", ".join((*SI_FACTORS["acceleration"], *SI_FACTORS["velocity"])),
            remedy="state quantity and unit with a [[sensor]] in the rig file",
        )
    low_hz, high_hz = band_hz
    if 2 * high_hz >= sampling_rate_hz:
        raise InputError(f"it was sampled at {sampling_rate_hz:g} Hz", where=where, allowed=f"above {2 * high_hz:g} Hz")
    x = checked_values(values)
    if len(x) * low_hz < MIN_PERIODS * sampling_rate_hz:
        raise InputError(
            f"it is {len(x) / sampling_rate_hz:.3g} s long", where=where, allowed=f"{MIN_PERIODS / low_hz:g} s or more"
        )
    _, mean_square = _velocity_lines(spectrum or amplitude_spectrum(x, sampling_rate_hz), quantity, band_hz)
    return 1e3 * factor * float(np.sqrt(mean_square.sum()))


def velocity_shares(
    spectrum: Spectrum, channel: Channel, places_hz: Mapping[str, Sequence[float]], band_hz: tuple[float, float]
) -> dict[str, float]:
    """Return the share of the squared overall velocity, 0 to 1, around the frequencies of each source.

    Parameters
    ----------
    spectrum : Spectrum
        `amplitude_spectrum` of an acceleration or a velocity.
    channel : Channel
    places_hz : mapping
        Name of a source → its frequencies; lines within two lines or half a per cent of them count.
    band_hz : (float, float)
        See `velocity_band_hz`.
    """
    hertz, mean_square = _velocity_lines(spectrum, channel.quantity, band_hz)
    total = float(mean_square.sum())
    shares = {}
    for name, frequencies in places_hz.items():
        is_there = np.zeros(len(hertz), dtype=bool)
        for frequency in frequencies:
            is_there |= np.abs(hertz - frequency) <= max(2.0 * spectrum.resolution, SAME_FREQUENCY * frequency)
        shares[name] = float(mean_square[is_there].sum()) / total if total > 0.0 else 0.0
    return shares


def _velocity_lines(spectrum: Spectrum, quantity: str, band_hz: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return the frequencies within a band, and each line's contribution to the mean square velocity."""
    inside = slice(*np.searchsorted(spectrum.positions, (band_hz[0], np.nextafter(band_hz[1], np.inf))))
    amplitude, hertz = spectrum.values[inside], spectrum.positions[inside]
    if quantity == "acceleration":
        amplitude = amplitude / (2 * np.pi * hertz)
    return hertz, 0.5 * np.square(amplitude) * spectrum.resolution / spectrum.noise_bandwidth


def velocity_band_hz(speed_rpm: float | None) -> tuple[float, float]:
    """Return the band of the overall velocity in Hz, which is wider for slow machines (ISO 20816-3)."""
    low_hz, high_hz = VELOCITY_BAND_HZ
    return (SLOW_LOWEST_HZ if speed_rpm is not None and speed_rpm < SLOW_RPM else low_hz), high_hz


def vibration_zone(velocity_mm_per_s: float, group: int, mounting: str) -> str:
    """Return the zone of ISO 20816-3 for an overall velocity.

    A: typical of new machines; B: acceptable for unrestricted long-term operation; C: not acceptable for long-term
    operation; D: severe enough to cause damage.

    Parameters
    ----------
    velocity_mm_per_s : float
        Rms from 10 to 1000 Hz on a bearing housing at steady speed; the maximum of all measuring points.
    group : int
        1 or 2, see `gearsig.rig.MachineSize`.
    mounting : str
        "rigid" or "flexible".

    Raises
    ------
    InputError
        On a group or mounting that is not in the standard.

    Examples
    --------
    >>> vibration_zone(2.0, 2, "rigid"), vibration_zone(7.2, 1, "rigid")
    ('B', 'D')
    """
    if (group, mounting) not in ZONE_LIMITS_MM_PER_S:
        known = ", ".join(f"{g} {m}" for g, m in ZONE_LIMITS_MM_PER_S)
        raise InputError(f"machine group and mounting are {group!r} {mounting!r}", allowed=known)
    return "ABCD"[sum(velocity_mm_per_s > limit for limit in ZONE_LIMITS_MM_PER_S[group, mounting])]


def overall_indicators(
    values: FloatArray,
    sampling_rate_hz: float,
    channel: Channel,
    speed_rpm: float | None = None,
    *,
    spectrum: Spectrum | None = None,
    transform: NDArray[np.complexfloating] | None = None,
) -> Iterator[Indicator]:
    """Yield the overall velocity, and rms, crest factor and kurtosis of the high frequencies, if they are defined.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    channel : Channel
    speed_rpm : float or None
        For slow machines, the velocity band begins at 2 Hz.
    spectrum : Spectrum or None
        The `amplitude_spectrum` of the values, if known.
    transform : array or None
        The `rfft` of `gearsig.spectra.with_continuous_ends` of the values, if known.
    """
    from scipy.fft import irfft, rfft

    band_hz = velocity_band_hz(speed_rpm)
    try:
        velocity = overall_velocity_mm_per_s(values, sampling_rate_hz, channel, band_hz, spectrum=spectrum)
    except InputError:
        pass
    else:
        yield Indicator("overall velocity", velocity, "mm/s", channel.name, "velocity", band=_band_text(band_hz))
    low_hz, high_hz = HIGH_BAND_HZ[0], min(HIGH_BAND_HZ[1], 0.45 * sampling_rate_hz)
    if channel.quantity in ("acceleration", "unknown") and high_hz > 2 * low_hz:
        known = rfft(with_continuous_ends(checked_values(values))) if transform is None else transform
        n = joined_length(len(values), len(known))
        inside = slice(ceil(low_hz * n / sampling_rate_hz), floor(high_hz * n / sampling_rate_hz) + 1)
        lines = np.zeros_like(known)
        lines[inside] = known[inside]
        high = Amplitudes(irfft(lines, n, overwrite_x=True)[: len(values)])
        for name, value, unit in (
            ("high-frequency rms", rms(high), channel.unit),
            ("high-frequency crest factor", crest_factor(high), ""),
            ("high-frequency kurtosis", kurtosis(high), ""),
        ):
            yield Indicator(name, value, unit, channel.name, "band-passed", band=_band_text((low_hz, high_hz)))


def _band_text(band_hz: tuple[float, float]) -> str:
    return f"{band_hz[0]:g} to {band_hz[1]:g} Hz"
