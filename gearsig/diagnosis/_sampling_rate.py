"""A wrong sampling rate or stated speed: all lines are a factor away from where speed and geometry put them.

Both errors give the same orders, so both are reported. A clock decides between them: the mains, of known frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import log10

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import ShaftAngle, find_offset_comb
from gearsig.checks import FloatArray
from gearsig.diagnosis._lines import SPREAD_OF_STATED, mains_lines, speed_is_confirmed
from gearsig.diagnosis._rotor import derivatives_of_velocity
from gearsig.diagnosis._signals import AnalysisSignals, BandEnvelope
from gearsig.diagnosis._types import CannotTell, Finding, Kind
from gearsig.formatting import sentence, unit_text
from gearsig.prepared import STATED_SPEED_TOLERANCE, LinesOverFloor
from gearsig.recording import RATE_GIVEN
from gearsig.rig import ConstantSpeed, EncoderChannel, TachometerChannel

SAMPLING_RATE = "sampling-rate-doubtful"
"""Code of the finding; it opens the verdict."""

USUAL_FACTORS = (2.0, 2.56, 4.0, 5.0, 8.0, 10.0)
"""Factors by which rates are mistaken, up or down: decimation, a prefix or a digit, bandwidth for rate (2.56)."""

COMMON_RATES_HZ = (
    *(1000.0 * rate for rate in (1, 2, 2.5, 4, 5, 6.25, 8, 10, 12, 12.5, 16, 20, 24, 25, 32, 40, 48, 50, 64, 96, 100)),
    *(2560.0 * 2**power for power in range(7)),  # 2.56 times an analyser's bandwidth
    *(6400.0 * 2**power for power in range(6)),
    *(4096.0 * 2**power for power in range(6)),
    11025.0, 22050.0, 44100.0,
)  # fmt: skip
"""Rates of acquisition systems; if one recording of a set was taken at another of them, the factor is their ratio."""

SLIPS = np.linspace(0.985, 1.015, 61)
"""Of a part's order relative to its kinematic order."""

CLOSE_TOLERANCE = 0.005
"""Of the speed, for distinguishing rates that differ by less than the tolerance of a stated speed."""

SMEAR = 0.003
"""Relative width of a part's lines, as slip makes the intervals of impacts vary."""

NEAR_TOLERANCE = 0.015
"""Of the speed, where only multiples of one order support a rate: a motor's slip under load."""

N_LINES = 12
HIGHEST_ORDER = 12.0
CLEAR_DB = 12.0
"""The strongest lines of a spectrum, up to this order of the shaft: those that a machine's own parts cause."""

ENOUGH_EVIDENCE = -20.0
"""Sum over all spectra of lg p below which a rate explains the lines."""

ENOUGH_OF_EACH = -5.0
"""The same for the shafts' lines alone, and for what the races explain in addition."""

SHARE_OF_STATED = 0.25
"""The stated rate explains nothing if its sum is below this share of another rate's."""

BY_ONE_RACE = 1 / 3
"""Share of another rate's sum at which the shafts and one race at the stated rate are sufficient explanation, or the
shafts alone if that rate is so many times higher that they share few lines with its own."""

FEW_SHARED = 4.5
"""Factor above which less than a quarter of a slower shaft's multiples are those of the stated one."""

SHARE_OF_LEFT = 0.4
"""A lower rate is rejected if the stated one explains the lines that it leaves by this share of its own sum: for
simulated motors 0.25 or less at a rate that is too high, at the right one 0.5 or more for rates 2.5 to 10 times
lower."""

AS_GOOD = 0.6
"""Share of the best factor's sum at which a smaller factor is preferred, if it is far apart."""

FAR_APART = 2.5
"""Ratio of factors above which the larger may stand for a slower shaft that explains a race as well."""

LOWEST_OF_VELOCITY = 0.1
"""Share of a shaft's order below which velocity is mostly the drift of the sensor."""

SLIGHT = 0.12
"""Relative error of a stated speed that is not a slip of the pen: speed of a motor's field, or of another load."""

NAMED_AS_WELL = 0.35
"""Share of the best factor's sum above which another factor is named beside the preferred one."""


def detect_sampling_rate(
    signals: AnalysisSignals, angle: ShaftAngle | CannotTell, envelopes: Sequence[BandEnvelope]
) -> Finding | None:
    """Report that sampling rate or speed is probably wrong, and by which factor; None if nothing indicates it.

    With gears, their comb of mesh lines and sidebands is sought at other multiples of the stated speed. Without gears,
    the strongest lines are explained by shafts and races at each of the usual factors. A tachometer or encoder is
    compared with the nominal speed.
    """
    recording, rig = signals.recording, signals.rig
    source = recording.speed_source
    if isinstance(source, TachometerChannel | EncoderChannel) and isinstance(angle, ShaftAngle):
        return _beside_nominal(signals, angle)
    if rig.pairs:
        return _by_gears(signals, angle)
    if isinstance(source, ConstantSpeed) and signals.angle is not None:
        return _by_lines(signals, envelopes)
    return None


def _finding(
    signals: AnalysisSignals,
    factor: float,
    stated_rpm: float,
    evidence: str,
    also: Sequence[str] = (),
    others: Sequence[float] = (),
    shaft_rpm: float | None = None,
) -> Finding:
    """Return the finding that the true rate is `factor` times the stated one, or the stated speed that times the true.

    Parameters
    ----------
    signals : AnalysisSignals
    factor : float
    stated_rpm : float
        Speed stated for the machine.
    evidence : str
    also : sequence of str
        Other errors with the same effect.
    others : sequence of float
        Further factors that explain nearly as much.
    shaft_rpm : float or None
        The best fitting speed, if the factor is one of a list.
    """
    stated_hz = signals.recording.sampling_rate_hz
    factors = (factor, *others)
    hertz, rpm = [f"{x * stated_hz:.6g} Hz" for x in factors], [f"{stated_rpm / x:.5g} rpm" for x in factors]
    rate = f"{hertz[0]} instead of the stated {stated_hz:.6g} Hz"
    rpm[0] = rpm[0] if shaft_rpm is None else f"{shaft_rpm:.5g} rpm"
    speed = f"{rpm[0]} instead of the stated {stated_rpm:.5g} rpm"
    # The mains show which of the two is right, unless a shaft also turns at their frequency.
    scales = (1.0, factor)
    right, wrong = (mains_lines(signals, scale, scales) if signals.angle else None for scale in scales)
    if wrong and not right:
        what, fits, nearly = "sampling rate", rate, hertz[1:]
        clock = f"Lines of the mains stand at {wrong[1]:.0f} Hz and multiples with {hertz[0]} only."
        surer = "Check the sampling rate."
    elif right and not wrong:
        what, fits, nearly = " or ".join(["stated speed", *also]), speed, rpm[1:]
        clock = f"Lines of the mains stand at {right[1]:.0f} Hz and multiples: the sampling rate is right."
        surer = f"Check the {what}."
    else:
        what, fits = ", ".join(["sampling rate", *also]) + " or stated speed", f"{rate}, or {speed},"
        nearly = [f"{a} or {b}" for a, b in zip(hertz[1:], rpm[1:], strict=True)]
        clock = "Orders are the same with either, and no lines of the mains tell which."
        surer = f"Check the stated speed first, which is quickly measured, then the {' and '.join(['rate', *also])}."
    given = [sentence(text) for text in signals.recording.warnings if text.startswith(RATE_GIVEN)]
    if given:
        surer = "Leave out the sampling rate given (--fs), unless the one stated is known to be wrong."
    return Finding(
        SAMPLING_RATE,
        Kind.DATA_PROBLEM,
        f"The {what} is probably wrong: {fits} would fit best{'; ' if nearly else ''}"
        f"{', or '.join(nearly)}{' nearly as well' if nearly else ''}.",
        confidence=0.9,
        confidence_basis="what the factor explains that the stated figures do not",
        evidence=(evidence, clock, *given),
        surer=surer,
    )


def _power_text(log10_p: float) -> str:
    """Return a probability as text, by its power of ten."""
    power = round(log10_p)
    return unit_text(f"10^{power}") if power < 0 else "1"


def _usual(factor: float, tolerance: float) -> float | None:
    """Return the usual factor, or its reciprocal, within a relative tolerance of a measured one."""
    near = [f for usual in USUAL_FACTORS for f in (usual, 1 / usual) if abs(factor / f - 1) <= tolerance]
    return min(near, key=lambda f: abs(factor / f - 1), default=None)


def _beside_nominal(signals: AnalysisSignals, angle: ShaftAngle) -> Finding | None:
    """Compare a speed measured by the recording's own clock with the nominal one."""
    rig = signals.rig
    nominal_rpm = rig.nominal_speed_rpm(angle.shaft if angle.shaft in rig.shaft_names else "")
    if not nominal_rpm:
        return None
    ratio = angle.mean_speed_rpm / nominal_rpm
    factor = _usual(1 / ratio, rig.operating_point.speed_tolerance_percent / 100)
    if factor is None:
        return None
    evidence = f"The shaft turns at {angle.mean_speed_rpm:.5g} rpm by this clock, {ratio:.3g} times the nominal speed."
    pulses = ("pulses per revolution",) if isinstance(signals.recording.speed_source, TachometerChannel) else ()
    return _finding(signals, factor, nominal_rpm, evidence, pulses)


def _by_gears(signals: AnalysisSignals, angle: ShaftAngle | CannotTell) -> Finding | None:
    recording, rig = signals.recording, signals.rig
    if isinstance(angle, ShaftAngle):
        if not isinstance(recording.speed_source, ConstantSpeed) or speed_is_confirmed(signals):
            return None
        stated_rpm: float | None = 60.0 * signals.frequency_per_order_hz
        elsewhere = signals.offset_comb
    else:
        stated_rpm = rig.nominal_speed_rpm()
        elsewhere = find_offset_comb(recording, rig, stated_rpm) if stated_rpm else None
    factor = None if elsewhere is None else _usual(1 / elsewhere.factor, STATED_SPEED_TOLERANCE)
    if stated_rpm is None or elsewhere is None or factor is None:
        return None
    return _finding(signals, factor, stated_rpm, elsewhere.text, ("number of teeth",))


# --------------------
# Without gears: the rate at which shafts and races explain the strongest lines.
# --------------------


@dataclass(frozen=True)
class StrongLines:
    """The strongest lines of one spectrum over order, at the stated rate.

    Parameters
    ----------
    orders : array, (n_lines,)
    half_width : float
        Largest distance of a line from its place, in orders.
    lowest, highest : float
        Range of orders in which they were sought.
    """

    orders: FloatArray
    half_width: float
    lowest: float
    highest: float


def _strong_lines(excess: LinesOverFloor, highest: float) -> StrongLines | None:
    from scipy.ndimage import maximum_filter1d

    spectrum = excess.spectrum
    lowest = max(4 * spectrum.resolution, 0.02)
    highest = min(highest, float(spectrum.positions[-1]))
    clear = spectrum.values > excess.floor * 10 ** (CLEAR_DB / 20)
    clear &= (spectrum.values >= maximum_filter1d(spectrum.values, 7)) & (spectrum.positions > lowest)
    places = np.flatnonzero(clear & (spectrum.positions < highest))
    places = places[np.argsort(-spectrum.values[places])][:N_LINES]
    if len(places) < 5:
        return None  # too few to rule out chance
    return StrongLines(spectrum.positions[places], 1.5 * spectrum.resolution, lowest, highest)


class StrongSpectra:
    """The strongest lines of several spectra: the chance that this many lie at given places.

    Results needed repeatedly are computed once: the speed that fits the shafts, and the lines that a part explains.

    Parameters
    ----------
    spectra : sequence of StrongLines
    shafts : sequence of float
        Orders of the shafts.
    """

    def __init__(self, spectra: Sequence[StrongLines], shafts: Sequence[float]) -> None:
        self.spectra, self.shafts = spectra, shafts
        self.highest = max((x.highest for x in spectra), default=0.0)
        self._speeds = cache(self._speed_of_shafts)
        self._on_shafts = cache(self._at_shafts)
        self._near_parts = cache(self._at_part)

    def log_p(self, factor: float, parts: Sequence[tuple[float, float]], tolerance: float) -> float:
        r"""Return lg of the chance that this many strong lines lie at the places of shafts and races, in all spectra.

        .. math:: p = T \prod_s \sum_{k \ge m_s} \binom{n_s}{k} c_s^k (1 - c_s)^{n_s - k}

        m of n lines lie at the places, which cover the share c of the range; T is the number of speeds and slips tried.
        The true speed may differ from the stated one by the tolerance, a part's order from its kinematic one by 1.5 %,
        each the same in all spectra. Each multiple of a part has two sidebands on either side: at its shaft's order for
        a race, at the cage's for a rolling element. Uneven intervals of impacts smear a part's lines, higher ones more.
        """
        if not self.spectra:
            return 0.0
        best, n_speeds = self._speeds(factor, tolerance)
        return min(self._log_p_at(speed, n_speeds, parts) for speed in (best, 1 / factor))

    def without(self, factor: float, parts: Sequence[tuple[float, float]]) -> StrongSpectra:
        """Return the lines that shafts and parts leave unexplained at a factor, at the speed that fits them best."""
        if not self.spectra:
            return self
        speed, _ = self._speeds(factor, NEAR_TOLERANCE)
        _, seen = self._on_shafts(speed)
        for part in parts:
            _, _, seen = self._with_part(part, speed, seen)
        left = [replace(x, orders=x.orders[~y]) for x, y in zip(self.spectra, seen, strict=True)]
        return StrongSpectra(left, self.shafts)

    def shaft_speed(self, factor: float) -> float:
        """Return the order of the first shaft, as stated 1, that fits best near a factor."""
        return self._speeds(factor, STATED_SPEED_TOLERANCE)[0]

    def _speed_of_shafts(self, factor: float, tolerance: float) -> tuple[float, int]:
        """Return the speed that puts most lines on the first shaft's, the nearest if several, and the number tried."""
        half_width = min(x.half_width for x in self.spectra)
        n_speeds = min(4001, int(2 * tolerance * max(self.highest, 1.0) / (half_width / 1.5)) + 2)
        speeds = np.linspace(1 - tolerance, 1 + tolerance, n_speeds) / factor
        on_shaft = np.zeros(n_speeds)
        for lines in self.spectra:
            ratio = lines.orders[:, None] / speeds
            beside = np.abs(ratio - np.maximum(np.rint(ratio), 1)) * speeds
            on_shaft += (beside < lines.half_width).sum(axis=0)
        as_many = speeds[on_shaft == on_shaft.max()]
        return float(as_many[int(np.argmin(np.abs(as_many - 1 / factor)))]), n_speeds

    def _at_shafts(self, speed: float) -> tuple[FloatArray, list[NDArray[np.bool_]]]:
        """Return the places of the shafts' multiples, and which lines of each spectrum lie there."""
        places = np.concatenate([np.arange(1, int(self.highest / (s * speed)) + 2) * s * speed for s in self.shafts])
        return places, [_near(lines, places) for lines in self.spectra]

    def _at_part(self, part: float, sideband: float, speed: float) -> list[NDArray[np.bool_]]:
        """Return which lines of each spectrum lie at a part's family, (slip, line)."""
        return [_near_family(lines, part * SLIPS * speed, sideband * speed) for lines in self.spectra]

    def _with_part(
        self, part: tuple[float, float], speed: float, seen: Sequence[NDArray[np.bool_]]
    ) -> tuple[float, int, list[NDArray[np.bool_]]]:
        """Return the slip at which a part explains most further lines, their number, and all lines then explained."""
        near = self._near_parts(*part, speed)
        new = sum((x & ~y).sum(axis=1) for x, y in zip(near, seen, strict=True))
        best = int(np.argmax(new))
        return float(SLIPS[best]), int(new[best]), [x | y[best] for x, y in zip(seen, near, strict=True)]

    def _log_p_at(self, speed: float, n_speeds: int, parts: Sequence[tuple[float, float]]) -> float:
        from scipy.special import betainc

        places, seen = self._on_shafts(speed)
        smeared = np.zeros(0)
        log_p = log10(n_speeds)
        for part, sideband in parts:
            slip, n_new, seen_with_it = self._with_part((part, sideband), speed, seen)
            log_p += log10(3.0)
            if n_new >= 2:
                family = _family(part * slip, sideband, self.highest / speed) * speed
                smeared = np.concatenate([smeared, family])
                seen = seen_with_it
                log_p += log10(len(SLIPS) / 3)
        for lines, on_place in zip(self.spectra, seen, strict=True):
            m, n = int(on_place.sum()), len(lines.orders)
            if not m:
                continue  # this many or more lie there with certainty
            widths = np.concatenate([np.full(len(places), lines.half_width), _smeared(lines, smeared)])
            middles = np.concatenate([places, smeared])
            covered = _covered(middles - widths, middles + widths, lines.lowest, lines.highest)
            log_p += log10(max(float(betainc(m, n - m + 1, covered)), 1e-30))  # the binomial sum in closed form
        return min(0.0, log_p)


def _strong_of_all(spectra: Sequence[LinesOverFloor], shafts: Sequence[float], highest: float) -> StrongSpectra:
    strong = (_strong_lines(excess, highest) for excess in spectra)
    return StrongSpectra([lines for lines in strong if lines is not None], shafts)


def _near(lines: StrongLines, places: FloatArray) -> NDArray[np.bool_]:
    """Return which of the lines lie at one of the places."""
    beside: NDArray[np.bool_] = np.any(np.abs(lines.orders - places[:, None]) < lines.half_width, axis=0)
    return beside


def _smeared(lines: StrongLines, places: FloatArray) -> FloatArray:
    """Return the half widths within which lines of parts count as at their places."""
    widths: FloatArray = np.maximum(lines.half_width, SMEAR * np.abs(places))
    return widths


def _covered(starts: FloatArray, ends: FloatArray, lowest: float, highest: float) -> float:
    """Return the share of a range that some intervals cover together."""
    order = np.argsort(starts)
    starts, ends = (np.clip(x[order], lowest, highest) for x in (starts, ends))
    before = np.concatenate([[lowest], np.maximum.accumulate(ends)[:-1]])
    return float(np.maximum(ends - np.maximum(starts, before), 0.0).sum()) / (highest - lowest)


def _near_family(lines: StrongLines, parts: FloatArray, sideband: float) -> NDArray[np.bool_]:
    """Return which lines lie at a multiple of a part's order or one of its sidebands, (n_parts, n_lines)."""
    carrier = lines.orders - sideband * np.arange(-2, 3)[:, None]  # (n_sidebands, n_lines)
    parts = parts[:, None, None]
    multiple = np.clip(np.rint(carrier / parts), 1, np.floor(lines.highest / parts) + 1)
    reach = _smeared(lines, lines.orders)
    near: NDArray[np.bool_] = np.any(np.abs(carrier - multiple * parts) < reach, axis=1)
    return near


def _family(part: float, sideband: float, highest: float) -> FloatArray:
    """Return the orders of a part's multiples with their sidebands."""
    multiples = part * np.arange(1, int(highest / part) + 2)
    return (multiples[:, None] + sideband * np.arange(-2, 3)).ravel()


def _by_lines(signals: AnalysisSignals, envelopes: Sequence[BandEnvelope]) -> Finding | None:
    spectra = [*signals.order_excess.values(), *(e.excess for e in envelopes)]
    shafts = sorted(signals.known_shaft_orders.values())
    races, parts = (list(_parts(signals, with_elements=so)) for so in (False, True))
    strong_to = cache(partial(_strong_of_all, spectra, shafts))

    def evidence(
        factor: float,
        highest: float,
        tolerance: float = STATED_SPEED_TOLERANCE,
        at: Sequence[tuple[float, float]] | None = None,
    ) -> float:
        """Return lg of the chance that lines up to an order lie this well."""
        at = at if at is not None else parts if factor == 1.0 else races
        return strong_to(highest).log_p(factor, at, tolerance)

    def of_one_part(factor: float) -> float:
        """Return the minimum over one race at a factor; without races, over a part of any order, near fractions."""
        if not races:
            return _of_unknown_part(strong_to(ranges[factor]), factor)
        return min(evidence(factor, ranges[factor], at=[race]) for race in races)

    def has_unknown_part(highest: float, enough: float) -> bool:
        return _of_unknown_part(strong_to(highest)) <= enough

    ones = [*races, *((2 * part, by) for part, by in parts if by and (part, by) not in races)]
    usual, common = _factors(signals.recording.sampling_rate_hz, with_parts=bool(parts))
    candidates = [*usual, *common]
    factors = _apart(candidates)
    # A rate that is too high moves everything up, so that more of the spectrum counts.
    ranges = {factor: HIGHEST_ORDER * max(1.0, 1 / factor) for factor in factors}
    sums = {factor: evidence(factor, ranges[factor]) for factor in factors}
    # One family alone may be the shaft's or a race's at some rate and some speed: both must support a rate that is one
    # of many, and for a usual factor without races the speed must be near the stated one.
    for factor in factors:
        of_shafts = evidence(factor, ranges[factor], at=())
        if max(of_shafts, sums[factor] - of_shafts) > ENOUGH_OF_EACH:
            sums[factor] = 0.0
        if factor in usual and not sums[factor]:
            sums[factor] = evidence(factor, ranges[factor], NEAR_TOLERANCE)
            # Half orders of the shaft mean looseness, multiples blades or poles: shafts alone cannot show such a rate.
            alone = evidence(factor, ranges[factor], NEAR_TOLERANCE, ()) if factor > 2 else 0.0
            if alone < min(sums[factor], evidence(2.0, HIGHEST_ORDER, NEAR_TOLERANCE, ())):
                sums[factor] = alone
    best = min(sums.values())
    if best > ENOUGH_EVIDENCE:
        return None
    factor = _preferred(sums, usual, of_one_part)
    if factor < 1 and races:
        # At a rate k times too high all lines are at multiples of k orders, and a whole k gives those of the shaft and
        # the races as well. The shaft's other orders and a race's first ones decide: at the right rate they are there,
        # and at the lower one nothing would be. Multiples of the shaft's order alone may be blades or poles as well.
        sums[factor] = min(sums[factor], of_one_part(factor))
        of_races = sums[factor] - evidence(factor, ranges[factor], at=())
        left = _of_the_left(strong_to(ranges[factor]), factor, races)
        if of_races > ENOUGH_OF_EACH or left <= SHARE_OF_LEFT * sums[factor]:
            return None
    # If no race is described, impacts of some part need no wrong rate as explanation, and its order may be near a
    # fraction of the shaft's. The same holds for a part missing from the rig beside the shaft's own orders.
    if (not races or factor < 1) and has_unknown_part(ranges[factor], sums[factor] if races else AS_GOOD * best):
        return None
    for milder in sorted(f for f in factors if f in usual and 1 < f <= factor / FAR_APART):
        of_one = of_one_part(milder)
        if of_one <= AS_GOOD * best:
            factor, sums[milder] = milder, of_one
            break
    others = sorted((f for f in factors if f != factor and sums[f] <= NAMED_AS_WELL * best), key=lambda f: sums[f])
    # With all parts of all bearings nearly every order is some part's, and lines there say nothing: one race at a time
    # says more. In a short record q times its order is a whole number, and all of its lines are then also those of a
    # shaft that turns q times slower.
    of_shafts = evidence(1.0, ranges[factor], at=())
    by_one_race = min((evidence(1.0, ranges[factor], at=[race]) for race in races), default=0.0)
    # If some race has nearly 18 impacts in five turns, or a cage two, all lines are at multiples of a fifth. Few lines
    # of a shaft that turns so slowly would be the stated one's; of four times, also those of a motor's supply.
    by_shafts = factor > FEW_SHARED and of_shafts <= BY_ONE_RACE * sums[factor]
    by_race = factor > 1 and by_one_race - of_shafts <= ENOUGH_OF_EACH and by_one_race <= BY_ONE_RACE * sums[factor]
    if by_shafts or by_race:
        return None
    stated, explained, highest = evidence(1.0, ranges[factor]), sums[factor], ranges[factor]
    # The same holds for one race or element, which strikes twice a spin: no error of the rate is needed.
    by_one_part = min((evidence(1.0, highest, CLOSE_TOLERANCE, at=[part]) for part in ones), default=0.0)
    stands = (factor < 1 and _turns_as_stated(signals)) or (
        (factor > 1 or not races)
        and (stated < SHARE_OF_STATED * explained or evidence(1.0, highest, CLOSE_TOLERANCE, ()) <= explained)
    )
    if by_one_part <= AS_GOOD * explained or stands:
        return None
    close = (f for f in candidates if abs(f / factor - 1) <= STATED_SPEED_TOLERANCE)
    factor = min(close, key=lambda f: evidence(f, highest, CLOSE_TOLERANCE))
    return _finding(
        signals,
        factor,
        60.0 * signals.frequency_per_order_hz,
        f"The strongest lines of {len(spectra)} spectra then lie at orders of shafts and races: by chance as many with "
        f"a probability of {_power_text(explained)}, were the spectra independent; with what is stated, of "
        f"{_power_text(stated)}.",
        others=others[:2],
        shaft_rpm=60.0 * signals.frequency_per_order_hz * strong_to(highest).shaft_speed(factor),
    )


def _turns_as_stated(signals: AnalysisSignals) -> bool:
    """Whether the largest velocity of a channel is at the stated order of a shaft.

    If the rate were too high or the speed too low by a factor, nothing would turn so slowly: below the line of blades
    there is the one of their unbalanced wheel.
    """
    for channel, excess in signals.order_excess.items():
        orders = excess.spectrum.positions
        beyond = orders > LOWEST_OF_VELOCITY * min(signals.known_shaft_orders.values())
        clear = beyond & (excess.spectrum.values > excess.floor * 10 ** (CLEAR_DB / 20))
        if clear.any():
            per_order = orders[clear] ** float(derivatives_of_velocity(signals, channel))
            top = float(orders[clear][np.argmax(excess.spectrum.values[clear] / per_order)])
            if any(abs(top / turns - 1) <= SPREAD_OF_STATED for turns in signals.known_shaft_orders.values()):
                return True
    return False


def _preferred(sums: dict[float, float], usual: Sequence[float], of_one_part: Callable[[float], float]) -> float:
    """Return the factor that explains most, and lower `sums` by what one race explains at the factors near it.

    A sum includes all places; but if q times a race's order is nearly a whole number, a shaft that turns q times slower
    explains shaft and race together. So the smallest factor that explains nearly as much yields only to one less than
    `FAR_APART` times as large. The usual factors take precedence over ratios to common rates, which are many, and a
    slightly wrong stated speed over both. For a rate that is too low, one damaged race says more than all races, whose
    places cover much of the range.
    """
    as_good = [f for f in sums if sums[f] <= AS_GOOD * min(sums.values())]
    slight = [f for f in as_good if abs(f - 1) <= SLIGHT]
    if slight and min(sums, key=lambda f: sums[f]) > 1:  # a slower shaft has the stated shaft's lines and more
        return min(slight, key=lambda f: sums[f])
    as_good = [f for f in as_good if f in usual] or as_good
    near = [f for f in as_good if f < FAR_APART * min(as_good)]
    if len(near) > 1:
        sums |= {f: min(sums[f], of_one_part(f)) for f in near if f > 1}
    return min(near, key=lambda f: sums[f])


def _of_the_left(strong: StrongSpectra, factor: float, races: Sequence[tuple[float, float]]) -> float:
    """Return lg p of shafts and one race, modulated or not, at the stated rate, for the lines that a factor leaves."""
    left = strong.without(factor, races)
    ones = [[(race, sideband)] for race, by in races for sideband in (by, 0.0)]
    return min(left.log_p(1.0, at, CLOSE_TOLERANCE) for at in ((), *ones))


def _of_unknown_part(strong: StrongSpectra, factor: float = 1.0) -> float:
    """Return lg p of shafts and one part of unknown order, that of a strong line, at a factor times the stated rate.

    Its impacts are constant in strength, or modulated by the shaft. If impacts are at no known order and nothing else
    shows, this is more likely than a rate that puts them on a shaft or a race.
    """
    orders = sorted({round(float(order), 2) for x in strong.spectra for order in x.orders if order > 0.3})
    tried = [(factor * order, sideband) for order in orders for sideband in (0.0, *strong.shafts)]
    sums = (strong.log_p(factor, [part], CLOSE_TOLERANCE) for part in tried)
    return min(sums, default=0.0) + log10(max(len(tried), 1))


def _factors(stated_hz: float, *, with_parts: bool) -> tuple[list[float], list[float]]:
    """Return the factors to try: the usual ones, and those to common rates.

    Half orders of the shaft mean looseness, multiples blades or poles: distinguishing these rates takes races.
    """
    usual = [f for factor in USUAL_FACTORS for f in (factor, 1 / factor) if with_parts or f > 2]
    common = [rate / stated_hz for rate in COMMON_RATES_HZ if with_parts and 0.2 <= rate / stated_hz <= 5.0]
    return usual, [f for f in common if abs(f - 1) > STATED_SPEED_TOLERANCE]


def _apart(factors: Sequence[float]) -> list[float]:
    """Return the first of the factors that are equal within the speed's tolerance."""
    apart: list[float] = []
    for factor in factors:
        if all(abs(factor / other - 1) > STATED_SPEED_TOLERANCE for other in apart):
            apart.append(factor)
    return apart


def _parts(signals: AnalysisSignals, *, with_elements: bool) -> Iterator[tuple[float, float]]:
    """Yield the order of each bearing part, and of what modulates its impacts: the shaft, or the cage.

    An element passes the load once per turn of the cage. Elements and cage may support only the stated rate: n elements
    pass an outer race, so that all of its lines would be the cage's at 1/n of the rate.
    """
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft)
        if ratio is None:
            continue
        orders = {part: ratio * order for part, order in bearing.orders().items()}
        yield from ((orders[part], ratio) for part in ("BPFO", "BPFI") if part in orders)
        if with_elements and "BSF" in orders and "FTF" in orders:
            yield from ((orders["BSF"], orders["FTF"]), (orders["FTF"], 0.0))
