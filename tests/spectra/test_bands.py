"""The compared band choice finds the band that carries the modulation, and says which way of looking shows it best."""

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.spectra import coherence_band, compare_bands, spectral_coherence

RATE_HZ, SECONDS, MODULATION_HZ = 12_000.0, 6.0, 107.0


def ringing(carrier_hz: float, height: float, *, shocks: float = 0.0, seed: int = 0) -> FloatArray:
    """Impacts that ring at a carrier in white noise, and a few strong shocks at 4.8 kHz."""
    rng = np.random.default_rng(seed)
    n = int(SECONDS * RATE_HZ)
    x, k = rng.standard_normal(n), np.arange(200)
    hits = np.cumsum(RATE_HZ / MODULATION_HZ * (1 + 0.002 * rng.standard_normal(int(SECONDS * MODULATION_HZ) - 5)))
    train = np.zeros(n)
    train[np.round(hits).astype(int)] = height
    x += np.convolve(train, np.exp(-k / 30) * np.sin(2 * np.pi * carrier_hz * k / RATE_HZ))[:n]
    few = np.zeros(n)
    few[rng.integers(0, n - 300, 6)] = shocks
    return x + np.convolve(few, np.exp(-k / 20) * np.sin(2 * np.pi * 4800.0 * k / RATE_HZ))[:n]


@pytest.mark.parametrize("carrier_hz", [1500.0, 2600.0, 4100.0])
def test_the_coherence_band_holds_the_carrier(carrier_hz: float) -> None:
    x = ringing(carrier_hz, 1.5)
    low, high = coherence_band(spectral_coherence(x, RATE_HZ, highest_alpha_hz=400.0), MODULATION_HZ)
    assert low < carrier_hz < high
    assert high - low < 1500.0


def test_a_few_shocks_mislead_the_kurtogram_alone() -> None:
    choices = {c.method: c for c in compare_bands(ringing(2600.0, 1.5, shocks=12.0), RATE_HZ, MODULATION_HZ)}
    assert choices["kurtogram"].band_hz[0] > 3500.0
    assert choices["coherence band"].clarity_db > choices["kurtogram"].clarity_db + 6.0
    assert choices["coherence band"].modulation_hz == pytest.approx(MODULATION_HZ, rel=2e-3)


def test_the_clearest_comes_first_and_noise_shows_nothing() -> None:
    choices = compare_bands(ringing(2600.0, 1.5), RATE_HZ, MODULATION_HZ)
    assert [c.clarity_db for c in choices] == sorted((c.clarity_db for c in choices), reverse=True)
    assert choices[0].clarity_db > 15.0
    assert all(c.clarity_db < 9.0 for c in compare_bands(ringing(2600.0, 0.0), RATE_HZ, MODULATION_HZ))
