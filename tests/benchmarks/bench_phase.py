"""Phase-space methods beside plain implementations and nolds, one core, interleaved.

Run: python tests/benchmarks/bench_phase.py. Prints ratios: absolute times depend
on what else the machine does.
"""

import os
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from interleaved import best_of

from gearsig.phase import (
    average_mutual_information,
    delay_embedding,
    embedding_dimension,
    largest_lyapunov_exponent,
    nearest_apart,
    recurrence_measures,
    zero_one_test,
)


def _signal(n: int) -> np.ndarray:
    """Return the x of the Lorenz system, sampled every 0.02."""
    s, out, h = np.array([1.0, 1.0, 20.0]), np.empty(n), 0.01

    def rate(s: np.ndarray) -> np.ndarray:
        return np.array([10.0 * (s[1] - s[0]), s[0] * (28.0 - s[2]) - s[1], s[0] * s[1] - 8.0 / 3.0 * s[2]])

    for i in range(-500, n):
        for _ in range(2):
            a = rate(s)
            b = rate(s + h / 2 * a)
            c = rate(s + h / 2 * b)
            s = s + h / 6 * (a + 2 * b + 2 * c + rate(s + h * c))
        if i >= 0:
            out[i] = s[0]
    return out


def _plain_mutual_information(x: np.ndarray, n_delays: int, n_bins: int) -> float:
    total = 0.0
    for delay in range(n_delays):
        joint = np.histogram2d(x[: len(x) - delay], x[delay:], bins=n_bins)[0]
        p = joint / joint.sum()
        outer = p.sum(axis=1)[:, None] * p.sum(axis=0)[None, :]
        total += float(np.sum(p[p > 0] * np.log(p[p > 0] / outer[p > 0])))
    return total


def _plain_zero_one(x: np.ndarray, n_frequencies: int = 100) -> float:
    n, n_cut = len(x), len(x) // 10
    k, steps = [], np.arange(1, n_cut + 1)
    for c in np.linspace(np.pi / 5, 4 * np.pi / 5, n_frequencies):
        z = np.cumsum(x * np.exp(1j * c * np.arange(1, n + 1)))
        m = np.array([np.mean(np.abs(z[j : j + n - n_cut] - z[: n - n_cut]) ** 2) for j in steps])
        d = m - x.mean() ** 2 * (1 - np.cos(steps * c)) / (1 - np.cos(c))
        k.append(np.corrcoef(steps, d)[0, 1])
    return float(np.median(k))


def _plain_recurrence(points: np.ndarray, radius: float) -> float:
    """Determinism from the whole matrix."""
    from scipy.spatial.distance import cdist

    matrix = cdist(points, points) < radius
    on_lines = total = 0
    for lag in range(21, len(points)):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], np.diagonal(matrix, lag).astype(np.int8), [0]])))
        lengths = edges[1::2] - edges[::2]
        total += int(lengths.sum())
        on_lines += int(lengths[lengths >= 2].sum())
    return on_lines / max(total, 1)


def _plain_neighbours(points: np.ndarray, theiler: int) -> float:
    """Nearest neighbours apart in time from all distances, a reference at a time."""
    index, total = np.arange(len(points)), 0.0
    for r in range(0, len(points), 10):
        distance = np.square(points - points[r]).sum(axis=1)
        total += float(np.sqrt(distance[np.abs(index - r) > theiler].min()))
    return total


def _smooth(n: int) -> np.ndarray:
    """Four coordinates of a slow, finely sampled motion: all near neighbours are near in time."""
    t = np.arange(n) / 2000.0
    return np.column_stack([np.sin((1.0 + 0.37 * k) * t * 6.0 + k) for k in range(4)])


def _nolds_lyapunov(x: np.ndarray) -> Callable[[], Any] | None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import nolds
        except (ImportError, TypeError):
            return None
    return lambda: nolds.lyap_r(x, emb_dim=3, lag=8, min_tsep=80, trajectory_len=150, fit="poly")


def main() -> None:
    """Print one ratio per method."""
    x = _signal(20_000)
    short, maps = x[:4_000], np.random.default_rng(0).normal(size=4_000)
    portrait = delay_embedding(x, 50.0, delay_samples=8, dimension=3)
    small = delay_embedding(short, 50.0, delay_samples=8, dimension=3)
    points = small.points / small.extent
    # Compiling is not timed.
    information = average_mutual_information(x, 50.0)
    largest_lyapunov_exponent(portrait)
    recurrence_measures(small, radius=0.5, theiler_samples=20, stride=1)
    print(f"load of the machine (1 min): {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    cases = [
        (
            "mutual information, 20 000 samples | numpy histogram2d",
            lambda: average_mutual_information(x, 50.0),
            lambda: _plain_mutual_information(x, len(information.information_nats), information.n_bins),
        ),
        (
            "0–1 test, 4000 values, 100 c | numpy, as defined",
            lambda: zero_one_test(maps),
            lambda: _plain_zero_one(maps),
        ),
        (
            "recurrence measures, 4000 points | whole matrix, scipy cdist",
            lambda: recurrence_measures(small, radius=0.5, theiler_samples=20, stride=1),
            lambda: _plain_recurrence(points, 0.5),
        ),
    ]
    slow, every = _smooth(20_000), np.arange(20_000)
    nearest_apart(slow, every, every[::10], 2000)
    cases.append(
        (
            "neighbours apart in time, 2000 of 20 000, window 2000 | numpy, all distances",
            lambda: nearest_apart(slow, every, every[::10], 2000),
            lambda: _plain_neighbours(slow, 2000),
        )
    )
    nolds = _nolds_lyapunov(short)
    if nolds is not None:
        cases.append(
            ("Lyapunov exponent (Rosenstein), 4000 points | nolds", lambda: largest_lyapunov_exponent(small), nolds)
        )
    for name, ours, theirs in cases:
        (own, _), (other, _) = best_of(5, ours, theirs)
        print(f"{name:78s} {other / own:8.1f}×")
    (dimension, _), (mutual, _) = best_of(
        1, lambda: embedding_dimension(x, 50.0, delay_samples=8), lambda: average_mutual_information(x, 50.0)
    )
    print(f"embedding dimension in mutual informations {dimension / mutual:.1f}")


if __name__ == "__main__":
    main()
