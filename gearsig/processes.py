"""Run jobs in this process, in fresh local processes with one computing thread each, or on a cluster."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from itertools import islice
from multiprocessing import connection, current_process, parent_process
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from threading import Lock, Thread
from traceback import format_exc
from typing import Any, TypeVar, cast

from gearsig.errors import InputError

Job = TypeVar("Job")
Result = TypeVar("Result")

_THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_MAIN = "__main__"
_STARTING = Lock()
_CALLING = Lock()
_APART: _Apart | None = None


@contextmanager
def process_pool(n_processes: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of fresh processes with one thread each, as more would compete for the processors.

    They do not know what the caller's own script defines; see `can_be_sent`.

    Raises
    ------
    InputError
        If the system has no room for the semaphores that control them.
    """
    try:
        pool = ProcessPoolExecutor(n_processes, mp_context=_Context(), initializer=_start_worker)
    except OSError as error:
        raise InputError(
            f"no processes can be started ({error})", remedy="make room in shared memory (/dev/shm)"
        ) from None
    try:
        yield pool
    except (KeyboardInterrupt, GeneratorExit):  # an interrupted process must not wait for jobs that take minutes
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


_KEPT: ContextVar[list[ProcessPoolExecutor]] = ContextVar("kept")


@contextmanager
def one_pool(n_processes: int) -> Iterator[None]:
    """Run all jobs of a block that ask for `n_processes` local processes in the same pool; also a decorator.

    The processes start with the first job and live until the block ends; if one is killed, the following jobs get
    fresh ones. A nested block has no effect.
    """
    if any(pool._max_workers == n_processes for pool in _KEPT.get([])):  # type: ignore[attr-defined]  # there is no public attribute
        yield
        return
    with process_pool(n_processes) as pool:
        before = _KEPT.set([pool])
        try:
            yield
        finally:
            _KEPT.reset(before)


def start_early(function: Callable[..., object], *arguments: object) -> None:
    """Start the processes of `one_pool` now, each with a call that loads what jobs need; its result is ignored."""
    if active_cluster() is None and can_be_sent(arguments):
        for pool in _KEPT.get([]):
            for _ in range(pool._max_workers):  # type: ignore[attr-defined]  # there is no public attribute
                pool.submit(function, *arguments)


def begin(function: Callable[..., Result], *arguments: object) -> Callable[[], Result]:
    """Begin a call in a process of `one_pool`; return a function that waits for its result.

    Outside such a block, or if the process is killed, that function makes the call itself.
    """
    future: Future[Result] | None = None
    if active_cluster() is None and can_be_sent((function, arguments)):
        for pool in _KEPT.get([]):
            with suppress(BrokenProcessPool):
                future = pool.submit(function, *arguments)

    def result() -> Result:
        try:
            return function(*arguments) if future is None else future.result()
        except BrokenProcessPool:
            return function(*arguments)

    return result


@contextmanager
def _jobs_pool(n_processes: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool, or reuse that of `one_pool`; a broken one is not used again."""
    kept = _KEPT.get([])
    if not kept or kept[0]._max_workers != n_processes:  # type: ignore[attr-defined]  # there is no public attribute
        with process_pool(n_processes) as pool:
            yield pool
        return
    try:
        yield kept[0]
    except BrokenProcessPool:
        kept.clear()
        raise


def call_apart(
    function: Callable[..., Result], *arguments: object, longest_s: float, most_bytes: int | None = None
) -> Result:
    """Call a function that may crash, such as a compiled reader of damaged files, in a separate, reused process.

    Parameters
    ----------
    function : callable
    *arguments
    longest_s : float
        Limit of processor time in s, which is independent of the machine's load; the limit of elapsed time is twenty
        times as long. If the system cannot measure processor time, the limit of elapsed time.
    most_bytes : int or None
        Limit of additional memory, where the system can enforce it: a damaged length makes a reader ask for gigabytes.

    Raises
    ------
    MemoryError, or what the function makes of it
        If it asks for more.
    InputError
        If no process can be started.
    BrokenProcessPool
        If the process died, or exceeded the limit and was killed; the next call gets a new process.
    """
    global _APART  # noqa: PLW0603 - one process for all calls, which starts in a second
    with _CALLING:
        apart = _APART if _APART is not None and _APART.is_alive() else _Apart()
        _APART = None  # whatever keeps it from answering ends it
        try:
            succeeded, result = apart.call(function, arguments, longest_s, most_bytes)
        except BaseException:
            apart.kill()
            raise
        _APART = apart
    if not succeeded:
        raise result
    return cast("Result", result)


class _Apart:
    """A process that makes one call after another.

    No pool: a pool's semaphores outlive a process that is killed, as workers are on Ctrl-C.
    """

    def __init__(self) -> None:
        self._here, there = connection.Pipe()
        self._process = _Process(target=_answer, args=(there,), daemon=True)
        try:
            self._process.start()
            there.close()
            self._here.recv()  # it has started: the time from here on is the functions'
        except (OSError, EOFError) as error:
            raise InputError(f"no process can be started ({error})", remedy="end other programs") from None

    def is_alive(self) -> bool:
        """Whether it runs, and is not that of the process from which this one was forked."""
        return self._process._parent_pid == os.getpid() and self._process.is_alive()  # type: ignore[attr-defined]

    def call(self, function: object, arguments: object, longest_s: float, most_bytes: int | None) -> tuple[bool, Any]:
        """Return whether a call succeeded, and its result or error."""
        longest_wait_s = 20.0 * longest_s if hasattr(signal, "setitimer") else longest_s
        try:
            self._here.send((function, arguments, longest_s, most_bytes))
            if self._here.poll(longest_wait_s):
                return cast("tuple[bool, Any]", self._here.recv())
        except (OSError, EOFError):
            raise BrokenProcessPool("the process died") from None
        raise BrokenProcessPool(f"no answer for {longest_wait_s:g} s")

    def kill(self) -> None:
        self._process.kill()
        self._process.join()
        self._here.close()


def _answer(there: Connection) -> None:
    """Make the calls that come from the parent process, until it ends."""
    _start_worker()
    with suppress(EOFError, OSError):
        there.send(None)
        while True:
            call = there.recv()
            try:
                there.send((True, _counted(*call)))
            except Exception as error:  # noqa: BLE001 - raised again by the parent
                error.add_note(format_exc())
                there.send((False, error))


def _counted(
    function: Callable[..., Result], arguments: tuple[object, ...], longest_s: float, most_bytes: int | None
) -> Result:
    """Call a function; the system kills this process after `longest_s` of processor time, even in compiled code."""
    with _memory_limit(most_bytes):
        if not hasattr(signal, "setitimer"):
            return function(*arguments)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, longest_s)
        try:
            return function(*arguments)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)


@contextmanager
def _memory_limit(most_bytes: int | None) -> Iterator[None]:
    """Limit the memory that this process may take in addition to what it has, where the system can."""
    statm = Path("/proc/self/statm")
    if most_bytes is None or not statm.exists():
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    most_bytes += int(statm.read_text().split()[0]) * resource.getpagesize()
    if before[0] != resource.RLIM_INFINITY:
        most_bytes = min(most_bytes, before[0])
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def n_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def can_be_sent(value: object) -> bool:
    """Whether a value can be sent to fresh processes: it can be pickled and is not defined in the caller's script."""
    try:
        return _MAIN.encode() not in pickle.dumps(value)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False


class _Process(SpawnProcess):
    """A fresh process that does not run the caller's script, and that a daemonic process may start, too.

    Python would run it again in each, up to the point where processes are started: from a script without
    `if __name__ == "__main__":`, which is common, none would ever start. It keeps daemonic processes, such as Dask's
    workers under a nanny, from starting any, as these would be left when they are ended: ours end with their parent.
    """

    def start(self) -> None:
        try:
            with _STARTING, _script_out_of_sight(), _one_thread(), _not_daemonic(), _no_ctrl_c():
                super().start()
        except KeyboardInterrupt:  # nobody knows the process yet
            if self._popen is not None:  # type: ignore[attr-defined]  # there is no public attribute
                self.kill()
            raise


class _Context(SpawnContext):
    Process = _Process


@contextmanager
def _not_daemonic() -> Iterator[None]:
    """Temporarily let this process start others even if it is daemonic."""
    here = current_process()
    before, here.daemon = here.daemon, False
    try:
        yield
    finally:
        here.daemon = before


@contextmanager
def _no_ctrl_c() -> Iterator[None]:
    """Let a fresh process notice Ctrl-C only when `_start_worker` has decided what it does there: not as it imports."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # it would start, and let signals in, between this and the process
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Set libraries to one thread through the environment, which they read when loaded; restore it afterwards."""
    before = {name: os.environ.get(name) for name in _THREAD_SETTINGS}
    os.environ.update(dict.fromkeys(_THREAD_SETTINGS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _script_out_of_sight() -> Iterator[None]:
    """Temporarily hide from `multiprocessing.spawn` where the script is."""
    main = sys.modules[_MAIN]
    known: dict[str, Any] = {name: main.__dict__[name] for name in ("__spec__", "__file__") if name in main.__dict__}
    main.__dict__.update(dict.fromkeys(known))
    try:
        yield
    finally:
        main.__dict__.update(known)


def _start_worker() -> None:
    """Let Ctrl-C end a worker at once without a traceback, as the parent cleans up; end it with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    parent = parent_process()
    if parent is not None and hasattr(signal, "SIGIO"):
        # The kernel ends it when the parent's end of this pipe closes, even where compiled code holds the interpreter.
        import fcntl

        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
        flags = fcntl.fcntl(parent.sentinel, fcntl.F_GETFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)
        if connection.wait([parent.sentinel], 0):  # the parent ended while this process started: no signal will come
            os._exit(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent ends: a parent that was killed cannot clean up."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


# --------------------
# One function for all batches of jobs: reports, fleets, sweeps, bifurcations, simulations of a gap diagnosis.
# --------------------


def run_jobs(
    function: Callable[[Job], Result],
    jobs: Iterable[Job],
    *,
    n_workers: int,
    executor: Executor | None = None,
    if_killed: Callable[[Job], Result],
    on_wait: Callable[[], object] | None = None,
) -> Generator[tuple[int, Result], None, None]:
    """Run jobs and yield each result with the job's number, once, as they finish.

    Jobs are taken as workers become free, so they may be created, or claimed, at the last moment. If a job kills its
    local process, each job that was running gets its own process; one that kills that, too, goes to `if_killed`.

    Parameters
    ----------
    function : callable
        Defined in a module; it must not raise. Its job and its result must be picklable.
    jobs : iterable
    n_workers : int
        Number of local processes; with 1 everything runs in this process.
    executor : concurrent.futures.Executor or None
        Runs the jobs instead; None: that of the `cluster` in whose block this is called, if any.
    if_killed : callable
        Returns the result of a job whose worker was killed.
    on_wait : callable or None
        Called each second while no job finishes; never if everything runs in this process.
    """
    if executor is None and (active := active_cluster()) is not None:
        executor, n_workers = active.executor, active.n_workers
    waiting = iter(enumerate(jobs))
    running: dict[Future[Result], tuple[int, Job]] = {}
    if executor is not None:
        yield from _collect(executor, function, waiting, running, 4 * n_workers, on_wait, if_killed)
        return
    if n_workers == 1:
        for number, job in waiting:
            yield number, function(job)
        return
    while True:
        try:
            with _jobs_pool(n_workers) as pool:
                yield from _collect(pool, function, waiting, running, 2 * n_workers, on_wait)
        except BrokenProcessPool:
            suspects = sorted(running.values(), key=lambda item: item[0])
            running.clear()
            for number, job in suspects:
                try:
                    with process_pool(1) as pool:
                        result = pool.submit(function, job).result()
                except BrokenProcessPool:
                    result = if_killed(job)
                yield number, result
        else:
            return


def _collect(
    executor: Executor,
    function: Callable[[Job], Result],
    waiting: Iterator[tuple[int, Job]],
    running: dict[Future[Result], tuple[int, Job]],
    n_at_once: int,
    on_wait: Callable[[], object] | None,
    if_killed: Callable[[Job], Result] | None = None,
) -> Iterator[tuple[int, Result]]:
    """Keep `n_at_once` jobs with an executor; jobs left in `running` after an error have no result."""
    try:
        while True:
            for number, job in islice(waiting, n_at_once - len(running)):
                try:
                    running[executor.submit(function, job)] = number, job
                except BrokenProcessPool:
                    running[Future()] = number, job
                    raise
            if not running:
                return
            done = wait(running, timeout=1.0 if on_wait else None, return_when=FIRST_COMPLETED).done
            if not done and on_wait is not None:
                on_wait()
            for future in done:
                try:
                    result = future.result()
                except BrokenProcessPool:
                    raise
                except Exception:
                    if if_killed is None:
                        raise
                    result = if_killed(running[future][1])
                number, _ = running.pop(future)
                yield number, result
    finally:
        for future in running:
            future.cancel()


def killed_text(job: str) -> str:
    """Return why a job whose process was killed has no result, for use in `if_killed` of `run_jobs`.

    Parameters
    ----------
    job : str
        What the process was doing, e.g. "analysed it".
    """
    return f"the process that {job} was killed: perhaps it ran out of memory"


class Cluster:
    """Workers of a Dask cluster as one executor, with a record of lost workers.

    Parameters
    ----------
    client : distributed.Client
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._seen: set[str] = set(self._workers())
        self.executor: Executor = client.get_executor(pure=False)

    @property
    def n_workers(self) -> int:
        """Number of threads of all present workers, at least 1."""
        return max(1, sum(int(worker["nthreads"]) for worker in self._workers().values()))

    def lost(self) -> tuple[str, ...]:
        """Return the addresses of workers that have disappeared."""
        now = set(self._workers())
        self._seen |= now
        return tuple(sorted(self._seen - now))

    def text(self) -> str:
        """Say in one sentence where the jobs ran and how many workers were lost."""
        lost, here = self.lost(), self._workers()
        text = f"on {len(here)} worker{'s' * (len(here) != 1)} of a Dask cluster"
        if not lost:
            return text
        return f"{text}; {len(lost)} more {'was' if len(lost) == 1 else 'were'} lost, and what it ran was run again"

    def _workers(self) -> dict[str, Any]:
        workers: dict[str, Any] = self._client.scheduler_info(n_workers=-1)["workers"]
        return workers


_ACTIVE: ContextVar[Cluster | None] = ContextVar("cluster", default=None)


def active_cluster() -> Cluster | None:
    """Return the cluster in whose block this is called; None outside any such block."""
    return _ACTIVE.get()


@contextmanager
def cluster(address: str) -> Iterator[Cluster]:
    """Run the jobs of a block on a Dask cluster. Its workers must see the same files under the same paths.

    Dask sends pickled code both ways: use only a cluster that you trust.

    Parameters
    ----------
    address : str
        Address of the scheduler, e.g. "tcp://10.0.0.5:8786".

    Raises
    ------
    InputError
        If `distributed` is not installed, no scheduler answers, it has no workers, or their gearsig version differs.
    """
    from gearsig import __version__

    try:
        from distributed import Client
    except ImportError:
        remedy = "install it with: pip install 'gearsig[cluster]'"
        raise InputError("a cluster needs the package distributed", remedy=remedy) from None
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers ({' '.join(str(error).split())})",
            where=address,
            remedy="give its address, e.g. tcp://10.0.0.5:8786, and start it with: dask scheduler",
        ) from None
    try:
        versions = set(client.run(gearsig_version).values())
        if versions != {__version__}:
            here = f"gearsig is {__version__} here, and {', '.join(sorted(versions)) or 'no worker'} there"
            raise InputError(here, where=address, remedy="start workers with the same gearsig: dask worker ADDRESS")
        opened = Cluster(client)
        before = _ACTIVE.set(opened)
        try:
            yield opened
        finally:
            _ACTIVE.reset(before)
    finally:
        client.close()


def gearsig_version() -> str:
    """Return the version of gearsig; workers are asked to call it."""
    from gearsig import __version__

    return __version__


# --------------------
# Processes that run other programs, each in a separate session, so that they end with all that they started.
# --------------------


PATIENCE_S = 3.0
"""Time after which a process that was told to stop is killed."""


def stop(process: subprocess.Popen[Any]) -> None:
    """End a process and what it started, unless it has already ended."""
    if process.poll() is not None:
        return
    _signal(process, force=False)
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        _signal(process, force=True)
        process.wait()


class Running:
    """Running processes that can be stopped together; none starts after that."""

    def __init__(self) -> None:
        self._lock, self._processes, self._stopped = Lock(), set[subprocess.Popen[Any]](), False

    def start(self, arguments: list[str], **settings: Any) -> subprocess.Popen[Any]:
        """Start a process in a separate session.

        Raises
        ------
        KeyboardInterrupt
            If `stop` has been called.
        """
        with self._lock:
            if self._stopped:
                raise KeyboardInterrupt
            process = subprocess.Popen(arguments, start_new_session=True, **settings)
            self._processes.add(process)
        return process

    def ended(self, process: subprocess.Popen[Any]) -> bool:
        """Forget a process; return whether it ended by itself and was not stopped."""
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
