"""The kind of motion, from a model's states and from one measured channel; the 0–1 test."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from gearsig.errors import InputError, RefusalError
from gearsig.phase import (
    PhasePortrait,
    constant_period_lock,
    embedding_dimension,
    kind_of_motion,
    mean_square_displacement,
    phase_plane,
    poincare_section,
    translation_walk,
    zero_one_test,
    zero_one_test_of_section,
)
from tests.marks import further
from tests.phase.systems import DUFFING_PERIOD_S, duffing, henon, logistic, lorenz, quasi_periodic, rossler

RATE = 64 / DUFFING_PERIOD_S


@cache
def _duffing(force, n_periods=1500, noise=0.0):
    states = duffing(force, n_periods)
    states += noise * states.std(axis=0) * np.random.default_rng(0).normal(size=states.shape)
    path = PhasePortrait(states, RATE, ("x", "v"), ("m", "m/s"), "states", "duffing")
    return path, constant_period_lock(DUFFING_PERIOD_S, path.end_s, "forcing period")


@pytest.mark.parametrize(
    ("force", "noise", "kind", "period"),
    [
        (0.20, 0.0, "periodic", 1),
        (0.20, 0.02, "periodic", 1),
        (0.28, 0.0, "subharmonic", 2),
        (0.28, 0.02, "subharmonic", 2),
        (0.29, 0.0, "subharmonic", 4),
        (0.50, 0.0, "chaotic", 0),
    ],
)
def test_forced_oscillator(force, noise, kind, period):
    found = kind_of_motion(*_duffing(force, noise=noise))
    assert (found.kind, found.period) == (kind, period)
    assert found.evidence


def test_from_measured_acceleration_alone():
    path, lock = _duffing(0.5)
    x, v = path.points.T
    t = np.arange(len(x)) / RATE
    acceleration = 0.5 * np.cos(1.2 * t) - 0.3 * v + x - x**3
    plane = phase_plane(acceleration, RATE, quantity="acceleration", low_cut_hz=0.02, unit="m/s^2")
    assert kind_of_motion(plane, lock).kind == "chaotic"


def test_two_frequencies_are_quasi_periodic():
    x = quasi_periodic(30_000)
    plane = phase_plane(x, 1000.0, quantity="displacement")
    found = kind_of_motion(plane, constant_period_lock(50.3 / 1000.0, 30.0))
    assert found.kind == "quasi-periodic"
    assert found.chaos_test.k < 0.1
    assert abs(found.exponent.exponent_per_s) < 0.05  # per second, of a motion with 20 cycles per second


def test_noise_is_called_stochastic():
    noise = np.random.default_rng(0).normal(size=(8_000, 2))
    path = PhasePortrait(noise, 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    found = kind_of_motion(path, constant_period_lock(0.02, 8.0))
    assert found.kind == "stochastic"
    assert any("no dimension" in sentence for sentence in found.evidence)


@pytest.mark.slow
@pytest.mark.parametrize(("per_period", "n_periods"), [(32, 600), further(128, 300)])
def test_clean_chaos_whose_usual_delay_is_too_long_is_not_called_stochastic(per_period, n_periods):
    rate = per_period / DUFFING_PERIOD_S
    path = PhasePortrait(duffing(0.5, n_periods, per_period), rate, ("x", "v"), ("m", "m/s"), "states", "duffing")
    usual = embedding_dimension(np.ascontiguousarray(path.points[:, 0]), rate)
    assert usual.dimension == 0
    found = kind_of_motion(path, constant_period_lock(DUFFING_PERIOD_S, path.end_s, "forcing period"))
    assert found.kind == "chaotic"


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [0.5, 0.95])
@pytest.mark.parametrize("seed", [0, further(2)])
def test_filtered_noise_stays_stochastic(smooth, seed):
    x = lfilter([1.0], [1.0, -smooth], np.random.default_rng(seed).normal(size=8_000))
    path = PhasePortrait(np.stack([x, np.gradient(x)], 1), 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    assert kind_of_motion(path, constant_period_lock(0.0297, 8.0)).kind == "stochastic"


def test_what_cannot_be_answered_is_said():
    noise = np.random.default_rng(0).normal(size=(1500, 2))
    path = PhasePortrait(noise, 1000.0, ("x", "v"), ("m", "m/s"), "states", "noise")
    found = kind_of_motion(path, constant_period_lock(0.02, 1.5))
    assert any(sentence.startswith("0–1 test: values has") for sentence in found.evidence)
    with pytest.raises(RefusalError, match="no whole cycle"):
        kind_of_motion(path, constant_period_lock(5.0, 10.0))


@pytest.mark.slow
def test_a_model_without_noise_needs_no_exponent_to_be_regular(monkeypatch):
    """Where neighbours cannot be followed, the 0–1 test calls a deterministic motion regular, but never chaotic."""

    def refuse(_path, **_options):
        raise RefusalError("too short", remedy="longer")

    monkeypatch.setattr("gearsig.phase._kind.largest_lyapunov_exponent", refuse)
    chaos = _duffing(0.5)
    assert kind_of_motion(*chaos).kind == "undecided"
    assert kind_of_motion(*chaos, noise_free=True).kind == "undecided"
    plane = phase_plane(quasi_periodic(30_000), 1000.0, quantity="displacement")
    assert kind_of_motion(plane, constant_period_lock(50.3 / 1000.0, 30.0), noise_free=True).kind == "quasi-periodic"


# The 0–1 test on maps, sections and signals.


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
