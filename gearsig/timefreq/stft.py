"""Short-time Fourier transform over time or shaft angle."""

from __future__ import annotations

import numpy as np

from gearsig.checks import one_of
from gearsig.timefreq.columns import ColumnPowers, Form, plan_columns, room_for
from gearsig.timefreq.ends import EDGES, Edges
from gearsig.timefreq.frames import FramePlan, plan_frames, spectra
from gearsig.timefreq.types import Coefficients, Reduction, TimeFrequencyMap
from gearsig.timefreq.uniform import Source, UniformSignal, uniform


def stft(
    signal: Source,
    channel: str | None = None,
    *,
    window: str = "hann",
    window_length: float | None = None,
    zero_padding: int = 1,
    lowest: float | None = None,
    highest: float | None = None,
    step: int = 1,
    edges: Edges = "reflect",
) -> Coefficients:
    """Return the complex spectra of windows centred on every `step`-th sample.

    V(f, t) = (2 / Σg) Σ_τ x(t + τ) g(τ) e^{-2πifτ}, so that |V| of a unit sine is 1 on its line.

    Parameters
    ----------
    signal : Recording, AngleSignal or UniformSignal
        Over time, lines are frequencies; over angle, orders.
    channel : str or None
    window : str
        "hann" or "gaussian".
    window_length : float or None
        Seconds or revolutions; None: 1/64 of the signal, 16 to 8192 samples.
    zero_padding : int
        Points of the FFT over those of the window.
    lowest, highest : float or None
        Lines that are kept, in Hz or orders.
    step : int
        Samples between columns.
    edges : str
        What is assumed beyond the ends: "reflect" or "zero".

    Returns
    -------
    Coefficients
        complex64; their weighted sum over all lines from zero to half the rate is the signal to 1e-6.

    Raises
    ------
    InputError
        On values that are not finite, lines beyond half the sampling rate, or more than 2 GB of coefficients.
    RefusalError
        If the signal is shorter than the window.

    Notes
    -----
    Not for impacts and slow parts at once: the window is the same for all lines. Take `cwt`.

    Source: L. Cohen, *Time-Frequency Analysis* (1995), chapter 7.
    """
    x, plan, form = prepared(signal, channel, window, window_length, zero_padding, lowest, highest, edges)
    V = room_for(plan.n_lines, x, step)
    for frame, part, _ in spectra(x, plan, step, edges):
        V[:, frame : frame + len(part)] = (part * plan.gains).T
    return form.coefficients(V, x, step, np.full(plan.n_lines, plan.weight))


def stft_map(
    signal: Source,
    channel: str | None = None,
    *,
    window: str = "hann",
    window_length: float | None = None,
    zero_padding: int = 1,
    lowest: float | None = None,
    highest: float | None = None,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
    edges: Edges = "reflect",
) -> TimeFrequencyMap:
    """Return levels of the short-time Fourier transform in stretches, never holding the whole matrix.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, edges
        As in `stft`.
    n_columns, reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap
        Windows overlap by at least 7/8; a peak between two of them may read 2 % low.

    Raises
    ------
    InputError, RefusalError
        As in `stft`.
    """
    x, plan, form = prepared(signal, channel, window, window_length, zero_padding, lowest, highest, edges)
    columns = plan_columns(x, n_columns)
    powers = ColumnPowers(columns, plan.n_lines, reduction)
    step = max(1, min(columns.n_per_column, plan.n_window // 8))
    everything = np.arange(plan.n_lines)
    for frame, part, _ in spectra(x, plan, step, edges):
        powers.add(everything, frame * step, step, (part * plan.gains).T)
    return powers.finished(x, form, scaling)


def prepared(
    signal: Source,
    channel: str | None,
    window: str,
    window_length: float | None,
    zero_padding: int,
    lowest: float | None,
    highest: float | None,
    edges: Edges,
    *,
    squeezed: bool = False,
) -> tuple[UniformSignal, FramePlan, Form]:
    """Check what all transforms by frames are given, and plan the frames."""
    x = uniform(signal, channel)
    plan = plan_frames(x, window, window_length, zero_padding, lowest, highest)
    one_of(edges, "edges", EDGES)
    method = f"{'synchrosqueezed ' if squeezed else ''}STFT, {plan.name}"
    edge = np.full(plan.n_lines, plan.n_window / 2 / x.rate)
    return x, plan, Form(plan.lines(x.rate), "linear", method, edge, plan.n_reach, squeezed)
