"""Time signals in universal files (data set 58, ASCII or binary)."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.recording._limits import check_memory
from gearsig.recording._table import RawColumn, RawTable
from gearsig.recording.formats._format import FileFormat

READER = "gearsig UFF58 reader"
TIME_RESPONSE = 1
# Directions as numbered by data set 58.
DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z"}
# Specific data types of data set 58 that are quantities here.
QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force", 15: "sound_pressure"}


def read_uff58(path: Path) -> RawTable:
    """Return the time responses (function type 0 or 1) of a universal file.

    A channel has the name of the response, or else its node and direction. Other data sets are left out.

    Raises
    ------
    InputError
        If the file is damaged, holds no time signal, or its signals have several rates.
    """
    import pyuff

    where = path.name
    check_memory(8 * path.stat().st_size, where)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = pyuff.UFF(str(path))
        numbers = [i for i, kind in enumerate(file.get_set_types()) if int(kind) == 58]
        sets = [file.read_sets(i) for i in numbers]
    signals = [s for s in sets if int(s.get("func_type", 0)) in (0, TIME_RESPONSE) and not np.iscomplexobj(s["data"])]
    if not signals:
        raise InputError(
            f"holds {counted(len(sets), 'function')}, none of them a time signal",
            where=where,
            allowed="data set 58 with function type 1 (time response)",
            remedy="export the time signals, not spectra",
        )
    rate_hz = _one_rate(signals, where)
    time = None if rate_hz is not None else RawColumn("time", np.asarray(signals[0]["x"], dtype=np.float64), "s")
    return RawTable(_columns(signals), READER, sampling_rate_hz=rate_hz, time=time)


def _one_rate(signals: list[dict[str, Any]], where: str) -> float | None:
    """Return the rate in Hz of evenly spaced signals; None if each sample has its own time."""
    if any(int(s.get("abscissa_spacing", 1)) == 0 for s in signals):
        return None
    steps_s = [float(s.get("abscissa_inc", 0.0)) for s in signals]
    if min(steps_s) <= 0 or max(steps_s) > 1.001 * min(steps_s):
        raise InputError(
            f"the sampling intervals are {min(steps_s):g} to {max(steps_s):g} s",
            where=where,
            allowed="one interval above 0 s",
            remedy="split the file, or give the rate when exporting",
        )
    return 1.0 / steps_s[0]


def _columns(signals: list[dict[str, Any]]) -> tuple[RawColumn, ...]:
    columns = []
    for i, signal in enumerate(signals):
        direction = DIRECTIONS.get(int(signal.get("rsp_dir", 0)), "")
        label = str(signal.get("rsp_ent_name", "")).strip()
        label = "" if label == "NONE" else label
        name = label or f"{signal.get('rsp_node', i + 1)}{direction}"
        unit = str(signal.get("ordinate_axis_units_lab", "")).strip()
        quantity = QUANTITIES.get(int(signal.get("ordinate_spec_data_type", 0)), "")
        columns.append(RawColumn(name, np.asarray(signal["data"]), "" if unit == "NONE" else unit, quantity))
    names = [c.name for c in columns]
    if len(set(names)) < len(names):
        columns = [replace(c, name=f"{c.name} ({i + 1})") for i, c in enumerate(columns)]
    return tuple(columns)


def _sniff(head: bytes) -> str:
    return "UFF58" if re.match(rb"\A\s*-1[ \t]*\r?\n\s{0,5}\d{1,5}[b ]?", head) else ""


UFF58 = FileFormat("UFF58", (".uff", ".unv", ".uf", ".u58"), _sniff, read_uff58)
