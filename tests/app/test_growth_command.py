"""`gearsig growth`: turns left, files, and what it refuses."""

import csv
import json

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from gearsig.errors import InputError


def test_turns_are_written_with_their_interval_and_assumptions(tmp_path):
    asked = ["growth", "--preset", "published_55_75", "--depth", "1..1.6mm", "--torque", "300Nm", "-o", str(tmp_path)]
    found = CliRunner().invoke(app, asked)
    assert found.exit_code == 0, found.output
    kept = json.loads((tmp_path / "growth.json").read_text(encoding="utf-8"))
    low, middle, high = kept["remaining_turns"]
    assert low < middle < high
    assert (kept["depth_mm"], kept["ends"], len(kept["assumptions"])) == ([1.0, 1.6], "depth", 5)
    rows = list(csv.DictReader((tmp_path / "growth.csv").read_text(encoding="utf-8").splitlines()))
    assert float(rows[-1]["turns_50"]) == pytest.approx(middle, rel=1e-4)
    assert (tmp_path / "growth.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "wrong", [["--depth", "9mm"], ["--depth", "1mm", "--paris", "steel"], ["--depth", "1mm", "--gear", "x"]]
)
def test_what_makes_no_sense_is_refused(tmp_path, wrong):
    found = CliRunner().invoke(app, ["growth", "--preset", "published_55_75", *wrong, "-o", str(tmp_path / "out")])
    assert isinstance(found.exception, InputError)
