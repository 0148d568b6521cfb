import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gearsig.errors import InputError
from gearsig.plot import envelope, thin

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
