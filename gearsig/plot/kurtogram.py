"""Kurtogram with the band it chose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.plot import style
from gearsig.plot.display import plain
from gearsig.plot.order_map import colours
from gearsig.spectra.band_choice import BandCandidate
from gearsig.spectra.kurtogram_types import Kurtogram

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT_IN, RIGHT_IN, BOTTOM_IN, TOP_IN = 0.85, 1.0, 0.55, 0.55


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
    axes = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=TOP_IN)
    axes.grid(visible=False)
    _draw_bands(figure, axes, kurtogram, height_in)
    _draw_choice(axes, kurtogram, band)
    prepared = "" if kurtogram.preparation == "none" else f", {kurtogram.preparation}"
    style.label_axes(axes, "frequency (Hz)", "number of bands", f"kurtogram of {kurtogram.source}{prepared}")
    remarks = kurtogram.remarks(band)
    style.note(axes, remarks[0] if remarks else _named(band))
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
    left = (style.WIDTH_IN - RIGHT_IN + 0.15) / style.WIDTH_IN
    size = (0.12 / style.WIDTH_IN, (height_in - BOTTOM_IN - TOP_IN) / height_in)
    bar_axes = figure.add_axes((left, BOTTOM_IN / height_in, *size))
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
