"""The 0–1 test on maps, sections and signals."""

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.phase import (
    PhasePortrait,
    constant_period_lock,
    mean_square_displacement,
    poincare_section,
    translation_walk,
    zero_one_test,
    zero_one_test_of_section,
)
from tests.phase.systems import DUFFING_PERIOD_S, duffing, henon, logistic, lorenz, quasi_periodic, rossler


def test_displacement_by_correlation_equals_the_definition():
    phi, c, n_cut = logistic(400), 1.234, 40
    j = np.arange(1, len(phi) + 1)
    z = np.cumsum(phi * np.exp(1j * c * j))
    base = len(phi) - n_cut
    wanted = [np.mean(np.abs(z[n : n + base] - z[:base]) ** 2) for n in range(1, n_cut + 1)]
    np.testing.assert_allclose(mean_square_displacement(phi, c, n_cut), wanted, rtol=1e-9)


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        (lambda: logistic(3000, 4.0), "irregular"),
        (lambda: logistic(3000, 3.97), "irregular"),  # the value the test's authors use
        (lambda: logistic(3000, 3.55), "regular"),
        (lambda: henon(3000), "irregular"),
        (lambda: quasi_periodic(3000, period=4.7), "regular"),
        (lambda: np.random.default_rng(0).normal(size=3000), "irregular"),  # noise too, as stated
    ],
    ids=["logistic 4", "logistic 3.97", "logistic 3.55", "henon", "quasi-periodic", "noise"],
)
def test_maps_and_sampled_motion(values, verdict):
    found = zero_one_test(values())
    assert found.verdict == verdict
    assert abs(found.k - (verdict == "irregular")) < 0.05


def test_transition_of_the_logistic_map_follows_its_exponent():
    """K and the sign of the exact exponent (mean of ln|r(1 - 2x)|) agree outside the weakly chaotic band."""
    for r in np.linspace(3.5, 4.0, 14):
        x = logistic(4000, r)
        exponent = float(np.mean(np.log(np.abs(r * (1 - 2 * x)) + 1e-300)))
        if abs(exponent) > 0.15:
            assert zero_one_test(x).k == pytest.approx(float(exponent > 0), abs=0.15), r


@pytest.mark.slow
@pytest.mark.parametrize(("force", "verdict"), [(0.2, "regular"), (0.28, "regular"), (0.5, "irregular")])
def test_sections_of_a_forced_oscillator(force, verdict):
    states = duffing(force, 1500)
    path = PhasePortrait(states, 64 / DUFFING_PERIOD_S, ("x", "v"), ("m", "m/s"), "states", "duffing")
    section = poincare_section(path, constant_period_lock(DUFFING_PERIOD_S, path.end_s))
    assert zero_one_test_of_section(section).verdict == verdict


def test_a_fine_sampled_signal_is_thinned_unless_told_otherwise():
    x = lorenz(20_000, 0.02)[:, 0]
    fine = zero_one_test(x, every=1)
    assert fine.k < 0.2
    assert fine.oversampled
    assert (fine.verdict, fine.every) == ("undecided", 1)
    assert "neighbours lie too close" in fine.reason
    thinned = zero_one_test(x)
    assert (thinned.verdict, thinned.oversampled, thinned.reason) == ("irregular", False, "")
    assert thinned.every > 1
    assert zero_one_test(rossler(20_000, 0.15)[:, 0]).verdict == "irregular"


def test_noise_on_a_finely_sampled_sine_is_not_called_irregular():
    noise = 0.1 * np.random.default_rng(0).normal(size=20_000)
    x = np.sin(2.0 * np.pi * 0.5 * np.arange(20_000) / 50.0) + noise
    assert zero_one_test(x).k < 0.4
    fine = zero_one_test(x, every=1)
    assert fine.k > 0.8
    assert fine.verdict == "undecided"


def test_impacts_on_a_map_are_not_taken_for_close_sampling():
    x = np.random.default_rng(3).normal(size=2000)
    x[::400] += 30.0
    assert not zero_one_test(x).oversampled


def test_a_map_is_taken_whole_and_a_short_signal_not_thinned_away():
    assert zero_one_test(henon(3000)).every == 1
    short = zero_one_test(lorenz(500, 0.02)[:, 0])
    assert short.n_values >= 200
    assert short.verdict == "undecided"


def test_damping_keeps_noise_on_regular_motion_from_being_read_as_chaos():
    clean = quasi_periodic(20_000, period=4.7)[:3000]
    noisy = clean + 0.1 * np.random.default_rng(1).normal(size=3000)
    plain, damped = zero_one_test(noisy).k, zero_one_test(noisy, damping=2.5).k
    assert damped < plain
    assert damped < 0.4
    assert zero_one_test(logistic(3000), damping=2.5).k > 0.95


def test_offset_scale_float32_and_odd_length_do_not_matter():
    x = henon(3001)
    k = [zero_one_test(v).k for v in (x, 1e6 * x - 3e6, x.astype(np.float32), x[:-1])]
    np.testing.assert_allclose(k, k[0], atol=2e-3)


def test_bad_input():
    with pytest.raises(InputError, match="199 sample"):
        zero_one_test(np.arange(199.0))
    with pytest.raises(InputError, match="100 values are left"):
        zero_one_test(henon(1000), every=10)
    with pytest.raises(RefusalError, match="constant"):
        zero_one_test(np.ones(500))
    with pytest.raises(InputError, match="NaN"):
        zero_one_test(np.where(np.arange(500) == 3, np.nan, 1.0))
    with pytest.raises(InputError, match="damping"):
        zero_one_test(henon(500), damping=-1.0)


def test_walk_is_bounded_for_regular_motion_and_wanders_for_chaos():
    regular, chaotic = quasi_periodic(4000), logistic(4000)
    size = {name: np.abs(translation_walk(x, 1.3)).max() for name, x in (("regular", regular), ("chaos", chaotic))}
    assert size["regular"] < 15.0
    assert size["chaos"] > 2.0 * size["regular"]


def test_walk_is_the_sum_that_defines_it():
    x, c = logistic(300), 1.1
    step = (x - x.mean()) / x.std()
    expected = [sum(step[j] * np.cos(c * (j + 1)) for j in range(n + 1)) for n in (0, 10, 299)]
    np.testing.assert_allclose(translation_walk(x, c)[[0, 10, 299], 0], expected, atol=1e-10)
