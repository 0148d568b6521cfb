"""The sample recordings: made again they are the same, readable, and they hold what their table says."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle, resample_to_angle
from gearsig.diagnosis import Kind, analyze
from gearsig.orders import synchronous_average
from gearsig.recording import read_recording
from gearsig.rig import read_rig

FOLDER = Path(__file__).parents[2] / "sample_data"
TRUTHS = json.loads((FOLDER / "truth.json").read_text(encoding="utf-8"))
FILES = tuple(TRUTHS)
EFFECTS = {
    "healthy.h5": [],
    "damaged_tooth.csv.gz": ["tooth_spall"],
    "outer_race.mat": ["bearing_outer_race"],
    "eccentric_wheel.wav": ["eccentricity"],
    "run_up.h5": [],
    "root_crack_0mm.h5": [],
    **{f"root_crack_{depth}mm.h5": ["root_crack"] for depth in (1, 2, 3, 4)},
}


@pytest.fixture(scope="module")
def made_again(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    subprocess.run([sys.executable, FOLDER / "make_samples.py", folder], check=True, capture_output=True)
    return folder


def read(folder, file):
    return read_recording(folder / file, rig=read_rig(folder / f"{file.split('.')[0]}.toml"))


@pytest.mark.study
@pytest.mark.parametrize("file", FILES)
def test_made_again_the_samples_are_the_same(file, made_again):
    old, new = read(FOLDER, file), read(made_again, file)
    assert old.channels == new.channels
    assert old.rig == new.rig
    # Other library versions may round a value to the next converter step.
    for channel, a, b in zip(old.channels, old.samples, new.samples, strict=True):
        step = TRUTHS[file]["converter_step_mps2"] if channel.quantity == "acceleration" else 2.0**-8
        np.testing.assert_allclose(a, b, atol=1.01 * step + 1e-3)


@pytest.mark.study
def test_made_again_the_truth_names_the_same_files(made_again):
    written = {path.name for path in made_again.iterdir()}
    assert written == {"truth.json", *FILES, *(f"{file.split('.')[0]}.toml" for file in FILES)}
    assert list(json.loads((made_again / "truth.json").read_text(encoding="utf-8"))) == list(FILES)


def test_nothing_else_is_there():
    scripts = {"README.md", *(path.name for path in FOLDER.glob("*.py"))}
    kept = {path.name for path in FOLDER.iterdir() if path.is_file()} - scripts
    assert kept == {"truth.json", *FILES, *(f"{file.split('.')[0]}.toml" for file in FILES)}


@pytest.mark.parametrize("file", FILES)
def test_samples_are_read_with_rate_length_and_units(file):
    recording = read(FOLDER, file)
    assert recording.sampling_rate_hz == pytest.approx(TRUTHS[file]["sampling_rate_hz"], rel=1e-9)
    assert recording.duration_s == pytest.approx(TRUTHS[file]["duration_s"], rel=1e-9)
    assert recording.channels[0].quantity == "acceleration"
    assert recording.channels[0].unit == "m/s^2"
    has_tachometer = file != "no_tachometer.csv"
    assert (recording.speed_source is not None) == has_tachometer
    assert any(c.quantity == "tachometer" for c in recording.channels) == has_tachometer


@pytest.mark.parametrize("file", EFFECTS)
def test_the_truth_holds_what_was_put_in(file):
    truth = TRUTHS[file]
    assert truth["model"] == "cracked"
    assert [e["name"] for e in truth["effects"]] == EFFECTS[file]
    if file.startswith("root_crack"):
        severities = [e["severity"] for e in truth["effects"]]
        assert severities == [float(file[11])] * len(severities)


@pytest.mark.parametrize("file", EFFECTS)
def test_no_value_reaches_the_end_of_the_range(file):
    truth = TRUTHS[file]
    largest = np.abs(read(FOLDER, file).samples[0]).max()
    assert largest < 0.95 * truth["parameters"]["sensor_range_mps2"]


@pytest.mark.parametrize("file", EFFECTS)
def test_the_recording_turns_as_often_as_the_truth_says(file):
    """The tachometer's pulses, counted by nothing but a threshold."""
    recording, truth = read(FOLDER, file), TRUTHS[file]
    high = recording.samples[recording.index(recording.channel_names[-1])] > 2.5
    pulses = np.count_nonzero(high[1:] & ~high[:-1])
    assert abs(pulses - truth["measurement"]["n_revolutions"]["input"]) < 1.0


def test_cracks_are_in_one_machine_that_differs_in_nothing_else():
    truths = [TRUTHS[f"root_crack_{depth}mm.h5"] for depth in range(5)]
    assert all(t["parameters"] == truths[0]["parameters"] for t in truths)
    assert len({t["specimen_seed"] for t in truths}) == 1
    assert len({t["seed"] for t in truths}) == 5


def test_a_crack_changes_the_average_at_its_tooth_and_the_more_the_deeper_it_is():
    n_teeth, n_angles, highest = 55, 55 * 80, 600
    averages = []
    for depth in range(5):
        recording = read(FOLDER, f"root_crack_{depth}mm.h5")
        angle = find_shaft_angle(recording)
        average = synchronous_average(resample_to_angle(recording, angle), "a1").values
        # Grids differ a little with the speed; orders do not.
        averages.append(np.fft.irfft(np.fft.rfft(average)[: highest + 1] / len(average), n_angles) * n_angles)
    changes = [(a - averages[0]).reshape(n_teeth, -1).std(axis=1) for a in averages[1:]]
    tooth = int(TRUTHS["root_crack_4mm.h5"]["effects"][0]["options"]["tooth"])
    assert {int(np.argmax(c)) + 1 for c in changes} == {tooth}
    assert np.all(np.diff([c.max() for c in changes]) > 0)
    assert all(c.max() > 10.0 * np.median(c) for c in changes)


@pytest.mark.parametrize("file", ["healthy.h5", "run_up.h5", "root_crack_0mm.h5"])
def test_no_fault_is_found_where_there_is_none(file):
    assert not [f.title for f in analyze(read(FOLDER, file)).findings if f.kind is Kind.FAULT]


def test_the_damaged_tooth_is_found():
    tooth = int(TRUTHS["damaged_tooth.csv.gz"]["effects"][0]["options"]["tooth"])
    first = analyze(read(FOLDER, "damaged_tooth.csv.gz")).findings[0]
    assert first.kind is Kind.FAULT
    assert (first.code, first.where.shaft, first.where.tooth) == ("tooth-local-damage", "input", tooth)


def test_the_deepest_crack_is_found_in_one_recording():
    first = analyze(read(FOLDER, "root_crack_4mm.h5")).findings[0]
    assert first.kind is Kind.FAULT
    assert (first.code, first.where.shaft, first.where.tooth) == ("tooth-local-damage", "input", 21)


def test_the_outer_race_is_named():
    first = analyze(read(FOLDER, "outer_race.mat")).findings[0]
    assert (first.code, first.where.shaft) == ("bearing-outer-race", "input")


def test_the_run_up_is_followed():
    angle = analyze(read(FOLDER, "run_up.h5")).shaft_angle
    low, high = angle.speed_range_rpm
    # Pulse to pulse the ends of the ramp are averaged over a revolution, 0.1 s at 600 rpm.
    assert 600.0 < low < 632.0
    assert 2980.0 < high < 3005.0


def test_together_they_stay_small():
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < 5.5e6


def test_table_names_every_sample():
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(f"`{file}`" in table for file in FILES)
