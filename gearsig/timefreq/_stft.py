"""Short-time Fourier transform over time or shaft angle, plain and synchrosqueezed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import ComplexArray, FloatArray, count, number, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.timefreq._squeezing import (
    MIN_SHARE,
    SqueezeEngine,
    check_ssqueezepy_bytes,
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
    Reduction,
    Source,
    TimeFrequencyMap,
    UniformSignal,
    plan_columns,
    segment_of,
    uniform,
)


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
        Lines are frequencies for a signal over time, orders for one over angle.
    channel : str, float or None
        None: the only channel. For an array, its sampling rate in Hz.
    window : str
        "hann" or "gaussian".
    window_length : float or None
        Seconds or revolutions; None: 1/64 of the signal, 16 to 8192 samples.
    zero_padding : int
        Ratio of FFT length to window length.
    lowest, highest : float or None
        Range of lines to keep, in Hz or orders.
    step : int
        Samples between columns.
    edges : str
        Continuation of the signal beyond its ends: "reflect" or "zero".

    Returns
    -------
    Coefficients
        complex64; their weighted sum over all lines from zero to half the rate restores the signal to 1e-6.

    Raises
    ------
    InputError
        On non-finite values, lines beyond half the sampling rate, or more than 2 GB of coefficients.
    RefusalError
        If the signal is shorter than the window.

    Notes
    -----
    Not for impacts and slow components at the same time, since all lines share one window: use `cwt`.

    Source: L. Cohen, *Time-Frequency Analysis* (1995), chapter 7.
    """
    frames = _frames(signal, channel, window, window_length, zero_padding, lowest, highest, edges)
    return frames.coefficients(step)


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
    """Return the levels of the short-time Fourier transform in segments, without holding the whole matrix in memory.

    Parameters
    ----------
    signal, channel, window, window_length, zero_padding, lowest, highest, edges
        As in `stft`.
    n_columns, reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap
        Windows overlap by at least 7/8; a peak between two windows may read 2 % low.

    Raises
    ------
    InputError, RefusalError
        As in `stft`.
    """
    frames = _frames(signal, channel, window, window_length, zero_padding, lowest, highest, edges)
    return frames.level_map(n_columns, reduction, scaling)


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
    """Return the short-time spectra reassigned to their instantaneous frequency, at every `step`-th sample.

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
    Sharp only for components whose frequency changes little within the window: for a sweep, use the angle signal.

    Source: G. Thakur, H.-T. Wu, *Synchrosqueezing-based recovery of instantaneous frequency from nonuniform samples*,
    SIAM Journal on Mathematical Analysis 43 (2011).
    """
    frames = _frames(signal, channel, window, window_length, zero_padding, lowest, highest, edges, engine)
    return frames.coefficients(step)


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
    """Return the levels of the synchrosqueezed STFT in segments, without holding the whole matrix in memory.

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
    frames = _frames(signal, channel, window, window_length, zero_padding, lowest, highest, edges, engine)
    return frames.level_map(n_columns, reduction, scaling)


@dataclass(frozen=True)
class FramePlan:
    """Windowed frames of a signal: window g and its slope per sample; n_fft points; lines first to last (excluded).

    With `engine` None the spectra are plain, otherwise squeezed.
    """

    signal: UniformSignal
    window: FloatArray
    slope: FloatArray
    n_fft: int
    first: int
    last: int
    edges: Edges
    engine: SqueezeEngine | None
    name: str

    @property
    def k(self) -> NDArray[np.int64]:
        """Indices of the lines that are kept."""
        return np.arange(self.first, self.last)

    @property
    def twins(self) -> FloatArray:
        """2 for lines with a mirror image, 1 at zero and at half the rate."""
        return np.where((self.k == 0) | (2 * self.k == self.n_fft), 1.0, 2.0)

    @property
    def gains(self) -> FloatArray:
        """Factors by which a unit sine reads 1, (n_lines,)."""
        return np.asarray(self.twins / float(self.window.sum()))

    @property
    def weight(self) -> float:
        """Factor by which the sum over lines restores the signal."""
        return float(self.window.sum() / self.n_fft / self.window[len(self.window) // 2])

    @property
    def transform(self) -> LinePlan:
        """Line plan with the reach of the ends and of one component."""
        squeezed, n, rate = self.engine is not None, len(self.window), self.signal.rate
        by = " by ssqueezepy" if self.engine == "ssqueezepy" else ""
        spread = float(np.sum(self.slope**2) / np.sum(self.window**2)) ** 0.5  # rms width, rad per sample
        return LinePlan(
            self.signal,
            self.k * (rate / self.n_fft),
            "linear",
            f"{'synchrosqueezed ' if squeezed else ''}STFT{by}, {self.name}",
            np.full(len(self.k), n / 2 / rate),
            max(2, int(np.rint(spread / np.pi * self.n_fft))),  # where the power has fallen to e⁻²
            squeezed,
        )

    def coefficients(self, step: int) -> Coefficients:
        """Return the spectra of frames at every `step`-th sample."""
        transform = self.transform
        V = transform.room(step)
        levels = np.empty(V.shape, dtype=np.float32) if transform.squeezed else None
        for frame, part in self.batches(step):
            columns = slice(frame, frame + part.shape[-1])
            V[:, columns] = part if levels is None else part[0]
            if levels is not None:
                levels[:, columns] = np.abs(part[1])
        return transform.coefficients(V, step, np.full(len(V), 1.0 if transform.squeezed else self.weight), levels)

    def level_map(self, n_columns: int, reduction: Reduction, scaling: str) -> TimeFrequencyMap:
        """Return the levels of frames that overlap by at least 7/8, or 15/16 if squeezed."""
        columns = plan_columns(self.signal, n_columns)
        step = max(1, min(columns.n_per_column, len(self.window) // (8 if self.engine is None else 16)))
        pieces = ((self.k - self.first, frame * step, step, part) for frame, part in self.batches(step))
        return self.transform.level_map(columns, reduction, scaling, pieces)

    def batches(self, step: int) -> Iterator[tuple[int, ComplexArray]]:
        """Yield (first frame, spectra), (n_lines, n_frames); if squeezed, (2, …): squeezed and plain spectra."""
        by_ssqueezepy = _by_ssqueezepy(self, step) if self.engine == "ssqueezepy" else None  # all at once
        x, gains = self.signal, self.gains
        lines = self.transform.lines
        table = squeeze_lines(lines, x.rate, "linear")
        omega = 2 * np.pi / x.rate * lines
        weights = np.full(len(lines), self.weight, dtype=np.float32)
        smallest = MIN_SHARE**2 * float(np.dot(x.values, x.values)) / x.n_samples
        for frame, V, slopes in self._spectra(step):
            if self.engine is None:
                yield frame, (V * gains).T
                continue
            # With the phase origin at the frame's middle, ∂V/∂t = -V_g' + iω V: the same rule as for wavelets.
            scaled = (V * gains).T.astype(np.complex64)
            if by_ssqueezepy is not None:
                yield frame, np.stack([by_ssqueezepy[:, frame : frame + scaled.shape[1]], scaled])
                continue
            rates = ((1j * omega * V - slopes) * gains).T.astype(np.complex64)
            T = np.zeros(scaled.shape, dtype=np.complex64)
            squeeze(scaled, rates, weights, smallest, table.borders, table.lookup, T, 0)
            yield frame, np.stack([T, scaled])

    def _spectra(self, step: int) -> Iterator[tuple[int, ComplexArray, ComplexArray]]:
        """Yield (first frame, spectra with the window, spectra with its slope if squeezed), (n_frames, n_lines)."""
        from scipy.fft import rfft

        n_frames, n = -(-self.signal.n_samples // step), len(self.window)
        n_batch, half = max(1, (1 << 19) // self.n_fft), n // 2
        for frame in range(0, n_frames, n_batch):
            n_now = min(n_batch, n_frames - frame)
            part = segment_of(self.signal.values, frame * step - half, (n_now - 1) * step + n, self.edges)
            frames = np.lib.stride_tricks.sliding_window_view(part, n)[::step]
            spectra = []
            for window in (self.window,) if self.engine is None else (self.window, self.slope):
                turned = np.zeros((n_now, self.n_fft))
                turned[:, : n - half] = frames[:, half:] * window[half:]
                turned[:, self.n_fft - half :] = frames[:, :half] * window[:half]
                spectra.append(rfft(turned, axis=1)[:, self.first : self.last])
            yield frame, spectra[0], spectra[-1]


def _frames(
    signal: Source,
    channel: str | float | None,
    window: str,
    window_length: float | None,
    zero_padding: int,
    lowest: float | None,
    highest: float | None,
    edges: Edges,
    engine: SqueezeEngine | None = None,
) -> FramePlan:
    """Check the arguments common to all frame transforms, and plan the frames."""
    from scipy.fft import next_fast_len

    if engine is not None:
        is_ssqueezepy(engine)
    x = uniform(signal, channel)
    one_of(window, "window", ("hann", "gaussian"))
    one_of(edges, "edges", get_args(Edges))
    n = _length(x, window_length)
    n_fft = int(next_fast_len(n * count(zero_padding, "zero_padding"), real=True))
    n_fft += n_fft % 2
    resolution = x.rate / n_fft
    low = 0.0 if lowest is None else number(lowest, "lowest")
    high = x.highest_valid if highest is None else positive(highest, "highest")
    if not 0.0 <= low < high <= x.highest_valid * (1 + 1e-9):
        raise InputError(
            f"lines from {low:g} to {high:g} {x.position_unit} are requested",
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
    return FramePlan(x, g, slope, n_fft, first, last, edges, engine, f"{window} window of {n} samples")


def _length(x: UniformSignal, window_length: float | None) -> int:
    if window_length is None:
        n = min(max(x.n_samples // 64, 16), 8192)
    else:
        n = round(positive(window_length, "window_length") * x.rate)
    unit = x.length_unit
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
    """Return the window centred on sample n // 2, and its derivative per sample, (n,) each."""
    tau = np.arange(n) - n // 2
    if name == "hann":
        turn = 2 * np.pi / n
        return 0.5 + 0.5 * np.cos(turn * tau), -0.5 * turn * np.sin(turn * tau)
    sigma = n / 2 / 4.0  # four standard deviations to either side
    g = np.exp(-0.5 * (tau / sigma) ** 2)
    return g, -tau / sigma**2 * g


def _by_ssqueezepy(plan: FramePlan, step: int) -> ComplexArray:
    """Return the squeezed spectra computed by ssqueezepy, (n_lines, n_frames).

    ssqueezepy sums V / n_fft over the lines; with 2 / g(0), or 1 / g(0) for lines without a mirror image, a unit sine
    reads 1.
    """
    x, n = plan.signal, len(plan.window)
    n_frames = -(-x.n_samples // step)
    # Complex: spectra, their derivatives, a copy and the result; real: the frames of both windows before.
    check_ssqueezepy_bytes((plan.n_fft // 2 + 1) * n_frames * 8 * 6)
    window = np.zeros(plan.n_fft)
    start = plan.n_fft // 2 - n // 2
    window[start : start + n] = plan.window
    scaled, rms = unit_rms(x)
    with ssqueezepy() as ssq:
        T = ssq.ssq_stft(
            scaled,
            window,
            n_fft=plan.n_fft,
            win_len=plan.n_fft,
            hop_len=step,
            fs=1.0,
            padtype=plan.edges,
            gamma=MIN_SHARE * plan.window.sum() / 2,
            preserve_transform=False,
        )[0]
        rows = np.asarray(T)[plan.first : plan.last, :n_frames]
        gains = plan.twins * (rms / plan.window[n // 2])
        return np.asarray(rows * gains.astype(np.float32)[:, None])
