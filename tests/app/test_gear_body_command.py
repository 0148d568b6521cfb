"""`gearsig gear-body`, `gearsig growth`: figures, files and text of one small gear; turns left."""

import csv
import json
import re
from dataclasses import replace

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.main import app
from gearsig.cache import OtherVersionError
from gearsig.errors import InputError
from sims.fe_gear import (
    GearBlank,
    gear_key,
    gear_name,
    plan_for,
    read_gear,
    ready_gear,
    write_gear,
)
from sims.mesh import GearGeometry

SMALL = ["--teeth", "16", "--profile-shift", "0.2", "--face", "10mm", "--bore", "8mm", "--dof", "15000"]


def _run(*arguments):
    return CliRunner().invoke(app, ["gear-body", *arguments])


@pytest.mark.study
def test_mesh_modes_stress_and_reductions_are_written(tmp_path, monkeypatch):
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path / "kept"))
    found = _run("-o", str(tmp_path / "out"), *SMALL, "--vtk", "--reduce", "--modes", "8")
    assert found.exit_code == 0, found.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"mesh.png", "modes.png", "stress.png", "gear.vtu", "reduced.npz", "craig_bampton.txt"}
    gear = read_gear(tmp_path / "out" / "reduced.npz")
    assert gear.blank.n_teeth == 16
    # The model finds it there.
    (kept,) = (tmp_path / "kept" / "gears").iterdir()
    assert kept.stem == gear_name(gear.blank, plan_for(gear.blank, 15_000))
    assert gear.key == gear_key(gear.blank, plan_for(gear.blank, 15_000))
    assert f"{gear.n_dof} degrees of freedom" in found.output
    assert f"{gear.frequencies_hz[0]:.1f} Hz, {gear.nodal_diameters[0]} nodal diameters" in found.output
    assert "Craig–Bampton: 229 degrees of freedom" in found.output
    points = meshio.read(tmp_path / "out" / "gear.vtu").point_data
    assert "von_mises_pa" in points
    assert any(name.startswith("mode_1_") for name in points)


@pytest.mark.study
def test_a_gear_of_another_version_is_named_until_it_is_cleared_away(tmp_path, monkeypatch):
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path / "kept"))
    arguments = ("-o", str(tmp_path / "out"), *SMALL, "--dof", "5000", "--modes", "4", "--reduce")
    blank = GearBlank(GearGeometry(16, 3.0, profile_shift=0.2, face_width_mm=10.0, bore_radius_mm=8.0))
    kept = tmp_path / "kept" / "gears" / f"{gear_name(blank, plan_for(blank, 5000))}.npz"
    kept.parent.mkdir(parents=True)
    write_gear(kept, replace(ready_gear("z50_m3"), key="of another version"))
    refused = _run(*arguments)
    assert isinstance(refused.exception, OtherVersionError)
    assert str(kept) in str(refused.exception)
    assert "--fresh" in str(refused.exception)
    assert not (tmp_path / "out").exists()
    again = _run(*arguments, "--fresh")
    assert again.exit_code == 0
    assert "1 file of another version deleted" in again.stderr
    assert read_gear(kept).key == gear_key(blank, plan_for(blank, 5000))


def test_a_model_that_keeps_nothing_has_nothing_to_clear_away(tmp_path):
    found = CliRunner().invoke(app, ["simulate", "cracked", "--fresh", "-o", str(tmp_path / "a.h5")])
    assert isinstance(found.exception, InputError)
    assert "--fresh" in str(found.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--teeth", "12"), "undercuts"),
        (("--web", "30mm"), "thicker than the face"),
        (("--dof", "5000", "--teeth", "150", "--module", "1mm"), "too few for 150 teeth"),
        (("--dof", "5000", "--reduce"), "too coarse for the fillet: its straight edges lie up to 0.15 mm off it"),
        (("--held", "springs", "--radial", "0N/m", "--dof", "5000"), "--radial"),
        (("--held", "shaft"), "--held"),
        (("--held", "bore", "--radial", "1e8N/m", "--dof", "5000"), "add --held springs"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, arguments, said):
    found = _run("-o", str(tmp_path / "out"), *arguments)
    assert isinstance(found.exception, InputError)
    assert said in str(found.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_coarse_gear_on_springs_says_how_coarse_it_is(tmp_path):
    found = _run(
        "-o", str(tmp_path / "out"), "--dof", "5000", "--held", "springs", "--twist", "1e5Nm/rad", "--modes", "9"
    )
    assert found.exit_code == 0, found.output
    assert "modes, hub on springs:" in found.output
    assert "coarse: against " in found.output
    assert "edges straight" in found.output
    assert not (tmp_path / "out" / "stress.png").exists()
    turning = next(line for line in found.output.splitlines() if "turns about the shaft" in line)
    inertia = float(re.search(r"polar inertia ([0-9.e-]+)", found.output)[1])
    # The hub's twist adds its compliance to the spring's.
    assert float(turning.split(" Hz")[0]) == pytest.approx(np.sqrt(1e5 / inertia) / (2.0 * np.pi), rel=0.03)


def test_more_modes_than_bodies_have_are_refused_before_the_search(tmp_path):
    found = _run("-o", str(tmp_path / "out"), *SMALL, "--modes", "2000")
    assert isinstance(found.exception, InputError)
    assert "n_modes is 2000 (allowed: a whole number from 1 to 300)" in str(found.exception)


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
def test_growth_that_makes_no_sense_is_refused(tmp_path, wrong):
    found = CliRunner().invoke(app, ["growth", "--preset", "published_55_75", *wrong, "-o", str(tmp_path / "out")])
    assert isinstance(found.exception, InputError)
