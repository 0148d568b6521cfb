"""Cepstra: echoes, harmonic families, liftering."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.spectra import amplitude_spectrum, cepstrum, lifter_families


@settings(max_examples=20, deadline=None)
@given(delay=st.integers(5, 60), strength=st.floats(0.1, 0.6), n=st.sampled_from([1000, 1001]))
def test_an_echo_shows_as_its_series(delay, strength, n):
    x = np.zeros(n)
    x[0], x[delay] = 1.0, strength
    c = cepstrum(x, 1.0)
    # ln|1 + a e^{-iφ}| = Σ (-1)^{k+1} a^k cos(kφ)/k; each cosine is shared by both signs of the quefrency
    assert c.values[delay] == pytest.approx(strength / 2, abs=1e-3)
    assert c.values[2 * delay] == pytest.approx(-(strength**2) / 4, abs=1e-2)
    assert cepstrum(x, 1.0, kind="power").values == pytest.approx(4 * c.values**2)


def test_sideband_spacing_is_the_highest_peak():
    t = np.arange(2000) / 2000.0
    rng = np.random.default_rng(0)
    x = sum(np.cos(2 * np.pi * (500 + 25 * k) * t + k) / (1 + abs(k)) for k in range(-8, 9))
    c = cepstrum(x + 0.01 * rng.normal(size=len(t)), 2000.0)
    assert c.largest_near(0.045, 0.025)[0] == pytest.approx(1 / 25.0, abs=1 / 2000.0)


@pytest.mark.parametrize("n", [8000, 8001])
def test_kept_and_removed_parts_of_the_log_spectrum_add_up(n):
    rng = np.random.default_rng(1)
    x = rng.normal(size=n)
    log_all, log_kept, log_rest = (
        np.log(np.abs(np.fft.rfft(v)))
        for v in (x, lifter_families(x, 1000.0, 20.0, keep=True), lifter_families(x, 1000.0, 20.0, keep=False))
    )
    mean = cepstrum(x, 1000.0).values[0]
    assert log_kept + log_rest - mean == pytest.approx(log_all, abs=1e-7)


def test_removal_levels_the_family_and_leaves_the_rest():
    t = np.arange(20000) / 2000.0
    rng = np.random.default_rng(2)
    family = sum(np.cos(2 * np.pi * 25 * k * t + k * k) for k in range(1, 40))
    x = family + 0.05 * rng.normal(size=len(t))
    before, after = (amplitude_spectrum(v, 2000.0) for v in (x, lifter_families(x, 2000.0, 25.0, keep=False)))
    lines = [before.index_of(25.0 * k) for k in range(4, 36)]
    between = [i + 120 for i in lines]
    assert np.median(20 * np.log10(before.values[lines] / after.values[lines])) > 20.0
    assert abs(np.median(20 * np.log10(before.values[between] / after.values[between]))) < 6.0


def test_zeros_and_impossible_spacings_are_refused():
    with pytest.raises(RefusalError, match="zero"):
        cepstrum(np.zeros(100), 1.0)
    with pytest.raises(InputError, match="spacing_hz"):
        lifter_families(np.ones(100), 100.0, 60.0, keep=True)
