"""What comes out of a bifurcation: a table of the points, a summary of the values, the figure."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from io import StringIO
from itertools import groupby
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.bifurcation.kept import Kept
from app.bifurcation.measure import Measured, diagram_of
from gearsig.errors import RefusalError
from gearsig.phase.types import BifurcationDiagram
from sims.cracked.continuation import DECAYS, Branch
from sims.sweep_run import written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from app.bifurcation.folder import Wanted

POINTS, SUMMARY, FIGURE = "points.csv", "bifurcation.json", "bifurcation.png"
DOTS_PER_INCH = 160
NAMES = {"up": "rising", "down": "falling", "rest": "from rest"}
TRANSIENT = f"{DECAYS:g} time constants of the machine's slowest decay are left out at each value"
BOUNDED = "known at the values tried only; a range that begins or ends where the sweep does may go on beyond it"

Found = Mapping[str, Sequence[Kept]]


def write_results(wanted: Wanted, found: Found, folder: Path) -> tuple[Path, Path, Path]:
    """Write table, summary and figure; return their paths.

    Raises
    ------
    RefusalError
        If no value gave points.
    """
    figure = figure_of(wanted.branch, found)
    table = written(folder / POINTS, points_csv(wanted.branch, found))
    text = json.dumps(summary(wanted, found), indent=2, ensure_ascii=False) + "\n"
    picture = folder / FIGURE
    figure.savefig(picture, dpi=DOTS_PER_INCH)
    return picture, table, written(folder / SUMMARY, text)


def diagrams(branch: Branch, found: Found) -> dict[str, BifurcationDiagram]:
    """Return the diagram of each branch that has points."""
    with_points = {name: measured_of(kept) for name, kept in found.items()}
    return {name: diagram_of(branch, values) for name, values in with_points.items() if values}


def measured_of(kept: Sequence[Kept]) -> list[Measured]:
    """Return the values that gave points."""
    return [one.found for one in kept if one.found is not None]


def figure_of(branch: Branch, found: Found) -> Figure:
    """Draw one branch or both."""
    from gearsig.plot.bifurcation import bifurcation_figure

    drawn = list(diagrams(branch, found).values())
    if not drawn:
        reasons = [one.reason for kept in found.values() for one in kept if one.reason]
        raise RefusalError(
            f"no value gave points: {reasons[0] if reasons else 'none was run'}", remedy="change the range or settings"
        )
    preset = branch.sweep.preset
    words = f"{drawn[0].axis_name} once per {drawn[0].section} over {drawn[0].parameter_name}, {preset}"
    return bifurcation_figure(*drawn[:2], title=words)


def points_csv(branch: Branch, found: Found) -> str:
    """Return every point: branch, value of what is varied, coordinates of the path in SI units."""
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    first = next(one for kept in found.values() for one in measured_of(kept))
    axes = zip(first.section.axis_names, first.section.units, strict=True)
    table.writerow(["branch", branch.sweep.axes[0].name, *(f"{name} ({unit})" for name, unit in axes)])
    for name, kept in found.items():
        for one in measured_of(kept):
            for point in one.section.points:
                table.writerow([name, f"{one.value:.12g}", *(f"{x:.9g}" for x in point)])
    return text.getvalue()


def summary(wanted: Wanted, found: Found) -> dict[str, Any]:
    """Return the values of each branch, and where branches are apart."""
    from gearsig.phase.bifurcation import values_apart
    from gearsig.phase.coexistence import coexistence_ranges, step_of

    drawn = diagrams(wanted.branch, found)
    result: dict[str, Any] = {
        "definition": wanted.definition(),
        "transient": TRANSIENT,
        "branches": {name: [_row(one) for one in kept] for name, kept in found.items()},
    }
    if {"up", "down"} <= drawn.keys():
        up, down = drawn["up"], drawn["down"]
        result["coexisting_at"] = values_apart(up, down).tolist()
        result["coexisting_ranges"] = [asdict(one) for one in coexistence_ranges(up, down)]
        result["coexisting_step"] = step_of(up, down)
        result["coexisting_note"] = BOUNDED
    return result


def coexistence_lines(result: Mapping[str, Any], unit: str) -> list[str]:
    """Return in words where two motions coexist, from a summary; empty where they do nowhere."""
    ranges = result.get("coexisting_ranges", [])
    if not ranges:
        return []
    seen = ", ".join(_range_text(one["first"], one["last"]) for one in ranges)
    step = f"{result['coexisting_step']:g} {unit}".strip()
    return [f"Two motions coexist at {seen} {unit}".rstrip() + f"; values tried are {step} apart.", f"  ({BOUNDED})"]


def motion_lines(kept: Sequence[Kept], unit: str) -> list[str]:
    """Return the kind of motion over ranges of neighbouring values; empty where it was not looked for."""
    lines: list[str] = []
    for motion, group in groupby((one for one in measured_of(kept) if one.motion), key=lambda one: one.motion):
        values = list(group)
        text = f"{_range_text(values[0].value, values[-1].value)} {unit}".rstrip() + f": {motion}"
        exponents = [one.exponent_per_s for one in values if isfinite(one.exponent_per_s)]
        tests = [one.k for one in values if isfinite(one.k)]
        more = [
            *([f"K {_range_text(min(tests), max(tests), '.2f')}"] if tests else []),
            *([f"exponent {_range_text(min(exponents), max(exponents), '.3g')} 1/s"] if exponents else []),
        ]
        lines.append(text + (f" ({', '.join(more)})" if more else ""))
    return lines


def _range_text(low: float, high: float, form: str = "g") -> str:
    first, last = format(low, form), format(high, form)
    return first if first == last else f"{first} to {last}"


def _row(kept: Kept) -> dict[str, Any]:
    one = kept.found
    if one is None:
        return {"value": kept.value, "reason": kept.reason}
    row: dict[str, Any] = {
        "value": one.value,
        "period_cycles": one.period,
        "n_points": one.section.n_points,
        "std": float(one.section.extent[0]),
        "lowest": float(one.section.points[:, 0].min()),
        "highest": float(one.section.points[:, 0].max()),
        "separated_share": round(one.separated_share, 4),
        "settled_s": one.settled_s,
    }
    if one.motion:
        row["motion"] = one.motion
        row["lyapunov_exponent_per_s"] = one.exponent_per_s if isfinite(one.exponent_per_s) else None
        row["zero_one_k"] = one.k if isfinite(one.k) else None
    return row
