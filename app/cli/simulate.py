"""`gearsig simulate`: a recording from a model, with its rig file and its truth."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from gearsig.errors import InputError

if TYPE_CHECKING:
    from sims.effects import Effect, Option
    from sims.presets import Preset
    from sims.registry import Simulation
    from sims.simulator import Parameter, Simulator


def simulate(
    model: Annotated[str | None, typer.Argument(help="Model, e.g. cracked; --list shows them.")] = None,
    preset: options.PresetOption = "",
    mode: Annotated[
        str, typer.Option("--mode", help="Of the model forging: start-stop or continuous; short for --set mode=….")
    ] = "",
    settings: options.SetOption = None,
    effects: options.EffectOption = None,
    speed: options.SimulatedSpeedOption = None,
    torque: options.SimulatedTorqueOption = None,
    duration: options.DurationOption = "5s",
    fs: options.RateOption = "",
    seed: options.SeedOption = 0,
    fresh: options.FreshOption = False,
    output: Annotated[Path | None, options.output_option("Recording: .csv .h5 .parquet .wav or .mat.", "FILE")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
    listing: Annotated[
        bool, typer.Option("--list", help="Show models, presets, parameters with units and ranges, effects.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Check that a smaller time step changes nothing that matters.")
    ] = False,
) -> None:
    """Simulate a machine, healthy or with faults, and write the recording that a measurement would have given.

    Beside FILE stand its rig file (NAME.toml) and what was put in (NAME.truth.json). Everything else in gearsig reads
    the recording as it reads a measured one.

    Example: gearsig simulate cracked --preset published_55_75 --effect root_crack=2mm,tooth=21 -o crack.h5
    """
    if listing:
        from sims import presets, registry

        if preset:
            typer.echo(preset_text(presets.preset(model or next(iter(registry.simulators())), preset)))
        else:
            chosen = registry.simulators().values() if model is None else (registry.simulator(model),)
            typer.echo("\n\n".join(_model_text(simulator) for simulator in chosen))
        return
    if mode:
        settings = [*(settings or []), f"mode={mode}"]
    request = options.read_request(model, preset, settings, effects, speed, torque, duration, fs, seed)
    if output is None and not check:
        raise InputError("no output file is given", remedy="give -o FILE, or --check")
    if fresh:
        options.clear_other_versions(model)
    if check:
        typer.echo(_convergence(request))
    if output is None:
        return
    from rich.console import Console

    from sims.files import file_set, write_set

    names = file_set(output, replace=force)
    with Console(stderr=True).status(f"simulating {request.duration_s:g} s"):
        recording = request.run()
        write_set(recording, names)
    typer.echo(f"{names.recording}: {recording.duration_s:g} s at {recording.sampling_rate_hz:g} Hz, ", nl=False)
    typer.echo(f"channels {', '.join(recording.channel_names)}")
    typer.echo(f"Beside it: {names.rig.name} (rig), {names.truth.name} (what was put in).")
    for warning in recording.warnings:
        typer.echo(f"Note: {warning}", err=True)
    typer.echo(f"Next: gearsig analyze {names.recording}")
    if recording.rig is not None and recording.rig.contact is not None:
        typer.echo("It holds the motion of both gears: gearsig start-stop, force and identify read it as well.")


def _convergence(request: Simulation) -> str:
    import numpy as np

    from sims.registry import simulator

    return simulator(request.model).check_convergence(request.setup, np.random.default_rng(request.seed)).text


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
        lines += ["", "Effects"]
        for e in preset.effects:
            lines.append(
                f"  {e.name}: {e.severity:g}" + "".join(f", {name} {value}" for name, value in e.options.items())
            )
    lines += ["", "Parameters (the others have the model's defaults)"]
    return "\n".join([*lines, *(f"  {name} = {value}" for name, value in preset.parameters.items())])


def _model_text(simulator: Simulator) -> str:
    from sims.effects import effect, effects
    from sims.presets import presets

    machines = presets(simulator.name)
    parts = [
        _wrapped(f"Model {simulator.name}: {simulator.title}", "", "  "),
        f"Presets (--preset NAME; details: gearsig simulate {simulator.name} --preset NAME --list)",
        _columns((p.name, f"{p.title}; {p.speed_rpm:g} rpm, {p.torque_nm:g} N m") for p in machines.values()),
        "Parameters (--set NAME=VALUE)",
        _columns([(p.name, _parameter_line(p)) for p in simulator.parameters]),
    ]
    if simulator.effects:
        parts.append("Effects (--effect NAME=SEVERITY,OPTION=VALUE,…)")
        parts.append("\n\n".join(_effect_text(effect(name)) for name in simulator.effects))
    missing_effects = [name for name in effects() if name not in simulator.effects]
    lacking = [f"{', '.join(missing_effects)}: not represented."] if missing_effects else []
    if lacking or simulator.meaningless:
        parts.append("Effects without a meaning here")
        parts += [_wrapped(text, "  ", "  ") for text in (*lacking, *simulator.meaningless)]
    return "\n\n".join(parts)


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
    """Wrap to 100 columns, wherever it is printed to; a narrower terminal gets less."""
    width = 100
    if sys.stdout.isatty():
        width = max(60, min(width, shutil.get_terminal_size().columns))
    return textwrap.fill(text, width, initial_indent=first, subsequent_indent=later, break_on_hyphens=False)
