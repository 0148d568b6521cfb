"""`gearsig simulate --preset FILE`: a machine with its effects from a file."""

import json
from pathlib import Path

from typer.testing import CliRunner

from app.cli.main import app
from gearsig.gap import AddedEffect, OperatingCondition
from gearsig.rig import GearPair, Rig, Shaft
from sims.registry import gap_simulator

RIG = Rig("bench", (Shaft("a"), Shaft("b")), (GearPair("p", "a", "b", 21, 50, 2.0),))
CRACK = AddedEffect("root_crack", 2.0, {"gear": "driver", "tooth": 4.0})


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["simulate", "cracked", *words])
    return result.exit_code, result.output + str(result.exception or "")


def test_a_twins_preset_runs_and_its_effect_stands_in_the_truth(tmp_path: Path) -> None:
    preset, output = tmp_path / "twin.toml", tmp_path / "again.csv"
    twin = gap_simulator("cracked").twin_of(RIG)
    preset.write_text(twin.preset_toml(OperatingCondition(1500.0, 40.0), (CRACK,), ["a note"]), encoding="utf-8")
    code, text = run("--preset", str(preset), "--duration", "0.2s", "-o", str(output))
    assert code == 0, text
    truth = json.loads((tmp_path / "again.truth.json").read_text(encoding="utf-8"))
    assert (truth["preset"], truth["effects"][0]["name"], truth["effects"][0]["severity"]) == (
        "twin",
        "root_crack",
        2.0,
    )
    code, text = run("--preset", str(preset), "--list")
    assert code == 0, text
    assert "root_crack" in text
    assert "a note" in text


def test_a_preset_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    code, text = run("--preset", str(tmp_path / "none.toml"), "-o", str(tmp_path / "x.csv"))
    assert code != 0
    assert "cannot be read" in " ".join(text.split())
