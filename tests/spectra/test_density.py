"""Power spectral density against scipy's Welch and closed forms."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from gearsig.recording import Channel, Recording
from gearsig.spectra import power_density


@pytest.mark.parametrize("n_per_block", [256, 255])
@pytest.mark.parametrize("overlap", [0.0, 0.5])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_agrees_with_scipy(n_per_block, overlap, dtype):
    x = np.random.default_rng(0).normal(size=3000).astype(dtype)
    ours = power_density(x, 50.0, n_per_block=n_per_block, overlap=overlap)
    step = round(n_per_block * (1 - overlap))
    f, theirs = scipy_signal.welch(
        x.astype(np.float64), 50.0, "hann", n_per_block, noverlap=n_per_block - step, detrend=False
    )
    assert ours.values == pytest.approx(theirs, rel=1e-10)
    assert ours.positions == pytest.approx(f)


def test_white_noise_has_twice_its_variance_over_the_sampling_rate():
    x = 3.0 * np.random.default_rng(1).normal(size=400_000)
    assert power_density(x, 1000.0).values[1:-1].mean() == pytest.approx(2 * 9.0 / 1000.0, rel=0.01)


def test_integral_is_the_mean_square():
    rng = np.random.default_rng(2)
    x = scipy_signal.lfilter([1.0], [1.0, -0.8], rng.normal(size=200_000))
    density = power_density(x, 200.0, n_per_block=512)
    assert density.values.sum() * density.resolution == pytest.approx(np.mean(x**2), rel=0.01)


def test_channel_density_writes_its_unit():
    recording = Recording(np.ones((1, 100)), 8.0, (Channel("p", "sound_pressure", "Pa"),))
    assert power_density(recording, "p").unit == "Pa^2/Hz"
