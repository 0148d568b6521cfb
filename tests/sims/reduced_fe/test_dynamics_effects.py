"""Friction and rolling elements in the dynamics of the flexible pair."""

from dataclasses import replace

import numpy as np
import pytest

import sims
from gearsig.errors import InputError
from sims.gear_pair import DEFLECTIONS
from sims.machine import Operation, RaceDefect
from sims.reduced_fe import (
    TRANSMISSION_ERROR,
    bearing_springs,
    respond,
    start_state,
)
from tests.sims.reduced_fe.flexible_pairs import pair_of, synthetic_pair

RUN = Operation.steady(1000.0, 170.0)


def with_bearing(pair, row, **changes):
    bearings = list(pair.machine.bearings)
    bearings[row] = replace(bearings[row], **changes)
    return replace(pair, machine=replace(pair.machine, bearings=tuple(bearings)))


def settled(pair, signals, operation=RUN, duration_s=0.2):
    run = respond(pair, operation, duration_s=duration_s, signals=(*signals, "mesh_cycles"), stride=4)
    last = run["mesh_cycles"] > run["mesh_cycles"][-1] - 50.0  # one revolution
    return {name: run[name][last] for name in (*signals, "mesh_cycles")}


@pytest.fixture(scope="module")
def rubbed():
    pair = synthetic_pair(friction="on", viscosity_cp=17.6, roughness_um=0.84, roughness_locked_to="none")
    return settled(pair, ("mesh_force_n", "friction_n", "driver x acceleration", TRANSMISSION_ERROR))


def test_friction_turns_round_at_the_pitch_point_and_is_a_part_of_the_load(rubbed):
    part = rubbed["friction_n"] / rubbed["mesh_force_n"]
    assert part.max() > 0.01
    assert part.min() < -0.01
    assert np.abs(part).max() < 0.3
    assert abs(part.mean()) < 0.2 * np.abs(part).max()  # equal gears: as long before the pitch point as after


def test_friction_shakes_the_gears_across_the_line_of_action_and_loses_power(rubbed):
    plain = settled(synthetic_pair(), ("mesh_force_n", "driver x acceleration", TRANSMISSION_ERROR))
    assert np.std(rubbed["driver x acceleration"]) > 3.0 * np.std(plain["driver x acceleration"])
    # The load is set on the driven side: losses come on top of its force, 1 % or so of it at this friction.
    gain = rubbed["mesh_force_n"].mean() / plain["mesh_force_n"].mean() - 1.0
    assert abs(gain) < 0.03


@pytest.mark.slow
def test_more_friction_is_more_of_the_same():
    one, two = (
        settled(synthetic_pair(friction="on", friction_factor=f), ("friction_n",))["friction_n"] for f in (0.5, 1.0)
    )
    assert np.std(two) == pytest.approx(2.0 * np.std(one), rel=0.05)


def test_dry_friction_is_a_part_of_the_load_that_does_not_fade_towards_the_pitch_point():
    """±μ N of every pair; where two carry they are on either side of it, and only what one has more counts."""
    dry = {"friction": "on", "friction_factor": 0.0}
    one, two = (settled(pair_of(dry_friction=mu, **dry), ("mesh_force_n", "friction_n")) for mu in (0.1, 0.2))
    part = two["friction_n"] / two["mesh_force_n"]
    assert np.abs(part).max() < 0.2
    pitch_point = 0.877  # in mesh cycles, as the pair has it
    near = np.abs(two["mesh_cycles"] % 1.0 - pitch_point) < 0.05
    assert np.abs(part[near]).max() > 0.13
    assert np.std(two["friction_n"]) == pytest.approx(2.0 * np.std(one["friction_n"]), rel=0.1)


@pytest.mark.parametrize("bends", [0.0, 300.0])
def test_a_misaligned_coupling_shakes_its_bearing_twice_a_turn_by_torque_and_by_its_own_stiffness(bends):
    """β (T ⊕ K)/(2 L) on either bearing, the two a quarter of a period apart; a spring far below its resonance."""
    pair = synthetic_pair(bearing_stiffness_n_per_m=2e8, bending_stiffness_n_per_m=2e8)
    shaft = replace(pair.machine.shafts[0], coupling_angle_deg=1.0, coupling_bending_nm_per_rad=bends)
    pair = replace(pair, machine=replace(pair.machine, shafts=(shaft, pair.machine.shafts[1])))
    name = "bearing 1 x acceleration"
    run = settled(pair, (name,))
    turns = run["mesh_cycles"] / pair.machine.mesh.pair.driver.teeth
    window = np.hanning(len(turns)) / np.hanning(len(turns)).sum()
    line = 2.0 * abs(np.sum(window * run[name] * np.exp(-4j * np.pi * turns)))
    force = np.radians(1.0) * np.hypot(170.0, bends) / (2.0 * shaft.bearing_distance_m)
    assert line == pytest.approx((2.0 * 1000.0 * np.pi / 30.0) ** 2 * force / 2e8, rel=0.05)


def test_friction_is_against_the_sliding_before_and_after_the_pitch_point():
    """v_s = ω(ρ2 − ρ1): positive in approach, negative in recess; one pair in contact, a load too light for corners."""
    pair = synthetic_pair(friction="on")
    found = settled(pair, ("friction_n",), Operation.steady(300.0, 5.0), duration_s=0.4)
    cycles, teeth = found["mesh_cycles"] % 1.0, pair.machine.mesh.pair
    for low, high in ((0.82, 0.85), (0.91, 0.94)):
        here = (cycles > low) & (cycles < high)
        rho_1, rho_2 = teeth.contact_radii_mm(cycles[here])
        assert np.all(np.sign(found["friction_n"][here]) == np.sign(rho_2 - rho_1))


def test_a_spall_on_the_outer_race_knocks_as_often_as_elements_pass():
    pair = pair_of()
    bearing = pair.machine.bearings[0].bearing
    spoilt = with_bearing(pair, 0, defect=RaceDefect("outer", 1.0, 0.0, 0.0, 0.0))
    both = [settled(p, ("bearing 1 y",), duration_s=0.3)["bearing 1 y"] for p in (pair, spoilt)]
    change = both[1] - both[0]
    order = bearing.orders()["BPFO"]
    depth = pair.machine.bearings[0].stiffness_n_per_m
    assert 1e-3 < np.abs(change).max() * depth / (170.0 / 0.0705 / 2.0) < 1.0  # part of the bearing's load
    knocks = np.abs(change) > 0.5 * np.abs(change).max()
    begun = np.count_nonzero(knocks[1:] & ~knocks[:-1])
    assert abs(begun - order) <= 0.35 * order + 1.0


def test_a_loaded_bearing_with_clearance_is_soft_across_its_load():
    support = replace(pair_of().machine.bearings[0], clearance_um=10.0)
    load = np.array([300.0, -400.0])
    along, across = bearing_springs(support, load)
    np.testing.assert_allclose(along.direction, [0.6, -0.8])
    assert along.n_per_m == support.stiffness_n_per_m
    yielded = 500.0 / support.stiffness_n_per_m
    assert across.n_per_m == pytest.approx(support.stiffness_n_per_m * yielded / (yielded + 1e-5))
    assert along.direction @ across.direction == pytest.approx(0.0, abs=1e-15)


def test_the_shaft_sways_with_the_elements_in_a_bearing_with_clearance():
    pair = pair_of()
    loose = with_bearing(pair, 0, clearance_um=20.0)
    slow = Operation.steady(120.0, 170.0)
    sway = settled(loose, ("bearing 1 x", "bearing 1 y", *DEFLECTIONS[:2]), slow, duration_s=1.0)
    still = settled(pair, ("bearing 1 x", "bearing 1 y"), slow, duration_s=1.0)
    wide = [np.ptp(run["bearing 1 x"]) + np.ptp(run["bearing 1 y"]) for run in (sway, still)]
    assert wide[0] > 10.0 * wide[1]
    assert wide[0] < 4e-5
    # It follows them under a load that stays: hardly any of that motion is a force on the housing.
    assert max(np.ptp(sway[name]) for name in DEFLECTIONS[:2]) < 0.02 * wide[0]


def test_a_shaft_that_would_lift_in_its_bearing_is_refused():
    loose = with_bearing(pair_of(), 0, clearance_um=20.0)
    with pytest.raises(InputError, match="the shaft would lift in it"):
        respond(loose, Operation.steady(1000.0, 0.0), duration_s=0.01)
    with pytest.raises(InputError, match="would lift"):
        sims.simulate("reduced-fe", effects={"bearing_clearance": 30.0}, torque_nm=0.0, duration_s=0.1)


def test_starts_from_rest_have_friction_without_chatter():
    pair = synthetic_pair(friction="on")
    from sims.reduced_fe import constants

    standing = Operation.steady(0.0, 170.0)
    own = constants(pair, standing)
    first = start_state(pair, own, standing, 0.0)
    run = respond(pair, standing, duration_s=0.05, signals=("friction_n", "driver x velocity"), first=first, ready=own)
    late = slice(len(run["friction_n"]) // 2, None)
    assert np.ptp(run["friction_n"][late]) < 0.05 * 170.0 / 0.0705
