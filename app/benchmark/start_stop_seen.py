"""What the diagnosis sees of blind start–stop cases, collected for its floors and its calibration."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.benchmark.shares import counts_of
from app.gap.start_stop.diagnose import compared_of, predictions_of
from app.gap.start_stop.weighing import Seen, seen_of
from sims.blind_drive import CATALOGUE, OUTSIDE, draw_case, label_of, record_case

SHARES = {"none": 0.3, "single": 0.55, "unknown": 0.15}


def planned(n_cases: int, seed: int) -> list[tuple[str, str, float]]:
    """Return kind, effect and level of each case: effects in turn, levels drawn."""
    rng = np.random.default_rng([seed, 0])
    found: list[tuple[str, str, float]] = []
    effects = {"none": ("",), "single": tuple(CATALOGUE), "unknown": tuple(OUTSIDE)}
    for kind, n in counts_of(SHARES, n_cases).items():
        names = effects[kind]
        found += [(kind, names[i % len(names)], float(rng.random())) for i in range(n)]
    return [found[i] for i in rng.permutation(len(found))]


def collect(role: str, seed: int, number: int, plan: tuple[str, str, float]) -> list[tuple[dict[str, Any], Seen]]:
    """Make a case and return what is seen of it with its reference and without."""
    kind, effect, level = plan
    rng = np.random.default_rng([seed, 1, number])
    case = draw_case(rng, role, kind=kind, effect=effect, level=level, with_reference=True)
    made, label = record_case(case), label_of(case)
    found = []
    for reference in (made.reference, None):
        if reference is None and effect and (CATALOGUE | OUTSIDE)[effect].needs_reference:
            continue
        compared = compared_of(made.recording, reference, "case")
        seen = seen_of(compared, predictions_of(compared).causes)
        found.append(({**label, "with_reference": reference is not None}, seen))
    return found
