"""A gap report in a few lines: the verdict, and what a further operating condition would give."""

from __future__ import annotations

from gearsig.gap.simulator import Point
from gearsig.gap.types import GapOutcome, GapReport
from gearsig.gap.words import point_text, same_condition

CHECK_FIRST = "Check first"
"""Before each of the doubts."""


def gap_text(report: GapReport) -> str:
    """Return the verdict in four lines, what must be checked first, what a second operating condition would give."""
    advice = condition_advice(report)
    doubts = (f"{CHECK_FIRST}: {doubt}" for doubt in report.doubts)
    return "\n".join([*report.verdict, *doubts, *([advice] if advice else [])])


def condition_advice(report: GapReport) -> str:
    """Say what a second operating condition would give; empty where there are several, or none would tell more."""
    if not report.is_simulated or n_conditions(report) > 1:
        return ""
    start = "One operating condition: "
    if report.outcome is GapOutcome.NO_GAP:
        return start + "whether the machine also agrees at another speed or load was not looked at."
    held_out = next((c.shrinkage.held_out for c in report.causes if c.shrinkage), "other revolutions")
    where = held_out if "starts" in held_out else "other revolutions of the same recordings"
    checked = f"the result could be checked on {where} only. "
    here = report.conditions[0].point
    best = next((one for one in report.next_recordings if not same_condition(one.point, here)), None)
    if best is None:
        return f"{start}{checked}A second one would check it at another speed or load."
    apart = f"{best.standard_deviations:.2g} structural floors apart, against {best.now:.2g} now"
    return f"{start}{checked}A second one, at {point_text(best.point)}, would put the two likeliest causes {apart}."


def n_conditions(report: GapReport) -> int:
    """Count operating conditions: recordings at nearly the same speed and torque are one."""
    distinct: list[Point] = []
    for facts in report.conditions:
        if not any(same_condition(facts.point, point) for point in distinct):
            distinct.append(facts.point)
    return len(distinct)
