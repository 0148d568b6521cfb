"""What the benchmarks share: one thread each, the best of interleaved rounds, the largest memory."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

threadpool_limits(1)


def best_of(n_rounds: int, *runs: Callable[[], Any]) -> list[tuple[float, Any]]:
    """Return (seconds, result) of the quickest run of each.

    The seconds are the process's own processor time, so that other work on the machine counts less.
    """
    best: list[tuple[float, Any]] = [(np.inf, None)] * len(runs)
    for _ in range(n_rounds):
        for i, run in enumerate(runs):
            start = time.process_time()
            result = run()
            elapsed = time.process_time() - start
            if elapsed < best[i][0]:
                best[i] = (elapsed, result)
    return best


def peak_mb() -> float:
    """Return the process's own largest resident size (Linux); getrusage would hand down the parent's."""
    return int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1e3
