"""Presets that people give as files: read strictly, with errors that say what is wrong and where."""

from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.cracked import CrackedPair
from sims.presets import preset, preset_text
from sims.simulator import SimulationSetup

GOOD = """
[about]
model = "cracked"
title = "t"
sources = []
assumed = ["a"]
does_not_represent = []
[parameters]
teeth_driver = 25
[operation]
speed_rpm = 1000
torque_nm = 30
[[effects]]
name = "root_crack"
severity = 1.0
options = {gear = "driven", tooth = 3}
"""
INSTALLED = """
[installed]
shafts = ["in", "out"]
pickup = {channel = "z", side = 1}
sensors = [{channel = "x", bearing = 2}]
modes = [{frequency_hz = 900, damping_ratio = 0.02, gain = 0.05, shape = [1, 0.5, 0, 0]}]
bearings = [
  {name = "1", shaft = "in", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "2", shaft = "in", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "3", shaft = "out", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
  {name = "4", shaft = "out", n_rolling_elements = 8, rolling_element_diameter_mm = 6.0, pitch_diameter_mm = 30.0},
]
"""


def written(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def prepare(name: str) -> object:
    return CrackedPair().prepare(SimulationSetup(name), np.random.default_rng(0))


def test_a_file_may_carry_effects_and_what_is_fitted(tmp_path: Path) -> None:
    name = written(tmp_path, GOOD + INSTALLED)
    chosen = preset("cracked", name)
    assert (chosen.name, chosen.speed_rpm, chosen.effects[0].options["tooth"]) == ("mine", 1000.0, 3)
    machine = CrackedPair().prepare(SimulationSetup(name), np.random.default_rng(0)).machine
    assert machine.mesh.cracks_2[0].tooth == 2
    assert machine.shaft_names == ("in", "out")
    assert [b.bearing.name for b in machine.bearings] == ["1", "2", "3", "4"]
    (channel,) = machine.chain.channels
    assert (channel.name, len(channel.path.modes)) == ("x", 1)
    assert set(channel.path.direct) == {"bearing 2 x", "bearing 2 y"}
    assert machine.chain.tachometer.shaft == "out"  # type: ignore[union-attr]  # it has one


def test_it_is_written_as_it_was_read(tmp_path: Path) -> None:
    chosen = preset("cracked", written(tmp_path, GOOD + INSTALLED))
    again = preset("cracked", written(tmp_path, preset_text(chosen, ["first\nsecond"])))
    assert again == chosen


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("[operation]", "[operations]", "did you mean operation"),
        ("title =", "titel =", "did you mean title"),
        ('title = "t"', "title = 3", "text in quotes"),
        ('assumed = ["a"]', 'assumed = "a"', "a list of texts"),
        ("speed_rpm = 1000", "speed_rpm = true", "a number"),
        ("speed_rpm = 1000", "speed_rpm = -5", "speed_rpm"),
        ("teeth_driver = 25", "teeth_driver = [25]", "a number or a text"),
        ("teeth_driver = 25", "teeth_drive = 25", "did you mean teeth_driver"),
        ("severity = 1.0", "severity = 99.0", "0 to 10 mm"),
        ("severity = 1.0", "strength = 1.0", "severity"),
        ('"root_crack"', '"root_crak"', "did you mean root_crack"),
        ("tooth = 3", "teeth = 3", "did you mean tooth"),
        ('"cracked"', '"forging"', "is a preset of the model 'forging'"),
        ("[about]", "[about", "not valid TOML"),
        ('shafts = ["in", "out"]', 'shafts = ["in", "in"]', "two different names"),
        ('shafts = ["in", "out"]', 'shafts = ["in", "on"]', "is on shaft 'out'"),
        ("bearing = 2", "bearing = 7", "1 to 4"),
        ("bearing = 2", 'bearing = 2, file = "/etc/passwd"', "there is no key 'file'"),
        ("shape = [1, 0.5, 0, 0]", "shape = [1]", "4 bearings"),
        ("gain = 0.05", "gain = inf", "finite"),
        ('channel = "z"', 'channel = "x"', "each once"),
        ("modes = [", "mode = [", "has the keys"),
    ],
)
def test_nonsense_is_named(tmp_path: Path, old: str, new: str, named: str) -> None:
    assert old in GOOD + INSTALLED
    name = written(tmp_path, (GOOD + INSTALLED).replace(old, new))
    with pytest.raises(InputError) as caught:
        prepare(name)
    assert named in str(caught.value)


def test_files_that_are_no_presets(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        preset("cracked", str(tmp_path / "none.toml"))
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(InputError, match="cannot be read"):
        preset("cracked", str(tmp_path / "folder.toml"))
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        preset("cracked", str(tmp_path / "binary.toml"))
    (tmp_path / "large.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(InputError, match="up to 1 MB"):
        preset("cracked", str(tmp_path / "large.toml"))


def test_a_name_without_its_ending_is_never_a_file(tmp_path: Path) -> None:
    written(tmp_path, GOOD)
    with pytest.raises(InputError, match="has no preset"):
        preset("cracked", str(tmp_path / "mine"))
