"""`gearsig bifurcation`: what is asked for, what comes out, stopping and going on, errors."""

import csv
import json

import numpy as np
import pytest

from app.bifurcation import (
    BifurcationRequest,
    KeptValue,
    Measured,
    coexistence_lines,
    load,
    measured,
    motion_lines,
    parameter_text,
    run_folder,
    save,
    value_path,
)
from app.cli.main import main
from gearsig.errors import InputError
from gearsig.phase import PoincareSection
from sims.continuation import Branch
from sims.sweep import Axis, Sweep

BASE = ("bifurcation", "cracked", "--preset", "small_30_25", "--set", "roughness_um=0", "--points", "20", "-j", "1")


def branch(name="torque_nm", values=(10.0, 20.0), **more):
    smooth = {"roughness_um": 0.0}  # a rough flank comes back with its tooth, not with each mesh cycle
    sweep = Sweep("cracked", (Axis(name, values),), preset="small_30_25", parameters=smooth, common_seed=True)
    return Branch(sweep, n_cycles=20, **more)


def asked(*arguments):
    """Run the command; a run without trouble ends with exit code 0."""
    with pytest.raises(SystemExit) as end:
        main([*BASE, *(str(a) for a in arguments)])
    return end.value.code or 0


@pytest.mark.slow
def test_figure_table_and_summary(tmp_path, capsys):
    assert asked("--vary", "torque=10..20Nm:3", "--speed", "1500rpm", "-o", tmp_path / "out") == 0
    told = capsys.readouterr().out
    assert "rising: 3 values; periods in cycles: 1" in told
    summary = json.loads((tmp_path / "out" / "bifurcation.json").read_text(encoding="utf-8"))
    assert [row["value"] for row in summary["branches"]["up"]] == [10.0, 15.0, 20.0]
    assert summary["coexisting_at"] == []
    assert "8 time constants" in summary["transient"]
    with (tmp_path / "out" / "points.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["branch"] for row in rows} == {"up", "down"}
    # More torque, more transmission error: each tooth pair yields more.
    error = [
        np.mean([float(row["transmission error (m)"]) for row in rows if float(row["torque_nm"]) == value])
        for value in (10.0, 20.0)
    ]
    assert error[1] > 1.5 * error[0]
    picture = (tmp_path / "out" / "bifurcation.png").read_bytes()
    assert picture.startswith(b"\x89PNG")


def test_kinds_are_told_over_ranges_and_two_motions_with_their_bounds():
    points = PoincareSection(np.zeros((4, 1)), np.arange(4.0), ("x",), ("m",), np.ones(1), "locked", "mesh", "")
    found = [
        Measured(v, points, 1, 0.1, 0.0, "periodic" if v < 3 else "chaotic", 2.0 * v, 0.9) for v in (1.0, 2.0, 3.0)
    ]
    lines = motion_lines([KeptValue(one.value, one, None) for one in found], "rpm")
    assert lines == [
        "1 to 2 rpm: periodic (K 0.90, exponent 2 to 4 1/s)",
        "3 rpm: chaotic (K 0.90, exponent 6 1/s)",
    ]
    assert motion_lines([KeptValue(1.0, None, None, "no")], "rpm") == []
    ranges = [{"first": 1.0, "last": 2.0}, {"first": 4.0, "last": 4.0}]
    told = coexistence_lines({"coexisting_ranges": ranges, "coexisting_step": 0.5}, "rpm")
    assert told[0] == "Two motions coexist at 1 to 2, 4 rpm; values tried are 0.5 rpm apart."
    assert "may extend beyond it" in told[1]
    assert coexistence_lines({}, "rpm") == []


def test_what_is_there_is_not_run_again(tmp_path, monkeypatch):
    wanted = BifurcationRequest(branch(), "up")
    first = run_folder(wanted, tmp_path / "out", n_processes=1)
    value_path(tmp_path / "out", "up", 1).unlink()
    asked_for = []

    def run(_self, value, before=None):
        asked_for.append((value, None if before is None else before.torque_nm))
        raise InputError("enough")

    monkeypatch.setattr(Branch, "run", run)
    again = run_folder(wanted, tmp_path / "out", n_processes=1)
    assert asked_for == [(20.0, 10.0)]  # from where the first value ended
    np.testing.assert_array_equal(again["up"][0].measured.section.points, first["up"][0].measured.section.points)
    assert again["up"][1].reason == "enough"


def test_an_interrupted_run_goes_on_and_gives_the_same(tmp_path, monkeypatch):
    wanted, own = BifurcationRequest(branch(), "down"), Branch.run

    def stopped(self, value, before=None):
        if before is not None:
            raise KeyboardInterrupt
        return own(self, value, before)

    monkeypatch.setattr(Branch, "run", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_folder(wanted, tmp_path / "out", n_processes=1)
    monkeypatch.setattr(Branch, "run", own)
    assert not list((tmp_path / "out" / "values").glob(".*"))
    resumed = run_folder(wanted, tmp_path / "out", n_processes=1)["down"]
    whole = run_folder(wanted, tmp_path / "other", n_processes=1)["down"]
    for one, other in zip(resumed, whole, strict=True):
        np.testing.assert_array_equal(one.measured.section.points, other.measured.section.points)


def test_another_bifurcation_s_folder_is_refused(tmp_path):
    run_folder(BifurcationRequest(branch(values=(10.0,)), "rest"), tmp_path / "out", n_processes=1)
    with pytest.raises(InputError, match="holds another bifurcation: axes differs"):
        run_folder(BifurcationRequest(branch(values=(11.0,)), "rest"), tmp_path / "out", n_processes=1)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="belong to no bifurcation"):
        run_folder(BifurcationRequest(branch(), "rest"), tmp_path / "mine", n_processes=1)


def test_values_that_cannot_be_run_are_named_and_stop_nothing(tmp_path, capsys):
    code = asked("--vary", "crack_depth_mm=0,1,50", "--direction", "up", "-o", tmp_path / "out")
    assert code == 0
    told = capsys.readouterr()
    assert "rising: 2 values" in told.out
    assert "rising, 50:" in told.err
    rows = json.loads((tmp_path / "out" / "bifurcation.json").read_text(encoding="utf-8"))["branches"]["up"]
    assert "reason" in rows[2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--vary", "speed=600..900rpm"), "FROM..TO:COUNT"),
        (("--vary", "sped=600..900rpm:3"), "there is no parameter 'sped'"),
        (("--vary", "torque=5..9Nm:3", "--torque", "5Nm"), "torque_nm is both given and varied"),
        (("--vary", "torque=5..9Nm:3", "--direction", "sideways"), "direction is 'sideways'"),
        (("--vary", "torque=5..9Nm:3", "--signal", "a7"), "there is no signal or channel 'a7'"),
        (("--vary", "torque=5..9Nm:3", "--section", "tooth"), "section is 'tooth'"),
        (("--vary", "torque=5..9Nm:3", "--phase", "1.5"), "phase is 1.5 (allowed: 0 to 1)"),
        (("--vary", "torque=5..9Nm:3", "--speed", "300..900rpm"), "speed_rpm changes with time"),
    ],
)
def test_wrong_options_are_one_line_with_the_remedy(arguments, words, tmp_path, capsys):
    assert asked(*arguments, "-o", tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1


def test_a_value_on_disk_is_what_was_saved(tmp_path):
    one = branch(values=(10.0,))
    run = one.run(10.0)
    kept = KeptValue(10.0, measured(run, one, with_kind=True), run.end)
    save(kept, tmp_path / "a.npz")
    again = load(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.end.state.v, run.end.state.v)
    np.testing.assert_array_equal(again.measured.section.points, kept.measured.section.points)
    assert (again.measured.motion, again.measured.period) == ("periodic", 1)
    assert again.measured.section.units == ("m", "m/s")
    assert load(tmp_path / "b.npz") is None
    (tmp_path / "a.npz").write_bytes(b"torn")
    assert load(tmp_path / "a.npz") is None


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("speed_rpm", ("speed", "rpm")),
        ("half_backlash_um", ("half backlash", "µm")),
        ("mesh_damping_ratio", ("mesh damping ratio", "")),
        ("bending_stiffness_n_per_m", ("bending stiffness", "N/m")),
    ],
)
def test_what_is_varied_is_named_for_people(name, words):
    value = 1e8 if "stiffness" in name else 0.5
    assert parameter_text(branch(name, (value,))) == words


@pytest.mark.slow
def test_signals_of_the_model_and_channels_of_the_chain():
    for signal, period in (("transmission_error_m", 1), ("driver y", 1), ("mesh_force_n", 1)):
        one = branch(values=(20.0,), signal=signal)
        assert measured(one.run(20.0), one).period == period
    channel = branch(values=(20.0,), signal="a1", section="shaft")
    found = measured(channel.run(20.0), channel)
    assert found.section.units == ("m/s^2",)
    assert found.section.n_points >= 20
