"""Every kind of figure draws what it is given, at its edges too."""

from __future__ import annotations

import gc
import pickle
import re
import weakref
from base64 import b64decode
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from io import BytesIO
from time import perf_counter

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import gearsig
from gearsig import plot
from gearsig.angle import ShaftAngle
from gearsig.decompose import Modes, VmdSettings, mode_spectra, vmd
from gearsig.errors import InputError
from gearsig.orders import OrderMap
from gearsig.plot import (
    FAULT,
    AngleMark,
    ChartLine,
    Cursor,
    LevelPanel,
    LinePanel,
    average_figure,
    figure_table,
    modes_figure,
    new_figure,
    order_map_figure,
    panels_of,
    polar_figure,
    spectrum_figure,
    speed_figure,
    svg_panel,
    time_figure,
)
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed
from gearsig.timefreq import UniformSignal
from tests.plot.drawn import texts_of


def _line(figure, axes=0):
    return max(figure.axes[axes].lines, key=lambda line: len(line.get_ydata()))


@pytest.mark.parametrize("n", [1, 2, 3, 5000])
def test_time_of_any_length(recording_of, n):
    figure = time_figure(recording_of(np.zeros((2, n)), "a", "b"))
    assert {"a: acceleration", "b: acceleration"} <= set(texts_of(figure))


def test_time_of_a_million_samples_is_thinned_and_quick(recording_of):
    samples = np.zeros(1_000_000)
    samples[123_457] = 7.0
    recording = recording_of(samples, "a")
    start = perf_counter()
    figure = time_figure(recording)
    texts_of(figure)
    assert perf_counter() - start < 3.0
    assert len(_line(figure).get_ydata()) <= 4000
    assert max(_line(figure).get_ydata()) == 7.0


def test_time_limits_cut_the_signal(recording_of):
    line = _line(time_figure(recording_of(np.arange(1000.0), "a"), limits_s=(0.2, 0.3)))
    assert min(line.get_xdata()) == pytest.approx(0.2)
    assert max(line.get_xdata()) == pytest.approx(0.3)


def test_names_are_never_markup(recording_of):
    assert "$\\frac{: acceleration" in texts_of(time_figure(recording_of(np.zeros(5), "$\\frac{")))


@pytest.mark.parametrize("scale", ["log", "decibel", "linear"])
@pytest.mark.parametrize("values", [np.zeros(10), np.zeros(1), np.ones(1), np.full(10, 1e-30), np.arange(50.0)])
def test_spectrum_of_any_values(spectrum_of, values, scale):
    assert texts_of(spectrum_figure(spectrum_of(values), scale=scale))


def test_spectrum_draws_cursors_floor_and_marked_positions(spectrum_of):
    rng = np.random.default_rng(1)
    spectrum = spectrum_of(rng.rayleigh(size=20_000))
    cursors = [Cursor(23.0, "mesh", "1× mesh"), Cursor(24.0, "sideband", ""), Cursor(9999.0, "shaft", "far away")]
    figure = spectrum_figure(spectrum, cursors, floor=np.ones(20_000), limits=(0, 100), marked=(23.0,))
    texts = texts_of(figure)
    assert "1× mesh" in texts
    assert "far away" not in texts
    assert any(line.get_marker() == "o" for line in figure.axes[0].lines)


def test_spectrum_keeps_the_position_of_a_peak(spectrum_of):
    values = np.full(100_000, 1e-3)
    values[54_321] = 1.0
    line = next(line for line in spectrum_figure(spectrum_of(values)).axes[0].lines if len(line.get_xdata()) > 100)
    assert line.get_xdata()[np.argmax(line.get_ydata())] == pytest.approx(5432.1)


def test_decibel_scale_of_amplitudes(spectrum_of):
    line = _line(spectrum_figure(spectrum_of(np.array([1.0, 10.0, 0.1])), scale="decibel"))
    np.testing.assert_allclose(line.get_ydata(), [0, 20, -20])


def test_spectrum_refuses_what_does_not_fit(spectrum_of):
    with pytest.raises(InputError, match="floor has 3 values"):
        spectrum_figure(spectrum_of(np.ones(10)), floor=np.ones(3))
    with pytest.raises(InputError, match="ascending"):
        spectrum_figure(spectrum_of(np.ones(10)), limits=(5.0, 5.0))
    with pytest.raises(InputError, match="did you mean linear"):
        spectrum_figure(spectrum_of(np.ones(10)), scale="liner")


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (3, 7), (900, 3000)])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_order_map_of_any_shape(shape, level):
    values = np.full(shape, level)
    time, positions = np.arange(shape[0]) * 0.1, np.arange(shape[1]) * 0.05
    order_map = OrderMap(values, positions, time, 1000 + time, "order", "amplitude peak", "m/s^2", 0.05, "a1", "input")
    assert texts_of(order_map_figure(order_map, [Cursor(1.0, "mesh", "1× mesh")] if shape[1] > 30 else []))


def test_order_map_keeps_a_single_tall_cell():
    values = np.full((900, 3000), 1e-3)
    values[777, 1234] = 1.0
    order_map = OrderMap(
        values, np.arange(3000.0), np.arange(900.0), np.ones(900), "order", "amplitude peak", "g", 1.0, "a1", "in"
    )
    figure = order_map_figure(order_map)
    assert figure.axes[1].collections[0].get_array().max() == pytest.approx(0.0)
    assert "order map of a1" in {text.get_text() for text in figure.texts}
    assert figure.axes[1].get_xlabel() == "order of in"


@pytest.mark.parametrize("n", [1, 2, 100, 5000])
@pytest.mark.parametrize("teeth", [None, 3, 23, 300])
def test_polar_of_any_length_and_teeth(average_of, n, teeth):
    assert texts_of(polar_figure(average_of(np.zeros(n)), n_teeth=teeth))


def test_polar_without_any_signal_or_scatter(average_of):
    assert texts_of(polar_figure(average_of(np.zeros(64), error=0.0), n_teeth=8))


def test_polar_colours_the_marked_tooth(average_of):
    figure = polar_figure(average_of(np.zeros(64)), n_teeth=8, marks=[AngleMark(100.0, "tooth 3, 100°")])
    assert "tooth 3, 100°" in texts_of(figure)
    bold = [text.get_text() for text in figure.axes[0].texts if text.get_color() == FAULT]
    assert "3" in bold
    assert "2" not in bold


def test_polar_radius_is_zero_ring_plus_value(average_of):
    figure = polar_figure(average_of(np.array([0.0, 1.0, 0.0, -1.0]), error=0.0))
    line = next(line for line in figure.axes[0].lines if len(line.get_ydata()) == 5)
    np.testing.assert_allclose(line.get_ydata(), [1.0, 1.55, 1.0, 0.45, 1.0])


@pytest.mark.parametrize("n", [1, 2, 4096])
def test_average_of_any_length(average_of, n):
    averages = [average_of(np.ones(n), kind="average"), average_of(np.zeros(n))]
    assert texts_of(average_figure(averages, n_teeth=23, marks=[AngleMark(359.0, "tooth 23")]))


@pytest.mark.parametrize("uncertainty", [float("nan"), 1e-4])
def test_speed_at_rest_and_turning(uncertainty):
    for speed in (0.0, 25.0):
        time = np.array([0.0, 1.0])
        angle = ShaftAngle("input", time, speed * time, np.full(2, speed), "pulses", uncertainty)
        assert "speed of input" in texts_of(speed_figure(angle))


@pytest.mark.slow
def test_figures_can_be_made_in_threads_and_leave_nothing(spectrum_of):
    spectrum = spectrum_of(np.random.default_rng(0).rayleigh(size=3000))

    def make(_):
        figure = spectrum_figure(spectrum, [Cursor(23.0, "mesh", "1× mesh")])
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=50)
        return buffer.getvalue(), weakref.ref(figure)

    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(make, range(12)))
    assert len({picture for picture, _ in results}) == 1
    gc.collect()
    assert all(figure() is None for _, figure in results)


def test_a_panel_as_svg_breaks_lines_at_gaps_and_keeps_the_largest_level() -> None:
    x = np.arange(5.0)
    line = ChartLine(x, np.array([0.0, 1.0, np.nan, 1.0, 0.0]), "a")
    (d,) = re.findall(r'd="([^"]+)" fill="none" stroke', svg_panel(LinePanel([line], "x", "y")))
    assert d.count("M") == 2
    levels = np.full((400, 3000), -90.0)
    levels[100, 1500] = 0.0
    panel = LevelPanel(levels, np.arange(3000.0), np.arange(400.0), "x", "y", "dB")
    packed = re.search(r"base64,([^\"]+)", svg_panel(panel))
    assert packed is not None
    picture = np.asarray(Image.open(BytesIO(b64decode(packed[1]))).convert("L"), dtype=float)
    row, column = np.unravel_index(picture.argmin(), picture.shape)  # dark is high
    assert (1 - (row + 0.5) / picture.shape[0]) * 400 == pytest.approx(100, abs=3)
    assert (column + 0.5) / picture.shape[1] * 3000 == pytest.approx(1500, abs=8)
    assert np.sum(picture < picture.max()) == 1


def test_many_names_of_lines_stand_in_rows_within_the_drawing():
    x = np.arange(3.0)
    svg = svg_panel(LinePanel([ChartLine(x, x, f"mode {k}, {1000 + k} Hz") for k in range(9)], "x", "y"))
    places = [tuple(map(float, at)) for at in re.findall(r'<text x="([\d.]+)" y="([\d.]+)">mode', svg)]
    assert len(places) == 9
    assert len({y for _, y in places}) == 2
    assert max(x for x, _ in places) < 760 - 6 * len("mode 0, 1000 Hz")


def test_a_figure_shows_itself_in_a_notebook() -> None:
    """By itself, IPython knows how to draw figures of `pyplot` only."""
    figure = pickle.loads(pickle.dumps(new_figure(2.0)))  # noqa: S301 - its own
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_a_figure_is_taken_apart_into_panels_that_zoom(average_of) -> None:

    figure = new_figure(3.0)
    left, right = figure.subplots(1, 2)
    turn = np.linspace(0.0, 4.0 * np.pi, 200)
    left.plot(np.cos(turn), np.sin(turn), color=FAULT)
    left.plot([0.5], [0.25], "o", color="#123456")
    right.plot([0.0, 1.0], [2.0, 3.0], "--", color=FAULT, label="fault")
    right.plot([0.0, 1.0], [1.0, 1.0], color=FAULT, label="whole")
    right.legend()
    right.axvline(0.25)
    right.axhline(2.5)
    right.axvspan(0.5, 0.75, color="#00FF00")
    right.bar([0.1], [1.5], width=0.2)
    right.twinx().vlines([0.1, 0.2], 0.0, [1.0, 2.0])
    right.set_xlabel("time (s)")
    ((plane,), (lines, twin)) = panels_of(figure)[0]
    assert plane.is_plane
    assert [(line.colour, line.dots) for line in plane.lines] == [(1, False), ("#123456", True)]
    np.testing.assert_array_equal(plane.lines[0].x, np.cos(turn))
    assert not lines.is_plane
    assert lines.x == "time (s)"
    assert [c.position for c in lines.cursors] == [0.25]
    assert lines.spans == [(0.5, 0.75, "#00FF00")]
    dashed, whole, level, bar = lines.lines
    assert (whole.name, whole.dotted) == ("whole", False)
    assert (dashed.name, dashed.dotted, tuple(level.y)) == ("fault", True, (2.5, 2.5))
    assert np.nanmax(bar.y) == 1.5
    assert np.nanmax(bar.x) == pytest.approx(0.2)
    np.testing.assert_array_equal(twin.lines[0].y, [0.0, 1.0, np.nan, 0.0, 2.0, np.nan])
    assert panels_of(polar_figure(average_of(np.zeros(64)))) == []


def test_a_figures_table_holds_what_it_draws() -> None:
    figure = Figure()
    lines, image = figure.add_subplot(2, 2, 1), figure.add_subplot(2, 2, 2)
    polar = figure.add_subplot(2, 2, 3, projection="polar")
    lines.set_title("first", loc="left")
    lines.plot([0.0, 1.0, 2.0], [5.0, 6.0, 7.0], label="level")
    lines.axhline(3.0)  # no data of its own
    lines.bar([1.0, 3.0], [2.0, 4.0], width=0.5, label="counts")
    lines.scatter([8.0], [9.0], c=[0.5], label="dots")
    lines.fill_between([0.0, 1.0], [0.0, 0.0], [1.0, 1.0], label="band")
    image.imshow(np.array([[1.0, 2.0], [3.0, 4.0]]), origin="lower", extent=(0.0, 2.0, 10.0, 30.0))
    image.pcolormesh([0.0, 2.0, 4.0], [0.0, 1.0], np.array([[7.0, 8.0]]))
    image.set_xlabel("x")
    image.set_ylabel("y")
    polar.plot([0.0, np.pi], [1.0, 2.0])
    table = figure_table(figure)

    def rows(panel: str, series: str) -> list[list[float]]:
        kept = table[(table.panel == panel) & (table.series == series)]
        return [[float(v) for v in row] for row in kept[["x", "y", "level"]].to_numpy()]

    assert [row[:2] for row in rows("first", "level")] == [[0.0, 5.0], [1.0, 6.0], [2.0, 7.0]]
    assert [row[:2] for row in rows("first", "counts")] == [[1.0, 2.0], [3.0, 4.0]]
    assert rows("first", "dots") == [[8.0, 9.0, 0.5]]
    assert len(rows("first", "band")) >= 4
    assert rows("y over x", "image 1") == [[0.5, 15.0, 1.0], [1.5, 15.0, 2.0], [0.5, 25.0, 3.0], [1.5, 25.0, 4.0]]
    assert rows("y over x", "area 1") == [[1.0, 0.5, 7.0], [3.0, 0.5, 8.0]]
    assert [row[:2] for row in rows("panel 3", "line 1")] == [[0.0, 1.0], [np.pi, 2.0]]
    assert figure_table(Figure()).empty


# The figure of modes draws what it is given, at its edges too.

FS = 1000.0


def _modes(n: int = 5000, n_modes: int = 2, **told: str) -> Modes:
    i = np.arange(n)
    x = np.cos(0.2 * i) + 0.5 * np.cos(1.3 * i) + 0.1 * np.random.default_rng(0).normal(size=n)
    return vmd(UniformSignal(x, FS, **told), None, VmdSettings(n_modes, max_iterations=50))


@pytest.mark.parametrize("n", [16, 17, 5000, 50_001])
def test_a_row_for_each_mode_and_the_residual(n):
    figure = modes_figure(_modes(n, unit="m/s^2", source="a1"))
    texts = texts_of(figure)
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
    texts = texts_of(modes_figure(_modes(axis="order", shaft="input")))
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
    assert any("$x^2$" in text for text in texts_of(modes_figure(_modes(source="$x^2$ \\frac"))))


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


# Figures in one call: what they draw is what the method returns.

RATE_HZ = 2000.0
T = np.arange(16000) / RATE_HZ
RECORDING = Recording(
    (np.sin(2 * np.pi * 100.0 * T) + 0.1 * np.random.default_rng(0).normal(size=len(T)))[None],
    RATE_HZ,
    (Channel("a1", "acceleration", "m/s^2"),),
    speed=ConstantSpeed(600.0),
)
ALIKE = (
    *("amplitude_spectrum", "power_density", "kurtogram", "cepstrum", "order_spectrum", "order_map"),
    *("synchronous_average", "stft", "cwt"),
)


@pytest.mark.parametrize("name", ALIKE)
def test_a_method_of_a_recording_is_drawn_in_one_call(name) -> None:
    figure = getattr(plot, name)(RECORDING, "a1")
    assert any(axes.lines or axes.collections or axes.images for axes in figure.axes)
    assert getattr(plot, name).__doc__


def test_the_line_stands_where_the_method_puts_it() -> None:
    (axes, *_) = plot.order_spectrum(RECORDING, "a1").axes
    x, y = max((line.get_data() for line in axes.lines), key=lambda data: len(data[0]))
    spectrum = gearsig.order_spectrum(RECORDING, "a1")
    assert x[np.argmax(y)] == pytest.approx(spectrum.positions[np.argmax(spectrum.values)])


def test_tracked_orders_are_drawn_over_time_at_steady_speed_else_over_speed() -> None:
    for speed_rpm, label in ((600.0, "time (s)"), (np.linspace(600.0, 900.0, len(T)), "speed (rpm)")):
        (axes, *_) = plot.track_orders(RECORDING, "a1", [10.0, 3.0], speed_rpm=speed_rpm).axes
        (tracked, _) = gearsig.track_orders(RECORDING, "a1", [10.0, 3.0], speed_rpm=speed_rpm)
        assert axes.get_xlabel() == label
        assert "m/s²" in axes.get_ylabel()
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), tracked.amplitude)


def test_results_that_nothing_draws_are_refused() -> None:
    with pytest.raises(InputError):
        plot.figure_of(3.0)
    with pytest.raises(InputError, match="tuple of Indicator"):
        plot.figure_of(gearsig.time_indicators(RECORDING, "a1"))
