import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gearsig.errors import InputError
from gearsig.plot import cell_limits, envelope, pooled_levels, thin

lines = arrays(np.float64, st.integers(1, 500), elements=st.floats(-1e6, 1e6, width=32))


@given(lines, st.integers(4, 120))
def test_thinned_line_keeps_extremes_ends_order_and_only_true_points(y, n_points):
    x = np.arange(len(y), dtype=float)
    x_thin, y_thin = thin(x, y, n_points)
    assert len(y_thin) <= max(n_points, 0) or len(y) <= n_points
    assert y_thin.max() == y.max()
    assert y_thin.min() == y.min()
    assert x_thin[0] == x[0]
    assert x_thin[-1] == x[-1]
    assert np.all(np.diff(x_thin) > 0)
    np.testing.assert_array_equal(y[x_thin.astype(int)], y_thin)


@given(lines, st.integers(4, 120), st.data())
def test_every_point_lies_between_neighbouring_extremes(y, n_points, data):
    """No stretch of a bucket's length loses its peak by more than what lies in the bucket."""
    i = data.draw(st.integers(0, len(y) - 1))
    x_thin, y_thin = thin(np.arange(len(y), dtype=float), y, n_points)
    length = -(-len(y) // ((n_points - 2) // 2))
    near = y_thin[np.abs(x_thin - i) <= length]
    assert near.min() <= y[i] <= near.max()


@given(lines, st.integers(1, 60))
def test_envelope_bounds_the_line(y, n_columns):
    x, low, high = envelope(np.arange(len(y), dtype=float), y, n_columns)
    assert len(x) <= n_columns or len(x) == len(y)
    assert np.all(low <= high)
    assert high.max() == y.max()
    assert low.min() == y.min()
    np.testing.assert_array_equal(y[x.astype(int)], high)


def test_lengths_must_agree_and_values_be_finite():
    with pytest.raises(InputError, match="x has 3 points, y has 2"):
        thin(np.arange(3.0), np.arange(2.0))
    with pytest.raises(InputError, match="NaN"):
        thin(np.arange(2.0), np.array([0.0, np.nan]))


def test_rows_of_pixels_show_the_nearest_speed_not_the_next():
    """Of a run-up, whose speeds are not equally far apart: else its lines lie beside the orders drawn over them."""
    speeds = np.array([600.0, 655.0, 700.0, 752.0, 806.0, 850.0, 897.0, 955.0])
    pooled, rows = pooled_levels(np.eye(len(speeds)), speeds, 100, 360)
    low, high = cell_limits(speeds)
    middles = low + (np.arange(len(pooled)) + 0.5) * (high - low) / len(pooled)
    shown = speeds[pooled.argmax(axis=1)]
    holds_one = np.isclose(shown, middles, atol=(high - low) / len(pooled))
    nearest = np.abs(speeds[:, None] - middles).min(axis=0)
    assert np.all(holds_one | np.isclose(np.abs(shown - middles), nearest))
    assert set(rows) == set(range(len(speeds)))


@given(st.lists(st.floats(0.01, 10.0), min_size=1, max_size=200), st.integers(1, 60), st.booleans())
def test_pooled_rows_lose_no_peak(steps, n_rows, logarithmic):
    positions = 5.0 + np.cumsum(steps)
    levels = np.diag(np.arange(1.0, len(positions) + 1))
    pooled, _ = pooled_levels(levels, positions, len(positions), n_rows, logarithmic=logarithmic)
    assert len(pooled) <= max(n_rows, 1)
    if len(positions) <= 1:
        return
    low, high = cell_limits(positions, logarithmic=logarithmic)
    assert low < positions[0] < positions[-1] < high
    np.testing.assert_array_equal(pooled.max(axis=0), np.arange(1.0, len(positions) + 1))


def test_rows_of_equal_steps_are_cells_of_their_own():
    levels = np.arange(12.0).reshape(4, 3)
    pooled, rows = pooled_levels(levels, np.array([1.0, 2.0, 3.0, 4.0]), 10, 360)
    np.testing.assert_array_equal(pooled, levels)
    assert rows.tolist() == [0, 1, 2, 3]
