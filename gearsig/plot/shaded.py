"""Values at the corners of triangles as an image: long thin ones, which renderers streak, come out smooth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
PIXELS = 640
"""Of the image, across."""
SPACING = 0.8
"""Of the points at which a triangle is sampled, in pixels."""


def draw_shaded(
    axes: Axes,
    points: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    *,
    window: tuple[float, float, float, float],
    limits: tuple[float, float],
    cmap: str,
) -> AxesImage:
    """Draw values that run straight over each triangle; where triangles lie on each other, their mean.

    Parameters
    ----------
    points : array, (n, 2)
    triangles : array of int, (m, 3)
    values : array, (n,)
    window : tuple
        Low and high x, low and high y of what is drawn; the axes are as long for it both ways.
    limits : tuple
        Values at the ends of the colours.
    cmap : str
    """
    per_unit = PIXELS / (window[1] - window[0])
    shape = tuple(round((window[i + 1] - window[i]) * per_unit) for i in (2, 0))
    corners = (np.asarray(points)[triangles] - [window[0], window[2]]) * per_unit  # (m, 3, 2), in pixels
    shown = np.all((corners.max(axis=1) >= 0.0) & (corners.min(axis=1) < shape[::-1]), axis=1)
    # Each triangle begins where its two shorter sides meet: a long thin one is then sampled along its length only.
    far = np.linalg.norm(np.roll(corners[shown], -1, axis=1) - np.roll(corners[shown], -2, axis=1), axis=2).argmax(
        axis=1
    )
    order = (far[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners[shown], order[:, :, None], axis=1)
    values_at = np.asarray(values)[np.take_along_axis(triangles[shown], order, axis=1)]
    where, which = _samples(corners)
    sampled = np.einsum("ij,ij->i", values_at[which], where)
    places = np.einsum("ijk,ij->ik", corners[which], where).astype(np.int64)
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
    """Give pixels between two known ones their mean: oblique samples step over one here and there."""
    for axis in (0, 1):
        before, after = (np.roll(image, step, axis) for step in (1, -1))
        between = ~known & np.roll(known, 1, axis) & np.roll(known, -1, axis)
        image[between] = (before[between] + after[between]) / 2.0
        known |= between


def _samples(corners: FloatArray) -> tuple[FloatArray, Any]:
    """Barycentric coordinates (k, 3) of points close enough for pixels, and their triangles (k,)."""
    sides = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2)
    n = np.maximum(np.ceil(sides / SPACING), 1.0).astype(np.int64)
    count = (n[:, 0] + 1) * (n[:, 1] + 1)
    which = np.repeat(np.arange(len(corners)), count)
    number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    i, j = np.divmod(number, n[which, 1] + 1)
    inside = i * n[which, 1] + j * n[which, 0] <= n[which, 0] * n[which, 1]
    which = which[inside]
    u, v = i[inside] / n[which, 0], j[inside] / n[which, 1]
    return np.column_stack((1.0 - u - v, u, v)), which
