"""`gearsig report`: HTML pages for many recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.console import EXIT_INPUT_ERROR, EXIT_INTERRUPTED, EXIT_SOME_FAILED, progress_bar, typed_command
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.rig import SpeedSource


def report(
    files: Annotated[list[Path], typer.Argument(help="Recordings; folders are not searched.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the pages.")],
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    reference: options.ReferenceOption = None,
    torque: options.TorqueOption = None,
    jobs: options.JobsOption = None,
) -> None:
    """Write one self-contained HTML page per recording, and an index page that compares them.

    A file that cannot be read does not stop the others: the index lists it with its reason, and the exit code is 1
    (2 if no file could be read). With --reference, all recordings are compared with that one.

    Example: gearsig report monday.csv tuesday.csv --rig gearbox.toml -o report
    """
    if tach_times is not None and len(files) > 1:
        raise InputError(
            f"--tach-times belong to one recording, and there are {len(files)}", remedy="make a report for each"
        )
    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    failed = make_report(
        files,
        output,
        rig,
        fs,
        speed,
        jobs,
        command=typed_command(),
        reference=reference,
        torque_nm=options.torque_of(torque),
    )
    if failed:
        raise typer.Exit(EXIT_INPUT_ERROR if failed == len(files) else EXIT_SOME_FAILED)


def make_report(
    files: list[Path],
    output: Path,
    rig: Path | None,
    fs: float | None,
    speed: SpeedSource | None,
    jobs: int | None,
    command: str,
    reference: Path | None = None,
    torque_nm: float | None = None,
) -> int:
    """Write the pages with a progress bar; return how many files failed."""
    from gearsig.batch import report_many

    before, n_done = output.exists(), 0

    def advance(*_: object) -> None:
        nonlocal n_done
        n_done += 1
        show(n_done)

    try:
        with progress_bar("analysing", len(files)) as show:
            result = report_many(
                files,
                output,
                rig=options.open_rig(rig),
                sampling_rate_hz=fs,
                speed=speed,
                n_processes=jobs,
                on_progress=advance,
                command=command,
                reference=reference,
                torque_nm=torque_nm,
            )
    except KeyboardInterrupt:
        typer.echo(f"gearsig: stopped after {n_done} of {len(files)} files; {_kept(output, before)}", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None
    for entry in result.entries:
        typer.echo(f"{entry.name}: {entry.verdict}")
    for failure in result.failures:
        typer.echo(f"{failure.name}: not analysed: {failure.reason}", err=True)
    typer.echo(f"Open {result.index_path} in a browser.")
    return len(result.failures)


def _kept(output: Path, was_there: bool) -> str:
    """Say what an interrupted report left; a new folder without pages is taken away."""
    n_pages = len(list(output.glob("*.html"))) if output.is_dir() else 0
    if n_pages:
        return f"pages in {output} are whole, the index is not made anew"
    if not was_there and output.is_dir() and not any(output.iterdir()):
        output.rmdir()
    return "nothing was kept"
