"""What the index page needs to know of each recording; small, so that it travels between processes."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.diagnosis.types import Analysis, Finding, Kind, Outcome
from gearsig.indicators.types import Indicator
from gearsig.severity.types import CrackEstimate


@dataclass(frozen=True)
class Entry:
    """A recording that was analysed.

    Parameters
    ----------
    name : str
        As given by the user, e.g. the file's name.
    page : str
        Address of its page, relative to the index; empty: no page.
    outcome : Outcome
    verdict : str
    confidence : float or None
        Of the fault or suspicion in the verdict; None without one.
    ratio_db : float or None
        Of that finding over its floor.
    indicators : tuple of Indicator
    crack_mm : float or None
        Depth of the crack, where the verdict is about one.
    is_reference : bool
        Whether the other recordings were compared with this one.
    """

    name: str
    page: str
    outcome: Outcome
    verdict: str
    confidence: float | None = None
    ratio_db: float | None = None
    indicators: tuple[Indicator, ...] = ()
    crack_mm: float | None = None
    is_reference: bool = False


@dataclass(frozen=True)
class Failure:
    """A recording that could not be analysed, and why."""

    name: str
    reason: str


def entry_of(analysis: Analysis, name: str, page: str) -> Entry:
    """Sum up an analysis for the index page."""
    claims = (f for f in analysis.findings if f.kind in (Kind.FAULT, Kind.SUSPICION))
    top = min(claims, key=lambda finding: finding.kind is not Kind.FAULT, default=None)
    return Entry(
        name,
        page,
        analysis.outcome,
        analysis.verdict,
        top.confidence if top is not None else None,
        top.strength.ratio_db if top is not None and top.strength is not None else None,
        analysis.indicators,
        _crack_mm(analysis, top),
    )


def _crack_mm(analysis: Analysis, top: Finding | None) -> float | None:
    """Return the depth of a crack, where it is what the verdict is about."""
    crack = analysis.crack
    if not isinstance(crack, CrackEstimate) or crack.likelier_other or top is None:
        return None
    return crack.depth_mm if top.where.gear == crack.gear and top.where.angle_deg == crack.angle_deg else None


def by_severity(entry: Entry) -> tuple[int, float, float, float, str]:
    """Key that sorts the most important first: outcome, then depth of a crack, then confidence, then strength."""
    place = list(Outcome).index(entry.outcome)
    return place, -(entry.crack_mm or 0.0), -(entry.confidence or 0.0), -(entry.ratio_db or 0.0), entry.name
