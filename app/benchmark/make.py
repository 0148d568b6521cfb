"""Making one case: what may be seen goes to a folder, the truth stays in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.benchmark.plan import SAME, Plan, PlannedCase
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording
from sims.blind import Case, CaseRecordings, draw_case, labels, record_case, write_seen


@dataclass(frozen=True)
class Truth:
    """What the scoring side knows of a case; it is never on disk while anything is being diagnosed.

    Parameters
    ----------
    labels : mapping
        See `sims.blind`.
    fault_changes : tuple of mappings
        For each condition: feature → dB between the case and its twin, the same run without the fault.
    healthy : mapping
        Of a case with nothing wrong, its first condition: feature → value; else empty.
    healthy_change : mapping
        The same against the reference; empty without one.
    """

    labels: Mapping[str, Any]
    fault_changes: tuple[Mapping[str, float], ...]
    healthy: Mapping[str, float]
    healthy_change: Mapping[str, float]


def make_case(plan: Plan, planned: PlannedCase, folder: Path | None) -> Truth:
    """Draw and record a case; write what may be seen into `folder` (None: nowhere); return the truth."""
    case = _drawn(plan, planned)
    if planned.source == SAME:
        from app.benchmark.make_same import record_same

        made, label = record_same(plan, planned, case)
    else:
        made = record_case(case)
        label = labels(case, made)
    if folder is not None:
        write_seen(made, folder)
    return _truth(label, made)


def _drawn(plan: Plan, planned: PlannedCase) -> Case:
    case = draw_case(
        plan.rng_of(planned),
        plan.role,
        kind=planned.kind,
        effect=planned.effect,
        level=planned.level if planned.kind != "none" else None,
        n_conditions=planned.n_conditions,
        with_reference=planned.with_reference,
    )
    longest = plan.longest_s
    if longest is None:
        return case
    conditions = tuple(replace(c, duration_s=min(c.duration_s, longest)) for c in case.conditions)
    references = tuple(replace(c, duration_s=min(c.duration_s, longest)) for c in case.references)
    return replace(case, conditions=conditions, references=references)


def _truth(label: Mapping[str, Any], made: CaseRecordings) -> Truth:
    if label["effects"]:
        changes = tuple(_difference(case, twin) for case, twin in zip(made.conditions, made.twins, strict=True))
        return Truth(label, changes, {}, {})
    change = _difference(made.conditions[0], made.references[0]) if made.references else {}
    return Truth(label, (), _features(made.conditions[0]), change)


def _difference(now: Recording, before: Recording) -> dict[str, float]:
    ours, theirs = _features(now), _features(before)
    return {name: ours[name] - theirs[name] for name in ours if name in theirs}


def _features(recording: Recording) -> dict[str, float]:
    """Return the features by name; none where the recording cannot be reduced."""
    from gearsig.gap.features import once
    from gearsig.gap.gather import gather

    if recording.rig is None:
        return {}
    try:
        names, values = once(gather(recording, recording.rig))
    except RefusalError:
        return {}
    return dict(zip(names, values.tolist(), strict=True))
