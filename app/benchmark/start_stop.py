"""`gearsig benchmark gap --model forging`: blind start–stop cases from an independent drive, diagnosed one by one."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from io import StringIO
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark.answer import Answer, AnsweredShrinkage
from app.benchmark.cases import counts_of
from app.benchmark.diagnosers import START_STOP
from app.benchmark.run import ANSWERS_FOLDER, DEFINITION, BlindRun, state_of_code
from app.benchmark.scoring.scores import Score, brier, calibration_error, median_of, share
from app.gap_start_stop.diagnose import compared_of, predictions_of
from app.gap_start_stop.predict import DriveEvidence, seen_of
from gearsig import __version__
from gearsig.checks import count, one_of
from gearsig.gap import NONE, UNKNOWN, GapOutcome
from sims.blind_drive import CATALOGUE, OUTSIDE, ROLES, draw_case, label_of, record_case
from sims.sweep import written

# --------------------
# What the diagnosis sees of blind start–stop cases, collected for its floors and its calibration.
# --------------------


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


def collect(
    role: str, seed: int, number: int, plan: tuple[str, str, float]
) -> list[tuple[dict[str, Any], DriveEvidence]]:
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


REFERENCES = ("both", "with", "without")


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
        if effect and (CATALOGUE | OUTSIDE)[effect].needs_reference:
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
    kind, effect, level = planned(plan.n_cases, plan.seed)[number]
    rng = np.random.default_rng([plan.seed, 1, number])
    reference = plan.with_reference(number, effect)
    case = draw_case(rng, plan.role, kind=kind, effect=effect, level=level, with_reference=reference)
    if folder is not None:
        from gearsig.recording import write_recording
        from gearsig.rig import write_rig

        made = record_case(case)
        for stem, recording in (("condition_1", made.recording), ("reference_1", made.reference)):
            if recording is not None and recording.rig is not None:
                write_recording(recording, folder / f"{stem}.h5")
                write_rig(recording.rig, folder / f"{stem}.toml")
    return label_of(case)


def run_drive_benchmark(
    plan: DrivePlan, folder: Path, *, n_processes: int = 2, on_progress: Callable[[int], object] | None = None
) -> list[DriveDone]:
    """Make and diagnose all cases, see `app.benchmark.run`."""
    numbers = range(len(planned(plan.n_cases, plan.seed)))
    run = BlindRun(numbers, partial(make_drive_case, plan), (START_STOP,), plan.definition())
    answered = run.answered(folder, n_processes=n_processes, on_progress=on_progress)
    return [DriveDone(number, label, answers[START_STOP]) for number, label, answers in answered]


# --------------------
# Scores of blind start–stop cases: how often right, what is said of sound and of unknown ones, how far gaps shrink.
# --------------------


TABLE, SCORES, CASES = "table.md", "scores.json", "cases.csv"
FILES = (TABLE, SCORES, CASES, DEFINITION, ANSWERS_FOLDER)
NAMING = (GapOutcome.EFFECT.value, GapOutcome.CANNOT_SEPARATE.value)
STRONG = 0.5
"""Level from which on an effect is in the upper half of its span."""
SEED = 0
"""Of the draws with replacement that a median's interval comes from."""

Cases = Sequence[DriveDone]


def truth_of(done: DriveDone) -> str:
    """Return the cause that is right."""
    return str(done.label["effect"]) if done.label["kind"] == "single" else str(done.label["kind"])


def ranked(done: DriveDone) -> list[str]:
    """Return the causes by probability."""
    return [c.name for c in done.answer.ranked]


def mechanical(done: DriveDone) -> list[str]:
    """Return the effects by probability."""
    return [name for name in ranked(done) if name not in (NONE, UNKNOWN)]


def names_effect(done: DriveDone) -> bool:
    """Whether the answer names an effect."""
    return done.answer.outcome in NAMING


def named_effects(done: DriveDone) -> list[str]:
    """Return what the answer names: one effect, or all those that it cannot tell apart."""
    if done.answer.outcome == GapOutcome.CANNOT_SEPARATE.value:
        return list(done.answer.inseparable)
    return mechanical(done)[:1] if names_effect(done) else []


def figures(cases: Cases) -> dict[str, Score]:
    """Return the figures of some cases, each with its 90 % interval and its number of cases."""
    single = [c for c in cases if c.label["kind"] == "single"]
    strong = [c for c in single if c.label["level"] >= STRONG]
    placed = [c for c in single if c.label["place"] and mechanical(c)[:1] == [truth_of(c)]]
    found = {
        "likeliest effect right": _share(single, lambda c: mechanical(c)[:1] == [truth_of(c)]),
        "among the first two": _share(single, lambda c: truth_of(c) in mechanical(c)[:2]),
        "likeliest effect right, upper half of the span": _share(strong, lambda c: mechanical(c)[:1] == [truth_of(c)]),
        "named, and right": _share(single, lambda c: truth_of(c) in named_effects(c)),
        "named, and wrong": _share(single, lambda c: names_effect(c) and truth_of(c) not in named_effects(c)),
        "tooth or order right, of effects found": _share(placed, _is_placed),
        "effect named on a sound machine": _share([c for c in cases if c.label["kind"] == "none"], names_effect),
        "effect named on an unknown": _share([c for c in cases if c.label["kind"] == "unknown"], names_effect),
        "unknown recognised": _share(
            [c for c in cases if c.label["kind"] == "unknown"],
            lambda c: c.answer.outcome == GapOutcome.UNKNOWN.value,
        ),
    }
    shrinks = [s for c in single if (s := _shrink(c, truth_of(c))) is not None]
    found["held-out shrink by the true effect, median"] = _middle([s.shrink for s in shrinks])
    found["by the same effect elsewhere (placebo), median"] = _middle([s.placebo for s in shrinks if s.n_placebos])
    wrong = [s.shrink for c in single for n in mechanical(c) if n != truth_of(c) and (s := _shrink(c, n)) is not None]
    found["by wrong effects, median"] = _middle(wrong)
    answered = [c for c in cases if c.answer.causes]
    sure = [max(k.probability for k in c.answer.causes) for c in answered]
    right = [ranked(c)[0] == truth_of(c) for c in answered]
    error = calibration_error(sure, right, 5) if answered else nan
    found["calibration error"] = Score(error, nan, nan, len(answered))
    scores = [brier({k.name: k.probability for k in c.answer.causes}, truth_of(c)) for c in answered]
    found["Brier score, mean"] = Score(sum(scores) / len(scores) if scores else nan, nan, nan, len(scores))
    found["processor time of a diagnosis in s, median"] = _middle([c.answer.cpu_seconds for c in cases])
    found["longest time of a diagnosis in s"] = Score(
        max((c.answer.seconds for c in cases), default=nan), nan, nan, len(cases)
    )
    found["no answer"] = _share(cases, lambda c: not c.answer.causes)
    return found


def write_scores(cases: Cases, folder: Path, command: str) -> Path:
    """Write table, scores and cases beside the answers, each whole or not at all."""
    with_, without = ([c for c in cases if bool(c.label["with_reference"]) is wanted] for wanted in (True, False))
    parts = {"all": figures(cases), "with reference": figures(with_), "without": figures(without)}
    rows = [f"| {name} | {' | '.join(_cell(parts[part][name]) for part in parts)} |" for name in parts["all"]]
    head = f"| blind start–stop cases | {' | '.join(parts)} |\n|---|{'---|' * len(parts)}\n"
    text = head + "\n".join(rows) + "\n\n" + _effect_table(cases) + f"\n`{command}`\n"
    plain = {
        part: {name: {"value": s.value, "low": s.low, "high": s.high, "n": s.n} for name, s in found.items()}
        for part, found in parts.items()
    }
    written(folder / CASES, _cases_csv(cases))
    written(folder / SCORES, json.dumps(_finite(plain), indent=1) + "\n")
    return written(folder / TABLE, text)


def _effect_table(cases: Cases) -> str:
    """Return, for each effect, how often the likeliest effect was right and what it was taken for."""
    lines = ["| effect | right | in the upper half of its span | most often taken for |", "|---|---|---|---|"]
    for name in CATALOGUE:
        own = [c for c in cases if c.label["effect"] == name]
        strong = [c for c in own if c.label["level"] >= STRONG]
        wrong = Counter(ranked(c)[0] for c in own if c.answer.causes and ranked(c)[0] != name).most_common(1)
        cells = [_right(own, name), _right(strong, name), f"{wrong[0][0]} ({wrong[0][1]})" if wrong else ""]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _right(cases: Cases, name: str) -> str:
    return f"{sum(mechanical(c)[:1] == [name] for c in cases)} of {len(cases)}"


def _share(cases: Cases, wanted: Callable[[DriveDone], bool]) -> Score:
    return share(sum(wanted(c) for c in cases), len(cases))


def _middle(values: Sequence[float]) -> Score:
    return median_of(values, np.random.default_rng(SEED))


def _shrink(done: DriveDone, name: str) -> AnsweredShrinkage | None:
    cause = done.answer.cause(name)
    return None if cause is None else cause.shrinkage


def _is_placed(done: DriveDone) -> bool:
    cause = done.answer.cause(truth_of(done))
    place = done.label["place"]
    return cause is not None and all(cause.options.get(key) == value for key, value in place.items())


def _cell(score: Score) -> str:
    if not score.n or not isfinite(score.value):
        return "–"
    interval = f" ({score.low:.2f} to {score.high:.2f})" if isfinite(score.low) else ""
    return f"{score.value:.2f}{interval}, n {score.n}"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    return None if isinstance(value, float) and not isfinite(value) else value


def _cases_csv(cases: Cases) -> str:
    """Return one line per case."""
    text = StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["case", "kind", "effect", "level", "severity", "unit", "with_reference", "n_channels",
                   "encoder_counts", "outcome", "first", "probability", "second", "seconds", "error"])  # fmt: skip
    for c in cases:
        names, label = ranked(c), c.label
        first = names[0] if names else ""
        rows.writerow(
            [
                c.number,
                *(label[k] for k in ("kind", "effect", "level", "severity", "unit", "with_reference")),
                label["n_channels"],
                label["encoder_counts"],
                c.answer.outcome,
                first,
                f"{c.answer.probability(first):.3f}",
                names[1] if len(names) > 1 else "",
                f"{c.answer.seconds:.1f}",
                c.answer.error,
            ]
        )
    return text.getvalue()
