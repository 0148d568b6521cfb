"""`gearsig benchmark gap --model forging`: blind start–stop cases from an independent drive, and their scores."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.cases import BLIND, Plan, PlannedCase, Truth, counts_of
from app.benchmark.diagnosers import START_STOP
from app.benchmark.run import BenchmarkRequest, Done
from app.benchmark.scores import PARTS as ALL_PARTS
from app.benchmark.scores import (
    WITH,
    WITHOUT,
    BenchmarkResult,
    Figure,
    Located,
    Measure,
    Row,
    Rows,
    Score,
    brier_of,
    calibration_error,
    confidence_of,
    counted,
    is_kind,
    mean_of,
    median_of,
    row_of,
    says_unknown,
    score_parts,
    shrink_of,
)
from gearsig.gap import NAMING, NONE, UNKNOWN, GapOutcome, Shrinkage
from gearsig.recording import Recording
from sims.blind_drive import CATALOGUE, OUTSIDE, DriveCase, draw_case, label_of, record_case

SHARES = {"none": 0.3, "single": 0.55, "unknown": 0.15}


def planned(n_cases: int, seed: int) -> list[tuple[str, str, float]]:
    """Return kind, effect and level of each case: effects in turn, random levels."""
    rng = np.random.default_rng([seed, 0])
    cases: list[tuple[str, str, float]] = []
    effects = {"none": ("",), "single": tuple(CATALOGUE), "unknown": tuple(OUTSIDE)}
    for kind, n in counts_of(SHARES, n_cases).items():
        names = effects[kind]
        cases += [(kind, names[i % len(names)], float(rng.random())) for i in range(n)]
    return [cases[i] for i in rng.permutation(len(cases))]


@dataclass(frozen=True)
class DrivePlan(Plan):
    """Plan of the drive cases, by number, seed, role and references as in `Plan`."""

    n_cases: int = 140

    def definition(self) -> dict[str, Any]:
        """Return the values that determine the cases."""
        return {"model": "forging", **super().definition()}

    def cases(self) -> list[PlannedCase]:
        """Return the cases in the order of the run; effects without a healthy value in the drawing get a reference."""
        cases = []
        for number, (kind, effect, level) in enumerate(planned(self.n_cases, self.seed)):
            wished = number % 2 == 0 if self.reference == "both" else self.reference == "with"
            cases.append(PlannedCase(number, BLIND, kind, effect, level, wished or needs_reference(effect), 1))
        return cases

    def make(self, planned: PlannedCase, folder: Path | None) -> Truth:
        """Make a case; write its visible part into `folder` (None: nowhere); return the truth."""
        fault = planned.kind, planned.effect or "", planned.level
        case = drawn_case(self.role, self.seed, planned.number, fault, with_reference=planned.with_reference)
        if folder is not None:
            from gearsig.recording import write_recording
            from gearsig.rig import write_rig

            made = record_case(case)
            for stem, recording in (("condition_1", made.recording), ("reference_1", made.reference)):
                if recording is not None and recording.rig is not None:
                    write_recording(recording, folder / f"{stem}.h5")
                    write_rig(recording.rig, folder / f"{stem}.toml")
        return Truth(_labels(case), ())


def _labels(case: DriveCase) -> dict[str, Any]:
    """Return the label in the layout used for the blind gear pairs."""
    label = label_of(case)
    effect = {"name": label["effect"], **{key: label[key] for key in ("severity", "unit", "level", "place")}}
    return {
        "kind": label["kind"],
        "effects": [effect] if label["effect"] else [],
        "has_reference": label["with_reference"],
        "conditions": [{}],
        "pair": dict(zip(("z1", "z2"), label["teeth"], strict=True)),
        "n_channels": label["n_channels"],
        "encoder_counts": label["encoder_counts"],
    }


def drawn_case(role: str, seed: int, number: int, fault: tuple[str, str, float], *, with_reference: bool) -> DriveCase:
    """Return a case with the given kind, effect and level; the rest follows from the seed and the case number."""
    kind, effect, level = fault
    rng = np.random.default_rng([seed, 1, number])
    return draw_case(rng, role, kind=kind, effect=effect, level=level, with_reference=with_reference)


def labelled_recordings(
    role: str, seed: int, number: int, fault: tuple[str, str, float]
) -> tuple[dict[str, Any], Recording, Recording | None]:
    """Return label, recording and healthy reference of a case for calibration."""
    case = drawn_case(role, seed, number, fault, with_reference=True)
    made = record_case(case)
    return label_of(case), made.recording, made.reference


def needs_reference(effect: str) -> bool:
    """Return whether an effect shows only against a healthy reference, because no drawing states the normal value."""
    return bool(effect) and (CATALOGUE | OUTSIDE)[effect].needs_reference


# --------------------
# Scores: share of right answers, answers to healthy and unknown cases, shrinkage of the gap.
# --------------------


STRONG_LEVEL = 0.5
"""Level from which an effect is in the upper half of its span."""
PARTS = {name: ALL_PARTS[name] for name in ("all", WITH, WITHOUT)}


def judge_drives(request: BenchmarkRequest, cases: Sequence[Done]) -> BenchmarkResult:
    """Score all answers."""
    rows = {START_STOP: [drive_row(done) for done in cases]}
    return BenchmarkResult(request, rows, score_parts(request, rows, PARTS, FIGURES, (False,)), nan, FIGURES)


def drive_row(done: Done) -> Row:
    """Return the row of a case for the scores; tooth and order count as right if the fitted setting states them."""

    def located(place: Mapping[str, Any], effect: str, answer: Answer) -> Located:
        return Located(**{key: answer.options(effect).get(key) == at for key, at in place.items()})

    return row_of(done, done.answers[START_STOP], nan, located)


def effects_ranked(row: Row) -> list[str]:
    """Return the effects by decreasing probability."""
    return [name for name in row.ranked if name not in (NONE, UNKNOWN)]


def effects_named(row: Row) -> list[str]:
    """Return the effects that the answer names: one, or several that it cannot distinguish."""
    if row.answer.outcome == GapOutcome.CANNOT_SEPARATE.value:
        return list(row.answer.inseparable)
    return effects_ranked(row)[:1] if _names_effect(row) else []


def _names_effect(row: Row) -> bool:
    return row.answer.outcome in {outcome.value for outcome in NAMING}


def _is_right(row: Row) -> bool:
    return effects_ranked(row)[:1] == list(row.truths)


_is_single = is_kind("single")


def _shrinkages(rows: Rows) -> list[Shrinkage]:
    """Return the shrinkage of the gap by the true effect, for each case that has one."""
    shrinkages = [row.answer.shrinkage(row.truths[0]) for row in rows if _is_single(row)]
    return [shrinkage for shrinkage in shrinkages if shrinkage is not None]


def _wrong_shrinks(rows: Rows) -> list[float]:
    wrong = [(row, name) for row in rows if _is_single(row) for name in effects_ranked(row) if name not in row.truths]
    return [shrink_of(row, name) for row, name in wrong]


def _medians(values: Callable[[Rows], list[float]]) -> Measure:
    return lambda rows, rng: median_of(values(rows), rng)


def _plain(statistic: Callable[[Rows], float], of: Callable[[Row], bool] = lambda row: bool(row.ranked)) -> Measure:
    """Return a measure: a statistic of the answered cases, without an interval."""

    def measure(rows: Rows, rng: np.random.Generator) -> Score:  # noqa: ARG001 - all measures have one form
        chosen = [row for row in rows if of(row)]
        return Score(statistic(chosen) if chosen else nan, nan, nan, len(chosen))

    return measure


FIGURES = (
    Figure("top_1", "likeliest effect right", counted(_is_single, _is_right)),
    Figure("top_2", "among the two likeliest", counted(_is_single, lambda r: r.truths[0] in effects_ranked(r)[:2])),
    Figure(
        "top_1_strong",
        "likeliest effect right, upper half of the span",
        counted(lambda r: _is_single(r) and r.level >= STRONG_LEVEL, _is_right),
    ),
    Figure("named_right", "named and right", counted(_is_single, lambda r: r.truths[0] in effects_named(r))),
    Figure(
        "named_wrong",
        "named but wrong",
        counted(_is_single, lambda r: _names_effect(r) and r.truths[0] not in effects_named(r)),
    ),
    Figure(
        "place",
        "tooth or order right, if the effect is right",
        counted(
            lambda r: _is_single(r) and r.located != Located() and _is_right(r),
            lambda r: r.located.tooth or r.located.order,
        ),
    ),
    Figure("named_on_none", "effect named on a healthy machine", counted(is_kind("none"), _names_effect)),
    Figure("named_on_unknown", "effect named on an unknown", counted(is_kind("unknown"), _names_effect)),
    Figure("unknown_recognised", "unknown recognised", counted(is_kind("unknown"), says_unknown)),
    Figure(
        "shrink_true",
        "held-out shrink by the true effect, median",
        _medians(lambda rows: [s.shrink.value for s in _shrinkages(rows)]),
        is_share=False,
    ),
    Figure(
        "placebo",
        "by the same effect elsewhere (placebo), median",
        _medians(lambda rows: [s.placebo for s in _shrinkages(rows) if s.n_placebos]),
        is_share=False,
    ),
    Figure("shrink_wrong", "by wrong effects, median", _medians(_wrong_shrinks), is_share=False),
    Figure(
        "ece",
        "calibration error, 5 equal bins",
        _plain(lambda rows: calibration_error(*confidence_of(rows), 5)),
        is_share=False,
    ),
    Figure("brier", "Brier score (0 to 2)", mean_of(brier_of), is_share=False),
    Figure(
        "cpu_s",
        "processor time of a diagnosis in s, median",
        _medians(lambda rows: [r.answer.cpu_seconds for r in rows]),
        is_share=False,
    ),
    Figure(
        "longest_s",
        "longest time of a diagnosis in s",
        _plain(lambda rows: max(r.answer.seconds for r in rows), lambda _: True),
        is_share=False,
    ),
    Figure("no_answer", "no answer", counted(lambda _: True, lambda r: not r.ranked)),
)


def write_drive_results(result: BenchmarkResult, cases: Sequence[Done], folder: Path, command: str) -> Path:
    """Write table, scores, cases and labels next to the answers, each atomically; return the path of the table."""
    from app.benchmark.results import TABLE, figures_table, titled_table, write_files
    from gearsig.report import Section

    parts = {name: result.part(name) for name in PARTS}
    tables = (figures_table(result, "Blind start–stop cases", "", parts), Section(*_by_effect(result)))
    text = "\n".join([*(titled_table(table) for table in tables), f"`{command}`\n"])
    write_files(result, cases, folder, command, text)
    return folder / TABLE


def _by_effect(result: BenchmarkResult) -> tuple[str, str, tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return, for each effect, how often the likeliest effect was right and the most frequent wrong answer."""
    table = []
    for name in CATALOGUE:
        cases = [row for row in result.rows[START_STOP] if row.effects == (name,)]
        strong = [row for row in cases if row.level >= STRONG_LEVEL]
        wrong = Counter(row.first for row in cases if row.ranked and row.first != name).most_common(1)
        shares = (f"{sum(map(_is_right, some))} of {len(some)}" for some in (cases, strong))
        table.append((name, *shares, f"{wrong[0][0]} ({wrong[0][1]})" if wrong else ""))
    header = ("effect", "right", "in the upper half of its span", "most often mistaken for")
    return "Effect by effect", "Likeliest effect right.", header, tuple(table)
