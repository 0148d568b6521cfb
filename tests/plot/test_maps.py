"""Figures of time–frequency maps, of the kurtogram and of spectral coherence."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.plot import CURSOR_COLOURS, Cursor, coherence_figure, kurtogram_figure, time_frequency_figure
from gearsig.spectra import enhanced_envelope, kurtogram, spectral_coherence
from gearsig.timefreq import Ridge, TimeFrequencyMap
from tests.plot.drawn import texts_of


@pytest.fixture
def levels_of():
    def make(values, spacing="linear", axis="frequency", scaling="amplitude peak", reduction="mean"):
        n_columns, n_lines = values.shape
        positions = np.arange(1.0, n_lines + 1) if spacing == "linear" else 10 * 2 ** (np.arange(n_lines) / 16)
        at = np.arange(n_columns) * 0.1
        edge = np.full(n_lines, 0.3)
        return TimeFrequencyMap(
            values, positions, at, axis, spacing, scaling, "m/s^2", "CWT", reduction, edge, source="a$1", shaft="input"
        )

    return make


@pytest.mark.parametrize("spacing", ["linear", "logarithmic"])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (1000, 130), (3000, 1100)])
def test_any_shape_is_drawn_and_thinned(levels_of, spacing, shape):
    values = np.zeros(shape)
    values[shape[0] // 2, shape[1] // 2] = 4.0
    figure = time_frequency_figure(levels_of(values, spacing))
    texts = set(texts_of(figure))
    assert {"a$1", "time (s)", "frequency (Hz)", "CWT; mean power per column", "dB re 1 m/s²"} <= texts
    drawn = figure.axes[0].collections[0].get_array()
    assert drawn.size <= 1200 * 500
    assert drawn.max() == pytest.approx(20 * np.log10(4.0))


def test_orders_and_largest_values_are_named(levels_of):
    texts = texts_of(time_frequency_figure(levels_of(np.ones((20, 9)), axis="order", reduction="max")))
    assert {"angle (revolutions of input)", "order of input", "CWT; largest per column"} <= set(texts)


def test_axis_of_frequencies_follows_the_lines(levels_of):
    figure = time_frequency_figure(levels_of(np.ones((20, 64)), "logarithmic"))
    assert figure.axes[0].get_yscale() == "log"
    assert {"20", "50", "100"} <= set(texts_of(figure))
    assert time_frequency_figure(levels_of(np.ones((20, 64)))).axes[0].get_yscale() == "linear"


def test_ridges_are_dashed_where_shared(levels_of):
    levels = levels_of(np.ones((50, 20)))
    shared = np.arange(50) > 30
    ridge = Ridge(levels.at, np.full(50, 5.0), np.ones(50), shared, "frequency", "m/s^2")
    lines = time_frequency_figure(levels, [ridge]).axes[0].lines[-2:]
    assert [int(np.isfinite(line.get_ydata()).sum()) for line in lines] == [31, 19]
    assert lines[0].get_linestyle() == "-"
    assert lines[1].get_linestyle() == "--"


def test_colours_span_the_asked_range(levels_of):
    values = np.geomspace(1e-9, 1.0, 400).reshape(20, 20)
    mesh = time_frequency_figure(levels_of(values, scaling="power"), dynamic_range_db=40).axes[0].collections[0]
    assert mesh.get_clim() == pytest.approx((-40.0, 0.0))
    with pytest.raises(InputError, match="dynamic_range_db"):
        time_frequency_figure(levels_of(values), dynamic_range_db=0)


def test_ridges_may_be_numbered(levels_of):
    levels = levels_of(np.ones((50, 20)))
    alone = np.zeros(50, dtype=bool)
    found = [Ridge(levels.at, np.full(50, place), np.ones(50), alone, "frequency", "g") for place in (5.0, 12.0)]
    numbers = [
        text for text in time_frequency_figure(levels, found, numbered=True).axes[0].texts if text.get_bbox_patch()
    ]
    assert [(text.get_text(), text.get_position()[1]) for text in numbers] == [("1", 5.0), ("2", 12.0)]
    assert not any(text.get_bbox_patch() for text in time_frequency_figure(levels, found).axes[0].texts)


# Figures of the kurtogram and of spectral coherence.

FS = 10_000.0


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
    texts = set(texts_of(figure))
    assert {"kurtogram of a$1", "frequency (Hz)", "spectral kurtosis", "1", "2", "3"} <= texts
    other = kurtogram_figure(k, k.best_band(highest_hz=2000.0))
    assert max(other.axes[0].lines[-1].get_xdata()) <= 2000.0


def test_kurtogram_says_what_speaks_against_its_band():
    k = kurtogram(np.random.default_rng(1).normal(size=20_000), FS)
    assert any("noise alone reaches" in text for text in texts_of(kurtogram_figure(k)))


@pytest.mark.parametrize("n", [6001, 60_000])
def test_coherence_draws_map_mean_and_level(n):
    c = spectral_coherence(_signal(n), FS, highest_alpha_hz=200.0, n_bands=16, source="a$1")
    figure = coherence_figure(c, cursors=(Cursor(31.0, "shaft", "1× input"), Cursor(93.0, "bearing", "BPFO")))
    assert {"spectral coherence of a$1", "cyclic frequency (Hz)", "carrier (Hz)", "1× input", "BPFO"} <= set(
        texts_of(figure)
    )
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
    assert f"carriers {low:.5g} to {high:.5g} Hz" in texts_of(coherence_figure(c, band))
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
