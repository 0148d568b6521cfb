"""Studies that produced the shipped numbers: calibrations and the population of the gap diagnosis."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import TypeVar

import typer

from gearsig.processes import process_pool

Job = TypeVar("Job")
Answer = TypeVar("Answer")


def run_study(*commands: Callable[..., None]) -> None:
    """Run the commands of a module started by `python -m`: one function, or several by name.

    They run in the module as others import it, not in its copy `__main__`, which other processes cannot import.
    """
    spec = sys.modules["__main__"].__spec__
    module = import_module(spec.name if spec is not None else __name__)
    app = typer.Typer(help=module.__doc__, add_completion=False, pretty_exceptions_enable=False)
    for command in commands:
        app.command(help=module.__doc__ if len(commands) == 1 else None)(getattr(module, command.__name__))
    app()


def answers_of(
    function: Callable[[Job], Answer], jobs: Sequence[Job], n_processes: int
) -> Iterator[tuple[Job, Answer]]:
    """Yield each job with its answer, in order, and print how many are done; the processes are new ones."""
    with process_pool(n_processes) as pool:
        for n_done, (job, answer) in enumerate(zip(jobs, pool.map(function, jobs), strict=True), start=1):
            typer.echo(f"{n_done} of {len(jobs)} done")
            yield job, answer
