"""A fleet: recordings of many machines over time, their trends and alarms, in one folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearsig.checks import closest_match_hint, count, known_name, one_of
from gearsig.errors import InputError
from gearsig.fleet._add import FAILED, UNTOLD, AddResult, AnalysisOptions, Progress, add_recordings
from gearsig.fleet._origin import ExcludedFile, Origin, origins
from gearsig.fleet._statistics import ALARM, OK, WARNING
from gearsig.fleet._store import SERIES, Store, write_query
from gearsig.fleet._trends import (
    CONDITIONS,
    STATUS_LEVELS,
    Baseline,
    OperatingTrend,
    PointTrends,
    Trend,
    TrendSettings,
    judge,
    last_level,
    over_condition,
    read_settings,
    state_rows,
    trend_of,
    write_settings,
)
from gearsig.formatting import counted

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from duckdb import DuckDBPyConnection
    from pandas import DataFrame

    from gearsig.rig import Rig, SpeedSource

TRENDS = "trends.parquet"
TABLES = ("recordings", "indicators", "trends", "status")

_STATE = {
    **dict.fromkeys(("machine", "point", *SERIES), "VARCHAR"),
    "n": "BIGINT",
    "n_baseline": "BIGINT",
    "baseline_from": "TIMESTAMP",
    "baseline_to": "TIMESTAMP",
    "value": "DOUBLE",
    "date": "TIMESTAMP",
    "expected": "DOUBLE",
    "upper_limit": "DOUBLE",
    "change": "DOUBLE",
    "in_db": "BOOLEAN",
    "level": "BIGINT",
    "since": "TIMESTAMP",
    "basis": "VARCHAR",
    "normalised": "VARCHAR",
    "changed": "TIMESTAMP",
    "changed_added": "TIMESTAMP",
    "changed_by": "DOUBLE",
    "events": "VARCHAR",
    "fingerprint": "VARCHAR",
}
_TYPED = ", ".join(f"{name}::{kind} AS {name}" for name, kind in _STATE.items())
"""Columns of a series' state: see `state_rows`."""
LATEST = f"(outcome <> '{UNTOLD}', date)"
"""Order whose maximum is the recording that gives the diagnosis: the last conclusive one, else the last."""


@dataclass(frozen=True)
class DiagnosisChange:
    """A measuring point whose last conclusive recording has another diagnosis than the one before."""

    machine: str
    point: str
    date: datetime
    before: str
    now: str
    verdict: str


class Fleet:
    """Results of many recordings; see `open_fleet`."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._trends: DataFrame | None = None

    def __repr__(self) -> str:
        n, machines, points = self._rows(
            "SELECT count(*), count(DISTINCT machine), count(DISTINCT (machine, point)) FROM recordings"
        )[0]
        counts = counted(n, "recording"), counted(machines, "machine"), counted(points, "measuring point")
        return "Fleet {}: {} of {} at {}".format(self.folder, *counts)

    @property
    def folder(self) -> Path:
        """Folder of the store."""
        return self._store.folder

    # ---------------- adding

    def add(
        self,
        recordings: str | Path | Iterable[str | Path | Origin],
        *,
        pattern: str = "",
        machine: str = "",
        point: str = "",
        date: datetime | None = None,
        rig: Rig | None = None,
        sampling_rate_hz: float | None = None,
        speed: SpeedSource | None = None,
        reference: str | Path | None = None,
        torque_nm: float | None = None,
        reference_rate_hz: float | None = None,
        memory_bytes: float = 2e9,
        n_processes: int | None = None,
        executor: Executor | None = None,
        on_progress: Progress | None = None,
    ) -> AddResult:
        """Analyse new recordings and store their results.

        Recordings that the store already holds, by content, rig and version of gearsig, are skipped. Any number of
        processes may add to one store at the same time; one that is killed loses only what it was analysing.

        Parameters
        ----------
        recordings : str, Path, or iterable of these or of Origin
            Files, folders with sub-folders, "folder/*.csv"; or the result of `gearsig.fleet.origins`, checked first.
        pattern, machine, point, date
            See `gearsig.fleet.origins`.
        rig, sampling_rate_hz, speed, reference, torque_nm, reference_rate_hz, memory_bytes
            See `gearsig.batch.report_many`; None: as files and rig files state.
        n_processes : int or None
            Local processes; None: one per processor.
        executor : concurrent.futures.Executor or None
            Runs the analyses instead, e.g. the executor of `gearsig.processes.cluster`.
        on_progress : callable or None
            Called as ``on_progress(n_done, n_total, added)``.

        Raises
        ------
        InputError
            If nothing is found, the pattern is invalid, or the store cannot be written.
        """
        if n_processes is not None:
            count(n_processes, "n_processes")
        places = [recordings] if isinstance(recordings, (str, Path)) else list(recordings)
        listed = [item for item in places if isinstance(item, Origin)]
        paths = [item for item in places if not isinstance(item, Origin)]
        excluded = list[ExcludedFile]()
        if paths or not listed:
            stated: dict[str, Any] = {"machine": machine, "point": point, "date": date, "rig": rig}
            listed += origins(paths, pattern=pattern, **stated, on_excluded=excluded.append)
        healthy = Path(reference) if reference is not None else None
        options = AnalysisOptions(rig, sampling_rate_hz, speed, healthy, torque_nm, memory_bytes, reference_rate_hz)
        result = add_recordings(
            self._store, listed, options, n_processes=n_processes, executor=executor, on_progress=on_progress
        )
        self._refreshed()
        return replace(result, excluded=tuple(excluded))

    # ---------------- settings

    @property
    def settings(self) -> TrendSettings:
        """How trends are judged."""
        return read_settings(self.folder)

    def set(self, settings: TrendSettings) -> None:
        """Change the settings by which trends are judged."""
        write_settings(self.folder, settings)

    def set_baseline(self, machine: str, start: datetime, end: datetime, *, point: str = "") -> None:
        """State a period in which a machine was healthy, e.g. after an overhaul; it replaces an earlier statement."""
        self._check_place(machine, point)
        settings = self.settings
        unchanged = tuple(b for b in settings.baselines if (b.machine, b.point) != (machine, point))
        self.set(replace(settings, baselines=(*unchanged, Baseline(machine, point, start, end))))

    # ---------------- tables

    def recordings(
        self, machine: str = "", point: str = "", *, start: datetime | None = None, end: datetime | None = None
    ) -> DataFrame:
        """Return a row per recording, sorted by machine, point and date; failures have outcome "failed" and a reason.

        Parameters
        ----------
        machine, point : str
            Empty: all.
        start, end : datetime or None
        """
        return self._table("recordings", machine, point, {}, start, end, "machine, point, date")

    def indicators(
        self,
        machine: str = "",
        point: str = "",
        name: str = "",
        *,
        channel: str = "",
        place: str = "",
        start: datetime | None = None,
        end: datetime | None = None,
    ) -> DataFrame:
        """Return a row per indicator and recording: machine, point, date, name, value, unit, channel, place, band.

        Parameters
        ----------
        machine, point : str
            Empty: all.
        name : str
            Of the indicator, e.g. "kurtosis"; empty: all.
        channel, place : str
            The place is a gear ("stage 1/input"), a bearing or a shaft.
        start, end : datetime or None
        """
        only = {"name": name, "channel": channel, "place": place}
        return self._table("indicators", machine, point, only, start, end, "machine, point, date")

    def series(self, machine: str = "", point: str = "") -> DataFrame:
        """Return a row per indicator and measuring point: last value, limits and alarms, the worst first."""
        self._refreshed()
        where, values = _where(machine, point, {})
        sql = (
            f"SELECT * EXCLUDE (fingerprint) FROM trends {where} AND name <> '' "
            "ORDER BY level DESC, coalesce(abs(change), 0) DESC, machine, point, name"
        )
        return self._frame(sql, values)

    def status(self) -> DataFrame:
        """Return a row per measuring point, the worst first.

        Columns: machine, point, n_recordings, n_failed, first, last, outcome and verdict of the last conclusive
        recording (a fault remains until a recording shows that it is gone, which "cannot tell" does not), level
        ("alarm", "warning", "unknown" or "ok": the worse of diagnosis and trends, "unknown" without either), n_alarms,
        n_warnings, since, worst (indicator), worst_place (its gear, bearing or shaft), change (its deviation from the
        expected value, in dB if change_in_db), changed (since when the level of some indicator has changed), n_baseline
        (recordings in the longest baseline).
        """
        self._refreshed()
        sql = f"""
            WITH latest AS (
                SELECT machine, point, count(*) FILTER (outcome <> '{FAILED}') AS n_recordings,
                    count(*) FILTER (outcome = '{FAILED}') AS n_failed, min(date) AS first, max(date) AS last,
                    arg_max(outcome, {LATEST}) FILTER (outcome <> '{FAILED}') AS outcome,
                    arg_max(verdict, {LATEST}) FILTER (outcome <> '{FAILED}') AS verdict
                FROM recordings GROUP BY machine, point
            ), judged AS (
                SELECT machine, point, max(level) AS level, count(*) FILTER (level = {ALARM}) AS n_alarms,
                    count(*) FILTER (level = {WARNING}) AS n_warnings, min(since) AS since,
                    arg_max(name, (level, coalesce(abs(change), 0))) FILTER (level > 0) AS worst,
                    arg_max(place, (level, coalesce(abs(change), 0))) FILTER (level > 0) AS worst_place,
                    arg_max(change, (level, coalesce(abs(change), 0))) FILTER (level > 0) AS change,
                    arg_max(in_db, (level, coalesce(abs(change), 0))) FILTER (level > 0) AS change_in_db,
                    min(changed) AS changed, max(n_baseline) AS n_baseline
                FROM trends GROUP BY machine, point
            ), joined AS (
                SELECT l.*, greatest(coalesce(j.level, 0), CASE l.outcome WHEN 'fault' THEN {ALARM}
                    WHEN 'suspicion' THEN {WARNING} ELSE {OK} END) AS number,
                    j.* EXCLUDE (machine, point, level)
                FROM latest l LEFT JOIN judged j USING (machine, point)
            )
            SELECT machine, point, CASE number WHEN {ALARM} THEN 'alarm' WHEN {WARNING} THEN 'warning'
                ELSE CASE WHEN outcome = 'no fault' OR n_baseline > 0 THEN 'ok' ELSE 'unknown' END END
                AS level, * EXCLUDE (machine, point, number)
            FROM joined
            ORDER BY number DESC, level = 'unknown' DESC, n_alarms DESC, n_warnings DESC, abs(change) DESC NULLS LAST,
                machine, point
        """
        return self._frame(sql, [])

    def point_trends(self, machine: str, point: str = "") -> PointTrends:
        """Return all series of a measuring point with their limits, judged again."""
        self._check_place(machine, point, exactly=True)
        return self._store.read(lambda connection: _judged(connection, machine, point, self.settings))

    def trend(
        self, machine: str, name: str, *, point: str = "", channel: str = "", place: str = "", computed_on: str = ""
    ) -> tuple[Trend, ...]:
        """Return an indicator of a machine over time, for each channel and place that has it, the worst first.

        Parameters
        ----------
        machine, name : str
        point, channel, place, computed_on : str
            Empty: all.

        Raises
        ------
        InputError
            If there is no such machine, point or indicator.
        """
        chosen = self._chosen(machine, name, point, {"channel": channel, "place": place, "computed_on": computed_on})
        return tuple(trend_of(trends, column, machine, of_point) for of_point, trends, column in chosen)

    def trend_over(
        self,
        over: str,
        machine: str,
        name: str,
        *,
        point: str = "",
        channel: str = "",
        place: str = "",
        computed_on: str = "",
    ) -> tuple[OperatingTrend, ...]:
        """Return an indicator of a machine over load or speed, for each channel and place that has it; see `trend`.

        Parameters
        ----------
        over : str
            "load" or "speed".
        machine, name, point, channel, place, computed_on : str
            See `trend`.

        Raises
        ------
        InputError
            If there is no such machine, point or indicator, or no recording states its load or speed.
        """
        one_of(over, "over", CONDITIONS)
        only = {"channel": channel, "place": place, "computed_on": computed_on}
        result, settings = [], self.settings
        for of_point, trends, column in self._chosen(machine, name, point, only):
            table, curve, held = over_condition(trends, column, over, settings)
            if not table.empty:
                result.append(OperatingTrend(trend_of(trends, column, machine, of_point), over, table, curve, held))
        if not result:
            remedies = {
                "load": "give --torque to add, a torque channel, or torque_nm in the rig file's operating point",
                "speed": "give a speed source or gears in a rig file",
            }
            raise InputError(f"no recording states its {over}", where=machine, remedy=remedies[over])
        return tuple(result)

    def _chosen(self, machine: str, name: str, point: str, only: dict[str, str]) -> list[tuple[str, PointTrends, int]]:
        """Return measuring point, its trends and column for each requested series, the worst first."""
        self._check_place(machine, point)
        points = [point] if point else [p for (p,) in self._rows(_POINTS, [machine])]
        of_points = {chosen: self.point_trends(machine, chosen) for chosen in points}
        series = [
            (chosen, column, row)
            for chosen, trends in of_points.items()
            for column, row in enumerate(trends.series.to_dict("records"))
        ]
        for key, value in {"name": name, **only}.items():
            if value:
                column_text = (
                    "indicator" if key == "name" else f"{name} {'on' if key == 'computed_on' else f'of {key}'}"
                )
                known = sorted({row[key] for *_, row in series})
                known_name(value, known, f"there is no {column_text} {value!r}", where=machine)
                series = [item for item in series if item[2][key] == value]
        result = [(chosen, of_points[chosen], column) for chosen, column, _ in series]
        return sorted(result, key=lambda item: STATUS_LEVELS.index(last_level(item[1], item[2])))

    def export(
        self,
        path: str | Path,
        table: str = "indicators",
        machine: str = "",
        point: str = "",
        *,
        name: str = "",
        start: datetime | None = None,
        end: datetime | None = None,
    ) -> int:
        """Write a table as CSV, Parquet or JSON lines, by the file's ending; return the number of rows.

        The rows of "indicators" and "recordings" are in no particular order.

        Parameters
        ----------
        path : str or Path
            ".csv", ".parquet" or ".jsonl".
        table : str
            "indicators", "recordings", "trends" (limits and alarms of each series) or "status".
        machine, point, name, start, end
            See `indicators`.
        """
        one_of(table, "table", TABLES)
        target = Path(path)
        # Dictionaries of texts that hardly repeat, and filters over them, cost time and save no space: none is used
        # for more than 16 different texts in a row group. Small groups stay in the processor's cache.
        parquet = "parquet, COMPRESSION snappy, DICTIONARY_SIZE_LIMIT 16, WRITE_BLOOM_FILTER false, "
        forms = {".csv": "csv, HEADER", ".parquet": f"{parquet} ROW_GROUP_SIZE 20480", ".jsonl": "json"}
        form = forms[one_of(target.suffix.lower(), f"ending of {target.name}", forms)]
        if not target.parent.is_dir():
            raise InputError("there is no such folder", where=str(target.parent), remedy="make it, or choose another")
        self._check_place(machine, point)
        dated = table in ("indicators", "recordings")
        if table == "status":
            frame = self.status()
            frame = frame[(frame["machine"] == machine) | (not machine)]
            frame = frame[(frame["point"] == point) | (not point)]
        elif table == "trends":
            frame = self.series(machine, point)
            frame = frame[(frame["name"] == name) | (not name)]
        where, values = _where(machine, point, {"name": name if table == "indicators" else ""}, start, end)

        def write(connection: DuckDBPyConnection) -> int:
            connection.execute("SET preserve_insertion_order = false")  # rows have their date; takes half the time
            if dated:
                return write_query(connection, f"SELECT * FROM {table} {where}", target, form, values)
            connection.register("chosen", frame)
            return write_query(connection, "FROM chosen", target, form)

        return self._store.read(write)

    def news(self, since: datetime) -> tuple[int, int, tuple[tuple[str, str], ...], tuple[DiagnosisChange, ...]]:
        """Return what was added since a date (UTC): numbers of recordings and failures, failures, diagnoses."""
        n_new, n_failed = self._rows(
            f"SELECT count(*), count(*) FILTER (outcome = '{FAILED}') FROM recordings WHERE added > ?", [since]
        )[0]
        failures = self._rows(
            f"SELECT source, reason FROM recordings WHERE added > ? AND outcome = '{FAILED}' "
            "ORDER BY added DESC LIMIT 100",
            [since],
        )
        rows = self._rows(
            f"""
            WITH good AS (FROM recordings WHERE outcome <> '{FAILED}'), split AS (
                SELECT machine, point, max(date) AS date,
                    arg_max(outcome, {LATEST}) FILTER (added <= $1) AS before, arg_max(outcome, {LATEST}) AS now,
                    arg_max(verdict, {LATEST}) AS verdict, max(added) AS added
                FROM good GROUP BY machine, point
            )
            SELECT machine, point, date, coalesce(before, ''), now, verdict FROM split
            WHERE added > $1 AND now IS DISTINCT FROM before
                AND (before IS NOT NULL OR now IN ('fault', 'suspicion'))
            ORDER BY now <> 'fault', now <> 'suspicion', machine, point
            """,
            [since],
        )
        return n_new, n_failed, tuple(failures), tuple(DiagnosisChange(*row) for row in rows)

    def compact(self) -> None:
        """Merge all small files; `add` does so by itself when there are many."""
        self._store.compact(everything=True)

    # ---------------- the rest

    def _refreshed(self) -> None:
        """Judge measuring points again whose results, settings or version of gearsig have changed."""
        settings = self.settings
        self._store.read(lambda connection: self._refresh(connection, settings))

    def _refresh(self, connection: DuckDBPyConnection, settings: TrendSettings) -> None:
        self._view_of_trends(connection)
        from gearsig import __version__

        mark = f"{settings.digest}-{__version__}"
        stale = connection.execute(
            f"""
            WITH now AS (
                SELECT machine, point, concat_ws('-', count(*), epoch_us(max(added)), ?::VARCHAR) AS fingerprint
                FROM recordings WHERE outcome <> '{FAILED}' GROUP BY machine, point
            ), kept AS (SELECT DISTINCT machine, point, fingerprint FROM trends)
            SELECT coalesce(n.machine, k.machine), coalesce(n.point, k.point), n.fingerprint
            FROM now n FULL JOIN kept k USING (machine, point)
            WHERE n.fingerprint IS DISTINCT FROM k.fingerprint
            """,
            [mark],
        ).fetchall()
        if not stale:
            return
        import pandas as pd

        rows: list[dict[str, Any]] = []
        for machine, point, fingerprint in stale:
            if fingerprint is None:
                continue
            trends = _judged(connection, machine, point, settings)
            states = state_rows(trends, machine, point, fingerprint)
            rows += states or [
                dict.fromkeys(_STATE)
                | {"machine": machine, "point": point, "name": "", "level": OK, "fingerprint": fingerprint}
            ]
        new = pd.DataFrame(rows, columns=list(_STATE))
        connection.register("judged_anew", new)
        connection.register("stale", pd.DataFrame([place[:2] for place in stale], columns=["machine", "point"]))
        query = (
            f"SELECT {_TYPED} FROM trends ANTI JOIN stale USING (machine, point) UNION ALL "
            f"SELECT {_TYPED} FROM judged_anew"
        )
        try:
            write_query(connection, query, self.folder / TRENDS, "parquet, COMPRESSION zstd")
            self._trends = None
        except InputError:  # the store may be read-only, or the disk full
            self._trends = connection.execute(query).df()

    def _view_of_trends(self, connection: DuckDBPyConnection) -> None:
        """Create the view `trends` of the file, or of what could not be written; a damaged file counts as missing."""
        import pyarrow.parquet as pq

        if self._trends is not None:
            connection.register("unwritten", self._trends)
            connection.execute(f"CREATE OR REPLACE TEMP VIEW trends AS SELECT {_TYPED} FROM unwritten")
            return
        path = self.folder / TRENDS
        try:
            whole = path.exists() and list(pq.read_schema(path).names) == list(_STATE)
        except Exception:  # noqa: BLE001 - damaged bytes make readers raise anything
            whole = False
        if not whole:
            columns = ", ".join(f"NULL::{kind} AS {name}" for name, kind in _STATE.items())
            connection.execute(f"CREATE OR REPLACE TEMP VIEW trends AS SELECT {columns} WHERE false")
            return
        text = str(path).replace("'", "''")
        connection.execute(f"CREATE OR REPLACE TEMP VIEW trends AS FROM read_parquet(['{text}'])")

    def _table(
        self,
        table: str,
        machine: str,
        point: str,
        only: dict[str, str],
        start: datetime | None,
        end: datetime | None,
        order: str,
    ) -> DataFrame:
        self._check_place(machine, point)
        where, values = _where(machine, point, only, start, end)
        return self._frame(f"SELECT * FROM {table} {where} ORDER BY {order}", values)

    def _frame(self, sql: str, values: Sequence[object]) -> DataFrame:
        def read(connection: DuckDBPyConnection) -> DataFrame:
            self._view_of_trends(connection)
            frame: DataFrame = connection.execute(sql, list(values)).df()
            return frame

        return self._store.read(read)

    def _rows(self, sql: str, values: Sequence[object] = ()) -> list[Any]:
        return self._store.read(lambda connection: connection.execute(sql, list(values)).fetchall())

    def _check_place(self, machine: str, point: str, *, exactly: bool = False) -> None:
        if not machine and not point and not exactly:
            return
        where, values = _where(machine, point, {})
        if exactly:  # including the point without a name
            where, values = "WHERE machine = ? AND point = ?", [machine, point]
        if self._rows(f"SELECT 1 FROM recordings {where} LIMIT 1", values):
            return
        machines = sorted({m for (m,) in self._rows("SELECT DISTINCT machine FROM recordings")})
        if machine not in machines and machine:
            raise InputError(
                f"there is no machine {machine!r}",
                where=str(self.folder),
                allowed=", ".join(repr(m) for m in machines[:20]) + (" …" if len(machines) > 20 else ""),
                remedy=closest_match_hint(machine, machines),
            )
        points = [p for (p,) in self._rows(_POINTS, [machine])]
        raise InputError(
            f"there is no measuring point {point!r}",
            where=machine,
            allowed=", ".join(repr(p) for p in points),
            remedy=closest_match_hint(point, points),
        )


_POINTS = "SELECT DISTINCT point FROM recordings WHERE machine = ? ORDER BY point"


def open_fleet(folder: str | Path, *, create: bool = False, on_message: Callable[[str], object] | None = None) -> Fleet:
    """Open a store of results of many recordings, kept in a folder.

    Parameters
    ----------
    folder : str or Path
    create : bool
        Whether to create the store if there is none.
    on_message : callable or None
        Called with one sentence, e.g. that a damaged file was set aside; None: issue a Python warning.

    Raises
    ------
    InputError
        If there is no fleet, or the packages it needs are not installed.

    Examples
    --------
    >>> fleet = open_fleet("fleet", create=True)  # doctest: +SKIP
    >>> fleet.add("recordings", pattern="{machine}/{point}_{date:%Y%m%d}.csv")  # doctest: +SKIP
    >>> fleet.status()  # doctest: +SKIP
    """

    def warn(text: str) -> None:
        import warnings

        warnings.warn(text, stacklevel=2)

    return Fleet(Store(Path(folder), on_message or warn, create=create))


def _where(
    machine: str, point: str, only: dict[str, str], start: datetime | None = None, end: datetime | None = None
) -> tuple[str, list[object]]:
    parts: list[str] = ["true"]
    values: list[object] = []
    for name, value in {"machine": machine, "point": point, **only}.items():
        if value:
            parts.append(f"{name} = ?")
            values.append(value)
    for sign, moment in ((">=", start), ("<=", end)):
        if moment is not None:
            parts.append(f"date {sign} ?")
            values.append(moment.replace(tzinfo=None))
    return "WHERE " + " AND ".join(parts), values


def _judged(connection: DuckDBPyConnection, machine: str, point: str, settings: TrendSettings) -> PointTrends:
    place = [machine, point]
    recordings = connection.execute(
        "SELECT key, date, added, speed_rpm, load_nm, outcome, iso_group, iso_mounting FROM recordings "
        f"WHERE machine = ? AND point = ? AND outcome <> '{FAILED}'",
        place,
    ).df()
    names = ", ".join(SERIES)
    indicators = connection.execute(
        f"SELECT key, value, {names} FROM indicators WHERE machine = ? AND point = ?", place
    ).df()
    return judge(recordings, indicators, settings, settings.baseline_of(machine, point))
