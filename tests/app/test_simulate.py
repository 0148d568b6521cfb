"""`gearsig simulate` and `gearsig sweep`: what they write and print, and that nonsense is one line and code 2."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from app.cli.quantities import read_profile
from gearsig.errors import InputError
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from sims import simulate
from sims.effects import effects
from sims.gear_pair import PARAMETERS
from sims.presets import presets
from sims.registry import simulators
from tests.app.test_cli import run

SHORT = ("--duration", "50ms")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder is known in which nobody can write")
@pytest.mark.parametrize(
    "words", [("simulate", "cracked", *SHORT, "-o", "x.h5"), ("identify", "no.h5", "-o", "x.toml")]
)
def test_where_nothing_can_be_written_is_said_before_the_work(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    *asked, name = words
    code, _, err = run(capsys, *asked, f"/proc/self/{name}")
    assert code == 2
    assert "/proc/self: cannot be written" in err


@pytest.mark.parametrize("extension", ["csv", "h5", "parquet", "wav", "mat"])
def test_recording_rig_and_truth(capsys: pytest.CaptureFixture[str], tmp_path: Path, extension: str) -> None:
    file = tmp_path / f"crack.{extension}"
    code, out, _ = run(
        capsys, "simulate", "cracked", "--preset", "workshop_29_47", "--set", "half_backlash_um=0.05mm",
        "--effect", "root_crack=1.5mm,gear=driven,tooth=5", "--torque", "20Nm", "--fs", "10.24kHz", *SHORT,
        "--seed", 7, "-o", file,
    )  # fmt: skip
    assert code == 0
    assert f"gearsig analyze {file}" in out
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([file.name, "crack.toml", "crack.truth.json"])
    recording = read_recording(file)
    assert recording.channel_names == ("a1", "a2", "tacho")
    assert (recording.n_samples, recording.sampling_rate_hz) == (512, 10240.0)
    truth = json.loads((tmp_path / "crack.truth.json").read_text())
    assert recording.truth is not None
    assert dict(recording.truth) == truth
    assert truth["effects"][0] == {
        "name": "root_crack",
        "severity": 1.5,
        "unit": "mm",
        "options": {"gear": "driven", "tooth": 5.0, "angle_deg": 45.0, "width_percent": 100.0},
    }
    assert truth["parameters"]["half_backlash_um"] == pytest.approx(50.0)
    assert truth["operation"]["torque_nm"]["values"] == [20.0]
    assert truth["seed"] == 7
    rig = read_rig(tmp_path / "crack.toml")
    assert rig.operating_point.torque_nm == 20.0
    assert rig.pairs[0].driver_teeth == 29


def test_the_command_and_python_give_the_same(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run(capsys, "simulate", "cracked", "--effect", "root_crack=2", "--seed", 1, *SHORT, "-o", tmp_path / "a.h5")
    recording = simulate("cracked", effects={"root_crack": 2.0}, duration_s=0.05, seed=1)
    other = simulate("cracked", effects={"root_crack": 2.0}, duration_s=0.05, seed=2)
    assert np.array_equal(read_recording(tmp_path / "a.h5").samples, recording.samples)
    assert not np.array_equal(other.samples, recording.samples)
    assert recording.rig is not None


def test_existing_files_are_kept_unless_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("mine")
    arguments = ("simulate", "cracked", *SHORT, "-o", tmp_path / "a.h5")
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert "a.toml" in err
    assert "--force" in err
    assert (tmp_path / "a.toml").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1
    assert run(capsys, *arguments, "--force")[0] == 0
    assert read_rig(tmp_path / "a.toml").pairs[0].driver_teeth == 55


def test_a_failure_while_writing_leaves_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("sims.files.write_rig", full)
    code, _, err = run(capsys, "simulate", "cracked", *SHORT, "-o", tmp_path / "a.h5")
    assert code == 2
    assert "No space left" in err
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_run_up(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    points = tmp_path / "load.csv"
    points.write_text("time_s,torque_nm\n0,20\n0.1,40\n\n0.2,30\n")
    code, _, _ = run(
        capsys, "simulate", "cracked", "--speed", "300..1500rpm", "--torque", points, "--duration", "200ms",
        "-o", tmp_path / "up.h5",
    )  # fmt: skip
    assert code == 0
    truth = json.loads((tmp_path / "up.truth.json").read_text())
    assert truth["operation"]["speed_rpm"] == {"times_s": [0.0, 0.2], "values": [300.0, 1500.0]}
    assert truth["operation"]["torque_nm"] == {"times_s": [0.0, 0.1, 0.2], "values": [20.0, 40.0, 30.0]}
    assert truth["measurement"]["n_revolutions"]["input"] == pytest.approx(900 / 60 * 0.2, rel=0.05)
    assert read_rig(tmp_path / "up.toml").operating_point.speed_rpm is None


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "time_s,speed_rpm"),
        ("time_s,speed_rpm\n", "no points"),
        ("t,n\n0,1\n", "t, n"),
        ("time_s,speed_rpm\n0,1\n1\n", "line 3"),
        ("time_s,speed_rpm\n0,1\n1,x\n", "line 3"),
        ("time_s,speed_rpm\n0,1\n1,nan\n", "finite"),
        ("time_s,speed_rpm\n1,1\n0,2\n", "do not increase"),
    ],
)
def test_bad_profiles(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "p.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_profile(str(path), "speed_rpm", "rpm", 1.0)
    assert named in str(caught.value)
    assert "p.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("duration_s", "said"),
    [(1.0, ["begins at 0.5 s"]), (2.0, ["begins at 0.5 s", "ends at 1.5 s of 2 s"]), (1.5, ["begins at 0.5 s"])],
)
def test_a_profile_that_does_not_span_the_recording_is_held_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], duration_s: float, said: list[str]
) -> None:
    path = tmp_path / "p.csv"
    path.write_text("time_s,speed_rpm\n0.5,300\n1.5,600\n")
    assert read_profile(str(path), "speed_rpm", "rpm", duration_s).at(3.0) == 600.0
    notes = capsys.readouterr().err.splitlines()
    assert len(notes) == len(said)
    assert all(f"p.csv: {text}" in note for text, note in zip(said, notes, strict=True))


def test_the_list_names_everything_within_100_columns(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "simulate", "cracked", "--list")
    assert code == 0
    assert max(map(len, out.splitlines())) <= 100
    words = out.replace(":", " ").split()
    for name in (*presets("cracked"), *(p.name for p in PARAMETERS), *effects()):
        assert name in words
    flowing = " ".join(out.split())
    for p in PARAMETERS:
        reach = f"{p.low:g} to {p.high:g} {p.unit}".strip() if not p.choices else ", ".join(p.choices)
        assert f"{p.meaning}; {reach}, default" in flowing
    for e in effects().values():
        assert f"{e.severity.low:g} to {e.severity.high:g} {e.severity.unit}".strip() in flowing
        assert " ".join(e.signature.split()) in flowing


def test_the_list_of_models_is_short(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "simulate", "--list")
    assert code == 0
    assert len(out.splitlines()) < 50
    assert max(map(len, out.splitlines())) <= 100
    for model in simulators():
        assert {model, *presets(model)} <= set(out.replace(",", " ").split())


def test_the_list_says_what_has_no_meaning_and_why(capsys: pytest.CaptureFixture[str]) -> None:
    flexible = " ".join(run(capsys, "simulate", "reduced-fe", "--list")[1].split())
    assert "that have no meaning here surface_roughness with locked_to=time: flanks are shapes here" in flexible
    assert "unbalance" in run(capsys, "simulate", "forging", "--list")[1].split("that have no meaning here")[1]
    assert "have no meaning" not in run(capsys, "simulate", "cracked", "--list")[1]


@pytest.mark.parametrize("command", ["simulate", "sweep"])
def test_help(capsys: pytest.CaptureFixture[str], command: str) -> None:
    code, out, _ = run(capsys, command, "--help")
    assert code == 0
    assert f"Example: gearsig {command} cracked" in " ".join(out.split())
    assert command in run(capsys, "--help")[1]


def test_the_list_of_a_preset_says_what_is_assumed(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "simulate", "cracked", "--preset", "published_55_75", "--list")
    assert code == 0
    flowing = " ".join(out.split())
    chosen = presets("cracked")["published_55_75"]
    for text in (*chosen.sources, *chosen.assumed, *chosen.does_not_represent):
        assert text in flowing


@pytest.mark.slow
def test_the_convergence_check_writes_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(capsys, "simulate", "cracked", "--preset", "small_30_25", "--check")
    assert code == 0
    assert "converged" in out
    assert list(tmp_path.iterdir()) == []


BAD = [
    (("cracked",), "give -o FILE"),
    ((), "no model"),
    (("craked", "-o", "a.h5"), "did you mean cracked"),
    (("cracked", "-o", "a.txt"), ".csv"),
    (("cracked", "-o", "a.b.h5"), "a_b.h5"),
    (("cracked", "-o", "absent/a.h5"), "absent"),
    (("cracked", "-o", "a.h5", "--preset", "publishd_55_75"), "did you mean published_55_75"),
    (("cracked", "-o", "a.h5", "--set", "crack_depth_mm"), "NAME=VALUE"),
    (("cracked", "-o", "a.h5", "--set", "crack_dept_mm=2"), "did you mean crack_depth_mm"),
    (("cracked", "-o", "a.h5", "--set", "crack_depth_mm=2Nm"), "give it in mm"),
    (("cracked", "-o", "a.h5", "--set", "crack_depth_mm=9"), "goes past the tooth"),
    (("cracked", "-o", "a.h5", "--set", "teeth_driver=4"), "5 to 400"),
    (("cracked", "-o", "a.h5", "--set", "friction=maybe"), "on, off"),
    (("cracked", "-o", "a.h5", "--effect", "root_crak=2"), "did you mean root_crack"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack"), "0 to 10 mm"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=2rpm"), "give it in mm"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=20mm"), "0 to 10 mm"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=8mm"), "goes past the tooth"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=2mm,geer=driven"), "did you mean gear"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=2mm,gear=wheel"), "driver, driven"),
    (("cracked", "-o", "a.h5", "--effect", "root_crack=2mm,tooth=56"), "1 to 55"),
    (("cracked", "-o", "a.h5", "--speed", "-5rpm"), "0 rpm"),
    (("cracked", "-o", "a.h5", "--speed", "500Nm"), "give it in rpm"),
    (("cracked", "-o", "a.h5", "--speed", "1e9"), "30000 rpm"),
    (("cracked", "-o", "a.h5", "--speed", "absent.csv"), "absent.csv"),
    (("cracked", "-o", "a.h5", "--torque", "110m"), "give it in N m"),
    (("cracked", "-o", "a.h5", "--duration", "0s"), "duration_s"),
    (("cracked", "-o", "a.h5", "--duration", "1h"), "give it in s"),
    (("cracked", "-o", "a.h5", "--duration", "1e6"), "120 s"),
    (("cracked", "-o", "a.h5", "--fs", "0"), "sampling_rate_hz"),
    (("cracked", "-o", "a.h5", "--fs", "20rpm"), "give it in Hz"),
]


@pytest.mark.parametrize(("arguments", "named"), BAD, ids=[" ".join(a[1:]) or "none" for a, _ in BAD])
def test_nonsense_is_one_line_and_code_2(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    named: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, "simulate", *arguments)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert named in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_sweep_and_its_index(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = (
        "sweep", "cracked", "--preset", "workshop_29_47", "--vary", "speed=600..1200rpm:2",
        "--vary", "root_crack=0,1,9mm,gear=driven", *SHORT, "--format", "csv", "-j", 1, "-o", tmp_path / "grid",
    )  # fmt: skip
    code, out, err = run(capsys, *arguments)
    assert code == 1  # a crack of 9 mm goes past the tooth
    assert "6 points, 4 simulated" in out
    assert "point 2: depth_mm of the crack is 9 mm" in err
    with (tmp_path / "grid" / "index.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(r["speed_rpm"], r["root_crack"], bool(r["file"])) for r in rows] == [
        (speed, depth, depth != "9") for speed in ("600", "1200") for depth in ("0", "1", "9")
    ]
    truth = json.loads((tmp_path / "grid" / "point_4.truth.json").read_text())
    assert truth["operation"]["speed_rpm"]["values"] == [1200.0]
    assert truth["effects"][0]["options"]["gear"] == "driven"
    assert "0 simulated; 4 existed already" in run(capsys, *arguments)[1]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--vary", "speed=300..1500rpm"), "FROM..TO:COUNT"),
        (("--vary", "speed=300..1500rpm:1"), "at least 2"),
        (("--vary", "speed=300..1500Nm:3"), "give it in rpm"),
        (("--vary", "speed"), "NAME=VALUES"),
        (("--vary", "speed=1,2rpm", "--speed", "500"), "leave out --speed or --vary"),
        (("--vary", "speed=1,2rpm,tooth=2"), "no options"),
        (("--vary", "friction=1,2"), "--set"),
        (("--vary", "root_crack=1,99mm"), "0 to 10 mm"),
        (("--vary", "crak=1,2"), "crack_depth_mm"),
        (("--vary", "speed=1,2", "--format", "txt"), ".csv"),
        (("--vary", "speed=1,2", "-j", "0"), "n_processes"),
        (("--vary", "speed="), "speed"),
    ],
)
def test_nonsense_in_a_sweep(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], named: str
) -> None:
    code, out, err = run(capsys, "sweep", "cracked", *arguments, "-o", tmp_path / "grid")
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert named in err
    assert not (tmp_path / "grid").exists()
