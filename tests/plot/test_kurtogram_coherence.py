"""Figures of the kurtogram and of spectral coherence."""

from io import BytesIO

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.plot import CURSOR_COLOURS, Cursor, coherence_figure, kurtogram_figure
from gearsig.spectra import enhanced_envelope, kurtogram, spectral_coherence

FS = 10_000.0


def _texts(figure):
    from matplotlib.text import Text

    figure.savefig(BytesIO(), format="png", dpi=40)
    return {text.get_text() for text in figure.findobj(Text) if text.get_text()}


def _signal(n):
    t = np.arange(n) / FS
    return (1 + 0.8 * np.cos(2 * np.pi * 31 * t)) ** 4 * np.random.default_rng(0).normal(size=n)


@pytest.mark.parametrize("n", [1024, 30_001])
def test_kurtogram_outlines_the_band(n):
    k = kurtogram(_signal(n), FS, source="a$1")
    figure = kurtogram_figure(k)
    axes = figure.axes[0]
    assert sum(mesh.get_array().size for mesh in axes.collections) == len(k.kurtosis)
    band = k.best_band()
    outline = axes.lines[-1]
    assert (min(outline.get_xdata()), max(outline.get_xdata())) == band.band_hz
    texts = _texts(figure)
    assert {"kurtogram of a$1", "frequency (Hz)", "spectral kurtosis", "1", "2", "3"} <= texts
    other = kurtogram_figure(k, k.best_band(highest_hz=2000.0))
    assert max(other.axes[0].lines[-1].get_xdata()) <= 2000.0


def test_kurtogram_says_what_speaks_against_its_band():
    k = kurtogram(np.random.default_rng(1).normal(size=20_000), FS)
    assert any("noise alone reaches" in text for text in _texts(kurtogram_figure(k)))


@pytest.mark.parametrize("n", [6001, 60_000])
def test_coherence_draws_map_mean_and_level(n):
    c = spectral_coherence(_signal(n), FS, highest_alpha_hz=200.0, n_bands=16, source="a$1")
    figure = coherence_figure(c, cursors=(Cursor(31.0, "shaft", "1× input"), Cursor(93.0, "bearing", "BPFO")))
    assert {"spectral coherence of a$1", "cyclic frequency (Hz)", "carrier (Hz)", "1× input", "BPFO"} <= _texts(figure)
    for axes in figure.axes[:2]:  # in both panels, each kind in its colour
        colours = {line.get_color() for line in axes.lines if len(set(line.get_xdata())) == 1}
        assert colours >= {CURSOR_COLOURS["shaft"], CURSOR_COLOURS["bearing"]}
    drawn = figure.axes[1].collections[0].get_array()
    assert drawn.max() == pytest.approx(c.coherence_squared.max())
    assert drawn.shape[0] == len(c.frequency_hz)
    assert drawn.shape[1] <= 500
    dashed = figure.axes[0].lines[1]
    assert dashed.get_ydata()[0] == pytest.approx(enhanced_envelope(c).level)


def test_mean_over_a_band_is_named_and_must_belong_to_the_map():
    c = spectral_coherence(_signal(8000), FS, highest_alpha_hz=200.0, n_bands=16)
    band = enhanced_envelope(c, (1000.0, 2500.0))
    low, high = band.band_hz
    assert f"carriers {low:.5g} to {high:.5g} Hz" in _texts(coherence_figure(c, band))
    other = spectral_coherence(_signal(9000), FS, highest_alpha_hz=200.0, n_bands=16)
    with pytest.raises(InputError, match="does not belong"):
        coherence_figure(other, band)


def test_coherence_may_be_drawn_between_limits():
    found = spectral_coherence(_signal(30_001), FS, highest_alpha_hz=200)
    above, below, *_ = coherence_figure(found, limits=(20.0, 60.0)).axes
    low, high = below.get_xlim()
    assert (low, high) == pytest.approx((20.0, 60.0), abs=found.alpha_resolution)
    x = above.lines[0].get_xdata()
    assert 20.0 <= min(x) <= max(x) <= 60.0
    for limits in ((60.0, 20.0), (300.0, 400.0)):
        with pytest.raises(InputError, match="limits are"):
            coherence_figure(found, limits=limits)
