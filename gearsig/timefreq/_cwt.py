"""Continuous wavelet transform over time or shaft angle, plain and synchrosqueezed, and its inverse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import ComplexArray, FloatArray, freeze, not_negative, one_of, within
from gearsig.errors import InputError
from gearsig.results import Result
from gearsig.timefreq._squeezing import (
    MIN_SHARE,
    SqueezeEngine,
    check_ssqueezepy_bytes,
    gather_lines,
    gather_near,
    is_ssqueezepy,
    squeeze,
    squeeze_lines,
    ssqueezepy,
    unit_rms,
)
from gearsig.timefreq._types import (
    Coefficients,
    Edges,
    LinePlan,
    Piece,
    Reduction,
    Ridge,
    Source,
    Spacing,
    TimeFrequencyMap,
    UniformSignal,
    plan_columns,
    uniform,
)
from gearsig.timefreq._wavelets import (
    DEFAULT,
    Wavelet,
    admissibility,
    band,
    block_pieces,
    half_support,
    lines_of,
    lowest_analysable,
    pieces,
    plan_group,
    plan_groups,
    sampled_pieces,
    workspace,
)

_GUARD = 1e-3  # response below which a wavelet does not contribute to a squeezed line


def cwt(
    signal: Source,
    channel: str | float | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    positions: FloatArray | None = None,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 16,
    step: int = 1,
    edges: Edges = "reflect",
) -> Coefficients:
    """Return the complex wavelet coefficients at every `step`-th sample.

    W(f, t) = (1/2π) ∫ X(ω) Ψ(ω / 2πf) e^{iωt} dω with max Ψ = 2, so that |W| of a unit sine is 1 on its line.

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Lines are frequencies for a signal over time, orders for one over angle.
    channel : str, float or None
        None: the only channel. For an array, its sampling rate in Hz.
    wavelet : Morse or Morlet
    positions : array or None
        Lines in Hz or orders; None: `lowest` to `highest` at `n_per_octave` per octave.
    lowest, highest : float or None
        In Hz or orders. None for `highest`: what the wavelet's response allows; for `lowest`: ten octaves below, or
        twice the lowest possible line.
    n_per_octave : int
        Lines per octave, if `positions` is None.
    step : int
        Samples between columns; the columns are exact, not averaged.
    edges : str
        Continuation of the signal beyond its ends: "reflect" or "zero".

    Returns
    -------
    Coefficients
        complex64, peak amplitude in the channel's unit. Error about 1e-6 of the largest coefficient of a line.

    Raises
    ------
    InputError
        On non-finite values, lines beyond half the sampling rate, or more than 2 GB of coefficients.
    RefusalError
        If the signal is shorter than the wavelet at the lowest line.

    Notes
    -----
    For plots, use `cwt_map`, which shows the same over a long recording in little memory.

    Source: S. Mallat, *A Wavelet Tour of Signal Processing*, 3rd ed. (2009), chapter 4.
    """
    x = uniform(signal, channel)
    lines, spacing = lines_of(x, wavelet, positions, lowest, highest, n_per_octave)
    transform = _transform(x, lines, spacing, wavelet, edges)
    W = transform.room(step)
    for piece, column, thinned, _ in sampled_pieces(x, lines, wavelet, step, edges):
        W[piece.lines, column : column + thinned.shape[1]] = thinned
    weights = 2.0 * np.gradient(np.log(lines)) / admissibility(wavelet) if len(lines) > 1 else np.ones(1)
    return transform.coefficients(W, step, weights)


def cwt_map(
    signal: Source,
    channel: str | float | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    positions: FloatArray | None = None,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 16,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
    edges: Edges = "reflect",
) -> TimeFrequencyMap:
    """Return the levels of the wavelet transform in segments, without holding the whole matrix in memory.

    Parameters
    ----------
    signal, channel, wavelet, positions, lowest, highest, n_per_octave, edges
        As in `cwt`.
    n_columns : int
        Maximum number of segments; each has a whole number of samples, the last may be shorter.
    reduction : str
        "mean" of the power in each segment, or "max", which keeps the height of short impacts.
    scaling : str
        "amplitude peak" or "power".

    Returns
    -------
    TimeFrequencyMap
        Low lines are sampled as their bandwidth requires, not at every sample; their maximum may read 1 % low.

    Raises
    ------
    InputError, RefusalError
        As in `cwt`.
    """
    x = uniform(signal, channel)
    lines, spacing = lines_of(x, wavelet, positions, lowest, highest, n_per_octave)
    transform, columns = _transform(x, lines, spacing, wavelet, edges), plan_columns(x, n_columns)
    groups = plan_groups(lines / x.rate, wavelet, x.n_samples, step=columns.largest_step, follow_band=True)
    parts = ((p.lines, p.start, p.step, p.values) for group in groups for p in pieces(x.values, group, edges))
    return transform.level_map(columns, reduction, scaling, parts)


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
    """Return the wavelet coefficients reassigned to their instantaneous frequency, at every `step`-th sample.

    T(f_l, t) = (2 Δ ln f / C) Σ_j W(f_j, t) over the j with f̂(f_j, t) in line l, where f̂ = Im(∂W/∂t / W) / 2π: a unit
    sine reads 1 in one line, and the sum over all lines is the analytic signal between `lowest` and `highest`.

    Parameters
    ----------
    signal, channel, wavelet, lowest, highest, step, edges
        As in `cwt`.
    n_per_octave : int
        Lines, and wavelets, per octave.
    engine : str
        "gearsig", or "ssqueezepy" for comparison: single precision, the whole matrix in memory, each frequency
        assigned to the line that is nearest on the logarithmic axis.

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
    orders stay constant while frequencies sweep. Use a longer wavelet (larger β) for close components.

    Source: I. Daubechies, J. Lu, H.-T. Wu, *Synchrosqueezed wavelet transforms: an empirical mode decomposition-like
    tool*, Applied and Computational Harmonic Analysis 30 (2011).
    """
    x = uniform(signal, channel)
    plan = analysis(x, wavelet, lowest, highest, n_per_octave)
    transform = _transform(x, plan.lines, "logarithmic", wavelet, edges, engine)
    T = transform.room(step)
    levels = np.empty(T.shape, dtype=np.float32)
    if is_ssqueezepy(engine):
        T[:] = _by_ssqueezepy(x, plan, wavelet, edges)[:, ::step]
        for piece, column, W, _ in sampled_pieces(x, plan.lines, wavelet, step, edges):
            levels[piece.lines, column : column + W.shape[1]] = np.abs(W)
    else:
        table = squeeze_lines(plan.lines, x.rate, "logarithmic")
        weights = np.full(len(plan.analysed), plan.weight, dtype=np.float32)
        for piece, column, W, dW in sampled_pieces(x, plan.analysed, wavelet, step, edges, derivatives=True):
            squeeze(W, dW, weights, plan.smallest, table.borders, table.lookup, T, column)
            lines, of_piece = plan.lines_among(piece.lines)
            levels[lines, column : column + W.shape[1]] = np.abs(W[of_piece])
    return transform.coefficients(T, step, np.ones(len(T)), levels)


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
    """Return the levels of the synchrosqueezed wavelet transform in segments, without holding the whole matrix.

    Parameters
    ----------
    signal, channel, wavelet, lowest, highest, n_per_octave, edges, engine
        As in `squeezed_cwt`.
    n_columns, reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap
        A line is sampled as the bandwidth of its contributing wavelets requires.

    Raises
    ------
    InputError, RefusalError
        As in `squeezed_cwt`.
    """
    x = uniform(signal, channel)
    plan = analysis(x, wavelet, lowest, highest, n_per_octave)
    transform = _transform(x, plan.lines, "logarithmic", wavelet, edges, engine)
    columns = plan_columns(x, n_columns)
    if is_ssqueezepy(engine):
        squeezed = _by_ssqueezepy(x, plan, wavelet, edges)
        plain = np.empty_like(squeezed)
        for piece, column, W, _ in sampled_pieces(x, plan.lines, wavelet, 1, edges):
            plain[piece.lines, column : column + W.shape[1]] = W
        whole = (np.arange(len(plan.lines)), 0, 1, np.stack([squeezed, plain]))
        return transform.level_map(columns, reduction, scaling, [whole])
    octave = np.floor(np.log2(plan.lines[-1] / plan.lines) + 1e-9)
    blocks = (
        block
        for o in np.unique(octave)
        for block in _blocks(x, plan, wavelet, np.flatnonzero(octave == o), columns.largest_step, edges)
    )
    return transform.level_map(columns, reduction, scaling, blocks)


def _transform(
    x: UniformSignal,
    lines: FloatArray,
    spacing: Spacing,
    wavelet: Wavelet,
    edges: Edges,
    engine: SqueezeEngine | None = None,
) -> LinePlan:
    """Check edges and engine (None: not squeezed); return the line plan with the reach of ends and components."""
    one_of(edges, "edges", get_args(Edges))
    by = " by ssqueezepy" if engine is not None and is_ssqueezepy(engine) else ""
    method = f"CWT, {wavelet.name}" if engine is None else f"synchrosqueezed CWT{by}, {wavelet.name}"
    edge = half_support(wavelet) / 2 / lines  # half of the support carries all but a thousandth
    middle = len(lines) // 2
    # Lines, at the middle line, from a component's centre to where its power has fallen to e⁻².
    reach = int(np.searchsorted(lines, lines[middle] * (1.0 + np.sqrt(2.0) / wavelet.duration))) - middle
    return LinePlan(x, lines, spacing, method, edge, max(1, reach), engine is not None)


@dataclass(frozen=True)
class SqueezingWavelets:
    """Wavelets of a squeezed transform, extending beyond its lines so that the outermost lines are complete.

    Parameters
    ----------
    lines : array, (n_lines,)
        In Hz or orders.
    analysed : array, (n_analysed,)
        Frequencies or orders of the wavelets.
    weight : float
        2 Δ(ln f) / C: the sum over the wavelets is the analytic signal.
    smallest : float
        Power below which a coefficient is only rounding.
    """

    lines: FloatArray
    analysed: FloatArray
    weight: float
    smallest: float

    def lines_among(self, analysed: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the indices of the lines among these wavelets, and a mask of the wavelets that are lines."""
        first = int(np.argmin(np.abs(np.log(self.analysed / self.lines[0]))))
        numbers = analysed - first
        inside = (numbers >= 0) & (numbers < len(self.lines))
        return numbers[inside], inside


def analysis(
    x: UniformSignal, wavelet: Wavelet, lowest: float | None, highest: float | None, n_per_octave: int
) -> SqueezingWavelets:
    """Return the lines, and the wavelets: those of the lines and those beyond that still respond to them."""
    lines, _ = lines_of(x, wavelet, None, lowest, highest, n_per_octave)
    v_low, v_high = band(wavelet, _GUARD)
    n_below, n_above = (int(np.ceil(n_per_octave * np.log2(r))) for r in (v_high, 1 / v_low))
    k = np.arange(1 - len(lines) - n_below, n_above + 1)
    analysed = lines[-1] * 2.0 ** (k / n_per_octave)
    inside = (analysed >= min(lines[0], lowest_analysable(x, wavelet))) & (analysed <= max(lines[-1], x.rate / 2))
    weight = 2.0 * np.log(2.0) / n_per_octave / admissibility(wavelet)
    mean_square = float(np.dot(x.values, x.values)) / x.n_samples
    return SqueezingWavelets(lines, analysed[inside], weight, MIN_SHARE**2 * mean_square)


def _blocks(
    x: UniformSignal, plan: SqueezingWavelets, wavelet: Wavelet, part: np.ndarray, largest_step: int, edges: Edges
) -> Iterator[Piece]:
    """Yield the squeezed and plain coefficients of some neighbouring lines, block by block."""
    lines = plan.lines[part]
    table = squeeze_lines(lines, x.rate, "logarithmic")
    v_low, v_high = band(wavelet, _GUARD)
    chosen = np.flatnonzero((plan.analysed > lines[0] / v_high / 1.02) & (plan.analysed < lines[-1] / v_low * 1.02))
    cycles = plan.analysed / x.rate
    # The largest power of two that samples the band at least twice as often as necessary.
    width = cycles[chosen[-1]] * (v_high - v_low)
    step = int(min(largest_step, 1 << max(0, int(np.floor(np.log2(0.5 / width))))))
    group = plan_group(chosen, cycles, wavelet, x.n_samples, step=step)
    weights = np.full(len(chosen), plan.weight, dtype=np.float32)
    space = workspace(group)
    for start in group.starts(x.n_samples):
        length = -(-min(group.n_core, x.n_samples - start) // step)
        T = np.zeros((2, len(part), length), dtype=np.complex64)
        for piece in block_pieces(x.values, group, start, edges, space, derivatives=True):
            squeeze(piece.values, piece.derivatives, weights, plan.smallest, table.borders, table.lookup, T[0], 0)
            numbers, of_piece = plan.lines_among(piece.lines)
            in_part = (numbers >= part[0]) & (numbers <= part[-1])
            T[1, numbers[in_part] - part[0]] = piece.values[of_piece][in_part]
        yield part, start, step, T


def _by_ssqueezepy(x: UniformSignal, plan: SqueezingWavelets, wavelet: Wavelet, edges: Edges) -> ComplexArray:
    """Return the squeezed wavelet transform at every sample, computed by ssqueezepy, (n_lines, n_samples).

    ssqueezepy sums W Δ(ln f) over the wavelets, also with a peak gain of 2; with 2/C a unit sine reads 1.
    It assigns everything beyond its lines to the outermost ones, so it is given one extra line on either side.
    """
    lines, analysed = plan.lines, plan.analysed
    ratio = analysed[1] / analysed[0]
    grid = np.concatenate([[analysed[0] / ratio], analysed, [analysed[-1] * ratio]])
    # Coefficients, their derivatives, a copy, the result, and two of these padded to the next power of two.
    check_ssqueezepy_bytes(len(grid) * 8 * (4 * x.n_samples + 2 * (4 << (x.n_samples - 1).bit_length() - 1)))
    scaled, rms = unit_rms(x)
    with ssqueezepy() as ssq:
        T = ssq.ssq_cwt(
            scaled,
            ssq.Wavelet(lambda w: wavelet.response(w).astype(np.float32)),
            scales=(x.rate / (2 * np.pi * grid))[::-1].copy(),
            ssq_freqs=grid / x.rate,
            padtype=edges,
            gamma=MIN_SHARE,
            flipud=False,
            preserve_transform=False,
            cache_wavelet=False,
        )[0]
        first = 1 + int(np.argmin(np.abs(np.log(analysed / lines[0]))))
        rows = np.asarray(T)[first : first + len(lines)]
        return np.asarray(rows * np.float32(2.0 * rms / admissibility(wavelet)))


# --------------------
# Reconstruction from the coefficients: the whole signal, or the component along a ridge.
# --------------------


def inverse(
    coefficients: Coefficients, *, lowest: FloatArray | float | None = None, highest: FloatArray | float | None = None
) -> ComplexArray:
    """Return the analytic signal at the columns, reconstructed from coefficients; its real part is the signal.

    z(t) = Σ_l weight_l · value(l, t) over the lines between `lowest` and `highest`.

    Parameters
    ----------
    coefficients : Coefficients
    lowest, highest : float, array (n_columns,) or None
        In Hz or orders; an array follows a component. None: all lines.

    Returns
    -------
    complex array, (n_columns,)
        Peak amplitude in the coefficients' unit. Errors over amplitude for whole signals: from the STFT with all lines
        1e-6, including the ends; from the CWT with the default wavelet, away from the ends, 1e-4 for frequencies at
        least a factor √2 inside the outermost lines, 1e-2 next to them; from the squeezed transforms 1e-4 rms, with
        single samples 1e-2 off where components cancel. Content outside the lines, including the mean, is lost.

    Raises
    ------
    InputError
        If the length of the limits differs from the number of columns.
    """
    values, lines = coefficients.values, coefficients.positions
    n = values.shape[1]
    low, high = _limit(lowest, -np.inf, n, "lowest"), _limit(highest, np.inf, n, "highest")
    result = np.zeros(n, dtype=np.complex128)
    for line, weight, row in zip(lines, coefficients.weights, values, strict=True):
        inside = (line >= low) & (line <= high)
        if inside.any():
            result += np.where(inside, weight * row, 0.0)
    return result


def _limit(value: FloatArray | float | None, default: float, n: int, name: str) -> FloatArray:
    if value is None:
        return np.full(1, default)
    limit = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if limit.shape not in ((1,), (n,)):
        raise InputError(f"{name} has shape {limit.shape}", allowed=f"a number, or an array of {n} columns")
    if np.isnan(limit).any():
        raise InputError(f"{name} holds NaN", allowed="numbers")
    not_negative(float(limit.min()), name)
    return limit


@dataclass(frozen=True)
class Component(Result, columns=("at", "analytic")):
    """Waveform of one component.

    Parameters
    ----------
    analytic : complex array, (n_samples,)
        Peak amplitude in `unit`.
    at : array, (n_samples,)
        Seconds from the start, or revolutions.
    ridge : Ridge
        The ridge around which it was reconstructed.
    half_width : float
        Half width of the band, relative to the ridge's frequency or order.
    unit, source : str
    """

    analytic: ComplexArray
    at: FloatArray
    ridge: Ridge
    half_width: float
    unit: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "analytic", ndim=None)
        freeze(self, "at")

    @property
    def values(self) -> FloatArray:
        """Waveform of the component, (n_samples,)."""
        return self.analytic.real

    @property
    def amplitude(self) -> FloatArray:
        """Instantaneous peak amplitude, (n_samples,)."""
        return np.abs(self.analytic)


def component(
    signal: Source,
    ridge: Ridge,
    channel: str | float | None = None,
    *,
    half_width: float | None = None,
    squeezed: bool = True,
    wavelet: Wavelet = DEFAULT,
    n_per_octave: int = 32,
    edges: Edges = "reflect",
) -> Component:
    """Return the waveform of the component along a ridge, at every sample.

    Squeezed: the sum of all wavelet coefficients whose instantaneous frequency lies within the band. Not squeezed: the
    sum over the lines within the band, divided by the share of the wavelet that they hold.

    Parameters
    ----------
    signal, channel
        The signal in which the ridge was found.
    ridge : Ridge
    half_width : float or None
        Fraction of the ridge's frequency or order, 0 to 0.5. None: √2/P of the wavelet if squeezed, 2√2/P otherwise, at
        most 0.5.
    squeezed : bool
        True rejects more noise, but also fast modulation; False is smoother.
    wavelet, n_per_octave, edges
        As in `squeezed_cwt`; preferably those with which the ridge was found.

    Returns
    -------
    Component
        Where the ridge is shared with another, it contains both components.

    Raises
    ------
    InputError
        If ridge and signal are not over the same axis, or the band is out of range.
    RefusalError
        If the signal is shorter than the wavelet at the lowest part of the ridge.

    Notes
    -----
    Memory: a few arrays of the signal's length.

    Source: I. Daubechies, J. Lu, H.-T. Wu (2011), see `squeezed_cwt`, theorem 3.3.
    """
    x = uniform(signal, channel)
    one_of(edges, "edges", get_args(Edges))
    if ridge.axis != x.axis:
        raise InputError(
            f"the ridge is over {ridge.axis}, but the signal is not",
            where="ridge",
            remedy="give the recording for a frequency ridge, the angle signal for an order ridge",
        )
    usual = min(0.5, (1.0 if squeezed else 2.0) * np.sqrt(2.0) / wavelet.duration)
    width = float(usual) if half_width is None else within(half_width, "half_width", 1e-6, 0.5)
    at = x.instants(1)
    path = ridge.position_at(at)
    if float(path.min()) <= 0.0:
        raise InputError("the ridge touches zero", where="ridge", remedy="look for it between lines above zero")
    low, high = path / (1.0 + width), path * (1.0 + width)
    # If the signal is just long enough for the ridge, the band's lower half is cut rather than refused.
    bottom = max(float(low.min()), min(float(path.min()), lowest_analysable(x, wavelet)))
    top = min(float(high.max()), x.highest_valid)
    plan = analysis(x, wavelet, bottom, top, n_per_octave)
    borders = 2 * np.pi / x.rate * low, 2 * np.pi / x.rate * high
    omegas = 2 * np.pi / x.rate * plan.analysed
    z = np.zeros(x.n_samples, dtype=np.complex128)
    for group in plan_groups(plan.analysed / x.rate, wavelet, x.n_samples):
        for piece in pieces(x.values, group, edges, derivatives=squeezed):
            columns = slice(piece.start, piece.start + piece.values.shape[1])
            limits = borders[0][columns], borders[1][columns]
            if squeezed:
                gather_near(piece.values, piece.derivatives, plan.weight, plan.smallest, *limits, z[columns])
            else:
                gather_lines(piece.values, omegas[piece.lines], plan.weight, *limits, z[columns])
    if not squeezed:  # the share of C = ∫ Ψ(v)/v dv that lies within the band
        s = np.linspace(-np.log1p(width), np.log1p(width), 4001)
        z /= float(np.trapezoid(wavelet.response(np.exp(s)), s)) / admissibility(wavelet)
    return Component(z, at, ridge, width, x.unit, x.source)
