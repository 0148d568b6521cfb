"""The squeezed transforms by ssqueezepy, in the lines, scaling and phase of gearsig's own."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from types import ModuleType
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.engines import engine_module
from gearsig.errors import InputError
from gearsig.timefreq._stft import FramePlan
from gearsig.timefreq._types import ComplexArray
from gearsig.timefreq._uniform import Edges, UniformSignal
from gearsig.timefreq._wavelets import Wavelet, admissibility

SqueezeEngine = Literal["gearsig", "ssqueezepy"]

_MAX_BYTES = 4 << 30
"""Of its matrices, all of which it holds at once; more would push a usual machine into swapping."""


def is_ssqueezepy(engine: str) -> bool:
    """Check the name of an engine, and tell whether it is ssqueezepy."""
    return one_of(engine, "engine", get_args(SqueezeEngine)) == "ssqueezepy"


def cwt_by_ssqueezepy(
    x: UniformSignal, lines: FloatArray, analysed: FloatArray, smallest_share: float, wavelet: Wavelet, edges: Edges
) -> ComplexArray:
    """Return the squeezed wavelet transform of every sample on `lines`, which are among `analysed`.

    ssqueezepy sums W Δ(ln f) over the wavelets, with W of peak gain 2 too; 2/C makes a unit sine read 1.
    It puts what lies beyond its lines on the outermost ones, so it is given one more on either side than is analysed.

    Parameters
    ----------
    lines, analysed : arrays
        Hz or orders at equal ratios, increasing.
    smallest_share : float
        Modulus over the signal's rms below which a coefficient is rounding.
    """
    ratio = analysed[1] / analysed[0]
    grid = np.concatenate([[analysed[0] / ratio], analysed, [analysed[-1] * ratio]])
    # Wavelets, their derivatives, a copy, the result, and two of these padded to the next power of two.
    _check_memory(len(grid) * 8 * (4 * x.n_samples + 2 * (4 << (x.n_samples - 1).bit_length() - 1)))
    scaled, rms = _unit_rms(x)
    with _ssqueezepy() as ssq:
        T = ssq.ssq_cwt(
            scaled,
            ssq.Wavelet(lambda w: wavelet.response(w).astype(np.float32)),
            scales=(x.rate / (2 * np.pi * grid))[::-1].copy(),
            ssq_freqs=grid / x.rate,
            padtype=edges,
            gamma=smallest_share,
            flipud=False,
            preserve_transform=False,
            cache_wavelet=False,
        )[0]
        first = 1 + int(np.argmin(np.abs(np.log(analysed / lines[0]))))
        rows = np.asarray(T)[first : first + len(lines)]
        return np.asarray(rows * np.float32(2.0 * rms / admissibility(wavelet)))


def stft_by_ssqueezepy(
    x: UniformSignal, plan: FramePlan, step: int, smallest_share: float, edges: Edges
) -> ComplexArray:
    """Return the squeezed short-time transform of every `step`-th sample on the plan's lines.

    ssqueezepy sums V / n_fft over the lines; 2 / g(0) makes a unit sine read 1, and 1 / g(0) where there is no twin.
    """
    n_frames = -(-x.n_samples // step)
    # Spectra and their derivatives, a copy and the result, complex; frames of both windows before, real.
    _check_memory((plan.n_fft // 2 + 1) * n_frames * 8 * 6)
    window = np.zeros(plan.n_fft)
    middle = plan.n_window // 2
    start = plan.n_fft // 2 - middle
    window[start : start + plan.n_window] = plan.window
    scaled, rms = _unit_rms(x)
    with _ssqueezepy() as ssq:
        T = ssq.ssq_stft(
            scaled,
            window,
            n_fft=plan.n_fft,
            win_len=plan.n_fft,
            hop_len=step,
            fs=1.0,
            padtype=edges,
            gamma=smallest_share * plan.window.sum() / 2,
            preserve_transform=False,
        )[0]
        rows = np.asarray(T)[plan.first : plan.last, :n_frames]
        k = np.arange(plan.first, plan.last)
        twins = np.where((k == 0) | (2 * k == plan.n_fft), 1.0, 2.0) * (rms / plan.window[middle])
        return np.asarray(rows * twins.astype(np.float32)[:, None])


def _ssqueezepy() -> AbstractContextManager[ModuleType]:
    # Its parallel kernels abort the process when they are called from several threads; it reads this at every call.
    os.environ.setdefault("SSQ_PARALLEL", "0")
    return engine_module("ssqueezepy")


def _unit_rms(x: UniformSignal) -> tuple[FloatArray, float]:
    """Return the signal over its rms: ssqueezepy computes in single precision, with absolute limits."""
    rms = float(np.sqrt(np.dot(x.values, x.values) / x.n_samples)) or 1.0
    return np.asarray(x.values / rms), rms


def _check_memory(n_bytes: int) -> None:
    if n_bytes > _MAX_BYTES:
        raise InputError(
            f"ssqueezepy would take about {n_bytes / 1e9:.3g} GB for this signal",
            where="engine",
            allowed=f"at most {_MAX_BYTES / 1e9:.2g} GB",
            remedy='choose engine="gearsig", a shorter signal, fewer lines, or a larger step of the STFT',
        )
