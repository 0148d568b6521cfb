"""The sample recordings: made again they are the same, readable, and they hold what their table says."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gearsig.recording.read import read_recording
from gearsig.rig.toml import read_rig

FOLDER = Path(__file__).parents[2] / "sample_data"
FILES = tuple(json.loads((FOLDER / "truth.json").read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def made_again(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    subprocess.run([sys.executable, FOLDER / "make_samples.py", folder], check=True, capture_output=True)
    return folder


def read(folder, file):
    return read_recording(folder / file, rig=read_rig(folder / f"{file.split('.')[0]}.toml"))


@pytest.mark.parametrize("file", FILES)
def test_made_again_the_samples_are_the_same(file, made_again):
    old, new = read(FOLDER, file), read(made_again, file)
    assert old.channels == new.channels
    assert old.rig == new.rig
    # Other library versions may round a value to the next converter step.
    np.testing.assert_allclose(old.samples, new.samples, atol=1.01 * 2.0**-8)


@pytest.mark.parametrize("file", FILES)
def test_samples_are_read_with_rate_length_and_units(file):
    truth = json.loads((FOLDER / "truth.json").read_text(encoding="utf-8"))[file]
    recording = read(FOLDER, file)
    assert recording.sampling_rate_hz == pytest.approx(truth["sampling_rate_hz"], rel=1e-9)
    assert recording.duration_s == pytest.approx(truth["duration_s"], rel=1e-9)
    assert recording.channels[0].quantity == "acceleration"
    assert recording.channels[0].unit == "m/s^2"
    has_tachometer = truth["model"]["tachometer"] is not None
    assert (recording.speed_source is not None) == has_tachometer
    assert any(c.quantity == "tachometer" for c in recording.channels) == has_tachometer


def test_together_they_stay_small():
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < 3e6


def test_table_names_every_sample():
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(f"`{file}`" in table for file in FILES)
