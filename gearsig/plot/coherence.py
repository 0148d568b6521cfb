"""Spectral coherence over cyclic frequency and carrier, with its mean over the carriers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import style
from gearsig.plot.order_map import colours
from gearsig.plot.thin import envelope as thinned
from gearsig.spectra.coherence_types import EnhancedEnvelope, SpectralCoherence, enhanced_envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

N_COLUMNS = 500  # of the map: a line of one cell must be wider than a pixel to be seen
LEFT_IN, RIGHT_IN, BOTTOM_IN, GAP_IN, TOP_IN = 0.85, 1.0, 0.55, 0.12, 0.55
LINES_IN = 1.3
LOWEST_SHARE = 0.02


def coherence_figure(
    coherence: SpectralCoherence,
    mean: EnhancedEnvelope | None = None,
    *,
    marked: Sequence[float] = (),
    limits: tuple[float, float] | None = None,
    height_in: float = 5.2,
) -> Figure:
    """Draw the squared coherence as a map, and above it its mean over the carriers.

    Parameters
    ----------
    coherence : SpectralCoherence
    mean : EnhancedEnvelope or None
        The upper panel; None takes the mean over all carriers. The range of its carriers is drawn beside the map.
    marked : sequence of float
        Cyclic frequencies or orders expected of a fault.
    limits : (float, float) or None
        Cyclic frequencies or orders that are drawn; None: all.
    height_in : float

    Returns
    -------
    Figure
        Colours are logarithmic and begin at the level that noise exceeds in one cell of 1000. Where there are more
        cells than pixels, the largest in a pixel is shown. The dashed line is noise's level at the mean's own
        probability.

    Raises
    ------
    InputError
        If the mean belongs to another axis of cyclic frequencies, or the limits hold fewer than two of them.
    """
    mean = enhanced_envelope(coherence) if mean is None else mean
    if len(mean.spectrum.positions) != len(coherence.alpha) or mean.spectrum.axis != coherence.alpha_axis:
        raise InputError("the mean does not belong to the coherence", remedy="take enhanced_envelope of the same one")
    figure = style.new_figure(height_in)
    split = height_in - TOP_IN - LINES_IN
    below = style.panel(
        figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=height_in - split + GAP_IN
    )
    above = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=split, top_in=TOP_IN, sharex=below)
    below.grid(visible=False)
    shown = _between(coherence.alpha, limits)
    _draw_map(figure, below, coherence, shown, height_in, split)
    _draw_mean(above, mean, coherence.frequency_hz, shown)
    for position in marked:
        for axes in (above, below):
            axes.axvline(position, color=style.BEARING, linewidth=0.8, linestyle=(0, (2, 3)))
    below.plot([1.004, 1.004], mean.band_hz, transform=below.get_yaxis_transform(), color=style.MEASURED, clip_on=False)
    style.label_axes(below, coherence.alpha_label, "carrier (Hz)")
    style.label_axes(above, "", "mean γ²", f"spectral coherence of {coherence.source}")
    style.note(above, f"noise: 1 line in {1 / mean.probability:.4g} above the dashed line")
    above.tick_params(labelbottom=False)
    for axes in (above, below):
        style.no_offset(axes)
    return figure


def _between(alpha: FloatArray, limits: tuple[float, float] | None) -> slice:
    low, high = (-np.inf, np.inf) if limits is None else limits
    first, last = (int(i) for i in (np.searchsorted(alpha, low), np.searchsorted(alpha, high, side="right")))
    if last - first < 2:
        raise InputError(
            f"limits are {low:g} to {high:g}", allowed=f"ascending, two of {alpha[0]:g} to {alpha[-1]:g} between them"
        )
    return slice(first, last)


def _draw_map(
    figure: Figure, axes: Axes, coherence: SpectralCoherence, shown: slice, height_in: float, split: float
) -> None:
    from matplotlib.colors import LogNorm

    values, alpha = _coarse(coherence.coherence_squared[shown], coherence.alpha[shown])
    low = coherence.level(1e-3)
    high = max(float(values.max()), 2.0 * low)
    x, y = _borders(alpha), _borders(coherence.frequency_hz)
    mesh = axes.pcolormesh(x, y, np.maximum(values.T, low), cmap=colours(), norm=LogNorm(low, high), rasterized=True)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    left = (style.WIDTH_IN - RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (split - GAP_IN - BOTTOM_IN) / height_in)
    bar = figure.add_axes((left, BOTTOM_IN / height_in, *size))
    figure.colorbar(mesh, cax=bar).outline.set_visible(False)
    bar.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    bar.set_ylabel("squared coherence γ²", color=style.INK, fontsize=style.TEXT_PT)
    _plain_ticks(bar)


def _plain_ticks(bar: Axes) -> None:
    """Label 1, 2 and 5 of each decade in full, whole powers of ten included."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    bar.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    bar.yaxis.set_minor_formatter(NullFormatter())


def _draw_mean(axes: Axes, mean: EnhancedEnvelope, carriers: FloatArray, shown: slice) -> None:
    at, _, high = thinned(mean.spectrum.positions[shown], mean.spectrum.values[shown], 1200)
    axes.plot(at, high, color=style.MEASURED, linewidth=0.9)
    axes.axhline(mean.level, color=style.FLOOR, linewidth=1.0, linestyle=(0, (4, 3)))
    # A slow change of level stands at the first lines: it must not squeeze the others.
    axes.set_ylim(0.0, 1.08 * max(float(high[int(LOWEST_SHARE * len(high)) :].max()), 1.5 * mean.level))
    low, top = mean.band_hz
    if (low, top) != (float(carriers[0]), float(carriers[-1])):
        where = f"carriers {low:.5g} to {top:.5g} Hz"
        axes.text(0.995, 0.93, where, transform=axes.transAxes, ha="right", va="top", fontsize=style.SMALL_PT)


def _coarse(values: FloatArray, alpha: FloatArray) -> tuple[FloatArray, FloatArray]:
    n = len(alpha)
    if n <= N_COLUMNS:
        return values, alpha
    starts = np.arange(0, n, -(-n // N_COLUMNS))
    ends = np.append(starts[1:], n) - 1
    return np.maximum.reduceat(values, starts, axis=0), (alpha[starts] + alpha[ends]) / 2


def _borders(middles: FloatArray) -> FloatArray:
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    result: FloatArray = np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
    return result
