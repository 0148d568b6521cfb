"""Figures of time–frequency maps."""

from io import BytesIO

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.plot import time_frequency_figure
from gearsig.timefreq import Ridge, TimeFrequencyMap


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


def _texts(figure):
    from matplotlib.text import Text

    figure.savefig(BytesIO(), format="png", dpi=40)
    return {text.get_text() for text in figure.findobj(Text) if text.get_text()}


@pytest.mark.parametrize("spacing", ["linear", "logarithmic"])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (1000, 130), (3000, 1100)])
def test_any_shape_is_drawn_and_thinned(levels_of, spacing, shape):
    values = np.zeros(shape)
    values[shape[0] // 2, shape[1] // 2] = 4.0
    figure = time_frequency_figure(levels_of(values, spacing))
    texts = _texts(figure)
    assert {"a$1", "time (s)", "frequency (Hz)", "CWT; mean power per column", "dB re 1 m/s²"} <= texts
    drawn = figure.axes[0].collections[0].get_array()
    assert drawn.size <= 1200 * 500
    assert drawn.max() == pytest.approx(20 * np.log10(4.0))


def test_orders_and_largest_values_are_named(levels_of):
    texts = _texts(time_frequency_figure(levels_of(np.ones((20, 9)), axis="order", reduction="max")))
    assert {"angle (revolutions of input)", "order of input", "CWT; largest per column"} <= texts


def test_axis_of_frequencies_follows_the_lines(levels_of):
    figure = time_frequency_figure(levels_of(np.ones((20, 64)), "logarithmic"))
    assert figure.axes[0].get_yscale() == "log"
    assert {"20", "50", "100"} <= _texts(figure)
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
