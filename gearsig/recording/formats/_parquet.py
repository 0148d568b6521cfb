"""Parquet files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._limits import check_decoded
from gearsig.recording._table import NumberArray, RawColumn, RawTable
from gearsig.recording._types import Recording, split_unit, stated_rate_hz
from gearsig.recording.formats._format import OWN_NAME, FileFormat, begins, metadata_json, table_from_metadata

READER = "gearsig Parquet reader"


def read_parquet(path: Path, part: slice | None = None) -> RawTable:
    """Return the columns of numbers of a Parquet file.

    Units are in the column's metadata ("unit", "units") or in brackets in its name; a key of the file's metadata that
    is named like a sampling rate states the rate. The index that pandas writes is left out.

    Raises
    ------
    InputError
        If the file is damaged or does not fit into memory.
    """
    from pyarrow import parquet, types

    where = path.name
    with path.open("rb") as file:
        parts = parquet.ParquetFile(file)
        schema = parts.schema_arrow
        metadata = schema.metadata or {}
        is_number = (types.is_integer, types.is_floating, types.is_boolean)
        numeric = [f for f in schema if any(test(f.type) for test in is_number)]
        kept = [f for f in numeric if not f.name.startswith("__index_level_")]
        row_bytes = sum(max(1, int(f.type.bit_width) // 8) for f in kept)
        # Buffered: column by column, nothing before it is used.
        lazily = parquet.ParquetFile(file, metadata=parts.metadata, buffer_size=4096, pre_buffer=False)
        sizes = _group_bytes(lazily, kept, row_bytes)
        check_decoded(sum(sizes), path, at_once_bytes=None if part is None else max(sizes, default=0))
        # Other columns are not even decoded: texts unpack to any size.
        single = [f.name for f in kept if schema.names.count(f.name) == 1]
        values = {name: _column_values(parts, name, part) for name in single}
    doubled = [f.name for f in kept if f.name not in values]
    if doubled:
        raise InputError(
            f"column names occur more than once: {', '.join(sorted(set(doubled)))}",
            where=where,
            remedy="rename the columns",
        )
    if OWN_NAME.encode() in metadata:
        return table_from_metadata(
            metadata[OWN_NAME.encode()].decode(errors="replace"), list(values.values()), READER, where
        )
    left_out = [f.name for f in schema if f not in numeric]
    notes = (f"columns that hold no numbers were left out: {', '.join(left_out[:8])}",) if left_out else ()
    columns = tuple(_column(f, values[f.name]) for f in kept)
    return RawTable(columns, READER, sampling_rate_hz=_stated_rate(metadata), warnings=notes)


def _column(field: Any, values: Any) -> RawColumn:
    name, unit = split_unit(field.name)
    facts = field.metadata or {}
    for key in (b"unit", b"units"):
        unit = facts.get(key, unit.encode()).decode("utf-8", errors="replace")
    return RawColumn(name or field.name, values, unit)


def parquet_length(path: Path) -> int:
    """Return the number of rows that the file states."""
    from pyarrow import parquet

    return int(parquet.read_metadata(path).num_rows)


def _column_values(parts: Any, name: str, part: slice | None) -> NumberArray:
    """Return a column, or a part of it from the row groups that hold it."""
    if part is None:
        whole: NumberArray = parts.read(columns=[name]).column(name).to_numpy()
        return whole
    first, last, _ = part.indices(parts.metadata.num_rows)
    pieces, at = [], 0
    for i in range(parts.metadata.num_row_groups):
        n = parts.metadata.row_group(i).num_rows
        if first < at + n and last > at:
            group = parts.read_row_group(i, columns=[name]).column(name).to_numpy()
            pieces.append(group[max(first - at, 0) : max(last - at, 0)])
        at += n
    return np.concatenate(pieces) if pieces else np.empty(0, np.float32)


def _group_bytes(parts: Any, fields: Sequence[Any], row_bytes: int) -> list[int]:
    """Return the decoded bytes of some columns in each row group; pages and dictionaries count as the file states."""
    names, schema = {field.name for field in fields}, parts.schema
    columns = [i for i in range(len(schema)) if schema.column(i).path in names]
    sizes = []
    for i in range(parts.metadata.num_row_groups):
        # A column's metadata may be inconsistent. Reading it, even no rows of it, raises an error that can be caught;
        # the request for its size below would end the process.
        list(parts.reader.iter_batches(0, [i], columns))
        group = parts.metadata.row_group(i)
        stated = sum(int(group.column(column).total_uncompressed_size) for column in columns)
        sizes.append(max(group.num_rows * row_bytes, stated))
    return sizes


def _stated_rate(metadata: Mapping[bytes, bytes]) -> float | None:
    for key, value in metadata.items():
        with suppress(ValueError):
            rate_hz = stated_rate_hz(key.decode("utf-8", errors="replace"), float(value))
            if rate_hz is not None:
                return rate_hz
    return None


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one column per channel, the JSON in the schema's metadata and units in the columns' metadata."""
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [pa.array(row) for row in recording.samples]
    fields = [
        pa.field(c.name, array.type, metadata={"unit": c.unit})
        for c, array in zip(recording.channels, arrays, strict=True)
    ]
    facts = {OWN_NAME: metadata_json(recording), "sampling_rate_hz": repr(float(recording.sampling_rate_hz))}
    parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=facts)), path)


PARQUET = FileFormat(
    "Parquet",
    (".parquet", ".pq"),
    begins("Parquet", b"PAR1"),
    read_parquet,
    write_parquet,
    (".parquet",),
    read_parquet,
    parquet_length,
)
