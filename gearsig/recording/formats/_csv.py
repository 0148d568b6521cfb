"""Text files of numbers: CSV, TSV, semicolons, blanks, decimal comma, gzip."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.recording._limits import check_memory, read_text_bytes
from gearsig.recording._table import (
    RawColumn,
    RawTable,
    ask_whether_runs,
    counts_rows,
    refuse_spectrum,
    rises,
    time_among,
    without_clock,
)
from gearsig.recording._types import Recording, interval_in_line, is_unit, plain_name, rate_in_line, split_unit
from gearsig.recording.formats._format import OWN_TEXT_MARK, FileFormat, metadata_json, table_from_metadata

# --------------------
# How a text file of numbers is laid out: separator, decimal sign, header, first line of numbers.
# --------------------


SNIFF_BYTES = 1 << 18
N_PROOF_LINES = 5
"""Lines from which the layout is judged: the first must hold only numbers, most others as many fields."""

# Tried in this order; the first that reads the most columns wins. Commas come after tabs and semicolons, because they
# are also decimal signs: "1,5;2,7" must not become three columns of text.
CANDIDATES = (("\t", "."), (";", "."), ("\t", ","), (";", ","), (",", "."), (" ", "."), (" ", ","))
MAX_LINES_ABOVE = 2000
"""More lines than this are not the header of a table."""
COMMENT_SIGNS = ("#", "%", "//")

# Possessive: digits that do not end a number are examined only once.
_NUMBER = re.compile(r"[+-]?(?:\d++\.?\d*+|\.\d++)(?:e[+-]?\d++)?\Z|[+-]?(?:nan|inf|infinity)\Z", re.IGNORECASE)
_MINUTES = r":[0-9]{2}:[0-9]{2}(?:[.,][0-9]{1,9})?"
_CLOCK = rf"(?:[0-9]{{1,2}}{_MINUTES}|(?:0?[0-9]|1[0-2]){_MINUTES} ?[AaPp][Mm])"
_DAY = r"(?:[0-9]{4}[-/.][0-9]{2}[-/.][0-9]{2}|[0-9]{1,2}\.[0-9]{1,2}\.[0-9]{4}|[0-9]{1,2}/[0-9]{1,2}/[0-9]{4})"
_ISO = r"[0-9]{4}-[0-9]{2}-[0-9]{2}[T ][0-9]{2}:[0-9]{2}:[0-9]{2}(?:\.[0-9]{1,9})?"
_DATE_TIMES = {
    kind: re.compile(expression + r"\Z")
    for kind, expression in {
        "local": _ISO,
        "zoned": _ISO + r"(?:Z|[+-][0-9]{2}(?::?[0-9]{2})?)",
        "written": _DAY + "[T ]" + _CLOCK,
        "apart": _DAY + "\x1f" + _CLOCK,
        "clock": _CLOCK,
    }.items()
}
"""Kind of date and time → its notation: ISO 8601, as people write it, in two columns, or the time of day only."""
DATE_TIME_EXAMPLES = (
    "2026-01-31T12:00:00.0001, 2026-01-31 12:00:00.0001Z, 31.01.2026 12:00:00,0001, 1/31/2026 12:00:00.0001 PM "
    "or 12:00:00.0001"
)
"""Examples of what is read as date and time."""


@dataclass(frozen=True)
class CsvLayout:
    """Where the table starts and how its lines are split.

    Parameters
    ----------
    separator, decimal : str
        The separator " " means any run of blanks.
    n_columns : int
    leading_separator, trailing_separator : bool
        Whether each line begins or ends with a separator that has no column beside it.
    header, units : tuple of str
        One text per column, or nothing.
    preamble : tuple of str
        Lines above the table that are not its header.
    first_line : int
        Number of the first line of numbers, from 1.
    offset : int
        Bytes before that line.
    bytes_per_line : float
        Mean over the lines that were examined.
    date_times : str
        Kind in the first column, or the first two ("apart"), see `date_time_kind`; empty if it holds numbers.
    """

    separator: str
    decimal: str
    n_columns: int
    leading_separator: bool
    trailing_separator: bool
    header: tuple[str, ...]
    units: tuple[str, ...]
    preamble: tuple[str, ...]
    first_line: int
    offset: int
    bytes_per_line: float
    date_times: str = ""

    @property
    def n_date_columns(self) -> int:
        """Number of columns that together are the time."""
        return 0 if not self.date_times else 2 if self.date_times == "apart" else 1


def is_number(text: str, decimal: str) -> bool:
    """Whether a field is a number with this decimal sign; blanks around it do not matter."""
    field = text.strip(" \t\r")
    if decimal == ",":
        if "." in field:
            return False
        field = field.replace(",", ".")
    return _NUMBER.match(field) is not None


def date_time_kind(fields: Sequence[str]) -> str:
    """Return the kind of date and time that the first fields of a line hold; empty if they hold none.

    Examples
    --------
    >>> [date_time_kind([text]) for text in ("2026-01-31T12:00:00.5Z", "2026-01-31 12:00:00", "2026-02-30 12:00:00")]
    ['zoned', 'local', '']
    >>> [date_time_kind(fields) for fields in (["31.1.2026 12:00:00,5"], ["2026/01/31", "12:00:00"], ["0:00:01"])]
    ['written', 'apart', 'clock']
    >>> [date_time_kind([text]) for text in ("1/31/2026 12:00:00 AM", "31/1/2026 2:05:00 pm", "13:00:00 PM")]
    ['written', 'written', '']
    """
    from pyarrow import ArrowInvalid

    kind = _date_time_form(fields)
    try:
        _seconds_from_first([_date_time_text(fields, kind)] if kind else [], kind)
    except ArrowInvalid:  # a 30th of February
        return ""
    return kind


def _date_time_form(fields: Sequence[str]) -> str:
    """Return the kind as `date_time_kind` does, but without checking that the day and time exist."""
    texts = {kind: _date_time_text(fields, kind) for kind in _DATE_TIMES}
    return next((kind for kind, form in _DATE_TIMES.items() if form.match(texts[kind])), "")


def _date_time_text(fields: Sequence[str], kind: str) -> str:
    return "\x1f".join(field.strip(" \t\r") for field in fields[: 2 if kind == "apart" else 1])


def _seconds_from_first(date_times: Any, kind: str) -> FloatArray:
    """Return dates and times, given as texts or Arrow values, in seconds from the first, to a nanosecond over days.

    Dates with slashes may have the month first, as in America, or the day; the reading that gives the shorter record
    is taken.
    """
    import pyarrow as pa
    from pyarrow import compute

    if isinstance(date_times, list):
        date_times = pa.array(date_times, pa.string())
    if kind in ("local", "zoned"):
        return _from_first(date_times, "UTC" if kind == "zoned" else None)
    first, half_days = date_times[0].as_py() if len(date_times) else "", 0
    if first[-1:] in ("m", "M"):  # 12-hour clock: 12 AM is midnight
        half_days = compute.match_substring_regex(date_times, "[pP].$").to_numpy(zero_copy_only=False)
        for old, new in ((r" ?[AaPp][Mm]$", ""), (r"(^|[ T\x1f])12(:[0-9]{2}:[^:]*)$", r"\100\2")):
            date_times = compute.replace_substring_regex(date_times, old, new)
    if "/" not in first[:3]:
        return _from_first(_as_iso(date_times, kind), None, half_days)
    readings, problems = list[FloatArray](), list[pa.ArrowInvalid]()
    for order in (r"\3-\1-\2", r"\3-\2-\1"):
        try:
            readings.append(_from_first(_as_iso(date_times, kind, order), None, half_days))
        except pa.ArrowInvalid as error:
            problems.append(error)
    if not readings:
        raise problems[0]
    return min(readings, key=np.ptp)


def _from_first(date_times: Any, zone: str | None, half_days: Any = 0) -> FloatArray:
    """Return ISO 8601 dates and times, plus half days to be added, in seconds from the first."""
    import pyarrow as pa

    moments_ns = date_times.cast(pa.timestamp("ns", zone)).cast(pa.int64()).to_numpy(zero_copy_only=False)
    whole, rest_ns = np.divmod(moments_ns + half_days * (12 * 3600 * 10**9), 10**9)
    seconds: FloatArray = (whole - whole[:1]) + (rest_ns - rest_ns[:1]) / 1e9
    return seconds


def _as_iso(texts: Any, kind: str, order: str = r"\3-\2-\1") -> Any:
    """Return dates and times of other notations in ISO 8601; `order` is that of a date's three numbers."""
    from pyarrow import compute

    changes = [(r"^([0-9]{4})[/.]([0-9]{2})[/.]", r"\1-\2-")]
    if kind != "clock":
        changes += [(r"^([0-9])([./])", r"0\1\2"), (r"^([0-9]{2})([./])([0-9])[./]", r"\1\20\3\2")]
        changes += [(r"^([0-9]{2})[./]([0-9]{2})[./]([0-9]{4})", order)]
    else:
        changes += [("^", "1970-01-01 ")]
    for old, new in [*changes, ("\x1f", " "), (" ([0-9]):", r" 0\1:"), (",", ".")]:
        texts = compute.replace_substring_regex(texts, old, new)
    return texts


def split(line: str, separator: str) -> list[str]:
    """Split one line into its fields, respecting quotes."""
    if separator == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return line.split(separator)


def _text(line: bytes) -> str:
    """Decode a line as UTF-8, or else as Windows' Western code page, in which "m/s²" has other bytes."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")


def _between_separators(fields: list[str]) -> tuple[list[str], bool, bool]:
    """Return the fields without an empty first and last one, and whether each of these was present."""
    leading = len(fields) > 1 and not fields[0].strip()
    trailing = len(fields) > 1 + leading and not fields[-1].strip()
    return fields[leading : len(fields) - trailing], leading, trailing


def find_layout(data: bytes, where: str) -> CsvLayout:
    """Return the layout of a text file from its first lines.

    Raises
    ------
    InputError
        If no line of numbers is found.
    """
    lines = _first_lines(data)
    texts = [_text(line).strip("\r\n") for line in lines]
    texts[0] = texts[0].removeprefix("\ufeff")
    start, separator, decimal = _table_start(texts, where)
    fields, leading, trailing = _between_separators(split(texts[start], separator))
    n_columns = len(fields)
    header, units, preamble = _header(texts[:start], separator, n_columns, leading, trailing)
    table = lines[start:]
    return CsvLayout(
        separator,
        decimal,
        n_columns,
        leading,
        trailing,
        header,
        units,
        preamble,
        first_line=start + 1,
        offset=sum(len(line) for line in lines[:start]),
        bytes_per_line=sum(len(line) for line in table) / len(table),
        date_times=date_time_kind(fields),
    )


def own_layout(data: bytes) -> CsvLayout:
    """Return the layout that gearsig writes: a description, a header, then the numbers."""
    header_at = data.find(b"\n") + 1
    offset = data.find(b"\n", header_at) + 1
    end = data.find(b"\n", offset)
    first = data[offset : end if end > 0 else len(data)]
    description = data[: header_at - 1].decode("utf-8", errors="replace")
    n_columns = first.count(b",") + 1
    return CsvLayout(",", ".", n_columns, False, False, (), (), (description,), 3, offset, len(first) + 1.0)


def _first_lines(data: bytes) -> list[bytes]:
    """Return the complete lines at the beginning, or all if the file is short."""
    lines = data[:SNIFF_BYTES].splitlines(keepends=True)
    if len(data) > SNIFF_BYTES and len(lines) > 1:
        lines.pop()
    return lines


def _table_start(texts: list[str], where: str) -> tuple[int, str, str]:
    """Return the first line of numbers, with the separator and decimal sign that read the most columns there."""
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
    """Return how many columns of numbers the lines have; 0 if they do not agree or hold something else.

    The last line may be cut off, and a single bad field further down is reported later with its line: only the first
    line must be clean, and most of the others must have as many fields.
    """
    rows = [split(line, separator) for line in proof]
    if "" in (rows[0][0].strip(), rows[0][-1].strip()):
        rows = [_between_separators(row)[0] if row else row for row in rows]
    kind = date_time_kind(rows[0])
    numbers = rows[0][(kind == "apart") + (kind != "") :]
    if not numbers or not all(is_number(field, decimal) for field in numbers):
        return 0
    same = sum(len(row) == len(rows[0]) and (not kind or date_time_kind(row) == kind) for row in rows)
    return len(rows[0]) - (kind == "apart") if 2 * same > len(rows) else 0


MAX_HEADER_LINES = 12
"""Lines above the table that may have a field for each column: names, units, calibrations, types."""


def _header(
    above: list[str], separator: str, n_columns: int, leading: bool, trailing: bool
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return names, units and the remaining lines above the table.

    The names are in the last line that has a field for each column, or in the line above a row of units.
    """
    filled = [text for text in above if text.strip()]
    rows: list[tuple[str, ...]] = []
    n_lines = 2 if n_columns == 1 else MAX_HEADER_LINES  # any line may be the name of one column
    for text in reversed(filled[-n_lines:]):
        fields = _header_fields(text, separator, n_columns, leading, trailing)
        if fields is None:
            break
        rows.append(fields)
    of_units = next((i for i, row in enumerate(rows[:-1]) if _all_units(row)), None)
    if of_units is None:
        return rows[0] if rows else (), (), tuple(filled[: len(filled) - bool(rows)])
    return rows[of_units + 1], rows[of_units], tuple(filled[: -of_units - 2] + filled[len(filled) - of_units :])


def _header_fields(text: str, separator: str, n_columns: int, leading: bool, trailing: bool) -> tuple[str, ...] | None:
    """Return a line's fields if it can be the header of `n_columns` columns."""
    if rate_in_line(text) is not None:
        return None
    for sign in COMMENT_SIGNS:
        text = text.strip("\r\n" if leading else None).removeprefix(sign)
    if n_columns == 1 and not leading:
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
        if len(cleaned) == n_columns + leading + trailing:  # there may be a name without numbers
            cleaned = cleaned[leading : leading + n_columns]
        elif len(cleaned) == leading + n_columns + 1 and cleaned[-1].casefold() in ("", "comment"):
            cleaned = cleaned[leading:-1]
        if len(cleaned) == n_columns and any(cleaned) and "=" not in cleaned:
            return cleaned
    return None


def _all_units(fields: Iterable[str]) -> bool:
    """Whether a row consists of units, in brackets or known ones; empty fields and "-" mean plain numbers."""
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
# The rows of a text file: a fast parser, and a careful one that can name the line and column of an error.
# --------------------


MAX_LINE_BYTES = 1 << 20


def parse_rows(data: bytes, layout: CsvLayout, names: tuple[str, ...], where: str) -> list[FloatArray]:
    """Return one float64 array per column; if the fast parser fails, the rows are parsed line by line."""
    from pyarrow import ArrowInvalid

    try:
        return _parse_fast(data, layout)
    except ArrowInvalid:
        return _parse_carefully(data, layout, names, where)


def line_of_row(data: bytes, layout: CsvLayout, row: int) -> int:
    """Return the line number of a row of the table; blank lines in between count."""
    for i, (line, _) in enumerate(_filled_lines(data, layout)):
        if i == row:
            return line
    return layout.first_line + row


def _parse_fast(data: bytes, layout: CsvLayout) -> list[FloatArray]:
    import pyarrow as pa
    from pyarrow import compute, csv

    table_bytes = memoryview(data)[layout.offset :]
    separator = layout.separator
    if separator == " ":
        table_bytes = memoryview(_with_single_blanks(bytes(table_bytes)))
    columns = [f"column {i}" for i in range(layout.n_columns)]
    types = dict.fromkeys(columns, pa.float64()) | dict.fromkeys(columns[: layout.n_date_columns], pa.string())
    if layout.date_times in ("local", "zoned"):
        types[columns[0]] = pa.timestamp("ns", "UTC" if layout.date_times == "zoned" else None)
    table = csv.read_csv(
        pa.BufferReader(pa.py_buffer(table_bytes)),
        read_options=csv.ReadOptions(
            column_names=["before"] * layout.leading_separator + columns + ["after"] * layout.trailing_separator
        ),
        parse_options=csv.ParseOptions(delimiter=separator, quote_char=False),
        convert_options=csv.ConvertOptions(
            column_types=types, null_values=[], decimal_point=layout.decimal, include_columns=columns
        ),
    )
    values = [table.column(name) for name in columns]
    if layout.date_times == "apart":
        values[0] = compute.binary_join_element_wise(values[0], values.pop(1), "\x1f")
    if layout.date_times:
        return [_seconds_from_first(values[0], layout.date_times), *(v.to_numpy() for v in values[1:])]
    return [v.to_numpy() for v in values]


def _with_single_blanks(text: bytes) -> bytes:
    """Return the lines with one blank between fields and none at either end."""
    text = text.replace(b"\t", b" ").replace(b"\r", b"")
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b" \n", b"\n").replace(b"\n ", b"\n").strip(b" ")


def _parse_carefully(data: bytes, layout: CsvLayout, names: tuple[str, ...], where: str) -> list[FloatArray]:
    """Parse line by line: slow, but precise about the first error."""
    from pyarrow import ArrowInvalid

    rows = []
    date_times: dict[int, str] = {}
    for number, line in _filled_lines(data, layout):
        fields = split(line, layout.separator)
        if layout.trailing_separator and len(fields) > layout.n_columns and not fields[-1].strip():
            fields.pop()
        if layout.leading_separator and len(fields) > layout.n_columns and not fields[0].strip():
            del fields[0]
        if len(fields) != layout.n_columns:
            _raise_field_count(len(fields), number, line, layout, where)
        if layout.date_times:
            text = _date_time_text(fields, layout.date_times)
            if not _DATE_TIMES[layout.date_times].match(text):
                _raise_no_date_time(text, number, names[0], layout, where)
            date_times[number] = text
            fields[: layout.n_date_columns] = ["0"]
        for field, name in zip(fields, names, strict=True):
            if not is_number(field, layout.decimal):
                _raise_no_number(field, number, name, layout, where)
        rows.append([float(field.replace(",", ".")) for field in fields])
    columns = list(np.array(rows, dtype=np.float64).T)
    if layout.date_times:
        try:
            columns[0] = _seconds_from_first(list(date_times.values()), layout.date_times)
        except ArrowInvalid:
            number = next(number for number, text in date_times.items() if not date_time_kind(text.split("\x1f")))
            _raise_no_date_time(date_times[number], number, names[0], layout, where)
    return columns


def _filled_lines(data: bytes, layout: CsvLayout) -> Iterator[tuple[int, str]]:
    """Yield the numbers and texts of the table's lines that are not blank; long lines are truncated."""
    at, number = layout.offset, layout.first_line
    while at < len(data):
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        line = _text(data[at : min(end, at + MAX_LINE_BYTES)])
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
        f"line {number}, column {name!r}: {field.strip()[:60]!r} is not a date and time like those above it",
        where=where,
        allowed=f"e.g. {DATE_TIME_EXAMPLES}, each {'with' if layout.date_times == 'zoned' else 'without'} a time zone",
        remedy="correct the field, or replace the column by seconds",
    )


def _raise_no_number(field: str, number: int, name: str, layout: CsvLayout, where: str) -> None:
    text = field.strip()[:60]
    remedy = "correct the field, or remove the column" if text else "cut out the gap knowingly or export again"
    if re.match(r"[+-]?\d{1,3}(?:[.,' \u00a0]\d{3})+(?!\d)", text):
        remedy = "export the numbers without thousands separators"
    raise InputError(
        f"line {number}, column {name!r}: " + (f"{text!r} is not a number" if text else "the field is empty"),
        where=where,
        allowed=f"numbers with decimal {'comma' if layout.decimal == ',' else 'point'}",
        remedy=remedy,
    )


READER = "gearsig CSV reader"
UNIT_LABELS = ("unit", "units", "yunit", "yunits", "yunitlabel", "amplitudeunit", "amplitudeunits", "einheit")
"""Labels of a line above the table that states units, as `plain_name` writes them."""


def read_csv(path: Path) -> RawTable:
    """Return the columns of a text file.

    The layout is found from the first lines: separator (comma, semicolon, tab, blanks), decimal point or comma, a
    header, units in brackets or in a separate row, lines above the header ("# …" or free text). A line such as
    "sampling rate: 25600" among these states the rate. A first column of dates and times is the time, in seconds from
    its first row; so are a date and a time of day in two columns.

    Raises
    ------
    InputError
        Naming line and column, if a line has a different number of columns or a field is not a number.
    """
    where = path.name
    data = read_text_bytes(path)
    is_own = data.startswith(OWN_TEXT_MARK.encode())
    layout = own_layout(data) if is_own else find_layout(data, where)
    n_rows = (len(data) - layout.offset) / layout.bytes_per_line
    check_memory(int(16 * n_rows * layout.n_columns), where)  # besides the text, which is in memory by now
    names, units = _names_and_units(layout)
    values = parse_rows(data, layout, names, where)

    def place(row: int) -> str:
        return f"line {line_of_row(data, layout, row)}"

    if is_own:
        return table_from_metadata(layout.preamble[0].removeprefix(OWN_TEXT_MARK), values, READER, where, place)
    refuse_spectrum(layout.preamble, where)
    warnings = list(_doubtful_comma(layout, values))
    columns = [RawColumn(name, v, unit) for name, unit, v in zip(names, units, values, strict=True)]
    time = None
    if layout.date_times:
        time, *columns = columns
        time = replace(time, unit="s")
        warnings += [] if layout.header else ask_whether_runs(columns, where)
    else:
        is_named = bool(layout.header) and not counts_rows(layout.header[0])
        columns, time, notes = without_clock(columns, is_named=is_named)
        warnings += notes if time is None or layout.header else [*notes, *ask_whether_runs(columns, where)]
    rate_hz = next((hz for line in layout.preamble if (hz := rate_in_line(line)) is not None), None)
    if rate_hz is None and time is None and time_among(columns) is None:  # steps may be rounded more than times
        steps = (step_s for line in layout.preamble if (step_s := interval_in_line(line)) is not None)
        rate_hz = next((1.0 / step_s for step_s in steps if step_s > 0), None)
    return RawTable(
        tuple(_with_stated_units(columns, layout.preamble)),
        READER,
        sampling_rate_hz=rate_hz,
        time=time,
        warnings=tuple(warnings),
        row_place=place,
    )


def _with_stated_units(columns: list[RawColumn], preamble: tuple[str, ...]) -> list[RawColumn]:
    """Return the columns with the units that a line above the table states, one for all signals or one for each."""
    n_axes = int(len(columns) > 1 and rises(columns[0].values))  # a time column, identified later
    signals = columns[n_axes:]
    for line in preamble:
        label, *fields = (field.strip() for field in re.split(r"[:=;\t]+", line.strip()))
        units = [field for field in fields if field]
        if plain_name(label) in UNIT_LABELS and any(map(is_unit, units)):
            units = units * (len(signals) if len(units) == 1 else 1)
            if len(units) == len(signals):
                new = [c if c.unit else replace(c, unit=unit) for c, unit in zip(signals, units, strict=True)]
                return [*columns[:n_axes], *new]
    return columns


def _names_and_units(layout: CsvLayout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return a name and a unit per column, one for date and time together; a column without a name is numbered.

    A name that occurs more than once is followed by its column number.
    """
    header = layout.header or ("",) * layout.n_columns
    pairs = [split_unit(text) for text in header]
    units = [unit for _, unit in pairs]
    if layout.units:
        units = [text.strip("[]() -") for text in layout.units]
    prefix = "column " if layout.header else "ch"
    names = [name or f"{prefix}{i + 1}" for i, (name, _) in enumerate(pairs)]
    doubled = {name for name in names if names.count(name) > 1}
    names = [f"{name} ({i + 1})" if name in doubled else name for i, name in enumerate(names)]
    if layout.date_times == "apart":
        del names[1], units[1]
    return tuple(names), tuple(units)


def _doubtful_comma(layout: CsvLayout, values: list[FloatArray]) -> list[str]:
    """Return a warning if "1,5" was read as two columns but may be one with decimal commas."""
    whole = all(np.array_equal(v, np.round(v)) for v in values)
    if layout.separator == "," and layout.n_columns == 2 and not layout.header and whole:
        return ["two columns of whole numbers were read; if the comma is a decimal comma, add a header line"]
    return []


def write_csv(recording: Recording, path: Path) -> None:
    """Write a line of JSON, a header line and one line per sample, with all digits of the numbers."""
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


CSV = FileFormat("CSV", (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm"), _sniff, read_csv, write_csv, (".csv",))
