"""Reads MATLAB's MAT files of version 5 (saved with -v6 or -v7)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gearsig.recording.formats.mat5_elements import variables
from gearsig.recording.formats.mat5_values import Unreadable
from gearsig.recording.formats.writers import OWN_NAME
from gearsig.recording.metadata import table_from_metadata
from gearsig.recording.named_arrays import NamedArrays, table_from_arrays
from gearsig.recording.raw_table import NumberArray, RawTable

READER = "gearsig MAT v5 reader"


def read_mat5(path: Path) -> RawTable:
    """Return the signals of a MAT file.

    Variables and fields of structs become channels if they are vectors or matrices; single numbers named like a
    sampling rate (fs, sr, SampFreq, dt, …) give the rate. A variable that stands in the file twice is taken from the
    copy that is not all zeros.

    Raises
    ------
    InputError
        If the file is damaged, holds only objects or text, or would not fit into memory.
    """
    where = path.name
    values, notes = _load(path)
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    unreadable: list[str] = []
    for name, value in values.items():
        _flatten(name, value, arrays, texts, unreadable)
    if OWN_NAME in texts and "samples" in arrays:
        return table_from_metadata(texts[OWN_NAME], list(arrays["samples"].T), READER, where)
    if unreadable:
        notes.append(f"sparse arrays, functions or objects were left out: {', '.join(unreadable[:8])}")
    return table_from_arrays(NamedArrays(arrays, texts, warnings=tuple(notes)), READER, where)


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the variables by name; among copies the last that is not blank, with a note."""
    chosen: dict[str, Any] = {}
    doubled: dict[str, None] = {}
    differ: dict[str, None] = {}
    for name, value in variables(path):
        if name in chosen:
            doubled[name] = None
            if _is_blank(value):
                continue
            if not _is_blank(chosen[name]) and not _equal(value, chosen[name]):
                differ[name] = None
        chosen[name] = value
    notes = []
    if doubled:
        names = ", ".join(doubled)
        notes.append(f"variable(s) {names} stand in the file more than once: the copy that is not all zeros was taken")
    if differ:
        notes.append(f"the copies of {', '.join(differ)} differ: the last was taken")
    return chosen, notes


def _is_blank(value: Any) -> bool:
    """Whether an array is empty or all zeros; a struct or cell is if all its numbers are."""
    if isinstance(value, dict):
        return all(_is_blank(item) for item in value.values())
    if isinstance(value, list):
        return all(_is_blank(item) for item in value)
    return not isinstance(value, np.ndarray) or not value.any()


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return bool(np.array_equal(a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_equal(a[name], b[name]) for name in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_equal, a, b))
    return type(a) is type(b) and (isinstance(a, Unreadable) or bool(a == b))


def _flatten(
    path: str, value: Any, arrays: dict[str, NumberArray], texts: dict[str, str], unreadable: list[str]
) -> None:
    """Collect numbers and texts from nested structs and cells under their paths."""
    if isinstance(value, dict):
        for name, item in value.items():
            _flatten(f"{path}.{name}", item, arrays, texts, unreadable)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _flatten(path if len(value) == 1 else f"{path}({i + 1})", item, arrays, texts, unreadable)
    elif isinstance(value, str):
        texts[path] = value
    elif isinstance(value, Unreadable):
        unreadable.append(path or "an object")
    elif value.size and value.ndim <= 2:
        arrays[path] = value
