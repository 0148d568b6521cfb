"""`gearsig benchmark`: accuracy of the gap diagnosis on blind cases, and run times of methods.

`gearsig papers`: the models compared with publications.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import progress_bar, stopped, typed_command
from app.cli.options import output_option
from gearsig.errors import InputError

if TYPE_CHECKING:
    from app.benchmark.run import BenchmarkRequest, Done

benchmark_app = typer.Typer(
    name="benchmark", no_args_is_help=True, help="Measure how accurate a diagnosis is, or how fast methods are."
)


@benchmark_app.command("gap")
def gap(
    output: Annotated[Path, output_option("Folder for the report.")],
    cases: Annotated[int, typer.Option("--cases", min=1, max=100_000, help="Number of blind cases.")] = 200,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Determines the cases.")] = 1,
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
        typer.Option("--same-simulator", help="Add cases made by the diagnosing simulator, and report the drop."),
    ] = False,
    diagnosers: Annotated[
        list[str] | None,
        typer.Option(
            "--diagnoser",
            metavar="NAME",
            help="gap, forest, either with -unseen (nothing learned from the rig that makes the cases), majority, "
            "rules, or MODULE:FUNCTION, whose code is executed. The first is judged, the others are listed for "
            "comparison. Default: gap.",
        ),
    ] = None,
    longest: Annotated[
        float | None,
        typer.Option("--longest", metavar="SECONDS", help="Cut recordings to this length; default 4 to 8 s."),
    ] = None,
    least_level: Annotated[
        float,
        typer.Option("--least-level", help="Minimum strength of the effects, 0 to 1, where 1 is strong; default: all."),
    ] = 0.0,
    model: Annotated[
        str, typer.Option("--model", help="cracked; or forging: blind starts and stops of an independent drive.")
    ] = "cracked",
    processes: Annotated[int, typer.Option("--processes", "-j", help="Number of cases run in parallel.")] = 2,
) -> None:
    """Make blind cases, diagnose each in a process that cannot know its cause, and score the answers.

    The cases come from an independent rig, which shares no code with the diagnosing simulator. It can be stopped with
    Ctrl-C at any time; the same command continues from the answers it has.

    Example: gearsig benchmark gap --cases 200 --same-simulator -o benchmark
    """
    from gearsig.checks import one_of

    wished = "both" if reference is None else "with" if reference else "without"
    if one_of(model, "model", ("cracked", "forging")) == "forging":
        _refuse_options(
            same_simulator=same_simulator,
            diagnosers=bool(diagnosers),
            longest=longest is not None,
            least_level=least_level != 0.0,
        )
        _run_drives(cases, seed, role, wished, output, processes)
        return
    from app.benchmark.cases import Plan
    from app.benchmark.diagnosers import BASELINES, GAP
    from app.benchmark.results import TABLE, write_results
    from app.benchmark.run import BenchmarkRequest
    from app.benchmark.scores import judge

    names = tuple(dict.fromkeys([*(diagnosers or [GAP]), *BASELINES]))
    request = BenchmarkRequest(Plan(cases, seed, role, wished, same_simulator, longest, least_level), names)
    done = _run(request, output, processes)
    page = write_results(judge(request, done), done, output, typed_command())
    typer.echo((output / TABLE).read_text(encoding="utf-8"))
    typer.echo(f"{page} (report), {TABLE}, scores.json, cases.csv, labels/.")


@benchmark_app.command("speed")
def speed(
    output: Annotated[Path | None, output_option("Folder for speed.md and speed.csv, if wanted.")] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="WORD", help="Only methods with this word in their name; repeatable."),
    ] = None,
    longest: Annotated[
        float,
        typer.Option(
            "--longest", metavar="SECONDS", min=0.0, help="A method that takes longer is given no longer signal."
        ),
    ] = 20.0,
) -> None:
    """Time each method against its usual alternative in one run: growth with length, agreement, distance to a limit.

    PyWavelets, ssqueezepy, vmdpy and SciPy come with gearsig; pyfcwt and PySDKit are timed if they are installed.

    Example: gearsig benchmark speed --only wavelet
    """
    from app.benchmark.speed import METHODS, measure, rows, table
    from gearsig.formatting import csv_rows
    from gearsig.report import write_folder

    chosen = [m for m in METHODS if not only or any(word.lower() in m.name.lower() for word in only)]
    if not chosen:
        raise InputError(
            f"no method is called {', '.join(only or ())}", allowed="; ".join(method.name for method in METHODS)
        )
    with progress_bar("timing", len(chosen)) as show:
        results = measure(chosen, longest_s=longest, on_progress=show)
    text = table(results)
    typer.echo(text)
    if output is not None:
        records = list(rows(results))
        numbers = csv_rows(records[0], (record.values() for record in records))
        paths = write_folder(output, texts={"speed.md": text, "speed.csv": numbers})
        typer.echo(f"{paths[0]} (table), {paths[1].name} (its numbers).")


def _refuse_options(**given: bool) -> None:
    for name, is_set in given.items():
        if is_set:
            option = name.replace("_", "-").removesuffix("s")
            raise InputError(f"--{option} is given with --model forging", remedy=f"leave --{option} out")


def _run_drives(cases: int, seed: int, role: str, reference: str, output: Path, processes: int) -> None:
    from app.benchmark.diagnosers import START_STOP
    from app.benchmark.run import BenchmarkRequest
    from app.benchmark.start_stop import DrivePlan, judge_drives, write_drive_results

    request = BenchmarkRequest(DrivePlan(cases, seed, role, reference), (START_STOP,))
    done = _run(request, output, processes)
    table = write_drive_results(judge_drives(request, done), done, output, typed_command())
    typer.echo(table.read_text(encoding="utf-8"))
    typer.echo(f"{table}, scores.json, cases.csv, labels/.")


def _run(request: BenchmarkRequest, output: Path, processes: int) -> list[Done]:
    """Run a benchmark with a progress bar; after Ctrl-C the answers so far are kept."""
    from app.benchmark.run import n_answered, run_benchmark

    n_cases = len(request.plan.cases())
    try:
        with progress_bar("diagnosing", n_cases) as show:
            return run_benchmark(request, output, n_processes=processes, on_progress=show)
    except KeyboardInterrupt:
        raise stopped(f"{n_answered(output)} of {n_cases} cases are answered in {output}") from None


# `gearsig papers`: the figures of three publications, computed by the models.


def _paper_names(incomplete: str) -> list[str]:
    from app.papers import PAPERS

    return [name for name in PAPERS if name.startswith(incomplete)]


def papers(
    name: Annotated[str, typer.Argument(help="cracked, reduced-fe or forging.", autocompletion=_paper_names)],
    output: Annotated[Path, output_option("Folder for page and figures.")],
) -> None:
    """Draw the figures of a publication that the model can reproduce, and check each statement of its text by numbers.

    Each statement is given as "agrees", "agrees in part" or "does not agree, because …". index.html shows everything.

    Example: gearsig papers cracked -o cracked
    """
    from app.papers import paper, write_paper
    from gearsig.report import check_writable

    check_writable(output)
    with progress_bar("preparing") as show:
        publication = paper(name, lambda stage, done: show(done, stage))
        write_paper(publication, output, command=typed_command())
    for figure in publication.figures:
        typer.echo(f"{figure.answers}: {figure.title}")
        for claim in figure.claims:
            typer.echo(f"  {claim.verdict:<15} {claim.statement}: {claim.number}")
    typer.echo(f"{publication.summary} Open {output / 'index.html'} in a browser.")
