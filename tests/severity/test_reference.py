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
    assert np.max(np.abs(difference.lines[0][telling])) < 0.01 * np.max(np.abs(PATTERN[telling]))
    assert agreement == pytest.approx(1.0, abs=2e-3)


@given(st.floats(-0.2, 0.2), st.booleans(), st.integers(0, TEETH - 1))
def test_a_mark_that_has_moved_a_little_leaves_nothing_of_the_pattern(moved: float, has_mark: bool, teeth: int) -> None:
    """As after its sensor was mounted anew; where the mark is on the mate, any tooth may meet besides."""
    whole = 0 if has_mark else teeth
    now = shaft(PATTERN, has_mark=has_mark)
    healthy = turned(shaft(PATTERN, has_mark=has_mark), (whole + moved) / TEETH)
    difference, agreement = difference_lines(now, healthy, whole_teeth=True)
    assert np.max(np.abs(difference.lines)) < 0.03 * np.max(np.abs(PATTERN))
    assert agreement > 0.999


def test_a_mark_rules_out_other_teeth() -> None:
    healthy = turned(shaft(PATTERN), 3.0 / TEETH)
    _, agreement = difference_lines(shaft(PATTERN), healthy, whole_teeth=False)
    assert agreement < 0.4


def test_strange_gears_do_not_agree() -> None:
    healthy = shaft(mesh_lines() + teeth_pattern(8), has_mark=False)
    _, agreement = difference_lines(shaft(PATTERN, has_mark=False), healthy, whole_teeth=True)
    assert agreement < 0.4


def test_another_speed_is_refused() -> None:
    now = shaft(PATTERN)
    with pytest.raises(RefusalError, match=r"speed 5\.0 % off"):
        difference_lines(now, replace(now, order_hz=now.order_hz / 1.05), whole_teeth=False)
