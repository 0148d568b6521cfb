"""Which mesh harmonic, sideband or shaft order changed most: line by line in the synchronous averages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVER, GearFrame
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import (
    MOST_SHAFT_ORDERS,
    N_MESH_HARMONICS,
    N_SIDEBAND_HARMONICS,
    SIDES,
    average_lines,
    is_synchronous,
    line_power,
    visible_orders,
)
from gearsig.gap.spots import Comparison, Spot, by_decibels, shaft_words
from gearsig.gap.tooth import mesh_power
from gearsig.gap.words import feature_words

FURTHEST_SIDEBAND = 12
WORTH_NAMING = 0.25
"""Of the largest change of power: what changed by less is not named, be its ratio ever so large."""
MOST_ORDERS = 6
LEAST_CHANGE_DB = 1.0
"""Of a sideband or shaft order; features that saw more saw noise."""
EXPLAINED = 0.5
"""Of the largest change of power, what a shaft's own lines must hold of it."""


def mesh_spot(comparison: Comparison) -> Spot | None:
    """Return the mesh harmonic that changed most."""
    frame = comparison.now.frame
    if comparison.strongest("mesh", "line.half_mesh") in ("mesh.half", "line.half_mesh"):
        half = comparison.change_db[comparison.strongest("mesh.half", "line.half_mesh")]
        return Spot(f"half the mesh order, {by_decibels(half)}", half, (frame.teeth[0] / 2.0,))
    both = _both(comparison, DRIVER, relative=not comparison.is_reference)
    lines = [k * frame.teeth[0] for k in range(1, N_MESH_HARMONICS + 1) if k * frame.teeth[0] < both[0].power.shape[1]]
    strongest = _strongest_group(*both, [[line] for line in lines])
    if strongest is None:
        return None
    row, best, change = strongest
    if abs(change) < LEAST_CHANGE_DB:  # the lines hardly moved: what was scored is a ratio, of harmonics or of sensors
        scored = comparison.strongest("mesh.", "alike.")
        change = comparison.change_db[scored]
        title = f"{feature_words(scored, frame)}, {by_decibels(change)}"
        if scored.startswith("alike."):
            title = "what lies beside the mesh harmonics, which themselves hardly moved"
        return Spot(title, change, _harmonic_order(scored, frame))
    total = comparison.change_db["mesh.total"]
    alike = comparison.is_reference and abs(total) > 0.7 * abs(change) and total * change > 0
    every = f"mesh harmonics, together {by_decibels(total)}, " if alike else "mesh harmonics, "
    title = f"{every}most at {_times(best + 1)}mesh ({by_decibels(change)})"
    if not comparison.is_reference:
        title += " against the other harmonics"
    return Spot(title, change, (float(lines[best]),), channel=_channel(comparison, row))


def _harmonic_order(feature: str, frame: GearFrame) -> tuple[float, ...]:
    """Return the order of the one mesh harmonic that a feature is of; none for what is of all."""
    harmonic = feature.rpartition(".")[2]
    return (float(int(harmonic) * frame.teeth[DRIVER]),) if harmonic.isdigit() else ()


def sideband_spot(comparison: Comparison, side: int) -> Spot | None:
    """Return about which mesh harmonic a shaft's sidebands changed most, and which of them."""
    now, other = _both(comparison, side, relative=not comparison.is_reference)
    frame = comparison.now.frame
    teeth, n = frame.teeth[side], now.power.shape[1]
    reach = min(FURTHEST_SIDEBAND, teeth // 2)
    groups = [
        [k * teeth + offset for offset in range(-reach, reach + 1) if offset and k * teeth + offset < n]
        for k in range(1, N_SIDEBAND_HARMONICS + 1)
        if k * teeth + 1 < n
    ]
    strongest = _strongest_group(now, other, groups)
    if strongest is None or abs(strongest[2]) < LEAST_CHANGE_DB:
        return None
    row, best, change = strongest
    lines = _largest_lines(now.own[row] - other.own[row], groups[best])
    title = f"sidebands of {shaft_words(frame, side)} about {_times(best + 1)}mesh, {by_decibels(change)}"
    carrier = (best + 1) * teeth
    title += _how_far_apart([abs(line - carrier) for line in lines])
    orders = tuple(float(line * frame.shaft_orders[side]) for line in lines)
    return Spot(title, change, orders, channel=_channel(comparison, row))


def shaft_spot(comparison: Comparison, side: int) -> Spot | None:
    """Return the low order of a shaft that changed most."""
    both = _both(comparison, side, relative=False)
    frame = comparison.now.frame
    last = min(MOST_SHAFT_ORDERS, frame.teeth[side] - 3, both[0].power.shape[1] - 1)
    name = comparison.strongest(f"shaft.{SIDES[side]}").split(".")[2]
    groups = [[int(name)]] if name.isdigit() else [[order] for order in range(1, last + 1)]
    strongest = _strongest_group(*both, groups)
    if strongest is None or abs(strongest[2]) < LEAST_CHANGE_DB:
        return None
    row, best, change = strongest
    order = groups[best][0]
    title = f"order {order} of {shaft_words(frame, side)}, {by_decibels(change)}"
    return Spot(title, change, (order * frame.shaft_orders[side],), channel=_channel(comparison, row))


@dataclass(frozen=True)
class _Lines:
    """Lines of a shaft's average, (n_channels, n_orders): all power, the shaft's own, and the noise put under it."""

    power: FloatArray
    own: FloatArray
    floor: FloatArray

    def first(self, n: int) -> _Lines:
        return _Lines(self.power[:, :n], self.own[:, :n], self.floor[:, :n])

    def of_groups(self, groups: Sequence[list[int]]) -> _Lines:
        """Return the sums over groups of lines, (n_channels, n_groups)."""
        sums = [
            np.stack([values[:, group].sum(axis=1) for group in groups], axis=1)
            for values in (self.power, self.own, self.floor)
        ]
        return _Lines(*sums)


def _both(comparison: Comparison, side: int, *, relative: bool) -> tuple[_Lines, _Lines]:
    """Return the lines of both on the same orders; `relative` to each channel's mesh harmonics."""
    names = tuple(comparison.now.channels)
    now, other = (_lines(run, names, side, relative=relative) for run in (comparison.now, comparison.other))
    n = min(now.power.shape[1], other.power.shape[1])
    return now.first(n), other.first(n)


def _lines(gathered: Gathered, names: Sequence[str], side: int, *, relative: bool) -> _Lines:
    rows = []
    for name in names:
        sums = gathered.channels[name]
        power, (lines, noise) = line_power(sums, side), average_lines(sums, side)
        own = np.where(is_synchronous(sums, side), np.maximum(np.abs(lines) ** 2 - noise, 0.0), 0.0)
        floor = power - np.maximum(np.abs(lines) ** 2 - noise, 0.0)
        scale = mesh_power(gathered, sums, side) if relative else 1.0
        rows.append([values / scale for values in (power, own, floor)])
    n = visible_orders(gathered, side, min(len(row[0]) for row in rows)) + 1
    return _Lines(*(np.stack([row[i][:n] for row in rows]) for i in range(3)))


def _strongest_group(now: _Lines, other: _Lines, groups: Sequence[list[int]]) -> tuple[int, int, float] | None:
    """Return channel, group and change in dB of the largest ratio among those whose power changed much.

    Channels are weighed by their own largest change: a sensor with a small gain sees the same. What changed must be the
    shaft's own lines; None where it is noise, or leaks into the average.
    """
    here, there = now.of_groups(groups), other.of_groups(groups)
    floor = np.maximum(np.maximum(here.floor, there.floor), 1e-300)
    ratio = 10.0 * np.log10((here.own + floor) / (there.own + floor))
    moved, whole = np.abs(here.own - there.own), np.abs(here.power - there.power)
    explained = moved.max(axis=1, keepdims=True) >= EXPLAINED * whole.max(axis=1, keepdims=True)
    enough = (moved > 0.0) & (moved >= WORTH_NAMING * moved.max(axis=1, keepdims=True)) & explained
    if not enough.any():
        return None
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
