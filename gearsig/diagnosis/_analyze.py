"""From a recording to findings: the main job."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from gearsig import indicators
from gearsig.angle import ShaftAngle
from gearsig.checks import instance_of, positive
from gearsig.diagnosis._bearing import detect_bearings
from gearsig.diagnosis._change import change_findings, family_change, level_changes, with_clearest_band
from gearsig.diagnosis._crack import Answer, crack_depth, with_crack
from gearsig.diagnosis._lines import detect_lines, detect_mesh, detect_standstill, speed_finding
from gearsig.diagnosis._modulation import detect_sidebands
from gearsig.diagnosis._overall import detect_vibration_zone
from gearsig.diagnosis._reference import beside_reference, reference_not_healthy, reference_unfit
from gearsig.diagnosis._resonance import detect_resonances, order_levels
from gearsig.diagnosis._rotor import HALF_ORDERS, OIL_WHIRL, detect_between_orders
from gearsig.diagnosis._sampling_rate import detect_sampling_rate
from gearsig.diagnosis._signals import (
    AnalysisSignals,
    BandEnvelope,
    KurtogramBand,
    band_envelopes,
    channel_analysis,
    compute_signals,
    in_common_bands,
    kurtogram_bands,
)
from gearsig.diagnosis._start_stop import start_stop_analysis
from gearsig.diagnosis._tooth import ChangedAverages, detect_tooth_damage, with_changed_teeth
from gearsig.diagnosis._types import (
    Analysis,
    AnalysisSettings,
    CannotTell,
    Finding,
    Kind,
    LevelChange,
    Outcome,
    Where,
    cannot_tell,
    outcome_of,
)
from gearsig.diagnosis._verdict import (
    detect_data_problems,
    lowered,
    ranked,
    speed_warnings,
    spoiled,
    verdict_of,
    with_doubt,
    withheld_crack,
    without_synchronous_hum,
)
from gearsig.errors import InputError, RefusalError
from gearsig.orders import SeparatedAverage, SynchronousAverage, band_passed_mesh
from gearsig.prepared import MEMORY_LIMIT_MB, PreparedRecording, prepare
from gearsig.recording import CONDITION_CHANNEL, Recording, names_without_number
from gearsig.rig import EncoderChannel, Rig, TachometerChannel

MINIMUM_SAMPLES = 256
"""With fewer samples no spectrum has a noise floor to compare with."""

LARGEST_VALUE = 1e60
"""Above it, fourth powers leave the range of floating point numbers; no unit makes vibration values that large."""


def analyze(
    recording: Recording | PreparedRecording,
    rig: Rig | None = None,
    settings: AnalysisSettings | None = None,
    *,
    reference: Recording | PreparedRecording | None = None,
    torque_nm: float | None = None,
    on_stage: Callable[[str], object] | None = None,
) -> Analysis:
    """Diagnose one recording.

    Parameters
    ----------
    recording : Recording or PreparedRecording
        Its rig, if any, describes the machine.
    rig : Rig or None
        Used where the recording carries none.
    settings : AnalysisSettings or None
    reference : Recording, PreparedRecording or None
        Of the same machine when healthy, with the same sensors, speed and load: cracks of a millimetre show against it,
        and indicators are compared with it.
    torque_nm : float or None
        For the depth of a crack, in place of the operating point's: on the shaft that the operating point names, else
        on the reference shaft.
    on_stage : callable or None
        Called with a few words as each stage begins.

    Returns
    -------
    Analysis
        Findings, most important first; a question that cannot be answered is a finding with its reason, not an error.
        A machine that starts, stops or reverses is examined for backlash and impacts instead: see `gearsig.diagnosis`.

    Raises
    ------
    InputError
        If there is no vibration channel, the record is shorter than 256 samples, or the reference has none of its
        channels or is the recording itself. Names that differ only by a record's number are the same channel; so are
        the only vibration channels of both records, unless only a sensor's number differs.
    """
    prepared = prepare(recording, rig)
    instance_of(settings, AnalysisSettings | None, "settings")
    if torque_nm is not None:
        positive(torque_nm, "torque_nm", "N m")
    _check_size(prepared.recording)
    healthy = None if reference is None else prepare(reference, prepared.recording.rig, name="reference")
    renamed: list[Finding] = []
    if healthy is not None:
        given, healthy = healthy.recording, with_matching_channel_names(prepared.recording, healthy)
        renamed = only_channel_assumed(given, healthy.recording)
        _check_reference(prepared.recording, healthy.recording)
    analysis, _ = _examined(prepared, settings or AnalysisSettings(), healthy, torque_nm, on_stage or (lambda _: None))
    return replace(analysis, findings=(*analysis.findings, *renamed)) if renamed else analysis


Shown = tuple[AnalysisSignals, Sequence[BandEnvelope]]
"""The signals that an analysis used."""


def _examined(
    prepared: PreparedRecording,
    settings: AnalysisSettings,
    healthy: PreparedRecording | None,
    torque_nm: float | None,
    announce: Callable[[str], object],
) -> tuple[Analysis, Shown | None]:
    """Return the analysis, and the signals it used if channels are live and the machine turns."""
    # Checks that end an analysis early come first, cheapest first: a machine that starts and stops has no orders, and
    # no spectrum helps if every channel is dead.
    recording, known = prepared.recording, prepared.rig
    announce("finding the speed")
    findings, dead = detect_data_problems(prepared)
    healthy_recording = healthy.recording if healthy is not None else None
    unsteady = start_stop_analysis(recording, known, findings, asdict(settings), healthy_recording)
    if unsteady is not None:
        return unsteady, None
    _check_vibration(recording)
    angle = _angle_of(prepared)
    findings = without_synchronous_hum(findings, angle, known)
    findings += [speed_finding(angle), *speed_warnings(angle, known)]

    def ended(findings: Sequence[Finding]) -> tuple[Analysis, None]:
        order = ranked(findings)
        return Analysis(recording, recording.rig, angle, (), (), order, verdict_of(order), asdict(settings)), None

    if not (names := [name for name in recording.vibration_names() if name not in dead]):
        return ended([*findings, cannot_tell("all-channels-dead", "Every vibration channel is dead.")])

    # Signals are computed once for all detectors; without an angle only those over frequency exist.
    announce("averages and spectra")
    usable = angle if isinstance(angle, ShaftAngle) else None
    signals = compute_signals(prepared, names, usable, settings, has_reference=healthy is not None)
    announce("envelopes")
    envelopes, own_bands = list(band_envelopes(signals)), kurtogram_bands(signals)
    announce("levels over speed")
    levels = order_levels(signals)

    # A wrong sampling rate must be found before anything is identified by its order. If pulses or an encoder were
    # sampled with the vibration, orders stay right and only frequencies are wrong.
    announce("gears, bearings and shafts")
    doubt = detect_sampling_rate(signals, angle, envelopes)
    if doubt is not None:
        findings = with_doubt(findings, doubt)
    if doubt is not None and not isinstance(recording.speed_source, TachometerChannel | EncoderChannel):
        return ended(findings)  # all orders are wrong, and so is what they would show
    findings += detect_standstill(signals)
    # The reference is analysed on its own, without a reference; an unfit one is reported and left out.
    if healthy is not None:
        announce("the reference")
    reference_analysis, then = _of_reference(healthy, settings)
    if reference_analysis is not None and then is None:
        findings.append(reference_unfit(reference_analysis))
        reference_analysis = healthy = None
    found = tuple(_indicators(signals, envelopes, then[0] if then is not None else None))
    beside = None
    if healthy is not None and then is not None:
        now, before = in_common_bands(signals, envelopes, *then, healthy)
        beside = (signals, now, then[0], before)
    findings += [*_of_machine(signals, envelopes, own_bands, beside), *detect_resonances(levels)]
    findings += detect_vibration_zone(signals, found)

    # Findings that the reference shows as well are downgraded before changes add findings of their own.
    compared: tuple[LevelChange, ...] = ()
    changes: ChangedAverages = {}
    if beside is not None and reference_analysis is not None:
        findings, compared, changes = _against(findings, reference_analysis, beside)
    # Warnings come last, when all that they could lower is there; the crack's depth uses no channel that they spoil.
    findings, unfit = lowered(findings, names), dead | spoiled(findings, names)
    crack: Answer | None = withheld_crack(findings, is_asked=healthy is not None and bool(known.pairs))
    if not unfit.issuperset(names):
        crack = crack_depth(prepared, known, healthy, torque_nm, unfit)
    order = ranked(with_crack(findings, crack, known))
    analysis = Analysis(
        recording=recording,
        rig=recording.rig,
        shaft_angle=angle,
        channels=tuple(
            channel_analysis(signals, name, envelopes, own_bands, levels.get(name, ()), order, changes)
            for name in names
        ),
        indicators=found,
        findings=order,
        verdict=verdict_of(order, has_reference=healthy is not None),
        settings=asdict(settings),
        crack=crack,
        reference=reference_analysis,
        level_changes=compared,
    )
    return analysis, (signals, envelopes)


def _of_reference(
    healthy: PreparedRecording | None, settings: AnalysisSettings
) -> tuple[Analysis | None, Shown | None]:
    """Return the reference's analysis and the signals it used, kept because many recordings share a reference."""
    if healthy is None:
        return None, None
    _check_size(healthy.recording)
    return healthy.keep(("diagnosis", settings), lambda: _examined(healthy, settings, None, None, lambda _: None))


Beside = tuple[AnalysisSignals, Sequence[BandEnvelope], AnalysisSignals, Sequence[BandEnvelope]]
"""Signals and envelopes of a recording, and those of its reference, the envelopes in the same bands."""


def _against(
    findings: list[Finding], reference: Analysis, beside: Beside
) -> tuple[list[Finding], tuple[LevelChange, ...], ChangedAverages]:
    """Return the findings after comparison with the reference, the compared levels and the changed averages."""
    signals, _, then, _ = beside

    def measured(finding: Finding) -> LevelChange | None:
        return family_change(finding.where, *beside)

    not_healthy = reference_not_healthy(reference, measured, shows_fault=outcome_of(findings) is Outcome.FAULT)
    findings = beside_reference(findings, reference, measured)
    findings, changes = with_changed_teeth(with_clearest_band(findings, signals, then), signals, then)
    compared = level_changes(*beside)
    changed = change_findings(compared, signals, then, findings)
    # What the comparison identifies on a shaft is not reported again from the recording alone.
    again = {HALF_ORDERS: {"looseness", "rub"}, OIL_WHIRL: {OIL_WHIRL}}
    named = {(f.code, f.where.shaft) for f in changed if f.is_claim}
    findings = [f for f in findings if not any((code, f.where.shaft) in named for code in again.get(f.code, ()))]
    return [*findings, *changed, *not_healthy], compared, changes


def _of_machine(
    signals: AnalysisSignals,
    envelopes: list[BandEnvelope],
    own_bands: Sequence[KurtogramBand],
    beside: Beside | None,
) -> Iterator[Finding]:
    """Yield the findings on gears, bearings, shafts and single lines."""
    if not (signals.rig.pairs or signals.rig.bearings):
        title = "No gears or bearings are described, so none can be examined."
        surer = "A rig file with teeth and bearings; `gearsig rig example` prints one to start from."
        if any(signals.rig.shaft_names):  # the rig of a rotor in plain bearings is complete
            surer = "Rolling bearings in the rig file, if there are any."
            if not signals.has_reference:
                surer = "A recording of the rotor when it was healthy, given with --reference, or its rolling bearings."
        yield cannot_tell("machine-not-described", title, surer=surer)
    yield from detect_mesh(signals)
    yield from detect_tooth_damage(signals)

    def is_as_before(where: Where) -> bool:
        change = family_change(where, *beside) if beside is not None else None
        return change is not None and not change.is_change

    impacts = detect_bearings(signals, envelopes, own_bands, is_as_before)
    yield from impacts
    of_envelopes = [(f, f.where.order) for f in impacts if f.where.order is not None and f.where.band_hz is not None]
    trains = tuple(order for _, order in of_envelopes)
    yield from detect_sidebands(signals, trains)
    yield from detect_between_orders(signals)
    named = tuple(order for f, order in of_envelopes if f.where.bearing and f.is_claim)
    yield from detect_lines(signals, trains, named)


def with_known_angle(
    recording: Recording, angle: ShaftAngle | CannotTell, *, memory_limit_mb: float = MEMORY_LIMIT_MB
) -> PreparedRecording:
    """Return a recording prepared with the angle that an analysis found, or with the reason why there is none.

    Parameters
    ----------
    recording : Recording
        With its rig.
    angle : ShaftAngle or CannotTell
    memory_limit_mb : float
        As in `PreparedRecording`.
    """
    prepared = PreparedRecording(recording, memory_limit_mb=memory_limit_mb)

    def known() -> ShaftAngle:
        if isinstance(angle, CannotTell):
            raise RefusalError(angle.reason, remedy=angle.remedy)
        return angle

    prepared.keep_angle(known)
    return prepared


def _angle_of(prepared: PreparedRecording) -> ShaftAngle | CannotTell:
    """Return the angle over the record's duration; pulses before and after it do not count."""
    source = prepared.recording.provenance.source
    try:
        return prepared.shaft_angle
    except RefusalError as refusal:
        return CannotTell("What is the speed of the shafts?", refusal.reason, refusal.remedy)
    except InputError as error:  # it names the channel; the file is known only here
        where = error.where if error.where.startswith(source) else f"{source}: {error.where}".removesuffix(": ")
        remedy = error.remedy or "check [speed] in the rig file, or leave it out and state the speed by --speed-rpm"
        raise InputError(error.what, where=where, allowed=error.allowed, remedy=remedy) from None


def _indicators(
    signals: AnalysisSignals, envelopes: Sequence[BandEnvelope], reference: AnalysisSignals | None
) -> Iterator[indicators.Indicator]:
    """Yield every indicator that the recording and the rig allow: per channel, per gear, per shaft, per bearing.

    The reference serves the indicators that need an earlier record of the healthy machine.
    """
    rig = signals.rig
    earlier = {turning.shaft: turning.separated for turning in reference.shafts} if reference is not None else {}
    for channel in signals.recording.channels:
        name, unit = channel.name, channel.unit
        values, rate_hz = signals.recording.values(name), signals.recording.sampling_rate_hz
        yield from indicators.time_indicators(values, name, unit)
        speed_rpm = None if signals.angle is None else signals.angle.mean_speed_rpm
        spectrum, transform = signals.spectra[name], signals.prepared.joined_transform(name)
        yield from indicators.overall_indicators(
            values, rate_hz, channel, speed_rpm, spectrum=spectrum, transform=transform
        )
        if name in signals.order_excess:
            spectrum = signals.order_excess[name].spectrum
            for pair in rig.pairs:
                if rig.mesh_order(pair) is not None:
                    yield from indicators.mesh_indicators(spectrum, rig, pair, channel=name)
            for shaft, order in signals.known_shaft_orders.items():
                yield from indicators.shaft_indicators(spectrum, shaft, shaft_ratio=order, channel=name)
        for turning in signals.shafts:
            values, on = turning.averages[name].values, "synchronous average"
            yield from indicators.time_indicators(values, name, unit, computed_on=on, shaft=turning.shaft)
            before = earlier.get(turning.shaft, {}).get(name)
            yield from _of_gears(rig, turning.shaft, turning.separated.get(name), before)
        if signals.angle is not None:
            yield from _of_bearings(signals, name, envelopes)


def _of_gears(
    rig: Rig, shaft: str, parts: SeparatedAverage | None, before: SeparatedAverage | None
) -> Iterator[indicators.Indicator]:
    if parts is None:
        return
    if before is not None and before.average.unit != parts.average.unit:
        before = None
    for pair, teeth in rig.gear_teeth(shaft).items():
        band, band_before = _mesh_band(parts, teeth), None if before is None else _mesh_band(before, teeth)
        yield from indicators.gear_indicators(
            parts.average,
            parts.residual,
            parts.difference,
            band,
            teeth=teeth,
            gear=f"{pair}/{shaft}",
            history=() if before is None else (before.residual,),
            band_history=() if band_before is None else (band_before,),
        )


def _mesh_band(parts: SeparatedAverage, teeth: int) -> SynchronousAverage | None:
    try:
        return band_passed_mesh(parts.average, teeth)
    except RefusalError:  # the band reaches beyond half the sampling rate
        return None


def _of_bearings(
    signals: AnalysisSignals, name: str, envelopes: Sequence[BandEnvelope]
) -> Iterator[indicators.Indicator]:
    """Yield the indicators of the band whose envelope has the clearest lines, and of the widest band.

    A quiet band would only give its floor. The clearest band varies between recordings, so levels compare over time
    only in the widest.
    """
    of_channel = [e for e in envelopes if e.channel == name]
    if not of_channel:
        return
    clearest = max(of_channel, key=lambda e: float(e.excess.scores().sum()))
    widest = max(of_channel, key=lambda e: e.band_hz[1] - e.band_hz[0])
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft)
        if ratio is None or not bearing.orders():
            continue
        for envelope in [clearest] if clearest is widest else [clearest, widest]:
            band, spectrum = "{:.0f} to {:.0f} Hz".format(*envelope.band_hz), envelope.excess.spectrum
            yield from indicators.bearing_indicators(spectrum, bearing, shaft_ratio=ratio, channel=name, band=band)


def _check_size(recording: Recording) -> None:
    where = recording.provenance.source or "recording"
    if recording.n_samples < MINIMUM_SAMPLES:
        raise InputError(
            f"{recording.n_samples} samples are too few",
            where=where,
            allowed=f"{MINIMUM_SAMPLES} or more",
            remedy="record at least ten revolutions of the slowest shaft",
        )
    if max(float(recording.samples.max()), -float(recording.samples.min())) > LARGEST_VALUE:
        allowed = f"values up to {LARGEST_VALUE:g}"
        raise InputError(
            "samples are too large", where=where, allowed=allowed, remedy="check the file's format and unit"
        )


def _check_vibration(recording: Recording) -> None:
    if not recording.vibration_names():
        quantities = ", ".join(sorted({c.quantity for c in recording.channels}))
        raise InputError(
            f"there is no vibration channel (only {quantities})",
            where=recording.provenance.source or "recording",
            remedy="name the channel's quantity with a [[sensor]] in the rig file",
        )


def with_matching_channel_names(recording: Recording, healthy: PreparedRecording) -> PreparedRecording:
    """Return the reference with the recording's channel names where these differ only by a record's number.

    If each has only one vibration channel, these are taken to be the same, whatever their names. The renamed recording
    is kept with the original, together with its results.
    """
    reference = healthy.recording
    theirs, ours = reference.vibration_names(), recording.vibration_names()
    is_other_name = len({re.sub(r"\d+", "", name) for name in (*theirs, *ours)}) > 1
    if len(theirs) == len(ours) == 1 and is_other_name and ours[0] not in reference.channel_names:
        return _renamed(healthy, {theirs[0]: ours[0]})

    names = {key: name for name, key in names_without_number(recording.channel_names).items()}
    keys = names_without_number(reference.channel_names)
    alike = {name: names[key] for name, key in keys.items() if names.get(key, name) != name}
    if not alike or set(ours) <= set(reference.channel_names):
        return healthy
    return _renamed(healthy, alike)


def _renamed(prepared: PreparedRecording, names: Mapping[str, str]) -> PreparedRecording:
    recording = prepared.recording
    channels = tuple(replace(c, name=names.get(c.name, c.name)) for c in recording.channels)
    return prepared.keep(("diagnosis", "renamed", channels), lambda: prepare(replace(recording, channels=channels)))


def only_channel_assumed(reference: Recording, renamed: Recording) -> list[Finding]:
    """Report that a reference's only vibration channel was taken for the recording's, where their names differ."""
    before, after = reference.vibration_names(), renamed.vibration_names()
    if before == after or len(before) != 1:
        return []
    title = f"The reference's only vibration channel, {before[0]}, is compared with {after[0]}."
    return [Finding("reference-channel-renamed", Kind.INFORMATION, title, Where(channels=(after[0],)))]


def _check_reference(recording: Recording, reference: Recording) -> None:
    where = reference.provenance.source or "reference"
    if np.array_equal(recording.samples, reference.samples):
        remedy = "give one that was taken when the machine was healthy"
        raise InputError("the reference is the recording itself", where=where, remedy=remedy)
    names = recording.vibration_names()
    missing = [name for name in names if name not in reference.channel_names]
    if names and len(missing) == len(names):
        names_text = ", ".join(reference.channel_names)
        raise InputError(
            f"the reference has no channel {missing[0]!r}",
            where=where,
            allowed=f"same channels: {names_text}",
            remedy=_columns_remedy(recording, reference),
        )


def _columns_remedy(recording: Recording, reference: Recording) -> str:
    """Return which columns to name if one record is one column of its file, "runs.mat#2", and the other all of it."""

    def is_column(record: Recording) -> bool:
        return record.channel_names == (CONDITION_CHANNEL,) and re.search(r"#\d+$", record.name) is not None

    if is_column(recording) == is_column(reference):
        return ""
    whole, one, other = recording, "reference", "recording"
    if is_column(recording):
        whole, one, other = reference, other, one
    columns = " or ".join(f"{whole.name}#{number}" for number in range(1, min(len(whole.channels), 8) + 1))
    return f"the {one} is one column of its file; for one of the {other}'s give {columns}"
