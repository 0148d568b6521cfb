"""`gearsig benchmark gap`: how good the gap diagnosis is, on cases whose cause it cannot know."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gearsig.checks import one_of
from gearsig.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress

    from app.benchmark.run import BenchmarkRequest, Done


EXIT_INTERRUPTED = 130

benchmark_app = typer.Typer(no_args_is_help=True, help="Measure how good a diagnosis is.")


@benchmark_app.callback()
def _benchmarks() -> None:
    """Hold the benchmarks, of which there is one so far."""


@benchmark_app.command("gap")
def gap(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the report.")],
    cases: Annotated[int, typer.Option("--cases", help="Blind cases.")] = 200,
    seed: Annotated[int, typer.Option("--seed", help="Decides the cases.")] = 1,
    role: Annotated[
        str, typer.Option("--role", help="evaluation, calibration or development; they share no gear geometry.")
    ] = "evaluation",
    reference: Annotated[
        bool | None,
        typer.Option(
            "--with-reference/--without-reference",
            help="All cases with a healthy reference, or none. Default: half of them.",
        ),
    ] = None,
    same_simulator: Annotated[
        bool,
        typer.Option("--same-simulator", help="The same cases from the diagnosing simulator as well, and the drop."),
    ] = False,
    diagnosers: Annotated[
        list[str] | None,
        typer.Option(
            "--diagnoser",
            metavar="NAME",
            help="gap, forest, either with -unseen (nothing learned from the rig that makes the cases), majority, "
            "rules, or MODULE:FUNCTION; the first is judged, more stand beside it. Default: gap.",
        ),
    ] = None,
    longest: Annotated[
        float | None, typer.Option("--longest", metavar="SECONDS", help="Cut recordings to this; default 4 to 8 s.")
    ] = None,
    least_level: Annotated[
        float,
        typer.Option("--least-level", help="0 to 1: levels of effects go from here to 1 (strong); default 0: all."),
    ] = 0.0,
    model: Annotated[
        str, typer.Option("--model", help="cracked, or forging: blind starts and stops, from a drive of their own.")
    ] = "cracked",
    processes: Annotated[int, typer.Option("--processes", "-j", help="Cases at a time.")] = 2,
) -> None:
    """Make blind cases, diagnose each in a process that cannot know its cause, score the answers.

    An independent rig makes the cases: it shares no code with the diagnosing simulator. It can be stopped with Ctrl-C
    at any time; the same command goes on from the answers it has.

    Example: gearsig benchmark gap --cases 200 --same-simulator -o benchmark
    """
    from app.benchmark.cases import Plan
    from app.benchmark.diagnosers import BASELINES, GAP
    from app.benchmark.run import BenchmarkRequest
    from app.benchmark.scoring.results import TABLE, write_results
    from app.benchmark.scoring.scores import judge

    wished = "both" if reference is None else "with" if reference else "without"
    if one_of(model, "model", ("cracked", "forging")) == "forging":
        _refuse_others(
            same_simulator=same_simulator,
            diagnosers=bool(diagnosers),
            longest=longest is not None,
            least_level=least_level != 0.0,
        )
        _run_drives(cases, seed, role, wished, output, processes)
        return
    names = tuple(dict.fromkeys([*(diagnosers or [GAP]), *BASELINES]))
    wanted = BenchmarkRequest(Plan(cases, seed, role, wished, same_simulator, longest, least_level), names)
    done = _run(wanted, output, processes)
    page = write_results(judge(wanted, done), done, output, " ".join(["gearsig", *sys.argv[1:]]))
    typer.echo((output / TABLE).read_text(encoding="utf-8"))
    typer.echo(f"{page} (report), {TABLE}, scores.json, cases.csv, labels/.")


def _refuse_others(**given: bool) -> None:
    for name, is_given in given.items():
        if is_given:
            option = name.replace("_", "-").removesuffix("s")
            raise InputError(f"--{option} is given with --model forging", remedy=f"leave --{option} out")


def _run_drives(cases: int, seed: int, role: str, reference: str, output: Path, processes: int) -> None:
    from app.benchmark.start_stop import DrivePlan, run_drive_benchmark, write_scores

    plan = DrivePlan(cases, seed, role, reference)
    with _progress() as progress:
        task = progress.add_task("diagnosing", total=cases)
        done = run_drive_benchmark(
            plan, output, n_processes=processes, on_progress=lambda n: progress.update(task, completed=n)
        )
    table = write_scores(done, output, " ".join(["gearsig", *sys.argv[1:]]))
    typer.echo(table.read_text(encoding="utf-8"))
    typer.echo(f"{table}, scores.json, cases.csv.")


def _progress() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _run(wanted: BenchmarkRequest, output: Path, processes: int) -> list[Done]:
    from app.benchmark.run import n_answered, run_benchmark

    n_cases = len(wanted.plan.cases())
    try:
        with _progress() as progress:
            task = progress.add_task("diagnosing", total=n_cases)
            return run_benchmark(
                wanted, output, n_processes=processes, on_progress=lambda n: progress.update(task, completed=n)
            )
    except KeyboardInterrupt:
        n = n_answered(output)
        typer.echo(
            f"gearsig: stopped; {n} of {n_cases} cases are answered in {output}; the same command goes on from there",
            err=True,
        )
        raise typer.Exit(EXIT_INTERRUPTED) from None
