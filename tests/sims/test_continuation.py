"""Runs that go on from a state, and the softening jump of gears that lose contact."""

from math import pi

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.continuation import DECAYS, Branch
from sims.cracked import CrackedPair, PairState, respond, slowest_decay_s
from sims.effects import EffectSetting
from sims.gear_pair import total_inertia_kg_m2
from sims.machine import Operation, Profile
from sims.simulator import SimulationSetup
from sims.sweep import Axis, Sweep

OPERATION = Operation.steady(1500.0, 40.0)
SMOOTH = {"roughness_um": 0.0, "friction": "off"}


def machine(**parameters):
    values = {**SMOOTH, **parameters}
    return (
        CrackedPair().prepare(SimulationSetup("small_30_25", values, (), OPERATION), np.random.default_rng(0)).machine
    )


def branch(name, values, preset="symmetric_50_50", torque_nm=20.0, effects=(), parameters=SMOOTH, **more):
    sweep = Sweep(
        "cracked",
        (Axis(name, tuple(values)),),
        preset=preset,
        parameters=dict(parameters),
        effects=effects,
        torque_nm=None if name == "torque_nm" else Profile.constant(torque_nm),
        common_seed=True,
    )
    return Branch(sweep, **more)


def run(given=None, duration_s=0.02, start_s=0.0):
    return respond(
        machine(),
        OPERATION,
        duration_s=duration_s,
        rng=np.random.default_rng(1),
        step_s=4e-6,
        first=given,
        start_s=start_s,
    )


def test_a_run_in_two_parts_is_the_run_in_one():
    whole, first = run(duration_s=0.04), run(duration_s=0.02)
    second = run(first.last, duration_s=0.02, start_s=0.02)
    for name in whole.signals:
        np.testing.assert_array_equal(second[name], whole[name][len(first[name]) :])
    np.testing.assert_array_equal(second.last.q, whole.last.q)


def test_a_state_is_not_changed_by_the_run_that_starts_from_it():
    state = run().last
    before = state.q.copy()
    run(state)
    np.testing.assert_array_equal(state.q, before)


def test_a_state_of_another_model_is_refused():
    with pytest.raises(InputError, match="a state of 3 coordinates"):
        run(PairState(np.zeros(3), np.zeros(3), 0.0))


def test_the_slowest_decay_is_the_drive_s_recovery_or_that_of_the_least_damped_mode():
    assert slowest_decay_s(machine(), OPERATION) == pytest.approx(0.06, rel=1e-6)
    slow = machine(governor_nm_s_per_rad=0.01)
    assert slowest_decay_s(slow, OPERATION) == pytest.approx(2.0 * total_inertia_kg_m2(slow) / 0.01)
    # A heavy output rotor on a soft, lightly damped shaft swings against everything else, which the drive holds.
    loose = machine(
        torsional_damping_nm_s_per_rad=0.02,
        torsional_stiffness_nm_per_rad=50.0,
        rotor_inertia_output_kg_m2=0.05,
        governor_nm_s_per_rad=1000.0,
    )
    assert slowest_decay_s(loose, OPERATION) > 1.0


@pytest.mark.slow
def test_the_softening_jump_of_a_lightly_loaded_pair():
    """Tooth separation softens the mesh: the resonance bends to lower speeds, and two motions exist below it.

    On the way up the teeth keep contact, on the way down they part. Under full load there is one motion only. So
    found by A. Kahraman and G. W. Blankenship on a rig of this kind.
    """
    light = branch("speed_rpm", (1840.0, 1880.0, 1920.0, 1960.0, 2000.0, 2040.0), n_cycles=40)
    sizes, apart = {}, {}
    for way in ("up", "down"):
        end = None
        for value in light.values[:: 1 if way == "up" else -1]:
            found = light.run(value, end)
            end = found.end
            sizes[way, value] = float(found.response["transmission_error_m"].std())
            apart[way, value] = found.separated_share
    for value in (1840.0, 1880.0, 1920.0):
        assert sizes["down", value] > 1.8 * sizes["up", value]
        assert apart["up", value] == 0.0
        assert apart["down", value] > 0.3
    for value in (2000.0, 2040.0):
        assert sizes["down", value] == pytest.approx(sizes["up", value], rel=0.02)
    loaded = branch("speed_rpm", (1840.0, 1920.0), torque_nm=300.0, n_cycles=40)
    down = loaded.run(1840.0, loaded.run(1920.0).end)
    up = loaded.run(1840.0)
    assert down.response["transmission_error_m"].std() == pytest.approx(
        up.response["transmission_error_m"].std(), rel=0.02
    )
    assert down.separated_share == 0.0


def test_what_is_kept_starts_at_zero_and_holds_the_cycles_asked_for():
    one = branch("half_backlash_um", (20.0,), n_cycles=30)
    found = one.run(20.0)
    turned = found.response["driver angle"] * 50 / (2 * pi)
    assert found.response.start_s == pytest.approx(0.0, abs=found.response.interval_s)
    assert 30.0 <= np.ptp(turned) <= 36.0
    assert found.settled_s == pytest.approx(DECAYS * 0.06, rel=1e-3)
    rate = np.gradient(found.response["transmission_error_m"], found.response.interval_s)
    np.testing.assert_allclose(rate[2:-2], found.rate_of_transmission_error_mps[2:-2], atol=0.03 * np.abs(rate).max())


def test_an_effect_may_be_varied_and_a_channel_looked_at():
    one = branch(
        "root_crack", (0.0, 2.0), signal="a1", section="shaft", n_cycles=4, effects=(EffectSetting("unbalance", 50.0),)
    )
    healthy, cracked = one.run(0.0), one.run(2.0)
    assert healthy.recording.channel_names[0] == "a1"
    assert cracked.recording.truth is not None
    assert not np.allclose(healthy.recording.values("a1"), cracked.recording.values("a1"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"section": "tooth"}, "section"),
        ({"n_cycles": 2}, "n_cycles"),
        ({"signal": "a7"}, r"no signal or channel 'a7'.*a1, a2"),
    ],
)
def test_what_cannot_be_run_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        branch("torque_nm", (10.0,), **change).check_signal()


def test_a_branch_needs_one_axis_and_steady_speed():
    axes = (Axis("speed_rpm", (500.0,)), Axis("torque_nm", (10.0,)))
    with pytest.raises(InputError, match="2 quantities are varied"):
        Branch(Sweep("cracked", axes))
    ramp = Profile.of((0.0, 1.0), (300.0, 900.0))
    with pytest.raises(InputError, match="speed_rpm changes with time"):
        Branch(Sweep("cracked", axes[1:], speed_rpm=ramp))
    with pytest.raises(InputError, match="a shaft at rest"):
        branch("speed_rpm", (0.0,)).run(0.0)
