"""Phases of a start–stop motion: of a trapezoid by its corners, of the simulated drive by its valve and brake."""

import numpy as np
import pytest

from gearsig.motion import (
    AT_REST,
    RUN_DOWN,
    RUN_UP,
    RUNNING,
    examine_start_stop,
    find_phases,
    measure_motion,
    motion_segments,
    shaft_speed_rad_s,
)
from tests.motion.recordings import start_stop

RATE = 1000.0


def trapezoid(*corners: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Angle and speed along corners (s, rad/s)."""
    times, speeds = np.array(corners).T
    t = np.arange(round(times[-1] * RATE)) / RATE
    speed = np.interp(t, times, speeds)
    return np.cumsum(speed) / RATE, speed


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_phases_of_a_trapezoid(sign: float) -> None:
    corners = [(0.0, 0.0), (1.0, 0.0), (2.0, 10.0), (3.0, 10.0), (3.5, 0.0), (5.0, 0.0)]
    angle, speed = trapezoid(*((t, sign * w) for t, w in corners))
    phases = find_phases(motion_segments(angle, RATE, speed), speed, RATE)
    assert [p.name for p in phases] == [AT_REST, RUN_UP, RUNNING, RUN_DOWN, AT_REST]
    # 2 % of the speed is motion, 90 % is running
    assert [p.start_s for p in phases] == pytest.approx([0.0, 1.02, 1.9, 3.05, 3.49], abs=3e-3)
    assert [p.end_s for p in phases[:-1]] == [p.start_s for p in phases[1:]]


def test_a_record_that_is_cut_has_no_run_up_or_run_down() -> None:
    angle, speed = trapezoid((0.0, 10.0), (1.0, 10.0), (1.5, 0.0), (3.0, 0.0), (3.5, 10.0), (4.0, 10.0))
    phases = find_phases(motion_segments(angle, RATE, speed), speed, RATE)
    assert [p.name for p in phases] == [RUNNING, RUN_DOWN, AT_REST, RUN_UP, RUNNING]


def test_phases_of_the_drive_follow_valve_and_brake() -> None:
    """95 N m from 0 to 1 s and from 3 to 4 s, then the brake."""
    motion = measure_motion(start_stop())
    speed = shaft_speed_rad_s(motion.driver_angle_rad, motion.sampling_rate_hz)
    phases = find_phases(examine_start_stop(motion).segments, speed, motion.sampling_rate_hz)
    assert [p.name for p in phases] == [RUN_UP, RUNNING, RUN_DOWN, AT_REST] * 2
    assert [p.end_s for p in phases if p.name == RUNNING] == pytest.approx([1.03, 4.03], abs=0.02)


def test_starts_and_stops_in_words() -> None:
    angle, speed = trapezoid((0.0, 0.0), (0.5, 0.0), (0.6, 9.0), (1.5, 9.0), (1.6, 0.0), (2.0, 0.0))
    assert motion_segments(angle, RATE, speed).summary == "1 start and 1 stop"
    cut = slice(700, 1400)
    assert motion_segments(angle[cut], RATE, speed[cut]).summary == (
        "0 starts and 0 stops in a record that begins and ends in motion"
    )
