"""Order and frequency maps along a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError
from gearsig.orders import OrderMap
from gearsig.plot import _style as style
from gearsig.plot._cursors import Cursor, draw, place
from gearsig.plot._series import envelope as thinned
from gearsig.plot._style import decibels, plain, unit_text
from gearsig.spectra import BandCandidate, EnhancedEnvelope, Kurtogram, SpectralCoherence, enhanced_envelope
from gearsig.timefreq import Ridge, TimeFrequencyMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure


DYNAMIC_RANGE_DB = 60.0
N_COLUMNS, N_ROWS = 1200, 500
LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN, SPEED_IN = 0.75, 1.0, 0.55, 0.7, 1.25


def order_map_figure(
    order_map: OrderMap, cursors: Sequence[Cursor] = (), *, highest: float | None = None, height_in: float = 4.6
) -> Figure:
    """Draw levels over order (or frequency) and time, with the speed beside them.

    Parameters
    ----------
    order_map : OrderMap
    cursors : sequence of Cursor
        In the map's axis.
    highest : float or None
        Highest order or frequency shown; None: all.

    Returns
    -------
    Figure
        Colours span 60 dB below the largest value. Where there are more cells than pixels, the largest value of the
        cells in a pixel is shown.
    """
    figure = style.new_figure(height_in)
    left = LEFT_IN + SPEED_IN
    speed = style.panel(
        figure, left_in=LEFT_IN, right_in=style.WIDTH_IN - left + 0.12, bottom_in=BOTTOM_IN, top_in=TOP_IN
    )
    axes = style.panel(figure, left_in=left, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=TOP_IN)
    axes.sharey(speed)
    axes.tick_params(labelleft=False)
    axes.grid(visible=False)
    stop = len(order_map.positions)
    if highest is not None:
        stop = max(int(np.searchsorted(order_map.positions, highest, side="right")), min(2, stop))
    positions, values = _fewer_cells(order_map.positions[:stop], order_map.values[:, :stop], axis=1, n_max=N_COLUMNS)
    time, values = _fewer_cells(order_map.time_s, values, axis=0, n_max=N_ROWS)
    level = decibels(values, order_map.scaling)
    x, y = _cell_borders(positions), _cell_borders(time)
    top = float(level.max())
    mesh = axes.pcolormesh(x, y, level, cmap=colours(), vmin=top - DYNAMIC_RANGE_DB, vmax=top, rasterized=True)
    _colour_bar(figure, mesh, f"dB re 1 {unit_text(order_map.unit)}".strip(), height_in)
    limits = (float(x[0]), float(x[-1]))
    axes.set_xlim(*limits)
    speed.set_ylim(float(y[0]), float(y[-1]))
    speed.plot(order_map.speed_rpm, order_map.time_s, color=style.MEASURED, linewidth=1.2)
    _spare_the_right_end(speed)
    width = style.WIDTH_IN - left - RIGHT_IN
    draw(axes, place(cursors, limits, width), (width, height_in - BOTTOM_IN - TOP_IN), through=False)
    name = f"order (of {order_map.shaft or 'the shaft'})" if order_map.axis == "order" else "frequency (Hz)"
    style.label_axes(axes, name)
    style.label_axes(speed, "speed (rpm)", "time (s)")
    figure.text(
        LEFT_IN / style.WIDTH_IN,
        1 - 0.14 / height_in,
        plain(order_map.source, 110),
        fontsize=style.TEXT_PT,
        fontweight="bold",
        va="top",
        color=style.INK,
        parse_math=False,
    )
    style.no_offset(speed)
    return figure


def _spare_the_right_end(axes: Axes) -> None:
    """Leave out a number that would run into those of the panel on the right."""
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    ticks = MaxNLocator(3).tick_values(low, high)
    axes.set_xticks([t for t in ticks if low <= t <= high - 0.2 * (high - low)])


def colours() -> Colormap:
    """Return a map from white over blue to nearly black: even steps of lightness, the same for every reader."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(
        "level", ["#FFFFFF", "#C9DDF0", "#6FA8D6", "#1F6FB0", "#0B3A69", "#06172E"]
    )


def _fewer_cells(middles: FloatArray, values: FloatArray, *, axis: int, n_max: int) -> tuple[FloatArray, FloatArray]:
    """Keep the largest of neighbouring cells along an axis where there are more than `n_max`, the pixels there are."""
    n = values.shape[axis]
    if n <= n_max:
        return middles, values
    starts = np.arange(0, n, -(-n // n_max))
    ends = np.append(starts[1:], n) - 1
    return (middles[starts] + middles[ends]) / 2, np.maximum.reduceat(values, starts, axis=axis)


def _cell_borders(middles: FloatArray) -> FloatArray:
    """Return the borders of cells from their middles."""
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    result: FloatArray = np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])
    return result


def _colour_bar(figure: Figure, mesh: object, label: str, height_in: float) -> None:
    from matplotlib.cm import ScalarMappable

    assert isinstance(mesh, ScalarMappable)  # noqa: S101 - what pcolormesh returns, said to the type checker
    left = (style.WIDTH_IN - RIGHT_IN + 0.15) / style.WIDTH_IN
    axes = figure.add_axes(
        (left, BOTTOM_IN / height_in, 0.12 / style.WIDTH_IN, (height_in - BOTTOM_IN - TOP_IN) / height_in)
    )
    bar = figure.colorbar(mesh, cax=axes)
    bar.outline.set_visible(False)
    axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    axes.set_ylabel(plain(label), color=style.INK, fontsize=style.TEXT_PT, parse_math=False)


# --------------------
# Levels over time and frequency, or over shaft angle and order.
# --------------------


TIME_FREQUENCY_LEFT_IN, TIME_FREQUENCY_RIGHT_IN, TIME_FREQUENCY_BOTTOM_IN, TIME_FREQUENCY_TOP_IN = 0.85, 1.0, 0.55, 0.55


def time_frequency_figure(
    levels: TimeFrequencyMap,
    ridges: Sequence[Ridge] = (),
    *,
    dynamic_range_db: float = DYNAMIC_RANGE_DB,
    height_in: float = 4.6,
    numbered: bool = False,
) -> Figure:
    """Draw levels over time (or angle) and frequency (or order), with ridges as lines.

    Parameters
    ----------
    levels : TimeFrequencyMap
    ridges : sequence of Ridge
        Dashed where two of them share their place.
    dynamic_range_db : float
        Span of the colours below the largest level.
    height_in : float
    numbered : bool
        Number the ridges from 1, at their right ends.

    Returns
    -------
    Figure
        The frequency axis is logarithmic where the lines are. Where there are more cells than pixels, the largest of
        the cells in a pixel is shown. Between the dashed lines and the ends, a level depends on what was assumed
        outside of the signal.
    """
    positive(dynamic_range_db, "dynamic_range_db", "dB")
    figure = style.new_figure(height_in)
    axes = style.panel(
        figure,
        left_in=TIME_FREQUENCY_LEFT_IN,
        right_in=TIME_FREQUENCY_RIGHT_IN,
        bottom_in=TIME_FREQUENCY_BOTTOM_IN,
        top_in=TIME_FREQUENCY_TOP_IN,
    )
    axes.grid(visible=False)
    logarithmic = levels.spacing == "logarithmic"
    if logarithmic:
        axes.set_yscale("log")
    mesh = _draw_levels(axes, levels, dynamic_range_db, logarithmic=logarithmic)
    _colour_bar_time_frequency(figure, mesh, f"dB re 1 {unit_text(levels.unit)}".strip(), height_in)
    _draw_edges(axes, levels)
    for i, ridge in enumerate(ridges, start=1):
        _draw_ridge(axes, ridge)
        if numbered:
            _number(axes, ridge, i)
    style.label_axes(axes, levels.at_label, levels.axis_label, levels.source)
    style.note(axes, f"{levels.method}; {'mean power' if levels.reduction == 'mean' else 'largest'} per column")
    if logarithmic:
        _plain_ticks(axes)
    else:
        style.no_offset(axes)
    return figure


def _draw_levels(axes: Axes, levels: TimeFrequencyMap, dynamic_range_db: float, *, logarithmic: bool) -> QuadMesh:
    at, values = _fewer_cells(levels.at, levels.values, axis=0, n_max=N_COLUMNS)
    positions, values = _fewer_cells(levels.positions, values, axis=1, n_max=N_ROWS)
    shown = decibels(values.T, levels.scaling)
    x = _cell_borders(at)
    y = np.exp(_cell_borders(np.log(positions))) if logarithmic else np.maximum(_cell_borders(positions), 0.0)
    top = float(shown.max())
    mesh = axes.pcolormesh(x, y, shown, cmap=colours(), vmin=top - dynamic_range_db, vmax=top, rasterized=True)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    return mesh


def _draw_edges(axes: Axes, levels: TimeFrequencyMap) -> None:
    begin, end = axes.get_xlim()
    inside = levels.edge < (end - begin) / 2
    for side in (begin + levels.edge, end - levels.edge):
        axes.plot(side[inside], levels.positions[inside], color="white", linewidth=2.2)
        axes.plot(side[inside], levels.positions[inside], color=style.QUIET, linewidth=0.8, linestyle=(0, (4, 3)))


def _draw_ridge(axes: Axes, ridge: Ridge) -> None:
    alone = np.where(ridge.shared, np.nan, ridge.positions)
    together = np.where(ridge.shared, ridge.positions, np.nan)
    axes.plot(ridge.at, alone, color=style.FAULT, linewidth=1.2)
    axes.plot(ridge.at, together, color=style.FAULT, linewidth=1.2, linestyle=(0, (3, 2)))


def _number(axes: Axes, ridge: Ridge, number: int) -> None:
    """Write a ridge's number on a light disc at nine tenths of its course: numbers of ridges that meet stay apart."""
    i = round((0.94 - 0.04 * (number % 3)) * (len(ridge.at) - 1))
    disc = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.FAULT, "linewidth": 0.8}
    place = float(ridge.at[i]), float(ridge.positions[i])
    axes.text(*place, str(number), ha="center", va="center", fontsize=style.SMALL_PT, color=style.FAULT, bbox=disc)


def _plain_ticks(axes: Axes, n_digits: int = 6) -> None:
    """Label 1, 2 and 5 of each decade in full, whole powers of ten included."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.{n_digits}g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _colour_bar_time_frequency(figure: Figure, mesh: QuadMesh, label: str, height_in: float) -> None:
    left = (style.WIDTH_IN - TIME_FREQUENCY_RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (height_in - TIME_FREQUENCY_BOTTOM_IN - TIME_FREQUENCY_TOP_IN) / height_in)
    axes = figure.add_axes((left, TIME_FREQUENCY_BOTTOM_IN / height_in, *size))
    bar = figure.colorbar(mesh, cax=axes)
    bar.outline.set_visible(False)
    axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    axes.set_ylabel(plain(label), color=style.INK, fontsize=style.TEXT_PT, parse_math=False)


# --------------------
# Kurtogram with the band it chose.
# --------------------


KURTOGRAM_LEFT_IN, KURTOGRAM_RIGHT_IN, KURTOGRAM_BOTTOM_IN, KURTOGRAM_TOP_IN = 0.85, 1.0, 0.55, 0.55


def kurtogram_figure(kurtogram: Kurtogram, band: BandCandidate | None = None, *, height_in: float = 4.2) -> Figure:
    """Draw the kurtosis of each band over frequency, one row per level, widest bands on top.

    Parameters
    ----------
    kurtogram : Kurtogram
    band : BandCandidate or None
        Outlined and named; None takes the kurtogram's own best one.

    Returns
    -------
    Figure
        Colours start at 0: bands below are no more impulsive than noise. Remarks on the band stand below the title.
    """
    band = kurtogram.best_band() if band is None else band
    figure = style.new_figure(height_in)
    axes = style.panel(
        figure,
        left_in=KURTOGRAM_LEFT_IN,
        right_in=KURTOGRAM_RIGHT_IN,
        bottom_in=KURTOGRAM_BOTTOM_IN,
        top_in=KURTOGRAM_TOP_IN,
    )
    axes.grid(visible=False)
    _draw_bands(figure, axes, kurtogram, height_in)
    _draw_choice(axes, kurtogram, band)
    prepared = "" if kurtogram.preparation == "none" else f", {kurtogram.preparation}"
    style.label_axes(axes, "frequency (Hz)", "number of bands", f"kurtogram of {kurtogram.source}{prepared}")
    warnings = kurtogram.warnings(band)
    style.note(axes, warnings[0] if warnings else _named(band))
    style.no_offset(axes)
    axes.set_yticks(range(len(kurtogram.levels)), [f"{round(2**level)}" for level in kurtogram.levels])
    return figure


def _draw_bands(figure: Figure, axes: Axes, kurtogram: Kurtogram, height_in: float) -> None:
    top = max(float(kurtogram.kurtosis.max()), 1e-3)
    mesh = None
    for row, level in enumerate(kurtogram.levels):
        inside = kurtogram.level == level
        edges = np.append(kurtogram.low_hz[inside], kurtogram.high_hz[inside][-1])
        values = kurtogram.kurtosis[inside][None, :]
        mesh = axes.pcolormesh(edges, [row - 0.5, row + 0.5], values, cmap=colours(), vmin=0.0, vmax=top)
    axes.set_xlim(0.0, float(kurtogram.high_hz.max()))
    axes.set_ylim(len(kurtogram.levels) - 0.5, -0.5)
    if mesh is None:
        return
    left = (style.WIDTH_IN - KURTOGRAM_RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (height_in - KURTOGRAM_BOTTOM_IN - KURTOGRAM_TOP_IN) / height_in)
    bar_axes = figure.add_axes((left, KURTOGRAM_BOTTOM_IN / height_in, *size))
    figure.colorbar(mesh, cax=bar_axes).outline.set_visible(False)
    bar_axes.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    bar_axes.set_ylabel("spectral kurtosis", color=style.INK, fontsize=style.TEXT_PT)
    style.no_offset(bar_axes)


def _draw_choice(axes: Axes, kurtogram: Kurtogram, band: BandCandidate) -> None:
    row = int(np.argmin(np.abs(kurtogram.levels - band.level)))
    x = [band.low_hz, band.high_hz, band.high_hz, band.low_hz, band.low_hz]
    y = [row - 0.5, row - 0.5, row + 0.5, row + 0.5, row - 0.5]
    axes.plot(x, y, color="white", linewidth=3.0, clip_on=False)
    axes.plot(x, y, color=style.FAULT, linewidth=1.6, clip_on=False)


def _named(band: BandCandidate) -> str:
    return plain(f"{band.low_hz:.5g} to {band.high_hz:.5g} Hz, kurtosis {band.kurtosis:.3g}")


# --------------------
# Spectral coherence over cyclic frequency and carrier, with its mean over the carriers.
# --------------------


COHERENCE_N_COLUMNS = 500  # of the map: a line of one cell must be wider than a pixel to be seen
COHERENCE_LEFT_IN, COHERENCE_RIGHT_IN, COHERENCE_BOTTOM_IN, GAP_IN, COHERENCE_TOP_IN = 0.85, 1.0, 0.55, 0.12, 0.55
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
    split = height_in - COHERENCE_TOP_IN - LINES_IN
    below = style.panel(
        figure,
        left_in=COHERENCE_LEFT_IN,
        right_in=COHERENCE_RIGHT_IN,
        bottom_in=COHERENCE_BOTTOM_IN,
        top_in=height_in - split + GAP_IN,
    )
    above = style.panel(
        figure,
        left_in=COHERENCE_LEFT_IN,
        right_in=COHERENCE_RIGHT_IN,
        bottom_in=split,
        top_in=COHERENCE_TOP_IN,
        sharex=below,
    )
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

    alpha, values = _fewer_cells(
        coherence.alpha[shown], coherence.coherence_squared[shown], axis=0, n_max=COHERENCE_N_COLUMNS
    )
    low = coherence.level(1e-3)
    high = max(float(values.max()), 2.0 * low)
    x, y = _cell_borders(alpha), _cell_borders(coherence.frequency_hz)
    mesh = axes.pcolormesh(x, y, np.maximum(values.T, low), cmap=colours(), norm=LogNorm(low, high), rasterized=True)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    left = (style.WIDTH_IN - COHERENCE_RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (split - GAP_IN - COHERENCE_BOTTOM_IN) / height_in)
    bar = figure.add_axes((left, COHERENCE_BOTTOM_IN / height_in, *size))
    figure.colorbar(mesh, cax=bar).outline.set_visible(False)
    bar.tick_params(colors=style.QUIET, labelcolor=style.INK, labelsize=style.SMALL_PT)
    bar.set_ylabel("squared coherence γ²", color=style.INK, fontsize=style.TEXT_PT)
    _plain_ticks(bar, n_digits=4)


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
