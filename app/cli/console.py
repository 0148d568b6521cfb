"""What the commands share on the terminal: a progress bar, the command as it was typed, how a command ends."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer

EXIT_SOME_FAILED = 1
EXIT_INPUT_ERROR = 2
EXIT_INTERRUPTED = 130


def typed_command() -> str:
    """Return the command that this process was started with, for the pages that it writes."""
    return "gearsig " + shlex.join(sys.argv[1:])


@contextmanager
def progress_bar(stage: str, n: int | None = None) -> Iterator[Callable[..., None]]:
    """Show a bar on standard error while a command works, on a terminal only.

    Parameters
    ----------
    stage : str
        What is being done.
    n : int or None
        Things that are counted, with the time that remains; None: a share from 0 to 1, with the time that has passed.

    Yields
    ------
    callable
        Takes what is complete, and the stage where it changes.
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

    text = TextColumn("{task.description}", markup=False)  # names of files are no markup
    share: tuple[ProgressColumn, ...] = (TaskProgressColumn(), TimeElapsedColumn())
    columns = share if n is None else (MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        text, BarColumn(), *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        task = progress.add_task(stage, total=1.0 if n is None else n)

        def show(completed: float, stage: str | None = None) -> None:
            progress.update(task, completed=completed, description=stage)

        yield show


def stopped(kept: str) -> typer.Exit:
    """Say what an interrupted command keeps, and that it can go on from there; return what ends the command."""
    typer.echo(f"gearsig: stopped; {kept}; the same command goes on from there", err=True)
    return typer.Exit(EXIT_INTERRUPTED)
