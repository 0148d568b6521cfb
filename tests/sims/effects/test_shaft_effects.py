"""Effects on shafts and drive: vectors add, angles and ripples go where they belong."""

from cmath import rect
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.effects import EffectSetting, effect, vector_sum, with_effects
from sims.machine import Machine, Wheel
from tests.sims.machines import spur_pair_machine

lengths = st.floats(0.0, 200.0)
angles = st.floats(-360.0, 360.0)


def apply(machine: Machine, name: str, severity: float, seed: int = 0, **options: float | str) -> Machine:
    return effect(name).apply(machine, severity, options, np.random.default_rng(seed))


def runout(wheel: Wheel) -> complex:
    return rect(wheel.runout_um, radians(wheel.runout_angle_deg))


def unbalance(wheel: Wheel) -> complex:
    return rect(wheel.unbalance_g_mm, radians(wheel.unbalance_angle_deg))


@given(lengths, angles, lengths, angles)
@example(2.0, 0.0, 5e-324, 31.0)  # an angle below what numbers hold
def test_vectors_add(a: float, alpha: float, b: float, beta: float) -> None:
    length, angle = vector_sum(a, alpha, b, beta)
    expected = rect(a, radians(alpha)) + rect(b, radians(beta))
    assert rect(length, radians(angle)) == pytest.approx(expected, abs=1e-9)


def test_two_run_outs_on_opposite_sides_cancel() -> None:
    once = apply(spur_pair_machine(), "eccentricity", 20.0, angle_deg=30.0)
    twice = apply(once, "eccentricity", 20.0, angle_deg=210.0)
    assert once.wheels[0].runout_um == pytest.approx(20.0)
    assert abs(runout(twice.wheels[0])) < 1e-12
    assert abs(unbalance(twice.wheels[0])) < 1e-12


def test_an_eccentric_gear_is_out_of_balance_by_its_mass_times_the_run_out() -> None:
    machine = apply(spur_pair_machine(), "eccentricity", 20.0, gear="driven", angle_deg=45.0)
    wheel = machine.wheels[1]
    assert wheel.mass_offset_m == pytest.approx(20e-6)  # the centre of mass lies where the pitch circle's centre does
    assert wheel.unbalance_angle_deg == pytest.approx(wheel.runout_angle_deg) == pytest.approx(45.0)
    assert machine.wheels[0] == spur_pair_machine().wheels[0]


def test_balancing_an_eccentric_gear_leaves_the_run_out() -> None:
    eccentric = apply(spur_pair_machine(), "eccentricity", 20.0, angle_deg=0.0)
    grams = eccentric.wheels[0].unbalance_g_mm
    balanced = apply(eccentric, "unbalance", grams, angle_deg=180.0).wheels[0]
    assert balanced.unbalance_g_mm == pytest.approx(0.0, abs=1e-9)
    assert balanced.runout_um == pytest.approx(20.0)


@pytest.mark.parametrize("name", ["eccentricity", "unbalance"])
def test_an_angle_that_is_not_given_is_drawn_from_the_whole_circle(name: str) -> None:
    drawn = [apply(spur_pair_machine(), name, 10.0, seed).wheels[0].unbalance_angle_deg for seed in range(200)]
    quarters = np.histogram(drawn, [0, 90, 180, 270, 360])[0]
    assert quarters.sum() == 200
    assert quarters.min() > 25  # 50 expected, standard deviation 6
    assert apply(spur_pair_machine(), name, 10.0, 1, angle_deg=12.0).wheels[0].unbalance_angle_deg == pytest.approx(12)


def test_misalignment_adds_up_to_what_a_coupling_allows() -> None:
    machine = apply(spur_pair_machine(), "misalignment", 3.0, shaft="driven")
    assert [s.coupling_angle_deg for s in machine.shafts] == [0.0, 3.0]
    with pytest.raises(InputError, match=r"beside the 3° there are.*allowed: 0 to 2 deg"):
        apply(machine, "misalignment", 2.5, shaft="driven")


def test_a_ripple_has_its_order_and_part_of_the_torque() -> None:
    (ripple,) = apply(spur_pair_machine(), "torque_ripple", 5.0, order=2.0).drive.ripples
    assert (ripple.order, ripple.fraction) == (2.0, 0.05)
    with pytest.raises(InputError, match="order of torque_ripple"):
        apply(spur_pair_machine(), "torque_ripple", 5.0, order=0.0)


def test_a_swing_has_its_frequency_and_part_of_the_speed() -> None:
    (swing,) = apply(spur_pair_machine(), "speed_fluctuation", 3.0, frequency_hz=0.5).drive.swings
    assert (swing.frequency_hz, swing.fraction) == (0.5, 0.03)


def test_phases_are_drawn() -> None:
    phases = [apply(spur_pair_machine(), "torque_ripple", 5.0, seed).drive.ripples[0].phase_rad for seed in range(50)]
    assert 0.0 <= min(phases) < 1.0
    assert 5.28 < max(phases) <= 2 * np.pi


def test_backlash_is_the_whole_play() -> None:
    machine = replace(spur_pair_machine(), half_backlash_um=15.0)
    assert apply(machine, "backlash", 100.0).half_backlash_um == 65.0


def test_unbalance_joins_eccentricity_whatever_their_order() -> None:
    settings = [
        EffectSetting("eccentricity", 20.0, {"angle_deg": 10.0}),
        EffectSetting("unbalance", 40.0, {"angle_deg": 100.0}),
    ]
    mass = spur_pair_machine().wheels[0].mass_kg
    expected = rect(20.0 * mass, radians(10.0)) + rect(40.0, radians(100.0))
    for order in (settings, settings[::-1]):
        machine = with_effects(spur_pair_machine(), order, np.random.default_rng(0))
        assert unbalance(machine.wheels[0]) == pytest.approx(expected)
