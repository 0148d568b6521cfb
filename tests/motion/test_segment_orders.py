"""Order spectra through standstill and reversal."""

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.motion import measure_motion, motion_segments, segment_order_spectrum
from tests.motion.recordings import start_stop

RATE = 2000.0


def swing(turns: float = 6.0, period_s: float = 4.0, n_periods: int = 3) -> np.ndarray:
    t = np.arange(0.0, n_periods * period_s, 1.0 / RATE)
    return np.pi * turns * np.sin(2.0 * np.pi * t / period_s)


@pytest.mark.parametrize("direction", ["forwards", "backwards"])
def test_a_tone_over_angle_is_one_line_though_the_speed_crosses_zero(direction: str) -> None:
    """1.5 cos(20 θ) of a shaft that swings: its frequency runs from 0 to 190 Hz and back, its order stays."""
    angle = swing()
    segments = motion_segments(angle, RATE)
    spectrum = segment_order_spectrum(
        1.5 * np.cos(20.0 * angle + 0.3) + 0.5, angle, segments, direction=direction, revolutions_per_block=4.0
    )
    order, amplitude = spectrum.largest_near(20.0, 1.0)
    assert order == pytest.approx(20.0, abs=0.13)
    assert amplitude == pytest.approx(1.5, rel=0.02)
    assert spectrum.values[0] == pytest.approx(0.5, rel=0.02)
    away = np.abs(spectrum.positions - 20.0) > 1.0
    assert np.max(spectrum.values[away & (spectrum.positions > 1.0)]) < 0.02
    assert spectrum.axis == "order"


def test_over_time_the_same_signal_is_no_line() -> None:
    from gearsig.spectra import amplitude_spectrum

    signal = 1.5 * np.cos(20.0 * swing() + 0.3)
    assert np.max(amplitude_spectrum(signal, RATE).values) < 0.4


def test_mesh_order_of_the_simulated_drive() -> None:
    """Pairs come and go 20 times a revolution: the strongest line of the tooth force above the run-up itself."""
    recording = start_stop()
    motion = measure_motion(recording)
    segments = motion_segments(motion.driver_angle_rad, 1000.0)
    spectrum = segment_order_spectrum(
        recording.values("torque"), motion.driver_angle_rad, segments, revolutions_per_block=1.0, unit="N m"
    )
    high = (spectrum.positions > 12.0) & (spectrum.positions < 30.0)
    assert spectrum.positions[high][np.argmax(spectrum.values[high])] == pytest.approx(20.0, abs=1.1)


def test_segments_that_are_too_short() -> None:
    angle = swing(turns=0.5)
    segments = motion_segments(angle, RATE)
    with pytest.raises(RefusalError, match="no segment forwards holds 2 revolutions"):
        segment_order_spectrum(np.cos(angle), angle, segments, revolutions_per_block=2.0)
    fast = 40_000.0 * np.arange(400) / RATE
    with pytest.raises(RefusalError, match="samples per revolution"):
        segment_order_spectrum(np.cos(fast), fast, motion_segments(fast, RATE), revolutions_per_block=1.0)
