"""Which bearing, race or strange order: lines that no shaft repeats, in envelopes and in the residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.cyclic import LOWEST_STRANGE, N_FAMILY, N_SHAFT_FAMILY, RACES, SLIP, envelope_ratios, residual_ratios
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.hum import N_HARMONICS, SUPPLIES_HZ
from gearsig.gap.spots import Comparison, Spot, band_words, by_decibels, hertz, shaft_words
from gearsig.gap.types import PlaceKind

RACE_WORDS = {"outer": "outer race", "inner": "inner race", "ball": "rolling elements", "cage": "cage"}
A_FAMILY_IS_HEARD = 0.6
"""A family's rise over that of the strongest line, from which on the line is taken for one of the family's."""
LEAST_OF_A_FAMILY_DB = 3.0
FEWEST_OF_A_FAMILY = 3
"""Lines free of the shafts' orders, of the four."""
UPWARDS, N_SLIPS = 0.005, 41
"""Rolling elements lag behind; only the contact angle brings an outer race's order up a little."""
HIGHEST_MULTIPLE, MISSED = 12, 0.004
MOST_OF_A_BAND = 0.5
"""Of a band's new power in one line: it is a tone, not noise."""
_SUPPLY_WANDERS = 0.004
_LINE_WIDTH = 3


@dataclass(frozen=True)
class Levels:
    """Lines over their floor, in dB and not below 0, of both sides of a comparison.

    Parameters
    ----------
    now, other : arrays, (n_rows, n_lines)
        On the same orders.
    step : float
        Orders from line to line.
    taken : array, (n_lines,)
        Which lie at a multiple of a shaft's order: what the averages left over.
    """

    now: FloatArray
    other: FloatArray
    step: float
    taken: NDArray[np.bool_]


@dataclass(frozen=True)
class _Found:
    words: str
    rise_db: float
    orders: tuple[float, ...]
    row: int


def envelope_spot(comparison: Comparison) -> Spot:
    """Return whose order modulates what no shaft repeats."""
    now, names = comparison.now, tuple(comparison.now.channels)
    both = [np.concatenate([envelope_ratios(g, g.channels[name]) for name in names]) for g in (now, comparison.other)]
    levels = _levels(comparison, both, now.cycle_step, comparison.other.cycle_step)
    levels, sign = _upwards(levels, comparison.size[comparison.strongest("envelope.")])
    found = _told_apart(_best_race(comparison, levels), _strongest(comparison, levels, fundamental=True))
    found = max(found, *_shafts(comparison, levels), key=lambda one: one.rise_db)
    bands = now.bands_hz * len(names)
    change = sign * found.rise_db
    title = f"envelope lines {found.words}, {by_decibels(change)} in {band_words(bands[found.row])}"
    channel = names[found.row // len(now.bands_hz)]
    return Spot(title, change, found.orders, bands[found.row], channel=channel)


def line_spot(comparison: Comparison) -> Spot:
    """Return which line of the residual changed most: the supply's, a bearing's, or a strange one."""
    strongest = comparison.strongest("line.outer", "line.inner", "line.ball", "line.cage", "line.strange", "hum")
    levels, sign = _upwards(_residual_levels(comparison), comparison.size[strongest])
    line = _strongest(comparison, levels, fundamental=False)
    if strongest == "hum" or (_is_the_supplys(comparison, line.orders[0]) and comparison.size["hum"] > 1.0):
        return _hum(comparison)
    return _line(comparison, _told_apart(_best_race(comparison, levels), line), sign)


def line_within(comparison: Comparison, band_hz: tuple[float, float], change_db: float) -> Spot | None:
    """Return the line that makes up most of what a band of the residual has more; None where it is noise."""
    if change_db <= 0:
        return None
    now = comparison.now
    powers = [
        np.stack([g.channels[name].residual_power.mean(axis=0) for name in now.channels])
        for g in (now, comparison.other)
    ]
    orders = np.arange(powers[0].shape[1]) * now.order_step
    within = (orders * now.speed_hz >= band_hz[0]) & (orders * now.speed_hz <= band_hz[1])
    row, peak = (int(i) for i in np.unravel_index(int(np.argmax(np.where(within, powers[0], 0.0))), powers[0].shape))
    line = powers[0][row, max(peak - _LINE_WIDTH, 0) : peak + _LINE_WIDTH + 1].sum()
    old = np.arange(powers[1].shape[1]) * comparison.other.order_step * now.speed_hz
    before = powers[1][row, (old >= band_hz[0]) & (old <= band_hz[1])].sum()
    if line < MOST_OF_A_BAND * max(float(powers[0][row, within].sum() - before), 1e-300):
        return None
    order = float(orders[peak])
    levels = _residual_levels(comparison)
    rise = float((levels.now - levels.other)[row, min(peak, len(levels.taken) - 1)])
    words = _strange_words(comparison, order)
    return replace(_line(comparison, _Found(words, rise, (order,), row), 1.0), kind=PlaceKind.LINE)


def _line(comparison: Comparison, found: _Found, sign: float) -> Spot:
    change = sign * found.rise_db
    title = f"line {found.words} ({hertz(found.orders[0] * comparison.now.speed_hz)}), {by_decibels(change)}"
    return Spot(title, change, found.orders, channel=list(comparison.now.channels)[found.row])


def _residual_levels(comparison: Comparison) -> Levels:
    now, other = comparison.now, comparison.other
    both = [residual_ratios(g, [g.channels[name] for name in now.channels]) for g in (now, other)]
    return _levels(comparison, both, now.order_step, other.order_step)


def _levels(comparison: Comparison, ratios: list[FloatArray], step: float, other_step: float) -> Levels:
    now, other = (10.0 * np.log10(np.maximum(rows, 1.0)) for rows in ratios)
    orders = np.arange(min(now.shape[1], int(other.shape[1] * other_step / step))) * step
    before = _widened(other)
    shafts = np.array(comparison.now.frame.shaft_orders)[:, None]
    away = np.abs(orders / shafts - np.rint(orders / shafts)) * shafts
    return Levels(
        now[:, : len(orders)],
        np.stack([np.interp(orders, np.arange(other.shape[1]) * other_step, row) for row in before]),
        step,
        (away < 1.5 * step).any(axis=0) | (orders < LOWEST_STRANGE),
    )


def _upwards(levels: Levels, size: float) -> tuple[Levels, float]:
    """Return the comparison the other way round, and −1, where it went down."""
    if size >= 0:
        return levels, 1.0
    return replace(levels, now=levels.other, other=_widened(levels.now)), -1.0


def _widened(levels: FloatArray) -> FloatArray:
    """Return each line's largest neighbour, so that a line that moved by one counts as the same."""
    from scipy.ndimage import maximum_filter1d

    widened: FloatArray = maximum_filter1d(levels, 3, axis=1)
    return widened


def _told_apart(family: _Found, line: _Found) -> _Found:
    """Return the family if it is heard beside the strongest line, or that line is one of its multiples."""
    harmonic = family.orders[0] / line.orders[0] if family.orders else 0.0
    if family.rise_db < LEAST_OF_A_FAMILY_DB or (harmonic > 1.5 and abs(harmonic / round(harmonic) - 1.0) < MISSED):
        return line  # of a lower line's harmonics, the family has but some
    multiple = line.orders[0] / family.orders[0]
    is_one = round(multiple) in range(1, HIGHEST_MULTIPLE + 1) and abs(multiple / round(multiple) - 1.0) < MISSED
    return family if is_one or family.rise_db > A_FAMILY_IS_HEARD * line.rise_db else line


def _best_race(comparison: Comparison, levels: Levels) -> _Found:
    """Return the bearing's family whose lines rose most."""
    found = [_Found("", 0.0, (), 0)]
    now, other = _widened(levels.now), levels.other
    for bearing in comparison.now.frame.bearings:
        for kind, (attribute, factor) in RACES.items():
            order = getattr(bearing, attribute) * factor
            if np.isfinite(order):
                rise, row, slipped = _family_rise(now - other, order, levels)
                words = f"of the {RACE_WORDS[kind]} of {_bearing(bearing.name)} (order {slipped:.3g})"
                found.append(_Found(words, rise, _multiples(slipped, N_FAMILY), row))
    return max(found, key=lambda one: one.rise_db)


def _bearing(name: str) -> str:
    return name if "bearing" in name.lower() else f"bearing {name}"


def _family_rise(rise: FloatArray, order: float, levels: Levels) -> tuple[float, int, float]:
    """Return the second smallest rise among a family's lines, its row, and the order with slip.

    One strange line that falls on a harmonic makes no family; one harmonic that is missing does not spoil it.
    """
    slips = order * (1.0 + np.linspace(-SLIP, UPWARDS, N_SLIPS))
    lines = np.rint(np.outer(slips, np.arange(1, N_FAMILY + 1)) / levels.step).astype(np.intp)
    inside = lines < rise.shape[1]
    lines = np.minimum(lines, rise.shape[1] - 1)
    free = inside & ~levels.taken[lines]
    values = np.where(free, rise[:, lines], np.inf)  # (row, slip, harmonic)
    second = np.sort(values, axis=2)[:, :, 1]
    second = np.where(free.sum(axis=1) >= FEWEST_OF_A_FAMILY, second, -np.inf)
    # Of slips that are as good, the one whose lines are strongest in all.
    mean = np.where(free, rise[:, lines], 0.0).mean(axis=2)
    row, best = np.unravel_index(int(np.argmax(second + 1e-3 * mean)), second.shape)
    return float(max(second[row, best], 0.0)), int(row), float(slips[best])


def _shafts(comparison: Comparison, levels: Levels) -> list[_Found]:
    """Return the shafts' families, where the features say that they changed."""
    found, rise = [], _widened(levels.now) - levels.other
    for side, order in enumerate(comparison.now.frame.shaft_orders):
        lines = np.rint(order * np.arange(1, N_SHAFT_FAMILY + 1) / levels.step).astype(np.intp)
        means = rise[:, lines[lines < rise.shape[1]]].mean(axis=1)
        felt = abs(comparison.size[f"envelope.{SIDES[side]}_shaft"]) > 1.0
        words = f"at multiples of {shaft_words(comparison.now.frame, side)}"
        found.append(_Found(words, float(means.max()) if felt else 0.0, _multiples(order, 3), int(np.argmax(means))))
    return found


def _multiples(order: float, n: int) -> tuple[float, ...]:
    return tuple(float(k * order) for k in range(1, n + 1))


def _strongest(comparison: Comparison, levels: Levels, *, fundamental: bool) -> _Found:
    """Return the line that rose most of those at no multiple of a shaft's order."""
    rise = np.where(levels.taken, -np.inf, levels.now - levels.other)
    row, line = (int(i) for i in np.unravel_index(int(np.argmax(rise)), rise.shape))
    change = float(rise[row, line])
    if fundamental:
        line = _fundamental(levels.now[row], line)
    order = line * levels.step
    return _Found(_strange_words(comparison, order), change, (order,), row)


def _strange_words(comparison: Comparison, order: float) -> str:
    """Return whose order it is by itself, without a family of multiples."""
    for bearing in comparison.now.frame.bearings:
        for kind, (attribute, factor) in RACES.items():
            if -SLIP < order / (getattr(bearing, attribute) * factor) - 1.0 < UPWARDS:
                return f"at order {order:.4g}, that of the {RACE_WORDS[kind]} of {_bearing(bearing.name)}"
    nor = "and no bearing" if comparison.now.frame.bearings else "(the rig names no bearing)"
    return f"at order {order:.4g}, which belongs to no shaft {nor}"


def _fundamental(level: FloatArray, line: int) -> int:
    """Return the line of which this one is a harmonic, where there is one half as high in dB."""
    for divisor in range(HIGHEST_MULTIPLE, 1, -1):
        first = max(round(line / divisor) - 1, 1)
        lower = first + int(np.argmax(level[first : first + 3]))
        if lower > 4 and level[lower] > 0.5 * level[line]:
            return lower
    return line


def _is_the_supplys(comparison: Comparison, order: float) -> bool:
    speed_hz = comparison.now.speed_hz
    lines = np.array([k * supply for supply in SUPPLIES_HZ for k in range(1, N_HARMONICS + 1)])
    width = np.maximum(_SUPPLY_WANDERS * lines, comparison.now.order_step * speed_hz)
    return bool((np.abs(order * speed_hz - lines) < width).any())


def _hum(comparison: Comparison) -> Spot:
    now = comparison.now
    supply = SUPPLIES_HZ[int(np.argmax(now.hum))]
    change = comparison.change_db["hum"]
    orders = tuple(k * supply / now.speed_hz for k in range(1, N_HARMONICS + 1))
    return Spot(f"mains hum at {supply:g} Hz and multiples, {by_decibels(change)}", change, orders)
