"""Deconvolution undoes a path: against closed forms, a dense solution and what is known of the source."""

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.spectra import minimum_entropy_deconvolution, multipoint_deconvolution, multipoint_norms

RATE_HZ = 1000.0


def ringing_train(period: float, n: int = 6000, noise: float = 0.1, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Impacts every `period` samples, and how they ring at a sensor in noise."""
    impacts = np.zeros(n)
    impacts[np.round(np.arange(20, n, period)).astype(int)] = 1.0
    k = np.arange(120)
    ring = np.exp(-k / 15.0) * np.sin(0.9 * k) + 0.5 * np.exp(-k / 30.0) * np.sin(1.7 * k)
    return impacts, np.convolve(impacts, ring)[:n] + noise * np.random.default_rng(seed).normal(size=n)


def delays(x: FloatArray, n_taps: int) -> FloatArray:
    """The matrix X, row by row."""
    return np.asarray(sliding_window_view(x, n_taps)[:, ::-1].T)


def test_multipoint_solution_is_that_of_the_dense_least_squares_problem() -> None:
    _, x = ringing_train(150.0)
    n_taps = 40
    result = multipoint_deconvolution(x, RATE_HZ, 0.150, n_taps=n_taps)
    matrix = delays(x - x.mean(), n_taps)
    train = np.zeros(matrix.shape[1])
    train[::150] = 1.0
    taps = np.linalg.lstsq(matrix.T, train, rcond=None)[0]
    taps /= np.linalg.norm(taps)
    np.testing.assert_allclose(result.taps, taps, atol=1e-6)
    np.testing.assert_allclose(result.values, matrix.T @ taps, atol=1e-6)
    y = matrix.T @ taps
    assert result.score == pytest.approx(train @ y / np.linalg.norm(train) / np.linalg.norm(y), rel=1e-6)


def test_no_other_filter_has_a_higher_multipoint_norm() -> None:
    _, x = ringing_train(150.0)
    result = multipoint_deconvolution(x, RATE_HZ, 0.150, n_taps=30)
    train = np.zeros(len(result.values))
    train[::150] = 1.0
    rng = np.random.default_rng(1)
    for _ in range(50):
        taps = result.taps + 0.05 * rng.normal(size=30)
        y = np.convolve(x - x.mean(), taps, mode="valid")
        assert train @ y / np.linalg.norm(train) / np.linalg.norm(y) < result.score


def test_norms_over_periods_are_those_of_each_and_highest_at_the_true_one() -> None:
    _, x = ringing_train(137.3, noise=0.3)
    periods = np.array([0.1, 0.121, 0.1373, 0.15, 0.171])
    norms = multipoint_norms(x, RATE_HZ, periods, n_taps=60)
    each = [multipoint_deconvolution(x, RATE_HZ, p, n_taps=60).score for p in periods]
    np.testing.assert_allclose(norms, each, rtol=1e-5)
    assert int(np.argmax(norms)) == 2
    assert norms[2] > 2 * np.delete(norms, 2).max()


def test_minimum_entropy_undoes_a_path_that_has_an_inverse() -> None:
    rng = np.random.default_rng(2)
    source = rng.normal(size=8000) * (rng.uniform(size=8000) < 0.01)
    x = np.convolve(source, [1.0, -0.9, 0.5])[:8000]  # zeros inside the unit circle: a stable inverse
    result = minimum_entropy_deconvolution(x, RATE_HZ, n_taps=40)
    y = result.values
    lags = range(40)
    match = max(abs(np.corrcoef(source[lag : lag + len(y)], y)[0, 1]) for lag in lags)
    assert match > 0.99
    kurtosis = len(source) * np.sum(source**4) / np.sum(source**2) ** 2
    assert result.score == pytest.approx(kurtosis, rel=0.05)


def test_minimum_entropy_is_a_fixed_point_and_scale_free() -> None:
    _, x = ringing_train(200.0)
    result = minimum_entropy_deconvolution(x, RATE_HZ, n_taps=50, n_iterations=500)
    matrix, y = delays(x - x.mean(), 50), result.values
    taps = np.linalg.solve(matrix @ matrix.T, matrix @ y**3)
    assert abs(taps @ result.taps) / np.linalg.norm(taps) == pytest.approx(1.0, abs=1e-2)
    louder = minimum_entropy_deconvolution(1e3 * x + 7.0, RATE_HZ, n_taps=50, n_iterations=500)
    assert louder.score == pytest.approx(result.score, rel=1e-3)
    assert result.score > len(x) * np.sum(x**4) / np.sum(x**2) ** 2


def test_of_white_noise_the_norm_is_that_of_the_number_of_taps() -> None:
    x = np.random.default_rng(3).normal(size=20_000)
    norms = multipoint_norms(x, RATE_HZ, np.linspace(0.11, 0.19, 40), n_taps=80)
    assert np.sqrt(np.mean(norms**2)) == pytest.approx(np.sqrt(80 / 20_000), rel=0.1)


def test_what_does_not_fit_is_refused() -> None:
    x = np.random.default_rng(4).normal(size=1000)
    with pytest.raises(InputError, match="tenth"):
        minimum_entropy_deconvolution(x, RATE_HZ, n_taps=101)
    with pytest.raises(InputError, match="period_s"):
        multipoint_deconvolution(x, RATE_HZ, 0.5, n_taps=20)
    with pytest.raises(RefusalError, match="constant"):
        minimum_entropy_deconvolution(np.full(1000, 3.0), RATE_HZ, n_taps=20)
