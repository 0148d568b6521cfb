"""Terminal helpers of the commands: progress bar, the command as typed, exit codes."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import typer

from gearsig.formatting import percent

EXIT_SOME_FAILED = 1
EXIT_INPUT_ERROR = 2
EXIT_INTERRUPTED = 130


def typed_command() -> str:
    """Return the command line of this process, for the pages that it writes."""
    return "gearsig " + shlex.join(sys.argv[1:])


@contextmanager
def progress_bar(stage: str, n: int | None = None) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error; if that is no terminal, print a line every ten seconds.

    Parameters
    ----------
    stage : str
        What is being done.
    n : int or None
        Number of items, shown with the time remaining; None: a fraction from 0 to 1, shown with the time elapsed.

    Yields
    ------
    callable
        Takes the amount completed and, if they change, the stage and the total.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    text = TextColumn("{task.description}", markup=False)  # file names are not markup
    share: tuple[ProgressColumn, ...] = (TaskProgressColumn(), TimeElapsedColumn())
    columns = share if n is None else (MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _progress_lines(stage, n)
        return
    with Progress(text, BarColumn(), *columns, console=console, transient=True) as progress:
        task = progress.add_task(stage, total=1.0 if n is None else n)

        def show(completed: float, stage: str | None = None, total: float | None = None) -> None:
            progress.update(task, completed=completed, description=stage, total=total)

        yield show


SECONDS_BETWEEN_LINES = 10.0


def _progress_lines(stage: str, n: int | None) -> Callable[..., None]:
    """Return a function that prints the progress as lines for a log file; quick commands print nothing."""
    began_s = printed_s = monotonic()
    now, whole = stage, 1.0 if n is None else float(n)

    def show(completed: float, stage: str | None = None, total: float | None = None) -> None:
        nonlocal printed_s, now, whole
        now, whole = stage or now, total or whole
        passed_s = monotonic() - began_s
        if monotonic() - printed_s < SECONDS_BETWEEN_LINES:
            return
        printed_s = monotonic()
        share = percent(completed) if n is None else f"{completed:.0f} of {whole:.0f}"
        remaining_s = passed_s * (whole - completed) / completed if completed else 0.0
        remaining_text = f", {remaining_s:.0f} s left" if completed else ""
        typer.echo(f"{now}: {share} after {passed_s:.0f} s{remaining_text}", err=True)

    return show


def stopped(kept: str) -> typer.Exit:
    """Print what an interrupted command keeps and how to continue it; return the exit to raise."""
    typer.echo(f"gearsig: stopped; {kept}; the same command continues from there", err=True)
    return typer.Exit(EXIT_INTERRUPTED)
