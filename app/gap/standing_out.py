"""What stands out of a recording without any simulation: damaged races, other impacts, lines of nothing known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.analyze import analyze
from gearsig.diagnosis.comparison import Earlier, in_reference
from gearsig.diagnosis.detectors import bearing_family
from gearsig.diagnosis.types import Analysis, CannotTell, Finding, Kind, Outcome
from gearsig.errors import RefusalError
from gearsig.formatting import named
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from gearsig.severity.reference import LARGEST_SPEED_DIFFERENCE

RACES = {"bearing-outer-race": "bearing_outer_race", "bearing-inner-race": "bearing_inner_race"}
"""Code of a finding → the effect of the catalogue that it means."""

IMPACTS = ("non-synchronous-impacts", "bearing-rolling-element", "bearing-cage")
"""Codes of families of impacts that no effect of the catalogue makes."""

LINE = "unexplained-line"

PARTS = {f"bearing-{part.replace(' ', '-')}": (part, name) for name, (part, _) in bearing_family.PARTS.items()}
"""Code of a finding → part of a bearing, and its order's name."""

SAME_EDGE = 0.1
"""Relative, of a band's edges."""
GREW = "Whether it has grown cannot be told."

LEAST_RISE_DB = 6.0
"""Twice the reference's level: less is between two recordings of the same machine."""


@dataclass(frozen=True)
class Standing:
    """A finding beyond what the machine is known to show.

    Parameters
    ----------
    finding : Finding
    recording : str
        Its name.
    rise_db : float or None
        Over the reference, which shows it as well in the same band; None: it does not, or there is none.
    """

    finding: Finding
    recording: str
    rise_db: float | None = None

    @property
    def over_floor_db(self) -> float:
        """Strongest line over the noise beside it."""
        strength = self.finding.strength
        return float("nan") if strength is None or strength.ratio_db is None else strength.ratio_db


@dataclass(frozen=True)
class Examined:
    """One recording with its analysis, the reference at its speed, and what stands out.

    Parameters
    ----------
    name : str
    analysis : Analysis
    angle : ShaftAngle
    reference : Analysis or None
        Of the sound machine at its speed.
    standing : tuple of Standing
        Most important first.
    notices : tuple of str
    """

    name: str
    analysis: Analysis
    angle: ShaftAngle
    reference: Analysis | None
    standing: tuple[Standing, ...]
    notices: tuple[str, ...]

    @property
    def is_sound(self) -> bool:
        """Whether the bearings were examined, and would have shown a damage."""
        codes = {f.code for f in self.analysis.findings}
        return "no-bearing-damage" in codes and self.analysis.outcome is Outcome.NO_FAULT


def carrying(recording: Recording, rig: Rig) -> Recording:
    """Return the recording with this rig; one that it carries already has applied its sensors, which are the same."""
    applied = recording.rig is not None and recording.rig.sensors
    return replace(recording, rig=rig) if applied else recording.with_rig(rig)


def analysed(recording: Recording, rig: Rig, name: str) -> tuple[Analysis, ShaftAngle]:
    """Analyse a recording whose speed must be known.

    Raises
    ------
    RefusalError
        If there is no speed, no live channel, or too few revolutions.
    """
    analysis = analyze(carrying(recording, rig))
    if isinstance(analysis.shaft_angle, CannotTell):
        raise RefusalError(f"{name}: {analysis.shaft_angle.reason}", remedy=analysis.shaft_angle.remedy)
    for finding in analysis.findings:
        if finding.code in ("all-channels-dead", "bearings-not-examined"):
            raise RefusalError(f"{name}: {finding.title}", remedy=finding.surer or "check the measurement chain")
    return analysis, analysis.shaft_angle


def examined(
    name: str, found: tuple[Analysis, ShaftAngle], references: Sequence[tuple[Analysis, ShaftAngle]]
) -> Examined:
    """Return what stands out of a recording, beyond the reference at its speed where there is one."""
    analysis, angle = found
    reference, notices = _reference(name, found, references)
    standing = []
    for finding in analysis.findings:
        if finding.code not in (*RACES, *IMPACTS, LINE):
            continue
        earlier = None if reference is None else in_reference(finding, reference)
        rise_db = None if earlier is None else _rise_db(finding, earlier)
        if earlier is None or finding.kind is Kind.FAULT or (rise_db is not None and rise_db >= LEAST_RISE_DB):
            standing.append(Standing(finding, name, rise_db))
        elif rise_db is None:
            notices.append(f"{name}: {finding.title.rstrip('.')}; the reference shows it too, in another band. {GREW}")
    doubts = tuple(f"{name}: {f.title}" for f in analysis.findings if f.kind in (Kind.DATA_PROBLEM, Kind.CANNOT_TELL))
    return Examined(name, analysis, angle, reference, tuple(standing), (*notices, *doubts))


def surest(every: Sequence[Examined]) -> list[Standing]:
    """Return what stands out, each part once, from the recording that shows it surest; single lines last."""
    found: dict[tuple[str, str], Standing] = {}
    for one in (standing for recording in every for standing in recording.standing):
        key = (one.finding.code, one.finding.where.bearing)
        if key not in found or _sureness(one) > _sureness(found[key]):
            found[key] = one
    kinds = list(Kind)
    return sorted(
        found.values(), key=lambda one: (one.finding.code == LINE, kinds.index(one.finding.kind), -_sureness(one)[0])
    )


def bearings_text(finding: Finding, rig: Rig) -> str:
    """Name the bearing of a finding, and those whose same part has the same order; empty where there is none."""
    name = PARTS.get(finding.code, ("", ""))[1]
    orders = {b.name: b.orders().get(name, 0.0) * (rig.ratio(b.shaft) or 0.0) for b in rig.bearings}
    own = orders.get(finding.where.bearing)
    if not own:
        return ""
    alike = [other for other, order in orders.items() if abs(order / own - 1.0) < bearing_family.SAME_ORDER]
    return named("bearing", " or ".join(alike))


def shafts_of_unknown_speed(rig: Rig) -> str:
    """Name the shafts whose speed the rig file does not tell, as those of a gear pair left out; empty: none."""
    return named("shaft", " and ".join(shaft.name for shaft in rig.shafts if rig.ratio(shaft.name) is None))


def _sureness(one: Standing) -> tuple[float, float]:
    return one.finding.confidence, one.over_floor_db


def _rise_db(finding: Finding, earlier: Earlier) -> float | None:
    """Return the rise since then; None where the bands differ, since the level in a band grows with its width."""
    bands = finding.where.band_hz or (), earlier.finding.where.band_hz or ()
    differ = any(abs(now - then) > SAME_EDGE * max(now, then) for now, then in zip(*bands, strict=False))
    return None if differ else earlier.change_db


def _reference(
    name: str, found: tuple[Analysis, ShaftAngle], references: Sequence[tuple[Analysis, ShaftAngle]]
) -> tuple[Analysis | None, list[str]]:
    """Return the healthy reference at the recording's speed, or none and why."""
    if not references:
        return None, []
    analysis, angle = found
    speed = angle.mean_speed_rpm
    nearest, its_angle = min(references, key=lambda one: abs(one[1].mean_speed_rpm - speed))
    why = ""
    if abs(its_angle.mean_speed_rpm / speed - 1.0) > LARGEST_SPEED_DIFFERENCE:
        why = f"no reference is within {100 * LARGEST_SPEED_DIFFERENCE:.0f} % of its speed"
    elif missing := set(_channels(analysis)) - set(_channels(nearest)):
        why = f"the reference has no channel {', '.join(sorted(missing))}"
    elif nearest.outcome is Outcome.FAULT:
        why = f"the reference at its speed is not healthy ({nearest.findings[0].title.rstrip('.')})"
    return (None, [f"{name} is not compared with a reference: {why}."]) if why else (nearest, [])


def _channels(analysis: Analysis) -> list[str]:
    return [channel.channel for channel in analysis.channels]
