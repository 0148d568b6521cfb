"""Order levels of a measured run-up against the table of another vendor's software.

Conventions that explain the table, found by comparison: level in dB re 20 µPa of the rms sound pressure; 1 Pa is full
scale of the 16-bit samples (the file's own metadata say "Pa" and 1.0), without any offset; power within a band of 0.25
orders around the order, in blocks of about half a second to a second, each ascribed to the speed at its middle. The
table's first row, at the lowest speed of the recording, has no full block and is 38 dB below the second: an edge.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from gearsig.angle import ShaftAngle, resample_to_angle
from gearsig.orders import amplitude_at_speeds, track_order_bands
from gearsig.recording import Channel, Recording

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "car_run_up"
FULL_SCALE_PA, FULL_SCALE_RPM = 1.0, 4821.4287

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the measured recordings are not here")


@pytest.fixture(scope="module")
def differences_db():
    rate, samples = _read()
    rpm = samples[:, 1] / 32768 * FULL_SCALE_RPM
    t = np.arange(len(rpm)) / rate
    revolutions = np.concatenate([[0.0], np.cumsum(rpm[1:] + rpm[:-1]) / 120 / rate])
    angle = ShaftAngle("crankshaft", t, revolutions, rpm / 60, "speed channel")
    pressure = samples[:, 0] / 32768 * FULL_SCALE_PA
    recording = Recording(pressure[None, :], float(rate), (Channel("p", "sound_pressure", "Pa"),))
    signal = resample_to_angle(recording, angle, samples_per_revolution=128)
    tracked = track_order_bands(signal, "p", [2.0, 4.0], overlap=0.95)
    table = np.loadtxt(FOLDER / "reference_order_levels.txt", skiprows=1)
    levels = [20 * np.log10(amplitude_at_speeds(o, table[:, 0]) / 2**0.5 / 20e-6) for o in tracked]
    return {2: levels[0] - table[:, 1], 4: levels[1] - table[:, 2]}


def _read():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # the vendor's own metadata chunk
        return wavfile.read(FOLDER / "accel_with_rpm.wav")


@pytest.mark.parametrize("order", [2, 4])
def test_levels_agree_with_the_other_software(differences_db, order):
    known = differences_db[order][np.isfinite(differences_db[order])]
    assert len(known) >= 74  # all but the first rows, which have no full block
    assert abs(np.median(known)) < 0.1
    assert np.median(np.abs(known)) < 0.35
    assert np.percentile(np.abs(known), 90) < 1.2
