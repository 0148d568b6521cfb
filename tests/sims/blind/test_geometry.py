"""Involute kinematics and stiffness against textbook formulas and an own construction."""

from math import acos, cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.blind import SpurPair

pairs = st.builds(
    SpurPair, st.integers(22, 70), st.integers(22, 70), st.sampled_from([1.5, 3.0, 6.0]), st.floats(10.0, 60.0)
)


def test_contact_ratio_of_published_pairs() -> None:
    """20/100 standard teeth: 1.705; 50/50: 1.755."""
    assert SpurPair(20, 100, 5.0, 50.0).contact_ratio == pytest.approx(1.705, abs=5e-3)
    assert SpurPair(50, 50, 3.0, 20.0).contact_ratio == pytest.approx(1.755, abs=5e-4)


def test_iso_stiffness_by_hand() -> None:
    """30/40 teeth, 20 mm: q' = 0.05886, c' = 13.25, ε = 1.684, c_γ = 20.05 N/(mm µm)."""
    pair = SpurPair(30, 40, 2.0, 20.0)
    assert pair.mean_stiffness_n_per_m() == pytest.approx(20.05 * 20 * 1e6, rel=2e-3)


@given(pairs)
def test_the_pairs_together_have_the_mean_of_the_standard(pair: SpurPair) -> None:
    path, k = pair.path, pair.pair_stiffness_n_per_m()
    inside = (path >= 0) & (path <= pair.contact_ratio)
    assert np.trapezoid(k[inside], path[inside]) == pytest.approx(pair.mean_stiffness_n_per_m(), rel=0.02)


@given(pairs)
@settings(deadline=None)
def test_gaps_open_smoothly_and_ever_more(pair: SpurPair) -> None:
    gap, path = pair.end_gap_m(), pair.path
    inside = (path >= 0) & (path <= pair.contact_ratio)
    assert (gap[inside] == 0).all()
    for side in (gap[path < 0][::-1], gap[path > pair.contact_ratio]):
        assert (np.diff(side) > 0).all()
        assert side[0] < 1e-6 * pair.module_mm  # no jump at the end of the path
        quarter, half = side[len(side) // 4], side[len(side) // 2]
        assert 3 < half / quarter < 6.5  # about the square of the distance


def polygon_gap(pair: SpurPair, beyond_m: float) -> float:
    """Separation after E found by search: turn the wheel until its flank, drawn as points, meets the pinion's tip."""
    rb1, rb2 = pair.base_radii_m
    ra1 = pair.tip_radii_m[0]
    a, alpha = pair.centre_distance_m, radians(pair.pressure_angle_deg)
    rho = sqrt(ra1**2 - rb1**2)
    # Line of action from the pinion's base circle at (cos α, sin α) towards (sin α, −cos α).
    x, y = rb1 * cos(alpha) + rho * sin(alpha), rb1 * sin(alpha) - rho * cos(alpha)
    tip = np.arctan2(y, x) - beyond_m / rb1  # the pinion turns on, clockwise
    px, py = ra1 * cos(tip) - a, ra1 * sin(tip)
    rho2 = a * sin(alpha) - rho - beyond_m
    roll = np.linspace(0, 3 * rho2 / rb2 + 0.5, 200_000)

    def flank(base_angle: float) -> tuple[np.ndarray, np.ndarray]:
        at = base_angle + roll
        return rb2 * (np.cos(at) + roll * np.sin(at)), rb2 * (np.sin(at) - roll * np.cos(at))

    # Seen from the wheel the base tangent point is at π + α; the involute unwinds the other way.
    start = pi + alpha - rho2 / rb2
    fx, fy = flank(start)
    r = np.hypot(fx, fy)
    order = np.argsort(r)
    angle_at = np.interp(np.hypot(px, py), r[order], np.unwrap(np.arctan2(fy, fx))[order])
    return float(rb2 * abs((np.arctan2(py, px) - angle_at + pi) % (2 * pi) - pi))


@pytest.mark.parametrize("beyond", [0.05, 0.1, 0.2])
def test_gap_after_the_path_by_points_on_the_flank(beyond: float) -> None:
    pair = SpurPair(30, 40, 3.0, 24.0)
    gap = pair.corner_gap_m(1, np.array([beyond * pair.base_pitch_m]))[0]
    assert gap == pytest.approx(polygon_gap(pair, beyond * pair.base_pitch_m), rel=1e-3)


def ends_rad(pair: SpurPair, centre_m: float) -> tuple[float, float]:
    """Pinion angles at which contact begins and ends at a centre distance, from a fixed direction."""
    (rb1, rb2), (ra1, ra2) = pair.base_radii_m, pair.tip_radii_m
    alpha = acos((rb1 + rb2) / centre_m)
    rho_start = centre_m * sin(alpha) - sqrt(ra2**2 - rb2**2)
    return rho_start / rb1 - alpha, sqrt(ra1**2 - rb1**2) / rb1 - alpha


@given(pairs)
def test_ends_move_with_the_centre_distance(pair: SpurPair) -> None:
    step = 1e-6
    before, after = ends_rad(pair, pair.centre_distance_m), ends_rad(pair, pair.centre_distance_m + step)
    moved = [(b - a) * pair.base_radii_m[0] / pair.base_pitch_m / step for a, b in zip(before, after, strict=True)]
    np.testing.assert_allclose(moved, pair.end_shift_per_m(), rtol=1e-3)
    assert tan(pair.alpha) > 0


def test_bad_pairs_are_refused() -> None:
    with pytest.raises(InputError, match="z1"):
        SpurPair(12, 40, 2.0, 20.0)
    with pytest.raises(InputError, match="interfere"):
        SpurPair(17, 2000, 2.0, 20.0)
