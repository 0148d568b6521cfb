"""`gearsig report`: HTML pages for many recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli import options
from app.cli.console import EXIT_INPUT_ERROR, EXIT_INTERRUPTED, EXIT_SOME_FAILED, progress_bar, typed_command
from gearsig.errors import InputError


def report(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders with their sub-folders, or 'FOLDER/*.csv'.")
    ],
    output: Annotated[Path, options.output_option("Folder for the pages.")],
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    reference: options.ReferenceOption = None,
    reference_fs: options.ReferenceRateOption = None,
    torque: options.TorqueOption = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="METHOD",
            help="Further methods on the pages, e.g. order-map or modes+squeezed-cwt; see gearsig show --list. "
            "Repeatable. Default: those that each recording calls for; none: none.",
        ),
    ] = None,
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
    memory: options.MemoryOption = 2.0,
    pdf: Annotated[bool, typer.Option("--pdf", help="Write each page and the index as PDF as well.")] = False,
) -> None:
    """Write one self-contained HTML page per recording, and an index page that compares them.

    A file that cannot be analysed does not stop the others: the index lists it with its reason, and the exit code is 1
    (2 if none could be). With --reference, all recordings are compared with that one. It can be stopped at any
    time: the same command goes on from the pages that are there.

    Example: gearsig report monday.csv tuesday.csv --rig gearbox.toml -o report
    """
    if tach_times is not None and (len(files) > 1 or files[0].is_dir()):
        raise InputError("--tach-times belong to one recording, and there are more", remedy="make a report for each")
    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    failed = make_report(
        files,
        output,
        rig,
        jobs,
        cluster,
        command=typed_command(),
        sampling_rate_hz=fs,
        speed=speed,
        reference=reference,
        reference_rate_hz=reference_fs,
        torque_nm=options.torque_of(torque),
        memory_bytes=1e9 * memory,
        pdf=pdf,
        methods=[] if methods == ["none"] else methods,
    )
    if failed:
        raise typer.Exit(failed)


def make_report(
    files: list[Path], output: Path, rig: Path | None = None, jobs: int | None = None, cluster: str = "", **how: Any
) -> int:
    """Write the pages with their progress, by what else `report_many` takes; return the exit code."""
    from gearsig.batch import report_many

    before, so_far = output.exists(), "0"

    def advance(done: int, total: int, _result: object) -> None:
        nonlocal so_far
        so_far = f"{done} of {total}"
        show(done, total=total)

    with options.open_cluster(cluster) as workers:
        try:
            with progress_bar("analysing", len(files)) as show:
                result = report_many(
                    files,
                    output,
                    rig=options.open_rig(rig),
                    **options.on_workers(workers, jobs),
                    on_progress=advance,
                    **how,
                )
        except KeyboardInterrupt:
            typer.echo(f"gearsig: stopped after {so_far} files; {_present_text(output, before)}", err=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None
        ran = workers.text() if workers else ""
    for entry in result.entries:
        typer.echo(f"{entry.name}: {entry.verdict}")
    for failure in result.failures:
        typer.echo(f"{failure.name}: not analysed: {failure.reason}", err=True)
    kept = f"{result.n_found} of {len(result.entries)} pages were there already. " if result.n_found else ""
    typer.echo(f"{kept}{f'It ran {ran}. ' if ran else ''}Open {result.index_path} in a browser.")
    if not result.failures:
        return 0
    return EXIT_SOME_FAILED if result.entries else EXIT_INPUT_ERROR


def _present_text(output: Path, was_there: bool) -> str:
    """Say what an interrupted report left; a new folder without pages is taken away."""
    pages = [page for page in output.glob("*.html") if page.name != "index.html"] if output.is_dir() else []
    if pages:
        return f"pages in {output} are whole, and the same command goes on from there"
    if not was_there:
        (output / "index.html").unlink(missing_ok=True)
    if not was_there and output.is_dir() and not any(output.iterdir()):
        output.rmdir()
    return "nothing was kept"
