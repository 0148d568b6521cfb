"""Synchrosqueezed short-time Fourier transform over time or shaft angle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearsig.timefreq.columns import ColumnPowers, plan_columns, room_for
from gearsig.timefreq.ends import Edges
from gearsig.timefreq.frames import FramePlan, spectra
from gearsig.timefreq.squeeze_lines import squeeze_lines
from gearsig.timefreq.squeezed_cwt import LEAST_SHARE
from gearsig.timefreq.stft import prepared
from gearsig.timefreq.types import Coefficients, ComplexArray, Reduction, TimeFrequencyMap
from gearsig.timefreq.uniform import Source, UniformSignal


def squeezed_stft(
    signal: Source,
    channel: str | None = None,
    *,
    window: str = "gaussian",
    window_length: float | None = None,
    zero_padding: int = 2,
    lowest: float | None = None,
    highest: float | None = None,
    step: int = 1,
    edges: Edges = "reflect",
) -> Coefficients:
    """Return the short-time spectra moved to their momentary frequency, at every `step`-th sample.

    f̂ = f - Im(V_g' / V_g) / 2π, with g' the window's derivative; T(f_l, t) is the weighted sum of V over the lines
    whose f̂ lies in line l. A unit sine reads 1 in one line, and the sum over the lines is the analytic signal.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, step, edges
        As in `stft`.

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
    x, plan, form = prepared(
        signal, channel, window, window_length, zero_padding, lowest, highest, edges, squeezed=True
    )
    T = room_for(plan.n_lines, x, step)
    for frame, part in _squeezed(x, plan, step, edges):
        T[:, frame : frame + part.shape[1]] = part
    return form.coefficients(T, x, step, np.ones(plan.n_lines))


def squeezed_stft_map(
    signal: Source,
    channel: str | None = None,
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
) -> TimeFrequencyMap:
    """Return levels of the synchrosqueezed short-time Fourier transform, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, edges
        As in `stft`.
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
    x, plan, form = prepared(
        signal, channel, window, window_length, zero_padding, lowest, highest, edges, squeezed=True
    )
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, plan.n_lines, reduction)
    step = max(1, min(columns.n_per_column, plan.n_window // 16))
    everything = np.arange(plan.n_lines)
    for frame, part in _squeezed(x, plan, step, edges):
        powers.add(everything, frame * step, step, part)
    return powers.finished(x, form, scaling)


def _squeezed(x: UniformSignal, plan: FramePlan, step: int, edges: Edges) -> Iterator[tuple[int, ComplexArray]]:
    """Yield (first frame, T) in batches."""
    from gearsig.timefreq.squeeze_kernel import squeeze

    lines = plan.lines(x.rate)
    table = squeeze_lines(lines, x.rate, "linear")
    omega = 2 * np.pi / x.rate * lines
    weights = np.full(len(lines), plan.weight, dtype=np.float32)
    smallest = LEAST_SHARE**2 * float(np.dot(x.values, x.values)) / x.n_samples
    for frame, V, slopes in spectra(x, plan, step, edges, slopes=True):
        # With the frame's middle as origin of the phase, ∂V/∂t = -V_g' + iω V: the same rule as for wavelets.
        scaled = (V * plan.gains).T.astype(np.complex64)
        rates = ((1j * omega * V - slopes) * plan.gains).T.astype(np.complex64)
        T = np.zeros(scaled.shape, dtype=np.complex64)
        squeeze(scaled, rates, weights, smallest, table.borders, table.lookup, T, 0)
        yield frame, T
