"""Poincaré sections, locked and geometric, and the diagrams made of them."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.errors import InputError, RefusalError
from gearsig.phase import (
    BifurcationDiagram,
    CycleLock,
    PhasePortrait,
    PoincareSection,
    TwoMotions,
    bifurcation_diagram,
    coexistence_ranges,
    coexistence_values,
    constant_period_lock,
    find_lock,
    phase_plane,
    poincare_section,
    section_period,
)
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, GearPair, Rig, Shaft
from tests.phase.systems import DUFFING_PERIOD_S, duffing, logistic

PER_PERIOD = 64
DUFFING_RATE = PER_PERIOD / DUFFING_PERIOD_S
RIG = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("stage", "in", "out", 20, 41),))


def _states(points, rate, start_s=0.0):
    names = tuple("xyz"[: points.shape[1]])
    return PhasePortrait(points, rate, names, ("",) * len(names), "states", "model", start_s)


def _duffing_section(force, n_periods=200):
    path = _states(duffing(force, n_periods, PER_PERIOD), DUFFING_RATE)
    return poincare_section(path, constant_period_lock(DUFFING_PERIOD_S, path.end_s, "forcing period"))


# Forces of the textbook cascade of this oscillator: periods 1, 2, 4, 5, and chaos.
@pytest.mark.parametrize(("force", "period"), [(0.20, 1), (0.28, 2), (0.29, 4), (0.37, 5), (0.50, 0)])
def test_period_of_a_forced_oscillator(force, period):
    section = _duffing_section(force)
    assert section_period(section) == period
    if period:
        branches = {tuple(np.round(point, 4)) for point in section.points}
        assert len(branches) == period


def test_locked_points_are_the_states_at_whole_periods():
    section = _duffing_section(0.5, 40)
    path = duffing(0.5, 40, PER_PERIOD)
    cycle = np.round(section.times_s / DUFFING_PERIOD_S).astype(int)
    np.testing.assert_allclose(section.times_s, cycle * DUFFING_PERIOD_S, rtol=1e-12)
    np.testing.assert_allclose(section.points, path[cycle * PER_PERIOD], atol=1e-4)
    assert np.all(np.diff(cycle) == 1)


def test_two_frequencies_give_an_ellipse_from_acceleration_alone():
    rate, f1, f2 = 5000.0, 100.0, 100.0 * np.sqrt(2.0) / 3.0
    t = np.arange(40_001) / rate
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    acceleration = -(w1**2) * np.cos(w1 * t) - 0.5 * w2**2 * np.cos(w2 * t)
    plane = phase_plane(acceleration, rate, quantity="acceleration", low_cut_hz=15.0)
    section = poincare_section(plane, constant_period_lock(1.0 / f1, t[-1]))
    radius = np.hypot((section.points[:, 0] - 1.0) / 0.5, section.points[:, 1] / (0.5 * w2))
    np.testing.assert_allclose(radius, 1.0, atol=1e-3)
    assert section_period(section) == 0


def _run_up(n=20_001, rate=10_000.0):
    """A shaft from 5 to 25 rev/s with exact angle; displacement repeats once per mesh cycle of 20 teeth."""
    t = np.arange(n) / rate
    end = t[-1]
    knots = np.linspace(0.0, end, 21)
    acceleration = 20.0 / end
    angle = ShaftAngle("in", knots, 5 * knots + acceleration / 2 * knots**2, 5 + acceleration * knots, "pulses")
    theta = 5 * t + acceleration / 2 * t**2
    x = np.cos(2 * np.pi * 20 * theta) + 0.3 * np.cos(2 * np.pi * 40 * theta + 1.0)
    return Recording(x[None, :], rate, (Channel("d", "displacement", "m"),), rig=RIG), angle


def test_a_mesh_cycle_stays_one_point_while_the_speed_changes():
    recording, angle = _run_up()
    lock = find_lock(recording, pair="stage", angle=angle)
    assert (lock.cycles_per_revolution, lock.name) == (20.0, "mesh of stage")
    section = poincare_section(phase_plane(recording, "d"), lock, phase_cycles=0.0)
    np.testing.assert_allclose(section.points[:, 0], 1.0 + 0.3 * np.cos(1.0), atol=2e-5)
    cycles = 20 * angle.revolutions_at(section.times_s)
    np.testing.assert_allclose(cycles, np.round(cycles), atol=1e-7)
    quarter = poincare_section(phase_plane(recording, "d"), lock, phase_cycles=0.25)
    np.testing.assert_allclose(quarter.points[:, 0], 0.3 * np.cos(np.pi + 1.0), atol=2e-5)


def test_lock_to_shafts_counts_their_revolutions():
    recording, angle = _run_up()
    assert find_lock(recording, angle=angle).cycles_per_revolution == 1.0
    assert find_lock(recording, shaft="out", angle=angle).cycles_per_revolution == pytest.approx(20 / 41)
    n = len(find_lock(recording, shaft="out", angle=angle).times_s(0.0, 2.0))
    assert n == int(30 * 20 / 41) + 1


def test_no_section_without_a_period():
    x = np.random.default_rng(0).normal(size=(1, 4000))
    bare = Recording(x, 1000.0, (Channel("a", "acceleration", "m/s^2"),))
    with pytest.raises(RefusalError, match="no speed source"):
        find_lock(bare)
    with pytest.raises(InputError, match="has no rig"):
        find_lock(bare, pair="stage")
    with pytest.raises(InputError, match="one of them"):
        find_lock(bare, pair="stage", shaft="in", rig=RIG)
    with pytest.raises(InputError, match="did you mean stage"):
        find_lock(bare, pair="stag", rig=RIG)
    toothless = Rig(shafts=RIG.shafts, pairs=(GearPair("stage", "in", "out"),), speed=ConstantSpeed(600.0, "in"))
    with pytest.raises(RefusalError, match="period of the mesh of stage is not known"):
        find_lock(bare, pair="stage", rig=toothless)


def test_section_refuses_cycles_it_cannot_resolve_or_hold():
    path = _states(np.random.default_rng(0).normal(size=(2000, 2)), 1000.0)
    with pytest.raises(RefusalError, match="faster than two samples"):
        poincare_section(path, constant_period_lock(1e-3, 2.0))
    with pytest.raises(RefusalError, match="no whole cycle"):
        poincare_section(path, CycleLock(constant_period_lock(1.0, 2.0).angle, 0.1, "slow"), phase_cycles=0.5)
    with pytest.raises(RefusalError, match="angle is known from"):
        poincare_section(_states(path.points, 1000.0, 10.0), constant_period_lock(0.1, 2.0))
    with pytest.raises(InputError, match="the portrait has 20 points"):
        poincare_section(_states(path.points[:20], 1000.0), constant_period_lock(0.01, 2.0))


@pytest.mark.parametrize("direction", [1, -1, 0])
def test_geometric_section_of_a_circle_is_of_fourth_order(direction):
    errors = []
    for rate in (50.0, 100.0):
        t = 2 * np.pi * 1.0137 * np.arange(int(40 * rate)) / rate  # crossings anywhere between the samples
        circle = _states(np.column_stack([np.cos(t), np.sin(t)]), rate)
        section = poincare_section(circle, normal=np.array([0.0, 1.0]), offset=0.5, direction=direction)
        assert section.n_points == pytest.approx(81 if direction == 0 else 40.5, abs=1)
        np.testing.assert_allclose(section.points[:, 1], 0.5, atol=1e-12)
        errors.append(np.abs(np.abs(section.points[:, 0]) - np.sqrt(0.75)).max())
        if direction:
            assert np.all(np.sign(section.points[:, 0]) == direction)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)


def test_geometric_section_says_where_the_path_lies():
    t = np.linspace(0, 10, 500)
    circle = _states(np.column_stack([np.cos(t), np.sin(t)]), 50.0)
    with pytest.raises(RefusalError, match=r"runs from -1 to 1"):
        poincare_section(circle, offset=2.0)
    with pytest.raises(InputError, match="2 numbers"):
        poincare_section(circle, normal=np.zeros(2))
    with pytest.raises(InputError, match="direction"):
        poincare_section(circle, direction=2)


def _map_section(x):
    return PoincareSection(
        x[:, None], np.arange(len(x)), ("x",), ("",), np.array([0.2]), "locked", "iteration of map", "logistic"
    )


def test_bifurcations_of_the_logistic_map():
    values = (3.5, 2.8, 3.2, 3.55, 3.9, 3.835)  # periods 4, 1, 2, 8, none, 3 (the window)
    diagram = bifurcation_diagram(
        ((r, _map_section(logistic(300, r))) for r in values), parameter="r", max_points=100, tolerance=1e-3
    )
    assert diagram.values.tolist() == sorted(values)
    assert diagram.periods == (1, 2, 4, 8, 3, 0)
    fixed_point = diagram.points[diagram.parameter == 2.8]
    np.testing.assert_allclose(fixed_point, 1 - 1 / 2.8, atol=1e-12)
    assert len(diagram.points) == 600


def test_bifurcations_of_the_forced_oscillator():
    def section(force):
        start_s, end_s = 5 * DUFFING_PERIOD_S, 60 * DUFFING_PERIOD_S
        path = _states(duffing(force, 60, PER_PERIOD), DUFFING_RATE).between(start_s, end_s)
        return poincare_section(path, constant_period_lock(DUFFING_PERIOD_S, path.end_s))

    diagram = bifurcation_diagram(((force, section(force)) for force in (0.28, 0.2, 0.29)), parameter="force")
    assert diagram.values.tolist() == [0.2, 0.28, 0.29]
    assert diagram.periods == (1, 2, 4)


@pytest.mark.slow
def test_branches_that_go_on_from_their_last_state_show_hysteresis():
    """The forced oscillator with a bow-shaped resonance curve: two motions at one frequency, by the way there."""
    state = {}

    def run(frequency, branch):
        steps, w = 400, 2 * np.pi * frequency
        h = 1.0 / frequency / steps
        path, (x, v) = np.empty((60 * steps, 2)), state.get(branch, (0.0, 0.0))
        for i in range(60 * steps):  # x'' + 0.1 x' + x + x³ = 0.4 cos ωt, by the symplectic Euler method
            path[i] = x, v
            v += h * (0.4 * np.cos(w * i * h) - 0.1 * v - x - x**3)
            x += h * v
        state[branch] = (x, v)
        return path[35 * steps :: 5]

    values = tuple(np.arange(16, 36, 2) / 100.0)
    sizes = {}
    for branch in ("up", "down"):
        for f in values if branch == "up" else values[::-1]:
            sizes[branch, f] = float(np.std(run(f, branch)[:, 0]))
    up, down = (
        BifurcationDiagram(np.array(values), s, "f", "Hz", "x", "m", np.array(values), (1,) * 10, "period", s)
        for s in (np.array([sizes[branch, f] for f in values]) for branch in ("up", "down"))
    )
    apart = coexistence_values(up, down)
    # One harmonic: the small motion exists where (ω² - 1)³ > 27/4 · 3/4 F², the large one up to ω² = 1 + 3/4 (F/cω)².
    lowest, highest = np.sqrt(1.0 + (81.0 / 16.0 * 0.4**2) ** (1.0 / 3.0)) / (2 * np.pi), 2.0 / (2 * np.pi)
    assert len(apart) >= 2
    assert lowest - 0.01 < apart.min() <= apart.max() < highest + 0.01
    assert all(sizes["up", f] > 2.0 * sizes["down", f] for f in apart)  # a hardening spring


def test_apart_needs_two_diagrams_of_the_same_with_extents():
    diagram = bifurcation_diagram([(1.0, _map_section(np.ones(9)))], parameter="r")
    assert diagram.extents.tolist() == [0.2]
    assert coexistence_values(diagram, diagram).tolist() == []
    with pytest.raises(InputError, match="without extents"):
        coexistence_values(diagram, replace(diagram, extents=np.empty(0)))
    with pytest.raises(InputError, match="diagrams of x and y"):
        coexistence_values(diagram, replace(diagram, axis_name="y"))


def _branch(values, sizes):
    return BifurcationDiagram(values, sizes, "speed", "rpm", "x", "m", values, (1,) * len(values), "mesh cycle", sizes)


def test_ranges_of_two_motions_end_half_a_step_from_where_they_are_seen():
    values = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 14.0, 15.0])
    one = _branch(values, np.ones(7))
    first, second, last = coexistence_ranges(one, _branch(values, np.array([3.0, 1.0, 3.0, 1.0, 3.0, 1.0, 3.0])))[:3]
    assert first == TwoMotions(0.0, 0.0, 0.0, 0.5, True, False)
    assert second == TwoMotions(2.0, 2.0, 1.5, 2.5, False, False)
    assert last == TwoMotions(4.0, 4.0, 3.5, 4.5, False, False)  # not half way over the gap to 14
    whole = coexistence_ranges(one, _branch(values, np.full(7, 3.0)))
    assert whole == (TwoMotions(0.0, 15.0, 0.0, 15.0, True, True),)
    assert coexistence_ranges(one, one) == ()
    single = _branch(values[:1], np.ones(1)), _branch(values[:1], np.full(1, 3.0))
    assert coexistence_ranges(*single) == (TwoMotions(0.0, 0.0, 0.0, 0.0, True, True),)


def test_bifurcation_over_load_of_recorded_acceleration():
    def section(half):
        t = np.arange(8000) / 2000.0
        w = 2 * np.pi * 50.0
        x = -(w**2) * np.cos(w * t) - half * (w / 2) ** 2 * np.cos(w / 2 * t + 0.5)
        rig = Rig(shafts=(Shaft("s"),), speed=ConstantSpeed(3000.0, "s"))
        recording = Recording(x[None, :], 2000.0, (Channel("a", "acceleration", "m/s^2"),), rig=rig)
        return poincare_section(phase_plane(recording, "a", low_cut_hz=12.0), find_lock(recording))

    diagram = bifurcation_diagram([(100.0, section(0.0)), (50.0, section(0.4))], parameter="load", unit="N·m")
    assert diagram.values.tolist() == [50.0, 100.0]
    assert diagram.periods == (2, 1)
    assert (diagram.axis_name, diagram.unit, diagram.section) == ("displacement", "m", "revolution")


def test_a_diagram_of_nothing_or_of_unlike_sections_is_refused():
    with pytest.raises(InputError, match="no sections"):
        bifurcation_diagram([], parameter="r")
    other = PoincareSection(np.ones((9, 1)), np.arange(9), ("v",), ("m",), np.ones(1), "locked", "s", "model")
    with pytest.raises(InputError, match="differ in their axes"):
        bifurcation_diagram([(1.0, _map_section(np.ones(9))), (2.0, other)], parameter="r")
    with pytest.raises(InputError, match="axis is 3"):
        bifurcation_diagram([(1.0, _map_section(np.ones(9)))], parameter="r", axis=3)


def test_a_motion_that_nearly_closes_is_not_called_periodic():
    """√2/1.1 is 9/7 within 7e-5: after seven cycles the section is back but for a creep."""
    t = np.arange(30_000) / 1000.0
    w = 2 * np.pi * 20.0
    x = np.sin(w * t) + 0.6 * np.sin(np.sqrt(2.0) / 1.1 * w * t)
    plane = phase_plane(x, 1000.0, quantity="displacement")
    assert section_period(poincare_section(plane, constant_period_lock(0.05, 30.0))) == 0
    closed = phase_plane(np.sin(w * t) + 0.6 * np.sin(9 / 7 * w * t), 1000.0, quantity="displacement")
    assert section_period(poincare_section(closed, constant_period_lock(0.05, 30.0))) == 7
