"""Families of lines in the envelopes: at the orders of known bearing parts, and at others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, exp, gcd, log, log10, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.diagnosis._lines import magnetic_pull_at
from gearsig.diagnosis._signals import (
    MINIMUM_LINES,
    SEEN_THERE,
    AnalysisSignals,
    BandEnvelope,
    is_of_tones,
    lines_without_tones,
    without_shafts,
)
from gearsig.prepared import MAINS_TOLERANCE, Comb, LinesOverFloor, best_comb, comb_at, peak_position
from gearsig.rig import Bearing
from gearsig.spectra import Spectrum

SEEN_DB = 6.0
"""Height over the floor at which a line between those of a family counts as seen."""

AS_STRONG_DB = 9.0
"""Scatter of a train's lines about a smooth profile: beats between two resonances weaken a line by this much."""

AS_STRONG_BESIDE_SHAFT_DB = 3.0
"""The same if one of a train's first six lines is a multiple of a shaft's order: sums and differences of family and
shaft then lie on the train, too, and are weaker than the family, whereas the lines of a real train are equally
strong."""


def underlying_impulse_train(excess: LinesOverFloor, comb: Comb, shafts: tuple[float, ...] = ()) -> Comb | None:
    """Return the train of impacts whose lines a family is a part of, or None if the family stands alone.

    Candidates are p/q of the family's fundamental (q to 30, p to 3), over the range of the family's lines. The best has
    the largest sum of log ratios minus a cost per line: a train that is too slow pays for lines of noise, one that is
    too fast misses lines. It counts if at least half of its lines that belong neither to the family nor to the family's
    sidebands are seen; a race that turns through the load has sidebands a shaft's order apart. These lines must also be
    as strong as the family's, within `AS_STRONG_DB`, up to where weaker ones could still be seen: nothing makes every
    q-th line of a train stronger than the others, whereas second-order sidebands of a strong family, or lines of its
    foot, lie everywhere.

    Parameters
    ----------
    excess : LinesOverFloor
    comb : Comb
        A family of multiples of one fundamental.
    shafts : tuple of float
        Orders of the shafts that may modulate the family.

    Returns
    -------
    Comb or None
        With all multiples within the range; the p-value is that of the family.
    """
    if not comb.positions:
        return None
    reach = max(comb.positions) + excess.spectrum.resolution
    family = _unmasked(excess, comb.fundamental, reach)
    noise = float(np.median(excess.log_ratio[~excess.masked]))
    # Between noise (0) and the family's mean (1), so that a train that adds noise lines loses.
    cost = noise + 0.4 * (float(family.mean()) - noise) if len(family) else 0.0
    best, best_score = None, float(np.sum(family - cost))
    # A family still has two of three multiples on every third line of a train.
    fractions = {p / q for q in range(2, 31) for p in range(1, min(q, 4)) if gcd(p, q) == 1}
    for fundamental in (comb.fundamental * fraction for fraction in sorted(fractions)):
        if fundamental < 6 * excess.spectrum.resolution:
            continue  # trains with lines closer than that cannot be distinguished from noise
        score = float(np.sum(_unmasked(excess, fundamental, reach) - cost))
        if score > best_score and _is_seen_between(excess, fundamental, comb.fundamental, reach, shafts):
            best, best_score = fundamental, score
    if best is None:
        return None
    return comb_at(excess, best, np.arange(1, int(reach / best) + 1), comb.p_value)


def stands_out_from_neighbours(excess: LinesOverFloor, comb: Comb, slip: float, others: tuple[float, ...]) -> bool:
    """Whether no family at orders a few percent on either side scores as high as this one.

    Neighbours that contain one of the `others`, the orders of further parts, are left out: they may be families too.
    """
    for distance in (-0.09, -0.05, 0.05, 0.09):
        low, high = (comb.fundamental * (1 + distance + side * slip) for side in (-1, 1))
        if any(low <= other * (1 + side * slip) <= high for other in others for side in (-1, 0, 1)):
            continue
        placebo = best_comb(excess, low, high)
        if placebo is not None and placebo.score >= 0.9 * comb.score:  # a true part's family scores clearly higher
            return False
    return True


def _unmasked(excess: LinesOverFloor, fundamental: float, reach: float) -> FloatArray:
    """Return the log ratios of the multiples up to `reach` that are not explained yet."""
    ratios: FloatArray = excess.log_ratio[
        excess.free_lines_at(np.arange(1, int(reach / fundamental) + 1) * fundamental)
    ]
    return ratios


def _is_seen_between(
    excess: LinesOverFloor, fundamental: float, family: float, reach: float, shafts: tuple[float, ...]
) -> bool:
    """Whether at least half of those lines of the train stand out that are not the family's or its sidebands.

    A line counts as seen 6 dB over the floor, which a widened line of noise reaches once in 18. Sidebands of a race's
    family give few such lines.
    """
    places = np.arange(1, int(reach / fundamental) + 1) * fundamental
    sidebands = [0.0, *(side * k * shaft for shaft in shafts for k in (1, 2, 3) for side in (-1, 1))]
    peaks, resolution = _peaks_at(excess.spectrum, excess.line_numbers(places)), excess.spectrum.resolution
    explained = np.any([_is_of_family(places, peaks, resolution, family, sideband) for sideband in sidebands], axis=0)
    further = excess.free_lines_at(places[~explained])
    seen = excess.log_ratio[further] >= SEEN_DB * np.log(10) / 10
    if len(further) < 3 or float(np.mean(seen)) < 0.5:
        return False
    multiples = excess.free_lines_at(np.arange(1, int(reach / family) + 1) * family)
    own_db, between_db = (excess.over_floor_db(lines) for lines in (multiples, further[seen]))
    # Lines count as seen above 6 dB only, so weak ones cannot be judged by family lines below 6 dB plus the scatter.
    is_seen = own_db >= SEEN_DB + AS_STRONG_DB
    if is_seen.any():
        between_db = between_db[further[seen] <= multiples[is_seen].max()]
        own_db = own_db[is_seen]
    beside = (abs(k * fundamental - round(k * fundamental / turn) * turn) for turn in shafts for k in range(1, 7))
    is_beside_shaft = any(distance <= 2 * resolution for distance in beside)
    weaker_db = AS_STRONG_BESIDE_SHAFT_DB if is_beside_shaft else AS_STRONG_DB
    return len(between_db) > 0 and bool(np.median(between_db) >= np.median(own_db) - weaker_db)


def _is_of_family(
    places: FloatArray, peaks: FloatArray, resolution: float, family: float, sideband: float
) -> NDArray[np.bool_]:
    """Whether a multiple of the family, shifted by `sideband`, is near and fits the peak at least as well."""
    others = sideband + np.maximum(np.rint((places - sideband) / family), 0) * family
    near: NDArray[np.bool_] = np.abs(others - places) < 2 * resolution
    if sideband:
        near = near & (np.abs(others - peaks) <= np.abs(places - peaks))
    return near


def _peaks_at(spectrum: Spectrum, lines: NDArray[np.int64]) -> FloatArray:
    """Return the position of the highest peak within two lines of each, interpolated by a parabola."""
    values, last = spectrum.values, len(spectrum.values) - 2
    near = np.clip(lines[:, None] + np.arange(-2, 3), 1, last)
    top = np.take_along_axis(near, values[near].argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.array([peak_position(spectrum, i) for i in top.tolist()])


BEARING_PARTS = {
    "BPFO": ("outer race", 1.0),
    "BPFI": ("inner race", 1.0),
    "BSF": ("rolling element", 2.0),
    "FTF": ("cage", 1.0),
}
"""Part and impacts per cycle for each order: a damaged rolling element strikes both races in each spin."""

RACES = ("BPFO", "BPFI")
"""Where almost all damage begins."""


def part_text(name: str, bearing: str) -> str:
    """Return a part's text from its order's name, e.g. "outer race of bearing 1"."""
    return f"{BEARING_PARTS[name][0]} of {bearing}"


USUAL_SLIP = 0.007
"""Scatter of a part's order about the kinematic order."""

SAME_BEARING_ORDER = 1e-3
"""Relative distance below which two bearings' orders are indistinguishable in any record: slip alone scatters more."""

N_MULTIPLES = 6
"""Multiples of a family's fundamental that are examined."""


ALTERNATING_DB = 6.0
"""Level of the odd lines of half a rate below the even ones if impacts at that rate alternate in strength."""


@dataclass(frozen=True)
class Candidate:
    """A family of lines, and what it may be.

    `of_same_order` are other bearings whose same part has the same order, which no envelope can distinguish. `share` is
    the posterior share of the part, these included, among all causes that would show at that order. `loudest` is the
    channel with the largest line. `of_tones` says that the family vanishes with the steady tones, `of_elements` that
    unequal elements may cause it as well, `is_smooth` that no impacts cause it.
    """

    comb: Comb
    envelope: BandEnvelope
    p_value: float
    bearing: Bearing | None = None
    name: str = ""
    expected: float = 0.0
    rivals: tuple[str, ...] = ()
    of_same_order: tuple[Bearing, ...] = ()
    share: float = 1.0
    in_train: bool = False
    loudest: str = ""
    of_tones: bool = False
    of_elements: bool = False
    is_smooth: bool = False

    @property
    def strength_db(self) -> float:
        """Mean height of the first six multiples over the floor in dB; those that do not stand out count 0."""
        highest = (N_MULTIPLES + 0.5) * self.comb.fundamental
        lines = zip(self.comb.positions, self.comb.ratios_db, strict=True)
        return float(sum(ratio for position, ratio in lines if position < highest)) / N_MULTIPLES

    @property
    def has_odd_lines(self) -> bool:
        """Whether odd multiples are about as high as even ones, which impacts at twice the rate would not cause."""
        highest_db = [0.0, 0.0]
        for position, ratio_db in zip(self.comb.positions, self.comb.ratios_db, strict=True):
            number = round(position / self.comb.fundamental)
            if number <= N_MULTIPLES:
                highest_db[number % 2] = max(highest_db[number % 2], ratio_db)
        return highest_db[1] > highest_db[0] - ALTERNATING_DB

    @property
    def modulation(self) -> float:
        """Amplitude of the strongest line over the mean envelope."""
        return self.comb.amplitude / self.envelope.mean if self.envelope.mean > 0 else 0.0


@dataclass(frozen=True)
class Families:
    """The families of lines in the envelopes.

    Parameters
    ----------
    named : tuple of Candidate
        Parts of known bearings, most certain first.
    trains : tuple of Candidate
        Other periodic impacts; without a bearing, or with the one whose part has their rate.
    unclear : tuple of Candidate
        Families at a part's order that are no clearer than their neighbours.
    """

    named: tuple[Candidate, ...] = ()
    trains: tuple[Candidate, ...] = ()
    unclear: tuple[Candidate, ...] = ()


def _without(envelopes: Sequence[BandEnvelope], families: Sequence[Candidate]) -> list[BandEnvelope]:
    """Return the envelopes without the multiples of these families."""
    for family in families:
        envelopes = [replace(e, excess=e.excess.without_multiples(family.comb.fundamental)) for e in envelopes]
    return list(envelopes)


def find_families(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> Families:
    """Return the families of the envelopes, each attributed to a bearing part only if nothing else explains it.

    A family at a part's order that belongs to a slower train of impacts is attributed to the train. The train is then
    masked and the search repeated, to find a damaged part beside it; the same is done for the clicks of a supply and
    beats of steady tones. A train whose lines are those of a stronger family explains nothing, because sums and
    differences of that family and the shaft lie on it.
    """
    trains: list[Candidate] = []
    pulls: list[Candidate] = []
    for _ in range(3):
        candidates = _significant(signals, envelopes)
        of_pull = [c for c in candidates if c.of_tones or mains_beside(signals, c)]
        candidates = [c for c in candidates if all(c is not pull for pull in of_pull)]
        # A family with the multiples of a stronger one, as a cage's include an outer race's, is not masked.
        if of_pull := [c for c in of_pull if not any(_hides(c, other) for other in candidates)]:
            pulls += of_pull
            envelopes = _without(envelopes, of_pull)
            candidates = _significant(signals, envelopes)
        candidates = _distinct(signals, [c for c in candidates if not c.of_tones])
        named: list[Candidate] = []
        train = None
        for candidate in candidates:
            train = _train_of(signals, candidate)
            if train is None:
                named.append(candidate)
            elif _shaft_beside(signals, train) or any(_is_multiple(c.comb.fundamental, train) for c in named):
                train = None  # and the candidate is a by-product
            else:
                break
        if train is None:
            break
        trains.append(train)
        envelopes = _without(envelopes, [train])
    if not named and not trains:
        named = _distinct(signals, pulls)
    trains = [t for t in trains if not any(t.strength_db < c.strength_db - SECOND_DB for c in named)]
    named = [c for c in named if not any(c.strength_db < t.strength_db - SECOND_DB for t in trains)]
    if named:
        stranger = _strongest_family(signals, envelopes)
        named = [c for c in named if c.strength_db >= stranger - SECOND_DB]
    clear = [c for c in named if _stands_out(signals, c)]
    unclear = [c for c in named if c not in clear]
    if not clear and not trains:  # combinations with shaft orders are further families, but no second fault
        free = best_unnamed(signals, envelopes)
        if free is not None and free.bearing is not None:
            return Families((free,), (), tuple(unclear))
        if free is not None and mains_beside(signals, free):  # clicks of a supply hide slower and weaker trains
            further = find_families(signals, _without(envelopes, [free]))
            return replace(further, trains=(free, *further.trains))
        trains = [] if free is None else [free]
    return Families(tuple(_beside_elements(c, clear) for c in clear), tuple(trains), tuple(unclear))


def _beside_elements(candidate: Candidate, named: Sequence[Candidate]) -> Candidate:
    """Return an ambiguous outer race as its elements', too, if they or the cage show."""
    elements = {c.bearing for c in named if c.name in ("BSF", "FTF")}
    is_open = candidate.name == "BPFO" and candidate.share <= 0.5
    return replace(candidate, of_elements=True) if is_open and candidate.bearing in elements else candidate


SAME_FAMILY = 5e-3
"""Relative distance up to which two fundamentals are the same: a bearing's slip varies from day to day."""

FOUR_IN_FIVE = 0.8
"""Share of a family's lines: another line may stand in the place of one of them."""

PEAK_ERROR = 0.02
"""Error of a peak's position by a parabola, as a fraction of the line spacing."""

SECOND_DB = 12.0
"""A family this much weaker than another, in its own envelope or in the clearest one, is a by-product of it: sums and
differences with the shaft and the cage, or pick-up by the other bearing's sensor."""


def _distinct(signals: AnalysisSignals, candidates: list[Candidate]) -> list[Candidate]:
    """Return the candidates, strongest first, without by-products of another one."""
    kept: list[Candidate] = []
    for candidate in sorted(candidates, key=lambda c: -c.strength_db):
        beside = (max(s.strength_db, _strength_in(candidate.envelope, s.comb.fundamental)) for s in kept)
        if all(candidate.strength_db >= level - SECOND_DB for level in beside):
            kept.append(candidate)
    return [c for c in kept if not any(_is_sideband(signals, c, carrier) for carrier in kept)]


def _is_sideband(signals: AnalysisSignals, candidate: Candidate, carrier: Candidate) -> bool:
    """Whether a family is the sidebands of a race's: k (f - n s) is sideband k n of multiple k.

    An inner race turns through the load, so its sidebands are a shaft's order apart; so are an outer race's where the
    load rotates, weaker than its own lines. Sidebands of elements and cages are a cage's order apart. BPFO and BPFI add
    up to the number of elements: if they are nearly whole numbers, an inner and an outer race are each other's
    sidebands. The true carrier is the one whose sidebands fit the other's lines better, weighted by their slips.
    """
    shaft = signals.rig.ratio(carrier.bearing.shaft) if carrier.bearing is not None else None
    if not shaft:
        return False
    there, back = (_off_sidebands(*two, shaft) for two in ((candidate, carrier), (carrier, candidate)))
    resolution = candidate.envelope.excess.spectrum.resolution
    lies_there, lies_back = (float(np.mean(off <= resolution)) >= FOUR_IN_FIVE for off in (there, back))
    distance = abs(candidate.comb.fundamental - carrier.comb.fundamental)
    n = round(distance / shaft)
    is_apart = 1 <= n <= 3 and abs(distance - n * shaft) <= 2 * resolution
    if {candidate.name, carrier.name} == set(RACES) and (is_apart or lies_there or lies_back):
        # With n lines scattering normally about their places, the likelihood is proportional to 1/scatter^n.
        n_lines = min(len(there), len(back))
        odds = [
            _own_weight(signals, one) / float(np.mean(off / resolution) + PEAK_ERROR) ** n_lines
            for one, off in ((carrier, there), (candidate, back))
        ]
        return odds[0] > odds[1]
    if carrier.name == "BPFI" and candidate.name != "BPFI":
        return lies_there or is_apart
    return carrier.name in RACES and carrier.strength_db > candidate.strength_db and is_apart


def _off_sidebands(candidate: Candidate, carrier: Candidate, shaft: float) -> FloatArray:
    """Return the distances of a family's peaks from another's multiples and up to three sidebands of these.

    If a race's order is nearly a whole number, they lie near the multiples of many orders, but not on them.
    """
    peaks, fundamental = np.array(candidate.comb.positions), carrier.comb.fundamental
    sidebands = shaft * np.arange(-3, 4)
    numbers = np.maximum(np.rint((peaks[:, None] - sidebands) / fundamental), 1)
    beside: FloatArray = np.abs(peaks[:, None] - numbers * fundamental - sidebands).min(axis=1)
    return beside


def _strength_in(envelope: BandEnvelope, fundamental: float) -> float:
    """Return the strength of a family in another envelope, in dB as `Candidate.strength_db`."""
    places = fundamental * np.arange(1, N_MULTIPLES + 1)
    lines = envelope.excess.free_lines_at(places)
    return float(np.maximum(envelope.excess.over_floor_db(lines), 0.0).sum()) / N_MULTIPLES


def _hides(family: Candidate, stronger: Candidate) -> bool:
    """Whether masking a family's lines would also remove a stronger family."""
    return stronger.strength_db > family.strength_db and _is_multiple(stronger.comb.fundamental, family)


def _is_multiple(fundamental: float, train: Candidate) -> bool:
    """Whether a family's fundamental is among the train's lines."""
    of_train, resolution = train.comb.fundamental, train.envelope.excess.spectrum.resolution
    return abs(fundamental - round(fundamental / of_train) * of_train) <= 2 * resolution


def speed_is_only_stated(signals: AnalysisSignals) -> bool:
    """Whether the speed is stated and no line of the signal has confirmed it."""
    return signals.angle is not None and signals.angle.method == "constant" and signals.angle.quality <= 0.5


def slip_of(signals: AnalysisSignals) -> float:
    """Return the relative range in which a part's order is searched.

    Where the speed is stated and not confirmed, a motor's slip adds to the bearing's.
    """
    slip = signals.settings.bearing_slip
    return max(slip, 0.05) if speed_is_only_stated(signals) else slip


def expected_parts(signals: AnalysisSignals) -> list[tuple[Bearing, str, float]]:
    """Return every known bearing part with the order of the impacts that damage to it would cause."""
    return [
        (bearing, name, order * ratio * BEARING_PARTS[name][1])
        for bearing in signals.rig.bearings
        if (ratio := signals.rig.ratio(bearing.shaft)) is not None
        for name, order in bearing.orders().items()
    ]


def _rates_of_bearings(signals: AnalysisSignals) -> tuple[float, float]:
    """Return the range of orders of bearing impacts: about 1.5 to 14 times per revolution."""
    turns = signals.known_shaft_orders.values()
    return 1.5 * min(turns, default=1.0), 14.0 * max(turns, default=1.0)


def best_unnamed(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> Candidate | None:
    """Return the clearest family that is not a shaft's.

    Slower trains show by their multiples among the bearing rates. The family gets a bearing's name if its fundamental
    is a low harmonic of a known part, since paths may hide the first.
    """
    best = clearest_family(envelopes, *_rates_of_bearings(signals))
    if best is None or best.p_value > signals.settings.false_alarm_probability:
        return None
    train = underlying_impulse_train(best.envelope.excess, best.comb, tuple(signals.known_shaft_orders.values()))
    if train is not None:
        return _as_part(signals, replace(best, comb=train, in_train=True))
    known = _known_multiple(signals, best)
    if known is None:
        return _where_it_is_strongest(envelopes, best)
    # Smeared lines do not stand out from neighbouring families, although theirs is the clearest of all orders.
    return known if _stands_out(signals, known) else replace(known, share=0.5 * known.share)


def _strongest_family(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> float:
    """Return the strength in dB of the strongest family that is not due to chance or to beats of steady tones.

    If it is of no known part it has another cause: a damaged race at a wrong speed, or a bearing missing from the rig.
    Its by-products are near one part or another.
    """
    allowed, strongest = signals.settings.false_alarm_probability, 0.0
    families = [c for c in _families(envelopes, *_rates_of_bearings(signals)) if c.p_value <= allowed]
    for family in sorted(families, key=lambda c: -c.strength_db):
        if family.strength_db <= strongest:
            break
        excess = lines_without_tones(signals, family.envelope)
        if excess is not None:
            left = _strength_in(replace(family.envelope, excess=excess), family.comb.fundamental)
            strongest = max(strongest, min(left, family.strength_db))
    return strongest


def clearest_family(envelopes: list[BandEnvelope], low: float, high: float) -> Candidate | None:
    """Return the most certain family with a fundamental between `low` and `high`, its p-value over all envelopes.

    Of families with negligible p-values, the strongest.
    """
    families = _families(envelopes, low, high)
    best = min(families, key=lambda family: (max(family.p_value, 1e-9), -family.strength_db), default=None)
    if best is None:
        return None
    # At no known order there are few other causes of impacts, and each envelope counts as a trial.
    return replace(best, p_value=min(1.0, best.p_value * len(envelopes)), loudest=_loudest(envelopes, best))


def _chance_over(envelopes: Sequence[BandEnvelope], best: Candidate, p_values: Sequence[float]) -> float:
    """Return the p-value of the best family over all envelopes, from its p-values in those that have one.

    Bands overlap and channels pick up the same source: if a line is higher than noise makes any line of a spectrum, the
    envelopes that show it are not independent trials, and the harmonic mean of the p-values, which is valid for
    dependent trials, is used (Wilson 2019, doi:10.1073/pnas.1814092116). Without such a line each envelope counts as a
    trial, because one accident of noise may be in all bands.
    """
    n, of_noise_db = len(envelopes), 10 * log10(log(len(best.envelope.excess.log_ratio)))
    if max(best.comb.ratios_db) <= of_noise_db:
        return min(1.0, n * min(p_values))
    return min(1.0, n / (sum(1.0 / max(p, 1e-300) for p in p_values) + n - len(p_values)))


def _where_it_is_strongest(envelopes: list[BandEnvelope], family: Candidate) -> Candidate:
    """Return a family in the envelope in which it stands out most.

    This need not be the one with the smallest p-value: a family that fills its own channel with lines makes chance
    lines more likely there.
    """
    low, high = (family.comb.fundamental * (1 + off) for off in (-SAME_FAMILY, SAME_FAMILY))
    seen = [
        replace(family, comb=there.comb, envelope=there.envelope)
        for there in _families(envelopes, low, high)
        if there.p_value <= SEEN_THERE
    ]
    return max((family, *seen), key=lambda candidate: candidate.strength_db)


def _families(envelopes: list[BandEnvelope], low: float, high: float) -> list[Candidate]:
    """Return each envelope's best family with a fundamental between `low` and `high`, if it has one."""
    combs = [(best_comb(envelope.excess, low, high), envelope) for envelope in envelopes]
    return [Candidate(c, e, c.p_value) for c, e in combs if c is not None and len(c.positions) >= MINIMUM_LINES]


def _loudest(envelopes: list[BandEnvelope], family: Candidate) -> str:
    """Return the channel whose envelopes have the largest line at a family's fundamental: the nearest to its source.

    It need not be the clearest: the scatter of impacts raises the floor of their own channel.
    """
    spectrum = family.envelope.excess.spectrum
    comparable = [e for e in envelopes if e.excess.spectrum.unit == spectrum.unit]
    near, reach = family.comb.fundamental, 2 * spectrum.resolution
    return max(comparable, key=lambda e: e.excess.spectrum.largest_near(near, reach)[1]).channel


def _significant(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> list[Candidate]:
    """Return the significant bearing parts, most certain first, the more certain one of those that share lines."""
    allowed = signals.settings.false_alarm_probability
    candidates = [c for c in _at_parts(signals, envelopes) if c.p_value <= allowed and _has_own_lines(c.comb)]
    candidates.sort(key=lambda c: -_own_weight(signals, c))
    kept: list[Candidate] = []
    for candidate in candidates:
        if not any(_shares_lines(candidate.comb, other.comb) for other in kept):
            of_tones = is_of_tones(signals, candidate.envelope, candidate.comb.fundamental)
            kept.append(_with_rivals(signals, replace(candidate, of_tones=of_tones)))
    return sorted(kept, key=lambda c: c.p_value)


def _at_parts(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> Iterator[Candidate]:
    """Yield the clearest family at each part's order, with its p-value over all envelopes and parts."""
    slip = slip_of(signals)
    expected = expected_parts(signals)
    orders = sorted(order for _, _, order in expected)  # the same part of identical bearings is one trial
    n_orders = sum(high / low - 1 >= SAME_BEARING_ORDER for low, high in pairwise(orders)) + 1
    for bearing, name, order in expected:
        low, high = order * (1 - slip), order * (1 + slip)
        best = clearest_family(envelopes, low, high)
        if best is None:
            continue
        p_value = min(1.0, _chance_among_others(signals, envelopes, best, bearing, name, low, high) * n_orders)
        # After the fit to the lines, the fundamental must still be near the order.
        near = slip * order + best.envelope.excess.spectrum.resolution / 6
        if abs(best.comb.fundamental - order) <= near:
            yield replace(best, p_value=p_value, bearing=bearing, name=name, expected=order)


DOUBTFUL = 0.05
"""p-value of a race's family that rules out saying that no damage shows: the customary significance level."""


def doubtful_races(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> list[Candidate]:
    """Return families at races' orders that chance hardly explains, although they were not reported as findings."""
    candidates = _at_parts(signals, envelopes)
    return [c for c in candidates if c.name in RACES and c.p_value <= DOUBTFUL]


IN_VIBRATION, SEEN_IN_VIBRATION, WITHOUT_GAPS = 24, 6, 0.75
"""Multiples of a race's order that are sought in the vibration itself, the number of them that must be seen, and the
share of those between the first and the last seen: impacts leave no gaps, whereas strong gear lines, though not due to
chance either, are scattered."""


def races_in_vibration(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope]) -> list[tuple[str, str, Comb]]:
    """Return channel, race and lines of trains in the order spectra, where no envelope can show them.

    Envelopes are searched for the first six lines of a family. Slip may shift these to multiples of a slow shaft, from
    which only the further lines of the train separate. If an envelope could show the family and does not, the lines are
    smooth tones of elements passing the load, which healthy bearings also have, up to high multiples.
    """
    races = [(part_text(name, b.name), order) for b, name, order in expected_parts(signals) if name in RACES]
    multiples, slip = np.arange(1, IN_VIBRATION + 1), slip_of(signals)
    allowed = signals.settings.false_alarm_probability / max(len(races) * len(signals.order_excess), 1)
    damaged_races = []
    for channel, lines in signals.order_excess.items():
        free = without_shafts(signals, lines)
        for race, order in races:
            comb = best_comb(free, order * (1 - slip), order * (1 + slip), offsets=multiples)
            if comb is None or comb.p_value > allowed or len(comb.positions) < SEEN_IN_VIBRATION:
                continue
            first, last = (round(position / comb.fundamental) for position in (comb.positions[0], comb.positions[-1]))
            between = free.free_lines_at(comb.fundamental * np.arange(first, last + 1))
            first_six = comb.fundamental * np.arange(1, N_MULTIPLES + 1)
            is_hidden = all(len(e.excess.free_lines_at(first_six)) < MINIMUM_LINES for e in envelopes)
            if is_hidden and len(comb.positions) >= WITHOUT_GAPS * len(between):
                damaged_races.append((channel, race, comb))
    return sorted(damaged_races, key=lambda one: one[2].p_value)


def _chance_among_others(
    signals: AnalysisSignals,
    envelopes: list[BandEnvelope],
    family: Candidate,
    bearing: Bearing,
    name: str,
    low: float,
    high: float,
) -> float:
    """Return a family's p-value over all envelopes, not counting its sidebands and further multiples as chance lines.

    A race that turns through the load fills the spectrum with lines a shaft's order apart, a rolling element with lines
    a cage's order apart, and impacts go on beyond the sixth multiple. These lines would make their own family look like
    chance, above all in a short record, where each line is wide.
    """
    fundamental = family.comb.fundamental
    step = (signals.rig.ratio(bearing.shaft) or 0.0) * (bearing.orders().get("FTF", 0.0) if name == "BSF" else 1.0)
    sides = step * np.array([-3, -2, -1, 1, 2, 3] if step else [])
    chances = []
    for there in _families(envelopes, low, high):
        chances.append(there.p_value)
        if there.p_value > SEEN_THERE or abs(there.comb.fundamental / fundamental - 1) > SAME_FAMILY:
            continue
        excess = there.envelope.excess
        carriers = fundamental * np.arange(int(excess.spectrum.positions[-1] / fundamental) + 1)
        further = carriers[N_MULTIPLES + 1 :]
        masked = excess.masked.copy()
        masked[_widened(excess, np.concatenate(((carriers[:, None] + sides).ravel(), further)), 1)] = True
        of_family = _widened(excess, carriers[1 : N_MULTIPLES + 1], 2)
        masked[of_family] = excess.masked[of_family]
        comb = best_comb(replace(excess, masked=masked), low, high)
        if comb is not None and abs(comb.fundamental / fundamental - 1) <= SAME_FAMILY:
            chances[-1] = min(there.p_value, comb.p_value)
    return _chance_over(envelopes, family, chances)


def _widened(excess: LinesOverFloor, places: FloatArray, reach: int) -> NDArray[np.int64]:
    """Return the numbers of the lines at some places and of their neighbours."""
    lines = excess.lines_at(places)[:, None] + np.arange(-reach, reach + 1)
    return np.unique(np.clip(lines, 0, len(excess.masked) - 1))


def _has_own_lines(comb: Comb) -> bool:
    """Whether the harmonic numbers of the strong lines have no common divisor; otherwise they are another family's."""
    lines = zip(comb.positions, comb.ratios_db, strict=True)
    strong = [round(position / comb.fundamental) for position, db in lines if db >= max(comb.ratios_db) - SECOND_DB]
    return gcd(*strong) == 1 or len(strong) == 1


def _train_of(signals: AnalysisSignals, candidate: Candidate) -> Candidate | None:
    """Return the train of impacts to which a candidate's lines belong, if any."""
    train = underlying_impulse_train(
        candidate.envelope.excess, candidate.comb, tuple(signals.known_shaft_orders.values())
    )
    if train is None:
        return None
    if candidate.name == "BSF" and abs(2 * train.fundamental / candidate.comb.fundamental - 1) < SAME_FAMILY:
        return None  # an element that strikes one race harder than the other has lines at its spin, too
    free = replace(candidate, comb=train, bearing=None, name="", expected=0.0, rivals=(), share=1.0, in_train=True)
    return _as_part(signals, free)


def _as_part(signals: AnalysisSignals, train: Candidate) -> Candidate:
    """Return the train with the name of the most likely part at its rate, if there is one.

    A cage is slower than everything else. In a short record the first multiples of a slower shaft's race or element run
    into those of its shaft, and the higher ones fall on the orders of a similar bearing on the faster shaft.
    """
    fitting = [
        replace(train, bearing=bearing, name=name, expected=order)
        for bearing, name, order in expected_parts(signals)
        if abs(train.comb.fundamental / order - 1) <= signals.settings.bearing_slip
    ]
    likeliest = max(fitting, key=lambda one: _own_weight(signals, one), default=None)
    return train if likeliest is None else _with_rivals(signals, likeliest)


def _stands_out(signals: AnalysisSignals, candidate: Candidate) -> bool:
    others = tuple(order for _, _, order in expected_parts(signals) if order != candidate.expected)
    slip = signals.settings.bearing_slip
    return stands_out_from_neighbours(candidate.envelope.excess, candidate.comb, slip, others)


def _weight(signals: AnalysisSignals, name: str, slip: float) -> float:
    """Return the weight of a part, given the distance of the lines from its kinematic order.

    Slip scatters by 0.7 %, or 2 % including an error of the speed. Rolling elements and cages are damaged far less
    often than races.
    """
    return exp(-0.5 * (slip / _typical_slip(signals)) ** 2) * (0.3 if name in ("BSF", "FTF") else 1.0)


def _typical_slip(signals: AnalysisSignals) -> float:
    """Return the scatter of a part's order about its kinematic order, including the error of an unconfirmed speed."""
    return 0.02 if speed_is_only_stated(signals) else USUAL_SLIP


def _own_weight(signals: AnalysisSignals, candidate: Candidate) -> float:
    """Return the weight of the candidate's part, given its slip and whether its bearing is the nearest."""
    near = nearest_bearing(signals, candidate.loudest or candidate.envelope.channel)
    slip = candidate.comb.fundamental / candidate.expected - 1
    return _weight(signals, candidate.name, slip) * (1.0 if near in (None, candidate.bearing) else 0.5)


def _with_rivals(signals: AnalysisSignals, candidate: Candidate) -> Candidate:
    """Add what else would show at the same lines.

    These are other parts whose order, or half or twice of it, is within slip of this one; a nearby multiple of the
    shaft, of half of it or of twice the mains; and, for an outer race, unequal elements if lines a cage's order apart
    are as strong.
    """
    weight = _own_weight(signals, candidate)
    parts = expected_parts(signals)
    order_of_part = next(o for b, name, o in parts if (b, name) == (candidate.bearing, candidate.name))
    near = nearest_bearing(signals, candidate.loudest or candidate.envelope.channel)
    others, rivals, of_same_order, differ = 0.0, [], [], False
    for bearing, name, order in parts:
        if (bearing, name) == (candidate.bearing, candidate.name):
            continue
        if name == candidate.name and abs(order / order_of_part - 1) < SAME_BEARING_ORDER:
            of_same_order.append(bearing)
            continue
        multiples = (1.0, 2.0) if candidate.has_odd_lines else (0.5, 1.0, 2.0)
        slip = min((candidate.comb.fundamental / (order * m) - 1 for m in multiples), key=abs)
        if abs(slip) <= slip_of(signals):
            others += _weight(signals, name, slip) * (1.0 if near in (None, bearing) else 0.5)
            rivals.append(f"the {part_text(name, bearing.name)}")
    if beside := _shaft_beside(signals, candidate) or _half_beside(signals, candidate):
        others += 1.0
        rivals.append(beside)
    elif pull := mains_beside(signals, candidate):
        others += _weight_of_pull(signals, candidate)
        rivals.append(pull)
    if candidate.name == "BPFO":
        shallow = min(1.0, (SHALLOW / max(candidate.modulation, 1e-9)) ** 2)
        differ = _elements_differ(signals, candidate)
        others += weight * max(shallow, float(differ))  # at the same order, with the same slip
        if differ:
            rivals.append("a damaged element or cage, whose lines at the cage's spacing are as strong there,")
        elif shallow > 0.5:
            rivals.append("unequal elements passing the load of a healthy race")
    if candidate.of_tones and _rings_in_multiples(signals, candidate):
        others += weight
        rivals.append("steady tones of that rate, without which nothing shows there,")
    elif candidate.of_tones:
        others += weight * AS_BEATS
        rivals.append("beats of steady tones, without which nothing shows there,")
    return replace(
        candidate,
        rivals=tuple(rivals),
        of_same_order=tuple(of_same_order),
        share=weight / (weight + others),
        of_elements=differ,
    )


AS_BEATS = 10.0
"""Odds of beats of tones against impacts, where a family vanishes with the tones."""

AS_NEAR = 1e-3
"""Relative distance up to which a rate's multiples in the vibration and in an envelope are the same."""

NO_ACCIDENT = 1e-6
"""p-value of lines at the multiples of a rate below which tones are not there by accident."""


def _rings_in_multiples(signals: AnalysisSignals, candidate: Candidate) -> bool:
    """Whether a band's own lines are at the multiples of the family's rate; beating tones may be anywhere.

    In a short record impacts, too, ring in steady lines. Only multiples known well against their spacing are used.
    """
    lines, order = signals.order_excess.get(candidate.envelope.channel), candidate.comb.fundamental
    if lines is None:
        return False
    low, high = (edge_hz / signals.frequency_per_order_hz / order for edge_hz in candidate.envelope.band_hz)
    multiples = np.arange(max(1, ceil(low)), min(int(high), int(0.1 / AS_NEAR)) + 1)
    if len(multiples) < MINIMUM_LINES:
        return False
    low, high = order * (1 - AS_NEAR), order * (1 + AS_NEAR)
    comb = best_comb(without_shafts(signals, lines), low, high, offsets=multiples)
    return comb is not None and comb.p_value <= NO_ACCIDENT and len(comb.positions) >= MINIMUM_LINES


def _weight_of_pull(signals: AnalysisSignals, candidate: Candidate) -> float:
    """Return the weight of a supply's magnetic pull at a family's rate, relative to a part at its kinematic order.

    A supply puts it there within its drift, or within the record's resolution; a part anywhere within its slip.
    """
    resolution = candidate.envelope.excess.spectrum.resolution / candidate.comb.fundamental
    return max(1.0, sqrt(2 * pi) * _typical_slip(signals) / (2 * max(MAINS_TOLERANCE, resolution / 2)))


SHALLOW = 0.15
"""Depth of modulation up to which an outer race's order is no more likely damage than elements passing by: unequal
elements, and the varying stiffness as they pass the load, modulate at the same order."""

BESIDE_SHAFT = 0.015
"""Relative distance from a multiple of a shaft within which its line, spread by a varying speed, is a rival."""


def _shaft_beside(signals: AnalysisSignals, candidate: Candidate) -> str:
    """Return the multiple of a shaft beside the family that is at least half as strong; empty if there is none.

    It must be as strong beside half of the lines that the family shows, not the first alone: a line spread by a varying
    speed is spread about each of its multiples.
    """
    spectrum, fundamental = candidate.envelope.excess.spectrum, candidate.comb.fundamental
    seen = [round(position / fundamental) for position in candidate.comb.positions]
    for shaft, order in signals.known_shaft_orders.items():
        k = round(fundamental / order)
        if k < 1 or not 0 < abs(fundamental / (k * order) - 1) <= BESIDE_SHAFT:
            continue
        as_strong = [
            _amplitude_beside(spectrum, m * k * order, m * fundamental)
            >= 0.5 * spectrum.largest_near(m * fundamental, 2 * spectrum.resolution)[1]
            for m in sorted({1, *seen})
        ]
        if as_strong[0] and 2 * sum(as_strong) >= len(as_strong):
            return f"the {k}-fold order of shaft {shaft or 'of reference'}"
    return ""


def _amplitude_beside(spectrum: Spectrum, place: float, strong: float) -> float:
    """Return the largest amplitude within two lines of a place, excluding the lobe of another line that reaches in.

    Two places closer than two lines are the same.
    """
    reach = 2 * spectrum.resolution
    if abs(place - strong) <= reach:
        return spectrum.largest_near(strong, reach)[1]
    near = (np.abs(spectrum.positions - place) <= reach) & (np.abs(spectrum.positions - strong) > 1.25 * reach)
    return float(spectrum.values[near].max(initial=0.0))


BESIDE_DB, ONE_SIDED_DB = 12.0, 6.0
"""Heights over the floor, and over the mirrored place on the other side, at which lines beside multiples of a shaft are
not smeared shaft lines."""


def races_beside_shaft(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope]) -> dict[str, tuple[int, str]]:
    """Return inner races that may show by one line and its sidebands: race → multiple of the shaft beside it, shaft.

    If a race rings from one impact to the next, there are no further multiples; slip may also bring the first so near
    to a whole number of turns that it is taken for the shaft's. This line and its two sidebands then lie at equal
    distances from the shaft's multiples, on one side, whereas a varying speed spreads the multiples to both sides,
    higher ones more. A multiple of another shaft is attributed to that shaft. One band of one channel alone does not
    count: impacts excite more than that, and healthy bearings show as much in one.
    """
    races = {}
    for bearing, name, order in expected_parts(signals):
        shaft = signals.rig.ratio(bearing.shaft)
        k = round(order / shaft) if shaft else 0
        if name != "BPFI" or k < 2 or not shaft:
            continue
        low, high = (order * (1 + side * slip_of(signals)) - k * shaft for side in (-1, 1))
        others = [turns for turns in signals.known_shaft_orders.values() if turns != shaft]
        n_envelopes = 0
        for excess in (envelope.excess for envelope in envelopes):
            values, width = excess.spectrum.values, excess.spectrum.resolution
            off = np.arange(ceil(low / width), int(high / width) + 1) * width
            places = k * shaft + off
            is_free = np.all(
                [np.abs(places - np.rint(places / turns) * turns) >= 2 * width for turns in others], axis=0
            )
            off = off[is_free & (np.abs(off) >= 2 * width), None]
            multiples = np.arange(k - 1, k + 2) * shaft
            here, there = (excess.line_numbers(multiples + side) for side in (off, -off))
            if here.max(initial=0) + 1 >= len(values) or there.max(initial=0) >= len(values):
                continue
            is_peak = values[here] >= np.maximum(values[here - 1], values[here + 1])
            least = np.maximum(10 ** (BESIDE_DB / 20) * excess.floor[here], 10 ** (ONE_SIDED_DB / 20) * values[there])
            n_envelopes += bool(np.any(np.all(is_peak & (values[here] >= least), axis=1)))
        if n_envelopes > 1:
            races[part_text(name, bearing.name)] = k, bearing.shaft
    return races


def parts_on_shaft(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope]) -> dict[tuple[int, str], list[str]]:
    """Return the races that may cause impacts a whole number of times per turn of a shaft, as their slip allows it.

    The k-fold order of the shaft and its next two multiples stand out from the envelope. They are twice as high as all
    other multiples of the shaft between them, except the first and the neighbours one order away, none of which exceeds
    its own carrier. A k-fold order that is a smaller multiple of another shaft is attributed to that shaft: each
    modulates its own mesh.
    """
    parts: dict[tuple[int, str], list[str]] = {}
    turns = tuple(signals.known_shaft_orders.values())
    for bearing, name, order in expected_parts(signals):
        shaft = signals.rig.ratio(bearing.shaft)
        k = round(order / shaft) if shaft else 0
        if k < 2 or not shaft or name not in RACES or abs(order / (k * shaft) - 1) > slip_of(signals):
            continue
        if any(abs(j * turn / (k * shaft) - 1) < SAME_BEARING_ORDER for turn in turns for j in range(1, k)):
            continue
        multiples = np.arange(2, 3 * k + 2)
        is_carrier = multiples % k == 0
        between = ~is_carrier & (multiples % k != 1) & (multiples % k != k - 1)
        for envelope in envelopes:
            spectrum = envelope.excess.spectrum
            if multiples[-1] * shaft >= spectrum.positions[-1]:
                continue
            heights = np.array([spectrum.largest_near(m * shaft, 2 * spectrum.resolution)[1] for m in multiples])
            over_floor_db = envelope.excess.over_floor_db(envelope.excess.line_numbers(multiples[is_carrier] * shaft))
            highest_between = heights[between].max(initial=0.0)
            carriers = np.flatnonzero(is_carrier)
            beside = np.maximum(heights[np.maximum(carriers - 1, 0)], heights[carriers + 1])
            is_alone = heights[is_carrier].min() >= 2 * highest_between and bool(np.all(heights[is_carrier] >= beside))
            if over_floor_db.min() >= 12.0 and is_alone:
                parts.setdefault((k, bearing.shaft), []).append(part_text(name, bearing.name))
                break
    return parts


def _half_beside(signals: AnalysisSignals, candidate: Candidate) -> str:
    """Return the half-integer multiple of a shaft that the family's fundamental is on or beside; empty if none.

    Loose parts cause impacts every other turn: half the shaft's order is then there, too, at least half as strong. If a
    race is on a half-integer multiple, so are its sidebands, and a slower train cannot be distinguished from it.
    """
    spectrum, fundamental = candidate.envelope.excess.spectrum, candidate.comb.fundamental
    reach = 2 * spectrum.resolution
    needed = 0.5 * spectrum.largest_near(fundamental, reach)[1]
    for shaft, order in signals.known_shaft_orders.items():
        k = int(fundamental / order) + 0.5
        is_beside = abs(fundamental / (k * order) - 1) <= BESIDE_SHAFT
        if is_beside and all(spectrum.largest_near(half * order, reach)[1] >= needed for half in (0.5, k)):
            return f"the {k:g}-fold order of shaft {shaft or 'of reference'}, of loose parts,"
    return ""


def mains_beside(signals: AnalysisSignals, candidate: Candidate) -> str:
    """Return the multiple of twice the mains frequency at the family's fundamental: magnetic forces modulate."""
    return magnetic_pull_at(candidate.comb.fundamental * signals.frequency_per_order_hz)


def _elements_differ(signals: AnalysisSignals, candidate: Candidate) -> bool:
    """Whether lines at the cage's order beside multiples of the shaft are as strong as an outer race's own.

    Unequal elements pass the load in turn, once per turn of the cage; an outer race struck by equal elements does not
    show it.
    """
    bearing, excess = candidate.bearing, candidate.envelope.excess
    shaft = signals.rig.ratio(bearing.shaft) if bearing is not None else None
    orders = bearing.orders() if bearing is not None else {}
    if shaft is None or not orders.get("FTF"):
        return False
    cage = candidate.comb.fundamental * orders["FTF"] / orders["BPFO"]
    places = np.array([abs(k * shaft + side * cage) for k in range(6) for side in (-1, 1)])
    own = [excess.over_floor_db(excess.free_lines_at(candidate.comb.fundamental * np.arange(1, 4)))]
    beside = excess.over_floor_db(excess.free_lines_at(np.unique(places)))
    return len(beside) >= 4 and len(own[0]) > 0 and bool(np.median(beside) >= np.median(own[0]) - 6.0)


def nearest_bearing(signals: AnalysisSignals, channel: str) -> Bearing | None:
    """Return the bearing at a channel's location, by the channel's position or name; None if none or several fit.

    A bearing's name fits if it is part of the position or of the channel's name, or if the initials of its words are a
    word there: "drive end" in "X130_DE_time".
    """
    import re

    text = f"{signals.recording.channels[signals.recording.index(channel)].position} {channel}".lower()
    words = set(re.split(r"[^a-z0-9]+", text))
    fitting = []
    for bearing in signals.rig.bearings:
        parts = re.split(r"[^a-z0-9]+", bearing.name.lower().removeprefix("bearing").strip())
        initials = "".join(part[:1] for part in parts)
        if set(parts) <= words or (len(initials) > 1 and initials in words):
            fitting.append(bearing)
    return fitting[0] if len(fitting) == 1 else None


def _known_multiple(signals: AnalysisSignals, candidate: Candidate) -> Candidate | None:
    """Return the candidate as a known part if its fundamental is a low harmonic of that part; paths may hide the first.

    It may equally be something that causes impacts two or three times as often.
    """
    for bearing, name, order in expected_parts(signals):
        for m in (1, 2, 3):
            if abs(candidate.comb.fundamental / (m * order) - 1) <= signals.settings.bearing_slip:
                named = replace(candidate, bearing=bearing, name=name, expected=m * order)
                named = _with_rivals(signals, named)
                return named if m == 1 else replace(named, share=0.5 * named.share)
    return None


def _shares_lines(comb: Comb, surer: Comb) -> bool:
    """Whether most lines of a family are those of a more certain one."""
    shared = [p for p in comb.positions if any(abs(p / q - 1) < 0.005 for q in surer.positions)]
    return len(shared) >= len(comb.positions) / 2
