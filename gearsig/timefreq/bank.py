"""Bank of analytic filters: coefficients of many lines, block by block, at any decimation.

Each line needs few bins of a block's spectrum. With B = M R samples in a block and at most M bins, sample
n = R m + r is an M-point inverse FFT over m of the bins turned by e^{2πi k r / B}: R short transforms that stay in the
cache instead of a long one, and only as many of them as samples are wanted. Blocks overlap by the wavelet's support, so
that memory depends on the longest wavelet and not on the length of the signal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, rfft

from gearsig.checks import FloatArray
from gearsig.timefreq.bank_kernel import fill, turns
from gearsig.timefreq.ends import Edges, stretch
from gearsig.timefreq.types import ComplexArray
from gearsig.timefreq.wavelets import Wavelet, band, half_support

IntArray = NDArray[np.int64]

_SMALLEST_BLOCK = 1 << 13
_CUT_MARGIN = 512  # samples: wavelets that are cut off at half the sampling rate ring longer
_CACHE_SAMPLES = 1 << 15  # coefficients that are worked on at a time: they stay in a core's own cache


@dataclass(frozen=True)
class Batch:
    """Lines of a group that share the length of their transforms."""

    lines: IntArray
    n_bins: int
    step: int
    low: IntArray
    high: IntArray
    first: int
    response: NDArray[np.float32]
    omega: NDArray[np.float32]
    twiddle: ComplexArray


@dataclass(frozen=True)
class Group:
    """Lines that share blocks: `n_block` samples, of which `n_margin` at either end are not valid."""

    batches: tuple[Batch, ...]
    n_block: int
    n_margin: int

    @property
    def n_core(self) -> int:
        """Valid samples per block."""
        return self.n_block - 2 * self.n_margin

    def starts(self, n_samples: int) -> range:
        """First sample of each block's valid part."""
        return range(0, n_samples, self.n_core)


@dataclass(frozen=True)
class Piece:
    """Coefficients of some lines at samples start, start + step, …; with their derivatives where asked."""

    lines: IntArray
    start: int
    step: int
    values: ComplexArray
    derivatives: ComplexArray


def plan_groups(
    cycles: FloatArray, wavelet: Wavelet, n_samples: int, *, step: int = 1, follow_band: bool = False
) -> list[Group]:
    """Group lines by octave.

    Parameters
    ----------
    cycles : array, (n_lines,)
        Line frequencies in cycles per sample, increasing.
    step : int
        Samples between coefficients; a power of two.
    follow_band : bool
        Let each line have its own step, as large as its bandwidth allows, up to `step`.
    """
    octave = np.floor(np.log2(cycles[-1] / cycles) + 1e-9).astype(np.int64)
    return [
        plan_group(np.flatnonzero(octave == o), cycles, wavelet, n_samples, step=step, follow_band=follow_band)
        for o in np.unique(octave)
    ]


def plan_group(
    lines: IntArray, cycles: FloatArray, wavelet: Wavelet, n_samples: int, *, step: int = 1, follow_band: bool = False
) -> Group:
    """Plan one group of lines with common blocks; see `plan_groups`."""
    v_low, v_high = band(wavelet)
    support = int(np.ceil(half_support(wavelet) / float(cycles[lines[0]])))
    step = min(step, _power_of_two(support)) if follow_band else step
    if v_high * float(cycles[lines[-1]]) > 0.5:
        support = max(support, _CUT_MARGIN)
    margin = -(-support // step) * step
    n_block = _power_of_two(min(max(8 * margin, _SMALLEST_BLOCK), n_samples + 2 * margin))
    n_block = max(n_block, _power_of_two(4 * step))
    low = np.maximum(np.ceil(cycles[lines] * v_low * n_block), 1).astype(np.int64)
    high = np.minimum(np.floor(cycles[lines] * v_high * n_block) + 1, n_block // 2).astype(np.int64)
    low = np.minimum(low, high - 1)
    n_bins = np.array([_power_of_two(int(w)) for w in high - low])
    batches = []
    for size in np.unique(n_bins):
        chosen = n_bins == size
        own = min(step, max(1, n_block // int(size) // 2)) if follow_band else step
        batches.append(_batch(lines[chosen], cycles, wavelet, n_block, int(size), own, low[chosen], high[chosen]))
    return Group(tuple(batches), n_block, margin)


def pieces(values: FloatArray, group: Group, edges: Edges, *, derivatives: bool = False) -> Iterator[Piece]:
    """Yield the coefficients of a group, block after block."""
    space = workspace(group)
    for start in group.starts(len(values)):
        yield from block_pieces(values, group, start, edges, space, derivatives=derivatives)


def workspace(group: Group) -> ComplexArray:
    """Return room for the coefficients of a piece and their derivatives: asking for it each time costs more."""
    most = max(_rows_at_once(batch, group) * group.n_block // batch.step for batch in group.batches)
    return np.empty((2, most), dtype=np.complex64)


def _rows_at_once(batch: Batch, group: Group) -> int:
    return min(len(batch.lines), max(1, _CACHE_SAMPLES * batch.step // group.n_block))


def block_pieces(
    values: FloatArray, group: Group, start: int, edges: Edges, space: ComplexArray, *, derivatives: bool = False
) -> Iterator[Piece]:
    """Yield the coefficients of a group in the block whose valid part begins at `start`.

    They lie in `space` (from `workspace`) and hold until the next piece is asked for.
    """
    margin, length = group.n_margin, min(group.n_core, len(values) - start)
    # In double precision: rounding in strong parts of the spectrum must not reach the weak ones.
    spectrum = rfft(stretch(values, start - margin, group.n_block, edges))
    for batch in group.batches:
        X = spectrum[batch.first : batch.first + batch.response.shape[1]].astype(np.complex64)
        dX = (X * (1j * batch.omega)).astype(np.complex64) if derivatives else X[:0]
        cut = slice(margin // batch.step, margin // batch.step - (-length // batch.step))
        n_rows = _rows_at_once(batch, group)
        for row in range(0, len(batch.lines), n_rows):
            rows = slice(row, row + n_rows)
            W = _coefficients(X, batch, rows, space[0])[:, cut]
            dW = _coefficients(dX, batch, rows, space[1])[:, cut] if derivatives else W[:0]
            yield Piece(batch.lines[rows], start, batch.step, W, dW)


def _coefficients(X: ComplexArray, batch: Batch, rows: slice, space: ComplexArray) -> ComplexArray:
    low, high = batch.low[rows], batch.high[rows]
    shape = (len(low), batch.n_bins, batch.twiddle.shape[1])
    turned = space[: np.prod(shape)].reshape(shape)
    fill(X, batch.response[rows], low, high, batch.twiddle, batch.first, turned)
    result: ComplexArray = ifft(turned, axis=1, overwrite_x=True)
    return result.reshape(len(low), -1)


def _batch(
    lines: IntArray,
    cycles: FloatArray,
    wavelet: Wavelet,
    n_block: int,
    n_bins: int,
    step: int,
    low: IntArray,
    high: IntArray,
) -> Batch:
    n_bins = min(n_bins, n_block // step)
    first, k = int(low.min()), np.arange(int(low.min()), int(high.max()))
    response = wavelet.response((k / n_block)[None, :] / cycles[lines][:, None]) * (n_bins / n_block)
    twiddle = turns(first, len(k), n_block // n_bins // step, step, n_block)
    return Batch(
        lines,
        n_bins,
        step,
        low,
        high,
        first,
        response.astype(np.float32),
        (2 * np.pi / n_block * k).astype(np.float32),
        twiddle,
    )


def _power_of_two(n: int) -> int:
    """Smallest power of two not below n."""
    return 1 << max(0, int(n - 1).bit_length())
