"""Back to signals: the sum of a transform's lines, and one component's waveform from the band around its ridge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np

from gearsig.checks import FloatArray, freeze, not_negative, one_of, within
from gearsig.errors import InputError
from gearsig.results import Result
from gearsig.timefreq._cwt import analysis
from gearsig.timefreq._squeezing import gather_lines, gather_near
from gearsig.timefreq._types import Coefficients, ComplexArray, Edges, Ridge, Source, uniform
from gearsig.timefreq._wavelets import DEFAULT, Wavelet, admissibility, lowest_possible, pieces, plan_groups


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
        Around which it was gathered.
    half_width : float
        Share of the ridge's frequency or order that the band reaches to either side.
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
        """The waveform."""
        return self.analytic.real

    @property
    def amplitude(self) -> FloatArray:
        """Momentary peak amplitude."""
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
    """Return the waveform of the component that runs along a ridge, at every sample.

    Squeezed: the sum of all wavelet coefficients whose momentary frequency lies within the band. Not squeezed: of the
    lines within the band, divided by the share of the wavelet that they hold.

    Parameters
    ----------
    signal, channel
        What the ridge was found in.
    ridge : Ridge
    half_width : float or None
        Share of the ridge's frequency or order, 0 to 0.5. None: √2/P of the wavelet where squeezed, 2√2/P where not,
        at most 0.5.
    squeezed : bool
        Squeezed: keeps more noise out, and fast modulation too. Not squeezed: smoother.
    wavelet, n_per_octave, edges
        As in `squeezed_cwt`; best those that the ridge was found with.

    Returns
    -------
    Component
        Where the ridge is shared with another one, both are in it.

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
            f"the ridge is over {ridge.axis}, the signal is not",
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
    # Where the signal is just long enough for the ridge, the band's lower half is cut rather than refused.
    bottom = max(float(low.min()), min(float(path.min()), lowest_possible(x, wavelet)))
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
