"""What `gearsig simulate --list` prints."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sims.effects import Effect, EffectSetting
    from sims.effects.effect import Option
    from sims.presets import Preset
    from sims.simulator import Parameter, Simulator

WIDTH = 100
"""Columns, wherever it is printed to; a narrower terminal gets less."""


def models_text(simulators: Iterable[Simulator]) -> str:
    """Return models, their presets, parameters and effects."""
    return "\n\n".join(_model_text(simulator) for simulator in simulators)


def preset_text(preset: Preset) -> str:
    """Return all that is known of a preset."""
    lines = [f"{preset.name}: {preset.title}", f"  {preset.speed_rpm:g} rpm, {preset.torque_nm:g} N m at the input"]
    for title, texts in (
        ("Sources", preset.sources),
        ("Assumed", preset.assumed),
        ("Does not represent", preset.does_not_represent),
    ):
        lines += ["", title, *(_wrapped(text, "  - ", "    ") for text in texts)]
    if preset.effects:
        lines += ["", "Effects", *(f"  {_setting(e)}" for e in preset.effects)]
    lines += ["", "Parameters (the others have the model's defaults)"]
    return "\n".join([*lines, *(f"  {name} = {value}" for name, value in preset.parameters.items())])


def _setting(setting: EffectSetting) -> str:
    options = "".join(f", {name} {value}" for name, value in setting.options.items())
    return f"{setting.name}: {setting.severity:g}{options}"


def _model_text(simulator: Simulator) -> str:
    from sims.effects import effect, effects
    from sims.presets import presets

    machines = presets(simulator.name)
    parts = [
        _wrapped(f"Model {simulator.name}: {simulator.title}", "", "  "),
        f"Presets (--preset NAME; details: gearsig simulate {simulator.name} --preset NAME --list)",
        _columns([(p.name, _preset_line(p)) for p in machines.values()]),
        "Parameters (--set NAME=VALUE)",
        _columns([(p.name, _parameter_line(p)) for p in simulator.parameters]),
    ]
    if simulator.effects:
        parts.append("Effects (--effect NAME=SEVERITY,OPTION=VALUE,…)")
        parts.append("\n\n".join(_effect_text(effect(name)) for name in simulator.effects))
    others = [name for name in effects() if name not in simulator.effects]
    lacking = [f"{', '.join(others)}: not represented."] if others else []
    if lacking or simulator.meaningless:
        parts.append("Effects without a meaning here")
        parts += [_wrapped(text, "  ", "  ") for text in (*lacking, *simulator.meaningless)]
    return "\n\n".join(parts)


def _preset_line(preset: Preset) -> str:
    return f"{preset.title}; {preset.speed_rpm:g} rpm, {preset.torque_nm:g} N m"


def _parameter_line(p: Parameter) -> str:
    unit = f" {p.unit}" if p.unit else ""
    return f"{p.meaning}; {_range(p.low, p.high, p.choices)}{unit}, default {_default(p.default)}"


def _effect_text(effect: Effect) -> str:
    s = effect.severity
    reach = f"{s.low:g} to {s.high:g} {s.unit}".strip()
    rows = [
        ("severity", f"{reach}, e.g. {s.typical:g}: {s.meaning}"),
        ("changes", effect.changes),
        ("signature", effect.signature),
        *((f"option {o.name}", _option_line(o)) for o in effect.options),
    ]
    return f"  {effect.name}: {effect.title} ({effect.group})\n{_columns(rows, indent=4)}"


def _option_line(option: Option) -> str:
    reach = _range(option.low, option.high, option.choices)
    unit = f" {option.unit}" if option.unit else ""
    default = "drawn" if option.default is None else _default(option.default)
    return f"{option.meaning}; {f'{reach}{unit}, ' if reach else ''}default {default or 'empty'}"


def _range(low: float | None, high: float | None, choices: tuple[str, ...]) -> str:
    if choices:
        return ", ".join(choices)
    if low is None and high is None:
        return ""
    return f"{'any' if low is None else f'{low:g}'} to {'any' if high is None else f'{high:g}'}"


def _default(value: float | str | None) -> str:
    if value is None:
        return "none"
    return value if isinstance(value, str) else f"{value:g}"


def _columns(rows: Iterable[tuple[str, str]], indent: int = 2) -> str:
    """Return names and texts in two columns."""
    listed = list(rows)
    wide = max((len(name) for name, _ in listed), default=0) + 2
    blank = " " * (indent + wide)
    return "\n".join(_wrapped(text, f"{'':{indent}}{name:{wide}}", blank) for name, text in listed)


def _wrapped(text: str, first: str, later: str) -> str:
    return textwrap.fill(text, _width(), initial_indent=first, subsequent_indent=later, break_on_hyphens=False)


def _width() -> int:
    if sys.stdout.isatty():
        return max(60, min(WIDTH, shutil.get_terminal_size().columns))
    return WIDTH
