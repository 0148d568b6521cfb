"""Figures of a gear's finite elements."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.text import Text

from gearsig.errors import InputError
from gearsig.plot.fe_gear import gear_mesh_figure, gear_modes_figure, gear_stress_figure

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
NEAR = (-0.5, 1.5, -0.5, 1.5)


def _texts(figure):
    figure.savefig(BytesIO(), format="png", dpi=40)
    return {text.get_text().strip() for text in figure.findobj(Text) if text.get_text()}


def test_cells_are_drawn_whole_and_close_with_their_quality():
    figure = gear_mesh_figure(np.array([SQUARE, SQUARE + 1.0]), np.array([0.9, 0.4]), near_mm=NEAR, title="A gear")
    whole, close, bar = figure.axes
    for axes in (whole, close):
        (faces,) = axes.collections
        np.testing.assert_array_equal(faces.get_array(), [0.9, 0.4])
        assert faces.get_clim() == (0.0, 1.0)
    assert close.get_xlim() == NEAR[:2]
    assert {"x (mm)", "y (mm)", "scaled Jacobian (1: undistorted)", "A gear"} <= _texts(figure)
    assert bar.get_ylim() == (0.0, 1.0)


def test_modes_have_names_a_form_and_a_border():
    axial = np.array([[0, 0, 1.0], [0, 0, -1.0], [0, 0, 1.0], [0, 0, -1.0]])
    sideways = np.array([[2.0, 0, 0]] * 4)
    figure = gear_modes_figure(SQUARE, TRIANGLES, {"100 Hz, n = 2": axial, "200 Hz, n = 0": sideways}, title="Free")
    first, second, _ = figure.axes
    np.testing.assert_allclose(first.collections[0].get_array(), axial[:, 2])
    np.testing.assert_allclose(second.collections[0].get_array(), 0.0)
    assert len(first.collections[1].get_segments()) == 4
    right = max(segment[:, 0].max() for segment in second.collections[1].get_segments())
    assert right == pytest.approx(1.12)
    assert {"100 Hz, n = 2", "200 Hz, n = 0", "Free"} <= _texts(figure)


def test_stress_is_drawn_in_mpa_with_its_force():
    stress = np.array([1e6, 2e6, 3e6, 50e6])
    figure = gear_stress_figure(
        SQUARE, TRIANGLES, stress, near_mm=NEAR, top_pa=10e6, force=(SQUARE[2], np.array([0.0, -1.0]), "500 N")
    )
    axes = figure.axes[0]
    np.testing.assert_allclose(axes.collections[0].get_array(), stress * 1e-6)
    assert axes.collections[0].get_clim() == (0.0, 10.0)
    assert {"von Mises stress (MPa)", "500 N"} <= _texts(figure)
    free = gear_stress_figure(SQUARE, TRIANGLES, stress, near_mm=NEAR)
    assert free.axes[0].collections[0].get_clim() == (0.0, 50.0)


def test_wrong_shapes_are_refused():
    with pytest.raises(InputError, match="outlines_mm has shape"):
        gear_mesh_figure(SQUARE, np.ones(4), near_mm=NEAR)
    with pytest.raises(InputError, match="quality"):
        gear_mesh_figure(np.array([SQUARE]), np.ones(2), near_mm=NEAR)
    with pytest.raises(InputError, match="shape of 'a'"):
        gear_modes_figure(SQUARE, TRIANGLES, {"a": np.ones((4, 2))})
    with pytest.raises(InputError, match="shapes is empty"):
        gear_modes_figure(SQUARE, TRIANGLES, {})
