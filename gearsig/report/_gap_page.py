"""The page of a gap diagnosis: where, which, how far, what to record next."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from datetime import datetime
from math import isfinite
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from gearsig import plot
from gearsig.cache import write_text
from gearsig.formatting import enumerated, named, odds_text, percent, readable, signed
from gearsig.gap import (
    NONE,
    UNKNOWN,
    AngleCurves,
    AverageCurves,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    Interval,
    OperatingCondition,
    PlaceKind,
    Shrinkage,
    SpectrumCurves,
    against_reference,
    evidence_direction_text,
    lines_beyond,
    point_text,
    same_condition,
    severity_unit,
    too_small_to_judge_text,
)
from gearsig.processes import begin
from gearsig.report._files import render
from gearsig.report._sections import Rows, made_rows

N_DETAILED = 3
"""Number of causes whose evidence is shown."""
MIN_SHOWN = 0.01
"""Groups below this are left out, and shares below it are written as "< 1 %"."""
OUTCOME_CLASSES = {
    "no gap": "no-fault",
    "effect": "fault",
    "cannot separate": "suspicion",
    "unknown": "cannot-tell",
    "undecided": "cannot-tell",
}


class PlaceRow(NamedTuple):
    """A place of the gap, as shown on the page."""

    title: str
    where: tuple[str, ...]
    change: str
    repeatability: str
    structural: str
    sizes: str
    share: str
    bar_percent: float


class EvidenceRow(NamedTuple):
    """A predicted and an observed change in dB; the stance in words, its sign, and its CSS class."""

    feature: str
    predicted: str
    observed: str
    floor: str
    stance: str
    sign: str
    look: str


class CauseRow(NamedTuple):
    """A cause, as shown on the page; only the first ones have statements and evidence."""

    name: str
    title: str
    group: str
    percent: str
    bar_percent: float
    severity: str
    place: str
    statements: tuple[str, ...] = ()
    evidence: tuple[EvidenceRow, ...] = ()


def verdict_rows(report: GapReport) -> Rows:
    """Return the four lines of the verdict as (word before the colon, text)."""
    lines = [line.partition(": ") for line in report.verdict]
    return tuple((word, text[:1].upper() + text[1:]) for word, _, text in lines)


def size_text(report: GapReport) -> str:
    """Return the size of the whole gap in units of both floors; empty if nothing was simulated."""
    if not report.is_simulated:
        return ""
    return f"{interval_text(report.size)} structural floors, {readable(report.repeatability, 2)} repeatability floors"


def floors_text(report: GapReport, *, of_pictures: bool = True) -> str:
    """Say what the recordings are compared with, and what the two floors are; empty if nothing was simulated.

    With `of_pictures`, also say which pictures show the reference and which the simulation.
    """
    if not report.is_simulated:
        return ""
    structural, beside = "how much healthy machines differ from that", ""
    alone = [condition.name for condition in report.conditions if not condition.reference]
    if report.references:
        known = f"Compared with the same machine when it was healthy ({', '.join(report.references)}). "
        if 0 < len(alone) < len(report.conditions):
            known += f"Without a reference at its operating point, with the simulated prediction: {', '.join(alone)}. "
        structural = "how much healthy machines change from one recording to another"
        if of_pictures:
            beside = (
                " The first pictures show the recording beside the reference, the further ones beside the simulation."
            )
    else:
        known = "Compared with what the simulation of the healthy machine predicts, as far as it is credible. "
    return (
        f"{known}A structural floor is {structural}; one in twenty exceeds 1. A repeatability floor is how much this "
        f"machine differs from itself, from one segment to the next. A place is measured on its own features only, so "
        f"it may reach many floors although the gap over all features is only a few.{beside}"
    )


def place_rows(report: GapReport) -> tuple[PlaceRow, ...]:
    """Return the places in order."""
    return tuple(map(_place_row, report.places))


def _place_row(place: GapPlace) -> PlaceRow:
    change, structural, repeatability = (
        f"{signed(place.change_db)} dB",
        readable(place.structural, 2),
        readable(place.repeatability, 2),
    )
    sizes = f"{change} · {structural} × structural floor · {repeatability} × repeatability floor"
    if not isfinite(place.structural):  # it was found without floors
        over = f"{change} over what it is compared with"
        sizes = over if place.follows else "stands out by itself, over the noise beside it"
    orders = ", ".join(readable(order) for order in place.orders[:4]) + (" …" if len(place.orders) > 4 else "")
    where = (
        place.kind.value,
        named("shaft", place.shaft),
        f"tooth {place.tooth}" if place.tooth is not None else "",
        f"at {readable(place.angle_deg)}°" if place.angle_deg is not None else "",
        f"{'order' if len(place.orders) == 1 else 'orders'} {orders}" if place.orders else "",
        f"{readable(place.band_hz[0])} to {readable(place.band_hz[1])} Hz" if place.band_hz is not None else "",
        named("sensor", place.channel),
    )
    return PlaceRow(
        place.title[:1].upper() + place.title[1:],
        tuple(text for text in where if text),
        change,
        repeatability,
        structural,
        sizes,
        percent(place.share),
        _bar(place.share),
    )


def cause_rows(report: GapReport) -> tuple[CauseRow, ...]:
    """Return the causes above 1 %, likeliest first; the first effects with evidence for and against."""
    detailed = detailed_causes(report)
    shown = [cause for cause in report.causes if not cause.probability < MIN_SHOWN or cause in detailed]
    return tuple(_cause_row(cause, detailed=cause in detailed) for cause in shown)


def others_text(report: GapReport) -> str:
    """Name the causes that are not among `cause_rows`; empty if there are none."""
    shown = {row.name for row in cause_rows(report)}
    titles = [cause.title for cause in report.causes if cause.name not in shown]
    return f"Below 1 % each: {', '.join(titles)}." if titles else ""


def detailed_causes(report: GapReport) -> tuple[GapCause, ...]:
    """Return the effects whose evidence is shown: the likeliest three, if there is a gap.

    Without a simulation, all causes with statements or evidence, including the unknown.
    """
    if not report.is_simulated:
        return tuple(cause for cause in report.causes if cause.notes)
    if report.outcome is GapOutcome.NO_GAP:
        return ()
    return tuple(cause for cause in report.causes if cause.name not in (NONE, UNKNOWN))[:N_DETAILED]


def _cause_row(cause: GapCause, *, detailed: bool) -> CauseRow:
    return CauseRow(
        cause.name,
        cause.title,
        cause.group,
        odds_text(cause.probability),
        _bar(cause.probability),
        severity_text(cause),
        cause.place,
        (cause.notes or _statements(cause.shrinkage)) if detailed else (),
        tuple(_evidence_row(evidence) for evidence in cause.evidence) if detailed else (),
    )


def severity_text(cause: GapCause) -> str:
    """Return the fitted severity with its interval; empty if none was fitted."""
    return "" if cause.severity is None else interval_text(cause.severity, severity_unit(cause.unit))


def _statements(shrinkage: Shrinkage | None) -> tuple[str, ...]:
    if shrinkage is None:
        return ("It was not fitted: no held-out check.",)
    if not shrinkage.is_predicted:
        return (f"How far the gap shrinks is not known: it {too_small_to_judge_text(shrinkage)}.",)
    before, after = interval_text(shrinkage.before), interval_text(shrinkage.after)
    shrink, wrong = shrinkage.shrink, shrinkage.placebo
    taken, low, high = (percent(x) for x in (shrink.value, shrink.low, shrink.high))
    checked = f"checked on {shrinkage.held_out}"
    placebo = f"removes at most {percent(wrong)}" if wrong >= MIN_SHOWN else "removes nothing"
    if not shrinkage.n_placebos:
        placebo = "could not be tried, as the machine has no other place for it that would look different"
    elsewhere: tuple[str, ...] = ()
    if shrinkage.elsewhere is not None:
        part = _taken(shrinkage.elsewhere)
        elsewhere = (f"At an operating condition of which only its level was fitted it removes {part}.",)
    of_all: tuple[str, ...] = ()
    if shrinkage.of_all is not None:
        part = _taken(shrinkage.of_all)
        of_all = (f"Of what exceeds the floor on the features of all effects tried, it removes {part}.",)
    return (
        f"Gap on the features that it changes: {before} structural floors without it, {after} with it.",
        f"It removes nothing: with it the gap grows, {checked}."
        if shrink.value < 0.0
        else f"It removes {taken} ({low} to {high}) of what exceeds the floor, {checked}.",
        *elsewhere,
        *of_all,
        f"In a wrong place (placebo) it {placebo}.",
        f"The observed change is {readable(shrinkage.slope, 2)} times the predicted one; 1 would be exact.",
    )


def _taken(share: float) -> str:
    return percent(share) if share >= MIN_SHOWN else "nothing"


def _evidence_row(evidence: Evidence) -> EvidenceRow:
    look = ("✓", "for") if evidence.speaks_for else ("↗", "further") if evidence.is_further else ("✗", "against")
    predicted, observed = signed(evidence.predicted_db), signed(evidence.observed_db)
    floor = readable(evidence.floor_db, 2)
    return EvidenceRow(evidence.feature, predicted, observed, floor, evidence_direction_text(evidence), *look)


def group_texts(report: GapReport) -> tuple[str, ...]:
    """Return the groups above 1 %, likeliest first."""
    ranked = sorted(report.groups.items(), key=lambda item: -item[1] if isfinite(item[1]) else 0.0)
    return tuple(f"{group} {odds_text(p)}" for group, p in ranked if p >= MIN_SHOWN)


def inseparable_text(report: GapReport) -> str:
    """Say which causes cannot be distinguished; empty if there are none."""
    if report.inseparable is None:
        return ""
    titles = {cause.name: f"{cause.title} ({odds_text(cause.probability)})" for cause in report.causes}
    named = enumerated([titles.get(name, name) for name in report.inseparable])
    return f"These recordings cannot tell {named} apart."


def step_rows(report: GapReport) -> tuple[tuple[str, str, str, str], ...]:
    """Return the steps of the waterfall: residual gap, its interval, and the reduction by the step."""
    before = (None, *(step.remaining for step in report.steps))
    return tuple(
        (
            step.label,
            step.remaining.text,
            step.remaining.words(),
            "" if last is None else signed(step.remaining.value - last.value, n_decimals=2),
        )
        for step, last in zip(report.steps, before, strict=False)
    )


def next_rows(report: GapReport) -> tuple[tuple[str, str, str, str], ...]:
    """Return operating point and any further sensor, the pair of causes it separates, their distance then and now."""
    titles = {cause.name: cause.title for cause in report.causes}
    return tuple(
        (
            point_text(advice.point) + (f", with a further sensor at {advice.place}" if advice.place else ""),
            " / ".join(titles.get(name, name) for name in advice.separates),
            readable(advice.standard_deviations, 2),
            readable(advice.now, 2),
        )
        for advice in report.next_recordings
    )


def condition_rows(report: GapReport) -> tuple[tuple[str, ...], ...]:
    """Return name, speed, torque, revolutions, duration and sampling rate of each recording."""
    return tuple(
        (
            condition.name,
            readable(condition.point.speed_rpm, 5),
            readable(condition.point.torque_nm, 3),
            readable(condition.n_revolutions, 4),
            readable(condition.duration_s, 3),
            readable(condition.sampling_rate_hz, 6),
        )
        for condition in report.conditions
    )


def fact_rows(report: GapReport, command: str, date: datetime | None = None) -> Rows:
    """Return the basis of the diagnosis, and how to repeat it."""
    rows = (
        ("rig", report.rig),
        ("simulator", report.simulator or "none: nothing was simulated"),
        ("healthy references", references_text(report)),
        ("size of the gap", size_text(report)),
        *made_rows(command, date),
    )
    return tuple((name, text) for name, text in rows if text)


def references_text(report: GapReport) -> str:
    """Return the names of the references, or the baseline used instead."""
    instead = "none: compared with the simulation itself" if report.is_simulated else "none"
    return ", ".join(report.references) or instead


def interval_text(interval: Interval, unit: str = "") -> str:
    """Write a value with its 90 % interval."""
    return f"{interval.text}{' ' if unit else ''}{unit} ({interval.words()})"


def _bar(share: float) -> float:
    return round(100 * min(max(share, 0.0), 1.0), 3) if isfinite(share) else 0.0


Question = Literal["where", "which", "how far"]
QUESTIONS: tuple[Question, ...] = ("where", "which", "how far")


@dataclass(frozen=True)
class GapFigure:
    """A figure with its texts.

    Parameters
    ----------
    question : str
        "where", "which" or "how far": the section it belongs to.
    figure : Figure
        From `gearsig.plot`.
    look : str
        What to look for.
    shows : str
        Text alternative for readers who cannot see it.
    of : str
        Name of the cause that it belongs to; empty: none.
    is_small : bool
        Whether it is placed beside others.
    vector : bool
        Whether to draw it as vectors, as it has few lines.
    data : RowPanel or AngleCurves or None
        The numbers of bars and rings, for interactive drawing.
    """

    question: Question
    figure: Any  # the drawing library's type is known in gearsig.plot alone
    look: str
    shows: str
    of: str = ""
    is_small: bool = False
    vector: bool = False
    data: plot.RowPanel | AngleCurves | None = None


@dataclass(frozen=True)
class GapGallery:
    """The pictures of one question: full width, side by side, and by cause."""

    wide: tuple[plot.Picture, ...]
    small: tuple[plot.Picture, ...]
    of: Mapping[str, plot.Picture]


def gap_galleries(report: GapReport) -> dict[str, GapGallery]:
    """Return the pictures of a page by question; a process of `one_pool`, if there is one, draws half of them."""
    first_half = begin(_embedded, report, _against_reference)
    later = [pair for draw in (_spectra, *_FEW_LINES) for pair in _embedded(report, draw)]
    drawn = [*first_half(), *later]
    return {
        question: GapGallery(
            tuple(p for figure, p in drawn if figure.question == question and not figure.is_small and not figure.of),
            tuple(p for figure, p in drawn if figure.question == question and figure.is_small),
            {figure.of: p for figure, p in drawn if figure.question == question and figure.of},
        )
        for question in QUESTIONS
    }


def _embedded(
    report: GapReport, draw: Callable[[GapReport], Iterator[GapFigure]]
) -> list[tuple[GapFigure, plot.Picture]]:
    """Return some figures as pictures, without the figure objects, which cannot be sent."""
    return [
        (replace(figure, figure=None), plot.embed(figure.figure, figure.look, figure.shows, vector=figure.vector))
        for figure in draw(report)
    ]


def gap_figures(report: GapReport, *, curves: bool = True) -> Iterator[GapFigure]:
    """Draw each figure for which the report has finite numbers, in the order of the page.

    Shares of places and probabilities of causes are not figures: page and dashboard show them as lists with bars.

    Parameters
    ----------
    report : GapReport
    curves : bool
        Whether to include spectra and averages.
    """
    if curves:
        yield from _against_reference(report)
        yield from _spectra(report)
    for draw in _FEW_LINES:
        yield from draw(report)


def _against_reference(report: GapReport) -> Iterator[GapFigure]:
    """Draw what was scored if there is a reference: the changes since then."""
    for curves in report.spectra:
        if not len(curves.orders) or not len(curves.reference) or not is_finite(curves):
            continue
        view = against_reference(curves)
        yield GapFigure(
            "where",
            plot.gap_orders_figure(
                view,
                compared_with="reference",
                marked=report.is_beyond,
                title=f"{curves.label}: recording against reference",
            ),
            "Above, lines in the grey repeatability floor are not significant. Below, the change of each line since "
            f"the reference. {_beyond_text(report, view)}",
            f"Order spectrum, {curves.label}: recording, healthy reference, and their difference in dB.",
        )
    for average in report.averages:
        if len(average.angle_deg) and is_finite(average):
            yield GapFigure(
                "where",
                plot.gap_averages_figure(average, mark=_mark(report, average)),
                f"One mean revolution of shaft {average.shaft} without what all teeth have in common, on the sensor "
                "with the largest change. A tooth that differs shows at its angle; noise and other speeds leave a "
                "little everywhere.",
                f"Synchronous average of shaft {average.shaft} without mesh harmonics: recording, healthy reference, "
                "and their difference.",
            )


def _spectra(report: GapReport) -> Iterator[GapFigure]:
    for curves in report.spectra:
        if not len(curves.orders) or not is_finite(curves):
            continue
        if not len(curves.before):
            yield _lines(report, curves)
            continue
        scored = not len(curves.reference)
        title = curves.label if scored else f"{curves.label}: recording against simulation"
        beyond = _beyond_text(report, curves) if scored else NOT_SCORED
        dots = " Green dots: the residual gap with the likeliest effect." if len(curves.after) else ""
        yield GapFigure(
            "where",
            plot.gap_orders_figure(curves, marked=scored and report.is_beyond, title=title),
            f"Above, lines in the grey repeatability floor are not significant. Below, the gap of each line. {beyond}"
            f"{dots}",
            f"Order spectrum, {curves.label}: measured, simulated, and their difference in dB.",
        )


NOT_SCORED = "No line is marked: with a reference, only what has changed since it is scored."


def _beyond_text(report: GapReport, curves: SpectrumCurves) -> str:
    """Say what orange means and how many lines exceed their floors, or why none is marked."""
    n, n_all = lines_beyond(curves)
    known, many = len(curves.structural_db) > 0, f"{n} of {n_all} lines"
    if not report.is_beyond:
        alone = (
            f" {many} alone exceed it (grey band): it is the floor of the features that are scored, and single lines "
            "scatter more."
        )
        return f"The whole gap is within one structural floor, so that no line is marked.{alone if known else ''}"
    if not known:
        return "Orange: above the repeatability floor; how far healthy machines differ is not known for single lines."
    return (
        f"Orange: {many}, which exceed the structural floor (grey band). Single lines scatter more than the features "
        "that are scored: some exceed it on healthy machines, too."
    )


def _lines(report: GapReport, curves: SpectrumCurves) -> GapFigure:
    """Draw an envelope spectrum without a simulation."""
    families = [place.orders[0] for place in report.places if place.kind is PlaceKind.ENVELOPE and place.orders]
    marks = "Triangles: multiples of the order that was found. " if families else ""
    return GapFigure(
        "where",
        plot.gap_lines_figure(curves, families[0] if families else None),
        f"{marks}Lines in the grey noise floor are not significant; there is no simulation to compare with.",
        f"Spectrum, {curves.label}: measured, with the noise floor.",
    )


def _teeth(report: GapReport) -> Iterator[GapFigure]:
    """Draw the rings of the shafts that places name, or of all shafts if none is named."""
    named = {place.shaft for place in report.places if place.shaft}
    for curves in report.angles:
        if not len(curves.angle_deg) or not is_finite(curves) or (named and curves.shaft not in named):
            continue
        numbers = (
            "" if curves.has_mark else " The shaft has no mark: teeth have no numbers, and the start is arbitrary."
        )
        yield GapFigure(
            "where",
            plot.gap_teeth_figure(curves, mark=_mark(report, curves)),
            f"Shaft {curves.shaft}, tooth by tooth: healthy teeth form a ring, a damaged one stands out.{numbers}",
            f"Energy around one revolution of shaft {curves.shaft}, measured and simulated.",
            is_small=True,
            data=curves,
        )


def _mark(report: GapReport, curves: AngleCurves | AverageCurves) -> plot.AngleMark | None:
    """Return the tooth on this shaft to which the gap points."""
    for place in report.places:
        if place.kind is PlaceKind.TOOTH and place.shaft == curves.shaft and place.angle_deg is not None:
            label = (
                f"tooth {place.tooth}"
                if place.tooth is not None and curves.has_mark
                else f"{readable(place.angle_deg)}°"
            )
            return plot.AngleMark(place.angle_deg, label) if np.isfinite(place.angle_deg) else None
    return None


def _evidence(report: GapReport) -> Iterator[GapFigure]:
    for cause in detailed_causes(report):
        evidence = [item for item in cause.evidence if is_finite(item)]
        if evidence:
            panel = plot.gap_evidence_panel(evidence)
            yield GapFigure(
                "which",
                plot.rows_figure(panel),
                "Where a bar ends at its diamond, the effect explains sign and size; “further” marks one in the "
                "predicted direction, but larger. Grey: how much a healthy machine may change.",
                f"Predicted and observed changes of the features of {cause.title}.",
                of=cause.name,
                vector=True,
                data=panel,
            )


def _waterfall(report: GapReport) -> Iterator[GapFigure]:
    if len(report.steps) > 1 and all(is_finite(step) for step in report.steps):
        shrinkage = report.causes[0].shrinkage if report.causes else None
        held_out = shrinkage.held_out if shrinkage is not None else ""
        panel = plot.gap_waterfall_panel(report.steps, held_out=held_out)
        yield GapFigure(
            "how far",
            plot.rows_figure(panel),
            "The reduction by each effect. Within the shaded structural floor there is nothing left to explain.",
            "The gap before, its reduction by each added effect, and the residual.",
            vector=True,
            data=panel,
        )


_FEW_LINES = (_teeth, _evidence, _waterfall)
"""Functions that draw rings and bars, in the order of the page."""


def is_finite(value: Any) -> bool:
    """Whether all numbers in a dataclass, including nested ones, are finite."""
    if is_dataclass(value):
        return all(is_finite(getattr(value, field.name)) for field in fields(value))
    return not isinstance(value, (float, np.ndarray)) or bool(np.isfinite(value).all())


CHECK_FIRST = "Check first"
"""Heading of each warning."""


def gap_text(report: GapReport) -> str:
    """Return the four lines of the verdict, warnings to check first, and the use of a second operating condition."""
    advice = condition_advice(report)
    warnings = (f"{CHECK_FIRST}: {warning}" for warning in report.warnings)
    return "\n".join([*report.verdict, *warnings, *([advice] if advice else [])])


def condition_advice(report: GapReport) -> str:
    """Say what a second operating condition would give; empty if there are several, or none would help."""
    if not report.is_simulated or n_conditions(report) > 1:
        return ""
    start = "One operating condition: "
    if report.outcome is GapOutcome.NO_GAP:
        return start + "agreement at another speed or load was not checked."
    held_out = next((c.shrinkage.held_out for c in report.causes if c.shrinkage), "other revolutions")
    where = held_out if "starts" in held_out else "other revolutions of the same recordings"
    checked = f"the result could be checked on {where} only. "
    point = report.conditions[0].point
    best = next((advice for advice in report.next_recordings if not same_condition(advice.point, point)), None)
    if best is None:
        return f"{start}{checked}A second one would check it at another speed or load."
    apart = f"{best.standard_deviations:.2g} structural floors apart, against {best.now:.2g} now"
    return f"{start}{checked}A second one, at {point_text(best.point)}, would put the two likeliest causes {apart}."


def n_conditions(report: GapReport) -> int:
    """Count operating conditions; recordings at nearly the same speed and torque count as one."""
    distinct: list[OperatingCondition] = []
    for facts in report.conditions:
        if not any(same_condition(facts.point, point) for point in distinct):
            distinct.append(facts.point)
    return len(distinct)


def write_gap_page(report: GapReport, path: str | Path, *, command: str = "") -> Path:
    """Write the page of a gap diagnosis.

    The page is one file without scripts or external resources. It appears only when it is complete.

    Parameters
    ----------
    report : GapReport
    path : str or Path
        Missing folders are created.
    command : str
        The command that reproduces the page.

    Returns
    -------
    Path
        Of the page.
    """
    return write_text(Path(path), gap_page_html(report, command=command))


def gap_page_html(report: GapReport, *, command: str = "", date: datetime | None = None) -> str:
    """Return the HTML of the page that `write_gap_page` writes."""
    return render(
        "gap.html.j2",
        report=report,
        outcome=report.outcome.value,
        outcome_class=OUTCOME_CLASSES[report.outcome.value],
        verdict=verdict_rows(report),
        check_first=CHECK_FIRST,
        advice=condition_advice(report),
        size=size_text(report),
        floors=floors_text(report),
        has_after=any(len(curves.after) for curves in report.spectra),
        places=place_rows(report),
        causes=cause_rows(report),
        others=others_text(report),
        groups=group_texts(report),
        inseparable=inseparable_text(report),
        steps=step_rows(report),
        next_recordings=next_rows(report),
        conditions=condition_rows(report),
        facts_rows=fact_rows(report, command, date),
        galleries=gap_galleries(report),
    )
