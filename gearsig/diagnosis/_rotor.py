"""Lines between the multiples of a rotor's speed: halves and thirds from loose or rubbing parts, and oil whirl."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.diagnosis._signals import AnalysisSignals, PlacedLine, line_at
from gearsig.diagnosis._types import Finding, Kind, p_text
from gearsig.formatting import named, percent
from gearsig.prepared import MAINS_TOLERANCE, LinesOverFloor
from gearsig.recording import MAINS_HZ

HALF_ORDERS, OIL_WHIRL = "half-orders", "oil-whirl"
"""Codes of the findings."""

WHIRL_ORDERS = (0.38, 0.49)
"""Of the oil in plain bearings, which rotates at a little less than half the shaft's speed; exactly half is a rub or a
loose part (ISO 13373-3:2015; A. Muszynska, *Rotordynamics*, 2005, ch. 4)."""

CONFIRMS_WHIRL = (
    "An orbit that is round and turns with the shaft; the line keeps its share of the speed, and changes with the "
    "oil's temperature and the load. A belt's keeps its share as well, whatever the oil."
)

CLEAR_DB = 12.0
"""A line that noise alone exceeds once in 10⁷."""

N_FRACTIONS, MINIMUM_FRACTIONS = 8, 3
"""Number of halves or thirds of the order examined, starting with the first, and the minimum number for a family."""

FRACTIONS = {2: "halves", 3: "thirds"}
"""Fractions of a shaft's order at which loose and rubbing parts cause impacts: every other turn, or every third."""

N_OF_A_PART = 3
"""Highest multiple of a bearing part's order at which its lines are expected."""

OF_SOME_SIZE = 0.1
"""Velocity of the largest such line over that of the largest multiple of the shaft, below which it is no suspicion."""

UNSTEADY = 0.1
"""Relative range of speed above which lines pass resonances, which cause peaks of their own."""


@dataclass(frozen=True)
class _Between:
    """Lines between a shaft's multiples in one channel, their size relative to the largest multiple, and p-value."""

    channel: str
    kind: str
    places: tuple[float, ...]
    largest: PlacedLine
    size: float
    p_value: float


def detect_between_orders(signals: AnalysisSignals) -> Iterator[Finding]:
    """Yield findings on halves or thirds of a shaft's order, or on a line just below one half, without gears.

    Healthy rotors have neither. A gear train has shafts at all ratios, and a run-up's lines pass resonances.
    """
    if not _may_be_examined(signals):
        return
    for shaft, fractions in _largest_fractions(signals):
        yield _fractions(signals, shaft, fractions)
    for shaft, order in shafts_of_whirl(signals).items():
        whirls = [_whirl(signals, channel, order) for channel in signals.order_excess]
        whirl = max((one for one in whirls if one is not None), key=lambda one: one.size, default=None)
        if whirl is not None:
            yield _oil_whirl(signals, shaft, order, whirl)


def _may_be_examined(signals: AnalysisSignals) -> bool:
    angle = signals.angle
    return bool(signals.order_excess) and not signals.rig.pairs and angle is not None and angle.is_steady(UNSTEADY)


def _largest_fractions(signals: AnalysisSignals) -> Iterator[tuple[str, _Between]]:
    """Yield each shaft with lines at halves or thirds of its order, with the largest of all channels."""
    for shaft, order in signals.known_shaft_orders.items():
        seen = [_at_fractions(signals, channel, order, of) for of in FRACTIONS for channel in signals.order_excess]
        fractions = max((one for one in seen if one is not None), key=lambda one: one.size, default=None)
        if fractions is not None:
            yield shaft, fractions


def possible_half_speed_text(signals: AnalysisSignals) -> str:
    """Return a clause on a shaft whose half order exceeds all its multiples, with the cause; empty without one.

    It is not a sentence yet.
    """
    seen = _largest_fractions(signals) if _may_be_examined(signals) else ()
    return next((_half_speed_text(shaft) for shaft, one in seen if _may_be_of_half_speed(signals, one)), "")


def _may_be_of_half_speed(signals: AnalysisSignals, fractions: _Between) -> bool:
    """Whether a shaft may turn half as fast as stated, since the largest line of most rotors is at once per turn.

    Not if its speed is measured. A rub, too, may have its largest line at one half.
    """
    is_stated = signals.angle is not None and signals.angle.method == "constant"
    return is_stated and fractions.kind == FRACTIONS[2] and fractions.size >= 1.0


def _half_speed_text(shaft: str) -> str:
    return (
        f"a line at half of the order of {named('shaft', shaft) or 'the shaft'} exceeds all its multiples, as if it "
        "turned half as fast as stated, or the sampling rate were twice the stated one"
    )


def shafts_of_whirl(signals: AnalysisSignals) -> dict[str, float]:
    """Return name and order of the shafts that may run in plain bearings: those described without a rolling bearing."""
    rolling = {bearing.shaft for bearing in signals.rig.bearings}
    described = () if signals.rig.pairs else signals.rig.shaft_names
    orders = signals.known_shaft_orders
    return {name: orders[name] for name in described if name in orders and name not in rolling}


def _at_fractions(signals: AnalysisSignals, channel: str, order: float, of: int) -> _Between | None:
    """Return the halves or thirds that stand out in a channel's spectrum, unless chance or a train explains them.

    The probability that a place meets one of the spectrum's lines by chance is the share of the axis covered by lines;
    that for this many places is binomial. A slower train also has lines midway between these places, or at both halves
    and thirds.
    """
    from scipy.stats import binom

    excess = signals.order_excess[channel]
    numbers = [k for k in range(1, of * N_FRACTIONS) if k % of][:N_FRACTIONS]
    places = [place for k in numbers if _is_free(signals, excess, place := k / of * order)]
    lines = [(place, line) for place in places if (line := _clear(excess, place)) is not None]
    if len(lines) < MINIMUM_FRACTIONS:
        return None
    highest = (numbers[-1] + 1) / of * order
    midway = [(k + 0.5) / of * order for k in range(numbers[-1] + 1)]
    others = [k / other * order for other in FRACTIONS if other != of for k in range(1, round(highest)) if k % other]
    if any(sum(_clear(excess, place) is not None for place in train) >= len(lines) for train in (midway, others)):
        return None
    chance = float(binom.sf(len(lines) - 1, len(places), _share_of_lines(excess, highest)))
    p_value = min(1.0, chance * len(FRACTIONS) * len(signals.order_excess) * len(signals.known_shaft_orders))
    if p_value > signals.settings.false_alarm_probability:
        return None
    top_place, top = max(lines, key=lambda line: _as_velocity(signals, channel, line[0], line[1].amplitude))
    size = _as_velocity(signals, channel, top_place, top.amplitude) / _largest_multiple(signals, channel, order)
    return _Between(channel, FRACTIONS[of], tuple(place for place, _ in lines), top, size, p_value)


def _whirl(signals: AnalysisSignals, channel: str, order: float) -> _Between | None:
    """Return the line just below half the order; None if its multiples stand out as well, as a belt's do."""
    excess = signals.order_excess[channel]
    low, high = (edge * order for edge in WHIRL_ORDERS)
    place = excess.spectrum.largest_near((low + high) / 2, (high - low) / 2)[0]
    line = _clear(excess, place) if low < place < high and _is_free(signals, excess, place) else None
    if line is None or _clear(excess, 2 * line.position) is not None:
        return None
    size = _as_velocity(signals, channel, place, line.amplitude) / _largest_multiple(signals, channel, order)
    return _Between(channel, "below half", (place,), line, size, 0.0)


def _clear(excess: LinesOverFloor, place: float) -> PlacedLine | None:
    """Return the line at a place if it stands out from noise and is the highest nearby."""
    line = line_at(excess, place)
    return line if line is not None and line.is_highest and line.ratio_db >= CLEAR_DB else None


def _is_free(signals: AnalysisSignals, excess: LinesOverFloor, place: float) -> bool:
    """Whether neither a supply nor a described rolling bearing causes a line at an order."""
    hertz, width_hz = (x * signals.frequency_per_order_hz for x in (place, 2 * excess.spectrum.resolution))
    supply_hz = [mains_hz * max(1, round(hertz / mains_hz)) for mains_hz in MAINS_HZ]
    if any(abs(hertz - line_hz) <= max(MAINS_TOLERANCE * line_hz, width_hz) for line_hz in supply_hz):
        return False
    slip = signals.settings.bearing_slip
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft) or 0.0
        for fundamental in (part * ratio for part in bearing.orders().values() if ratio):
            k = max(1, round(place / fundamental))
            if k <= N_OF_A_PART and abs(place - k * fundamental) <= slip * k * fundamental:
                return False
    return True


def _share_of_lines(excess: LinesOverFloor, highest: float) -> float:
    """Return the share of an axis that is within 1.5 lines of a peak that stands out."""
    n = excess.spectrum.index_of(highest)
    values = excess.spectrum.values[: n + 2]
    is_peak = (values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])
    stands_out = values[1:-1] >= 10 ** (CLEAR_DB / 20) * excess.floor[1 : n + 1]
    return min(0.5, 3.0 * float(np.sum(is_peak & stands_out)) / max(n, 1))


def _largest_multiple(signals: AnalysisSignals, channel: str, order: float) -> float:
    """Return the largest amplitude of a shaft's first multiples, as velocity."""
    excess = signals.order_excess[channel]
    lines = ((k * order, line_at(excess, k * order)) for k in range(1, N_FRACTIONS + 1))
    sizes = [_as_velocity(signals, channel, place, line.amplitude) for place, line in lines if line is not None]
    return max(sizes, default=1e-300)


def _as_velocity(signals: AnalysisSignals, channel: str, order: float, amplitude: float) -> float:
    """Return a line's amplitude as velocity, up to a factor common to all lines of a channel."""
    return max(amplitude, 1e-300) / order ** derivatives_of_velocity(signals, channel)


def derivatives_of_velocity(signals: AnalysisSignals, channel: str) -> int:
    """Return how often velocity is differentiated to give a channel's quantity; unknown ones count as acceleration."""
    quantity = signals.recording.channels[signals.recording.index(channel)].quantity
    return {"velocity": 0, "displacement": -1, "transmission_error": -1}.get(quantity, 1)


_BASIS = "how well the textbook's signs fit, one recording alone; not calibrated"


def _fractions(signals: AnalysisSignals, shaft: str, fractions: _Between) -> Finding:
    count, name = len(fractions.places), named("shaft", shaft) or "the shaft"
    orders = ", ".join(f"{place:.4g}" for place in fractions.places)
    chance = f"chance of so many {p_text(fractions.p_value)}"
    other = "A shaft at exactly a third of the speed"
    if fractions.kind == FRACTIONS[2]:
        other = "A four-stroke engine, or a shaft at exactly half the speed,"
    title = f"Perhaps looseness or a rub of {name}: lines stand at {fractions.kind} of its order."
    surer = "Bolts, feet and fits of the bearings; seals for marks; an earlier recording of the machine."
    if _may_be_of_half_speed(signals, fractions):
        title = f"Perhaps a wrong speed or sampling rate, else looseness or a rub: {_half_speed_text(shaft)}."
        surer = f"Check the stated speed and the sampling rate first. {surer}"
    return Finding(
        HALF_ORDERS,
        Kind.SUSPICION if fractions.size >= OF_SOME_SIZE else Kind.NOTICE,
        title,
        signals.where(fractions.largest.position, fractions.channel, shaft=shaft),
        fractions.largest.strength("noise floor"),
        0.5,
        _BASIS,
        (
            f"{count} of the first {N_FRACTIONS} stand out in {fractions.channel}: orders {orders}; {chance}.",
            f"The largest has {percent(fractions.size)} of the velocity of the shaft's largest multiple.",
            f"{other} would show the same.",
        ),
        surer,
    )


def _oil_whirl(signals: AnalysisSignals, shaft: str, order: float, whirl: _Between) -> Finding:
    at = f"{whirl.largest.position / order:.3f}"
    return Finding(
        OIL_WHIRL,
        Kind.SUSPICION if whirl.size >= OF_SOME_SIZE else Kind.NOTICE,
        f"Perhaps oil whirl in the plain bearings of {named('shaft', shaft)}, or a belt: a line stands at {at} of its "
        "order.",
        signals.where(whirl.largest.position, whirl.channel, shaft=shaft),
        whirl.largest.strength("noise floor"),
        0.4,
        _BASIS,
        (
            f"It has {percent(whirl.size)} of the velocity of the shaft's largest multiple.",
            "No rolling bearing is described on that shaft; the cage of one would turn at nearly the same rate.",
        ),
        CONFIRMS_WHIRL,
    )
