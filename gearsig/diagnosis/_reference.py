"""A recording compared with that of the healthy machine: indicators and findings, then and now."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, log10
from pathlib import Path

import numpy as np

from gearsig.diagnosis._types import (
    MIN_CHANGE_DB,
    REFERENCE_NOT_HEALTHY,
    REFERENCE_UNFIT,
    Analysis,
    Finding,
    Kind,
    LevelChange,
    Outcome,
    Where,
)
from gearsig.errors import InputError
from gearsig.formatting import percent, signed
from gearsig.indicators import Indicator
from gearsig.rig import Rig, SpeedSource


@dataclass(frozen=True)
class IndicatorChange:
    """An indicator's value in the reference, and its change since.

    Parameters
    ----------
    reference_value : float
    change_db : float or None
        20 lg(value/reference), or the difference of levels already in dB; None where a ratio has no meaning.
    """

    reference_value: float
    change_db: float | None


@dataclass(frozen=True)
class ReferenceFinding:
    """A finding's counterpart in the reference.

    Parameters
    ----------
    finding : Finding
    is_comparable : bool
        Whether both come from the same channel and band.
    change_db : float or None
        Change since the reference; None where levels do not compare.
    """

    finding: Finding
    is_comparable: bool
    change_db: float | None


REFERENCE_OPTIONS = {"--fs": "--reference-fs"}
"""Options of the command line → the corresponding options of the reference."""


def rig_and_rate_of_reference(
    path: str | Path,
    rig: Rig | None,
    stated_hz: float | None,
    reference_rate_hz: float | None = None,
    *,
    is_same_machine: bool = False,
) -> tuple[Rig | None, float | None]:
    """Return (rig, sampling rate) for the healthy reference of a recording, using the rig file beside the reference.

    Parameters
    ----------
    path : str or Path
        Of the reference.
    rig : Rig or None
        Of the recording. It applies to the reference, except for what the file beside it states of the measurement:
        sensors, speed source, sampling rate, torque.
    stated_hz : float or None
        Sampling rate stated for the recording; it applies to the reference, unless that file states one.
    reference_rate_hz : float or None
        Sampling rate stated for the reference.
    is_same_machine : bool
        Whether the user said so: then other teeth in the file beside the reference are a mistake.

    Raises
    ------
    InputError
        If that rig file has gears with other teeth, unless `is_same_machine`, or gives the speed of another shaft.
    """
    from gearsig.rig import read_rig, rig_file_beside

    beside = rig_file_beside(path)
    rig_beside = read_rig(beside) if beside is not None else None
    its_rig = (
        rig
        if rig_beside is None
        else _rig_at_reference(path, rig or Rig(), rig_beside, is_same_machine=is_same_machine)
    )
    if reference_rate_hz is not None:
        return its_rig, reference_rate_hz
    return its_rig, stated_hz if rig_beside is None or rig_beside.sampling_rate_hz is None else None


def _rig_at_reference(path: str | Path, rig: Rig, rig_beside: Rig, *, is_same_machine: bool) -> Rig:
    """Return the recording's machine with the measurement data of the file beside the reference."""
    teeth, others = (", ".join(f"{p.driver_teeth}/{p.driven_teeth}" for p in r.pairs) for r in (rig, rig_beside))
    if not is_same_machine and rig.pairs and rig_beside.pairs and teeth != others:
        raise InputError(
            f"the reference is of another machine: its rig file says teeth {others}, the recording's {teeth}",
            where=Path(path).name,
            remedy="give a recording of the same machine when it was healthy",
        )
    its_rig = rig.with_measurement_of(replace(rig_beside, speed=_speed_at_reference(path, rig, rig_beside.speed)))
    point, then = rig.operating_point, rig_beside.operating_point
    if not rig_beside.pairs or then.shaft != point.shaft:
        return its_rig
    torque_nm = point.torque_nm if then.torque_nm is None else then.torque_nm
    return replace(its_rig, operating_point=replace(point, torque_nm=torque_nm))


def _speed_at_reference(path: str | Path, rig: Rig, speed: SpeedSource | None) -> SpeedSource | None:
    """Return the speed source of the file beside the reference, on the shaft whose orders are compared."""
    if speed is None or speed.shaft in ("", rig.reference_shaft):
        return speed
    if not rig.shafts:
        return replace(speed, shaft="")
    if rig.speed is None:  # the recording itself gives its speed, and so may the reference
        return None
    raise InputError(
        f"its rig file tells the speed of shaft {speed.shaft!r}, the recording's that of {rig.reference_shaft!r}",
        where=Path(path).name,
        allowed="the same shaft, as orders are compared",
        remedy="let [speed] name the same shaft in both rig files",
    )


def changes(analysis: Analysis) -> tuple[IndicatorChange | None, ...]:
    """Return for each indicator of an analysis its value in the reference; None where it has none there.

    Indicators correspond if they agree in name, channel, gear, shaft, bearing, band and underlying signal.
    """
    then = {_key(i): i for i in analysis.reference.indicators} if analysis.reference is not None else {}
    return tuple(_change(now, then.get(_key(now))) for now in analysis.indicators)


def reference_unfit(reference: Analysis) -> Finding:
    """Return the finding that a reference is not used because nothing in it could be analysed, with the reason."""
    name = reference.recording.provenance.source or "the reference"
    reason = next((f for f in reference.findings if f.kind is Kind.DATA_PROBLEM), None)
    return Finding(
        REFERENCE_UNFIT,
        Kind.DATA_PROBLEM,
        f"Not compared with {name}: {reason.title if reason is not None else reference.verdict}",
        confidence_basis="what the reference's own analysis says",
        evidence=reason.evidence if reason is not None else (),
        surer="State the reference's sampling rate with --reference-fs, or rate and speed in a rig file beside it "
        "(NAME.toml), or take another one.",
    )


def reference_not_healthy(
    reference: Analysis, measured: Callable[[Finding], LevelChange | None], *, shows_fault: bool
) -> list[Finding]:
    """Report a fault that the reference itself shows: it is not new, and a decrease is no improvement.

    Parameters
    ----------
    reference : Analysis
        Of the reference alone.
    measured : callable
        See `beside_reference`.
    shows_fault : bool
        Whether the recording shows a fault; if not, and if it shows less of the reference's fault, the two may have
        been exchanged.
    """
    if reference.outcome is not Outcome.FAULT:
        return []
    fault = next(f for f in reference.findings if f.kind is Kind.FAULT)
    change = measured(fault)
    is_there = shows_fault or (change is not None and change.change_db > -MIN_CHANGE_DB)
    exchanged = "" if is_there else " This recording shows none: the two may have been exchanged."
    return [
        Finding(
            REFERENCE_NOT_HEALTHY,
            Kind.DATA_PROBLEM,
            f"The reference may not be healthy itself: {fault.title.removesuffix('.')} (at most "
            f"{percent(fault.confidence)} sure).{exchanged}",
            fault.where,
            fault.strength,
            fault.confidence,
            fault.confidence_basis,
            fault.evidence,
            "A recording of the machine when it was healthy.",
        )
    ]


def beside_reference(
    findings: Iterable[Finding], reference: Analysis, measured: Callable[[Finding], LevelChange | None] = lambda _: None
) -> list[Finding]:
    """Return the findings, with a sentence in each fault or suspicion on what the reference shows of it.

    A suspicion for which the healthy machine gives as much reason becomes a notice. Damage that is as strong there is
    at most a suspicion: it is not new, or the reference is not of a healthy machine.

    Parameters
    ----------
    findings : iterable of Finding
    reference : Analysis
    measured : callable
        Finding → the level of its family of lines here and in the reference, in the same band; None: not measured.
    """
    return [_beside(f, reference, measured(f)) if f.is_claim else f for f in findings]


def _beside(finding: Finding, reference: Analysis, measured: LevelChange | None) -> Finding:
    earlier = in_reference(finding, reference)
    text = _then(finding, earlier)
    if measured is not None:
        is_new = measured.is_change and measured.change_db > 0
        if earlier is None and not is_new:
            text = (
                f"The reference has as much there, within its own scatter ({signed(measured.change_db)} dB since then)."
            )
        elif earlier is not None and not earlier.is_comparable:
            text = f"The reference shows it as well; since then it has changed by {signed(measured.change_db)} dB."
        change_db: float | None = measured.change_db
    else:
        change_db = earlier.change_db if earlier is not None and earlier.is_comparable else None
        is_new = earlier is None or change_db is None or change_db >= MIN_CHANGE_DB
    kind, title = finding.kind, finding.title
    if kind is Kind.SUSPICION and not is_new:
        kind = Kind.NOTICE
    elif kind is Kind.FAULT and earlier is not None and change_db is not None and change_db < MIN_CHANGE_DB / 2:
        # A reference with a fault is not healthy, and a finding says so; healthy machines may have anything less.
        kind = Kind.SUSPICION if earlier.finding.kind is Kind.FAULT else Kind.NOTICE
        title = f"{title.removesuffix('.')}, as strong in the reference: it is not new."
        title = f"Perhaps {title[:1].lower()}{title[1:]}" if kind is Kind.NOTICE else title
    return replace(finding, kind=kind, title=title, evidence=(*finding.evidence, text))


SAME_GAIN_DB = 2.0
"""If all levels of a channel, noise included, change alike to within this, the gain has changed."""


def changed_sensors(changes: Sequence[LevelChange]) -> tuple[list[Finding], list[LevelChange]]:
    """Report channels that changed rather than the machine, and return the changes of the others.

    Either all its levels have changed alike, noise included, or most of what changed is in it, see `_faded_alone`.
    """
    findings, rest = [], []
    for channel in dict.fromkeys(c.where.channels[0] for c in changes):
        of_channel = [c for c in changes if c.where.channels[0] == channel]
        lines = [c for c in of_channel if c.stands_out and c.kind != "bearing"]
        shifts = np.array([c.change_db for c in lines])
        gain = float(np.median(shifts))
        spread = float(np.percentile(np.abs(shifts - gain), 90))
        if len(lines) < 4 or abs(gain) < MIN_CHANGE_DB / 2 or spread > SAME_GAIN_DB:
            if _faded_alone(channel, changes):
                findings.append(_faded(channel, [c for c in of_channel if c.is_change]))
            else:
                rest += of_channel
            continue
        findings.append(
            Finding(
                "levels-scaled",
                Kind.DATA_PROBLEM,
                f"Every level of channel {channel} has changed alike by {signed(gain)} dB since the reference, "
                "noise included: the gain, unit or sensor differs rather than the machine.",
                Where((channel,)),
                confidence=0.9,
                confidence_basis=f"{len(lines)} levels within {spread:.2g} dB of each other",
                surer="Check sensor, range and unit of both recordings.",
            )
        )
    return findings, rest


def _faded_alone(channel: str, changes: Sequence[LevelChange]) -> bool:
    """Whether two thirds of what changed are in one channel, where most noise fell and no other channel's changed.

    A loose sensor loses the high frequencies. Where noise rises in one channel alone, a machine is damaged beside it.
    """
    own, others = ([c for c in changes if (c.where.channels[0] == channel) is is_own] for is_own in (True, False))
    noise, noise_beside = ([c for c in some if c.kind == "noise"] for some in (own, others))
    n_own, n_others = (sum(c.is_change and c.kind != "bearing" for c in some) for some in (own, others))
    n_fallen = sum(c.is_change and c.change_db < 0 for c in noise)
    stays = bool(noise_beside) and not any(c.is_change for c in noise_beside)
    return 2 * n_fallen > len(noise) and stays and n_own > 2 * n_others


def _faded(channel: str, changed: Sequence[LevelChange]) -> Finding:
    return Finding(
        "channel-faded",
        Kind.DATA_PROBLEM,
        f"Most of what changed since the reference is in channel {channel} alone, noise included: check its mounting, "
        "cable and range.",
        Where((channel,)),
        confidence=0.8,
        confidence_basis="most of its noise has fallen, and no other channel's has changed",
        evidence=(
            *(c.text for c in changed),
            "Its changes are left out; a repair beside this sensor would make it quieter, too.",
        ),
        surer="Both recordings again with the sensor mounted alike.",
    )


def in_reference(finding: Finding, reference: Analysis) -> ReferenceFinding | None:
    """Return what the reference shows of the same part, order or frequency; None where it shows nothing."""
    alike = [f for f in reference.findings if _is_alike(f, finding, reference.rig)]
    same = [f for f in alike if _has_same_witness(f, finding)]
    if same:
        return ReferenceFinding(same[0], True, _change_db(same[0], finding))
    return ReferenceFinding(alike[0], False, None) if alike else None  # levels elsewhere do not compare


def _then(finding: Finding, earlier: ReferenceFinding | None) -> str:
    if earlier is None or not (earlier.is_comparable or _is_placed(finding)):
        return "The reference does not show it."
    if not earlier.is_comparable:
        where = earlier.finding.where
        seen_in = ", ".join(where.channels) or "another channel"
        seen_in += f", {where.band_hz[0]:.0f} to {where.band_hz[1]:.0f} Hz" if where.band_hz else ""
        return f"The reference shows it as well, but in {seen_in}: the levels do not compare."
    change = earlier.change_db
    if finding.where.angle_deg is not None and not _names_tooth(earlier.finding, finding):
        since = "" if change is None else f", {signed(change)} dB since then"
        return f"The reference shows such an event on that shaft{since}; no mark shows whether at the same tooth."
    since = "." if change is None else f"; since then it has changed by {signed(change)} dB."
    return f"The reference shows it as well{since}"


def _change_db(old: Finding, new: Finding) -> float | None:
    if old.strength is None or new.strength is None or old.strength.unit != new.strength.unit:
        return None
    then, now = old.strength.value, new.strength.value
    return 20 * log10(now / then) if 0 < then < float("inf") and 0 < now < float("inf") else None


def _is_alike(old: Finding, new: Finding, rig: Rig | None) -> bool:
    """Whether two findings say the same of the same part: shaft, gear, tooth, bearing, order or frequency."""
    then, now = old.where, new.where
    if (old.code, then.shaft, then.gear) != (new.code, now.shaft, now.gear):
        return False
    # Of bearings that cannot be distinguished, any may be the first that a finding names.
    if then.bearing != now.bearing and not (then.bearing and now.bearing and then.bearing in new.title):
        return False
    if not _is_near(then.order, now.order):
        return False
    if now.order is None and not _is_near(then.frequency_hz, now.frequency_hz):
        return False
    return not _names_tooth(old, new) or _is_same_tooth(then, now, rig)


def _has_same_witness(old: Finding, new: Finding) -> bool:
    """Whether two findings come from the same channel and band, so that their levels compare.

    A mesh's sideband ratio is the median of all channels, so the channel does not matter for it.
    """
    then, now = old.where, new.where
    if then.band_hz is not None and now.band_hz is not None:
        if max(then.band_hz[0], now.band_hz[0]) >= min(then.band_hz[1], now.band_hz[1]):
            return False
    elif then.band_hz is not now.band_hz:  # one of them has none
        return False
    rests_on_channel = now.band_hz is not None or now.angle_deg is not None or not _is_placed(new)
    return not rests_on_channel or then.channels == now.channels or bool(set(then.channels) & set(now.channels))


def _is_placed(finding: Finding) -> bool:
    return bool(finding.where.gear or finding.where.bearing or finding.where.shaft)


def _is_near(then: float | None, now: float | None) -> bool:
    if then is None or now is None:
        return then is now
    return abs(then - now) <= 0.02 * abs(now)  # a bearing's slip differs from day to day


def _names_tooth(old: Finding, new: Finding) -> bool:
    """Whether both count teeth from a mark; without one, an angle is valid only for its own record."""
    return old.where.tooth is not None and new.where.tooth is not None


def _is_same_tooth(then: Where, now: Where, rig: Rig | None) -> bool:
    """Whether two teeth are the same or neighbours, as each is located to about one tooth."""
    off = abs((then.tooth or 0) - (now.tooth or 0))
    teeth = rig.teeth_of(now.gear) if rig is not None else None
    return min(off, teeth - off if teeth is not None else off) <= 1


def _key(i: Indicator) -> tuple[str, ...]:
    return i.name, i.unit, i.channel, i.computed_on, i.shaft, i.gear, i.bearing, i.band


def _change(now: Indicator, then: Indicator | None) -> IndicatorChange | None:
    if then is None or not (isfinite(now.value) and isfinite(then.value)):
        return None
    if now.unit == "dB":
        return IndicatorChange(then.value, now.value - then.value)
    positive = now.value > 0 and then.value > 0
    return IndicatorChange(then.value, 20 * log10(now.value / then.value) if positive else None)
