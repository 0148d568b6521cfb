"""The quasi-static simulator of the population: contact by closed forms, a structure's answer, effects that show."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.studies.gap.quasi_static import (
    EFFECTS,
    MESH,
    N_PAIRS,
    Path,
    QuasiStaticDay,
    StaticMachine,
    Structure,
    crack_lever,
    record,
    sinking_m,
    static_contact,
)
from gearsig.gap import reduce_recording
from sims.effects import textbook
from sims.mesh import (
    STEEL,
    GearGeometry,
    PairGeometry,
    RootCrack,
    corner_separation_m,
    cracked_tooth_compliance,
    deepest_crack_mm,
    tooth_compliance,
)


@given(st.integers(0, 10**6))
def test_pairs_carry_the_load_and_none_pulls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, gaps = rng.uniform(1e7, 1e9, (N_PAIRS, 5)), rng.normal(0.0, 1e-5, (N_PAIRS, 5))
    load = rng.uniform(1.0, 1e5, 5)
    error, carried = static_contact(k, gaps, load)
    assert carried.sum(axis=0) == pytest.approx(load, rel=1e-9)
    assert np.all(carried >= 0.0)
    assert carried == pytest.approx(k * np.maximum(error - gaps, 0.0))


def test_the_path_of_contact_is_that_of_the_textbook() -> None:
    """z = 20/40, module 1, 20°: contact ratio 1.64 (any textbook's formula for standard teeth)."""
    path = Path.of((20, 40), 1.0, 20.0)
    assert path.ratio == pytest.approx(1.635, abs=0.005)
    assert path.base_pitch_m == pytest.approx(2.952e-3, rel=1e-3)
    assert 0.0 < path.pitch_point < path.ratio


def test_a_structure_follows_slow_motion_and_rings_at_its_modes() -> None:
    one = Structure(np.array([1000.0]), np.array([0.01]), np.array([[[1.0, 0.0]] * 5]))
    slow, ringing = (abs(one.accelerations(0, np.array([f]), MESH)[0]) / (2 * np.pi * f) ** 2 for f in (10.0, 1000.0))
    assert slow == pytest.approx(1.0, rel=1e-3)
    assert ringing == pytest.approx(50.0, rel=1e-3)


@pytest.mark.parametrize("side", [0, 1])
def test_a_mate_sinks_past_an_edge_as_past_the_corner_of_a_whole_tooth(side: int) -> None:
    """Against the exact corner of a tooth that a chip has made shorter, up to a quarter of a pitch beyond it."""
    made = machine()
    pair = PairGeometry(*(GearGeometry(z, made.nominal.module_mm) for z in made.drawn.teeth))
    lost, place = 0.7 * made.nominal.module_mm, made.path.places
    gear = (pair.driver, pair.driven)[side]
    edge_mm = np.sqrt((gear.tip_radius_mm - lost) ** 2 - gear.base_radius_mm**2)
    at_edge_mm = edge_mm if side == 0 else pair.action_length_mm - edge_mm
    beyond = (1 if side == 0 else -1) * (place - (at_edge_mm - pair.start_radius_mm) / pair.base_pitch_mm)
    exact = corner_separation_m(pair, place, (lost, 0.0) if side == 0 else (0.0, lost))
    near = (beyond > 0.05) & (beyond < 0.25)
    assert sinking_m(made, side, np.maximum(beyond, 0.0))[near] == pytest.approx(exact[near], rel=0.2)


@pytest.mark.parametrize("side", [0, 1])
def test_a_crack_gives_way_as_that_of_a_beam(side: int) -> None:
    """At the pitch point over the tip, within the span of what is drawn."""
    made = machine()
    gear = GearGeometry(made.drawn.teeth[side], made.nominal.module_mm, face_width_mm=20.0)
    tip, pitch_point = gear.tip_roll_rad, np.tan(gear.pressure_angle_rad)
    crack, roll = RootCrack(0.4 * deepest_crack_mm(gear)), np.array([pitch_point, tip])
    added = cracked_tooth_compliance(gear, STEEL, roll, crack, 0.02) - tooth_compliance(gear, STEEL, roll).total / 0.02
    place = np.argmin(np.abs(made.path.places - made.path.pitch_point))
    shapes = [crack_lever(made, side, hinge)[place] ** 2 for hinge in (0.9, 1.5)]
    assert shapes[0] - 0.05 < added[0] / added[1] < shapes[1] + 0.05


def test_a_tooth_that_stays_bent_stands_back_from_its_load() -> None:
    made = machine()
    for seed in range(20):
        state, healthy = made.healthy(), made.healthy()
        EFFECTS["root_crack"](made, state, np.random.default_rng(seed))
        assert all(np.all(now >= before) for now, before in zip(state.gaps_m, healthy.gaps_m, strict=True))


def machine(seed: int = 3) -> StaticMachine:
    return StaticMachine.of(np.random.default_rng(seed))


def test_a_recording_ends_without_the_blow_of_a_slow_motion_that_is_cut_off() -> None:
    made = machine()
    state = made.healthy()
    state.runout_m.append((0, 1.0, 60.0 * made.rated_m, 0.3))
    samples = np.abs(record(made, state, QuasiStaticDay.drawn(np.random.default_rng(1)), None).samples[:-1])
    assert np.all(samples[:, -100:].max(axis=1) < 1.5 * samples[:, :-100].max(axis=1))


def test_the_same_day_is_the_same_recording_and_the_teeth_keep_their_mark() -> None:
    made, day = machine(), QuasiStaticDay.drawn(np.random.default_rng(1))
    one, again = (record(made, made.healthy(), day, None) for _ in range(2))
    assert np.array_equal(one.samples, again.samples)
    crest = reduce_recording(one, made.rig)
    assert crest.n_revolutions > 15


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_changes_what_is_recorded(name: str) -> None:
    made, day = machine(), QuasiStaticDay.drawn(np.random.default_rng(1))
    state = made.healthy()
    EFFECTS[name](made, state, np.random.default_rng(2))
    healthy, faulty = record(made, made.healthy(), day, None).samples, record(made, state, day, None).samples
    assert np.all(np.isfinite(faulty))
    assert np.std(faulty[:-1] - healthy[:-1]) > 1e-3 * np.std(healthy[:-1])


def test_a_changed_path_is_heard_on_its_channel() -> None:
    made, day = machine(), QuasiStaticDay.drawn(np.random.default_rng(1))
    state = made.healthy()
    state.paths = [textbook.PathChange(gain=2.0), textbook.PathChange()]
    before, after = record(made, made.healthy(), day, None).samples, record(made, state, day, None).samples
    assert after[0] == pytest.approx(2.0 * before[0], abs=1e-9 * float(np.abs(before[0]).max()))
    assert after[1:] == pytest.approx(before[1:], abs=1e-9 * float(np.abs(before[1]).max()))


def test_friction_is_louder_the_less_the_gears_can_yield() -> None:
    made = [machine(seed) for seed in range(200)]
    assert 1.0 <= min(m.directness for m in made) < 1.2
    assert 8.0 < max(m.directness for m in made) <= 10.0
