"""Synchrosqueezing: coefficients reassigned to their instantaneous frequency, by compiled kernels or ssqueezepy."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import ModuleType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, one_of
from gearsig.compiled import njit
from gearsig.errors import InputError, engine_module
from gearsig.timefreq._types import Spacing, UniformSignal

MIN_SHARE = 1e-6
"""Coefficients below this share of the signal's rms are rounding: they have no frequency."""


SqueezeEngine = Literal["gearsig", "ssqueezepy"]


def is_ssqueezepy(engine: str) -> bool:
    """Check the name of an engine, and return whether it is ssqueezepy."""
    return one_of(engine, "engine", get_args(SqueezeEngine)) == "ssqueezepy"


@dataclass(frozen=True)
class SqueezeLines:
    """Borders of the lines in radians per sample, (n_lines + 1,), and a table of the line at each cell's left end."""

    borders: FloatArray
    lookup: NDArray[np.int64]


def squeeze_lines(lines: FloatArray, rate: float, spacing: Spacing) -> SqueezeLines:
    """Return borders halfway between the lines, on a logarithmic scale for logarithmic spacing."""
    logarithmic = spacing == "logarithmic"
    places = np.log(lines) if logarithmic else np.asarray(lines)
    half = np.diff(places) / 2 if len(places) > 1 else np.array([0.5 if not logarithmic else 0.02])
    borders = np.concatenate([[places[0] - half[0]], places[:-1] + half[: len(places) - 1], [places[-1] + half[-1]]])
    borders = (np.exp(borders) if logarithmic else borders) * (2 * np.pi / rate)
    # One cell more than needed: the highest frequency may round into it.
    cells = borders[0] + np.arange(4097) * (borders[-1] - borders[0]) / 4097
    lookup = np.clip(np.searchsorted(borders, cells, side="right") - 1, 0, len(borders) - 2)
    return SqueezeLines(borders, lookup.astype(np.int64))


def ssqueezepy() -> AbstractContextManager[ModuleType]:
    """Load ssqueezepy; the transforms convert its results to gearsig's lines, scaling and phase."""
    # Its parallel kernels abort the process if called from several threads; it reads this variable at every call.
    os.environ.setdefault("SSQ_PARALLEL", "0")
    return engine_module("ssqueezepy")


def unit_rms(x: UniformSignal) -> tuple[FloatArray, float]:
    """Return (signal over its rms, rms), since ssqueezepy uses single precision and absolute limits."""
    rms = float(np.sqrt(np.dot(x.values, x.values) / x.n_samples)) or 1.0
    return np.asarray(x.values / rms), rms


MOST_BYTES = 4 << 30
"""Maximum total size of ssqueezepy's matrices: more would make a typical machine swap.

It does not depend on free memory, so that a comparison of engines runs on all machines or on none."""


def check_ssqueezepy_bytes(n_bytes: int) -> None:
    """Raise InputError if ssqueezepy would need more than `MOST_BYTES`."""
    if n_bytes > MOST_BYTES:
        raise InputError(
            f"ssqueezepy would take about {n_bytes / 1e9:.3g} GB for this signal",
            where="engine",
            allowed=f"at most {MOST_BYTES / 1e9:.2g} GB",
            remedy='choose engine="gearsig", a shorter signal, fewer lines, or a larger step of the STFT',
        )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _momentary_frequency(w, dw, smallest):  # type: ignore[no-untyped-def]
    """Compute ω̂ = Im(w'/w); nan where |w|² <= `smallest`."""
    a, b = w.real, w.imag
    power = a * a + b * b
    return (dw.imag * a - dw.real * b) / power if power > smallest else np.nan


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def squeeze(W, dW, weights, smallest, borders, lookup, T, first):  # type: ignore[no-untyped-def]
    """T[l, first + t] += weights[j] W[j, t], where the borders of line l enclose the instantaneous frequency.

    The frequency is in the unit of `borders` (n_lines + 1, increasing). `lookup` gives the line at the left end of
    each of its equal cells between the outermost borders. Coefficients with |W|² <= `smallest` have no frequency.
    """
    n_lines = T.shape[0]
    bottom, top = borders[0], borders[n_lines]
    per_cell = lookup.shape[0] / (top - bottom)
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            omega = _momentary_frequency(W[j, t], dW[j, t], smallest)
            if not bottom <= omega < top:
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
            if low[t] <= _momentary_frequency(W[j, t], dW[j, t], smallest) <= high[t]:
                out[t] += weight * W[j, t]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def gather_lines(W, omegas, weight, low, high, out):  # type: ignore[no-untyped-def]
    """out[t] += weight · W[j, t] wherever low[t] <= omegas[j] <= high[t]."""
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            if low[t] <= omegas[j] <= high[t]:
                out[t] += weight * W[j, t]
