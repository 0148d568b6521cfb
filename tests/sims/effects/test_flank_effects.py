"""Effects on teeth and flanks: which tooth, what is allowed, what adds and how."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.effects import cumulative_pitch, effect
from sims.machine import Lubrication, Machine, Roughness
from sims.mesh import deepest_crack_mm, highest_chip_mm
from tests.sims.machines import spur_pair_machine


def apply(machine: Machine, name: str, severity: float, seed: int = 0, **options: float | str) -> Machine:
    return effect(name).apply(machine, severity, options, np.random.default_rng(seed))


def test_a_crack_goes_where_it_is_told() -> None:
    mesh = apply(
        spur_pair_machine(), "root_crack", 1.5, gear="driven", tooth=7, angle_deg=60.0, width_percent=50.0
    ).mesh
    (crack,) = mesh.cracks_2
    assert mesh.cracks_1 == ()
    assert (crack.depth_mm, crack.angle_deg, crack.tooth, crack.width_mm) == (1.5, 60.0, 6, 10.0)


def test_a_crack_past_the_tooth_is_refused_with_what_is_allowed() -> None:
    deepest = deepest_crack_mm(spur_pair_machine().mesh.pair.driver)
    with pytest.raises(InputError, match=rf"goes past the tooth \(allowed: above 0 to {deepest:.3g} mm"):
        apply(spur_pair_machine(), "root_crack", 1.01 * deepest)
    assert apply(spur_pair_machine(), "root_crack", 0.99 * deepest).mesh.cracks_1


TOOTH_FAULTS = [("root_crack", "crack"), ("tooth_spall", "spall"), ("chipped_tooth", "chip")]


@pytest.mark.parametrize(("name", "word"), TOOTH_FAULTS)
def test_one_of_a_kind_per_tooth(name: str, word: str) -> None:
    machine = apply(spur_pair_machine(), name, 1.0, tooth=3)
    with pytest.raises(InputError, match=f"tooth 3 of the driver gear already has a {word}"):
        apply(machine, name, 2.0, tooth=3)
    assert [f.tooth for f in getattr(apply(machine, name, 2.0, tooth=4).mesh, f"{word}s_1")] == [2, 3]
    assert [f.tooth for f in getattr(apply(machine, name, 2.0, gear="driven", tooth=3).mesh, f"{word}s_2")] == [2]


@pytest.mark.parametrize(("name", "word"), TOOTH_FAULTS)
def test_a_tooth_that_is_not_there(name: str, word: str) -> None:
    with pytest.raises(InputError, match=r"tooth of the driver gear is 56 \(allowed: 1 to 55\)"):
        apply(spur_pair_machine(), name, 0.5, tooth=56)
    assert getattr(apply(spur_pair_machine(), name, 0.5, gear="driven", tooth=75).mesh, f"{word}s_2")


def test_three_kinds_of_damage_on_one_tooth() -> None:
    machine = spur_pair_machine()
    for name, _ in TOOTH_FAULTS:
        machine = apply(machine, name, 1.0, tooth=5)
    assert machine.mesh.cracks_1[0].tooth == machine.mesh.spalls_1[0].tooth == machine.mesh.chips_1[0].tooth == 4


def test_a_spall_longer_than_the_flank_is_refused_with_what_is_allowed() -> None:
    with pytest.raises(InputError, match=r"longer than the flank \(allowed: 0 to [34]\.\d+ mm along the profile"):
        apply(spur_pair_machine(), "tooth_spall", 50.0, length_mm=6.0)
    (spall,) = apply(spur_pair_machine(), "tooth_spall", 80.0, length_mm=2.0, depth_um=50.0).mesh.spalls_1
    assert (spall.length_mm, spall.width_mm, spall.depth_um) == (2.0, 16.0, 50.0)


def test_a_chip_higher_than_the_flank_is_refused_with_what_is_allowed() -> None:
    highest = highest_chip_mm(spur_pair_machine().mesh.pair.driver)
    with pytest.raises(InputError, match=rf"higher than the flank \(allowed: 0 to {highest:.3g} mm"):
        apply(spur_pair_machine(), "chipped_tooth", 1.01 * highest)


def test_a_strip_too_narrow_to_carry_is_refused() -> None:
    with pytest.raises(InputError, match=r"19 mm on a loaded face of 20 mm \(allowed: 0 to 18 mm, or 20 mm"):
        apply(spur_pair_machine(), "chipped_tooth", 1.0, width_percent=95.0)
    with pytest.raises(InputError, match=r"allowed: 0 to 90 %"):
        apply(spur_pair_machine(), "tooth_spall", 95.0)


def test_wear_adds_on_one_gear() -> None:
    once = apply(spur_pair_machine(), "tooth_wear", 12.0, gear="driven")
    mesh = apply(once, "tooth_wear", 8.0, gear="driven").mesh
    assert (mesh.flank_1.wear_um, mesh.flank_2.wear_um) == (0.0, 20.0)


@given(st.integers(5, 200), st.integers(0, 2**31))
def test_pitch_closes_over_the_revolution(teeth: int, seed: int) -> None:
    cumulative = cumulative_pitch(teeth, np.random.default_rng(seed))
    single = np.diff(cumulative, prepend=cumulative[-1])  # the first tooth's pitch is measured from the last tooth
    assert abs(single.sum()) < 1e-9
    assert abs(cumulative.mean()) < 1e-12
    assert np.abs(single).max() < 6.0  # no jump where the revolution closes: drawn from a normal distribution


def test_single_pitch_deviations_have_the_severity_as_standard_deviation() -> None:
    singles = []
    for seed in range(300):
        pitch = np.array(apply(spur_pair_machine(), "pitch_error", 8.0, seed).mesh.flank_1.pitch_um)
        singles.append(np.diff(pitch, prepend=pitch[-1]))
    values = np.array(singles)  # (300, 55)
    assert values.std() == pytest.approx(8.0, rel=0.03)
    assert values[:, 0].std() == pytest.approx(8.0, rel=0.15)  # nothing special about the first tooth


def test_one_tooth_alone_may_be_out() -> None:
    pitch = np.array(apply(spur_pair_machine(), "pitch_error", 8.0, gear="driven", tooth=7).mesh.flank_2.pitch_um)
    assert np.flatnonzero(pitch).tolist() == [6]
    assert pitch[6] == 8.0
    ahead = apply(spur_pair_machine(), "pitch_error", 8.0, gear="driven", tooth=7, stands="ahead").mesh.flank_2.pitch_um
    assert ahead[6] == -8.0


def test_pitch_errors_add_and_grow_in_proportion() -> None:
    once = np.array(apply(spur_pair_machine(), "pitch_error", 5.0).mesh.flank_1.pitch_um)
    machine = apply(spur_pair_machine(), "pitch_error", 5.0)
    more = np.array(apply(machine, "pitch_error", 10.0).mesh.flank_1.pitch_um)
    np.testing.assert_allclose(more, 3.0 * once, rtol=1e-12)
    assert apply(spur_pair_machine(), "pitch_error", 5.0, gear="driven").mesh.flank_1.pitch_um == ()


def test_roughness_adds_in_squares() -> None:
    machine = replace(spur_pair_machine(), roughness=Roughness(0.3, "time"))
    rougher = apply(machine, "surface_roughness", 0.4).roughness
    assert rougher.rms_um == pytest.approx(0.5)
    assert rougher.locked_to == "time"


def test_roughness_there_is_keeps_what_it_returns_with() -> None:
    assert apply(spur_pair_machine(), "surface_roughness", 0.4, locked_to="time").roughness.locked_to == "time"
    machine = replace(spur_pair_machine(), roughness=Roughness(0.3, "time"))
    with pytest.raises(InputError, match=r"already have 0.3 µm, locked to 'time', and 'flank'"):
        apply(machine, "surface_roughness", 0.4, locked_to="flank")


def test_friction_comes_on_top_of_the_films() -> None:
    machine = replace(spur_pair_machine(), lubrication=Lubrication(factor=2.0, dry_coefficient=0.05))
    oil = apply(machine, "sliding_friction", 0.1).lubrication
    assert (oil.factor, oil.dry_coefficient) == (2.0, pytest.approx(0.15))


def test_no_flanks_rub_more_than_clean_steel() -> None:
    machine = replace(spur_pair_machine(), lubrication=Lubrication(dry_coefficient=0.3))
    with pytest.raises(InputError, match=r"beside the 0.3 there are, is 0.4 \(allowed: 0 to 0.3\)"):
        apply(machine, "sliding_friction", 0.4)


def test_friction_starts_at_nothing_where_there_was_none() -> None:
    """Continuous: hardly any severity switches hardly any friction on."""
    machine = replace(spur_pair_machine(), lubrication=Lubrication(friction=False, factor=1.0))
    oil = apply(machine, "sliding_friction", 0.001).lubrication
    assert oil.friction
    assert (oil.factor, oil.dry_coefficient) == (0.0, 0.001)
