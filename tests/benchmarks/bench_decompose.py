"""Variational modes beside vmdpy, one core, interleaved rounds. Run: python tests/benchmarks/bench_decompose.py.

Times are the process' own processor time, so that other work on the machine counts less.
"""

# ruff: noqa: E402 - the number of threads must be set before numpy is loaded

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import gc
import resource
import time

import numpy as np
from vmdpy import VMD

from gearsig.decompose import VmdSettings, vmd

N_ROUNDS = 3
N_MODES = 5


def _signal(n: int) -> np.ndarray:
    """Return two tones, a modulated one and noise."""
    i = np.arange(n)
    modulated = (1 + 0.5 * np.cos(40 * i / n)) * np.cos(2 * np.pi * 0.1 * i)
    tones = np.cos(2 * np.pi * 0.02 * i) + 0.3 * np.cos(2 * np.pi * 0.3 * i)
    return tones + 0.5 * modulated + 0.2 * np.random.default_rng(0).normal(size=n)


def _compare(n: int, tolerance: float) -> None:
    x, settings = _signal(n), VmdSettings(N_MODES, tolerance=tolerance)
    vmd(x[:64], 1.0, VmdSettings(N_MODES))  # compiles, or loads what is compiled
    ours, theirs = [], []
    for _ in range(N_ROUNDS):
        gc.collect()
        start = time.process_time()
        modes = vmd(x, 1.0, settings)
        ours.append(time.process_time() - start)
        start = time.process_time()
        u, _, omega = VMD(x, settings.penalty, settings.dual_step, N_MODES, DC=False, init=1, tol=tolerance)
        theirs.append(time.process_time() - start)
    difference = float(np.abs(u - modes.waveforms).max())
    print(
        f"{n:>8} samples, {N_MODES} modes, {modes.n_iterations} and {len(omega)} iterations: "
        f"ratio of the best {min(theirs) / min(ours):6.0f}, of the medians {np.median(theirs) / np.median(ours):6.0f}, "
        f"largest difference {difference:.1e}"
    )


def _memory(n: int) -> None:
    """Print how far the process' peak memory rises; memory does not depend on the number of iterations."""
    x, settings = _signal(n), VmdSettings(N_MODES, max_iterations=3)
    vmd(x[:64], 1.0, settings)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    modes = vmd(x, 1.0, settings)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"{n:>8} samples, {modes.n_modes} modes: peak memory of the process {peak / 1024:.0f} MiB, "
        f"{(peak - before) * 1024 / (8 * n):.1f} values per sample more than before"
    )


def main() -> None:
    """Print the ratio of times, the largest difference and the memory."""
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; ratios only")
    _memory(2**20)  # first: vmdpy's own peak would hide it
    _compare(2**13, 1e-3)
    _compare(2**16, 1e-4)


if __name__ == "__main__":
    main()
