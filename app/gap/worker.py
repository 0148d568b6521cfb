"""A gap diagnosis in a process of its own: `python -m app.gap.worker FOLDER`, started by `app.gap.job`.

The folder holds request.json; progress.json, and in the end results or error.json, come beside it. The process ends
when its standard input does: nothing goes on for a parent that is gone.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from dataclasses import asdict
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any

from app.gap.run import GapRequest
from gearsig.errors import GearsigError, InputError, RefusalError
from gearsig.report import write_text

REQUEST, PROGRESS, ERROR, RESULTS = "request.json", "progress.json", "error.json", "results"
EXIT_REFUSED = 2
EVERY_S = 0.2
"""Progress is written no oftener."""


def main(folder: Path) -> int:
    """Diagnose what the folder asks for."""
    from app.gap.job import write_results
    from app.gap.run import run_gap

    asked, model, cache, command = _request(folder)
    try:
        report = run_gap(asked, model, cache=cache, on_stage=_Progress(folder / PROGRESS))
        write_results(report, folder / RESULTS, command=command)
    except GearsigError as error:
        write_text(folder / ERROR, json.dumps(error_to_dict(error)))
        return EXIT_REFUSED
    return 0


def write_request(folder: Path, asked: GapRequest, model: str, cache: Path | None, command: str) -> None:
    """Write what the process is to do."""
    found = {"asked": asdict(asked), "model": model, "cache": cache, "command": command}
    write_text(folder / REQUEST, json.dumps(found, default=str))


def error_to_dict(error: GearsigError) -> dict[str, str]:
    """Return an error as texts."""
    if isinstance(error, InputError):
        return {"what": error.what, "where": error.where, "allowed": error.allowed, "remedy": error.remedy}
    if isinstance(error, RefusalError):
        return {"reason": error.reason, "remedy": error.remedy}
    return {"reason": str(error), "remedy": ""}


def error_from_dict(found: dict[str, str]) -> GearsigError:
    """Return the error that `error_to_dict` made the texts of."""
    if "what" in found:
        return InputError(found["what"], where=found["where"], allowed=found["allowed"], remedy=found["remedy"])
    return RefusalError(found["reason"], remedy=found["remedy"])


class _Progress:
    """Writes the stage and the share that is complete, now and then."""

    def __init__(self, path: Path) -> None:
        self._path, self._stage, self._at = path, "", 0.0

    def __call__(self, stage: str, done: float) -> None:
        if stage == self._stage and monotonic() - self._at < EVERY_S:
            return
        self._stage, self._at = stage, monotonic()
        write_text(self._path, json.dumps({"stage": stage, "done": float(done)}))


def _request(folder: Path) -> tuple[GapRequest, str, Path | None, str]:
    found: dict[str, Any] = json.loads((folder / REQUEST).read_text(encoding="utf-8"))
    given = found["asked"]
    asked = GapRequest(
        tuple(map(Path, given["recordings"])),
        tuple(map(Path, given["references"])),
        Path(given["rig"]) if given["rig"] else None,
        tuple(given["torques_nm"]),
        given["sampling_rate_hz"],
        tuple(given["names"]),
        tuple(given["reference_names"]),
    )
    return asked, found["model"], Path(found["cache"]) if found["cache"] else None, found["command"]


def _end_with_parent() -> None:
    """Wait for the end of standard input in a thread; then end this process and those that it started."""

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 1024):  # not through sys.stdin: its lock would be in the way at the end
            pass
        if hasattr(os, "killpg"):
            os.killpg(os.getpgrp(), signal.SIGTERM)
        os._exit(1)

    Thread(target=wait, daemon=True).start()


if __name__ == "__main__":
    _end_with_parent()
    sys.exit(main(Path(sys.argv[1])))
