"""The same cases from the diagnosing simulator itself: same gears, conditions and levels, its own form of each effect.

What a diagnosis scores on these over the independent rig is what it owes to knowing the generator.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from app.benchmark.plan import Plan, PlannedCase
from gearsig.gap.simulator import Added, Point
from gearsig.recording.types import Recording
from sims.blind import SHAFTS, Case, CaseRecordings, Condition
from sims.cracked.twin import cracked_gap_simulator
from sims.effects import effect
from sims.gear_pair.twin import PairTwin

N_DRAWS = 9
"""Settings drawn per effect, of which the planned level picks one by severity."""


def record_same(plan: Plan, planned: PlannedCase, case: Case) -> tuple[CaseRecordings, dict[str, Any]]:
    """Record a case on a specimen of the simulator; return it with its labels, laid out like the blind rig's."""
    rng = plan.rng_of_run(planned)
    first = case.conditions[0]
    twin = cracked_gap_simulator().twin_of(case.rig.description(first.stated_rpm, first.stated_nm))
    added = [_added(twin, fault.name, planned.level, rng) for fault in case.faults]
    seed = int(rng.integers(1, 2**31))

    def run(condition: Condition, faults: list[Added], noise: int) -> Recording:
        recording = twin.run(
            Point(condition.true_rpm, condition.true_nm),
            faults,
            seed=seed,
            duration_s=condition.duration_s,
            sampling_rate_hz=case.rig.sampling_rate_hz,
            noise=noise,
        )
        return replace(recording, rig=case.rig.description(condition.stated_rpm, condition.stated_nm))

    n = len(case.conditions)
    made = CaseRecordings(
        conditions=tuple(run(c, added, 1 + i) for i, c in enumerate(case.conditions)),
        references=tuple(run(c, [], 1 + n + i) for i, c in enumerate(case.references)),
        twins=tuple(run(c, [], 1 + i) for i, c in enumerate(case.conditions)) if added else (),
        places=tuple(_place(one, case) for one in added),
    )
    return made, _labels(case, planned, added, made)


def _added(twin: PairTwin, name: str, level: float, rng: np.random.Generator) -> Added:
    drawn = sorted((twin.draw(name, rng) for _ in range(N_DRAWS)), key=lambda one: one.severity)
    return drawn[min(int(level * N_DRAWS), N_DRAWS - 1)]


def _place(added: Added, case: Case) -> dict[str, Any]:
    """Return where the effect sits, in the words of the blind rig's labels."""
    found: dict[str, Any] = {}
    for name in ("gear", "shaft"):
        if name in added.options:
            found["shaft"] = SHAFTS[added.options[name] == "driven"]
    if "bearing" in added.options:
        bearing = str(added.options["bearing"])
        found |= {"bearing": bearing, "shaft": SHAFTS[bearing in ("bearing 3", "bearing 4")]}
    if "tooth" in added.options and found.get("shaft") == SHAFTS[0]:
        found["angle_deg"] = 360.0 * (float(added.options["tooth"]) - 0.5) / case.rig.pair.z1
    if "order" in added.options:
        found |= {"order": float(added.options["order"]), "shaft": SHAFTS[0]}
    return found


def _labels(case: Case, planned: PlannedCase, added: list[Added], made: CaseRecordings) -> dict[str, Any]:
    def of_effect(one: Added, place: Mapping[str, Any]) -> dict[str, Any]:
        known = effect(one.name)
        return {
            "name": one.name,
            "group": known.group,
            "severity": one.severity,
            "unit": known.severity.unit,
            "level": planned.level,
            "resembles": "",
            "place": dict(place),
        }

    return {
        "role": case.role,
        "kind": case.kind,
        "effects": [of_effect(one, place) for one, place in zip(added, made.places, strict=True)],
        "has_reference": bool(case.references),
        "conditions": [{"true_rpm": c.true_rpm, "true_nm": c.true_nm} for c in case.conditions],
        "pair": {"z1": case.rig.pair.z1, "z2": case.rig.pair.z2, "module_mm": case.rig.pair.module_mm},
    }
