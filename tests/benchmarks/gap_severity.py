"""How far the severity that is fitted on a rig's twin lies from the true one.

`python tests/benchmarks/gap_severity.py [CASES] [SEED] [ROLE]` makes blind cases of an independent rig with a healthy
reference (development gears unless told otherwise), tries the true effect on the twin, and where the twin comes nearer
with it prints one line: effect, true and fitted severity, the fit's own interval. Then by how much they differ, and how
often the interval holds the true one. Effects that the rig measures in another unit than the twin are left out.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.benchmark.cases import Plan, PlannedCase
from app.benchmark.diagnosers import VisibleCase, read_visible
from gearsig.errors import GearsigError
from gearsig.gap import GapEffect, Interval, conditions_of, try_effects
from gearsig.prepared import PreparedRecording
from sims.registry import gap_simulator

MIN_LEVEL = 0.4
"""Weaker effects are hardly ever named, and severities are given of what is named."""


@dataclass(frozen=True)
class Fitted:
    """One case: effect, true severity, the fit's."""

    effect: str
    true: float
    fit: Interval


def fitted(plan: Plan, planned: PlannedCase) -> Fitted | None:
    """Try the true effect of a case; None where it is not tried, or the twin comes no nearer with it."""
    with tempfile.TemporaryDirectory() as name:
        effects = plan.make(planned, Path(name)).labels["effects"]
        seen = read_visible(Path(name))
    (one,) = effects
    known = gap_simulator("cracked").gap_effects()[one["name"]]
    if known.is_nuisance or one["unit"].partition(" of ")[0] != (known.unit or "1"):
        return None
    tried = _tried(seen, known)
    return None if tried is None else Fitted(known.name, one["severity"], tried)


def _tried(seen: VisibleCase, effect: GapEffect) -> Interval | None:
    twin = gap_simulator("cracked").twin_of(seen.rig)
    try:
        conditions, _notices = conditions_of(
            [PreparedRecording(recording) for recording in seen.recordings],
            [PreparedRecording(reference) for reference in seen.references],
            twin,
        )
        found = try_effects([effect], twin, conditions, None, lambda _what, _done: None).get(effect.name)
    except GearsigError:
        return None
    return found.fit.severity if found is not None and found.explains else None


def main(n_cases: int, seed: int, role: str) -> None:
    """Print the cases, and what they say together."""
    plan = Plan(n_cases, seed, role, reference="with", least_level=MIN_LEVEL)
    rows = []
    for planned in plan.cases():
        if planned.kind == "single" and (row := fitted(plan, planned)) is not None:
            rows.append(row)
            fit = row.fit
            print(f"{row.effect:22}{row.true:10.4g}{fit.value:10.4g}{fit.low:10.4g}{fit.high:10.4g}", flush=True)
    if not rows:
        raise SystemExit("no case has an effect that could be fitted; ask for more cases")
    ratios = np.array([row.true / row.fit.value for row in rows])
    held = sum(row.fit.low <= row.true <= row.fit.high for row in rows)
    least, middle, most = np.quantile(ratios, (0.0, 0.5, 1.0))
    print(f"true over fitted: {least:.2g} to {most:.2g}, middle {middle:.2g}; {held} of {len(rows)} in the interval")


if __name__ == "__main__":
    given = sys.argv[1:]
    cases, seed, role = (*given, *("130", "31", "development")[len(given) :])
    main(int(cases), int(seed), role)
