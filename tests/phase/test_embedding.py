"""Delay, dimension and neighbours of an embedding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from gearsig.errors import InputError, RefusalError
from gearsig.phase import (
    average_mutual_information,
    delay_embedding,
    delay_vectors,
    embedding_dimension,
    evenly_spaced_indices,
    nearest_beyond_theiler_window,
)
from gearsig.recording import Channel, Recording
from tests.phase.systems import henon, logistic, lorenz, narrow_band_noise, quasi_periodic, rossler

N = 12_000


def _noise(n=N, seed=0):
    return np.random.default_rng(seed).normal(size=n)


def test_mutual_information_of_a_gaussian_process_is_known():
    """I(τ) = -ln(1 - ρ²)/2 with ρ = 0.8^τ; binning loses some percent of it."""
    x = lfilter([1.0], [1.0, -0.8], _noise(100_000))[100:]
    information = average_mutual_information(x, 1.0, longest_delay_samples=20).information_nats
    delays = np.arange(1, 21)
    wanted = -0.5 * np.log1p(-(0.8 ** (2 * delays)))
    np.testing.assert_allclose(information[1:], wanted, rtol=0.05, atol=2e-3)


def test_mutual_information_does_not_change_under_a_monotonic_distortion():
    x = lorenz(N, 0.02)[:, 0]
    one, two = (average_mutual_information(v, 50.0) for v in (x, np.arctan(x / 5.0)))
    np.testing.assert_allclose(one.information_nats, two.information_nats[: len(one.information_nats)], atol=1e-9)
    assert one.delay_samples == two.delay_samples


@pytest.mark.parametrize(
    ("x", "delay", "rule"),
    [
        (lambda: lorenz(N, 0.01)[:, 0], (15, 19), "first minimum"),  # 0.16 s in the literature
        (lambda: rossler(N, 0.1)[:, 0], (12, 18), "first minimum"),  # about a quarter of 5.9
        (lambda: np.sin(2 * np.pi * np.arange(N) / 50.3), (12, 13), "quarter period"),
        (lambda: quasi_periodic(N), (9, 14), "first minimum"),
        (lambda: henon(N), (1, 1), "one step"),
        (_noise, (1, 1), "one step"),
    ],
    ids=["lorenz", "rossler", "sine", "quasi", "henon", "noise"],
)
def test_delay(x, delay, rule):
    found = average_mutual_information(x(), 1.0)
    assert found.rule == rule
    assert delay[0] <= found.delay_samples <= delay[1]


@pytest.mark.parametrize(
    ("x", "dimension"),
    [
        (lambda: lorenz(N, 0.01)[:, 0], 3),
        (lambda: rossler(N, 0.1)[:, 0], 3),
        (lambda: henon(N), 2),
        (lambda: logistic(N), 1),
        (lambda: quasi_periodic(N), 3),
        (lambda: lorenz(N, 0.01)[:, 0] + 0.03 * 8.0 * _noise(), 3),
        (lambda: _noise(6000), 0),
        (lambda: lfilter([1.0], [1.0, -0.9], _noise(6000)), 0),
    ],
    ids=["lorenz", "rossler", "henon", "logistic", "quasi", "lorenz with 3 % noise", "white noise", "coloured noise"],
)
def test_dimension(x, dimension):
    found = embedding_dimension(x(), 1.0)
    assert found.dimension == dimension
    assert found.verdict == ("deterministic" if dimension else "stochastic")


@pytest.mark.parametrize("n", [300, 1000, 3000])
def test_white_noise_of_any_length_is_called_stochastic_and_not_embedded(n):
    found = embedding_dimension(_noise(n, n), 1.0)
    assert found.verdict == "stochastic"
    np.testing.assert_allclose(found.determinism[:3], 1.0, atol=0.15)
    if n == 300:
        with pytest.raises(RefusalError, match="looks stochastic"):
            delay_embedding(_noise(n, n), 1.0)


def test_float32_odd_length_and_one_sample_more_give_the_same():
    x = lorenz(6000, 0.02)[:, 0]
    found = [embedding_dimension(v, 50.0, largest=5) for v in (x, x[:-1], x.astype(np.float32), 5.0 * x - 3.0)]
    assert {f.dimension for f in found} == {3}
    assert {f.delay_samples for f in found} <= {7, 8, 9}
    np.testing.assert_allclose(found[2].false_fraction, found[0].false_fraction, atol=5e-3)
    np.testing.assert_allclose(found[3].false_fraction, found[0].false_fraction, atol=5e-3)


def test_embedding_is_a_view_of_delayed_values():
    x = np.arange(100.0)
    vectors = delay_vectors(x, 3, 4)
    assert vectors.shape == (91, 4)
    assert vectors[5].tolist() == [5.0, 8.0, 11.0, 14.0]
    portrait = delay_embedding(_noise(), 10.0, delay_samples=3, dimension=4, unit="g")
    assert portrait.points.base is not None
    assert portrait.axis_names == ("x(t)", "x(t + 0.3 s)", "x(t + 0.6 s)", "x(t + 0.9 s)")


def test_a_channel_is_embedded_with_its_unit():
    recording = Recording(lorenz(N, 0.02)[:, 0][None, :], 50.0, (Channel("a1", "acceleration", "g"),))
    portrait = delay_embedding(recording, "a1")
    assert (portrait.n_axes, portrait.units, portrait.source) == (3, ("g",) * 3, "a1")


@pytest.mark.parametrize("norm", [2.0, np.inf])
def test_neighbours_equal_brute_force(norm):
    points = delay_vectors(lorenz(600, 0.02)[:, 0].copy(), 8, 3)
    references = np.arange(0, len(points), 7)
    distance, index = nearest_beyond_theiler_window(points, np.arange(len(points)), references, 40, norm)
    for i, d, j in zip(references, distance, index, strict=True):
        all_distances = np.linalg.norm(points - points[i], ord=norm, axis=1)
        all_distances[max(0, i - 40) : i + 41] = np.inf
        assert (j, d) == (all_distances.argmin(), pytest.approx(all_distances.min()))


@pytest.mark.parametrize("call", [average_mutual_information, embedding_dimension, delay_embedding])
def test_constants_gaps_and_short_signals(call):
    with pytest.raises(RefusalError, match=r"constant at 3.*check the sensor"):
        call(np.full(1000, 3.0), 1.0)
    with pytest.raises(InputError, match="NaN"):
        call(np.where(np.arange(1000) == 7, np.nan, 1.0), 1.0)
    with pytest.raises(InputError, match="10 sample"):
        call(np.arange(10.0), 1.0)
    with pytest.raises(InputError, match=r"sampling.rate.* is 0 Hz"):
        call(_noise(1000), 0.0)


def test_embeddings_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="too few for dimension 10 at a delay of 100"):
        delay_embedding(_noise(500), 1.0, delay_samples=100, dimension=10)
    with pytest.raises(InputError, match="dimension is 21"):
        delay_embedding(_noise(5000), 1.0, delay_samples=1, dimension=21)
    with pytest.raises(RefusalError, match="in 10 dimensions"):
        embedding_dimension(_noise(500), 1.0, delay_samples=60)
    with pytest.raises(RefusalError, match="too few for delays up to 400"):
        average_mutual_information(_noise(500), 1.0, longest_delay_samples=400)
    with pytest.raises(RefusalError, match=r"does not return|does not fall|leave"):
        embedding_dimension(np.linspace(0.0, 1.0, 5000), 1.0)


def test_narrow_band_noise_is_not_told_apart_by_false_neighbours_alone():
    """A stated limit: the Lyapunov exponent's refusal is what catches it (see test_lyapunov)."""
    assert embedding_dimension(narrow_band_noise(N, np.random.default_rng(0)), 1.0).dimension > 3


@pytest.mark.parametrize("n_levels", [256, 4096])
def test_a_coarse_converter_does_not_change_the_dimension(n_levels):
    x = lorenz(N, 0.02)[:, 0]
    step = np.ptp(x) / n_levels
    assert embedding_dimension(np.round(x / step) * step, 50.0).dimension == 3


def test_exact_repetition_is_named():
    x = np.tile(np.random.default_rng(0).normal(size=10), 200)
    points = delay_vectors(x, 1, 3)
    library, references = np.arange(len(points)), np.arange(0, len(points), 7)
    with pytest.raises(RefusalError, match="exactly the same points"):
        nearest_beyond_theiler_window(points, library, references, 10)
    distance, index = nearest_beyond_theiler_window(points, library, references, 10, equal_counts=True)
    assert not distance.any()
    assert np.all((index - references) % 10 == 0)


# Neighbours that are apart in time, against all distances.


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
    library, references = evenly_spaced_indices(900, 600), evenly_spaced_indices(900, 150)
    expected = all_distances(points, library, references, theiler, norm, equal_counts=equal_counts)
    found, index = nearest_beyond_theiler_window(points, library, references, theiler, norm, equal_counts=equal_counts)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.all(np.abs(index - references) > theiler)


def test_what_never_comes_back_is_refused():
    drift = np.column_stack([np.arange(8000.0), np.zeros(8000)])
    with pytest.raises(RefusalError, match="does not return"):
        nearest_beyond_theiler_window(drift, np.arange(8000), evenly_spaced_indices(8000, 100), 2000)


def test_exact_repetition_is_refused_as_such():
    t = np.arange(6000) % 3
    with pytest.raises(RefusalError, match="exactly the same points"):
        nearest_beyond_theiler_window(
            np.column_stack([t, t]).astype(float), np.arange(6000), evenly_spaced_indices(6000, 100), 10
        )
