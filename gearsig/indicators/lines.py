"""Amplitude of one order in a spectrum or a synchronous average, and the floor around it."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, exp, log, sqrt

import numpy as np

from gearsig.checks import positive
from gearsig.errors import InputError
from gearsig.indicators.gear import line_amplitude
from gearsig.orders.types import SynchronousAverage
from gearsig.spectra.types import Spectrum

LineSource = Spectrum | SynchronousAverage
"""Where an order's amplitude can be read: a spectrum, or the lines of an average."""

_PEAK_PER = {"amplitude peak": 1.0, "amplitude rms": sqrt(2.0)}
_WHOLE = 1e-6  # an order this close to a whole number is that line of an average


@dataclass(frozen=True)
class Line:
    """One order as it was found.

    Parameters
    ----------
    order : float
        Where the largest line was; the order asked for in an average.
    amplitude : float
        Peak amplitude; nan where `note` says why.
    largest : float
        Height of the largest line itself, to be compared with a floor of single lines; up to the window's scalloping
        (Hann: 1.4 dB) below `amplitude`.
    n_lines : int
        Lines among which the largest was taken.
    note : str
    """

    order: float
    amplitude: float
    largest: float = float("nan")
    n_lines: int = 1
    note: str = ""


def find_line(
    source: LineSource, order: float, *, search_orders: float = 0.0, speed_rev_per_s: float | None = None
) -> Line:
    """Return the peak amplitude of the largest line within `search_orders` of `order`.

    In a spectrum a sine spreads over the window's main lobe; A = √(Σ A_i² Δ/B) over the lobe, Δ the line spacing and B
    the noise bandwidth, is its amplitude wherever it lies between the lines.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    order : float
        Cycles per revolution of the shaft that the source's orders are counted on.
    search_orders : float
        Half width of the search; in an average the order must be whole and is not searched.
    speed_rev_per_s : float or None
        Of that shaft, for a spectrum over frequency.

    Returns
    -------
    Line

    Raises
    ------
    InputError
        On a spectrum of power or of quefrencies, or over frequency without a speed.
    """
    if isinstance(source, SynchronousAverage):
        return _line_of_average(source, order)
    unit = axis_per_order(source, speed_rev_per_s)
    position, half = order * unit, max(search_orders * unit, 0.5 * source.resolution)
    if position + half > float(source.positions[-1]):
        top = float(source.positions[-1]) / unit
        return Line(order, float("nan"), note=f"order {order:.4g} lies above the spectrum's end, {top:.4g}")
    low, high = source.index_of(position - half), source.index_of(position + half)
    best = low + int(np.argmax(source.values[low : high + 1]))
    lobe = lobe_lines(source)
    first, last = max(best - lobe, 0), min(best + lobe, len(source.values) - 1)
    energy = float(np.sum(np.square(source.values[first : last + 1], dtype=np.float64)))
    amplitude = sqrt(energy * source.resolution / source.noise_bandwidth) * _PEAK_PER[source.scaling]
    largest = float(source.values[best]) * _PEAK_PER[source.scaling]
    return Line(float(source.positions[best]) / unit, amplitude, largest, high - low + 1)


def floor_near(
    source: Spectrum, order: float, half_width_orders: float, *, leave_out_orders: float, speed_rev_per_s: float | None
) -> float:
    """Median peak amplitude of the lines around an order, the order's own surroundings left out; nan below 8 lines."""
    unit = axis_per_order(source, speed_rev_per_s)
    distance = np.abs(source.positions - order * unit)
    own = max(leave_out_orders * unit, lobe_lines(source) * source.resolution)
    # Lines at zero hold the mean of the signal, or what is left of it.
    near = (distance <= half_width_orders * unit) & (distance > own)
    near &= source.positions > lobe_lines(source) * source.resolution
    if np.count_nonzero(near) < 8:
        return float("nan")
    return float(np.median(source.values[near])) * _PEAK_PER[source.scaling]


def noise_reaches(n_lines: int, probability: float = 0.05) -> float:
    """Ratio to the median that the largest of `n_lines` lines of noise exceeds with `probability`.

    Lines of noise have Rayleigh amplitudes: P(a > x m) = 2^(-x²), m the median. Neighbouring lines of a window share
    noise and averaged spectra scatter less, so that the true probability is lower.
    """
    each = 1 - exp(log(1 - probability) / max(n_lines, 1))
    return sqrt(-log(each) / log(2))


def axis_per_order(source: Spectrum, speed_rev_per_s: float | None) -> float:
    """Axis units per order: 1 on an order axis, the speed on a frequency axis."""
    if source.scaling not in _PEAK_PER:
        raise InputError(
            f"the spectrum is scaled as {source.scaling!r}",
            allowed=", ".join(_PEAK_PER),
            remedy="compute it with an amplitude scaling",
        )
    if source.axis == "order":
        return 1.0
    if source.axis != "frequency" or speed_rev_per_s is None:
        raise InputError(
            f"orders cannot be placed on a {source.axis} axis",
            allowed="an order spectrum, or a frequency spectrum together with speed_rev_per_s",
        )
    return positive(speed_rev_per_s, "speed_rev_per_s", "rev/s")


def lobe_lines(source: Spectrum) -> int:
    """Half width of the window's main lobe in lines, from its noise bandwidth: 2 for Hann, 5 for flat-top."""
    return max(2, ceil(1.3 * source.noise_bandwidth / source.resolution))


def ratio_db(value: float, reference: float) -> float:
    """20 lg(value/reference); nan where either is not above zero."""
    if not (value > 0 and reference > 0):
        return float("nan")
    return 20 * float(np.log10(value / reference))


def _line_of_average(average: SynchronousAverage, order: float) -> Line:
    whole = round(order)
    if abs(order - whole) > _WHOLE * max(order, 1.0):
        return Line(
            order, float("nan"), note=f"order {order:.6g} is not whole: it is not in the average of {average.shaft!r}"
        )
    amplitude = line_amplitude(average, whole)
    if np.isnan(amplitude):
        return Line(order, amplitude, note=f"order {whole} lies above the average's end, {average.highest_order:.4g}")
    return Line(float(whole), amplitude, amplitude)
