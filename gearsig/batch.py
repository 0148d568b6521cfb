"""Many recordings: analysed by local processes, or by any executor, into one folder of pages."""

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
"""Sub-folder that holds what the index says of each page, and of what the page was made: a later run goes on there."""


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
    n_found : int
        Of the entries, those whose pages stood there already.
    """

    entries: tuple[Entry, ...]
    failures: tuple[Failure, ...]
    index_path: Path
    n_found: int = 0


@dataclass(frozen=True)
class _Job:
    """One recording and where its page goes; everything a worker needs."""

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

    A file that cannot be analysed does not stop the others: the index lists it with its reason; one that does not exist
    is refused before anything is written. A page that was made of the same recording, rig and options by the same
    gearsig is kept. While the pages are made, and after an interruption, the index says what is missing; the same call
    goes on from there.

    Parameters
    ----------
    paths : sequence of str or Path
        Files, folders with their sub-folders, "folder/*.csv".
    output_folder : str or Path
        Made if it is not there. A recording's own page is replaced; one of the same name but of another recording, or
        of no recording, is left, and the new one gets a number.
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
        Runs the recordings instead, e.g. that of `gearsig.processes.cluster`; `n_processes` then says how many at
        once. Its workers must see the same files under the same paths.
    on_progress : callable or None
        Called as ``on_progress(n_done, n_total, result)`` with an `Entry` or a `Failure`, in the order of completion.
    command : str
        The command that makes the report again, for the pages.
    reference : str, Path, mapping or None
        Recording of the same machine when it was healthy; all are compared with it but itself. Of several machines a
        mapping of recordings to theirs.
    reference_rate_hz : float or None
        Sampling rate of the reference, where it differs and neither it nor a rig file beside it states it.
    torque_nm : float or None
        For the depth of cracks, instead of the rig's operating point.
    pdf : bool
        Write each page and the index as PDF as well.
    methods : sequence of str or None
        Further methods that the pages show; None: those that each recording calls for.
    memory_bytes : float
        What the analysis of one recording may take; of a longer one the page shows the most severe part, see
        `gearsig.diagnosis.analyze_file`.

    Returns
    -------
    BatchResult

    Raises
    ------
    InputError
        If a file that is named does not exist, there are no recordings, `n_processes` is below 1, or the folder cannot
        be made.
    """
    from gearsig.cache import made_folder, remove_parts
    from gearsig.checks import count
    from gearsig.fleet import AnalysisOptions, find_recordings, no_recordings
    from gearsig.report import Entry, Failure, check_pdf, named_method, page_names, write_index

    # What can be refused is refused before anything is written: no recordings, reference or typst, a wrong method.
    files = [path for path, _ in find_recordings(paths)]
    if not files:
        raise no_recordings(paths)
    if pdf:
        check_pdf()
    workers = min(len(files), n_processors()) if n_processes is None else count(n_processes, "n_processes")
    given = _references(reference, files)
    chosen = None if methods is None else tuple(method for method in methods if named_method(method))
    folder = made_folder(Path(output_folder))
    # A recording is not compared with itself: the reference's own page says that it is one.
    healthy = {file.resolve(): path for file, path in given.items()}
    healthy_files = {path.resolve() for path in healthy.values()}
    names = [file.name for file in files]
    jobs = []
    for file, page in zip(files, page_names(files, folder), strict=True):
        # Files of the same name are told apart by their folders.
        name = file_label(file, whole=not file.name or names.count(file.name) > 1)
        is_healthy = file.resolve() in healthy_files
        compared = None if is_healthy else healthy.get(file.resolve())
        path = folder / f"{page}.html"
        stated_hz = reference_rate_hz if is_healthy and reference_rate_hz is not None else sampling_rate_hz
        its_rate_hz = reference_rate_hz if compared else None
        options = AnalysisOptions(rig, stated_hz, speed, compared, torque_nm, memory_bytes, its_rate_hz)
        jobs.append(_Job(file, name, path, options, command, is_reference=is_healthy, pdf=pdf, methods=chosen))
    # Pages that were made of the same files and options by the same gearsig stay as they are.
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
        index()  # an earlier one would speak of other pages
    running = run_jobs(
        _report_one,
        (jobs[number] for number in missing),
        n_workers=min(workers, max(len(missing), 1)) if executor is None else workers,
        executor=executor,
        if_killed=_killed,
    )
    # Also after an interruption the index says what is there and what is missing.
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
    """Return the reference of each recording that has one, after a look whether it can be one."""
    from gearsig.recording import n_samples_of

    references = given if isinstance(given, Mapping) else dict.fromkeys(files, Path(given)) if given else {}
    for path in set(references.values()):
        n_samples_of(path)
    return references


def _made_of() -> Callable[[_Job], str]:
    """Return a function that says of what a page is made, as a hash; empty where the recording cannot be looked at."""
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
            beside = rig_file_beside(job.path) if job.options.rig is None else None
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
    """Return what the index says of a page that stands there already, None where it is another one or none."""
    from gearsig.report import Entry, from_plain

    try:
        data = json.loads(_result_path(job).read_text(encoding="utf-8"))
        pages = [job.page, *([job.page.with_suffix(".pdf")] if job.pdf else [])]
        if not job.made_of or data["made_of"] != job.made_of or not all(page.is_file() for page in pages):
            return None
        entry: Entry = from_plain(Entry, data["entry"], "entry")
    except (OSError, ValueError, KeyError, TypeError, RecursionError):  # damaged: made again
        return None
    return entry


def _report_one(job: _Job) -> Entry | Failure:
    """Analyse one recording and write its page; every error becomes a reason."""
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
        with suppress(GearsigError):  # a page that the next run makes again
            write_text(_result_path(job), json.dumps({"made_of": job.made_of, "entry": entry}) + "\n")
        kept: Entry = from_plain(Entry, entry, "entry")  # rounded as for a later run, which must say the same
        return kept  # noqa: TRY300
    except GearsigError as error:
        return _failure(job, str(error).removeprefix(f"{job.name}: "))
    except Exception as error:  # noqa: BLE001 - one broken file must not stop the rest; the reason is passed on
        return _failure(job, unexpected_text(error))


def _killed(job: _Job) -> Failure:
    return _failure(job, killed_text("analysed it"))


def _failure(job: _Job, reason: str) -> Failure:
    from gearsig.report import Failure

    return Failure(job.name, reason)
