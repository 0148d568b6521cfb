"""A gap diagnosis from files to a folder of results, in this process or in a separate one that can be stopped.

A page starts `python -P -m app.gap_job FOLDER`. The folder holds request.json; progress.json and finally the results or
error.json are added. The process ends when its standard input ends, so that it does not outlive its parent.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import sysconfig
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from threading import Thread
from time import monotonic

from gearsig.cache import write_text
from gearsig.errors import GearsigError, InputError, RefusalError, not_written
from gearsig.gap import PROCESSES, GapReport, GapRequest, read_gap_inputs
from gearsig.processes import one_pool, stop
from gearsig.report import check_writable, from_plain, plain, read_gap_json, write_gap_json, write_gap_page

Stage = Callable[[str, float], None]
READING = 0.03
"""Share of the progress assigned to reading."""


def run_gap(
    request: GapRequest,
    model: str,
    *,
    cache: Path | None,
    fresh: bool = False,
    on_stage: Stage = lambda *_: None,
) -> GapReport:
    """Read the files and diagnose the gap.

    Parameters
    ----------
    request : GapRequest
    model : str
        Name of the simulator.
    cache : Path or None
        Cache folder for what is prepared once per rig; None: no cache.
    fresh : bool
        Prepare again what the folder holds already, and replace it.
    on_stage : callable
        Takes the current stage and the fraction completed.

    Raises
    ------
    InputError, RefusalError
    """
    from gearsig.gap import diagnose_gap
    from sims.registry import gap_simulator

    simulator = gap_simulator(model)
    inputs = read_gap_inputs(request, lambda name: on_stage(f"reading {name}", 0.0))
    return diagnose_gap(
        inputs.recordings,
        simulator,
        references=inputs.references,
        run_up=inputs.run_up,
        learn=inputs.labelled,
        stage=request.stage,
        cache=cache,
        fresh=fresh,
        on_stage=lambda stage, done: on_stage(stage, READING + (1 - READING) * done),
    )


JSON, PAGE, TWIN = "gap.json", "gap.html", "twin.toml"
"""Files of a gap diagnosis, the last only if an effect is named; all are written or none."""


def check_folder(folder: Path) -> None:
    """Check before the computation that results can be written; those of an earlier diagnosis will be replaced.

    Raises
    ------
    InputError
        If it is not a folder, cannot be written, or holds files that do not belong to a gap diagnosis.
    """
    check_writable(folder)
    if folder.is_dir():
        foreign = [path for path in folder.iterdir() if path.name not in (JSON, PAGE, TWIN)]
        if foreign or (any(folder.iterdir()) and not _is_ours(folder / JSON)):
            raise InputError(
                "holds files that do not belong to a gap diagnosis", where=str(folder), remedy="choose another with -o"
            )


def write_results(report: GapReport, folder: Path, *, command: str = "") -> tuple[Path, ...]:
    """Write the results next to their folder and move them there once all are complete.

    Returns
    -------
    tuple of Path
        Page, JSON, and the twin's preset if there is one.
    """
    target = folder.absolute()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = target.parent / f".{target.name[:32]}-{secrets.token_hex(4)}"
        try:
            unfinished.mkdir()
            write_gap_page(report, unfinished / PAGE, command=command)
            write_gap_json(report, unfinished / JSON)
            if report.twin_toml:
                (unfinished / TWIN).write_text(report.twin_toml, encoding="utf-8")
            _move(unfinished, target)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    except OSError as error:
        raise not_written(error, folder, "choose another with -o") from None
    return tuple(folder / name for name in (PAGE, JSON, TWIN) if (folder / name).exists())


def _move(unfinished: Path, target: Path) -> None:
    """Move the finished folder to its place; move single files if the folder exists, as it may hold other files."""
    if not target.exists():
        unfinished.rename(target)
        return
    for name in (PAGE, TWIN, JSON):  # gap.json last: if it is new, so are the others
        if (unfinished / name).exists():
            (unfinished / name).replace(target / name)
        else:
            (target / name).unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and content.get("schema") == "gearsig.gap"


REQUEST, PROGRESS, ERROR, RESULTS, LOG = "request.json", "progress.json", "error.json", "results", "log.txt"
EXIT_REFUSED = 2
EVERY_S = 0.2
"""Minimum interval between two writes of the progress."""


class JobFailedError(GearsigError):
    """The process ended without a result and without an error message."""


@dataclass(frozen=True)
class _JobRequest:
    gap: GapRequest
    model: str
    cache: Path | None
    command: str


class Job:
    """A diagnosis in a separate process, with a private folder that is removed with the job.

    Parameters
    ----------
    folder : Path
        From `private_folder`; also holds the uploads. The job owns it.
    request, model, cache, command
        See `run_gap`; `command` is the one shown on the page.
    """

    def __init__(self, folder: Path, request: GapRequest, model: str, *, cache: Path | None, command: str = "") -> None:
        self.folder, self.was_stopped = folder, False
        write_text(folder / REQUEST, json.dumps(plain(_JobRequest(request, model, cache, command))))
        log = (folder / LOG).open("w", encoding="utf-8")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.gap_job", str(folder)],  # -P: do not import a user's app.py
            env=_environment(),
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            start_new_session=True,  # so that it is stopped together with the processes that it starts
        )
        log.close()
        self._end = weakref.finalize(self, _end, self._process, folder)

    @property
    def is_running(self) -> bool:
        """Whether the process is still running."""
        return self._process.poll() is None

    @property
    def progress(self) -> tuple[str, float]:
        """Current stage and fraction completed."""
        try:
            content = json.loads((self.folder / PROGRESS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return "starting", 0.0
        return str(content["stage"]), min(max(float(content["done"]), 0.0), 1.0)

    def stop(self) -> None:
        """End the process and those that it started; there is then no result."""
        self.was_stopped = True
        _stop(self._process)

    def report(self) -> GapReport:
        """Return the result of a job that has ended.

        Raises
        ------
        GearsigError
            If there is no result; the message says why.
        """
        if (self.folder / ERROR).exists():
            raise error_from_json((self.folder / ERROR).read_text(encoding="utf-8"))
        if not (self.folder / RESULTS / JSON).exists():
            raise JobFailedError(f"the diagnosis ended without a result ({self._last_message()})")
        return read_gap_json(self.folder / RESULTS / JSON)

    def result(self, name: str) -> bytes | None:
        """Return the content of a result file; None if it does not exist."""
        path = self.folder / RESULTS / name
        return path.read_bytes() if path.exists() else None

    def close(self) -> None:
        """Stop the process and remove the folder."""
        self._end()

    def _last_message(self) -> str:
        if (self._process.returncode or 0) < 0:  # only an external signal ends it like this
            return "its process was killed, perhaps for lack of memory; a shorter recording needs less"
        lines = (self.folder / LOG).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self._process.returncode}"


def private_folder() -> Path:
    """Create and return a folder that only this user can read."""
    return Path(mkdtemp(prefix="gearsig-gap-"))


def _environment() -> dict[str, str]:
    """Return the environment in which a process imports this same `app` package, installed or not."""
    root = str(Path(__file__).parents[1])
    if root == sysconfig.get_path("purelib"):
        return dict(os.environ)
    folders = (root, os.environ.get("PYTHONPATH", ""))
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))}


def _end(process: subprocess.Popen[bytes], folder: Path) -> None:
    _stop(process)
    shutil.rmtree(folder, ignore_errors=True)


def _stop(process: subprocess.Popen[bytes]) -> None:
    stop(process)
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()


def error_to_json(error: GearsigError) -> str:
    """Return an error with its parts as JSON, for `error_from_json`."""
    parts = {name: part for name, part in vars(error).items() if isinstance(part, str)} or {"reason": str(error)}
    return json.dumps({"kind": type(error).__name__, "parts": parts})


def error_from_json(text: str) -> GearsigError:
    """Return the error from the JSON of `error_to_json`."""
    written = json.loads(text)
    parts = written["parts"]
    if written["kind"] == InputError.__name__:
        return InputError(**parts)
    return RefusalError(**parts) if written["kind"] == RefusalError.__name__ else GearsigError(*parts.values())


class _Progress:
    """Writes the stage and the fraction completed at intervals."""

    def __init__(self, path: Path) -> None:
        self._path, self._stage, self._at = path, "", 0.0

    def __call__(self, stage: str, done: float) -> None:
        if stage == self._stage and monotonic() - self._at < EVERY_S:
            return
        self._stage, self._at = stage, monotonic()
        write_text(self._path, json.dumps({"stage": stage, "done": float(done)}))


def main(folder: Path) -> int:
    """Run the diagnosis that the folder requests and return the exit code."""
    request: _JobRequest = from_plain(
        _JobRequest, json.loads((folder / REQUEST).read_text(encoding="utf-8")), where=REQUEST
    )
    try:
        with one_pool(PROCESSES):
            report = run_gap(request.gap, request.model, cache=request.cache, on_stage=_Progress(folder / PROGRESS))
            write_results(report, folder / RESULTS, command=request.command)
    except GearsigError as error:
        write_text(folder / ERROR, error_to_json(error))
        return EXIT_REFUSED
    return 0


def _end_with_parent() -> None:
    """Start a thread that waits for the end of standard input, then ends this process and those that it started."""

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 1024):  # not through sys.stdin, whose lock would block the exit
            pass
        if hasattr(os, "killpg"):
            os.killpg(os.getpgrp(), signal.SIGTERM)
        os._exit(1)

    Thread(target=wait, daemon=True).start()


if __name__ == "__main__":
    _end_with_parent()
    sys.exit(main(Path(sys.argv[1])))
