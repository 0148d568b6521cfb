"""Which figures show a gap, under which question, and what to look at in each: of the page and of the dashboard."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal

import numpy as np

from gearsig.formatting import readable
from gearsig.gap.curve_types import AngleCurves, AverageCurves, SpectrumCurves
from gearsig.gap.curves import against_reference, lines_beyond
from gearsig.gap.types import GapReport, PlaceKind
from gearsig.plot.embed import Picture, embed
from gearsig.plot.marks import AngleMark
from gearsig.report.gap_sections import detailed_causes

Question = Literal["where", "which", "how far"]
QUESTIONS: tuple[Question, ...] = ("where", "which", "how far")


@dataclass(frozen=True)
class GapFigure:
    """A figure and its words.

    Parameters
    ----------
    question : str
        "where", "which" or "how far": under which heading it stands.
    figure : Figure
        Of `gearsig.plot`.
    look : str
        What to look at.
    shows : str
        What it shows, for those who do not see it.
    of : str
        Name of the cause that it belongs to; empty: to none.
    is_small : bool
        Whether it stands beside others.
    vector : bool
        Whether it has few lines.
    """

    question: Question
    figure: Any  # the drawing library's type is known in gearsig.plot alone
    look: str
    shows: str
    of: str = ""
    is_small: bool = False
    vector: bool = False


@dataclass(frozen=True)
class GapGallery:
    """The pictures of one question: one per line, side by side, and by the cause that they belong to."""

    wide: tuple[Picture, ...]
    small: tuple[Picture, ...]
    of: Mapping[str, Picture]


def gap_galleries(report: GapReport) -> dict[str, GapGallery]:
    """Return the pictures of a page by question."""
    drawn = [(one, embed(one.figure, one.look, one.shows, vector=one.vector)) for one in gap_figures(report)]
    return {
        question: GapGallery(
            tuple(p for one, p in drawn if one.question == question and not one.is_small and not one.of),
            tuple(p for one, p in drawn if one.question == question and one.is_small),
            {one.of: p for one, p in drawn if one.question == question and one.of},
        )
        for question in QUESTIONS
    }


def gap_figures(report: GapReport) -> Iterator[GapFigure]:
    """Draw every figure that the report has finite numbers for, in the order of the page.

    Shares of places and probabilities of causes are no figures: page and dashboard write them as lists with bars.
    """
    yield from _against_reference(report)
    yield from _spectra(report)
    yield from _teeth(report)
    yield from _evidence(report)
    yield from _waterfall(report)


def _against_reference(report: GapReport) -> Iterator[GapFigure]:
    """Draw what was scored where there is a reference: what has changed since."""
    from gearsig.plot.gap_averages import gap_averages_figure
    from gearsig.plot.gap_orders import gap_orders_figure

    for curves in report.spectra:
        if not len(curves.orders) or not len(curves.reference) or not is_finite(curves):
            continue
        view = against_reference(curves)
        yield GapFigure(
            "where",
            gap_orders_figure(
                view, beside="reference", marked=report.is_beyond, title=f"{curves.label}: recording against reference"
            ),
            "Above, lines in the grey repeatability floor say nothing. Below, what has changed since the reference, "
            f"line by line. {_beyond_text(report, view)}",
            f"Order spectrum, {curves.label}: recording, healthy reference, and their difference in dB.",
        )
    for average in report.averages:
        if len(average.angle_deg) and is_finite(average):
            yield GapFigure(
                "where",
                gap_averages_figure(average, mark=_mark(report, average)),
                f"One mean revolution of shaft {average.shaft} without what all teeth have in common, on the sensor "
                "where most has changed. What one tooth does otherwise stands at its angle; noise and other speeds "
                "leave a little everywhere.",
                f"Synchronous average of shaft {average.shaft} without mesh harmonics: recording, healthy reference, "
                "and their difference.",
            )


def _spectra(report: GapReport) -> Iterator[GapFigure]:
    from gearsig.plot.gap_orders import gap_orders_figure

    for curves in report.spectra:
        if not len(curves.orders) or not is_finite(curves):
            continue
        if not len(curves.before):
            yield _lines(report, curves)
            continue
        scored = not len(curves.reference)
        title = curves.label if scored else f"{curves.label}: recording against simulation"
        beyond = _beyond_text(report, curves) if scored else NOT_SCORED
        left = " Green dots: what is left with the likeliest effect." if len(curves.after) else ""
        yield GapFigure(
            "where",
            gap_orders_figure(curves, marked=scored and report.is_beyond, title=title),
            f"Above, lines in the grey repeatability floor say nothing. Below, the gap line by line. {beyond}{left}",
            f"Order spectrum, {curves.label}: measured, simulated, and their difference in dB.",
        )


NOT_SCORED = "No line is marked: with a reference, only what has changed since it is scored."


def _beyond_text(report: GapReport, curves: SpectrumCurves) -> str:
    """Say what orange means, and how many lines exceed their floors; or why none is marked."""
    n, n_all = lines_beyond(curves)
    known, many = len(curves.structural_db) > 0, f"{n} of {n_all} lines"
    if not report.is_beyond:
        alone = (
            f" {many} alone exceed it (grey band): it is the floor of the features that are scored, and single lines "
            "scatter more."
        )
        return f"The whole gap is within one structural floor, so that no line is marked.{alone if known else ''}"
    if not known:
        return "Orange: above the repeatability floor; how far sound machines differ is not known line by line."
    return (
        f"Orange: {many}, which exceed the structural floor (grey band). Single lines scatter more than the features "
        "that are scored: some exceed it on sound machines, too."
    )


def _lines(report: GapReport, curves: SpectrumCurves) -> GapFigure:
    """Draw an envelope spectrum that there is no simulation beside."""
    from gearsig.plot.gap_lines import gap_lines_figure

    families = [place.orders[0] for place in report.places if place.kind is PlaceKind.ENVELOPE and place.orders]
    marks = "Triangles: multiples of the order that was found. " if families else ""
    return GapFigure(
        "where",
        gap_lines_figure(curves, families[0] if families else None),
        f"{marks}Lines in the grey noise floor say nothing; nothing was simulated beside it.",
        f"Spectrum, {curves.label}: measured, and the noise floor.",
    )


def _teeth(report: GapReport) -> Iterator[GapFigure]:
    from gearsig.plot.gap_teeth import gap_teeth_figure

    for curves in report.angles:
        if not len(curves.angle_deg) or not is_finite(curves):
            continue
        numbers = (
            "" if curves.has_mark else " The shaft has no mark: teeth have no numbers, and the start is arbitrary."
        )
        yield GapFigure(
            "where",
            gap_teeth_figure(curves, mark=_mark(report, curves)),
            f"Shaft {curves.shaft}, tooth by tooth: sound teeth draw an even ring, a damaged one swings out.{numbers}",
            f"Energy around one revolution of shaft {curves.shaft}, measured and simulated.",
            is_small=True,
        )


def _mark(report: GapReport, curves: AngleCurves | AverageCurves) -> AngleMark | None:
    """Return the tooth that the gap names on this shaft."""
    for place in report.places:
        if place.kind is PlaceKind.TOOTH and place.shaft == curves.shaft and place.angle_deg is not None:
            label = (
                f"tooth {place.tooth}"
                if place.tooth is not None and curves.has_mark
                else f"{readable(place.angle_deg)}°"
            )
            return AngleMark(place.angle_deg, label) if np.isfinite(place.angle_deg) else None
    return None


def _evidence(report: GapReport) -> Iterator[GapFigure]:
    from gearsig.plot.gap_evidence import gap_evidence_figure

    for cause in detailed_causes(report):
        evidence = [one for one in cause.evidence if is_finite(one)]
        if evidence:
            yield GapFigure(
                "which",
                gap_evidence_figure(evidence),
                "Where diamond and bar end together, sign and size are right; further: it moved the foretold way, and "
                "more. Grey: what a healthy machine may change.",
                f"Predicted and observed changes of the own features of {cause.title}.",
                of=cause.name,
                vector=True,
            )


def _waterfall(report: GapReport) -> Iterator[GapFigure]:
    from gearsig.plot.gap_waterfall import gap_waterfall_figure

    if len(report.steps) > 1 and all(is_finite(step) for step in report.steps):
        shrinkage = report.causes[0].shrinkage if report.causes else None
        yield GapFigure(
            "how far",
            gap_waterfall_figure(report.steps, held_out=shrinkage.held_out if shrinkage is not None else ""),
            "What each effect takes away. Within the shaded structural floor there is nothing left to explain.",
            "The gap before, what each added effect takes away, and what is left.",
            vector=True,
        )


def is_finite(value: Any) -> bool:
    """Whether all numbers in a dataclass, however deep, are finite."""
    if is_dataclass(value):
        return all(is_finite(getattr(value, field.name)) for field in fields(value))
    return not isinstance(value, (float, np.ndarray)) or bool(np.isfinite(value).all())
