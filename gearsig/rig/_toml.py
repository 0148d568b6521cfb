"""Rig files: TOML in, TOML out."""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress
from dataclasses import MISSING, fields
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, get_args

from gearsig.cache import write_whole
from gearsig.checks import known_name, short, type_hints_of
from gearsig.errors import InputError
from gearsig.rig._bearing import Bearing
from gearsig.rig._contact import ToothContact
from gearsig.rig._types import (
    ConstantSpeed,
    EncoderChannel,
    GearPair,
    MachineSize,
    OperatingPoint,
    PulseTimes,
    Rig,
    Sensor,
    Shaft,
    SpeedChannel,
    SpeedSource,
    TachometerChannel,
)

MAX_TOML_BYTES = 1_000_000
MAX_TABLES = 1000
"""A rig file or preset is a page or two of text; anything larger is not one."""

# Seventeen dotted names: parsing time grows with the square of their number. Matches start only at a name's beginning.
_DEEP_KEY = re.compile(r"(?<![\w\"'-])[\w\"'-]++(?:[ \t]*+\.[ \t]*+[\w\"'-]++){16}")

_LISTS = {"shaft": Shaft, "pair": GearPair, "bearing": Bearing, "sensor": Sensor}
_PLAIN = ("name", "sources", "assumed", "sampling_rate_hz")
_SPEED_SOURCES: dict[str, type] = {
    "constant": ConstantSpeed,
    "tachometer": TachometerChannel,
    "encoder": EncoderChannel,
    "speed channel": SpeedChannel,
}


def read_rig(path: str | Path) -> Rig:
    """Read a rig file.

    Parameters
    ----------
    path : str or Path
        A TOML file; the README lists its tables and keys. Without [[shaft]] tables, the pairs name the shafts. Pairs
        without a name are called "stage 1", "stage 2", … in order.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or has an unknown key or an unsuitable value. The error names the
        file, table and key, and the closest known key.
    """
    path = Path(path)
    return rig_from_dict(read_toml(path, remedy="`gearsig rig example` prints one to start from"), where=path.name)


def read_toml(path: Path, *, remedy: str = "") -> dict[str, Any]:
    """Return the tables of a TOML file from an untrusted source.

    Raises
    ------
    InputError
        If it cannot be read, is longer than 1 MB, is nested too deeply, or is not valid TOML in UTF-8.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_TOML_BYTES + 1)
        text = data.decode("utf-8-sig") if len(data) <= MAX_TOML_BYTES else ""
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except UnicodeDecodeError:
        raise InputError("is not text in UTF-8", where=path.name, remedy="save it as UTF-8") from None
    if len(data) > MAX_TOML_BYTES:
        raise InputError("is too long", where=path.name, allowed="up to 1 MB of TOML")
    return parse_toml(text, path.name, remedy=remedy)


def parse_toml(text: str, where: str, *, remedy: str = "") -> dict[str, Any]:
    """Return the tables of a TOML text from an untrusted source.

    Raises
    ------
    InputError
        If it is nested too deeply or is not valid TOML.
    """
    deep = _DEEP_KEY.search(text)
    if deep is not None:
        raise InputError(f"{deep[0][:40]!r} is too deep", where=where, allowed="keys of up to 16 names")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, numbers of thousands of digits, nesting
        problem = "it is nested too deep" if isinstance(error, RecursionError) else str(error).partition("; use sys")[0]
        raise InputError(f"is not valid TOML: {problem}", where=where, remedy=remedy) from None


def rig_file_beside(recording: str | Path) -> Path | None:
    """Return the rig file of the same name beside a recording (`x.toml` for `x.csv.gz`); None if there is none."""
    path = Path(recording)
    if not path.name:
        return None
    rig_file = path.with_name(f"{recording_stem(path.name)}.toml")
    try:
        return rig_file if rig_file.is_file() else None
    except (OSError, ValueError):  # the name is too long or not a valid one
        return None


def recording_stem(name: str) -> str:
    """Return a file's name without its extension.

    Examples
    --------
    >>> recording_stem("run.5Nm.csv.gz"), recording_stem("run.5Nm.toml"), recording_stem("run")
    ('run.5Nm', 'run.5Nm', 'run')
    """
    return Path(name.removesuffix(".gz")).stem


def rig_from_dict(data: dict[str, Any], where: str = "rig") -> Rig:
    """Build a rig from the tables of a rig file, or from any mapping of the same structure."""
    allowed = (*_LISTS, *_PLAIN, "operating_point", "speed", "contact", "machine")
    for key in data:
        known_name(key, allowed, f"there is no {key!r}", where=where)
    parts: dict[str, Any] = {}
    for name, kind in _LISTS.items():
        tables = data.get(name, [])
        if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
            raise InputError(f"{name!r} is not a list of tables", where=where, remedy=f"write [[{name}]]")
        if len(tables) > MAX_TABLES:
            raise InputError(f"{len(tables)} tables [[{name}]]", where=where, allowed=f"up to {MAX_TABLES}")
        if kind is GearPair:
            tables = [{"name": f"stage {i}"} | table for i, table in enumerate(tables, 1)]
        parts[name + "s"] = tuple(from_table(kind, t, f"{where}: [[{name}]] {i}") for i, t in enumerate(tables, 1))
    parts["shafts"] = _with_implied_shafts(parts["shafts"], parts["pairs"], parts["bearings"])
    if "operating_point" in data:
        parts["operating_point"] = from_table(OperatingPoint, data["operating_point"], f"{where}: [operating_point]")
    if "contact" in data:
        parts["contact"] = from_table(ToothContact, data["contact"], f"{where}: [contact]")
    if "machine" in data:
        parts["machine"] = from_table(MachineSize, data["machine"], f"{where}: [machine]")
    if "speed" in data:
        parts["speed"] = _speed(data["speed"], f"{where}: [speed]", parts.get("operating_point"))
    plain = {key: data[key] for key in _PLAIN if key in data}
    return from_table(Rig, plain, where, **parts)  # type: ignore[no-any-return]


def rig_to_dict(rig: Rig) -> dict[str, Any]:
    """Return tables from which `rig_from_dict` builds the same rig, without pulse times: they belong to a record."""
    data: dict[str, Any] = {key: value for key in _PLAIN if (value := _plain(getattr(rig, key)))}
    for name in _LISTS:
        items = [to_table(item) for item in getattr(rig, name + "s")]
        if items:
            data[name] = items
    if rig.operating_point != OperatingPoint():
        data["operating_point"] = to_table(rig.operating_point)
    if rig.contact is not None:
        data["contact"] = to_table(rig.contact)
    if rig.machine is not None:
        data["machine"] = to_table(rig.machine)
    if rig.speed is not None and not isinstance(rig.speed, PulseTimes):
        source = next(name for name, kind in _SPEED_SOURCES.items() if kind is type(rig.speed))
        data["speed"] = {"source": source} | to_table(rig.speed)
    return data


def write_rig(rig: Rig, path: str | Path) -> None:
    """Write `rig` as a rig file from which `read_rig` restores it."""
    import tomli_w

    text = tomli_w.dumps(rig_to_dict(rig))
    write_whole(Path(path), lambda file: file.write(text.encode()))


def _speed(table: Any, where: str, nominal: OperatingPoint | None) -> SpeedSource | None:
    if not isinstance(table, dict) or not isinstance(table.get("source"), str):
        raise InputError("has no source", where=where, allowed=", ".join((*_SPEED_SOURCES, "none")))
    source, values = table["source"], {k: v for k, v in table.items() if k != "source"}
    if source == "none":
        return None
    if source == "pulse times":
        raise InputError(
            "pulse times belong to one recording, not to the rig",
            where=where,
            remedy="give them with --tach-times FILE",
        )
    known_name(source, (*_SPEED_SOURCES, "none"), f"source is {source!r}", where=where)
    if _SPEED_SOURCES[source] is ConstantSpeed and "speed_rpm" not in values and nominal and nominal.speed_rpm:
        shaft = f' and shaft = "{nominal.shaft}"' if nominal.shaft else ""
        raise InputError(
            "speed_rpm must be given",
            where=where,
            remedy=f"write speed_rpm = {nominal.speed_rpm:g}{shaft} if the machine turned at its nominal speed, "
            "which [operating_point] states",
        )
    return from_table(_SPEED_SOURCES[source], values, where)  # type: ignore[no-any-return]


def from_table(kind: type, table: Any, where: str, **ready: Any) -> Any:
    """Build a dataclass from a TOML table, checking keys and types; `where` names the table in errors."""
    if not isinstance(table, dict):
        raise InputError("is not a table", where=where, allowed="key = value lines")
    known = {f.name: f for f in fields(kind)}
    hints = type_hints_of(kind)
    values = {}
    for key, value in table.items():
        if key not in known:
            known_name(key, known, f"there is no key {key!r}", where=where, remedy=_elsewhere(key))
        values[key] = _typed(value, hints[key], f"{where}: {key}")
    missing = [
        n for n, f in known.items() if f.default is MISSING and f.default_factory is MISSING and n not in values | ready
    ]
    if missing:
        raise InputError(f"{', '.join(missing)} must be given", where=where)
    try:
        return kind(**values, **ready)
    except InputError as error:
        place = f"{where}: {error.where}" if error.where and error.where != "rig" else where
        raise InputError(error.what, where=place, allowed=error.allowed, remedy=error.remedy) from None


def _elsewhere(key: str) -> str:
    """Say in which other tables of a rig file a key belongs; empty if in none."""
    tables = {f"[[{name}]]": kind for name, kind in _LISTS.items()}
    tables |= {"[operating_point]": OperatingPoint, "[contact]": ToothContact, "[machine]": MachineSize}
    places = [table for table, kind in tables.items() if any(f.name == key for f in fields(kind))]
    return f"it belongs in {' or '.join(places)}" if places else ""


def _typed(value: Any, hint: Any, where: str) -> Any:
    """Convert a value to its field's type, or say which type is expected. TOML has no null, so None never occurs."""
    types = [t for t in get_args(hint) if t is not NoneType] if isinstance(hint, UnionType) else [hint]
    kind = types[0]
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        with suppress(OverflowError):
            return float(value)
    if kind in (str, bool) and isinstance(value, kind):
        return value
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if get_args(kind)[:1] == (str,) and isinstance(value, list) and all(isinstance(v, str) for v in value):
        return tuple(value)
    if get_args(kind)[:1] == (float,) and isinstance(value, list):
        return tuple(_typed(v, float, where) for v in value)
    names = {float: "a number", int: "a whole number", str: "text in quotes", bool: "true or false"}
    raise InputError(f"is {short(value)}", where=where, allowed=names.get(kind, "a list of texts"))


def _with_implied_shafts(
    shafts: tuple[Shaft, ...], pairs: tuple[GearPair, ...], bearings: tuple[Bearing, ...]
) -> tuple[Shaft, ...]:
    """Add shafts that gear pairs name; without any shafts or pairs, those that bearings name.

    A shaft that only a bearing names is more likely a misspelling than another shaft.
    """
    names = [n for p in pairs for n in (p.driver, p.driven)] if pairs else [b.shaft for b in bearings if not shafts]
    new = [name for name in dict.fromkeys(names) if name not in {s.name for s in shafts}]
    if shafts and new:
        return shafts  # some are listed: the rig's own check reports a name that is missing
    return (*shafts, *(Shaft(name) for name in new))


def to_table(item: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that differ from their defaults; `from_table` restores it from them."""
    return {f.name: _plain(v) for f in fields(item) if (v := getattr(item, f.name)) is not None and v != f.default}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
