"""Which mesh harmonic, sideband or shaft order changed most: line by line in the synchronous averages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVER
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import (
    MOST_SHAFT_ORDERS,
    N_MESH_HARMONICS,
    N_SIDEBAND_HARMONICS,
    SIDES,
    line_power,
    visible_orders,
)
from gearsig.gap.spots import Comparison, Spot, by_decibels, shaft_words
from gearsig.gap.tooth import mesh_power

FURTHEST_SIDEBAND = 12
WORTH_NAMING = 0.25
"""Of the largest change of power: what changed by less is not named, be its ratio ever so large."""
MOST_ORDERS = 6


def mesh_spot(comparison: Comparison) -> Spot:
    """Return the mesh harmonic that changed most."""
    frame = comparison.now.frame
    if comparison.strongest("mesh", "line.half_mesh") in ("mesh.half", "line.half_mesh"):
        half = comparison.change_db[comparison.strongest("mesh.half", "line.half_mesh")]
        return Spot(f"half the mesh order, {by_decibels(half)}", half, (frame.teeth[0] / 2.0,))
    now, other = _powers(comparison, DRIVER, relative=not comparison.is_reference)
    lines = [k * frame.teeth[0] for k in range(1, N_MESH_HARMONICS + 1) if k * frame.teeth[0] < now.shape[1]]
    row, best, change = _strongest_group(now, other, [[line] for line in lines])
    total = comparison.change_db["mesh.total"]
    alike = comparison.is_reference and abs(total) > 0.7 * abs(change) and total * change > 0
    every = f"mesh harmonics, together {by_decibels(total)}, " if alike else "mesh harmonics, "
    title = f"{every}most at {_times(best + 1)}mesh ({by_decibels(change)})"
    if not comparison.is_reference:
        title += " against the other harmonics"
    return Spot(title, change, (float(lines[best]),), channel=_channel(comparison, row))


def sideband_spot(comparison: Comparison, side: int) -> Spot:
    """Return about which mesh harmonic a shaft's sidebands changed most, and which of them."""
    now, other = _powers(comparison, side, relative=not comparison.is_reference)
    frame = comparison.now.frame
    teeth, n = frame.teeth[side], now.shape[1]
    reach = min(FURTHEST_SIDEBAND, teeth // 2)
    groups = [
        [k * teeth + offset for offset in range(-reach, reach + 1) if offset and k * teeth + offset < n]
        for k in range(1, N_SIDEBAND_HARMONICS + 1)
        if k * teeth + 1 < n
    ]
    row, best, change = _strongest_group(now, other, groups)
    lines = _largest_lines(now[row] - other[row], groups[best])
    title = f"sidebands of {shaft_words(frame, side)} about {_times(best + 1)}mesh, {by_decibels(change)}"
    carrier = (best + 1) * teeth
    title += _how_far_apart([abs(line - carrier) for line in lines])
    orders = tuple(float(line * frame.shaft_orders[side]) for line in lines)
    return Spot(title, change, orders, channel=_channel(comparison, row))


def shaft_spot(comparison: Comparison, side: int) -> Spot:
    """Return the low order of a shaft that changed most."""
    now, other = _powers(comparison, side, relative=False)
    frame = comparison.now.frame
    last = min(MOST_SHAFT_ORDERS, frame.teeth[side] - 3, now.shape[1] - 1)
    name = comparison.strongest(f"shaft.{SIDES[side]}").split(".")[2]
    groups = [[int(name)]] if name.isdigit() else [[order] for order in range(1, last + 1)]
    row, best, change = _strongest_group(now, other, groups)
    order = groups[best][0]
    title = f"order {order} of {shaft_words(frame, side)}, {by_decibels(change)}"
    return Spot(title, change, (order * frame.shaft_orders[side],), channel=_channel(comparison, row))


def _powers(comparison: Comparison, side: int, *, relative: bool) -> tuple[FloatArray, FloatArray]:
    """Return the lines' powers of both, (n_channels, n_orders); `relative` to each channel's mesh harmonics."""
    both = [_power_of(gathered, comparison, side, relative=relative) for gathered in (comparison.now, comparison.other)]
    n = min(power.shape[1] for power in both)
    return both[0][:, :n], both[1][:, :n]


def _power_of(gathered: Gathered, comparison: Comparison, side: int, *, relative: bool) -> FloatArray:
    sums = [gathered.channels[name] for name in comparison.now.channels]
    rows = [line_power(one, side) / (mesh_power(gathered, one, side) if relative else 1.0) for one in sums]
    n = visible_orders(gathered, side, min(len(row) for row in rows)) + 1
    return np.stack([row[:n] for row in rows])


def _strongest_group(now: FloatArray, other: FloatArray, groups: Sequence[list[int]]) -> tuple[int, int, float]:
    """Return channel, group and change in dB of the largest ratio among those whose power changed much.

    Channels are weighed by their own largest power: a sensor with a small gain sees the same.
    """
    sums = [np.stack([power[:, group].sum(axis=1) for group in groups], axis=1) for power in (now, other)]
    ratio = 10.0 * np.log10(np.maximum(sums[0], 1e-300) / np.maximum(sums[1], 1e-300))
    moved = np.abs(sums[0] - sums[1])
    enough = moved >= WORTH_NAMING * moved.max(axis=1, keepdims=True)
    row, best = np.unravel_index(int(np.argmax(np.where(enough, np.abs(ratio), -1.0))), ratio.shape)
    return int(row), int(best), float(ratio[row, best])


def _largest_lines(moved: FloatArray, lines: list[int]) -> list[int]:
    """Return the lines of one group whose power changed most, the largest first."""
    amounts = np.abs(moved[lines])
    order = np.argsort(amounts)[::-1][:MOST_ORDERS]
    return [lines[i] for i in order if amounts[i] >= WORTH_NAMING * amounts.max()]


def _how_far_apart(offsets: list[int]) -> str:
    if max(offsets) <= 2:
        return ", nearest lines only" if max(offsets) == 1 else ", nearest two lines"
    return f", up to {max(offsets)} orders away"


def _times(harmonic: int) -> str:
    return "" if harmonic == 1 else f"{harmonic} × "


def _channel(comparison: Comparison, row: int) -> str:
    return list(comparison.now.channels)[row]
