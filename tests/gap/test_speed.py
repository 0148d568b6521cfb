"""What the speed does besides standing still: hunting counts, other shafts' orders seen once a revolution do not."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.gap import speed_figures

TURNS_HZ, RATIO = 25.0, 29 / 47


def figures(hunting: float, wheel: float, ratio: float = RATIO) -> dict[str, float]:
    """Of six seconds of an angle that swings by shares of the speed: at 0.7 Hz, and with the wheel's revolutions."""
    time = np.arange(0.0, 6.0, 1e-4)
    swing = hunting / (2 * np.pi * 0.7) * np.sin(2 * np.pi * 0.7 * time)
    swing += wheel / (2 * np.pi * ratio * TURNS_HZ) * np.sin(2 * np.pi * ratio * TURNS_HZ * time)
    turns = TURNS_HZ * (time + swing)
    whole = np.arange(np.floor(turns[-1]))
    at = np.interp(whole, turns, time)
    angle = ShaftAngle("input", at, whole, np.gradient(whole, at), "pulses")
    return speed_figures(angle, (ratio,))._asdict()


def test_hunting_is_seen() -> None:
    found = figures(1e-3, 0.0)
    assert found["swing"] == pytest.approx(1e-3 / np.sqrt(2), rel=0.05)
    assert found["swing_frequency_hz"] == pytest.approx(0.7, abs=0.05)


def test_a_swing_that_no_run_out_makes_stays_where_its_alias_is_another_shafts_order() -> None:
    found = figures(0.0, 0.02)
    assert found["swing"] > 2e-3
    assert found["swing_frequency_hz"] == pytest.approx((1.0 - RATIO) * TURNS_HZ, abs=0.1)


@pytest.mark.parametrize("ratio", [RATIO, 0.5, 46 / 23, 1.7])
def test_what_another_shaft_does_every_revolution_is_no_hunting(ratio: float) -> None:
    assert figures(0.0, 1e-3, ratio)["swing"] < 1e-5
    both = figures(1e-3, 1e-3, ratio)
    assert both["swing"] == pytest.approx(1e-3 / np.sqrt(2), rel=0.05)
    assert both["swing_frequency_hz"] == pytest.approx(0.7, abs=0.05)
