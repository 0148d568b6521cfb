"""Fresh local processes with one computing thread each, which a script can use without a guard."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Lock
from typing import Any

_THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_MAIN = "__main__"
_STARTING = Lock()


@contextmanager
def process_pool(n_processes: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of fresh processes; more threads than one each would fight over the processors.

    They do not know what the caller's own script defines, see `can_be_sent`. The libraries read the thread
    settings when they load, hence the environment; it is restored afterwards.
    """
    before = {name: os.environ.get(name) for name in _THREAD_SETTINGS}
    os.environ.update(dict.fromkeys(_THREAD_SETTINGS, "1"))
    pool = ProcessPoolExecutor(n_processes, mp_context=_Context(), initializer=_start_worker)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def n_processors() -> int:
    """Return the processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def can_be_sent(thing: object) -> bool:
    """Return whether fresh processes understand a thing: it can be pickled, and is not of the caller's own script."""
    try:
        return _MAIN.encode() not in pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False


class _Process(SpawnProcess):
    """A fresh process that does not run the caller's script.

    Python would run it again in each, up to where the processes are started: from a script without
    `if __name__ == "__main__":`, as people write them, none would ever start.
    """

    def start(self) -> None:
        with _STARTING, _script_out_of_sight():
            super().start()


class _Context(SpawnContext):
    Process = _Process


@contextmanager
def _script_out_of_sight() -> Iterator[None]:
    """Take away for a moment what tells `multiprocessing.spawn` where the script is."""
    main = sys.modules[_MAIN]
    known: dict[str, Any] = {name: main.__dict__[name] for name in ("__spec__", "__file__") if name in main.__dict__}
    main.__dict__.update(dict.fromkeys(known))
    try:
        yield
    finally:
        main.__dict__.update(known)


def _start_worker() -> None:
    """Let Ctrl-C end a worker at once and without a traceback; the parent tidies up."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)
