"""Scales of speeds and accelerations against the angle: recovered, refused where wrong."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.motion import channel_scale, measure_motion
from tests.motion.recordings import changed, continuous, start_stop

RATE_HZ = 1000.0
TIME_S = np.arange(6000) / RATE_HZ


@given(gain=st.floats(0.2, 5.0), seed=st.integers(0, 1000))
def test_the_scale_is_recovered_with_its_error(gain: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = 3.0 * np.sin(2.0 * TIME_S) + 1e-5 * rng.standard_normal(len(TIME_S))
    speed = 6.0 * np.cos(2.0 * TIME_S) + 0.05 * rng.standard_normal(len(TIME_S))
    acceleration = -12.0 * np.sin(2.0 * TIME_S) + 0.5 * rng.standard_normal(len(TIME_S))
    for order, rate in ((1, speed), (2, acceleration)):
        scale, error = channel_scale(angle, gain * rate, RATE_HZ, order)
        assert scale == pytest.approx(gain, abs=6.0 * error + 2e-4 * gain)
        assert error < 0.02 * gain


def test_nothing_is_said_of_what_stands_or_moves_once() -> None:
    for angle in (np.zeros(6000), np.where(TIME_S > 3.0, 1.0, 0.0), np.linspace(0.0, 1.0, 300)):
        assert np.isnan(channel_scale(angle, np.ones(len(angle)), RATE_HZ)[0])


@pytest.mark.parametrize("name", ["pinion speed", "wheel speed", "pinion acceleration", "wheel acceleration"])
@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_channel_of_another_scale_is_refused_with_its_factor(name: str, gain: float) -> None:
    healthy = start_stop(rate_hz=4000.0)  # the pinion's acceleration rings too fast for 1 kHz to tell its scale
    with pytest.raises(InputError, match=f"{name}' reads (0.[78]|1.2).*angle'.*scale"):
        measure_motion(changed(healthy, name, gain * healthy.values(name)))


def test_simulated_channels_agree_in_every_mode() -> None:
    for recording in (start_stop(), start_stop(rate_hz=4000.0), start_stop("manipulator_table"), continuous()):
        measure_motion(recording)
    measure_motion(start_stop(slow_channels="filtered"))  # type: ignore[arg-type]  # a word
    coarse = start_stop(encoder_counts=512.0)
    measure_motion(replace(coarse, samples=coarse.samples))


def test_an_acceleration_that_is_sampled_too_slowly_is_not_judged() -> None:
    """Ringing folds down, alike in each start: the sum is off though the channel is right."""
    healthy = start_stop()
    measure_motion(changed(healthy, "pinion acceleration", 0.7 * healthy.values("pinion acceleration")))
