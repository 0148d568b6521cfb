"""A gap report of nothing but probabilities: what a baseline can say."""

from __future__ import annotations

from collections.abc import Mapping

from gearsig.gap.simulator import Added
from gearsig.gap.types import NONE, UNKNOWN, GapCause, GapOutcome, GapReport, Interval
from gearsig.gap.verdict import rivals
from sims.effects import effects

NUISANCE_GROUP = "measurement chain"
_NOTHING = Interval(0.0, 0.0, 0.0)


def bare_report(
    simulator: str,
    probabilities: Mapping[str, float],
    options: Mapping[str, Mapping[str, str]] | None = None,
    outcome: GapOutcome | None = None,
) -> GapReport:
    """Return the report of probabilities.

    Parameters
    ----------
    simulator : str
        Name of the baseline, where a report names its simulator.
    probabilities : mapping
        Cause → probability.
    options : mapping or None
        Cause → where it is put: gear, bearing.
    outcome : GapOutcome or None
        None: the likeliest cause's.
    """
    where = options or {}
    ranked = sorted(probabilities.items(), key=lambda item: -item[1])
    likeliest = {NONE: GapOutcome.NO_GAP, UNKNOWN: GapOutcome.UNKNOWN}.get(ranked[0][0], GapOutcome.EFFECT)
    causes = tuple(_cause(name, p, where.get(name, {})) for name, p in ranked)
    return GapReport(
        rig="",
        simulator=simulator,
        conditions=(),
        references=(),
        outcome=outcome or likeliest,
        size=_NOTHING,
        repeatability=0.0,
        places=(),
        causes=causes,
        groups={},
        inseparable=rivals(causes) if outcome is GapOutcome.CANNOT_SEPARATE else None,
    )


def _cause(name: str, probability: float, options: Mapping[str, str]) -> GapCause:
    known = effects().get(name)
    if known is None:
        return GapCause(name, "", name, "", probability)
    return GapCause(
        name,
        known.group,
        known.title,
        known.severity.unit,
        probability,
        fitted=Added(name, known.severity.typical, options),
        is_nuisance=known.group == NUISANCE_GROUP,
    )
