"""The texts and tables of a gap page: places, causes with their evidence, steps, recordings to make, facts."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from math import isfinite

from gearsig import __version__
from gearsig.formatting import named, readable, signed
from gearsig.gap.types import (
    NONE,
    UNKNOWN,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    Interval,
    Shrinkage,
)
from gearsig.gap.words import hardly_foretold, point_text, severity_unit, stance_words
from gearsig.report.sections import Rows

N_DETAILED = 3
"""Causes whose evidence is shown."""
MOST_ORDERS = 4
LEAST_SHOWN = 0.01
"""Below this a group is left out, and a share is said to be below one percent."""
OUTCOME_CLASSES = {
    "no gap": "no-fault",
    "effect": "fault",
    "cannot separate": "suspicion",
    "unknown": "cannot-tell",
    "undecided": "cannot-tell",
}


@dataclass(frozen=True)
class PlaceRow:
    """A place of the gap as the page shows it."""

    title: str
    where: tuple[str, ...]
    change: str
    repeatability: str
    structural: str
    sizes: str
    share: str
    bar_percent: float


@dataclass(frozen=True)
class EvidenceRow:
    """A predicted change beside the observed one, in dB; the stance in words, its sign, and the class of its look."""

    feature: str
    predicted: str
    observed: str
    floor: str
    stance: str
    sign: str
    look: str


@dataclass(frozen=True)
class CauseRow:
    """A cause as the page shows it; statements and evidence of the first ones only."""

    name: str
    title: str
    group: str
    percent: str
    bar_percent: float
    severity: str
    place: str
    statements: tuple[str, ...] = ()
    evidence: tuple[EvidenceRow, ...] = ()


@dataclass(frozen=True)
class StepRow:
    """A step of the waterfall: what is left, and how much less than before the step."""

    label: str
    left: str
    interval: str
    taken: str


def verdict_rows(report: GapReport) -> Rows:
    """Return the four lines, the word before the colon apart."""
    lines = [line.partition(": ") for line in report.verdict]
    return tuple((word, text[:1].upper() + text[1:]) for word, _, text in lines)


def size_text(report: GapReport) -> str:
    """Return the size of the whole gap against both floors; empty where nothing was simulated."""
    if not report.is_simulated:
        return ""
    return f"{interval_text(report.size)} structural floors, {readable(report.repeatability, 2)} repeatability floors"


def floors_text(report: GapReport) -> str:
    """Say what the recordings are compared with, and what the two floors are; empty where nothing was simulated."""
    if not report.is_simulated:
        return ""
    structural, beside = "what healthy machines differ by from that", ""
    alone = [one.name for one in report.conditions if not one.reference]
    if report.references:
        known = f"Compared with the same machine when it was sound ({', '.join(report.references)}). "
        if 0 < len(alone) < len(report.conditions):
            known += f"Without a reference at its point, with what the simulation lets expect: {', '.join(alone)}. "
        structural = "what healthy machines change by from one recording to another"
        beside = " The first pictures show the recording beside the reference, the further ones beside the simulation."
    else:
        known = "Compared with what the simulation of the sound machine lets expect, as far as it is credible. "
    return (
        f"{known}A structural floor is {structural}; they exceed 1 once in twenty. A repeatability floor is what this "
        f"machine differs by from itself, from one stretch to the next. A place counts against its own features alone: "
        f"one may be many floors where the whole is few.{beside}"
    )


def place_rows(report: GapReport) -> tuple[PlaceRow, ...]:
    """Return the places in their order."""
    return tuple(
        PlaceRow(
            place.title[:1].upper() + place.title[1:],
            _where(place),
            f"{signed(place.change_db)} dB",
            readable(place.repeatability, 2),
            readable(place.structural, 2),
            _sizes(place),
            percent(place.share),
            _bar(place.share),
        )
        for place in report.places
    )


def _sizes(place: GapPlace) -> str:
    """Write the change against both floors, or that it was found without them."""
    if place.follows and not isfinite(place.structural):
        return f"{signed(place.change_db)} dB over what it is compared with"
    if not isfinite(place.structural):
        return "stands out by itself, over the noise beside it"
    floors = (
        f"{readable(place.structural, 2)} × structural floor · {readable(place.repeatability, 2)} × repeatability floor"
    )
    return f"{signed(place.change_db)} dB · {floors}"


def _where(place: GapPlace) -> tuple[str, ...]:
    orders = ", ".join(readable(order) for order in place.orders[:MOST_ORDERS])
    more = " …" if len(place.orders) > MOST_ORDERS else ""
    texts = (
        place.kind.value,
        named("shaft", place.shaft),
        f"tooth {place.tooth}" if place.tooth is not None else "",
        f"at {readable(place.angle_deg)}°" if place.angle_deg is not None else "",
        f"{'order' if len(place.orders) == 1 else 'orders'} {orders}{more}" if place.orders else "",
        f"{readable(place.band_hz[0])} to {readable(place.band_hz[1])} Hz" if place.band_hz is not None else "",
        named("sensor", place.channel),
    )
    return tuple(text for text in texts if text)


def cause_rows(report: GapReport) -> tuple[CauseRow, ...]:
    """Return the causes that have a chance, likeliest first; the first effects with what speaks for and against."""
    detailed = detailed_causes(report)
    shown = [cause for cause in report.causes if not cause.probability < LEAST_SHOWN or cause in detailed]
    return tuple(_cause_row(cause, detailed=cause in detailed) for cause in shown)


def others_text(report: GapReport) -> str:
    """Name the causes that are not among `cause_rows`; empty where there are none."""
    shown = {row.name for row in cause_rows(report)}
    titles = [cause.title for cause in report.causes if cause.name not in shown]
    return f"Below 1 % each: {', '.join(titles)}." if titles else ""


def detailed_causes(report: GapReport) -> tuple[GapCause, ...]:
    """Return the effects whose evidence is shown: the likeliest three, where there is a gap at all.

    Without a simulation, the causes of which there is something to say, unknown among them.
    """
    if not report.is_simulated:
        return tuple(cause for cause in report.causes if cause.remarks)
    if report.outcome is GapOutcome.NO_GAP:
        return ()
    return tuple(cause for cause in report.causes if cause.name not in (NONE, UNKNOWN))[:N_DETAILED]


def _cause_row(cause: GapCause, *, detailed: bool) -> CauseRow:
    return CauseRow(
        cause.name,
        cause.title,
        cause.group,
        percent(cause.probability),
        _bar(cause.probability),
        severity_text(cause),
        cause.place,
        (cause.remarks or _statements(cause.shrinkage)) if detailed else (),
        tuple(_evidence_row(one) for one in cause.evidence) if detailed else (),
    )


def severity_text(cause: GapCause) -> str:
    """Return the fitted severity with its interval; empty where nothing was fitted."""
    return "" if cause.severity is None else interval_text(cause.severity, severity_unit(cause.unit))


def _statements(shrinkage: Shrinkage | None) -> tuple[str, ...]:
    if shrinkage is None:
        return ("It was not fitted: no held-out check.",)
    if not shrinkage.is_foretold:
        return (f"How far the gap shrinks is not known: it {hardly_foretold(shrinkage)}.",)
    before, after = interval_text(shrinkage.before), interval_text(shrinkage.after)
    shrink, wrong = shrinkage.shrink, shrinkage.placebo
    taken, low, high = (percent(x) for x in (shrink.value, shrink.low, shrink.high))
    checked = f"checked on {shrinkage.held_out}"
    placebo = f"takes away at most {percent(wrong)}" if wrong >= LEAST_SHOWN else "takes away nothing"
    if not shrinkage.n_placebos:
        placebo = "could not be tried, as the machine has no other place for it that would look different"
    elsewhere = shrinkage.elsewhere
    return (
        f"Gap on its own features: {before} structural floors without it, {after} with it.",
        f"It takes away nothing: with it the gap grows, {checked}."
        if shrink.value < 0.0
        else f"It takes away {taken} ({low} to {high}) of what exceeds the floor, {checked}.",
        *(() if elsewhere is None else (_elsewhere_statement(elsewhere),)),
        f"In a wrong place (placebo) it {placebo}.",
        f"The observed change is {readable(shrinkage.slope, 2)} times the predicted one; 1 is right.",
    )


def _elsewhere_statement(shrink: float) -> str:
    taken = f"it takes away {percent(shrink)}" if shrink >= LEAST_SHOWN else "it takes away nothing"
    return f"At an operating condition of which only its level was fitted {taken}."


def _evidence_row(one: Evidence) -> EvidenceRow:
    sign, look = ("✓", "for") if one.speaks_for else ("↗", "further") if one.is_further else ("✗", "against")
    return EvidenceRow(
        one.feature,
        signed(one.predicted_db),
        signed(one.observed_db),
        readable(one.floor_db, 2),
        stance_words(one),
        sign,
        look,
    )


def group_texts(report: GapReport) -> tuple[str, ...]:
    """Return the groups that have a chance, likeliest first."""
    ranked = sorted(report.groups.items(), key=lambda item: -item[1] if isfinite(item[1]) else 0.0)
    return tuple(f"{group} {percent(p)}" for group, p in ranked if p >= LEAST_SHOWN)


def inseparable_text(report: GapReport) -> str:
    """Say which causes cannot be told apart; empty where there are none."""
    if report.inseparable is None:
        return ""
    titles = {cause.name: f"{cause.title} ({percent(cause.probability)})" for cause in report.causes}
    *others, last = (titles.get(name, name) for name in report.inseparable)
    return f"These recordings cannot tell {', '.join(others)} and {last} apart."


def step_rows(report: GapReport) -> tuple[StepRow, ...]:
    """Return the steps of the waterfall."""
    before = (None, *(step.left for step in report.steps))
    return tuple(
        StepRow(
            step.label,
            readable(step.left.value, 2),
            f"{readable(step.left.low, 2)} to {readable(step.left.high, 2)}",
            "" if last is None else signed(step.left.value - last.value, n_decimals=2),
        )
        for step, last in zip(report.steps, before, strict=False)
    )


def next_rows(report: GapReport) -> tuple[tuple[str, str, str, str], ...]:
    """Return operating point and further sensor, the pair that they separate, its distance there and now."""
    titles = {cause.name: cause.title for cause in report.causes}
    return tuple(
        (
            point_text(one.point) + (f", with a further sensor at {one.place}" if one.place else ""),
            " / ".join(titles.get(name, name) for name in one.separates),
            readable(one.standard_deviations, 2),
            readable(one.now, 2),
        )
        for one in report.next_recordings
    )


def condition_rows(report: GapReport) -> tuple[tuple[str, ...], ...]:
    """Return name, speed, torque, revolutions, length and sampling rate of each recording."""
    return tuple(
        (
            one.name,
            readable(one.point.speed_rpm, 5),
            readable(one.point.torque_nm, 3),
            readable(one.n_revolutions, 4),
            readable(one.duration_s, 3),
            readable(one.sampling_rate_hz, 6),
        )
        for one in report.conditions
    )


def fact_rows(report: GapReport, command: str, date: datetime) -> Rows:
    """Return what the diagnosis rests on, and how to repeat it."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    rows = (
        ("rig", report.rig),
        ("simulator", report.simulator or "none: nothing was simulated"),
        ("healthy references", references_text(report)),
        ("size of the gap", size_text(report)),
        ("versions", f"gearsig {__version__}, {versions}, Python {platform.python_version()}"),
        ("date", date.strftime("%Y-%m-%d %H:%M %Z").strip()),
        ("command", command),
    )
    return tuple((name, text) for name, text in rows if text)


def references_text(report: GapReport) -> str:
    """Return the names of the references, or what is compared with instead."""
    instead = "none: compared with the simulation itself" if report.is_simulated else "none"
    return ", ".join(report.references) or instead


def interval_text(interval: Interval, unit: str = "") -> str:
    """Write a value with its 90 % interval."""
    value, within = readable(interval.value, 2), interval.words(lambda end: readable(end, 2))
    return f"{value}{' ' if unit else ''}{unit} ({within})"


def percent(share: float) -> str:
    """Write a share in percent: nothing below one is told from another.

    Examples
    --------
    >>> percent(0.884), percent(0.003), percent(0.0), percent(float("nan")), percent(-0.1), percent(-0.001)
    ('88 %', '< 1 %', '0 %', '–', '−10 %', '0 %')
    """
    if not isfinite(share):
        return "–"
    return "< 1 %" if 0 < share < LEAST_SHOWN else f"{round(100 * share)} %".replace("-", "−")


def _bar(share: float) -> float:
    return round(100 * min(max(share, 0.0), 1.0), 3) if isfinite(share) else 0.0
