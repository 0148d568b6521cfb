"""A gap report, and what it says in four sentences: where, which, how far, and what to record next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan

from gearsig.formatting import odds_text, percent
from gearsig.gap._next_recording import HEALTHY_MACHINE, STEPS
from gearsig.gap._simulator import GapEffect
from gearsig.gap._types import (
    LIKELIER_THAN_NOT,
    NAMING,
    NONE,
    NOT_KNOWN,
    OWN_LABELS,
    UNKNOWN,
    AngleCurves,
    AverageCurves,
    ConditionFacts,
    GapCause,
    GapKind,
    GapOutcome,
    GapPlace,
    GapStep,
    Interval,
    LabelledFacts,
    NextRecording,
    NextStep,
    SpectrumCurves,
    group_probabilities,
    kind_of,
    rivals,
)
from gearsig.gap._words import hardly_predicted, same_load, same_speed, severity_unit
from gearsig.results import Result, verdict_html


@dataclass(frozen=True)
class GapReport(Result, rows="causes"):
    """The answer.

    Parameters
    ----------
    rig, simulator : str
        Names; no simulator where none can be set to the rig.
    conditions : tuple of ConditionFacts
    references : tuple of str
        Names of the healthy recordings that were compared with; empty: the simulation itself is compared with.
    outcome : GapOutcome
    size : Interval
        Of the whole gap in structural floors (the largest that healthy machines reach once in twenty is 1); nan where
        nothing was simulated.
    repeatability : float
        The same in repeatability floors.
    places : tuple of GapPlace
        See `gearsig.gap`.
    causes : tuple of GapCause
        What the outcome names first, the others by probability; these add up to 1.
    groups : mapping
        Group → probability; default: of the causes.
    inseparable : tuple of str or None
        Causes that these recordings cannot tell apart, likeliest first; default: `rivals`, where the outcome says so.
    steps : tuple of GapStep
        Before, with each effect, what is left.
    next_recordings : tuple of NextRecording
        Best first.
    spectra : tuple of SpectrumCurves
    angles : tuple of AngleCurves
    averages : tuple of AverageCurves
        Empty where there is no reference.
    notes : tuple of str
        What the reader should know.
    warnings : tuple of str
        What must be checked first, where there is strong evidence of it: a wrong rig file, or recording and reference
        exchanged. The rest of the report is as if it were not so.
    twin_toml : str
        The simulator with the effect fitted, as a preset; empty where none is named.
    labelled : LabelledFacts or None
        What labelled recordings of the rig changed; None: none were given.
    next_steps : tuple of NextStep
        What would help most besides, best first.
    """

    rig: str
    simulator: str
    conditions: tuple[ConditionFacts, ...]
    references: tuple[str, ...]
    outcome: GapOutcome
    causes: tuple[GapCause, ...]
    size: Interval = NOT_KNOWN
    repeatability: float = nan
    places: tuple[GapPlace, ...] = ()
    groups: Mapping[str, float] = field(default_factory=dict)
    inseparable: tuple[str, ...] | None = None
    steps: tuple[GapStep, ...] = ()
    next_recordings: tuple[NextRecording, ...] = ()
    spectra: tuple[SpectrumCurves, ...] = ()
    angles: tuple[AngleCurves, ...] = ()
    averages: tuple[AverageCurves, ...] = ()
    notes: tuple[str, ...] = ()
    twin_toml: str = field(default="", repr=False)
    warnings: tuple[str, ...] = ()
    labelled: LabelledFacts | None = None
    next_steps: tuple[NextStep, ...] = ()

    def __post_init__(self) -> None:
        if not self.groups:
            object.__setattr__(self, "groups", group_probabilities(self.causes))
        if self.inseparable is None and self.outcome is GapOutcome.CANNOT_SEPARATE:
            object.__setattr__(self, "inseparable", rivals(self.causes))

    @property
    def kind(self) -> GapKind | None:
        """The kind of fault that is named; None where nothing is, or no kind is likelier than all else together."""
        return kind_of(self.causes, self.groups) if self.outcome in NAMING else None

    def _repr_html_(self) -> str:
        """Return the four lines of the verdict and the likeliest causes, for notebooks."""
        probable = [cause for cause in self.causes if cause.probability >= 0.01][:5]
        rows = [(cause.title, odds_text(cause.probability), cause.place) for cause in probable]
        return verdict_html(self.verdict, ("cause", "probability", "place"), rows)

    @property
    def is_simulated(self) -> bool:
        """Whether a simulator could be set to the rig; without one there are no sizes in floors, no steps, no twin."""
        return bool(self.simulator)

    @property
    def is_beyond(self) -> bool:
        """Whether an effect is named, or the whole gap exceeds what healthy machines show.

        Single places and lines may exceed their own floors all the same, by chance. True where nothing was simulated:
        there is no whole then.
        """
        return self.outcome in NAMING or not self.size.value <= 1.0

    @property
    def verdict(self) -> tuple[str, str, str, str]:
        """Where, which, how far, and what to record next: one line each."""
        if self.is_simulated:
            return _where(self), _which(self), _shrinkage_text(self), _next(self)
        return _where_seen(self), _which_seen(self), NO_SIMULATION, _next_seen(self)


NO_SIMULATION = (
    "How far: cannot be told; the simulators have a gear pair and this rig has none, so nothing was simulated."
)


def _where(report: GapReport) -> str:
    if report.outcome in (GapOutcome.NO_GAP, GapOutcome.UNDECIDED) and (report.size.value <= 1.0 or not report.places):
        return f"Where: nowhere beyond the floor; the gap is {report.size.value:.2g} structural floors."
    if not report.places:
        return f"Where: spread over all orders and bands, {report.size.value:.2g} structural floors."
    first, *further_places = report.places
    second_place = ""
    if not isfinite(first.structural) and further_places and isfinite(further_places[0].share):
        second_place = f"; beside it, {_with_size(further_places[0])}"
    return f"Where: {_with_size(first)}{second_place}."


def _with_size(place: GapPlace) -> str:
    """Return a place's title, with its size and share as far as it has them."""
    size = f", {place.structural:.2g} structural floors" if isfinite(place.structural) else ""
    return f"{place.title}{size}{f' ({percent(place.share)} of the gap)' if isfinite(place.share) else ''}"


def _which(report: GapReport) -> str:
    first = report.causes[0]
    odds = odds_text(first.probability)
    if report.outcome is GapOutcome.NO_GAP:
        return f"Which: none ({odds}); what differs is no more than between healthy machines and the simulator."
    if report.outcome is GapOutcome.UNDECIDED:
        return _which_undecided(report)
    if report.outcome is GapOutcome.UNKNOWN:
        return _which_unknown(report)
    if report.outcome is GapOutcome.CANNOT_SEPARATE and report.inseparable is not None:
        return f"Which: {_kind_and_rivals(report, report.inseparable)}; these recordings cannot tell them apart."
    size = f", {_severity(first, first.severity)}" if first.severity and not first.severity.is_unbounded else ""
    if report.kind is not None and report.kind.probability - first.probability >= SURER:
        return f"Which: {_kind(report.kind)}: {first.title}{size} (probability {odds})."
    place = f" at {first.place}" if first.place else ""
    return f"Which: {first.title}{place}{size} (probability {odds})."


SURER = 0.01
"""By how much the kind of fault is surer than the effect, from which it is told first."""


def _kind(kind: GapKind) -> str:
    """Return "a damaged tooth, tooth 21 of the gear on the input shaft (97 %)"."""
    place = f", {kind.place}" if kind.place else ""
    return f"{kind.title}{place} ({odds_text(kind.probability)})"


def _kind_and_rivals(report: GapReport, rivals: Sequence[str]) -> str:
    """Return the kind of fault with what of it is likeliest, then what else may be; without a kind, all of them."""
    if report.kind is None:
        return _or_text(report, rivals)
    groups = {cause.name: cause.group for cause in report.causes}
    within = [name for name in rivals if groups.get(name) == report.kind.group]
    beyond = [name for name in rivals if name not in within]
    if not within:
        return _or_text(report, rivals)
    return f"{_kind(report.kind)}: {_or_text(report, within)}{f'; else {_or_text(report, beyond)}' if beyond else ''}"


def _or_text(report: GapReport, names: Sequence[str]) -> str:
    *titles, last = (_titled(report, name) for name in names)
    return f"{', '.join(titles)} or {last}" if titles else last


def _which_unknown(report: GapReport) -> str:
    known = [cause for cause in report.causes if cause.name not in (NONE, UNKNOWN)]
    best = max(known, key=lambda cause: cause.probability, default=None)
    unknown = next((cause.probability for cause in report.causes if cause.name == UNKNOWN), 1.0)
    if best is None or best.probability <= unknown:
        return "Which: unknown; nothing in the catalogue explains it well enough."
    return f"Which: unknown; {best.title} comes nearest ({odds_text(best.probability)}), too little to be named."


def named_cause(name: str, probability: float, effects: Mapping[str, GapEffect], place: str = "") -> GapCause:
    """Return a cause by its name: one of the effects, none or unknown, or somebody's own label."""
    if name in effects:
        e = effects[name]
        return GapCause(name, e.group, e.title, e.unit, probability, place=place, is_nuisance=e.is_nuisance)
    if name not in (NONE, UNKNOWN):
        return GapCause(name, OWN_LABELS, f"“{name.replace('_', ' ')}”", "", probability)
    title = "nothing beyond what healthy machines differ by" if name == NONE else "nothing in the catalogue"
    return GapCause(name, name, title, "", probability)


def in_order(causes: Sequence[GapCause], outcome: GapOutcome) -> tuple[GapCause, ...]:
    """Put first what the outcome says; the rest by probability."""
    ranked = sorted(causes, key=lambda cause: -cause.probability)
    if outcome is GapOutcome.UNDECIDED:
        return tuple(ranked)
    name = {GapOutcome.NO_GAP: NONE, GapOutcome.UNKNOWN: UNKNOWN}.get(outcome)
    first = next(c for c in ranked if (c.name == name if name else c.name not in (NONE, UNKNOWN)))
    return (first, *(c for c in ranked if c is not first))


def most_probable_two(causes: Sequence[GapCause]) -> tuple[str, str] | None:
    """Return the names of the first two effects, None where there are fewer."""
    names = [c.name for c in causes if c.name not in (NONE, UNKNOWN)]
    return (names[0], names[1]) if len(names) > 1 else None


SETTLED = 0.01
"""Probability of the second effect below which nobody needs a further recording to tell it from the first."""


def is_settled(causes: Sequence[GapCause]) -> bool:
    """Whether of all effects one alone is likely."""
    probabilities = sorted((c.probability for c in causes if c.name not in (NONE, UNKNOWN)), reverse=True)
    return len(probabilities) > 1 and probabilities[1] < SETTLED <= probabilities[0]


def within_the_floor(probabilities: Mapping[str, float], size: Interval) -> dict[str, float]:
    """Return the probabilities with that of an unknown cause given to none, where the whole gap is within its floor.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    size : Interval
        Of the whole gap, in structural floors.
    """
    if size.high > 1.0:
        return dict(probabilities)
    moved = {NONE: probabilities[NONE] + probabilities[UNKNOWN], UNKNOWN: 0.0}
    return dict(sorted({**probabilities, **moved}.items(), key=lambda item: -item[1]))


def unbounded_fits(causes: Sequence[GapCause], outcome: GapOutcome) -> list[str]:
    """Say of what is named which effects the fit can give no size, not even tell from nothing at all."""
    named = rivals(causes) if outcome is GapOutcome.CANNOT_SEPARATE else [causes[0].name] if outcome in NAMING else ()
    return [
        f"{cause.title[0].upper()}{cause.title[1:]}: on the twin any severity fits the recordings about as well, none "
        "at all included. How the recordings changed speaks for it, the simulation does not."
        for cause in causes
        if cause.name in named and cause.severity is not None and cause.severity.is_unbounded
    ]


def _which_undecided(report: GapReport) -> str:
    """Name the likeliest two, and the group that is likelier than not."""
    named = {NONE: "no gap", UNKNOWN: "a gap of unknown cause"}
    most_probable = sorted(report.causes, key=lambda cause: -cause.probability)[:2]
    parts = [f"{named.get(cause.name, cause.title)} {odds_text(cause.probability)}" for cause in most_probable]
    groups = {name: p for name, p in report.groups.items() if name not in (NONE, UNKNOWN, "")}
    group = max(groups, key=groups.__getitem__, default="")
    if group and groups[group] >= LIKELIER_THAN_NOT:
        parts.append(f"effects of the group “{group}” together {odds_text(groups[group])}")
    return f"Which: undecided; nothing is likely enough to be named: {', '.join(parts)}."


def _severity(cause: GapCause, severity: Interval) -> str:
    """Write a severity with three digits, without an exponent, and its unit."""
    return f"{float(f'{severity.value:.3g}'):.12g} {severity_unit(cause.unit)}".rstrip()


def _titled(report: GapReport, name: str) -> str:
    cause = {c.name: c for c in report.causes}.get(name)
    return f"{cause.title} ({odds_text(cause.probability)})" if cause is not None else name.replace("_", " ")


def _shrinkage_text(report: GapReport) -> str:
    shrinkage = report.causes[0].shrinkage
    if report.outcome not in NAMING or shrinkage is None:
        return "How far: no effect was added."
    if not shrinkage.is_predicted:
        return f"How far: not known; {report.causes[0].title} {hardly_predicted(shrinkage)}."
    s, sizes = shrinkage.shrink, f"from {shrinkage.before.value:.2g} to {shrinkage.after.value:.2g} structural floors"
    low, high = (f"{100 * end:.0f}" for end in (s.low, s.high))
    closed = percent(s.value) + (f" ({low} to {high} %)" if low != high else "")
    shrinks = f"shrinks {sizes}, by {closed} of what exceeds one,"
    if s.value <= 0.0:
        shrinks = "does not shrink"
    elif shrinkage.after.high < 1.0:
        shrinks = f"shrinks {sizes}, within what healthy machines show,"
    return f"How far: with {report.causes[0].title}, the gap on its own features {shrinks} on {shrinkage.held_out}."


def _next(report: GapReport) -> str:
    best = report.next_recordings[0].text if report.next_recordings else ""
    steps = [step.text for step in report.next_steps] or ([] if report.references else [STEPS["healthy"]])
    if steps:
        return f"Next: {steps[0]}. Or {best}" if best else f"Next: {steps[0]}."
    if best:
        return f"Next: {best}"
    if report.outcome in (GapOutcome.UNKNOWN, GapOutcome.UNDECIDED):
        purpose = {"speed": ", which tells orders from resonances"}
        ways = "".join(f", or another {what}{purpose.get(what, '')}" for what in _unvaried_quantities(report)[:1])
        return f"Next: another sensor nearer to where it is loudest{ways}."
    if report.outcome is GapOutcome.NO_GAP:
        return "Next: nothing is needed; keep these recordings, later ones are best compared with them."
    if sum(cause.shrinkage is not None for cause in report.causes) < 2:
        ways = " or ".join(_unvaried_quantities(report)) or "sensor"
        return f"Next: another {ways}; no two effects are likely enough to compute which would tell most."
    where_to_look = _common_place(report)
    look = f"look at {where_to_look}; " if where_to_look else ""
    why = "speed or load that was simulated would put the two likeliest effects further apart"
    if is_settled(report.causes):
        why = "effect is likely enough to be told from this one by a further recording"
    return f"Next: {look}no other {why}."


def _unvaried_quantities(report: GapReport) -> list[str]:
    """Return what of speed and load is the same in all recordings."""
    points = [condition.point for condition in report.conditions]
    same = {"speed": same_speed, "load": same_load}
    return [what for what, is_same in same.items() if all(is_same(points[0], point) for point in points)]


def _common_place(report: GapReport) -> str:
    """Return the place that both likeliest effects share, which can be looked at; empty where they have none."""
    first, second = [cause.place for cause in report.causes if cause.name not in (NONE, UNKNOWN)][:2]
    return first if first == second and first.startswith("tooth") else ""


def _where_seen(report: GapReport) -> str:
    if report.places:
        return f"Where: {report.places[0].title}."
    beyond = " beyond the healthy reference" if report.references else ""
    return f"Where: nothing stands out{beyond} that is not synchronous with a shaft."


def _which_seen(report: GapReport) -> str:
    first = report.causes[0]
    odds = f"at most {percent(first.probability)}"
    if report.outcome is GapOutcome.UNKNOWN:
        return f"Which: unknown; {first.title}."
    place = f" at {first.place}" if first.place else ""
    name = "none; " if report.outcome is GapOutcome.NO_GAP else ""
    return f"Which: {name}{first.title}{place} ({odds})."


def _next_seen(report: GapReport) -> str:
    if report.references:
        return "Next: another sensor nearer to the bearings, or a longer recording."
    return f"Next: {HEALTHY_MACHINE}, at the same speed; then only what has changed since is named."
