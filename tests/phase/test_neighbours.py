"""Neighbours that are apart in time, against all distances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.phase import nearest_apart, spaced


def all_distances(points, library, references, theiler, norm, *, equal_counts):
    difference = points[references][:, None, :] - points[library][None, :, :]
    distance = np.abs(difference).max(axis=2) if norm == np.inf else np.sqrt(np.square(difference).sum(axis=2))
    near = np.abs(references[:, None] - library[None, :]) <= theiler
    distance[near | ((distance == 0.0) & (not equal_counts))] = np.inf
    return distance.min(axis=1)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    d=st.integers(1, 6),
    theiler=st.integers(0, 300),
    norm=st.sampled_from([2.0, np.inf]),
    equal_counts=st.booleans(),
    smooth=st.booleans(),
)
def test_same_as_from_all_distances(seed, d, theiler, norm, equal_counts, smooth):
    rng = np.random.default_rng(seed)
    if smooth:  # neighbours in time are the nearest ones: the tree's first answers are all of no use
        t = np.arange(900) * 0.02
        points = np.column_stack([np.sin((1.0 + 0.1 * k) * t + k) for k in range(d)])
    else:
        points = rng.normal(size=(900, d))
        points[800:] = points[:100]  # pairs of equal points
    library, references = spaced(900, 600), spaced(900, 150)
    expected = all_distances(points, library, references, theiler, norm, equal_counts=equal_counts)
    found, index = nearest_apart(points, library, references, theiler, norm, equal_counts=equal_counts)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.all(np.abs(index - references) > theiler)


def test_what_never_comes_back_is_refused():
    drift = np.column_stack([np.arange(8000.0), np.zeros(8000)])
    with pytest.raises(RefusalError, match="does not come back"):
        nearest_apart(drift, np.arange(8000), spaced(8000, 100), 2000)


def test_exact_repetition_is_refused_as_such():
    t = np.arange(6000) % 3
    with pytest.raises(RefusalError, match="exactly the same points"):
        nearest_apart(np.column_stack([t, t]).astype(float), np.arange(6000), spaced(6000, 100), 10)
