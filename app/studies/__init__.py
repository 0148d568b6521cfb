"""How the numbers that ship were made: calibrations and the population of the gap diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import typer

from gearsig.processes import process_pool

Job = TypeVar("Job")
Answer = TypeVar("Answer")


def answers_of(
    function: Callable[[Job], Answer], jobs: Sequence[Job], n_processes: int
) -> Iterator[tuple[Job, Answer]]:
    """Yield each job with its answer, in order, and say how many are done.

    The processes are fresh ones: a function of a script that runs as `python -m` must be imported by its module's name.
    """
    with process_pool(n_processes) as pool:
        for n_done, (job, answer) in enumerate(zip(jobs, pool.map(function, jobs), strict=True), start=1):
            typer.echo(f"{n_done} of {len(jobs)} done")
            yield job, answer
