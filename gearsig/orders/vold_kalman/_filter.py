"""Vold–Kalman order tracking: orders taken out of a recording as waveforms, also where they cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, frozen_array, one_of, positive
from gearsig.errors import InputError
from gearsig.orders._average import unit_of
from gearsig.orders.vold_kalman._grouping import (
    Coupling,
    Group,
    check_distinct,
    check_record_length,
    coupling_notes,
    end_notes,
    grouped,
    mask_notes,
    neighbours_of,
    settled_parts,
)
from gearsig.orders.vold_kalman._joint import (
    BoolArray,
    ComplexArray,
    Problem,
    accuracy_of,
    cheap_together,
    solve_groups,
    waveform_accuracy_of,
)
from gearsig.orders.vold_kalman._tracks import (
    FrequencyTrack,
    Generation,
    OrderLike,
    OrderSeparation,
    SeparatedOrder,
    Tracks,
    bandwidths_of,
    checked_poles,
    tracks_of_orders,
    tracks_over_angle,
    valid_parts,
)
from gearsig.recording import Recording

# From a signal and the orders' tracks to separated orders: checks, grouping, solution, notes.


MIN_SAMPLES = 16
NOTED_ERROR = 1e-5


@dataclass(frozen=True)
class Method:
    """How the orders are solved for; as the parameters of `track_vold_kalman`."""

    n_poles: int
    generation: Generation
    coupled: Coupling
    mirror: bool

    def __post_init__(self) -> None:
        one_of(self.generation, "generation", ("first", "second"))
        if self.generation == "second":
            checked_poles(self.n_poles)

    @property
    def p(self) -> int:
        """Order of the structural equation."""
        return self.n_poles if self.generation == "second" else 2

    @property
    def skirt_poles(self) -> int:
        """Poles that the gain has on either side of the order: with two in all, the first generation has one."""
        return self.n_poles if self.generation == "second" else 1


def separated(
    y: FloatArray, rate: float, tracks: Tracks, widths: FloatArray, method: Method, *, unit: str = "", source: str = ""
) -> OrderSeparation:
    """Return the orders and the residual.

    Parameters
    ----------
    y : array, (n,)
    rate : float
        Samples per unit of the tracks' duration.
    tracks : Tracks
    widths : array, (n_orders, n) or (n_orders, 1)
        Bandwidths in the unit of the tracks.
    method : Method
    unit, source : str
    """
    if len(y) < MIN_SAMPLES:
        raise InputError(f"the signal has {len(y)} samples", allowed=f"at least {MIN_SAMPLES}")
    valid = valid_parts(tracks, widths, rate, method.generation)
    check_record_length(tracks, widths, valid, rate)
    neighbours = neighbours_of(tracks, widths, valid, method.skirt_poles)
    check_distinct(neighbours, tracks)
    problem = Problem(
        tracks.cycles, valid, _continued(widths, valid) / rate, method.p, method.generation, method.mirror
    )
    cheap = method.generation == "second" and cheap_together(
        problem.cycles, problem.valid, problem.bandwidths, method.p
    )
    groups = grouped(method.coupled, neighbours, len(valid), cheap=cheap)
    envelopes, waveforms, sweep_error = solve_groups(y, problem, groups, share=isinstance(method.coupled, str))
    settled = settled_parts(widths, valid, rate, method.skirt_poles)
    error = sweep_error + max(_expected_error(problem, g) for g in groups)
    residual = y.astype(np.float64)
    for waveform in waveforms:
        residual -= waveform
    orders = tuple(
        _order(k, tracks, widths, envelopes[k], waveforms[k], valid[k], settled[k], unit, source)
        for k in range(len(valid))
    )
    axis: Literal["time", "angle"] = "angle" if tracks.unit == "orders" else "time"
    members = tuple(tuple(int(k) for k in group) for group in groups)
    notes = (
        *mask_notes(tracks, valid),
        *end_notes(tracks, widths, settled, method.skirt_poles),
        *coupling_notes(groups, neighbours, tracks),
        *_error_notes(error),
    )
    return OrderSeparation(orders, residual, rate, axis, method.generation, method.p, members, error, notes)


def _order(
    k: int,
    tracks: Tracks,
    widths: FloatArray,
    envelope: ComplexArray,
    waveform: FloatArray,
    valid: BoolArray,
    settled: BoolArray,
    unit: str,
    source: str,
) -> SeparatedOrder:
    """Wrap one order; over angle, frequency and bandwidth become Hz with the speed."""
    frequency, width = tracks.frequency_hz[k], widths[k]
    if tracks.unit == "orders" and tracks.speed_rev_per_s is not None:
        frequency, width = frequency * tracks.speed_rev_per_s, width * tracks.speed_rev_per_s
    return SeparatedOrder(
        name=tracks.names[k],
        shaft=tracks.shafts[k],
        order=float(tracks.orders[k]),
        envelope=envelope,
        waveform=waveform,
        frequency_hz=frequency,
        bandwidth_hz=width,
        valid=valid,
        settled=settled,
        time_s=tracks.time_s,
        unit=unit,
        source=source,
    )


def _expected_error(problem: Problem, group: Group) -> float:
    """Return the rounding error of one group's solution."""
    widths = problem.bandwidths[group]
    if problem.generation == "second":
        return accuracy_of(problem.cycles[group], problem.valid[group], widths, problem.p)
    return waveform_accuracy_of(problem.cycles[group], problem.valid[group], widths)


def _error_notes(error: float) -> list[str]:
    if error <= NOTED_ERROR:
        return []
    text = f"rounding may reach {error:.1g} of the largest component: the band is too narrow for this rate"
    return [f"{text}, or the bandwidths differ too much for one solution"]


def _continued(widths: FloatArray, valid: BoolArray) -> FloatArray:
    """Return the bandwidths, those outside the valid part limited to those inside it: zero width has no weight."""
    if widths.shape[1] == 1:
        return widths
    out = np.empty_like(widths)
    for k, width in enumerate(widths):
        inside = width[valid[k]]
        out[k] = np.clip(width, inside.min(), inside.max())
    return out


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
        from gearsig.angle import find_shaft_angle

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
