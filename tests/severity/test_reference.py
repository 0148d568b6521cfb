"""The reference is turned to the same teeth, and what all teeth differ by cancels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.severity import difference_lines
from tests.severity.averages import TEETH, flat_pulse, mesh_lines, shaft, teeth_pattern, turned

PATTERN = mesh_lines() + teeth_pattern(7)


@given(st.integers(0, TEETH - 1))
def test_the_same_teeth_meet_whatever_the_start(teeth: int) -> None:
    now = shaft(PATTERN + flat_pulse(0.3, 0.01), has_mark=False)
    healthy = turned(shaft(PATTERN, has_mark=False), teeth / TEETH)
    difference, agreement = difference_lines(now, healthy, whole_teeth=True)
    assert agreement > 0.8
    fitted = np.abs(difference.lines[0, 5:]) / 0.01
    assert np.median(fitted) == pytest.approx(1.0, abs=0.3)  # the pulse is left, the pattern of 0.03 is gone


def test_a_slightly_other_gain_is_taken_out() -> None:
    now, healthy = shaft(PATTERN), shaft(PATTERN * 1.05 * np.exp(0.05j))
    difference, agreement = difference_lines(now, healthy, whole_teeth=False)
    telling = np.abs((np.arange(len(PATTERN)) + TEETH // 2) % TEETH - TEETH // 2) > 1
    assert np.max(np.abs(difference.lines[0][telling])) < 1e-9
    assert agreement == pytest.approx(np.cos(0.05), abs=1e-6)


def test_strange_gears_do_not_agree() -> None:
    healthy = shaft(mesh_lines() + teeth_pattern(8), has_mark=False)
    _, agreement = difference_lines(shaft(PATTERN, has_mark=False), healthy, whole_teeth=True)
    assert agreement < 0.4


def test_another_speed_is_refused() -> None:
    now = shaft(PATTERN)
    with pytest.raises(RefusalError, match=r"speed 5\.0 % off"):
        difference_lines(now, replace(now, order_hz=now.order_hz / 1.05), whole_teeth=False)
