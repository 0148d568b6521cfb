"""Continuous wavelet transform over time or shaft angle."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, not_negative, one_of
from gearsig.errors import InputError
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
    given_lines,
    half_support,
    logarithmic_lines,
    pieces,
    plan_groups,
)


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
    """Return the complex wavelet coefficients of every `step`-th sample.

    W(f, t) = (1/2π) ∫ X(ω) Ψ(ω / 2πf) e^{iωt} dω with max Ψ = 2, so that |W| of a unit sine is 1 on its line.

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Over time, lines are frequencies; over angle, orders.
    channel : str, float or None
        None: the only channel there is. Of an array its sampling rate in Hz.
    wavelet : Morse or Morlet
    positions : array or None
        Lines in Hz or orders; None: `lowest` to `highest` at `n_per_octave` per octave.
    lowest, highest : float or None
        In Hz or orders; see `logarithmic_lines`.
    step : int
        Samples between columns; the columns are exact, not averaged.
    edges : str
        What is assumed beyond the ends: "reflect" or "zero".

    Returns
    -------
    Coefficients
        complex64, peak amplitude in the channel's unit. Error about 1e-6 of the largest coefficient of a line.

    Raises
    ------
    InputError
        On values that are not finite, lines beyond half the sampling rate, or more than 2 GB of coefficients.
    RefusalError
        If the signal is shorter than the wavelet at the lowest line.

    Notes
    -----
    Not for looking at: `cwt_map` gives the same over a long recording in little memory.

    Source: S. Mallat, *A Wavelet Tour of Signal Processing*, 3rd ed. (2009), chapter 4.
    """
    x, form = _prepared(signal, channel, wavelet, positions, lowest, highest, n_per_octave, edges)
    W = room_for(len(form.lines), x, step)
    own = largest_power_of_two_in(step)
    for group in plan_groups(form.lines / x.rate, wavelet, x.n_samples, step=own):
        for piece in pieces(x.values, group, edges):
            column = -(-piece.start // step)
            thinned = piece.values[:, (column * step - piece.start) // own :: step // own]
            W[piece.lines, column : column + thinned.shape[1]] = thinned
    return form.coefficients(W, x, step, inverse_weights(form.lines, wavelet))


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
    """Return levels of the wavelet transform in `n_columns` stretches, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, wavelet, positions, lowest, highest, n_per_octave, edges
        As in `cwt`.
    n_columns : int
        Most columns; each stretch has a whole number of samples, the last may be shorter.
    reduction : str
        "mean" of the power in each stretch, or "max": short impacts keep their height.
    scaling : str
        "amplitude peak" or "power".

    Returns
    -------
    TimeFrequencyMap
        A low line is read as often as its bandwidth asks, not at every sample; its maximum may read 1 % low.

    Raises
    ------
    InputError, RefusalError
        As in `cwt`.
    """
    x, form = _prepared(signal, channel, wavelet, positions, lowest, highest, n_per_octave, edges)
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, len(form.lines), reduction)
    for group in plan_groups(form.lines / x.rate, wavelet, x.n_samples, step=columns.largest_step, follow_band=True):
        for piece in pieces(x.values, group, edges):
            powers.add(piece.lines, piece.start, piece.step, piece.values)
    return powers.finished(x, form, scaling)


def _prepared(
    signal: Source,
    channel: str | float | None,
    wavelet: Wavelet,
    positions: FloatArray | None,
    lowest: float | None,
    highest: float | None,
    n_per_octave: int,
    edges: Edges,
) -> tuple[UniformSignal, Form]:
    """Check what both functions are given, and lay the lines."""
    x = uniform(signal, channel)
    lines, spacing = chosen_lines(x, wavelet, positions, lowest, highest, n_per_octave)
    one_of(edges, "edges", EDGES)
    return x, Form(lines, spacing, f"CWT, {wavelet.name}", edge_of(lines, wavelet), n_reach(lines, wavelet))


def chosen_lines(
    x: UniformSignal,
    wavelet: Wavelet,
    positions: FloatArray | None,
    lowest: float | None,
    highest: float | None,
    n_per_octave: int,
) -> tuple[FloatArray, Spacing]:
    """Return the asked lines and how they are spaced."""
    if positions is None:
        return logarithmic_lines(x, wavelet, lowest, highest, n_per_octave), "logarithmic"
    if lowest is not None or highest is not None:
        raise InputError("both positions and a range are given", where="positions", remedy="give one of them")
    lines = given_lines(positions, x, wavelet)
    even = len(lines) < 3 or bool(np.ptp(np.diff(lines)) < 1e-6 * (lines[1] - lines[0]))
    return lines, "linear" if even else "logarithmic"


def edge_of(lines: FloatArray, wavelet: Wavelet) -> FloatArray:
    """Return how far the ends reach into each line: half of the support carries all but a thousandth."""
    return half_support(wavelet) / 2 / lines


def n_reach(lines: FloatArray, wavelet: Wavelet) -> int:
    """Return how many lines from its middle a component falls to e⁻² of its power, at the middle line."""
    middle = len(lines) // 2
    reach = lines[middle] * (1.0 + np.sqrt(2.0) / wavelet.duration)
    return max(1, int(np.searchsorted(lines, reach)) - middle)


def inverse_weights(lines: FloatArray, wavelet: Wavelet) -> FloatArray:
    """Return 2 Δ(ln f) / C of each line: the weighted sum of the coefficients is the analytic signal."""
    if len(lines) < 2:
        return np.ones(len(lines))
    return 2.0 * np.gradient(np.log(lines)) / admissibility(wavelet)


def largest_power_of_two_in(step: int) -> int:
    """Return the largest power of two, up to 1024, that divides `step`."""
    return min(step & -step, 1024)


# --------------------
# Back from coefficients to the signal, whole or between lines.
# --------------------


def inverse(
    coefficients: Coefficients, *, lowest: FloatArray | float | None = None, highest: FloatArray | float | None = None
) -> ComplexArray:
    """Return the analytic signal at the columns; its real part is the signal.

    z(t) = Σ_l weight_l · value(l, t) over the lines between `lowest` and `highest`.

    Parameters
    ----------
    coefficients : Coefficients
    lowest, highest : float, array (n_columns,) or None
        In Hz or orders; an array follows a component. None: all lines.

    Returns
    -------
    complex array, (n_columns,)
        Peak amplitude in the coefficients' unit. Whole signals come back, as error over amplitude: from the STFT
        with all lines to 1e-6, ends included; from the CWT to 1e-4 away from the ends for frequencies that lie √2 or
        more inside the outermost lines (the default wavelet), 1e-2 next to them; from the squeezed transforms to 1e-4
        rms, with single samples 1e-2 off where components cancel. What lies outside the lines, the mean
        included, is lost.

    Raises
    ------
    InputError
        If limits have another length than the columns.
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
