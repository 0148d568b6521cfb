"""The measured recordings, where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

from gearsig.recording import find_problems, read_pulse_times, read_recording
from gearsig.rig import SpeedChannel

DATA = Path(__file__).parents[3] / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not at hand")


@pytest.mark.parametrize(
    ("name", "shape", "rate_hz", "dtype"),
    [
        ("bearing_races/InnerRaceFault_vload_3.mat", (1, 146484), 48828, np.float64),
        ("gear_pair_23_46/3027_217_Data_Chan12.mat", (1, 282624), 25600, np.float32),
        ("car_run_up/accel_with_rpm.wav", (2, 909956), 44100, np.float32),
    ],
)
def test_read_without_options(name, shape, rate_hz, dtype):
    r = read_recording(DATA / name)
    assert r.samples.shape == shape
    assert r.samples.dtype == dtype
    assert r.sampling_rate_hz == rate_hz
    assert r.samples.any(axis=1).all()
    assert find_problems(r) == ()


def test_car_run_up_scale():
    r = read_recording(DATA / "car_run_up/accel_with_rpm.wav")
    assert isinstance(r.speed, SpeedChannel)
    rpm = r.values(r.speed.channel)
    assert rpm.max() == pytest.approx(4821.4287 * 32767 / 32768, rel=1e-6)
    assert rpm[0] == pytest.approx(974, abs=2)


def test_four_channels_and_pulses():
    r = read_recording(DATA / "two_stage_gearbox/h30hz50.csv.gz", sampling_rate_hz=4266.7)
    assert r.channel_names == ("a1", "a2", "a3", "a4")
    assert find_problems(r) == ()
    assert len(read_pulse_times(DATA / "tach_pulses/REC3642_tach_pulse_times.csv").times_s) == 489
