"""The base class of all results: a `repr` of a few lines, and a pandas table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from html import escape
from operator import attrgetter
from textwrap import wrap
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gearsig.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

_AXES = {
    ("positions", "frequency"): "frequency_hz",
    ("positions", "order"): "order",
    ("positions", "quefrency"): "quefrency_s",
    ("at", "frequency"): "time_s",
    ("at", "order"): "revolutions",
}
"""(field, axis of the result) → name of the column: the same field may hold Hz or orders."""
_LINE, _TEXT, _SHOWN = 110, 60, 6
"""Maximum characters of a line and of a text in it; number of tuple items that are shown."""


class Result:
    """Base class of the dataclasses that the library returns.

    Parameters
    ----------
    rows : str
        Class keyword: the field whose items are the rows of `to_frame`.
    columns : tuple of str
        Class keyword: fields or properties of equal length that are its columns, or mappings of such. Default: all
        one-dimensional arrays that are as long as the longest.
    matrix : (str, str, str)
        Class keyword: a two-dimensional array (or its transpose, "values.T"), the index of its rows, and that of its
        columns.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Level(Result, columns=("time_s", "level")):
    ...     time_s: np.ndarray
    ...     level: np.ndarray
    ...     unit: str
    >>> Level(np.arange(3.0), np.array([1.0, 4.0, 2.0]), "g")
    Level: unit 'g'
      time_s  (3,) float64, 0 to 2
      level   (3,) float64, 1 to 4
    >>> Level(np.arange(3.0), np.array([1.0, 4.0, 2.0]), "g").to_frame()["level"].to_list()
    [1.0, 4.0, 2.0]
    """

    _rows: ClassVar[str] = ""
    _columns: ClassVar[tuple[str, ...]] = ()
    _matrix: ClassVar[tuple[str, str, str] | None] = None

    def __init_subclass__(
        cls, *, rows: str = "", columns: tuple[str, ...] = (), matrix: tuple[str, str, str] | None = None
    ) -> None:
        super().__init_subclass__()
        cls._rows, cls._columns, cls._matrix = rows or cls._rows, columns or cls._columns, matrix or cls._matrix
        # The decorator `dataclass`, which runs after this, keeps a `__repr__` that the class itself defines.
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.repr}  # type: ignore[arg-type]
        arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray) and value.ndim}
        texts = {name: _value_text(value) for name, value in values.items() if name not in arrays}
        head = [line for text in _verdict_of(self) for line in wrap(text, _LINE, subsequent_indent="  ")]
        facts = ", ".join(f"{name} {text}" for name, text in texts.items() if text and not (head and name == "verdict"))
        head += wrap(f"{type(self).__name__}: {facts}", _LINE, subsequent_indent="  ")
        width = max(map(len, arrays), default=0)
        return "\n".join([*head, *(f"  {name:<{width}}  {_array_text(a)}" for name, a in arrays.items())])

    def _repr_html_(self) -> str:
        """Return the same as a small HTML table for notebooks; texts are escaped, as they may come from files."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.repr}  # type: ignore[arg-type]
        rows = []
        for name, value in values.items():
            is_array = isinstance(value, np.ndarray) and value.ndim
            text = _array_text(value) if is_array else value if isinstance(value, str) else _value_text(value)
            rows += [(name, text)] if text else []
        return verdict_html([type(self).__name__], ("field", "value"), rows)

    def to_frame(self) -> DataFrame:
        """Return the result as a pandas table; column names end in their unit where it is fixed."""
        from pandas import DataFrame

        table = _table_of(self)
        return DataFrame([_row_of(self)]) if table is None else table


def verdict_html(verdict: Sequence[str], head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a verdict above a table as HTML for notebooks; texts are escaped, as they may come from files.

    Parameters
    ----------
    verdict, head : sequence of str
    rows : iterable of sequences of str
        Of the same length as `head`.
    """
    cell = "<{0} style='text-align:left'>{1}</{0}>"
    lines = [("th", head), *(("td", row) for row in rows)]
    table = "".join(f"<tr>{''.join(cell.format(kind, escape(text)) for text in line)}</tr>" for kind, line in lines)
    paragraphs = "".join(f"<p><strong>{escape(text)}</strong></p>" for text in verdict)
    return f"{paragraphs}<table>{table}</table>" if len(lines) > 1 else paragraphs


def to_frame(result: object) -> DataFrame:
    """Return a result, or a sequence of results, as a pandas table.

    Parameters
    ----------
    result : Result or sequence of dataclasses
        Each item of a sequence is a row. If the items hold arrays (tracked orders, ridges), their tables are stacked,
        with a leading column for each number or text in which the items differ.

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> from gearsig import time_indicators, to_frame
    >>> table = to_frame(time_indicators(np.sin(np.arange(1000.0)), "a1", "g"))
    >>> table[["name", "unit"]].iloc[0].to_list()
    ['rms', 'g']
    """
    if isinstance(result, (tuple, list)) and all(is_dataclass(item) for item in result):
        return _frame_of_items(result)
    if not hasattr(result, "to_frame"):
        raise InputError(f"a {type(result).__name__} has no table", allowed="a result, or a sequence of results")
    frame: DataFrame = result.to_frame()
    return frame


def _frame_of_items(items: Sequence[Any]) -> DataFrame:
    from pandas import DataFrame, concat

    tables = [_table_of(item) if isinstance(item, Result) else None for item in items]
    rows = [_row_of(item) for item in items]
    # If one item holds a dataclass, whose numbers are columns, and another holds None, None gets no separate column.
    parents = {name[:at] for row in rows for name in row for at, c in enumerate(name) if c == "."}
    rows = [{name: value for name, value in row.items() if name not in parents} for row in rows]
    parts = [table for table in tables if table is not None]
    if not parts or len(parts) < len(items):
        return DataFrame(rows)
    # Items are distinguished by their own numbers and texts, not those of results in them.
    plain = [n for n, v in rows[0].items() if "." not in n and not isinstance(v, tuple)]
    leading = [n for n in plain if any(row[n] != rows[0][n] for row in rows)]
    for row, part in zip(rows, parts, strict=True):
        for at, name in enumerate(leading):
            part.insert(at, name, row[name], allow_duplicates=True)
    return concat(parts, ignore_index=True)


def _table_of(result: Result) -> DataFrame | None:
    """Return the table of a result's items or arrays; None if it has neither."""
    from pandas import DataFrame, Index

    if result._rows:
        return _frame_of_items(getattr(result, result._rows))
    if result._matrix is not None:
        values, down, across = result._matrix
        index, columns = (Index(getattr(result, name), name=_column_name(result, name)) for name in (down, across))
        return DataFrame(attrgetter(values)(result), index=index, columns=columns)
    names = result._columns
    if not names:
        arrays = {f.name: getattr(result, f.name) for f in fields(result)}  # type: ignore[arg-type]  # a dataclass
        lengths = {name: len(a) for name, a in arrays.items() if isinstance(a, np.ndarray) and a.ndim == 1}
        names = tuple(name for name, n in lengths.items() if n == max(lengths.values()))
    table: dict[str, Any] = {}
    for name in names:
        value = getattr(result, name)
        table |= value if isinstance(value, Mapping) else {_column_name(result, name): value}
    return DataFrame(table) if table else None


def _column_name(result: object, name: str) -> str:
    return _AXES.get((name, getattr(result, "axis", "")), name)


def _row_of(item: Any, path: str = "") -> dict[str, Any]:
    """Return the numbers and texts of a dataclass, with nested dataclasses by path and without arrays."""
    row: dict[str, Any] = {}
    for name, value in ((path + f.name, getattr(item, f.name)) for f in fields(item)):
        if is_dataclass(value):
            row |= _row_of(value, f"{name}.")
        elif isinstance(value, Enum):
            row[name] = value.value
        elif value is None or isinstance(value, _SIMPLE) or _is_simple(value):
            row[name] = value
    return row


# The text of a `repr`.


def _verdict_of(result: object) -> tuple[str, ...]:
    """Return a result's verdict in words, which is shown first."""
    verdict = getattr(result, "verdict", ())
    if isinstance(verdict, str):
        return (verdict,) if " " in verdict else ()  # a single word is shown among the fields
    return tuple(verdict)


_SIMPLE = (str, bool, int, float, np.number)


def _is_simple(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(item, _SIMPLE) for item in value)


def _array_text(array: NDArray[Any]) -> str:
    text = f"{array.shape} {array.dtype}"
    if array.dtype == bool:
        return f"{text}, {int(array.sum())} true"
    is_complex = np.iscomplexobj(array)
    numbers = np.abs(array) if is_complex else array
    if not np.issubdtype(numbers.dtype, np.number) or not np.isfinite(numbers).any():
        return text
    return f"{text}, {'modulus ' if is_complex else ''}{np.nanmin(numbers):.4g} to {np.nanmax(numbers):.4g}"


def _value_text(value: Any) -> str:
    """Return a value as a short text; empty if there is nothing to show."""
    if value is None or (isinstance(value, (str, tuple, Mapping)) and not value):
        text = ""
    elif isinstance(value, str):
        text = repr(value if len(value) <= _TEXT else value[: _TEXT - 1] + "…")
    elif isinstance(value, Enum):
        text = str(value.value)
    elif isinstance(value, (float, np.floating)):
        text = f"{value:.6g}"
    elif _is_simple(value) and len(value) <= _SHOWN:
        text = f"({', '.join(_value_text(item) or repr(item) for item in value)})"
    elif isinstance(value, (Mapping, tuple, list)):
        items = value.values() if isinstance(value, Mapping) else value
        text = f"{len(value)} × {' or '.join(sorted({type(item).__name__ for item in items}))}"
    elif is_dataclass(value):
        name = getattr(value, "name", "")
        text = f"{type(value).__name__} {name!r}" if name else ""
    else:
        text = str(value)[:_TEXT]
    return text
