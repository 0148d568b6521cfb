"""`gearsig fleet`: recordings of many machines over time."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import options
from app.cli.console import EXIT_INPUT_ERROR, EXIT_SOME_FAILED, progress_bar, stopped

if TYPE_CHECKING:
    from pandas import DataFrame

    from gearsig.fleet import AddResult, ExcludedFile, Fleet, OperatingTrend, Origin
    from gearsig.processes import Cluster

fleet_app = typer.Typer(
    name="fleet",
    no_args_is_help=True,
    help="""Keep the results of many machines over time: trends, limits, alarms.

    Start with **gearsig fleet add FOLDER --dry-run**, then **gearsig fleet status**.""",
)

StoreOption = Annotated[
    Path,
    typer.Option("--store", metavar="DIR", envvar="GEARSIG_FLEET", help="Folder where results are kept."),
]
PlacesArgument = Annotated[
    list[Path], typer.Argument(help="Recordings, folders (including sub-folders) or 'FOLDER/*.csv'.")
]
PatternOption = Annotated[
    str,
    typer.Option(
        "--pattern",
        help="How the ends of paths give machine, point and date: '{machine}/{point}_{date:%Y%m%d}.csv'; "
        "{number:1min} is a running number, {speed} a nominal speed in rpm, {} matches anything.",
    ),
]
MachineOption = Annotated[str, typer.Option("--machine", help="Machine of all these recordings.")]
PointOption = Annotated[str, typer.Option("--point", help="Measuring point of all these recordings.")]
OnlyMachineOption = Annotated[str, typer.Option("--machine", help="Only this machine.")]
OnlyPointOption = Annotated[str, typer.Option("--point", help="Only this measuring point.")]
DateOption = Annotated[
    datetime | None, typer.Option("--date", help="Date of these recordings, if their names do not state it.")
]
StartOption = Annotated[datetime | None, typer.Option("--from", help="From this date on, e.g. 2026-01-31.")]
EndOption = Annotated[datetime | None, typer.Option("--to", help="Up to this date.")]
DEFAULT_STORE = Path("fleet")
N_SHOWN = 10


@fleet_app.command()
def add(
    places: PlacesArgument,
    store: StoreOption = DEFAULT_STORE,
    pattern: PatternOption = "",
    machine: MachineOption = "",
    point: PointOption = "",
    date: DateOption = None,
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    reference: options.ReferenceOption = None,
    reference_fs: options.ReferenceRateOption = None,
    torque: options.TorqueOption = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only show machine, point, date and speed of each recording.")
    ] = False,
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
    memory: options.MemoryOption = 2.0,
    json: options.JsonOption = False,
) -> None:
    """Analyse new recordings and keep their results; recordings that are already in the fleet are skipped.

    Machine, date and speed are taken from the options, the pattern, sub-folders, rig files and file names, in this
    order, and shown first. It can be stopped, or killed, at any time: the same command continues from there. The exit
    code is 1 if some recordings could not be analysed.

    Example: gearsig fleet add recordings --pattern '{machine}/{point}_{date:%Y%m%d}.csv'
    """
    from gearsig.fleet import ExcludedFile, excluded_text, open_fleet, origins

    opened = options.open_rig(rig)
    excluded = list[ExcludedFile]()
    stated: dict[str, Any] = {"machine": machine, "point": point, "date": date, "rig": opened, "speed_rpm": speed_rpm}
    listed = origins(places, pattern=pattern, **stated, on_excluded=excluded.append)
    if dry_run and json:
        answer = {
            "recordings": [_origin_json(origin) for origin in listed],
            "excluded": _excluded_json(excluded),
        }
        _print_json(answer)
    else:
        _show_origins(listed, len(listed) if dry_run else N_SHOWN, err=not dry_run)
    if excluded:
        _say(excluded_text(excluded))
    if dry_run:
        return
    fleet = open_fleet(store, create=True, on_message=_say)
    n_done = 0

    def advance(done: int, total: int, _added: object) -> None:
        nonlocal n_done
        n_done = done
        show(done, total=total)

    with ExitStack() as stack:
        workers = stack.enter_context(options.open_cluster(cluster))
        try:
            show = stack.enter_context(progress_bar("analysing", len(listed)))
            result = fleet.add(
                listed,
                rig=opened,
                sampling_rate_hz=fs,
                speed=options.stated_speed(speed_rpm, None, 1),
                reference=reference,
                reference_rate_hz=reference_fs,
                torque_nm=options.torque_of(torque),
                memory_bytes=1e9 * memory,
                n_processes=jobs,
                on_progress=advance,
            )
        except KeyboardInterrupt:
            raise stopped(f"{n_done} results are in {store}") from None
        _show_added(replace(result, excluded=tuple(excluded)), store, workers, json=json)
    if result.failures:
        raise typer.Exit(EXIT_INPUT_ERROR if len(result.failures) == len(listed) else EXIT_SOME_FAILED)


@fleet_app.command()
def status(
    store: StoreOption = DEFAULT_STORE,
    machine: OnlyMachineOption = "",
    all_points: Annotated[bool, typer.Option("--all", help="All measuring points, not the 40 worst.")] = False,
    json: options.JsonOption = False,
) -> None:
    """Show the measuring points, the worst first: diagnosis of the last recording, alarms, largest increases."""
    from gearsig.fleet import counts_text, diagnosis_text, trends_text

    table = _open(store).status()
    if machine:
        table = table[table["machine"] == machine]
    if json:
        _print_records(table)
        return
    shown = table if all_points else table.head(40)
    rows = [
        (
            str(row["level"]),
            str(row["machine"]),
            str(row["point"]) or "–",
            f"{row['last']:%Y-%m-%d %H:%M}",
            str(row["n_recordings"]) + (f" (+{row['n_failed']} failed)" if row["n_failed"] else ""),
            diagnosis_text(row),
            trends_text(row),
        )
        for row in shown.to_dict("records")
    ]
    _table(("", "machine", "point", "last", "recordings", "diagnosis", "trends"), rows)
    more = f"; {len(table) - len(shown)} more with --all" if len(shown) < len(table) else ""
    typer.echo(f"{counts_text(table)}{more}")


@fleet_app.command()
def trend(
    machine: Annotated[str, typer.Argument(help="Machine.")],
    indicator: Annotated[str, typer.Argument(help="E.g. 'overall velocity'; default: all, the worst first.")] = "",
    store: StoreOption = DEFAULT_STORE,
    point: OnlyPointOption = "",
    channel: Annotated[str, typer.Option("--channel", help="Only this channel.")] = "",
    over: Annotated[
        str, typer.Option("--over", help="time, load or speed; for the last two, limits follow the baseline's trend.")
    ] = "time",
    json: options.JsonOption = False,
) -> None:
    """Show an indicator over time, load or speed with its limits, or all indicators of a machine against theirs.

    For the overall velocity, limits are the zones of ISO 20816-3 if the rig file gives the machine's class; otherwise
    they are statistical limits from the baseline; docs/fleet.md says how often they are wrong.
    """
    from gearsig.checks import one_of
    from gearsig.errors import InputError
    from gearsig.fleet import CONDITIONS
    from gearsig.formatting import unit_text

    one_of(over, "--over", ("time", *CONDITIONS))
    fleet = _open(store)
    if not indicator:
        if over != "time":
            raise InputError(f"--over {over} takes one indicator", remedy="name it after the machine")
        table = fleet.series(machine, point)
        if json:
            _print_records(table)
            return
        _table(
            ("", "indicator", "of", "last", "expected", "limit", "change", "since", "limits"),
            [_series_row(row) for row in table.to_dict("records")],
        )
        return
    if over != "time":
        _show_over(fleet.trend_over(over, machine, indicator, point=point, channel=channel), json=json)
        return
    trends = fleet.trend(machine, indicator, point=point, channel=channel)
    if json:
        _print_json([_trend_json(t) for t in trends])
        return
    for series in trends:
        typer.echo(f"{series!r}. {series.text}")
        rows = [
            (
                row["level"] if not row["in_baseline"] else "baseline",
                f"{row['date']:%Y-%m-%d %H:%M}",
                *(_number(row[name]) for name in ("value", "expected", "high", "alarm", "speed_rpm", "load_nm")),
            )
            for row in series.table.to_dict("records")
        ]
        unit = f" ({unit_text(series.unit)})" if series.unit else ""
        _table(("", "date", f"{series.name}{unit}", "expected", "limit", "alarm", "rpm", "N m"), rows)


@fleet_app.command()
def export(
    output: Annotated[Path, options.output_option(".csv, .parquet or .jsonl.", "FILE")],
    table: Annotated[
        str, typer.Option("--table", help="indicators, recordings, trends (limits and alarms) or status.")
    ] = "indicators",
    store: StoreOption = DEFAULT_STORE,
    machine: OnlyMachineOption = "",
    point: OnlyPointOption = "",
    indicator: Annotated[str, typer.Option("--indicator", metavar="NAME", help="Only this indicator.")] = "",
    start: StartOption = None,
    end: EndOption = None,
) -> None:
    """Write results as a table for other programs.

    Example: gearsig fleet export -o kurtosis.csv --indicator kurtosis --from 2026-01-01
    """
    n = _open(store).export(output, table, machine, point, name=indicator, start=start, end=end)
    typer.echo(f"{n} rows in {output}.")


@fleet_app.command()
def report(
    output: Annotated[Path, options.output_option("The page, e.g. fleet.html.", "FILE")],
    store: StoreOption = DEFAULT_STORE,
    since: Annotated[
        datetime | None, typer.Option("--since", help="UTC. Default: since the last report of this fleet.")
    ] = None,
    everything: Annotated[bool, typer.Option("--everything", help="Since the beginning.")] = False,
    pdf: Annotated[bool, typer.Option("--pdf", help="Also write the page as PDF.")] = False,
) -> None:
    """Write what changed since the last report as one HTML page: diagnoses, alarms raised and cleared, level changes.

    Example: gearsig fleet report -o monday.html
    """
    from datetime import UTC

    from gearsig.errors import InputError
    from gearsig.fleet import last_report, mark_reported
    from gearsig.report import check_pdf, write_fleet_page

    if pdf:
        check_pdf()
    fleet = _open(store)
    now = datetime.now(UTC).replace(tzinfo=None)
    write_fleet_page(fleet, output, None if everything else since or last_report(fleet), pdf=pdf)
    if since is None and not everything:
        try:
            mark_reported(fleet, now)
        except InputError as error:  # somebody else's store may be read-only
            _say(f"the next report will start at the same date as this one: {error}")
    typer.echo(f"Open {output} in a browser.")


@fleet_app.command()
def baseline(
    machine: Annotated[str, typer.Argument(help="Machine.")],
    start: Annotated[datetime, typer.Argument(help="First date, e.g. 2026-01-31.")],
    end: Annotated[datetime, typer.Argument(help="Last date.")],
    store: StoreOption = DEFAULT_STORE,
    point: OnlyPointOption = "",
) -> None:
    """State when a machine was healthy, e.g. after an overhaul; by default its first 20 healthy recordings count."""
    from datetime import timedelta

    if end == end.replace(hour=0, minute=0, second=0, microsecond=0):  # a date means all of that day
        end += timedelta(days=1, microseconds=-1)
    _open(store).set_baseline(machine, start, end, point=point)
    typer.echo(f"The baseline of {machine} is from {start:%Y-%m-%d} to {end:%Y-%m-%d}.")


@fleet_app.command()
def watch(
    places: PlacesArgument,
    store: StoreOption = DEFAULT_STORE,
    pattern: PatternOption = "",
    machine: MachineOption = "",
    point: PointOption = "",
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    interval: Annotated[float, typer.Option("--interval", metavar="S", help="Seconds between two checks.")] = 5.0,
    settle: Annotated[
        float, typer.Option("--settle", metavar="S", help="Seconds for which a file must be unchanged.")
    ] = 10.0,
    once: Annotated[bool, typer.Option("--once", help="End once all existing recordings have been added.")] = False,
    jobs: options.JobsOption = None,
    cluster: options.ClusterOption = "",
    memory: options.MemoryOption = 2.0,
    json: Annotated[bool, typer.Option("--json", help="Print a line of JSON for each recording.")] = False,
) -> None:
    """Add new recordings as they appear, with a line for each, until it is stopped (Ctrl-C or SIGTERM).

    A file is added once it has stopped changing. Several watches on one folder share the work; after a restart the
    command continues where it was. The exit code is 0 when it is stopped, and 1 if recordings failed with --once.

    Example: gearsig fleet watch incoming --pattern '{machine}/{date:%Y%m%d-%H%M}.wav' --json
    """
    from gearsig.fleet import WatchEvent, open_fleet
    from gearsig.fleet import watch as run_watch

    opened = options.open_rig(rig)
    fleet = open_fleet(store, create=True, on_message=_say)

    def tell(event: WatchEvent) -> None:
        if json:
            typer.echo(json_text.dumps(event.as_dict(), ensure_ascii=False))
            return
        words = event.text
        if event.added is not None:
            o = event.added.origin
            where = " ".join(part for part in (o.machine, o.point) if part)
            words = f"{where} {o.date:%Y-%m-%d %H:%M} {o.path.name}: {event.added.outcome}: {event.text}"
            words += f" (no longer in the fleet as {event.added.replaced})" if event.added.replaced else ""
        typer.echo(
            f"{event.time:%Y-%m-%dT%H:%M:%SZ} {event.kind}: {words}", err=event.kind in ("problem", "passed over")
        )

    with options.open_cluster(cluster):
        try:
            n_failed = run_watch(
                fleet,
                places,
                on_event=tell,
                interval_s=interval,
                settle_s=settle,
                once=once,
                n_processes=jobs,
                pattern=pattern,
                machine=machine,
                point=point,
                rig=opened,
                sampling_rate_hz=fs,
                memory_bytes=1e9 * memory,
            )
        except KeyboardInterrupt:
            typer.echo("gearsig: the watch was stopped", err=True)
            return
    if n_failed:
        raise typer.Exit(EXIT_SOME_FAILED)


# --------------------
# How results are shown.
# --------------------

_STYLES = {"alarm": "bold red", "warning": "yellow", "unknown": "bold", "ok": "green"}


def _open(store: Path) -> Fleet:
    from gearsig.fleet import open_fleet

    return open_fleet(store, on_message=_say)


def _say(text: str) -> None:
    typer.echo(f"gearsig: {text}", err=True)


def _print_json(answer: object) -> None:
    typer.echo(json_text.dumps(answer, indent=1, ensure_ascii=False))


def _print_records(table: DataFrame) -> None:
    typer.echo(table.to_json(orient="records", date_format="iso", indent=1, force_ascii=False))


def _table(
    headings: tuple[str, ...],
    rows: Sequence[tuple[str, ...]],
    styles: Mapping[str, str] = _STYLES,
    *,
    err: bool = False,
) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell, styles.get(cell, "")) for cell in row))  # names from files are not markup
    console = Console(stderr=err)
    if not console.is_terminal:
        console = Console(stderr=err, width=200)
    console.print(table)


def _show_origins(listed: list[Origin], n_shown: int, *, err: bool) -> None:
    from gearsig.fleet import origin_rows

    _table(("file", "machine", "point", "date", "speed"), origin_rows(listed[:n_shown]), styles={}, err=err)
    if len(listed) > n_shown:
        typer.echo(f"… and {len(listed) - n_shown} more; --dry-run shows them all", err=err)


def _origin_json(origin: Origin) -> dict[str, Any]:
    return {name: str(value) if name in ("path", "date") else value for name, value in vars(origin).items()}


def _excluded_json(files: Sequence[ExcludedFile]) -> list[dict[str, str]]:
    return [{"file": str(file.path), "reason": file.reason} for file in files]


def _show_added(result: AddResult, store: Path, workers: Cluster | None, *, json: bool) -> None:
    from gearsig.formatting import counted

    ran = workers.text() if workers else ""
    replaced = [added for added in result.added if added.replaced]
    if json:
        failures = [{"file": str(a.origin.path), "reason": a.verdict} for a in result.failures]
        summary = {
            "added": len(result.added) - len(failures),
            "known": result.n_known,
            "taken_by_others": result.n_elsewhere,
            "failures": failures,
            "replaced": [{"file": str(a.origin.path), "earlier": a.replaced} for a in replaced],
            "excluded": _excluded_json(result.excluded),
            "ran": ran,
        }
        _print_json(summary)
        return
    for moved in replaced:
        typer.echo(f"{moved.origin.path}: no longer in the fleet as {moved.replaced}", err=True)
    for failure in result.failures:
        typer.echo(f"{failure.origin.path}: not analysed: {failure.verdict}", err=True)
    parts = [f"{counted(len(result.added) - len(result.failures), 'recording')} added to {store}"]
    parts += [f"{len(result.failures)} failed"] if result.failures else []
    was, are = ("was" if result.n_known == 1 else "were"), ("is" if result.n_elsewhere == 1 else "are")
    parts += [f"{result.n_known} {was} known already"] if result.n_known else []
    parts += [f"{result.n_elsewhere} {are} being analysed by another process"] if result.n_elsewhere else []
    typer.echo("; ".join(parts) + (f"; {ran}" if ran else "") + ".")


def _series_row(row: dict[Any, Any]) -> tuple[str, ...]:
    from pandas import isna

    from gearsig.fleet import change_text, series_level
    from gearsig.formatting import moment_text, unit_text

    unit = f" {unit_text(row['unit'])}" if row["unit"] else ""
    of = " ".join(part for part in (row["point"], row["place"], row["channel"], row["computed_on"]) if part)
    return (
        series_level(row),
        row["name"],
        of,
        _number(row["value"]) + unit,
        _number(row["expected"]),
        _number(row["upper_limit"]),
        change_text(row["change"], in_db=row["in_db"]),
        "" if isna(row["since"]) else moment_text(row["since"]),
        row["basis"],
    )


def _number(value: float) -> str:
    from gearsig.formatting import readable

    return readable(value, 4)


def _show_over(trends: Sequence[OperatingTrend], *, json: bool) -> None:
    from gearsig.formatting import unit_text

    if json:
        _print_json([_over_json(shown) for shown in trends])
        return
    for shown in trends:
        typer.echo(f"{shown!r}. {shown.text}")
        columns = [str(name) for name in shown.table.columns if name not in ("date", "level", "low")]
        unit = f" ({unit_text(shown.trend.unit)})" if shown.trend.unit else ""
        headings = {"load_nm": "N m", "speed_rpm": "rpm", "value": f"{shown.trend.name}{unit}", "high": "limit"}
        rows = [
            (row["level"], *(_number(row[name]) for name in columns), f"{row['date']:%Y-%m-%d %H:%M}")
            for row in shown.table.to_dict("records")
        ]
        _table(("", *(headings.get(name, str(name)) for name in columns), "date"), rows)


def _over_json(shown: OperatingTrend) -> dict[str, Any]:
    return _trend_json(shown.trend) | {
        "over": shown.over,
        "held": shown.held if isfinite(shown.held) else None,
        "text": shown.text,
        "table": _records(shown.table),
        "curve": _records(shown.curve),
    }


def _records(table: DataFrame) -> Any:
    return json_text.loads(table.to_json(orient="records", date_format="iso"))


def _trend_json(trend: Any) -> dict[str, Any]:
    facts = {name: value for name, value in vars(trend).items() if name != "table"}
    facts["changed"] = trend.changed.isoformat() if trend.changed else None
    facts["table"] = _records(trend.table)
    return facts
