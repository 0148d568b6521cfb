"""Reads text files of numbers: CSV, TSV, semicolons, blanks, decimal comma, gzip."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording.formats.csv_layout import CsvLayout, find_layout, own_layout
from gearsig.recording.formats.csv_rows import line_of_row, parse_rows
from gearsig.recording.limits import check_memory, read_text_bytes
from gearsig.recording.metadata import OWN_TEXT_MARK, table_from_metadata
from gearsig.recording.names import plain_name, rate_in_line, split_unit
from gearsig.recording.raw_table import RawColumn, RawTable

READER = "gearsig CSV reader"


def read_csv(path: Path) -> RawTable:
    """Return the columns of a text file.

    The layout is found from the first lines: separator (comma, semicolon, tab, blanks), decimal point or comma, a
    header, units in brackets or in a row of their own, lines above the header ("# …" or free text). A line
    "sampling rate: 25600" among those states the rate.

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
    columns, warning = _without_counter(columns, layout)
    warnings += warning
    time = None
    if not layout.header and len(columns) > 1 and not warning and _is_uniform(columns[0].values):
        time = columns.pop(0)
        warnings.append("no header: the first column increases uniformly and was taken for the time in seconds")
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


def _without_counter(columns: list[RawColumn], layout: CsvLayout) -> tuple[list[RawColumn], list[str]]:
    """Drop a first column that only counts the rows: it is neither a signal nor a time."""
    first = columns[0]
    unnamed = not layout.header or plain_name(layout.header[0]) in ("", "index", "sample", "samples", "no", "nr", "#")
    if len(columns) == 1 or not unnamed or len(first.values) < 2 or first.values[0] not in (0, 1):
        return columns, []
    if not np.all(np.diff(first.values) == 1):
        return columns, []
    return columns[1:], [f"column 1 ({first.name!r}) only counts the rows and was left out"]


def _is_uniform(values: FloatArray) -> bool:
    """Whether a column without a name rises in steps that are equal within 1 %."""
    steps = np.diff(values)
    return len(steps) > 1 and bool(steps.min() > 0) and bool(np.ptp(steps) <= 0.02 * steps.mean())


def _doubtful_comma(layout: CsvLayout, values: list[FloatArray]) -> list[str]:
    """Say so where "1,5" was read as two columns although it may be one with decimal commas."""
    whole = all(np.array_equal(v, np.round(v)) for v in values)
    if layout.separator == "," and layout.n_columns == 2 and not layout.header and whole:
        return ["two columns of whole numbers were read; if the comma is a decimal comma, add a header line"]
    return []
