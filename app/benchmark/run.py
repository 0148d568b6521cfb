"""`gearsig benchmark gap`: blind cases of a gearbox, made as planned and diagnosed one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from app.benchmark.answer import Answer
from app.benchmark.blind_run import BlindRun, state_of_code
from app.benchmark.diagnosers import diagnoser
from app.benchmark.make import Truth, make_case
from app.benchmark.plan import Plan, PlannedCase
from gearsig import __version__


@dataclass(frozen=True)
class Wanted:
    """A benchmark as it is asked for.

    Parameters
    ----------
    plan : Plan
    diagnosers : tuple of str
        The first is judged, the others stand beside it; see `app.benchmark.diagnosers`.
    """

    plan: Plan
    diagnosers: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.diagnosers:
            diagnoser(name)

    @cached_property
    def code(self) -> str:
        """State of the code when it was first asked for."""
        return state_of_code()

    def definition(self) -> dict[str, Any]:
        """What decides the result, as plain values."""
        return {
            **self.plan.definition(),
            "diagnosers": list(self.diagnosers),
            "version": __version__,
            "code": self.code,
        }


@dataclass(frozen=True)
class Done:
    """One case, made and answered.

    Parameters
    ----------
    planned : PlannedCase
    truth : Truth
    answers : mapping of str to Answer
    """

    planned: PlannedCase
    truth: Truth
    answers: dict[str, Answer]


def run_benchmark(
    wanted: Wanted, folder: Path, *, n_processes: int = 2, on_progress: Callable[[int], object] | None = None
) -> list[Done]:
    """Make and diagnose all cases, in as many processes; return them in the plan's order.

    Raises
    ------
    InputError
        See `app.benchmark.blind_run`; or if a diagnoser is not there, or the code has changed.
    """
    cases = {planned.number: planned for planned in wanted.plan.cases()}
    run = BlindRun(sorted(cases), partial(_make, wanted.plan, cases), wanted.diagnosers, wanted.definition())
    answered = run.answered(folder, n_processes=n_processes, on_progress=on_progress)
    return [Done(cases[number], truth, answers) for number, truth, answers in answered]


def _make(plan: Plan, cases: Mapping[int, PlannedCase], number: int, folder: Path | None) -> Truth:
    return make_case(plan, cases[number], folder)
