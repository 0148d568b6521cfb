"""Reads MATLAB's MAT files of version 5 (saved with -v6 or -v7)."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.foreign_errors import foreign_errors
from gearsig.recording.formats.mat5_size import check_mat5_size
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
        check_mat5_size(path)
        variables, notes = _load(path)
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    for name, value in variables.items():
        _flatten(name, value, arrays, texts, MAX_DEPTH)
    if OWN_NAME in texts and "samples" in arrays:
        return table_from_metadata(texts[OWN_NAME], list(arrays["samples"].T), READER, where)
    return table_from_arrays(NamedArrays(arrays, texts, warnings=tuple(notes)), READER, where)


def _load(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the variables by name, and what was noticed about doubled ones."""
    from scipy.io import loadmat, whosmat

    counts = Counter(name for name, *_ in whosmat(path))
    if max(counts.values(), default=0) > 1:
        return _load_doubled(path, counts)
    loaded = loadmat(path)
    return {name: value for name, value in loaded.items() if not name.startswith("__")}, []


def _load_doubled(path: Path, counts: Counter[str]) -> tuple[dict[str, Any], list[str]]:
    """Choose among variables that stand in the file twice: the copy with content, or the last."""
    from scipy.io import loadmat
    from scipy.io.matlab import varmats_from_mat

    chosen: dict[str, Any] = {}
    differ: set[str] = set()
    with path.open("rb") as file:
        for name, stream in varmats_from_mat(file):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # scipy repeats what is told below
                value = loadmat(stream).get(name)  # type: ignore[arg-type]  # the stubs know paths only
            both = name in chosen and not _is_blank(value) and not _is_blank(chosen[name])
            if both and not _equal(value, chosen[name]):
                differ.add(name)
            if name not in chosen or not _is_blank(value):
                chosen[name] = value
    doubled = ", ".join(name for name, n in counts.items() if n > 1)
    notes = [f"variable(s) {doubled} stand in the file more than once: the copy that is not all zeros was taken"]
    if differ:
        notes.append(f"the copies of {', '.join(sorted(differ))} differ: the last was taken")
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
