"""Effects of one's own: one Python file outside the package takes part like those of the catalogue."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft
from sims.effects import VARIABLE, EffectSetting, add_effect, effect, effects, is_user_effect, with_effects
from sims.registry import gap_simulator
from sims.simulator import sources_digest
from tests.sims.machines import spur_pair_machine

RIG = Rig(
    "bench",
    (Shaft("pinion"), Shaft("wheel")),
    (GearPair("pair", "pinion", "wheel", 21, 50, 2.0, 20.0, 18.0),),
    operating_point=OperatingPoint("pinion", 1500.0, torque_nm=40.0),
)
FILE = """
from dataclasses import replace
from sims.effects import GEAR_OPTION, TOOTH_OPTION, Effect, Severity, with_each_channel

def change(machine, severity, options, rng):
    def louder(channel):
        return replace(channel, background=replace(channel.background, rms_mps2=severity))
    return with_each_channel(machine, louder)

EFFECT = Effect(
    "NAME", "shaft", "seal that hisses", Severity("level_mps2", "m/s^2", 0.0, 12.0, 5.0, "rms"), "noise", "floor",
    ("broadband",), change, (GEAR_OPTION, TOOTH_OPTION),
)
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.delenv(VARIABLE, raising=False)
    path = tmp_path / "seal.py"
    path.write_text(FILE.replace("NAME", "hissing_seal"))
    monkeypatch.setenv(VARIABLE, "")  # so that it is as before afterwards
    yield path
    monkeypatch.undo()
    effects.cache_clear()


def test_it_takes_its_place_in_the_catalogue_and_changes_machines(file: Path) -> None:
    before, digest = list(effects()), sources_digest()
    added = add_effect(file)
    assert effects()["hissing_seal"] is effect("hissing_seal")
    assert [name for name in effects() if name != "hissing_seal"] == before
    assert list(effects()).index("hissing_seal") == list(effects()).index("misalignment") - 1  # by group, then by name
    assert (is_user_effect("hissing_seal"), is_user_effect("misalignment"), is_user_effect("nothing")) == (
        True,
        False,
        False,
    )
    assert sources_digest() != digest
    machine = with_effects(spur_pair_machine(), [EffectSetting("hissing_seal", 3.0)], np.random.default_rng(0))
    assert {c.background.rms_mps2 for c in machine.chain.channels} == {3.0}
    assert added.title == "seal that hisses"
    assert add_effect(file).name == "hissing_seal"  # once more changes nothing
    assert len(effects()) == len(before) + 1


@pytest.mark.slow
def test_processes_that_are_started_know_it(file: Path) -> None:
    add_effect(file)
    code = "from sims.effects import effects; print('hissing_seal' in effects())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "True"


def test_a_twin_tries_it_about_its_typical_severity_on_each_gear(file: Path) -> None:
    add_effect(file)
    simulator = gap_simulator("cracked")
    assert simulator.gap_effects()["hissing_seal"].unit == "m/s^2"
    candidates = simulator.twin_of(RIG).candidates("hissing_seal")
    assert {str(a.options["gear"]) for a in candidates} == {"driver", "driven"}
    assert {a.options["tooth"] for a in candidates} == {1.0}
    severities = sorted({a.severity for a in candidates})
    assert severities[0] == pytest.approx(5.0 / 3.0, rel=1e-3)
    assert severities[-1] == 12.0  # not three times the typical one: no more may be given
    drawn = simulator.twin_of(RIG).draw("hissing_seal", np.random.default_rng(0))  # type: ignore[attr-defined]
    assert severities[0] * 0.999 <= drawn.severity <= 12.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("EFFECT = 3", "defines no effect"),
        ("x = ", "does not run .SyntaxError"),
        ("1 / 0", "does not run .ZeroDivisionError"),
        (FILE.replace("NAME", "clipping"), "an effect 'clipping' already"),
        (FILE.replace("NAME", "<b>a, b</b>"), "allowed: letters, digits and underscores"),
    ],
)
def test_a_file_of_no_use_is_an_error_and_leaves_the_catalogue_as_it_was(file: Path, text: str, said: str) -> None:
    before = list(effects())
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        add_effect(file)
    assert list(effects()) == before


def test_a_file_that_is_not_there_is_an_error(file: Path) -> None:
    with pytest.raises(InputError, match="is no Python file"):
        add_effect(file.with_name("other.py"))


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise RuntimeError('boom')", r"seal\.py.*'hissing_seal' fails \(RuntimeError: boom\)"),
        ("pass", "returns NoneType"),
    ],
)
def test_one_that_fails_says_so_with_its_file(file: Path, body: str, words: str) -> None:
    file.write_text(FILE.replace("NAME", "hissing_seal").replace("return with_each_channel(machine, louder)", body))
    own = add_effect(file)
    with pytest.raises(InputError, match=words):
        own.apply(spur_pair_machine(), 5.0, {}, np.random.default_rng(0))


def test_a_place_that_nothing_can_show_in_is_an_error(file: Path) -> None:
    file.write_text(FILE.replace("NAME", "hissing_seal").replace("broadband", "everywhere"))
    with pytest.raises(InputError, match=r"shows_in of hissing_seal.*broadband"):
        add_effect(file)
