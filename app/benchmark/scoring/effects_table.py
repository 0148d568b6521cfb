"""Per effect and per level; and what was taken for what, with what both have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from app.benchmark.plan import BLIND
from app.benchmark.scoring.judged import Row
from app.benchmark.scoring.strata import Result
from app.benchmark.scoring.strength import STRONG
from app.benchmark.scoring.table import Table
from gearsig.gap.types import NONE, UNKNOWN
from sims.blind import CATALOGUE, OUTSIDE

LEVELS = (("weak", 0.0, 1 / 3), ("middle", 1 / 3, 2 / 3), ("strong", 2 / 3, 1.01))
MOST_CONFUSIONS = 12


def effects_table(result: Result) -> Table:
    """Return, for each effect, how often the likeliest cause was right, by level, strength and reference."""
    rows = [r for r in result.rows[result.judged] if r.source == BLIND]
    table = [_effect_row(name, [r for r in rows if r.kind == "single" and r.effects == (name,)]) for name in CATALOGUE]
    table += [_effect_row(name, [r for r in rows if r.kind == "unknown" and r.effects == (name,)]) for name in OUTSIDE]
    header = (
        "effect",
        *(name for name, *_ in LEVELS),
        f"≥ {STRONG:g} floors, without",
        "with reference",
        "strength",
        "most often taken for",
    )
    note = (
        "Likeliest cause right, of so many: in the weak, middle and strong third of the effect's span, and from "
        f"{STRONG:g} structural floors on. Strength: the middle, in structural floors. For effects outside the "
        "catalogue “unknown” is right."
    )
    return Table("Effect by effect", note, header, tuple(row for row in table if row))


def _effect_row(name: str, rows: Sequence[Row]) -> tuple[str, ...]:
    if not rows:
        return ()
    strong = [r for r in rows if r.strength >= STRONG]
    wrong = Counter(r.first or "no answer" for r in rows if r.first not in r.truths).most_common(1)
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
    return f"{sum(r.first in r.truths for r in rows)} of {len(rows)}" if rows else "–"


def confusions_table(result: Result) -> Table:
    """Return the commonest wrong answers, and in which kinds of features both effects show."""
    rows = [r for r in result.rows[result.judged] if r.source == BLIND and r.kind != "pair"]
    if result.strengths_known:
        rows = [r for r in rows if r.kind == "none" or r.strength >= STRONG]
    found = Counter(
        (r.truths[0] if r.kind != "unknown" else r.effects[0], r.first) for r in rows if r.first not in r.truths
    )
    table = [(true, said or "no answer", str(n), _common(true, said)) for (true, said), n in found.most_common()]
    return Table(
        "What was taken for what",
        "In common: kinds of features in which theory expects both.",
        ("it was", "said", "cases", "in common"),
        tuple(table[:MOST_CONFUSIONS]),
    )


def _common(true: str, said: str) -> str:
    from sims.effects import effects

    if said == NONE:
        return "too weak to stand out of the floor"
    if true in OUTSIDE:
        return "made to be mistaken for it" if OUTSIDE[true].resembles == said else ""
    known = effects()
    if true in known and said in known:
        return ", ".join(kind.replace("_", " ") for kind in known[true].shows_in if kind in known[said].shows_in)
    return "not explained well enough" if said == UNKNOWN else ""


def confusion_counts(result: Result) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray]:
    """Return what it was, what was said, and the counts, (n_true, n_said), of blind cases with one right answer."""
    rows = [r for r in result.rows[result.judged] if r.source == BLIND and r.kind != "pair"]
    if result.strengths_known:
        rows = [r for r in rows if r.kind == "none" or r.strength >= STRONG]
    true = (*CATALOGUE, NONE, UNKNOWN)
    said = (*true, "no answer") if any(not r.first for r in rows) else true
    counts = np.zeros((len(true), len(said)), dtype=np.int64)
    for row in rows:
        counts[true.index(row.truths[0]), said.index(row.first or "no answer")] += 1
    return true, said, counts
