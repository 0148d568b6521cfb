"""Figures of a gear's finite elements."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from gearsig.errors import InputError
from gearsig.plot import draw_shaded, gear_mesh_figure, gear_modes_figure, gear_stress_figure, new_figure, panels_of
from tests.plot.drawn import texts_of

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
NEAR = (-0.5, 1.5, -0.5, 1.5)


def test_cells_are_drawn_whole_and_close_with_their_quality():
    figure = gear_mesh_figure(np.array([SQUARE, SQUARE + 1.0]), np.array([0.9, 0.4]), near_mm=NEAR, title="A gear")
    whole, close, bar = figure.axes
    for axes in (whole, close):
        (faces,) = axes.collections
        np.testing.assert_array_equal(faces.get_array(), [0.9, 0.4])
        assert faces.get_clim() == (0.0, 1.0)
    assert close.get_xlim() == NEAR[:2]
    assert {"x (mm)", "y (mm)", "scaled Jacobian (1: undistorted)", "A gear"} <= set(texts_of(figure))
    assert bar.get_ylim() == (0.0, 1.0)


def test_modes_have_names_a_form_and_a_border():
    axial = np.array([[0, 0, 1.0], [0, 0, -1.0], [0, 0, 1.0], [0, 0, -1.0]])
    sideways = np.array([[2.0, 0, 0]] * 4)
    figure = gear_modes_figure(SQUARE, TRIANGLES, {"100 Hz, n = 2": axial, "200 Hz, n = 0": sideways}, title="Free")
    first, second, _ = figure.axes
    image = first.images[0].get_array()
    assert image.max() == pytest.approx(1.0, abs=0.01)
    assert image.min() == pytest.approx(-1.0, abs=0.01)
    np.testing.assert_allclose(second.images[0].get_array().compressed(), 0.0)
    assert len(first.collections[0].get_segments()) == 4
    right = max(segment[:, 0].max() for segment in second.collections[0].get_segments())
    assert right == pytest.approx(1.12)
    assert {"100 Hz, n = 2", "200 Hz, n = 0", "Free"} <= set(texts_of(figure))


def test_stress_is_drawn_in_mpa_with_its_force():
    stress = np.array([1e6, 2e6, 3e6, 50e6])
    figure = gear_stress_figure(
        SQUARE, TRIANGLES, stress, near_mm=NEAR, top_pa=10e6, force=(SQUARE[2], np.array([0.0, -1.0]), "500 N")
    )
    axes = figure.axes[0]
    assert axes.images[0].get_array().max() == pytest.approx(50.0, rel=0.01)
    assert axes.images[0].get_clim() == (0.0, 10.0)
    assert {"von Mises stress (MPa)", "500 N"} <= set(texts_of(figure))
    free = gear_stress_figure(SQUARE, TRIANGLES, stress, near_mm=NEAR)
    assert free.axes[0].images[0].get_clim() == (0.0, 50.0)
    (((panel,),),) = panels_of(free)
    assert panel.unit == "von Mises stress (MPa)"
    assert np.isnan(panel.levels).any()  # where there is no gear
    assert panel.levels[np.isfinite(panel.levels)].max() == pytest.approx(50.0, rel=0.01)


def test_long_thin_triangles_are_shaded_without_streaks_or_holes():
    y = np.linspace(0.0, 1.0, 301)
    points = np.vstack([np.column_stack((np.full(len(y), x), y)) for x in (0.0, 1.0)])
    low = np.arange(len(y) - 1)
    triangles = np.vstack(
        [np.column_stack((low, low + 1, low + 301)), np.column_stack((low + 1, low + 302, low + 301))]
    )
    axes = new_figure(4.0).add_subplot()
    shaded = draw_shaded(
        axes, points, triangles, points @ [3.0, 1.0], window=(0.0, 1.0, 0.0, 1.0), limits=(0.0, 4.0), cmap="viridis"
    ).get_array()
    middle = (np.arange(shaded.shape[0]) + 0.5) / shaded.shape[0]
    assert not np.ma.getmaskarray(shaded).any()
    np.testing.assert_allclose(shaded, 3.0 * middle + middle[:, None], atol=4.0 / shaded.shape[0])


def test_oblique_triangles_leave_no_holes():
    points = np.vstack([SQUARE, np.random.default_rng(1).random((300, 2))])
    triangles = Delaunay(points).simplices
    axes = new_figure(4.0).add_subplot()
    shaded = draw_shaded(
        axes, points, triangles, points[:, 0], window=(0.0, 1.0, 0.0, 1.0), limits=(0.0, 1.0), cmap="viridis"
    ).get_array()
    assert not np.ma.getmaskarray(shaded)[1:-1, 1:-1].any()
    np.testing.assert_allclose(shaded[1:-1, 1:-1], np.broadcast_to(shaded[1, 1:-1], (638, 638)), atol=2.0 / 640)


def test_wrong_shapes_are_refused():
    with pytest.raises(InputError, match="outlines_mm has shape"):
        gear_mesh_figure(SQUARE, np.ones(4), near_mm=NEAR)
    with pytest.raises(InputError, match="quality"):
        gear_mesh_figure(np.array([SQUARE]), np.ones(2), near_mm=NEAR)
    with pytest.raises(InputError, match="shape of 'a'"):
        gear_modes_figure(SQUARE, TRIANGLES, {"a": np.ones((4, 2))})
    with pytest.raises(InputError, match="shapes is empty"):
        gear_modes_figure(SQUARE, TRIANGLES, {})
