"""Cases of a benchmark: kinds in fixed shares, effects and severities balanced, all in shuffled order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark.diagnosers import SHARES
from gearsig.checks import count, one_of, within
from gearsig.errors import RefusalError
from gearsig.gap import AddedEffect, OperatingCondition
from gearsig.recording import Recording
from sims.blind import (
    CATALOGUE,
    OUTSIDE_CATALOGUE,
    ROLES,
    SHAFTS,
    BlindCase,
    CaseRecordings,
    RunCondition,
    draw_case,
    labels,
    record_case,
    write_visible,
)
from sims.cracked import CrackedPair
from sims.effects import effect
from sims.gear_pair import PairTwin


def counts_of(shares: Mapping[str, float], n_cases: int) -> dict[str, int]:
    """Return whole numbers of cases in these shares, by largest remainder; their sum is `n_cases`."""
    exact = {kind: share * n_cases for kind, share in shares.items()}
    counts = {kind: int(value) for kind, value in exact.items()}
    missing = n_cases - sum(counts.values())
    for kind in sorted(exact, key=lambda k: counts[k] - exact[k])[:missing]:
        counts[kind] += 1
    return counts


REFERENCES = ("both", "with", "without")
BLIND, SAME = "blind", "same"
"""Where the recordings of a case come from: the independent rig, or the diagnosing simulator itself."""


@dataclass(frozen=True)
class PlannedCase:
    """One planned case, before its details are drawn.

    Parameters
    ----------
    number : int
        Number from 1, in the order of the run.
    source : str
        `BLIND` or `SAME`.
    kind : str
    effect : str or None
        None: no effect, or drawn with the case (pairs).
    level : float
        0 (barely noticeable) to 1 (strong).
    with_reference : bool
    n_conditions : int
    repeats : int or None
        Number of the blind case with the same gears, conditions and effects; None: it is blind itself.
    """

    number: int
    source: str
    kind: str
    effect: str | None
    level: float
    with_reference: bool
    n_conditions: int
    repeats: int | None = None


@dataclass(frozen=True)
class Plan:
    """The settings that determine a benchmark's cases.

    Parameters
    ----------
    n_cases : int
        Number of cases of the independent rig.
    seed : int
    role : str
        "development", "calibration" or "evaluation"; they share no gear geometry.
    reference : str
        "with" or "without" healthy references, or "both" in equal shares.
    same_simulator : bool
        Whether the diagnosing simulator also makes the same cases, except unknown ones, which it cannot make.
    longest_s : float or None
        Maximum length to which recordings are cut; None: 4 to 8 s as drawn.
    least_level : float
        Minimum level of effects, 0 (barely noticeable) to 1 (strong). Above 0, more cases are as strong as the targets
        require; at 0, only one in thirty is.
    """

    n_cases: int = 200
    seed: int = 1
    role: str = "evaluation"
    reference: str = "both"
    same_simulator: bool = False
    longest_s: float | None = None
    least_level: float = 0.0

    def __post_init__(self) -> None:
        count(self.n_cases, "cases")
        one_of(self.role, "role", ROLES)
        one_of(self.reference, "reference", REFERENCES)
        within(self.least_level, "least level", 0, 1)

    def definition(self) -> dict[str, Any]:
        """Return the values that determine the cases."""
        return asdict(self)

    def cases(self) -> list[PlannedCase]:
        """Return the cases in the order of the run."""
        blind = _shuffled(self, np.random.default_rng([self.seed, 0]))
        if not self.same_simulator:
            return blind
        again = [c for c in blind if c.kind != "unknown"]
        return blind + [
            replace(c, number=len(blind) + i, source=SAME, repeats=c.number) for i, c in enumerate(again, 1)
        ]

    def rng_of(self, case: PlannedCase) -> np.random.Generator:
        """Return the random generator of a case; a repeated case uses that of its blind original."""
        return np.random.default_rng([self.seed, 1, case.number if case.repeats is None else case.repeats])

    def rng_of_run(self, case: PlannedCase) -> np.random.Generator:
        """Return the random generator of the diagnosing simulator, for severities, places and noise."""
        return np.random.default_rng([self.seed, 2, case.number])

    def draw(self, planned: PlannedCase) -> BlindCase:
        """Draw a case's rig, conditions and fault, without recording them."""
        case = draw_case(
            self.rng_of(planned),
            self.role,
            kind=planned.kind,
            effect=planned.effect,
            level=planned.level if planned.kind != "none" else None,
            n_conditions=planned.n_conditions,
            with_reference=planned.with_reference,
        )
        longest = self.longest_s
        if longest is None:
            return case
        conditions = tuple(replace(c, duration_s=min(c.duration_s, longest)) for c in case.conditions)
        references = tuple(replace(c, duration_s=min(c.duration_s, longest)) for c in case.references)
        return replace(case, conditions=conditions, references=references)

    def make(self, planned: PlannedCase, folder: Path | None) -> Truth:
        """Draw and record a case; write its visible part into `folder` (None: nowhere); return the truth."""
        case = self.draw(planned)
        if planned.source == SAME:
            made, label = record_same(self, planned, case)
        else:
            made = record_case(case)
            label = labels(case, made)
        if folder is not None:
            write_visible(made, folder)
        twins = zip(made.conditions, made.twins, strict=True) if label["effects"] else ()
        return Truth(label, tuple(_difference(now, twin) for now, twin in twins))


def _shuffled(plan: Plan, rng: np.random.Generator) -> list[PlannedCase]:
    drawn = [
        planned_case
        for kind, n in counts_of(SHARES, plan.n_cases).items()
        for planned_case in _of_kind(kind, n, plan, rng)
    ]
    order = rng.permutation(len(drawn))
    return [PlannedCase(i, BLIND, *drawn[place]) for i, place in enumerate(order, 1)]


def _of_kind(
    kind: str, n: int, plan: Plan, rng: np.random.Generator
) -> Iterator[tuple[str, str | None, float, bool, int]]:
    """Yield kind, effect, level, reference, conditions; levels are balanced within an effect, the rest overall."""
    names: Sequence[str | None] = {"single": tuple(CATALOGUE), "unknown": tuple(OUTSIDE_CATALOGUE)}.get(kind, (None,))
    chosen = [names[i] for i in rng.permutation(len(names))]
    effects = [chosen[i % len(chosen)] for i in range(n)]
    turn = int(rng.integers(4))
    for name in dict.fromkeys(effects):
        k = effects.count(name)
        for level in (rng.permutation(k) + rng.random(k)) / k:
            turn = (turn + 1) % 4
            reference = turn % 2 == 0 if plan.reference == "both" else plan.reference == "with"
            yield kind, name, plan.least_level + (1.0 - plan.least_level) * float(level), reference, 1 + turn // 2


# --------------------
# Making one case: the visible part goes to a folder, the truth stays in memory.
# --------------------


@dataclass(frozen=True)
class Truth:
    """The scoring side's knowledge of a case, which is never on disk while anything is being diagnosed.

    Parameters
    ----------
    labels : mapping
        See `sims.blind`.
    fault_changes : tuple of mappings
        For each condition: feature → dB between the case and its twin, the same run without the fault.
    """

    labels: Mapping[str, Any]
    fault_changes: tuple[Mapping[str, float], ...]


def _difference(now: Recording, before: Recording) -> dict[str, float]:
    ours, theirs = _features(now), _features(before)
    return {name: ours[name] - theirs[name] for name in ours if name in theirs}


def _features(recording: Recording) -> dict[str, float]:
    """Return the features by name; empty if the recording cannot be reduced."""
    from gearsig.gap import feature_values, reduce_recording

    if recording.rig is None:
        return {}
    try:
        names, values = feature_values(reduce_recording(recording, recording.rig))
    except RefusalError:
        return {}
    return dict(zip(names, values.tolist(), strict=True))


# --------------------
# The same cases made by the diagnosing simulator: same gears, conditions and levels, its own form of each effect.
#
# The difference in score to the independent rig is what the diagnosis gains from knowing the generator.
# --------------------


N_DRAWS = 9
"""Number of settings drawn per effect; the planned level selects one by severity."""


def record_same(plan: Plan, planned: PlannedCase, case: BlindCase) -> tuple[CaseRecordings, dict[str, Any]]:
    """Record a case on a specimen of the simulator; return it with labels in the layout of the blind rig's."""
    rng = plan.rng_of_run(planned)
    first = case.conditions[0]
    twin = CrackedPair().twin_of(case.rig.description(first.stated_rpm, first.stated_nm))
    added = [_added(twin, fault.name, planned.level, rng) for fault in case.faults]
    seed = int(rng.integers(1, 2**31))

    def run(condition: RunCondition, faults: list[AddedEffect], noise: int) -> Recording:
        recording = twin.run(
            OperatingCondition(condition.true_rpm, condition.true_nm),
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
        places=tuple(_place(setting, case) for setting in added),
    )
    return made, _labels(case, planned, added, made)


def _added(twin: PairTwin, name: str, level: float, rng: np.random.Generator) -> AddedEffect:
    drawn = sorted((twin.draw(name, rng) for _ in range(N_DRAWS)), key=lambda candidate: candidate.severity)
    return drawn[min(int(level * N_DRAWS), N_DRAWS - 1)]


def _place(added: AddedEffect, case: BlindCase) -> dict[str, Any]:
    """Return the location of the effect in the terms of the blind rig's labels."""
    place: dict[str, Any] = {}
    for name in ("gear", "shaft"):
        if name in added.options:
            place["shaft"] = SHAFTS[added.options[name] == "driven"]
    if "bearing" in added.options:
        bearing = str(added.options["bearing"])
        place |= {"bearing": bearing, "shaft": SHAFTS[bearing in ("bearing 3", "bearing 4")]}
    if "tooth" in added.options and place.get("shaft") == SHAFTS[0]:
        place["angle_deg"] = 360.0 * (float(added.options["tooth"]) - 0.5) / case.rig.pair.z1
    if "order" in added.options:
        place |= {"order": float(added.options["order"]), "shaft": SHAFTS[0]}
    return place


def _labels(case: BlindCase, planned: PlannedCase, added: list[AddedEffect], made: CaseRecordings) -> dict[str, Any]:
    def of_effect(setting: AddedEffect, place: Mapping[str, Any]) -> dict[str, Any]:
        known = effect(setting.name)
        return {
            "name": setting.name,
            "group": known.group,
            "severity": setting.severity,
            "unit": known.severity.unit,
            "level": planned.level,
            "resembles": "",
            "place": dict(place),
        }

    return {
        "role": case.role,
        "kind": case.kind,
        "effects": [of_effect(setting, place) for setting, place in zip(added, made.places, strict=True)],
        "has_reference": bool(case.references),
        "conditions": [{"true_rpm": c.true_rpm, "true_nm": c.true_nm} for c in case.conditions],
        "pair": {"z1": case.rig.pair.z1, "z2": case.rig.pair.z2, "module_mm": case.rig.pair.module_mm},
    }
