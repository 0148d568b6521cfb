"""Marks at shaft angles and teeth, as findings name them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gearsig.diagnosis.types import Finding, Kind


@dataclass(frozen=True)
class AngleMark:
    """A place on a gear.

    Parameters
    ----------
    angle_deg : float
        Of the shaft, from the start of the average.
    label : str
        E.g. "tooth 17".
    """

    angle_deg: float
    label: str


def marks_of(findings: Iterable[Finding], shaft: str, n_teeth: int | None = None) -> tuple[AngleMark, ...]:
    """Return the places on one shaft that faults and suspicions name.

    A tooth without angle is marked at its middle: tooth k spans (k - 1)/n to k/n of a revolution.

    Parameters
    ----------
    findings : iterable of Finding
    shaft : str
    n_teeth : int or None
        Of the gear on that shaft, where known.

    Returns
    -------
    tuple of AngleMark
    """
    marks = []
    for finding in findings:
        where = finding.where
        here = where.shaft == shaft or where.gear.rpartition("/")[2] == shaft
        if finding.kind not in (Kind.FAULT, Kind.SUSPICION) or not here:
            continue
        angle = where.angle_deg
        if angle is None and where.tooth is not None and n_teeth:
            angle = (where.tooth - 0.5) * 360.0 / n_teeth
        if angle is not None:
            tooth = f"tooth {where.tooth}, " if where.tooth is not None else ""
            marks.append(AngleMark(angle % 360.0, f"{tooth}{angle % 360.0:.0f}°"))
    return tuple(dict.fromkeys(marks))
