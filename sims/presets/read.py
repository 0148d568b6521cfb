"""Reads the presets that come with the simulators."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError
from sims.machine.operation import Operation
from sims.simulator import ParameterValue

_TABLES = ("about", "parameters", "operation")
_ABOUT = ("model", "title", "sources", "assumed", "does_not_represent")


@dataclass(frozen=True)
class Preset:
    """A machine that somebody published or that serves as an example.

    Parameters
    ----------
    name, model, title : str
    sources : tuple of str
        Where its numbers come from.
    assumed : tuple of str
        What no source states.
    does_not_represent : tuple of str
        What it must not be taken for.
    parameters : mapping
        What differs from the model's defaults.
    speed_rpm, torque_nm : float
        Of the input shaft.
    """

    name: str
    model: str
    title: str
    sources: tuple[str, ...]
    assumed: tuple[str, ...]
    does_not_represent: tuple[str, ...]
    parameters: MappingProxyType[str, ParameterValue]
    speed_rpm: float
    torque_nm: float

    @property
    def operation(self) -> Operation:
        """Its own speed and torque, constant."""
        return Operation.steady(self.speed_rpm, self.torque_nm)


@cache
def presets(model: str) -> dict[str, Preset]:
    """Return the presets of a model by name, in alphabetical order."""
    found = [read_preset(path) for path in sorted(Path(__file__).parent.glob("*.toml"))]
    return {preset.name: preset for preset in found if preset.model == model}


def preset(model: str, name: str) -> Preset:
    """Return the preset `name` of a model; an empty name is its first."""
    found = presets(model)
    if not name and found:
        return next(iter(found.values()))
    if name not in found:
        raise InputError(
            f"{model} has no preset {name!r}",
            allowed=", ".join(found) or "none: it has no presets",
            remedy=closest_match_hint(name, found),
        )
    return found[name]


def read_preset(path: Path) -> Preset:
    """Read a preset; its name is that of the file.

    Raises
    ------
    InputError
        If a table or key is missing or not known. Parameters are checked by their simulator.
    """
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    _check_keys(data, _TABLES, path.name)
    about, operation = data["about"], data["operation"]
    _check_keys(about, _ABOUT, f"{path.name}: [about]")
    _check_keys(operation, ("speed_rpm", "torque_nm"), f"{path.name}: [operation]")
    return Preset(
        name=path.stem,
        model=about["model"],
        title=about["title"],
        sources=tuple(about["sources"]),
        assumed=tuple(about["assumed"]),
        does_not_represent=tuple(about["does_not_represent"]),
        parameters=MappingProxyType(dict(data["parameters"])),
        speed_rpm=float(operation["speed_rpm"]),
        torque_nm=float(operation["torque_nm"]),
    )


def _check_keys(table: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    if set(table) != set(keys):
        raise InputError(f"has the keys {', '.join(table)}", where=where, allowed=", ".join(keys))
