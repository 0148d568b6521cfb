"""ASAM MDF files, version 3 and 4, of vehicle and test-bench loggers; needs the extra `gearsig[mf4]`."""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures.process import BrokenProcessPool
from contextlib import redirect_stderr, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.processes import call_apart
from gearsig.recording._limits import FREE_BYTES, MAX_RATIO, check_memory
from gearsig.recording._table import NumberArray, RawColumn, RawTable
from gearsig.recording.formats._format import FileFormat, begins

READER = "gearsig MF4 reader"


def read_mf4(path: Path) -> RawTable:
    """Return the fastest channels of an MDF file, scaled as it states, with their time.

    Each group of channels has its own time. The group with the most samples is used, and others with the same times;
    slower ones are left out with a warning.

    Raises
    ------
    InputError
        If `asammdf` is not installed, or the file is damaged, holds no numbers or does not fit into memory.
    """
    where = path.name
    if find_spec("asammdf") is None:
        raise InputError(
            "MF4 files are read by the package asammdf, which is not installed",
            where=where,
            remedy="pip install 'gearsig[mf4]', or export as HDF5 or MAT",
        )
    check_memory(4 * path.stat().st_size, where)
    try:  # its compiled parts trust the file: a damaged one can end the process
        call_apart(_load, longest_s=60.0)  # takes seconds, once
        size = path.stat().st_size
        most_bytes = 2 * max(FREE_BYTES, MAX_RATIO * size)
        return call_apart(_read, path, longest_s=4.0 + 1e-6 * size, most_bytes=most_bytes)
    except (BrokenProcessPool, MemoryError):
        raise InputError(
            "is damaged: its reader crashes, does not finish, or needs far more memory than the file can hold",
            where=where,
            allowed="a complete MF4 file",
        ) from None


def _load() -> None:
    import logging

    import asammdf  # noqa: F401

    logging.getLogger("asammdf").disabled = True  # it logs errors of damaged files, which are reported once, here


def _read(path: Path) -> RawTable:
    from asammdf import MDF

    sys.unraisablehook = lambda _: None  # destructors of half-opened files fail; this process does nothing else
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()), MDF(str(path)) as file:
        signals = [s for s in file.iter_channels(skip_master=True) if s.samples.dtype.kind in "fiub"]
    signals = [s for s in signals if s.samples.ndim == 1 and len(s.samples) > 1]
    if not signals:
        raise InputError("holds no signal of numbers", where=path.name, remedy="check the channels of the measurement")
    time: NumberArray = max(signals, key=lambda s: len(s.samples)).timestamps
    kept = [s for s in signals if np.array_equal(s.timestamps, time)]
    slower = [str(s.name) for s in signals if not np.array_equal(s.timestamps, time)]
    notes = (f"channels at other times were left out: {', '.join(slower[:8])}",) if slower else ()
    return RawTable(_columns(kept), READER, time=RawColumn("time", time, "s"), warnings=notes)


def _columns(signals: list[Any]) -> tuple[RawColumn, ...]:
    """Return the channels, named as in the file; names used more than once are numbered."""
    n_used = Counter(str(s.name) for s in signals)
    return tuple(
        RawColumn(f"{s.name} ({i})" if n_used[str(s.name)] > 1 else str(s.name), s.samples, str(s.unit or ""))
        for i, s in enumerate(signals, 1)
    )


MF4 = FileFormat("MF4", (".mf4", ".mdf"), begins("MF4", b"MDF     ", b"UnFinMF "), read_mf4)
