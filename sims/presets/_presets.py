"""Reads presets: those that come with the simulators, and files that people give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gearsig.checks import closest_match_hint, not_negative, short
from gearsig.errors import InputError
from gearsig.rig import read_toml
from sims.effects import EffectSetting
from sims.machine import Operation

if TYPE_CHECKING:
    from sims.simulator import ParameterValue

_TABLES = ("about", "parameters", "operation")
_ABOUT = ("model", "title", "sources", "assumed", "does_not_represent")
_OPERATION = ("speed_rpm", "torque_nm")
_OPTIONAL = ("effects", "installed")
_EFFECT = ("name", "severity", "options")


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
    effects : tuple of EffectSetting
        That the machine has from the start.
    installed : mapping
        What is fitted besides the parameters, as its simulator reads it; empty: what is usual.
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
        """Its own speed and torque, constant."""
        return Operation.steady(self.speed_rpm, self.torque_nm)


@cache
def presets(model: str) -> dict[str, Preset]:
    """Return the presets of a model by name, in alphabetical order."""
    all_presets = [read_preset(path) for path in sorted(Path(__file__).parent.glob("*.toml"))]
    return {preset.name: preset for preset in all_presets if preset.model == model}


def preset(model: str, name: str) -> Preset:
    """Return the preset `name` of a model; an empty name is its first, one that ends in .toml is a file."""
    if is_file(name):
        return _of_model(read_preset(Path(name)), model)
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
    """Say whether a preset is asked for by its file."""
    return name.lower().endswith(".toml")


def read_preset(path: Path) -> Preset:
    """Read a preset; its name is that of the file.

    Raises
    ------
    InputError
        If the file cannot be read, or a table or key is missing, not known or of another form. Values of parameters,
        effects and of what is installed are checked by their simulator.
    """
    data, where = read_toml(path), path.name
    _check_keys(data, _TABLES, where, _OPTIONAL)
    about, operation = (_table(data[name], f"{where}: [{name}]") for name in ("about", "operation"))
    _check_keys(about, _ABOUT, f"{where}: [about]")
    _check_keys(operation, _OPERATION, f"{where}: [operation]")
    sources, assumed, lacking = (_texts(about[name], f"{where}: {name} of [about]") for name in _ABOUT[2:])
    speed, torque = (not_negative(_number(operation[name], f"{where}: {name}"), name) for name in _OPERATION)
    return Preset(
        name=path.stem,
        model=_text(about["model"], f"{where}: model of [about]"),
        title=_text(about["title"], f"{where}: title of [about]"),
        sources=sources,
        assumed=assumed,
        does_not_represent=lacking,
        speed_rpm=speed,
        torque_nm=torque,
        parameters=MappingProxyType(_values(data["parameters"], f"{where}: [parameters]")),
        effects=_effects(data.get("effects", []), f"{where}: [[effects]]"),
        installed=MappingProxyType(_table(data.get("installed", {}), f"{where}: [installed]")),
    )


def _of_model(candidate: Preset, model: str) -> Preset:
    if candidate.model != model:
        raise InputError(
            f"is a preset of the model {candidate.model!r}", where=f"{candidate.name}.toml", allowed=f"{model!r}"
        )
    return candidate


def _effects(rows: object, where: str) -> tuple[EffectSetting, ...]:
    if not isinstance(rows, list):
        raise InputError("is not a list of tables", where=where, allowed="[[effects]] with name, severity, options")
    settings = []
    for row in rows:
        table = _table(row, where)
        _check_keys(table, _EFFECT[:2], where, _EFFECT[2:])
        options = _values(table.get("options", {}), f"{where}: options")
        settings.append(EffectSetting(_text(table["name"], where), _number(table["severity"], where), options))
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


def _texts(value: object, where: str) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise InputError(f"is {value!r}", where=where, allowed="a list of texts")
    return tuple(_text(item, where) for item in value)


def _text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"is {value!r}", where=where, allowed="a text in quotes")
    return value


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > 1e300:
        raise InputError(f"is {short(value)}", where=where, allowed="a number")
    return float(value)


def _check_keys(table: Mapping[str, Any], keys: tuple[str, ...], where: str, optional: tuple[str, ...] = ()) -> None:
    missing, unknown = [k for k in keys if k not in table], [k for k in table if k not in (*keys, *optional)]
    if unknown:
        hint = closest_match_hint(unknown[0], (*keys, *optional))
        raise InputError(
            f"there is no key {unknown[0]!r}", where=where, allowed=", ".join((*keys, *optional)), remedy=hint
        )
    if missing:
        raise InputError(f"{', '.join(missing)} must be given", where=where)


# Writes a preset as a file that `read_preset` reads back to the same machine.


def preset_text(preset: Preset, comments: Sequence[str] = ()) -> str:
    """Return a preset as TOML; its name is left out: it is that of the file.

    Parameters
    ----------
    preset : Preset
    comments : sequence of str
        Lines ahead of it.
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
