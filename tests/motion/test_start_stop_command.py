"""`gearsig start-stop`: text, JSON, picture."""

import json
from pathlib import Path

import pytest

from gearsig.motion import examine_start_stop, measure_motion
from gearsig.plot import start_stop_figure
from sims.files import file_set, write_set
from tests.app.test_cli import run
from tests.motion.recordings import continuous, start_stop, without


def test_text_data_and_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "drive.h5"
    write_set(start_stop(), file_set(file))
    code, out, _ = run(capsys, "start-stop", file, "-o", tmp_path / "out")
    assert code == 0
    assert "Backlash 299." in out
    assert "impacts, the hardest" in out
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["start_stop.json", "start_stop.png"]
    data = json.loads((tmp_path / "out" / "start_stop.json").read_text())
    assert data["schema"] == "gearsig.start_stop"
    assert len(data["impacts"]) > 15
    assert data["teeth"]["signal"] == "torque"
    assert len(data["teeth"]["rms_forwards"]) == 20
    assert data["teeth"]["rms_backwards"] == [None] * 20
    assert len(data["orders"]["order"]) == len(data["orders"]["amplitude"]) > 20
    code, out, _ = run(capsys, "start-stop", file, "--json")
    assert (code, json.loads(out)) == (0, data)


def test_the_picture_shows_speed_plane_and_loop() -> None:
    over, left, right, speeds = start_stop_figure(examine_start_stop(measure_motion(start_stop()))).axes
    assert over.get_ylabel() == "driver's speed (rpm)"
    assert left.get_xlabel() == "compression (µm)"
    walls = sorted(line.get_xdata()[0] for line in left.lines[1:])
    assert walls == pytest.approx([-150.0, 150.0], rel=0.02)
    assert right.get_ylabel() == "torque (N·m)"
    assert len(speeds.collections) == 2


def test_a_picture_of_what_could_not_be_told() -> None:
    figure = start_stop_figure(examine_start_stop(measure_motion(without(continuous(), "torque"))))
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "no torque was measured" in texts
