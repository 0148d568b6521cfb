"""A gap diagnosis that runs beside the page which asked for it, and can be stopped."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import weakref
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from app.gap.inputs import Asked
from app.gap.results import JSON
from app.gap.worker import ERROR, PROGRESS, RESULTS, error_from_dict, write_request
from app.stopping import stop
from gearsig.errors import GearsigError

if TYPE_CHECKING:
    from gearsig.gap.types import GapReport

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

    def __init__(self, folder: Path, asked: Asked, model: str, *, cache: Path | None, command: str = "") -> None:
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
        from gearsig.report.gap_reading import read_gap_json

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
