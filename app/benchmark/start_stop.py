"""`gearsig benchmark gap --model forging`: blind start–stop cases from an independent drive, diagnosed one by one."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from io import StringIO
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark.answer import Answer, AnsweredShrinkage
from app.benchmark.cases import BLIND, REFERENCES, counts_of
from app.benchmark.diagnosers import START_STOP
from app.benchmark.run import BlindRun, state_of_code
from app.benchmark.scoring.judged import Located, Row
from app.benchmark.scoring.scores import Measure, Score, brier_of, calibration_error, counted, median_of, shrink_of
from gearsig import __version__
from gearsig.checks import count, one_of
from gearsig.gap import NAMING, NONE, UNKNOWN, GapOutcome
from gearsig.recording import Recording
from sims.blind_drive import CATALOGUE, OUTSIDE, ROLES, DriveCase, draw_case, label_of, record_case
from sims.sweep import written

SHARES = {"none": 0.3, "single": 0.55, "unknown": 0.15}


def planned(n_cases: int, seed: int) -> list[tuple[str, str, float]]:
    """Return kind, effect and level of each case: effects in turn, levels drawn."""
    rng = np.random.default_rng([seed, 0])
    cases: list[tuple[str, str, float]] = []
    effects = {"none": ("",), "single": tuple(CATALOGUE), "unknown": tuple(OUTSIDE)}
    for kind, n in counts_of(SHARES, n_cases).items():
        names = effects[kind]
        cases += [(kind, names[i % len(names)], float(rng.random())) for i in range(n)]
    return [cases[i] for i in rng.permutation(len(cases))]


@dataclass(frozen=True)
class DrivePlan:
    """What decides the cases.

    Parameters
    ----------
    n_cases, seed : int
    role : str
        "development", "calibration" or "evaluation"; they share no gears.
    reference : str
        "with" or "without" healthy references, or "both" in turn.
    """

    n_cases: int = 140
    seed: int = 1
    role: str = "evaluation"
    reference: str = "both"

    def __post_init__(self) -> None:
        count(self.n_cases, "cases")
        one_of(self.role, "role", ROLES)
        one_of(self.reference, "reference", REFERENCES)

    def definition(self) -> dict[str, Any]:
        """What decides the answers, as plain values."""
        return {
            "model": "forging",
            "n_cases": self.n_cases,
            "seed": self.seed,
            "role": self.role,
            "reference": self.reference,
            "version": __version__,
            "code": state_of_code(),
        }

    def with_reference(self, number: int, effect: str) -> bool:
        """Whether a case has a healthy reference: an effect without a sound value in the drawing always has."""
        if needs_reference(effect):
            return True
        return number % 2 == 0 if self.reference == "both" else self.reference == "with"


@dataclass(frozen=True)
class DriveDone:
    """A case, made and answered: what was true of it, and the answer."""

    number: int
    label: dict[str, Any]
    answer: Answer


def make_drive_case(plan: DrivePlan, number: int, folder: Path | None) -> dict[str, Any]:
    """Make a case; write what may be seen into `folder` (None: nowhere); return the label."""
    asked = planned(plan.n_cases, plan.seed)[number]
    case = drawn_case(plan.role, plan.seed, number, asked, with_reference=plan.with_reference(number, asked[1]))
    if folder is not None:
        from gearsig.recording import write_recording
        from gearsig.rig import write_rig

        made = record_case(case)
        for stem, recording in (("condition_1", made.recording), ("reference_1", made.reference)):
            if recording is not None and recording.rig is not None:
                write_recording(recording, folder / f"{stem}.h5")
                write_rig(recording.rig, folder / f"{stem}.toml")
    return label_of(case)


def drawn_case(role: str, seed: int, number: int, asked: tuple[str, str, float], *, with_reference: bool) -> DriveCase:
    """Return a case of a plan: kind, effect and level as asked, all else from the seed and the case's number."""
    kind, effect, level = asked
    rng = np.random.default_rng([seed, 1, number])
    return draw_case(rng, role, kind=kind, effect=effect, level=level, with_reference=with_reference)


def labelled_recordings(
    role: str, seed: int, number: int, asked: tuple[str, str, float]
) -> tuple[dict[str, Any], Recording, Recording | None]:
    """Return label, recording and healthy reference of a case for calibration."""
    case = drawn_case(role, seed, number, asked, with_reference=True)
    made = record_case(case)
    return label_of(case), made.recording, made.reference


def needs_reference(effect: str) -> bool:
    """Whether an effect shows against a healthy reference only: no drawing says what is usual."""
    return bool(effect) and (CATALOGUE | OUTSIDE)[effect].needs_reference


def run_drive_benchmark(
    plan: DrivePlan, folder: Path, *, n_processes: int = 2, on_progress: Callable[[int], object] | None = None
) -> list[DriveDone]:
    """Make and diagnose all cases, see `app.benchmark.run`."""
    numbers = range(len(planned(plan.n_cases, plan.seed)))
    run = BlindRun(numbers, partial(make_drive_case, plan), (START_STOP,), plan.definition())
    answered = run.answered(folder, n_processes=n_processes, on_progress=on_progress)
    return [DriveDone(number, label, answers[START_STOP]) for number, label, answers in answered]


# --------------------
# Scores of blind start–stop cases: how often right, what is said of healthy and of unknown ones, how far gaps shrink.
# --------------------


TABLE, SCORES, CASES = "table.md", "scores.json", "cases.csv"
STRONG_LEVEL = 0.5
"""Level from which on an effect is in the upper half of its span."""
N_BINS = 5
SEED = 0
"""Of the draws with replacement that a median's interval comes from."""


def drive_row(done: DriveDone) -> Row:
    """Return a case with its answer as the scores count it; tooth or order are placed right if the setting says so."""
    label, answer = done.label, done.answer
    effects: tuple[str, ...] = (str(label["effect"]),) if label["effect"] else ()
    truths = effects if label["kind"] == "single" else (str(label["kind"]),)
    cause = answer.cause(truths[0])
    placed = {name: cause is not None and cause.options.get(name) == at for name, at in label["place"].items()}
    return Row(
        number=done.number,
        source=BLIND,
        kind=label["kind"],
        effects=effects,
        truths=truths,
        level=label["level"],
        strength=nan,
        has_reference=bool(label["with_reference"]),
        n_conditions=1,
        answer=answer,
        located=Located(**placed),
    )


def effects_ranked(row: Row) -> list[str]:
    """Return the effects by probability."""
    return [name for name in row.ranked if name not in (NONE, UNKNOWN)]


def effects_named(row: Row) -> list[str]:
    """Return what the answer names: one effect, or all those that it cannot tell apart."""
    if row.answer.outcome == GapOutcome.CANNOT_SEPARATE.value:
        return list(row.answer.inseparable)
    return effects_ranked(row)[:1] if _names_effect(row) else []


def _names_effect(row: Row) -> bool:
    return row.answer.outcome in {outcome.value for outcome in NAMING}


def _is_right(row: Row) -> bool:
    return effects_ranked(row)[:1] == list(row.truths)


def _is(kind: str) -> Callable[[Row], bool]:
    return lambda row: row.kind == kind


def _is_single(row: Row) -> bool:
    return row.kind == "single"


def _is_placed(row: Row) -> bool:
    return bool(row.located.tooth or row.located.order)


def _shrinkages(rows: Sequence[Row]) -> list[AnsweredShrinkage]:
    """Return the shrinkages by the true effects."""
    causes = [row.answer.cause(row.truths[0]) for row in rows if _is_single(row)]
    return [cause.shrinkage for cause in causes if cause is not None and cause.shrinkage is not None]


def _wrong_shrinks(rows: Sequence[Row]) -> list[float]:
    return [shrink_of(row, name) for row in rows if _is_single(row) for name in effects_ranked(row)
            if name not in row.truths]  # fmt: skip


def _medians(values: Callable[[Sequence[Row]], list[float]]) -> Measure:
    return lambda rows, rng: median_of(values(rows), rng)


def _is_answered(row: Row) -> bool:
    return bool(row.ranked)


def _plain(statistic: Callable[[Sequence[Row]], float], of: Callable[[Row], bool] = _is_answered) -> Measure:
    """Return a statistic of the answered cases without an interval."""

    def measure(rows: Sequence[Row], rng: np.random.Generator) -> Score:  # noqa: ARG001 - all measures have one form
        chosen = [row for row in rows if of(row)]
        return Score(statistic(chosen) if chosen else nan, nan, nan, len(chosen))

    return measure


MEASURES: dict[str, Measure] = {
    "likeliest effect right": counted(_is_single, _is_right),
    "among the first two": counted(_is_single, lambda r: r.truths[0] in effects_ranked(r)[:2]),
    "likeliest effect right, upper half of the span": counted(
        lambda r: _is_single(r) and r.level >= STRONG_LEVEL, _is_right
    ),
    "named, and right": counted(_is_single, lambda r: r.truths[0] in effects_named(r)),
    "named, and wrong": counted(_is_single, lambda r: _names_effect(r) and r.truths[0] not in effects_named(r)),
    "tooth or order right, of effects found": counted(
        lambda r: _is_single(r) and r.located != Located() and _is_right(r), _is_placed
    ),
    "effect named on a sound machine": counted(_is("none"), _names_effect),
    "effect named on an unknown": counted(_is("unknown"), _names_effect),
    "unknown recognised": counted(_is("unknown"), lambda r: r.answer.outcome == GapOutcome.UNKNOWN.value),
    "held-out shrink by the true effect, median": _medians(lambda rows: [s.shrink for s in _shrinkages(rows)]),
    "by the same effect elsewhere (placebo), median": _medians(
        lambda rows: [s.placebo for s in _shrinkages(rows) if s.n_placebos]
    ),
    "by wrong effects, median": _medians(_wrong_shrinks),
    "calibration error": _plain(
        lambda rows: calibration_error([r.confidence for r in rows], [r.first in r.truths for r in rows], N_BINS)
    ),
    "Brier score, mean": _plain(lambda rows: float(np.mean([brier_of(r) for r in rows]))),
    "processor time of a diagnosis in s, median": _medians(lambda rows: [r.answer.cpu_seconds for r in rows]),
    "longest time of a diagnosis in s": _plain(lambda rows: max(r.answer.seconds for r in rows), lambda _: True),
    "no answer": counted(lambda _: True, lambda r: not _is_answered(r)),
}
"""Figures by their names in table and scores.json."""


def figures(rows: Sequence[Row]) -> dict[str, Score]:
    """Return the figures of some cases, each with its 90 % interval and its number of cases."""
    return {name: measure(rows, np.random.default_rng(SEED)) for name, measure in MEASURES.items()}


def write_scores(cases: Sequence[DriveDone], folder: Path, command: str) -> Path:
    """Write table, scores and cases beside the answers, each whole or not at all."""
    rows = [drive_row(done) for done in cases]
    parts = {
        "all": figures(rows),
        "with reference": figures([row for row in rows if row.has_reference]),
        "without": figures([row for row in rows if not row.has_reference]),
    }
    lines = [
        f"| blind start–stop cases | {' | '.join(parts)} |",
        f"|---|{'---|' * len(parts)}",
        *(f"| {name} | {' | '.join(_cell(scores[name]) for scores in parts.values())} |" for name in MEASURES),
        "",
        *_effect_lines(rows),
        "",
        f"`{command}`",
    ]
    plain = {
        part: {name: {key: _finite(value) for key, value in asdict(score).items()} for name, score in scores.items()}
        for part, scores in parts.items()
    }
    written(folder / CASES, _cases_csv(cases, rows))
    written(folder / SCORES, json.dumps(plain, indent=1) + "\n")
    return written(folder / TABLE, "\n".join(lines) + "\n")


def _effect_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yield, for each effect, how often the likeliest effect was right and what it was taken for."""
    yield "| effect | right | in the upper half of its span | most often taken for |"
    yield "|---|---|---|---|"
    for name in CATALOGUE:
        cases = [row for row in rows if row.effects == (name,)]
        strong = [row for row in cases if row.level >= STRONG_LEVEL]
        wrong = Counter(row.first for row in cases if row.ranked and row.first != name).most_common(1)
        taken_for = f"{wrong[0][0]} ({wrong[0][1]})" if wrong else ""
        shares = (f"{sum(map(_is_right, some))} of {len(some)}" for some in (cases, strong))
        yield f"| {name} | {' | '.join(shares)} | {taken_for} |"


def _cell(score: Score) -> str:
    if not score.n or not isfinite(score.value):
        return "–"
    interval = f" ({score.low:.2f} to {score.high:.2f})" if isfinite(score.low) else ""
    return f"{score.value:.2f}{interval}, n {score.n}"


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _cases_csv(cases: Sequence[DriveDone], rows: Sequence[Row]) -> str:
    """Return one line per case."""
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    stated = ("kind", "effect", "level", "severity", "unit", "with_reference", "n_channels", "encoder_counts")
    table.writerow(["case", *stated, "outcome", "first", "probability", "second", "seconds", "error"])
    for done, row in zip(cases, rows, strict=True):
        answer = done.answer
        said = (row.first, f"{answer.probability(row.first):.3f}", row.ranked[1] if len(row.ranked) > 1 else "")
        label = (done.label[name] for name in stated)
        table.writerow([done.number, *label, answer.outcome, *said, f"{answer.seconds:.1f}", answer.error])
    return text.getvalue()
