"""The baseline that applies the rule table of `gearsig.gap.textbook`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from app.benchmark.bare_report import bare_report
from app.benchmark.seen import Seen
from app.benchmark.usual_features import LEAST_STRENGTH, USUAL
from gearsig.gap.features import once
from gearsig.gap.gear_lines import SIDES
from gearsig.gap.textbook import RULES, rule_strength, sides_of
from gearsig.gap.types import NONE, GapReport


def diagnose(seen: Seen) -> GapReport:
    """Return the rules' strengths as probabilities, by exponentials; conditions count alike."""
    found: dict[str, tuple[float, str]] = {NONE: (LEAST_STRENGTH, "")}
    each = list(_deviations(seen))
    for rule in RULES:
        for side in sides_of(rule):
            strength = float(np.mean([rule_strength(rule, side, deviations) for deviations in each]))
            if strength > found.get(rule.cause, (-np.inf, ""))[0]:
                found[rule.cause] = strength, side
    weights = {cause: float(np.exp(strength)) for cause, (strength, _) in found.items()}
    total = sum(weights.values())
    options = {cause: {"gear": side} for cause, (_, side) in found.items() if side}
    return bare_report("rules", {cause: weight / total for cause, weight in weights.items()}, options)


def _deviations(seen: Seen) -> Iterator[dict[str, float]]:
    """Yield, for each condition, how far every feature of the table is from usual, in spreads."""
    for i, gathered in enumerate(seen.gathered):
        values = dict(zip(*once(gathered), strict=True))
        before = dict(zip(*once(seen.gathered_references[i]), strict=True)) if seen.gathered_references else None
        found = {}
        for name, (usual, spread, change) in USUAL.items():
            for side in SIDES:
                own = name.format(side=side)
                found[own] = (values[own] - usual) / spread if before is None else (values[own] - before[own]) / change
        yield found
