"""A benchmark's files: report.html, table.md, scores.json, cases.csv, labels/. Each is written whole, the page last."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from io import StringIO
from pathlib import Path

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.blind_run import state_of_code
from app.benchmark.diagnosers import BASELINES
from app.benchmark.plan import BLIND, SAME
from app.benchmark.run import Done
from app.benchmark.scoring.calibration_curve import bins_of
from app.benchmark.scoring.effects_table import confusion_counts, confusions_table, effects_table
from app.benchmark.scoring.intervals import Score, share
from app.benchmark.scoring.judged import Row
from app.benchmark.scoring.scores import is_one_answer
from app.benchmark.scoring.strata import WITH, WITHOUT, Result
from app.benchmark.scoring.strength import STRONG
from app.benchmark.scoring.table import Table, beside_table, cost_lines, main_table, markdown, parts_table, same_table
from app.benchmark.shares import SHARES
from gearsig import __version__
from gearsig.formatting import rounded
from gearsig.plot.embed import Picture, embed
from gearsig.report.benchmark_page import Section, benchmark_html
from sims.sweep_run import written

COLUMNS = (
    *("number", "source", "kind", "effects", "level", "severity", "unit", "strength"),
    *("has_reference", "n_conditions", "z1", "z2"),
    *("diagnoser", "outcome", "likeliest", "probability", "second", "probability_of_true", "named", "right"),
    *("seconds", "cpu_seconds", "error"),
)
CHANGED = "; it changed while the benchmark ran, so that the answers are not all of one state"
REPORT, TABLE, SCORES, CASES, LABELS = "report.html", "table.md", "scores.json", "cases.csv", "labels"


def write_results(
    result: Result, cases: Sequence[Done], folder: Path, command: str, date: datetime | None = None
) -> Path:
    """Write everything; return the page's path. Nothing may be left to diagnose when this is called."""
    now = date or datetime.now().astimezone()
    (folder / LABELS).mkdir(exist_ok=True)
    for done in cases:
        text = json.dumps({"source": done.planned.source, **done.truth.labels}, indent=1, ensure_ascii=False)
        written(folder / LABELS / f"case_{done.planned.number:04d}.json", text + "\n")
    written(folder / CASES, cases_csv(result, cases))
    written(folder / SCORES, scores_json(result, command, now))
    written(folder / TABLE, markdown(result, command, now))
    return written(folder / REPORT, page(result, command, now))


def scores_json(result: Result, command: str, date: datetime) -> str:
    """Return every figure of every part, for programs."""
    parts = [
        {
            "diagnoser": p.diagnoser,
            "source": p.source,
            "cases": p.name,
            "least_strength": STRONG if p.strong else 0.0,
            "n_cases": p.n,
            "scores": {key: _plain(score) for key, score in p.scores.items()},
        }
        for p in result.parts
    ]
    head = {
        "layout": "gearsig benchmark gap 1",
        "version": __version__,
        "date": date.isoformat(timespec="seconds"),
        "command": command,
        "benchmark": result.wanted.definition(),
        "strengths_known": result.strengths_known,
        "calibration_error_by_chance": rounded(result.chance_error),
    }
    return json.dumps({**head, "parts": parts}, indent=1, ensure_ascii=False) + "\n"


def _plain(score: Score) -> dict[str, float | int | None]:
    found = asdict(score)
    return {**{key: rounded(found[key]) for key in ("value", "low", "high")}, "n": score.n}


def cases_csv(result: Result, cases: Sequence[Done]) -> str:
    """Return one line per case and diagnoser."""
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for name, rows in result.rows.items():
        for done, row in zip(cases, rows, strict=True):
            effects, pair = done.truth.labels["effects"], done.truth.labels["pair"]
            table.writerow(
                [
                    row.number,
                    row.source,
                    row.kind,
                    " ".join(row.effects),
                    *(_number(row.level), " ".join(f"{e['severity']:.4g}" for e in effects)),
                    " ".join(e["unit"].replace(" ", "_") for e in effects),
                    _number(row.strength),
                    *(int(row.has_reference), row.n_conditions, pair["z1"], pair["z2"]),
                    *(name, row.answer.outcome, row.first),
                    *_said(row),
                    *(f"{row.answer.seconds:.2f}", f"{row.answer.cpu_seconds:.2f}", row.answer.error),
                ]
            )
    return text.getvalue()


def _said(row: Row) -> tuple[str, ...]:
    answer: Answer = row.answer
    first = f"{row.confidence:.4f}" if answer.causes else ""
    second = row.ranked[1] if len(row.ranked) > 1 else ""
    true = f"{sum(answer.probability(name) for name in row.truths):.4f}"
    return first, second, true, row.named, str(int(row.first in row.truths))


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""


def page(result: Result, command: str, date: datetime) -> str:
    """Return report.html."""
    sections = [
        _section(main_table(result)),
        Section("What was taken for what", pictures=(_confusion_picture(result),)),
        _section(confusions_table(result), title="The commonest confusions"),
        Section("Are the probabilities true?", " ".join(cost_lines(result)[1:]), pictures=_calibration(result)),
        _section(effects_table(result)),
        _section(parts_table(result)),
        _section(beside_table(result)),
        *([_section(same)] if (same := same_table(result)) is not None else []),
        _failures(result),
    ]
    return benchmark_html(
        "Blind benchmark of the gap diagnosis",
        _summary(result),
        [s for s in sections if s.rows or s.pictures],
        _provenance(result, command),
        date,
    )


def _section(table: Table, title: str = "") -> Section:
    return Section(title or table.title, table.note, table.header, table.rows)


def _summary(result: Result) -> str:
    said = []
    for name in (WITHOUT, WITH):
        part = result.part(name)
        top, false = part.scores["top_1"], part.scores["named_on_none"]
        if top.n:
            wrong = f"; an effect is named on {100 * false.value:.0f} % of healthy cases" if false.n else ""
            said.append(f"{name}: {100 * top.value:.0f} % of mechanical effects right{wrong}")
    return f"{'. '.join(text[0].upper() + text[1:] for text in said)}." if said else "No mechanical effects."


def _provenance(result: Result, command: str) -> list[tuple[str, str]]:
    plan = result.wanted.plan
    shares = ", ".join(f"{100 * part:.0f} % {kind}" for kind, part in SHARES.items())
    return [
        ("command", command),
        ("cases", f"{plan.n_cases}, role {plan.role}, seed {plan.seed}; {shares}"),
        ("code", result.wanted.code + ("" if state_of_code() == result.wanted.code else CHANGED)),
        ("blindness", "each case diagnosed by a fresh process that is given recordings and rig files only"),
        ("strength", "change between a case and its twin without the fault, sized like the whole gap"),
        ("one diagnosis", cost_lines(result)[0]),
    ]


def _confusion_picture(result: Result) -> Picture:
    from gearsig.plot.benchmark import confusion_figure

    strong = f", faults of at least {STRONG:g} structural floors" if result.strengths_known else ""
    true, said, counts = confusion_counts(result)
    figure = confusion_figure(true, said, counts, title=f"Cases by what it was and what was said{strong}")
    return embed(
        figure,
        "Rows are what it was, with the number of cases; what lies off the diagonal was mistaken.",
        "Table of what it was against the likeliest cause.",
    )


def _calibration(result: Result) -> tuple[Picture, ...]:
    from gearsig.plot.benchmark import calibration_figure

    curves = {}
    for name in (result.judged, *(b for b in BASELINES if b in result.rows and b != result.judged)):
        rows = [r for r in result.rows[name] if r.source == BLIND and is_one_answer(r)]
        found = bins_of([r.confidence for r in rows], [r.first in r.truths for r in rows])
        ends = [share(round(b.accuracy * b.n), b.n) for b in found]
        if found:
            curves[name] = (
                np.array([b.confidence for b in found]),
                np.array([b.accuracy for b in found]),
                np.array([s.low for s in ends]),
                np.array([s.high for s in ends]),
            )
    if not curves:
        return ()
    figure = calibration_figure(curves, title="Right answers over stated probability")
    caption = "Ten bins of equally many cases, of every strength; below the dashed line answers are surer than right."
    return (embed(figure, caption, "Share of right answers over stated probability.", vector=True),)


def _failures(result: Result) -> Section:
    rows = [r for r in result.rows[result.judged] if r.answer.error]
    cells = tuple((str(r.number), "same simulator" if r.source == SAME else "blind", r.answer.error) for r in rows)
    return Section("Cases without an answer", "", ("case", "made by", "reason"), cells)
