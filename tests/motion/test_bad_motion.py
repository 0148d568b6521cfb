"""Every bad input of a start–stop recording, by every command that reads one: one line, exit 2, nothing written."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.motion import measure_motion
from gearsig.recording import Recording, write_recording
from gearsig.rig import read_rig, write_rig
from sims import simulate
from tests.app.test_cli import run
from tests.motion.recordings import changed, start_stop, without

JUMP = np.where(np.arange(6000) < 2700, 0.0, 0.5)
COMMANDS = ("force", "start-stop", "identify")
OUTPUT = {"force": "out", "start-stop": "out", "identify": "out.toml"}


def wrapped_angle() -> Recording:
    return changed(start_stop(), "wheel angle", np.mod(start_stop().values("wheel angle") + 6.2, 2.0 * np.pi))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The rig, the angle that jumps, the encoder that wraps, and the torque without times."""
    good = start_stop()
    assert good.rig is not None
    write_rig(good.rig, tmp_path / "rig.toml")
    write_recording(changed(good, "wheel angle", good.values("wheel angle") + JUMP), tmp_path / "jump.h5")
    write_recording(wrapped_angle(), tmp_path / "wrap.h5")
    write_recording(good, tmp_path / "good.h5")
    np.savetxt(tmp_path / "torque.csv", good.values("torque")[:500], header="torque", comments="")
    return tmp_path


def changed_rig(folder: Path, old: str, new: str) -> Path:
    text = (folder / "rig.toml").read_text()
    assert old in text
    (folder / "bad.toml").write_text(text.replace(old, new))
    return folder / "bad.toml"


def refused(capsys: pytest.CaptureFixture[str], folder: Path, command: str, file: str, rig: Path | None = None) -> str:
    before = sorted(folder.rglob("*"))
    output = () if command == "analyze" else ("-o", folder / OUTPUT[command])
    code, out, err = run(capsys, command, folder / file, "--rig", rig or folder / "rig.toml", *output)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert sorted(folder.rglob("*")) == before
    return err


def options_of(capsys: pytest.CaptureFixture[str], command: str) -> set[str]:
    return set(re.findall(r"--[a-z-]+", run(capsys, command, "--help")[1]))


@pytest.mark.parametrize("command", COMMANDS)
def test_angles_that_jump_or_wrap(capsys: pytest.CaptureFixture[str], folder: Path, command: str) -> None:
    jump = refused(capsys, folder, command, "jump.h5")
    assert "jump.h5: channel 'wheel angle' jumps by 0.5" in jump
    assert "from 2.699 to 2.7 s" in jump
    wrap = refused(capsys, folder, command, "wrap.h5")
    assert "wrap.h5: channel 'wheel angle' steps by 1 revolutions" in wrap
    assert set(re.findall(r"--[a-z-]+", wrap)) <= options_of(capsys, command)


@pytest.mark.parametrize("command", [*COMMANDS, "analyze"])
def test_torque_without_a_time_base(capsys: pytest.CaptureFixture[str], folder: Path, command: str) -> None:
    err = refused(capsys, folder, command, "torque.csv")
    assert "torque.csv: states no sampling rate" in err
    assert "--fs" in err
    assert "--fs" in options_of(capsys, command)


@pytest.mark.parametrize("command", [*COMMANDS, "analyze"])
@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("driver_inertia_kg_m2 = 0.01", "driver_inertia_kg_m2 = -0.01", "driver_inertia_kg_m2 is -0.01"),
        ("half_backlash_um = 150.0", "half_backlash_um = 150.0\nrestitution = 1.2", "restitution is 1.2"),
    ],
)
def test_impossible_contacts(
    capsys: pytest.CaptureFixture[str], folder: Path, command: str, old: str, new: str, named: str
) -> None:
    err = refused(capsys, folder, command, "good.h5", changed_rig(folder, old, new))
    assert f"bad.toml: [contact]: {named}" in err
    assert "allowed" in err


def test_analysis_says_what_it_cannot_examine_and_names_a_remedy_it_has(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    """An angle that jumps or wraps does not stop the examination of the other channels; the remedy is the rig file."""
    for file, named in (("jump.h5", "jumps by 0.5"), ("wrap.h5", "wraps = true")):
        code, out, _ = run(capsys, "analyze", folder / file, "--rig", folder / "rig.toml")
        assert code == 0
        text = " ".join(out.split())
        assert "Backlash and impacts cannot be told." in text
        assert named in text


def test_the_remedy_for_an_encoder_that_wraps_works(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    rig = changed_rig(folder, 'channel = "wheel angle"', 'channel = "wheel angle"\nwraps = true')
    for command in ("force", "start-stop", "analyze"):
        code, out, _ = run(capsys, command, folder / "wrap.h5", "--rig", rig)
        assert code == 0
        assert "cannot be told" not in " ".join(out.split())
    wrapped = replace(wrapped_angle(), rig=None)
    plain = measure_motion(start_stop()).driven_angle_rad
    assert measure_motion(wrapped, read_rig(rig)).driven_angle_rad - plain == pytest.approx(
        np.full(len(plain), 6.2), abs=1e-9
    )


def test_motion_alone_is_examined_as_far_as_it_goes(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    """No vibration, no torque: starts, stops, impacts and lost motion still show."""
    alone = without(start_stop(), *(n for n in start_stop().channel_names if "angle" not in n))
    write_recording(alone, folder / "motion.h5")
    code, out, _ = run(capsys, "analyze", folder / "motion.h5", "--rig", folder / "rig.toml")
    assert code == 0
    assert "2 starts and 2 stops" in " ".join(out.split())
    assert "The lost motion" in out


def test_a_rig_whose_encoder_is_missing_has_a_remedy(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    write_recording(without(start_stop(), *(n for n in start_stop().channel_names if n != "torque")), folder / "t.h5")
    err = refused(capsys, folder, "analyze", "t.h5")
    assert "there is no channel 'pinion angle'" in err
    assert "--speed-rpm" in err
    assert "--speed-rpm" in options_of(capsys, "analyze")


@pytest.mark.parametrize("command", [*COMMANDS, "analyze"])
def test_a_stop_longer_than_the_record_is_refused(
    capsys: pytest.CaptureFixture[str], folder: Path, command: str
) -> None:
    """Cut out between the stop and the press blow: the flanks lie in the play, and nothing can be told."""
    write_recording(replace(start_stop(), samples=start_stop().samples[:, 1200:1900]), folder / "rest.h5")
    err = refused(capsys, folder, command, "rest.h5")
    assert "its stop is longer than the record" in err
    assert "record a start and a braked stop" in err


@pytest.mark.parametrize("command", [*COMMANDS, "analyze"])
def test_a_machine_that_is_only_knocked_is_refused(
    capsys: pytest.CaptureFixture[str], folder: Path, command: str
) -> None:
    """A torque that never breaks away, and blows of the press that rattle the teeth."""
    knocked = simulate("forging", torque_nm=1.0, duration_s=6.0, sampling_rate_hz=1000.0)
    write_recording(knocked, folder / "knocked.h5")
    assert "the machine stands" in refused(capsys, folder, command, "knocked.h5")


@pytest.mark.parametrize("command", ["force", "start-stop"])
def test_a_folder_that_cannot_be_written_is_told_before_the_work(
    command: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "a_file").write_text("kept")
    code, _, err = run(capsys, command, tmp_path / "is_not_read.h5", "-o", tmp_path / "a_file" / "out")
    assert code == 2
    assert "a_file" in err
    assert "choose another" in err
