"""Figures of motion in phase space: what is drawn is what was given."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.phase import (
    BifurcationDiagram,
    ChaosTest,
    EmbeddingDimension,
    LyapunovExponent,
    MutualInformation,
    PhasePortrait,
    PoincareSection,
    RecurrenceMeasures,
    RecurrencePlot,
)
from gearsig.plot import (
    bifurcation_figure,
    chaos_test_figure,
    divergence_figure,
    embedding_figure,
    phase_portrait_figure,
    recurrence_figure,
)
from tests.plot.drawn import texts_of

T = 2 * np.pi * np.arange(2000) / 50.0
PORTRAIT = PhasePortrait(
    np.column_stack([np.cos(T), np.sin(T)]), 50.0, ("displacement", "velocity"), ("m", "m/s"), "phase plane", "a1 <$x$>"
)


def _section(points):
    return PoincareSection(
        points,
        np.arange(len(points)),
        PORTRAIT.axis_names,
        PORTRAIT.units,
        PORTRAIT.extent,
        "locked",
        "mesh of stage",
        "a1",
    )


def test_portrait_with_its_points():
    points = PORTRAIT.points[::50] + 1e-12
    figure = phase_portrait_figure(PORTRAIT, _section(points))
    path, alone = figure.axes
    np.testing.assert_array_equal(path.lines[0].get_ydata(), PORTRAIT.points[:, 1])
    for axes in (path, alone):
        np.testing.assert_array_equal(axes.lines[-1].get_xdata(), points[:, 0])
    # One point stays a point: the panel does not shrink to its rounding.
    assert np.ptp(alone.get_xlim()) > 0.05
    assert {"displacement (m)", "velocity (m/s)", "40 points", "once per mesh of stage", "a1 <$x$>"} <= set(
        texts_of(figure)
    )


def test_long_paths_are_cut_and_say_so():
    figure = phase_portrait_figure(PORTRAIT, n_points=500, axes=(1, 0), title="T")
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_xdata(), PORTRAIT.points[-500:, 1])
    assert {"last 10 s", "T"} <= set(texts_of(figure))


def test_a_filtered_path_of_few_samples_a_period_is_drawn_as_the_curve_it_is():
    angle = 2 * np.pi * np.arange(4000) / 2.7  # 2.7 samples a period: straight lines would cut to cos(π/2.7) = 0.4
    circle = np.column_stack([np.sin(angle), np.cos(angle)])
    portrait = PhasePortrait(circle, 2700.0, ("x", "v"), ("m", "m/s"), "phase plane", "a1", band_hz=(50.0, 1100.0))
    (line,) = phase_portrait_figure(portrait, n_points=500).axes[0].lines
    radius = np.hypot(*line.get_xydata().T)
    assert len(radius) > 8 * 480
    assert radius == pytest.approx(np.full(len(radius), radius.mean()), rel=0.01)
    chord = np.hypot(*(0.5 * (line.get_xydata()[1:] + line.get_xydata()[:-1])).T)
    assert np.all(chord > 0.95 * radius.mean())


def test_portrait_refuses_other_axes():
    with pytest.raises(InputError, match="axes is"):
        phase_portrait_figure(PORTRAIT, axes=(0, 2))
    other = PoincareSection(np.ones((3, 1)), np.arange(3), ("x",), ("",), np.ones(1), "locked", "s", "a")
    with pytest.raises(InputError, match="section's axes"):
        phase_portrait_figure(PORTRAIT, other)


def test_bifurcation_draws_all_points_and_names_periods():
    values = np.linspace(1000.0, 2000.0, 21)
    parameter, points = np.repeat(values, 4), np.arange(84.0)
    periods = (1,) * 8 + (2,) * 8 + (0,) * 5
    diagram = BifurcationDiagram(
        parameter, points, "speed", "rpm", "displacement", "m", values, periods, "revolution of in"
    )
    figure = bifurcation_figure(diagram)
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_xdata(), parameter)
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), points)
    texts = texts_of(figure)
    assert {"period 1", "period 2", "speed (rpm)", "displacement (m)"} <= set(texts)
    assert "period 0" not in texts


def test_two_branches_shade_where_they_are_apart():
    values = np.linspace(1000.0, 2000.0, 11)
    one = np.full(11, 1.0)
    other = np.where(values < 1350.0, 3.0, 1.0)
    up, down = (
        BifurcationDiagram(values, size, "speed", "rpm", "x", "m", values, (1,) * 11, "mesh cycle", size)
        for size in (one, other)
    )
    figure = bifurcation_figure(up, down)
    points, sizes = figure.axes
    np.testing.assert_array_equal(points.lines[1].get_ydata(), other)
    np.testing.assert_array_equal(sizes.lines[1].get_ydata(), other)
    shaded = [patch.get_extents().transformed(points.transData.inverted()) for patch in points.patches]
    assert min(box.x0 for box in shaded) == pytest.approx(1000.0)
    assert max(box.x1 for box in shaded) == pytest.approx(1350.0)
    assert {"rising", "falling", "shaded: two motions"} <= {text.get_text() for text in figure.legends[0].get_texts()}
    assert "two motions at the values tried, step 100 rpm; they may go on beyond the sweep" in texts_of(figure)
    other_axis = BifurcationDiagram(values, one, "speed", "rpm", "y", "m", values, (1,) * 11, "mesh cycle", one)
    with pytest.raises(InputError, match="branches of x and y"):
        bifurcation_figure(up, other_axis)


def test_periods_are_named_for_each_branch_in_its_colour():
    values = np.linspace(1000.0, 2000.0, 11)
    up, down = (
        BifurcationDiagram(values, values, "speed", "rpm", "x", "m", values, (period,) * 11, "mesh cycle", values)
        for period in (1, 2)
    )
    figure = bifurcation_figure(up, down)
    colours = {text.get_text(): text.get_color() for text in figure.axes[0].texts}
    assert colours["period 1"] == figure.axes[0].lines[0].get_color()
    assert colours["period 2"] == figure.axes[0].lines[1].get_color()
    assert not figure.axes[0].patches


def test_chaos_test_draws_k_and_the_walk():
    test = ChaosTest(0.9, np.array([0.8, 1.0]), np.array([2.0, 1.0]), 0.0, 500, "irregular", False, "a1")
    walk = np.column_stack([T, -T])
    figure = chaos_test_figure(test, walk, 1.5)
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), [1.0, 0.8])  # in the order of c
    np.testing.assert_array_equal(figure.axes[1].lines[0].get_ydata(), -T)
    assert {"K = 0.90, irregular, 500 values", "walk at c = 1.500 rad", "p", "q"} <= set(texts_of(figure))


def test_recurrence_shows_the_matrix_over_time_and_the_measures():
    matrix = np.eye(50, dtype=bool)
    plot = RecurrencePlot(matrix, np.arange(50) * 0.1, 0.3, 7, "a1")
    measures = RecurrenceMeasures(0.05, 0.9, 1.0, 2.0, 1.5, 0.4, 0.2, 0.3, 2, 5, 7, 50, 35.0, "a1")
    figure = recurrence_figure(plot, measures)
    np.testing.assert_array_equal(figure.axes[0].images[0].get_array(), matrix)
    assert figure.axes[0].images[0].get_extent() == pytest.approx([0.0, 4.9, 0.0, 4.9])
    assert {"determinism 0.900", "1 in 7 points", "longest line 2 s"} <= set(texts_of(figure))


@pytest.mark.parametrize(("dimension", "words"), [(3, "dimension 3"), (0, "no dimension: stochastic")])
def test_embedding_marks_what_was_chosen(dimension, words):
    information = MutualInformation(np.linspace(3.0, 0.5, 30), 2, 1000.0, 16, "first minimum", 20, "a1")
    false = EmbeddingDimension(
        (1, 2, 3, 4),
        np.array([0.9, 0.2, 0.0, 0.0]),
        np.array([0.1, 0.8, 1.0]),
        np.array([0.2, 0.9, 1.1]),
        dimension,
        "deterministic" if dimension else "stochastic",
        0.02,
        16,
        "a1",
    )
    figure = embedding_figure(information, false)
    delays, dimensions = figure.axes
    np.testing.assert_allclose(delays.lines[0].get_xdata(), np.arange(30) * 2.0)
    assert delays.lines[1].get_xdata()[0] == pytest.approx(16.0)
    np.testing.assert_array_equal(dimensions.lines[0].get_ydata(), false.false_fraction)
    assert {words, "16 ms: first minimum", "false neighbours"} <= set(texts_of(figure))


def test_divergence_draws_the_fitted_line_on_the_curve():
    s = -3.0 + 0.5 * np.arange(40) * 0.1
    found = LyapunovExponent(0.5, 0.02, s, 0.1, (0.5, 2.0), 0.0, "diverging", "rosenstein", 100, 5, "a1")
    figure = divergence_figure(found)
    line = figure.axes[0].lines[-1]
    np.testing.assert_allclose(line.get_ydata(), -3.0 + 0.5 * line.get_xdata())
    assert line.get_xdata()[[0, -1]] == pytest.approx([0.5, 2.0])
    assert "λ = 0.5 ± 0.02 1/s, diverging" in texts_of(figure)


def test_small_motion_is_read_in_small_units():
    small = PhasePortrait(
        PORTRAIT.points * [1e-6, 1e-2], 50.0, ("displacement", "velocity"), ("m", "m/s"), "phase plane", "a1"
    )
    section = PoincareSection(
        small.points[::50] * 1.1, np.arange(40), small.axis_names, small.units, small.extent, "locked", "in", "a1"
    )
    figure = phase_portrait_figure(small, section)
    path, alone = figure.axes
    np.testing.assert_allclose(path.lines[0].get_xdata(), PORTRAIT.points[:, 0])
    np.testing.assert_allclose(path.lines[0].get_ydata(), 10.0 * PORTRAIT.points[:, 1])
    np.testing.assert_allclose(alone.lines[-1].get_ydata(), 11.0 * PORTRAIT.points[::50, 1], atol=1e-12)
    assert {"displacement (µm)", "velocity (mm/s)"} <= set(texts_of(figure))
