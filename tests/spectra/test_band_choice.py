"""The demodulation band: impulses are found, noise and tones are not."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from gearsig.errors import RefusalError
from gearsig.spectra import choose_band

FS, N = 20_000.0, 100_000


def _impulses(rng, amplitude):
    x = np.zeros(N)
    at = np.cumsum(rng.normal(400, 4, size=240)).astype(int)  # one per cent of jitter
    x[at[at < N]] = amplitude
    b, a = scipy_signal.butter(2, [5000, 6000], "bandpass", fs=FS)
    return scipy_signal.lfilter(b, a, x)


def test_band_of_the_resonance_is_found_under_noise():
    rng = np.random.default_rng(0)
    best = choose_band(rng.normal(size=N) + _impulses(rng, 25.0), FS)[0]
    assert 4700 < (best.low_hz + best.high_hz) / 2 < 6300
    assert best.kurtosis > 10 * best.standard_error


def test_a_strong_tone_in_the_band_does_not_hide_the_impulses():
    rng = np.random.default_rng(1)
    x = rng.normal(size=N) + _impulses(rng, 25.0) + 20.0 * np.sin(2 * np.pi * 5500.3 * np.arange(N) / FS)
    best = choose_band(x, FS)[0]
    assert 4700 < (best.low_hz + best.high_hz) / 2 < 6300
    raw = choose_band(x, FS, tone_limit_db=None)
    with_tone = [c.kurtosis for c in raw if c.low_hz < 5500 < c.high_hz and c.level <= 4]
    assert max(with_tone) < -0.5


def test_kurtosis_of_noise_is_zero_within_its_stated_error():
    candidates = choose_band(np.random.default_rng(2).normal(size=N), FS)
    scores = np.array([c.kurtosis / c.standard_error for c in candidates])
    assert abs(scores.mean()) < 0.3
    assert scores.std() == pytest.approx(1.0, abs=0.25)


def test_limits_are_kept():
    x = np.random.default_rng(3).normal(size=N)
    candidates = choose_band(x, FS, narrowest_hz=900.0, lowest_hz=1500.0)
    assert min(c.high_hz - c.low_hz for c in candidates) >= 900.0
    assert min(c.low_hz for c in candidates) >= 1500.0


def test_too_short_a_signal_is_refused():
    with pytest.raises(RefusalError, match="too few"):
        choose_band(np.random.default_rng(4).normal(size=300), FS)
