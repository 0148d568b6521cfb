"""`gearsig report`: HTML pages for many recordings."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from app.commands.options import RigOption, SamplingRateOption, SpeedOption, open_rig, stated_speed

EXIT_SOME_FAILED = 1
EXIT_NONE_READ = 2


def report(
    files: Annotated[list[Path], typer.Argument(help="Recordings; folders are not searched.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the pages.")],
    rig: RigOption = None,
    fs: SamplingRateOption = None,
    speed_rpm: SpeedOption = None,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", help="Processes; default: one per processor.")] = None,
) -> None:
    """Write one self-contained HTML page per recording, and an index page that compares them.

    A file that cannot be read does not stop the others: the index lists it with its reason, and the exit code is 1
    (2 if no file could be read).

    Example: gearsig report monday.csv tuesday.csv --rig gearbox.toml -o report
    """
    failed = make_report(files, output, rig, fs, speed_rpm, jobs, command="gearsig " + shlex.join(sys.argv[1:]))
    if failed:
        raise typer.Exit(EXIT_NONE_READ if failed == len(files) else EXIT_SOME_FAILED)


def make_report(
    files: list[Path],
    output: Path,
    rig: Path | None,
    fs: float | None,
    speed_rpm: float | None,
    jobs: int | None,
    command: str,
) -> int:
    """Write the pages with a progress bar; return how many files failed."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from gearsig.batch import report_many

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("analysing", total=len(files))
        result = report_many(
            files,
            output,
            rig=open_rig(rig),
            sampling_rate_hz=fs,
            speed=stated_speed(speed_rpm, None, 1),
            n_processes=jobs,
            on_progress=lambda *_: progress.advance(task),
            command=command,
        )
    for entry in result.entries:
        typer.echo(f"{entry.name}: {entry.verdict}")
    for failure in result.failures:
        typer.echo(f"{failure.name}: not analysed: {failure.reason}", err=True)
    typer.echo(f"Open {result.index_path} in a browser.")
    return len(result.failures)
