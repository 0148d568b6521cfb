"""Level of orders along a change of speed, as the power in a band of orders around each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError
from gearsig.orders.track import order_amplitudes, plan_track, tracked_orders
from gearsig.orders.types import TrackedOrder


def track_order_bands(
    signal: AngleSignal,
    channel: str,
    orders: Sequence[float],
    *,
    bandwidth_orders: float = 0.25,
    revolutions_per_block: float = 24.0,
    overlap: float = 0.75,
    window: str = "hann",
) -> tuple[TrackedOrder, ...]:
    """Return the level of each order as the power within a band of orders around it.

    A(o)² = Σ_{|k/R| ≤ b/2} |c(o + k/R)|² / B, with c as in `track_orders`, R revolutions per block, b the bandwidth
    and B the window's noise bandwidth in lines: a constant sine in the band keeps its amplitude, noise in the band
    counts with its power. This is what sound and vibration analysers show as "order level": less smoothed than
    `track_orders` with the same block, for a modulated order's sidebands within the band are kept.

    Parameters
    ----------
    signal : AngleSignal
    channel : str
    orders : floats
    bandwidth_orders : float
        Full width; at least 4/revolutions_per_block, so that the main lobe of the Hann window fits.
    revolutions_per_block : float
    overlap : float
        0 to 0.95.
    window : str

    Returns
    -------
    tuple of TrackedOrder
        Amplitude is peak (√2 times the rms in the band); the phase is that of the centre line.

    Raises
    ------
    RefusalError, InputError
        As `track_orders`; also on a band that is too narrow or reaches below order zero.
    """
    width = positive(bandwidth_orders, "bandwidth_orders")
    if width * revolutions_per_block < 4.0:
        raise InputError(
            f"bandwidth_orders is {width:g} with blocks of {revolutions_per_block:g} revolutions",
            allowed=f"at least {4.0 / positive(revolutions_per_block, 'revolutions_per_block'):g}",
            remedy="widen the band or lengthen the block",
        )
    wanted, plan = plan_track(signal, channel, orders, revolutions_per_block, overlap, window, margin=width / 2)
    per_rev = signal.samples_per_revolution
    half = int(width / 2 * plan.n_per_block / per_rev * (1 + 1e-12))
    lines = wanted[:, None] + np.arange(-half, half + 1) * per_rev / plan.n_per_block
    if lines.min() <= 0:
        raise InputError(
            f"the band of order {wanted.min():g} reaches down to {lines.min():g}", remedy="narrow it: above order zero"
        )
    c = order_amplitudes(signal.values(channel), plan, lines.ravel() / per_rev, lines.ravel() * signal.start_revolution)
    c = c.reshape(plan.n_blocks, *lines.shape)
    amplitude: FloatArray = np.sqrt((np.abs(c) ** 2).sum(axis=2) / plan.window.noise_bandwidth_bins)
    tracked = tracked_orders(signal, channel, wanted, plan, c[:, :, half])
    return tuple(replace(o, amplitude=amplitude[:, i], bandwidth_orders=width) for i, o in enumerate(tracked))
