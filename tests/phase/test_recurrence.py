"""Recurrence plots and their quantification against brute force and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.phase import PhasePortrait, delay_embedding, recurrence_measures, recurrence_plot
from tests.phase.systems import lorenz


def _path(points, rate=1.0):
    points = np.asarray(points, dtype=float).reshape(len(points), -1)
    names = tuple(f"x{i}" for i in range(points.shape[1]))
    return PhasePortrait(points, rate, names, ("",) * len(names), "states", "test")


def _brute_force(points, radius, theiler, shortest):
    """Measures from the full matrix, in points."""
    scaled = points / points.std(axis=0)
    matrix = np.linalg.norm(scaled[:, None] - scaled[None, :], axis=2) < radius
    n = len(points)
    i, j = np.indices((n, n))
    matrix[np.abs(i - j) <= theiler] = False

    def lengths(lines):
        found = []
        for line in lines:
            edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
            found += list(edges[1::2] - edges[::2])
        return np.array(found, dtype=int)

    out = {"rr": matrix.sum() / np.count_nonzero(np.abs(i - j) > theiler)}
    for name, lines in (("diagonal", [np.diagonal(matrix, k) for k in range(1 - n, n)]), ("vertical", matrix.T)):
        found = lengths(lines)
        long = found[found >= shortest]
        out[name] = (long.sum() / max(found.sum(), 1), long.mean() if len(long) else 0.0, max(long, default=0))
        share = np.unique(long, return_counts=True)[1] / max(len(long), 1)
        out[name + " entropy"] = -np.sum(share * np.log(share))
    return out


@given(st.integers(100, 140), st.integers(0, 30), st.integers(2, 5), st.floats(0.2, 1.5), st.integers(0, 99))
@settings(max_examples=25)
def test_measures_equal_brute_force(n, theiler, shortest, radius, seed):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(n, 2)), axis=0) % 5.0
    found = recurrence_measures(
        _path(points), radius=radius, theiler_samples=theiler, shortest_line=shortest, n_points=200, stride=1
    )
    wanted = _brute_force(points, radius, theiler, shortest)
    assert found.recurrence_rate == pytest.approx(wanted["rr"])
    diagonal = (found.determinism, found.mean_line_s, found.longest_line_s)
    assert diagonal == pytest.approx(wanted["diagonal"])
    assert found.entropy_nats == pytest.approx(wanted["diagonal entropy"])
    assert (found.laminarity, found.trapping_time_s) == pytest.approx(wanted["vertical"][:2])


def test_independent_samples_have_the_determinism_of_chance():
    """Entries along a diagonal are independent: a share 1 - (1 - r)² of them touches another one."""
    x = np.random.default_rng(0).normal(size=5000)
    found = recurrence_measures(_path(x), recurrence_rate=0.05, theiler_samples=1, stride=1)
    r = found.recurrence_rate
    assert r == pytest.approx(0.05, rel=0.03)
    assert found.determinism == pytest.approx(2 * r - r * r, rel=0.04)


def test_a_periodic_path_is_all_lines():
    x = np.sin(2 * np.pi * np.arange(3000) / 50.0)
    portrait = delay_embedding(x, 100.0, delay_samples=12, dimension=2)
    found = recurrence_measures(portrait, radius=0.1, stride=1)
    assert found.determinism == 1.0
    # The longest line is the first multiple of the period outside the Theiler window of one period.
    assert found.longest_line_s == pytest.approx((3000 - 12 - 100) / 100.0)


def test_plot_is_symmetric_bounded_and_has_the_rate_asked_for():
    portrait = delay_embedding(lorenz(20_001, 0.02)[:, 0], 50.0, delay_samples=8, dimension=3)
    plot = recurrence_plot(portrait, recurrence_rate=0.1, n_points=500)
    assert plot.recurrent.shape == (500, 500)
    assert plot.stride in (4, 5)  # about 80 samples are a mean period
    np.testing.assert_array_equal(plot.recurrent, plot.recurrent.T)
    assert plot.recurrent.mean() == pytest.approx(0.1, rel=0.05)
    assert plot.times_s[-1] <= portrait.end_s
    assert not plot.recurrent.flags.writeable
    taken = portrait.points[:: plot.stride][:500] / portrait.extent
    assert plot.recurrent[3, 9] == (np.linalg.norm(taken[3] - taken[9]) < plot.radius)


def test_bad_input():
    portrait = _path(np.random.default_rng(0).normal(size=500))
    with pytest.raises(InputError, match="n_points"):
        recurrence_plot(portrait, n_points=100_000)
    with pytest.raises(InputError, match="recurrence_rate"):
        recurrence_plot(portrait, recurrence_rate=0.0)
    with pytest.raises(InputError, match="radius"):
        recurrence_measures(portrait, radius=-1.0)
    with pytest.raises(InputError, match="shortest_line"):
        recurrence_measures(portrait, shortest_line=1)
    with pytest.raises(RefusalError, match="Theiler window of 300"):
        recurrence_measures(portrait, theiler_samples=300, stride=1)
    with pytest.raises(RefusalError, match="does not move"):
        recurrence_plot(_path(np.ones(500)))


def test_long_paths_cost_no_more_and_another_stretch_can_be_asked_for():
    x = lorenz(100_000, 0.02)[:, 0]
    portrait = delay_embedding(x, 50.0, delay_samples=8, dimension=3)
    late = portrait.between(1000.0, 1600.0)
    assert (late.start_s, late.n_points) == (1000.0, 30_001)
    np.testing.assert_array_equal(late.points[0], portrait.points[50_000])
    one, two = recurrence_measures(portrait), recurrence_measures(late)
    assert one.n_points == two.n_points == 5_000
    assert one.duration_s == pytest.approx(5_000 * one.stride / 50.0)
    assert two.determinism == pytest.approx(one.determinism, abs=0.02)
    with pytest.raises(InputError, match="no samples from 5000"):
        portrait.between(5000.0, 6000.0)
