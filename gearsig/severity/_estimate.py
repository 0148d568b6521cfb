"""Depth of a crack in a tooth root, from one recording and, far better, a reference of the healthy gears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import exp, log

import numpy as np

from gearsig.checks import FloatArray, instance_of, listed, within
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import percent
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording, check_recording
from gearsig.rig import GearPair, Rig
from gearsig.severity._encoders import with_assumption, with_encoders
from gearsig.severity._features import (
    DB_OF_LOG_ENERGY,
    FEATURES,
    MAX_RELIEF_SHARE,
    STIFFNESS_N_PER_MM_UM,
    Conditions,
    ReferenceRefusalError,
    ShaftLines,
    ToothEvent,
    check_same_speed,
    difference_lines,
    event_shape,
    event_windows,
    feature_vector,
    find_event,
    mesh_energies,
    n_bands,
    reach_cycles,
    reversed_channels,
    reversed_text,
    search_levels,
    shaft_lines,
    squeezed_rise_db,
    without_regular_lines,
)
from gearsig.severity._model import (
    ALONE,
    LARGEST_BOUND_PERCENT,
    NO_MARK,
    RELIEF_KNOWN,
    TEETH_COUNT,
    WITH_REFERENCE,
    Calibration,
    CrackEstimate,
    DepthModel,
    NoCrackSeen,
    ToothSearch,
    UnlikeCracksError,
    kind_vector,
    load_calibration,
)
from gearsig.severity._pair import PairFacts, finite_element_percent, pair_facts, percent_per_mm

MIN_HARMONICS = 4
"""Mesh harmonics needed below the highest order: with fewer, one resonance decides."""

SMALLEST_DIFFERENCE = 1e-9
"""Relative to the largest line: two measurements never agree so well."""


@dataclass(frozen=True)
class GearEvidence:
    """What stands out on one gear.

    Parameters
    ----------
    shaft : ShaftLines
    event : ToothEvent
    features : array
        See `gearsig.severity.FEATURES`.
    searched : ShaftLines
        What the event was found in: the average, or its difference from the healthy gear's.
    healthy : ShaftLines
        The healthy gear's average, or the average itself where there is no reference.
    shape : array
        See `gearsig.severity.SHAPE`.
    agreement : float or None
        Of the tooth pattern with the reference's; None without a reference.
    """

    shaft: ShaftLines
    event: ToothEvent
    features: FloatArray
    searched: ShaftLines
    healthy: ShaftLines
    shape: FloatArray
    agreement: float | None = None


def pair_lines(
    recording: Recording | PreparedRecording, rig: Rig | None, pair: GearPair, channels: Sequence[str]
) -> tuple[ShaftLines, ...]:
    """Return the lines of both shafts' synchronous averages, the driver's first.

    Parameters
    ----------
    recording : Recording or PreparedRecording
    rig : Rig or None
        None: the recording's own.
    pair : GearPair
        The pair whose teeth are examined.
    channels : sequence of str
        Acceleration channels; the lines keep their order.

    Returns
    -------
    tuple of ShaftLines
        See `shaft_lines`.
    """
    prepared = prepare(recording, rig)
    return tuple(shaft_lines(prepared, pair, shaft, channels) for shaft in (pair.driver, pair.driven))


def gear_evidence(
    now: Sequence[ShaftLines],
    healthy: Sequence[ShaftLines] | None,
    module_mm: float,
    load_mpa: float,
    tip_relief_um: float | None = None,
) -> tuple[GearEvidence, ...]:
    """Return the most conspicuous tooth of each gear, in the difference from the healthy gear where there is one.

    The event is compared with mesh energies that are the geometric mean of both recordings'.

    Parameters
    ----------
    now : sequence of ShaftLines
        Of both shafts.
    healthy : sequence of ShaftLines or None
        Of the healthy machine at the same operating point. None: the tooth is compared with its neighbours.
    module_mm : float
        Normal module, mm.
    load_mpa : float
        Tangential force at the pitch circle per face width and module, MPa.
    tip_relief_um : float or None
        In µm; None: unknown.

    Returns
    -------
    tuple of GearEvidence
        The driver's first.
    """
    return tuple(
        _gear_evidence(now, healthy, i, Conditions(module_mm, load_mpa, shaft.order_hz * shaft.teeth, tip_relief_um))
        for i, shaft in enumerate(now)
    )


def _gear_evidence(
    now: Sequence[ShaftLines], healthy: Sequence[ShaftLines] | None, i: int, conditions: Conditions
) -> GearEvidence:
    shaft = now[i]
    _check_harmonics(shaft)
    if healthy is None:
        event = find_event(shaft)
        mesh = mesh_energies(shaft, n_bands(shaft))
        shape = event_shape(shaft, event)
        return GearEvidence(shaft, event, feature_vector(shaft, shaft, mesh, event, conditions), shaft, shaft, shape)
    _check_harmonics(healthy[i], "the reference's")
    difference, agreement = difference_lines(shaft, healthy[i], whole_teeth=_is_marked(now, healthy))
    residual, largest = np.abs(without_regular_lines(difference)).max(axis=1), np.abs(shaft.lines).max(axis=1)
    if not np.all(residual > SMALLEST_DIFFERENCE * largest):
        raise ReferenceRefusalError(
            "the reference holds the same samples as the recording",
            remedy="give a recording that was taken before the crack",
        )
    n = n_bands(difference)
    mesh = np.sqrt(mesh_energies(shaft, n) * mesh_energies(healthy[i], n))
    event = find_event(difference)
    features = feature_vector(difference, healthy[i], mesh, event, conditions)
    shape = event_shape(difference, event)
    return GearEvidence(shaft, event, features, difference, healthy[i], shape, agreement)


def _is_marked(now: Sequence[ShaftLines], healthy: Sequence[ShaftLines]) -> bool:
    """Whether either shaft has a mark in both recordings, which fixes the phase of the mesh."""
    return any(a.has_mark and b.has_mark for a, b in zip(now, healthy, strict=True))


def _check_harmonics(shaft: ShaftLines, whose: str = "the recording's") -> None:
    if n_bands(shaft) < MIN_HARMONICS:
        raise RefusalError(
            f"{n_bands(shaft)} mesh harmonics of the {shaft.teeth} teeth lie in {whose} band, "
            f"{MIN_HARMONICS} are needed",
            remedy="a higher sampling rate or a lower speed",
        )
    if not np.all(mesh_energies(shaft, MIN_HARMONICS) > 0):
        raise RefusalError("a channel holds no mesh vibration at all", remedy="leave the dead channel out")


def acceleration_channels(recording: Recording, chosen: tuple[str, ...], whose: str = "") -> tuple[str, ...]:
    """Return the chosen channels, or all acceleration channels; other quantities weight frequencies differently.

    Raises
    ------
    InputError
        If a chosen channel is not an acceleration.
    RefusalError
        If there is no acceleration channel, or one holds a single value only.
    """
    accelerations = tuple(channel.name for channel in recording.channels if channel.quantity == "acceleration")
    unknown = [name for name in chosen if name not in accelerations]
    if unknown:
        allowed = ", ".join(accelerations)
        raise InputError(f"{unknown[0]!r} is not an acceleration channel", where="channels", allowed=allowed)
    if not accelerations:
        raise RefusalError(
            "there is no acceleration channel, and the calibration is for accelerations alone",
            remedy="name the channel's quantity with a [[sensor]] in the rig file",
        )
    names = chosen or accelerations
    dead = [name for name in names if float(np.ptp(recording.values(name))) == 0.0]
    if dead:
        raise RefusalError(
            f"channel {dead[0]!r} {whose}is dead: it holds one value only", remedy="check the sensor, or leave it out"
        )
    return names


LARGEST_TORQUE_CHANGE = 0.10
"""Relative, as in the calibration."""

LARGEST_LEVEL_CHANGE_DB = 2.5
"""Largest change of the median mesh harmonic, each weighted by its decibels over the surrounding lines. Unweighted, on
100 simulated machines it is at most 1.4 dB, with the deepest cracks; another torque within its limit adds 0.8 dB."""

_REMEDY = "take a reference of the same gears, with the same sensors and gains, at the same speed and load"


def check_same_rig(now: Rig, healthy: Rig) -> None:
    """Refuse a reference whose rig has different teeth or a different torque.

    Raises
    ------
    ReferenceRefusalError
    """
    if healthy.pairs and now.teeth_text != healthy.teeth_text:
        raise ReferenceRefusalError(
            f"the reference is of another machine: its teeth are {healthy.teeth_text}, the recording's "
            f"{now.teeth_text}",
            remedy=_REMEDY,
        )
    torque, reference_torque = now.operating_point.torque_nm, healthy.operating_point.torque_nm
    same_shaft = now.operating_point.shaft == healthy.operating_point.shaft
    if torque and reference_torque and same_shaft and abs(abs(torque / reference_torque) - 1.0) > LARGEST_TORQUE_CHANGE:
        raise ReferenceRefusalError(
            f"the reference was taken at {reference_torque:g} N m, the recording at {torque:g} N m",
            remedy=f"take it within {percent(LARGEST_TORQUE_CHANGE)} of the same torque",
        )


def check_same_level(now: Sequence[ShaftLines], healthy: Sequence[ShaftLines]) -> None:
    """Refuse a reference at another speed, or whose mesh harmonics are much stronger or weaker.

    Raises
    ------
    ReferenceRefusalError
    """
    check_same_speed(now[0], healthy[0])
    n = min(n_bands(now[0]), n_bands(healthy[0]))
    (now_db, over_db), (healthy_db, healthy_over_db) = (_mesh_levels(side[0], n) for side in (now, healthy))
    weights = np.maximum(np.minimum(over_db, healthy_over_db), 0.0) + 1e-6
    for i, name in enumerate(now[0].channels):
        change_db = np.quantile(now_db[:, i] - healthy_db[:, i], 0.5, weights=weights[:, i], method="inverted_cdf")
        if abs(change_db) > LARGEST_LEVEL_CHANGE_DB:
            side = "above" if change_db > 0 else "below"
            raise ReferenceRefusalError(
                f"the mesh is {abs(change_db):.1f} dB {side} that of the reference in channel {name!r}: another gain, "
                "unit or load",
                remedy=_REMEDY,
            )


def _mesh_levels(shaft: ShaftLines, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the mesh harmonics' levels and their heights over the surrounding lines, in dB, (n, n_channels) each."""
    z, tiny = shaft.teeth, np.finfo(float).tiny
    energies = np.maximum(mesh_energies(shaft, n), tiny)
    around = [np.abs(shaft.lines[:, k * z - z // 2 : k * z + z // 2 + 1]) ** 2 for k in range(1, n + 1)]
    neighbours = np.maximum([np.median(lines, axis=1) for lines in around], tiny)
    return 10.0 * np.log10(energies), 10.0 * np.log10(energies / neighbours)


def share_of_the_recording(now: ShaftLines, difference: ShaftLines, event: ToothEvent) -> tuple[float, float]:
    """Return (E_now − E_reference)/E_difference at the event: about 1 if it is the recording's, −1 if the reference's.

    Energies are relative to the difference's background, averaged over bands and channels. Where the teeth differ much,
    cross terms of their pattern with the event blur the result.

    Parameters
    ----------
    now : ShaftLines
    difference : ShaftLines
        What remains of it after subtracting the turned reference.
    event : ToothEvent
        Found in the difference.

    Returns
    -------
    share : float
    standard_error : float
        From the scatter over bands and channels.
    """
    recorded = now.lines[:, : difference.highest_order + 1]
    (recording, usual), (reference, usual_then), (residual, background) = (
        event_windows(replace(difference, lines=lines), event)
        for lines in (recorded, recorded - difference.lines, difference.lines)
    )
    gain = np.sqrt(usual / usual_then)  # of the other teeth: a deep crack biases the gain fitted before
    shares = (recording / gain - reference * gain) / background / np.mean(residual / background)
    return float(shares.mean()), float(shares.std() / np.sqrt(shares.size))


SMALLEST_AGREEMENT = 0.4
"""Agreement of the tooth pattern with the reference's: other gears reach 0.38 once in a hundred cases; the right ones
fall below it only where a deep crack dominates the pattern."""

CLEARLY_OF_THE_REFERENCE, STANDARD_ERRORS = -0.2, 3.0
"""Share of the recording in the event, and by how many standard errors it is below zero. Of 67 simulated machines with
a visible crack, two came so low; with recording and reference exchanged, 54 of 68 did (seed 9158)."""

WEAKER = "Something at one tooth stands out, but is weaker, over the mesh, than the calibration's shallowest cracks."

CLEARLY_LARGER = log(1.3)
"""Logarithm of the ratio of both gears' prominences from which the gear counts as certain."""


def estimate_crack(
    recording: Recording | PreparedRecording,
    rig: Rig | None = None,
    *,
    reference: Recording | PreparedRecording | None = None,
    torque_nm: float | None = None,
    tip_relief_um: float | None = None,
    channels: Sequence[str] = (),
    calibration: Calibration | None = None,
) -> CrackEstimate | NoCrackSeen:
    """Estimate the depth of a crack in a tooth root of a spur gear pair.

    Each shaft's synchronous average (with a reference: its difference from that of the healthy gears) is searched for
    the tooth that stands out most. The ratios of its energy to that of the mesh harmonics in the same bands enter a
    model of ln(depth) that never falls as they rise, fitted to simulated machines. The interval is conformal.

    Parameters
    ----------
    recording : Recording or PreparedRecording
        Acceleration at steady speed; at least 13 revolutions of each shaft, preferably a hundred.
    rig : Rig or None
        Used where the recording carries none. Teeth, module, face width and torque must be known.
    reference : Recording, PreparedRecording or None
        Of the same gears, sensors, speed and load before there was a crack. Without it, manufacturing differences
        between teeth hide all but deep cracks.
    torque_nm : float or None
        In place of the operating point's torque.
    tip_relief_um : float or None
        Metal removed at the tips of each gear, from the drawing, 0 if there is none; None: unknown. It sets the
        strength of the mesh that the crack is compared with: knowing it to 20 % makes the depth more certain.
    channels : sequence of str
        Default: all acceleration channels.
    calibration : Calibration or None
        Default: the one that comes with this version.

    Returns
    -------
    CrackEstimate or NoCrackSeen

    Raises
    ------
    RefusalError
        If the machine is outside the calibration, the record is too short, the reference does not fit, or what stands
        out is unlike a crack.
    InputError
        If a channel is missing, the speed source is malformed, or the torque or tip relief is impossible.

    Notes
    -----
    Encoders on both shafts, in both recordings, count as well (`tooth_error_evidence`): kind and depth of the same
    tooth are combined with the vibration's, and stand in where that gives no estimate, if the reference fits.

    Not for helical gears, planetary sets, or cracks over a part of the face width. The calibration's teeth lose section
    behind a crack as by Chen and Shao; finite-element teeth give way about twice as much (`FINITE_ELEMENT_DEPTHS`). In
    a pair of them (50/50 teeth of 3 mm) cracks of 1, 2, 3, 4 and 5 mm read 2.0, 3.5, 4.2, 4.5 and 4.7 mm. The depth is
    that in the calibration's teeth; the interval reaches down to that in finite-element teeth, and holds four of them.

    On 200 simulated gearboxes with other teeth and modules than the calibration's
    (`tests/benchmarks/severity_cases.py`, seed 9157; depths 0.5 to 4 mm): with a reference, the median error is 0.36 mm
    (90 %: 0.30 to 0.42 mm; 0.31 mm where the tip relief is known to 20 %), and the 90 % interval held the depth in 85
    of 89 cases. Of the cracks below 1 mm, 5 of 20 were seen, of those above, 84 of 121; most others were refused. A
    crack was reported for none of 59 healthy gearboxes. Without a reference 33 of 141 were seen, with a median error of
    0.52 mm. Where teeth differ much from each other, a load 8 % off the reference's can look like a crack of 2 mm.

    The kind of damage is uncertain, as it hardly shows: with a reference, of 90 visible cracks 48 were called cracked
    and 42 left open; of 122 chips and spalls 15 were called that, 10 cracked, and 97 left open.

    On simulated machines these did not make the depth more certain: squeezed energy at high orders, reach in mesh
    cycles, phases relative to the mesh, two loads or two speeds (two recordings mostly share their errors).

    References
    ----------
    P. D. McFadden, "Examination of a technique for the early detection of failure in gears by signal processing of the
    time domain average of the meshing vibration", 1987. J. Lei, M. G'Sell, A. Rinaldo, R. J. Tibshirani,
    L. Wasserman, "Distribution-free predictive inference for regression", 2018 (locally weighted conformal intervals).
    """
    prepared = prepare(recording, rig)
    if reference is not None:
        check_recording(reference, "reference", Recording | PreparedRecording)
    instance_of(calibration, Calibration | None, "calibration")
    facts = pair_facts(prepared.rig, torque_nm)
    used = calibration or load_calibration()
    if tip_relief_um is not None:  # larger than any in the calibration means a wrong unit
        max_relief_um = (
            MAX_RELIEF_SHARE * used.reach["load_mpa"][1] * used.reach["module_mm"][1] / STIFFNESS_N_PER_MM_UM
        )
        remedy = "give what is ground off at the tips, in µm"
        within(tip_relief_um, "tip_relief_um", 0.0, round(max_relief_um), "µm", remedy=remedy)
    chosen = listed(channels, "channels", str)
    if reference is None:
        return with_assumption(_by_vibration(prepared, None, facts, used, chosen, tip_relief_um))
    before = prepare(reference, prepared.rig)
    check_same_rig(prepared.rig, before.rig)
    by_vibration = partial(_by_vibration, prepared, before, facts, used, chosen, tip_relief_um)
    return with_encoders(by_vibration, prepared, before, facts)


def _by_vibration(
    prepared: PreparedRecording,
    before: PreparedRecording | None,
    facts: PairFacts,
    used: Calibration,
    chosen: tuple[str, ...],
    tip_relief_um: float | None,
) -> CrackEstimate | NoCrackSeen:
    """Return the estimate from accelerations; `before` is the reference. Default: the channels that both have."""
    names = acceleration_channels(prepared.recording, chosen)
    if before is not None and not chosen:
        theirs = {channel.name for channel in before.recording.channels if channel.quantity == "acceleration"}
        common = tuple(name for name in names if name in theirs)
        if not common:
            raise RefusalError(
                f"the reference has no acceleration channel {' or '.join(map(repr, names))}",
                remedy="record both with the same channels",
            )
        names = common
    now = pair_lines(prepared, None, facts.pair, names)
    used.check_reach(reach_of(facts, now[0].order_hz * facts.driver_teeth))
    healthy = None
    wrong = "place and depth may be wrong for it."
    doubts = [f"{problem.text}; {wrong}" for problem in prepared.grave_problems(names)]
    if before is not None:
        acceleration_channels(before.recording, names, "of the reference ")
        healthy = pair_lines(before, None, facts.pair, names)
        check_same_level(now, healthy)
        doubts += [f"The reference: {problem.text}; {wrong}" for problem in before.grave_problems(names)]
        turned = reversed_channels(now[0], healthy[0], whole_teeth=_is_marked(now, healthy))
        if turned:
            healthy = tuple(shaft.turned_about(turned) for shaft in healthy)
            doubts.append(reversed_text(turned))
    evidence = gear_evidence(now, healthy, facts.module_mm, facts.load_mpa, tip_relief_um)
    way = ALONE if before is None else WITH_REFERENCE
    answer = judge(evidence, used.models[way + ("" if tip_relief_um is None else RELIEF_KNOWN)], used, facts)
    return replace(answer, reasons=(*answer.reasons, *doubts)) if doubts else answer


def reach_of(facts: PairFacts, mesh_hz: float) -> dict[str, float]:
    """Return the quantities whose range limits the calibration."""
    return {
        "module_mm": facts.module_mm,
        "load_mpa": facts.load_mpa,
        "mesh_hz": mesh_hz,
        "fewer_teeth": float(min(facts.driver_teeth, facts.driven_teeth)),
        "more_teeth": float(max(facts.driver_teeth, facts.driven_teeth)),
    }


def judge(
    gears: Sequence[GearEvidence], model: DepthModel, calibration: Calibration, facts: PairFacts
) -> CrackEstimate | NoCrackSeen:
    """Decide whether the clearest event is a crack, and how deep it is or may be."""

    def rank(evidence: GearEvidence) -> tuple[bool, float]:
        # An event that is weaker than those of the shallowest cracks must not hide one on the other gear.
        score = model.score(evidence.features)
        return score >= model.threshold and not model.is_weaker(evidence.features), score

    best = max(gears, key=rank)
    clear = model.score(best.features) >= model.threshold
    agreements = {  # where nothing changed as much as the shallowest crack changes it, patterns need not agree
        evidence.shaft.shaft: evidence.agreement
        for evidence in gears
        if evidence.agreement is not None and not model.is_weaker(evidence.features)
    }
    weakest = min(agreements, key=lambda shaft: agreements[shaft], default=None)
    strange = weakest is not None and agreements[weakest] < SMALLEST_AGREEMENT
    if clear and strange:  # the difference holds the reference's pattern: require as much as without it
        alone = calibration.models[ALONE]
        clear = alone.score(best.features) >= alone.threshold
    is_weaker = clear and model.is_weaker(best.features)
    if clear and not is_weaker:
        try:
            return _crack_estimate(gears, best, model, calibration, facts)
        except RefusalError as refusal:
            refusal.looked_at = _searched(gears, model, calibration, facts)
            raise
    searched = _searched(gears, model, calibration, facts)
    if strange and weakest is not None:
        raise ReferenceRefusalError(
            f"the teeth's own pattern on shaft {weakest!r} agrees with that of the reference by "
            f"only {agreements[weakest]:.2f}",
            remedy="take a reference of the same gears, same sensors, same speed and load; or leave it out. Teeth that "
            "hardly differ have no pattern to compare: then a longer recording may help",
            looked_at=searched,
        )
    limits = []
    for evidence in gears:
        percent = exp(model.log_interval(model.at_threshold(evidence.features))[1])
        limits.append((percent / percent_per_mm(evidence.shaft.teeth, facts.module_mm), percent))
    below_mm, below_percent = max(limits)
    if below_percent > LARGEST_BOUND_PERCENT:
        healthy = "give a reference of the same gears when they were healthy"
        raise RefusalError(
            f"no crack stands out, but one of up to {below_mm:.1f} mm ({below_percent:.0f} % of the root) might hide "
            "among the teeth's own differences",
            remedy=healthy if best.agreement is None else "record longer, at higher load",
            looked_at=searched,
        )
    return NoCrackSeen(
        below_mm,
        below_percent,
        model.p_value(model.score(best.features)),
        best.agreement is not None,
        dict(zip(FEATURES, best.features.tolist(), strict=True)),
        (_reference_text(best), *((WEAKER,) if is_weaker else ())),
        searched,
        stands_out=is_weaker,
    )


def _searched(
    gears: Sequence[GearEvidence], model: DepthModel, calibration: Calibration, facts: PairFacts
) -> tuple[ToothSearch, ...]:
    """Return the search of each gear."""
    return tuple(_search(evidence, model, calibration, facts) for evidence in gears)


def _search(evidence: GearEvidence, model: DepthModel, calibration: Calibration, facts: PairFacts) -> ToothSearch:
    shaft = evidence.shaft
    middles, levels = search_levels(evidence.searched)
    at = (middles - calibration.lag_pitches / shaft.teeth) % 1.0  # as the place of a crack
    order = np.argsort(at, kind="stable")
    return ToothSearch(
        f"{facts.pair.name}/{shaft.shaft}",
        shaft.shaft,
        shaft.teeth,
        360.0 * at[order],
        levels[order],
        DB_OF_LOG_ENERGY * model.threshold_prominence(evidence.features),
        evidence.agreement is not None,
    )


def _crack_estimate(
    gears: Sequence[GearEvidence], best: GearEvidence, model: DepthModel, calibration: Calibration, facts: PairFacts
) -> CrackEstimate:
    shaft, teeth, features = best.shaft.shaft, best.shaft.teeth, best.features
    if best.agreement is not None:
        share, error = share_of_the_recording(best.shaft, best.searched, best.event)
        if share < CLEARLY_OF_THE_REFERENCE and share < -STANDARD_ERRORS * error:
            raise ReferenceRefusalError(
                f"what stands out at one tooth of shaft {shaft!r} seems to be in the reference, not in the recording",
                remedy="swap both if they were exchanged, or take a reference of healthy gears",
            )
    unlike = model.unlike(features)
    if unlike:
        raise UnlikeCracksError(
            f"one tooth stands out on shaft {shaft!r}, but unlike the calibration's cracks ({unlike})",
            remedy="look at the tooth: it may be chipped or spalled, or the machine is unlike the calibration's",
        )
    low, high = model.percent_range
    centre, reasons = exp(model.log_percent(features)), [_reference_text(best)]
    if not low <= centre <= high:
        reasons.append(f"The estimate of {centre:.0f} % lies beyond the calibration's {low:.0f} to {high:.0f} %.")
    percent = min(max(centre, low), high)
    bounds = tuple(exp(bound) for bound in model.log_interval(features))
    interval = finite_element_percent(min(bounds[0], percent)), max(min(bounds[1], 100.0), percent)
    per_mm = percent_per_mm(teeth, facts.module_mm)
    place = (best.event.centre_rev - calibration.lag_pitches / teeth) % 1.0
    further_prominences = [e.event.prominence for e in gears if e is not best]
    reasons.append(TEETH_COUNT if best.shaft.has_mark else NO_MARK)
    way = ALONE if best.agreement is None else WITH_REFERENCE
    return CrackEstimate(
        shaft=shaft,
        gear=f"{facts.pair.name}/{shaft}",
        tooth=int(place * teeth) % teeth + 1 if best.shaft.has_mark else None,
        angle_deg=360.0 * place,
        gear_is_certain=all(
            log(best.event.prominence / prominence) >= CLEARLY_LARGER for prominence in further_prominences
        ),
        depth_mm=percent / per_mm,
        depth_percent=percent,
        interval_mm=(interval[0] / per_mm, interval[1] / per_mm),
        interval_percent=interval,
        p_value=model.p_value(model.score(features)),
        with_reference=best.agreement is not None,
        agreement=best.agreement,
        features=dict(zip(FEATURES, features.tolist(), strict=True)),
        reasons=tuple(reasons),
        kind_probabilities=calibration.kinds[way].probabilities(kind_vector(features, best.shape)),
        reach_cycles=reach_cycles(best.searched, best.event),
        squeezed_rise_db=squeezed_rise_db(best.searched, best.healthy, best.event),
    )


def _reference_text(evidence: GearEvidence) -> str:
    if evidence.agreement is None:
        return "Without a reference of the healthy gears, differences between teeth hide all but deep cracks."
    if evidence.agreement < SMALLEST_AGREEMENT:
        return (
            f"Be careful with the reference: the teeth's own pattern agrees by only {evidence.agreement:.2f}. It may "
            "be of other gears or another load, or the teeth hardly differ."
        )
    return f"Compared with a reference; the teeth's own pattern agrees by {evidence.agreement:.2f}."
