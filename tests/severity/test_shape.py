"""An event's shape: short or long, how far it is felt; gains and starts do not matter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.severity import (
    SHAPE,
    ShaftLines,
    band_signal,
    event_shape,
    find_event,
    n_bands,
    reach_cycles,
    squeezed_rise_db,
)
from tests.severity.averages import N_ORDERS, TEETH, flat_pulse, mesh_lines, shaft, teeth_pattern


def shape_of(average: ShaftLines) -> dict[str, float]:
    return dict(zip(SHAPE, event_shape(average, find_event(average)).tolist(), strict=True))


def long_pulse(centre_rev: float, size: float, pitches: float) -> np.ndarray:
    """Lines of a burst between two mesh harmonics that lasts."""
    orders = np.arange(N_ORDERS + 1)
    return flat_pulse(centre_rev, size) * np.exp(-0.5 * ((orders - 2.5 * TEETH) * pitches * np.pi / TEETH) ** 2)


def test_a_longer_event_is_longer_and_lower() -> None:
    averages = [shaft(mesh_lines() + teeth_pattern(1, 1e-3) + long_pulse(0.4, 1.0, p)) for p in (1.0, 2.0)]
    short, long = (shape_of(average) for average in averages)
    assert long["duration"] > short["duration"] + 0.2
    assert long["peak"] < short["peak"] - 0.3


@settings(max_examples=25)
@given(st.floats(0.01, 100.0), st.integers(0, TEETH - 1))
def test_neither_gain_nor_start_matters(gain: float, teeth: int) -> None:
    plain = mesh_lines() + teeth_pattern(2) + flat_pulse(10.3 / TEETH, 0.2)
    start = np.exp(-2j * np.pi * np.arange(N_ORDERS + 1) * teeth / TEETH)
    expected, found = shape_of(shaft(plain)), shape_of(shaft(gain * plain * start))
    assert list(found.values()) == pytest.approx(list(expected.values()), rel=1e-6, abs=1e-6)


def test_ringing_reaches_further() -> None:
    orders = np.arange(N_ORDERS + 1)
    decaying = [flat_pulse(0.3, 1.0) / (1.0 + 1j * (orders - 3.4 * TEETH) / (0.1 * TEETH / t)) for t in (0.3, 2.0)]
    averages = [shaft(mesh_lines() + teeth_pattern(4, 2e-3) + lines) for lines in decaying]
    reaches = [reach_cycles(a, find_event(a)) for a in averages]
    assert 0.3 < reaches[0] < reaches[1] < TEETH / 2


def test_squeezed_energy_rises_with_the_event() -> None:
    healthy = shaft(mesh_lines() + teeth_pattern(5, 0.02))
    averages = [shaft(healthy.lines[0] + flat_pulse(0.6, size)) for size in (0.1, 0.2, 0.4)]
    rises = [squeezed_rise_db(average, healthy, find_event(average)) for average in averages]
    assert np.diff(rises) == pytest.approx([20 * np.log10(2.0)] * 2, abs=0.7)


def test_the_band_signal_holds_the_energy_of_its_lines() -> None:
    average = shaft(teeth_pattern(6))
    signal = band_signal(average, 0.5, n_bands(average) + 0.5, 0.25)
    orders = np.arange(N_ORDERS + 1)
    near = np.abs((orders + TEETH // 2) % TEETH - TEETH // 2) <= 2
    kept = (orders >= 0.5 * TEETH) & (orders <= (n_bands(average) + 0.5) * TEETH) & ~near
    assert np.mean(signal**2) == pytest.approx(0.5 * np.sum(np.abs(average.lines[0, kept]) ** 2), rel=1e-9)
