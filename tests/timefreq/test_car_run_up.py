"""A measured run-up: orders sweep over time and stand still over angle."""

import numpy as np
import pytest

from gearsig.angle import resample_to_angle
from gearsig.timefreq import component, ridges, squeezed_cwt_map, stft_map
from tests.measured import car_run_up, needs_data

pytestmark = needs_data


@pytest.fixture(scope="module")
def over_angle():
    return resample_to_angle(*car_run_up()[:2], samples_per_revolution=64)


def test_firing_order_stands_still_over_angle(over_angle):
    levels = squeezed_cwt_map(over_angle, "p", lowest=1, highest=8, n_columns=500)
    (ridge,) = ridges(levels, lowest=1.5, highest=2.8)
    assert np.median(ridge.positions) == pytest.approx(2.0, rel=0.01)
    assert np.mean(np.abs(ridge.positions / 2.0 - 1) < 0.08) > 0.9  # it fades into the noise in between


def test_firing_order_follows_the_speed_over_time():
    recording, angle, _ = car_run_up()
    levels = stft_map(recording, "p", window_length=0.25, zero_padding=2, highest=300)
    (ridge,) = ridges(levels, lowest=20, highest=200)
    order = ridge.positions / (angle.speed_rpm_at(ridge.at) / 60)
    assert np.median(order) == pytest.approx(2.0, rel=0.01)
    assert np.mean(np.abs(order / 2.0 - 1) < 0.05) > 0.9


def test_waveform_of_the_firing_order(over_angle):
    levels = squeezed_cwt_map(over_angle, "p", lowest=1, highest=8, n_columns=500)
    (ridge,) = ridges(levels, lowest=1.5, highest=2.8)
    found = component(over_angle, ridge, "p", squeezed=False)
    turns = np.unwrap(np.angle(found.analytic)) / (2 * np.pi)
    assert turns[-1] - turns[0] == pytest.approx(2 * over_angle.n_revolutions, rel=0.03)  # slips where it fades
