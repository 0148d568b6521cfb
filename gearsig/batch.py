"""Analyse many recordings in local processes, or with any executor, into one folder of pages."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearsig.errors import GearsigError, unexpected_text
from gearsig.formatting import file_label
from gearsig.processes import killed_text, n_processors, run_jobs

if TYPE_CHECKING:
    from gearsig.fleet import AnalysisOptions
    from gearsig.report import Entry, Failure
    from gearsig.rig import Rig, SpeedSource

Progress = Callable[[int, int, "Entry | Failure"], object]

RESULTS = ".results"
"""Sub-folder with the index entry of each page and a hash of the page's inputs, so that a later run can resume."""


@dataclass(frozen=True)
class BatchResult:
    """The outcome for all recordings.

    Parameters
    ----------
    entries : tuple of Entry
        Those analysed, in the order given.
    failures : tuple of Failure
        Those that could not be analysed, with the reason, in the order given.
    index_path : Path
        The page that compares them.
    n_found : int
        Number of entries whose pages already existed.
    """

    entries: tuple[Entry, ...]
    failures: tuple[Failure, ...]
    index_path: Path
    n_found: int = 0


@dataclass(frozen=True)
class _Job:
    """One recording and the path of its page: all that a worker needs."""

    path: Path
    name: str
    page: Path
    options: AnalysisOptions
    command: str
    is_reference: bool
    pdf: bool
    methods: tuple[str, ...] | None
    made_of: str = ""


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
    reference: str | Path | Mapping[Path, Path] | None = None,
    reference_rate_hz: float | None = None,
    torque_nm: float | None = None,
    pdf: bool = False,
    methods: Sequence[str] | None = None,
    memory_bytes: float = 2e9,
) -> BatchResult:
    """Analyse recordings and write a page for each, and an index that compares them.

    A file that cannot be analysed does not stop the others: the index lists it with the reason. A file that does not
    exist raises before anything is written. A page made from the same recording, rig and options by the same version
    of gearsig is kept. While the run lasts, and after an interruption, the index says how many pages are missing; the
    same call resumes from there.

    Parameters
    ----------
    paths : sequence of str or Path
        Files, folders (with their sub-folders) or patterns such as "folder/*.csv".
    output_folder : str or Path
        Created if it does not exist. A page of the same recording is replaced; any other file of that name is left,
        and the new page gets a number.
    rig : Rig or None
        The machine of all recordings; what a rig file of the same name beside one states of its measurement goes
        before it, and before the sampling rate. None: only that file.
    sampling_rate_hz : float or None
        For files that do not state it.
    speed : SpeedSource or None
        For all recordings, instead of what file and rig say.
    n_processes : int or None
        Local processes; None: one per processor, but not more than files. With 1, everything runs in this process.
        With more, the caller's script needs the usual ``if __name__ == "__main__":``, as processes are spawned.
    executor : concurrent.futures.Executor or None
        Runs the jobs instead, e.g. that of `gearsig.processes.cluster`; `n_processes` is then the number of jobs at
        the same time. Its workers must see the same files under the same paths.
    on_progress : callable or None
        Called as ``on_progress(n_done, n_total, result)`` with an `Entry` or a `Failure`, in the order of completion.
    command : str
        The command that reproduces the report, to be shown on the pages.
    reference : str, Path, mapping or None
        Recording of the same machine when it was healthy; all others are compared with it. For several machines, a
        mapping from each recording to its reference.
    reference_rate_hz : float or None
        Sampling rate of the reference if it differs and neither the file nor a rig file beside it states it.
    torque_nm : float or None
        For the depth of cracks, instead of the rig's operating point.
    pdf : bool
        Also write each page and the index as PDF.
    methods : sequence of str or None
        Further methods to show on the pages; None: those that suit each recording.
    memory_bytes : float
        Memory that the analysis of one recording may take; for a longer one the page shows the most severe part, see
        `gearsig.diagnosis.analyze_file`.

    Returns
    -------
    BatchResult

    Raises
    ------
    InputError
        If a named file does not exist, there are no recordings, `n_processes` is below 1, or the folder cannot be
        created.
    """
    from gearsig.cache import made_folder, remove_parts
    from gearsig.checks import count
    from gearsig.fleet import AnalysisOptions, find_recordings, no_recordings
    from gearsig.report import Entry, Failure, check_pdf, named_method, page_names, write_index

    # Raise before anything is written: no recordings, reference or typst, or an unknown method.
    files = [path for path, _ in find_recordings(paths)]
    if not files:
        raise no_recordings(paths)
    if pdf:
        check_pdf()
    workers = min(len(files), n_processors()) if n_processes is None else count(n_processes, "n_processes")
    given = _references(reference, files)
    chosen = None if methods is None else tuple(method for method in methods if named_method(method))
    folder = made_folder(Path(output_folder))
    # A recording is not compared with itself: the reference's page says that it is the reference.
    healthy = {file.resolve(): path for file, path in given.items()}
    healthy_files = {path.resolve() for path in healthy.values()}
    names = [file.name for file in files]
    jobs = []
    for file, page in zip(files, page_names(files, folder), strict=True):
        # Files of the same name are distinguished by their folders.
        name = file_label(file, whole=not file.name or names.count(file.name) > 1)
        is_healthy = file.resolve() in healthy_files
        compared = None if is_healthy else healthy.get(file.resolve())
        path = folder / f"{page}.html"
        its_rate_hz = reference_rate_hz if compared or is_healthy else None
        options = AnalysisOptions(rig, sampling_rate_hz, speed, compared, torque_nm, memory_bytes, its_rate_hz)
        jobs.append(_Job(file, name, path, options, command, is_reference=is_healthy, pdf=pdf, methods=chosen))
    # Pages made from the same files and options by the same version of gearsig are kept.
    made_of = _made_of()
    jobs = [replace(job, made_of=made_of(job)) for job in jobs]
    results: dict[int, Entry | Failure] = {n: kept for n, job in enumerate(jobs) if (kept := _kept(job)) is not None}
    missing, n_found = [n for n in range(len(jobs)) if n not in results], len(results)

    def index() -> BatchResult:
        ordered = [results[number] for number in sorted(results)]
        entries = tuple(item for item in ordered if isinstance(item, Entry))
        failures = tuple(item for item in ordered if isinstance(item, Failure))
        n_missing = len(jobs) - len(results)
        page = folder / "index.html"
        path = write_index(entries, page, failures=failures, command=command, n_missing=n_missing, pdf=pdf)
        return BatchResult(entries, failures, path, n_found)

    if missing:
        index()  # an earlier index would refer to other pages
    running = run_jobs(
        _report_one,
        (jobs[number] for number in missing),
        n_workers=min(workers, max(len(missing), 1)) if executor is None else workers,
        executor=executor,
        if_killed=_killed,
    )
    # The index is written after an interruption, too: it says what is there and what is missing.
    try:
        with closing(running):
            for place, result in running:
                results[missing[place]] = result
                if on_progress is not None:
                    on_progress(len(results), len(jobs), result)
    finally:
        remove_parts(folder)
        made = index()
    return made


def _references(given: str | Path | Mapping[Path, Path] | None, files: Sequence[Path]) -> Mapping[Path, Path]:
    """Return the reference of each recording that has one, after checking that it can be read."""
    from gearsig.recording import n_samples_of

    references = given if isinstance(given, Mapping) else dict.fromkeys(files, Path(given)) if given else {}
    for path in set(references.values()):
        n_samples_of(path)
    return references


def _made_of() -> Callable[[_Job], str]:
    """Return a function that hashes the inputs of a page; the hash is empty if a file is not accessible."""
    from functools import cache

    from gearsig import __version__
    from gearsig.recording import without_condition
    from gearsig.rig import rig_file_beside

    @cache
    def state(path: Path) -> tuple[str, int, int]:
        stat = without_condition(path)[0].stat()
        return str(path.absolute()), stat.st_size, stat.st_mtime_ns

    def made_of(job: _Job) -> str:
        reference = job.options.reference
        try:
            beside = rig_file_beside(job.path)
            then = rig_file_beside(reference) if reference is not None else None
            files = [state(path) for path in (job.path, beside, reference, then) if path is not None]
        except OSError:
            return ""
        rig = job.options.rig and job.options.rig.key()
        options = repr(vars(job.options) | {"rig": rig})
        parts = [__version__, files, job.name, options, job.is_reference, job.methods]
        return hashlib.sha256(json.dumps(parts).encode("utf-8", "surrogateescape")).hexdigest()

    return made_of


def _result_path(job: _Job) -> Path:
    return job.page.parent / RESULTS / f"{job.page.stem}.json"


def _kept(job: _Job) -> Entry | None:
    """Return the index entry of a page that already exists; None if there is none or its inputs differ."""
    from gearsig.report import Entry, from_plain

    try:
        data = json.loads(_result_path(job).read_text(encoding="utf-8"))
        pages = [job.page, *([job.page.with_suffix(".pdf")] if job.pdf else [])]
        if not job.made_of or data["made_of"] != job.made_of or not all(page.is_file() for page in pages):
            return None
        entry: Entry = from_plain(Entry, data["entry"], "entry")
    except (OSError, ValueError, KeyError, TypeError, RecursionError):  # damaged: redo the page
        return None
    return entry


def _report_one(job: _Job) -> Entry | Failure:
    """Analyse one recording and write its page; any error becomes the reason of a `Failure`."""
    from gearsig.cache import write_text
    from gearsig.diagnosis import LongAnalysis
    from gearsig.report import Entry, entry_of, from_plain, plain, recording_mark, write_page

    try:
        result = job.options.analyze(job.path)
        analysis = result.as_one() if isinstance(result, LongAnalysis) else result
        mark = recording_mark(job.path)
        how: dict[str, Any] = {"command": job.command, "methods": job.methods, "pdf": job.pdf}
        write_page(analysis, job.page, index="index.html", mark=mark, **how)
        entry = plain(replace(entry_of(analysis, job.name, job.page.name), is_reference=job.is_reference))
        with suppress(GearsigError):  # the next run makes the page again
            write_text(_result_path(job), json.dumps({"made_of": job.made_of, "entry": entry}) + "\n")
        kept: Entry = from_plain(Entry, entry, "entry")  # rounded as in a later run, so that both say the same
        return kept  # noqa: TRY300
    except GearsigError as error:
        return _failure(job, str(error).removeprefix(f"{job.name}: "))
    except Exception as error:  # noqa: BLE001 - one broken file must not stop the others; the reason is reported
        return _failure(job, unexpected_text(error))


def _killed(job: _Job) -> Failure:
    return _failure(job, killed_text("analysed it"))


def _failure(job: _Job, reason: str) -> Failure:
    from gearsig.report import Failure

    return Failure(job.name, reason)
