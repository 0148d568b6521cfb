"""Orders to be separated by a Vold–Kalman filter: phase, frequency and bandwidth over time; weights and phasors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import AngleSignal, ShaftAngle, times_of_revolutions
from gearsig.checks import FloatArray, count, freeze, frozen_array, listed, positive, short
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.orders._track import TrackedOrder
from gearsig.results import Result
from gearsig.rig import Rig

Generation = Literal["first", "second"]


@dataclass(frozen=True)
class FrequencyTrack:
    """A component known by its frequency over time instead of by shaft and order.

    Parameters
    ----------
    name : str
    frequency_hz : array, (n_samples,)
        At the recording's samples, not negative. Its integral is the phase, zero at the first sample.
    order : float, optional
        Cycles per revolution of `shaft`, if known. It determines the shaft's speed, so that a bandwidth in orders
        refers to that shaft, and levels can be read over speed.
    shaft : str, optional
    """

    name: str
    frequency_hz: FloatArray
    order: float = float("nan")
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "frequency_hz", frozen_array(self.frequency_hz, f"frequency_hz of {self.name!r}", ndim=1)
        )
        if len(self.frequency_hz) == 0 or self.frequency_hz.min() < 0.0:
            raise InputError(f"the frequency of track {self.name!r} is empty or negative", allowed=">= 0 Hz")
        if not np.isnan(self.order):
            positive(self.order, f"order of track {self.name!r}")


@dataclass(frozen=True)
class SeparatedOrder(
    Result, columns=("time_s", "waveform", "amplitude", "phase_rad", "frequency_hz", "valid", "settled")
):
    """One order extracted from a signal: waveform and complex envelope over time.

    Parameters
    ----------
    name : str
    shaft : str
        Empty if not known, for a frequency track.
    order : float
        Cycles per revolution of `shaft`; nan if not known, for a frequency track.
    envelope : array, (n_samples,), complex
        A e^{iφ} of A cos(2π·cycles + φ), with A the peak amplitude in `unit`; nan where not `valid`.
    waveform : array, (n_samples,)
        The order's part of the signal; 0 where not `valid`.
    frequency_hz : array, (n_samples,)
    bandwidth_hz : array, (n_samples,) or (1,)
        Between the -3 dB points.
    valid : array of bool, (n_samples,)
        Where the whole band lies between zero and half the sampling rate and the shaft angle is known.
    settled : array of bool, (n_samples,)
        Where, in addition, the order is valid for long enough on both sides. At the ends of the recording and next to
        parts left out, the filter has data on one side only: it passes more noise, and the closed-form gain does not
        hold.
    time_s : array, (n_samples,)
    unit, source : str
    """

    name: str
    shaft: str
    order: float
    envelope: NDArray[np.complex128]
    waveform: FloatArray
    frequency_hz: FloatArray
    bandwidth_hz: FloatArray
    valid: NDArray[np.bool_]
    settled: NDArray[np.bool_]
    time_s: FloatArray
    unit: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "waveform", "frequency_hz", "bandwidth_hz", "time_s")
        freeze(self, "envelope", "valid", "settled", ndim=None)
        lengths = {len(getattr(self, name)) for name in ("envelope", "waveform", "frequency_hz", "valid", "time_s")}
        if len(lengths) > 1 or len(self.bandwidth_hz) not in {1, *lengths}:
            raise InputError(f"parts of order {self.name!r} differ in length")

    @property
    def amplitude(self) -> FloatArray:
        """Peak amplitude, (n_samples,); nan where not valid."""
        amplitude: FloatArray = np.abs(self.envelope)
        return amplitude

    @property
    def phase_rad(self) -> FloatArray:
        """Phase of the cosine relative to the angle, -π to π, (n_samples,); nan where not valid."""
        phase: FloatArray = np.angle(self.envelope)
        return phase

    def tracked(self, *, step: int = 1) -> TrackedOrder:
        """Return amplitude and phase over speed at every `step`-th valid sample, like the result of `track_orders`.

        Raises
        ------
        RefusalError
            For a frequency track of unknown order.
        """
        if not np.isfinite(self.order):
            raise RefusalError(f"{self.name!r} is a frequency track, without a speed", remedy="read it over time")
        at = np.flatnonzero(self.valid)[:: count(step, "step")]
        speed_rev_per_s = self.frequency_hz[at] / self.order
        width = np.broadcast_to(self.bandwidth_hz, self.valid.shape)[at]
        return TrackedOrder(
            order=self.order,
            time_s=self.time_s[at],
            speed_rpm=60.0 * speed_rev_per_s,
            amplitude=np.abs(self.envelope[at]),
            phase_rad=np.angle(self.envelope[at]),
            unit=self.unit,
            bandwidth_orders=float(np.median(width / speed_rev_per_s)),
            source=self.source,
            shaft=self.shaft,
        )


@dataclass(frozen=True)
class OrderSeparation(Result, rows="orders"):
    """A signal as the sum of orders and a residual.

    Parameters
    ----------
    orders : tuple of SeparatedOrder
        In the requested order.
    residual : array, (n_samples,)
        The signal minus all waveforms.
    sampling_rate : float
        Of the separated signal: in Hz, or samples per revolution for an `AngleSignal`.
    axis : "time" or "angle"
        Axis along which the samples are equally spaced.
    generation : "first" or "second"
    n_poles : int
        Of the second generation; the first has two.
    groups : tuple of tuples of int
        Positions of the orders that were solved for together.
    expected_error : float
        Error of the numerical solution, relative to the signal's largest component.
    notes : tuple of str
        Notes on masked parts, ends, close orders, and orders solved for together.
    """

    orders: tuple[SeparatedOrder, ...]
    residual: FloatArray
    sampling_rate: float
    axis: Literal["time", "angle"]
    generation: Generation
    n_poles: int
    groups: tuple[tuple[int, ...], ...]
    expected_error: float
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "residual")

    @property
    def coupled(self) -> bool:
        """Whether any orders were solved for jointly."""
        return any(len(group) > 1 for group in self.groups)

    def time_s(self) -> FloatArray:
        """Sample times of the recording, (n_samples,)."""
        return self.orders[0].time_s


BoolArray = NDArray[np.bool_]
NamedOrder = float | tuple[str, float] | FrequencyTrack
OrderLike = NamedOrder | FloatArray
CHUNK_SAMPLES = 2**17


@dataclass(frozen=True)
class Tracks:
    """Phase (cycles) and frequency of each order at the samples, (n_orders, n), and where they are known, (n,).

    Over time, frequencies are in Hz and durations in s; over angle, in orders and revolutions. `speed_rev_per_s` is the
    speed of the angle's shaft, (n,), or None if there is no shaft angle.
    """

    names: tuple[str, ...]
    shafts: tuple[str, ...]
    orders: FloatArray
    cycles: FloatArray
    frequency_hz: FloatArray
    known: BoolArray
    time_s: FloatArray
    speed_rev_per_s: FloatArray | None = None
    unit: str = "Hz"
    duration_unit: str = "s"


def tracks_of_orders(
    orders: Sequence[NamedOrder], angle: ShaftAngle | None, rig: Rig | None, n: int, sampling_rate_hz: float
) -> Tracks:
    """Return the tracks of orders given as a number (of the angle's shaft), (shaft, number) or a frequency track."""
    cycles, frequency = np.empty((len(orders), n)), np.empty((len(orders), n))
    labels: list[tuple[str, str, float]] = []
    known = np.ones(n, dtype=bool)
    turns, speed = (None, None) if angle is None else _sampled_angle(angle, n, sampling_rate_hz)
    for k, order in enumerate(orders):
        if isinstance(order, FrequencyTrack):
            f = order.frequency_hz.astype(np.float64)
            if len(f) != n:
                raise InputError(
                    f"track {order.name!r} has {len(f)} samples, the recording {n}",
                    where="orders",
                    remedy="interpolate the frequency to the recording's samples",
                )
            frequency[k], cycles[k, 0] = f, 0.0
            np.cumsum((f[1:] + f[:-1]) / (2.0 * sampling_rate_hz), out=cycles[k, 1:])
            labels.append((order.name, order.shaft, order.order))
            continue
        if angle is None or turns is None or speed is None:
            raise InputError("an order is given without a shaft angle", where="orders", remedy="give frequency tracks")
        shaft, number, ratio = _of_shaft(order, angle, rig)
        # Only samples within the angle's time are known, with one sample of tolerance at either end.
        known[: max(0, int(np.ceil(angle.start_s * sampling_rate_hz - 1.0)))] = False
        known[max(0, int(np.floor(angle.end_s * sampling_rate_hz + 1.0)) + 1) :] = False
        np.multiply(turns, number * ratio, out=cycles[k])
        np.multiply(speed, number * ratio, out=frequency[k])
        labels.append((f"{shaft} {number:g}".strip(), shaft, number))
    names, shafts, numbers = zip(*labels, strict=True)
    time_s = np.arange(n) / sampling_rate_hz
    return Tracks(names, shafts, np.array(numbers), cycles, frequency, known, time_s, speed)


def tracks_over_angle(orders: Sequence[NamedOrder], signal: AngleSignal) -> Tracks:
    """Return the tracks of orders in a signal over angle, where all have a constant frequency."""
    angle, n = signal.shaft_angle, signal.samples.shape[1]
    numbers = []
    for order in orders:
        if isinstance(order, FrequencyTrack):
            raise InputError(
                f"{order.name!r} is a frequency over time, but the signal is over angle",
                where="orders",
                remedy="give the recording and its shaft angle",
            )
        _, number, ratio = _of_shaft(order, angle, None)
        numbers.append(number * ratio)
        if numbers[-1] >= signal.highest_order:
            raise InputError(
                f"order {numbers[-1]:g} lies above the signal's highest order",
                where="orders",
                allowed=f"below {signal.highest_order:.4g}",
                remedy="resample with more samples per revolution",
            )
    revolutions = signal.start_revolution + np.arange(n) / signal.samples_per_revolution
    times = times_of_revolutions(angle, signal.start_revolution, 1.0 / signal.samples_per_revolution, n)
    return Tracks(
        tuple(f"{angle.shaft} {number:g}".strip() for number in numbers),
        (angle.shaft,) * len(numbers),
        np.array(numbers),
        np.multiply.outer(numbers, revolutions),
        np.broadcast_to(np.array(numbers)[:, None], (len(numbers), n)),
        np.ones(n, dtype=bool),
        times,
        np.asarray(angle.speed_rpm_at(times) / 60.0),
        "orders",
        "revolutions",
    )


def named_orders(orders: Sequence[OrderLike]) -> list[NamedOrder]:
    """Return the orders, with plain frequency arrays converted to named tracks."""
    orders = listed(orders, "orders", object, remedy='give a list: [2, ("output", 4.5)]')
    if not orders:
        raise InputError("no orders are given", where="orders", remedy="name at least one")
    return [
        FrequencyTrack(f"component {k}", order) if isinstance(order, np.ndarray) and order.ndim else order  # type: ignore[misc]
        for k, order in enumerate(orders, start=1)
    ]


def _of_shaft(order: float | tuple[str, float], angle: ShaftAngle, rig: Rig | None) -> tuple[str, float, float]:
    """Return an order's shaft, its number, and the revolutions of that shaft per revolution of the angle's shaft."""
    if isinstance(order, tuple) and len(order) != 2:
        raise InputError(f"an order is {short(order)}", where="orders", allowed="a number, or (shaft, number)")
    shaft, number = order if isinstance(order, tuple) else (angle.shaft, order)
    number = positive(number, f"order {number!r}")
    ratio = 1.0 if shaft == angle.shaft else rig.ratio(shaft, to=angle.shaft) if rig and rig.shafts else None
    if ratio is None:
        raise InputError(
            f"the ratio of shaft {shaft!r} to {angle.shaft!r} is not known",
            where="orders",
            remedy="give a rig with the teeth between both shafts",
        )
    return shaft, number, ratio


def _sampled_angle(angle: ShaftAngle, n: int, sampling_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return revolutions and revolutions per second at the samples, (n,) each."""
    revolutions, speed = np.empty(n), np.empty(n)
    for start in range(0, n, CHUNK_SAMPLES):
        part = slice(start, min(start + CHUNK_SAMPLES, n))
        t = np.arange(part.start, part.stop) / sampling_rate_hz
        revolutions[part] = angle.revolutions_at(t)
        speed[part] = angle.speed_rpm_at(t) / 60.0
    # At standstill, the cubic's slope may round to slightly below zero.
    return revolutions, np.maximum(speed, 0.0)


def bandwidths_of(
    tracks: Tracks, hz: float | Sequence[float] | None, in_orders: float | Sequence[float] | None
) -> FloatArray:
    """Return the bandwidths in the unit of the tracks, (n_orders, 1) if constant, else (n_orders, n)."""
    if (hz is None) == (in_orders is None):
        raise InputError("give either bandwidth_hz or bandwidth_orders, not both", where="bandwidth")
    n_orders, over_angle = len(tracks.names), tracks.unit == "orders"
    name, unit = ("bandwidth_orders", "orders") if hz is None else ("bandwidth_hz", "Hz")
    bandwidths = np.atleast_1d(np.asarray(in_orders if hz is None else hz, dtype=object))
    if bandwidths.shape not in {(1,), (n_orders,)}:
        raise InputError(
            f"{name} has shape {bandwidths.shape}", allowed=f"one number, or one for each of {n_orders} orders"
        )
    for width in bandwidths:
        if isinstance(width, str):  # strings are refused even if they could be parsed as numbers
            raise InputError(
                f"{name} is {width!r}", allowed=f"a number above 0, in {unit}", remedy="leave the unit out"
            )
    widths = np.broadcast_to([positive(cast("float", width), name, unit) for width in bandwidths], (n_orders,))
    speed = tracks.speed_rev_per_s
    if hz is not None:
        if not over_angle:
            return widths[:, None].copy()
        if speed is None or speed.min() <= 0.0:
            raise InputError("the shaft stops in between", where="bandwidth_hz", remedy="give bandwidth_orders")
        return np.asarray(np.divide.outer(widths, speed))
    for order, width, label in zip(tracks.orders, widths, tracks.names, strict=True):
        if width >= 2 * order:
            raise InputError(
                f"bandwidth_orders is {width:g} for order {label!r}: its band reaches down to order zero",
                allowed=f"below {2 * order:g}",
            )
    if over_angle:
        return widths[:, None].copy()
    rows = []
    for k, width in enumerate(widths):  # by the speed of the order's own shaft, or else of the angle's
        order_speed = tracks.frequency_hz[k] / tracks.orders[k] if np.isfinite(tracks.orders[k]) else speed
        if order_speed is None:
            raise InputError(
                f"track {tracks.names[k]!r} has no order, and there is no shaft angle",
                where="bandwidth_orders",
                remedy="give the track an order, a shaft angle, or bandwidth_hz",
            )
        rows.append(width * order_speed)
    return np.stack(rows)


def valid_parts(tracks: Tracks, bandwidth: FloatArray, sampling_rate: float, generation: Generation) -> BoolArray:
    """Return where each order's whole band lies between zero and half the sampling rate, (n_orders, n).

    Raises
    ------
    RefusalError
        If there is no such part for an order.
    """
    f = tracks.frequency_hz
    margin: FloatArray = bandwidth / 2
    if generation == "first":
        margin = sampling_rate * lowest_frequency(np.minimum(bandwidth / sampling_rate, 0.5))
    above, below = f + margin >= sampling_rate / 2, f <= margin
    valid: BoolArray = ~(above | below) & tracks.known
    for k, name in enumerate(tracks.names):
        if valid[k].any():
            continue
        reach = f"runs from {f[k].min():.4g} to {f[k].max():.4g} {tracks.unit}"
        if f[k].max() == 0.0:
            raise RefusalError(f"order {name!r} stands still throughout", remedy="record while the machine turns")
        if f[k].min() >= sampling_rate / 2:
            raise RefusalError(
                f"order {name!r} {reach}, at or above half the sampling rate of {sampling_rate:g} {tracks.unit}",
                remedy="record at a higher rate",
            )
        room = 2.0 * float(np.minimum(f[k], sampling_rate / 2 - f[k]).max())
        raise RefusalError(
            f"order {name!r} {reach}: its band of {np.max(bandwidth[k]):.4g} {tracks.unit} reaches down to zero or up "
            f"to half the sampling rate of {sampling_rate:g} {tracks.unit} all the time; narrow the bandwidth below "
            f"{room:.4g} {tracks.unit}"
        )
    return valid


# --------------------
# Weights of the filter in closed form, and compiled phasors of an order's angle.
# --------------------


HALF_POWER = np.sqrt(np.sqrt(2.0) - 1.0)
"""r·|D| at the -3 dB points, where 1/(1 + r²|D|²) = 1/√2."""


def settling_time(bandwidth: FloatArray, skirt_poles: int) -> FloatArray:
    """Return the time after which the filter's response has decayed to 1 %, in the inverse unit of the bandwidth.

    The slowest pole of 1/(1 + (√2 - 1)(2f/B)^2p) decays as exp(-t/τ), τ = (√2 - 1)^(1/2p)/(πB sin(π/2p)). The settling
    time is τ ln 100: 0.94/B, 1.66/B and 2.53/B for one, two and three poles. The first generation's skirts have one
    pole. For zero bandwidth, as for an order of a shaft at rest, it is infinite.
    """
    slowness = HALF_POWER ** (1.0 / skirt_poles) / (np.pi * np.sin(0.5 * np.pi / skirt_poles))
    with np.errstate(divide="ignore"):
        time: FloatArray = np.log(100.0) * slowness / bandwidth
    return time


def envelope_weight(bandwidth: FloatArray, p: int) -> FloatArray:
    """Return r = √(√2 - 1)/(2 sin(πb/2))^p of the second generation; bandwidth b in cycles per sample.

    The gain at a distance f is then 1/(1 + r² (2 sin πf)^2p). For narrow bands r is 0.2049/b, 0.0652/b² and 0.0208/b³.

    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    r: FloatArray = HALF_POWER / (2.0 * np.sin(0.5 * np.pi * bandwidth)) ** p
    return r


def waveform_weight(bandwidth: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return r of the first generation; bandwidth and frequency in cycles per sample.

    With h half the bandwidth and ω the frequency in rad, r = √(√2 - 1)/(2 tan h √(sin²ω - sin²h)): the -3 dB points of
    1/(1 + r²(2 cos ω' - 2 cos ω)²) are 2h apart, not quite symmetric about ω.
    """
    h, omega = np.pi * bandwidth, 2.0 * np.pi * frequency
    # sin²ω - sin²h as a product, to keep all digits where the band nearly touches zero frequency.
    r: FloatArray = HALF_POWER / (2.0 * np.tan(h) * np.sqrt(np.sin(omega - h) * np.sin(omega + h)))
    return r


def lowest_frequency(bandwidth: FloatArray) -> FloatArray:
    """Return the frequency below which the first generation's band reaches zero; both in cycles per sample.

    cos ω = cos² h: about 0.71 bandwidths, as the band is not symmetric. The same distance applies at half the sampling
    rate.
    """
    f: FloatArray = np.arccos(np.cos(np.pi * bandwidth) ** 2) / (2.0 * np.pi)
    return f


S3, S5, S7, S9, S11, S13, S15 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800, -1 / 1307674368e3
C2, C4, C6, C8 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320
C10, C12, C14, C16 = -1 / 3628800, 1 / 479001600, -1 / 87178291200, 1 / 20922789888e3
BLOCK = 1000
QUARTER_TURN_RAD = 1.5707963267948966


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def cosine_and_sine(revolutions: FloatArray, cosine: FloatArray, sine: FloatArray) -> None:
    """Write cos 2πx and sin 2πx, accurate to about 1e-15.

    Taylor series of a quarter of the angle (at most π/4, where the omitted terms are below 1e-16), then doubled twice.
    There are no branches, so the compiler can vectorise.
    """
    for i in range(len(revolutions)):
        x = revolutions[i]
        a = (x - round(x)) * QUARTER_TURN_RAD
        q = a * a
        s = a * (1 + q * (S3 + q * (S5 + q * (S7 + q * (S9 + q * (S11 + q * (S13 + q * S15)))))))
        c = 1 + q * (C2 + q * (C4 + q * (C6 + q * (C8 + q * (C10 + q * (C12 + q * (C14 + q * C16)))))))
        s2 = 2 * s * c
        c2 = 1 - 2 * s * s
        sine[i] = 2 * s2 * c2
        cosine[i] = 1 - 2 * s2 * s2


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_phasors(revolutions: FloatArray, out: NDArray[Any]) -> None:
    """Write e^{2πix} by way of contiguous blocks in the cache, since writing with a stride of two is slow."""
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    for start in range(0, len(revolutions), BLOCK):
        n = min(BLOCK, len(revolutions) - start)
        cosine_and_sine(revolutions[start : start + n], cosine[:n], sine[:n])
        for i in range(n):
            out[start + i] = complex(cosine[i], sine[i])


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_modulated(envelope: NDArray[Any], revolutions: FloatArray, out: FloatArray) -> None:
    """Write Re(a e^{2πix})."""
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    for start in range(0, len(revolutions), BLOCK):
        n = min(BLOCK, len(revolutions) - start)
        cosine_and_sine(revolutions[start : start + n], cosine[:n], sine[:n])
        for i in range(n):
            a = envelope[start + i]
            out[start + i] = a.real * cosine[i] - a.imag * sine[i]


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def write_envelope(waveform: FloatArray, revolutions: FloatArray, out: NDArray[Any]) -> None:
    """Write the envelope a of x = Re(a e^{2πic}), assumed constant from a sample to its neighbours.

    The neighbours are x(n±1) = x cos α± ∓ q sin α±, with α± the phase step; both give the quadrature q by least
    squares, and a = (x + iq) e^{-2πic}.
    """
    n = len(waveform)
    cosine, sine = np.empty(BLOCK), np.empty(BLOCK)
    step_cosine, step_sine = np.empty(BLOCK + 1), np.empty(BLOCK + 1)
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        cosine_and_sine(revolutions[start:stop], cosine[: stop - start], sine[: stop - start])
        first, last = max(start - 1, 0), min(stop, n - 1)  # steps from first to last; none beyond the ends
        steps = revolutions[first + 1 : last + 1] - revolutions[first:last]
        cosine_and_sine(steps, step_cosine[: last - first], step_sine[: last - first])
        for i in range(start, stop):
            x, q, size = waveform[i], 0.0, 0.0
            if i > 0:
                c, s = step_cosine[i - 1 - first], step_sine[i - 1 - first]
                q += (waveform[i - 1] - x * c) * s
                size += s * s
            if i < n - 1:
                c, s = step_cosine[i - first], step_sine[i - first]
                q -= (waveform[i + 1] - x * c) * s
                size += s * s
            if size > 0.0:
                q /= size
            out[i] = complex(x, q) * complex(cosine[i - start], -sine[i - start])
