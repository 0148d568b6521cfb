"""A bank on disk: arrays without pickles, whole or not at all; a file that does not fit is made again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.cache import read_arrays, write_whole
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.simulator import Added, Point

if TYPE_CHECKING:
    from app.gap.bank import Bank

_ARRAYS = ("sound", "sound_changes", "changes")
MOST_BYTES = 100_000_000
"""Of a bank's arrays; a real one has less than one."""


def read_bank(path: Path, key: str) -> Bank | None:
    """Return the bank that a file holds for this key, None where there is no such file, or it is damaged or foreign."""
    data = read_arrays(path, MOST_BYTES)
    if data is None:
        return None
    try:
        about = json.loads(str(data["about"]))
        return _checked(about, {name: data[name] for name in _ARRAYS}) if about["key"] == key else None
    except (ValueError, KeyError, TypeError, IndexError):
        return None


def write_bank(path: Path, key: str, bank: Bank) -> None:
    """Write a bank beside its place and move it there."""
    about = {
        "key": key,
        "point": [bank.point.speed_rpm, bank.point.torque_nm],
        "feature_names": bank.feature_names,
        "change_names": bank.change_names,
        "added": [_plain(a) for a in bank.added],
        "left_out": [[_plain(a), why] for a, why in bank.left_out],
    }
    arrays: dict[str, Any] = {name: getattr(bank, name) for name in _ARRAYS}
    try:
        write_whole(path, lambda file: np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays))
    except InputError as error:
        raise InputError(error.what, where=str(path.parent), remedy="choose another folder with --cache") from None


def _checked(about: dict[str, Any], arrays: dict[str, FloatArray]) -> Bank | None:
    from app.gap.bank import Bank

    names, changes = tuple(about["feature_names"]), tuple(about["change_names"])
    added = tuple(_added(row) for row in about["added"])
    sound, again, changed = (arrays[name] for name in _ARRAYS)
    n, m = len(names), len(changes)
    shapes = sound.ndim == again.ndim == 2 and changed.ndim == 3
    if not shapes or sound.shape[1] != n or again.shape != (len(sound), m) or changed.shape[::2] != (len(added), m):
        return None
    if any(a.dtype != np.float64 for a in arrays.values()):
        return None
    left_out = tuple((_added(row), str(why)) for row, why in about["left_out"])
    return Bank(Point(*map(float, about["point"])), names, changes, sound, again, added, changed, left_out)


def _plain(added: Added) -> list[Any]:
    return [added.name, added.severity, dict(added.options)]


def _added(row: list[Any]) -> Added:
    name, severity, options = row
    return Added(str(name), float(severity), dict(options))
