"""Results as dictionaries, lists, texts and numbers, which is what JSON knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from gearsig.formatting import rounded

Json = dict[str, Any]


def members(value: object, *names: str) -> Json:
    """Return attributes and properties of a value by name, in this order, each as `plain` writes it.

    Examples
    --------
    >>> members(1.0 + 2.0j, "real", "imag")
    {'real': 1.0, 'imag': 2.0}
    """
    return {name: plain(getattr(value, name)) for name in names}


def plain(value: Any, *, arrays: bool = True) -> Any:
    """Return a value as JSON knows it: dataclasses as their fields, numbers of nine digits, nan and infinity as null.

    Parameters
    ----------
    value : object
    arrays : bool
        Whether arrays come as lists; otherwise as ``{"shape": […]}``.
    """
    if isinstance(value, np.ndarray):
        return _array(value) if arrays else {"shape": list(value.shape)}
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name), arrays=arrays) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item, arrays=arrays) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, arrays=arrays) for item in value]
    return _scalar(value)


def _scalar(value: Any) -> str | bool | float | None:
    if isinstance(value, Enum):
        return str(value.value)
    if value is None or isinstance(value, (str, bool)):
        return value
    return int(value) if isinstance(value, (int, np.integer)) else rounded(value)


def _array(values: np.ndarray[Any, np.dtype[Any]]) -> list[Any]:
    if values.ndim > 1:
        return [_array(row) for row in values]
    return [rounded(value) for value in values.tolist()]
