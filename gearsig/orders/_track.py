"""Level and phase of orders over speed, from the angle-resampled signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import (
    ComplexArray,
    FloatArray,
    freeze,
    frozen_array,
    instance_of,
    listed_numbers,
    not_negative,
    positive,
)
from gearsig.errors import InputError, RefusalError
from gearsig.orders._average import block_times, over_angle, unit_of
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import BATCH_SAMPLES, BlockPlan, plan_blocks


@dataclass(frozen=True)
class TrackedOrder(Result, columns=("time_s", "speed_rpm", "amplitude", "phase_rad")):
    """Level and phase of one order over time and speed.

    Parameters
    ----------
    order : float
        Cycles per revolution of `shaft`.
    time_s, speed_rpm : arrays, (n,)
    amplitude : array, (n,)
        Peak amplitude of the order in `unit`.
    phase_rad : array, (n,)
        Phase of the cosine relative to the shaft angle, -π to π.
    bandwidth_orders : float
        Width over which the order's energy was collected.
    unit, source, shaft : str
        Unit of the amplitude; the channel; the shaft that the order refers to.
    """

    order: float
    time_s: FloatArray
    speed_rpm: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray
    unit: str
    bandwidth_orders: float
    source: str
    shaft: str

    def __post_init__(self) -> None:
        freeze(self, "time_s", "speed_rpm", "amplitude", "phase_rad")


def track_orders(
    signal: AngleSignal | Recording | FloatArray,
    channel: str | float,
    orders: Sequence[float],
    *,
    shaft: str = "",
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
    revolutions_per_block: float = 10.0,
    overlap: float = 0.75,
    window: str = "hann",
) -> tuple[TrackedOrder, ...]:
    """Return amplitude and phase of each order along the signal, block by block.

    c(o) = 2 Σ x[n] w[n] exp(-2πi o θ_n) / Σ w[n] over each block, with θ the shaft angle in revolutions: the amplitude
    is |c|, the phase is φ of x = A cos(2π o θ + φ). Constant amplitudes are exact except for leakage of other orders.

    Parameters
    ----------
    signal, channel, shaft, shaft_angle, speed_rpm
        As in `order_spectrum`.
    orders : floats
        Cycles per revolution; need not be whole.
    revolutions_per_block : float
        Above zero. Two orders are resolved if they lie at least two bandwidths apart; level changes within the block
        are smoothed.
    overlap : float
        0 to 0.95.
    window : str
        See `make_window`.

    Returns
    -------
    tuple of TrackedOrder
        In the requested order, each with its bandwidth: the window's equivalent noise bandwidth in orders.

    Raises
    ------
    RefusalError
        If an order lies above the signal's highest valid order, or the signal is shorter than a block.
    InputError
        On an unknown channel or window, or a negative order.

    Notes
    -----
    Not for crossing or close orders of two shafts, which a block filter cannot separate.
    The speed may change within the block; the level should not change much.

    References
    ----------
    K. R. Fyfe and E. D. S. Munck, "Analysis of computed order tracking", 1997.
    """
    signal, channel = over_angle(signal, channel, shaft, shaft_angle, speed_rpm)
    numbers, plan = plan_track(signal, channel, orders, revolutions_per_block, overlap, window)
    cycles = numbers / signal.samples_per_revolution
    c = order_amplitudes(signal.values(channel), plan, cycles, numbers * signal.start_revolution)
    return tracked_orders(signal, channel, numbers, plan, c)


def plan_track(
    signal: AngleSignal,
    channel: str,
    orders: Sequence[float],
    revolutions_per_block: float,
    overlap: float,
    window: str,
    *,
    margin: float = 0.0,
) -> tuple[FloatArray, BlockPlan]:
    """Check the orders and the block length; return the orders and the block plan."""
    numbers = _checked_orders(signal, orders, margin)
    n = len(signal.values(channel))
    n_per_block = round(positive(revolutions_per_block, "revolutions_per_block") * signal.samples_per_revolution)
    if not 2 <= n_per_block <= n:
        raise RefusalError(
            f"a block of {revolutions_per_block:g} revolutions does not fit {signal.n_revolutions:.1f} revolutions",
            remedy="shorten the block or record longer",
        )
    return numbers, plan_blocks(n, n_per_block, overlap, window)


def tracked_orders(
    signal: AngleSignal, channel: str, orders: FloatArray, plan: BlockPlan, c: ComplexArray
) -> tuple[TrackedOrder, ...]:
    """Return complex amplitudes (n_blocks, n_orders) as tracked orders with time, speed and unit."""
    time_s, speed_rpm = block_times(signal, 0, plan.n_per_block, plan.step, plan.n_blocks)
    return tuple(
        TrackedOrder(
            order=float(order),
            time_s=time_s,
            speed_rpm=speed_rpm,
            amplitude=np.abs(c[:, i]),
            phase_rad=np.angle(c[:, i]),
            unit=unit_of(signal, channel),
            bandwidth_orders=plan.window.noise_bandwidth_bins * signal.samples_per_revolution / plan.n_per_block,
            source=channel,
            shaft=signal.shaft_angle.shaft,
        )
        for i, order in enumerate(orders)
    )


def order_amplitudes(
    x: FloatArray, plan: BlockPlan, cycles_per_sample: FloatArray, start_cycles: FloatArray
) -> ComplexArray:
    """Return the complex amplitudes c, as in `track_orders`, for each block and order, (n_blocks, n_orders).

    One real matrix product per batch of blocks; the phase at each block's start is removed afterwards.
    """
    n, w = plan.n_per_block, plan.window.values
    turns = 2 * np.pi * np.outer(np.arange(n), cycles_per_sample)
    basis = np.concatenate([np.cos(turns), -np.sin(turns)], axis=1) * w[:, None]
    blocks = np.lib.stride_tricks.sliding_window_view(x, n)[:: plan.step]
    per_batch = max(1, BATCH_SAMPLES // n)
    parts = np.concatenate(
        [blocks[i : i + per_batch].astype(np.float64) @ basis for i in range(0, plan.n_blocks, per_batch)]
    )
    k = len(cycles_per_sample)
    at_start = start_cycles + np.outer(np.arange(plan.n_blocks) * plan.step, cycles_per_sample)
    c: ComplexArray = (parts[:, :k] + 1j * parts[:, k:]) * np.exp(-2j * np.pi * at_start)
    c *= np.where(cycles_per_sample == 0.0, 1.0, 2.0) / w.sum()
    return c


def amplitude_at_speeds(tracked: TrackedOrder, speeds_rpm: FloatArray) -> FloatArray:
    """Return a tracked order's peak amplitude at given speeds, interpolated linearly in power between the blocks.

    Parameters
    ----------
    tracked : TrackedOrder
        Of a run-up or a run-down: the speed must rise or fall monotonically.
    speeds_rpm : array, (n,)

    Returns
    -------
    array, (n,)
        nan outside the tracked speed range.

    Raises
    ------
    RefusalError
        If the speed both rises and falls: an amplitude then belongs to a time, not to a speed.
    """
    instance_of(tracked, TrackedOrder, "tracked", remedy="gearsig.track_orders(recording, channel, orders) makes them")
    grid = frozen_array(speeds_rpm, "speeds_rpm", ndim=1)
    rising = np.diff(tracked.speed_rpm)
    if not (np.all(rising > 0) or np.all(rising < 0)):
        raise RefusalError(
            "the speed does not rise or fall monotonically",
            remedy="cut the recording into run-up and run-down, or read the level over time",
        )
    along = np.argsort(tracked.speed_rpm)
    power = np.interp(grid, tracked.speed_rpm[along], tracked.amplitude[along] ** 2, left=np.nan, right=np.nan)
    amplitude: FloatArray = np.sqrt(power)
    return amplitude


def _checked_orders(signal: AngleSignal, orders: Sequence[float], margin: float) -> FloatArray:
    listed_orders = listed_numbers(orders, "orders", remedy="give a list: [2, 4.5]")
    if not listed_orders:
        raise InputError("no orders are given", remedy="name at least one")
    numbers = np.array([not_negative(order, "order") for order in listed_orders])
    if numbers.max() + margin > signal.highest_order:
        raise RefusalError(
            f"order {numbers.max():g} lies above the highest valid order {signal.highest_order:g} of the signal",
            remedy="resample with more samples per revolution, or record at a higher rate",
        )
    return numbers


def track_order_bands(
    signal: AngleSignal | Recording | FloatArray,
    channel: str | float,
    orders: Sequence[float],
    *,
    shaft: str = "",
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
    bandwidth_orders: float = 0.25,
    revolutions_per_block: float = 24.0,
    overlap: float = 0.75,
    window: str = "hann",
) -> tuple[TrackedOrder, ...]:
    """Return the level of each order as the power within a band of orders around it.

    A(o)² = Σ_{|k/R| ≤ b/2} |c(o + k/R)|² / B, with c as in `track_orders`, R revolutions per block, b the bandwidth
    and B the window's noise bandwidth in lines: a constant sine in the band keeps its amplitude, and noise in the band
    contributes its power. Sound and vibration analysers call this "order level". It is less smoothed than
    `track_orders` with the same block, because a modulated order's sidebands within the band are kept.

    Parameters
    ----------
    signal, channel, orders, shaft, shaft_angle, speed_rpm
        As in `track_orders`.
    bandwidth_orders : float
        Full width; at least 4/revolutions_per_block, so that the main lobe of the Hann window fits.
    revolutions_per_block : float
    overlap : float
        0 to 0.95.
    window : str

    Returns
    -------
    tuple of TrackedOrder
        The amplitude is peak (√2 times the rms in the band); the phase is that of the centre line.

    Raises
    ------
    RefusalError, InputError
        As `track_orders`; also if the band is too narrow or reaches below order zero.
    """
    width = positive(bandwidth_orders, "bandwidth_orders")
    if width * positive(revolutions_per_block, "revolutions_per_block") < 4.0:
        raise InputError(
            f"bandwidth_orders is {width:g} with blocks of {revolutions_per_block:g} revolutions",
            allowed=f"at least {4.0 / revolutions_per_block:g}",
            remedy="widen the band or lengthen the block",
        )
    signal, channel = over_angle(signal, channel, shaft, shaft_angle, speed_rpm)
    numbers, plan = plan_track(signal, channel, orders, revolutions_per_block, overlap, window, margin=width / 2)
    per_rev = signal.samples_per_revolution
    half = int(width / 2 * plan.n_per_block / per_rev * (1 + 1e-12))
    lines = numbers[:, None] + np.arange(-half, half + 1) * per_rev / plan.n_per_block
    if lines.min() <= 0:
        raise InputError(
            f"the band of order {numbers.min():g} reaches down to {lines.min():g}", remedy="narrow it: above order zero"
        )
    c = order_amplitudes(signal.values(channel), plan, lines.ravel() / per_rev, lines.ravel() * signal.start_revolution)
    c = c.reshape(plan.n_blocks, *lines.shape)
    amplitude: FloatArray = np.sqrt((np.abs(c) ** 2).sum(axis=2) / plan.window.noise_bandwidth_bins)
    tracked = tracked_orders(signal, channel, numbers, plan, c[:, :, half])
    return tuple(replace(o, amplitude=amplitude[:, i], bandwidth_orders=width) for i, o in enumerate(tracked))
