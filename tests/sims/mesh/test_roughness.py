"""Fractal roughness: scale from Rq, listed lines, rms, derivative, return with the tooth, compiled against plain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import FlankRoughness, FractalSurface, TimeLockedRoughness, advance, height_now

# As published for γ = 1.5; read from a spectrum, so the lowest are off by a line of it.
LISTED_HZ = [17.9, 26.9, 39.4, 59.1, 89.6, 133.4, 200.5, 300.8, 451.2, 667.7, 1016.0, 1524.0]


@pytest.mark.parametrize(("rms_um", "scale_m"), [(0.45, 2.33e-12), (0.84, 8.10e-12), (1.40, 2.25e-11)])
def test_scale_of_three_roughnesses(rms_um, scale_m):
    surface = FractalSurface.of_roughness(rms_um, 1.5)
    assert surface.scale_m == pytest.approx(scale_m, rel=3e-3)
    assert surface.rms_m == pytest.approx(rms_um * 1e-6, rel=1e-12)


@settings(deadline=None)  # kernels compile in the first example
@given(st.floats(0.01, 10.0), st.floats(1.1, 1.9))
def test_scale_and_rms_are_inverse(rms_um, dimension):
    assert FractalSurface.of_roughness(rms_um, dimension).rms_m == pytest.approx(rms_um * 1e-6, rel=1e-10)


@settings(deadline=None)  # kernels compile in the first example
@given(st.floats(1e-14, 1e-8), st.floats(1.1, 1.9))
def test_rms_formula(G, D):
    """rms² = G^(2(D-1))/2 · Σγ^(-2(2-D)n)."""
    n = np.arange(7, 19)
    expected = np.sqrt(G ** (2 * (D - 1)) / 2 * np.sum(1.5 ** (-2 * (2 - D) * n)))
    assert FractalSurface(G, D).rms_m == pytest.approx(expected, rel=1e-12)


def test_smooth_flank_is_flat():
    surface = FractalSurface.of_roughness(0.0)
    assert surface.rms_m == 0.0
    assert TimeLockedRoughness.draw(surface, np.random.default_rng(0)).height_m(0.3) == 0.0


def test_listed_lines():
    lines = TimeLockedRoughness.draw(FractalSurface.of_roughness(1.4), np.random.default_rng(1)).frequencies_hz
    np.testing.assert_allclose(lines, LISTED_HZ, rtol=0.02)
    np.testing.assert_allclose(lines[-2:], LISTED_HZ[-2:], rtol=1e-4)
    np.testing.assert_allclose(lines, 1.0312 * 1.5 ** np.arange(7, 19), rtol=1e-14)


def test_spectrum_holds_the_lines_with_their_amplitudes():
    surface = FractalSurface(1e-12, n_first=2, n_last=6, gamma=2.0)
    r = TimeLockedRoughness(surface, surface.draw_phases(np.random.default_rng(2))[0], travel_mps=1.0)
    t = np.arange(4096) / 1024
    spectrum = np.abs(np.fft.rfft(r.height_m(t))) * 2 / len(t)
    bins = (surface.cycles_per_metre * 4).astype(int)
    np.testing.assert_allclose(spectrum[bins], surface.amplitudes_m, rtol=1e-9)
    rest = np.delete(spectrum, bins)
    assert rest.max() < 1e-12 * surface.amplitudes_m.max()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.floats(1.2, 1.8))
def test_rms_of_a_long_profile(seed, dimension):
    surface = FractalSurface.of_roughness(1.0, dimension)
    r = TimeLockedRoughness.draw(surface, np.random.default_rng(seed))
    t = np.linspace(0.0, 20.0, 100_003)
    assert np.sqrt(np.mean(r.height_m(t) ** 2)) == pytest.approx(1e-6, rel=0.01)


def rate_mps(r, time_s):
    """Derivative of the profile over time."""
    omega = 2 * np.pi * r.frequencies_hz
    return float(-np.sum(r.surface.amplitudes_m * omega * np.sin(omega * time_s + r.phases_rad)))


def test_phasors_follow_the_profile_for_a_million_steps():
    r = TimeLockedRoughness.draw(FractalSurface.of_roughness(0.84), np.random.default_rng(3))
    real, imaginary, omega, cosine, sine = r.phasors(2e-6)
    assert height_now(real, imaginary, omega) == pytest.approx((float(r.height_m(0)), rate_mps(r, 0.0)))
    for _ in range(1_000_000):
        advance(real, imaginary, cosine, sine)
    height, rate = height_now(real, imaginary, omega)
    assert height == pytest.approx(float(r.height_m(2.0)), abs=1e-8 * r.surface.rms_m)
    assert rate == pytest.approx(rate_mps(r, 2.0), rel=1e-6)


@settings(deadline=None)  # kernels compile in the first example
@given(st.integers(-1000, 1000), st.floats(0.0, 6e-3), st.integers(0, 100))
def test_flank_returns_with_the_tooth(tooth, position, seed):
    flank = FlankRoughness.draw(FractalSurface.of_roughness(0.45), 19, np.random.default_rng(seed))
    assert flank.height_m(tooth, position) == flank.height_m(tooth + 19, position)
    assert flank.height_m(tooth, position) == flank.height_m(tooth - 38, position)
    assert flank.height_m(tooth, position) != flank.height_m(tooth + 1, position)


def test_over_teeth_the_flanks_have_the_rms():
    flank = FlankRoughness.draw(FractalSurface.of_roughness(0.84), 4000, np.random.default_rng(5))
    z = flank.height_m(np.arange(4000)[:, None], np.linspace(0, 6e-3, 50))
    assert np.sqrt(np.mean(z**2)) == pytest.approx(0.84e-6, rel=0.02)


def test_gear_that_turns_shows_only_orders_of_its_shaft():
    flank = FlankRoughness.draw(FractalSurface.of_roughness(0.84), 8, np.random.default_rng(5))
    cycles = np.arange(8 * 64 * 4) / 64  # four revolutions, 64 points a tooth
    z = flank.height_m(cycles.astype(int), (cycles % 1.0) * 6e-3)
    spectrum = np.abs(np.fft.rfft(z))
    assert spectrum[np.arange(len(spectrum)) % 4 != 0].max() < 1e-9 * spectrum.max()


def test_same_seed_same_phases_and_wrong_numbers_are_refused():
    surface = FractalSurface.of_roughness(0.45)
    a, b = (TimeLockedRoughness.draw(surface, np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(a.phases_rad, b.phases_rad)
    with pytest.raises(InputError, match="per line"):
        TimeLockedRoughness(surface, np.zeros(3))
    with pytest.raises(InputError, match="dimension"):
        FractalSurface(1e-12, 2.0)
    with pytest.raises(InputError, match="lines"):
        FractalSurface(1e-12, 1.5, 9, 8)
