"""Analytic wavelets, defined by their response relative to a line's frequency, and a filter bank of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, rfft

from gearsig.checks import ComplexArray, FloatArray, count, frozen_array, instance_of, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.timefreq._types import Edges, Spacing, UniformSignal, segment_of

TAIL = 1e-6
"""Share of the peak below which a wavelet is treated as zero, in time and in frequency."""


@dataclass(frozen=True)
class Morse:
    """Generalised Morse wavelet.

    Ψ(v) = 2 exp(β ln v - (β/γ)(v^γ - 1)) for v > 0, with v the frequency relative to the line's; zero for v < 0.

    Parameters
    ----------
    beta : float
        1 to 1000; with γ it sets the number of periods in the wavelet, √(βγ)/π.
    gamma : float
        1 to 10; the wavelet is most symmetric at 3.

    Notes
    -----
    With the factor 2, a unit sine reads 1 on its line.

    Source: J. M. Lilly, S. C. Olhede, *Generalized Morse wavelets as a superfamily of analytic wavelets*, IEEE
    Transactions on Signal Processing 60 (2012).
    """

    beta: float = 20.0
    gamma: float = 3.0

    def __post_init__(self) -> None:
        within(self.beta, "beta", 1.0, 1000.0)
        within(self.gamma, "gamma", 1.0, 10.0)

    @property
    def duration(self) -> float:
        """P = √(βγ): P/π periods lie in the central window."""
        return float(np.sqrt(self.beta * self.gamma))

    @property
    def name(self) -> str:
        """Kind and parameters."""
        return f"Morse wavelet, β {self.beta:g}, γ {self.gamma:g}"

    def response(self, v: FloatArray) -> FloatArray:
        """Ψ(v)."""
        v = np.asarray(v, dtype=np.float64)
        safe = np.where(v > 0, v, 1.0)
        value = 2.0 * np.exp(self.beta * np.log(safe) - self.beta / self.gamma * (safe**self.gamma - 1.0))
        return np.where(v > 0, value, 0.0)


@dataclass(frozen=True)
class Morlet:
    """Analytic Morlet wavelet: a Gaussian in frequency.

    Ψ(v) = 2 exp(-ω₀² (v - 1)² / 2) for v > 0.

    Parameters
    ----------
    omega0 : float
        5 to 100; below 5, the Gaussian would extend to negative frequencies.

    Notes
    -----
    The complex Morlet with bandwidth B and centre C (cycles) has ω₀ = 2πC √(B/2).

    Source: S. Mallat, *A Wavelet Tour of Signal Processing*, 3rd ed. (2009), section 4.3.
    """

    omega0: float = 6.0

    def __post_init__(self) -> None:
        within(self.omega0, "omega0", 5.0, 100.0)

    @property
    def duration(self) -> float:
        """P = ω₀: P/π periods lie in the central window."""
        return float(self.omega0)

    @property
    def name(self) -> str:
        """Kind and parameter."""
        return f"Morlet wavelet, ω₀ {self.omega0:g}"

    def response(self, v: FloatArray) -> FloatArray:
        """Ψ(v)."""
        v = np.asarray(v, dtype=np.float64)
        return np.where(v > 0, 2.0 * np.exp(-0.5 * (self.omega0 * (v - 1.0)) ** 2), 0.0)


Wavelet = Morse | Morlet
DEFAULT = Morse()


@lru_cache(maxsize=64)
def band(wavelet: Wavelet, share: float = TAIL) -> tuple[float, float]:
    """Return the lowest and highest v at which the response exceeds `share` of its peak."""
    positive(share, "share")
    v = np.geomspace(1e-4, 1e3, 400_001)
    inside = v[wavelet.response(v) > 2.0 * share]
    return float(inside[0]), float(inside[-1])


@lru_cache(maxsize=64)
def half_support(wavelet: Wavelet) -> float:
    """Return the distance from a wavelet's centre, in periods of its line, at which it falls below `TAIL`."""
    step = 1.0 / (32.0 * wavelet.duration + 64.0)
    v = np.arange(0.0, band(wavelet)[1], step)
    shape = np.abs(np.fft.ifft(wavelet.response(v), 1 << int(np.ceil(np.log2(len(v))) + 2)))
    n = len(shape)
    half = shape[: n // 2]
    last = int(np.flatnonzero(half > TAIL * half[0])[-1])
    return (last + 1) / (n * step)


@lru_cache(maxsize=64)
def admissibility(wavelet: Wavelet) -> float:
    """Return C = ∫ Ψ(v)/v dv, the gain of the sum over lines at equal steps of ln v."""
    low, high = band(wavelet, 1e-16)
    s = np.linspace(np.log(low), np.log(high), 20_001)
    return float(np.trapezoid(wavelet.response(np.exp(s)), s))


def footprint_periods(wavelet: Wavelet) -> float:
    """Return the number of periods that hold most of a wavelet's energy, 2√2 P / 2π.

    Source: J. M. Lilly, *Element analysis: a wavelet-based method for analysing time-localized events in noisy time
    series*, Proceedings of the Royal Society A 473 (2017).
    """
    return float(np.sqrt(2.0) * wavelet.duration / np.pi)


def lowest_analysable(signal: UniformSignal, wavelet: Wavelet) -> float:
    """Return the frequency or order whose wavelet just fits into the signal."""
    return footprint_periods(wavelet) / signal.length


def lines_of(
    x: UniformSignal,
    wavelet: Wavelet,
    positions: FloatArray | None,
    lowest: float | None,
    highest: float | None,
    n_per_octave: int,
) -> tuple[FloatArray, Spacing]:
    """Return the given lines, or lines at equal ratios 2^(1/n_per_octave) down from `highest`, and their spacing.

    Parameters
    ----------
    x : UniformSignal
    wavelet : Wavelet
    positions : array or None
        The lines themselves; then `lowest` and `highest` are None.
    lowest, highest : float or None
        In Hz or orders. None for `highest`: where the wavelet's response falls to a hundredth at the highest valid
        frequency; for `lowest`: ten octaves below, or twice the lowest possible line.
    n_per_octave : int

    Raises
    ------
    InputError
        If they are not positive, in the wrong order, or beyond the highest valid frequency.
    RefusalError
        If the signal is too short for the lowest line.
    """
    instance_of(wavelet, Wavelet, "wavelet", remedy="e.g. gearsig.timefreq.Morse()")
    fits, unit = lowest_analysable(x, wavelet), x.position_unit
    if positions is None:
        count(n_per_octave, "n_per_octave")
        top = x.highest_valid / band(wavelet, 0.01)[1] if highest is None else positive(highest, "highest")
        low = min(max(top / 2**10, 2.0 * fits), top) if lowest is None else positive(lowest, "lowest")
    else:
        if lowest is not None or highest is not None:
            raise InputError("both positions and a range are given", where="positions", remedy="give one of them")
        lines = frozen_array(positions, "positions", ndim=1)
        if len(lines) == 0 or lines[0] <= 0 or np.any(np.diff(lines) <= 0):
            raise InputError("positions are not positive and increasing", allowed="at least one, each above the last")
        low, top = float(lines[0]), float(lines[-1])
    if top > x.highest_valid * (1 + 1e-9):
        raise InputError(
            f"the highest line is {top:g} {unit}",
            where="highest",
            allowed=f"at most {x.highest_valid:g} {unit}",
            remedy="lower it, or sample faster",
        )
    if low > top:
        raise InputError(f"lowest is {low:g}, highest is {top:g} {unit}", allowed="lowest < highest")
    if low < fits * (1 - 1e-9):
        raise RefusalError(
            f"the signal of {x.length:.4g} {x.length_unit} is shorter than the wavelet at {low:.4g} {unit}, which "
            f"lasts {footprint_periods(wavelet) / low:.4g} {x.length_unit}",
            remedy=f"set lowest to {fits:.4g} {unit} or more, take a shorter wavelet, or record longer",
        )
    if positions is not None:
        even = len(lines) < 3 or bool(np.ptp(np.diff(lines)) < 1e-6 * (lines[1] - lines[0]))
        return lines, "linear" if even else "logarithmic"
    n = int(np.floor(n_per_octave * np.log2(top / low) * (1 + 1e-12))) + 1
    return top * 2.0 ** (np.arange(1 - n, 1) / n_per_octave), "logarithmic"


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def fill(X, H, low, high, twiddle, first, out):  # type: ignore[no-untyped-def]
    """out[j, k mod M, r] = X[k] H[j, k] twiddle[k, r]: the bins of line j, ready for M-point inverse FFTs over k.

    Bin k of the block has index k - `first` in X, H and twiddle. Bins of line j run from low[j] to high[j] (excluded).
    If they are fewer than M, the others are zero; if they are more, they add up: samples are then sparser than the band
    requires, but still exact.
    """
    M, n_r = out.shape[1], out.shape[2]
    for j in range(out.shape[0]):
        for k in range(high[j], low[j] + M):
            for r in range(n_r):
                out[j, k % M, r] = 0.0
        for k in range(low[j], high[j]):
            i, place = k - first, k % M
            value = X[i] * H[j, i]
            if k >= low[j] + M:
                for r in range(n_r):
                    out[j, place, r] += value * twiddle[i, r]
                continue
            for r in range(n_r):  # the compiler vectorises this loop only with explicit indices
                out[j, place, r] = value * twiddle[i, r]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def turns(first, n_bins, n_r, step, n_block):  # type: ignore[no-untyped-def]
    """Return e^{2πi k r D / B} for bins k from `first` on and r < n_r, with D = step and B = n_block."""
    out = np.empty((n_bins, n_r), dtype=np.complex64)
    for i in range(n_bins):
        angle = 2.0 * np.pi * (((first + i) * step) % n_block) / n_block
        turn, value = complex(np.cos(angle), np.sin(angle)), complex(1.0, 0.0)
        for r in range(n_r):
            out[i, r] = value
            value *= turn
    return out


# Bank of analytic filters: coefficients of many lines, block by block, at any decimation.
#
# Each line needs few bins of a block's spectrum. With B = M R samples in a block and at most M bins, sample
# n = R m + r is an M-point inverse FFT over m of the bins times e^{2πi k r / B}: R short transforms that stay in the
# cache replace a long one, and only those for the requested samples are computed. Blocks overlap by the wavelet's
# support, so that memory depends on the longest wavelet, not on the length of the signal.


IntArray = NDArray[np.int64]

_SMALLEST_BLOCK = 1 << 13
_CUT_MARGIN = 512  # samples: wavelets cut off at half the sampling rate ring longer
_CACHE_SAMPLES = 1 << 15  # coefficients processed at a time: they stay in a core's own cache


@dataclass(frozen=True)
class Batch:
    """Lines of a group whose transforms have the same length."""

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
class LineGroup:
    """Lines that share blocks of `n_block` samples, of which `n_margin` at either end are not valid."""

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
    """Coefficients of some lines at samples start, start + step, …, with their derivatives if requested."""

    lines: IntArray
    start: int
    step: int
    values: ComplexArray
    derivatives: ComplexArray


def plan_groups(
    cycles: FloatArray, wavelet: Wavelet, n_samples: int, *, step: int = 1, follow_band: bool = False
) -> list[LineGroup]:
    """Group lines by octave.

    Parameters
    ----------
    cycles : array, (n_lines,)
        Line frequencies in cycles per sample, increasing.
    wavelet : Morse or Morlet
    n_samples : int
        Of the signal.
    step : int
        Samples between coefficients; a power of two.
    follow_band : bool
        Whether each line has its own step, as large as its bandwidth allows, up to `step`.
    """
    octave = np.floor(np.log2(cycles[-1] / cycles) + 1e-9).astype(np.int64)
    return [
        plan_group(np.flatnonzero(octave == o), cycles, wavelet, n_samples, step=step, follow_band=follow_band)
        for o in np.unique(octave)
    ]


def plan_group(
    lines: IntArray, cycles: FloatArray, wavelet: Wavelet, n_samples: int, *, step: int = 1, follow_band: bool = False
) -> LineGroup:
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
        block_step = min(step, max(1, n_block // int(size) // 2)) if follow_band else step
        batches.append(
            _batch(lines[chosen], cycles, wavelet, n_block, int(size), block_step, low[chosen], high[chosen])
        )
    return LineGroup(tuple(batches), n_block, margin)


def pieces(values: FloatArray, group: LineGroup, edges: Edges, *, derivatives: bool = False) -> Iterator[Piece]:
    """Yield the coefficients of a group, block by block."""
    space = workspace(group)
    for start in group.starts(len(values)):
        yield from block_pieces(values, group, start, edges, space, derivatives=derivatives)


def sampled_pieces(
    x: UniformSignal, positions: FloatArray, wavelet: Wavelet, step: int, edges: Edges, *, derivatives: bool = False
) -> Iterator[tuple[Piece, int, ComplexArray, ComplexArray]]:
    """Yield pieces at every `step`-th sample: piece, first column, coefficients and derivatives there.

    They are computed at a step that is the largest power of two, up to 1024, that divides `step`.
    """
    every = min(step & -step, 1024)
    for group in plan_groups(positions / x.rate, wavelet, x.n_samples, step=every):
        for piece in pieces(x.values, group, edges, derivatives=derivatives):
            column = -(-piece.start // step)
            thin = slice((column * step - piece.start) // every, None, step // every)
            yield piece, column, piece.values[:, thin], piece.derivatives[:, thin]


def workspace(group: LineGroup) -> ComplexArray:
    """Return a buffer for the coefficients of a piece and their derivatives, to avoid repeated allocation."""
    n_columns = max(_rows_at_once(batch, group) * group.n_block // batch.step for batch in group.batches)
    return np.empty((2, n_columns), dtype=np.complex64)


def _rows_at_once(batch: Batch, group: LineGroup) -> int:
    return min(len(batch.lines), max(1, _CACHE_SAMPLES * batch.step // group.n_block))


def block_pieces(
    values: FloatArray, group: LineGroup, start: int, edges: Edges, space: ComplexArray, *, derivatives: bool = False
) -> Iterator[Piece]:
    """Yield the coefficients of a group in the block whose valid part begins at `start`.

    They are stored in `space` (from `workspace`) and valid until the next piece is requested.
    """
    margin, length = group.n_margin, min(group.n_core, len(values) - start)
    # In double precision: rounding in strong parts of the spectrum must not reach the weak ones.
    spectrum = rfft(segment_of(values, start - margin, group.n_block, edges))
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
    """Return the smallest power of two not below n."""
    return 1 << max(0, int(n - 1).bit_length())
