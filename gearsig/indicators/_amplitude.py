"""Indicators of a signal's amplitude distribution, as they are taken from the raw signal.

All use the values as they are, mean included, except skewness and kurtosis. Averages have divisor N. MATLAB's
`rms`, `peak2rms`, `kurtosis` and `skewness` (with their default flags) agree; `gearConditionMetrics` applies RMS,
Kurtosis and CrestFactor to the synchronous average instead of the raw signal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np

from gearsig.checks import FloatArray, frozen_array, read_only
from gearsig.compiled import njit
from gearsig.errors import InputError
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import array_rate_hz


def checked_values(values: FloatArray, name: str = "values") -> FloatArray:
    """Return the values as float64, one-dimensional, finite and at least one."""
    x = frozen_array(values, name, ndim=1)
    if x.size == 0:
        raise InputError(f"{name} is empty", allowed="at least one value")
    return x.astype(np.float64, copy=False)


CONSTANT = 1e-12
"""Scatter over size that is only rounding."""


def is_constant(x: FloatArray, size: float | None = None) -> bool:
    """Whether the scatter of `x` is only rounding against `size` (default: its own largest magnitude)."""
    scale = float(np.abs(x).max()) if size is None else size
    largest_deviation = float(np.abs(x - x.mean()).max())
    return largest_deviation <= CONSTANT * scale


def standardised_moment(x: FloatArray, order: int, size: float | None = None) -> float:
    """N^(k/2 - 1) Σ (x - x̄)^k / (Σ (x - x̄)²)^(k/2), i.e. the k-th central moment over σ^k, σ² with divisor N.

    nan for a constant; see `is_constant` for `size`.
    """
    if is_constant(x, size):
        return float("nan")
    d = x - x.mean()
    d = d / np.abs(d).max()  # powers up to 8 neither overflow nor vanish
    square = d * d
    power = square ** (order // 2)  # the power of an array by a whole number above two takes thirty times as long
    return float(np.mean(power * d if order % 2 else power) / np.mean(square) ** (order / 2))


@dataclass(frozen=True)
class Indicator(Result):
    """A number that says something about the condition, with everything needed to read it.

    Parameters
    ----------
    name : str
        As in the literature: "FM4", "sideband index", …
    value : float
        nan where it is undefined (e.g. the kurtosis of a constant); `note` says why.
    unit : str
        Empty for a dimensionless one.
    channel : str
    computed_on : str
        "raw", "synchronous average", "residual", "difference", "regular", "band-passed mesh", "envelope", …
    shaft, gear, bearing : str
        What it belongs to: a shaft's name, a gear as "pair/shaft", a bearing's name; all empty where it belongs to the
        channel.
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
    """What the indicators of a signal's amplitudes share: the signal is looked at twice, whatever is asked.

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
        """Means of |y|, √|y|, y² and d², d³, d⁴: y over the peak, d from the mean, over the largest deviation.

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
    """√(mean x²), in the signal's unit."""
    a = _of(values)
    return a.peak * sqrt(a.means[2])


def peak(values: Values) -> float:
    """Largest |x|, in the signal's unit."""
    return _of(values).peak


def peak_to_peak(values: Values) -> float:
    """Largest minus smallest value, in the signal's unit."""
    return _of(values).peak_to_peak


def crest_factor(values: Values) -> float:
    """Peak over rms; √2 for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(a.peak, rms(a))


def skewness(values: Values) -> float:
    """Third central moment over σ³; 0 for a symmetric distribution, nan for a constant."""
    return _standardised(_of(values), 3)


def kurtosis(values: Values) -> float:
    """Fourth central moment over σ⁴; 3 for a normal distribution, 1.5 for a sine, nan for a constant.

    Not the excess kurtosis, which is this minus 3.
    """
    return _standardised(_of(values), 4)


def shape_factor(values: Values) -> float:
    """Rms over mean |x|; π/(2√2) for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(rms(a), a.peak * a.means[0])


def impulse_factor(values: Values) -> float:
    """Peak over mean |x|; π/2 for a sine, nan for zeros."""
    a = _of(values)
    return _ratio(a.peak, a.peak * a.means[0])


def clearance_factor(values: Values) -> float:
    """Peak over (mean √|x|)²; nan for zeros. Also called margin factor."""
    a = _of(values)
    return _ratio(a.peak, a.peak * a.means[1] ** 2)


def _standardised(a: Amplitudes, order: int) -> float:
    """Return the central moment of order 3 or 4 over that power of σ."""
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
        Of a recording: which to read. Of an array: its sampling rate in Hz, as other methods take it, though no
        indicator depends on it; or what the indicators are labelled with.
    unit : str
        In which a recording's channel is read; else what the indicators are labelled with.
    computed_on : str
        "raw", "synchronous average", …
    shaft : str
        Where the values are a shaft's average.

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
    if abs(amplitudes.mean) > 0.1 * rms(amplitudes):  # then they say more about the offset than about the vibration
        offset = f"the signal has a mean of {amplitudes.mean:.4g} {unit}, which is included".replace(" ,", ",")
    indicators = []
    for name, function in _OF_AMPLITUDE.items():
        value = function(amplitudes)
        note = "undefined: the signal is constant" if np.isnan(value) else offset
        if name in ("skewness", "kurtosis") and note == offset:
            note = ""  # of central moments
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
