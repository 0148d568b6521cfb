"""The codec between dataclasses and JSON: members by field names or a layout's, values by type hints.

Numbers carry nine significant digits; nan and infinity, which JSON does not know, are null and read as nan.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from reprlib import repr as shortened
from types import NoneType, UnionType
from typing import Any, NoReturn, Union, get_args, get_origin, get_type_hints

import numpy as np

from gearsig import __version__
from gearsig.errors import InputError
from gearsig.formatting import rounded

Json = dict[str, Any]


@dataclass(frozen=True)
class Layout:
    """How a dataclass stands in a file where its members are not just its fields.

    Parameters
    ----------
    names : mapping
        Field → member, where they differ.
    inline : tuple of str
        Fields that are dataclasses whose members stand among the others.
    null_if_empty : tuple of str
        Fields with texts or arrays that are written as null where they are empty.
    left_out : tuple of str
        Fields that are not written; such a file is not read again.
    properties : tuple of str
        Properties that are written after the fields, for other programs.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    inline: tuple[str, ...] = ()
    null_if_empty: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    properties: tuple[str, ...] = ()


Layouts = Mapping[type, Layout]
_AS_FIELDS = Layout()


def head(schema: str, version: int = 1) -> Json:
    """Return the members that a file begins with: what it is, in which version, made by which gearsig."""
    return {"schema": schema, "schema_version": version, "gearsig_version": __version__}


def document(schema: str, content: Json) -> str:
    """Return a file's text: its head, and its content."""
    return json.dumps(head(schema) | plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def members(value: object, *names: str) -> Json:
    """Return attributes and properties of a value by name, in this order, each as `plain` writes it.

    Examples
    --------
    >>> members(1.0 + 2.0j, "real", "imag")
    {'real': 1.0, 'imag': 2.0}
    """
    return {name: plain(getattr(value, name)) for name in names}


def plain(value: Any, *, arrays: bool = True, layouts: Layouts | None = None) -> Any:  # noqa: PLR0911  one line per kind
    """Return a value as JSON knows it: dictionaries, lists, texts, numbers of nine digits and null.

    Parameters
    ----------
    value : object
    arrays : bool
        Whether arrays come as lists; otherwise as ``{"shape": […]}``.
    layouts : mapping, optional
        Dataclass → `Layout`; the others are written as their fields.
    """

    def written(part: Any) -> Any:
        return plain(part, arrays=arrays, layouts=layouts)

    if isinstance(value, np.ndarray):
        return [written(part) for part in value.tolist()] if arrays else {"shape": list(value.shape)}
    if is_dataclass(value):
        layout = (layouts or {}).get(type(value), _AS_FIELDS)
        result: Json = {}
        for item in fields(value):
            part = getattr(value, item.name)
            if item.name in layout.inline:
                result |= written(part)
            elif item.name not in layout.left_out:
                is_null = item.name in layout.null_if_empty and not len(part)
                result[layout.names.get(item.name, item.name)] = None if is_null else written(part)
        return result | {name: written(getattr(value, name)) for name in layout.properties}
    if isinstance(value, Mapping):
        return {str(key): written(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [written(part) for part in value]
    if isinstance(value, Enum):
        return str(value.value)
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, Path):
        return str(value)
    return int(value) if isinstance(value, (int, np.integer)) else rounded(value)


def from_plain(hint: Any, value: Any, where: str, layouts: Layouts | None = None) -> Any:  # noqa: PLR0911  one line per kind
    """Return what `plain` wrote: a value of type `hint`.

    Parameters
    ----------
    hint : type
        A dataclass, enumeration, `Path`, text, number, array, tuple or mapping of these, or a union with None.
    value : object
        As `json.loads` returns it; members that the dataclass does not know are passed over, so that later versions
        may add some.
    where : str
        Path of the value, for errors.
    layouts : mapping, optional
        As they were written with.

    Raises
    ------
    InputError
        If a value is of another type, or a member is missing whose field has no default.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        kinds = [kind for kind in arguments if kind is not NoneType]
        if value is None and NoneType in arguments:
            return None
        if len(kinds) > 1:
            kinds = [str] if str in kinds and isinstance(value, str) else [kind for kind in kinds if kind is not str]
        if kinds[0] in _JSON_NAMES and NoneType in arguments:
            return _typed(value, kinds[0], where, " or null")
        return from_plain(kinds[0], value, where, layouts)
    if is_dataclass(hint) and isinstance(hint, type):
        return _dataclass_from_plain(hint, _typed(value, dict, where), where, layouts)
    if origin is np.ndarray:
        parts = _typed(value, list, where)
        return np.array([from_plain(float, v, f"{where}[{i}]") for i, v in enumerate(parts)], dtype=np.float64)
    if origin is tuple:
        parts = _typed(value, list, where)
        kinds = [arguments[0]] * len(parts) if arguments[-1] is Ellipsis else list(arguments)
        if len(kinds) != len(parts):
            _fail(f"{where} has {len(parts)} values, not {len(kinds)}")
        return tuple(
            from_plain(k, v, f"{where}[{i}]", layouts) for i, (k, v) in enumerate(zip(kinds, parts, strict=True))
        )
    if isinstance(origin, type) and issubclass(origin, Mapping):
        parts = _typed(value, dict, where)
        return {key: from_plain(arguments[1], v, f"{where}.{key}", layouts) for key, v in parts.items()}
    if isinstance(hint, type) and issubclass(hint, (Enum, Path)):
        try:
            return hint(_typed(value, str, where))
        except ValueError:
            _fail(f"{where} is {shortened(value)}, which is not known")
    if hint is float:
        return _number(value, where)
    return _typed(value, hint, where)


def _dataclass_from_plain(kind: type, value: Json, where: str, layouts: Layouts | None) -> Any:
    layout = (layouts or {}).get(kind, _AS_FIELDS)
    hints = _hints(kind)
    result = {}
    for item in fields(kind):
        name = layout.names.get(item.name, item.name)
        if item.name in layout.inline:
            result[item.name] = from_plain(hints[item.name], value, where, layouts)
        elif name not in value:
            if not _has_default(item):
                _fail(f"{where} has no member {name!r}")
        elif value[name] is None and item.name in layout.null_if_empty:
            result[item.name] = "" if hints[item.name] is str else np.zeros(0)
        else:
            result[item.name] = from_plain(hints[item.name], value[name], f"{where}.{name}", layouts)
    return kind(**result)


def _has_default(item: Field[Any]) -> bool:
    return item.default is not MISSING or item.default_factory is not MISSING


_hints = cache(get_type_hints)


def _number(value: Any, where: str) -> float:
    if value is None:
        return float("nan")
    if type(value) not in (int, float):
        _fail(f"{where} is {shortened(value)}, not number or null")
    try:
        return float(value)
    except OverflowError:
        _fail(f"{where} is too large")


_JSON_NAMES = {dict: "object", list: "array", str: "string", bool: "boolean", int: "integer"}


def _typed(value: Any, kind: type, where: str, or_null: str = "") -> Any:
    if type(value) is not kind:  # not isinstance: True is no integer
        _fail(f"{where} is {shortened(value)}, not {_JSON_NAMES[kind]}{or_null}")
    return value


def _fail(what: str) -> NoReturn:
    raise InputError(what, remedy="make the file anew")
