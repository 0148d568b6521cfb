"""A simulation compared with a recording: spectra, averages and band levels, with their differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.comparison import BEYOND, BandLevel, LevelPair, LineLevel
from gearsig.errors import InputError
from gearsig.formatting import unit_text
from gearsig.orders import SynchronousAverage
from gearsig.plot import _style as style
from gearsig.plot._cursors import ROW_IN, Cursor, draw, n_rows, place
from gearsig.plot._style import above_zero, envelope, plain, thin, with_unit
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


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
    """Draw both spectra in one panel, and below it the difference of each line of the simulation in dB.

    Parameters
    ----------
    recorded, simulated : Spectrum
        Over the same axis, in the same unit and scaling.
    lines : sequence of LineLevel
        Those visible in neither record are left out. Whiskers: twice the repeatability. Triangle: the line is missing
        in one record, and the difference is at least that large.
    cursors : sequence of Cursor
    limits : (float, float) or None
        Of the axis; None: the range common to both.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If axes, units or scalings differ, or the limits do not ascend.
    """
    for name in ("axis", "scaling", "unit"):
        a, b = getattr(recorded, name), getattr(simulated, name)
        if a != b:
            raise InputError(f"the spectra differ in {name}: {a!r} and {b!r}", allowed="the same")
    low, high = limits or (0.0, float(min(recorded.positions[-1], simulated.positions[-1])))
    if not low < high:
        raise InputError(f"limits are {low:g} to {high:g}", allowed="ascending")
    shown = [line for line in lines if line.is_seen and low <= line.order <= high]
    placed = place(cursors, (low, high), style.WIDTH_IN - 0.85 - 0.2)
    figure, panels = style.panels(
        (2.3, 1.5) if shown else (2.3,), top_in=0.68 + ROW_IN * n_rows(placed), row_gap_in=0.35, share_x=True
    )
    curves = _draw_spectra(panels[0], (recorded, simulated), (low, high))
    draw(panels[0], placed)
    style.label_axes(panels[0], "", with_unit(recorded.scaling, recorded.unit))
    if shown:
        curves += _draw_differences(panels[1], shown)
        style.label_axes(panels[1], "", "sim. − rec. (dB)")
    style.label_axes(panels[-1], recorded.axis_label, panels[-1].get_ylabel())
    panels[0].set_xlim(low, high)
    style.head(figure, title, curves)
    return figure


def _draw_spectra(axes: Axes, spectra: tuple[Spectrum, Spectrum], limits: tuple[float, float]) -> list[Line2D]:
    curves: list[Line2D] = []
    tops, floors = [], []
    for spectrum, (name, colour) in zip(spectra, SIDES, strict=True):
        start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
        # The first lines contain the sensor's offset and its leakage by the window.
        start = max(start, min(1 + int(2 * spectrum.noise_bandwidth / spectrum.resolution), stop - 2))
        values = above_zero(spectrum.values[start:stop])
        at, _, peaks = envelope(spectrum.positions[start:stop], values, 1200)
        curves += axes.plot(at, peaks, color=colour, linewidth=0.9, label=name, zorder=2, alpha=0.9)
        tops.append(float(values.max()))
        floors.append(float(np.percentile(values, 5)))
    axes.set_yscale("log")
    axes.set_ylim(max(min(floors), max(tops) * 1e-7) / 2.0, 2.5 * max(tops))
    return curves


def _draw_differences(axes: Axes, lines: Sequence[LineLevel]) -> list[Line2D]:
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1)
    marks: list[Line2D] = []
    for kind, colour in reversed(KIND_COLOURS.items()):
        alike = [line for line in lines if line.kind == kind]
        if not alike:
            continue
        x = np.array([line.order for line in alike])
        y = np.array([line.level.difference_db for line in alike])
        errors = np.array([BEYOND * line.level.repeatability_db for line in alike])
        axes.vlines(x, 0.0, y, color=colour, linewidth=1.0, alpha=0.45, zorder=2)
        axes.vlines(x, y - errors, y + errors, color=colour, linewidth=2.4, alpha=0.28, zorder=2.2)
        size = 3.0 if kind == "sideband" else 4.5
        looks = {"color": colour, "linestyle": "none", "markeredgewidth": 0.0, "markersize": size, "zorder": 3}
        marks += axes.plot(x, y, "o", label=KIND_WORDS[kind], **looks)  # type: ignore[arg-type]
        bounds = np.array([not (line.simulated_is_seen and line.recorded_is_seen) for line in alike])
        looks |= {"markersize": size + 1.5}
        for sign, marker in ((1, "^"), (-1, "v")):
            of_sign = bounds & (np.sign(y) == sign)
            axes.plot(x[of_sign], y[of_sign], marker, **looks)  # type: ignore[arg-type]
    largest = max(6.0, max(abs(line.level.difference_db) for line in lines) * 1.15)
    axes.set_ylim(-largest, largest)
    style.no_offset(axes)
    return marks[::-1]


def difference_bars(axes: Axes, x: FloatArray, levels: Sequence[LevelPair], width: float) -> None:
    """Draw differences as bars with whiskers of twice the repeatability; smaller differences are pale."""
    y = np.array([level.difference_db for level in levels])
    beyond = np.array([level.is_beyond for level in levels])
    axes.axhline(0.0, color=style.QUIET, linewidth=0.8, zorder=1)
    for bars, alpha in ((beyond, 0.85), (~beyond, 0.3)):
        axes.bar(x[bars], y[bars], width, color=style.SIMULATED, alpha=alpha, linewidth=0, zorder=2)
    errors = np.array([BEYOND * level.repeatability_db for level in levels])
    axes.vlines(x, y - errors, y + errors, color=style.INK, linewidth=0.9, zorder=3)
    largest = max(3.0, float(np.max(np.abs(y) + errors, initial=0.0)) * 1.1)
    axes.set_ylim(-largest, largest)
    style.no_offset(axes)


def average_overlay_figure(
    recorded: SynchronousAverage,
    simulated: SynchronousAverage,
    tooth_levels: Sequence[LevelPair] = (),
    *,
    n_teeth: int | None = None,
    title: str = "",
) -> Figure:
    """Draw both averages over a revolution, its first teeth enlarged, and each tooth's difference in dB.

    Parameters
    ----------
    recorded, simulated : SynchronousAverage
        Of one shaft, aligned, at the same angles. Bands: twice the standard error.
    tooth_levels : sequence of LevelPair
        One per tooth, from angle 0; empty: no such panel.
    n_teeth : int or None
        Draw a tick per tooth.
    title : str

    Returns
    -------
    Figure
        If one is more than four times as large as the other, each is divided by its own rms, and the axis says so.

    Raises
    ------
    InputError
        If the angles differ.
    """
    if len(recorded.values) != len(simulated.values):
        raise InputError(f"{len(recorded.values)} and {len(simulated.values)} angles", allowed="the same angles")
    figure, panels = style.panels((1.5,) * (3 if tooth_levels else 2))
    sizes = [float(np.sqrt(np.mean(a.values**2))) for a in (recorded, simulated)]
    if min(sizes) > 0 and max(sizes) / min(sizes) <= 4.0:
        scales, label = (1.0, 1.0), with_unit("average", recorded.unit)
    else:  # on a common scale, the smaller one would be a flat line
        scales, label = (sizes[0] or 1.0, sizes[1] or 1.0), "over its own rms"
    end = 360.0 * 4 / n_teeth if n_teeth else 60.0
    for axes, limit in zip(panels[:2], (360.0, end), strict=True):
        curves = _overlay(axes, (recorded, simulated), scales, limit)
        style.label_axes(axes, "", label)
        style.no_offset(axes)
    if n_teeth:
        panels[0].set_xticks(np.arange(n_teeth + 1) * 360.0 / n_teeth, minor=True)
    panels[0].set_xticks(range(0, 361, 45))
    style.label_axes(panels[1], f"angle of {recorded.shaft or 'the shaft'} (deg)", label)
    if tooth_levels:
        difference_bars(panels[2], np.arange(1.0, len(tooth_levels) + 1), tooth_levels, 0.75)
        panels[2].set_xlim(0.3, len(tooth_levels) + 0.7)
        style.label_axes(panels[2], "tooth, from angle 0", "sim. − rec. (dB)")
    style.head(figure, title, curves)
    return figure


def _overlay(
    axes: Axes, averages: tuple[SynchronousAverage, SynchronousAverage], scales: tuple[float, float], end: float
) -> list[Line2D]:
    axes.axhline(0, color=style.QUIET, linewidth=0.6, zorder=1)
    curves: list[Line2D] = []
    for average, scale, (name, colour) in zip(averages, scales, SIDES, strict=True):
        n = len(average.values)
        around = np.arange(n + 1)[np.arange(n + 1) * 360.0 / n <= end]  # including the first again at 360°
        x, y = around * 360.0 / n, average.values[around % n] / scale
        e = 2.0 * average.standard_error[around % n] / scale
        axes.fill_between(x, y - e, y + e, color=colour, alpha=0.2, linewidth=0, zorder=1.5)
        curves += axes.plot(*thin(x, y), color=colour, linewidth=1.0, label=name, alpha=0.9, zorder=2)
    axes.set_xlim(0.0, end)
    return curves


def band_levels_figure(bands: Sequence[BandLevel], unit: str = "", *, title: str = "") -> Figure:
    """Draw band levels side by side, their differences below, and below these the agreement of their lines (FRAC).

    Parameters
    ----------
    bands : sequence of BandLevel
        On one axis, ascending.
    unit : str
        Reference unit of the levels; empty if not known.
    title : str

    Returns
    -------
    Figure
        Without the FRAC panel if no band has one.

    Raises
    ------
    InputError
        Without bands.
    """
    if not bands:
        raise InputError("there are no bands to draw", allowed="at least one")
    alike = any(band.agreement is not None for band in bands)
    figure, panels = style.panels((1.7,) * (3 if alike else 2), bottom_in=0.95, row_gap_in=0.3)
    x = np.arange(len(bands), dtype=np.float64)
    curves: list[Line2D] = []
    edges = np.repeat(np.arange(len(bands) + 1) - 0.5, 2)[1:-1]
    for (name, colour), key in zip(SIDES, ("recorded_db", "simulated_db"), strict=True):
        levels = np.repeat([float(getattr(band.level, key)) for band in bands], 2)
        curves += panels[0].plot(edges, levels, color=colour, linewidth=1.4, label=name, zorder=2)
    style.no_offset(panels[0])
    style.label_axes(panels[0], "", f"level (dB re 1 {unit_text(unit)})" if unit else "level (dB)")
    difference_bars(panels[1], x, [band.level for band in bands], 0.7)
    style.label_axes(panels[1], "", "sim. − rec. (dB)")
    if alike:
        curves += _draw_agreement(panels[2], bands)
    for axes in panels:
        axes.set_xlim(-0.6, len(bands) - 0.4)
        axes.set_xticks(x, [plain(band.label, 22) for band in bands], rotation=45, ha="right", parse_math=False)
        axes.tick_params(labelbottom=axes is panels[-1])
    style.head(figure, title, curves)
    return figure


def _draw_agreement(axes: Axes, bands: Sequence[BandLevel]) -> list[Line2D]:
    compared = [(i, band.agreement) for i, band in enumerate(bands) if band.agreement is not None]
    x = np.array([i for i, _ in compared])
    # FRAC of the magnitudes of two noises (Rayleigh distributed): (E|x| E|y|)² / (E|x|² E|y|²).
    axes.axhline(np.pi**2 / 16, color=style.QUIET, linewidth=0.8, linestyle=":", zorder=1)
    curves: list[Line2D] = []
    for name, fracs, marker, colour in (
        ("FRAC, complex", [agreement.complex_frac for _, agreement in compared], "o", style.INK),
        ("FRAC, magnitudes", [agreement.magnitude_frac for _, agreement in compared], "s", style.QUIET),
    ):
        y, errors = np.array([frac.value for frac in fracs]), 2.0 * np.array([frac.repeatability for frac in fracs])
        axes.vlines(x, np.maximum(y - errors, 0), np.minimum(y + errors, 1), color=colour, linewidth=1.0, zorder=2)
        looks = {"linestyle": "none", "markersize": 5.0, "zorder": 3, "label": name}
        looks |= {"markerfacecolor": "white"} if marker == "s" else {}
        curves += axes.plot(x, y, marker, color=colour, **looks)  # type: ignore[arg-type]
    chance = np.array([agreement.complex_by_chance for _, agreement in compared])
    looks = {"linestyle": "none", "markersize": 12, "markeredgewidth": 1.4, "color": style.FLOOR, "zorder": 1.5}
    curves += axes.plot(x, chance, "_", label="complex, by chance", **looks)  # type: ignore[arg-type]
    axes.set_ylim(-0.04, 1.04)
    style.label_axes(axes, "", "FRAC (0 to 1)")
    style.no_offset(axes)
    return curves
