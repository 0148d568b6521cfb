"""Largest Lyapunov exponents against published values and another library."""

import warnings

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.phase import PhasePortrait, delay_embedding, largest_lyapunov_exponent
from tests.phase.systems import (
    HENON_EXPONENT,
    LORENZ_EXPONENT,
    ROSSLER_EXPONENT,
    henon,
    logistic,
    lorenz,
    narrow_band_noise,
    quasi_periodic,
    rossler,
)

N = 20_000


def _embedded(x, dt, delay, dimension):
    return delay_embedding(x, 1.0 / dt, delay_samples=delay, dimension=dimension)


# Tolerances are those of the method at this length, as found here: the literature gives 5 to 15 % for flows.
@pytest.mark.parametrize(
    ("portrait", "method", "exponent", "tolerance"),
    [
        (lambda: _embedded(lorenz(N, 0.02)[:, 0], 0.02, 8, 3), "rosenstein", LORENZ_EXPONENT, 0.08),
        (lambda: _embedded(lorenz(N, 0.02)[:, 0], 0.02, 8, 5), "rosenstein", LORENZ_EXPONENT, 0.10),
        (lambda: _embedded(lorenz(N, 0.02)[:, 0], 0.02, 8, 3), "transverse", LORENZ_EXPONENT, 0.20),
        (lambda: _embedded(rossler(N, 0.1)[:, 0], 0.1, 14, 3), "rosenstein", ROSSLER_EXPONENT, 0.20),
        (lambda: _embedded(rossler(N, 0.2)[:, 0], 0.2, 7, 3), "transverse", ROSSLER_EXPONENT, 0.08),
        (lambda: _embedded(rossler(N, 0.1)[:, 0], 0.1, 14, 3), "kantz", ROSSLER_EXPONENT, 0.25),
        (lambda: _embedded(henon(5000), 1.0, 1, 2), "rosenstein", HENON_EXPONENT, 0.02),
        (lambda: _embedded(henon(5000), 1.0, 1, 2), "kantz", HENON_EXPONENT, 0.05),
        (lambda: _embedded(logistic(5000), 1.0, 1, 1), "rosenstein", np.log(2.0), 0.01),
        (lambda: _embedded(logistic(5000), 1.0, 1, 1), "kantz", np.log(2.0), 0.02),
    ],
)
def test_published_exponents(portrait, method, exponent, tolerance):
    found = largest_lyapunov_exponent(portrait(), method=method)
    assert found.exponent_per_s == pytest.approx(exponent, rel=tolerance)
    assert found.verdict == "diverging"
    assert found.uncertainty_per_s < 0.4 * exponent


def test_states_of_a_model_need_no_embedding():
    """Axes of different units are made comparable: metres or micrometres give the same exponent."""
    states = lorenz(N, 0.02)
    names, units = ("x", "y", "z"), ("m", "m", "m/s")
    one = largest_lyapunov_exponent(PhasePortrait(states, 50.0, names, units, "states", "model"))
    two = largest_lyapunov_exponent(PhasePortrait(states * [1e6, 1.0, 1e-3], 50.0, names, units, "states", "model"))
    assert one.exponent_per_s == pytest.approx(LORENZ_EXPONENT, rel=0.1)
    assert two.exponent_per_s == pytest.approx(one.exponent_per_s, rel=1e-9)


@pytest.mark.parametrize("method", ["rosenstein", "transverse", "kantz"])
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1])
def test_quasi_periodic_motion_does_not_diverge(method, noise):
    x = quasi_periodic(N) + noise * np.random.default_rng(1).normal(size=N)
    found = largest_lyapunov_exponent(_embedded(x, 1.0, 11, 4), method=method)
    assert found.verdict == "not diverging"
    assert abs(found.exponent_per_s) < 1e-4


def test_limit_cycle_with_noise_does_not_diverge():
    t = 2 * np.pi * np.arange(N) / 50.3
    x = np.sin(t) + 0.3 * np.sin(2 * t + 1.0) + 0.1 * np.random.default_rng(2).normal(size=N)
    assert largest_lyapunov_exponent(_embedded(x, 1.0, 12, 4)).verdict == "not diverging"


@pytest.mark.parametrize("method", ["rosenstein", "transverse", "kantz"])
@pytest.mark.parametrize("kind", ["white", "narrow band"])
def test_noise_is_refused(method, kind):
    rng = np.random.default_rng(3)
    x = rng.normal(size=N) if kind == "white" else narrow_band_noise(N, rng)
    portrait = _embedded(x, 1.0, 3 if kind == "white" else 12, 5)
    with pytest.raises(RefusalError, match=r"% as far apart as unrelated points.*is stochastic") as refused:
        largest_lyapunov_exponent(portrait, method=method)
    looked_at = refused.value.looked_at
    assert np.isnan(looked_at.exponent_per_s)
    assert looked_at.log_distance[-1] == pytest.approx(looked_at.saturation_log_distance, abs=1.0)


def test_two_percent_noise_keeps_the_exponent_and_ten_percent_is_not_answered():
    x, rng = lorenz(N, 0.02)[:, 0], np.random.default_rng(4)
    noisy = x + 0.02 * x.std() * rng.normal(size=N)
    found = largest_lyapunov_exponent(_embedded(noisy, 0.02, 8, 4))
    assert found.exponent_per_s == pytest.approx(LORENZ_EXPONENT, rel=0.15)
    with pytest.raises(RefusalError, match="too noisy"):
        largest_lyapunov_exponent(_embedded(x + 0.1 * x.std() * rng.normal(size=N), 0.02, 8, 5))


def test_odd_length_float32_and_scale_do_not_matter():
    x = henon(5000)
    found = [
        largest_lyapunov_exponent(_embedded(v, 1.0, 1, 2)).exponent_per_s
        for v in (x, x[:-1], x.astype(np.float32), 1e-6 * x)
    ]
    assert found[1] == pytest.approx(found[0], rel=0.01)
    assert found[2] == pytest.approx(found[0], rel=0.01)
    assert found[3] == pytest.approx(found[0], rel=1e-6)


def test_time_scales_the_exponent():
    x = lorenz(N, 0.02)[:, 0]
    slow, fast = (largest_lyapunov_exponent(_embedded(x, dt, 8, 3)) for dt in (0.02, 0.0002))
    assert fast.exponent_per_s == pytest.approx(100.0 * slow.exponent_per_s)
    assert fast.uncertainty_per_s == pytest.approx(100.0 * slow.uncertainty_per_s)


@pytest.mark.parametrize(("motion", "dimension", "steps"), [(henon, 2, 9), (logistic, 1, 7)])
def test_agrees_with_another_library_on_maps(motion, dimension, steps):
    """The other one fits a stated number of steps; both are given nearly the same stretch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nolds = pytest.importorskip("nolds")
        x = motion(1500)
        theirs = nolds.lyap_r(x, emb_dim=dimension, lag=1, min_tsep=5, trajectory_len=steps, fit="poly")
    ours = largest_lyapunov_exponent(_embedded(x, 1.0, 1, dimension), theiler_samples=5).exponent_per_s
    assert ours == pytest.approx(theirs, rel=0.05)


@pytest.mark.parametrize(
    ("motion", "dt", "delay", "theiler", "exponent", "tolerance"),
    [
        (lorenz, 0.02, 8, 40, LORENZ_EXPONENT, 0.20),
        (rossler, 0.2, 7, 40, ROSSLER_EXPONENT, 0.20),
    ],
)
def test_agrees_with_another_library_on_flows(motion, dt, delay, theiler, exponent, tolerance):
    """The other one fits from the first step on; over the same stretch both find the same slope.

    Our own rule leaves out the first steps, in which delayed values still overlap, and lies no farther from the
    published value.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nolds = pytest.importorskip("nolds")
    x = motion(4000, dt)[:, 0]
    path = _embedded(x, dt, delay, 3)
    by_rule = largest_lyapunov_exponent(path, theiler_samples=theiler)
    end_s = by_rule.fit_s[1]
    same_stretch = largest_lyapunov_exponent(path, theiler_samples=theiler, fit_s=(0.0, end_s))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = nolds.lyap_r(
            x, emb_dim=3, lag=delay, min_tsep=theiler, tau=dt, trajectory_len=round(end_s / dt) + 1, fit="poly"
        )
    assert same_stretch.exponent_per_s == pytest.approx(theirs, rel=0.06)
    assert by_rule.exponent_per_s == pytest.approx(exponent, rel=tolerance)
    assert abs(by_rule.exponent_per_s - exponent) < abs(theirs - exponent) + 0.02 * exponent
    assert by_rule.verdict == "diverging"


def test_a_stretch_to_fit_may_be_given():
    path = _embedded(lorenz(N, 0.02)[:, 0], 0.02, 8, 3)
    by_rule = largest_lyapunov_exponent(path)
    given = largest_lyapunov_exponent(path, fit_s=by_rule.fit_s)
    assert given.exponent_per_s == by_rule.exponent_per_s
    for wrong in ((-1.0, 1.0), (0.5, 0.5), (0.0, 1e4)):
        with pytest.raises(InputError, match="fit_s goes from"):
            largest_lyapunov_exponent(path, fit_s=wrong)


def test_bad_input():
    portrait = _embedded(lorenz(2000, 0.02)[:, 0], 0.02, 8, 3)
    with pytest.raises(InputError, match="did you mean rosenstein"):
        largest_lyapunov_exponent(portrait, method="rosenstien")
    with pytest.raises(RefusalError, match="too few"):
        largest_lyapunov_exponent(portrait, n_steps=1950)
    with pytest.raises(RefusalError, match="too few"):
        largest_lyapunov_exponent(_embedded(lorenz(200, 0.02)[:, 0], 0.02, 8, 3))
    with pytest.raises(InputError, match="at least 100"):
        largest_lyapunov_exponent(_embedded(lorenz(80, 0.02)[:, 0], 0.02, 8, 3))
    constant = PhasePortrait(np.ones((500, 2)), 1.0, ("x", "y"), ("", ""), "states", "model")
    with pytest.raises(RefusalError, match="constant"):
        largest_lyapunov_exponent(constant)
