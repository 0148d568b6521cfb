"""What is given beside a file is checked before the file is read, so that the file is not blamed for it."""

import os

import numpy as np
import pytest
from scipy.io import savemat

from app.cli.main import main
from gearsig.diagnosis import analyze
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, n_samples_of, read_recording

RUNS = np.column_stack([np.arange(2000) / 1000.0, np.random.default_rng(2).standard_normal((2000, 3))])


@pytest.fixture
def record(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("a1\n" + "1.5\n-2.5\n" * 500)
    return path


@pytest.fixture
def runs(tmp_path):
    savemat(tmp_path / "runs.mat", {"runs": RUNS})
    return tmp_path / "runs.mat"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rig": "x.toml"}, r"^rig is 'x\.toml' .*gearsig\.read_rig\('x\.toml'\)"),
        ({"rig": os}, r"^rig is a module"),
        ({"speed": 1500.0}, r"^speed is 1500\.0 .*gearsig\.ConstantSpeed\("),
        ({"part": (0, 5)}, r"^part is \(0, 5\) \(allowed: slice, None\)"),
        ({"sampling_rate_hz": "1000"}, r"^x\.csv: sampling rate given is '1000' \(allowed: a number\)"),
    ],
)
def test_the_file_is_not_blamed_for_other_arguments(record, given, said):
    with pytest.raises(InputError, match=said) as caught:
        read_recording(record, **{"sampling_rate_hz": 1000.0} | given)
    assert "damaged" not in str(caught.value)


def test_paths_that_are_none():
    for read in (read_recording, n_samples_of):
        with pytest.raises(InputError, match=r"path is None \(allowed: text, path\)"):
            read(None)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), r"x\.csv: does not fit into memory as CSV .*split the file"),
        (PermissionError(13, "Permission denied"), r"x\.csv: cannot be opened \(Permission denied\).*permissions"),
        (KeyError("a"), r"x\.csv: cannot be read as CSV .*damaged"),
    ],
)
def test_only_what_the_file_may_be_blamed_for_is_damage(record, monkeypatch, error, said):
    def fail(*_):
        raise error

    monkeypatch.setattr("gearsig.recording._limits.check_memory", fail)
    with pytest.raises(InputError, match=said):
        read_recording(record, sampling_rate_hz=1000.0)


@pytest.mark.parametrize("name", ["runs.mat#x", "runs.mat#", "runs.mat#1.5", "runs.mat#-1"])
def test_a_run_that_is_no_number_offers_those_there_are(runs, name):
    with pytest.raises(InputError, match=r"cannot be opened .*of runs\.mat there are: #1, #2, #3$"):
        read_recording(runs.with_name(name))


@pytest.mark.parametrize("name", ["runs.mat#0", "runs.mat#9"])
def test_a_run_that_is_not_there_offers_those_there_are(runs, name):
    with pytest.raises(InputError, match=r"allowed: #1, #2, #3"):
        read_recording(runs.with_name(name))


def test_a_run_of_a_file_that_cannot_be_read(tmp_path):
    (tmp_path / "runs.mat").write_bytes(b"MATLAB 5.0 MAT-file")
    with pytest.raises(InputError, match=r"runs\.mat#x: cannot be opened .*runs\.mat#1"):
        read_recording(tmp_path / "runs.mat#x")


def test_a_reference_whose_columns_are_conditions(runs):
    whole, one = read_recording(runs), read_recording(runs.with_name("runs.mat#3"))
    columns = r"runs\.mat#1 or runs\.mat#2 or runs\.mat#3"
    with pytest.raises(InputError, match=rf"the recording is one column of its file; .*reference's give {columns}"):
        analyze(one, reference=whole)
    with pytest.raises(InputError, match=rf"the reference is one column of its file; .*recording's give {columns}"):
        analyze(whole, reference=one)
    other = Recording(RUNS[:, 1:3].T, 1000.0, (Channel("a1"), Channel("a2")))
    with pytest.raises(InputError, match=r"no channel 'ch1' \(allowed: same channels: a1, a2\)$"):
        analyze(whole, reference=other)


@pytest.mark.parametrize("rate", [(), ("--fs", "25600")])
def test_pulse_times_that_are_analysed_as_a_recording(tmp_path, capsys, rate):
    times = tmp_path / "pulses.csv"
    times.write_text("\n".join(f"{t:.6f}" for t in np.cumsum(np.linspace(0.1, 0.02, 300)) + 2.3))
    with pytest.raises(SystemExit) as stopped:
        main(["analyze", str(times), *rate])
    assert stopped.value.code == 2
    err = capsys.readouterr().err
    assert "pulses.csv: the only column, 'ch1', rises" in err
    assert "--tach-times FILE" in err
    assert "--fs" in err


@pytest.mark.parametrize("text", ["time\n1\n2\n3\n", "Zeit [ms]\n1\n2\n3\n"])
def test_a_single_column_that_is_called_a_time(tmp_path, text):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=r"is a time .*--tach-times FILE"):
        read_recording(tmp_path / "p.csv")


@pytest.mark.parametrize("text", ["1\n-2\n3\n", "-3\n1\n2\n", "1\n1\n2\n"])
def test_a_signal_without_a_rate_is_not_taken_for_times(tmp_path, text):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=r"states no sampling rate .*; give --fs") as caught:
        read_recording(tmp_path / "p.csv")
    assert "--tach-times" not in str(caught.value)
