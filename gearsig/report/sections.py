"""The texts and tables of a page: findings, machine and recording, indicators, provenance."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version

from gearsig import __version__
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis, CannotTell, Finding, Kind, Outcome, Strength, Where
from gearsig.formatting import named, readable
from gearsig.plot.display import unit_text
from gearsig.rig.types import Bearing, GearPair, Rig

Rows = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class FindingCard:
    """A finding as the page shows it."""

    kind: str
    css_class: str
    title: str
    where: tuple[str, ...]
    strength: str
    floor_percent: float | None
    confidence_percent: int | None
    confidence_basis: str
    evidence: tuple[str, ...]
    surer: str
    code: str


def finding_card(finding: Finding) -> FindingCard:
    """Put a finding into words."""
    stated = finding.kind in (Kind.FAULT, Kind.SUSPICION) or finding.confidence < 1.0
    return FindingCard(
        finding.kind.value,
        css_class(finding.kind),
        finding.title,
        where_texts(finding.where),
        strength_text(finding.strength),
        _floor_percent(finding.strength),
        round(100 * finding.confidence) if stated else None,
        finding.confidence_basis,
        finding.evidence,
        finding.surer,
        finding.code,
    )


def css_class(kind: Kind | Outcome) -> str:
    """Return the style class of a kind or an outcome: its value without spaces."""
    return str(kind.value).replace(" ", "-")


def where_texts(where: Where) -> tuple[str, ...]:
    """Return the place of a finding, one text per part of it."""
    texts = [
        ("channel " if len(where.channels) == 1 else "channels ") + ", ".join(where.channels) if where.channels else "",
        named("gear", where.gear) if where.gear else named("shaft", where.shaft),
        named("bearing", where.bearing),
        _tooth_text(where),
        _order_text(where),
        f"{readable(where.frequency_hz, 6)} Hz" if where.frequency_hz is not None else "",
        f"{readable(where.time_s[0])} to {readable(where.time_s[1])} s" if where.time_s is not None else "",
    ]
    return tuple(text for text in texts if text)


def _tooth_text(where: Where) -> str:
    angle = f"{readable(where.angle_deg)}°" if where.angle_deg is not None else ""
    if where.tooth is None:
        return f"at {angle}" if angle else ""
    return f"tooth {where.tooth}" + (f" at {angle}" if angle else "")


def _order_text(where: Where) -> str:
    if where.order is None:
        return ""
    return f"order {readable(where.order, 5)}" + (f" of {where.order_shaft}" if where.order_shaft else "")


def strength_text(strength: Strength | None) -> str:
    """Return the size of a finding against its floor, in words."""
    if strength is None:
        return ""
    unit = f" {unit_text(strength.unit)}" if strength.unit else ""
    floor = f"{strength.against} {readable(strength.floor)}{unit}".strip()
    text = f"{readable(strength.value)}{unit} against {floor} ({strength.floor_is})"
    return text if strength.ratio_db is None else f"{text}: {readable(strength.ratio_db, 3)}\u00a0dB"


def _floor_percent(strength: Strength | None) -> float | None:
    """Return where the floor lies on a bar whose full length is the larger of value and floor; None without a bar."""
    if strength is None or strength.ratio_db is None or not 0 < strength.floor < strength.value < float("inf"):
        return None
    return round(100 * strength.floor / strength.value, 1)


def machine_rows(rig: Rig | None) -> Rows:
    """Return what is known of the machine."""
    if rig is None:
        return ()
    rows = [("machine", rig.name), ("shafts", ", ".join(rig.shaft_names))]
    rows += [(named("gear pair", pair.name), _pair_text(pair)) for pair in rig.pairs]
    rows += [(named("bearing", bearing.name), _bearing_text(bearing)) for bearing in rig.bearings]
    nominal = rig.nominal_speed_rpm()
    rows += [
        ("nominal speed", f"{readable(nominal, 6)} rpm of {rig.reference_shaft}" if nominal is not None else ""),
        ("sources", "; ".join(rig.sources)),
        ("assumed, not known", ", ".join(rig.assumed)),
    ]
    return tuple((name, text) for name, text in rows if text)


def _pair_text(pair: GearPair) -> str:
    driver, driven = (str(teeth) if teeth is not None else "?" for teeth in (pair.driver_teeth, pair.driven_teeth))
    text = f"{driver} teeth on {pair.driver} drive {driven} on {pair.driven}"
    extra = [
        f"module {readable(pair.module_mm)} mm" if pair.module_mm is not None else "",
        f"pressure angle {readable(pair.pressure_angle_deg)}°" if pair.pressure_angle_deg is not None else "",
        f"face width {readable(pair.face_width_mm)} mm" if pair.face_width_mm is not None else "",
    ]
    return ", ".join([text, *(item for item in extra if item)])


def _bearing_text(bearing: Bearing) -> str:
    orders = ", ".join(f"{name} {readable(order)}" for name, order in bearing.orders().items())
    return f"on {bearing.shaft}" + (f"; orders {orders}" if orders else "")


def speed_rows(angle: ShaftAngle | CannotTell) -> Rows:
    """Return what is known of the speed, or why it is not."""
    if isinstance(angle, CannotTell):
        rows = [("speed", f"not known: {angle.reason}"), ("what would give it", angle.remedy)]
        return tuple((name, text) for name, text in rows if text)
    low, high = angle.speed_range_rpm
    uncertainty = angle.relative_speed_uncertainty
    known = f" ± {readable(100 * uncertainty, 2)} %" if uncertainty < float("inf") else ""
    span = f", {readable(low, 6)} to {readable(high, 6)} rpm" if high > low else ""
    from gearsig.plot.speed import METHODS

    return (
        (
            "speed" + (f" of {angle.shaft}" if angle.shaft else ""),
            f"mean {readable(angle.mean_speed_rpm, 6)} rpm{known}{span}",
        ),
        ("how it was found", METHODS[angle.method] + f"; quality {readable(angle.quality, 2)} of 1"),
        ("revolutions", readable(angle.n_revolutions, 5)),
        *(("remark on the speed", note) for note in angle.notes),
    )


def provenance_rows(analysis: Analysis, command: str, date: datetime) -> Rows:
    """Return everything needed to make the page again."""
    recording = analysis.recording
    origin = recording.provenance
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    rows = [
        ("file", origin.source),
        ("SHA-256", origin.sha256),
        ("reader", origin.reader),
        ("history", "; ".join(origin.history)),
        ("sampling rate", f"{recording.sampling_rate_hz:.10g} Hz"),
        ("parameters", ", ".join(f"{name} = {_setting(value)}" for name, value in analysis.settings.items())),
        ("versions", f"gearsig {__version__}, {versions}, Python {platform.python_version()}"),
        ("date", date.strftime("%Y-%m-%d %H:%M %Z").strip()),
        ("command", command),
    ]
    return tuple((name, text) for name, text in rows if text)


def _setting(value: str | float | int | None) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    return "none" if value is None else str(value)


def reference_text(reference: Analysis | None) -> str:
    """Return which recording was compared with; empty without one. A reference that is not sound itself is told."""
    if reference is None:
        return ""
    text = f"Compared with {reference.recording.provenance.source or 'a reference'}"
    if reference.outcome in (Outcome.FAULT, Outcome.SUSPICION):
        return f"{text}, which is not sound itself: {reference.verdict}"
    return f"{text}."


def truth_rows(truth: Mapping[str, object] | None) -> Rows:
    """Return what a simulator put in, for simulated recordings."""
    return tuple((name, str(value)[:200]) for name, value in (truth or {}).items())
