"""Ending processes that were started in a session of their own, with all that they started."""

from __future__ import annotations

import os
import signal
import subprocess
from contextlib import suppress
from threading import Lock
from typing import Any

PATIENCE_S = 3.0
"""A process that was told to stop is ended by force after this."""


def stop(process: subprocess.Popen[Any]) -> None:
    """End a process and what it started; nothing happens if it has ended."""
    if process.poll() is not None:
        return
    _signal(process, force=False)
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        _signal(process, force=True)
        process.wait()


class Running:
    """Processes that run at the moment, to be stopped together; none starts after that."""

    def __init__(self) -> None:
        self._lock, self._processes, self._stopped = Lock(), set[subprocess.Popen[Any]](), False

    def start(self, arguments: list[str], **settings: Any) -> subprocess.Popen[Any]:
        """Start a process in a session of its own.

        Raises
        ------
        KeyboardInterrupt
            If they have been stopped.
        """
        with self._lock:
            if self._stopped:
                raise KeyboardInterrupt
            process = subprocess.Popen(arguments, start_new_session=True, **settings)
            self._processes.add(process)
        return process

    def ended(self, process: subprocess.Popen[Any]) -> bool:
        """Forget a process; whether it ended by itself and was not stopped."""
        with self._lock:
            self._processes.discard(process)
            return not self._stopped

    def stop(self) -> None:
        """Stop all of them."""
        with self._lock:
            self._stopped, processes = True, list(self._processes)
        for process in processes:
            stop(process)


def _signal(process: subprocess.Popen[Any], *, force: bool) -> None:
    with suppress(ProcessLookupError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL if force else signal.SIGTERM)
        elif force:
            process.kill()
        else:
            process.terminate()
