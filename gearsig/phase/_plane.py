"""Portraits of motion in phase space, checks on them, and the phase plane by integration within a band."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, floor
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, freeze, frozen_array, instance_of, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.rig import si_factor
from gearsig.spectra import named_signal

PortraitKind = Literal["phase plane", "delay embedding", "states"]


@dataclass(frozen=True)
class PhasePortrait(Result, matrix=("points", "times_s", "axis_names")):
    """A path through phase space, sampled at a constant rate.

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Sample i lies at `start_s` + i / `sampling_rate_hz` of the recording's time.
    sampling_rate_hz : float
    axis_names, units : tuples of str
        One per axis.
    kind : str
        "phase plane": displacement and velocity; "delay embedding": x(t), x(t + τ), …; "states": states of a model.
    source : str
        The channel and its processing.
    start_s : float
    band_hz : (float, float)
        Band that the axes contain without attenuation; (0, inf) if nothing was filtered.
    delay_samples : int
        Delay of a delay embedding; 0 otherwise.
    """

    points: FloatArray
    sampling_rate_hz: float
    axis_names: tuple[str, ...]
    units: tuple[str, ...]
    kind: PortraitKind
    source: str
    start_s: float = 0.0
    band_hz: tuple[float, float] = (0.0, float("inf"))
    delay_samples: int = 0

    def __post_init__(self) -> None:
        freeze(self, "points", ndim=2)
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        if not self.points.shape[1] == len(self.axis_names) == len(self.units):
            raise InputError(
                f"{len(self.axis_names)} axis names and {len(self.units)} units for {self.points.shape[1]} axes"
            )

    @property
    def n_points(self) -> int:
        """Number of samples of the path."""
        return int(self.points.shape[0])

    @property
    def n_axes(self) -> int:
        """Dimension of the space."""
        return int(self.points.shape[1])

    @property
    def times_s(self) -> FloatArray:
        """Time of each sample in s, (n_points,)."""
        return self.start_s + np.arange(self.n_points) / self.sampling_rate_hz

    @property
    def end_s(self) -> float:
        """Time of the last sample, in s."""
        return self.start_s + (self.n_points - 1) / self.sampling_rate_hz

    @property
    def extent(self) -> FloatArray:
        """Standard deviation along each axis, (n_axes,): the size to which distances are compared."""
        deviation: FloatArray = np.std(self.points, axis=0, dtype=np.float64)
        return deviation

    def between(self, start_s: float, end_s: float) -> PhasePortrait:
        """Return the samples from `start_s` to `end_s`, both included.

        Raises
        ------
        InputError
            If there are fewer than two.
        """
        first = max(0, ceil((start_s - self.start_s) * self.sampling_rate_hz - 1e-6))
        last = min(self.n_points - 1, floor((end_s - self.start_s) * self.sampling_rate_hz + 1e-6))
        if last <= first:
            raise InputError(
                f"there are no samples from {start_s:g} to {end_s:g} s", allowed=f"{self.start_s:g} to {self.end_s:g} s"
            )
        start = self.start_s + first / self.sampling_rate_hz
        return replace(self, points=self.points[first : last + 1], start_s=start)


def check_portrait(value: object) -> None:
    """Raise unless the value is a path in phase space."""
    remedy = "gearsig.phase_plane and gearsig.delay_embedding(recording, channel) make one"
    instance_of(value, PhasePortrait, "portrait", remedy=remedy)


def checked_series(values: FloatArray, *, minimum: int, name: str = "values") -> FloatArray:
    """Return a finite float64 series of at least `minimum` samples that is not constant.

    Raises
    ------
    InputError
        On NaN, a wrong shape, or too few samples.
    RefusalError
        If the series is constant: there is no motion to analyse.
    """
    x = frozen_array(values, name, ndim=1)
    if len(x) < minimum:
        raise InputError(
            f"{name} has {counted(len(x), 'sample')}",
            allowed=f"at least {minimum}",
            remedy="record longer or request less",
        )
    low, high = float(x.min()), float(x.max())
    if high - low <= 8.0 * np.finfo(x.dtype).eps * max(abs(low), abs(high)):
        raise RefusalError(
            f"{name} is constant at {low:g}: nothing moves, so there is nothing to embed",
            remedy="check the sensor, or take a channel or a segment that vibrates",
        )
    return np.asarray(x, dtype=np.float64)


def mean_period_samples(x: FloatArray) -> float:
    """Return the reciprocal of the power spectrum's mean frequency, in samples; at least 2.

    T = Σ|X(f)|² / Σ f |X(f)|², with the mean of the signal removed.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, *A practical method for calculating largest Lyapunov
    exponents from small data sets*, Physica D 65 (1993).
    """
    from scipy import fft

    part = x[: 1 << 20]
    lines = fft.rfft(part - part.mean(), fft.next_fast_len(len(part), real=True))
    power = np.square(lines.real) + np.square(lines.imag)
    frequency = np.arange(len(power)) / (2.0 * (len(power) - 1))
    return max(2.0, float(power.sum() / np.dot(frequency, power)))


SETTLING_PERIODS, MIN_PERIODS = 5.0, 4.0
"""Periods of the low cut that settling takes at either end, and periods that must be left between the ends."""


def lowest_low_cut_hz(duration_s: float) -> float:
    """Return the lowest low cut for which a signal is long enough, i.e. both ends settle and four periods remain."""
    return (2.0 * SETTLING_PERIODS + MIN_PERIODS) / positive(duration_s, "duration_s", "s")


def n_unsettled(sampling_rate_hz: float, low_cut_hz: float) -> int:
    """Return the number of samples at either end of an integrated signal that depend on unknown values beyond it."""
    return ceil(SETTLING_PERIODS * sampling_rate_hz / low_cut_hz) if low_cut_hz > 0.0 else 256


def integrate_band(
    values: FloatArray, sampling_rate_hz: float, n_times: int, band_hz: tuple[float, float]
) -> FloatArray:
    """Return the signal integrated `n_times` (negative: differentiated) within a band.

    Y(f) = X(f) W(f) / (2πi f)ⁿ, with W = 1 from `low` to `high`, rising smoothly from zero at low/4 and falling to zero
    halfway between `high` and half the sampling rate. No phase shift is added. Both ends are faded first, as an abrupt
    end would add slow components, which integration amplifies. Before that, the mean is removed or, without a low cut,
    the straight line between both ends, which is restored afterwards.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite; float64; longer than twice `n_unsettled`.
    sampling_rate_hz : float
    n_times : int
        -2 to 2.
    band_hz : (float, float)
        low = 0 keeps the mean, which is possible only for n_times <= 0.

    Returns
    -------
    array, (n_samples,)
        Within `n_unsettled` samples of either end the result is disturbed; the caller must discard these. Elsewhere,
        the error is below 5e-4 of the displacement amplitude for a line between the low cut and 75 times it.

    Notes
    -----
    Content below the low cut is lost: a slow drift of displacement cannot be obtained from an accelerometer.
    """
    from scipy import fft

    n, (low, high) = len(values), band_hz
    offset, slope = 0.0, 0.0  # of the line through the first and the last sample
    if low == 0.0:
        offset, slope = float(values[0]), float((values[-1] - values[0]) * sampling_rate_hz / (n - 1))
    line = offset + slope * (np.arange(n) / sampling_rate_hz)
    x = values - (values.mean() if low > 0.0 else line)
    n_fade = ceil(2.0 * sampling_rate_hz / low) if low > 0.0 else 64  # two periods of the low cut
    ramp = _smooth_step((np.arange(n_fade) + 0.5) / n_fade)
    x[:n_fade] *= ramp
    x[-n_fade:] *= ramp[::-1]
    n_fft = fft.next_fast_len(n + n_unsettled(sampling_rate_hz, low), real=True)
    lines = fft.rfft(x, n_fft)
    lines *= _gain(np.arange(len(lines)) * (sampling_rate_hz / n_fft), sampling_rate_hz, n_times, low, high)
    y: FloatArray = fft.irfft(lines, n_fft, overwrite_x=True)[:n]
    if n_times == 0 and low == 0.0:
        y = y + line
    return y + slope if n_times == -1 else y


def _gain(f: FloatArray, rate: float, n_times: int, low: float, high: float) -> np.ndarray:
    """Return W(f) / (2πi f)ⁿ at the lines of the transform."""
    weight = np.ones(len(f))
    if low > 0.0:
        weight *= _smooth_step((f - 0.25 * low) / (0.75 * low))
    stop = 0.5 * (high + 0.5 * rate)
    if stop > high:
        weight *= _smooth_step((stop - f) / (stop - high))
    if n_times == 0:
        return weight
    inside = weight > 0.0
    gain = np.zeros(len(f), dtype=np.complex128)
    if n_times < 0:
        inside &= f > 0.0  # the mean differentiates to zero
    gain[inside] = weight[inside] * (2j * np.pi * f[inside]) ** (-float(n_times))
    return gain


def _smooth_step(u: FloatArray) -> FloatArray:
    """Return a rise from 0 at u = 0 to 1 at u = 1 with three continuous derivatives, so that ringing decays fast."""
    v = np.clip(u, 0.0, 1.0)
    step: FloatArray = v**4 * (35.0 - 84.0 * v + 70.0 * v**2 - 20.0 * v**3)
    return step


MotionQuantity = Literal["acceleration", "velocity", "displacement"]

# Number of integrations from the measured quantity to displacement; velocity needs one less.
_INTEGRATIONS = {"acceleration": 2, "velocity": 1, "displacement": 0, "transmission_error": 0}


def phase_plane(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    low_cut_hz: float | None = None,
    high_cut_hz: float | None = None,
    quantity: MotionQuantity | None = None,
    unit: str = "",
    source: str = "",
) -> PhasePortrait:
    """Return displacement and velocity of a signal that measures acceleration, velocity or displacement.

    Displacement and velocity follow from acceleration by two integrations and one, from velocity by one and none, and
    from displacement (or transmission error) by none and one differentiation. All operate in the frequency domain,
    within the band from `low_cut_hz` to `high_cut_hz`, without phase shift.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    low_cut_hz : float or None
        Lowest frequency kept without attenuation; a quarter of it and below is removed. Needed for acceleration and
        velocity, as integration amplifies slow content. None for a displacement keeps all slow content, including the
        mean.
    high_cut_hz : float or None
        Highest frequency kept without attenuation; None: 0.4 of the sampling rate.
    quantity : str or None
        The measured quantity; needed for an array, or if the recording does not state it.
    unit, source : str
        Of the signal; default: the channel's.

    Returns
    -------
    PhasePortrait
        Axes displacement (in m if the unit is known) and velocity. It starts 5/low_cut after the recording's start and
        ends as much before its end (256 samples without a low cut), as the integral near the ends depends on unknown
        values beyond them; the error is below 5e-4 of the displacement amplitude.

    Raises
    ------
    InputError
        If the quantity is not one of motion, the low cut is missing, or the band exceeds that of the signal.
    RefusalError
        If the channel is constant or too short for the low cut.

    Notes
    -----
    Not for assessing slow motion: below the low cut nothing is left. A low cut that is too low turns sensor noise into
    drift; one that is too high distorts the portrait of slow motion.

    Source: L. Meirovitch, *Elements of Vibration Analysis* (1986), for the phase plane; integration follows from the
    property of the Fourier transform.
    """
    instance_of(quantity, str | None, "quantity")
    if isinstance(signal, Recording) and quantity is None:
        measured: str = signal.channels[signal.index(str(channel_or_rate_hz))].quantity
    else:
        measured = quantity or "an unknown quantity"
    values, rate, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=1)
    if measured not in _INTEGRATIONS:
        raise InputError(
            f"channel {source!r} measures {measured}: displacement and velocity do not follow from it",
            allowed="acceleration, velocity, displacement",
            remedy="give quantity='acceleration' if it is one, or use a delay embedding of the channel instead",
        )
    n_times = _INTEGRATIONS[measured]
    x = checked_series(values, minimum=16)
    low, high = _band(low_cut_hz, high_cut_hz, rate, n_times)
    n_lost = n_unsettled(rate, low)
    if low == 0.0 and len(x) < 4 * n_lost:
        raise InputError(
            f"values has {counted(len(x), 'sample')}", allowed=f"at least {4 * n_lost}", remedy="record longer"
        )
    if low > 0.0 and len(x) - 2 * n_lost < MIN_PERIODS * rate / low:
        need = lowest_low_cut_hz(1.0) / low
        raise RefusalError(
            f"{len(x) / rate:.4g} s are too short for a low cut of {low:g} Hz, which needs {need:.4g} s",
            remedy=f"raise low_cut_hz above {low * need * rate / len(x):.4g} Hz or record longer",
        )
    factor, length_unit = _length_unit(unit, measured)
    kept = slice(n_lost, len(x) - n_lost)
    axes = [integrate_band(x, rate, n, (low, high))[kept] * factor for n in (n_times, n_times - 1)]
    return PhasePortrait(
        points=np.column_stack(axes),
        sampling_rate_hz=rate,
        axis_names=("displacement", "velocity"),
        units=(length_unit, f"{length_unit}/s" if length_unit else ""),
        kind="phase plane",
        source=f"{source}, {low:g} to {high:g} Hz".lstrip(", "),
        start_s=n_lost / rate,
        band_hz=(low, high),
    )


def _band(low_cut_hz: float | None, high_cut_hz: float | None, rate: float, n_times: int) -> tuple[float, float]:
    if low_cut_hz is None and n_times > 0:
        raise InputError(
            "low_cut_hz is not given",
            allowed="> 0 Hz",
            remedy="integration amplifies slow content: give half of the lowest frequency you want to see",
        )
    high = 0.4 * rate if high_cut_hz is None else within(high_cut_hz, "high_cut_hz", 0.0, 0.5 * rate, "Hz")
    low = 0.0 if low_cut_hz is None else positive(low_cut_hz, "low_cut_hz", "Hz")
    if not low < high:
        raise InputError(f"the band goes from {low:g} to {high:g} Hz", allowed=f"ascending, up to {0.5 * rate:g} Hz")
    return low, high


def _length_unit(unit: str, measured: str) -> tuple[float, str]:
    """Return the factor to metres and "m", or 1 and the unit of displacement that follows from the channel's unit."""
    factor = si_factor(measured, unit)
    if factor is not None:
        return factor, "m"
    if not unit:
        return 1.0, ""
    n_times = _INTEGRATIONS[measured]
    return 1.0, unit if n_times == 0 else f"{unit} s" if n_times == 1 else f"{unit} s^2"
