"""Orders 2 and 4 of a measured run-up by Vold–Kalman, beside the resampling-based tracking and the vendor's table.

The table's conventions are told in `test_car_run_up.py`. Level over speed: the squared envelope,
averaged over 0.4 s (Hann).
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile
from scipy.signal import get_window, oaconvolve

from gearsig.angle import ShaftAngle, resample_to_angle
from gearsig.orders import amplitude_at_speeds, track_order_bands, track_vold_kalman
from gearsig.recording import Channel, Recording

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "car_run_up"
FULL_SCALE_RPM = 4821.4287
REFERENCE_PA = 20e-6

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the measured recordings are not here")


@pytest.fixture(scope="module")
def car():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # the vendor's own metadata chunk
        rate, samples = wavfile.read(FOLDER / "accel_with_rpm.wav")
    rpm = samples[:, 1] / 32768 * FULL_SCALE_RPM
    t = np.arange(len(rpm)) / rate
    revolutions = np.concatenate([[0.0], np.cumsum(rpm[1:] + rpm[:-1]) / 120 / rate])
    angle = ShaftAngle("crankshaft", t, revolutions, rpm / 60, "speed channel")
    recording = Recording((samples[:, 0] / 32768)[None], float(rate), (Channel("p", "sound_pressure", "Pa"),))
    return recording, angle, np.loadtxt(FOLDER / "reference_order_levels.txt", skiprows=1)


@pytest.fixture(scope="module")
def separation(car):
    recording, angle, _ = car
    return track_vold_kalman(recording, "p", [2.0, 4.0], bandwidth_orders=0.25, shaft_angle=angle)


def levels_db(order, rate, speeds_rpm):
    window = get_window("hann", round(0.4 * rate))
    power = oaconvolve(np.abs(order.envelope) ** 2, window / window.sum(), "valid")[::100]
    speed = oaconvolve(60 * order.frequency_hz / order.order, window / window.sum(), "valid")[::100]
    along = np.argsort(speed)
    power_at = np.interp(speeds_rpm, speed[along], power[along], left=np.nan, right=np.nan)
    return 10 * np.log10(power_at / 2 / REFERENCE_PA**2)


@pytest.mark.slow
@pytest.mark.parametrize("i", [0, 1])
def test_levels_agree_with_the_other_software(car, separation, i):
    recording, _, table = car
    difference = levels_db(separation.orders[i], recording.sampling_rate_hz, table[:, 0]) - table[:, i + 1]
    known = difference[1:][np.isfinite(difference[1:])]  # the first row is an edge
    assert len(known) >= 73
    assert abs(np.median(known)) < 0.15
    assert np.median(np.abs(known)) < 0.45
    assert np.percentile(np.abs(known), 90) < 1.2


@pytest.mark.parametrize("i", [0, 1])
def test_levels_agree_with_the_resampled_tracking(car, separation, i):
    recording, angle, table = car
    signal = resample_to_angle(recording, angle, samples_per_revolution=128)
    tracked = track_order_bands(signal, "p", [2.0, 4.0], overlap=0.95)[i]
    resampled = 20 * np.log10(amplitude_at_speeds(tracked, table[:, 0]) / 2**0.5 / REFERENCE_PA)
    difference = levels_db(separation.orders[i], recording.sampling_rate_hz, table[:, 0]) - resampled
    known = difference[np.isfinite(difference)]
    assert abs(np.median(known)) < 0.15
    assert np.median(np.abs(known)) < 0.4
