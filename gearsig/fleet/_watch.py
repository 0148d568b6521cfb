"""Add recordings to a fleet as they appear in a folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gearsig.checks import not_negative, positive
from gearsig.errors import GearsigError
from gearsig.fleet._add import AddedRecording
from gearsig.fleet._fleet import Fleet
from gearsig.fleet._origin import ExcludedFile, FilePattern, Origin, excluded_text, origins
from gearsig.processes import active_cluster, n_processors, process_pool


@dataclass(frozen=True)
class WatchEvent:
    """One line of a watch's log.

    Parameters
    ----------
    kind : str
        "added", "failed", "passed over" (files that the pattern leaves out, each reported once) or "problem" (with
        folder or store, which is tried again).
    time : datetime
        In UTC.
    text : str
    added : AddedRecording or None
    excluded : tuple of ExcludedFile
    """

    kind: str
    time: datetime
    text: str
    added: AddedRecording | None = None
    excluded: tuple[ExcludedFile, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the content of the event's line of JSON."""
        result: dict[str, Any] = {"event": self.kind, "time": f"{self.time:%Y-%m-%dT%H:%M:%SZ}", "text": self.text}
        if self.added is not None:
            origin = self.added.origin
            result |= {
                "file": str(origin.path),
                "machine": origin.machine,
                "point": origin.point,
                "date": origin.date.isoformat(),
                "outcome": self.added.outcome,
            }
        if self.excluded:
            result["excluded"] = [{"file": str(file.path), "reason": file.reason} for file in self.excluded]
        return result


@dataclass
class _WatchedFile:
    """A file's size and modification time, and since when they are unchanged (monotonic clock, s)."""

    signature: tuple[int, int]
    since_s: float
    is_done: bool = False


def watch(
    fleet: Fleet,
    places: Iterable[str | Path],
    *,
    on_event: Callable[[WatchEvent], object],
    interval_s: float = 5.0,
    settle_s: float = 10.0,
    once: bool = False,
    n_processes: int | None = None,
    executor: Executor | None = None,
    stop: Callable[[], bool] = lambda: False,
    **how: Any,
) -> int:
    """Add new recordings as they appear, until `stop` returns true; return how many failed.

    The folders are searched at each interval: unlike notifications of the operating system, this also works on network
    drives and after a restart. A file is added once its size and modification time have not changed for a while. If it
    was added too early, or changes later, it is added again, and a failure is replaced.

    Parameters
    ----------
    fleet : Fleet
    places : iterable of str or Path
        Folders or files; they may appear later.
    on_event : callable
        Called with a `WatchEvent` for each recording and each problem.
    interval_s : float
        Time between two searches.
    settle_s : float
        Time for which a file must not change.
    once : bool
        Whether to end when all present files have been added, after waiting for those that still change.
    n_processes, executor
        See `Fleet.add`.
    stop : callable
        Called before each search.
    **how
        Other arguments of `Fleet.add`: pattern, rig, sampling_rate_hz, …
    """
    positive(interval_s, "interval_s", "s")
    not_negative(settle_s, "settle_s", "s")
    FilePattern(how.get("pattern", ""))  # an invalid pattern is refused at once
    roots = [Path(place) for place in places]
    seen: dict[Path, _WatchedFile] = {}
    reported: set[Path] = set()
    problems: set[str] = set()
    n_failed = 0

    def say(kind: str, text: str, added: AddedRecording | None = None) -> None:
        on_event(WatchEvent(kind, datetime.now(UTC), text, added))

    def tell(_done: int, _total: int, added: AddedRecording) -> None:
        nonlocal n_failed
        n_failed += added.failed
        say("failed" if added.failed else "added", added.verdict, added)

    with ExitStack() as stack:
        pool = executor
        while not stop():
            try:
                left_out = list[ExcludedFile]()
                ready, n_waiting = _ready(roots, seen, settle_s, how, left_out.append)
                if new := tuple(file for file in left_out if file.path not in reported):
                    reported |= {file.path for file in new}
                    on_event(WatchEvent("passed over", datetime.now(UTC), excluded_text(new), excluded=new))
                if ready:
                    if pool is None and active_cluster() is None:
                        pool = stack.enter_context(process_pool(n_processes or n_processors()))
                    try:
                        fleet.add(ready, executor=pool, n_processes=n_processes, on_progress=tell, **_options(how))
                    except BrokenProcessPool:  # one of them kills its process: each gets a process of its own
                        pool = executor
                        fleet.add(ready, n_processes=max(2, n_processes or 2), on_progress=tell, **_options(how))
                    for origin in ready:
                        seen[origin.path].is_done = True
                problems.clear()
            except (GearsigError, OSError) as error:
                n_waiting = 0
                if str(error) not in problems:
                    problems.add(str(error))
                    say("problem", str(error))
                if once:
                    raise
            if once and not n_waiting:
                break
            time.sleep(interval_s)
    return n_failed


_OF_ORIGIN = ("pattern", "machine", "point", "date")


def _options(how: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in how.items() if name not in _OF_ORIGIN}


def _ready(
    roots: list[Path],
    seen: dict[Path, _WatchedFile],
    settle_s: float,
    how: dict[str, Any],
    on_excluded: Callable[[ExcludedFile], object],
) -> tuple[list[Origin], int]:
    """Return the unchanging recordings that were not added yet, and the number of those that still change."""
    present_roots = [root for root in roots if root.exists()]
    of_origin = {name: how[name] for name in (*_OF_ORIGIN, "rig") if name in how}
    now_s, wall_s = time.monotonic(), time.time()
    ready, n_waiting = [], 0
    for origin in origins(present_roots, on_excluded=on_excluded, may_be_none=True, **of_origin):
        signature = origin.n_bytes, origin.mtime_ns
        known = seen.get(origin.path)
        if known is None:
            age_s = max(0.0, min(wall_s - origin.mtime_ns / 1e9, settle_s))  # an old file need not be waited for
            known = seen[origin.path] = _WatchedFile(signature, now_s - age_s)
        elif known.signature != signature:
            known = seen[origin.path] = _WatchedFile(signature, now_s)
        if known.is_done:
            continue
        if now_s - known.since_s >= settle_s:
            ready.append(origin)
        else:
            n_waiting += 1
    return ready, n_waiting
