"""The rows of a text file: a fast parser, and a careful one that can name the line and column of what is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.recording.formats.csv_layout import CsvLayout, is_number, split

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
    table = csv.read_csv(
        pa.BufferReader(pa.py_buffer(table_bytes)),
        read_options=csv.ReadOptions(column_names=columns + ["nothing"] * layout.trailing_separator),
        parse_options=csv.ParseOptions(delimiter=separator, quote_char=False),
        convert_options=csv.ConvertOptions(
            column_types=dict.fromkeys(columns, pa.float64()),
            null_values=[],
            decimal_point=layout.decimal,
            include_columns=columns,
        ),
    )
    return [table.column(name).to_numpy() for name in columns]


def _with_single_blanks(text: bytes) -> bytes:
    """Return the lines with one blank between fields and none at the ends."""
    text = text.replace(b"\t", b" ").replace(b"\r", b"")
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b" \n", b"\n").replace(b"\n ", b"\n").strip(b" ")


def _parse_carefully(data: bytes, layout: CsvLayout, names: tuple[str, ...], where: str) -> list[FloatArray]:
    """Parse line by line: slow, and precise about the first thing that is wrong."""
    rows = []
    for number, line in _filled_lines(data, layout):
        fields = split(line, layout.separator)
        if layout.trailing_separator and len(fields) == layout.n_columns + 1 and not fields[-1].strip():
            fields.pop()
        if len(fields) != layout.n_columns:
            _raise_field_count(len(fields), number, line, layout, where)
        for field, name in zip(fields, names, strict=True):
            if not is_number(field, layout.decimal):
                _raise_no_number(field, number, name, layout, where)
        rows.append([float(field.replace(",", ".")) for field in fields])
    return list(np.array(rows, dtype=np.float64).T)


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


def _raise_no_number(field: str, number: int, name: str, layout: CsvLayout, where: str) -> None:
    text = field.strip()[:60]
    raise InputError(
        f"line {number}, column {name!r}: " + (f"{text!r} is not a number" if text else "the field is empty"),
        where=where,
        allowed=f"numbers with decimal {'comma' if layout.decimal == ',' else 'point'}",
        remedy="correct the field, or remove the column" if text else "cut out the gap knowingly or export again",
    )
