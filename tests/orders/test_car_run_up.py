"""Order levels of a measured run-up, by tracked bands and by Vold–Kalman, against the table of another vendor.

Conventions that explain the table, found by comparison: level in dB re 20 µPa of the rms sound pressure; 1 Pa is full
scale of the 16-bit samples (the file's own metadata say "Pa" and 1.0), without any offset; power within a band of 0.25
orders around the order, in blocks of about half a second to a second, each ascribed to the speed at its middle. The
table's first row, at the lowest speed of the recording, has no full block and is 38 dB below the second: an edge.
Of Vold–Kalman, level over speed is the squared envelope, averaged over 0.4 s (Hann).
"""

import numpy as np
import pytest
from scipy.signal import get_window, oaconvolve

from gearsig.angle import resample_to_angle
from gearsig.orders import amplitude_at_speeds, track_order_bands, track_vold_kalman
from tests.measured import car_run_up, needs_data

REFERENCE_PA = 20e-6

pytestmark = needs_data


@pytest.fixture(scope="module")
def tracked_db():
    """Levels of orders 2 and 4 at the table's speeds, by tracked bands."""
    recording, angle, table = car_run_up()
    signal = resample_to_angle(recording, angle, samples_per_revolution=128)
    tracked = track_order_bands(signal, "p", [2.0, 4.0], overlap=0.95)
    return [20 * np.log10(amplitude_at_speeds(o, table[:, 0]) / 2**0.5 / REFERENCE_PA) for o in tracked]


@pytest.fixture(scope="module")
def separated_db():
    """The same by Vold–Kalman."""
    recording, angle, table = car_run_up()
    separation = track_vold_kalman(recording, "p", [2.0, 4.0], bandwidth_orders=0.25, shaft_angle=angle)
    return [_levels_db(order, recording.sampling_rate_hz, table[:, 0]) for order in separation.orders]


def _levels_db(order, rate, speeds_rpm):
    window = get_window("hann", round(0.4 * rate))
    power = oaconvolve(np.abs(order.envelope) ** 2, window / window.sum(), "valid")[::100]
    speed = oaconvolve(60 * order.frequency_hz / order.order, window / window.sum(), "valid")[::100]
    along = np.argsort(speed)
    power_at = np.interp(speeds_rpm, speed[along], power[along], left=np.nan, right=np.nan)
    return 10 * np.log10(power_at / 2 / REFERENCE_PA**2)


@pytest.mark.parametrize("i", [0, 1])
def test_levels_agree_with_the_other_software(tracked_db, i):
    difference = tracked_db[i] - car_run_up()[2][:, i + 1]
    known = difference[np.isfinite(difference)]
    assert len(known) >= 74  # all but the first rows, which have no full block
    assert abs(np.median(known)) < 0.1
    assert np.median(np.abs(known)) < 0.35
    assert np.percentile(np.abs(known), 90) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("i", [0, 1])
def test_separated_levels_agree_with_the_other_software(separated_db, i):
    difference = separated_db[i] - car_run_up()[2][:, i + 1]
    known = difference[1:][np.isfinite(difference[1:])]  # the first row is an edge
    assert len(known) >= 73
    assert abs(np.median(known)) < 0.15
    assert np.median(np.abs(known)) < 0.45
    assert np.percentile(np.abs(known), 90) < 1.2


@pytest.mark.parametrize("i", [0, 1])
def test_separated_levels_agree_with_the_tracked_ones(separated_db, tracked_db, i):
    difference = separated_db[i] - tracked_db[i]
    known = difference[np.isfinite(difference)]
    assert abs(np.median(known)) < 0.15
    assert np.median(np.abs(known)) < 0.4
