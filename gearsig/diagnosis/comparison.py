"""A recording beside that of the sound machine: indicators and findings, then and now."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite, log10
from pathlib import Path

from gearsig.diagnosis.types import Analysis, Finding, Kind
from gearsig.errors import InputError
from gearsig.indicators.types import Indicator
from gearsig.rig.types import Rig

SAME_ORDER = 0.02
"""Relative: a bearing's slip differs from day to day."""

_CLAIMS = (Kind.FAULT, Kind.SUSPICION)


@dataclass(frozen=True)
class Change:
    """An indicator's value in the reference, and how far it has moved.

    Parameters
    ----------
    reference_value : float
    change_db : float or None
        20 lg(value/reference), or the difference of levels that are in dB already; None where a ratio has no meaning.
    """

    reference_value: float
    change_db: float | None


def rig_of_reference(path: str | Path, rig: Rig | None) -> Rig | None:
    """Return the recording's rig for its reference, with the torque that the rig file beside the reference states.

    Raises
    ------
    InputError
        If that rig file has gears with other teeth.
    """
    from gearsig.rig.toml import read_rig, rig_file_beside

    beside = rig_file_beside(path)
    own = read_rig(beside) if beside is not None else None
    if own is None or rig is None or not own.pairs:
        return rig
    teeth, others = (", ".join(f"{p.driver_teeth}/{p.driven_teeth}" for p in r.pairs) for r in (rig, own))
    if teeth != others:
        raise InputError(
            f"the reference is of another machine: its rig file says teeth {others}, the recording's {teeth}",
            where=Path(path).name,
            remedy="give a recording of the same machine when it was sound",
        )
    point, then = rig.operating_point, own.operating_point
    return replace(rig, operating_point=replace(point, torque_nm=then.torque_nm)) if then.shaft == point.shaft else rig


def changes(analysis: Analysis) -> tuple[Change | None, ...]:
    """Return for each indicator of an analysis what it was in the reference; None where it has none there.

    Indicators belong together that agree in name, channel, gear, shaft, bearing, band and the signal they rest on.
    """
    then = {_key(i): i for i in analysis.reference.indicators} if analysis.reference is not None else {}
    return tuple(_change(now, then.get(_key(now))) for now in analysis.indicators)


def beside_reference(findings: Iterable[Finding], reference: Analysis) -> list[Finding]:
    """Return the findings, each fault or suspicion with a sentence on what the reference shows of it."""
    return [replace(f, evidence=(*f.evidence, _then(f, reference))) if f.kind in _CLAIMS else f for f in findings]


def _then(finding: Finding, reference: Analysis) -> str:
    old = next((f for f in reference.findings if _is_same(f, finding)), None)
    if old is None:
        return "The reference does not show it."
    if old.strength is None or finding.strength is None or not 0 < old.strength.value < float("inf"):
        return "The reference shows it as well."
    change = 20 * log10(finding.strength.value / old.strength.value) if finding.strength.value > 0 else 0.0
    return f"The reference shows it as well; since then it has changed by {change:+.1f} dB."


def _is_same(old: Finding, new: Finding) -> bool:
    if (old.code, old.where.gear, old.where.bearing) != (new.code, new.where.gear, new.where.bearing):
        return False
    if old.where.order is None or new.where.order is None:
        return old.where.order is new.where.order
    return abs(old.where.order - new.where.order) <= SAME_ORDER * abs(new.where.order)


def _key(i: Indicator) -> tuple[str, ...]:
    return i.name, i.unit, i.channel, i.computed_on, i.shaft, i.gear, i.bearing, i.band


def _change(now: Indicator, then: Indicator | None) -> Change | None:
    if then is None or not (isfinite(now.value) and isfinite(then.value)):
        return None
    if now.unit == "dB":
        return Change(then.value, now.value - then.value)
    positive = now.value > 0 and then.value > 0
    return Change(then.value, 20 * log10(now.value / then.value) if positive else None)
