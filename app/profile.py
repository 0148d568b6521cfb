"""Speed or torque over time as people type it: a number, a span, or a file of points."""

from __future__ import annotations

import csv
from math import isfinite
from pathlib import Path

import typer

from app.quantities import quantity, span
from gearsig.errors import InputError
from sims.machine.operation import Course

MOST_BYTES = 50_000_000


def course(text: str, name: str, unit: str, duration_s: float) -> Course:
    """Return a course from "500rpm", "300..1500rpm" (in a straight line over the duration) or a CSV file.

    Parameters
    ----------
    text : str
    name : str
        The column's, with its unit: "speed_rpm".
    unit : str
    duration_s : float
    """
    if text.strip().lower().endswith(".csv"):
        found = read_course(Path(text.strip()), name)
        for held in _held(found, duration_s):
            typer.echo(f"Note: {Path(text.strip()).name}: {held}", err=True)
        return found
    if ".." in text:
        return Course.of([0.0, duration_s], span(text, unit, name))
    return Course.constant(quantity(text, unit, name))


def _held(found: Course, duration_s: float) -> list[str]:
    """Return what is said of a profile that does not span the recording."""
    first_s, last_s = float(found.times_s[0]), float(found.times_s[-1])
    begins = f"begins at {first_s:g} s; its first value is held from 0 s"
    ends = f"ends at {last_s:g} s of {duration_s:g} s; its last value is held"
    return [begins] * (first_s > 0.0) + [ends] * (last_s < duration_s)


def read_course(path: Path, name: str) -> Course:
    """Read a course from a CSV file with the columns time_s and `name`."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError("is too long for a profile", where=path.name, allowed="up to 50 MB")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [(n, row) for n, row in enumerate(csv.reader(file), 1) if any(cell.strip() for cell in row)]
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError("is not a CSV text in UTF-8", where=path.name) from None
    titles = [cell.strip() for cell in rows[0][1]] if rows else []
    if titles != ["time_s", name] or len(rows) < 2:
        raise InputError(
            f"starts with {', '.join(titles) or 'nothing'}" if titles != ["time_s", name] else "holds no points",
            where=path.name,
            allowed=f"a line 'time_s,{name}' and a line for each point",
        )
    points = [_point(row, f"{path.name}: line {number}") for number, row in rows[1:]]
    try:
        return Course.of([p[0] for p in points], [p[1] for p in points])
    except InputError as error:
        raise InputError(error.what, where=path.name, allowed=error.allowed) from None


def _point(row: list[str], where: str) -> tuple[float, float]:
    try:
        time_s, value = (float(cell) for cell in row)
    except ValueError:
        raise InputError(f"holds {', '.join(row)[:60]!r}", where=where, allowed="two numbers") from None
    if not (isfinite(time_s) and isfinite(value)):
        raise InputError(f"holds {', '.join(row)[:60]!r}", where=where, allowed="finite numbers")
    return time_s, value
