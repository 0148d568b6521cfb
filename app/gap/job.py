"""A gap diagnosis that runs beside the page which asked for it, and can be stopped."""

from __future__ import annotations

import json
import secrets
import shutil
import subprocess
import sys
import weakref
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp

from app.gap.run import GapRequest
from app.gap.worker import ERROR, PROGRESS, RESULTS, error_from_dict, write_request
from app.stopping import stop
from gearsig.errors import GearsigError, InputError
from gearsig.gap import GapReport
from gearsig.report import check_writable

# --------------------
# What a gap diagnosis leaves in a folder: gap.json, gap.html and, where an effect is named, twin.toml; all or none.
# --------------------


JSON, PAGE, TWIN = "gap.json", "gap.html", "twin.toml"
NAMES = (JSON, PAGE, TWIN)


def check_folder(folder: Path) -> None:
    """Check, before the long work, that results can be written; results of an earlier diagnosis are replaced.

    Raises
    ------
    InputError
        If it is no folder, cannot be written, or holds files that belong to no gap diagnosis.
    """
    check_writable(folder)
    if folder.is_dir():
        found = [path for path in folder.iterdir() if path.name not in NAMES]
        if found or (any(folder.iterdir()) and not _is_ours(folder / JSON)):
            raise InputError(
                "holds files that belong to no gap diagnosis", where=str(folder), remedy="choose another with -o"
            )


def write_results(report: GapReport, folder: Path, *, command: str = "") -> tuple[Path, ...]:
    """Write the results beside their folder and move them there when all are complete.

    Returns
    -------
    tuple of Path
        Page, JSON, and the twin's preset where there is one.
    """
    from gearsig.report import write_gap_json, write_gap_page

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
        raise InputError(
            f"cannot be written ({error.strerror or error})", where=str(folder), remedy="choose another with -o"
        ) from None
    return tuple(folder / name for name in (PAGE, JSON, TWIN) if (folder / name).exists())


def _move(unfinished: Path, target: Path) -> None:
    """Put the finished folder in its place; file by file into a folder that exists, which may be somebody's own."""
    if not target.exists():
        unfinished.rename(target)
        return
    for name in (PAGE, TWIN, JSON):  # gap.json last: where it is new, the others are
        if (unfinished / name).exists():
            (unfinished / name).replace(target / name)
        else:
            (target / name).unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("schema") == "gearsig.gap"


LOG = "log.txt"


class JobFailedError(GearsigError):
    """The process ended without a result and without a reason of its own."""


class Job:
    """A diagnosis in a process of its own, with a private folder that goes when the job does.

    Parameters
    ----------
    folder : Path
        From `private_folder`; holds the uploads, too. The job owns it.
    asked, model, cache, command
        See `app.gap.run.run_gap` and the page's command.
    """

    def __init__(self, folder: Path, asked: GapRequest, model: str, *, cache: Path | None, command: str = "") -> None:
        self.folder, self.was_stopped = folder, False
        write_request(folder, asked, model, cache, command)
        log = (folder / LOG).open("w", encoding="utf-8")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "app.gap.worker", str(folder)],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            start_new_session=True,  # it and the processes that it starts are stopped together
        )
        log.close()
        self._end = weakref.finalize(self, _end, self._process, folder)

    @property
    def is_running(self) -> bool:
        """Whether it is still at work."""
        return self._process.poll() is None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, and which share of the whole is complete."""
        try:
            found = json.loads((self.folder / PROGRESS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return "starting", 0.0
        return str(found["stage"]), min(max(float(found["done"]), 0.0), 1.0)

    def stop(self) -> None:
        """End the process and what it started; there is no result then."""
        self.was_stopped = True
        _stop(self._process)

    def report(self) -> GapReport:
        """Return the result of a job that has ended.

        Raises
        ------
        GearsigError
            Why there is none.
        """
        from gearsig.report import read_gap_json

        if (self.folder / ERROR).exists():
            raise error_from_dict(json.loads((self.folder / ERROR).read_text(encoding="utf-8")))
        if not (self.folder / RESULTS / JSON).exists():
            raise JobFailedError(f"the diagnosis ended without a result ({self._last_words()})")
        return read_gap_json(self.folder / RESULTS / JSON)

    def result(self, name: str) -> bytes | None:
        """Return a file of the results, None where there is none."""
        path = self.folder / RESULTS / name
        return path.read_bytes() if path.exists() else None

    def close(self) -> None:
        """Stop, and remove the folder."""
        self._end()

    def _last_words(self) -> str:
        lines = (self.folder / LOG).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit code {self._process.returncode}"


def private_folder() -> Path:
    """Return a new folder that only this user can read."""
    return Path(mkdtemp(prefix="gearsig-gap-"))


def _end(process: subprocess.Popen[bytes], folder: Path) -> None:
    _stop(process)
    shutil.rmtree(folder, ignore_errors=True)


def _stop(process: subprocess.Popen[bytes]) -> None:
    stop(process)
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()
