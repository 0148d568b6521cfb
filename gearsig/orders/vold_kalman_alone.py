"""The Vold–Kalman filter for one order by itself, exact at any bandwidth: second generation, first generation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders import vold_kalman_pairs as pairs
from gearsig.orders import vold_kalman_states as states
from gearsig.orders.vold_kalman_fold import demodulate, fold, oscillator
from gearsig.orders.vold_kalman_halves import BLOCK_SAMPLES, GAIN_BYTES, Backward, Forward, smoothed_halves
from gearsig.orders.vold_kalman_phasor import cosine_and_sine

Array = NDArray[Any]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]


def envelope_alone(
    y: FloatArray,
    cycles: FloatArray,
    active: BoolArray | None,
    weights: FloatArray,
    p: int,
    *,
    mirror: bool,
    gain_bytes: int = GAIN_BYTES,
) -> ComplexArray:
    """Return the envelope 2x of one order, as `solve_envelopes` does for several.

    Parameters
    ----------
    y, cycles, active : arrays, (n,)
    weights : array, (n - p,) or (1,)
        r of each row of the structural equation.
    p : int
    mirror : bool
    gain_bytes : int
        Memory for the gains.

    Returns
    -------
    array, (n,), complex

    Raises
    ------
    RefusalError
        If the data do not determine it.
    """
    n = len(y)
    q = (2.0 if mirror else 1.0) / weights**2
    middle = float(q[min(-(-n // 2) + 1 - p, len(q) - 1)])
    if mirror:
        steps = _pair_steps(y, cycles, active, q, p)
        return smoothed_halves(n, p, pairs.N_GAINS[p], *steps, middle_q=middle, pair=True, gain_bytes=gain_bytes)
    x = smoothed_halves(n, p, p, *_single_steps(y, cycles, active, q, p), middle_q=middle, gain_bytes=gain_bytes)
    x *= 2.0
    return x


def waveform_alone(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidth: FloatArray, *, gain_bytes: int = GAIN_BYTES
) -> FloatArray:
    """Return the waveform of one order, as `solve_waveforms` does for several; bandwidth (n - 2,) or (1,)."""
    steps = _oscillator_steps(y, cycles, active, bandwidth)
    return smoothed_halves(len(y), 2, 2, *steps, middle_q=0.0, dtype=np.float64, gain_bytes=gain_bytes)


def _oscillator_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, bandwidth: FloatArray
) -> tuple[Forward, Backward]:
    """Return how a block of the first generation is filtered, and how it is smoothed."""
    n = len(y)

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level, signal = _levels(active, n, i, j), _of_samples(y, n, i, j)
        np.multiply(level[0], signal[0], out=front)
        np.multiply(level[1], signal[1], out=back)
        around = _of_samples(cycles, n, i - 1, j + 1)
        widths = [bandwidth] * 2 if len(bandwidth) == 1 else _of_steps(bandwidth, n, 2, i, j)
        kappa, q = np.empty((2, j - i)), np.empty((2, j - i))
        for row in range(2):
            oscillator(around[row], widths[row], kappa[row], q[row])
        states.forward_two(front, back, level, q, kappa, gains, s, g)

    return forward, states.backward_two


def _single_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, q: FloatArray, p: int
) -> tuple[Forward, Backward]:
    """Return how a block of the second generation, without mirror image, is filtered and smoothed."""
    n = len(y)
    filtered = {1: states.forward_one, 2: states.forward_two, 3: states.forward_three}[p]
    smoothed = {1: states.backward_one, 2: states.backward_two, 3: states.backward_three}[p]
    still = [np.zeros((2, BLOCK_SAMPLES))] if p == 2 else []  # κ

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level = _levels(active, n, i, j)
        signal, cosine, sine = _signal_and_phasor(y, cycles, level, i, j)
        demodulate(signal[0], cosine[0], sine[0], front)
        demodulate(signal[1], cosine[1], sine[1], back)
        filtered(front, back, level, _of_steps(q, n, p, i, j), *still, gains, s, g)

    return forward, smoothed


def _pair_steps(
    y: FloatArray, cycles: FloatArray, active: BoolArray | None, q: FloatArray, p: int
) -> tuple[Forward, Backward]:
    """Return how a block of the second generation, with mirror image, is filtered and smoothed."""
    n = len(y)
    filtered = {1: pairs.forward_pair_one, 2: pairs.forward_pair_two, 3: pairs.forward_pair_three}[p]
    smoothed = {1: pairs.backward_pair_one, 2: pairs.backward_pair_two, 3: pairs.backward_pair_three}[p]

    def forward(i: int, j: int, front: Array, back: Array, gains: FloatArray, s: FloatArray, g: Array) -> None:
        level = _levels(active, n, i, j)
        data = _signal_and_phasor(y, cycles, level, i, j)
        data[1:] *= level
        filtered(front, back, data, _of_steps(q, n, p, i, j), gains, s, g)

    return forward, smoothed


def _levels(active: BoolArray | None, n: int, i: int, j: int) -> FloatArray:
    """Return 1 where samples are data, 0 where not, (2, j - i)."""
    level = np.ones((2, j - i)) if active is None else _of_samples(active, n, i, j)
    if i == 0 and n % 2:
        level[1, 0] = 0.0
    return level


def _signal_and_phasor(y: FloatArray, cycles: FloatArray, level: FloatArray, i: int, j: int) -> FloatArray:
    """Return signal (zero where it is no data), cosine and sine, each folded, (3, 2, j - i)."""
    n = len(y)
    out = np.empty((3, 2, j - i))
    np.multiply(_of_samples(y, n, i, j), level, out=out[0])
    cosine_and_sine(_of_samples(cycles, n, i, j).reshape(-1), out[1].reshape(-1), out[2].reshape(-1))
    return out


def _of_samples(values: Array, n: int, i: int, j: int) -> FloatArray:
    """Return the values at a block's samples, (2, j - i)."""
    out = np.empty((2, j - i))
    fold(values, i, n + n % 2 - 1 - i, out)
    return out


def _of_steps(values: FloatArray, n: int, p: int, i: int, j: int) -> FloatArray:
    """Return the values of the structural equation's rows, (n - p,) or (1,), that a block's steps belong to.

    With one pole, the first half leaves the step across the middle to the second: there, q is 0.
    """
    out = np.empty((2, j - i))
    fold(values, i + 1 - p, n + n % 2 - 2 - i, out)
    if p == 1 and j == -(-n // 2):
        out[0, -1] = 0.0
    return out
