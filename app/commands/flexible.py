"""`gearsig flexible`: maps, speed sweeps and spectra of a pair of finite-element gears."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.simulation_options import (
    EffectOption,
    FreshOption,
    PresetOption,
    SeedOption,
    SetOption,
    clear_other_versions,
    read_request,
)
from app.quantities import quantity
from gearsig.errors import InputError

MODEL = "reduced-fe"


def flexible(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for figures and tables.")],
    preset: PresetOption = "",
    settings: SetOption = None,
    effects: EffectOption = None,
    torques: Annotated[str, typer.Option("--torques", metavar="LIST", help="Of the sweeps.")] = "85,170,340Nm",
    speeds: Annotated[str, typer.Option("--speeds", metavar="RANGE", help="Of the sweeps, up and down.")] = (
        "900..4100rpm"
    ),
    duration: Annotated[
        str, typer.Option("--duration", metavar="TIME", help="Of one sweep; 15s up and 15s down are six million steps.")
    ] = "15s",
    spreading: Annotated[
        bool, typer.Option("--spreading", help="Also check contact at single nodes against patches (RBE3).")
    ] = False,
    seed: SeedOption = 0,
    fresh: FreshOption = False,
) -> None:
    """Study a pair of reduced finite-element gears: stiffness and transmission-error maps, sweeps with jumps, spectra.

    Example: gearsig flexible --preset light_damping_50_50 -o study
    """
    import numpy as np
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from app.flexible.results import RANGE, write_study
    from app.flexible.study import flexible_study
    from sims.presets import preset as preset_named
    from sims.reduced_fe.simulator import ReducedPair

    request = read_request(MODEL, preset, settings, effects, None, None, "1s", "20480Hz", seed)
    first, last = _range(speeds)
    wanted = tuple(quantity(f"{t.strip().removesuffix('Nm')}Nm", "N m", "--torques") for t in torques.split(","))
    if fresh:
        clear_other_versions(MODEL)
    ready = ReducedPair().prepare(
        request.parameters, request.effects, None, np.random.default_rng(seed), preset_name=request.preset
    )
    chosen = preset_named(MODEL, request.preset)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("preparing", total=1.0)
        study = flexible_study(
            ready.pair,
            float(ready.operation.torque_nm.values[0]),
            wanted,
            sweep_s=quantity(duration, "s", "--duration"),
            first_rpm=first,
            last_rpm=last,
            step_s=ready.step_s,
            check_spreading=spreading,
            on_progress=lambda what, done: progress.update(task, description=what, completed=done),
        )
        paths = write_study(study, output, chosen.name)
    typer.echo(f"{output}: {', '.join(path.name for path in paths)}")
    for torque, (up, down) in study.sweeps.items():
        natural = study.natural_hz[torque]
        jumps = [sweep.jump_hz(RANGE[0] * natural, RANGE[1] * natural) for sweep in (up, down)]
        peaks = [sweep.peak_hz(RANGE[0] * natural, RANGE[1] * natural) for sweep in (up, down)]
        said = [
            f"greatest at {peak:.0f} Hz, {'no jump' if jump is None else f'jump at {jump:.0f} Hz'}"
            for peak, jump in zip(peaks, jumps, strict=True)
        ]
        typer.echo(f"{torque:g} N·m: torsional mode {natural:.0f} Hz; sweep up: {said[0]}; sweep down: {said[1]}")


def _range(text: str) -> tuple[float, float]:
    first, dots, last = text.partition("..")
    if not dots:
        raise InputError(f"--speeds is {text!r}", allowed="900..4100rpm")
    return quantity(f"{first.removesuffix('rpm')}rpm", "rpm", "--speeds"), quantity(last, "rpm", "--speeds")
