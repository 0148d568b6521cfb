"""`gearsig force`: text, JSON, table, pictures, and nonsense in one line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from gearsig.recording import write_recording
from gearsig.rig import write_rig
from sims.files import file_set, write_set
from tests.app.test_cli import run
from tests.motion.recordings import changed, start_stop, without


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drive.h5"
    write_set(start_stop(), file_set(path))
    return path


@pytest.mark.slow
def test_text_data_table_and_pictures(capsys: pytest.CaptureFixture[str], file: Path) -> None:
    folder = file.parent / "force"
    code, out, _ = run(capsys, "force", file, "-o", folder, "--noise")
    assert code == 0
    assert "piecewise                torque / base radius" in out
    assert "closer than Hunt–Crossley up to" in out
    assert "J1/r_b1 = 0.213 N per rad/s²" in out
    assert sorted(p.name for p in folder.iterdir()) == ["force.csv", "force.json", "force.png", "noise.png"]
    data = json.loads((folder / "force.json").read_text())
    errors = {(e["model"], e["reference"]): e["relative_rms"] for e in data["errors"]}
    assert errors["piecewise", "torque / base radius"] < 0.3 * errors["Hunt–Crossley", "torque / base radius"]
    assert data["noise"]["crossover_um"] > 1.0
    with (folder / "force.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert len(rows) == 6000
    torque = np.array([float(row["torque / base radius [N]"]) for row in rows])
    piecewise = np.array([float(row["piecewise [N]"]) for row in rows])
    expected = errors["piecewise", "torque / base radius"]
    assert np.std(piecewise - torque) / np.sqrt(np.mean(torque**2)) == pytest.approx(expected, rel=0.02)


def test_json_alone(capsys: pytest.CaptureFixture[str], file: Path) -> None:
    code, out, _ = run(capsys, "force", file, "--json", "--datum", "zero", "--bandwidth", "100Hz")
    assert code == 0
    data = json.loads(out)
    assert data["schema"] == "gearsig.force"
    assert data["datum"]["uncertainty_um"] is None
    assert "Savitzky–Golay" in data["methods"]["driver angle"]


def test_what_was_not_made_is_not_named_and_a_file_is_no_folder(
    capsys: pytest.CaptureFixture[str], file: Path, tmp_path: Path
) -> None:
    code, out, _ = run(capsys, "force", file, "--use", "torque=", "--use", "force=", "-o", tmp_path / "force")
    assert (code, out.splitlines()[-1]) == (0, f"In {tmp_path / 'force'}: force.json, force.csv.")
    assert sorted(p.name for p in (tmp_path / "force").iterdir()) == ["force.csv", "force.json"]
    code, out, err = run(capsys, "force", file, "-o", file)
    assert (code, out) == (2, "")
    assert "is a file; choose a folder" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--use", "driven angel=x"), "did you mean driven angle"),
        (("--use", "driven angle"), "ROLE=CHANNEL"),
        (("--use", "driven angle=x"), "there is no channel 'x'"),
        (("--use", "driven angle=torque"), "unit"),
        (("--datum", "3kg"), "--datum"),
        (("--bandwidth", "2kHz"), "bandwidth_hz"),
    ],
)
def test_nonsense_is_one_line(
    capsys: pytest.CaptureFixture[str], file: Path, arguments: tuple[str, ...], named: str
) -> None:
    code, out, err = run(capsys, "force", file, *arguments)
    assert (code, out) == (2, "")
    assert named in err.splitlines()[-1]


def test_bad_rigs_and_recordings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    recording = start_stop()
    assert recording.rig is not None
    write_recording(
        changed(recording, "pinion angle", np.mod(recording.values("pinion angle"), 6.28318)), tmp_path / "w.h5"
    )
    write_recording(recording, tmp_path / "a.h5")
    write_rig(recording.rig, tmp_path / "rig.toml")
    text = (tmp_path / "rig.toml").read_text()
    for name, old, new, named in (
        ("inertia", "driven_inertia_kg_m2 = 45.2625", "driven_inertia_kg_m2 = -45.0", "driven_inertia_kg_m2"),
        ("restitution", "half_backlash_um = 150.0", "half_backlash_um = 150.0\nrestitution = 1.2", "restitution"),
        ("law", "half_backlash_um = 150.0", 'half_backlash_um = 150.0\ndamping_law = "flore"', "did you mean flores"),
    ):
        assert old in text
        bad = tmp_path / f"{name}.toml"
        bad.write_text(text.replace(old, new))
        code, _, err = run(capsys, "force", tmp_path / "a.h5", "--rig", bad)
        assert code == 2
        assert named in err
        assert "[contact]" in err
    code, _, err = run(capsys, "force", tmp_path / "w.h5", "--rig", tmp_path / "rig.toml")
    assert code == 2
    assert "--unwrap" in err


def test_torque_without_a_time_base(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A table of torque and angles that states neither times nor a rate."""
    recording = without(start_stop(), "interaction force")
    assert recording.rig is not None
    write_rig(recording.rig, tmp_path / "rig.toml")
    header = ",".join(recording.channel_names)
    np.savetxt(tmp_path / "bare.csv", recording.samples.T[:500], delimiter=",", header=header, comments="")
    code, _, err = run(capsys, "force", tmp_path / "bare.csv", "--rig", tmp_path / "rig.toml")
    assert code == 2
    assert "states no sampling rate" in err
    assert run(capsys, "force", tmp_path / "bare.csv", "--rig", tmp_path / "rig.toml", "--fs", "1000")[0] == 0
