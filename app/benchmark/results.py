"""Files of a benchmark: report.html, table.md, scores.json, cases.csv, labels/; written atomically, the page last."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from math import isfinite
from pathlib import Path

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.cases import BLIND, SAME
from app.benchmark.diagnosers import BASELINES, SHARES
from app.benchmark.run import Done, state_of_code
from app.benchmark.scores import (
    FIGURES,
    STRONG,
    WITH,
    WITHOUT,
    BenchmarkResult,
    Figure,
    Part,
    Row,
    Score,
    bins_of,
    confidence_of,
    is_one_answer,
    judgement,
    share,
    strong_only,
)
from gearsig import __version__
from gearsig.cache import write_text
from gearsig.formatting import csv_rows, markdown_table, percent, rounded, with_minus
from gearsig.gap import NONE, UNKNOWN
from gearsig.plot import Picture, embed
from gearsig.report import Section, benchmark_html
from sims.blind import CATALOGUE, OUTSIDE_CATALOGUE

# --------------------
# Result tables: in Markdown for the README, and with the same cells for the page.
# --------------------


NO_CASES = "–"
"""Text of a cell without cases."""


def main_table(result: BenchmarkResult) -> Section:
    """Return the figures with targets and those needed to interpret them, with and without reference."""
    parts = {name: result.part(name).scores for name in (WITHOUT, WITH)}
    rows = []
    for figure in FIGURES:
        row = [figure.title]
        for i, name in enumerate((WITHOUT, WITH)):
            score = parts[name][figure.key]
            row += [cell(figure, score), target_cell(figure, score, i)]
        if any(scores[figure.key].n for scores in parts.values()):
            rows.append(tuple(row))
    header = ("", WITHOUT, "target", WITH, "target")
    return Section("Against the targets", _BASIS, header, tuple(rows))


def same_table(result: BenchmarkResult) -> tuple[Section, ...]:
    """Return the figures of the diagnosing simulator's own cases, if any, and the drop from them."""
    if not result.request.plan.same_simulator:
        return ()
    rows = []
    for figure in FIGURES:
        row = [figure.title]
        for name in (WITHOUT, WITH):
            same, blind = (result.part(name, source=source).scores[figure.key] for source in (SAME, BLIND))
            row += [cell(figure, same), _drop(figure, same, blind)]
        if any(text != NO_CASES for text in row[1::2]):
            rows.append(tuple(row))
    note = "The same plan of cases, made by the diagnosing simulator; drop: change on going to the independent rig."
    return (Section("Same simulator", note, ("", WITHOUT, "drop", WITH, "drop"), tuple(rows)),)


def figures_table(
    result: BenchmarkResult, title: str, note: str, columns: Mapping[str, Part], *, with_n: bool = True
) -> Section:
    """Return the figures of several parts side by side, without figures that apply to no case."""
    rows = []
    for figure in result.figures:
        of_parts = [part.scores[figure.key] for part in columns.values()]
        if any(score.n for score in of_parts):
            rows.append((figure.title, *(cell(figure, score, with_n=with_n) for score in of_parts)))
    return Section(title, note, ("", *columns), tuple(rows))


def alternatives_table(result: BenchmarkResult) -> Section:
    """Return the same figures for the other diagnosers, on the same cases."""
    names = result.request.diagnosers
    parts = (("without", WITHOUT), ("with", WITH))
    columns = {f"{name}, {word}": result.part(part, diagnoser=name) for name in names for word, part in parts}
    words = {"majority": "majority: always the most frequent answer", "rules": "rules: a table of textbook signatures"}
    note = "; ".join(words[name] for name in BASELINES if name in names).capitalize()
    text = f"On the same cases, without and with reference. {note}."
    return figures_table(result, "Comparison with other diagnosers", text, columns, with_n=False)


def parts_table(result: BenchmarkResult) -> Section:
    """Return the figures for one and two conditions, and for faults of every strength."""
    columns = {name: result.part(name) for name in ("one condition", "two conditions")} | {
        "every strength, without reference": result.part(WITHOUT, strong=False),
        "with reference": result.part(WITH, strong=False),
    }
    return figures_table(result, "By conditions, and with weak faults", "", columns)


def cell(figure: Figure, score: Score, *, with_n: bool = True) -> str:
    """Return value, interval and number of cases as text."""
    if not score.n:
        return NO_CASES
    n = f" of {score.n}" if with_n else ""
    if figure.is_share:
        return f"{percent(score.value)} ({100 * score.low:.0f}–{100 * score.high:.0f}){n}"
    interval = f" ({score.low:.2f}–{score.high:.2f})" if isfinite(score.low) else ""
    return with_minus(f"{score.value:.2f}{interval}{n}")


def target_cell(figure: Figure, score: Score, column: int) -> str:
    """Return the target and whether it is met."""
    if figure.targets is None:
        return ""
    target = figure.targets[column]
    sign = "≥" if figure.is_least else "≤"
    text = f"{sign} {percent(target)}" if figure.is_share else f"{sign} {target:.2f}"
    verdict = judgement(score, target, is_least=figure.is_least)
    return f"{text}: {verdict}" if verdict else text


def _drop(figure: Figure, same: Score, blind: Score) -> str:
    if not same.n or not blind.n:
        return NO_CASES
    drop = blind.value - same.value
    text = f"{100 * drop:+.0f} points" if figure.is_share else f"{drop:+.2f}"
    return with_minus(text)


_BASIS = (
    f"Faults of at least {STRONG:g} structural floors, and all healthy cases; value (90 % interval) and number of "
    "cases; open: the interval contains the target."
)


def markdown(result: BenchmarkResult, command: str, date: datetime) -> str:
    """Return the tables for a README, with date, version and command."""
    plan = result.request.plan
    head = f"{plan.n_cases} blind cases, {plan.role}; gearsig {__version__}, {date:%d %B %Y}; `{command}`.\n"
    tables = (main_table(result), *same_table(result), alternatives_table(result))
    return "\n".join([head, *map(titled_table, tables), *cost_lines(result), ""])


def titled_table(table: Section) -> str:
    """Return a table in Markdown with its title and note above it."""
    return f"**{table.title}.** {table.note}\n\n{markdown_table(table.header, table.rows)}"


def cost_lines(result: BenchmarkResult) -> list[str]:
    """Return the run time of a diagnosis and the calibration error expected by chance, as text."""
    answers = [row.answer for row in result.rows[result.judged]]
    wall = np.array([a.seconds for a in answers])
    cpu = np.array([a.cpu_seconds for a in answers])
    took = (
        f"One diagnosis took {np.median(wall):.1f} s (median; longest {wall.max():.1f} s), "
        f"{np.median(cpu):.1f} s of processor time (longest {cpu.max():.1f} s)."
    )
    chance = (
        "With this number of cases, exactly correct probabilities would show a calibration error of "
        f"{result.chance_error:.2f}."
    )
    return [took, chance]


# --------------------
# Results per effect and per level, and confusions, with what both effects have in common.
# --------------------


LEVELS = (("weak", 0.0, 1 / 3), ("middle", 1 / 3, 2 / 3), ("strong", 2 / 3, 1.01))
MAX_CONFUSIONS = 12


def effects_table(result: BenchmarkResult) -> Section:
    """Return, for each effect, how often the likeliest cause was right, by level, strength and reference."""
    rows = [r for r in result.rows[result.judged] if r.source == BLIND]
    table = [_effect_row(name, [r for r in rows if r.kind == "single" and r.effects == (name,)]) for name in CATALOGUE]
    table += [
        _effect_row(name, [r for r in rows if r.kind == "unknown" and r.effects == (name,)])
        for name in OUTSIDE_CATALOGUE
    ]
    header = (
        "effect",
        *(name for name, *_ in LEVELS),
        f"≥ {STRONG:g} floors, without",
        "with reference",
        "strength",
        "most often mistaken for",
    )
    note = (
        "Cases with the likeliest cause right, of how many: in the weak, middle and strong third of the effect's span, "
        f"and from {STRONG:g} structural floors upwards. Strength: the median, in structural floors. For effects "
        "outside the catalogue “unknown” is right."
    )
    return Section("Effect by effect", note, header, tuple(row for row in table if row))


def _effect_row(name: str, rows: Sequence[Row]) -> tuple[str, ...]:
    if not rows:
        return ()
    strong = [r for r in rows if r.strength >= STRONG]
    wrong = Counter(r.first or "no answer" for r in rows if not r.is_right).most_common(1)
    known = [r.strength for r in rows if np.isfinite(r.strength)]
    return (
        name,
        *(_right([r for r in rows if low <= r.level < high]) for _, low, high in LEVELS),
        _right([r for r in strong if not r.has_reference]),
        _right([r for r in strong if r.has_reference]),
        f"{np.median(known):.2g}" if known else "–",
        f"{wrong[0][0]} ({wrong[0][1]})" if wrong else "",
    )


def _right(rows: Sequence[Row]) -> str:
    return f"{sum(r.is_right for r in rows)} of {len(rows)}" if rows else "–"


def confusions_table(result: BenchmarkResult) -> Section:
    """Return the most frequent wrong answers, and the kinds of features in which both effects show."""
    confusions = Counter(
        (r.truths[0] if r.kind != "unknown" else r.effects[0], r.first)
        for r in _with_one_answer(result)
        if not r.is_right
    )
    table = [
        (true, answer or "no answer", str(n), _common(true, answer)) for (true, answer), n in confusions.most_common()
    ]
    return Section(
        "Confusions",
        "In common: kinds of features in which theory expects both.",
        ("true cause", "answer", "cases", "in common"),
        tuple(table[:MAX_CONFUSIONS]),
    )


def _with_one_answer(result: BenchmarkResult) -> list[Row]:
    """Return the blind cases with one right answer; only those with strong faults, if strength is known."""
    rows = [r for r in result.rows[result.judged] if r.source == BLIND and r.kind != "pair"]
    return strong_only(rows, STRONG) if result.strengths_known else rows


def _common(true: str, answer: str) -> str:
    from sims.effects import effects

    if answer == NONE:
        return "too weak to stand out from the floor"
    if true in OUTSIDE_CATALOGUE:
        return "made to resemble it" if OUTSIDE_CATALOGUE[true].resembles == answer else ""
    known = effects()
    if true in known and answer in known:
        return ", ".join(kind.replace("_", " ") for kind in known[true].shows_in if kind in known[answer].shows_in)
    return "not explained well enough" if answer == UNKNOWN else ""


def confusion_counts(result: BenchmarkResult) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray]:
    """Return true causes, answers and counts, (n_true, n_answers), of the blind cases with one right answer."""
    rows = _with_one_answer(result)
    true = (*CATALOGUE, NONE, UNKNOWN)
    answers = (*true, "no answer") if any(not r.first for r in rows) else true
    counts = np.zeros((len(true), len(answers)), dtype=np.int64)
    for row in rows:
        counts[true.index(row.truths[0]), answers.index(row.first or "no answer")] += 1
    return true, answers, counts


COLUMNS = (
    *("number", "source", "kind", "effects", "level", "severity", "unit", "strength"),
    *("has_reference", "n_conditions", "z1", "z2"),
    *("diagnoser", "outcome", "likeliest", "probability", "second", "probability_of_true", "named", "right"),
    *("seconds", "cpu_seconds", "error"),
)
CHANGED = "; it changed while the benchmark ran, so the answers come from different versions"
REPORT, TABLE, SCORES, CASES, LABELS = "report.html", "table.md", "scores.json", "cases.csv", "labels"


def write_results(result: BenchmarkResult, cases: Sequence[Done], folder: Path, command: str) -> Path:
    """Write all files and return the path of the page; call it only when every diagnosis has ended."""
    now = datetime.now().astimezone()
    write_files(result, cases, folder, command, markdown(result, command, now), now)
    return write_text(folder / REPORT, page(result, command, now))


def write_files(
    result: BenchmarkResult, cases: Sequence[Done], folder: Path, command: str, table: str, date: datetime | None = None
) -> None:
    """Write labels, cases, scores and tables, each atomically."""
    (folder / LABELS).mkdir(exist_ok=True)
    for done in cases:
        text = json.dumps({"source": done.planned.source, **done.truth.labels}, indent=1, ensure_ascii=False)
        write_text(folder / LABELS / f"case_{done.planned.number:04d}.json", text + "\n")
    write_text(folder / CASES, cases_csv(result, cases))
    write_text(folder / SCORES, scores_json(result, command, date or datetime.now().astimezone()))
    write_text(folder / TABLE, table)


def scores_json(result: BenchmarkResult, command: str, date: datetime) -> str:
    """Return every figure of every part as JSON."""
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
        "benchmark": result.request.definition(),
        "strengths_known": result.strengths_known,
        "calibration_error_by_chance": rounded(result.chance_error),
    }
    return json.dumps({**head, "parts": parts}, indent=1, ensure_ascii=False) + "\n"


def _plain(score: Score) -> dict[str, float | int | None]:
    values = asdict(score)
    return {**{key: rounded(values[key]) for key in ("value", "low", "high")}, "n": score.n}


def cases_csv(result: BenchmarkResult, cases: Sequence[Done]) -> str:
    """Return a CSV table with one line per case and diagnoser."""
    table: list[list[object]] = []
    for name, rows in result.rows.items():
        for done, row in zip(cases, rows, strict=True):
            effects, pair = done.truth.labels["effects"], done.truth.labels["pair"]
            table.append(
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
                    *_answer_cells(row),
                    *(f"{row.answer.seconds:.2f}", f"{row.answer.cpu_seconds:.2f}", row.answer.error),
                ]
            )
    return csv_rows(COLUMNS, table)


def _answer_cells(row: Row) -> tuple[str, ...]:
    answer: Answer = row.answer
    first = f"{row.confidence:.4f}" if answer.causes else ""
    second = row.ranked[1] if len(row.ranked) > 1 else ""
    true = f"{sum(answer.probability(name) for name in row.truths):.4f}"
    return first, second, true, row.named, str(int(row.is_right))


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""


def page(result: BenchmarkResult, command: str, date: datetime) -> str:
    """Return the HTML of report.html."""
    sections = [
        main_table(result),
        Section("Confusions", pictures=(_confusion_picture(result),)),
        replace(confusions_table(result), title="The most frequent confusions"),
        Section("Are the probabilities correct?", " ".join(cost_lines(result)[1:]), pictures=_calibration(result)),
        effects_table(result),
        parts_table(result),
        alternatives_table(result),
        *same_table(result),
        _failures(result),
    ]
    return benchmark_html(
        "Blind benchmark of the gap diagnosis",
        _summary(result),
        [s for s in sections if s.rows or s.pictures],
        _provenance(result, command),
        date,
    )


def _summary(result: BenchmarkResult) -> str:
    sentences = []
    for name in (WITHOUT, WITH):
        part = result.part(name)
        top, false = part.scores["top_1"], part.scores["named_on_none"]
        if top.n:
            wrong = f"; an effect is named on {percent(false.value)} of healthy cases" if false.n else ""
            sentences.append(f"{name}: {percent(top.value)} of mechanical effects right{wrong}")
    return f"{'. '.join(text[0].upper() + text[1:] for text in sentences)}." if sentences else "No mechanical effects."


def _provenance(result: BenchmarkResult, command: str) -> list[tuple[str, str]]:
    plan = result.request.plan
    shares = ", ".join(f"{percent(part)} {kind}" for kind, part in SHARES.items())
    return [
        ("command", command),
        ("cases", f"{plan.n_cases}, role {plan.role}, seed {plan.seed}; {shares}"),
        ("code", result.request.code + ("" if state_of_code() == result.request.code else CHANGED)),
        ("blindness", "each case is diagnosed by a new process that is given only recordings and rig files"),
        ("strength", "change between a case and its twin without the fault, measured like the whole gap"),
        ("one diagnosis", cost_lines(result)[0]),
    ]


def _confusion_picture(result: BenchmarkResult) -> Picture:
    from gearsig.plot import confusion_figure

    strong = f", faults of at least {STRONG:g} structural floors" if result.strengths_known else ""
    true, answers, counts = confusion_counts(result)
    figure = confusion_figure(true, answers, counts, title=f"Cases by true cause and answer{strong}")
    return embed(
        figure,
        "Rows: true causes, with the number of cases; entries off the diagonal are wrong answers.",
        "Table of the true cause against the likeliest cause.",
    )


def _calibration(result: BenchmarkResult) -> tuple[Picture, ...]:
    from gearsig.plot import calibration_figure

    curves = {}
    for name in (result.judged, *(b for b in BASELINES if b in result.rows and b != result.judged)):
        rows = [r for r in result.rows[name] if r.source == BLIND and is_one_answer(r)]
        bins = bins_of(*confidence_of(rows))
        ends = [share(round(b.accuracy * b.n), b.n) for b in bins]
        if bins:
            curves[name] = (
                np.array([b.confidence for b in bins]),
                np.array([b.accuracy for b in bins]),
                np.array([s.low for s in ends]),
                np.array([s.high for s in ends]),
            )
    if not curves:
        return ()
    figure = calibration_figure(curves, title="Right answers over stated probability")
    caption = (
        "Ten bins with equal numbers of cases, of every strength; answers below the dashed line are overconfident."
    )
    return (embed(figure, caption, "Share of right answers over stated probability.", vector=True),)


def _failures(result: BenchmarkResult) -> Section:
    rows = [r for r in result.rows[result.judged] if r.answer.error]
    cells = tuple((str(r.number), "same simulator" if r.source == SAME else "blind", r.answer.error) for r in rows)
    return Section("Cases without an answer", "", ("case", "made by", "reason"), cells)
