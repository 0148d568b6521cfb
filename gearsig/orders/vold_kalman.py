"""Vold–Kalman order tracking: orders taken out of a recording as waveforms, also where they cross."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, frozen_array, one_of, positive
from gearsig.errors import InputError
from gearsig.orders.revolutions import times_of_revolutions, unit_of
from gearsig.orders.vold_kalman_ends import end_notes, settled_parts
from gearsig.orders.vold_kalman_groups import Coupling, coupling_notes, grouped
from gearsig.orders.vold_kalman_neighbours import check_distinct, check_record_length, mask_notes, neighbours_of
from gearsig.orders.vold_kalman_solve import accuracy_of, cheap_together, waveform_accuracy_of
from gearsig.orders.vold_kalman_splines import BoolArray
from gearsig.orders.vold_kalman_sweeps import Problem, solve_groups
from gearsig.orders.vold_kalman_tracks import (
    OrderLike,
    Tracks,
    bandwidths_of,
    tracks_of_orders,
    tracks_over_angle,
    valid_parts,
)
from gearsig.orders.vold_kalman_types import FrequencyTrack, Generation, OrderSeparation, SeparatedOrder
from gearsig.orders.vold_kalman_weight import checked_poles
from gearsig.recording.types import Recording

FEWEST_SAMPLES = 16
NOTED_ERROR = 1e-5


def track_vold_kalman(
    recording: Recording | AngleSignal,
    channel: str,
    orders: Sequence[OrderLike],
    *,
    bandwidth_hz: float | Sequence[float] | None = None,
    bandwidth_orders: float | Sequence[float] | None = None,
    n_poles: int = 2,
    generation: Generation = "second",
    coupled: Coupling = "automatic",
    mirror: bool = True,
    shaft_angle: ShaftAngle | None = None,
) -> OrderSeparation:
    """Return orders of a recording as waveforms and complex envelopes over time, and what is left without them.

    Second generation: y_n = Σ_k Re(a_kn e^{iΘ_kn}) + η_n with ∇^p a_kn = ε_kn. First generation: y_n = Σ_k x_kn + η_n
    with x_kn - 2 cos ω_k(n+1) x_k(n+1) + x_k(n+2) = ε_kn. Both minimise Σ η² + Σ r² ε²; r follows from the bandwidth.

    Parameters
    ----------
    recording : Recording or AngleSignal
        Over angle, every order has a constant frequency, and the envelope's smoothness is one per revolution.
    channel : str
    orders : sequence
        Each a number (cycles per revolution of the angle's shaft), a pair (shaft, number) or a `FrequencyTrack`.
    bandwidth_hz, bandwidth_orders : float or one per order
        One of both: width between the -3 dB points, in Hz or in orders of the order's own shaft (of a frequency track
        without order: of the angle's shaft). In orders, it varies with speed. At least one over the duration. Noise
        within it stays in the waveform; a change of level within less than about 1/B is smoothed.
    n_poles : int
        Of the second generation: 1, 2 or 3. More poles, steeper skirts: away from the order the gain falls as f^-2p.
    generation : "first" or "second"
        The first has two poles and a fixed shape; take the second unless results are to be compared.
    coupled : "automatic", True, False, or groups
        Which orders are solved for together, so that crossing and close ones share the signal between them. Automatic:
        those of which more than 1e-4 would pass through each other's bands at any time, the groups in turn on what the
        others leave; or all, where bands are so narrow that this is faster. The notes give the reason.
        True: all. False: one by one. Groups: as positions in `orders`, e.g. [[0, 2]]; the others are solved for alone.
    mirror : bool
        Of the second generation: count each order's mirror image at negative frequency as part of the signal, which it
        is. False leaves it out, as most textbooks do: faster, but amplitudes near the ends are off by some percent.
    shaft_angle : ShaftAngle, optional
        Default: from the recording's speed source, as `find_shaft_angle`. Not needed for frequency tracks alone.

    Returns
    -------
    OrderSeparation
        All at the recording's samples, in the channel's unit; amplitudes are peak. Its notes tell over what time at the
        ends an order is not settled.

    Raises
    ------
    InputError
        On an unknown channel or shaft, a bandwidth below what the duration resolves or reaching down to order zero,
        orders that are the same, or too few samples.
    RefusalError
        If an order stands still or lies above half the sampling rate all the time.

    Notes
    -----
    Numerical error: about 1e-11 of the largest component for an order solved for alone, below 1e-6 for narrow bands
    solved for together, see `expected_error`.
    Not for transients shorter than 1/B, and not where only levels over speed are asked for: `track_order_bands` is
    enough. Close orders are told apart only over times in which they beat, about one over their distance. Near
    standstill an order meets its own mirror image: the part where the band reaches zero is left out. Memory: about 80
    bytes per sample and order, and up to 0.5 GB.

    References
    ----------
    H. Vold, J. Leuridan, "High resolution order tracking at extreme slew rates, using Kalman tracking filters", 1993.
    C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares problem", 2000.
    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    options = (n_poles, generation, coupled, mirror)
    if isinstance(recording, AngleSignal):
        if shaft_angle is not None:
            raise InputError("a signal over angle has its own shaft angle", where="shaft_angle", remedy="leave it out")
        tracks = tracks_over_angle(orders, recording)
        widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
        rate = float(recording.samples_per_revolution)
        times = times_of_revolutions(
            recording.shaft_angle, recording.start_revolution, 1.0 / rate, recording.samples.shape[1]
        )
        source = (unit_of(recording, channel), channel)
        return _separated(recording.values(channel), rate, times, tracks, widths, *options, *source)
    y, rate = recording.values(channel), recording.sampling_rate_hz
    angle = shaft_angle
    if angle is None and _needs_angle(orders, bandwidth_orders is not None):
        from gearsig.angle.shaft import find_shaft_angle

        angle = find_shaft_angle(recording)
    tracks = tracks_of_orders(orders, angle, recording.rig, len(y), rate)
    widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
    source = (recording.channels[recording.index(channel)].unit, channel)
    return _separated(y, rate, recording.time_s(), tracks, widths, *options, *source)


def separate_frequencies(
    signal: FloatArray,
    sampling_rate_hz: float,
    frequencies_hz: Sequence[FloatArray],
    *,
    bandwidth_hz: float | Sequence[float],
    n_poles: int = 2,
    generation: Generation = "second",
    coupled: Coupling = "automatic",
    mirror: bool = True,
) -> OrderSeparation:
    """Return components of a plain signal, each known by its frequency at every sample.

    Parameters
    ----------
    signal : array, (n,)
    sampling_rate_hz : float
    frequencies_hz : arrays, (n,)
        One per component.
    bandwidth_hz, n_poles, generation, coupled, mirror
        As in `track_vold_kalman`.

    Returns
    -------
    OrderSeparation

    Raises
    ------
    InputError, RefusalError
        As `track_vold_kalman`.
    """
    y, rate = frozen_array(signal, "signal", ndim=1), positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    given = [FrequencyTrack(f"component {k}", f) for k, f in enumerate(frequencies_hz, start=1)]
    tracks = tracks_of_orders(given, None, None, len(y), rate)
    widths = bandwidths_of(tracks, bandwidth_hz, None)
    return _separated(y, rate, np.arange(len(y)) / rate, tracks, widths, n_poles, generation, coupled, mirror, "", "")


def _needs_angle(orders: Sequence[OrderLike], in_orders: bool) -> bool:
    """Return whether any order, or a bandwidth in orders, cannot be told without the shaft's angle."""
    return any(not isinstance(wanted, FrequencyTrack) or (in_orders and np.isnan(wanted.order)) for wanted in orders)


def _separated(
    y: FloatArray,
    rate: float,
    time_s: FloatArray,
    tracks: Tracks,
    widths: FloatArray,
    n_poles: int,
    generation: Generation,
    coupled: Coupling,
    mirror: bool,
    unit: str,
    source: str,
) -> OrderSeparation:
    """Check, solve and wrap; widths in the unit of the tracks."""
    one_of(generation, "generation", ("first", "second"))
    p = checked_poles(n_poles) if generation == "second" else 2
    skirt_poles = p if generation == "second" else 1
    if len(y) < FEWEST_SAMPLES:
        raise InputError(f"the signal has {len(y)} samples", allowed=f"at least {FEWEST_SAMPLES}")
    valid = valid_parts(tracks, widths, rate, generation)
    check_record_length(tracks, widths, valid, rate)
    neighbours = neighbours_of(tracks, widths, valid, skirt_poles)
    check_distinct(neighbours, tracks)
    used = _continued(widths, valid) / rate
    cheap = generation == "second" and cheap_together(used, p)
    groups = grouped(coupled, neighbours, len(valid), cheap=cheap)
    problem = Problem(tracks.cycles, valid, used, p, generation, mirror)
    envelopes, waveforms, left = solve_groups(y, problem, groups, share=isinstance(coupled, str))
    settled = settled_parts(widths, valid, rate, skirt_poles)
    error = left + max(_expected_error(tracks.cycles[g], valid[g], used[g], p, generation) for g in groups)
    notes = [
        *mask_notes(tracks, valid),
        *end_notes(tracks, widths, settled, skirt_poles),
        *coupling_notes(groups, neighbours, tracks),
        *_error_notes(error),
    ]
    to_hz = tracks.speed_rev_per_s if tracks.unit == "orders" else None
    separated = tuple(
        SeparatedOrder(
            name=tracks.names[k],
            shaft=tracks.shafts[k],
            order=float(tracks.orders[k]),
            envelope=envelopes[k],
            waveform=waveforms[k],
            frequency_hz=tracks.frequency_hz[k] if to_hz is None else tracks.frequency_hz[k] * to_hz,
            bandwidth_hz=widths[k] if to_hz is None else widths[k] * to_hz,
            valid=valid[k],
            settled=settled[k],
            time_s=time_s,
            unit=unit,
            source=source,
        )
        for k in range(len(valid))
    )
    residual = y.astype(np.float64)
    for waveform in waveforms:
        residual -= waveform
    members = tuple(tuple(int(k) for k in group) for group in groups)
    axis: Literal["time", "angle"] = "time" if to_hz is None else "angle"
    return OrderSeparation(separated, residual, rate, axis, generation, p, members, error, tuple(notes))


def _expected_error(
    cycles: FloatArray, valid: BoolArray, bandwidths: FloatArray, p: int, generation: Generation
) -> float:
    """Return that of one group; bandwidths in cycles per sample."""
    return accuracy_of(bandwidths, p) if generation == "second" else waveform_accuracy_of(cycles, valid, bandwidths)


def _error_notes(error: float) -> list[str]:
    if error <= NOTED_ERROR:
        return []
    return [
        (
            f"rounding may reach {error:.1g} of the largest component: the band is too narrow for this rate, or the "
            "bandwidths differ too much for one solution"
        )
    ]


def _continued(widths: FloatArray, valid: BoolArray) -> FloatArray:
    """Return the bandwidths, those outside the valid part limited to those inside it: zero width has no weight."""
    if widths.shape[1] == 1:
        return widths
    out = np.empty_like(widths)
    for k, width in enumerate(widths):
        inside = width[valid[k]]
        out[k] = np.clip(width, inside.min(), inside.max())
    return out
