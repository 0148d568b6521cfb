"""Indicators of a signal's amplitude distribution, as they are taken from the raw signal.

All use the values as they are, mean included, except skewness and kurtosis. Averages have divisor N. MATLAB's
`rms`, `peak2rms`, `kurtosis` and `skewness` (with their default flags) agree; `gearConditionMetrics` applies RMS,
Kurtosis and CrestFactor to the synchronous average instead of the raw signal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.recording import Recording
from gearsig.results import Result


def checked_values(values: FloatArray, name: str = "values") -> FloatArray:
    """Return the values as float64, one-dimensional, finite and at least one."""
    x = frozen_array(values, name, ndim=1)
    if x.size == 0:
        raise InputError(f"{name} is empty", allowed="at least one value")
    return x.astype(np.float64, copy=False)


def is_constant(x: FloatArray, size: float | None = None) -> bool:
    """Whether the scatter of `x` is only rounding against `size` (default: its own largest magnitude)."""
    scale = float(np.abs(x).max()) if size is None else size
    largest_deviation = float(np.abs(x - x.mean()).max())
    return largest_deviation <= 1e-12 * scale or largest_deviation == 0.0


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


def rms(values: FloatArray) -> float:
    """√(mean x²), in the signal's unit."""
    x = checked_values(values)
    scale = float(np.abs(x).max())
    return scale * float(np.sqrt(np.mean((x / scale) ** 2))) if scale > 0 else 0.0


def peak(values: FloatArray) -> float:
    """Largest |x|, in the signal's unit."""
    return float(np.abs(checked_values(values)).max())


def peak_to_peak(values: FloatArray) -> float:
    """Largest minus smallest value, in the signal's unit."""
    x = checked_values(values)
    return float(x.max() - x.min())


def crest_factor(values: FloatArray) -> float:
    """Peak over rms; √2 for a sine, nan for zeros."""
    return _ratio(peak(values), rms(values))


def skewness(values: FloatArray) -> float:
    """Third central moment over σ³; 0 for a symmetric distribution, nan for a constant."""
    return standardised_moment(checked_values(values), 3)


def kurtosis(values: FloatArray) -> float:
    """Fourth central moment over σ⁴; 3 for a normal distribution, 1.5 for a sine, nan for a constant.

    Not the excess kurtosis, which is this minus 3.
    """
    return standardised_moment(checked_values(values), 4)


def shape_factor(values: FloatArray) -> float:
    """Rms over mean |x|; π/(2√2) for a sine, nan for zeros."""
    return _ratio(rms(values), _mean_magnitude(values))


def impulse_factor(values: FloatArray) -> float:
    """Peak over mean |x|; π/2 for a sine, nan for zeros."""
    return _ratio(peak(values), _mean_magnitude(values))


def clearance_factor(values: FloatArray) -> float:
    """Peak over (mean √|x|)²; nan for zeros. Also called margin factor."""
    x = np.abs(checked_values(values))
    return _ratio(float(x.max()), float(np.mean(np.sqrt(x))) ** 2)


def time_indicators(
    signal: FloatArray | Recording, channel: str = "", unit: str = "", *, computed_on: str = "raw", shaft: str = ""
) -> tuple[Indicator, ...]:
    """Return rms, peaks, moments and factors of a signal's amplitudes.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel, unit : str
        Of a recording: which to read, and in what unit. Of an array: what the indicators are labelled with.
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
        On an empty array or one with NaN.

    References
    ----------
    M. Lebold et al., "Review of vibration analysis methods for gearbox diagnostics and prognostics", 2000.
    """
    if isinstance(signal, Recording):
        unit = unit or signal.channels[signal.index(channel)].unit
        signal = signal.values(channel)
    x = checked_values(signal)
    mean = float(x.mean())
    offset = ""
    if abs(mean) > 0.1 * rms(x):  # then amplitudes say more about the offset than about the vibration
        offset = f"the signal has a mean of {mean:.4g} {unit}, which is included".replace(" ,", ",")
    indicators = []
    for name, function in _OF_AMPLITUDE.items():
        value = function(x)
        note = "undefined: the signal is constant" if np.isnan(value) else offset
        if name in ("skewness", "kurtosis") and note == offset:
            note = ""  # of central moments
        own_unit = unit if function in (rms, peak, peak_to_peak) else ""
        indicators.append(Indicator(name, value, own_unit, channel, computed_on, shaft, note=note))
    return tuple(indicators)


_OF_AMPLITUDE: dict[str, Callable[[FloatArray], float]] = {
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


def _mean_magnitude(values: FloatArray) -> float:
    return float(np.mean(np.abs(checked_values(values))))


def _ratio(numerator: float, denominator: float) -> float:
    return numerator / denominator if denominator > 0 else float("nan")
