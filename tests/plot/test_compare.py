"""Figures of a comparison: what they promise is in them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearsig.comparison import Agreement, BandLevel, LevelPair, LineLevel, RepeatableValue
from gearsig.errors import InputError
from gearsig.orders import SynchronousAverage
from gearsig.plot import average_overlay_figure, band_levels_figure, order_overlay_figure
from gearsig.spectra import Spectrum

LEVEL = LevelPair(-3.0, 0.0, 0.2)


def line(order: float, kind: str = "mesh", *, simulated: bool = True, recorded: bool = True) -> LineLevel:
    return LineLevel(f"{order:g}", kind, order, "input", LEVEL, simulated, recorded)  # type: ignore[arg-type]


def points(figure, marker: str) -> list[float]:  # type: ignore[no-untyped-def]
    return [x for axes in figure.axes for one in axes.lines if one.get_marker() == marker for x in one.get_xdata()]


def test_spectra_lie_over_each_other_and_differences_below(spectrum_of: Callable[..., Spectrum]) -> None:
    spectrum = spectrum_of(np.linspace(1.0, 2.0, 500), "amplitude rms")
    louder = replace(spectrum, values=2 * spectrum.values)
    lines = [line(20.0), line(30.0, "sideband", simulated=False), line(40.0, simulated=False, recorded=False)]
    figure = order_overlay_figure(spectrum, louder, lines, title="both")
    upper, lower = figure.axes
    assert [one.get_label() for one in upper.lines[:2]] == ["recorded", "simulated"]
    assert upper.get_ylabel() == "amplitude rms (m/s²)"
    assert sorted(points(figure, "o")) == [20.0, 30.0]  # a line that neither shows is left out
    assert points(figure, "v") == [30.0]  # missing in the simulation: at least so much too weak
    assert lower.get_ylabel() == "sim. − rec. (dB)"
    assert len(order_overlay_figure(spectrum, louder).axes) == 1


def test_spectra_of_different_kinds_are_refused(spectrum_of: Callable[..., Spectrum]) -> None:
    spectrum = spectrum_of(np.ones(50), "amplitude rms")
    with pytest.raises(InputError, match="differ in unit"):
        order_overlay_figure(spectrum, replace(spectrum, unit="g"))
    with pytest.raises(InputError, match="limits"):
        order_overlay_figure(spectrum, spectrum, limits=(2.0, 1.0))


def test_averages_share_an_axis_unless_one_would_be_a_flat_line(
    average_of: Callable[..., SynchronousAverage],
) -> None:
    wave = np.sin(np.linspace(0, 8 * np.pi, 400, endpoint=False))
    alike = average_overlay_figure(average_of(wave), average_of(2 * wave), [LEVEL] * 23, n_teeth=23)
    assert [axes.get_ylabel() for axes in alike.axes] == ["average (m/s²)", "average (m/s²)", "sim. − rec. (dB)"]
    assert alike.axes[1].get_xlim()[1] == pytest.approx(4 * 360 / 23)
    assert len(alike.axes[2].patches) == 23
    unlike = average_overlay_figure(average_of(wave), average_of(50 * wave))
    assert unlike.axes[0].get_ylabel() == "over its own rms"
    assert unlike.axes[0].get_ylim()[1] < 3
    with pytest.raises(InputError, match="angles"):
        average_overlay_figure(average_of(wave), average_of(wave[:100]))


def test_bands_show_their_agreement_where_they_have_one() -> None:
    alike = Agreement(RepeatableValue(0.9, 0.01), RepeatableValue(0.95, 0.01), 0.3, 20)
    bands = [BandLevel(f"{i}", i, i + 1, "order", LEVEL, alike) for i in range(5)]
    figure = band_levels_figure(bands, "m/s^2")
    assert figure.axes[0].get_ylabel() == "level (dB re 1 m/s²)"
    assert figure.axes[2].get_ylabel() == "FRAC (0 to 1)"
    assert len(band_levels_figure([replace(band, agreement=None) for band in bands]).axes) == 2
    with pytest.raises(InputError, match="no bands"):
        band_levels_figure([])
