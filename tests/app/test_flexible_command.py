"""`gearsig flexible`: figures, table and summary of a short study."""

import csv
import json

import pytest
from typer.testing import CliRunner

from app.cli import app
from gearsig.errors import InputError


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "out"
    found = CliRunner().invoke(
        app, ["flexible", "-o", str(folder), "--torques", "170Nm", "--speeds", "2000..4000rpm", "--duration", "0.5s"]
    )
    assert found.exit_code == 0, found.output
    return folder, found.output


def test_figures_table_and_summary_are_written(study):
    folder, output = study
    pictures = {p.stem for p in folder.glob("*.png")}
    wanted = {
        "stiffness_map",
        "transmission_error_map",
        "load_sharing",
        "spectra",
        "natural_frequencies",
        "run_up",
        "sweeps",
    }
    assert pictures == wanted
    assert "170 N·m: torsional mode 26" in output
    rows = list(csv.DictReader((folder / "sweeps.csv").read_text(encoding="utf-8").splitlines()))
    assert {row["direction"] for row in rows} == {"up", "down"}
    assert len(rows) == 400
    summary = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    assert summary["sweeps"][0]["n_steps"] == 200_000
    errors = [row["transmission_error_um"][1] for row in summary["static"]]
    assert errors == sorted(errors)


def test_a_torque_beyond_what_corners_follow_is_refused_before_anything_is_written(tmp_path):
    found = CliRunner().invoke(app, ["flexible", "-o", str(tmp_path / "x"), "--torques", "170,5000Nm"])
    assert isinstance(found.exception, InputError)
    assert "the teeth yield by" in str(found.exception)
    assert not (tmp_path / "x").exists()


def test_a_range_without_dots_is_refused(tmp_path):
    found = CliRunner().invoke(app, ["flexible", "-o", str(tmp_path / "x"), "--speeds", "2000rpm"])
    assert found.exit_code != 0
    assert "900..4100rpm" in str(found.exception)
