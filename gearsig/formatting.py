"""Numbers and names formatted for people and for JSON."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from datetime import datetime
from io import StringIO
from math import floor, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from pandas import DataFrame

N_DIGITS = 9
"""Significant digits in JSON: more than any measurement has, but without rounding noise."""


def file_label(path: str | Path, *, whole: bool = False) -> str:
    r"""Return a file's name, or its whole path, as text; bytes that are not UTF-8 become "?".

    Examples
    --------
    >>> file_label("runs/monday\udcff.csv")
    'monday?.csv'
    """
    return (str(path) if whole else Path(path).name).encode("utf-8", "replace").decode()


Cell = TypeVar("Cell")


def spreadsheet_cell(value: Cell) -> Cell | str:
    """Return a table value; text that a spreadsheet would run as a formula is prefixed with a quote.

    Examples
    --------
    >>> spreadsheet_cell("=1+1"), spreadsheet_cell("a1"), spreadsheet_cell(-2.0)
    ("'=1+1", 'a1', -2.0)
    """
    is_formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{value}" if is_formula else value


def csv_rows(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV, with cells unchanged."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, one line per row.

    Examples
    --------
    >>> print(markdown_table(["n", "time"], [["1", "2 s"]]), end="")
    | n | time |
    |---|---|
    | 1 | 2 s |
    """
    lines = ["|" + "---|" * len(header), *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join([f"| {' | '.join(header)} |", *lines, ""])


def csv_text(table: DataFrame) -> str:
    """Return a table as CSV, with texts made safe by `spreadsheet_cell`."""
    texts = table.select_dtypes(exclude="number").columns
    safe = table.assign(**{name: table[name].map(spreadsheet_cell) for name in texts})
    return str(safe.to_csv(index=False))


def rounded(value: float, n_digits: int = N_DIGITS) -> float | None:
    """Return `value` rounded to `n_digits` significant digits; None for nan and infinity, which JSON lacks.

    Examples
    --------
    >>> rounded(0.1 + 0.2), rounded(float("nan")), rounded(1999.7612345678)
    (0.3, None, 1999.76123)
    """
    number = float(value)
    return float(f"{number:.{n_digits}g}") if isfinite(number) else None


def readable(value: float, n_digits: int = 4) -> str:
    """Format a number with `n_digits` significant digits; nan is an en dash.

    Examples
    --------
    >>> readable(1999.7612, 6), readable(0.000012345), readable(float("nan")), readable(-1234567)
    ('1999.76', '1.234e-05', '–', '−1.235e+06')
    """
    number = float(value)
    if not isfinite(number):
        return "–" if number != number else ("∞" if number > 0 else "−∞")  # noqa: PLR0124 - nan alone differs from itself
    if number == 0:
        return "0"
    power = floor(log10(abs(number)))
    text = f"{number:.{n_digits - 1}e}" if power < -4 or power > 5 else f"{number:.{max(0, n_digits - 1 - power)}f}"
    if "." in text and "e" not in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−", 1) if text.startswith("-") else text


def seconds_text(seconds: float) -> str:
    """Format a time in s, ms or µs, whichever gives a readable number.

    Examples
    --------
    >>> seconds_text(7.8125e-05), seconds_text(0.0032), seconds_text(0.3), seconds_text(0.0)
    ('78.12 µs', '3.2 ms', '0.3 s', '0 s')
    """
    size = abs(seconds)
    scale, unit = (1.0, "s") if size >= 0.1 or size == 0.0 else (1e3, "ms") if size >= 1e-3 else (1e6, "µs")
    return f"{readable(scale * seconds, 4)} {unit}"


def power_of_ten(value: float) -> str:
    """Format a small positive number as one digit and a power of ten.

    Examples
    --------
    >>> power_of_ten(3.2e-4), power_of_ten(3e-11)
    ('3 × 10⁻⁴', '3 × 10⁻¹¹')
    """
    if not isfinite(value) or value == 0.0:
        return readable(value)
    digit, power = f"{value:.0e}".split("e")
    return f"{digit} × {unit_text(f'10^{int(power)}')}"


def signed(value: float, n_decimals: int = 1) -> str:
    """Format a change with its sign, which is left out if it rounds to zero.

    Examples
    --------
    >>> signed(14.23), signed(-3.0), signed(-0.04), signed(float("nan"))
    ('+14.2', '−3.0', '0.0', '–')
    """
    if not isfinite(value):
        return "–"
    rounded = round(value, n_decimals) + 0.0
    return f"{rounded:+.{n_decimals}f}".replace("-", "−") if rounded else f"{0.0:.{n_decimals}f}"


def decimals_for(scatter: float, n_decimals: int = 1) -> int:
    """Return the number of decimals for a value and its scatter: one more if the scatter would round to zero.

    Examples
    --------
    >>> decimals_for(0.2), decimals_for(0.04), decimals_for(0.0004, 3)
    (1, 2, 4)
    """
    return n_decimals if scatter >= 0.5 * 10.0**-n_decimals else n_decimals + 1


def scatter_text(scatter: float, n_decimals: int = 1) -> str:
    """Format a scatter; it is never shown as zero.

    Examples
    --------
    >>> scatter_text(0.23), scatter_text(0.04), scatter_text(0.001)
    ('0.2', '0.04', '<0.01')
    """
    n = decimals_for(scatter, n_decimals)
    return f"{scatter:.{n}f}" if scatter >= 0.5 * 10.0**-n else f"<{10.0**-n:.{n}f}"


def plus_minus(value: float, scatter: float, n_decimals: int = 1, *, with_sign: bool = False) -> str:
    """Format a value with its scatter, both to the same number of decimals.

    Examples
    --------
    >>> plus_minus(0.99479, 0.0014, 3), plus_minus(98.83, 0.03), plus_minus(-0.04, 0.02, with_sign=True)
    ('0.995 ± 0.001', '98.83 ± 0.03', '−0.04 ± 0.02')
    """
    n = decimals_for(scatter, n_decimals)
    text = signed(value, n) if with_sign else with_minus(f"{round(value, n) + 0.0:.{n}f}")
    return f"{text} ± {scatter_text(scatter, n_decimals)}"


def percent(share: float) -> str:
    """Format a fraction in percent; positive values below 1 % are "< 1 %".

    Examples
    --------
    >>> percent(0.884), percent(0.003), percent(0.0), percent(float("nan")), percent(-0.1), percent(-0.001)
    ('88 %', '< 1 %', '0 %', '–', '−10 %', '0 %')
    """
    if not isfinite(share):
        return "–"
    return "< 1 %" if 0 < share < 0.01 else f"{round(100 * share)} %".replace("-", "−")


def odds_text(probability: float) -> str:
    """Format a probability in percent, at most "> 99 %".

    Examples
    --------
    >>> odds_text(0.664), odds_text(0.998), odds_text(0.003)
    ('66 %', '> 99 %', '< 1 %')
    """
    return "> 99 %" if probability > 0.99 else percent(probability)


def enumerated(names: Sequence[str], conjunction: str = "and") -> str:
    """Join names as in a sentence.

    Examples
    --------
    >>> enumerated(["input"]), enumerated(["input", "middle", "output"]), enumerated(["gear", "shaft"], "or")
    ('input', 'input, middle and output', 'gear or shaft')
    """
    *first, last = names
    return f"{', '.join(first)} {conjunction} {last}" if first else last


def counted(n: int, noun: str) -> str:
    """Return a number with its noun, in the plural unless the number is 1.

    Examples
    --------
    >>> counted(1, "recording"), counted(0, "recording")
    ('1 recording', '0 recordings')
    """
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def sentence(text: str) -> str:
    """Return a note as a sentence: with a full stop and, unless it begins with a name, a capital letter.

    Examples
    --------
    >>> sentence("the file states 1796 rpm"), sentence("fs = 5 may be a speed"), sentence("Are these runs?")
    ('The file states 1796 rpm.', 'fs = 5 may be a speed.', 'Are these runs?')
    """
    begun = text[:1].upper() + text[1:] if re.match(r"[a-z]+ (?!=)", text) else text
    return begun if begun.endswith((".", "?", "!")) else f"{begun}."


def with_minus(text: str) -> str:
    """Replace the hyphens of negative numbers in a text by minus signs.

    Examples
    --------
    >>> with_minus("-54.4 to -10.2 dB by a 2-stage gearbox")
    '−54.4 to −10.2 dB by a 2-stage gearbox'
    """
    return re.sub(r"(?<![\w.])-(?=\d)", "−", text)


_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def unit_text(unit: str) -> str:
    """Format a unit with superscripts.

    Examples
    --------
    >>> unit_text("(m/s^2)^2/Hz")
    '(m/s²)²/Hz'
    """
    parts = unit.split("^")
    text = parts[0]
    for part in parts[1:]:
        digits = len(part) - len(part.lstrip("-0123456789"))
        text += part[:digits].translate(_SUPERSCRIPTS) + part[digits:] if digits else "^" + part
    return text


def axis_unit(axis: str) -> str:
    """Return the unit of an axis of frequencies, orders or quefrencies.

    Examples
    --------
    >>> axis_unit("frequency"), axis_unit("order"), axis_unit("quefrency")
    ('Hz', 'orders', 's')
    """
    return {"frequency": "Hz", "order": "orders", "quefrency": "s"}[axis]


def axis_label(axis: str, shaft: str) -> str:
    """Return the label of an axis of frequencies, orders (cycles per revolution of a shaft) or quefrencies."""
    return {"order": f"order of {shaft or 'the shaft'}", "quefrency": "quefrency (s)"}.get(axis, "frequency (Hz)")


def position_text(axis: str, position: float, n_digits: int = 7) -> str:
    """Format a position on an axis.

    Examples
    --------
    >>> position_text("order", 1.5), position_text("frequency", 50.0)
    ('order 1.5', '50 Hz')
    """
    text = f"{position:.{n_digits}g}"
    return f"order {text}" if axis == "order" else f"{text} {axis_unit(axis)}"


def named(what: str, name: str) -> str:
    """Return a name preceded by its kind, unless the name contains it; empty for an empty name."""
    return name if not name or what.rsplit(maxsplit=1)[-1] in name.lower() else f"{what} {name}"


def moment_text(moment: datetime) -> str:
    """Format a date, with the time of day unless it is midnight, as when a file name states only the day.

    Examples
    --------
    >>> moment_text(datetime(2026, 1, 31, 14, 5)), moment_text(datetime(2026, 1, 31))
    ('2026-01-31 14:05', '2026-01-31')
    """
    return f"{moment:%Y-%m-%d %H:%M}".removesuffix(" 00:00")
