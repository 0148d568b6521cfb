"""`gearsig simulate`: a recording from a model; `sweep`: a grid of them; `bifurcation`: bifurcation diagrams."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.console import EXIT_INPUT_ERROR, EXIT_SOME_FAILED, progress_bar, stopped
from app.cli.quantities import quantity, span, split_quantity
from gearsig.checks import within
from gearsig.errors import InputError
from gearsig.formatting import percent

if TYPE_CHECKING:
    from app.bifurcation import BifurcationRequest, Values
    from sims.effects import Effect, Option
    from sims.presets import Preset
    from sims.registry import Simulation
    from sims.simulator import Parameter, Simulator
    from sims.sweep import Axis, Sweep


def simulate(
    model: Annotated[str | None, typer.Argument(help="Model, e.g. cracked; --list shows them.")] = None,
    preset: options.PresetOption = "",
    mode: Annotated[
        str, typer.Option("--mode", help="Model forging: start-stop or continuous; short for --set mode=….")
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
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
    listing: Annotated[
        bool,
        typer.Option("--list", help="Show the models or, of one, presets, parameters with units and ranges, effects."),
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Check that a smaller time step changes nothing that matters.")
    ] = False,
) -> None:
    """Simulate a machine, healthy or with faults, and write the recording that a measurement would have given.

    Its rig file (NAME.toml) and the simulated condition (NAME.truth.json) are written next to FILE. All of gearsig
    reads the recording like a measured one.

    Example: gearsig simulate cracked --preset published_55_75 --effect root_crack=2mm,tooth=21 -o crack.h5
    """
    if listing:
        from sims import presets, registry

        if preset:
            typer.echo(preset_text(presets.preset(model or next(iter(registry.simulators())), preset)))
        else:
            typer.echo(_model_text(registry.simulator(model)) if model else _models_text())
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

    from gearsig.report import check_writable
    from sims.files import file_set, write_set

    names = file_set(output, replace=force)
    check_writable(output.parent)
    with Console(stderr=True).status(f"simulating {request.duration_s:g} s"):
        recording = request.run()
        write_set(recording, names)
    typer.echo(f"{names.recording}: {recording.duration_s:g} s at {recording.sampling_rate_hz:g} Hz, ", nl=False)
    typer.echo(f"channels {', '.join(recording.channel_names)}")
    typer.echo(f"Next to it: {names.rig.name} (rig), {names.truth.name} (simulated condition).")
    for warning in recording.warnings:
        typer.echo(f"Note: {warning}", err=True)
    typer.echo(f"Next: gearsig analyze {names.recording}")
    if recording.rig is not None and recording.rig.contact is not None:
        typer.echo("It contains the motion of both gears: gearsig start-stop, force and identify read it, too.")


def _convergence(request: Simulation) -> str:
    import numpy as np

    from sims.registry import simulator

    return simulator(request.model).check_convergence(request.setup, np.random.default_rng(request.seed)).text


def preset_text(preset: Preset) -> str:
    """Return everything known about a preset as text."""
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


def _models_text() -> str:
    from sims import presets, registry

    models = [
        _columns(
            [
                (simulator.name, simulator.title),
                ("", f"presets: {', '.join(presets.presets(simulator.name))}"),
                ("", f"effects: {', '.join(simulator.effects) or 'none'}"),
            ]
        )
        for simulator in registry.simulators().values()
    ]
    return "\n\n".join(["Models (all about one, with units and ranges: gearsig simulate MODEL --list)", *models])


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
        parts.append("Effects that have no meaning here")
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
    if low is None or high is None:
        return f"at least {low:g}" if low is not None else f"at most {high:g}" if high is not None else ""
    return f"{low:g} to {high:g}"


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
    """Wrap to 100 columns, or to the width of a narrower terminal."""
    width = 100
    if sys.stdout.isatty():
        width = max(60, min(width, shutil.get_terminal_size().columns))
    return textwrap.fill(text, width, initial_indent=first, subsequent_indent=later, break_on_hyphens=False)


# --------------------
# `gearsig sweep` and `gearsig bifurcation`: many simulations.
# --------------------


MAX_REASONS = 5
"""Maximum number of failures printed; the files hold all of them."""


def sweep(
    model: options.ModelArgument,
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary",
            metavar="NAME=VALUES",
            help="speed=300..1500rpm:10 (from, to, number), root_crack=0..4mm:5,gear=driven or "
            "torque=20,50,110Nm; repeatable. NAME is speed, torque, a parameter or an effect.",
        ),
    ],
    output: Annotated[Path, options.output_option("Folder for the recordings.")],
    preset: options.PresetOption = "",
    settings: options.SetOption = None,
    effects: options.EffectOption = None,
    speed: options.SimulatedSpeedOption = None,
    torque: options.SimulatedTorqueOption = None,
    duration: options.DurationOption = "5s",
    fs: options.RateOption = "",
    seed: options.SeedOption = 0,
    common_seed: Annotated[
        bool,
        typer.Option(
            "--common-seed",
            help="Draw the same noise and tolerances at every point, to compare points. Default: new ones at each.",
        ),
    ] = False,
    extension: Annotated[str, typer.Option("--format", metavar="EXT", help="csv, h5, parquet, wav or mat.")] = "h5",
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
) -> None:
    """Simulate a grid of conditions and faults on all processors, into a folder with an index.

    It can be stopped with Ctrl-C at any time; the same command continues from what is complete. The exit code is 1 if
    some points could not be simulated (2 if none could be); the index says why.

    Example: gearsig sweep cracked --vary speed=300..1500rpm:10 --vary root_crack=0..4mm:10 --duration 1s -o grid
    """
    request = options.read_request(model, preset, settings, effects, speed, torque, duration, fs, seed)
    planned = sweep_of(request, vary, common_seed, f".{extension.lstrip('.')}")
    from sims.sweep import n_complete, run_sweep

    n_points = planned.n_points
    try:
        with options.open_cluster(cluster) as workers, progress_bar("simulating", n_points) as show:
            result = run_sweep(planned, output, n_processes=jobs, on_progress=lambda n_done, _n, _outcome: show(n_done))
            ran = f" It ran {workers.text()}." if workers else ""
    except KeyboardInterrupt:
        raise stopped(f"{n_complete(planned, output)} of {n_points} points are in {output}") from None
    for failure in result.failures[:MAX_REASONS]:
        typer.echo(f"point {failure.point.index}: {failure.reason}", err=True)
    if len(result.failures) > MAX_REASONS:
        typer.echo(f"… and {len(result.failures) - MAX_REASONS} more points: see the index", err=True)
    n_made = len(result.outcomes) - len(result.failures)
    kept = f"; {result.n_found} existed already" if result.n_found else ""
    typer.echo(f"{result.n_points} points, {n_made} simulated{kept}. They are listed in {result.index_path}.{ran}")
    if result.failures:
        raise typer.Exit(EXIT_SOME_FAILED if n_made + result.n_found else EXIT_INPUT_ERROR)


def bifurcation(
    model: options.ModelArgument,
    vary: Annotated[
        str,
        typer.Option(
            "--vary",
            metavar="NAME=VALUES",
            help="speed=600..3000rpm:100 (from, to, number), torque=5..50Nm:40, half_backlash_um=0..60:40, "
            "root_crack=0..4mm:20. NAME is speed, torque, a parameter or an effect.",
        ),
    ],
    output: Annotated[Path, options.output_option("Folder for figure, table and summary.")],
    preset: options.PresetOption = "",
    settings: options.SetOption = None,
    effects: options.EffectOption = None,
    speed: options.SimulatedSpeedOption = None,
    torque: options.SimulatedTorqueOption = None,
    section: Annotated[
        str,
        typer.Option("--section", metavar="CYCLE", help="One point per mesh cycle (mesh) or per revolution (shaft)."),
    ] = "mesh",
    phase: Annotated[float, typer.Option("--phase", help="Position of the point in the cycle, 0 to 1.")] = 0.0,
    signal: Annotated[
        str,
        typer.Option(
            "--signal",
            help="transmission_error_m, 'driver y', mesh_force_n …, or a channel with its noise: a1.",
        ),
    ] = "transmission_error_m",
    points: Annotated[
        int | None, typer.Option("--points", help="Points at each value; default 100, or 400 with --kind.")
    ] = (None),
    direction: Annotated[
        str,
        typer.Option(
            "--direction",
            help="up or down: each value starts from the last state; both shows hysteresis; rest: each from rest.",
        ),
    ] = "both",
    kind: Annotated[
        bool,
        typer.Option(
            "--kind",
            help="Also classify the motion at each value, by ranges: Lyapunov exponent, 0–1 test. Takes longer.",
        ),
    ] = False,
    fs: options.RateOption = "20480Hz",
    seed: options.SeedOption = 0,
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
) -> None:
    """Draw a bifurcation diagram: Poincaré points of the steady motion over speed, load, backlash, or anything else.

    At each value the transient, 8 time constants of the machine's slowest decay, is left out. It can be stopped with
    Ctrl-C at any time; the same command continues from what is complete.

    Example: gearsig bifurcation cracked --preset symmetric_50_50 --torque 20Nm --vary speed=1600..2400rpm:41 -o jump
    """
    from app import bifurcation as study
    from sims.continuation import Branch

    request = options.read_request(model, preset, settings, effects, speed, torque, "1s", fs, seed)
    n_points = points if points is not None else study.MIN_FOR_KIND if kind else 100
    varied = sweep_of(request, [vary], common_seed=True, extension=".h5")
    study_request = study.BifurcationRequest(Branch(varied, signal, section, n_points), direction, phase, kind)
    study_request.branch.check_signal()
    try:
        with options.open_cluster(cluster) as workers, progress_bar("simulating", study_request.n_values) as show:
            values = study.run_folder(study_request, output, n_processes=jobs, on_progress=show)
            ran = workers.text() if workers else ""
    except KeyboardInterrupt:
        n = study.n_complete(study_request, output)
        if n:
            _print_bifurcation(study_request, study.complete(study_request, output), output)
        raise stopped(f"{n} of {study_request.n_values} values are in {output}") from None
    _print_bifurcation(study_request, values, output)
    if ran:
        typer.echo(f"It ran {ran}.")


def _print_bifurcation(request: BifurcationRequest, values: Values, output: Path) -> None:
    """Write the results and print a summary."""
    from app import bifurcation as study

    paths = study.write_results(request, values, output)
    reasons = [(name, point) for name, kept in values.items() for point in kept if point.reason]
    for name, point in reasons[:MAX_REASONS]:
        typer.echo(f"{study.NAMES[name]}, {point.value:g}: {point.reason}", err=True)
    if len(reasons) > MAX_REASONS:
        typer.echo(f"… and {len(reasons) - MAX_REASONS} more: see {paths[2].name}", err=True)
    unit = study.parameter_text(request.branch)[1]
    for name, kept in values.items():
        points = study.measured_of(kept)
        periods = sorted({point.period for point in points})
        period_text = ", ".join("none within 16 cycles" if p == 0 else str(p) for p in periods)
        largest = max((point.separated_share for point in points), default=0.0)
        typer.echo(
            f"{study.NAMES[name]}: {len(points)} values; periods in cycles: {period_text}; "
            f"teeth apart up to {percent(largest)}"
        )
        for line in study.motion_lines(kept, unit):
            typer.echo(f"  {line}")
    for line in study.coexistence_lines(study.summary(request, values), unit):
        typer.echo(line)
    typer.echo(f"{paths[0]} (figure), {paths[1].name} (points), {paths[2].name} (values).")


def sweep_of(request: Simulation, vary: Sequence[str], common_seed: bool, extension: str) -> Sweep:
    """Return the sweep that the options describe."""
    from sims.registry import simulator
    from sims.sweep import Sweep

    model = simulator(request.model)
    axes = tuple(read_axis(model, text) for text in vary)
    varied = [axis.name for axis in axes]
    for name, value in (("speed_rpm", request.speed_rpm), ("torque_nm", request.torque_nm)):
        if name in varied and value is not None:
            raise InputError(f"{name} is both given and varied", remedy=f"leave out --{name.split('_')[0]} or --vary")
    return Sweep(axes=axes, common_seed=common_seed, extension=extension, **vars(request))


def read_axis(model: Simulator, text: str) -> Axis:
    """Parse an axis such as "speed=300..1500rpm:10" or "root_crack=0,1,2mm,gear=driven"."""
    from sims.effects import effect
    from sims.simulator import parameter
    from sims.sweep import Axis

    name, sign, values_text = text.partition("=")
    name = {"speed": "speed_rpm", "torque": "torque_nm"}.get(name.strip(), name.strip())
    if not sign:
        raise InputError(
            f"{text!r} is not NAME=VALUES", where="--vary", remedy="write for example speed=300..1500rpm:10"
        )
    items = [item.strip() for item in values_text.split(",")]
    settings = [item for item in items if "=" in item]
    values = [item for item in items if "=" not in item]
    if name in model.effects:
        unit = effect(name).severity.unit
        return Axis(name, read_values(values, unit, name), options.read_effect_options(effect(name), settings))
    unit = {"speed_rpm": "rpm", "torque_nm": "N m"}.get(name, "")
    if not unit:
        varied = parameter(model.parameters, name)
        if varied.choices:
            raise InputError(f"{name} is not a number", where="--vary", allowed="numbers", remedy="set it with --set")
        unit = varied.unit
    if settings:
        raise InputError(f"{name} has no options", where="--vary", remedy=f"leave out {settings[0]}")
    return Axis(name, read_values(values, unit, name))


def read_values(items: Sequence[str], unit: str, name: str) -> tuple[float, ...]:
    """Parse values such as ["0..4mm:5"] or ["0", "1", "2mm"]; values without a unit take that of the last."""
    if len(items) == 1 and ".." in items[0]:
        reach, sign, number = items[0].rpartition(":")
        if not sign or not number.strip().isdigit() or int(number) < 2:
            raise InputError(
                f"{name} is {items[0]!r}", where="--vary", allowed="FROM..TO:COUNT with a count of at least 2"
            )
        first, last = span(reach, unit, name)
        from sims.sweep import MAX_POINTS

        n = within(float(number), f"number of values of {name}", 2, MAX_POINTS)
        return tuple(first + (last - first) * i / (n - 1) for i in range(int(n)))
    later = split_quantity(items[-1], unit, name)[1] if items else ""
    return tuple(quantity(t if split_quantity(t, unit, name)[1] else f"{t}{later}", unit, name) for t in items)
