"""Result tables: the README's in Markdown, the same cells for the page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

from app.benchmark.diagnosers import BASELINES
from app.benchmark.plan import BLIND, SAME
from app.benchmark.scoring.intervals import Score
from app.benchmark.scoring.scores import FIGURES, Figure, judgement
from app.benchmark.scoring.strata import WITH, WITHOUT, Result
from app.benchmark.scoring.strength import STRONG
from gearsig import __version__

NO_CASES = "–"
"""A cell without a case."""


@dataclass(frozen=True)
class Table:
    """Cells of a table.

    Parameters
    ----------
    title, note : str
    header : tuple of str
    rows : tuple of tuple of str
    """

    title: str
    note: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def main_table(result: Result) -> Table:
    """Return the figures that have targets or matter beside them, with and without reference."""
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
    return Table("Against the targets", _basis(result), header, tuple(rows))


def same_table(result: Result) -> Table | None:
    """Return the figures of the diagnosing simulator's own cases and the drop from them; None if there are none."""
    if not result.wanted.plan.same_simulator:
        return None
    rows = []
    for figure in FIGURES:
        row = [figure.title]
        for name in (WITHOUT, WITH):
            same, blind = (result.part(name, source=source).scores[figure.key] for source in (SAME, BLIND))
            row += [cell(figure, same), _drop(figure, same, blind)]
        if any(text != NO_CASES for text in row[1::2]):
            rows.append(tuple(row))
    note = "The same plan of cases, made by the diagnosing simulator; drop: from there to the independent rig."
    return Table("Same simulator", note, ("", WITHOUT, "drop", WITH, "drop"), tuple(rows))


def beside_table(result: Result) -> Table:
    """Return the same figures of the diagnosers beside, on the very same cases."""
    names = result.wanted.diagnosers
    header = ["", *(f"{name}, {part}" for name in names for part in ("without", "with"))]
    rows = []
    for figure in FIGURES:
        found = [result.part(part, diagnoser=name).scores[figure.key] for name in names for part in (WITHOUT, WITH)]
        if any(score.n for score in found):
            rows.append((figure.title, *(cell(figure, score, with_n=False) for score in found)))
    words = {"majority": "majority: always the commonest answer", "rules": "rules: a table of textbook signatures"}
    note = "; ".join(words[name] for name in BASELINES if name in names)
    return Table(
        "Beside other diagnosers",
        f"On the same cases, without and with reference. {note.capitalize()}.",
        tuple(header),
        tuple(rows),
    )


def parts_table(result: Result) -> Table:
    """Return the figures of one and two conditions, and of faults of every strength."""
    columns = [
        *((name, None) for name in ("one condition", "two conditions")),
        *((name, False) for name in (WITHOUT, WITH)),
    ]
    header = ["", "one condition", "two conditions", "every strength, without", "with reference"]
    rows = []
    for figure in FIGURES:
        found = [result.part(name, strong=strong).scores[figure.key] for name, strong in columns]
        if any(score.n for score in found):
            rows.append((figure.title, *(cell(figure, score) for score in found)))
    return Table("By conditions, and with weak faults", "", tuple(header), tuple(rows))


def cell(figure: Figure, score: Score, *, with_n: bool = True) -> str:
    """Return value, interval and number of cases."""
    if not score.n:
        return NO_CASES
    n = f" of {score.n}" if with_n else ""
    if figure.is_share:
        return f"{100 * score.value:.0f} % ({100 * score.low:.0f}–{100 * score.high:.0f}){n}"
    return f"{score.value:.2f} ({score.low:.2f}–{score.high:.2f}){n}".replace("-", "−")


def target_cell(figure: Figure, score: Score, column: int) -> str:
    """Return the target and whether it is met."""
    if figure.targets is None:
        return ""
    target = figure.targets[column]
    sign = "≥" if figure.is_least else "≤"
    text = f"{sign} {100 * target:.0f} %" if figure.is_share else f"{sign} {target:.2f}"
    verdict = judgement(score, target, is_least=figure.is_least)
    return f"{text}: {verdict}" if verdict else text


def _drop(figure: Figure, same: Score, blind: Score) -> str:
    if not same.n or not blind.n:
        return NO_CASES
    drop = blind.value - same.value
    text = f"{100 * drop:+.0f} points" if figure.is_share else f"{drop:+.2f}"
    return text.replace("-", "−")


def _basis(result: Result) -> str:
    if result.strengths_known:
        return (
            f"Faults of at least {STRONG:g} structural floors, and all healthy cases; value (90 % interval) of "
            "so many cases; open: the interval holds the target."
        )
    return (
        "Faults of every strength, as there are too few healthy cases for a floor; value (90 % interval) of so many "
        "cases."
    )


def markdown(result: Result, command: str, date: datetime) -> str:
    """Return the tables for a README, with date, version and command."""
    plan = result.wanted.plan
    text = [
        f"{plan.n_cases} blind cases, {plan.role}; gearsig {__version__}, {date:%d %B %Y}; `{command}`.",
        "",
        *_table(main_table(result)),
        "",
        *(_table(same) if (same := same_table(result)) is not None else ()),
        "",
        *_table(beside_table(result)),
        "",
        *cost_lines(result),
    ]
    return "\n".join(text) + "\n"


def _table(table: Table) -> Iterator[str]:
    yield f"**{table.title}.** {table.note}"
    yield ""
    yield "| " + " | ".join(table.header) + " |"
    yield "|" + "---|" * len(table.header)
    for row in table.rows:
        yield "| " + " | ".join(row) + " |"


def cost_lines(result: Result) -> list[str]:
    """Return what a diagnosis took, and the calibration error that chance alone would give."""
    import numpy as np

    answers = [row.answer for row in result.rows[result.judged]]
    wall = np.array([a.seconds for a in answers])
    cpu = np.array([a.cpu_seconds for a in answers])
    took = (
        f"One diagnosis took {np.median(wall):.1f} s (middle; longest {wall.max():.1f} s), "
        f"{np.median(cpu):.1f} s of one processor's time (longest {cpu.max():.1f} s)."
    )
    chance = (
        "With so many cases, probabilities that are exactly true would show a calibration error of "
        f"{result.chance_error:.2f}."
    )
    return [took, chance]
