"""Figures in one call: what they draw is what the method returns."""

import numpy as np
import pytest

import gearsig
from gearsig import plot
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed

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
