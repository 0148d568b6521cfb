"""All effects: a complete catalogue, severities from nothing to a bound, effects of one's own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import sims.effects as package
from gearsig.errors import InputError
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft
from sims.effects import (
    GROUPS,
    VARIABLE,
    Effect,
    EffectSetting,
    Option,
    Severity,
    add_effect,
    effect,
    effects,
    is_user_effect,
    with_effects,
)
from sims.machine import Machine
from sims.registry import gap_simulator, simulator
from sims.simulator import sources_digest
from tests.sims.machines import spur_pair_machine

CATALOGUE = {
    "tooth-local": {"root_crack", "tooth_spall", "chipped_tooth"},
    "flank": {"tooth_wear", "pitch_error", "surface_roughness", "sliding_friction"},
    "shaft": {"eccentricity", "unbalance", "misalignment"},
    "drive and load": {"torque_ripple", "speed_fluctuation", "backlash"},
    "bearing": {"bearing_outer_race", "bearing_inner_race", "bearing_clearance"},
    "measurement chain": {"transfer_path", "mains_hum", "clipping"},
}
NAMES = sorted(name for names in CATALOGUE.values() for name in names)
ONE_DEFECT = {"bearing_outer_race", "bearing_inner_race"}
"""A bearing has one defect: these two exclude each other on the same bearing."""


def machine_with(*settings: EffectSetting, seed: int = 0) -> Machine:
    return with_effects(spur_pair_machine(), settings, np.random.default_rng(seed))


def typical(name: str, **options: float | str) -> EffectSetting:
    return EffectSetting(name, effect(name).severity.typical, options)


def numbers(part: object) -> list[float]:
    """All numbers of a machine, in the order of its fields."""
    if hasattr(part, "__dataclass_fields__"):
        return [n for name in part.__dataclass_fields__ for n in numbers(getattr(part, name))]
    if isinstance(part, dict):
        return [n for key in sorted(part) for n in numbers(part[key])]
    if isinstance(part, (tuple, list)):
        return [n for item in part for n in numbers(item)]
    return [float(part)] if isinstance(part, (int, float)) else []


def test_the_catalogue_is_complete() -> None:
    found: dict[str, set[str]] = {group: set() for group in GROUPS}
    for one in effects().values():
        found[one.group].add(one.name)
    assert found == CATALOGUE


def test_each_effect_is_a_file_of_its_name() -> None:
    folder = Path(package.__path__[0])
    assert {name for name in NAMES if (folder / f"{name}.py").is_file()} == set(effects())


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_says_what_it_is(name: str) -> None:
    one = effect(name)
    s = one.severity
    assert s.low == 0.0 < s.typical < s.high
    assert s.meaning
    assert one.title
    assert one.shows_in
    assert one.changes.endswith(".")
    assert one.signature.endswith(".")


@pytest.mark.parametrize("name", effects())
def test_an_effect_states_plausible_severities_with_a_reason(name: str) -> None:
    plausible = effect(name).plausible
    assert plausible is not None
    assert plausible.why
    assert 0 < plausible.low < plausible.high


@pytest.mark.parametrize("name", NAMES)
def test_severity_zero_is_the_machine_itself(name: str) -> None:
    assert machine_with(EffectSetting(name, 0.0)) == spur_pair_machine()


@pytest.mark.parametrize("name", NAMES)
def test_typical_severity_changes_the_machine_and_the_seed_decides(name: str) -> None:
    changed = machine_with(typical(name))
    assert changed != spur_pair_machine()
    assert changed == machine_with(typical(name))


@pytest.mark.parametrize("name", NAMES)
def test_the_change_grows_steadily_with_the_severity(name: str) -> None:
    """One seed, rising severity: numbers of the machine move monotonically, each on its own."""
    steps = [numbers(machine_with(EffectSetting(name, part * effect(name).severity.typical))) for part in (0.5, 1, 1.5)]
    assert len({len(step) for step in steps}) == 1
    low, middle, high = (np.array(step) for step in steps)
    assert np.all((middle - low) * (high - middle) >= -1e-9)
    assert np.any(low != middle)


@pytest.mark.parametrize("name", NAMES)
def test_severity_outside_its_range_is_refused_with_the_range(name: str) -> None:
    s = effect(name).severity
    for severity in (-0.1, 1.01 * s.high, float("nan"), float("inf")):
        with pytest.raises(InputError) as caught:
            machine_with(EffectSetting(name, severity))
        assert s.name in str(caught.value)
    with pytest.raises(InputError, match=f"0 to {s.high:g}"):
        machine_with(EffectSetting(name, 1.01 * s.high))


@pytest.mark.parametrize("name", NAMES)
def test_unknown_options_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} has no option 'colour'"):
        machine_with(EffectSetting(name, 0.0, {"colour": 1.0}))


def test_a_misspelt_effect_gets_the_closest_name() -> None:
    with pytest.raises(InputError, match="did you mean root_crack"):
        machine_with(EffectSetting("rootcrack", 1.0))


@pytest.mark.parametrize(("first", "second"), [p for p in combinations(NAMES, 2) if set(p) != ONE_DEFECT])
def test_two_effects_commute(first: str, second: str) -> None:
    one = machine_with(typical(first), typical(second))
    other = machine_with(typical(second), typical(first))
    np.testing.assert_allclose(numbers(one), numbers(other), rtol=1e-12, atol=1e-12)


def test_what_an_effect_draws_does_not_depend_on_others() -> None:
    alone = machine_with(typical("pitch_error"))
    among = machine_with(typical("torque_ripple"), typical("pitch_error"), typical("eccentricity"))
    assert alone.mesh.flank_1 == among.mesh.flank_1
    assert alone != machine_with(typical("pitch_error"), seed=1)


def test_an_effect_twice_draws_twice() -> None:
    twice = machine_with(typical("torque_ripple"), typical("torque_ripple")).drive.ripples
    assert len(twice) == 2
    assert twice[0].phase_rad != twice[1].phase_rad


def test_exactly_one_number_is_taken_from_the_generator() -> None:
    used, untouched = np.random.default_rng(5), np.random.default_rng(5)
    with_effects(spur_pair_machine(), [typical("pitch_error"), typical("eccentricity")], used)
    untouched.integers(2**63)
    assert used.random() == untouched.random()


def test_all_effects_at_once_make_a_machine() -> None:
    settings = [typical(n) for n in NAMES if n != "bearing_inner_race"]
    everything = machine_with(*settings, typical("bearing_inner_race", bearing="bearing 3"))
    assert everything.bearings[0].defect is not None
    assert everything.bearings[2].defect is not None


def test_options_left_to_be_drawn_are_not_in_the_mapping() -> None:
    seen: dict[str, object] = {}

    def change(machine: Machine, severity: float, options: object, rng: np.random.Generator) -> Machine:
        del severity, rng
        seen.update(options)  # type: ignore[call-overload]
        return machine

    severity = Severity("size", "mm", 0.0, 1.0, 0.5, "size")
    options = (Option("angle_deg", None, "drawn", low=0.0, high=90.0), Option("order", 6.0, "fixed"))
    probe = Effect("probe", "flank", "probe", severity, "x.", "y.", ("speed",), change, options)
    probe.apply(spur_pair_machine(), 0.5, {}, np.random.default_rng(0))
    assert seen == {"order": 6.0}
    probe.apply(spur_pair_machine(), 0.5, {"angle_deg": 30}, np.random.default_rng(0))
    assert seen == {"order": 6.0, "angle_deg": 30.0}
    with pytest.raises(InputError, match="angle_deg of probe is 91"):
        probe.complete({"angle_deg": 91.0})


# Effects of one's own: one Python file outside the package takes part like those of the catalogue.

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
    assert simulator("cracked").effects == tuple(before)
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
    assert "hissing_seal" in simulator("cracked").effects  # though it was asked for before
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
        (FILE.replace("NAME", "clipping"), "already an effect 'clipping'"),
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
    with pytest.raises(InputError, match="is not a Python file"):
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
