"""Reads MATLAB's MAT files of version 5 (saved with -v6 or -v7)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.foreign_errors import foreign_errors
from gearsig.recording.formats.mat5_elements import elements
from gearsig.recording.formats.writers import OWN_NAME
from gearsig.recording.metadata import table_from_metadata
from gearsig.recording.named_arrays import NamedArrays, table_from_arrays
from gearsig.recording.raw_table import NumberArray, RawTable

READER = "gearsig MAT v5 reader"

MAX_DEPTH = 6


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
    with foreign_errors(where, "MAT v5"):
        variables, notes = _load(path)
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    for name, value in variables.items():
        _flatten(name, value, arrays, texts, MAX_DEPTH)
    if OWN_NAME in texts and "samples" in arrays:
        return table_from_metadata(texts[OWN_NAME], list(arrays["samples"].T), READER, where)
    return table_from_arrays(NamedArrays(arrays, texts, warnings=tuple(notes)), READER, where)


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the variables by name; among copies the last that is not blank, with a note."""
    from scipy.io import loadmat

    chosen: dict[str, Any] = {}
    doubled: dict[str, None] = {}
    differ: dict[str, None] = {}
    for element in elements(path):
        loaded = loadmat(io.BytesIO(element))  # type: ignore[arg-type]  # the stubs know paths only
        for name, value in loaded.items():
            if name.startswith("__") or not isinstance(value, np.ndarray):
                continue
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
    """Whether an array is empty or all zeros; a struct is if all its numbers are."""
    if not isinstance(value, np.ndarray) or value.size == 0:
        return True
    if value.dtype.names:
        return all(_is_blank(item) for name in value.dtype.names for item in value[name].reshape(-1))
    return value.dtype.kind in "fiubc" and not value.any()


def _equal(a: Any, b: Any) -> bool:
    if a.dtype.names or b.dtype.names or a.dtype == object:
        return repr(a) == repr(b)
    return bool(np.array_equal(a, b))


def _flatten(path: str, value: Any, arrays: dict[str, NumberArray], texts: dict[str, str], depth: int) -> None:
    """Collect numbers and texts from nested structs and cells under their paths."""
    if not isinstance(value, np.ndarray) or value.size == 0:
        return
    if depth == 0:
        raise InputError(f"{path!r} is nested too deeply", allowed=f"up to {MAX_DEPTH} levels of structs and cells")
    if value.dtype.names:
        flat = value.reshape(-1)
        for i, element in enumerate(flat):
            base = path if len(flat) == 1 else f"{path}({i + 1})"
            for name in value.dtype.names:
                _flatten(f"{base}.{name}", element[name], arrays, texts, depth - 1)
    elif value.dtype == object:
        for i, element in enumerate(value.reshape(-1)):
            _flatten(path if value.size == 1 else f"{path}{{{i + 1}}}", element, arrays, texts, depth - 1)
    elif value.dtype.kind in "US":
        texts[path] = str(value.reshape(-1)[0]).strip()
    elif value.ndim <= 2:
        arrays[path] = value
