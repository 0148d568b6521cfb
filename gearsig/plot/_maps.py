"""Order and frequency maps over time, kurtograms and coherence maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError
from gearsig.formatting import readable
from gearsig.orders import OrderMap
from gearsig.plot import _style as style
from gearsig.plot._cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot._style import decibels
from gearsig.spectra import BandCandidate, EnhancedEnvelope, Kurtogram, SpectralCoherence, enhanced_envelope
from gearsig.timefreq import Ridge, TimeFrequencyMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DYNAMIC_RANGE_DB = 60.0
N_COLUMNS, N_ROWS = 1200, 500


def order_map_figure(
    order_map: OrderMap, cursors: Sequence[Cursor] = (), *, highest: float | None = None, height_in: float = 4.6
) -> Figure:
    """Draw levels over order (or frequency) and time, with the speed beside them.

    Parameters
    ----------
    order_map : OrderMap
    cursors : sequence of Cursor
        On the map's axis.
    highest : float or None
        Maximum order or frequency shown; None: all.
    height_in : float
        Of the figure, in inches.

    Returns
    -------
    Figure
        Colours span 60 dB below the maximum. If there are more cells than pixels, each pixel shows the maximum of its
        cells.
    """
    figure, (speed, axes) = style.panels(
        (height_in - 1.25,), (1.13, 6.0), left_in=0.75, right_in=1.0, top_in=0.7, column_gap_in=0.12
    )
    axes.sharey(speed)
    axes.tick_params(labelleft=False)
    stop = len(order_map.positions)
    if highest is not None:
        stop = max(int(np.searchsorted(order_map.positions, highest, side="right")), min(2, stop))
    positions, values = _fewer_cells(order_map.positions[:stop], order_map.values[:, :stop], axis=1, n_max=N_COLUMNS)
    time, values = _fewer_cells(order_map.time_s, values, axis=0, n_max=N_ROWS)
    x, y = _cell_borders(positions), _cell_borders(time)
    _draw_levels(axes, x, y, decibels(values, order_map.scaling, order_map.unit), order_map.unit)
    speed.set_ylim(float(y[0]), float(y[-1]))
    speed.plot(order_map.speed_rpm, order_map.time_s, color=style.MEASURED, linewidth=1.2)
    _hide_last_tick_label(speed)
    limits = (float(x[0]), float(x[-1]))
    draw(axes, place(cursors, limits, style.size_in(axes)[0]), through=False)
    style.label_axes(axes, order_map.axis_label)
    style.label_axes(speed, "speed (rpm)", "time (s)")
    style.head(figure, f"{order_map.axis} map of {order_map.source}" if order_map.source else f"{order_map.axis} map")
    style.no_offset(speed)
    return figure


def _draw_levels(
    axes: Axes, x: FloatArray, y: FloatArray, level: FloatArray, unit: str, span_db: float = DYNAMIC_RANGE_DB
) -> None:
    top = float(level.max())
    mesh = axes.pcolormesh(x, y, level, cmap=style.colours(), vmin=top - span_db, vmax=top, rasterized=True)
    axes.grid(visible=False)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    style.colour_bar(axes, mesh, style.decibel_text(unit))


def draw_level_map(
    axes: Axes, at: FloatArray, positions: FloatArray, level: FloatArray, unit: str, span_db: float = DYNAMIC_RANGE_DB
) -> None:
    """Draw levels in dB, (n_positions, n_at), as the maximum of the cells in each pixel, with a colour bar."""
    at, level = _fewer_cells(at, level, axis=1, n_max=N_COLUMNS)
    positions, level = _fewer_cells(positions, level, axis=0, n_max=N_ROWS)
    logarithmic = axes.get_yscale() == "log"
    y = np.exp(_cell_borders(np.log(positions))) if logarithmic else np.maximum(_cell_borders(positions), 0.0)
    _draw_levels(axes, _cell_borders(at), y, level, unit, span_db)
    if logarithmic:
        style.number_decades(axes.yaxis)


def _hide_last_tick_label(axes: Axes) -> None:
    """Leave out a tick label that would run into those of the panel on the right."""
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    ticks = MaxNLocator(3).tick_values(low, high)
    axes.set_xticks([t for t in ticks if low <= t <= high - 0.2 * (high - low)])


def _fewer_cells(middles: FloatArray, values: FloatArray, *, axis: int, n_max: int) -> tuple[FloatArray, FloatArray]:
    """Merge neighbouring cells along an axis by their maximum if there are more than `n_max`, the number of pixels."""
    n = values.shape[axis]
    if n <= n_max:
        return middles, values
    starts = np.arange(0, n, -(-n // n_max))
    ends = np.append(starts[1:], n) - 1
    return (middles[starts] + middles[ends]) / 2, np.maximum.reduceat(values, starts, axis=axis)


def _cell_borders(middles: FloatArray) -> FloatArray:
    """Return the borders of cells from their centres."""
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    result: FloatArray = np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
    return result


def time_frequency_figure(
    levels: TimeFrequencyMap,
    ridges: Sequence[Ridge] = (),
    *,
    dynamic_range_db: float = DYNAMIC_RANGE_DB,
    numbered: bool = False,
) -> Figure:
    """Draw levels over time (or angle) and frequency (or order), with ridges as lines.

    Parameters
    ----------
    levels : TimeFrequencyMap
    ridges : sequence of Ridge
        Dashed where two of them coincide.
    dynamic_range_db : float
        Span of the colours below the maximum level.
    numbered : bool
        Number the ridges from 1, at their right ends.

    Returns
    -------
    Figure
        The frequency axis is logarithmic if the lines are spaced that way. If there are more cells than pixels, each
        pixel shows the maximum of its cells. Between the dashed lines and the ends, levels depend on the assumed
        continuation of the signal.
    """
    positive(dynamic_range_db, "dynamic_range_db", "dB")
    figure, (axes,) = style.panels((3.5,), right_in=1.0, top_in=0.55)
    logarithmic = levels.spacing == "logarithmic"
    if logarithmic:
        axes.set_yscale("log")
    level = decibels(levels.values.T, levels.scaling, levels.unit)
    draw_level_map(axes, levels.at, levels.positions, level, levels.unit, dynamic_range_db)
    start, end = axes.get_xlim()
    inside = levels.edge < (end - start) / 2
    for side in (start + levels.edge, end - levels.edge):
        axes.plot(side[inside], levels.positions[inside], color="white", linewidth=2.2)
        axes.plot(side[inside], levels.positions[inside], color=style.QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    for number, ridge in enumerate(ridges, start=1):
        alone, together = (np.where(ridge.shared == shared, ridge.positions, np.nan) for shared in (False, True))
        axes.plot(ridge.at, alone, color=style.FAULT, linewidth=1.2)
        axes.plot(ridge.at, together, color=style.FAULT, linewidth=1.2, linestyle=(0, (3, 2)))
        if numbered:  # on a light disc near the end; three places in turn separate ridges that meet
            i = round((0.94 - 0.04 * (number % 3)) * (len(ridge.at) - 1))
            disc = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.FAULT, "linewidth": 0.8}
            where = float(ridge.at[i]), float(ridge.positions[i])
            style.put_text(axes, *where, str(number), colour=style.FAULT, ha="center", va="center", bbox=disc)
    style.label_axes(axes, levels.at_label, levels.axis_label, levels.source)
    style.note(axes, f"{levels.method}; {'mean power' if levels.reduction == 'mean' else 'largest'} per column")
    if not logarithmic:
        style.no_offset(axes)
    return figure


def kurtogram_figure(kurtogram: Kurtogram, band: BandCandidate | None = None) -> Figure:
    """Draw the kurtosis of each band over frequency, one row per bandwidth with the widest on top.

    Parameters
    ----------
    kurtogram : Kurtogram
    band : BandCandidate or None
        Outlined and named; None: the kurtogram's best band.

    Returns
    -------
    Figure
        Colours start at 0: bands below are no more impulsive than noise. Warnings on the band stand below the title.
    """
    band = kurtogram.best_band() if band is None else band
    figure, (axes,) = style.panels((3.1,), right_in=1.0, top_in=0.55)
    axes.grid(visible=False)
    top = max(float(kurtogram.kurtosis.max()), 1e-3)
    for row, level in enumerate(kurtogram.levels):
        inside = kurtogram.level == level
        edges = np.append(kurtogram.low_hz[inside], kurtogram.high_hz[inside][-1])
        values = kurtogram.kurtosis[inside][None, :]
        mesh = axes.pcolormesh(edges, [row - 0.5, row + 0.5], values, cmap=style.colours(), vmin=0.0, vmax=top)
        if row == 0:
            style.no_offset(style.colour_bar(axes, mesh, "spectral kurtosis"))
    axes.set_xlim(0.0, float(kurtogram.high_hz.max()))
    axes.set_ylim(len(kurtogram.levels) - 0.5, -0.5)
    row = int(np.argmin(np.abs(kurtogram.levels - band.level)))
    x = [band.low_hz, band.high_hz, band.high_hz, band.low_hz, band.low_hz]
    y = [row - 0.5, row - 0.5, row + 0.5, row + 0.5, row - 0.5]
    axes.plot(x, y, color="white", linewidth=3.0, clip_on=False)
    axes.plot(x, y, color=style.FAULT, linewidth=1.6, clip_on=False)
    prepared = "" if kurtogram.preparation == "none" else f", {kurtogram.preparation}"
    style.label_axes(axes, "frequency (Hz)", "bandwidth (Hz)", f"kurtogram of {kurtogram.source}{prepared}")
    warnings = kurtogram.warnings(band)
    name = f"{band.low_hz:.5g} to {band.high_hz:.5g} Hz, kurtosis {band.kurtosis:.3g}"
    style.note(axes, warnings[0] if warnings else name)
    style.no_offset(axes)
    widest_hz = float(kurtogram.high_hz.max())
    axes.set_yticks(range(len(kurtogram.levels)), [readable(widest_hz / 2**level, 3) for level in kurtogram.levels])
    return figure


def coherence_figure(
    coherence: SpectralCoherence,
    mean: EnhancedEnvelope | None = None,
    *,
    cursors: Sequence[Cursor] = (),
    limits: tuple[float, float] | None = None,
) -> Figure:
    """Draw the squared coherence as a map, and above it its mean over the carriers.

    Parameters
    ----------
    coherence : SpectralCoherence
    mean : EnhancedEnvelope or None
        The upper panel; None: the mean over all carriers. Its range of carriers is drawn beside the map.
    cursors : sequence of Cursor
        Lines of shafts and bearings, in cyclic frequencies or orders; see `modulation_cursors`.
    limits : (float, float) or None
        Cyclic frequencies or orders to draw; None: all.

    Returns
    -------
    Figure
        Colours are logarithmic and begin at the level that noise exceeds in one cell of 1000. If there are more cells
        than pixels, each pixel shows the maximum of its cells. The dashed line is the level of noise at the mean's
        probability.

    Raises
    ------
    InputError
        If the mean belongs to another axis of cyclic frequencies, or the limits hold fewer than two of them.
    """
    from matplotlib.colors import LogNorm

    mean = enhanced_envelope(coherence) if mean is None else mean
    if len(mean.spectrum.positions) != len(coherence.alpha) or mean.spectrum.axis != coherence.alpha_axis:
        raise InputError("the mean does not belong to the coherence", remedy="take enhanced_envelope of the same one")
    shown = _between(coherence.alpha, limits)
    # A line of one column must be wider than a pixel to be visible.
    alpha, values = _fewer_cells(coherence.alpha[shown], coherence.coherence_squared[shown], axis=0, n_max=500)
    low = coherence.level(1e-3)
    norm = LogNorm(low, max(float(values.max()), 2.0 * low))
    x, y = _cell_borders(alpha), _cell_borders(coherence.frequency_hz)
    right_in = 1.0
    placed = place(cursors, (float(x[0]), float(x[-1])), style.WIDTH_IN - 0.85 - right_in)
    figure, (above, below) = style.panels(
        (1.3, 2.68), right_in=right_in, top_in=0.4 + ROW_IN * n_rows(placed), row_gap_in=0.12, share_x=True
    )
    mesh = below.pcolormesh(x, y, np.maximum(values.T, low), cmap=style.colours(), norm=norm, rasterized=True)
    below.grid(visible=False)
    below.set_xlim(float(x[0]), float(x[-1]))
    below.set_ylim(float(y[0]), float(y[-1]))
    style.number_decades(style.colour_bar(below, mesh, "squared coherence γ²").yaxis, n_digits=4)
    at, _, high = style.envelope(mean.spectrum.positions[shown], mean.spectrum.values[shown], 1200)
    above.plot(at, high, color=style.MEASURED, linewidth=0.9)
    above.axhline(mean.level, color=style.FLOOR, linewidth=1.0, linestyle=(0, (4, 3)))
    # A slow change of level appears in the first lines: it must not compress the others.
    above.set_ylim(0.0, 1.08 * max(float(high[int(0.02 * len(high)) :].max()), 1.5 * mean.level))
    if mean.band_hz != (float(coherence.frequency_hz[0]), float(coherence.frequency_hz[-1])):
        where = "carriers {:.5g} to {:.5g} Hz".format(*mean.band_hz)
        style.put_text(above, 0.995, 0.93, where, colour=style.INK, transform=above.transAxes, ha="right", va="top")
    draw(above, placed)
    draw(below, [(cursor, None) for cursor, _ in placed])
    style.no_offset(above, below)
    below.plot([1.004, 1.004], mean.band_hz, transform=below.get_yaxis_transform(), color=style.MEASURED, clip_on=False)
    style.label_axes(below, coherence.alpha_label, "carrier (Hz)")
    style.label_axes(above, "", "mean γ²")
    style.head(figure, f"spectral coherence of {coherence.source}")
    noise = f"noise: 1 line in {1 / mean.probability:.4g} above the dashed line"
    style.put_text(figure, *style.upper_right(figure, right_in), noise, ha="right", va="top")
    return figure


def _between(alpha: FloatArray, limits: tuple[float, float] | None) -> slice:
    low, high = (-np.inf, np.inf) if limits is None else limits
    first, last = (int(i) for i in (np.searchsorted(alpha, low), np.searchsorted(alpha, high, side="right")))
    if last - first < 2:
        raise InputError(
            f"limits are {low:g} to {high:g}", allowed=f"ascending, two of {alpha[0]:g} to {alpha[-1]:g} between them"
        )
    return slice(first, last)
