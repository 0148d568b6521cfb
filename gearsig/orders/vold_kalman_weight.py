"""Bandwidth and weighting of the Vold–Kalman filter: closed forms for each pole count and generation."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, count, positive, within
from gearsig.errors import InputError

N_POLES_MAX = 3
HALF_POWER = np.sqrt(np.sqrt(2.0) - 1.0)
"""r·|D| at the -3 dB points, for there 1/(1 + r²|D|²) = 1/√2."""


def weight_of_bandwidth(bandwidth_hz: float, sampling_rate_hz: float, n_poles: int = 2) -> float:
    """Return the weighting factor r of the second generation that gives a -3 dB bandwidth.

    r = √(√2 - 1)/(2 sin(πB/2f_s))^p. For narrow bands this is 0.2049/b, 0.0652/b² and 0.0208/b³ with b = B/f_s, for
    one, two and three poles.

    Parameters
    ----------
    bandwidth_hz : float
        Full width between the -3 dB points, above zero and below the sampling rate.
    sampling_rate_hz : float
    n_poles : int
        1 to 3.

    Returns
    -------
    float

    Raises
    ------
    InputError
        On a bandwidth or a number of poles that is not allowed.

    References
    ----------
    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    width = positive(bandwidth_hz, "bandwidth_hz", "Hz")
    if width >= rate:
        raise InputError(f"bandwidth_hz is {width:g} Hz", allowed=f"below the sampling rate of {rate:g} Hz")
    return float(envelope_weight(np.array([width / rate]), checked_poles(n_poles))[0])


def bandwidth_of_weight(weight: float, sampling_rate_hz: float, n_poles: int = 2) -> float:
    """Return the -3 dB bandwidth in Hz of a weighting factor of the second generation.

    B = 2f_s/π · arcsin((√(√2 - 1)/r)^(1/p)/2), the inverse of `weight_of_bandwidth`.

    Raises
    ------
    InputError
        On a weight so small that no frequency is attenuated by 3 dB.
    """
    p = checked_poles(n_poles)
    half_sine = 0.5 * (HALF_POWER / positive(weight, "weight")) ** (1.0 / p)
    if half_sine >= 1.0:
        raise InputError(f"weight is {weight:g}", allowed=f"above {HALF_POWER / 2**p:.4g} with {p} pole(s)")
    return float(2.0 * positive(sampling_rate_hz, "sampling_rate_hz", "Hz") / np.pi * np.arcsin(half_sine))


def envelope_response(
    offset_hz: FloatArray, bandwidth_hz: float, sampling_rate_hz: float, n_poles: int = 2
) -> FloatArray:
    """Return the gain of the second generation for a component `offset_hz` away from the order.

    H(f) = 1/(1 + r² (2 sin πf/f_s)^2p): real, no phase shift. It holds for constant bandwidth, away from the ends, for
    one order or several that lie far apart.

    Parameters
    ----------
    offset_hz : array
    bandwidth_hz, sampling_rate_hz, n_poles
        As in `weight_of_bandwidth`.

    Returns
    -------
    array
        0 to 1; 1/√2 at ± half the bandwidth.
    """
    r = weight_of_bandwidth(bandwidth_hz, sampling_rate_hz, n_poles)
    difference = 2.0 * np.sin(np.pi * np.asarray(offset_hz, dtype=np.float64) / sampling_rate_hz)
    gain: FloatArray = 1.0 / (1.0 + (r * difference**n_poles) ** 2)
    return gain


def waveform_weight_of_bandwidth(bandwidth_hz: float, frequency_hz: float, sampling_rate_hz: float) -> float:
    """Return the weighting factor r of the first generation that gives a -3 dB bandwidth at an order's frequency.

    With h = πB/f_s and ω = 2πf/f_s, r = √(√2 - 1)/(2 tan h √(sin²ω - sin²h)): the -3 dB points of
    1/(1 + r²(2 cos ω' - 2 cos ω)²) then lie 2h apart, not quite symmetric about ω.

    Raises
    ------
    InputError
        If a -3 dB point would lie below zero frequency or above half the sampling rate.
    """
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    width = within(positive(bandwidth_hz, "bandwidth_hz", "Hz"), "bandwidth_hz", 0.0, rate / 2, "Hz")
    lowest = float(lowest_frequency(np.array([width / rate]))[0]) * rate
    within(frequency_hz, "frequency_hz", lowest * (1 + 1e-9), rate / 2 - lowest, "Hz", remedy="narrow the band")
    return float(waveform_weight(np.array([width / rate]), np.array([frequency_hz / rate]))[0])


def settling_time(bandwidth: FloatArray, skirt_poles: int) -> FloatArray:
    """Return the time after which the filter's response has decayed to 1 %, in the inverse unit of the bandwidth.

    The slowest pole of 1/(1 + (√2 - 1)(2f/B)^2p) decays as exp(-t/τ), τ = (√2 - 1)^(1/2p)/(πB sin(π/2p)); this is
    τ ln 100: 0.94/B, 1.66/B and 2.53/B for one, two and three poles. The first generation's skirts have one. Where the
    bandwidth is 0, as that of an order of a shaft at rest, it is infinite.
    """
    slowness = HALF_POWER ** (1.0 / skirt_poles) / (np.pi * np.sin(0.5 * np.pi / skirt_poles))
    with np.errstate(divide="ignore"):
        time: FloatArray = np.log(100.0) * slowness / bandwidth
    return time


def envelope_weight(bandwidth: FloatArray, p: int) -> FloatArray:
    """Return r of the second generation; bandwidth in cycles per sample."""
    r: FloatArray = HALF_POWER / (2.0 * np.sin(0.5 * np.pi * bandwidth)) ** p
    return r


def waveform_weight(bandwidth: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return r of the first generation; bandwidth and frequency in cycles per sample."""
    h, omega = np.pi * bandwidth, 2.0 * np.pi * frequency
    # sin²ω - sin²h as a product: no digits are lost where the band nearly touches zero frequency.
    r: FloatArray = HALF_POWER / (2.0 * np.tan(h) * np.sqrt(np.sin(omega - h) * np.sin(omega + h)))
    return r


def lowest_frequency(bandwidth: FloatArray) -> FloatArray:
    """Return the frequency below which the first generation's band reaches zero; both in cycles per sample.

    cos ω = cos² h: about 0.71 bandwidths, for the band is not symmetric. The same holds below half the sampling rate.
    """
    f: FloatArray = np.arccos(np.cos(np.pi * bandwidth) ** 2) / (2.0 * np.pi)
    return f


def checked_poles(n_poles: int) -> int:
    """Return the number of poles if it is 1, 2 or 3."""
    p = count(n_poles, "n_poles")
    if p > N_POLES_MAX:
        raise InputError(f"n_poles is {p}", allowed="1, 2 or 3")
    return p
