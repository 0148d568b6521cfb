"""Modulation depth of a mesh by a shaft, from two-sided sidebands that stand out and belong to nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from math import gcd, log10

import numpy as np

from gearsig.diagnosis._bearing_families import expected_parts, slip_of
from gearsig.diagnosis._lines import CLEAR_DB, mesh_is_confirmed, teeth_are_contradicted
from gearsig.diagnosis._signals import AnalysisSignals, line_at
from gearsig.diagnosis._types import WITH_ASSUMED_DATA, Finding, Kind, Strength, from_p_value, p_text
from gearsig.formatting import signed
from gearsig.indicators import lobe_lines
from gearsig.prepared import (
    INNER_LINES,
    RUN_UP_FOOT_ORDERS,
    Comb,
    LinesOverFloor,
    best_comb,
    lines_over_floor,
    neighbour_level,
    neighbour_levels,
)
from gearsig.rig import GearPair, hunting_tooth_order
from gearsig.spectra import Spectrum

STRONG_DB = -10.0
"""Power of sidebands over carrier: amplitude modulation of 45 %, or of a third with some phase modulation."""

NOTABLE_DB = -16.0
"""An amplitude modulation of 22 %: worth a look, common on healthy machines."""

N_CARRIERS = 3
MAX_TIMES = 8
"""Largest number of modulations per revolution sought: planets, jaws of couplings, bolts."""

MIRROR_RATIO = 10.0
"""Power over the mirror image above which a line may be another machine's."""

APART_LINES = 3.0

TRAIN_SKIRT = 5e-4
"""Relative width, as a bearing's slip varies."""

Cells = dict[tuple[int, int], tuple[float, float]]
"""(mesh harmonic, k) → power of the lower and of the upper sideband."""


@dataclass(frozen=True)
class Modulation:
    """The modulation of a mesh in one channel.

    Parameters
    ----------
    times : int
        Modulations per revolution of the shaft.
    spacing : float
        Of the sidebands, in orders of the reference shaft.
    level_db : float
        Power of the first two sidebands on each side over that of the mesh harmonics; if none stand out, the level that
        noise would hide.
    """

    times: int
    spacing: float
    level_db: float


def mesh_modulation(signals: AnalysisSignals, pair: GearPair, shaft: str) -> dict[str, Modulation]:
    """Return the modulation of `pair` by `shaft` for the channels in which a notable one would show.

    Empty if the orders are unknown, or no sideband is distinguishable from its carrier or from other lines.
    """
    mesh, order = signals.rig.mesh_order(pair), signals.rig.ratio(shaft)
    if mesh is None or order is None:
        return {}
    others = [other for name, other in signals.known_shaft_orders.items() if name != shaft]
    # Places of other elements' lines: of the meshes, and the first of the other shafts themselves.
    foreign = [h * other for other in {mesh, *signals.known_mesh_orders.values()} for h in range(1, 11)]
    foreign += [k * other for other in others for k in range(1, 4)]
    by_channel = {}
    for name, excess in signals.order_excess.items():
        if order < sideband_distance(excess.spectrum, RUN_UP_FOOT_ORDERS if signals.speed_varies else 0.0):
            continue
        near = APART_LINES * excess.spectrum.resolution
        multiples = tuple(  # a smaller multiple of another shaft would be the simpler cause
            k
            for k in range(1, MAX_TIMES + 1)
            if not any(abs(k * order - j * other) <= near for other in others for j in range(1, k))
        )
        modulation = modulation_of(excess, mesh, order, tuple(foreign), multiples)
        if modulation is not None:
            by_channel[name] = modulation
    return by_channel


def sideband_distance(spectrum: Spectrum, foot: float = 0.0) -> float:
    """Return the smallest spacing at which a sideband separates from its carrier, clear of both main lobes."""
    return max(foot, (2 * lobe_lines(spectrum) + 1) * spectrum.resolution)


def modulation_of(
    excess: LinesOverFloor, mesh: float, order: float, foreign: tuple[float, ...], multiples: tuple[int, ...]
) -> Modulation | None:
    """Return the modulation of a mesh by a shaft, None if noise would hide a notable one.

    Parameters
    ----------
    excess : LinesOverFloor
    mesh, order : float
        Of the mesh and of the shaft.
    foreign : tuple of float
        Orders of other elements; sidebands that coincide with them are not counted.
    multiples : tuple of int
        k for which lines at k·order from the mesh belong to this shaft.
    """
    cells: Cells = {}
    carriers: dict[int, float] = {}
    floor = 0.0
    near = APART_LINES * excess.spectrum.resolution
    for h in range(1, N_CARRIERS + 1):
        if h * mesh + 2 * order > excess.spectrum.positions[-1]:
            break
        carriers[h] = _power(excess, h * mesh)
        floor = max(floor, _floor_power(excess, h * mesh))
        for k in multiples:
            places = [h * mesh - k * order, h * mesh + k * order]
            free = all(abs(place - other) > near for place in places for other in foreign)
            if free and places[0] > near and places[1] <= excess.spectrum.positions[-1]:
                cells[h, k] = (_sideband(excess, places[0], order), _sideband(excess, places[1], order))
    if not any(carriers.values()) or not cells:
        return None
    return _summed(_without_one_foreign_line(cells, carriers), order, sum(carriers.values()), floor)


def _summed(cells: Cells, order: float, carriers: float, floor: float) -> Modulation | None:
    power = {k: sum(sum(cell) for (_, number), cell in cells.items() if number == k) for k in range(1, MAX_TIMES + 1)}
    total = sum(power.values())
    # The level a pair needs in order to count: below it, "not modulated" and "hidden" are the same.
    hidden_db = 10 * log10(max(2 * 10 ** (CLEAR_DB / 10) * floor / (carriers + total), 1e-30))
    if hidden_db >= NOTABLE_DB:
        return None
    times = _times_per_revolution(power)
    explained = {times, 2 * times}
    if not any(min(cell) > 0 for (_, k), cell in cells.items() if k in explained):
        return Modulation(1, order, hidden_db)
    level = 10 * log10(sum(power.get(k, 0.0) for k in explained) / carriers)
    return Modulation(times, times * order, max(level, hidden_db))


def _times_per_revolution(power: dict[int, float]) -> int:
    """Return the largest k whose multiples hold 90 % of the sidebands' power."""
    total = sum(power.values())
    for k in range(MAX_TIMES, 1, -1):
        if total > 0 and sum(p for own, p in power.items() if own % k == 0) >= 0.9 * total:
            return k
    return 1


def _without_one_foreign_line(cells: Cells, carriers: dict[int, float]) -> Cells:
    """Remove the strongest lines beside one carrier that have no counterpart, as one tone of another machine causes.

    Amplitude and phase modulation together also make one side larger than the other, but at several harmonics.
    """
    lone: dict[tuple[int, int], float] = {}
    for (h, k), cell in cells.items():
        for side in (0, 1):
            if cell[side] > MIRROR_RATIO * cell[1 - side] and not _comes_again(cells, carriers, h, k, side):
                lone[h, side] = lone.get((h, side), 0.0) + cell[side]
    if not lone:
        return cells
    cut_h, side = max(lone, key=lambda key: lone[key])
    return {
        (h, k): (cell[1 - side],) * 2 if h == cut_h and cell[side] > MIRROR_RATIO * cell[1 - side] else cell
        for (h, k), cell in cells.items()
    }


def _comes_again(cells: Cells, carriers: dict[int, float], h: int, k: int, side: int) -> bool:
    """Whether the same sideband of another harmonic has a similar size relative to its carrier."""
    size = cells[h, k][side] / MIRROR_RATIO
    return any(
        cell[side] * carriers[h] >= size * carriers[own_h] > 0
        for (own_h, own_k), cell in cells.items()
        if own_k == k and own_h != h
    )


def _sideband(excess: LinesOverFloor, place: float, order: float) -> float:
    """Return the power of a sideband, 0 if no line stands out from the floor and from its neighbours."""
    apart = order / excess.spectrum.resolution
    line = line_at(excess, place, around=min(6.0, apart / 2) * excess.spectrum.resolution)
    if line is None or not line.is_highest:
        return 0.0  # a sideband is the highest line around; the foot of its carrier is not
    beside = neighbour_level(excess.spectrum, line.position, apart - INNER_LINES)
    if beside is not None and line.amplitude < beside * 10 ** (CLEAR_DB / 20):
        return 0.0
    return _power(excess, place)


def _power(excess: LinesOverFloor, place: float) -> float:
    """Return the power of the line at `place` minus what noise adds to it, 0 if it is not clear of the floor.

    Noise adds the expected maximum of the four lines there: 1 + 1/2 + 1/3 + 1/4 of their mean. Clear of the floor is a
    level that noise exceeds in four lines once in two million.
    """
    line, floor = line_at(excess, place), _floor_power(excess, place)
    if line is None or line.amplitude**2 <= floor * 10 ** (CLEAR_DB / 10):
        return 0.0
    return line.amplitude**2 - 2.0 * floor


def _floor_power(excess: LinesOverFloor, place: float) -> float:
    return float(excess.floor[excess.spectrum.index_of(place)]) ** 2


def detect_sidebands(signals: AnalysisSignals, trains: Sequence[float] = ()) -> list[Finding]:
    """Report strong modulation by known shafts, and sideband families of shafts missing from the rig.

    Parameters
    ----------
    signals : AnalysisSignals
    trains : sequence of float
        Orders of impacts in the envelopes, whose sidebands are no shaft's.
    """
    findings: list[Finding] = []
    for pair in signals.rig.pairs:
        if not mesh_is_confirmed(signals, pair) or teeth_are_contradicted(signals, pair) is not None:
            continue  # without a carrier there are no sidebands
        for shaft in (pair.driver, pair.driven):
            by_channel = mesh_modulation(signals, pair, shaft)
            median = float(np.median([m.level_db for m in by_channel.values()])) if by_channel else -np.inf
            if median >= NOTABLE_DB:
                findings.append(_modulated(signals, pair, shaft, by_channel, median))
        findings += _unknown_family(signals, pair, trains)
    return findings


def _modulated(
    signals: AnalysisSignals, pair: GearPair, shaft: str, by_channel: dict[str, Modulation], median: float
) -> Finding:
    rig = signals.rig
    channel = max(by_channel, key=lambda name: by_channel[name].level_db)
    strongest = by_channel[channel]
    n = strongest.times
    times = {1: "once", 2: "twice"}.get(n, f"{n} times")
    how = "strongly modulated" if median >= STRONG_DB else "modulated"
    basis = "how much modulation is usual depends on the machine and the sensor's place"
    evidence = [
        f"Sidebands against mesh harmonics: {signed(median)} dB (median), {signed(strongest.level_db)} dB in {channel}."
    ]
    if n <= 2:
        evidence.append("An eccentric gear, a bent shaft, misalignment and a fluctuating load all do this.")
    else:
        evidence.append(f"{n} planets that pass, a coupling of {n} jaws or a gear clamped out of round all do this.")
    driver, driven = rig.ratio(pair.driver), rig.ratio(pair.driven)
    if driver is not None and driver == driven:
        twins = f"Shafts {pair.driver} and {pair.driven} turn equally fast"
        evidence.append(f"{twins}: which of them it is cannot be told.")
    value, limit = 10 ** (median / 20), 10 ** (NOTABLE_DB / 20)
    surer = "Compare with a recording of the same gearbox known to be healthy, or look for it at another load."
    return Finding(
        "mesh-modulated",
        Kind.NOTICE,  # what is usual differs by machine: only one whose reference lacks it is suspected, see `_change`
        f"The mesh of {pair.name} is {how} {times} per revolution of shaft {shaft}.",
        # A ratio between lines has no frequency.
        replace(signals.where(strongest.spacing, channel, shaft=shaft, gear=f"{pair.name}/{shaft}"), frequency_hz=None),
        Strength(value, "of the carrier", limit, "common on healthy machines", median - NOTABLE_DB),
        confidence=0.95 * (WITH_ASSUMED_DATA if rig.assumed else 1.0),
        confidence_basis=f"that it is there; {basis}",
        evidence=tuple(evidence),
        surer="Look for it at another load." if signals.has_reference else surer,
    )


def _unknown_family(signals: AnalysisSignals, pair: GearPair, trains: Sequence[float]) -> Iterator[Finding]:
    """Yield sidebands whose spacing is no known shaft's: a gear without stated teeth shows in this way."""
    mesh = signals.rig.mesh_order(pair)
    if mesh is None:
        return
    combs = {name: _family(signals, excess, pair, trains) for name, excess in signals.order_excess.items()}
    found_combs = {name: comb for name, comb in combs.items() if comb is not None}
    channel = min(found_combs, key=lambda name: found_combs[name].p_value, default=None)
    if channel is None:
        return
    comb, excess = found_combs[channel], signals.order_excess[channel]
    p_value = min(1.0, comb.p_value * len(combs))
    shafts = signals.known_shaft_orders.values()
    # The spacing may be a known shaft's after all: skirts of its lines, if the speed is not known exactly.
    is_known = any(abs(k * order / comb.fundamental - 1) < 0.01 for order in shafts for k in (1, 2))
    hunting = hunting_tooth_order(signals.rig, pair)
    known = (*trains, hunting) if hunting is not None else trains
    is_known |= _is_part_of(comb.fundamental, known, excess.spectrum.resolution)
    if p_value > signals.settings.false_alarm_probability or is_known or not _is_family(comb, mesh):
        return
    evidence = [f"{len(comb.positions)} of the sidebands stand 6 dB or more over what lies beside them."]
    surer = "Give the teeth of all gears: a shaft of that order would explain it."
    teeth = mesh / comb.fundamental
    if None in (pair.driver_teeth, pair.driven_teeth) and abs(teeth - round(teeth)) <= 0.1:
        other_shaft = pair.driven if pair.driven_teeth is None else pair.driver
        evidence.append(f"A gear with {round(teeth)} teeth on shaft {other_shaft} would modulate the mesh this way.")
        surer = f"Count the teeth on shaft {other_shaft}; with them in the rig file that gear is examined as well."
    if signals.angle is not None and signals.angle.method == "pulses":
        # Pulses per revolution are wrong by factors up to 4: the marks of a coupling or a four-hole disc.
        wrong = [n for n in (2, 3, 4) if abs(comb.fundamental - 1 / n) <= excess.spectrum.resolution]
        of_speed = "of the speed found from the pulses: pulses_per_revolution may be wrong by"
        evidence += [f"The spacing is 1/{n} {of_speed} {n}." for n in wrong[:1]]
    where = signals.where(comb.fundamental, channel, gear=pair.name)
    ratio = max(comb.ratios_db, default=None)
    code, kind, which = "sidebands-of-unknown-shaft", Kind.NOTICE, "which no known shaft explains"
    miscounted = _miscounted(signals, pair, teeth)
    if miscounted is not None:
        shaft, counted = miscounted
        code, kind = "teeth-disagree", Kind.CANNOT_TELL
        which = f"as {round(teeth)} teeth on shaft {shaft} instead of {counted} would make: check the teeth"
        evidence.append(
            "The speed was found from the mesh by its teeth; a shaft that is not in the rig file may do it."
        )
        surer = f"Count the teeth on shaft {shaft}, or measure the speed."
    yield Finding(
        code,
        kind,
        f"The mesh of {pair.name} has sidebands spaced by order {comb.fundamental:.4f} of {where.order_shaft} "
        f"({signals.hertz_text(comb.fundamental, 4)}), {which}.",
        replace(where, frequency_hz=None),
        Strength(comb.amplitude, excess.spectrum.unit, comb.floor, "what lies beside it in the order spectrum", ratio),
        confidence=from_p_value(p_value, prior=0.3, limit=0.99),
        confidence_basis=f"chance that noise makes such a family: {p_text(p_value)}, over all spacings "
        "and channels tried",
        evidence=tuple(evidence),
        surer=surer,
    )


def _miscounted(signals: AnalysisSignals, pair: GearPair, teeth: float) -> tuple[str, int] | None:
    """Return the shaft and the stated teeth of the gear that really has `teeth`, None if there is none.

    A speed found from the mesh is wrong by the same factor as the teeth: the mesh stands where it should, and the
    sidebands of the miscounted gear's shaft a little beside their place. Within a tenth of the stated teeth, another
    shaft is less likely.
    """
    if signals.angle is None or signals.angle.method != "tachless" or abs(teeth - round(teeth)) > 0.05:
        return None
    for shaft, stated in ((pair.driver, pair.driver_teeth), (pair.driven, pair.driven_teeth)):
        if stated is not None and 0 < abs(round(teeth) - stated) <= 0.1 * stated:
            return shaft, stated
    return None


MOST_PARTS = 16


def _is_part_of(spacing: float, orders: Sequence[float], resolution: float) -> bool:
    """Whether a spacing is a fraction m/n of an order: two combs of lines then have common lines.

    A cage turns n times slower than its n elements pass a race. The multiple is as exact as the spacing, whose
    third multiples give it to a sixth of a line.
    """
    whole = [(m * order, round(m * order / spacing)) for order in orders for m in (1, 2, 3)]
    return any(1 <= n <= MOST_PARTS and abs(order - n * spacing) <= n * resolution / 6 for order, n in whole)


CLOSEST_LINES = 8.0
"""Spacing in lines below which a family leaves no lines between its own to stand out from."""

LARGEST_SPACING, SPACINGS = 1.9, 3
"""Widest spacing of sidebands that is sought, and their number on either side of the mesh."""


COMBINATIONS = ((1, 1), (1, 2), (2, 1), (1, 3), (2, 2), (3, 1))
"""j and k of the sidebands at j·a ± k·b of a mesh modulated by two shafts of orders a and b: its own shafts, or one of
them and the next, whose load is transmitted through the train."""


def _without_sidebands(
    excess: LinesOverFloor, mesh: float, distance: float, *, half_width: float = 0.0
) -> LinesOverFloor:
    """Return the lines without those at a given distance from any harmonic of a mesh, on either side."""
    above = excess.without_multiples(mesh, start=distance, half_width=half_width)
    return above.without_multiples(mesh, start=-distance, half_width=half_width)


def _without_combinations(signals: AnalysisSignals, excess: LinesOverFloor, mesh: float) -> LinesOverFloor:
    """Return the lines without the sidebands of a mesh that two shafts cause together.

    Products beyond `COMBINATIONS` are kept if they exceed one of their factors' own sidebands: depths are below 1, so
    no true product does.
    """
    for one, other in combinations(signals.known_shaft_orders.values(), 2):
        for j, k in COMBINATIONS:
            for distance in (j * one + k * other, j * one - k * other):
                excess = _without_sidebands(excess, mesh, distance)
    spectrum, masked, near = excess.spectrum, excess.masked.copy(), APART_LINES * excess.spectrum.resolution
    carriers = [h * mesh for h in range(1, N_CARRIERS + 1) if (h + 1) * mesh <= spectrum.positions[-1]]
    heights: dict[float, float] = {}
    for distance, factors in _products(signals, 4 * near):
        for factor in (f for f in factors if f not in heights):
            beside = (spectrum.largest_near(c + side * factor, near)[1] for c in carriers for side in (-1, 1))
            heights[factor] = max(beside, default=0.0)
        for place in (c + side * distance for c in carriers for side in (-1, 1)):
            lines = slice(spectrum.index_of(place - near), spectrum.index_of(place + near) + 1)
            if spectrum.values[lines].max() <= min(heights[factor] for factor in factors):
                masked[lines] = True
    return replace(excess, masked=masked)


def _products(signals: AnalysisSignals, closest: float) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield the distances from the mesh of sidebands of two shafts together, and those of their factors.

    Teeth that differ modulate by all multiples of their shaft's order, if these are not closer than `closest`; the
    other shaft modulates each of those by its first two multiples, as an eccentric or oval gear does. An angle found
    from the vibration at a few points per turn has images of what it follows.
    """
    shafts, farthest = tuple(signals.known_shaft_orders.values()), SPACINGS * LARGEST_SPACING
    for one, other in permutations((order for order in shafts if order >= closest), 2):
        for j in (1, 2):
            for k in range(1, int((farthest + j * one) / other) + 1):
                for distance in (abs(j * one - k * other), j * one + k * other):
                    if distance <= farthest:
                        yield distance, (j * one, k * other)
    for points in _knots(signals):
        for factor in (k * order for order in shafts for k in (1, 2)):
            yield abs(points - factor), (factor,)
            yield points + factor, (factor,)


def _knots(signals: AnalysisSignals) -> tuple[float, ...]:
    """Return at how many points per turn an angle found from the vibration is known; nothing for other angles."""
    angle = signals.angle
    if angle is None or angle.method != "tachless":
        return ()
    return ((len(angle.revolutions) - 1) / float(angle.revolutions[-1] - angle.revolutions[0]),)


def _family(signals: AnalysisSignals, excess: LinesOverFloor, pair: GearPair, trains: Sequence[float]) -> Comb | None:
    """Return the best family of sidebands of a pair's mesh that neither its shafts nor any other known cause explains.

    Its lines must stand out from their neighbours: the skirt of a mesh line is far above the noise floor, and any
    spacing fits lines of a skirt.
    """
    mesh, hunting = signals.rig.mesh_order(pair), hunting_tooth_order(signals.rig, pair)
    if mesh is None:
        return None
    beside = neighbour_levels(excess.spectrum, of_both_sides=True)
    excess = lines_over_floor(excess.spectrum, np.maximum(excess.floor, beside))
    foot = RUN_UP_FOOT_ORDERS if signals.speed_varies else 0.0
    for other in {mesh, *signals.known_mesh_orders.values()}:
        excess = excess.without_multiples(other, half_width=foot)
    for order in signals.known_shaft_orders.values():
        wide = foot if order >= 4 * foot else 0.0
        excess = excess.without_multiples(order, half_width=wide)
        excess = excess.without_multiples(order, start=mesh, half_width=wide)
    excess = _without_combinations(signals, excess, mesh)
    if hunting is not None:
        excess = excess.without_multiples(hunting)  # of both gears together; the mesh is one of its multiples
    for train in trains:  # with each shaft's sidebands
        for start in (0.0, mesh, *(mesh + k * o for o in signals.known_shaft_orders.values() for k in (-2, -1, 1, 2))):
            excess = excess.without_multiples(train, start=start, skirt=TRAIN_SKIRT)
    for _, part, order in expected_parts(signals):
        # Stiffness varies as rolling elements pass the load, and displaces the gears, in healthy bearings too.
        for passing in (order, 2 * order) if part == "BPFO" else ():
            excess = _without_sidebands(excess, mesh, passing, half_width=passing * slip_of(signals))
    centres = mesh * np.arange(1, N_CARRIERS + 1)
    centres = centres[centres + 2 < excess.spectrum.positions[-1]]
    if len(centres) == 0:
        return None
    lowest = max(0.05, CLOSEST_LINES * excess.spectrum.resolution, 3 * foot)
    offsets = np.array([k for k in range(-SPACINGS, SPACINGS + 1) if k])
    comb = best_comb(excess, lowest, LARGEST_SPACING, offsets=offsets, centres=centres)
    step = 1 if comb is None else gcd(*(k for _, k in _numbers(comb, mesh)))
    if comb is None or step <= 1 or (spacing := step * comb.fundamental) > LARGEST_SPACING:
        return comb
    # Only every second or third multiple: the spacing is that much wider, and its p-value is no smaller than before.
    near = excess.spectrum.resolution / 2
    wider = best_comb(excess, spacing - near, spacing + near, offsets=offsets, centres=centres)
    return comb if wider is None else replace(wider, p_value=max(comb.p_value, wider.p_value))


def _numbers(comb: Comb, mesh: float) -> list[tuple[int, int]]:
    """Return for each line the mesh harmonic of which it is a sideband, and its distance from that in spacings."""
    harmonics = [max(1, round(position / mesh)) for position in comb.positions]
    return [
        (h, round((position - h * mesh) / comb.fundamental))
        for h, position in zip(harmonics, comb.positions, strict=True)
    ]


def _is_family(comb: Comb, mesh: float) -> bool:
    """Whether three of the lines are there, two of them on both sides of one carrier, and one is clear on its own.

    A shaft shows by its first multiple before all others: second and third ones alone are products of other lines. A
    randomly varying amplitude puts the same noise on both sides of all harmonics of the mesh: its lines count as one
    line, no less probable together than alone.
    """
    places = _numbers(comb, mesh)
    is_clear = max(comb.ratios_db, default=0.0) >= CLEAR_DB
    has_first = any(abs(k) == 1 for _, k in places)
    return is_clear and has_first and len(places) >= 3 and any((h, -k) in places for h, k in places)
