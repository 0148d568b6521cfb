"""How the recursions of one order are driven: both halves to the middle, joined there, and back to the ends.

Sample i of the first half goes with sample n - 1 - i. Where n is odd, an unobserved sample is added at the end: it fits
whatever the others say, so it changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError

Array = NDArray[Any]
Forward = Callable[[int, int, Array, Array, FloatArray, FloatArray, Array], None]
"""Filter samples i to j of both halves: (i, j, front, back, gains, s, g)."""
Backward = Callable[[Array, Array, FloatArray, Array], None]
"""Smooth them, from the last to the first: (front, back, gains, z)."""
BLOCK_SAMPLES = 2**12
"""Of each half: what a block needs fits the cache."""
GAIN_BYTES = 256 * 2**20
"""Memory for the gains. Longer signals keep those of a part only, and compute each part a second time, backwards."""
SEEN_FROM_BEHIND = {
    1: np.array([[1.0]]),
    2: np.array([[1.0, -1.0], [0.0, -1.0]]),
    3: np.array([[1.0, -2.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]]),
}
"""Turns value and differences at the last of p samples into those at the first, counted the other way."""


def smoothed_halves(
    n: int,
    p: int,
    n_gains: int,
    forward: Forward,
    backward: Backward,
    *,
    middle_q: float,
    dtype: Any = np.complex128,
    pair: bool = False,
    gain_bytes: int = GAIN_BYTES,
) -> Array:
    """Return the solution of one order's problem, (n,).

    Parameters
    ----------
    n, p : int
        Samples, poles.
    n_gains : int
        Numbers that `forward` keeps per step for `backward`.
    forward, backward : callable
    middle_q : float
        q of the step after sample ⌈n/2⌉ in the first half's direction; used with three poles.
    dtype : type
        Of the solution.
    pair : bool
        Whether the components of the state are pairs, and S of blocks of 2 by 2.
    gain_bytes : int

    Raises
    ------
    RefusalError
        If the data do not determine the order.
    """
    half = -(-n // 2)
    x = np.empty(2 * half, dtype)
    front, back = x[:half], x[::-1][:half]
    blocks = _equal_blocks(half)
    per_part = min(len(blocks), max(1, gain_bytes // (16 * n_gains * BLOCK_SAMPLES)))
    parts = [blocks[m : m + per_part] for m in range(0, len(blocks), per_part)]
    buffer = np.empty((per_part, 2 * BLOCK_SAMPLES * n_gains))
    n_entries = p * (p + 1) // 2
    s, g = np.zeros((2, n_entries, 4) if pair else (2, n_entries)), np.zeros((2, p), dtype)

    def filter_part(part: list[tuple[int, int]]) -> None:
        for (i, j), kept in zip(part, buffer, strict=False):
            forward(i, j, front[i:j], back[i:j], _gains(kept, j - i, n_gains), s, g)

    entries = []
    for part in parts:
        entries.append((s.copy(), g.copy()))
        filter_part(part)
    z = _joined(p, s, g, middle_q)
    for part, entry in reversed(list(zip(parts, entries, strict=True))):
        if part is not parts[-1]:
            s[:], g[:] = entry
            filter_part(part)
        for (i, j), kept in reversed(list(zip(part, buffer, strict=False))):
            backward(front[i:j], back[i:j], _gains(kept, j - i, n_gains), z)
    return x[:n]


def _equal_blocks(n: int) -> list[tuple[int, int]]:
    """Return (first, one past the last) of blocks of about the same size, so that none is a single sample."""
    n_blocks = -(-n // BLOCK_SAMPLES)
    return [(n * m // n_blocks, n * (m + 1) // n_blocks) for m in range(n_blocks)]


def _gains(buffer: FloatArray, n: int, n_gains: int) -> FloatArray:
    """Return the part of a block's buffer that n samples take."""
    return buffer[: 2 * n * n_gains].reshape(2, n, n_gains)


def _joined(p: int, s: FloatArray, g: Array, q: float) -> Array:
    """Return the states after the last step of either half, (2, p), from what both halves say.

    Each form holds the rows of the structural equation up to its own state. With two poles both states are the same two
    samples, and each row is in one of the forms. With one pole, the first half leaves the row across the middle to the
    second. With three, one row is in neither: the first half takes one more step, with ε = √q η as a further unknown.
    """
    turn = SEEN_FROM_BEHIND[p]
    n_steps = max(0, p - 2)
    to_back = np.concatenate([turn @ np.triu(np.ones((p, p))) if n_steps else turn, np.zeros((p, n_steps))], axis=1)
    if n_steps:
        to_back[:, p:] = q**0.5 * turn.sum(axis=1, keepdims=True)
    pair = s.ndim == 3
    size = 2 if pair else 1
    turns = np.kron(to_back, np.eye(size))
    matrix = turns.T @ _dense(s[1], p) @ turns
    matrix[: p * size, : p * size] += _dense(s[0], p)
    matrix[p * size :, p * size :] += np.eye(n_steps * size)
    right = to_back.T @ g[1]
    right[:p] += g[0]
    try:
        solution = np.linalg.solve(matrix, right.view(np.float64) if pair else right)
    except np.linalg.LinAlgError:
        raise RefusalError(
            "the data do not determine the order", remedy="widen the band or take a longer recording"
        ) from None
    x = solution.view(g.dtype)
    return np.stack([x[:p], to_back @ x])


def _dense(entries: FloatArray, p: int) -> FloatArray:
    """Return S from its upper triangle, row by row, of numbers or of blocks of 2 by 2."""
    size = 2 if entries.ndim == 2 else 1
    blocks = np.zeros((p, p, size, size))
    rows, columns = np.triu_indices(p)
    blocks[rows, columns] = entries.reshape(-1, size, size)
    blocks[columns, rows] = entries.reshape(-1, size, size).transpose(0, 2, 1)
    return blocks.transpose(0, 2, 1, 3).reshape(p * size, p * size)
