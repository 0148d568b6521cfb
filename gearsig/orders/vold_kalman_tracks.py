"""Phase, frequency and bandwidth over time of the orders that the Vold–Kalman filter is to separate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.orders.revolutions import times_of_revolutions
from gearsig.orders.vold_kalman_types import FrequencyTrack, Generation
from gearsig.orders.vold_kalman_weight import lowest_frequency
from gearsig.rig.types import Rig

BoolArray = NDArray[np.bool_]
OrderLike = float | tuple[str, float] | FrequencyTrack
CHUNK_SAMPLES = 2**17


@dataclass(frozen=True)
class Tracks:
    """Phase (cycles) and frequency of each order at the samples, (n_orders, n), and where they are known, (n,).

    Over time, frequencies are in Hz and durations in s; over angle, in orders and in revolutions. `speed_rev_per_s` is
    that of the angle's shaft, (n,), None where it was not asked for.
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
    orders: Sequence[OrderLike], angle: ShaftAngle | None, rig: Rig | None, n: int, sampling_rate_hz: float
) -> Tracks:
    """Return the tracks of orders given as number (of the angle's shaft), (shaft, number) or frequency track."""
    if len(orders) == 0:
        raise InputError("no orders are given", where="orders", remedy="name at least one")
    cycles, frequency = np.empty((len(orders), n)), np.empty((len(orders), n))
    names: list[str] = []
    shafts: list[str] = []
    numbers: list[float] = []
    known = np.ones(n, dtype=bool)
    turned: tuple[FloatArray, FloatArray] | None = None
    for k, wanted in enumerate(orders):
        if isinstance(wanted, FrequencyTrack):
            cycles[k], frequency[k] = _integrated(wanted, n, sampling_rate_hz)
            names.append(wanted.name)
            shafts.append(wanted.shaft)
            numbers.append(wanted.order)
            continue
        if angle is None:
            raise InputError("an order is given without a shaft angle", where="orders", remedy="give frequency tracks")
        shaft, number = wanted if isinstance(wanted, tuple) else (angle.shaft, wanted)
        number = positive(number, f"order {number!r}")
        if turned is None:
            turned = _sampled_angle(angle, n, sampling_rate_hz)
            known = _known(angle, n, sampling_rate_hz)
        factor = number * _ratio(angle, shaft, rig)
        np.multiply(turned[0], factor, out=cycles[k])
        np.multiply(turned[1], factor, out=frequency[k])
        names.append(f"{shaft} {number:g}".strip())
        shafts.append(shaft)
        numbers.append(number)
    if turned is None and angle is not None:
        turned = _sampled_angle(angle, n, sampling_rate_hz)
    speed = None if turned is None else turned[1]
    time_s = np.arange(n) / sampling_rate_hz
    return Tracks(tuple(names), tuple(shafts), np.array(numbers), cycles, frequency, known, time_s, speed)


def tracks_over_angle(orders: Sequence[OrderLike], signal: AngleSignal) -> Tracks:
    """Return the tracks of orders in a signal over angle, where all have a constant frequency."""
    if len(orders) == 0:
        raise InputError("no orders are given", where="orders", remedy="name at least one")
    angle, n = signal.shaft_angle, signal.samples.shape[1]
    numbers = []
    for wanted in orders:
        if isinstance(wanted, FrequencyTrack):
            raise InputError(
                f"{wanted.name!r} is a frequency over time, the signal is one over angle",
                where="orders",
                remedy="give the recording and its shaft angle",
            )
        shaft, number = wanted if isinstance(wanted, tuple) else (angle.shaft, wanted)
        numbers.append(positive(number, f"order {number!r}") * _ratio(angle, shaft, None))
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


def bandwidths_of(
    tracks: Tracks, hz: float | Sequence[float] | None, in_orders: float | Sequence[float] | None
) -> FloatArray:
    """Return the bandwidths in the unit of the tracks, (n_orders, 1) if constant, else (n_orders, n)."""
    if (hz is None) == (in_orders is None):
        raise InputError("give either bandwidth_hz or bandwidth_orders", where="bandwidth", allowed="one of both")
    n_orders = len(tracks.names)
    name = "bandwidth_orders" if hz is None else "bandwidth_hz"
    given = np.atleast_1d(np.asarray(in_orders if hz is None else hz, dtype=object))
    if given.shape not in {(1,), (n_orders,)}:
        raise InputError(f"{name} has shape {given.shape}", allowed=f"one number, or one for each of {n_orders} orders")
    widths = np.broadcast_to([_width(width, name) for width in given], (n_orders,))
    over_angle = tracks.unit == "orders"
    if hz is not None:
        return _over_angle(tracks, widths) if over_angle else widths[:, None].copy()
    _check_below_order(tracks, widths)
    if over_angle:
        return widths[:, None].copy()
    return np.stack([width * _speed_of(tracks, k) for k, width in enumerate(widths)])


def _width(given: object, name: str) -> float:
    """Return a bandwidth as float; a text is no number, even one that could be read as such."""
    unit = name.removeprefix("bandwidth_").replace("hz", "Hz")
    if isinstance(given, str):
        raise InputError(f"{name} is {given!r}", allowed=f"a number above 0, in {unit}", remedy="leave the unit out")
    return positive(cast("float", given), name, unit)


def _check_below_order(tracks: Tracks, widths: FloatArray) -> None:
    """Raise InputError if a bandwidth in orders reaches down to order zero."""
    for order, width, label in zip(tracks.orders, widths, tracks.names, strict=True):
        if width >= 2 * order:
            raise InputError(
                f"bandwidth_orders is {width:g} for order {label!r}: its band reaches down to order zero",
                allowed=f"below {2 * order:g}",
            )


def _over_angle(tracks: Tracks, widths_hz: FloatArray) -> FloatArray:
    """Return bandwidths in Hz as orders, for a signal over angle."""
    speed = tracks.speed_rev_per_s
    if speed is None or speed.min() <= 0.0:
        raise InputError("the shaft stands still in between", where="bandwidth_hz", remedy="give bandwidth_orders")
    return np.asarray(np.divide.outer(widths_hz, speed))


def _speed_of(tracks: Tracks, k: int) -> FloatArray:
    """Return the speed in rev/s of an order's own shaft, or else of the angle's shaft."""
    if np.isfinite(tracks.orders[k]):
        return np.asarray(tracks.frequency_hz[k] / tracks.orders[k])
    if tracks.speed_rev_per_s is None:
        raise InputError(
            f"track {tracks.names[k]!r} has no order, and there is no shaft angle",
            where="bandwidth_orders",
            remedy="give the track an order, a shaft angle, or bandwidth_hz",
        )
    return tracks.speed_rev_per_s


def valid_parts(tracks: Tracks, bandwidth: FloatArray, sampling_rate: float, generation: Generation) -> BoolArray:
    """Return where each order's whole band lies between zero and half the sampling rate, (n_orders, n).

    Raises
    ------
    RefusalError
        If an order has no such part.
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
            raise RefusalError(f"order {name!r} stands still all the time", remedy="record while the machine turns")
        if f[k].min() >= sampling_rate / 2:
            raise RefusalError(
                f"order {name!r} {reach}, at or above half the sampling rate of {sampling_rate:g} {tracks.unit}",
                remedy="record at a higher rate",
            )
        raise RefusalError(_no_room(f"order {name!r} {reach}", f[k], bandwidth[k], sampling_rate, tracks.unit))
    return valid


def _no_room(order: str, f: FloatArray, bandwidth: FloatArray, sampling_rate: float, unit: str) -> str:
    """Return that a band does not fit between zero and half the sampling rate, and which one would."""
    room = 2.0 * float(np.minimum(f, sampling_rate / 2 - f).max())
    return (
        f"{order}: its band of {np.max(bandwidth):.4g} {unit} reaches down to zero or up to half the sampling rate of "
        f"{sampling_rate:g} {unit} all the time; narrow the bandwidth below {room:.4g} {unit}"
    )


def _sampled_angle(angle: ShaftAngle, n: int, sampling_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return revolutions and revolutions per second at the samples."""
    revolutions, speed = np.empty(n), np.empty(n)
    for start in range(0, n, CHUNK_SAMPLES):
        part = slice(start, min(start + CHUNK_SAMPLES, n))
        t = np.arange(part.start, part.stop) / sampling_rate_hz
        revolutions[part] = angle.revolutions_at(t)
        speed[part] = angle.speed_rpm_at(t) / 60.0
    # The cubic's slope may round to a little below zero where the machine stands.
    return revolutions, np.maximum(speed, 0.0)


def _known(angle: ShaftAngle, n: int, sampling_rate_hz: float) -> BoolArray:
    """Return the samples within the angle's time; one sample of tolerance at either end."""
    known = np.zeros(n, dtype=bool)
    first = max(0, int(np.ceil(angle.start_s * sampling_rate_hz - 1.0)))
    last = int(np.floor(angle.end_s * sampling_rate_hz + 1.0))
    known[first : max(0, last + 1)] = True
    return known


def _ratio(angle: ShaftAngle, shaft: str, rig: Rig | None) -> float:
    """Return revolutions of `shaft` per revolution of the angle's shaft."""
    if shaft == angle.shaft:
        return 1.0
    ratio = rig.ratio(shaft, to=angle.shaft) if rig is not None and rig.shafts else None
    if ratio is None:
        raise InputError(
            f"the ratio of shaft {shaft!r} to {angle.shaft!r} is not known",
            where="orders",
            remedy="give a rig with the teeth between both shafts",
        )
    return ratio


def _integrated(track: FrequencyTrack, n: int, sampling_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return phase in cycles (trapezoidal rule from 0) and frequency."""
    f = track.frequency_hz.astype(np.float64)
    if len(f) != n:
        raise InputError(
            f"track {track.name!r} has {len(f)} samples, the recording {n}",
            where="orders",
            remedy="interpolate the frequency to the recording's samples",
        )
    cycles = np.zeros(n)
    np.cumsum((f[1:] + f[:-1]) / (2.0 * sampling_rate_hz), out=cycles[1:])
    return cycles, f
