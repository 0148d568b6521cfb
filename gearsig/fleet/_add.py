"""Add recordings to a store: new ones are analysed, known ones are skipped."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearsig.errors import GearsigError, InputError, unexpected_text
from gearsig.fleet._origin import ExcludedFile, Origin
from gearsig.fleet._store import Row, Store
from gearsig.processes import killed_text, n_processors, run_jobs
from gearsig.rig import ConstantSpeed, Rig, SpeedSource, read_rig, rig_file_beside, rig_to_dict

if TYPE_CHECKING:
    from gearsig.diagnosis import Analysis, LongAnalysis

Progress = Callable[[int, int, "AddedRecording"], object]

FAILED = "failed"
"""Outcome of a recording that could not be analysed."""

UNTOLD = "cannot tell"
"""Outcome of an inconclusive recording: it neither finds a fault nor clears one."""


@dataclass(frozen=True)
class AnalysisOptions:
    """Options with which recordings are analysed, in addition to what their files state.

    Parameters
    ----------
    rig : Rig or None
        The machine of all recordings; what a rig file of the same name beside one states of its measurement goes
        before it, and before the sampling rate. None: only that file.
    sampling_rate_hz : float or None
        For files that do not state it.
    speed : SpeedSource or None
        Overrides what file and rig state.
    reference : Path or None
        Recording of the healthy machine.
    torque_nm : float or None
        Overrides the rig's operating point.
    memory_bytes : float
        Memory that the analysis of one recording may take; for longer ones, see `gearsig.diagnosis.analyze_file`.
    reference_rate_hz : float or None
        Sampling rate of the reference, if it differs. Without a reference, the recording itself is one.
    """

    rig: Rig | None = None
    sampling_rate_hz: float | None = None
    speed: SpeedSource | None = None
    reference: Path | None = None
    torque_nm: float | None = None
    memory_bytes: float = 2e9
    reference_rate_hz: float | None = None

    def analyze(self, path: Path, nominal_speed_rpm: float | None = None) -> Analysis | LongAnalysis:
        """Analyse a recording, with the reference unless it is the reference; see `gearsig.diagnosis.analyze_file`.

        A nominal speed, e.g. from the file name, replaces the rig's nominal and constant speeds.
        """
        from gearsig.diagnosis import analyze_file, read_reference, rig_and_rate_of_reference

        is_reference = self.reference is None or self.reference.resolve() == path.resolve()
        own_hz = self.reference_rate_hz if is_reference else None
        rig, rate_hz = rig_and_rate_of_reference(path, self.rig, self.sampling_rate_hz, own_hz, is_same_machine=True)
        if self.rig is None and (rig_file := rig_file_beside(path)) is not None:
            rig = read_rig(rig_file)
        reading: dict[str, Any] = {"speed": self.speed, "memory_bytes": self.memory_bytes}
        healthy = None
        if self.reference is not None and not is_reference:
            healthy = read_reference(
                self.reference,
                rig,
                sampling_rate_hz=self.sampling_rate_hz,
                reference_rate_hz=self.reference_rate_hz,
                **reading,
            )
        if nominal_speed_rpm is not None:
            rig = rig if rig is not None else Rig()
            point = replace(rig.operating_point, speed_rpm=nominal_speed_rpm)
            rig = replace(rig, operating_point=point, speed=None if isinstance(rig.speed, ConstantSpeed) else rig.speed)
        return analyze_file(path, rig, reference=healthy, torque_nm=self.torque_nm, sampling_rate_hz=rate_hz, **reading)


@dataclass(frozen=True)
class AddedRecording:
    """Outcome of one recording.

    Parameters
    ----------
    origin : Origin
    outcome : str
        "fault", "suspicion", "cannot tell", "no fault", or "failed".
    verdict : str
        In one sentence; for a failure, the reason.
    replaced : str
        Machine, point and date under which the fleet held the result of this file, which this one replaces; empty if
        it held none, or under the same.
    """

    origin: Origin
    outcome: str
    verdict: str
    replaced: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no result."""
        return self.outcome == FAILED


@dataclass(frozen=True)
class AddResult:
    """Result of adding recordings.

    Parameters
    ----------
    added : tuple of AddedRecording
        In the order of completion, including failures.
    n_known : int
        Recordings that the store already held.
    n_elsewhere : int
        Recordings that another process is analysing.
    excluded : tuple of ExcludedFile
        Recordings that the pattern leaves out.
    """

    added: tuple[AddedRecording, ...]
    n_known: int
    n_elsewhere: int = 0
    excluded: tuple[ExcludedFile, ...] = ()

    @property
    def failures(self) -> tuple[AddedRecording, ...]:
        """Recordings without a result."""
        return tuple(item for item in self.added if item.failed)


@dataclass(frozen=True)
class _AnalysisJob:
    """One recording with everything that a worker needs."""

    origin: Origin
    options: AnalysisOptions
    sha256: str
    setup: str
    replaces: str = ""


def add_recordings(
    store: Store,
    recordings: Sequence[Origin],
    options: AnalysisOptions,
    *,
    n_processes: int | None = None,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> AddResult:
    """Analyse what the store does not hold yet; see `Fleet.add`."""
    from gearsig import __version__
    from gearsig.recording import sha256_of

    setups = _setups(options)
    known = _stored_identities(store, recordings, __version__)
    missing = [origin for origin in recordings if _identity(origin, setups(origin)) not in known]
    elsewhere: list[Origin] = []
    unseen: list[Origin] = []  # known content under a new name or modification time
    results: list[AddedRecording] = []
    workers = min(max(len(missing), 1), n_processors()) if n_processes is None else n_processes
    claims: dict[str, ExitStack] = {}
    earlier: dict[Origin, str] = {}

    def jobs() -> Iterator[_AnalysisJob]:
        remaining = iter(missing)
        while batch := list(islice(remaining, 32)):
            held: dict[Origin, str] = {}
            for origin in batch:
                claim, name = ExitStack(), _digest(_identity(origin, setups(origin)))
                if not claim.enter_context(store.claim(name)):
                    elsewhere.append(origin)
                    continue
                claims[name] = claim
                try:
                    held[origin] = sha256_of(origin.path)
                except OSError as error:
                    results.append(AddedRecording(origin, FAILED, f"cannot be read ({error.strerror})"))
            of_content = _of_content(store, held)
            for origin, sha256 in held.items():
                setup = setups(origin)
                key, *before, earlier[origin] = of_content.get(origin, ("", ""))
                if before == [setup, __version__]:
                    unseen.append(origin)
                    claims.pop(_digest(_identity(origin, setup))).close()
                else:
                    yield _AnalysisJob(origin, options, sha256, setup, key)

    running = run_jobs(analyse_file, jobs(), n_workers=max(1, min(workers, 64)), executor=executor, if_killed=_killed)
    try:
        with closing(running):
            for _, (row, indicators, origin) in running:
                if row["key"]:
                    store.add(row, indicators)
                claims.pop(_digest(_identity(origin, setups(origin)))).close()
                text = str(row["verdict"] or row["reason"])
                results.append(AddedRecording(origin, str(row["outcome"]), text, earlier[origin]))
                if on_progress is not None:
                    on_progress(len(results), len(missing), results[-1])
                if len(results) % 64 == 0:
                    _merge_many(store)
    finally:
        for claim in claims.values():
            claim.close()
    _merge_many(store)
    n_known = len(recordings) - len(missing) + len(unseen)
    return AddResult(tuple(results), n_known, len(elsewhere))


def _merge_many(store: Store) -> None:
    """Merge small files if there are many; an addition does not fail if the disk has no room for the merged ones."""
    if store.n_new() < COMPACT_FROM:
        return
    try:
        store.compact()
    except InputError as error:
        store.on_message(f"small files are not merged yet: {error}")


COMPACT_FROM = 128
"""Number of small files from which they are merged: reading them takes a tenth of a second."""


def analyse_file(job: _AnalysisJob) -> tuple[Row, list[Row], Origin]:
    """Analyse one recording; every error becomes a reason. The key is empty if nothing is to be stored."""
    from gearsig.diagnosis import LongAnalysis
    from gearsig.recording import sha256_of

    path, began = job.origin.path, time.process_time()
    try:
        result = job.options.analyze(path, _nominal_speed_rpm(job.origin, job.options))
        analysis = result.as_one() if isinstance(result, LongAnalysis) else result
        if (analysis.recording.provenance.sha256 or sha256_of(path)) != job.sha256:  # no hash is computed of parts
            return _row(job, outcome=FAILED, reason="it was changed while it was read", key=""), [], job.origin
    except GearsigError as error:
        return _row(job, outcome=FAILED, reason=str(error).removeprefix(f"{path.name}: ")), [], job.origin
    except Exception as error:  # noqa: BLE001 - one broken file must not stop the rest; the reason is passed on
        return _row(job, outcome=FAILED, reason=unexpected_text(error)), [], job.origin
    facts = _facts(analysis, job.options)
    if isinstance(result, LongAnalysis):
        facts["duration_s"] = result.duration_s
    row = _row(job, **facts, cpu_s=time.process_time() - began)
    return row, _indicators(analysis), job.origin


def _facts(analysis: Analysis, options: AnalysisOptions) -> Row:
    from gearsig.angle import ShaftAngle
    from gearsig.diagnosis import VIBRATION_ZONE, outcome_of
    from gearsig.severity import CrackEstimate

    recording, rig, angle = analysis.recording, analysis.rig, analysis.shaft_angle
    top = analysis.top_claim
    # Zones are limits of a trend: a machine that has always been in zone C still has a baseline.
    outcome = outcome_of([f for f in analysis.findings if f.code != VIBRATION_ZONE])
    judged = rig is not None and any(f.code == VIBRATION_ZONE for f in analysis.findings)
    machine = rig.machine if rig is not None and judged else None
    load = options.torque_nm
    if load is None and rig is not None:
        load = rig.operating_point.torque_nm
    crack = analysis.crack
    return {
        "rig": rig.name if rig is not None else "",
        "n_channels": len(recording.channels),
        "duration_s": recording.duration_s,
        "sampling_rate_hz": recording.sampling_rate_hz,
        "speed_rpm": angle.mean_speed_rpm if isinstance(angle, ShaftAngle) else None,
        "load_nm": _measured_load_nm(analysis, load),
        "outcome": outcome.value,
        "verdict": analysis.verdict,
        "confidence": top.confidence if top is not None else None,
        "crack_mm": crack.depth_mm if isinstance(crack, CrackEstimate) else None,
        "iso_group": machine.group if machine is not None else None,
        "iso_mounting": machine.mounting if machine is not None else "",
        "findings": json.dumps(
            [
                {"code": f.code, "kind": f.kind.value, "title": f.title, "confidence": round(f.confidence, 4)}
                for f in analysis.findings
            ],
            ensure_ascii=False,
        ),
    }


def _measured_load_nm(analysis: Analysis, stated: float | None) -> float | None:
    """Return the mean of the first torque channel in N m, or else the stated load."""
    factor = {"nm": 1.0, "n*m": 1.0, "n·m": 1.0, "n m": 1.0, "knm": 1e3}
    for channel in analysis.recording.channels:
        unit = channel.unit.strip().casefold()
        if channel.quantity == "torque" and unit in factor:
            return float(analysis.recording.values(channel.name).mean()) * factor[unit]
    return stated


def _indicators(analysis: Analysis) -> list[Row]:
    from math import isfinite

    from gearsig.recording import names_without_number

    # The series continue in the next record, whose channel names contain its number.
    names = names_without_number(analysis.recording.channel_names)
    return [
        {
            "name": i.name,
            "value": float(i.value),
            "unit": i.unit,
            "channel": names.get(i.channel, i.channel),
            "place": i.gear or i.bearing or i.shaft,
            "computed_on": i.computed_on,
            "band": i.band,
        }
        for i in analysis.indicators
        if isfinite(i.value)
    ]


def _row(job: _AnalysisJob, **facts: Any) -> Row:
    from gearsig import __version__

    origin = job.origin
    key = [job.sha256, origin.machine, origin.point, origin.date.isoformat(), job.setup, __version__]
    return {
        "key": _digest(key),
        "machine": origin.machine,
        "point": origin.point,
        "date": origin.date,
        "source": _printable(origin.path),
        "sha256": job.sha256,
        "n_bytes": origin.n_bytes,
        "mtime_ns": origin.mtime_ns,
        "origin": f"machine: {origin.machine_from}; point: {origin.point_from}; date: {origin.date_from}"
        + (f"; speed: {origin.speed_from}" if origin.speed_rpm is not None else ""),
        "rig": "",
        "setup": job.setup,
        "version": __version__,
        "added": datetime.now(UTC).replace(tzinfo=None),
        "verdict": "",
        "iso_mounting": "",
        "findings": "[]",
        "reason": "",
        "replaces": job.replaces,
    } | facts


def _killed(job: _AnalysisJob) -> tuple[Row, list[Row], Origin]:
    return _row(job, outcome=FAILED, reason=killed_text("analysed it"), key=""), [], job.origin


def _stored_identities(store: Store, recordings: Sequence[Origin], version: str) -> set[tuple[Any, ...]]:
    """Return the identities of files whose results the store holds, judged by size and modification time."""
    names = {_printable(origin.path) for origin in recordings}
    sql = "SELECT source, n_bytes, mtime_ns, machine, point, date, setup FROM recordings WHERE version = ? " + (
        "AND source IN (SELECT unnest(?))" if len(names) < 100_000 else ""
    )
    arguments: list[Any] = [version, sorted(names)] if len(names) < 100_000 else [version]
    return set(store.read(lambda connection: connection.execute(sql, arguments).fetchall()))


def _identity(origin: Origin, setup: str) -> tuple[Any, ...]:
    place = origin.machine, origin.point, origin.date
    return _printable(origin.path), origin.n_bytes, origin.mtime_ns, *place, setup


def _of_content(store: Store, files: Mapping[Origin, str]) -> dict[Origin, tuple[str, ...]]:
    """Return key, setup, version and "" of the latest result of a file's content for the same machine, point and date.

    If there is none, return the key of a result that the new one replaces: that of the same file for another machine,
    point or date, with a text of these, or its failure before it was copied completely.
    """
    sql = (
        "SELECT sha256, machine, point, date, source, key, setup, version, outcome FROM recordings "
        f"WHERE sha256 IN (SELECT unnest($1)) OR (outcome = '{FAILED}' AND source IN (SELECT unnest($2))) "
        "ORDER BY added"
    )
    arguments = [[*files.values()], [_printable(origin.path) for origin in files]]
    rows = store.read(lambda connection: connection.execute(sql, arguments).fetchall())
    of_place = {tuple(row[:4]): (*row[5:8], "") for row in rows}
    of_file: dict[object, tuple[str, str]]
    of_file = {(row[0], row[4]): (row[5], _place_text(*row[1:4])) for row in rows}
    of_file |= {row[4]: (row[5], "") for row in rows if row[8] == FAILED}
    result: dict[Origin, tuple[str, ...]] = {}
    for origin, sha256 in files.items():
        place, source = (sha256, origin.machine, origin.point, origin.date), _printable(origin.path)
        replaced = of_file.get((sha256, source), of_file.get(source))
        if place in of_place:
            result[origin] = of_place[place]
        elif replaced is not None:
            result[origin] = replaced
    return result


def _place_text(machine: str, point: str, date: datetime) -> str:
    return ", ".join(part for part in (machine, point, f"{date:%Y-%m-%d %H:%M}") if part)


def _nominal_speed_rpm(origin: Origin, options: AnalysisOptions) -> float | None:
    """Return the nominal speed of a recording in rpm, unless a speed was given."""
    return origin.speed_rpm if options.speed is None else None


def _setups(options: AnalysisOptions) -> Callable[[Origin], str]:
    """Return a function that hashes everything but its content that determines a file's result."""
    from gearsig.recording import n_samples_of, sha256_of, without_condition

    reference = ""
    if options.reference is not None:
        n_samples_of(options.reference)  # a file that cannot be a reference is refused here
        file, run = without_condition(options.reference)
        reference = sha256_of(file) + ("" if run is None else f"#{run}")
    shared: list[object] = [reference, options.sampling_rate_hz, options.torque_nm, repr(options.speed)]
    if options.reference_rate_hz is not None:
        shared.append(options.reference_rate_hz)

    @cache
    def of_rig_file(path: Path) -> object:
        try:
            return rig_to_dict(read_rig(path))
        except InputError as error:
            return str(error)

    beside = rig_file_beside(options.reference) if options.reference is not None else None
    if beside is not None:
        shared.append(of_rig_file(beside))

    @cache
    def setup(origin: Origin) -> str:
        rig_file = rig_file_beside(origin.path)
        rig: object = of_rig_file(rig_file) if rig_file else None
        if options.rig is not None:
            rig = rig_to_dict(options.rig) if rig is None else [rig_to_dict(options.rig), rig]
        nominal_rpm = _nominal_speed_rpm(origin, options)
        return _digest([rig, *shared, *([f"nominal {nominal_rpm:g} rpm"] if nominal_rpm is not None else [])])

    return setup


def _digest(parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, default=str).encode("utf-8", "surrogateescape")).hexdigest()[:32]


def _printable(path: Path) -> str:
    """Return a path as UTF-8, which Parquet requires; other bytes of a file name are escaped."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")
