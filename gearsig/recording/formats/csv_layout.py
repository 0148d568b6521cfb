"""How a text file of numbers is laid out: separator, decimal sign, header, first line of numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice

from gearsig.errors import InputError
from gearsig.recording.names import is_unit, rate_in_line

SNIFF_BYTES = 1 << 18
N_PROOF_LINES = 5
"""So many lines in a row must be numbers of equal count before they are taken for the table."""

# Tried in this order; the first that reads most columns wins. The comma is last among the separators because it is
# also a decimal sign: "1,5;2,7" must not become three columns of text.
CANDIDATES = (("\t", "."), (";", "."), ("\t", ","), (";", ","), (",", "."), (" ", "."), (" ", ","))
COMMENT_SIGNS = ("#", "%", "//")

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\Z|[+-]?(?:nan|inf|infinity)\Z", re.IGNORECASE)


@dataclass(frozen=True)
class CsvLayout:
    """Where the table starts and how its lines are split.

    Parameters
    ----------
    separator, decimal : str
        The separator " " stands for any run of blanks.
    n_columns : int
    trailing_separator : bool
        Whether each line ends with a separator that begins no column.
    header, units : tuple of str
        One text per column, or nothing.
    preamble : tuple of str
        Lines above the table that are not its header.
    first_line : int
        Number of the first line of numbers, from 1.
    offset : int
        Bytes before that line.
    bytes_per_line : float
        Mean over the lines that were looked at.
    """

    separator: str
    decimal: str
    n_columns: int
    trailing_separator: bool
    header: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]
    first_line: int
    offset: int
    bytes_per_line: float


def is_number(text: str, decimal: str) -> bool:
    """Whether a field is a number with this decimal sign; blanks around it do not matter."""
    field = text.strip(" \t\r")
    if decimal == ",":
        if "." in field:
            return False
        field = field.replace(",", ".")
    return _NUMBER.match(field) is not None


def split(line: str, separator: str) -> list[str]:
    """Split one line; quotes are respected only where there are any."""
    if separator == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return line.split(separator)


def find_layout(data: bytes, where: str) -> CsvLayout:
    """Return the layout of a text file from its first lines.

    Raises
    ------
    InputError
        If no line of numbers is found.
    """
    lines = _first_lines(data)
    texts = [line.decode("utf-8", errors="replace").strip("\r\n") for line in lines]
    texts[0] = texts[0].removeprefix("\ufeff")
    start, separator, decimal = _table_start(texts, where)
    fields = split(texts[start], separator)
    trailing = len(fields) > 1 and fields[-1].strip() == "" and separator != " "
    n_columns = len(fields) - trailing
    header, units, preamble = _header(texts[:start], separator, n_columns)
    table = lines[start:]
    return CsvLayout(
        separator,
        decimal,
        n_columns,
        trailing,
        header,
        units,
        preamble,
        first_line=start + 1,
        offset=sum(len(line) for line in lines[:start]),
        bytes_per_line=sum(len(line) for line in table) / len(table),
    )


def own_layout(data: bytes) -> CsvLayout:
    """Return the layout that gearsig itself writes: a description, a header, then the numbers."""
    header_at = data.find(b"\n") + 1
    offset = data.find(b"\n", header_at) + 1
    end = data.find(b"\n", offset)
    first = data[offset : end if end > 0 else len(data)]
    description = data[: header_at - 1].decode("utf-8", errors="replace")
    n_columns = first.count(b",") + 1
    return CsvLayout(",", ".", n_columns, False, (), (), (description,), 3, offset, len(first) + 1.0)


def _first_lines(data: bytes) -> list[bytes]:
    """Return the complete lines at the beginning, or all if the file is short."""
    lines = data[:SNIFF_BYTES].splitlines(keepends=True)
    if len(data) > SNIFF_BYTES and len(lines) > 1:
        lines.pop()
    return lines


def _table_start(texts: list[str], where: str) -> tuple[int, str, str]:
    """Return the first line of numbers with the separator and decimal sign that read most columns there."""
    for start, text in enumerate(texts):
        if not text.strip() or not any(c.isdigit() for c in text):
            continue
        proof = list(islice((t for t in texts[start:] if t.strip()), N_PROOF_LINES))
        counts = [_n_columns(proof, separator, decimal) for separator, decimal in CANDIDATES]
        if max(counts) > 0:
            return (start, *CANDIDATES[counts.index(max(counts))])
    _raise_no_table(texts, where)
    raise AssertionError  # for the type checker: the line above always raises


def _n_columns(proof: list[str], separator: str, decimal: str) -> int:
    """Return how many columns of numbers all lines have, 0 if they do not agree or hold something else.

    The last line may be cut off, and a single bad field further down is reported later with its line: only the first
    line must be clean, and the others must have as many fields for the most part.
    """
    rows = [split(line, separator) for line in proof]
    if rows[0][-1].strip() == "" and len(rows[0]) > 1:
        rows = [row[:-1] if row and row[-1].strip() == "" else row for row in rows]
    if not all(is_number(field, decimal) for field in rows[0]):
        return 0
    same = sum(len(row) == len(rows[0]) for row in rows)
    return len(rows[0]) if 2 * same > len(rows) else 0


def _header(
    above: list[str], separator: str, n_columns: int
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return names, units and the remaining lines above the table."""
    filled = [text for text in above if text.strip()]
    found: list[tuple[str, ...]] = []
    for text in reversed(filled[-2:]):
        fields = _header_fields(text, separator, n_columns)
        if fields is None:
            break
        found.append(fields)
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    if len(found) == 2 and _all_units(found[0]):
        units, names = found[0], found[1]
        filled = filled[:-2]
    elif found:
        names = found[0]
        filled = filled[:-1]
    return names, units, tuple(filled)


def _header_fields(text: str, separator: str, n_columns: int) -> tuple[str, ...] | None:
    """Return a line's fields if it can be the header of so many columns."""
    if rate_in_line(text) is not None:
        return None
    for sign in COMMENT_SIGNS:
        text = text.strip().removeprefix(sign)
    if n_columns == 1:
        field = text.strip().strip('"')
        return (field,) if field and "=" not in field and ":" not in field else None
    attempts = [split(text, separator)]
    if separator == " ":  # names with their unit in brackets, or separated by tabs or two blanks
        attempts += [re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", text), re.split(r"\s{2,}|\t", text.strip())]
    for fields in attempts:
        cleaned = tuple(field.strip() for field in fields)
        if len(cleaned) == n_columns + 1 and cleaned[-1] == "":
            cleaned = cleaned[:-1]
        if len(cleaned) == n_columns and any(cleaned) and "=" not in cleaned:
            return cleaned
    return None


def _all_units(fields: Iterable[str]) -> bool:
    """Whether a row consists of units, in brackets or known; empty fields and "-" are units of plain numbers."""
    words = [field for field in fields if field not in ("", "-")]
    bracketed = [word[:1] + word[-1:] in ("[]", "()") for word in words]
    return bool(words) and all(b or is_unit(word) for b, word in zip(bracketed, words, strict=True))


def _raise_no_table(texts: list[str], where: str) -> None:
    last = next((i for i in range(len(texts) - 1, -1, -1) if texts[i].strip()), 0)
    shown = texts[last][:60] if texts else ""
    remedy = "the file was cut off after its header, or it holds something else"
    if re.search(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d:\d\d", shown):
        remedy = "date and time are not read: replace that column by seconds, or remove it and give --fs"
    raise InputError(
        f"no line of numbers was found; line {last + 1} begins {shown!r}",
        where=where,
        allowed="columns of numbers separated by comma, semicolon, tab or blanks",
        remedy=remedy,
    )
