"""The gap of a rig with bearings but no gear pair: it cannot be simulated, so only anomalies are named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import ShaftAngle
from gearsig.diagnosis import (
    BEARING_PARTS,
    SAME_BEARING_ORDER,
    Analysis,
    CannotTell,
    Finding,
    Kind,
    Outcome,
    ReferenceFinding,
    analyze,
    in_reference,
    only_channel_assumed,
    with_matching_channel_names,
)
from gearsig.errors import RefusalError
from gearsig.formatting import enumerated, named, percent, signed
from gearsig.gap._conditions import Stage, readable
from gearsig.gap._places import band_text, hertz
from gearsig.gap._report import (
    NONE,
    UNKNOWN,
    ConditionFacts,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    PlaceKind,
    SpectrumCurves,
    named_cause,
)
from gearsig.gap._simulator import GapEffect, OperatingCondition
from gearsig.prepared import PreparedRecording
from gearsig.rig import Rig
from gearsig.severity import LARGEST_SPEED_DIFFERENCE
from gearsig.spectra import noise_floor

# --------------------
# What stands out in a recording without a simulation: damaged races, other impacts, lines of unknown origin.
# --------------------


RACE_EFFECTS = {"bearing-outer-race": "bearing_outer_race", "bearing-inner-race": "bearing_inner_race"}
"""Code of a finding → the corresponding effect of the catalogue."""

IMPACTS = ("non-synchronous-impacts", "bearing-rolling-element", "bearing-cage")
"""Codes of families of impacts that no effect of the catalogue causes."""

LINE = "unexplained-line"

PARTS = {f"bearing-{part.replace(' ', '-')}": (part, name) for name, (part, _) in BEARING_PARTS.items()}
"""Code of a finding → part of a bearing, and the name of its order."""

SAME_EDGE = 0.1
"""Relative tolerance of a band's edges."""
GROWTH_NOT_KNOWN = "Whether it has grown is not known."

MIN_RISE_DB = 6.0
"""Twice the reference's level: smaller differences occur between two recordings of the same machine."""


@dataclass(frozen=True)
class UnexpectedFinding:
    """A finding beyond what the machine is known to show.

    Parameters
    ----------
    finding : Finding
    recording : str
        Name of the recording.
    rise_db : float or None
        Level over the reference, if that shows it as well in the same band; None: it does not, or there is none.
    """

    finding: Finding
    recording: str
    rise_db: float | None = None

    @property
    def over_floor_db(self) -> float:
        """Level of the strongest line over the noise around it."""
        strength = self.finding.strength
        return float("nan") if strength is None or strength.ratio_db is None else strength.ratio_db

    @property
    def sureness(self) -> tuple[float, float]:
        """Key by which the recording with the most certain finding is chosen."""
        return self.finding.confidence, self.over_floor_db


@dataclass(frozen=True)
class ExaminedRecording:
    """One recording with its analysis, the reference at its speed, and what stands out.

    Parameters
    ----------
    analysis : Analysis
    reference : Analysis or None
        Analysis of the healthy machine at that speed.
    unexpected : tuple of UnexpectedFinding
        Most important first.
    notes : tuple of str
    """

    analysis: Analysis
    reference: Analysis | None
    unexpected: tuple[UnexpectedFinding, ...]
    notes: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.analysis.recording.name

    @property
    def is_healthy(self) -> bool:
        """Whether the bearings were examined, and damage would have been detected."""
        codes = {f.code for f in self.analysis.findings}
        return "no-bearing-damage" in codes and self.analysis.outcome is Outcome.NO_FAULT


def _angle(analysis: Analysis) -> ShaftAngle:
    """Return the angle that an analysis found.

    Raises
    ------
    RefusalError
        If there is no speed.
    """
    angle = analysis.shaft_angle
    if isinstance(angle, CannotTell):
        raise RefusalError(angle.reason, remedy=angle.remedy)
    return angle


def _with_bearings(recording: PreparedRecording) -> Analysis:
    """Analyse a recording, once; its speed must be known and its bearings examined, as there is nothing else."""
    analysis = recording.keep(("gap", "analysed"), lambda: analyze(recording))
    _angle(analysis)
    for finding in analysis.findings:
        if finding.code in ("all-channels-dead", "bearings-not-examined"):
            raise RefusalError(finding.title, remedy=finding.surer or "check the measurement chain")
    return analysis


def examined(analysis: Analysis, references: Sequence[Analysis], *, damaged_too: bool = False) -> ExaminedRecording:
    """Return what stands out in a recording, beyond the reference at its speed where there is one.

    A reference that itself shows a fault is not used, unless `damaged_too`.
    """
    name = analysis.recording.name
    reference, messages = _reference(analysis, references, damaged_too=damaged_too)
    unexpected = []
    for finding in analysis.findings:
        if finding.code not in (*RACE_EFFECTS, *IMPACTS, LINE):
            continue
        earlier = None if reference is None else in_reference(finding, reference)
        rise_db = None if earlier is None else _rise_db(finding, earlier)
        if earlier is None or finding.kind is Kind.FAULT or (rise_db is not None and rise_db >= MIN_RISE_DB):
            unexpected.append(UnexpectedFinding(finding, name, rise_db))
        elif rise_db is None:
            messages.append(
                f"{name}: {finding.title.rstrip('.')}; the reference shows it too, in another band. {GROWTH_NOT_KNOWN}"
            )
    warnings = tuple(f"{name}: {f.title}" for f in analysis.findings if f.kind in (Kind.DATA_PROBLEM, Kind.CANNOT_TELL))
    return ExaminedRecording(analysis, reference, tuple(unexpected), (*messages, *warnings))


def surest(every: Sequence[ExaminedRecording]) -> list[UnexpectedFinding]:
    """Return the findings, each part once, from the recording where it is most certain; single lines last."""
    surest_of: dict[tuple[str, str], UnexpectedFinding] = {}
    for part in (unexpected for recording in every for unexpected in recording.unexpected):
        key = (part.finding.code, part.finding.where.bearing)
        if key not in surest_of or part.sureness > surest_of[key].sureness:
            surest_of[key] = part
    kinds = list(Kind)
    return sorted(
        surest_of.values(),
        key=lambda part: (part.finding.code == LINE, kinds.index(part.finding.kind), -part.finding.confidence),
    )


def bearings_text(finding: Finding, rig: Rig) -> str:
    """Return the bearing of a finding, and others whose same part has the same order; empty where there is none."""
    name = PARTS.get(finding.code, ("", ""))[1]
    orders = {b.name: b.orders().get(name, 0.0) * (rig.ratio(b.shaft) or 0.0) for b in rig.bearings}
    bearing_order = orders.get(finding.where.bearing)
    if not bearing_order:
        return ""
    alike = [bearing for bearing, order in orders.items() if abs(order / bearing_order - 1.0) < SAME_BEARING_ORDER]
    return named("bearing", " or ".join(alike))


def shafts_of_unknown_speed(rig: Rig) -> str:
    """Return the shafts whose speed the rig file does not determine, as where a gear pair is missing; empty: none."""
    return named("shaft", " and ".join(shaft.name for shaft in rig.shafts if rig.ratio(shaft.name) is None))


def _rise_db(finding: Finding, earlier: ReferenceFinding) -> float | None:
    """Return the rise since the reference; None where the bands differ, since the level grows with a band's width."""
    bands = finding.where.band_hz or (), earlier.finding.where.band_hz or ()
    differ = any(abs(now - then) > SAME_EDGE * max(now, then) for now, then in zip(*bands, strict=False))
    return None if differ else earlier.change_db


def _reference(
    analysis: Analysis, references: Sequence[Analysis], *, damaged_too: bool
) -> tuple[Analysis | None, list[str]]:
    """Return the healthy reference at the recording's speed, and what it lacks; or None and the reason."""
    if not references:
        return None, []
    name, speed = analysis.recording.name, _angle(analysis).mean_speed_rpm
    nearest = min(references, key=lambda reference: abs(_angle(reference).mean_speed_rpm - speed))
    channels = {c.channel for c in analysis.channels}
    missing = sorted(channels - {c.channel for c in nearest.channels})
    why = ""
    if abs(_angle(nearest).mean_speed_rpm / speed - 1.0) > LARGEST_SPEED_DIFFERENCE:
        why = f"no reference is within {percent(LARGEST_SPEED_DIFFERENCE)} of its speed"
    elif len(missing) == len(channels):
        why = f"the reference has no channel {', '.join(missing)}"
    elif nearest.outcome is Outcome.FAULT and not damaged_too:
        why = f"the reference at its speed is not healthy ({nearest.findings[0].title.rstrip('.')})"
    if why:
        return None, [f"{name} is not compared with a reference: {why}."]
    unasked = f"the reference has no channel {', '.join(missing)}; what stands out there may not be new"
    return nearest, [f"{name}: {unasked}."] if missing else []


# --------------------
# Causes of what stands out without a simulation to compare with: probabilities and the outcome.
# --------------------


MISSED_FAULT = 0.2
"""Probability that something is wrong although nothing shows, where damage of a race would have shown."""
UNDECIDED = 0.5
"""Fraction of the remaining probability for "unknown", where there is no evidence for it or for "none"."""

Races = Mapping[str, UnexpectedFinding]
"""Name of an effect → its most certain finding."""


def causes_of(
    unexpected: Sequence[UnexpectedFinding],
    every: Sequence[ExaminedRecording],
    rig: Rig,
    effects: Mapping[str, GapEffect],
) -> tuple[tuple[GapCause, ...], GapOutcome]:
    """Return the causes, with that of the outcome first, and the outcome.

    A race has the confidence c of its finding. Of the remainder 1 − Σc, a fraction u goes to "unknown" and 1 − u to
    "none". u is the confidence of other impacts or lines where they stand out alone, and 1/2 beside a race. Where
    nothing stands out, it is 1/5 if damage would have shown, else 1/2. An effect is named only if the finding is a
    fault.

    Parameters
    ----------
    unexpected : sequence of UnexpectedFinding
        Most important first.
    every : sequence of ExaminedRecording
    rig : Rig
    effects : mapping
        Effects that may be named.
    """
    races = {
        name: part for part in reversed(unexpected) if (name := RACE_EFFECTS.get(part.finding.code, "")) in effects
    }
    outcome, why = _outcome(unexpected, races, every, rig)
    total = sum(part.finding.confidence for part in races.values())
    remainder = 1.0 - min(total, 1.0)
    unknown = remainder * _share_of_unknown(unexpected, races, every)
    causes = [
        _race(effects[name], races.get(name), rig, scale=1.0 / max(total, 1.0))
        for name in RACE_EFFECTS.values()
        if name in effects
    ]
    strange = [part.finding for part in unexpected if part not in races.values()]
    causes += [
        GapCause(
            UNKNOWN,
            UNKNOWN,
            why if outcome is GapOutcome.UNKNOWN else "something else",
            "",
            unknown,
            notes=_messages(strange[0]) if strange and outcome is GapOutcome.UNKNOWN else (),
        ),
        GapCause(NONE, NONE, why if outcome is GapOutcome.NO_GAP else "no damage", "", remainder - unknown),
    ]
    firsts = {GapOutcome.UNKNOWN: UNKNOWN, GapOutcome.NO_GAP: NONE}
    first = firsts.get(outcome) or RACE_EFFECTS[_significant_races(races)[0].finding.code]
    return tuple(sorted(causes, key=lambda cause: (cause.name != first, -cause.probability))), outcome


def _significant_races(races: Races) -> list[UnexpectedFinding]:
    """Return the races that are certain to be damaged, most certain first."""
    faults = [race for race in races.values() if race.finding.kind is Kind.FAULT]
    return sorted(faults, key=lambda race: -race.finding.confidence)


def _outcome(
    unexpected: Sequence[UnexpectedFinding], races: Races, every: Sequence[ExaminedRecording], rig: Rig
) -> tuple[GapOutcome, str]:
    """Return the outcome and its reason."""
    if _significant_races(races):
        return GapOutcome.EFFECT, ""
    if unexpected:
        return GapOutcome.UNKNOWN, _why_unknown(unexpected[0], races, rig)
    if all(recording.reference is not None for recording in every):
        return GapOutcome.NO_GAP, "nothing stands out that the healthy reference does not show"
    if all(recording.is_healthy for recording in every):
        return GapOutcome.NO_GAP, "nothing stands out, and damage of a race would have"
    return GapOutcome.UNKNOWN, "nothing stands out, but damage of a race might not have"


def _why_unknown(part: UnexpectedFinding, races: Races, rig: Rig) -> str:
    code = part.finding.code
    if code in RACE_EFFECTS:
        is_known = part in races.values()
        return (
            "the lines of the race are not clear enough" if is_known else "the race is not among the effects asked for"
        )
    if code in PARTS:
        return f"damage of a {PARTS[code][0]} is not in the catalogue"
    why = "what makes the line is not known" if code == LINE else "what makes the impacts is not known"
    loose = shafts_of_unknown_speed(rig)
    return f"{why}; it may turn with {loose}, whose speed the rig file does not give" if loose else why


def _share_of_unknown(
    unexpected: Sequence[UnexpectedFinding], races: Races, every: Sequence[ExaminedRecording]
) -> float:
    impacts = [part.finding.confidence for part in unexpected if part.finding.code in IMPACTS]
    if races:  # beside a race, a line may be the ringing of its impacts
        return max([UNDECIDED, *impacts])
    if unexpected:
        return max(part.finding.confidence for part in unexpected)
    return MISSED_FAULT if all(part.is_healthy for part in every) else UNDECIDED


def _race(effect: GapEffect, part: UnexpectedFinding | None, rig: Rig, *, scale: float) -> GapCause:
    if part is None:
        return named_cause(effect.name, 0.0, {effect.name: effect})
    finding = part.finding
    cause = named_cause(effect.name, scale * finding.confidence, {effect.name: effect}, bearings_text(finding, rig))
    return replace(cause, notes=_messages(finding))


def _messages(finding: Finding) -> tuple[str, ...]:
    basis = finding.confidence_basis
    return (*finding.evidence, *((f"{basis[:1].upper()}{basis[1:]}.",) if basis else ()))


# --------------------
# What stands out in a recording by itself, as places of a gap.
# --------------------


NAN = float("nan")


def place_of_unexpected(part: UnexpectedFinding, rig: Rig, *, name: str = "") -> GapPlace:
    """Return the place of a finding, without sizes in floors, since it is found without a simulation.

    Parameters
    ----------
    part : UnexpectedFinding
    rig : Rig
    name : str
        Name of the recording, where there are several.
    """
    where = part.finding.where
    order = where.order or NAN
    frequency = "" if where.frequency_hz is None else f", {hertz(where.frequency_hz)}"  # none where the speed varies
    over = f"{part.over_floor_db:.0f} dB over their floor" + (
        f" in {band_text(where.band_hz)}" if where.band_hz else ""
    )
    since = "" if part.rise_db is None else f", {signed(part.rise_db)} dB over the reference"
    in_recording = f", in {name}" if name else ""
    driver = rig.ratio(rig.pairs[0].driver) if rig.pairs else 1.0
    return GapPlace(
        PlaceKind.LINE if part.finding.code == LINE else PlaceKind.ENVELOPE,
        f"{_part_text(part, rig)} (order {order:.4g}{frequency}), {over}{since}{in_recording}",
        part.over_floor_db if part.rise_db is None else part.rise_db,
        shaft=where.shaft,
        orders=(order / (driver or 1.0),),
        band_hz=where.band_hz,
        channel=where.channels[0] if where.channels else "",
    )


def _part_text(part: UnexpectedFinding, rig: Rig) -> str:
    code = part.finding.code
    if code in PARTS:
        return f"envelope lines of the {PARTS[code][0]} of {bearings_text(part.finding, rig)}"
    if code == LINE:
        return "the strongest line of no known shaft or bearing"
    loose = shafts_of_unknown_speed(rig)
    parts = [*(["no gear"] if rig.pairs else []), "no shaft", *(["no bearing"] if rig.bearings else [])]
    unknown = "" if rig.bearings else ", the rig file naming no bearing"
    known = f" of known speed explains, perhaps {loose}" if loose else " explains"
    return f"envelope lines of impacts that {enumerated(parts)}{known}{unknown}"


NO_GEAR_PAIR = (
    "The rig has no gear pair, so no simulator can model it: nothing was simulated, and no effect of gears was tried. "
    "How large the gap is, how severe its cause and how far it shrinks are not known; there is no twin. Only damaged "
    "races of the bearings were looked for, not unbalance, misalignment, clearance, drive or load."
)
HOW_SURE = (
    "The probabilities are not the calibrated ones of rigs with a gear pair. A race has the confidence of the bearing "
    "search: an upper limit, from how rarely noise makes such lines and how well other parts or a wrong speed explain "
    "them. The remainder is shared between unknown and none."
)
NO_REFERENCE = "No healthy reference: what stands out may have been there when the machine was healthy."
N_SHOWN = 6.5
"""Range of a spectrum's plot, in multiples of the order found."""


def diagnose_gearless(
    recordings: Sequence[PreparedRecording],
    references: Sequence[PreparedRecording],
    effects: Mapping[str, GapEffect],
    tell: Stage,
) -> GapReport:
    """Name a damaged race, or report that something unknown stands out, or nothing.

    Parameters
    ----------
    recordings, references : sequence of PreparedRecording
        Each with its rig.
    effects : mapping
        Effects that may be named; only damaged races can be.
    tell : callable
        Called with the current stage and the fraction completed.

    Returns
    -------
    GapReport
        Without simulator, sizes, steps and twin.

    Raises
    ------
    RefusalError
        If there is no speed or no live channel, or there are too few revolutions.
    """
    tell("analysing the references", 0.05)
    left_out: list[str] = []

    def healthy_reference(reference: PreparedRecording) -> tuple[PreparedRecording, list[str]]:
        _with_bearings(with_matching_channel_names(recordings[0].recording, reference))
        return reference, []

    usable = readable(references, healthy_reference, "reference", left_out)
    done, rig = iter(range(len(recordings))), recordings[0].rig

    def examine(recording: PreparedRecording) -> tuple[ExaminedRecording, list[str]]:
        tell(f"analysing {recording.recording.name}", 0.2 + 0.7 * next(done) / len(recordings))
        healthy = [with_matching_channel_names(recording.recording, reference) for reference in usable]
        alone = examined(_with_bearings(recording), [_with_bearings(reference) for reference in healthy])
        pairs = zip(usable, healthy, strict=True)
        taken = [f.title for then, named in pairs for f in only_channel_assumed(then.recording, named.recording)]
        return _beyond_reference(recording, alone, healthy), taken

    every = readable(recordings, examine, "recording", left_out)
    hint = () if references else (NO_REFERENCE,)
    unexpected = surest(every)
    causes, outcome = causes_of(unexpected, every, rig, effects)
    return GapReport(
        rig=rig.name,
        simulator="",
        conditions=tuple(_facts(item) for item in every),
        references=tuple(item.recording.name for item in references) if any(e.reference for e in every) else (),
        outcome=outcome,
        places=tuple(
            place_of_unexpected(item, rig, name=item.recording if len(every) > 1 else "") for item in unexpected
        ),
        causes=causes,
        spectra=_spectra(unexpected, every),
        notes=(
            NO_GEAR_PAIR,
            HOW_SURE,
            *hint,
            *left_out,
            *_loose_shafts(rig),
            *_limits(unexpected, every),
            *(text for item in every for text in item.notes),
        ),
    )


def _beyond_reference(
    recording: PreparedRecording, alone: ExaminedRecording, references: Sequence[PreparedRecording]
) -> ExaminedRecording:
    """Omit faults and suspicions for which the reference gives as much reason, measured in the same band of both.

    What is barely suspected in one recording is often just missed in another of the same machine.
    """

    def is_asked(finding: Finding) -> bool:
        return finding.is_claim or finding.code in RACE_EFFECTS  # weak lines of a race alone are only a notice

    if alone.reference is None or not any(is_asked(part.finding) for part in alone.unexpected):
        return alone
    # The prepared one, which holds what its own analysis has resampled and averaged.
    reference = next(prepared for prepared in references if prepared.recording is alone.reference.recording)
    beside = analyze(recording, reference=reference)
    now = {(f.code, f.where): f for f in beside.findings}
    kept, notes = [], list(alone.notes)
    for part in alone.unexpected:
        finding = now.get((part.finding.code, part.finding.where), part.finding)
        is_less = finding.kind is not part.finding.kind if part.finding.is_claim else not finding.is_claim
        if is_asked(part.finding) and is_less:
            notes.append(f"{alone.name}: {finding.title.rstrip('.')}. {finding.evidence[-1]}")
        else:
            kept.append(part)
    return replace(alone, unexpected=tuple(kept), notes=tuple(notes))


def _loose_shafts(rig: Rig) -> list[str]:
    """Return a message with the shafts whose orders, and those of their bearings, are not known."""
    loose = shafts_of_unknown_speed(rig)
    if not loose:
        return []
    message = (
        f"The rig file does not give the speed of {loose}, as it names no gear pair: whatever turns with it counts as "
        "unexplained, and its bearings were not examined. Give the teeth of the pair."
    )
    return [message]


def _limits(unexpected: Sequence[UnexpectedFinding], every: Sequence[ExaminedRecording]) -> list[str]:
    """Return messages where several races, or several recordings, contradict a single answer."""
    faults = [part for part in unexpected if part.finding.kind is Kind.FAULT]
    texts = []
    if len({part.finding.code for part in faults if part.finding.code in RACE_EFFECTS}) > 1:
        texts.append("Both races stand out and may both be damaged: the probabilities, of one cause each, are shared.")
    for fault in faults:
        key = (fault.finding.code, fault.finding.where.bearing)
        quiet_parts = [
            part.name
            for part in every
            if key not in [(s.finding.code, s.finding.where.bearing) for s in part.unexpected]
        ]
        if quiet_parts:
            texts.append(
                f"{', '.join(quiet_parts)}: no lines of the {PARTS[key[0]][0]} of {named('bearing', key[1])} stand out."
            )
    return texts


def _facts(examined_recording: ExaminedRecording) -> ConditionFacts:
    recording, angle = examined_recording.analysis.recording, _angle(examined_recording.analysis)
    torque = None if recording.rig is None else recording.rig.nominal_torque_nm()
    return ConditionFacts(
        examined_recording.name,
        OperatingCondition(angle.mean_speed_rpm, NAN if torque is None else torque),
        angle.n_revolutions,
        recording.duration_s,
        recording.sampling_rate_hz,
    )


def _spectra(unexpected: Sequence[UnexpectedFinding], every: Sequence[ExaminedRecording]) -> tuple[SpectrumCurves, ...]:
    """Return the envelope spectrum that shows the first family, or that of the first channel where there is none."""
    families = [item for item in unexpected if item.finding.code != LINE]
    name = families[0].recording if families else every[0].name
    channels = next(item for item in every if item.name == name).analysis.channels
    shown_channels = families[0].finding.where.channels if families else ()
    if not channels:
        return ()  # with a doubtful rate or speed, nothing was computed over orders
    channel = next((c for c in channels if c.channel in shown_channels), channels[0])
    spectrum, band = channel.envelope_spectrum, channel.envelope_band_hz
    if spectrum is None or band is None:
        return ()
    highest = N_SHOWN * (families[0].finding.where.order or NAN) if families else NAN
    kept = spectrum.positions <= (highest if np.isfinite(highest) else spectrum.positions[-1])
    label = f"envelope of {channel.channel}, {band_text(band)}" + (f", {name}" if len(every) > 1 else "")
    nothing = np.zeros(0)
    return (
        SpectrumCurves(
            label,
            spectrum.unit,
            spectrum.positions[kept],
            spectrum.values[kept],
            nothing,
            nothing,
            noise_floor(spectrum).values[kept],
        ),
    )


# --------------------
# What stands out in a recording of gears by itself, found by the analysis: impacts, and lines of unknown origin.
# --------------------


HIGHEST_HARMONIC, HARMONIC_TOLERANCE = 40, 1e-3
"""Highest multiple of a family of impacts at which a line still belongs to it, and the relative tolerance."""


def unexpected_findings(
    recording: PreparedRecording, references: Sequence[PreparedRecording]
) -> tuple[list[UnexpectedFinding], list[str], list[str]]:
    """Return families of impacts that no shaft repeats, beyond the reference's, most certain first; notes; warnings.

    The catalogue's effects are compared by features of known places; there, an unknown family is one feature among a
    hundred and easily lost. The analysis searches for it separately. A line of unknown origin, or a family that may
    well be chance, becomes a note. A fault of the reference becomes a warning, as it casts doubt on everything else.
    """
    name, now = recording.recording.name, analyze(recording)
    if isinstance(now.shaft_angle, CannotTell):  # without a speed no family of impacts has an order
        return [], [], []
    speeds: list[tuple[float, int, PreparedRecording]] = []
    for reference in references if len(references) > 1 else ():
        with suppress(RefusalError):  # a reference without a speed is no help
            speeds.append(
                (abs(reference.shaft_angle.mean_speed_rpm - now.shaft_angle.mean_speed_rpm), len(speeds), reference)
            )
    nearest = min(speeds)[2] if speeds else references[0] if len(references) == 1 else None
    alike = [] if nearest is None else [with_matching_channel_names(recording.recording, nearest)]
    healthy = [analysis for analysis in map(analyze, alike) if isinstance(analysis.shaft_angle, ShaftAngle)]
    alone = examined(now, healthy, damaged_too=True)  # shared findings are no gap, but give a warning
    now_examined = _beyond_reference(recording, alone, alike)
    warnings = _fault_of_reference(healthy[0], now, name) if healthy else []
    weak = [part for part in now_examined.unexpected if part.finding.code == LINE or part.finding.kind is Kind.NOTICE]
    strong = [part for part in now_examined.unexpected if part not in weak]
    messages = [
        f"Not explained by the gear model, in {name}: {part.finding.title.rstrip('.')}{_odds(part)}."
        for part in weak
        if not (part.finding.code == LINE and any(_is_harmonic(part, family) for family in strong))
    ]
    messages += now_examined.notes[len(alone.notes) :]
    return strong, messages, warnings


def with_unexpected(outcome: GapOutcome, unexpected: Sequence[UnexpectedFinding]) -> tuple[GapOutcome, list[str]]:
    """Return the outcome where impacts stand out although no effect is named, and what to check first.

    Impacts that no shaft repeats are a gap, however few features show them: unknown. Those of a bearing's race are in
    the catalogue; the forests see too little of them, so the outcome is undecided.
    """
    if not unexpected or outcome not in (GapOutcome.NO_GAP, GapOutcome.UNDECIDED):
        return outcome, []
    races = [part for part in unexpected if part.finding.code in RACE_EFFECTS]
    if len(races) < len(unexpected):
        return GapOutcome.UNKNOWN, []
    return GapOutcome.UNDECIDED, [
        f"{part.recording}: {part.finding.title.rstrip('.')}{_odds(part)}, found by the search for bearing orders; "
        "few of the compared features show it."
        for part in races
    ]


def _is_harmonic(line: UnexpectedFinding, family: UnexpectedFinding) -> bool:
    """Whether a line is a multiple of a family's order, which then explains it."""
    order, base = line.finding.where.order, family.finding.where.order
    if not (order and base and line.finding.where.shaft == family.finding.where.shaft):
        return False
    n = round(order / base)
    return 1 <= n <= HIGHEST_HARMONIC and abs(order / (n * base) - 1.0) < HARMONIC_TOLERANCE


def _odds(part: UnexpectedFinding) -> str:
    return "" if part.finding.code == LINE else f" (at most {percent(part.finding.confidence)})"


def _fault_of_reference(reference: Analysis, now: Analysis, name: str) -> list[str]:
    """Return a message if the reference shows a fault itself, in particular where the recording shows none."""
    if reference.outcome is not Outcome.FAULT:
        return []
    fault = reference.findings[0]
    is_shown = now.outcome is Outcome.FAULT or in_reference(fault, now) is not None
    perhaps = "" if is_shown else " and the recording shows no fault: they may have been exchanged"
    title = fault.title.rstrip(".")
    message = (
        f"The reference of {name} does not look healthy ({title}){perhaps}. What is named may be in the "
        "reference and not in the recording."
    )
    return [message]
