"""Averages of both shafts at once: each keeps what is its own, and nothing of the other's."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.gap import gear_frame, reduce_recording
from gearsig.orders import average_lines, separate_shafts
from tests.gap.synthetic import RIG, TEETH, record

FRAME = gear_frame(RIG)
N_REVOLUTIONS, N_ANGLES = 40, 256


def over(shaft: str, n_samples: int, wave: np.ndarray) -> AngleSignal:
    turns = n_samples / N_ANGLES
    steady = np.array([0.0, 1.0]), np.array([0.0, turns]), np.full(2, turns)
    return AngleSignal(wave[None], N_ANGLES, ShaftAngle(shaft, *steady, "given"), 0.0, ("v",), ("m/s^2",), 100.0)


def signals(driver_order: int, driven_order: int) -> tuple[AngleSignal, AngleSignal]:
    """A line of each shaft, sampled over the angle of either."""
    ratio = FRAME.shaft_orders[1]
    found = []
    for own in FRAME.shaft_orders:
        n = int(N_REVOLUTIONS * own) * N_ANGLES
        driver_turns = np.arange(n) / N_ANGLES / own
        wave = np.cos(2 * np.pi * driver_order * driver_turns) + np.cos(2 * np.pi * driven_order * ratio * driver_turns)
        found.append(over(FRAME.shafts[len(found)], n, wave))
    return found[0], found[1]


def test_neighbouring_orders_of_two_shafts_are_told_apart() -> None:
    # 8 turns of the driver are nearly 13 of the driven gear: their difference is not resolved in few revolutions.
    separated = separate_shafts(signals(8, 13), TEETH)
    driver, driven = (np.abs(average_lines(signal).whole[0]) for signal in separated.signals)
    assert driver[8] == pytest.approx(1.0, abs=0.02)
    assert driven[13] == pytest.approx(1.0, abs=0.02)
    assert np.delete(driver, 8).max() < 0.02
    assert np.delete(driven, 13).max() < 0.02
    assert np.abs(separated.residual.samples).max() < 0.1


def test_the_mesh_stays_in_both_averages() -> None:
    gathered = reduce_recording(record(), RIG)
    sums = gathered.channels[next(iter(gathered.channels))]
    first = [abs(lines.mean(axis=0)[z]) for lines, z in zip(sums.lines, TEETH, strict=True)]
    assert first[0] == pytest.approx(first[1], rel=0.02)
