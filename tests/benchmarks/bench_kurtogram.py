"""Kurtogram of 2²⁰ samples beside PySDKit's and a plain scipy filter bank, one core, interleaved rounds.

Run: python tests/benchmarks/bench_kurtogram.py. PySDKit (0.4.54 has Antoni's filter bank in Python) is used where it is
installed. Times are the process' own processor time, so that other work on the machine counts less.
"""

import importlib.util
import os
from collections.abc import Callable

import numpy as np
from interleaved import best_of, peak_mb
from scipy.signal import upfirdn

from gearsig.spectra import kurtogram, spectral_coherence, splitter

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


def main() -> None:
    """Print ratios, agreement and memory."""
    print("machine load", *(f"{v:.1f}" for v in os.getloadavg()))
    kurtogram(np.random.default_rng(0).normal(size=4096), 1.0)  # compiles, or loads what is compiled
    long = np.zeros(1 << 24, dtype=np.float32)
    long[::4096] = 1.0
    before = peak_mb()
    kurtogram(long, 1.0)
    print(f"2^24 samples of float32 (64 MB): peak memory rises by {peak_mb() - before:.0f} MB")
    x = np.random.default_rng(0).normal(size=1 << 20)
    others: dict[str, Callable[[], object]] = {"scipy's filter, node by node": lambda: scipy_filter_bank(x, N_LEVELS)}
    if importlib.util.find_spec("pysdkit") is not None:
        from pysdkit.utils._kurtogram import fast_kurtogram

        others["PySDKit"] = lambda: fast_kurtogram(x, N_LEVELS, 1.0)
    (best, ours), *rest = best_of(5, lambda: kurtogram(x, 1.0, n_levels=N_LEVELS), *others.values())
    for label, (seconds, _) in zip(others, rest, strict=True):
        print(f"kurtogram, {len(x)} samples: {seconds / best:5.1f} times as fast as {label}")
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

    def all_alphas() -> None:
        spectral_coherence(x, 1.0, highest_alpha_hz=n_alphas / len(x), n_bands=n_bands)

    (ours, _), (theirs, _) = best_of(3, all_alphas, some_alphas)
    ratio = theirs * n_alphas / 20 / ours
    print(f"coherence, {n_alphas} × {n_bands} cells: {ratio:5.1f} times as fast as one sum per α (20 timed)")


if __name__ == "__main__":
    main()
