"""`gearsig sweep`: a grid of simulations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import EXIT_INPUT_ERROR, EXIT_SOME_FAILED, progress_bar, stopped
from app.cli.options import (
    DurationOption,
    EffectOption,
    PresetOption,
    RateOption,
    SeedOption,
    SetOption,
    SimulatedSpeedOption,
    SimulatedTorqueOption,
    SimulationChoices,
    read_effect_options,
    read_request,
)
from app.cli.quantities import quantity, span, split_quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from sims.simulator import Simulator
    from sims.sweep import Axis, Sweep, SweepResult


MAX_REASONS = 5
"""Failures that are printed; the index holds them all."""


def sweep(
    model: Annotated[str, typer.Argument(help="Model, e.g. cracked; `gearsig simulate --list` shows them.")],
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary",
            metavar="NAME=VALUES",
            help="speed=300..1500rpm:10 (from, to, how many), root_crack=0..4mm:5,gear=driven or "
            "torque=20,50,110Nm; repeatable. NAME is speed, torque, a parameter or an effect.",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the recordings.")],
    preset: PresetOption = "",
    settings: SetOption = None,
    effects: EffectOption = None,
    speed: SimulatedSpeedOption = None,
    torque: SimulatedTorqueOption = None,
    duration: DurationOption = "5s",
    fs: RateOption = "",
    seed: SeedOption = 0,
    common_seed: Annotated[
        bool,
        typer.Option(
            "--common-seed",
            help="Draw the same noise and tolerances at every point, to compare points. Default: each its own.",
        ),
    ] = False,
    extension: Annotated[str, typer.Option("--format", metavar="EXT", help="csv, h5, parquet, wav or mat.")] = "h5",
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", help="Processes; default: one per processor.")] = None,
) -> None:
    """Simulate a grid of conditions and faults on all processors, into a folder with an index.

    It can be stopped with Ctrl-C at any time; the same command goes on from what is complete. The exit code is 1 if
    some points could not be simulated (2 if none could); the index says why.

    Example: gearsig sweep cracked --vary speed=300..1500rpm:10 --vary root_crack=0..4mm:10 --duration 1s -o grid
    """
    request = read_request(model, preset, settings, effects, speed, torque, duration, fs, seed)
    wanted = sweep_of(request, vary, common_seed, f".{extension.lstrip('.')}")
    result = _run(wanted, output, jobs)
    for failure in result.failures[:MAX_REASONS]:
        typer.echo(f"point {failure.point.index}: {failure.reason}", err=True)
    if len(result.failures) > MAX_REASONS:
        typer.echo(f"… and {len(result.failures) - MAX_REASONS} more points: see the index", err=True)
    n_made = len(result.outcomes) - len(result.failures)
    found = f"; {result.n_found} were there already" if result.n_found else ""
    typer.echo(f"{result.n_points} points, {n_made} simulated{found}. They are listed in {result.index_path}.")
    if result.failures:
        raise typer.Exit(EXIT_SOME_FAILED if n_made + result.n_found else EXIT_INPUT_ERROR)


def sweep_of(request: SimulationChoices, vary: Sequence[str], common_seed: bool, extension: str) -> Sweep:
    """Return the sweep that the options ask for."""
    from sims.registry import simulator
    from sims.sweep import Sweep

    model = simulator(request.model)
    axes = tuple(read_axis(model, text) for text in vary)
    varied = [axis.name for axis in axes]
    for name, value in (("speed_rpm", request.speed_rpm), ("torque_nm", request.torque_nm)):
        if name in varied and value is not None:
            raise InputError(
                f"{name} is given, and varied", remedy=f"leave one of --{name.split('_')[0]} and --vary out"
            )
    return Sweep(
        request.model,
        axes,
        request.preset,
        request.parameters,
        request.effects,
        request.speed_rpm,
        request.torque_nm,
        request.duration_s,
        request.sampling_rate_hz,
        request.seed,
        common_seed,
        extension,
    )


def read_axis(model: Simulator, text: str) -> Axis:
    """Return the axis of "speed=300..1500rpm:10" or "root_crack=0,1,2mm,gear=driven"."""
    from sims.effects import effect
    from sims.simulator import parameter
    from sims.sweep import Axis

    name, sign, rest = text.partition("=")
    name = {"speed": "speed_rpm", "torque": "torque_nm"}.get(name.strip(), name.strip())
    if not sign:
        raise InputError(
            f"{text!r} is not NAME=VALUES", where="--vary", remedy="write for example speed=300..1500rpm:10"
        )
    items = [item.strip() for item in rest.split(",")]
    options = [item for item in items if "=" in item]
    values = [item for item in items if "=" not in item]
    if name in ("speed_rpm", "torque_nm"):
        unit = "rpm" if name == "speed_rpm" else "N m"
    elif name in model.effects:
        return Axis(
            name, read_values(values, effect(name).severity.unit, name), read_effect_options(effect(name), options)
        )
    else:
        wanted = parameter(model.parameters, name)
        if wanted.choices:
            raise InputError(f"{name} is a word", where="--vary", allowed="numbers", remedy="give it with --set")
        unit = wanted.unit
    if options:
        raise InputError(f"{name} has no options", where="--vary", remedy=f"leave out {options[0]}")
    return Axis(name, read_values(values, unit, name))


def read_values(items: Sequence[str], unit: str, name: str) -> tuple[float, ...]:
    """Return the values of ["0..4mm:5"] or ["0", "1", "2mm"]; the last one's unit holds for those without."""
    if len(items) == 1 and ".." in items[0]:
        reach, sign, number = items[0].rpartition(":")
        if not sign or not number.strip().isdigit() or int(number) < 2:
            raise InputError(
                f"{name} is {items[0]!r}", where="--vary", allowed="FROM..TO:COUNT with a count of at least 2"
            )
        first, last = span(reach, unit, name)
        n = int(number)
        return tuple(first + (last - first) * i / (n - 1) for i in range(n))
    later = split_quantity(items[-1], unit, name)[1] if items else ""
    return tuple(quantity(t if split_quantity(t, unit, name)[1] else f"{t}{later}", unit, name) for t in items)


def _run(wanted: Sweep, output: Path, jobs: int | None) -> SweepResult:
    from sims.sweep import n_complete, run_sweep

    try:
        with progress_bar("simulating", wanted.n_points) as show:
            return run_sweep(wanted, output, n_processes=jobs, on_progress=lambda n_done, _n, _outcome: show(n_done))
    except KeyboardInterrupt:
        raise stopped(f"{n_complete(wanted, output)} of {wanted.n_points} points are in {output}") from None
