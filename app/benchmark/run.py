"""`gearsig benchmark gap`: blind cases of a gearbox, made as planned and diagnosed one by one."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import app
from app.benchmark.answer import ANSWERS, Answer, from_text, to_text
from app.benchmark.cases import Plan, PlannedCase, Truth
from app.benchmark.diagnosers import diagnoser, folders_of
from gearsig import __version__
from gearsig.cache import FOLDERS, write_text
from gearsig.checks import count
from gearsig.processes import Running, process_pool, stop
from sims.sweep import claimed

# --------------------
# Make cases and have each answered by a new process in its own temporary folder.
#
# Until every diagnosis has ended, labels and twins exist only in the memory of the making processes and of this one;
# the folder of a case has a random name, holds only recordings and rig files, and is removed after the answer. Only
# answers are kept during the run. An existing answer is not asked for again; its truth is made again from the seed.
# --------------------


DEFINITION, ANSWERS_FOLDER = "benchmark.json", "answers"
MAX_S = 900.0
"""Time limit, in s; a diagnosis that takes longer has no answer."""

_SHOWS_ONLY = ("gearsig/plot/", "gearsig/report/", "app/benchmark/scores.py", "app/benchmark/results.py")
"""Code that neither makes nor answers cases: it may change between an answer and its score."""

_PASSED_ON = ("PATH", "LANG", "LC_ALL", "HOME", "SYSTEMROOT", "VIRTUAL_ENV", "NUMBA_CACHE_DIR", *FOLDERS)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_ROOT = Path(app.__file__).resolve().parents[1]


@dataclass(frozen=True)
class BenchmarkRequest:
    """A requested benchmark.

    Parameters
    ----------
    plan : Plan
    diagnosers : tuple of str
        The first is judged, the others are for comparison; see `app.benchmark.diagnosers`.
    """

    plan: Plan
    diagnosers: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.diagnosers:
            diagnoser(name)

    @cached_property
    def code(self) -> str:
        """Hash of the code when it was first requested."""
        return state_of_code()

    def definition(self) -> dict[str, Any]:
        """Return the values that determine the result."""
        return {
            **self.plan.definition(),
            "diagnosers": list(self.diagnosers),
            "version": __version__,
            "code": self.code,
        }


@dataclass(frozen=True)
class Done:
    """One case, made and answered.

    Parameters
    ----------
    planned : PlannedCase
    truth : Truth
    answers : mapping of str to Answer
    """

    planned: PlannedCase
    truth: Truth
    answers: dict[str, Answer]


def run_benchmark(
    request: BenchmarkRequest, folder: Path, *, n_processes: int = 2, on_progress: Callable[[int], object] | None = None
) -> list[Done]:
    """Make and diagnose all cases in `n_processes` processes; return them in the plan's order.

    After Ctrl-C or SIGTERM the answers so far stay in the folder, and the same call continues from there.

    Raises
    ------
    InputError
        If the folder holds other files or another benchmark, a diagnoser does not exist, or the code has changed.
    """
    claimed(folder, request.definition(), DEFINITION, "benchmark")
    (folder / ANSWERS_FOLDER).mkdir(exist_ok=True)
    workers = count(n_processes, "processes")
    done: list[Done] = []
    running = Running()
    with process_pool(workers) as makers, ThreadPoolExecutor(workers) as threads:
        futures = [threads.submit(_run_case, request, case, folder, makers, running) for case in request.plan.cases()]
        try:
            for future in as_completed(futures):
                done.append(future.result())
                if on_progress is not None:
                    on_progress(len(done))
        finally:
            for future in futures:
                future.cancel()
            running.stop()
    return sorted(done, key=lambda done_case: done_case.planned.number)


def _run_case(
    request: BenchmarkRequest, planned: PlannedCase, folder: Path, makers: Executor, running: Running
) -> Done:
    kept = folder / ANSWERS_FOLDER / f"case_{planned.number:04d}.json"
    if (known := _kept_answers(kept, request.diagnosers)) is not None:
        return Done(planned, makers.submit(request.plan.make, planned, None).result(), known)
    with TemporaryDirectory(prefix="gearsig-") as name:
        place = Path(name)
        truth = makers.submit(request.plan.make, planned, place).result()
        answers = diagnosed(place, request.diagnosers, running)
    write_text(kept, to_text(answers))
    return Done(planned, truth, answers)


def _kept_answers(path: Path, diagnosers: Sequence[str]) -> dict[str, Answer] | None:
    """Return the answers of an earlier run; None if they are missing or damaged, so that they are made again."""
    try:
        answers = from_text(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return answers if set(answers) == set(diagnosers) else None


def n_answered(folder: Path) -> int:
    """Return the number of cases whose answers the folder holds."""
    return len(list((folder / ANSWERS_FOLDER).glob("case_*.json")))


def diagnosed(folder: Path, names: Sequence[str], running: Running | None = None) -> dict[str, Answer]:
    """Return the answers of a new process that is given only the folder.

    Raises
    ------
    KeyboardInterrupt
        If the run was stopped, which is not an answer.
    """
    runs = running or Running()
    process = runs.start(
        [sys.executable, "-P", "-m", "app.benchmark.answer", *names],
        cwd=folder,
        env=environment(folder, names),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        _, output = process.communicate(timeout=MAX_S)
    except subprocess.TimeoutExpired:
        return dict.fromkeys(names, Answer("", seconds=MAX_S, error=f"no answer within {MAX_S:g} s"))
    finally:
        stop(process)
        by_itself = runs.ended(process)
    if not by_itself:
        raise KeyboardInterrupt
    if process.returncode != 0:
        last = output.strip().rpartition("\n")[2]
        return dict.fromkeys(names, Answer("", error=f"the process ended with {process.returncode}: {last}"))
    return from_text((folder / ANSWERS).read_text(encoding="utf-8"))


def environment(folder: Path, names: Sequence[str]) -> dict[str, str]:
    """Return the environment of a diagnosing process.

    Of the caller's PYTHONPATH it contains only the folders that hold the modules of these diagnosers.
    """
    passed_on = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
    modules = dict.fromkeys([_ROOT, *(place for name in names for place in folders_of(name))])
    path = os.pathsep.join(map(str, modules))
    return passed_on | dict.fromkeys(_ONE_THREAD, "1") | {"TMPDIR": str(folder), "PYTHONPATH": path}


def state_of_code() -> str:
    """Return a hash of all code that makes or answers cases; answers made by other code do not count."""
    digest = hashlib.sha256()
    for room in ("gearsig", "sims", "app/benchmark"):
        for path in sorted((_ROOT / room).rglob("*")):
            name = path.relative_to(_ROOT).as_posix()
            if path.suffix in (".py", ".json", ".toml", ".npz") and not name.startswith(_SHOWS_ONLY):
                digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
