"""Kurtogram of 2²⁰ samples beside PySDKit's and a plain scipy filter bank, one core, interleaved rounds.

Run: python tests/benchmarks/bench_kurtogram.py. PySDKit (0.4.54 has Antoni's filter bank in Python) is used where it is
installed. Times are the process' own processor time, so that other work on the machine counts less.
"""

# ruff: noqa: E402 - the number of threads must be set before numpy is loaded

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import importlib.util
import resource
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import upfirdn

from gearsig.spectra import kurtogram, spectral_coherence, splitter

N_ROUNDS = 5
N_LEVELS = 7


def scipy_filter_bank(x: np.ndarray, n_levels: int) -> list[list[float]]:
    """Return the kurtoses of the same tree, by scipy's polyphase filter, node by node."""
    filters = {}
    for n_parts in (2, 3):
        s = splitter(n_parts)
        n_side = len(s.cosine) - 1
        k = np.arange(-n_side, n_side + 1)
        sign = np.where((np.abs(k) // (2 * n_parts)) % 2 == 0, 1.0, -1.0)
        h = np.hypot(s.cosine, s.sine)[np.abs(k)] * sign
        middles = (2 * np.arange(n_parts) + 1) / (4 * n_parts)
        filters[n_parts] = [h * np.exp(2j * np.pi * m * k) for m in middles]

    def parts(z: np.ndarray, n_parts: int) -> list[np.ndarray]:
        out = []
        for i, h in enumerate(filters[n_parts]):
            skip = len(h) - 1
            valid = upfirdn(h, z[: len(z)], 1, 1)[skip : len(z)][::n_parts]
            out.append(valid if i % 2 == 0 else valid * (-1.0) ** np.arange(len(valid)))
        return out

    def kurtosis(z: np.ndarray) -> float:
        power = z.real**2 + z.imag**2
        return float(np.mean(power**2) / np.mean(power) ** 2 - 2)

    rows, nodes = [], [(x - x.mean()).astype(np.complex128)]
    for _ in range(n_levels):
        rows.append([kurtosis(p) for z in nodes for p in parts(z, 3)])
        nodes = [p for z in nodes for p in parts(z, 2)]
        rows.append([kurtosis(z) for z in nodes])
    return rows


def _compare(x: np.ndarray, others: dict[str, Callable[[], object]], ours: Callable[[], object], name: str) -> None:
    best = dict.fromkeys(["ours", *others], np.inf)
    for _ in range(N_ROUNDS):
        for label, run in {"ours": ours, **others}.items():
            start = time.process_time()
            run()
            best[label] = min(best[label], time.process_time() - start)
    for label in others:
        print(f"{name}, {len(x)} samples: {best[label] / best['ours']:5.1f} times as fast as {label}")


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print ratios, agreement and memory."""
    print("machine load", *(f"{v:.1f}" for v in os.getloadavg()))
    kurtogram(np.random.default_rng(0).normal(size=4096), 1.0)  # compiles, or loads what is compiled
    long = np.zeros(1 << 24, dtype=np.float32)
    long[::4096] = 1.0
    before = _peak_mb()
    kurtogram(long, 1.0)
    print(f"2^24 samples of float32 (64 MB): peak memory rises by {_peak_mb() - before:.0f} MB")
    x = np.random.default_rng(0).normal(size=1 << 20)
    others: dict[str, Callable[[], object]] = {"scipy's filter, node by node": lambda: scipy_filter_bank(x, N_LEVELS)}
    if importlib.util.find_spec("pysdkit") is not None:
        from pysdkit.utils._kurtogram import fast_kurtogram

        others["PySDKit"] = lambda: fast_kurtogram(x, N_LEVELS, 1.0)
    _compare(x, others, lambda: kurtogram(x, 1.0, n_levels=N_LEVELS), "kurtogram")
    ours = kurtogram(x, 1.0, n_levels=N_LEVELS)
    halves = next(row for row in scipy_filter_bank(x, N_LEVELS) if len(row) == 2**N_LEVELS)
    difference = np.abs(ours.kurtosis[ours.level == N_LEVELS] - halves).max()
    print(f"largest difference from scipy's filters at the finest halves {difference:.1e}")
    _coherence(x)


def _coherence(x: np.ndarray) -> None:
    """Print how the fast correlation of lines compares with one sum per cyclic frequency."""
    n_alphas, n_bands = 10_000, 128
    lines = np.fft.rfft(x * np.hanning(len(x)))
    half = len(lines) // n_bands
    power = lines.real**2 + lines.imag**2

    def some_alphas() -> None:
        edges = np.arange(n_bands) * half
        for k in range(100, 120):
            S = np.add.reduceat(lines[k:] * np.conj(lines[:-k]), edges)
            _ = np.abs(S) ** 2 / (np.add.reduceat(power[k:], edges) * np.add.reduceat(power[:-k], edges))

    ours, theirs = np.inf, np.inf
    for _ in range(3):
        start = time.process_time()
        spectral_coherence(x, 1.0, highest_alpha_hz=n_alphas / len(x), n_bands=n_bands)
        ours = min(ours, time.process_time() - start)
        start = time.process_time()
        some_alphas()
        theirs = min(theirs, (time.process_time() - start) * n_alphas / 20)
    print(f"coherence, {n_alphas} × {n_bands} cells: {theirs / ours:5.1f} times as fast as one sum per α (20 timed)")


if __name__ == "__main__":
    main()
