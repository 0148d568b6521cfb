"""Synchrosqueezed wavelet transform over time or shaft angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray, one_of
from gearsig.timefreq._cwt import edge_of, largest_power_of_two_in, n_reach
from gearsig.timefreq._ssqueezepy import SqueezeEngine, cwt_by_ssqueezepy, is_ssqueezepy, stft_by_ssqueezepy
from gearsig.timefreq._stft import FramePlan, prepared, spectra
from gearsig.timefreq._types import Coefficients, ComplexArray, Reduction, Spacing, TimeFrequencyMap
from gearsig.timefreq._uniform import (
    EDGES,
    ColumnPowers,
    Edges,
    Form,
    Source,
    UniformSignal,
    plan_columns,
    room_for,
    uniform,
)
from gearsig.timefreq._wavelets import (
    DEFAULT,
    Wavelet,
    admissibility,
    band,
    block_pieces,
    logarithmic_lines,
    lowest_possible,
    pieces,
    plan_group,
    plan_groups,
    workspace,
)

# --------------------
# Borders between the lines of a squeezed transform, and where to look a frequency up.
# --------------------


_N_CELLS = 4096


@dataclass(frozen=True)
class SqueezeLines:
    """Borders of the lines in radians per sample, (n_lines + 1,), and the line at the left end of equal cells."""

    borders: FloatArray
    lookup: NDArray[np.int64]


def squeeze_lines(lines: FloatArray, rate: float, spacing: Spacing) -> SqueezeLines:
    """Return borders half-way between the lines, on the logarithm where they are spaced on it."""
    logarithmic = spacing == "logarithmic"
    places = np.log(lines) if logarithmic else np.asarray(lines)
    half = np.diff(places) / 2 if len(places) > 1 else np.array([0.5 if not logarithmic else 0.02])
    borders = np.concatenate([[places[0] - half[0]], places[:-1] + half[: len(places) - 1], [places[-1] + half[-1]]])
    borders = (np.exp(borders) if logarithmic else borders) * (2 * np.pi / rate)
    return SqueezeLines(borders, _lookup(borders))


def _lookup(borders: FloatArray) -> NDArray[np.int64]:
    # One cell more than used: the highest frequency may round into it.
    cells = borders[0] + np.arange(_N_CELLS + 1) * (borders[-1] - borders[0]) / (_N_CELLS + 1)
    found = np.searchsorted(borders, cells, side="right") - 1
    result: NDArray[np.int64] = np.clip(found, 0, len(borders) - 2).astype(np.int64)
    return result


MIN_SHARE = 1e-6
"""Coefficients below this share of the signal's rms are rounding: they have no frequency."""
_GUARD = 1e-3  # response at which a wavelet no longer adds to a line


@dataclass(frozen=True)
class SqueezingWavelets:
    """Wavelets of a squeezed transform: they reach beyond its lines, so that the outermost ones are complete.

    Parameters
    ----------
    lines : array, (n_lines,)
        In Hz or orders.
    analysed : array, (n_analysed,)
        The wavelets' own frequencies or orders.
    weight : float
        2 Δ(ln f) / C: the sum over the wavelets is the analytic signal.
    smallest : float
        Power below which a coefficient is rounding.
    """

    lines: FloatArray
    analysed: FloatArray
    weight: float
    smallest: float


def squeezed_cwt(
    signal: Source,
    channel: str | float | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 32,
    step: int = 1,
    edges: Edges = "reflect",
    engine: SqueezeEngine = "gearsig",
) -> Coefficients:
    """Return the wavelet coefficients moved to their momentary frequency, at every `step`-th sample.

    T(f_l, t) = (2 Δ ln f / C) Σ_j W(f_j, t) over the j with f̂(f_j, t) in line l, f̂ = Im(∂W/∂t / W) / 2π: a unit
    sine reads 1 in one line, and the sum over all lines is the analytic signal between `lowest` and `highest`.

    Parameters
    ----------
    signal, channel, wavelet, lowest, highest, step, edges
        As in `cwt`.
    n_per_octave : int
        Lines, and wavelets, per octave.
    engine : str
        "gearsig", or "ssqueezepy" for comparison: single precision, the whole matrix at once in memory, each
        frequency on the line that is nearest on the logarithm.

    Returns
    -------
    Coefficients
        complex64.

    Raises
    ------
    InputError, RefusalError
        As in `cwt`.

    Notes
    -----
    Sharp only for components that the wavelet separates and whose frequency changes little within it; over angle,
    orders stay put where frequencies sweep. Use a longer wavelet (larger β) for close components.

    Source: I. Daubechies, J. Lu, H.-T. Wu, *Synchrosqueezed wavelet transforms: an empirical mode decomposition-like
    tool*, Applied and Computational Harmonic Analysis 30 (2011).
    """
    x, plan, form = _prepared(signal, channel, wavelet, lowest, highest, n_per_octave, edges, engine)
    T = room_for(len(plan.lines), x, step)
    if is_ssqueezepy(engine):
        T[:] = cwt_by_ssqueezepy(x, plan.lines, plan.analysed, MIN_SHARE, wavelet, edges)[:, ::step]
    else:
        _fill(T, x, plan, wavelet, step, edges)
    return form.coefficients(T, x, step, np.ones(len(plan.lines)))


def squeezed_cwt_map(
    signal: Source,
    channel: str | float | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 32,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
    edges: Edges = "reflect",
    engine: SqueezeEngine = "gearsig",
) -> TimeFrequencyMap:
    """Return levels of the synchrosqueezed wavelet transform in stretches, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, wavelet, lowest, highest, n_per_octave, edges, engine
        As in `squeezed_cwt`.
    n_columns, reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap
        A line is read as often as the bandwidth of the wavelets that add to it asks.

    Raises
    ------
    InputError, RefusalError
        As in `squeezed_cwt`.
    """
    x, plan, form = _prepared(signal, channel, wavelet, lowest, highest, n_per_octave, edges, engine)
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, len(plan.lines), reduction)
    if is_ssqueezepy(engine):
        T = cwt_by_ssqueezepy(x, plan.lines, plan.analysed, MIN_SHARE, wavelet, edges)
        powers.add(np.arange(len(plan.lines)), 0, 1, T)
        return powers.finished(x, form, scaling)
    octave = np.floor(np.log2(plan.lines[-1] / plan.lines) + 1e-9)
    for o in np.unique(octave):
        part = np.flatnonzero(octave == o)
        for start, step, T in _blocks(x, plan, wavelet, part, columns.largest_step, edges):
            powers.add(part, start, step, T)
    return powers.finished(x, form, scaling)


def _prepared(
    signal: Source,
    channel: str | float | None,
    wavelet: Wavelet,
    lowest: float | None,
    highest: float | None,
    n_per_octave: int,
    edges: Edges,
    engine: SqueezeEngine,
) -> tuple[UniformSignal, SqueezingWavelets, Form]:
    """Check what both functions are given, and lay lines and wavelets."""
    x = uniform(signal, channel)
    plan = analysis(x, wavelet, lowest, highest, n_per_octave)
    one_of(edges, "edges", EDGES)
    by = " by ssqueezepy" if is_ssqueezepy(engine) else ""
    lines, method = plan.lines, f"synchrosqueezed CWT{by}, {wavelet.name}"
    form = Form(lines, "logarithmic", method, edge_of(lines, wavelet), n_reach(lines, wavelet), squeezed=True)
    return x, plan, form


def analysis(
    x: UniformSignal, wavelet: Wavelet, lowest: float | None, highest: float | None, n_per_octave: int
) -> SqueezingWavelets:
    """Return lines, and wavelets that reach as far beyond them as they answer to them."""
    lines = logarithmic_lines(x, wavelet, lowest, highest, n_per_octave)
    v_low, v_high = band(wavelet, _GUARD)
    n_below, n_above = (int(np.ceil(n_per_octave * np.log2(r))) for r in (v_high, 1 / v_low))
    k = np.arange(1 - len(lines) - n_below, n_above + 1)
    analysed = lines[-1] * 2.0 ** (k / n_per_octave)
    inside = (analysed >= min(lines[0], lowest_possible(x, wavelet))) & (analysed <= max(lines[-1], x.rate / 2))
    weight = 2.0 * np.log(2.0) / n_per_octave / admissibility(wavelet)
    mean_square = float(np.dot(x.values, x.values)) / x.n_samples
    return SqueezingWavelets(lines, analysed[inside], weight, MIN_SHARE**2 * mean_square)


def _fill(
    T: ComplexArray, x: UniformSignal, plan: SqueezingWavelets, wavelet: Wavelet, step: int, edges: Edges
) -> None:

    table = squeeze_lines(plan.lines, x.rate, "logarithmic")
    weights = np.full(len(plan.analysed), plan.weight, dtype=np.float32)
    own = largest_power_of_two_in(step)
    for group in plan_groups(plan.analysed / x.rate, wavelet, x.n_samples, step=own):
        for piece in pieces(x.values, group, edges, derivatives=True):
            column = -(-piece.start // step)
            thin = slice((column * step - piece.start) // own, None, step // own)
            W, dW = piece.values[:, thin], piece.derivatives[:, thin]
            squeeze(W, dW, weights, plan.smallest, table.borders, table.lookup, T, column)


def _blocks(
    x: UniformSignal, plan: SqueezingWavelets, wavelet: Wavelet, part: np.ndarray, largest_step: int, edges: Edges
) -> Iterator[tuple[int, int, ComplexArray]]:
    """Yield start, step and T of some neighbouring lines, block after block."""
    lines = plan.lines[part]
    table: SqueezeLines = squeeze_lines(lines, x.rate, "logarithmic")
    v_low, v_high = band(wavelet, _GUARD)
    chosen = np.flatnonzero((plan.analysed > lines[0] / v_high / 1.02) & (plan.analysed < lines[-1] / v_low * 1.02))
    cycles = plan.analysed / x.rate
    step = _step(cycles[chosen[-1]] * (v_high - v_low), largest_step)
    group = plan_group(chosen, cycles, wavelet, x.n_samples, step=step)
    weights = np.full(len(chosen), plan.weight, dtype=np.float32)
    space = workspace(group)
    for start in group.starts(x.n_samples):
        length = -(-min(group.n_core, x.n_samples - start) // step)
        T = np.zeros((len(part), length), dtype=np.complex64)
        for piece in block_pieces(x.values, group, start, edges, space, derivatives=True):
            squeeze(piece.values, piece.derivatives, weights, plan.smallest, table.borders, table.lookup, T, 0)
        yield start, step, T


def _step(width: float, largest: int) -> int:
    """Return the largest power of two that reads a band of `width` cycles per sample twice as often as it must."""
    return int(min(largest, 1 << max(0, int(np.floor(np.log2(0.5 / width))))))


# --------------------
# Synchrosqueezed short-time Fourier transform over time or shaft angle.
# --------------------


def squeezed_stft(
    signal: Source,
    channel: str | float | None = None,
    *,
    window: str = "gaussian",
    window_length: float | None = None,
    zero_padding: int = 2,
    lowest: float | None = None,
    highest: float | None = None,
    step: int = 1,
    edges: Edges = "reflect",
    engine: SqueezeEngine = "gearsig",
) -> Coefficients:
    """Return the short-time spectra moved to their momentary frequency, at every `step`-th sample.

    f̂ = f - Im(V_g' / V_g) / 2π, with g' the window's derivative; T(f_l, t) is the weighted sum of V over the lines
    whose f̂ lies in line l. A unit sine reads 1 in one line, and the sum over the lines is the analytic signal.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, step, edges
        As in `stft`.
    engine : str
        As in `squeezed_cwt`.

    Returns
    -------
    Coefficients
        complex64.

    Raises
    ------
    InputError, RefusalError
        As in `stft`.

    Notes
    -----
    Sharp only for components whose frequency changes little within the window: take the angle signal of a sweep.

    Source: G. Thakur, H.-T. Wu, *Synchrosqueezing-based recovery of instantaneous frequency from nonuniform samples*,
    SIAM Journal on Mathematical Analysis 43 (2011).
    """
    by = " by ssqueezepy" if is_ssqueezepy(engine) else ""
    x, plan, form = prepared(
        signal, channel, window, window_length, zero_padding, lowest, highest, edges, squeezed_by=by
    )
    T = room_for(plan.n_lines, x, step)
    for frame, part in _squeezed(x, plan, step, edges, engine):
        T[:, frame : frame + part.shape[1]] = part
    return form.coefficients(T, x, step, np.ones(plan.n_lines))


def squeezed_stft_map(
    signal: Source,
    channel: str | float | None = None,
    *,
    window: str = "gaussian",
    window_length: float | None = None,
    zero_padding: int = 2,
    lowest: float | None = None,
    highest: float | None = None,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
    edges: Edges = "reflect",
    engine: SqueezeEngine = "gearsig",
) -> TimeFrequencyMap:
    """Return levels of the synchrosqueezed short-time Fourier transform, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, edges, engine
        As in `squeezed_stft`.
    n_columns, reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap

    Raises
    ------
    InputError, RefusalError
        As in `stft`.
    """
    by = " by ssqueezepy" if is_ssqueezepy(engine) else ""
    x, plan, form = prepared(
        signal, channel, window, window_length, zero_padding, lowest, highest, edges, squeezed_by=by
    )
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, plan.n_lines, reduction)
    step = max(1, min(columns.n_per_column, plan.n_window // 16))
    everything = np.arange(plan.n_lines)
    for frame, part in _squeezed(x, plan, step, edges, engine):
        powers.add(everything, frame * step, step, part)
    return powers.finished(x, form, scaling)


def _squeezed(
    x: UniformSignal, plan: FramePlan, step: int, edges: Edges, engine: SqueezeEngine
) -> Iterator[tuple[int, ComplexArray]]:
    """Yield (first frame, T) in batches; ssqueezepy knows one batch only."""
    if is_ssqueezepy(engine):
        yield 0, stft_by_ssqueezepy(x, plan, step, MIN_SHARE, edges)
        return
    lines = plan.lines(x.rate)
    table = squeeze_lines(lines, x.rate, "linear")
    omega = 2 * np.pi / x.rate * lines
    weights = np.full(len(lines), plan.weight, dtype=np.float32)
    smallest = MIN_SHARE**2 * float(np.dot(x.values, x.values)) / x.n_samples
    for frame, V, slopes in spectra(x, plan, step, edges, slopes=True):
        # With the frame's middle as origin of the phase, ∂V/∂t = -V_g' + iω V: the same rule as for wavelets.
        scaled = (V * plan.gains).T.astype(np.complex64)
        rates = ((1j * omega * V - slopes) * plan.gains).T.astype(np.complex64)
        T = np.zeros(scaled.shape, dtype=np.complex64)
        squeeze(scaled, rates, weights, smallest, table.borders, table.lookup, T, 0)
        yield frame, T


# --------------------
# Compiled reassignment of coefficients to their momentary frequency; no state, the interpreter is released.
# --------------------


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def squeeze(W, dW, weights, smallest, borders, lookup, T, first):  # type: ignore[no-untyped-def]
    """T[l, first + t] += weights[j] W[j, t], l being the line whose borders hold the momentary frequency.

    ω̂ = Im(W' / W), in the unit of `borders` (n_lines + 1, increasing). `lookup` gives the line at the left end of each
    of its equal cells between the outermost borders. Coefficients with |W|² <= `smallest` have no frequency.
    """
    n_lines = T.shape[0]
    bottom, top = borders[0], borders[n_lines]
    per_cell = lookup.shape[0] / (top - bottom)
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            a, b = W[j, t].real, W[j, t].imag
            power = a * a + b * b
            if power <= smallest:
                continue
            omega = (dW[j, t].imag * a - dW[j, t].real * b) / power
            if omega < bottom or omega >= top:
                continue
            line = lookup[int((omega - bottom) * per_cell)]
            while omega >= borders[line + 1]:
                line += 1
            T[line, first + t] += weights[j] * W[j, t]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def gather_near(W, dW, weight, smallest, low, high, out):  # type: ignore[no-untyped-def]
    """out[t] += weight · W[j, t] wherever low[t] <= ω̂ <= high[t]."""
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            a, b = W[j, t].real, W[j, t].imag
            power = a * a + b * b
            if power <= smallest:
                continue
            omega = (dW[j, t].imag * a - dW[j, t].real * b) / power
            if low[t] <= omega <= high[t]:
                out[t] += weight * W[j, t]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def gather_lines(W, omegas, weight, low, high, out):  # type: ignore[no-untyped-def]
    """out[t] += weight · W[j, t] wherever low[t] <= omegas[j] <= high[t]."""
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            if low[t] <= omegas[j] <= high[t]:
                out[t] += weight * W[j, t]
