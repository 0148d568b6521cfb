"""A simulation's order spectrum over a recording's, and the difference of every line that counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.types import BEYOND, LevelPair, LineLevel
from gearsig.errors import InputError
from gearsig.plot import series, style
from gearsig.plot.cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot.display import above_zero, with_unit
from gearsig.plot.thin import envelope
from gearsig.spectra.types import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT_IN, RIGHT_IN = 0.85, 0.2
UPPER_IN, LOWER_IN, GAP_IN, BOTTOM_IN = 2.3, 1.5, 0.35, 0.55
TITLE_IN = 0.68
POINTS = 1200
KIND_COLOURS = {"mesh": style.MESH, "shaft": style.SHAFT, "sideband": style.FLOOR, "other": style.INK}
KIND_WORDS = {"mesh": "mesh harmonics", "shaft": "shaft orders", "sideband": "sidebands", "other": "other lines"}
SIDES = (("recorded", style.MEASURED), ("simulated", style.SIMULATED))


def order_overlay_figure(
    recorded: Spectrum,
    simulated: Spectrum,
    lines: Sequence[LineLevel] = (),
    cursors: Sequence[Cursor] = (),
    *,
    limits: tuple[float, float] | None = None,
    title: str = "",
) -> Figure:
    """Draw both spectra in one panel, and below it how far each line of the simulation is off, in dB.

    Parameters
    ----------
    recorded, simulated : Spectrum
        Over the same axis, in the same unit and scaling.
    lines : sequence of LineLevel
        Those that neither record shows are left out. Whiskers: twice the repeatability. A triangle: the line is missing
        on one side, and the difference is at least so large.
    cursors : sequence of Cursor
    limits : (float, float) or None
        Of the axis; None: all that both have.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If axes, units or scalings differ, or the limits do not ascend.
    """
    _check_alike(recorded, simulated)
    low, high = limits or (0.0, float(min(recorded.positions[-1], simulated.positions[-1])))
    if not low < high:
        raise InputError(f"limits are {low:g} to {high:g}", allowed="ascending")
    shown = [line for line in lines if line.is_seen and low <= line.order <= high]
    width = style.WIDTH_IN - LEFT_IN - RIGHT_IN
    placed = place(cursors, (low, high), width)
    top = TITLE_IN + ROW_IN * n_rows(placed)
    below = LOWER_IN + GAP_IN if shown else 0.0
    figure = style.new_figure(BOTTOM_IN + below + UPPER_IN + top)
    upper = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN + below, top_in=top)
    curves = _draw_spectra(upper, (recorded, simulated), (low, high))
    draw(upper, placed, (width, UPPER_IN))
    label = recorded.axis_label
    style.label_axes(upper, "" if shown else label, with_unit(recorded.scaling, recorded.unit))
    if shown:
        upper.tick_params(labelbottom=False)
        above = top + UPPER_IN + GAP_IN
        lower = style.panel(figure, left_in=LEFT_IN, right_in=RIGHT_IN, bottom_in=BOTTOM_IN, top_in=above, sharex=upper)
        curves += _draw_differences(lower, shown)
        style.label_axes(lower, label, "sim. − rec. (dB)")
    upper.set_xlim(low, high)
    series.headline(figure, title)
    series.legend_row(figure, curves, left_in=LEFT_IN, top_in=series.NAMES_AT_IN)
    return figure


def _check_alike(recorded: Spectrum, simulated: Spectrum) -> None:
    for name in ("axis", "scaling", "unit"):
        a, b = getattr(recorded, name), getattr(simulated, name)
        if a != b:
            raise InputError(f"the spectra differ in {name}: {a!r} and {b!r}", allowed="the same")


def _draw_spectra(axes: Axes, spectra: tuple[Spectrum, Spectrum], limits: tuple[float, float]) -> list:  # type: ignore[type-arg]  # of Line2D, imported for checking only
    curves = []
    tops, floors = [], []
    for spectrum, (name, colour) in zip(spectra, SIDES, strict=True):
        start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
        # The first lines hold the sensor's offset and the window's foot around it.
        start = max(start, min(1 + int(2 * spectrum.noise_bandwidth / spectrum.resolution), stop - 2))
        values = above_zero(spectrum.values[start:stop])
        at, _, peaks = envelope(spectrum.positions[start:stop], values, POINTS)
        curves += axes.plot(at, peaks, color=colour, linewidth=0.9, label=name, zorder=2, alpha=0.9)
        tops.append(float(values.max()))
        floors.append(float(np.percentile(values, 5)))
    axes.set_yscale("log")
    axes.set_ylim(max(min(floors), max(tops) * 1e-7) / 2.0, 2.5 * max(tops))
    return curves


def _draw_differences(axes: Axes, lines: Sequence[LineLevel]) -> list:  # type: ignore[type-arg]  # of Line2D
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1)
    marks = []
    for kind, colour in reversed(KIND_COLOURS.items()):
        own = [line for line in lines if line.kind == kind]
        if not own:
            continue
        x = np.array([line.order for line in own])
        y = np.array([line.level.difference_db for line in own])
        errors = np.array([BEYOND * line.level.repeatability_db for line in own])
        axes.vlines(x, 0.0, y, color=colour, linewidth=1.0, alpha=0.45, zorder=2)
        _whiskers(axes, x, y, errors, colour)
        size = 3.0 if kind == "sideband" else 4.5
        looks = {"color": colour, "linestyle": "none", "markeredgewidth": 0.0, "markersize": size, "zorder": 3}
        marks += axes.plot(x, y, "o", label=KIND_WORDS[kind], **looks)  # type: ignore[arg-type]
        bounds = np.array([not (line.simulated_is_seen and line.recorded_is_seen) for line in own])
        looks |= {"markersize": size + 1.5}
        for sign, marker in ((1, "^"), (-1, "v")):
            which = bounds & (np.sign(y) == sign)
            axes.plot(x[which], y[which], marker, **looks)  # type: ignore[arg-type]
    largest = max(6.0, max(abs(line.level.difference_db) for line in lines) * 1.15)
    axes.set_ylim(-largest, largest)
    style.no_offset(axes)
    return marks[::-1]


def _whiskers(axes: Axes, x: FloatArray, y: FloatArray, errors: FloatArray, colour: str) -> None:
    axes.vlines(x, y - errors, y + errors, color=colour, linewidth=2.4, alpha=0.28, zorder=2.2)


def difference_bars(axes: Axes, x: FloatArray, levels: Sequence[LevelPair], width: float) -> None:
    """Draw differences as bars with whiskers of twice the repeatability; those within it are pale."""
    y = np.array([level.difference_db for level in levels])
    beyond = np.array([level.is_beyond for level in levels])
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1)
    for which, alpha in ((beyond, 0.85), (~beyond, 0.3)):
        axes.bar(x[which], y[which], width, color=style.SIMULATED, alpha=alpha, linewidth=0, zorder=2)
    errors = np.array([BEYOND * level.repeatability_db for level in levels])
    axes.vlines(x, y - errors, y + errors, color=style.INK, linewidth=0.9, zorder=3)
    largest = max(3.0, float(np.max(np.abs(y) + errors, initial=0.0)) * 1.1)
    axes.set_ylim(-largest, largest)
    style.no_offset(axes)
