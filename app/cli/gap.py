"""`gearsig gap`: where a recording differs from its simulation, and which effect explains how much of it."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import progress_bar, typed_command
from app.cli.options import (
    ClusterOption,
    ReferenceRateOption,
    SamplingRateOption,
    SpeedOption,
    clear_other_versions,
    open_cluster,
    output_option,
)
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.gap import GapReport, GapRequest


TABLE_WIDTH = 110
"""Width of the table of effects, in columns, if it is not printed to a terminal."""


def gap(
    recordings: Annotated[
        list[Path] | None, typer.Argument(help="Recordings of one rig, preferably at several operating conditions.")
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig",
            help="Rig file (TOML) of all recordings. NAME.toml next to a recording overrides its speed, torque, "
            "sensors and sampling rate.",
        ),
    ] = None,
    model: Annotated[str, typer.Option("--model", help="Simulator to compare with.")] = "cracked",
    reference: Annotated[
        list[Path] | None,
        typer.Option(
            "--reference", metavar="HEALTHY", help="Recording of the same rig when it was healthy; repeatable."
        ),
    ] = None,
    reference_fs: ReferenceRateOption = None,
    run_up: Annotated[
        Path | None,
        typer.Option(
            "--run-up",
            metavar="HEALTHY",
            help="Run-up or run-down of the same rig when it was healthy, with a tachometer, in addition to "
            "--reference: it measures the path to the sensors, which helps to distinguish tooth faults.",
        ),
    ] = None,
    torque: Annotated[
        list[str] | None,
        typer.Option(
            "--torque", metavar="N", help="Of the input shaft, e.g. 60Nm: one for all recordings or one for each."
        ),
    ] = None,
    speed_rpm: SpeedOption = None,
    stage: Annotated[
        str,
        typer.Option("--stage", metavar="NAME", help="Gear pair to diagnose, if there are several: its name or shaft."),
    ] = "",
    fs: SamplingRateOption = None,
    learn: Annotated[
        Path | None,
        typer.Option(
            "--learn",
            metavar="FOLDER",
            help="Labelled recordings of this rig, or of your own simulation of it: labels.csv in it lists file, "
            "effect, reference. Two of each effect help most.",
        ),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            "--cache", metavar="DIR", help="Folder for what is prepared once per rig. Default: your cache folder."
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Prepare again what the cache holds, and replace it.")] = False,
    effect_file: Annotated[
        list[Path] | None,
        typer.Option(
            "--effect-file",
            metavar="FILE",
            help="Python file with an effect of your own to look for as well; repeatable. Its code is executed: give "
            "only files that you trust. The variable GEARSIG_EFFECTS names such files for every command and the "
            "dashboard, which then execute them.",
        ),
    ] = None,
    list_effects: Annotated[bool, typer.Option("--list-effects", help="Show the effects that are looked for.")] = False,
    output: Annotated[Path | None, output_option("Folder for gap.html, gap.json and twin.toml.")] = None,
    cluster: ClusterOption = "",
) -> None:
    """Find where recordings differ from the simulation of their rig, and which effect explains how much of it.

    If possible, give recordings at several speeds and loads, and recordings of the same rig when it was healthy: both
    make the answer much more certain. The first answer for a rig takes about a minute on two free cores; its
    simulations are kept, and the next answer at the same speed and load takes a quarter of that.

    Example: gearsig gap slow.h5 fast.h5 --rig gearbox.toml --reference healthy.h5 -o gap
    """
    if effect_file:
        from sims.effects import add_effect

        for path in effect_file:
            add_effect(path)
    if list_effects:
        _print_effects(model)
        return
    if output is None:
        raise InputError("no folder for the results is given", remedy="give -o DIR")
    from app.gap_job import check_folder, write_results
    from gearsig.gap import PROCESSES, GapRequest
    from gearsig.processes import one_pool
    from gearsig.report import check_writable

    request = GapRequest(
        tuple(recordings or ()),
        tuple(reference or ()),
        rig,
        _torques(torque),
        fs,
        learn=learn,
        stage=stage,
        speed_rpm=speed_rpm,
        reference_rate_hz=reference_fs,
        run_up=run_up,
    )
    check_folder(output)
    if cache is not None:
        check_writable(cache, "--cache")
    if fresh and model == "reduced-fe":
        clear_other_versions(model)
    with one_pool(PROCESSES):  # they draw the page, too
        with open_cluster(cluster) as workers:
            report = _diagnosed(request, model, cache, fresh=fresh)
            ran = workers.text() if workers else ""
        written = write_results(report, output, command=typed_command())
    _print_summary(report, written)
    if ran:
        typer.echo(f"It ran {ran}.")


def _torques(texts: list[str] | None) -> tuple[float, ...]:
    from app.cli.options import torque_of

    torques = (torque_of(text) for text in texts or ())
    return tuple(value for value in torques if value is not None)


def _diagnosed(request: GapRequest, model: str, cache: Path | None, *, fresh: bool) -> GapReport:
    """Diagnose and show the progress."""
    from app.gap_job import run_gap
    from gearsig.cache import cache_folder

    with progress_bar("reading") as show:
        return run_gap(
            request,
            model,
            cache=cache or cache_folder("gap"),
            fresh=fresh,
            on_stage=lambda stage, done: show(done, stage),
        )


def _print_summary(report: GapReport, written: tuple[Path, ...]) -> None:
    from gearsig.report import gap_text

    typer.echo(gap_text(report))
    for message in report.notes:
        typer.echo(f"Note: {message}", err=True)
    page, *further_files = written
    typer.echo(f"Open {page} in a browser; next to it: {', '.join(path.name for path in further_files)}.")
    if report.twin_toml:
        twin = shlex.quote(str(further_files[-1]))
        run = f"{_user_effects(report)}gearsig simulate {report.simulator} --preset {twin} -o twin.h5"
        typer.echo(f"Run the simulator with the effect: {run}")


def _user_effects(report: GapReport) -> str:
    """Return the variable to set in front of a command that needs the user's own effects."""
    from sims.effects import VARIABLE, is_user_effect, user_files

    fitted = report.causes[0].fitted
    if fitted is None or not is_user_effect(fitted.name):
        return ""
    return f"{VARIABLE}={shlex.quote(os.pathsep.join(map(str, user_files())))} "


def _print_effects(model: str) -> None:
    """Print the catalogue of effects: group, name, unit of the severity, where the effect shows."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from gearsig.gap import DriveSimulator, load_learned, severity_unit
    from sims.effects import is_user_effect
    from sims.registry import gap_simulator

    table = Table("group", "effect", "severity", "shows in", box=SIMPLE_HEAD, pad_edge=False)
    simulator = gap_simulator(model)
    effects = simulator.gap_effects()
    # Starts and stops are compared by their equation of motion: nothing is learned, so no effect is unrecognised.
    learned = effects if isinstance(simulator, DriveSimulator) else load_learned().causes
    last = ""
    for effect in effects.values():
        where = ", ".join(kind.replace("_", " ") for kind in effect.shows_in)
        group = "" if effect.group == last else effect.group
        last = effect.group
        notes = ["your own"] if is_user_effect(effect.name) else []
        notes += ["tried, not recognised"] if effect.name not in learned else []
        note = f"\n  ({': '.join(notes)})" if notes else ""
        table.add_row(group, f"{effect.name}\n  {effect.title}{note}", severity_unit(effect.unit) or "–", where)
    width = None if sys.stdout.isatty() else TABLE_WIDTH
    Console(markup=False, highlight=False, width=width).print(table)
    typer.echo(f"{len(effects)} effects that have a meaning for the model {model}; also: none, unknown.")
