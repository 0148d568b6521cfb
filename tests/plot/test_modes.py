"""The figure of modes draws what it is given, at its edges too."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from gearsig.decompose import Modes, VmdSettings, mode_spectra, vmd
from gearsig.errors import InputError
from gearsig.plot import modes_figure
from gearsig.timefreq import UniformSignal

FS = 1000.0


def _modes(n: int = 5000, n_modes: int = 2, **told: str) -> Modes:
    i = np.arange(n)
    x = np.cos(0.2 * i) + 0.5 * np.cos(1.3 * i) + 0.1 * np.random.default_rng(0).normal(size=n)
    return vmd(UniformSignal(x, FS, **told), None, VmdSettings(n_modes, max_iterations=50))


def _drawn(figure):
    """Draw, which raises where matplotlib warns; return all texts."""
    from matplotlib.text import Text

    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


@pytest.mark.parametrize("n", [16, 17, 5000, 50_001])
def test_a_row_for_each_mode_and_the_residual(n):
    figure = modes_figure(_modes(n, unit="m/s^2", source="a1"))
    texts = _drawn(figure)
    assert len(figure.axes) == 6
    assert sum(text.startswith("mode ") for text in texts) == 2
    assert any(text.startswith("residual") for text in texts)
    assert {"time (s)", "frequency (Hz)", "amplitude peak (m/s²)"} <= set(texts)


def test_rows_go_by_rising_centre_and_mark_it():
    modes = _modes()
    modes = replace(
        modes, waveforms=modes.waveforms[::-1], centres=modes.centres[::-1], bandwidths=modes.bandwidths[::-1]
    )
    figure = modes_figure(modes)
    marked = [figure.axes[i].lines[-1].get_xdata()[0] for i in (1, 3)]
    assert marked == pytest.approx(sorted(modes.centres))
    assert [axes.get_title(loc="left")[:6] for axes in figure.axes[:4:2]] == ["mode 2", "mode 1"]


def test_over_angle_the_axes_are_orders_and_revolutions():
    texts = _drawn(modes_figure(_modes(axis="order", shaft="input")))
    assert any("order" in text and "input" in text for text in texts)
    assert "angle of input (revolutions)" in texts


def test_a_million_samples_are_thinned():
    modes = _modes(1_000_000, 1)
    figure = modes_figure(modes)
    assert all(len(line.get_xdata()) <= 4000 for axes in figure.axes for line in axes.lines)


def test_limits_cut_both_sides():
    figure = modes_figure(_modes(), limits=(1.0, 2.0), spectrum_limits=(10.0, 100.0))
    assert figure.axes[0].get_xlim() == pytest.approx((1.0, 2.0))
    assert figure.axes[1].get_xlim() == pytest.approx((10.0, 100.0))
    assert min(figure.axes[0].lines[0].get_xdata()) == pytest.approx(1.0)


def test_names_from_files_are_no_markup():
    assert any("$x^2$" in text for text in _drawn(modes_figure(_modes(source="$x^2$ \\frac"))))


@pytest.mark.parametrize("limits", [(2.0, 1.0), (1.0, 1.0), (9.0, 10.0)])
def test_limits_that_do_not_do(limits):
    with pytest.raises(InputError, match="limits"):
        modes_figure(_modes(), limits=limits)


def test_too_many_modes():
    with pytest.raises(InputError, match="13 modes"):
        modes_figure(_modes(n_modes=13))


def test_spectra_of_a_mode_read_its_amplitude():
    modes = _modes()
    spectra = mode_spectra(modes)
    assert len(spectra) == 3
    i = int(np.argmin(modes.centres))
    assert spectra[i].largest_near(0.2 * FS / (2 * np.pi), 1.0)[1] == pytest.approx(1.0, rel=0.15)  # Hann: up to 1.4 dB
