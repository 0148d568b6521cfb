"""`gearsig flexible`: figures, table and summary of a short study."""

import csv
import json

import pytest
from typer.testing import CliRunner

from app.cli.main import app
from gearsig.errors import InputError

pytestmark = pytest.mark.slow


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
        "pair_stiffness_map",
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
    maps = list(csv.DictReader((folder / "maps.csv").read_text(encoding="utf-8").splitlines()))
    for row in (maps[0], maps[len(maps) // 2], maps[-1]):
        numbers = {name: float(value) for name, value in row.items()}
        slots = range(sum(name.endswith("_force_n") for name in numbers))
        parts = [numbers[f"pair_{j}_load_part"] for j in slots]
        assert sum(parts) == pytest.approx(1.0, abs=1e-5)
        tangents = [numbers[f"pair_{j}_tangent_n_per_m"] for j in slots]
        assert sum(tangents) == pytest.approx(numbers["tangent_n_per_m"], rel=1e-4)
    assert (float(maps[0]["torque_nm"]), float(maps[-1]["torque_nm"])) == (10.0, 500.0)
    summary = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    assert summary["sweeps"][0]["n_steps"] == 200_000
    errors = [row["transmission_error_um"][1] for row in summary["static"]]
    assert errors == sorted(errors)


def test_a_torque_beyond_what_corners_follow_is_refused_before_anything_is_written(tmp_path):
    found = CliRunner().invoke(app, ["flexible", "-o", str(tmp_path / "x"), "--torques", "170,5000Nm"])
    assert isinstance(found.exception, InputError)
    assert "the teeth deflect by" in str(found.exception)
    assert not (tmp_path / "x").exists()


def test_a_range_without_dots_is_refused(tmp_path):
    found = CliRunner().invoke(app, ["flexible", "-o", str(tmp_path / "x"), "--speeds", "2000rpm"])
    assert found.exit_code != 0
    assert "900..4100rpm" in str(found.exception)
