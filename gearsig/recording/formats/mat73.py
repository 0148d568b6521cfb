"""Reads MATLAB's MAT files of version 7.3, which are HDF5 files with MATLAB's conventions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gearsig.recording.foreign_errors import foreign_errors
from gearsig.recording.formats.hdf5 import load_dataset, own_datasets
from gearsig.recording.named_arrays import NamedArrays, table_from_arrays
from gearsig.recording.raw_table import NumberArray, RawTable

READER = "gearsig MAT v7.3 reader"
MAX_TEXT = 10_000


def read_mat73(path: Path) -> RawTable:
    """Return the signals of a MAT v7.3 file; names are treated as in MAT v5.

    Structs are followed, cells and struct arrays are not: MATLAB keeps those behind references.

    Raises
    ------
    InputError
        If the file is damaged, holds no plain arrays, or would not fit into memory.
    """
    import h5py

    where = path.name
    arrays: dict[str, NumberArray] = {}
    texts: dict[str, str] = {}
    skipped: list[str] = []
    with foreign_errors(where, "MAT v7.3"), h5py.File(path, "r", locking=False) as file:
        for name, dataset in own_datasets(file, skipped):
            if dataset.size == 0 or dataset.ndim > 2 or "MATLAB_empty" in dataset.attrs:
                continue
            if _matlab_class(dataset) == "char":
                texts[name] = _text(dataset)
            elif dataset.dtype.kind in "fiub":
                # MATLAB stores columns first, HDF5 rows first: every matrix arrives transposed.
                arrays[name] = np.atleast_2d(load_dataset(dataset, where)).T
            else:
                skipped.append(name)
    notes = (f"left out (cells, objects, complex numbers or links): {', '.join(skipped[:8])}",) if skipped else ()
    return table_from_arrays(NamedArrays(arrays, texts, warnings=notes), READER, where)


def _matlab_class(dataset: Any) -> str:
    value = dataset.attrs.get("MATLAB_class", b"")
    return value.decode("ascii", errors="replace") if isinstance(value, bytes) else str(value)


def _text(dataset: Any) -> str:
    """Return a char array, which MATLAB stores as UTF-16 code units."""
    if dataset.size > MAX_TEXT or dataset.dtype.kind != "u":
        return ""
    units = np.asarray(dataset[()]).reshape(-1).astype("<u2")
    return units.tobytes().decode("utf-16-le", errors="replace").strip()
