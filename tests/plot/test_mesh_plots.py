"""Figures of the mesh: stiffness, load sharing, the cracked tooth."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.text import Text

from gearsig.errors import InputError
from gearsig.plot import load_sharing_figure, mesh_stiffness_figure, panels_of

CYCLES = np.linspace(0.0, 2.0, 401)
STIFFNESS = {
    "none": 3e8 + 1e8 * np.sign(np.sin(2 * np.pi * CYCLES)),
    "2 mm": 2.9e8 + 1e8 * np.sign(np.sin(2 * np.pi * CYCLES)),
}


def _texts(figure):
    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def _line(axes, label):
    return next(line for line in axes.lines if line.get_label() == label)


def test_stiffness_is_drawn_as_given_with_units_and_names():
    figure = mesh_stiffness_figure(CYCLES, STIFFNESS, single_pair=(0.5, 1.0), heading="crack depth", title="A pair")
    whole, zoom = figure.axes
    for label, values in STIFFNESS.items():
        np.testing.assert_array_equal(_line(whole, label).get_xdata(), CYCLES)
        np.testing.assert_allclose(_line(whole, label).get_ydata(), values / 1e8)
        inside = (CYCLES >= 0.5) & (CYCLES <= 1.0)
        np.testing.assert_allclose(_line(zoom, label).get_ydata(), values[inside] / 1e8)
    assert zoom.get_xlim() == (0.5, 1.0)
    texts = _texts(figure)
    assert {"none", "2 mm", "crack depth", "A pair", "mesh cycles (tooth passages)"} <= set(texts)
    assert texts.count("mesh stiffness (10⁸ N/m)") == 2


def test_stiffness_without_a_region_has_one_panel():
    assert len(mesh_stiffness_figure(CYCLES, STIFFNESS).axes) == 1


def test_colours_of_ordered_cases_grow_lighter():
    figure = mesh_stiffness_figure(CYCLES, {f"{i} mm": np.full(401, 1e8 * i) for i in range(5)})
    from matplotlib.colors import to_rgb

    light = [np.dot(to_rgb(line.get_color()), (0.2126, 0.7152, 0.0722)) for line in figure.axes[0].lines]
    assert all(a < b for a, b in pairwise(light))


@pytest.mark.parametrize(
    ("cycles", "curves", "region", "message"),
    [
        (CYCLES, {"a": np.ones(3)}, None, r"stiffness_n_per_m\['a'\] has 3 points, its axis 401"),
        (CYCLES, {}, None, "holds 0 curves"),
        (CYCLES, {"a": np.full(401, np.nan)}, None, "NaN"),
        (CYCLES[::-1], {"a": np.ones(401)}, None, "mesh_cycles"),
        (np.ones((2, 2)), {"a": np.ones(2)}, None, "shape"),
        (CYCLES, STIFFNESS, (1.0, 0.5), "single_pair"),
        (CYCLES, STIFFNESS, (5.0, 6.0), "0 point"),
    ],
)
def test_stiffness_refuses_what_does_not_fit(cycles, curves, region, message):
    with pytest.raises(InputError, match=message):
        mesh_stiffness_figure(cycles, curves, single_pair=region)


def test_load_sharing_draws_forces_where_pairs_touch_and_errors_in_um():
    one = np.where(CYCLES < 1.0, 2000.0, 0.0)
    error = 1e-6 * (8 + np.cos(CYCLES))
    figure = load_sharing_figure(CYCLES, {"pair 0": one, "pair 1": 2000.0 - one}, {"healthy": error})
    upper, lower = figure.axes
    drawn = _line(upper, "pair 0").get_ydata()
    np.testing.assert_array_equal(drawn[CYCLES < 1.0], 2000.0)
    assert drawn[200] == 0.0  # the fall to zero is shown
    assert np.isnan(drawn[201:]).all()
    np.testing.assert_allclose(_line(lower, "healthy").get_ydata(), error * 1e6)
    assert {"force of a pair (N)", "transmission error (µm)", "mesh cycles (tooth passages)"} <= set(_texts(figure))


def test_pairs_keep_their_names_beside_cases_of_the_same_colours():
    """The legend of the errors below names lines by colours that the pairs above have as well."""
    ones = np.ones(len(CYCLES))
    figure = load_sharing_figure(CYCLES, {"pair 0": ones, "pair 1": 2 * ones}, {"10 N·m": ones, "500 N·m": 2 * ones})
    ((upper,),), ((lower,),) = panels_of(figure)
    assert [line.name for line in upper.lines] == ["pair 0", "pair 1"]
    assert [line.name for line in lower.lines] == ["10 N·m", "500 N·m"]
    assert not upper.title


def test_load_sharing_refuses_wrong_lengths():
    with pytest.raises(InputError, match="transmission_error_m"):
        load_sharing_figure(CYCLES, {"pair 0": np.ones(401)}, {"healthy": np.ones(400)})
