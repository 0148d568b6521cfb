"""From a recording to findings: the main job."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace

import numpy as np

from gearsig.angle import ShaftAngle
from gearsig.diagnosis._bearing import detect_bearings
from gearsig.diagnosis._crack import crack_depth, with_crack
from gearsig.diagnosis._mesh import detect_mesh
from gearsig.diagnosis._modulation import detect_sidebands
from gearsig.diagnosis._reference import beside_reference
from gearsig.diagnosis._resonance import detect_resonances, order_levels
from gearsig.diagnosis._signals import (
    AnalysisSignals,
    BandEnvelope,
    ExaminedSignals,
    ShaftSignals,
    band_envelopes,
    channel_analysis,
    compute_signals,
    kurtogram_bands,
)
from gearsig.diagnosis._single_lines import detect_lines
from gearsig.diagnosis._speed import speed_finding
from gearsig.diagnosis._start_stop import start_stop_analysis
from gearsig.diagnosis._tooth import detect_tooth_damage
from gearsig.diagnosis._types import Analysis, AnalysisSettings, CannotTell, Finding, Kind
from gearsig.diagnosis._verdict import detect_data_problems, ranked, verdict_of
from gearsig.errors import InputError, RefusalError
from gearsig.indicators import Indicator
from gearsig.orders import SynchronousAverage
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import Rig

# --------------------
# All indicators of an analysis: per channel, per gear, per shaft, per bearing.
# --------------------


def indicator_table(signals: AnalysisSignals, envelopes: list[BandEnvelope]) -> tuple[Indicator, ...]:
    """Return every indicator that the recording and the rig allow, channel by channel."""
    return tuple(
        indicator
        for channel in signals.recording.channels
        for indicator in _of_channel(signals, channel.name, channel.unit, envelopes)
    )


def _of_channel(signals: AnalysisSignals, name: str, unit: str, envelopes: list[BandEnvelope]) -> Iterator[Indicator]:
    from gearsig.indicators import time_indicators

    yield from time_indicators(signals.recording.values(name), name, unit)
    yield from _of_orders(signals, name)
    for shaft in signals.shafts:
        yield from time_indicators(
            shaft.averages[name].values, name, unit, computed_on="synchronous average", shaft=shaft.shaft
        )
        yield from _of_gears(signals, shaft, name)
    if signals.angle is not None:
        yield from _of_bearings(signals, name, envelopes)


def _of_orders(signals: AnalysisSignals, name: str) -> Iterator[Indicator]:
    from gearsig.indicators import mesh_indicators, shaft_indicators

    if name not in signals.order_excess:
        return
    spectrum = signals.order_excess[name].spectrum
    for pair in signals.rig.pairs:
        if signals.rig.mesh_order(pair) is not None:
            yield from mesh_indicators(spectrum, signals.rig, pair, channel=name)
    for shaft, order in signals.known_shaft_orders.items():
        yield from shaft_indicators(spectrum, shaft, shaft_ratio=order, channel=name)


def _of_gears(signals: AnalysisSignals, shaft: ShaftSignals, name: str) -> Iterator[Indicator]:
    from gearsig.indicators import gear_indicators

    if name not in shaft.separated:
        return
    parts = shaft.separated[name]
    for pair in signals.rig.pairs:
        if shaft.shaft not in (pair.driver, pair.driven) or (teeth := pair.teeth(shaft.shaft)) is None:
            continue
        yield from gear_indicators(
            parts.average,
            parts.residual,
            parts.difference,
            _band_passed(parts.average, teeth),
            teeth=teeth,
            gear=f"{pair.name}/{shaft.shaft}",
        )


def _band_passed(average: SynchronousAverage, teeth: int) -> SynchronousAverage | None:
    from gearsig.orders import band_passed_mesh

    try:
        return band_passed_mesh(average, teeth)
    except RefusalError:  # the band reaches beyond the sampling rate
        return None


def _of_bearings(signals: AnalysisSignals, name: str, envelopes: list[BandEnvelope]) -> Iterator[Indicator]:
    """Take the band whose envelope has the clearest lines; a quiet one would only state its floor."""
    from gearsig.indicators import bearing_indicators

    of_channel = [e for e in envelopes if e.channel == name]
    if not of_channel:
        return
    envelope = max(of_channel, key=lambda e: float(e.excess.scores().sum()))
    band = f"{envelope.band_hz[0]:.0f} to {envelope.band_hz[1]:.0f} Hz"
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft)
        if ratio is not None and bearing.orders():
            yield from bearing_indicators(envelope.excess.spectrum, bearing, shaft_ratio=ratio, channel=name, band=band)


MINIMUM_SAMPLES = 256
"""Below it no spectrum has a noise floor to compare with."""

LARGEST_VALUE = 1e60
"""Beyond it, fourth powers leave the range of floating point numbers; no unit makes vibration so large."""


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
        Its rig, if any, tells what the machine is.
    rig : Rig or None
        Used where the recording carries none.
    settings : AnalysisSettings or None
    reference : Recording, PreparedRecording or None
        Of the same machine when it was healthy, same sensors, speed and load: cracks of a millimetre show against it,
        and indicators are compared with it.
    torque_nm : float or None
        For the depth of a crack, instead of the operating point's: of the shaft that this names, else of the
        reference shaft.
    on_stage : callable or None
        Called with a few words as each stage begins.

    Returns
    -------
    Analysis
        Findings, most important first; what cannot be told is a finding with its reason, not an error. A machine that
        starts, stops or reverses is examined for backlash and impacts instead: see `gearsig.diagnosis`.

    Raises
    ------
    InputError
        If there is no vibration channel, the record is shorter than 256 samples, or the reference has other channels or
        is the recording itself.
    """
    settings = settings or AnalysisSettings()
    announce = on_stage or (lambda _: None)
    prepared = prepare(recording, rig)
    recording, known = prepared.recording, prepared.rig
    _check_size(recording)
    prepared_reference = None
    if reference is not None:
        prepared_reference = prepare(reference, recording.rig)
        _check_reference(recording, prepared_reference.recording)
    announce("finding the speed")
    findings, dead = detect_data_problems(recording)
    names = [name for name in recording.vibration_names() if name not in dead]
    unsteady = start_stop_analysis(
        recording,
        known,
        findings,
        asdict(settings),
        prepared_reference.recording if prepared_reference is not None else None,
    )
    if unsteady is not None:
        return unsteady
    _check_vibration(recording)
    angle = _angle_of(prepared)
    findings.append(speed_finding(angle))
    if not names:
        findings.append(Finding("all-channels-dead", Kind.CANNOT_TELL, "Every vibration channel is dead."))
        order = ranked(findings)
        return Analysis(recording, recording.rig, angle, (), (), order, verdict_of(order), asdict(settings))
    usable = angle if not isinstance(angle, CannotTell) else None
    material = _material(prepared, names, usable, settings, announce, has_reference=reference is not None)
    announce("gears, bearings and shafts")
    findings += _detect(material)
    reference_analysis = None
    if prepared_reference is not None:
        announce("the reference")
        reference_analysis = analyze(prepared_reference, settings=settings)
        findings = beside_reference(findings, reference_analysis)
    crack = crack_depth(prepared, known, prepared_reference, torque_nm, dead)
    order = ranked(with_crack(findings, crack, known))
    return Analysis(
        recording=recording,
        rig=recording.rig,
        shaft_angle=angle,
        channels=tuple(channel_analysis(material, name, order) for name in names),
        indicators=indicator_table(material.signals, material.envelopes),
        findings=order,
        verdict=verdict_of(order, has_reference=reference is not None),
        settings=asdict(settings),
        crack=crack,
        reference=reference_analysis,
    )


def _material(
    prepared: PreparedRecording,
    names: Sequence[str],
    angle: ShaftAngle | None,
    settings: AnalysisSettings,
    announce: Callable[[str], object],
    *,
    has_reference: bool,
) -> ExaminedSignals:
    """Compute everything that is looked at."""
    announce("averages and spectra")
    signals = replace(compute_signals(prepared, names, angle, settings), has_reference=has_reference)
    announce("envelopes")
    envelopes, chosen = list(band_envelopes(signals)), kurtogram_bands(signals)
    announce("levels over speed")
    return ExaminedSignals(signals, envelopes, chosen, order_levels(signals))


def _angle_of(prepared: PreparedRecording) -> ShaftAngle | CannotTell:
    """Return the angle within the record's own time; pulses may go on before and after it, but do not count."""
    source = prepared.recording.provenance.source
    try:
        return prepared.shaft_angle
    except RefusalError as refusal:
        return CannotTell("What is the speed of the shafts?", refusal.reason, refusal.remedy)
    except InputError as error:  # it names the channel; which file it is in is known here
        where = error.where if error.where.startswith(source) else f"{source}: {error.where}".removesuffix(": ")
        remedy = error.remedy or "check [speed] in the rig file, or state the speed by --speed-rpm"
        raise InputError(error.what, where=where, allowed=error.allowed, remedy=remedy) from None


def _detect(material: ExaminedSignals) -> list[Finding]:
    signals = material.signals
    return [
        *_nothing_to_examine(signals.rig),
        *detect_mesh(signals),
        *detect_tooth_damage(signals),
        *detect_bearings(signals, material.envelopes, material.kurtogram_bands),
        *detect_sidebands(signals),
        *detect_lines(signals),
        *detect_resonances(material.order_levels),
    ]


def _nothing_to_examine(rig: Rig) -> list[Finding]:
    if rig.pairs or rig.bearings:
        return []
    return [
        Finding(
            "machine-not-described",
            Kind.CANNOT_TELL,
            "No gears and no bearings are described, so that none can be examined.",
            surer="A rig file with teeth and bearings; `gearsig rig example` prints one to start from.",
        )
    ]


def _check_size(recording: Recording) -> None:
    where = recording.provenance.source or "recording"
    if recording.n_samples < MINIMUM_SAMPLES:
        raise InputError(
            f"{recording.n_samples} samples are too few", where=where, allowed=f"{MINIMUM_SAMPLES} or more"
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


def _check_reference(recording: Recording, reference: Recording) -> None:
    where = reference.provenance.source or "reference"
    if np.array_equal(recording.samples, reference.samples):
        remedy = "give one that was taken when the machine was healthy"
        raise InputError("the reference is the recording itself", where=where, remedy=remedy)
    missing = [name for name in recording.vibration_names() if name not in reference.channel_names]
    if missing:
        found = ", ".join(reference.channel_names)
        raise InputError(f"the reference has no channel {missing[0]!r}", where=where, allowed=f"same channels: {found}")
