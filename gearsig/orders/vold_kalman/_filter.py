"""Vold–Kalman order tracking: orders extracted from a recording as waveforms, even where they cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, get_args

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, count, one_of
from gearsig.errors import InputError
from gearsig.orders._average import angle_of, as_recording, over_angle, unit_of
from gearsig.orders.vold_kalman._joint import Group, Problem, solve_groups
from gearsig.orders.vold_kalman._tracks import (
    HALF_POWER,
    BoolArray,
    FrequencyTrack,
    Generation,
    OrderLike,
    OrderSeparation,
    SeparatedOrder,
    Tracks,
    bandwidths_of,
    named_orders,
    settling_time,
    tracks_of_orders,
    tracks_over_angle,
    valid_parts,
)
from gearsig.recording import Recording

Coupling = bool | Literal["automatic"] | Sequence[Sequence[int]]
MAX_LEAK = 1e-4
"""Share of one order that may leak through another's band before both are solved for together: -80 dB."""
NOTED_LEAK = 0.03


def track_vold_kalman(
    signal: Recording | AngleSignal | FloatArray,
    channel: str | float,
    orders: Sequence[OrderLike],
    *,
    bandwidth_hz: float | Sequence[float] | None = None,
    bandwidth_orders: float | Sequence[float] | None = None,
    n_poles: int = 2,
    generation: Generation = "second",
    coupled: Coupling = "automatic",
    mirror: bool = True,
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
) -> OrderSeparation:
    """Separate a signal into orders, as waveforms and complex envelopes over time, and a residual.

    Second generation: y_n = Σ_k Re(a_kn e^{iΘ_kn}) + η_n with ∇^p a_kn = ε_kn. First generation: y_n = Σ_k x_kn + η_n
    with x_kn - 2 cos ω_k(n+1) x_k(n+1) + x_k(n+2) = ε_kn. Both minimise Σ η² + Σ r² ε²; r follows from the bandwidth.

    Parameters
    ----------
    signal : Recording, AngleSignal or array, (n_samples,)
        Over angle, every order has a constant frequency, and the envelope is smooth per revolution, not per second.
    channel : str or float
        The channel's name, or an array's sampling rate in Hz.
    orders : sequence
        Each is a number (cycles per revolution of the angle's shaft), a pair (shaft, number), a `FrequencyTrack`, or
        the frequency in Hz at each sample.
    bandwidth_hz, bandwidth_orders : float or one per order
        Give one of the two: width between the -3 dB points, in Hz or in orders of the order's own shaft (for a
        frequency track without order, of the angle's shaft). In orders, it varies with speed. At least 1/duration.
        Noise within the band stays in the waveform; level changes faster than about 1/B are smoothed.
    n_poles : int
        For the second generation: 1, 2 or 3. More poles give steeper skirts: away from the order, the gain falls as
        f^-2p.
    generation : "first" or "second"
        The first has two poles and a fixed shape; use the second unless you need to compare results.
    coupled : "automatic", True, False, or groups
        Which orders are solved for together, so that crossing and close orders share the signal between them.
        Automatic: orders that would pass more than 1e-4 through each other's bands at any time, group by group, each on
        what the others leave; or all, if the bands are so narrow that this is faster. The notes give the reason.
        True: all. False: one by one. Groups: as positions in `orders`, e.g. [[0, 2]]; the others are solved for alone.
    mirror : bool
        For the second generation: whether to count each order's mirror image at negative frequency as part of the
        signal, as it truly is. False omits it, as most textbooks do: faster, but amplitudes near the ends are off by
        a few percent.
    shaft_angle, speed_rpm
        As in `order_spectrum`; not needed if all orders are frequency tracks.

    Returns
    -------
    OrderSeparation
        At the recording's samples, in the channel's unit; amplitudes are peak. The notes state how long an order takes
        to settle at the ends.

    Raises
    ------
    InputError
        On an unknown channel or shaft, a bandwidth below the resolution of the duration or reaching down to order zero,
        identical orders, or too few samples.
    RefusalError
        If an order's frequency is zero or above half the sampling rate throughout.

    Notes
    -----
    Numerical error: about 1e-11 of the largest component for an order solved for alone, below 1e-6 for several, see
    `expected_error`. Not for transients shorter than 1/B; if you need only levels over speed, `track_order_bands` is
    enough. Close orders can be separated only over at least one beat period, about the reciprocal of their distance.
    Near standstill, an order meets its own mirror image: the part where the band reaches zero is left out.
    Memory: about 80 bytes per sample and order, plus up to 0.3 GB.

    References
    ----------
    H. Vold, J. Leuridan, "High resolution order tracking at extreme slew rates, using Kalman tracking filters", 1993.
    C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares problem", 2000.
    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    how, orders = (n_poles, generation, coupled, mirror), named_orders(orders)
    if isinstance(signal, AngleSignal):
        angle_signal, name = over_angle(signal, channel, "", shaft_angle, speed_rpm)
        y, unit = angle_signal.values(name), unit_of(angle_signal, name)
        tracks, rate = tracks_over_angle(orders, angle_signal), float(angle_signal.samples_per_revolution)
    else:
        recording, name = as_recording(signal, channel)
        y, rate, unit = (
            recording.values(name),
            recording.sampling_rate_hz,
            recording.channels[recording.index(name)].unit,
        )
        # An order, or a bandwidth in orders for a track without an order, requires the shaft angle.
        in_orders = bandwidth_orders is not None
        needed = any(not isinstance(o, FrequencyTrack) or (in_orders and np.isnan(o.order)) for o in orders)
        angle = angle_of(recording, shaft_angle, speed_rpm) if needed else shaft_angle
        tracks = tracks_of_orders(orders, angle, recording.rig, len(y), rate)
    widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
    return _separated(y, rate, tracks, widths, *how, unit=unit, source=name)


def _separated(
    y: FloatArray,
    rate: float,
    tracks: Tracks,
    widths: FloatArray,
    n_poles: int,
    generation: Generation,
    coupled: Coupling,
    mirror: bool,
    *,
    unit: str,
    source: str,
) -> OrderSeparation:
    """Return the separated orders and the residual; widths (n_orders, n) or (n_orders, 1) in the unit of the tracks."""
    one_of(generation, "generation", get_args(Generation))
    if generation == "second":
        count(n_poles, "n_poles", maximum=3)
    if len(y) < 16:
        raise InputError(f"the signal has {len(y)} samples", allowed="at least 16")
    # The first generation's structural equation is of second order; on either side of the order it has one pole.
    p, skirt_poles = (n_poles, n_poles) if generation == "second" else (2, 1)
    valid = valid_parts(tracks, widths, rate, generation)
    _check_record_length(tracks, widths, valid, rate)
    neighbours = _neighbours(tracks, widths, valid, skirt_poles)
    problem = Problem(tracks.cycles, valid, _continued(widths, valid) / rate, p, generation, mirror)
    groups = _groups(coupled, neighbours, problem)
    envelopes, waveforms, sweep_error = solve_groups(y, problem, groups, share=isinstance(coupled, str))
    error = sweep_error + max(problem.of(group).expected_error for group in groups)
    settled = _settled(widths, valid, rate, skirt_poles)
    residual = y.astype(np.float64)
    for waveform in waveforms:
        residual -= waveform
    over_angle = tracks.unit == "orders"
    # Over angle, the speed converts frequency and bandwidth to Hz.
    to_hz = tracks.speed_rev_per_s if over_angle and tracks.speed_rev_per_s is not None else 1.0
    orders = tuple(
        SeparatedOrder(
            name=tracks.names[k],
            shaft=tracks.shafts[k],
            order=float(tracks.orders[k]),
            envelope=envelopes[k],
            waveform=waveforms[k],
            frequency_hz=tracks.frequency_hz[k] * to_hz,
            bandwidth_hz=widths[k] * to_hz,
            valid=valid[k],
            settled=settled[k],
            time_s=tracks.time_s,
            unit=unit,
            source=source,
        )
        for k in range(len(valid))
    )
    notes = (*_time_notes(tracks, widths, valid, settled, skirt_poles), *_coupling_notes(groups, neighbours, tracks))
    if error > 1e-5:
        narrow = f"rounding may reach {error:.1g} of the largest component: the band is too narrow for this rate"
        notes = (*notes, f"{narrow}, or the bandwidths differ too much for one solution")
    members = tuple(tuple(int(k) for k in group) for group in groups)
    return OrderSeparation(
        orders, residual, rate, "angle" if over_angle else "time", generation, p, members, error, notes
    )


def _continued(widths: FloatArray, valid: BoolArray) -> FloatArray:
    """Return the bandwidths, limited outside the valid part to the range inside it: zero width has no weight."""
    if widths.shape[1] == 1:
        return widths
    lowest = np.where(valid, widths, np.inf).min(axis=1, keepdims=True)
    highest = np.where(valid, widths, -np.inf).max(axis=1, keepdims=True)
    return np.clip(widths, lowest, highest)


def _check_record_length(tracks: Tracks, bandwidth: FloatArray, valid: BoolArray, sampling_rate: float) -> None:
    """Raise InputError if a band is narrower than the reciprocal of the time for which the order is valid."""
    for k, name in enumerate(tracks.names):
        duration = valid[k].sum() / sampling_rate
        width = float(np.median(np.broadcast_to(bandwidth[k], valid[k].shape)[valid[k]]))
        if width * duration < 1.0:
            raise InputError(
                f"the bandwidth of order {name!r} is {width:.4g} {tracks.unit}, but the order lasts only "
                f"{duration:.4g} {tracks.duration_unit}",
                where="bandwidth",
                allowed=f"at least {1 / duration:.4g} {tracks.unit}",
                remedy="widen the band or record longer",
            )


# Which orders are close to each other or cross, which are solved for together, and where each is settled.


@dataclass(frozen=True)
class Neighbours:
    """How close orders k and m come while both are valid.

    Parameters
    ----------
    k, m : int
    distance : float
        Smallest distance, in the unit of the tracks; infinite if they are never valid at the same time.
    leak : float
        Largest gain of the filter of one for the other, 0 to 1.
    close_share : float
        Share of the common time at a distance below twice the wider bandwidth.
    """

    k: int
    m: int
    distance: float
    leak: float
    close_share: float


def _neighbours(tracks: Tracks, bandwidth: FloatArray, valid: BoolArray, poles: int) -> list[Neighbours]:
    """Compare each pair of orders: the gain at distance d is 1/(1 + (√2 - 1)(2d/B)^2p), with p = `poles`.

    Raises
    ------
    InputError
        If two orders never drift apart by half a cycle.
    """
    step = max(1, valid.shape[1] // 2**15)  # frequencies are smooth
    is_valid, f, cycles = valid[:, ::step], tracks.frequency_hz[:, ::step], tracks.cycles[:, ::step]
    width = np.broadcast_to(bandwidth, valid.shape)[:, ::step]
    pairs = []
    for k, m in combinations(range(len(valid)), 2):
        are_valid = is_valid[k] & is_valid[m]
        if not are_valid.any():
            pairs.append(Neighbours(k, m, np.inf, 0.0, 0.0))
            continue
        drift = float(np.ptp((cycles[k] - cycles[m])[are_valid]))
        if drift < 0.5:
            raise InputError(
                f"orders {tracks.names[k]!r} and {tracks.names[m]!r} drift apart by only {drift:.3g} cycles",
                where="orders",
                allowed="different orders",
                remedy="leave one of them out or record longer",
            )
        difference = (f[k] - f[m])[are_valid]
        of_half = 2.0 * np.abs(difference) / np.maximum(width[k], width[m])[are_valid]
        crossing = difference.min() <= 0.0 <= difference.max()
        nearest = 0.0 if crossing else float(of_half.min())
        distance = 0.0 if crossing else float(np.abs(difference).min())
        leak = 1.0 / (1.0 + float(HALF_POWER) ** 2 * nearest ** (2 * poles))
        pairs.append(Neighbours(k, m, distance, leak, float(np.mean(of_half < 4.0))))
    return pairs


def _groups(coupled: Coupling, neighbours: Sequence[Neighbours], problem: Problem) -> list[Group]:
    """Return the positions of the orders solved for together; each order is in one group.

    "automatic": orders share a group if, at any time, more than `MAX_LEAK` of one would pass through the band of the
    other, or if a chain of such pairs links them. If it is cheap, all orders form one group.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n_orders = len(problem.valid)
    if coupled is False:
        return [np.array([k]) for k in range(n_orders)]
    if isinstance(coupled, str) and coupled != "automatic":
        raise InputError(f"coupled is {coupled!r}", allowed='True, False, "automatic" or groups of positions')
    if coupled is True or (isinstance(coupled, str) and problem.cheap_together):
        return [np.arange(n_orders)]
    if isinstance(coupled, str):
        pairs = np.array([(pair.k, pair.m) for pair in neighbours if pair.leak > MAX_LEAK], dtype=np.intp)
        graph = coo_array((np.ones(len(pairs)), tuple(pairs.reshape(-1, 2).T)), shape=(n_orders, n_orders))
        n_parts, labels = connected_components(graph, directed=False)
        return [np.flatnonzero(labels == part) for part in range(n_parts)]
    try:
        members = [sorted(int(k) for k in group) for group in coupled]
    except (TypeError, ValueError):
        members = [[-1]]
    flat = [k for group in members for k in group]
    if any(not 0 <= k < n_orders for k in flat) or len(set(flat)) != len(flat):
        raise InputError(
            f"the groups are {coupled!r}",
            where="coupled",
            allowed=f"positions from 0 to {n_orders - 1}, each in one group at most",
        )
    single = [[k] for k in range(n_orders) if k not in flat]
    return [np.array(group) for group in sorted([group for group in members if group] + single)]


def _coupling_notes(groups: Sequence[Group], neighbours: Sequence[Neighbours], tracks: Tracks) -> list[str]:
    """Return notes on why close orders are solved for together, and warnings for those that are not."""
    group_of = {int(k): i for i, group in enumerate(groups) for k in group}
    unit = tracks.unit
    notes = []
    for pair in neighbours:
        if pair.leak <= MAX_LEAK:
            continue
        text = (
            f"orders {tracks.names[pair.k]!r} and {tracks.names[pair.m]!r} come as close as {pair.distance:.3g} {unit}"
        )
        leak = f"up to {_percent(pair.leak)} of one lies in the band of the other"
        if group_of[pair.k] == group_of[pair.m]:
            close = ", and separated where they stay close for long enough to beat" if pair.leak > NOTED_LEAK else ""
            notes.append(f"{text}, where {leak}: they are solved for together{close}")
        else:
            notes.append(
                f"{text}, and leak into each other ({leak}; more than {_percent(NOTED_LEAK)} for "
                f"{100 * pair.close_share:.1f} % of the time): couple them or narrow the band"
            )
    apart = [k for k in range(len(tracks.names)) if len(groups[group_of[k]]) == 1]
    leaks = [p.leak for p in neighbours if group_of[p.k] != group_of[p.m]]
    if len(groups) == 1 and len(tracks.names) > 1 and not notes:
        notes.append("all orders are solved for together, though they lie far apart")
    if len(groups) > 1 and apart and max(leaks, default=1.0) <= MAX_LEAK:
        names = ", ".join(repr(tracks.names[k]) for k in apart)
        notes.append(
            f"solved for by themselves, with at most {_percent(max(leaks))} of another order in their band: {names}"
        )
    return notes


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share >= 1e-5 else "a thousandth of a percent"


def _settled(bandwidth: FloatArray, valid: BoolArray, sampling_rate: float, skirt_poles: int) -> BoolArray:
    """Return where each order is valid for one settling time before and one after, (n_orders, n).

    If the bandwidth varies, so does the settling time T: it has elapsed once ∫ dt/T has grown by one.
    """
    settled = np.zeros(valid.shape, dtype=bool)
    for k, is_valid in enumerate(valid):
        rate = 1.0 / (settling_time(bandwidth[k], skirt_poles) * sampling_rate)
        passed = rate[0] * np.arange(len(is_valid)) if len(rate) == 1 else np.cumsum(rate)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], is_valid, [False]]).view(np.int8)))
        for first, end in edges.reshape(-1, 2):
            begin = first + np.searchsorted(passed[first:end], passed[first] + 1.0)
            stop = first + np.searchsorted(passed[first:end], passed[end - 1] - 1.0, side="right")
            settled[k, begin : max(begin, stop)] = True
    return settled


def _time_notes(
    tracks: Tracks, bandwidth: FloatArray, valid: BoolArray, settled: BoolArray, skirt_poles: int
) -> list[str]:
    """Return notes on which orders are left out for how long, and how long they are unreliable at the ends."""
    notes = [
        f"order {name!r} is left out for {percent:.2g} % of the time, where its band reaches half the sampling rate or "
        "zero, or the shaft angle is not known"
        for name, percent in zip(tracks.names, 100.0 * (1.0 - valid.mean(axis=1)), strict=True)
        if percent > 0.0
    ]
    times = settling_time(bandwidth, skirt_poles)
    shortest, longest = float(times.min()), float(times.max())
    span = f"{longest:.3g}" if longest < 1.005 * shortest else f"{shortest:.3g} to {longest:.3g}"
    notes.append(
        f"at the ends of the recording, and next to parts left out, levels are not reliable over {span} "
        f"{tracks.duration_unit}, in which the filter's response decays to 1 %"
    )
    never = [repr(name) for name, has_settled in zip(tracks.names, settled, strict=True) if not has_settled.any()]
    if never:
        notes.append(f"the recording is too short for some orders to settle; widen the band: {', '.join(never)}")
    return notes
