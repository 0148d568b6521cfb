"""`gearsig compare`: from two files to a table, a page, data and lines."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import html5lib
import numpy as np
import pytest

from app.cli.compare import DATA, PAGE, TABLE, open_simulation, read_pair
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.rig import read_rig
from tests.app.test_cli import run
from tests.comparison.machines import LINES, TEETH, gear_record

RIG = f'[[pair]]\nname = "p"\ndriver = "in"\ndriven = "out"\ndriver_teeth = {TEETH[0]}\ndriven_teeth = {TEETH[1]}\n'


def export(path: Path, record: Recording, unit: str = "m/s^2", name: str = "a1") -> Path:
    """Write a record as other software does: time and one channel."""
    table = np.column_stack([record.time_s(), record.samples[0]])
    np.savetxt(path, table, delimiter=",", header=f"time (s),{name} ({unit})", comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    export(folder / "measured.csv", gear_record(duration_s=3.0))
    export(folder / "model.csv", gear_record(gain=0.5, noise=0.01, duration_s=2.0, rate_hz=10000.0, seed=1))
    export(folder / "other.csv", gear_record(duration_s=1.0), name="b7")
    export(folder / "velocity.csv", gear_record(duration_s=1.0), unit="mm/s")
    np.savetxt(folder / "bare.csv", gear_record(duration_s=1.0).samples[0], header="a1", comments="", fmt="%.6g")
    (folder / "gear.toml").write_text(RIG + "[speed]\nsource = 'constant'\nspeed_rpm = 1500.0\nshaft = 'in'\n")
    return folder


def test_two_csv_files_become_a_table_a_page_data_and_lines(
    capsys: pytest.CaptureFixture[str], files: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "made" / "here"
    rig = files / "gear.toml"
    code, out, err = run(capsys, "compare", files / "model.csv", files / "measured.csv", "--rig", rig, "-o", folder)
    assert (code, err) == (0, "")
    assert "1× mesh p" in out
    assert re.search(r"1× mesh p .* −6\.0\d? ± 0\.\d+$", out, re.MULTILINE)
    assert "a common gain of +6.0 dB" in out
    assert sorted(path.name for path in folder.iterdir()) == sorted((PAGE, DATA, TABLE))
    data = json.loads((folder / DATA).read_text(encoding="utf-8"))
    assert (data["schema"], data["schema_version"]) == ("gearsig.comparison", 1)
    lines = {round(line["order"], 3): line for line in data["channels"][0]["lines"]}
    for order in LINES:
        assert lines[order]["difference_db"] == pytest.approx(-6.02, abs=0.5)
    assert lines[23]["is_beyond"] is True
    with (folder / TABLE).open(encoding="utf-8", newline="") as file:
        rows = {(row["kind"], row["order"]): row for row in csv.DictReader(file)}
    assert float(rows["mesh", "23.0"]["recorded_db"]) == pytest.approx(20 * np.log10(2 / np.sqrt(2)), abs=0.05)
    page = (folder / PAGE).read_text(encoding="utf-8")
    html5lib.HTMLParser(strict=True).parse(page)
    assert page.count("<img") == 5  # orders, two averages, two kinds of bands
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "")


def test_nothing_is_written_where_the_page_fails(
    capsys: pytest.CaptureFixture[str], files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> str:
        raise InputError("no page today")

    monkeypatch.setattr("gearsig.report.comparison_page", fail)
    arguments = (files / "model.csv", files / "measured.csv", "--rig", files / "gear.toml", "-o", tmp_path / "out")
    code, out, err = run(capsys, "compare", *arguments)
    assert (code, out) == (2, "")
    assert "no page today" in err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_told_before_the_work(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    code, out, err = run(capsys, "compare", tmp_path / "no.csv", tmp_path / "no.csv", "-o", tmp_path / "file" / "out")
    assert (code, out) == (2, "")
    assert "out: cannot be written" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["velocity.csv", "measured.csv", "--rig", "gear.toml"], "measure different things: velocity and acceleration"),
        (["model.csv", "measured.csv"], "the speed of the simulation is not known"),
        (["model.csv", "missing.csv", "--rig", "gear.toml"], "missing.csv"),
        (["bare.csv", "measured.csv", "--rig", "gear.toml", "--fs", "9e3"], "bare.csv: states no sampling rate"),
        (["bare.csv", "measured.csv", "--rig", "gear.toml", "--fs", "9e3"], "give --sim-fs or"),
        (["model.csv", "bare.csv", "--rig", "gear.toml"], "give --fs or"),
        (["model.csv", "measured.csv", "--rig", "gear.toml", "--channel", "a1"], ""),
        (["model.csv", "measured.csv", "--rig", "gear.toml", "--channel", "x"], "'x' is not SIM=RECORDED"),
        (["model.csv", "measured.csv", "--rig", "gear.toml", "--channel", "a1=a2"], "there is no channel 'a2'"),
        (["model.csv", "measured.csv", "--rig", "gear.toml", "--align", "eye"], "--align is 'eye'"),
        (["model.csv", "measured.csv", "--rig", "gear.toml", "--align", "marks"], "no shaft has a mark"),
    ],
)
def test_bad_input_is_one_line(
    capsys: pytest.CaptureFixture[str], files: Path, arguments: list[str], message: str
) -> None:
    paths = [files / a if a.endswith((".csv", ".toml")) else a for a in arguments]
    code, out, err = run(capsys, "compare", *paths)
    if not message:
        assert (code, err) == (0, "")
        return
    assert (code, out) == (2, "")
    assert err.startswith("gearsig: ")
    assert err.count("\n") == 1
    assert message in err


def test_the_sampling_rate_of_the_recording_s_rig_applies_to_a_simulation_that_states_none(files: Path) -> None:
    rate_hz = gear_record(duration_s=1.0).sampling_rate_hz
    rig = read_rig(files / "gear.toml")
    opened = open_simulation(files / "bare.csv", None, replace(rig, sampling_rate_hz=rate_hz), None, None)
    assert opened.sampling_rate_hz == rate_hz


def test_the_only_channels_are_compared_whatever_their_names(capsys: pytest.CaptureFixture[str], files: Path) -> None:
    code, out, _ = run(capsys, "compare", files / "other.csv", files / "measured.csv", "--rig", files / "gear.toml")
    assert code == 0
    assert "a1 (simulated: b7)" in out


def test_names_may_hold_the_sign_between_them() -> None:
    def record(name: str) -> Recording:
        return Recording(np.zeros((1, 8)), 1.0, (Channel(name),))

    assert read_pair("x=1=y", record("x=1"), record("y")) == ("x=1", "y")
    assert read_pair("x=y=1", record("x"), record("y=1")) == ("x", "y=1")
    assert read_pair("same", record("same"), record("same")) == ("same", "same")
    with pytest.raises(InputError, match="SIM=RECORDED"):
        read_pair("x=1=z", record("x=1"), record("y"))
