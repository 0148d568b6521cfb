"""`gearsig simulate`: a recording from a model, with its rig file and its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.simulation_options import (
    DurationOption,
    EffectOption,
    FreshOption,
    PresetOption,
    RateOption,
    Request,
    SeedOption,
    SetOption,
    SpeedOption,
    TorqueOption,
    clear_other_versions,
    read_request,
)
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.recording.types import Recording


def simulate(
    model: Annotated[str | None, typer.Argument(help="Model, e.g. cracked; --list shows them.")] = None,
    preset: PresetOption = "",
    mode: Annotated[
        str, typer.Option("--mode", help="Of the model forging: start-stop or continuous; short for --set mode=….")
    ] = "",
    settings: SetOption = None,
    effects: EffectOption = None,
    speed: SpeedOption = None,
    torque: TorqueOption = None,
    duration: DurationOption = "5s",
    fs: RateOption = "",
    seed: SeedOption = 0,
    fresh: FreshOption = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Recording: .csv .h5 .parquet .wav or .mat."),
    ] = None,
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
        typer.echo(_listing(model, preset))
        return
    if mode:
        settings = [*(settings or []), f"mode={mode}"]
    request = read_request(model, preset, settings, effects, speed, torque, duration, fs, seed)
    if output is None and not check:
        raise InputError("no output file is given", remedy="give -o FILE, or --check")
    if fresh:
        clear_other_versions(model)
    if check:
        typer.echo(_convergence(request))
    if output is not None:
        _simulate_to(request, output, force)


def _listing(model: str | None, preset: str) -> str:
    from app.commands.simulate_text import models_text, preset_text
    from sims.presets import preset as preset_named
    from sims.registry import simulator, simulators

    if preset:
        return preset_text(preset_named(model or next(iter(simulators())), preset))
    return models_text(simulators().values() if model is None else (simulator(model),))


def _simulate_to(request: Request, output: Path, force: bool) -> None:
    from rich.console import Console

    from sims.files import file_set, write_set

    names = file_set(output, replace=force)
    with Console(stderr=True).status(f"simulating {request.duration_s:g} s"):
        recording = simulate_request(request)
        write_set(recording, names)
    typer.echo(f"{names.recording}: {recording.duration_s:g} s at {recording.sampling_rate_hz:g} Hz, ", nl=False)
    typer.echo(f"channels {', '.join(recording.channel_names)}")
    typer.echo(f"Beside it: {names.rig.name} (rig), {names.truth.name} (what was put in).")
    for warning in recording.warnings:
        typer.echo(f"Note: {warning}", err=True)
    typer.echo(f"Next: gearsig analyze {names.recording}")
    if recording.rig is not None and recording.rig.contact is not None:
        typer.echo("It holds the motion of both gears: gearsig start-stop, force and identify read it as well.")


def simulate_request(request: Request) -> Recording:
    """Run one simulation."""
    import sims

    return sims.simulate(
        request.model,
        preset=request.preset,
        parameters=request.parameters,
        effects=request.effects,
        speed_rpm=request.speed_rpm,
        torque_nm=request.torque_nm,
        duration_s=request.duration_s,
        sampling_rate_hz=request.sampling_rate_hz,
        seed=request.seed,
    )


def _convergence(request: Request) -> str:
    import numpy as np

    from sims.registry import ChecksConvergence, simulator
    from sims.request import operation_of

    model = simulator(request.model)
    if not isinstance(model, ChecksConvergence):
        raise InputError(f"{request.model} has no convergence check", remedy="leave out --check")
    operation = operation_of(request.model, request.preset, request.speed_rpm, request.torque_nm)
    rng = np.random.default_rng(request.seed)
    return model.check_convergence(request.parameters, request.effects, operation, rng, preset=request.preset).text
