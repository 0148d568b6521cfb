"""Synchrosqueezed wavelet transform over time or shaft angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.timefreq.bank import block_pieces, pieces, plan_group, plan_groups, workspace
from gearsig.timefreq.columns import ColumnPowers, Form, plan_columns, room_for
from gearsig.timefreq.cwt import edge_of, largest_power_of_two_in, n_reach
from gearsig.timefreq.ends import EDGES, Edges
from gearsig.timefreq.lines import logarithmic_lines, lowest_possible
from gearsig.timefreq.squeeze_lines import SqueezeLines, squeeze_lines
from gearsig.timefreq.types import Coefficients, ComplexArray, Reduction, TimeFrequencyMap
from gearsig.timefreq.uniform import Source, UniformSignal, uniform
from gearsig.timefreq.wavelets import DEFAULT, Wavelet, admissibility, band

LEAST_SHARE = 1e-6
"""Coefficients below this share of the signal's rms are rounding: they have no frequency."""
_GUARD = 1e-3  # response at which a wavelet no longer adds to a line


@dataclass(frozen=True)
class Analysis:
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
    channel: str | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 32,
    step: int = 1,
    edges: Edges = "reflect",
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
    x, plan, form = _prepared(signal, channel, wavelet, lowest, highest, n_per_octave, edges)
    T = room_for(len(plan.lines), x, step)
    _fill(T, x, plan, wavelet, step, edges)
    return form.coefficients(T, x, step, np.ones(len(plan.lines)))


def squeezed_cwt_map(
    signal: Source,
    channel: str | None = None,
    *,
    wavelet: Wavelet = DEFAULT,
    lowest: float | None = None,
    highest: float | None = None,
    n_per_octave: int = 32,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
    edges: Edges = "reflect",
) -> TimeFrequencyMap:
    """Return levels of the synchrosqueezed wavelet transform in stretches, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, wavelet, lowest, highest, n_per_octave, edges
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
    x, plan, form = _prepared(signal, channel, wavelet, lowest, highest, n_per_octave, edges)
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, len(plan.lines), reduction)
    octave = np.floor(np.log2(plan.lines[-1] / plan.lines) + 1e-9)
    for o in np.unique(octave):
        part = np.flatnonzero(octave == o)
        for start, step, T in _blocks(x, plan, wavelet, part, columns.largest_step, edges):
            powers.add(part, start, step, T)
    return powers.finished(x, form, scaling)


def _prepared(
    signal: Source,
    channel: str | None,
    wavelet: Wavelet,
    lowest: float | None,
    highest: float | None,
    n_per_octave: int,
    edges: Edges,
) -> tuple[UniformSignal, Analysis, Form]:
    """Check what both functions are given, and lay lines and wavelets."""
    x = uniform(signal, channel)
    plan = analysis(x, wavelet, lowest, highest, n_per_octave)
    one_of(edges, "edges", EDGES)
    lines, method = plan.lines, f"synchrosqueezed CWT, {wavelet.name}"
    form = Form(lines, "logarithmic", method, edge_of(lines, wavelet), n_reach(lines, wavelet), squeezed=True)
    return x, plan, form


def analysis(
    x: UniformSignal, wavelet: Wavelet, lowest: float | None, highest: float | None, n_per_octave: int
) -> Analysis:
    """Return lines, and wavelets that reach as far beyond them as they answer to them."""
    lines = logarithmic_lines(x, wavelet, lowest, highest, n_per_octave)
    v_low, v_high = band(wavelet, _GUARD)
    n_below, n_above = (int(np.ceil(n_per_octave * np.log2(r))) for r in (v_high, 1 / v_low))
    k = np.arange(1 - len(lines) - n_below, n_above + 1)
    analysed = lines[-1] * 2.0 ** (k / n_per_octave)
    inside = (analysed >= min(lines[0], lowest_possible(x, wavelet))) & (analysed <= max(lines[-1], x.rate / 2))
    weight = 2.0 * np.log(2.0) / n_per_octave / admissibility(wavelet)
    mean_square = float(np.dot(x.values, x.values)) / x.n_samples
    return Analysis(lines, analysed[inside], weight, LEAST_SHARE**2 * mean_square)


def _fill(T: ComplexArray, x: UniformSignal, plan: Analysis, wavelet: Wavelet, step: int, edges: Edges) -> None:
    from gearsig.timefreq.squeeze_kernel import squeeze

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
    x: UniformSignal, plan: Analysis, wavelet: Wavelet, part: np.ndarray, largest_step: int, edges: Edges
) -> Iterator[tuple[int, int, ComplexArray]]:
    """Yield start, step and T of some neighbouring lines, block after block."""
    from gearsig.timefreq.squeeze_kernel import squeeze

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
