"""What is fitted to a machine, as a table of a preset file and back; files are not trusted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gearsig.errors import InputError
from gearsig.rig.toml import from_table, to_table
from gearsig.rig.types import Bearing
from sims.gear_pair.installed import HousingMode, Installed, Pickup, SensorSeat

_LISTS = {"bearings": Bearing, "sensors": SensorSeat, "modes": HousingMode}
_KEYS = ("shafts", "pickup", *_LISTS)
_PLACE = "[installed]"


def table_of(installed: Installed) -> dict[str, Any]:
    """Return what is fitted as plain tables; `installed_of` reads them back."""
    lists = {name: [to_table(item) for item in getattr(installed, name)] for name in _LISTS}
    return {"shafts": list(installed.shafts), "pickup": to_table(installed.pickup), **lists}


def installed_of(table: Mapping[str, Any]) -> Installed:
    """Read what is fitted from plain tables.

    Raises
    ------
    InputError
        If a key is missing or not known, or a value does not fit.
    """
    if set(table) != set(_KEYS):
        raise InputError(f"has the keys {', '.join(map(str, table))}", where=_PLACE, allowed=", ".join(_KEYS))
    shafts = table["shafts"]
    if not isinstance(shafts, list) or len(shafts) != 2 or not all(isinstance(name, str) for name in shafts):
        raise InputError(f"shafts is {shafts!r}", where=_PLACE, allowed="two names")
    lists = {name: _items(kind, table[name], f"[[installed.{name}]]") for name, kind in _LISTS.items()}
    return Installed((shafts[0], shafts[1]), pickup=from_table(Pickup, table["pickup"], "[installed.pickup]"), **lists)


def _items(kind: type, rows: object, where: str) -> tuple[Any, ...]:
    if not isinstance(rows, list):
        raise InputError("is not a list of tables", where=where)
    return tuple(from_table(kind, row, f"{where} {i}") for i, row in enumerate(rows, 1))
