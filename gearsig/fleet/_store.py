"""Results of recordings in append-only Parquet files, read through DuckDB.

A result is written as one small file, named by a hash of its origin, completely or not at all. So any number of
processes may add to one store without waiting for each other, and one that is killed leaves nothing half written. From
time to time small files are merged into segments sorted by machine and indicator.

    store.json              which segments count, and which results in them were replaced
    new/KEY.parquet         one result, with its indicators as a list
    segments/NAME/          recordings.parquet, indicators.parquet
    claims/                 locks of files that a process is analysing
    damaged/                unreadable files, set aside
    trends.parquet          limits and alarms of all series, recomputed if missing
"""

from __future__ import annotations

import json
import secrets
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from math import log
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

from gearsig.cache import remove_parts, write_whole
from gearsig.errors import InputError, not_written

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection
    from filelock import FileLock

Value = TypeVar("Value")

SCHEMA, SCHEMA_VERSION = "gearsig-fleet", 1
MANIFEST, NEW, SEGMENTS, DAMAGED, CLAIMS, LOCK = "store.json", "new", "segments", "damaged", "claims", ".lock"
MERGED = "merged.json"

RECORDING = {
    "key": "string",
    "machine": "string",
    "point": "string",
    "date": "timestamp",
    "source": "string",
    "sha256": "string",
    "n_bytes": "int64",
    "mtime_ns": "int64",
    "origin": "string",
    "rig": "string",
    "setup": "string",
    "version": "string",
    "added": "timestamp",
    "n_channels": "int64",
    "duration_s": "double",
    "sampling_rate_hz": "double",
    "speed_rpm": "double",
    "load_nm": "double",
    "outcome": "string",
    "verdict": "string",
    "confidence": "double",
    "crack_mm": "double",
    "iso_group": "int64",
    "iso_mounting": "string",
    "findings": "string",
    "reason": "string",
    "cpu_s": "double",
    "replaces": "string",
}
"""Columns of a recording's result; `setup` is a hash of rig, reference and options, `reason` why there is none."""

INDICATOR = {
    "name": "string",
    "value": "double",
    "unit": "string",
    "channel": "string",
    "place": "string",
    "computed_on": "string",
    "band": "string",
}
"""Columns of an indicator, besides key, machine, point and date of its recording."""

SERIES = ("name", "channel", "place", "computed_on", "band", "unit")
"""Columns that distinguish the indicators of a measuring point."""

_SQL = {"string": "VARCHAR", "double": "DOUBLE", "int64": "BIGINT", "timestamp": "TIMESTAMP"}
TIER = 8
"""Number of segments of similar size that are merged into one: a result is rewritten once for each power of it."""

Row = dict[str, Any]


class Store:
    """A folder with results.

    Parameters
    ----------
    folder : Path
    on_message : callable
        Called with a message about what was set aside.
    create : bool
        Whether to create the folder if there is none.

    Raises
    ------
    InputError
        If there is no store, or the folder holds other things.
    """

    def __init__(self, folder: Path, on_message: Callable[[str], object], *, create: bool = False) -> None:
        self.folder, self.on_message = folder, on_message
        self._loose_known: frozenset[str] = frozenset()
        self._doubled: set[str] = set()
        self._segments_known: tuple[str, ...] | None = None
        if not (folder / MANIFEST).exists() and not (folder / SEGMENTS).is_dir() and not create:
            raise InputError(
                "there is no fleet", where=str(folder), remedy="make one with: gearsig fleet add RECORDINGS"
            )
        if create:
            self._make()

    def _make(self) -> None:
        """Create what is missing; two processes may do so at the same time without harm."""
        from filelock import FileLock

        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            present = {path.name for path in self.folder.iterdir()}
            if present and not present & {MANIFEST, SEGMENTS}:
                raise InputError("holds other files", where=str(self.folder), remedy="choose another with --store")
            for name in (SEGMENTS, NEW, CLAIMS):  # the first one marks the folder as a store
                (self.folder / name).mkdir(exist_ok=True)
            if MANIFEST not in present:
                with FileLock(self.folder / LOCK):
                    if not (self.folder / MANIFEST).exists():
                        self._write_manifest(self._present_segments(), [])
        except OSError as error:
            raise InputError(
                f"cannot be made ({error.strerror})", where=str(self.folder), remedy="choose another with --store"
            ) from None

    # ---------------- what there is

    def _manifest(self) -> tuple[list[str], list[str]]:
        """Return segments and replaced keys; if the list itself is damaged, all segments present."""
        try:
            data = json.loads((self.folder / MANIFEST).read_text(encoding="utf-8"))
            if data["schema"] == SCHEMA and data["schema_version"] > SCHEMA_VERSION:
                raise InputError(
                    f"was written by a later gearsig (schema {data['schema_version']})",
                    where=str(self.folder),
                    remedy="update gearsig",
                )
            segments, replaced = [str(name) for name in data["segments"]], [str(key) for key in data["replaced"]]
        except FileNotFoundError:
            return self._present_segments(), []
        except (ValueError, KeyError, TypeError, RecursionError):
            self._set_aside(self.folder / MANIFEST, "the list of segments is damaged; all segments count")
            return self._present_segments(), []
        return [name for name in segments if Path(name).name == name and self._segment(name).is_dir()], replaced

    def _present_segments(self) -> list[str]:
        """Return the segments present, except those that have been merged into another."""
        names = {path.name for path in (self.folder / SEGMENTS).glob("[0-9]*") if path.is_dir()}
        for name in sorted(names):
            with suppress(OSError, ValueError, TypeError):
                names -= set(json.loads((self._segment(name) / MERGED).read_text(encoding="utf-8")))
        return sorted(names)

    def _write_manifest(self, segments: Sequence[str], replaced: Sequence[str]) -> None:
        content = {
            "schema": SCHEMA,
            "schema_version": SCHEMA_VERSION,
            "segments": list(segments),
            "replaced": list(replaced),
        }
        text = json.dumps(content, indent=1) + "\n"
        write_whole(self.folder / MANIFEST, lambda file: file.write(text.encode()))

    def _segment(self, name: str) -> Path:
        return self.folder / SEGMENTS / name

    def _parquets(self, segments: Sequence[str]) -> tuple[list[str], list[str]]:
        """Return the files of recordings and the files of indicators, one of each per segment."""
        tables = ("recordings", "indicators")
        recordings, indicators = ([str(self._segment(s) / f"{table}.parquet") for s in segments] for table in tables)
        return recordings, indicators

    def _new(self) -> list[Path]:
        return sorted((self.folder / NEW).glob("[0-9a-f]*.parquet"))

    # ---------------- reading

    def read(self, work: Callable[[DuckDBPyConnection], Value]) -> Value:
        """Return the result of `work` on the views `recordings` and `indicators`; damaged files are set aside.

        Raises
        ------
        InputError
            If the query fails although all files can be read.
        """
        import duckdb

        problem = ""
        for _ in range(4):  # a segment merged while it is read is replaced by another
            try:
                with self._connection() as connection:
                    return work(connection)
            except (RuntimeError, duckdb.InterruptException) as error:
                if "interrupted" not in str(error).lower():
                    raise
                raise KeyboardInterrupt from error  # Ctrl-C during a query, for which DuckDB raises its own error
            except duckdb.Error as error:
                problem = str(error)
                self._check_files()
        raise InputError(f"cannot be read ({problem})", where=str(self.folder), remedy="please report")

    @contextmanager
    def _connection(self) -> Iterator[DuckDBPyConnection]:
        connection = _database().cursor()
        try:
            segments, replaced = self._manifest()
            loose = self._new()
            recordings, indicators = self._parquets(segments)
            self._drop_doubled(connection, loose, recordings)
            loose = [path for path in loose if path.stem not in self._doubled and path.exists()]
            replaced += self._replaced_by(connection, [*recordings, *map(str, loose)])
            connection.execute("CREATE TEMP TABLE replaced (key VARCHAR)")
            if replaced:
                connection.execute("INSERT INTO replaced SELECT unnest(?)", [replaced])
            kept = " WHERE key NOT IN (FROM replaced)" if replaced else ""
            files = [str(path) for path in loose]
            of_recording, of_indicator = ", ".join(RECORDING), ", ".join(INDICATOR)
            connection.execute(
                f"CREATE TEMP VIEW recordings AS {_parts(of_recording, recordings, RECORDING, kept)} UNION ALL "
                f"{_parts(of_recording, files, RECORDING, kept)}"
            )
            every = {"key": "string", "machine": "string", "point": "string", "date": "timestamp"} | INDICATOR
            loose_indicators = _nested_indicators(files, kept) if files else _parts("", [], every, "")
            columns = f"key, machine, point, date, {of_indicator}"
            connection.execute(
                f"CREATE TEMP VIEW indicators AS {_parts(columns, indicators, every, kept)} "
                f"UNION ALL {loose_indicators}"
            )
            yield connection
        finally:
            connection.close()

    def _drop_doubled(self, connection: DuckDBPyConnection, loose: Sequence[Path], segments: Sequence[str]) -> None:
        """Delete small files whose result is in a segment: two processes added it, or a merge was interrupted.

        In a read-only store they remain, but do not count.
        """
        names = frozenset(path.stem for path in loose)
        state = tuple(segments)
        unseen = names if state != self._segments_known else names - self._loose_known
        if unseen and segments:
            doubled = connection.execute(
                f"SELECT key FROM read_parquet({_list(segments)}) WHERE key IN (SELECT unnest(?))", [sorted(unseen)]
            ).fetchall()
            for (key,) in doubled:
                self._doubled.add(key)
                with suppress(OSError):
                    (self.folder / NEW / f"{key}.parquet").unlink(missing_ok=True)
        self._loose_known, self._segments_known = names, state

    def _replaced_by(self, connection: DuckDBPyConnection, files: Sequence[str]) -> list[str]:
        if not files:
            return []
        sql = f"SELECT DISTINCT replaces FROM read_parquet({_list(files)}) WHERE replaces <> ''"
        return [key for (key,) in connection.execute(sql).fetchall()]

    def _check_files(self) -> None:
        """Read every file completely and set aside those that are damaged."""
        import pyarrow.parquet as pq

        loose_schema, columns = _arrow_schema(), [*RECORDING]
        for path in self._new():
            try:
                with path.open("rb") as file:
                    table = pq.ParquetFile(file).read()
                if table.schema.remove_metadata() != loose_schema:
                    raise ValueError("columns")  # noqa: TRY301
            except FileNotFoundError:
                continue
            except Exception:  # noqa: BLE001 - damaged bytes make readers raise anything
                self._set_aside(path, "it is damaged; its recording is analysed again by the next add")
        for name in self._manifest()[0]:
            folder = self._segment(name)
            try:
                for table_name, expected in (("recordings", columns), ("indicators", [*INDICATOR, "key"])):
                    with (folder / f"{table_name}.parquet").open("rb") as file:
                        parts = pq.ParquetFile(file)
                        if not set(expected) <= set(parts.schema_arrow.names):
                            raise ValueError("columns")  # noqa: TRY301
                        for group in range(parts.num_row_groups):
                            parts.read_row_group(group)
            except Exception:  # noqa: BLE001
                if folder.is_dir():
                    self._set_aside(folder, "it is damaged; its recordings are analysed again by the next add")

    def _set_aside(self, path: Path, why: str) -> None:
        target = self.folder / DAMAGED
        with suppress(OSError):
            target.mkdir(exist_ok=True)
            path.rename(target / f"{path.name}.{secrets.token_hex(4)}")
            self.on_message(f"{path.relative_to(self.folder)} is set aside in {DAMAGED}: {why}")

    # ---------------- adding

    def add(self, row: Row, indicators: Sequence[Row]) -> bool:
        """Write one result; return False if the store already holds it.

        Raises
        ------
        InputError
            If it cannot be written, e.g. on a full disk.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.folder / NEW / f"{row['key']}.parquet"
        if path.exists():
            return False
        table = pa.Table.from_pylist([row | {"indicators": list(indicators)}], schema=_arrow_schema())
        write_whole(path, lambda file: pq.write_table(table, file, compression="zstd"))
        return True

    @contextmanager
    def claim(self, name: str) -> Iterator[bool]:
        """Hold the exclusive right to analyse a file within the block; yield False if another process has it.

        Raises
        ------
        InputError
            If the store cannot be written.
        """
        lock = self._locked(Path(CLAIMS) / name)
        if lock is None:
            yield False
            return
        try:
            yield True
        finally:
            with suppress(OSError):
                Path(lock.lock_file).unlink()
            lock.release()

    def _locked(self, name: Path) -> FileLock | None:
        """Return an acquired lock; None if another process holds it."""
        from filelock import FileLock, Timeout

        lock = FileLock(self.folder / name)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            return None
        except OSError as error:
            raise not_written(error, self.folder, "choose another with --store") from None
        return lock

    def n_new(self) -> int:
        """Return the number of small files."""
        return len(self._new())

    def compact(self, *, everything: bool = False) -> bool:
        """Merge small files into a segment, and small segments into one; return False if another process is doing so.

        Nothing is lost if the process is killed: a segment counts once the list names it, and small files are deleted
        only after that.

        Raises
        ------
        InputError
            If the store cannot be written.
        """
        lock = self._locked(Path(LOCK))
        if lock is None:
            return False
        try:
            self._remove_stale()
            self.read(lambda connection: self._merge(connection, everything=everything))
        except OSError as error:
            raise not_written(error, self.folder) from None
        finally:
            lock.release()
        return True

    def _merge(self, connection: DuckDBPyConnection, *, everything: bool) -> None:
        segments, replaced = self._manifest()
        loose = self._new()
        sizes = {
            name: connection.execute(
                f"SELECT count(*) FROM read_parquet({_list([str(self._segment(name) / 'recordings.parquet')])})"
            ).fetchall()[0][0]
            for name in segments
        }
        replaced = sorted({*replaced, *(key for (key,) in connection.execute("FROM replaced").fetchall())})
        merged = segments if everything else _segments_to_merge(sizes)
        if not loose and len(merged) < 2 and not (everything and replaced):
            return
        files = [str(path) for path in loose]
        old, of = self._parquets(merged)
        connection.execute("CREATE OR REPLACE TEMP TABLE gone AS SELECT unnest(?::VARCHAR[]) AS key", [replaced])
        columns, kept = ", ".join(RECORDING), " WHERE key NOT IN (FROM gone)"
        name = f"{time.time_ns():020d}-{secrets.token_hex(4)}"
        part = self.folder / SEGMENTS / f".{name}"
        part.mkdir()
        try:
            once = " QUALIFY row_number() OVER (PARTITION BY key) = 1"
            union = " UNION ALL ".join(
                f"SELECT {columns} FROM read_parquet({_list(paths)}){kept}" for paths in (old, files) if paths
            )
            form = "parquet, COMPRESSION zstd, ROW_GROUP_SIZE 60000"
            query = f"SELECT * FROM ({union}){once} ORDER BY machine, point, date"
            write_query(connection, query, part / "recordings.parquet", form)
            names = ", ".join(INDICATOR)
            of_loose = _nested_indicators(files, kept)
            of_old = f"SELECT key, machine, point, date, {names} FROM read_parquet({_list(of)}){kept}"
            rows = " UNION ALL ".join(sql for sql, exists in ((of_old, of), (of_loose, files)) if exists)
            order = ", ".join(("machine", "point", *SERIES, "date"))
            query = f"SELECT * FROM ({rows}) ORDER BY {order}"
            write_query(connection, query, part / "indicators.parquet", form)
            (part / MERGED).write_text(json.dumps(merged), encoding="utf-8")
            part.rename(self._segment(name))
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        remaining = [old_name for old_name in segments if old_name not in merged]
        self._write_manifest([*remaining, name], replaced if remaining else [])
        for path in loose:
            path.unlink(missing_ok=True)

    def _remove_stale(self) -> None:
        """Delete segments that no longer count; they are kept until the next merge for processes still reading them."""
        counting, _ = self._manifest()
        for path in (self.folder / SEGMENTS).iterdir():
            if path.name not in counting:
                shutil.rmtree(path, ignore_errors=True)
        for folder in (self.folder, self.folder / NEW):
            remove_parts(folder)


@cache
def _database() -> DuckDBPyConnection:
    """Return an empty in-memory database, one per process: opening one takes 20 ms, a cursor of it 1 ms.

    Temporary objects of a cursor are invisible to others. Files are not cached in memory.
    """
    import duckdb

    settings = {"autoinstall_known_extensions": "false", "autoload_known_extensions": "false"}
    database = duckdb.connect(":memory:", config=settings)
    with suppress(duckdb.CatalogException):  # before 1.3 there is no such cache
        database.execute("SET enable_external_file_cache = false")
    return database


def write_query(
    connection: DuckDBPyConnection, query: str, path: Path, form: str, values: Sequence[object] = ()
) -> int:
    """Write the result of a query to a file, completely or not at all; return the number of rows.

    Parameters
    ----------
    connection : DuckDBPyConnection
    query : str
    path : Path
    form : str
        Format and options of COPY.
    values : sequence
        Parameters of the query.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    import duckdb

    n = 0

    def write(file: IO[bytes]) -> None:
        nonlocal n
        try:
            sql = f"COPY ({query}) TO {_text(file.name)} (FORMAT {form}, USE_TMP_FILE false)"
            n = connection.execute(sql, list(values)).fetchall()[0][0]
        except duckdb.IOException as error:
            _, is_of_this, reason = str(error).partition(Path(file.name).name)
            if not is_of_this:  # the error is about a file that is read
                raise
            raise OSError(reason.lstrip(':\\" ').split('"')[0]) from None

    write_whole(path, write)
    return n


def _segments_to_merge(sizes: dict[str, int]) -> list[str]:
    """Return the segments of the lowest full tier and all smaller ones; none if no tier is full."""
    tiers = {name: int(log(max(size, 1), TIER)) for name, size in sizes.items()}
    full = [tier for tier in set(tiers.values()) if list(tiers.values()).count(tier) >= TIER]
    return [name for name, tier in tiers.items() if full and tier <= min(full)]


def _text(value: str) -> str:
    """Return a text as an SQL literal."""
    return "'" + value.replace("'", "''") + "'"


def _list(paths: Iterable[str]) -> str:
    """Return paths as an SQL list, with wildcards in them escaped."""
    return "[" + ", ".join(_text("".join(f"[{c}]" if c in "*?[" else c for c in path)) for path in paths) + "]"


def _nested_indicators(files: Sequence[str], kept: str) -> str:
    """Return the query for the indicators that small files hold as lists."""
    columns = ", ".join(f"i.{name} AS {name}" for name in INDICATOR)
    nested = f"SELECT key, machine, point, date, unnest(indicators) AS i FROM read_parquet({_list(files)}){kept}"
    return f"SELECT key, machine, point, date, {columns} FROM ({nested})"


def _parts(columns: str, files: Sequence[str], types: dict[str, str], kept: str) -> str:
    if files:
        return f"SELECT {columns} FROM read_parquet({_list(files)}){kept}"
    return f"SELECT {', '.join(f'NULL::{_SQL[kind]} AS {name}' for name, kind in types.items())} WHERE false"


def _arrow_schema() -> Any:
    import pyarrow as pa

    kinds = {"string": pa.string(), "double": pa.float64(), "int64": pa.int64(), "timestamp": pa.timestamp("us")}
    indicator = pa.struct([(name, kinds[kind]) for name, kind in INDICATOR.items()])
    fields = [(name, kinds[kind]) for name, kind in RECORDING.items()]
    return pa.schema([*fields, ("indicators", pa.list_(pa.field("element", indicator)))])
