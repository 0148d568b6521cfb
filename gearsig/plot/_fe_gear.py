"""Finite-element results of a gear: mesh quality, mode shapes, stress under load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.plot import _style as style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage


IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
Window = tuple[float, float, float, float]
"""Lower and upper x, lower and upper y, in mm."""


def draw_shaded(
    axes: Axes,
    points: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    *,
    window: Window,
    limits: tuple[float, float],
    cmap: str,
) -> AxesImage:
    """Draw values interpolated linearly over each triangle; where triangles overlap, their mean.

    Parameters
    ----------
    points : array, (n, 2)
    triangles : array of int, (m, 3)
    values : array, (n,)
    window : tuple
        Lower and upper x, lower and upper y of the region drawn, with equal scales in x and y.
    limits : tuple
        Values at the ends of the colour scale.
    cmap : str
    """
    per_unit = 640 / (window[1] - window[0])
    shape = tuple(round((window[i + 1] - window[i]) * per_unit) for i in (2, 0))
    corners = (np.asarray(points)[triangles] - [window[0], window[2]]) * per_unit  # (m, 3, 2), in pixels
    shown = np.all((corners.max(axis=1) >= 0.0) & (corners.min(axis=1) < shape[::-1]), axis=1)
    # Start each triangle where its two shorter sides meet, so that a long thin one is sampled along its length only.
    far = np.linalg.norm(np.roll(corners[shown], -1, axis=1) - np.roll(corners[shown], -2, axis=1), axis=2).argmax(
        axis=1
    )
    order = (far[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners[shown], order[:, :, None], axis=1)
    values_at = np.asarray(values)[np.take_along_axis(triangles[shown], order, axis=1)]
    where, of_triangle = _samples(corners)
    sampled = np.einsum("ij,ij->i", values_at[of_triangle], where)
    places = np.einsum("ijk,ij->ik", corners[of_triangle], where).astype(np.int64)
    inside = np.all((places >= 0) & (places < shape[::-1]), axis=1)
    flat = places[inside, 1] * shape[1] + places[inside, 0]
    counts = np.bincount(flat, minlength=shape[0] * shape[1])
    totals = np.bincount(flat, sampled[inside], minlength=shape[0] * shape[1])
    known = (counts > 0).reshape(shape)
    image = (totals / np.maximum(counts, 1)).reshape(shape)
    _close_holes(image, known)
    return axes.imshow(
        np.ma.masked_array(image, ~known),
        origin="lower",
        extent=window,
        vmin=limits[0],
        vmax=limits[1],
        cmap=cmap,
        interpolation="antialiased",
    )


def _close_holes(image: FloatArray, known: Any) -> None:
    """Fill pixels between two known ones with their mean, as oblique samples miss some pixels."""
    for axis in (0, 1):
        before, after = (np.roll(image, step, axis) for step in (1, -1))
        between = ~known & np.roll(known, 1, axis) & np.roll(known, -1, axis)
        image[between] = (before[between] + after[between]) / 2.0
        known |= between


def _samples(corners: FloatArray) -> tuple[FloatArray, Any]:
    """Barycentric coordinates (k, 3) of points at pixel spacing, and their triangles (k,)."""
    sides = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2)
    n = np.maximum(np.ceil(sides / 0.8), 1.0).astype(np.int64)
    count = (n[:, 0] + 1) * (n[:, 1] + 1)
    triangles = np.repeat(np.arange(len(corners)), count)
    number = np.arange(len(triangles)) - np.repeat(np.cumsum(count) - count, count)
    i, j = np.divmod(number, n[triangles, 1] + 1)
    inside = i * n[triangles, 1] + j * n[triangles, 0] <= n[triangles, 0] * n[triangles, 1]
    triangles = triangles[inside]
    u, v = i[inside] / n[triangles, 0], j[inside] / n[triangles, 1]
    return np.column_stack((1.0 - u - v, u, v)), triangles


COLUMNS = 3
TALL_IN = 3.95


def gear_mesh_figure(outlines_mm: FloatArray, quality: FloatArray, *, near_mm: Window, title: str = "") -> Figure:
    """Draw the cells of a gear seen along its shaft, coloured by quality, with a close view of a tooth.

    Parameters
    ----------
    outlines_mm : array, (n_faces, n_edge_points, 2)
        Points around each face.
    quality : array, (n_faces,)
        Scaled Jacobian: 1 for a parallelepiped, 0 where a cell folds.
    near_mm : tuple
        Lower and upper x, lower and upper y of the close view.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If the outlines have another shape, or the quality has another number of faces.
    """
    from matplotlib.collections import PolyCollection

    outlines = np.asarray(outlines_mm, dtype=np.float64)
    if outlines.ndim != 3 or outlines.shape[2] != 2:
        raise InputError(f"outlines_mm has shape {outlines.shape}", allowed="(n_faces, n_edge_points, 2)")
    values = style.checked_values(quality, len(outlines), "quality")
    wide_in, close_in = TALL_IN, 2.95
    figure, panels = style.panels(
        (TALL_IN,), (wide_in, close_in), left_in=0.7, right_in=1.05, top_in=0.4, column_gap_in=0.35
    )
    for axes, line in zip(panels, (0.15, 0.6), strict=True):
        _frame(axes)
        faces = PolyCollection(list(outlines), edgecolors=style.INK, linewidths=line, cmap="viridis")
        faces.set_array(values)
        faces.set_clim(0.0, 1.0)
        axes.add_collection(faces)
    whole, close = panels
    reach = 1.03 * float(np.abs(outlines).max())
    whole.set(xlim=(-reach, reach), ylim=(-reach, reach))
    x_low, x_high, y_low, y_high = near_mm
    half = max(y_high - y_low, (x_high - x_low) * TALL_IN / close_in) / 2.0
    close.set_xlim(x_high - 2.0 * half * close_in / TALL_IN, x_high)
    close.set_ylim((y_low + y_high) / 2.0 - half, (y_low + y_high) / 2.0 + half)
    style.label_axes(whole, "x (mm)", "y (mm)")
    style.label_axes(close, "x (mm)", "")
    style.colour_bar(close, faces, "scaled Jacobian (1: undistorted)")
    style.head(figure, title)
    return figure


def gear_modes_figure(
    points_mm: FloatArray, triangles: IntArray, shapes: Mapping[str, FloatArray], *, title: str = ""
) -> Figure:
    """Draw mode shapes seen along the shaft: axial motion as colour, in-plane motion as exaggerated shape.

    Parameters
    ----------
    points_mm : array, (n, 2)
    triangles : array of int, (m, 3)
    shapes : mapping
        Name of the mode, e.g. "3875 Hz, n = 2" → array (n, 3), motion along x, y, z in any unit; each is scaled to its
        maximum.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If there are no shapes, or one does not have three values for each point.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    if not shapes:
        raise InputError("shapes is empty", remedy="give at least one mode")
    n_rows = -(-len(shapes) // COLUMNS)
    figure, panels = style.panels(
        (2.45,) * n_rows,
        (1.0,) * COLUMNS,
        left_in=0.15,
        right_in=1.2,
        bottom_in=0.1,
        row_gap_in=0.3,
        column_gap_in=0.15,
    )
    for axes, (name, shape) in zip(panels, shapes.items(), strict=False):
        motion = np.asarray(shape, dtype=np.float64)
        if motion.shape != (len(points), 3):
            raise InputError(f"shape of {name!r} is {motion.shape}", allowed=f"({len(points)}, 3)")
        drawn = _draw_shape(axes, points, triangles, motion / np.abs(motion).max())
        style.write(axes, 0.0, 1.0, name, colour=style.INK)
    style.colour_bar(panels[COLUMNS - 1], drawn, "axial motion over largest motion")
    for axes in panels[len(shapes) :]:
        axes.remove()
    style.head(figure, title)
    return figure


def gear_stress_figure(
    points_mm: FloatArray,
    triangles: IntArray,
    stress_pa: FloatArray,
    *,
    near_mm: Window,
    top_pa: float | None = None,
    force: tuple[FloatArray, FloatArray, str] | None = None,
    note: str = "",
    title: str = "",
) -> Figure:
    """Draw the von Mises stress on the end face.

    Parameters
    ----------
    points_mm : array, (n, 2)
        Of the undeformed body, or with displacement already added.
    triangles : array of int, (m, 3)
    stress_pa : array, (n,)
    near_mm : tuple
        Lower and upper x, lower and upper y.
    top_pa : float or None
        Upper end of the colour scale; higher stress has the last colour. None: the maximum stress shown.
    force : (place (2,) in mm, direction (2,), text) or None
        An arrow that ends at that place.
    note : str
        Text below the title.
    title : str

    Returns
    -------
    Figure
    """
    points = np.asarray(points_mm, dtype=np.float64)
    stress = style.checked_values(stress_pa, len(points), "stress_pa") * 1e-6
    wide_in = min(6.8, TALL_IN * (near_mm[1] - near_mm[0]) / (near_mm[3] - near_mm[2]))
    width_in = max(5.0, 1.9 + wide_in)
    figure, (axes,) = style.panels(
        (TALL_IN,), left_in=0.75, right_in=width_in - 0.75 - wide_in, top_in=0.4, width_in=width_in
    )
    shown = stress[_inside(points, near_mm)]
    top = float(shown.max()) if top_pa is None else top_pa * 1e-6
    drawn = _draw_stress(axes, points, triangles, stress, near_mm, (0.0, top), "viridis")
    if force is not None:
        place, direction, text = np.asarray(force[0]), np.asarray(force[1]), force[2]
        span = 0.16 * (near_mm[3] - near_mm[2])
        tail = place - span * direction / np.hypot(*direction)
        ends = [(float(x), float(y)) for x, y in (place, tail)]
        axes.annotate("", xy=ends[0], xytext=ends[1], arrowprops={"arrowstyle": "-|>", "color": style.FAULT, "lw": 2.0})
        style.put_text(axes, *ends[1], text, colour=style.FAULT, ha="center", va="bottom")
    style.label_axes(axes, "x (mm)", "y (mm)")
    if note:
        style.put_text(axes, 0.0, 1.0 + 0.09 / TALL_IN, note, transform=axes.transAxes, va="center")
    beyond = top < float(shown.max())
    style.colour_bar(axes, drawn, "von Mises stress (MPa)", extend="max" if beyond else "neither")
    style.head(figure, title)
    return figure


def stress_maps_figure(
    points_mm: FloatArray,
    triangles: IntArray,
    stress_pa: Mapping[str, FloatArray],
    *,
    near_mm: Window,
    title: str = "",
) -> Figure:
    """Draw several stresses on the end face side by side; signed ones have white at 0.

    Parameters
    ----------
    points_mm : array, (n, 2)
    triangles : array of int, (m, 3)
    stress_pa : mapping
        Name → (n,).
    near_mm : tuple
        Lower and upper x, lower and upper y.
    title : str

    Returns
    -------
    Figure

    Raises
    ------
    InputError
        If there is no stress, or an array differs in length from the points.
    """
    if not stress_pa:
        raise InputError("stress_pa is empty", remedy="give at least one stress")
    points = np.asarray(points_mm, dtype=np.float64)
    n_rows = -(-len(stress_pa) // 2)
    figure, panels = style.panels(
        (3.4,) * n_rows, (1.0, 1.0), right_in=0.9, top_in=0.62, column_gap_in=1.5, row_gap_in=0.85
    )
    inside = _inside(points, near_mm)
    for axes, (name, values) in zip(panels, stress_pa.items(), strict=False):
        stress = style.checked_values(values, len(points), name) * 1e-6
        shown = stress[inside]
        signed = bool(shown.min() < -0.05 * shown.max())
        top = max(float(np.quantile(np.abs(shown), 0.995)), 1e-12)  # the peak at the force exceeds it
        low, colours = (-top, "RdBu_r") if signed else (0.0, "viridis")
        drawn = _draw_stress(axes, points, triangles, stress, near_mm, (low, top), colours)
        style.label_axes(axes, "x (mm)", "y (mm)", name)
        style.colour_bar(axes, drawn, "MPa", extend="both" if signed else "max")
    for axes in panels[len(stress_pa) :]:
        axes.remove()
    style.head(figure, title)
    return figure


def _draw_shape(axes: Axes, points: FloatArray, triangles: IntArray, motion: FloatArray) -> Any:
    reach = float(np.abs(points).max())
    moved = points + 0.12 * reach * motion[:, :2]
    end = 1.15 * reach
    drawn = draw_shaded(
        axes, moved, triangles, motion[:, 2], window=(-end, end, -end, end), limits=(-1.0, 1.0), cmap="RdBu_r"
    )
    _draw_border(axes, moved, points, triangles)
    axes.set(xlim=(-end, end), ylim=(-end, end), aspect="equal")
    axes.set_axis_off()
    return drawn


def _inside(points: FloatArray, near_mm: Window) -> NDArray[np.bool_]:
    """Return which points lie in a window: lower and upper x, lower and upper y."""
    (x, y), (left, right, bottom, top) = points.T[:2], near_mm
    inside: NDArray[np.bool_] = (x > left) & (x < right) & (y > bottom) & (y < top)
    return inside


def _draw_stress(
    axes: Axes,
    points: FloatArray,
    triangles: IntArray,
    stress: FloatArray,
    near_mm: Window,
    limits: tuple[float, float],
    colours: str,
) -> Any:
    """Draw a stress with the body's outline in a frame around the window; return the mappable for a colour bar."""
    _frame(axes)
    drawn = draw_shaded(axes, points, triangles, stress, window=near_mm, limits=limits, cmap=colours)
    _draw_border(axes, points, points, triangles)
    axes.set_xlim(*near_mm[:2])
    axes.set_ylim(*near_mm[2:])
    return drawn


def _frame(axes: Axes) -> None:
    """Draw a box with equal scales in x and y."""
    axes.grid(visible=False)
    axes.spines[:].set_visible(True)
    axes.spines[:].set(color=style.QUIET, linewidth=0.8)
    axes.set_aspect("equal", adjustable="box")


def _draw_border(axes: Axes, moved: FloatArray, points: FloatArray, triangles: IntArray) -> None:
    """Draw edges that belong to one triangle only; coincident points of neighbouring sectors count as one."""
    from matplotlib.collections import LineCollection

    _, first, same = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    corners = first[same.ravel()][triangles]
    edges = np.sort(np.concatenate((corners[:, :2], corners[:, 1:], corners[:, ::2])), axis=1)
    unique, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    axes.add_collection(LineCollection(list(moved[unique[count == 1]]), colors=style.QUIET, linewidths=0.5))
