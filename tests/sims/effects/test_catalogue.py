"""All effects: a complete catalogue, severities from nothing to a bound, effects that do not disturb others."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import sims.effects as package
from gearsig.errors import InputError
from sims.effects import GROUPS, Effect, EffectSetting, Option, Severity, effect, effects, with_effects
from sims.machine import Machine
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
PLACES = {
    "mesh_harmonics",
    "mesh_sidebands",
    "shaft_orders",
    "tooth_window",
    "envelope_orders",
    "broadband",
    "mains_lines",
    "amplitude_tail",
    "resonances",
    "speed",
    "low_load",
}
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
    assert set(one.shows_in) <= PLACES
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
