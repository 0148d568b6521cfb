"""Short-time Fourier transform over time or shaft angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.timefreq._types import Coefficients, ComplexArray, Reduction, TimeFrequencyMap
from gearsig.timefreq._uniform import (
    EDGES,
    ColumnPowers,
    Edges,
    Form,
    Source,
    UniformSignal,
    plan_columns,
    room_for,
    stretch,
    uniform,
)

# --------------------
# Windowed frames of a signal, centred on every so-many-th sample, and their spectra.
# --------------------


WINDOWS = ("hann", "gaussian")
_SIGMAS = 4.0  # half length of the Gaussian window in its own standard deviations
_FRAME_SAMPLES = 1 << 20  # samples in the frames that are transformed at a time
_MIN_WINDOW, _MAX_WINDOW, _SHARE = 16, 8192, 64


@dataclass(frozen=True)
class FramePlan:
    """Window g and its derivative per sample, from -n/2 to n/2; n_fft points; lines first to last (excluded)."""

    window: FloatArray
    slope: FloatArray
    n_fft: int
    first: int
    last: int
    name: str

    @property
    def n_window(self) -> int:
        """Samples in the window."""
        return len(self.window)

    @property
    def n_lines(self) -> int:
        """Lines that are kept."""
        return self.last - self.first

    def lines(self, rate: float) -> FloatArray:
        """Frequencies or orders of the lines that are kept."""
        result: FloatArray = np.arange(self.first, self.last) * (rate / self.n_fft)
        return result

    @property
    def gains(self) -> FloatArray:
        """Factors that make a unit sine read 1; the lines at zero and half the rate have no twin."""
        k = np.arange(self.first, self.last)
        twins: FloatArray = np.where((k == 0) | (2 * k == self.n_fft), 1.0, 2.0)
        return twins / float(self.window.sum())

    @property
    def weight(self) -> float:
        """Factor of the sum over lines that gives the signal back."""
        return float(self.window.sum() / self.n_fft / self.window[self.n_window // 2])

    @property
    def n_reach(self) -> int:
        """Lines from a component's middle to where its power has fallen to e⁻²."""
        spread = float(np.sum(self.slope**2) / np.sum(self.window**2)) ** 0.5  # rms width, rad per sample
        return max(2, int(np.rint(spread / np.pi * self.n_fft)))


def plan_frames(
    x: UniformSignal,
    window: str,
    window_length: float | None,
    zero_padding: int,
    lowest: float | None,
    highest: float | None,
) -> FramePlan:
    """Return window and lines.

    Parameters
    ----------
    window : str
        "hann" or "gaussian".
    window_length : float or None
        Seconds or revolutions; None: 1/64 of the signal, 16 to 8192 samples.
    zero_padding : int
        Points of the FFT over those of the window, at least.
    lowest, highest : float or None
        Lines that are kept, in Hz or orders; None: all that are valid.
    """
    from scipy.fft import next_fast_len

    one_of(window, "window", WINDOWS)
    n = _length(x, window_length)
    n_fft = int(next_fast_len(n * count(zero_padding, "zero_padding"), real=True))
    n_fft += n_fft % 2
    resolution = x.rate / n_fft
    low = 0.0 if lowest is None else lowest
    high = x.highest_valid if highest is None else positive(highest, "highest")
    if not 0.0 <= low < high <= x.highest_valid * (1 + 1e-9):
        raise InputError(
            f"lines from {low:g} to {high:g} {x.position_unit} are asked",
            where="lowest, highest",
            allowed=f"0 <= lowest < highest <= {x.highest_valid:g} {x.position_unit}",
        )
    first, last = int(np.ceil(low / resolution - 1e-9)), int(np.floor(high / resolution * (1 + 1e-12))) + 1
    if last - first < 2:
        raise InputError(
            f"lines are {resolution:g} {x.position_unit} apart: fewer than two lie between {low:g} and {high:g}",
            where="window_length",
            remedy="lengthen the window or widen the range",
        )
    g, slope = _window(window, n)
    return FramePlan(g, slope, n_fft, first, last, f"{window} window of {n} samples")


def spectra(
    x: UniformSignal, plan: FramePlan, step: int, edges: Edges, *, slopes: bool = False
) -> Iterator[tuple[int, ComplexArray, ComplexArray]]:
    """Yield (first frame, spectra with the window, spectra with its derivative), (n_frames, n_lines), in batches."""
    from scipy.fft import rfft

    n_frames = -(-x.n_samples // step)
    n_batch = max(1, _FRAME_SAMPLES // plan.n_fft)
    half, n = plan.n_window // 2, plan.n_window
    for frame in range(0, n_frames, n_batch):
        n_here = min(n_batch, n_frames - frame)
        part = stretch(x.values, frame * step - half, (n_here - 1) * step + n, edges)
        frames = np.lib.stride_tricks.sliding_window_view(part, n)[::step]
        found = []
        for window in (plan.window, plan.slope) if slopes else (plan.window,):
            turned = np.zeros((n_here, plan.n_fft))
            turned[:, : n - half] = frames[:, half:] * window[half:]
            turned[:, plan.n_fft - half :] = frames[:, :half] * window[:half]
            found.append(rfft(turned, axis=1)[:, plan.first : plan.last])
        yield frame, found[0], found[-1]


def _length(x: UniformSignal, window_length: float | None) -> int:
    if window_length is None:
        n = min(max(x.n_samples // _SHARE, _MIN_WINDOW), _MAX_WINDOW)
    else:
        n = round(positive(window_length, "window_length") * x.rate)
    unit = "s" if x.axis == "frequency" else "revolutions"
    if n < 4:
        raise InputError(
            f"the window of {window_length:g} {unit} holds {n} samples",
            where="window_length",
            allowed=f"at least {4 / x.rate:.4g} {unit}",
        )
    if n > x.n_samples:
        raise RefusalError(
            f"the signal of {x.length:.4g} {unit} is shorter than the window of {n / x.rate:.4g}",
            remedy="shorten window_length or record longer",
        )
    return n


def _window(name: str, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the window around its middle sample n // 2, and its derivative per sample."""
    tau = np.arange(n) - n // 2
    if name == "hann":
        turn = 2 * np.pi / n
        return 0.5 + 0.5 * np.cos(turn * tau), -0.5 * turn * np.sin(turn * tau)
    sigma = n / 2 / _SIGMAS
    g = np.exp(-0.5 * (tau / sigma) ** 2)
    return g, -tau / sigma**2 * g


def stft(
    signal: Source,
    channel: str | float | None = None,
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
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Over time, lines are frequencies; over angle, orders.
    channel : str, float or None
        None: the only channel there is. Of an array its sampling rate in Hz.
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
    channel: str | float | None = None,
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
    channel: str | float | None,
    window: str,
    window_length: float | None,
    zero_padding: int,
    lowest: float | None,
    highest: float | None,
    edges: Edges,
    *,
    squeezed_by: str | None = None,
) -> tuple[UniformSignal, FramePlan, Form]:
    """Check what all transforms by frames are given, and plan the frames."""
    x = uniform(signal, channel)
    plan = plan_frames(x, window, window_length, zero_padding, lowest, highest)
    one_of(edges, "edges", EDGES)
    squeezed = squeezed_by is not None
    method = f"{'synchrosqueezed ' if squeezed else ''}STFT{squeezed_by or ''}, {plan.name}"
    edge = np.full(plan.n_lines, plan.n_window / 2 / x.rate)
    return x, plan, Form(plan.lines(x.rate), "linear", method, edge, plan.n_reach, squeezed)
