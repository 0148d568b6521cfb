"""Published and demonstration machines, one TOML file each with sources and assumptions, and users' preset files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gearsig.checks import closest_match_hint, known_name, not_negative
from gearsig.errors import InputError
from gearsig.rig import from_table, read_toml
from sims.effects import EffectSetting
from sims.machine import Operation

if TYPE_CHECKING:
    from sims.simulator import ParameterValue

__all__ = ["Preset", "is_file", "preset", "preset_text", "presets", "read_preset"]

_TABLES = ("about", "parameters", "operation", "effects", "installed")
_OPTIONAL = _TABLES[3:]


@dataclass(frozen=True)
class Preset:
    """A published or demonstration machine.

    Parameters
    ----------
    name, model, title : str
    sources : tuple of str
        Sources of its numbers.
    assumed : tuple of str
        Assumptions that no source states.
    does_not_represent : tuple of str
        What it must not be taken to represent.
    parameters : mapping
        Values that differ from the model's defaults.
    speed_rpm, torque_nm : float
        Of the input shaft.
    effects : tuple of EffectSetting
        Effects that the machine has by default.
    installed : mapping
        Fittings in addition to the parameters, as its simulator reads them; empty: the usual ones.
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
    effects: tuple[EffectSetting, ...] = ()
    installed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def operation(self) -> Operation:
        """The preset's constant speed and torque."""
        return Operation.steady(self.speed_rpm, self.torque_nm)


@dataclass(frozen=True)
class _About:
    """The table [about] of a preset's file."""

    model: str
    title: str
    sources: tuple[str, ...]
    assumed: tuple[str, ...]
    does_not_represent: tuple[str, ...]


@dataclass(frozen=True)
class _Point:
    """The table [operation]."""

    speed_rpm: float
    torque_nm: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            not_negative(value, name)


@cache
def presets(model: str) -> dict[str, Preset]:
    """Return the presets of a model by name, in alphabetical order."""
    all_presets = [read_preset(path) for path in sorted(Path(__file__).parent.glob("*.toml"))]
    return {preset.name: preset for preset in all_presets if preset.model == model}


def preset(model: str, name: str) -> Preset:
    """Return the preset `name` of a model; an empty name gives its first, a name ending in .toml is a file."""
    if is_file(name):
        candidate = read_preset(Path(name))
        if candidate.model != model:
            raise InputError(
                f"is a preset of the model {candidate.model!r}", where=f"{candidate.name}.toml", allowed=f"{model!r}"
            )
        return candidate
    of_model = presets(model)
    if not name and of_model:
        return next(iter(of_model.values()))
    if name not in of_model:
        raise InputError(
            f"{model} has no preset {name!r}",
            allowed=", ".join([*of_model, "or a file, NAME.toml"]),
            remedy=closest_match_hint(name, of_model),
        )
    return of_model[name]


def is_file(name: str) -> bool:
    """Say whether a preset name is that of a file."""
    return name.lower().endswith(".toml")


def read_preset(path: Path) -> Preset:
    """Read a preset file; the preset is named after the file.

    Raises
    ------
    InputError
        If the file cannot be read, or a table or key is missing, unknown or malformed. Values of parameters, effects
        and fittings are checked by the simulator.
    """
    data, where = read_toml(path), path.name
    for name in data:
        known_name(name, _TABLES, f"there is no key {name!r}", where=where)
    if missing := [name for name in _TABLES if name not in (*data, *_OPTIONAL)]:
        raise InputError(f"{', '.join(missing)} must be given", where=where)
    about: _About = from_table(_About, data["about"], f"{where}: [about]")
    operation: _Point = from_table(_Point, data["operation"], f"{where}: [operation]")
    return Preset(
        path.stem,
        **vars(about),
        **vars(operation),
        parameters=MappingProxyType(_values(data["parameters"], f"{where}: [parameters]")),
        effects=_effects(data.get("effects", []), f"{where}: [[effects]]"),
        installed=MappingProxyType(_table(data.get("installed", {}), f"{where}: [installed]")),
    )


def _effects(rows: object, where: str) -> tuple[EffectSetting, ...]:
    if not isinstance(rows, list):
        raise InputError("is not a list of tables", where=where, allowed="[[effects]] with name, severity, options")
    settings = []
    for row in rows:
        stated = dict(_table(row, where))
        options = _values(stated.pop("options", {}), f"{where}: options")
        settings.append(from_table(EffectSetting, stated, where, options=options))
    return tuple(settings)


def _values(table: object, where: str) -> dict[str, ParameterValue]:
    values = _table(table, where)
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise InputError(f"{name} is {value!r}", where=where, allowed="a number or a text in quotes")
    return values


def _table(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError("is not a table", where=where, allowed="key = value lines")
    return value


# Writing a preset as a file that `read_preset` reads back to the same machine.


def preset_text(preset: Preset, comments: Sequence[str] = ()) -> str:
    """Return a preset as TOML, without its name, which is that of the file.

    Parameters
    ----------
    preset : Preset
    comments : sequence of str
        Comment lines at the top.
    """
    import tomli_w

    tables: dict[str, Any] = {
        "about": {
            "model": preset.model,
            "title": preset.title,
            "sources": list(preset.sources),
            "assumed": list(preset.assumed),
            "does_not_represent": list(preset.does_not_represent),
        },
        "parameters": dict(preset.parameters),
        "operation": {"speed_rpm": preset.speed_rpm, "torque_nm": preset.torque_nm},
    }
    if preset.effects:
        tables["effects"] = [
            {"name": e.name, "severity": e.severity, "options": dict(e.options)} for e in preset.effects
        ]
    if preset.installed:
        tables["installed"] = dict(preset.installed)
    lines = [" ".join(text.split()) for text in comments]
    return "".join(f"# {line}\n" for line in lines) + ("\n" if lines else "") + tomli_w.dumps(tables)
