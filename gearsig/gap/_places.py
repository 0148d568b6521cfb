"""Where a recording differs from its baseline, place by place, each with its share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.formatting import named
from gearsig.gap._change import (
    difference_residuals,
    lines_of_shaft,
    turned_difference,
)
from gearsig.gap._conditions import Condition
from gearsig.gap._evidence import feature_text
from gearsig.gap._features import (
    LOWEST_STRANGE,
    MAX_SHAFT_ORDERS,
    N_FAMILY,
    N_SHAFT_FAMILY,
    N_SIDEBAND_HARMONICS,
    SLIP,
    Feature,
    envelope_ratios,
    residual_ratios,
    tooth_energy,
)
from gearsig.gap._floors import Family, family_members, family_size
from gearsig.gap._reduction import DRIVER, N_MAINS_HARMONICS, N_MESH_HARMONICS, GearFrame, ReducedRecording, shaft_text
from gearsig.gap._report import GapPlace, PlaceKind, scaled
from gearsig.gap._simulator import GapEffect
from gearsig.prepared import MAINS_TOLERANCE
from gearsig.recording import MAINS_HZ
from gearsig.rig import SIDES
from gearsig.severity import ShaftLines, find_event, load_calibration

# --------------------
# Order of a gap's places: what stands out by itself, then by share, last what only follows from others.
# --------------------


SAME_ORDER = 0.02
"""Relative tolerance within which orders belong to the same family of lines, however they were found."""


def ranked_places(places: Sequence[GapPlace], unexpected: Sequence[GapPlace] = ()) -> tuple[GapPlace, ...]:
    """Return the places in the order in which someone at the machine should read them.

    Families of impacts that stand out by themselves come first: no tolerance of a simulator produces them. A place of
    the gap at the same order belongs to the same family and passes its sizes on to it. The other places follow, largest
    share first. Those that merely follow from other places, and so give no hint where to look, come last.

    Parameters
    ----------
    places : sequence of GapPlace
        Places of the gap, with sizes and shares.
    unexpected : sequence of GapPlace
        Places found without a simulation, most certain first.
    """
    remaining, first = list(places), []
    for family in unexpected:
        same = [place for place in remaining if _same_family(place, family)]
        first.append(_joined(family, same))
        remaining = [place for place in remaining if place not in same]
    return (*first, *sorted(remaining, key=_rank))


def _rank(place: GapPlace) -> tuple[bool, float]:
    return place.follows, -(place.structural if place.follows else place.share)


def _same_family(place: GapPlace, unexpected: GapPlace) -> bool:
    """Whether a place is a line, of the residual or an envelope, at the family's order."""
    if place.kind not in (PlaceKind.ENVELOPE, PlaceKind.LINE) or not place.orders:
        return False
    return abs(place.orders[0] / unexpected.orders[0] - 1.0) < SAME_ORDER


def _joined(unexpected: GapPlace, same: Sequence[GapPlace]) -> GapPlace:
    """Return an unexpected place with the sizes of the largest place of the same family and the sum of their shares."""
    if not same:
        return unexpected
    largest = max(same, key=lambda place: place.share)
    share = sum(place.share for place in same)
    return replace(unexpected, repeatability=largest.repeatability, structural=largest.structural, share=share)


# --------------------
# Evidence from the lines of races and shafts for or against causes.
# --------------------


RACES = {"bearing_outer_race": "outer", "bearing_inner_race": "inner"}
"""Effect → the race whose order it shows at, see `BearingFrame`, and whose family of lines it raises."""

MISSED_RACE = 0.2
"""Probability that a damaged race shows without raising its own lines: like `MISSED_FAULT`, for bearings alone."""


def with_unchanged_races_lowered(
    probabilities: Mapping[str, float], conditions: Sequence[Condition]
) -> dict[str, float]:
    """Lower the probabilities of races whose lines rose in none of the recordings.

    Balls that roll over a spall produce lines at the race's order. A tooth that strikes once per revolution produces
    lines at all multiples of its shaft's order in the same bands. Some of them fall within a race's slip, so the
    features of all bearings rise with them. A race without lines of its own is multiplied by `MISSED_RACE`; then all
    probabilities are scaled to add up to 1.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    conditions : sequence of Condition
        Of one rig.
    """
    silent = set(RACES).intersection(*(_silent_races(condition) for condition in conditions))
    return scaled({name: p * (MISSED_RACE if name in silent else 1.0) for name, p in probabilities.items()})


MULTIPLES_OF_ONE = 0.2
"""Probability that multiples of a shaft's order accompany a force rotating with it, due to unevenly stiff supports."""

CLEAR_MULTIPLE, STRONG_MULTIPLE = 2.0, 0.1
"""Floors from which a multiple has clearly risen; power relative to the first order from which it is no by-product."""


def without_multiples(
    probabilities: Mapping[str, float], effects: Mapping[str, GapEffect], conditions: Sequence[Condition]
) -> dict[str, float]:
    """Lower the probabilities of forces that rotate with a shaft where its multiples rose as well.

    An unbalance raises the first order only. Where the second or third order of the same shaft rose clearly and is
    strong relative to the first, the probability is multiplied by `MULTIPLES_OF_ONE`; then all are scaled to add up to
    1.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    effects : mapping
        Effect → its `GapEffect`, which states whether it is such a force.
    conditions : sequence of Condition
        Of one rig.
    """
    if not any(_multiples_rose(condition) for condition in conditions):
        return dict(probabilities)
    turning = {name for name, effect in effects.items() if effect.turns_with_shaft}
    return scaled({name: p * (MULTIPLES_OF_ONE if name in turning else 1.0) for name, p in probabilities.items()})


def _multiples_rose(condition: Condition) -> bool:
    side = max(SIDES, key=lambda side: condition.over_floors[f"shaft.{side}.1"])
    averages = condition.now.averages(SIDES.index(side))
    power = np.mean([np.abs(average.lines[:4]) ** 2 for average in averages], axis=0)
    return any(
        condition.over_floors[f"shaft.{side}.{k}"] >= CLEAR_MULTIPLE and power[k] >= STRONG_MULTIPLE * power[1]
        for k in (2, 3)
    )


def _silent_races(condition: Condition) -> set[str]:
    """Return the effects whose race has no lines that rose, in an envelope by more than the shafts' own.

    Nothing can be said of a race that the rig file does not describe.
    """
    envelope, residual = _envelope_levels(condition), _residual_levels(condition)
    of_shafts = max(family.rise_db for family in _shafts(condition, envelope))
    floors = ((envelope, max(MIN_OF_A_FAMILY_DB, of_shafts)), (residual, MIN_OF_A_FAMILY_DB))
    rises = [(_widened(levels.now) - levels.baseline, levels, floor) for levels, floor in floors]
    silent = set()
    for effect, kind in RACES.items():
        orders = [bearing.families[kind] for bearing in condition.now.frame.bearings]
        known = [order for order in orders if np.isfinite(order)]
        heard = any(_family_rise(rise, o, levels)[0] >= floor for o in known for rise, levels, floor in rises)
        if known and not heard:
            silent.add(effect)
    return silent


# --------------------
# The exact place within one family of features; sizes are added later.
# --------------------


def by_decibels(change_db: float) -> str:
    """Return "up by 14 dB" or "down by 3 dB"."""
    return f"{'up' if change_db >= 0 else 'down'} by {abs(change_db):.2g} dB"


def hertz(frequency_hz: float) -> str:
    """Return "850 Hz" or "2.1 kHz"."""
    return f"{frequency_hz / 1e3:.2g} kHz" if frequency_hz >= 999.5 else f"{frequency_hz:.3g} Hz"


def band_text(band_hz: tuple[float, float]) -> str:
    """Return "300 Hz to 2.1 kHz"."""
    low, high = (hertz(edge) for edge in band_hz)
    if low[-3:] == high[-3:]:
        low = low.rpartition(" ")[0]
    return f"{low} to {high}"


# --------------------
# Bearing, race or unrelated order: lines at no multiple of a shaft's order, in envelopes and in the residual.
# --------------------


RACE_WORDS = {"outer": "outer race", "inner": "inner race", "ball": "rolling elements", "cage": "cage"}
MIN_SHARE_OF_A_FAMILY = 0.6
"""A family's rise relative to that of the strongest line, from which that line is taken to be one of the family's."""
MIN_OF_A_FAMILY_DB = 3.0
MIN_OF_A_FAMILY = 3
"""Number of the family's four lines that must be clear of the shafts' orders."""
UPWARDS, N_SLIPS = 0.005, 41
"""Upper limit of slip, and number of trials: rolling elements lag; only the contact angle raises an outer race's order
slightly."""
HIGHEST_MULTIPLE, MISSED = 12, 0.004
MAX_OF_A_BAND = 0.5
"""Fraction of a band's added power in one line above which it is a tone, not noise."""
_LINE_WIDTH = 3


@dataclass(frozen=True)
class LineLevels:
    """Line levels above their floor, in dB and at least 0, of a recording and of its baseline.

    Parameters
    ----------
    now, baseline : arrays, (n_rows, n_lines)
        Both on the same orders.
    step : float
        Spacing of the lines, in orders.
    taken : array, (n_lines,)
        Lines at a multiple of a shaft's order, where the averages leave a remainder.
    """

    now: FloatArray
    baseline: FloatArray
    step: float
    taken: NDArray[np.bool_]


@dataclass(frozen=True)
class _StrongestRise:
    words: str
    rise_db: float
    orders: tuple[float, ...]
    row: int


def locate_envelope(condition: Condition) -> GapPlace:
    """Return the place of the order that modulates the non-synchronous part of the signal."""
    now, names = condition.now, tuple(condition.now.channels)
    levels = _envelope_levels(condition)
    levels, sign = _with_rising_change(levels, condition.over_floors[condition.strongest("envelope.")])
    family = _family_or_line(_best_race(condition, levels), _strongest(condition, levels, fundamental=True))
    family = max(family, *_shafts(condition, levels), key=lambda candidate: candidate.rise_db)
    bands = now.bands_hz * len(names)
    change = sign * family.rise_db
    title = f"envelope lines {family.words}, {by_decibels(change)} in {band_text(bands[family.row])}"
    channel = names[family.row // len(now.bands_hz)]
    return GapPlace(PlaceKind.ENVELOPE, title, change, orders=family.orders, band_hz=bands[family.row], channel=channel)


def locate_line(condition: Condition) -> GapPlace:
    """Return the residual line that changed most: of the mains, of a bearing, or of unknown origin."""
    strongest = condition.strongest("line.outer", "line.inner", "line.ball", "line.cage", "line.strange", "hum")
    levels, sign = _with_rising_change(_residual_levels(condition), condition.over_floors[strongest])
    line = _strongest(condition, levels, fundamental=False)
    if strongest == "hum" or (_is_mains_order(condition, line.orders[0]) and condition.over_floors["hum"] > 1.0):
        return _hum(condition)
    return _line(condition, _family_or_line(_best_race(condition, levels), line), sign)


def line_within(condition: Condition, band_hz: tuple[float, float], change_db: float) -> GapPlace | None:
    """Return the line that makes up most of a band's added residual power; None where it is noise."""
    if change_db <= 0:
        return None
    now = condition.now
    powers = [
        np.stack([g.channels[name].residual_power.mean(axis=0) for name in now.channels])
        for g in (now, condition.baseline)
    ]
    orders = np.arange(powers[0].shape[1]) * now.order_step
    within = (orders * now.speed_hz >= band_hz[0]) & (orders * now.speed_hz <= band_hz[1])
    row, peak = (int(i) for i in np.unravel_index(int(np.argmax(np.where(within, powers[0], 0.0))), powers[0].shape))
    line = powers[0][row, max(peak - _LINE_WIDTH, 0) : peak + _LINE_WIDTH + 1].sum()
    old = np.arange(powers[1].shape[1]) * condition.baseline.order_step * now.speed_hz
    before = powers[1][row, (old >= band_hz[0]) & (old <= band_hz[1])].sum()
    if line < MAX_OF_A_BAND * max(float(powers[0][row, within].sum() - before), 1e-300):
        return None
    order = float(orders[peak])
    levels = _residual_levels(condition)
    rise = float((levels.now - levels.baseline)[row, min(peak, len(levels.taken) - 1)])
    place = _line(condition, _StrongestRise(_named_order_text(condition, order), rise, (order,), row), 1.0)
    # Mesh components that swell and fade are missing from the averages, but still belong to the gears.
    is_of_the_mesh = _mesh_harmonic(condition, order) is not None
    return replace(place, kind=PlaceKind.BAND, band_hz=band_hz) if is_of_the_mesh else place


def _line(condition: Condition, line: _StrongestRise, sign: float) -> GapPlace:
    change = sign * line.rise_db
    title = f"line {line.words} ({hertz(line.orders[0] * condition.now.speed_hz)}), {by_decibels(change)}"
    return GapPlace(PlaceKind.LINE, title, change, orders=line.orders, channel=list(condition.now.channels)[line.row])


def _envelope_levels(condition: Condition) -> LineLevels:
    now, before = condition.now, condition.baseline
    ratios = [np.concatenate([envelope_ratios(g, g.channels[name]) for name in now.channels]) for g in (now, before)]
    return _levels(condition, ratios, now.cycle_step, before.cycle_step)


def _residual_levels(condition: Condition) -> LineLevels:
    now, before = condition.now, condition.baseline
    ratios = [residual_ratios(g, [g.channels[name] for name in now.channels]) for g in (now, before)]
    return _levels(condition, ratios, now.order_step, before.order_step)


def _levels(condition: Condition, ratios: list[FloatArray], step: float, step_before: float) -> LineLevels:
    now, before_db = (10.0 * np.log10(np.maximum(rows, 1.0)) for rows in ratios)
    orders = np.arange(min(now.shape[1], int(before_db.shape[1] * step_before / step))) * step
    before = _widened(before_db)
    shafts = np.array(condition.now.frame.shaft_orders)[:, None]
    away = np.abs(orders / shafts - np.rint(orders / shafts)) * shafts
    return LineLevels(
        now[:, : len(orders)],
        np.stack([np.interp(orders, np.arange(before_db.shape[1]) * step_before, row) for row in before]),
        step,
        (away < 1.5 * step).any(axis=0) | (orders < LOWEST_STRANGE),
    )


def _with_rising_change(levels: LineLevels, size: float) -> tuple[LineLevels, float]:
    """Return the comparison reversed, and −1, where the level went down."""
    if size >= 0:
        return levels, 1.0
    return replace(levels, now=levels.baseline, baseline=_widened(levels.now)), -1.0


def _widened(levels: FloatArray) -> FloatArray:
    """Return the maximum over each line and its neighbours, so that a line that moved by one bin counts as the same."""
    from scipy.ndimage import maximum_filter1d

    widened: FloatArray = maximum_filter1d(levels, 3, axis=1)
    return widened


def _family_or_line(family: _StrongestRise, line: _StrongestRise) -> _StrongestRise:
    """Return the family if it is strong enough beside the strongest line, or if that line is one of its multiples."""
    harmonic = family.orders[0] / line.orders[0] if family.orders else 0.0
    if family.rise_db < MIN_OF_A_FAMILY_DB or (harmonic > 1.5 and abs(harmonic / round(harmonic) - 1.0) < MISSED):
        return line  # the family is only some of a lower line's harmonics
    multiple = line.orders[0] / family.orders[0]
    is_multiple = round(multiple) in range(1, HIGHEST_MULTIPLE + 1) and abs(multiple / round(multiple) - 1.0) < MISSED
    return family if is_multiple or family.rise_db > MIN_SHARE_OF_A_FAMILY * line.rise_db else line


def _best_race(condition: Condition, levels: LineLevels) -> _StrongestRise:
    """Return the bearing family whose lines rose most."""
    races = [_StrongestRise("", 0.0, (), 0)]
    now, baseline = _widened(levels.now), levels.baseline
    for bearing in condition.now.frame.bearings:
        for kind, order in bearing.families.items():
            if np.isfinite(order):
                rise, row, slipped = _family_rise(now - baseline, order, levels)
                words = f"of the {RACE_WORDS[kind]} of {named('bearing', bearing.name)} (order {slipped:.3g})"
                races.append(_StrongestRise(words, rise, _multiples(slipped, N_FAMILY), row))
    return max(races, key=lambda family: family.rise_db)


def _family_rise(rise: FloatArray, order: float, levels: LineLevels) -> tuple[float, int, float]:
    """Return the second smallest rise among a family's lines, its row, and the order including slip.

    A single unrelated line that falls on a harmonic does not make a family; a single missing harmonic does not break
    one.
    """
    slips = order * (1.0 + np.linspace(-SLIP, UPWARDS, N_SLIPS))
    lines = np.rint(np.outer(slips, np.arange(1, N_FAMILY + 1)) / levels.step).astype(np.intp)
    inside = lines < rise.shape[1]
    lines = np.minimum(lines, rise.shape[1] - 1)
    free = inside & ~levels.taken[lines]
    values = np.where(free, rise[:, lines], np.inf)  # (row, slip, harmonic)
    second = np.sort(values, axis=2)[:, :, 1]
    second = np.where(free.sum(axis=1) >= MIN_OF_A_FAMILY, second, -np.inf)
    # Of equally good slips, take the one whose lines are strongest on average.
    mean = np.where(free, rise[:, lines], 0.0).mean(axis=2)
    row, best = np.unravel_index(int(np.argmax(second + 1e-3 * mean)), second.shape)
    return float(max(second[row, best], 0.0)), int(row), float(slips[best])


def _shafts(condition: Condition, levels: LineLevels) -> list[_StrongestRise]:
    """Return the shafts' families, with a rise of 0 dB where their features did not change."""
    families, rise = [], _widened(levels.now) - levels.baseline
    for side, order in enumerate(condition.now.frame.shaft_orders):
        lines = np.rint(order * np.arange(1, N_SHAFT_FAMILY + 1) / levels.step).astype(np.intp)
        means = rise[:, lines[lines < rise.shape[1]]].mean(axis=1)
        felt = abs(condition.over_floors[f"envelope.{SIDES[side]}_shaft"]) > 1.0
        words = f"at multiples of {shaft_text(condition.now.frame, side)}"
        families.append(
            _StrongestRise(words, float(means.max()) if felt else 0.0, _multiples(order, 3), int(np.argmax(means)))
        )
    return families


def _multiples(order: float, n: int) -> tuple[float, ...]:
    return tuple(float(k * order) for k in range(1, n + 1))


def _strongest(condition: Condition, levels: LineLevels, *, fundamental: bool) -> _StrongestRise:
    """Return the line that rose most, among those at no multiple of a shaft's order."""
    rise = np.where(levels.taken, -np.inf, levels.now - levels.baseline)
    row, line = (int(i) for i in np.unravel_index(int(np.argmax(rise)), rise.shape))
    change = float(rise[row, line])
    if fundamental:
        line = _fundamental(levels.now[row], line)
    order = line * levels.step
    return _StrongestRise(_named_order_text(condition, order), change, (order,), row)


def _mesh_harmonic(condition: Condition, order: float) -> int | None:
    """Return the number of the mesh harmonic at an order, None if there is none."""
    mesh = condition.now.frame.teeth[DRIVER]
    k = max(round(order / mesh), 1)
    return k if abs(order - k * mesh) <= 1.5 * condition.now.order_step else None


def _named_order_text(condition: Condition, order: float) -> str:
    """Return the words that say to what a single order belongs, apart from any family of multiples."""
    frame, step = condition.now.frame, 1.5 * condition.now.order_step
    if (k := _mesh_harmonic(condition, order)) is not None:
        return f"at order {order:.4g}, {'that' if k == 1 else f'{k} times that'} of the mesh"
    for side, turns in enumerate(frame.shaft_orders):
        if abs(order - max(round(order / turns), 1) * turns) <= min(step, 0.1 * turns):
            return f"at order {order:.4g}, a multiple of {shaft_text(frame, side)}"
    for bearing in condition.now.frame.bearings:
        for kind, of_family in bearing.families.items():
            if -SLIP < order / of_family - 1.0 < UPWARDS:
                return f"at order {order:.4g}, that of the {RACE_WORDS[kind]} of {named('bearing', bearing.name)}"
    nor = "and no bearing" if condition.now.frame.bearings else "(the rig names no bearing)"
    return f"at order {order:.4g}, which belongs to no shaft {nor}"


def _fundamental(level: FloatArray, line: int) -> int:
    """Return the line of which this one is a harmonic, where one has at least half its level in dB."""
    for divisor in range(HIGHEST_MULTIPLE, 1, -1):
        first = max(round(line / divisor) - 1, 1)
        lower = first + int(np.argmax(level[first : first + 3]))
        if lower > 4 and level[lower] > 0.5 * level[line]:
            return lower
    return line


def _is_mains_order(condition: Condition, order: float) -> bool:
    speed_hz = condition.now.speed_hz
    lines = np.array([k * supply for supply in MAINS_HZ for k in range(1, N_MAINS_HARMONICS + 1)])
    # Twice the variation of a supply, since the order was found on a grid of lines at a mean speed.
    width = np.maximum(2.0 * MAINS_TOLERANCE * lines, condition.now.order_step * speed_hz)
    return bool((np.abs(order * speed_hz - lines) < width).any())


def _hum(condition: Condition) -> GapPlace:
    now = condition.now
    supply = MAINS_HZ[int(np.argmax(now.hum))]
    change = condition.change_db["hum"]
    orders = tuple(k * supply / now.speed_hz for k in range(1, N_MAINS_HARMONICS + 1))
    return GapPlace(
        PlaceKind.LINE, f"mains hum at {supply:g} Hz and multiples, {by_decibels(change)}", change, orders=orders
    )


# --------------------
# Which mesh harmonic, sideband or shaft order changed most: line by line in the synchronous averages.
# --------------------


FURTHEST_SIDEBAND = 12
WORTH_NAMING = 0.25
"""Fraction of the largest change in power below which a change is not named, however large its ratio."""
MAX_ORDERS = 6
MIN_CHANGE_DB = 1.0
"""Minimum change of a sideband or shaft order; where features show more, it is noise."""
EXPLAINED = 0.5
"""Fraction of the largest change in power that a shaft's own lines must account for."""


def locate_mesh(condition: Condition) -> GapPlace | None:
    """Return the mesh harmonic that changed most."""
    frame = condition.now.frame
    if condition.strongest("mesh", "line.half_mesh") in ("mesh.half", "line.half_mesh"):
        half = condition.change_db[condition.strongest("mesh.half", "line.half_mesh")]
        return GapPlace(
            PlaceKind.MESH, f"half the mesh order, {by_decibels(half)}", half, orders=(frame.teeth[0] / 2.0,)
        )
    lines_of_both = _lines_of_both(condition, DRIVER, relative=not condition.has_reference)
    lines = [
        k * frame.teeth[0]
        for k in range(1, N_MESH_HARMONICS + 1)
        if k * frame.teeth[0] < lines_of_both[0].power.shape[1]
    ]
    strongest = _strongest_group(*lines_of_both, [[line] for line in lines])
    if strongest is None:
        return None
    row, best, change = strongest
    if abs(change) < MIN_CHANGE_DB:  # hardly any change: a ratio of harmonics or sensors was scored
        scored = condition.strongest("mesh.", "alike.")
        change = condition.change_db[scored]
        title = f"{feature_text(scored, frame)}, {by_decibels(change)}"
        if scored.startswith("alike."):
            title = "orders around the mesh harmonics, which themselves hardly changed"
        return GapPlace(PlaceKind.MESH, title, change, orders=_harmonic_order(scored, frame))
    total = condition.change_db["mesh.total"]
    alike = condition.has_reference and abs(total) > 0.7 * abs(change) and total * change > 0
    every = f"mesh harmonics, together {by_decibels(total)}, " if alike else "mesh harmonics, "
    title = f"{every}most at {_times(best + 1)}mesh ({by_decibels(change)})"
    if not condition.has_reference:
        title += " against the other harmonics"
    return GapPlace(PlaceKind.MESH, title, change, orders=(float(lines[best]),), channel=_channel(condition, row))


def _harmonic_order(feature: str, frame: GearFrame) -> tuple[float, ...]:
    """Return the order of the mesh harmonic that a feature describes; empty if it describes all of them."""
    harmonic = Feature.of(feature).detail.rpartition(".")[2]
    return (float(int(harmonic) * frame.teeth[DRIVER]),) if harmonic.isdigit() else ()


def locate_sidebands(condition: Condition, side: int) -> GapPlace | None:
    """Return the mesh harmonic around which a shaft's sidebands changed most, and the orders of these sidebands."""
    now, before = _lines_of_both(condition, side, relative=not condition.has_reference)
    frame = condition.now.frame
    teeth, n = frame.teeth[side], now.power.shape[1]
    reach = min(FURTHEST_SIDEBAND, teeth // 2)
    groups = [
        [k * teeth + offset for offset in range(-reach, reach + 1) if offset and k * teeth + offset < n]
        for k in range(1, N_SIDEBAND_HARMONICS + 1)
        if k * teeth + 1 < n
    ]
    strongest = _strongest_group(now, before, groups)
    if strongest is None or abs(strongest[2]) < MIN_CHANGE_DB:
        return None
    row, best, change = strongest
    lines = _largest_lines(now.synchronous[row] - before.synchronous[row], groups[best])
    title = f"sidebands of {shaft_text(frame, side)} about {_times(best + 1)}mesh, {by_decibels(change)}"
    carrier = (best + 1) * teeth
    title += _spacing_text([abs(line - carrier) for line in lines])
    orders = tuple(float(line * frame.shaft_orders[side]) for line in lines)
    return GapPlace(PlaceKind.SIDEBANDS, title, change, orders=orders, channel=_channel(condition, row))


def locate_shaft(condition: Condition, side: int) -> GapPlace | None:
    """Return the low order of a shaft that changed most."""
    lines_of_both = _lines_of_both(condition, side, relative=False)
    frame = condition.now.frame
    last = min(MAX_SHAFT_ORDERS, frame.teeth[side] - 3, lines_of_both[0].power.shape[1] - 1)
    scored = Feature.of(condition.strongest(f"shaft.{SIDES[side]}"))
    first = scored.detail.partition(".")[0]  # the order, or "strongest" or "low"
    groups = [[int(first)]] if first.isdigit() else [[order] for order in range(1, last + 1)]
    strongest = _strongest_group(*lines_of_both, groups)
    if strongest is None or abs(strongest[2]) < MIN_CHANGE_DB:
        return None
    row, best, change = strongest
    order = groups[best][0]
    title = f"order {order} of {shaft_text(frame, side)}, {by_decibels(change)}"
    change_order = (order * frame.shaft_orders[side],)
    return GapPlace(PlaceKind.SHAFT, title, change, orders=change_order, channel=_channel(condition, row))


@dataclass(frozen=True)
class _Lines:
    """Powers of the lines of a shaft's average, (n_channels, n_orders): total, synchronous, and assumed noise."""

    power: FloatArray
    synchronous: FloatArray
    floor: FloatArray

    def first(self, n: int) -> _Lines:
        return _Lines(self.power[:, :n], self.synchronous[:, :n], self.floor[:, :n])

    def of_groups(self, groups: Sequence[list[int]]) -> _Lines:
        """Return the sums over groups of lines, (n_channels, n_groups)."""
        sums = [
            np.stack([values[:, group].sum(axis=1) for group in groups], axis=1)
            for values in (self.power, self.synchronous, self.floor)
        ]
        return _Lines(*sums)


def _lines_of_both(condition: Condition, side: int, *, relative: bool) -> tuple[_Lines, _Lines]:
    """Return the lines of recording and baseline on the same orders; `relative` to each channel's mesh harmonics."""
    names = tuple(condition.now.channels)
    now, before = (_lines(run, names, side, relative=relative) for run in (condition.now, condition.baseline))
    n = min(now.power.shape[1], before.power.shape[1])
    return now.first(n), before.first(n)


def _lines(reduced: ReducedRecording, names: Sequence[str], side: int, *, relative: bool) -> _Lines:
    averages = [reduced.average(name, side) for name in names]
    n, rows = averages[0].highest + 1, []
    for average in averages:
        synchronous = np.where(average.is_synchronous, average.excess, 0.0)
        scale = average.mesh_power if relative else 1.0
        rows.append([values[:n] / scale for values in (average.power, synchronous, average.power - average.excess)])
    return _Lines(*(np.stack(values) for values in zip(*rows, strict=True)))


def _strongest_group(now: _Lines, before: _Lines, groups: Sequence[list[int]]) -> tuple[int, int, float] | None:
    """Return channel, group and change in dB of the largest ratio among the groups whose power changed substantially.

    Each channel is judged by its own largest change, since a sensor with a small gain sees the same. The shaft's own
    lines must account for the change; None where it is noise or leaks into the average.
    """
    now_sums, before_sums = now.of_groups(groups), before.of_groups(groups)
    floor = np.maximum(np.maximum(now_sums.floor, before_sums.floor), 1e-300)
    ratio = 10.0 * np.log10((now_sums.synchronous + floor) / (before_sums.synchronous + floor))
    moved, whole = np.abs(now_sums.synchronous - before_sums.synchronous), np.abs(now_sums.power - before_sums.power)
    explained = moved.max(axis=1, keepdims=True) >= EXPLAINED * whole.max(axis=1, keepdims=True)
    enough = (moved > 0.0) & (moved >= WORTH_NAMING * moved.max(axis=1, keepdims=True)) & explained
    if not enough.any():
        return None
    row, best = np.unravel_index(int(np.argmax(np.where(enough, np.abs(ratio), -1.0))), ratio.shape)
    return int(row), int(best), float(ratio[row, best])


def _largest_lines(moved: FloatArray, lines: list[int]) -> list[int]:
    """Return the lines of one group whose power changed most, largest first."""
    amounts = np.abs(moved[lines])
    order = np.argsort(amounts)[::-1][:MAX_ORDERS]
    return [lines[i] for i in order if amounts[i] >= WORTH_NAMING * amounts.max()]


def _spacing_text(offsets: list[int]) -> str:
    if max(offsets) <= 2:
        return ", nearest lines only" if max(offsets) == 1 else ", nearest two lines"
    return f", up to {max(offsets)} orders away"


def _times(harmonic: int) -> str:
    return "" if harmonic == 1 else f"{harmonic} × "


def _channel(condition: Condition, row: int) -> str:
    return list(condition.now.channels)[row]


# --------------------
# Places in the bands, in the speed and in the amplitudes.
# --------------------


MIN_SPEED_CHANGE = 3e-4
"""Relative; a smaller variation counts as constant speed."""
CLIPPED_SHARE = 1e-3
"""Share of samples within half a percent of the extreme; in a vibration with random peaks it is about 1e-5."""


def locate_band(condition: Condition) -> GapPlace:
    """Return the band of the residual that changed most, in level or in kurtosis."""
    name = condition.strongest("floor.band", "floor.kurtosis")
    kind, _, number = Feature.of(name).detail.partition(".")
    band = condition.now.bands_hz[int(number) - 1]
    change = condition.change_db[name]
    tone = line_within(condition, band, change) if kind == "band" else None
    if tone is not None:
        return tone
    quantity = "noise" if kind == "band" else "kurtosis of the noise"
    title = f"{quantity} between {band_text(band).replace(' to ', ' and ')}, {by_decibels(change)}"
    channel = _most_changed_channel(condition, int(number) - 1, kurtosis=kind != "band")
    return GapPlace(PlaceKind.BAND, title, change, band_hz=band, channel=channel, follows=kind != "band")


def _most_changed_channel(condition: Condition, band: int, *, kurtosis: bool) -> str:
    """Return the channel on which the band changed most."""

    def change(name: str) -> float:
        band_moments = [g.channels[name].moments.mean(axis=0)[band] for g in (condition.now, condition.baseline)]
        figures = [fourth / max(square**2, 1e-300) if kurtosis else square for square, fourth in band_moments]
        return abs(float(np.log(max(figures[0], 1e-300) / max(figures[1], 1e-300))))

    return max(condition.now.channels, key=change)


def locate_speed(condition: Condition) -> GapPlace | None:
    """Return how the speed varies differently; None where it hardly varies."""
    name = condition.strongest("speed.")
    change = condition.change_db[name]
    drift, swing, _, frequency_hz = condition.now.speed
    if max(abs(drift), swing, *(abs(figure) for figure in condition.baseline.speed[:2])) < MIN_SPEED_CHANGE:
        return None
    if name == "speed.drift":
        return GapPlace(PlaceKind.SPEED, f"speed drifts by {100 * drift:.2g} % along the record", change)
    title = f"speed swings by {100 * swing:.2g} % rms, most at {frequency_hz:.2g} Hz"
    return GapPlace(PlaceKind.SPEED, title, change, orders=(frequency_hz / condition.now.speed_hz,))


def locate_tail(condition: Condition) -> GapPlace:
    """Return how the distribution of amplitudes differs."""
    name = condition.strongest("raw.near", "raw.kurtosis")
    change = condition.change_db[name]
    channel = max(condition.now.channels, key=lambda c: float(condition.now.channels[c].tail[:, 2].mean()))
    if name == "raw.near_the_extreme":
        piled = float(condition.now.channels[channel].tail[:, 2].mean()) > CLIPPED_SHARE
        clipping = ", as clipping causes them" if change > 0 and piled else ""
        title = f"samples close to the largest amplitude{clipping}, {by_decibels(change)}"
        return GapPlace(PlaceKind.TAIL, title, change, channel=channel, follows=not clipping)
    tails = "heavier" if change > 0 else "lighter"
    title = f"{tails} tails of the amplitudes (kurtosis {by_decibels(change)})"
    return GapPlace(PlaceKind.TAIL, title, change, channel=channel, follows=True)


# --------------------
# Angle and tooth at which a shaft's average changed: energy tooth by tooth.
# --------------------


STANDS_OUT = 6.0
"""Energy within one pitch relative to the median pitch, from which a single tooth is named; where all teeth differ by
chance, the largest reaches about 5."""

ALL_ROUND = (".level", ".elsewhere", ".peak")
"""Endings of the names of features that measure the size of a pattern, not its shape."""

MIN_SYNCHRONOUS_SHARE = 0.3
"""Fraction of a pattern's power in the shaft's own lines, below which it is no pattern of teeth."""


@dataclass(frozen=True)
class ToothPattern:
    """Energy over a shaft's angle of the component in which its teeth differ.

    Parameters
    ----------
    energy : array, (n_channels, n)
        Mean square within one pitch, relative to the power of the mesh harmonics.
    lines : ShaftLines
        The lines it was computed from.
    synchronous_share : float
        Fraction of its power in lines that keep their phase from block to block.
    """

    energy: FloatArray
    lines: ShaftLines
    synchronous_share: float

    @property
    def prominence(self) -> float:
        """Largest energy over the median energy, mean over channels."""
        mean = self.energy.mean(axis=0)
        return float(mean.max() / max(float(np.median(mean)), 1e-300))

    @property
    def place_rev(self) -> float:
        """Position, 0 to 1, at which the prominent tooth engages; the response follows a little later."""
        centre = find_event(self.lines).centre_rev
        return (centre - load_calibration().lag_pitches / self.lines.teeth) % 1.0


def pattern_of_recording(reduced: ReducedRecording, side: int) -> ToothPattern:
    """Return the pattern of a recording by itself."""
    residuals = [average.pattern for average in reduced.averages(side)]
    return _pattern(reduced, side, residuals, lines_of_shaft(reduced, side))


def changed_pattern(now: ReducedRecording, healthy: ReducedRecording, side: int) -> ToothPattern:
    """Return the pattern of the difference from a healthy recording, rotated so that the same teeth coincide."""
    turned, _ = turned_difference(now, healthy, side)
    return _pattern(now, side, difference_residuals(now, turned, side), turned)


def _pattern(
    reduced: ReducedRecording, side: int, residuals: Sequence[NDArray[np.complex128]], lines: ShaftLines
) -> ToothPattern:
    powers = [np.abs(residual) ** 2 for residual in residuals]
    held = [average.is_synchronous for average in reduced.averages(side)]
    synchronous = sum(float(power[synchronous].sum()) for power, synchronous in zip(powers, held, strict=True))
    whole = sum(float(power.sum()) for power in powers)
    energy = np.stack([tooth_energy(residual, lines.teeth) for residual in residuals])
    return ToothPattern(energy, lines, synchronous / max(whole, 1e-300))


def locate_tooth(condition: Condition, side: int) -> GapPlace | None:
    """Return the angle and tooth that stands out, or that the teeth's pattern changed all round.

    None where most of the pattern is noise or leaks into the average.
    """
    frame, now = condition.now.frame, condition.now
    pattern = (
        changed_pattern(now, condition.baseline, side) if condition.has_reference else pattern_of_recording(now, side)
    )
    shaft, name = shaft_text(frame, side), list(now.channels)[int(np.argmax(pattern.energy.max(axis=1)))]
    if pattern.synchronous_share < MIN_SYNCHRONOUS_SHARE:
        return None
    if pattern.prominence < STANDS_OUT:
        return distributed_place(condition, side, shaft, name)
    place, teeth = pattern.place_rev, frame.teeth[side]
    above, angle = 10.0 * float(np.log10(pattern.prominence)), 360.0 * place
    tooth = int(place * teeth) % teeth + 1 if now.marks[side] else None
    at = f"tooth {tooth} ({angle:.0f}°)" if tooth else f"one tooth (at {angle:.0f}°; no mark)"
    title = f"burst once per revolution at {at} of {shaft}, {above:.2g} dB above the other teeth"
    return GapPlace(PlaceKind.TOOTH, title, above, angle_deg=angle, tooth=tooth, channel=name)


def distributed_place(condition: Condition, side: int, shaft: str, channel: str) -> GapPlace:
    """Return the place where no single tooth stands out, with the change of the feature that was scored."""
    scored = condition.strongest(*(f"{kind}.{SIDES[side]}." for kind in ("tooth", "change", "surprise")))
    level = f"tooth.{SIDES[side]}.level"
    if not scored.endswith(ALL_ROUND) and abs(condition.over_floors[level]) > 1.0:
        scored = level
    change = condition.change_db[scored]
    if not scored.endswith(ALL_ROUND):
        title = f"shape of the tooth pattern of {shaft}, no tooth in particular"
        return GapPlace(PlaceKind.TOOTH, title, change, channel=channel, follows=True)
    of_difference = not scored.startswith("tooth.")
    by = f"{by_decibels(change)} relative to changes of healthy machines" if of_difference else by_decibels(change)
    subject = "change in the tooth pattern" if of_difference else "tooth pattern"
    return GapPlace(PlaceKind.TOOTH, f"{subject} of {shaft} all round, {by}", change, channel=channel)


MIN_SHARE = 0.01

REPEATING = ("floor.to_signal", "floor.total", "raw.level")
"""Features that only repeat what others say about a place."""


def gap_places(condition: Condition) -> tuple[GapPlace, ...]:
    """Return where a recording differs, largest share first, and last what only follows from other places.

    A place is a family of features. Its size s_f is their mean of high order over the floors, and its share max(s_f² −
    1, 0)/Σ max(s² − 1, 0). A family that does not exceed the larger floor has no share. One that only follows from
    other places has none either (nan) and is not in the sum. Shares add up to less than 1 where some of the change is
    only noise and leakage, or below 1 % of the whole.

    Parameters
    ----------
    condition : Condition

    Raises
    ------
    RefusalError
        If the reference was taken at a different speed.
    """
    names, now = condition.change.names, condition.now
    distances, ratios = (np.array([*by_name.values()]) for by_name in (condition.change_db, condition.over_floors))
    members = {family: _located_rows(names, rows) for family, rows in family_members(names).items()}
    energies = {family: max(family_size(ratios[rows]) ** 2 - 1.0, 0.0) for family, rows in members.items()}
    min_energy = MIN_SHARE * sum(energies.values())
    spots = {family: _spot(condition, family) for family, energy in energies.items() if energy > min_energy}
    following = {family for family, spot in spots.items() if spot is not None and spot.follows}
    total = sum(energy for family, energy in energies.items() if family not in following)
    places = []
    for family, spot in spots.items():
        if spot is not None:
            sizes = [family_size(distances[members[family]] / floor[members[family]]) for floor in condition.floors]
            share = float("nan") if family in following else energies[family] / total
            shaft = now.frame.shafts[SIDES.index(family[1])] if family[1] else ""
            places.append(replace(spot, structural=sizes[0], repeatability=sizes[1], share=share, shaft=shaft))
    return ranked_places(_merged(places))


def _merged(places: list[GapPlace]) -> list[GapPlace]:
    """Return the places, with those that two families of features lead to merged into one."""
    merged: dict[tuple[PlaceKind, str, bool], GapPlace] = {}
    for place in sorted(places, key=lambda duplicate: -duplicate.structural):
        key = (place.kind, place.shaft, place.follows)
        if key in merged:
            merged[key] = replace(merged[key], share=merged[key].share + place.share)
        else:
            merged[key] = place
    return list(merged.values())


def _located_rows(names: tuple[str, ...], rows: np.ndarray) -> np.ndarray:
    kept = [row for row in rows if names[row] not in REPEATING and not names[row].startswith(("apart.", "burst."))]
    return np.array(kept, dtype=np.intp)


def _spot(condition: Condition, family: Family) -> GapPlace | None:
    kind, shaft = family
    of_a_shaft = {PlaceKind.SIDEBANDS: locate_sidebands, PlaceKind.SHAFT: locate_shaft, PlaceKind.TOOTH: locate_tooth}
    plain = {
        PlaceKind.MESH: locate_mesh,
        PlaceKind.ENVELOPE: locate_envelope,
        PlaceKind.LINE: locate_line,
        PlaceKind.BAND: locate_band,
        PlaceKind.SPEED: locate_speed,
        PlaceKind.TAIL: locate_tail,
    }
    return of_a_shaft[kind](condition, SIDES.index(shaft)) if kind in of_a_shaft else plain[kind](condition)
