"""Vold–Kalman order tracking: orders taken out of a recording as waveforms, also where they cross."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, frozen_array, one_of, positive
from gearsig.errors import InputError
from gearsig.orders.vold_kalman_neighbours import check_distinct, check_record_length, closeness_notes, mask_notes
from gearsig.orders.vold_kalman_solve import (
    accuracy_of,
    envelopes_of_waveforms,
    phasors_of,
    solve_envelopes,
    solve_waveforms,
    waveform_accuracy_of,
)
from gearsig.orders.vold_kalman_splines import BoolArray, ComplexArray
from gearsig.orders.vold_kalman_tracks import OrderLike, Tracks, bandwidths_of, tracks_of_orders, valid_parts
from gearsig.orders.vold_kalman_types import FrequencyTrack, Generation, OrderSeparation, SeparatedOrder
from gearsig.orders.vold_kalman_weight import checked_poles
from gearsig.recording.types import Recording

FEWEST_SAMPLES = 16
NOTED_ERROR = 1e-5


def track_vold_kalman(
    recording: Recording,
    channel: str,
    orders: Sequence[OrderLike],
    *,
    bandwidth_hz: float | Sequence[float] | None = None,
    bandwidth_orders: float | Sequence[float] | None = None,
    n_poles: int = 2,
    generation: Generation = "second",
    coupled: bool = True,
    mirror: bool = True,
    shaft_angle: ShaftAngle | None = None,
) -> OrderSeparation:
    """Return orders of a recording as waveforms and complex envelopes over time, and what is left without them.

    Second generation: y_n = Σ_k Re(a_kn e^{iΘ_kn}) + η_n with ∇^p a_kn = ε_kn. First generation: y_n = Σ_k x_kn + η_n
    with x_kn - 2 cos ω_k(n+1) x_k(n+1) + x_k(n+2) = ε_kn. Both minimise Σ η² + Σ r² ε²; r follows from the bandwidth.

    Parameters
    ----------
    recording : Recording
    channel : str
    orders : sequence
        Each a number (cycles per revolution of the angle's shaft), a pair (shaft, number) or a `FrequencyTrack`.
    bandwidth_hz, bandwidth_orders : float or one per order
        One of both: width between the -3 dB points, in Hz or in orders of the order's own shaft. In orders, it varies
        with speed. At least one over the duration. Noise within it stays in the waveform; a change of level within less
        than about 1/B is smoothed.
    n_poles : int
        Of the second generation: 1, 2 or 3. More poles, steeper skirts: away from the order the gain falls as f^-2p.
    generation : "first" or "second"
        The first has two poles and a fixed shape; take the second unless results are to be compared.
    coupled : bool
        Solve for all orders together, so that crossing and close ones share the signal between them. False: one by one.
    mirror : bool
        Of the second generation: count each order's mirror image at negative frequency as part of the signal, which it
        is. False leaves it out, as most textbooks do: faster, but amplitudes near the ends are off by some percent.
    shaft_angle : ShaftAngle, optional
        Default: from the recording's speed source, as `find_shaft_angle`. Not needed for frequency tracks alone.

    Returns
    -------
    OrderSeparation
        All at the recording's samples, in the channel's unit; amplitudes are peak.

    Raises
    ------
    InputError
        On an unknown channel or shaft, a bandwidth below what the duration resolves or reaching down to order zero,
        orders that are the same, or too few samples.
    RefusalError
        If an order stands still or lies above half the sampling rate all the time.

    Notes
    -----
    Error of the second generation: below 1e-6 of the largest component for constant bandwidth, see `expected_error`.
    Not for transients shorter than 1/B, and not where only levels over speed are asked for: `track_order_bands` is
    enough. Close orders are told apart only over times in which they beat, about one over their distance. Near
    standstill an order meets its own mirror image: the part where the band reaches zero is left out. Memory: about 80
    bytes per sample and order.

    References
    ----------
    H. Vold, J. Leuridan, "High resolution order tracking at extreme slew rates, using Kalman tracking filters", 1993.
    C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares problem", 2000.
    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    y, rate = recording.values(channel), recording.sampling_rate_hz
    angle = shaft_angle
    if angle is None and not all(isinstance(wanted, FrequencyTrack) for wanted in orders):
        from gearsig.angle.shaft import find_shaft_angle

        angle = find_shaft_angle(recording)
    tracks = tracks_of_orders(orders, angle, recording.rig, len(y), rate)
    unit = recording.channels[recording.index(channel)].unit
    widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
    return _separated(y, rate, tracks, widths, n_poles, generation, coupled, mirror, unit, channel)


def separate_frequencies(
    signal: FloatArray,
    sampling_rate_hz: float,
    frequencies_hz: Sequence[FloatArray],
    *,
    bandwidth_hz: float | Sequence[float],
    n_poles: int = 2,
    generation: Generation = "second",
    coupled: bool = True,
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
    return _separated(y, rate, tracks, widths, n_poles, generation, coupled, mirror, "", "")


def _separated(
    y: FloatArray,
    rate: float,
    tracks: Tracks,
    widths: FloatArray,
    n_poles: int,
    generation: Generation,
    coupled: bool,
    mirror: bool,
    unit: str,
    source: str,
) -> OrderSeparation:
    """Check, solve and wrap; widths in Hz."""
    one_of(generation, "generation", ("first", "second"))
    p = checked_poles(n_poles) if generation == "second" else 2
    if len(y) < FEWEST_SAMPLES:
        raise InputError(f"the signal has {len(y)} samples", allowed=f"at least {FEWEST_SAMPLES}")
    valid = valid_parts(tracks, widths, rate, generation)
    check_record_length(tracks, widths, valid, rate)
    check_distinct(tracks, valid)
    used = _continued(widths, valid) / rate
    groups = [np.arange(len(valid))] if coupled else [np.array([k]) for k in range(len(valid))]
    envelopes, waveforms = _solved(y, tracks.cycles, valid, used, p, generation, groups, mirror)
    errors = [
        accuracy_of(used[g], p) if generation == "second" else waveform_accuracy_of(tracks.cycles[g], valid[g], used[g])
        for g in groups
    ]
    notes = mask_notes(tracks, valid) + closeness_notes(tracks, widths, valid, coupled)
    if max(errors) > NOTED_ERROR:
        notes.append(
            f"rounding may reach {max(errors):.1g} of the largest component: the band is too narrow for this rate, or "
            "the bandwidths differ too much for one solution"
        )
    separated = tuple(
        _separated_order(k, tracks, widths, valid, envelopes, waveforms, unit, source, rate) for k in range(len(valid))
    )
    residual = y.astype(np.float64)
    for waveform in waveforms:
        residual -= waveform
    return OrderSeparation(separated, residual, rate, generation, p, coupled, max(errors), tuple(notes))


def _separated_order(
    k: int,
    tracks: Tracks,
    widths: FloatArray,
    valid: BoolArray,
    envelopes: ComplexArray,
    waveforms: FloatArray,
    unit: str,
    source: str,
    rate: float,
) -> SeparatedOrder:
    return SeparatedOrder(
        name=tracks.names[k],
        shaft=tracks.shafts[k],
        order=float(tracks.orders[k]),
        envelope=envelopes[k],
        waveform=waveforms[k],
        frequency_hz=tracks.frequency_hz[k],
        bandwidth_hz=widths[k],
        valid=valid[k],
        unit=unit,
        source=source,
        sampling_rate_hz=rate,
    )


def _solved(
    y: FloatArray,
    cycles: FloatArray,
    valid: BoolArray,
    bandwidths: FloatArray,
    p: int,
    generation: Generation,
    groups: list[np.ndarray[tuple[int], np.dtype[np.intp]]],
    mirror: bool,
) -> tuple[ComplexArray, FloatArray]:
    """Return envelopes (nan where not valid) and waveforms (0 there), group by group."""
    envelopes = np.empty(cycles.shape, np.complex128)
    waveforms = np.empty(cycles.shape)
    for g in groups:
        active = None if valid[g].all() else valid[g]
        if generation == "second":
            envelopes[g] = solve_envelopes(y, cycles[g], active, bandwidths[g], p, mirror=mirror)
            for k in g:
                waveforms[k] = (envelopes[k] * phasors_of(cycles[k : k + 1])[0]).real
        else:
            waveforms[g] = solve_waveforms(y, cycles[g], active, bandwidths[g])
            envelopes[g] = envelopes_of_waveforms(waveforms[g], cycles[g])
    envelopes[~valid] = np.nan
    waveforms[~valid] = 0.0
    return envelopes, waveforms


def _continued(widths: FloatArray, valid: BoolArray) -> FloatArray:
    """Return the bandwidths, those outside the valid part limited to those inside it: zero width has no weight."""
    if widths.shape[1] == 1:
        return widths
    out = np.empty_like(widths)
    for k, width in enumerate(widths):
        inside = width[valid[k]]
        out[k] = np.clip(width, inside.min(), inside.max())
    return out
