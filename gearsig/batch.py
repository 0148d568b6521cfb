"""Many recordings: analysed by local processes, or by any executor, into one folder of pages."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from gearsig.errors import GearsigError, InputError
from gearsig.formatting import file_label
from gearsig.processes import n_processors, process_pool

if TYPE_CHECKING:
    from gearsig.recording import Recording
    from gearsig.report import Entry, Failure
    from gearsig.rig import Rig, SpeedSource

Progress = Callable[[int, int, "Entry | Failure"], object]

Results = Generator[tuple[int, "Entry | Failure"], None, None]


@dataclass(frozen=True)
class BatchResult:
    """What became of the recordings.

    Parameters
    ----------
    entries : tuple of Entry
        Those analysed, in the order given.
    failures : tuple of Failure
        Those that could not be, with the reason, in the order given.
    index_path : Path
        The page that compares them.
    """

    entries: tuple[Entry, ...]
    failures: tuple[Failure, ...]
    index_path: Path


@dataclass(frozen=True)
class _Job:
    """One recording and where its page goes; everything a worker needs."""

    path: Path
    name: str
    page: Path
    rig: Rig | None
    sampling_rate_hz: float | None
    speed: SpeedSource | None
    command: str
    reference: Path | None = None
    torque_nm: float | None = None
    is_reference: bool = False


def report_many(
    paths: Sequence[str | Path],
    output_folder: str | Path,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
    n_processes: int | None = None,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
    command: str = "",
    reference: str | Path | None = None,
    torque_nm: float | None = None,
) -> BatchResult:
    """Analyse recordings and write a page for each, and an index that compares them.

    A file that fails does not stop the others: the index lists it with its reason. Ctrl-C leaves whole pages only.

    Parameters
    ----------
    paths : sequence of str or Path
        At least one.
    output_folder : str or Path
        Made if it is not there; pages of the same name are replaced.
    rig : Rig or None
        Of all recordings; None: the rig file of the same name beside each, if there is one.
    sampling_rate_hz : float or None
        For files that do not state it.
    speed : SpeedSource or None
        Of all recordings, instead of what file and rig say.
    n_processes : int or None
        Local processes; None: one per processor, not more than files. With 1, everything runs in this process. With
        more, the caller's script needs the usual ``if __name__ == "__main__":``, as processes are spawned.
    executor : concurrent.futures.Executor or None
        Runs the recordings instead, e.g. a cluster's. Its workers must see the same files under the same paths.
    on_progress : callable or None
        Called as ``on_progress(n_done, n_total, result)`` with an `Entry` or a `Failure`, in the order of completion.
    command : str
        The command that makes the report again, for the pages.
    reference : str, Path or None
        Recording of the same machine when it was healthy; all are compared with it but itself.
    torque_nm : float or None
        For the depth of cracks, instead of the rig's operating point.

    Returns
    -------
    BatchResult

    Raises
    ------
    InputError
        If there are no paths, `n_processes` is below 1, or the folder cannot be made.
    """
    from gearsig.checks import count
    from gearsig.report import Entry, Failure, made_folder, page_names, remove_parts, write_index

    files = [Path(path) for path in paths]
    if not files:
        raise InputError("there are no recordings to report on", remedy="name at least one file")
    workers = min(len(files), n_processors()) if n_processes is None else count(n_processes, "n_processes")
    folder = made_folder(Path(output_folder))
    healthy = Path(reference) if reference is not None else None
    names = [file.name for file in files]
    jobs = []
    for file, page in zip(files, page_names(files), strict=True):
        # Files of the same name are told apart by their folders.
        name = file_label(file, whole=not file.name or names.count(file.name) > 1)
        is_healthy = healthy is not None and file.exists() and healthy.exists() and file.samefile(healthy)
        compared = None if is_healthy else healthy
        path = folder / f"{page}.html"
        jobs.append(
            _Job(file, name, path, rig, sampling_rate_hz, speed, command, compared, torque_nm, is_reference=is_healthy)
        )
    results: dict[int, Entry | Failure] = {}
    try:
        with closing(_run(jobs, min(workers, len(jobs)), executor)) as running:
            for number, result in running:
                results[number] = result
                if on_progress is not None:
                    on_progress(len(results), len(jobs), result)
    finally:
        remove_parts(folder, [job.page.name for job in jobs])
    ordered = [results[number] for number in sorted(results)]
    entries = tuple(item for item in ordered if isinstance(item, Entry))
    failures = tuple(item for item in ordered if isinstance(item, Failure))
    index = write_index(entries, folder / "index.html", failures=failures, command=command)
    return BatchResult(entries, failures, index)


def _run(jobs: Sequence[_Job], n_workers: int, executor: Executor | None) -> Results:
    """Run the jobs and yield each result with its number, as they finish."""
    numbered = dict(enumerate(jobs))
    if executor is not None:
        yield from _collect(executor, numbered)
    elif n_workers == 1:
        for number, job in numbered.items():
            yield number, _report_one(job)
    else:
        yield from _run_local(numbered, n_workers)


def _run_local(jobs: Mapping[int, _Job], n_workers: int) -> Results:
    """Run jobs in local processes; where one kills its process, the unfinished ones get a process each."""
    unfinished = dict(jobs)
    try:
        with process_pool(n_workers) as pool:
            for number, result in _collect(pool, jobs):
                del unfinished[number]
                yield number, result
    except BrokenProcessPool:
        for number, job in unfinished.items():
            try:
                with process_pool(1) as pool:
                    result = pool.submit(_report_one, job).result()
            except BrokenProcessPool:
                result = _failure(job, "the process that analysed it was killed: perhaps it ran out of memory")
            yield number, result


def _collect(executor: Executor, jobs: Mapping[int, _Job]) -> Results:
    futures: dict[Future[Entry | Failure], int] = {executor.submit(_report_one, j): n for n, j in jobs.items()}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _report_one(job: _Job) -> Entry | Failure:
    """Analyse one recording and write its page; every error becomes a reason."""
    from gearsig.diagnosis import analyze
    from gearsig.recording import read_recording
    from gearsig.report import entry_of, write_page
    from gearsig.rig import read_rig, rig_file_beside

    try:
        beside = rig_file_beside(job.path) if job.rig is None else None
        rig = read_rig(beside) if beside is not None else job.rig
        analysis = analyze(
            read_recording(job.path, rig=rig, sampling_rate_hz=job.sampling_rate_hz, speed=job.speed),
            reference=_reference_of(job, rig),
            torque_nm=job.torque_nm,
        )
        write_page(analysis, job.page, command=job.command, index="index.html")
        return replace(entry_of(analysis, job.name, job.page.name), is_reference=job.is_reference)
    except GearsigError as error:
        return _failure(job, str(error))
    except Exception as error:  # noqa: BLE001 - one broken file must not stop the rest; the reason is passed on
        return _failure(job, f"unexpected error, please report: {type(error).__name__}: {' '.join(str(error).split())}")


def _reference_of(job: _Job, rig: Rig | None) -> Recording | None:
    """Read the recording of the healthy machine; pulse times would belong to the other one."""
    from gearsig.diagnosis import rig_of_reference
    from gearsig.recording import read_recording
    from gearsig.rig import PulseTimes

    if job.reference is None:
        return None
    speed = None if isinstance(job.speed, PulseTimes) else job.speed
    own = rig_of_reference(job.reference, rig)
    return read_recording(job.reference, rig=own, sampling_rate_hz=job.sampling_rate_hz, speed=speed)


def _failure(job: _Job, reason: str) -> Failure:
    from gearsig.report import Failure

    return Failure(job.name, reason)
