"""Contact of several elastic points: closed forms and what must hold for any of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from sims.reduced_fe import hertz_energy, root, solve_contacts

HERTZ, SMALL = 2e-9, 1e-2


def solve(r, approach, hertz=HERTZ, enough=1e-7, start=0.0):
    n = len(approach)
    force, w = np.full(n, start), np.full(n, SMALL**-0.1)
    order, a, x = np.empty(n, dtype=np.int64), np.empty((n, n)), np.empty(n)
    done, _ = solve_contacts(r, n, approach, np.full(1, hertz), SMALL, force, w, enough, order, a, x)
    assert done > 0
    return force


def local_approach(force, hertz=HERTZ):
    return np.where(force > SMALL, hertz * np.maximum(force, 1e-300) ** 0.9, hertz * SMALL**-0.1 * force)


def test_one_point_yields_as_spring_and_hertz_in_series():
    c, depth = 4e-9, 1e-5
    expected = brentq(lambda n: c * n + HERTZ * n**0.9 - depth, 1.0, 1e5, xtol=1e-12)
    assert solve(np.array([[c]]), np.array([depth]))[0] == pytest.approx(expected, rel=1e-10)


def test_a_point_that_its_neighbour_lifts_off_carries_nothing():
    # The first point pushes the second away by more than it approaches.
    r = np.array([[4e-9, 3e-9], [3e-9, 4e-9]])
    force = solve(r, np.array([1e-5, 2e-6]))
    assert force[1] == 0.0
    assert force[0] == pytest.approx(solve(r[:1, :1], np.array([1e-5]))[0], rel=1e-10)


@settings(max_examples=60)
@given(st.integers(1, 12), st.integers(0, 2**31 - 1), st.floats(1e-7, 5e-5))
def test_forces_do_not_pull_and_points_do_not_overlap(n, seed, scale):
    rng = np.random.default_rng(seed)
    mixed = rng.standard_normal((n, n))
    r = 1e-9 * (mixed @ mixed.T / n + 0.3 * np.eye(n))
    approach = scale * rng.standard_normal(n)
    force = solve(r, approach, start=float(rng.uniform(0.0, 100.0)))
    gap = approach - r @ force - local_approach(force)
    tiny = 1e-9 * scale + 1e-15
    assert np.all(force >= 0.0)
    assert np.all(np.abs(gap[force > 0.0]) <= tiny)
    assert np.all(gap[force == 0.0] <= tiny)


def test_the_tenth_root_follows_from_any_guess():
    for force in (1e-6, 0.5, 3.0, 4e4):
        for guess in (0.1, 1.0, max(force, SMALL) ** -0.1 * 1.01):
            found = root(force, SMALL, guess)
            assert found == pytest.approx(max(force, SMALL) ** -0.1, rel=3e-4)
            assert root(force, SMALL, found) == pytest.approx(max(force, SMALL) ** -0.1, rel=1e-7)


def test_energy_of_the_local_approach_is_the_work_done_on_it():
    force = np.linspace(0.0, 200.0, 200_001)
    h = local_approach(force)
    work = float(np.trapezoid(force, h))
    assert hertz_energy(200.0, HERTZ, SMALL) == pytest.approx(work, rel=1e-6)
