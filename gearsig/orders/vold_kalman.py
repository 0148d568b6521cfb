"""Vold–Kalman order tracking: orders taken out of a recording as waveforms, also where they cross."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, frozen_array, positive
from gearsig.errors import InputError
from gearsig.orders.revolutions import unit_of
from gearsig.orders.vold_kalman_groups import Coupling
from gearsig.orders.vold_kalman_separate import Method, separated
from gearsig.orders.vold_kalman_tracks import OrderLike, bandwidths_of, tracks_of_orders, tracks_over_angle
from gearsig.orders.vold_kalman_types import FrequencyTrack, Generation, OrderSeparation
from gearsig.recording.types import Recording


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
    Numerical error: about 1e-11 of the largest component for an order solved for alone, below 1e-6 for several, see
    `expected_error`. Not for transients shorter than 1/B, and not where only levels over speed are asked for:
    `track_order_bands` is enough. Close orders are told apart only over times in which they beat, about one over their
    distance. Near standstill an order meets its own mirror image: the part where the band reaches zero is left out.
    Memory: about 80 bytes per sample and order, and up to 0.3 GB.

    References
    ----------
    H. Vold, J. Leuridan, "High resolution order tracking at extreme slew rates, using Kalman tracking filters", 1993.
    C. Feldbauer, R. Höldrich, "Realization of a Vold-Kalman tracking filter – a least squares problem", 2000.
    J. Tůma, "Setting the passband width in the Vold-Kalman order tracking filter", 2005.
    """
    method = Method(n_poles, generation, coupled, mirror)
    y = recording.values(channel)
    if isinstance(recording, AngleSignal):
        if shaft_angle is not None:
            raise InputError("a signal over angle has its own shaft angle", where="shaft_angle", remedy="leave it out")
        tracks = tracks_over_angle(orders, recording)
        widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
        rate = float(recording.samples_per_revolution)
        return separated(y, rate, tracks, widths, method, unit=unit_of(recording, channel), source=channel)
    rate, angle = recording.sampling_rate_hz, shaft_angle
    if angle is None and _needs_angle(orders, bandwidth_orders is not None):
        from gearsig.angle.shaft import find_shaft_angle

        angle = find_shaft_angle(recording)
    tracks = tracks_of_orders(orders, angle, recording.rig, len(y), rate)
    widths = bandwidths_of(tracks, bandwidth_hz, bandwidth_orders)
    unit = recording.channels[recording.index(channel)].unit
    return separated(y, rate, tracks, widths, method, unit=unit, source=channel)


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
    if len(y) == 0:
        raise InputError("the signal is empty", where="signal", remedy="give samples")
    given = [FrequencyTrack(f"component {k}", f) for k, f in enumerate(frequencies_hz, start=1)]
    tracks = tracks_of_orders(given, None, None, len(y), rate)
    widths = bandwidths_of(tracks, bandwidth_hz, None)
    return separated(y, rate, tracks, widths, Method(n_poles, generation, coupled, mirror))


def _needs_angle(orders: Sequence[OrderLike], in_orders: bool) -> bool:
    """Return whether any order, or a bandwidth in orders, cannot be told without the shaft's angle."""
    return any(not isinstance(wanted, FrequencyTrack) or (in_orders and np.isnan(wanted.order)) for wanted in orders)
