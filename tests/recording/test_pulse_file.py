"""Pulse times from text."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import read_pulse_times, read_recording


def test_seconds_and_milliseconds(tmp_path):
    (tmp_path / "p.csv").write_text("0.5\n1.0\n\n1.75\n")
    pulses = read_pulse_times(tmp_path / "p.csv", 2, "input")
    np.testing.assert_array_equal(pulses.times_s, [0.5, 1.0, 1.75])
    assert (pulses.pulses_per_revolution, pulses.shaft) == (2, "input")
    (tmp_path / "q.csv").write_text("# logger\ntime [ms]\n500\n1000\n")
    np.testing.assert_allclose(read_pulse_times(tmp_path / "q.csv").times_s, [0.5, 1.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time\n", "no pulses"),
        ("", "is empty"),
        ("1.5\n", "only one pulse"),
        ("1\n2\n\n1.5\n", "line 4: time runs backwards, 2 is followed by 1.5"),
        ("1\n2\n2\n", "line 3: time stands still"),
        ("1\nx\n2\n", "line 2, column 'time': 'x' is not a number"),
        ("1\n2\nnan\n", "line 3: the time is nan"),
        ("1,2\n2,3.5\n", "has 2 columns"),
        ("time [km]\n1\n2\n", "unit of the times is 'km'"),
    ],
)
def test_broken_pulse_files(tmp_path, text, said):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=rf"p\.csv: .*{said}"):
        read_pulse_times(tmp_path / "p.csv")


def test_pulses_per_revolution(tmp_path):
    (tmp_path / "p.csv").write_text("1\n2\n")
    with pytest.raises(InputError, match="pulses_per_revolution is 0"):
        read_pulse_times(tmp_path / "p.csv", 0)


def test_a_signal_that_rises_all_along_is_known_by_its_unit(tmp_path):
    times_s = np.cumsum(np.random.default_rng(1).uniform(0.03, 0.05, 200))
    np.savetxt(tmp_path / "p.csv", times_s)
    with pytest.raises(InputError, match=r"pulse times .*--tach-times"):
        read_recording(tmp_path / "p.csv", sampling_rate_hz=1000.0)
    np.savetxt(tmp_path / "angle.csv", times_s, header="angle [rad]", comments="")
    assert read_recording(tmp_path / "angle.csv", sampling_rate_hz=1000.0).n_samples == 200
