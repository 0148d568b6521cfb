"""Which bearing, race or strange order: lines that no shaft repeats, in envelopes and in the residual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.cyclic import (
    LOWEST_STRANGE,
    N_FAMILY,
    N_SHAFT_FAMILY,
    RACES,
    SLIP,
    bearing_orders,
    best_of_family,
    envelope_ratios,
    excesses,
    free_lines,
    gear_orders,
    line_orders,
    residual_ratios,
)
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.hum import N_HARMONICS, SUPPLIES_HZ
from gearsig.gap.spots import Comparison, Spot, band_words, by_decibels, hertz, shaft_words

RACE_WORDS = {"outer": "outer race", "inner": "inner race", "ball": "rolling elements", "cage": "cage"}
A_FAMILY_IS_HEARD = 0.5
"""A family's mean line over the strongest strange line, from which on the strange one is taken for the family's."""
LEAST_OF_A_FAMILY_DB = 3.0
_SUPPLY_WANDERS = 0.004


@dataclass(frozen=True)
class Levels:
    """Lines over their floor, in dB, of both sides of a comparison.

    Parameters
    ----------
    now, other : arrays, (n_rows, n_lines)
    step, other_step : float
    channels : tuple of str
        Of each row.
    bands_hz : tuple
        Of each row; empty for the residual itself.
    known : tuple of float
        Orders that belong to something.
    """

    now: FloatArray
    other: FloatArray
    step: float
    other_step: float
    channels: tuple[str, ...]
    bands_hz: tuple[tuple[float, float], ...]
    known: tuple[float, ...]

    def swapped(self) -> Levels:
        """Return the comparison the other way round, for what went down."""
        return Levels(self.other, self.now, self.other_step, self.step, self.channels, self.bands_hz, self.known)


@dataclass(frozen=True)
class _Line:
    words: str
    change_db: float
    orders: tuple[float, ...]
    row: int


def envelope_spot(comparison: Comparison) -> Spot:
    """Return whose order modulates what no shaft repeats."""
    frame = comparison.now.frame
    rows = [name for name in comparison.now.channels for _ in comparison.now.bands_hz]
    levels = Levels(
        _envelopes(comparison.now, comparison.now),
        _envelopes(comparison.other, comparison.now),
        comparison.now.cycle_step,
        comparison.other.cycle_step,
        tuple(rows),
        comparison.now.bands_hz * len(comparison.now.channels),
        (*gear_orders(frame), *bearing_orders(frame)),
    )
    strongest = comparison.strongest("envelope.")
    down = comparison.size[strongest] < 0
    used = levels.swapped() if down else levels
    families = [_best_race(comparison, used, N_FAMILY), *_shafts(comparison, used)]
    found = _told_apart(max(families, key=lambda line: line.change_db), _strange(used, fundamental=True))
    change = -found.change_db if down else found.change_db
    band = used.bands_hz[found.row]
    title = f"envelope lines {found.words}, {by_decibels(change)} in {band_words(band)}"
    return Spot(title, change, found.orders, band, channel=used.channels[found.row])


def line_spot(comparison: Comparison) -> Spot:
    """Return which line of the residual changed most: the supply's, a bearing's, or a strange one."""
    now, other = comparison.now, comparison.other
    levels = Levels(
        _residuals(now, now),
        _residuals(other, now),
        now.order_step,
        other.order_step,
        tuple(now.channels),
        (),
        tuple(line_orders(now.frame)),
    )
    strongest = comparison.strongest("line.outer", "line.inner", "line.ball", "line.cage", "line.strange", "hum")
    down = comparison.size[strongest] < 0
    used = levels.swapped() if down else levels
    strange = _strange(used, fundamental=False)
    supply_hz = _supply(strange.orders[0] * now.speed_hz)
    if strongest == "hum" or (supply_hz and comparison.size.get("hum", 0.0) > 1.0):
        return _hum(comparison)
    found = _told_apart(_best_race(comparison, used, N_FAMILY), strange)
    change = -found.change_db if down else found.change_db
    title = f"line {found.words} ({hertz(found.orders[0] * now.speed_hz)}), {by_decibels(change)}"
    return Spot(title, change, found.orders, channel=used.channels[found.row])


def _envelopes(gathered: Gathered, like: Gathered) -> FloatArray:
    return excesses(np.concatenate([envelope_ratios(gathered, gathered.channels[name]) for name in like.channels]))


def _residuals(gathered: Gathered, like: Gathered) -> FloatArray:
    return excesses(residual_ratios(gathered, [gathered.channels[name] for name in like.channels]))


def _told_apart(family: _Line, strange: _Line) -> _Line:
    """Return the family if it is heard beside the strongest strange line, which may be its fifth harmonic."""
    heard = family.change_db > max(LEAST_OF_A_FAMILY_DB, A_FAMILY_IS_HEARD * strange.change_db)
    return family if heard else strange


def _best_race(comparison: Comparison, levels: Levels, n_harmonics: int) -> _Line:
    """Return the bearing's family whose lines rose most."""
    frame, found = comparison.now.frame, [_Line("", 0.0, (), 0)]
    known = gear_orders(frame)
    for bearing in frame.bearings:
        for kind, (attribute, factor) in RACES.items():
            order = getattr(bearing, attribute) * factor
            if not np.isfinite(order):
                continue
            score, row, slipped = best_of_family(levels.now, order, n_harmonics, levels.step, known, SLIP)
            before = best_of_family(levels.other, order, n_harmonics, levels.other_step, known, SLIP)[0]
            words = f"of the {RACE_WORDS[kind]} of bearing {bearing.name} (order {slipped:.3g})"
            found.append(_Line(words, score - before, _multiples(slipped, n_harmonics), row))
    return max(found, key=lambda line: line.change_db)


def _shafts(comparison: Comparison, levels: Levels) -> list[_Line]:
    found = []
    for side, order in enumerate(comparison.now.frame.shaft_orders):
        score, row, _ = best_of_family(levels.now, order, N_SHAFT_FAMILY, levels.step, (), 0.0)
        before = best_of_family(levels.other, order, N_SHAFT_FAMILY, levels.other_step, (), 0.0)[0]
        words = f"at multiples of {shaft_words(comparison.now.frame, side)}"
        # Told only where the features say so: the family is six lines, and any knock once per revolution makes it.
        felt = comparison.size.get(f"envelope.{SIDES[side]}_shaft", 0.0)
        found.append(_Line(words, score - before if abs(felt) > 1.0 else 0.0, _multiples(order, 3), row))
    return found


def _multiples(order: float, n: int) -> tuple[float, ...]:
    return tuple(float(k * order) for k in range(1, n + 1))


def _strange(levels: Levels, *, fundamental: bool) -> _Line:
    """Return the line that rose most of those that belong to nothing known."""
    n = levels.now.shape[1]
    orders = np.arange(n) * levels.step
    before = np.stack([np.interp(orders, np.arange(len(row)) * levels.other_step, row) for row in levels.other])
    rise = levels.now - before
    free = free_lines(n, levels.step, levels.known, first=LOWEST_STRANGE)
    rise = np.where(free, rise, -np.inf)
    row, best = (int(i) for i in np.unravel_index(int(np.argmax(rise)), rise.shape))
    best = _middle(levels.now[row], best)
    change = float(rise[row, best])
    if fundamental:
        best = _fundamental(levels.now[row], best)
    order = best * levels.step
    return _Line(f"at order {order:.4g}, which belongs to no shaft and no bearing", change, (float(order),), row)


def _middle(level: FloatArray, place: int) -> int:
    """Return the middle of the equal maxima that a line and its neighbours make."""
    same = [i for i in range(max(place - 2, 0), min(place + 3, len(level))) if level[i] == level[place]]
    return same[len(same) // 2]


def _fundamental(level: FloatArray, place: int) -> int:
    """Return the line of which this one is a harmonic, where there is one half as high in dB."""
    for divisor in (5, 4, 3, 2):
        lower = round(place / divisor)
        if lower > 4 and level[lower] > 0.5 * level[place]:
            return lower
    return place


def _supply(frequency_hz: float) -> float:
    """Return the supply's frequency of which this is a harmonic, or 0."""
    for supply in SUPPLIES_HZ:
        for k in range(1, N_HARMONICS + 1):
            if abs(frequency_hz / (k * supply) - 1.0) < _SUPPLY_WANDERS:
                return supply
    return 0.0


def _hum(comparison: Comparison) -> Spot:
    now = comparison.now
    supply = SUPPLIES_HZ[int(np.argmax(now.hum))]
    change = comparison.change_db["hum"]
    orders = tuple(k * supply / now.speed_hz for k in range(1, N_HARMONICS + 1))
    return Spot(f"mains hum at {supply:g} Hz and multiples, {by_decibels(change)}", change, orders)
