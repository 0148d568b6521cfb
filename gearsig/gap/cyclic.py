"""Features of what no shaft repeats: bearings' lines in envelope and spectrum, strange lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.frame import GearFrame
from gearsig.gap.gathered import ChannelSums, Gathered
from gearsig.gap.gear_lines import SIDES, Feature, decibel

SLIP = 0.015
"""Rolling elements slip: their orders are sought within this share of the kinematic ones."""
MOST_SLIPS = 201

Known = tuple[float, float]
"""An order, and by how much it may slip."""

N_FAMILY = 4
N_SHAFT_FAMILY = 6
USED_OF_BAND = 0.7
"""Of a band's width, the modulation that its envelope carries well."""
FLOOR_WIDTH = 48
"""Lines whose median is the floor."""
LOWEST_STRANGE = 0.4
"""Order of the driver below which a line may be the window's or the speed's."""
RACES = {"outer": ("outer", 1.0), "inner": ("inner", 1.0), "ball": ("spin", 2.0), "cage": ("cage", 1.0)}
"""Family → the bearing's order that it counts, and how often; a ball strikes with both sides."""


def floor_ratio(power: FloatArray) -> FloatArray:
    """Return each line's power over its neighbourhood's median, lines of noise being exponentially distributed.

    Medians of adjoining stretches are joined by straight lines: a running median costs a hundred times as much.
    """
    n_stretches = max(1, power.shape[-1] // FLOOR_WIDTH)
    width = power.shape[-1] // n_stretches
    medians = np.median(power[:, : n_stretches * width].reshape(len(power), n_stretches, width), axis=2)
    middles = (np.arange(n_stretches) + 0.5) * width
    logs = np.log(np.maximum(medians, 1e-300))
    floors = np.exp([np.interp(np.arange(power.shape[-1]), middles, row) for row in logs])
    ratio: FloatArray = power * np.log(2.0) / floors
    return ratio


def cyclic_features(gathered: Gathered, channels: Sequence[ChannelSums]) -> Iterator[Feature]:
    """Yield excesses in dB of families of envelope lines and of residual lines: the largest over channels and bands."""
    frame = gathered.frame
    envelopes = np.concatenate([envelope_ratios(gathered, c) for c in channels])
    step, levels = gathered.cycle_step, excesses(envelopes)
    known = gear_orders(frame)
    yield from _families(frame, levels, step, known, "envelope")
    for side, order in enumerate(frame.shaft_orders):
        yield f"envelope.{SIDES[side]}_shaft", _family(levels, order, N_SHAFT_FAMILY, step, (), 0.0)
    yield "envelope.mesh", _family(levels, float(frame.teeth[0]), 1, step, (), 0.0)
    yield "envelope.strange", _strange(envelopes, step, known_modulation(frame), first=LOWEST_STRANGE)
    depth = max(float(c.envelope_power.mean(axis=0)[:, 2:].sum(axis=1).max()) for c in channels)
    yield "envelope.depth", decibel(depth)
    residuals = residual_ratios(gathered, channels)
    levels = excesses(residuals)
    yield from _families(frame, levels, gathered.order_step, known, "line")
    yield "line.half_mesh", _family(levels, frame.teeth[0] / 2.0, 1, gathered.order_step, (), 0.0)
    yield "line.strange", _strange(residuals, gathered.order_step, known_lines(frame), first=LOWEST_STRANGE)


def envelope_ratios(gathered: Gathered, sums: ChannelSums) -> FloatArray:
    """Return the lines of each band's envelope over their floor; 1 beyond the band's width, where there is nothing."""
    ratios = floor_ratio(sums.envelope_power.mean(axis=0))
    cycles = np.arange(ratios.shape[1]) * gathered.cycle_step
    for row, (low, high) in zip(ratios, gathered.bands_hz, strict=True):
        row[cycles > USED_OF_BAND * (high - low) / gathered.speed_hz] = 1.0
    return ratios


def _families(
    frame: GearFrame, levels: FloatArray, step: float, known: Sequence[float], name: str
) -> Iterator[Feature]:
    for kind, (attribute, factor) in RACES.items():
        orders = [getattr(b, attribute) * factor for b in frame.bearings]
        scores = [_family(levels, o, N_FAMILY, step, known, SLIP) for o in orders if np.isfinite(o)]
        yield f"{name}.{kind}", max(scores, default=0.0)


def _family(
    levels: FloatArray, order: float, n_harmonics: int, step: float, known: Sequence[float], slip: float
) -> float:
    return best_of_family(levels, order, n_harmonics, step, known, slip)[0]


def best_of_family(
    levels: FloatArray, order: float, n_harmonics: int, step: float, known: Sequence[float], slip: float
) -> tuple[float, int, float]:
    """Return the mean excess in dB of a family's lines, the spectrum that shows it best, and its order with slip.

    `levels` are excesses in dB, not below 0; the larger of a line and its neighbours counts.
    """
    harmonics = np.arange(1, n_harmonics + 1) * order
    if known:
        harmonics = harmonics[np.min(np.abs(np.asarray(known) - harmonics[:, None]), axis=1) >= 1.5 * step]
    harmonics = harmonics[harmonics * (1.0 + slip) / step < levels.shape[1] - 1]
    if not len(harmonics):
        return 0.0, 0, order
    n_slips = min(MOST_SLIPS, 2 * int(np.ceil(slip * harmonics.max() / step)) + 1)  # a line apart at the highest
    shifts = np.linspace(-slip, slip, n_slips)
    places = np.rint(np.outer(1.0 + shifts, harmonics) / step).astype(np.intp)
    means = levels[:, places].mean(axis=2)
    row, best = np.unravel_index(int(np.argmax(means)), means.shape)
    return float(means[row, best]), int(row), order * (1.0 + float(shifts[best]))


def excesses(ratios: FloatArray) -> FloatArray:
    """Return excesses in dB, not below 0, each the largest of a line and its two neighbours."""
    from scipy.ndimage import maximum_filter1d

    level: FloatArray = 10.0 * np.log10(np.maximum(maximum_filter1d(ratios, 3, axis=1), 1.0))
    return level


def _strange(ratios: FloatArray, step: float, known: Sequence[Known], *, first: float) -> float:
    """Return the excess in dB of the strongest line that belongs to nothing known."""
    free = free_lines(ratios.shape[1], step, known, first=first)
    return max(decibel(float(ratios[:, free].max())), 0.0) if free.any() else 0.0


def free_lines(n_lines: int, step: float, known: Sequence[Known], *, first: float) -> NDArray[np.bool_]:
    """Return which lines belong to nothing known."""
    positions = np.arange(n_lines) * step
    near = np.zeros(n_lines, dtype=bool)
    for order, slip in known:
        low = np.searchsorted(positions, order - slip - 2.0 * step)
        near[low : np.searchsorted(positions, order + slip + 2.0 * step)] = True
    free: NDArray[np.bool_] = ~near & (positions > first)
    return free


def residual_ratios(gathered: Gathered, channels: Sequence[ChannelSums]) -> FloatArray:
    """Return the residuals' lines over their floor, one row per channel."""
    ratios = floor_ratio(np.stack([c.residual_power.mean(axis=0) for c in channels]))
    return ratios[:, : int(gathered.highest_order / gathered.order_step)]


def gear_orders(frame: GearFrame) -> list[float]:
    """Orders of both shafts' first harmonics, and of mesh harmonics with their first sidebands."""
    shafts = [k * order for order in frame.shaft_orders for k in range(1, 13)]
    mesh = [k * frame.teeth[0] + j * order for k in range(1, 7) for order in frame.shaft_orders for j in range(-3, 4)]
    return shafts + mesh


def known_modulation(frame: GearFrame) -> list[Known]:
    """Return what modulates the residual: gears, whose orders are exact, and every bearing's families."""
    return [*((order, 0.0) for order in gear_orders(frame)), *_bearing_orders(frame)]


def known_lines(frame: GearFrame) -> list[Known]:
    """Return everything that the residual may hold: gears, bearings, and bearings about the mesh harmonics."""
    bearings = _bearing_orders(frame)
    mesh = [(k * frame.teeth[0] + s * o, slip) for k in range(1, 7) for o, slip in bearings[:24] for s in (-1, 1)]
    return [*known_modulation(frame), *mesh]


def _bearing_orders(frame: GearFrame) -> list[Known]:
    """Return the orders of every bearing's families with their sidebands; what rolls may slip."""
    found = []
    for bearing in frame.bearings:
        shaft = frame.shaft_orders[bearing.side]
        for order, side in (
            (bearing.outer, 0.0),
            (bearing.inner, shaft),
            (2.0 * bearing.spin, bearing.cage),
            (bearing.cage, 0.0),
        ):
            if np.isfinite(order):
                sidebands = (-1, 0, 1) if side else (0,)
                found += [(k * order + j * side, SLIP * k * order) for k in range(1, N_FAMILY + 1) for j in sidebands]
    return found
