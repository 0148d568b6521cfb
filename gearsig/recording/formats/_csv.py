"""Text files of numbers: CSV, TSV, semicolons, blanks, decimal comma, gzip."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.recording._limits import check_memory, read_text_bytes
from gearsig.recording._table import RawColumn, RawTable, ask_whether_runs, without_clock
from gearsig.recording._types import Recording, is_unit, plain_name, rate_in_line, split_unit
from gearsig.recording.formats._format import OWN_TEXT_MARK, FileFormat, metadata_json, table_from_metadata

# --------------------
# How a text file of numbers is laid out: separator, decimal sign, header, first line of numbers.
# --------------------


SNIFF_BYTES = 1 << 18
N_PROOF_LINES = 5
"""So many lines in a row must be numbers of equal count before they are taken for the table."""

# Tried in this order; the first that reads most columns wins. The comma is last among the separators because it is
# also a decimal sign: "1,5;2,7" must not become three columns of text.
CANDIDATES = (("\t", "."), (";", "."), ("\t", ","), (";", ","), (",", "."), (" ", "."), (" ", ","))
MAX_LINES_ABOVE = 2000
"""More lines than that are no header of a table."""
COMMENT_SIGNS = ("#", "%", "//")

# Possessive: digits that no number ends are looked at once.
_NUMBER = re.compile(r"[+-]?(?:\d++\.?\d*+|\.\d++)(?:e[+-]?\d++)?\Z|[+-]?(?:nan|inf|infinity)\Z", re.IGNORECASE)
_DATE_TIME = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}[T ][0-9]{2}:[0-9]{2}:[0-9]{2}(?:\.[0-9]{1,9})?(Z|[+-][0-9]{2}(?::?[0-9]{2})?)?\Z"
)
DATE_TIME_EXAMPLES = "2026-01-31T12:00:00.0001 or 2026-01-31 12:00:00.0001Z"
"""Of what is read as date and time, ISO 8601."""


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
    date_times : str
        Of the first column: "local" or "zoned" where it holds dates and times (ISO 8601) without or with an offset from
        UTC, empty where it holds numbers.
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
    date_times: str = ""


def is_number(text: str, decimal: str) -> bool:
    """Whether a field is a number with this decimal sign; blanks around it do not matter."""
    field = text.strip(" \t\r")
    if decimal == ",":
        if "." in field:
            return False
        field = field.replace(",", ".")
    return _NUMBER.match(field) is not None


def date_time_kind(text: str) -> str:
    """Return "zoned" for date and time with an offset from UTC, "local" for those without, and nothing for other text.

    Examples
    --------
    >>> [date_time_kind(text) for text in ("2026-01-31T12:00:00.5Z", "2026-01-31 12:00:00", "2026-02-30 12:00:00")]
    ['zoned', 'local', '']
    """
    from pyarrow import ArrowInvalid

    kind = _date_time_form(text)
    try:
        _seconds_from_first([text.strip(" \t\r")] if kind else [], kind)
    except ArrowInvalid:  # a 30th of February
        return ""
    return kind


def _date_time_form(text: str) -> str:
    """Return what `date_time_kind` does, whether or not there is such a day and time."""
    match = _DATE_TIME.match(text.strip(" \t\r"))
    return "" if match is None else "zoned" if match[1] else "local"


def _seconds_from_first(date_times: Any, kind: str) -> FloatArray:
    """Return dates and times, as texts or as Arrow's, in seconds from the first: exact to a nanosecond over days."""
    import pyarrow as pa

    if isinstance(date_times, list):
        date_times = pa.array(date_times, pa.string()).cast(_arrow_type(kind))
    whole, rest_ns = np.divmod(date_times.cast(pa.int64()).to_numpy(zero_copy_only=False), 10**9)
    seconds: FloatArray = (whole - whole[:1]) + (rest_ns - rest_ns[:1]) / 1e9
    return seconds


def _arrow_type(kind: str) -> Any:
    import pyarrow as pa

    return pa.timestamp("ns", "UTC" if kind == "zoned" else None)


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
        date_times=date_time_kind(fields[0]),
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
    for start, text in enumerate(texts[:MAX_LINES_ABOVE]):
        if not text.strip() or not any(c.isdigit() for c in text):
            continue
        proof = list(islice((t for t in islice(texts, start, None) if t.strip()), N_PROOF_LINES))
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
    first, *others = rows[0]
    kind = date_time_kind(first) if others else ""
    if not all(is_number(field, decimal) for field in (others if kind else rows[0])):
        return 0
    same = sum(len(row) == len(rows[0]) and (not kind or date_time_kind(row[0]) == kind) for row in rows)
    return len(rows[0]) if 2 * same > len(rows) else 0


def _header(
    above: list[str], separator: str, n_columns: int
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return names, units and the remaining lines above the table."""
    filled = [text for text in above if text.strip()]
    rows: list[tuple[str, ...]] = []
    for text in reversed(filled[-2:]):
        fields = _header_fields(text, separator, n_columns)
        if fields is None:
            break
        rows.append(fields)
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    if len(rows) == 2 and _all_units(rows[0]):
        units, names = rows[0], rows[1]
        filled = filled[:-2]
    elif rows:
        names = rows[0]
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
        attempts += [
            re.findall(r"[^\s\[(]++(?:\s*+[\[(][^\])\[(]*+[\])])?", text),
            re.split(r"\s{2,}|\t", text.strip()),
        ]
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


_BEGINS_LIKE_NUMBER = re.compile(r"[\s\"']*+[+-]?[.,]?[0-9]")


def _raise_no_table(texts: list[str], where: str) -> None:
    filled = [i for i, text in enumerate(texts) if text.strip()] or [0]
    bad = next((i for i in filled if _BEGINS_LIKE_NUMBER.match(texts[i])), filled[0])
    shown = texts[bad][:60] if texts else ""
    remedy = "the file was cut off after its header, or it holds something else"
    if re.search(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d:\d\d", shown):
        remedy = f"date and time are read as {DATE_TIME_EXAMPLES}: write them so, or replace that column by seconds"
    raise InputError(
        f"no line of numbers was found; line {bad + 1} begins {shown!r}",
        where=where,
        allowed="columns of numbers separated by comma, semicolon, tab or blanks",
        remedy=remedy,
    )


# --------------------
# The rows of a text file: a fast parser, and a careful one that can name the line and column of what is wrong.
# --------------------


MAX_LINE_BYTES = 1 << 20


def parse_rows(data: bytes, layout: CsvLayout, names: tuple[str, ...], where: str) -> list[FloatArray]:
    """Return one float64 array per column; what the fast parser cannot read is read again line by line."""
    from pyarrow import ArrowInvalid

    try:
        return _parse_fast(data, layout)
    except ArrowInvalid:
        return _parse_carefully(data, layout, names, where)


def line_of_row(data: bytes, layout: CsvLayout, row: int) -> int:
    """Return the line number of a row of the table, counting the blank lines between."""
    for i, (line, _) in enumerate(_filled_lines(data, layout)):
        if i == row:
            return line
    return layout.first_line + row


def _parse_fast(data: bytes, layout: CsvLayout) -> list[FloatArray]:
    import pyarrow as pa
    from pyarrow import csv

    table_bytes = memoryview(data)[layout.offset :]
    separator = layout.separator
    if separator == " ":
        table_bytes = memoryview(_with_single_blanks(bytes(table_bytes)))
    columns = [f"column {i}" for i in range(layout.n_columns)]
    types = dict.fromkeys(columns, pa.float64())
    if layout.date_times:
        types[columns[0]] = _arrow_type(layout.date_times)
    table = csv.read_csv(
        pa.BufferReader(pa.py_buffer(table_bytes)),
        read_options=csv.ReadOptions(column_names=columns + ["nothing"] * layout.trailing_separator),
        parse_options=csv.ParseOptions(delimiter=separator, quote_char=False),
        convert_options=csv.ConvertOptions(
            column_types=types, null_values=[], decimal_point=layout.decimal, include_columns=columns
        ),
    )
    return [
        _seconds_from_first(table.column(name), layout.date_times)
        if layout.date_times and name == columns[0]
        else table.column(name).to_numpy()
        for name in columns
    ]


def _with_single_blanks(text: bytes) -> bytes:
    """Return the lines with one blank between fields and none at the ends."""
    text = text.replace(b"\t", b" ").replace(b"\r", b"")
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b" \n", b"\n").replace(b"\n ", b"\n").strip(b" ")


def _parse_carefully(data: bytes, layout: CsvLayout, names: tuple[str, ...], where: str) -> list[FloatArray]:
    """Parse line by line: slow, and precise about the first thing that is wrong."""
    from pyarrow import ArrowInvalid

    rows = []
    date_times: dict[int, str] = {}
    for number, line in _filled_lines(data, layout):
        fields = split(line, layout.separator)
        if layout.trailing_separator and len(fields) == layout.n_columns + 1 and not fields[-1].strip():
            fields.pop()
        if len(fields) != layout.n_columns:
            _raise_field_count(len(fields), number, line, layout, where)
        if layout.date_times:
            if _date_time_form(fields[0]) != layout.date_times:
                _raise_no_date_time(fields[0], number, names[0], layout, where)
            date_times[number], fields[0] = fields[0].strip(" \t\r"), "0"
        for field, name in zip(fields, names, strict=True):
            if not is_number(field, layout.decimal):
                _raise_no_number(field, number, name, layout, where)
        rows.append([float(field.replace(",", ".")) for field in fields])
    columns = list(np.array(rows, dtype=np.float64).T)
    if layout.date_times:
        try:
            columns[0] = _seconds_from_first(list(date_times.values()), layout.date_times)
        except ArrowInvalid:
            number = next(number for number, text in date_times.items() if not date_time_kind(text))
            _raise_no_date_time(date_times[number], number, names[0], layout, where)
    return columns


def _filled_lines(data: bytes, layout: CsvLayout) -> Iterator[tuple[int, str]]:
    """Yield the lines of the table that are not blank, with their numbers; long ones are shortened."""
    at, number = layout.offset, layout.first_line
    while at < len(data):
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        line = data[at : min(end, at + MAX_LINE_BYTES)].decode("utf-8", errors="replace")
        if line.strip():
            yield number, line.rstrip("\r")
        at, number = end + 1, number + 1


def _raise_field_count(n_fields: int, number: int, line: str, layout: CsvLayout, where: str) -> None:
    remedy = "the file was cut off there: remove the line knowingly, or export the file again"
    if n_fields > layout.n_columns or any(c.isalpha() for c in line):
        remedy = "remove the line, or export the table alone"
    raise InputError(
        f"line {number} has {n_fields} of {layout.n_columns} columns: {line[:60]!r}",
        where=where,
        allowed=f"{layout.n_columns} numbers in each line",
        remedy=remedy,
    )


def _raise_no_date_time(field: str, number: int, name: str, layout: CsvLayout, where: str) -> None:
    raise InputError(
        f"line {number}, column {name!r}: {field.strip()[:60]!r} is no date and time as those above it",
        where=where,
        allowed=f"e.g. {DATE_TIME_EXAMPLES}, each {'with' if layout.date_times == 'zoned' else 'without'} a time zone",
        remedy="correct the field, or replace the column by seconds",
    )


def _raise_no_number(field: str, number: int, name: str, layout: CsvLayout, where: str) -> None:
    text = field.strip()[:60]
    raise InputError(
        f"line {number}, column {name!r}: " + (f"{text!r} is not a number" if text else "the field is empty"),
        where=where,
        allowed=f"numbers with decimal {'comma' if layout.decimal == ',' else 'point'}",
        remedy="correct the field, or remove the column" if text else "cut out the gap knowingly or export again",
    )


READER = "gearsig CSV reader"
INDEX_NAMES = ("", "index", "sample", "samples", "no", "nr", "#")
"""Headers of columns that may count the rows, lower case."""


def read_csv(path: Path) -> RawTable:
    """Return the columns of a text file.

    The layout is found from the first lines: separator (comma, semicolon, tab, blanks), decimal point or comma, a
    header, units in brackets or in a row of their own, lines above the header ("# …" or free text). A line
    "sampling rate: 25600" among those states the rate. A first column of dates and times (ISO 8601) is the time, in
    seconds from its first row.

    Raises
    ------
    InputError
        With line and column, if a line has another number of columns or a field is no number.
    """
    where = path.name
    data = read_text_bytes(path)
    is_own = data.startswith(OWN_TEXT_MARK.encode())
    layout = own_layout(data) if is_own else find_layout(data, where)
    n_rows = (len(data) - layout.offset) / layout.bytes_per_line
    check_memory(int(16 * n_rows * layout.n_columns), where)  # beside the text, which is in memory now
    names, units = _names_and_units(layout)
    values = parse_rows(data, layout, names, where)

    def place(row: int) -> str:
        return f"line {line_of_row(data, layout, row)}"

    if is_own:
        return table_from_metadata(layout.preamble[0].removeprefix(OWN_TEXT_MARK), values, READER, where, place)
    warnings = list(_doubtful_comma(layout, values))
    columns = [RawColumn(name, v, unit) for name, unit, v in zip(names, units, values, strict=True)]
    time = None
    if layout.date_times:
        time, *columns = columns
        time = replace(time, unit="s")
        warnings += [] if layout.header else ask_whether_runs(columns, where)
    elif not layout.header or plain_name(layout.header[0]) in INDEX_NAMES:
        columns, time, notes = without_clock(columns)
        warnings += notes if time is None else [*notes, *ask_whether_runs(columns, where)]
    return RawTable(
        tuple(columns),
        READER,
        sampling_rate_hz=next((hz for line in layout.preamble if (hz := rate_in_line(line)) is not None), None),
        time=time,
        warnings=tuple(warnings),
        row_place=place,
    )


def _names_and_units(layout: CsvLayout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return a name and a unit per column; a column without a name is called by its number."""
    header = layout.header or ("",) * layout.n_columns
    pairs = [split_unit(text) for text in header]
    units = [unit for _, unit in pairs]
    if layout.units:
        units = [text.strip("[]() -") for text in layout.units]
    prefix = "column " if layout.header else "ch"
    names = [name or f"{prefix}{i + 1}" for i, (name, _) in enumerate(pairs)]
    return tuple(names), tuple(units)


def _doubtful_comma(layout: CsvLayout, values: list[FloatArray]) -> list[str]:
    """Say so where "1,5" was read as two columns although it may be one with decimal commas."""
    whole = all(np.array_equal(v, np.round(v)) for v in values)
    if layout.separator == "," and layout.n_columns == 2 and not layout.header and whole:
        return ["two columns of whole numbers were read; if the comma is a decimal comma, add a header line"]
    return []


def write_csv(recording: Recording, path: Path) -> None:
    """Write a line of JSON, a header line and one line per sample, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    header = io.StringIO()
    titles = [f"{c.name} [{c.unit}]" if c.unit else c.name for c in recording.channels]
    csv.writer(header, lineterminator="\n").writerow(
        ["".join(c if c.isprintable() else " " for c in title) for title in titles]
    )
    table = pa.table({f"column {i}": np.asarray(row) for i, row in enumerate(recording.samples)})
    with path.open("wb") as file:
        file.write(f"{OWN_TEXT_MARK}{metadata_json(recording)}\n".encode())
        file.write(header.getvalue().encode("utf-8", errors="replace"))
        arrow_csv.write_csv(table, file, arrow_csv.WriteOptions(include_header=False))


def _sniff(head: bytes) -> str:
    if head.startswith(b"\x1f\x8b"):
        return "gzip"
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):  # UTF-16
        return "CSV text"
    n_control = sum(c < 9 or 13 < c < 32 for c in head)
    return "" if b"\0" in head or n_control > 0.01 * len(head) else "CSV text"


CSV = FileFormat("CSV", (".csv", ".txt", ".tsv", ".dat", ".asc"), _sniff, read_csv, write_csv, (".csv",))
