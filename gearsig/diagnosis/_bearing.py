"""Bearings: families of lines in the envelope, at orders of known bearings or at orders the rig does not explain."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil, inf
from statistics import median_high

import numpy as np
from scipy.fft import irfft, next_fast_len, prev_fast_len, rfft
from scipy.signal.windows import hann

from gearsig.checks import FloatArray
from gearsig.diagnosis._bearing_families import (
    BEARING_PARTS,
    BESIDE_SHAFT,
    N_MULTIPLES,
    RACES,
    USUAL_SLIP,
    Candidate,
    Families,
    clearest_family,
    doubtful_races,
    expected_parts,
    find_families,
    mains_beside,
    part_text,
    parts_on_shaft,
    races_beside_shaft,
    races_in_vibration,
    slip_of,
    speed_is_only_stated,
    underlying_impulse_train,
)
from gearsig.diagnosis._lines import N_COUNTED, hunting_multiple, possible_speed_factor, speed_is_confirmed
from gearsig.diagnosis._rotor import possible_half_speed_text
from gearsig.diagnosis._signals import AnalysisSignals, BandEnvelope, KurtogramBand, without_shafts, witness_text
from gearsig.diagnosis._types import (
    WITH_ASSUMED_DATA,
    Finding,
    Kind,
    Strength,
    Where,
    cannot_tell,
    from_p_value,
    p_text,
)
from gearsig.formatting import enumerated, named, percent, sentence, signed
from gearsig.prepared import LOG_RATIO_LIMIT, score_needed
from gearsig.rig import Rig

CLEAR_MODULATION, USUAL_MODULATION, USUAL_OF_RACES = 0.05, 0.1, 0.2
"""Depth of the strongest envelope line above which a part is called damaged, not just worth watching: with a reference,
which shows the effect of the bearing's waviness and play; and without one, for elements and cages, and for races. Of
measured bearings, healthy ones have lines of 3 to 20 % at the orders of races, damaged races of 58 to 80 %, a damaged
ball of 12 %."""

MAX_PARTS = 2
"""Number of parts that may be damaged at once; families at more orders are more likely to have another cause."""

SHARED_BY_OTHERS = 0.5
"""Factor where impacts of another machine, a belt or an unknown shaft explain the lines as well as the part does."""

WITH_STATED_SPEED, AT_ANOTHER_SPEED = 0.85, 0.5
"""Factors where the speed is stated and only the family itself confirms it, and where another speed is as likely. The
latter holds if the family lies beyond a bearing's slip, so that it is the part's only if the stated speed is wrong; if
it lies beyond the usual slip and is an element's or a cage's, which are rarer than wrong speeds; or if the shafts'
lines also fit a whole multiple of the speed, so that it is the part's only if the stated speed is right."""

WORTH_A_SUSPICION = 0.3
"""Below this confidence a family at a part's order is only a notice: other causes together are more likely."""

IMPULSIVE_MOMENT, LATER_LINES = 0.15, 0.06
"""Third moment of a race's profile (`impact_profile_measures`), and power of its third to sixth lines relative to the
first two, below which no impacts cause it. Exponentials, however slowly they decay, have 0.5 to 0.9 and, with intervals
that scatter by 3 %, 0.13 to 0.9; damaged races in recordings and simulations 0.21 to 1.1 and 0.11 to 1.4, healthy ones
modulated by play, waviness and passing elements −0.4 to 0.16, or 0 to 0.04."""

ONE_TO_THREE = np.arange(1.0, 4.0)
"""Multiples of a race's order that must not coincide with a shaft's for its profile to be known."""

BLOCK_INTERVALS = 8
"""Impact intervals in a block: slip hardly spreads the first six multiples over so many."""

IF_SMOOTH, IF_SMOOTH_BESIDE = 0.25, 0.5
"""Factors on a family that no impacts cause: without a reference, where one of 22 such races was damaged; and with one,
which shows the effect of play and waviness."""

OTHER_MAKE = 0.04
"""Largest relative difference of order between two makes of a bearing of the same designation."""

SLIPS = (-0.45, -0.3, -0.18, -0.09, 0.0, 0.09, 0.18, 0.3, 0.45)
"""Nine typical slips relative to the range searched: deciles of their distribution, for a range of 2.8 deviations."""

WOULD_SHOW = 0.8
"""Share of the slips at which damage to a race must show for "no damage shows" to be said, which is also the confidence
stated. For elements and cages, which seldom fail first, half of the slips are enough."""


def detect_bearings(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    kurtogram_bands: Sequence[KurtogramBand] = (),
    is_as_before: Callable[[Where], bool] = lambda _: False,
) -> list[Finding]:
    """Identify the damaged part if the rig gives the bearing; else report families that nothing known explains.

    The bands selected by the kurtograms are searched like the others, and add evidence on a race found. Lines as strong
    in the healthy machine's recording are no reason to suspect that a bearing has been damaged since.
    """
    cleaned = [
        replace(envelope, excess=without_shafts(signals, envelope.excess))
        for envelope in (*envelopes, *(kurtogram_band.envelope for kurtogram_band in kurtogram_bands))
    ]
    if signals.angle is None:
        return list(_over_frequency(signals, cleaned))
    if signals.angle.n_revolutions < signals.settings.minimum_revolutions:
        title = f"Bearings cannot be examined: the record holds {signals.angle.n_revolutions:.3g} revolutions and "
        title += f"{signals.settings.minimum_revolutions} are needed."
        short = cannot_tell("bearings-not-examined", title, surer="A longer recording.")
        return [short] if signals.rig.bearings else []
    families = find_families(signals, cleaned)
    families = replace(
        families,
        named=tuple(map(_with_impact_profile, families.named)),
        trains=tuple(map(_with_impact_profile, families.trains)),
    )
    findings = []
    for candidate in families.named:
        finding = _named_finding(signals, candidate, len(families.named))
        order, band_hz = candidate.comb.fundamental, candidate.envelope.band_hz
        witnesses = witness_text(kurtogram_bands, candidate.envelope.channel, band_hz, order)
        findings.append(replace(finding, evidence=(*finding.evidence, *witnesses)))
    trains = [
        _unnamed_finding(signals, c) if c.bearing is None else _named_finding(signals, c, 1) for c in families.trains
    ]
    # A train of another machine explains a part as well: then the bearings are not reported as healthy.
    claimed = any(f.is_claim for f in (*findings, *(f for f in trains if not f.where.bearing)))
    findings += trains
    if not claimed and signals.rig.bearings and cleaned:
        fixed = cleaned[: len(envelopes)]  # the band in which damage rings is unknown; a kurtogram's band depends on it
        findings += _none_shows(signals, fixed, families, is_as_before)
    return findings


# Families found.


def _named_finding(signals: AnalysisSignals, candidate: Candidate, n_parts: int) -> Finding:
    bearing = candidate.bearing
    assert bearing is not None  # noqa: S101 - a named candidate has one; narrows the type
    part = BEARING_PARTS[candidate.name][0]
    slip, only_stated = candidate.comb.fundamental / candidate.expected - 1, speed_is_only_stated(signals)
    is_beyond_slip = only_stated and abs(slip) > signals.settings.bearing_slip
    times = possible_speed_factor(signals)
    is_shared = candidate.name == "FTF" or candidate.in_train or n_parts > MAX_PARTS
    width = 2.0 * candidate.envelope.excess.spectrum.resolution
    is_hunting = candidate.name == "FTF" and hunting_multiple(signals, candidate.comb.fundamental, width) is not None
    is_smooth = candidate.is_smooth

    confidence = from_p_value(candidate.p_value) * candidate.share
    confidence *= WITH_ASSUMED_DATA if signals.rig.assumed else 1.0
    if_smooth = IF_SMOOTH_BESIDE if signals.has_reference else IF_SMOOTH
    confidence *= SHARED_BY_OTHERS ** (is_shared + is_hunting) * (if_smooth if is_smooth else 1.0)
    is_of_other_speed = is_beyond_slip or times > 1
    if only_stated or is_of_other_speed:
        is_likely = (candidate.name in RACES or abs(slip) <= USUAL_SLIP) and not is_of_other_speed
        confidence *= WITH_STATED_SPEED if is_likely else AT_ANOTHER_SPEED
    is_open = is_shared or is_smooth or is_of_other_speed
    alone = USUAL_OF_RACES if candidate.name in RACES else USUAL_MODULATION
    depth = CLEAR_MODULATION if signals.has_reference else alone
    is_weak = candidate.modulation < depth
    if not signals.has_reference:
        confidence *= float(np.clip(candidate.modulation / USUAL_MODULATION, 0.5, 1.0))
    clear = not (is_open or is_weak) and confidence >= 0.75
    suspected = Kind.SUSPICION if confidence >= WORTH_A_SUSPICION else Kind.NOTICE

    place = f"the {part} of {_bearings_named(candidate)}"
    if candidate.of_elements:
        place += ", or at its rolling elements or cage"
    title = f"{'Damage' if clear else 'Perhaps damage'} at {place}."
    if is_smooth:
        title = f"Modulation at the order of {place}, unlike impacts."
    if is_beyond_slip:
        title = f"May be {place}: the speed is stated and not confirmed."
    if times > 1:
        title = f"May be {place}, or the sampling rate or the stated speed is wrong by a factor."
    evidence = list(_named_evidence(signals, candidate, times, is_weak=is_weak, is_smooth=is_smooth))
    if is_hunting:
        evidence.append("A multiple of a hunting-tooth order is there too: teeth that differ from each other cause it.")
    if n_parts > MAX_PARTS:
        evidence.append(f"{n_parts} parts show at once, which a single other source of impacts would explain as well.")
    surer = "Another sensor nearer to it."
    if not signals.has_reference:
        surer = "A recording of the same bearing when it was healthy, or another sensor nearer to it."
    return Finding(
        "bearing-" + part.replace(" ", "-"),
        Kind.FAULT if clear else suspected,
        title,
        _where(signals, candidate),
        _strength(candidate),
        confidence,
        f"chance that lines fit the order this well {p_text(candidate.p_value)} "
        "(all parts, bands, channels tried); never above 95 %, as only one recording is used",
        tuple(evidence),
        surer,
    )


def _named_evidence(
    signals: AnalysisSignals, candidate: Candidate, times: int, *, is_weak: bool, is_smooth: bool
) -> Iterator[str]:
    """Yield the evidence for a part, and what else would show in the same way."""
    slip = signed(100 * (candidate.comb.fundamental / candidate.expected - 1), 2)
    yield f"{_family_text(candidate)}, {slip} % from the kinematic order {candidate.expected:.4f}."
    yield _modulation_text(candidate) + (" Waviness of healthy races gives as much." if is_weak else "")
    if candidate.of_same_order:
        yield "Bearings of the same orders cannot be told apart by their envelope."
    for rival in candidate.rivals:
        yield f"Within its slip, {rival} would show at the same order."
    if times > 1:
        yield sentence(_other_speed_text(times))
    elif speed_is_only_stated(signals):
        yield "The speed is stated, and no line of a shaft or mesh confirms it."
    if candidate.name == "FTF":
        yield "Belts and other machines at the same rate look the same: lines at the cage's order alone."
    elif candidate.in_train:
        yield "The rate is that of a train of lines: another machine's or a belt's would look the same."
    if is_smooth:
        yield "Play, waviness and elements that pass the load modulate in this way; impacts rise at once and ring down."


def _other_speed_text(times: int) -> str:
    """Return a clause on which lines of the shafts stand out, and what else would cause them."""
    return (
        f"all lines of shafts and meshes that stand out are at multiples of {times} times their order: those of shafts "
        f"that turn {times} times as fast as stated, or of a sampling rate stated as many times too high, where every "
        "part has another order"
    )


def _with_impact_profile(candidate: Candidate) -> Candidate:
    """Mark a family as smooth if the modulation at a race's order is not by impacts, beyond three standard errors."""
    envelope, over_angle = candidate.envelope, candidate.envelope.over_angle
    order, excess = candidate.comb.fundamental, envelope.excess
    if candidate.name not in RACES or over_angle is None or len(excess.free_lines_at(order * ONE_TO_THREE)) < 3:
        return candidate
    # Shafts' lines that are as strong as the race's, or stronger, would distort its profile.
    values, per_revolution = over_angle.values(envelope.channel), over_angle.samples_per_revolution
    n = prev_fast_len(len(values), real=True)
    # Keep only the lines of N_MULTIPLES, half an interval beyond, and the window's foot.
    n_kept = min(n, next_fast_len(int(2 * (N_MULTIPLES + 2) * n * order / per_revolution), real=True))
    lines = rfft(values[:n])[: n_kept // 2 + 1]
    numbers = excess.line_numbers(np.arange(len(lines)) * per_revolution / n)
    lines[excess.masked[np.clip(numbers, 0, len(excess.masked) - 1)]] = 0
    profile = impact_profile_measures(irfft(lines, n_kept) * (n_kept / n), per_revolution * n_kept / (n * order))
    if profile is None:
        return candidate
    (moment, moment_error), (later, later_error) = profile
    is_smooth = moment + 3 * moment_error < IMPULSIVE_MOMENT or later + 3 * later_error < LATER_LINES
    return replace(candidate, is_smooth=is_smooth)


def impact_profile_measures(
    values: FloatArray, samples_per_interval: float
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    r"""Return two measures of whether an envelope's profile over the interval of a race is that of impacts.

    Impacts rise at once and ring down: the bispectrum of their envelope has phases from 0 (short) to −90° (saw tooth),
    that of dips between impacts 180°. With :math:`C_k` the Fourier coefficients of blocks of eight intervals, short
    enough for slip not to matter, the third moment is

    .. math:: \operatorname{Re} e^{i\pi/4} \sum_{k + l \le 6} \langle C_k C_l C_{k+l}^* \rangle
        \Big/ \Big(\sum_k \langle |C_k|^2 \rangle - n_k\Big)^{3/2}

    where the noise n is taken half way to the next multiples. It does not depend on where in an interval a block
    begins.

    Parameters
    ----------
    values : ndarray, shape (n,)
        An envelope.
    samples_per_interval : float
        Samples from one impact to the next.

    Returns
    -------
    ((float, float), (float, float)) or None
        The third moment, and the power of the third to sixth multiples over that of the first two, each with its
        standard error. None with fewer than eight blocks or six multiples, or where the noise has more power.
    """
    n, at_most = round(BLOCK_INTERVALS * samples_per_interval), 2000
    n_blocks = min(2 * len(values) // n - 1, at_most) if n else 0
    if n_blocks < 8 or samples_per_interval < 2 * (N_MULTIPLES + 1):
        return None
    starts = np.linspace(0, len(values) - n, n_blocks).astype(np.int64)
    window = hann(n, sym=False) / (n / 2)
    numbers = np.arange(1.0, N_MULTIPLES + 1)
    waves = window[:, None] * np.exp(
        -2j * np.pi * np.outer(np.arange(n) / samples_per_interval, np.append(numbers, np.append(0.5, numbers + 0.5)))
    )
    mean = float(np.mean(values))
    lines = np.array([(values[start : start + n] - mean) @ waves for start in starts])
    lines, between = lines[:, :N_MULTIPLES], np.mean(np.abs(lines[:, N_MULTIPLES:]) ** 2, axis=0)
    noise = (between[:-1] + between[1:]) / 2
    power = np.mean(np.abs(lines) ** 2, axis=0) - noise
    if power.sum() < noise.sum() or power[:2].sum() <= 0:
        return None
    pairs = [(i, j) for i in range(N_MULTIPLES) for j in range(N_MULTIPLES - 1 - i)]
    products = sum(lines[:, i] * lines[:, j] * lines[:, i + j + 1].conj() for i, j in pairs)
    moments = np.real(np.exp(1j * np.pi / 4) * products) / power.sum() ** 1.5
    later_error = np.sqrt(np.sum(noise[2:] * (noise[2:] + 2 * np.maximum(power[2:], 0))) / n_blocks)
    return (
        (float(moments.mean()), float(moments.std() / np.sqrt(n_blocks))),
        (float(power[2:].sum() / power[:2].sum()), float(later_error / power[:2].sum())),
    )


def _bearings_named(candidate: Candidate) -> str:
    """Return the bearing's name, with those that cannot be distinguished from it."""
    bearings = [b for b in (candidate.bearing, *candidate.of_same_order) if b is not None]
    names = " or ".join(f"{b.name} on {named('shaft', b.shaft)}" for b in bearings)
    if len({b.shaft for b in bearings}) == 1:
        names = f"{' or '.join(b.name for b in bearings)} on {named('shaft', bearings[0].shaft)}"
    return named("bearing", names)


def _unnamed_finding(signals: AnalysisSignals, candidate: Candidate) -> Finding:
    order = candidate.comb.fundamental
    where, confidence = _where(signals, candidate), from_p_value(candidate.p_value, limit=0.99)
    near = [  # a wrong speed makes the difference
        f"Shaft {name or 'of reference'} is near (order {shaft:.4f}, {signed(100 * (order / shaft - 1), 2)} %): "
        "the speed may be wrong by as much."
        for name, shaft in signals.known_shaft_orders.items()
        if abs(order / shaft - 1) <= 0.03
    ]
    near += _race_beyond_slip(signals, candidate)
    mains = mains_beside(signals, candidate)
    n_lines = round(max(candidate.comb.positions, default=order) / order)  # the fundamental is known better by this
    width = 2.0 * candidate.envelope.excess.spectrum.resolution / n_lines
    multiple_of = None if mains else hunting_multiple(signals, order, width)
    hunting = multiple_of[1] if multiple_of is not None else ""
    multiple, shaft = _shaft_as_stated(signals, candidate)
    # A shaft may well turn at this rate; an impact every other turn is no more likely than an unknown part.
    is_shafts = (multiple > 0 and multiple.is_integer()) or bool(near and not speed_is_confirmed(signals))
    strong = candidate.modulation >= CLEAR_MODULATION and not (is_shafts or mains or hunting)
    causes = ["The usual cause is a rolling bearing that is not in the rig file; or it is a belt or another machine."]
    if mains:
        causes = [f"It is the rate of {mains}, or of what that supply feeds."]
    elif hunting:
        causes = [f"It is {hunting}: teeth that differ from each other, or one that is damaged, meet at that rate."]
    elif candidate.in_train:
        causes = ["The rate is low for a race: another machine, a belt or a shaft not in the rig file causes it."]
        beside = [
            part_text(name, bearing.name)
            for bearing, name, part in expected_parts(signals)
            if abs(part / order - round(part / order)) * order <= slip_of(signals) * part and part > order
        ]
        if beside:
            by_density = "only because they are dense: that is no damage there"
            causes.append(f"Multiples fall near the order of the {', '.join(beside)} {by_density}.")
    if (times := possible_speed_factor(signals)) > 1:
        causes.append(sentence(_other_speed_text(times)))
    surer = "Give the bearings in the rig file: then the part is identified, or they are ruled out."
    explained = _unexplained_by(signals.rig)
    if shaft and not multiple.is_integer():
        causes.append("Loose or rubbing parts strike every other turn.")
    if hunting:
        explained, surer = f"is {hunting}", ""
    if shaft:
        explained, surer = f"may be {shaft} itself: the speed is stated and taken as constant", "A tachometer."
    return Finding(
        "non-synchronous-impacts",
        Kind.SUSPICION if strong else Kind.NOTICE,
        f"Impacts at order {order:.4f} of {where.order_shaft or 'the shaft'} ({signals.hertz_text(order)}), which "
        f"{explained}.",
        where,
        _strength(candidate),
        confidence,
        f"{_family_basis(candidate)}, all orders and bands tried; what causes it is not known",
        (f"{_family_text(candidate)}.", _modulation_text(candidate), *near, *causes),
        "" if signals.rig.bearings and not shaft else surer,
    )


def _race_beyond_slip(signals: AnalysisSignals, candidate: Candidate) -> Iterator[str]:
    """Yield the nearest race, if its order differs by a little more than slip explains."""
    order = candidate.comb.fundamental
    races = [(part, name, bearing.name) for bearing, name, part in expected_parts(signals) if name in RACES]
    part, name, bearing = min(races, key=lambda race: abs(order / race[0] - 1), default=(inf, "", ""))
    if slip_of(signals) < abs(order / part - 1) <= OTHER_MAKE:
        further = signed(100 * (part / order - 1), 1)
        yield (
            f"The {part_text(name, bearing)} would have impacts at order {part:.4f}, {further} %: more than slip, but "
            "a bearing of another make or contact angle may differ by as much."
        )


def _shaft_as_stated(signals: AnalysisSignals, candidate: Candidate) -> tuple[float, str]:
    """Return the multiple or half of a shaft's order beside a family, as a number and in words; (0, "") if none.

    Only for a stated speed taken as constant. If the true speed varies, the shaft's lines spread; so do those of a race
    whose order is nearly a whole number: with its sidebands they form a train at a rate beside the shaft's.
    """
    if signals.angle is None or signals.angle.method != "constant":
        return 0.0, ""
    order = candidate.comb.fundamental
    for name, turns in signals.known_shaft_orders.items():
        k = round(2 * order / turns) / 2
        reach = N_COUNTED if k.is_integer() else N_MULTIPLES  # a wheel's blades, or halves
        if 0 < k <= reach and abs(order / (k * turns) - 1) <= BESIDE_SHAFT:
            return k, f"{f'{k:g}× ' if k != 1 else ''}{named('shaft', name) or 'the shaft'}"
    return 0.0, ""


def _unexplained_by(rig: Rig) -> str:
    """Return the words for what does not explain impacts: nothing in the rig, or only the shaft of known speed."""
    if not any(shaft.name for shaft in rig.shafts):
        return "the shaft does not explain"
    kinds = ["shaft", *(["gear"] if rig.pairs else []), *(["bearing"] if rig.bearings else [])]
    return f"no {enumerated(kinds, 'or')} of the rig explains"


def _over_frequency(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> Iterator[Finding]:
    """Without a speed, yield the clearest family of the envelope over frequency, without a cause."""
    end_hz = min((float(e.excess.spectrum.positions[-1]) for e in envelopes), default=0.0)
    best = clearest_family(envelopes, 4.0, min(1000.0, end_hz / 4))
    if best is None or best.p_value > signals.settings.false_alarm_probability:
        return
    train = underlying_impulse_train(best.envelope.excess, best.comb)
    if train is not None:
        best = replace(best, comb=train, in_train=True)
    confidence, hertz = from_p_value(best.p_value, limit=0.99), best.comb.fundamental
    yield Finding(
        "periodic-impacts",
        Kind.NOTICE,
        f"The signal is modulated periodically at {hertz:.5g} Hz; the cause cannot be told.",
        replace(_where(signals, best), order=None, frequency_hz=hertz),
        _strength(best),
        confidence,
        _family_basis(best),
        (f"{_family_text(best)}.", _modulation_text(best)),
        "Give the shaft speed: then shafts, gears and bearings can be told apart.",
    )


def _where(signals: AnalysisSignals, candidate: Candidate) -> Where:
    shaft, name = (candidate.bearing.shaft, candidate.bearing.name) if candidate.bearing else ("", "")
    where = signals.where(candidate.comb.fundamental, candidate.envelope.channel, shaft=shaft, bearing=name)
    return replace(where, band_hz=candidate.envelope.band_hz)


def _strength(candidate: Candidate) -> Strength:
    comb, (low, high) = candidate.comb, candidate.envelope.band_hz
    floor_is = f"noise floor of the envelope spectrum, band {low:.0f} to {high:.0f} Hz"
    unit = candidate.envelope.excess.spectrum.unit
    return Strength(comb.amplitude, unit, comb.floor, floor_is, max(comb.ratios_db, default=None))


def _family_basis(candidate: Candidate) -> str:
    return f"that the family exists: its chance in noise {p_text(candidate.p_value)}"


def _family_text(candidate: Candidate) -> str:
    comb, n = candidate.comb, 6
    if candidate.in_train:  # then all multiples up to its last line were examined
        n = round(comb.positions[-1] / comb.fundamental) if comb.positions else 0
    ratios = ", ".join(f"{r:.0f}" for r in comb.ratios_db[:6]) + (", …" if len(comb.ratios_db) > 6 else "")
    return (
        f"{len(comb.positions)} of {n} harmonics of {comb.fundamental:.4f} stand out in the "
        f"envelope of {candidate.envelope.channel} ({ratios} dB over the floor)"
    )


def _modulation_text(candidate: Candidate) -> str:
    return f"The strongest line is {100 * candidate.modulation:.1f} % of the mean envelope."


# Bearings in which nothing shows: healthy as far as damage would have shown, else undecided.


def _none_shows(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    families: Families,
    is_as_before: Callable[[Where], bool],
) -> list[Finding]:
    """Report that nothing shows, as far as damage would have shown, and which parts could not have shown it."""
    where = Where(channels=tuple(dict.fromkeys(e.channel for e in envelopes)))
    reason = next(_reasons_to_leave_open(signals, envelopes, families, is_as_before), None)
    if reason is not None:
        return [_undecided(*reason, where)]
    # For each part of each bearing, the depth of modulation above which it would have shown.
    expected = expected_parts(signals)
    probability = signals.settings.false_alarm_probability / max(1, len(expected) * len(envelopes))
    depths = {
        (bearing.name, name): smallest_depth(
            envelopes, order, slip_of(signals), probability, WOULD_SHOW if name in RACES else 0.5
        )
        for bearing, name, order in expected
    }
    examined = _examined(signals, depths)
    if not examined:
        why = f"a modulation of {percent(CLEAR_MODULATION)} would not have stood out at the orders of their races"
        return [_undecided(why, "A longer recording: the floor of the envelope spectrum falls with its root.", where)]
    shown = {key: depth for key, depth in depths.items() if key[0] in examined and depth <= CLEAR_MODULATION}
    bearing, name = max(shown, key=lambda key: shown[key])
    limit = f"{100 * min(shown.values()):.2g} to {100 * shown[bearing, name]:.2g} % of the mean envelope"
    surer = "An earlier recording of the same machine: then smaller changes show."
    if signals.has_reference:
        surer = "Another sensor nearer to the bearings, or a longer recording."
    no_damage = Finding(
        "no-bearing-damage",
        Kind.INFORMATION,
        f"No damage shows in the bearings ({', '.join(examined)}){_apart_from(depths, examined)}.",
        where,
        confidence=WOULD_SHOW,
        confidence_basis="early damage may be hidden below the gears",
        evidence=(
            f"No family at their orders in {len(envelopes)} envelope spectra (channels × bands).",
            f"Six equal harmonics of {limit} would have shown in half of the bands.",
            f"The largest is needed at the {BEARING_PARTS[name][0]} of {bearing}.",
        ),
        surer=surer,
    )
    return [no_damage, *_not_examined(signals, depths, where)]


def _reasons_to_leave_open(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    families: Families,
    is_as_before: Callable[[Where], bool],
) -> Iterator[tuple[str, str]]:
    """Yield reasons why the absence of damage cannot be stated, each with what would help."""

    def new(candidates: Iterable[Candidate]) -> list[Candidate]:
        return [c for c in candidates if not is_as_before(_where(signals, c))]

    longer = "A longer recording, or another sensor."
    if not speed_is_confirmed(signals):
        why = "no line of a mesh or shaft stands where the speed puts it, so bearing orders may be elsewhere"
        if (times := possible_speed_factor(signals)) > 1:
            why = _other_speed_text(times)
        yield why, f"A tachometer, or a sensor nearer to the {'gears' if signals.rig.pairs else 'bearings'}."
    if why := possible_half_speed_text(signals):
        yield f"{why}: every part has another order then", "Check the stated speed and the sampling rate."
    named_here = new((*families.named, *(c for c in families.trains if c.bearing is not None)))
    rival = next((r for c in named_here for r in c.rivals), "")
    besides = f"{rival} would show there as well" if rival else "something else explains them as well"
    if named_here and all(c.is_smooth for c in named_here):
        besides = "they rise and fall unlike impacts"
    for seen, but in (
        (named_here, besides),
        (new(families.unclear), "families beside it are as clear"),
    ):
        if seen:
            parts = ", ".join(part_text(c.name, c.bearing.name) for c in seen if c.bearing)
            yield f"lines stand at the order of the {parts}, but {but}", longer
    for train in families.trains:
        if shaft := _shaft_as_stated(signals, train)[1]:
            why = f"impacts come at order {train.comb.fundamental:.4f}, which is {shaft} or a part's, and the speed is "
            yield f"{why}stated and taken as constant", "A tachometer."
    if doubtful := new(doubtful_races(signals, list(envelopes))):
        races = ", ".join(dict.fromkeys(part_text(c.name, c.bearing.name) for c in doubtful if c.bearing))
        chance = f"the chance of so many is {p_text(doubtful[0].p_value)}"
        yield f"lines stand at the order of the {races}, and {chance}", longer
    for channel, race, comb in races_in_vibration(signals, envelopes):
        lines = f"{len(comb.positions)} multiples of the order of the {race} stand in {channel} itself"
        why = f"{lines}, but the lines of a shaft hide the first ones from the envelopes"
        yield why, "A recording at another load: slip separates a bearing from the shaft."
    for race, (k, shaft) in races_beside_shaft(signals, envelopes).items():
        beside = f"lines stand beside {k} times per turn of {named('shaft', shaft)}, all on one side"
        yield f"{beside}, as those of the {race} may", longer
    for (k, shaft), on_shaft in parts_on_shaft(signals, envelopes).items():
        races = f"the order of the {' or '.join(on_shaft)} within its slip"
        why = f"impacts come {k} times per turn of {named('shaft', shaft)}, which is {races}"
        yield why, "A recording at another load: slip separates a bearing from the shaft."


def _examined(signals: AnalysisSignals, depths: Mapping[tuple[str, str], float]) -> list[str]:
    """Return the bearings whose races, or other known parts without these, would have shown damage."""
    examined = []
    for bearing in signals.rig.bearings:
        parts = {name: depth for (owner, name), depth in depths.items() if owner == bearing.name}
        decisive = [depth for name, depth in parts.items() if name in RACES] or list(parts.values())
        if decisive and max(decisive) <= CLEAR_MODULATION:
            examined.append(bearing.name)
    return examined


def _apart_from(depths: Mapping[tuple[str, str], float], examined: Sequence[str]) -> str:
    """Return which parts of the bearings examined would not have shown damage, in words; empty if all would."""
    hidden = {name for (bearing, name), depth in depths.items() if depth > CLEAR_MODULATION and bearing in examined}
    parts = " or ".join(BEARING_PARTS[name][0] for name in BEARING_PARTS if name in hidden)
    return f", of which not every {parts} could be examined" if parts else ""


def _not_examined(signals: AnalysisSignals, depths: Mapping[tuple[str, str], float], where: Where) -> Iterator[Finding]:
    hidden = [(bearing, name) for (bearing, name), depth in depths.items() if depth > CLEAR_MODULATION]
    if hidden:
        orders_fall = "Its order falls" if len(hidden) == 1 else "Their orders fall"
        finding = cannot_tell(
            "bearing-part-hidden",
            f"Not examined: {', '.join(part_text(name, bearing) for bearing, name in hidden)}. {orders_fall} on "
            "multiples of a shaft within the resolution, or the floor there is too high for a modulation of "
            f"{percent(CLEAR_MODULATION)} to show.",
            where,
            surer="A longer recording: orders that are close need many revolutions to be resolved.",
        )
        # A cage seldom breaks before the other parts are damaged: it alone does not leave the bearing undecided.
        only_cages = all(name == "FTF" for _, name in hidden)
        yield replace(finding, kind=Kind.INFORMATION) if only_cages else finding
    unknown = [b.name for b in signals.rig.bearings if b.name not in {owner for owner, _ in depths}]
    if unknown:
        why = f"the geometry or the shaft speed of {', '.join(unknown)} is not known"
        yield _undecided(why, "Geometry or orders of the bearing, and the teeth that drive its shaft.", where)


def _undecided(why: str, surer: str, where: Where) -> Finding:
    title = f"Whether the bearings are damaged cannot be told: {why}."
    return cannot_tell("bearings-undecided", title, where, surer=surer)


def smallest_depth(
    envelopes: Sequence[BandEnvelope], order: float, slip: float, probability: float, share: float = WOULD_SHOW
) -> float:
    """Return the depth of modulation at which six equal harmonics near `order` would have shown in half of the bands.

    Each line needs the log ratio score/n over its floor, where `score` is what chance reaches with `probability` and n
    the number of harmonics that no shaft hides. The depth is the amplitude of such a line over the mean envelope. The
    band in which damage rings is not known beforehand, so the best of all bands says little: the median over bands is
    taken, each with its best channel. Slip moves a part's lines towards and away from those of the shafts: the depth
    returned is sufficient at a share of the slips.

    Parameters
    ----------
    envelopes : sequence of BandEnvelope
        Multiples of the shafts masked.
    order : float
    slip : float
        Relative range searched on either side.
    probability : float
        Of a false alarm in one envelope.
    share : float
        Of the typical slips, 0 to 1.

    Returns
    -------
    float
        inf if no depth would have shown.
    """
    best: dict[tuple[float, float], float] = {}
    for envelope in envelopes:
        score = score_needed(envelope.excess, 6, order * (1 - slip), order * (1 + slip), probability)
        depths = np.sort(_depths_in(envelope, order * (1 + slip * np.array(SLIPS)), score))
        enough = float(depths[max(ceil(share * len(SLIPS)), 1) - 1])
        best[envelope.band_hz] = min(enough, best.get(envelope.band_hz, inf))
    return median_high(best.values()) if best else inf


def _depths_in(envelope: BandEnvelope, orders: FloatArray, score: float) -> FloatArray:
    excess = envelope.excess
    places = orders[:, None] * np.arange(1, 7)
    lines = np.clip(excess.line_numbers(places), 0, len(excess.masked) - 1)
    free = (places <= excess.spectrum.positions[-1]) & ~excess.masked[lines]
    n_free = np.maximum(free.sum(axis=1), 1)
    needed = score / n_free
    log_floor = np.where(free, np.log(np.maximum(excess.floor[lines], 1e-300)), 0.0).sum(axis=1) / n_free
    # A family needs three harmonics that no shaft hides in order to be seen.
    shows = (n_free >= 3) & (needed <= LOG_RATIO_LIMIT) & (envelope.mean > 0)
    depths: FloatArray = np.where(shows, np.exp(log_floor + needed / 2) / max(envelope.mean, 1e-300), inf)
    return depths
