"""A model's parameters as plain values, for `Recording.truth`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def plain(part: Any) -> Any:
    """Return dataclasses as dictionaries with their class's name under "kind", tuples as lists, the rest unchanged."""
    if is_dataclass(part) and not isinstance(part, type):
        return {"kind": type(part).__name__} | {f.name: plain(getattr(part, f.name)) for f in fields(part)}
    if isinstance(part, Mapping):
        return {key: plain(value) for key, value in part.items()}
    if isinstance(part, (tuple, list)):
        return [plain(item) for item in part]
    return part
