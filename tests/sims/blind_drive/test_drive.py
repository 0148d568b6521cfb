"""The blind forging drive: balances, convergence, and that each thing that can be wrong does what its name says."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gearsig.motion import measure_motion
from sims.blind_drive import (
    CATALOGUE,
    GEARS,
    N_STATES,
    OUTSIDE,
    BlindDrive,
    Chain,
    build,
    changed,
    draw_case,
    draw_drawing,
    label_of,
    march,
    record_case,
    run,
)

CLEAN = Chain(2**26, 8, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@cache
def machine(**numbers: float) -> BlindDrive:
    rng = np.random.default_rng(5)
    made = build(rng, draw_drawing(rng, "development"))
    return replace(made, numbers={**made.numbers, "blow": 0.0, **numbers})


def recorded(made: BlindDrive, duration_s: float = 2.0):
    return run(made, CLEAN, duration_s, np.random.default_rng(1))


def test_gears_are_in_one_role_only():
    every = [pair for pairs in GEARS.values() for pair in pairs]
    assert len(set(every)) == len(every)


@pytest.mark.parametrize("name", CATALOGUE | OUTSIDE)
def test_one_compiled_kernel_runs_them_all(name: str):
    """Two processes that compile two kernels at once can keep one under the other's name."""
    healthy = machine()
    assert changed(healthy, name, 1.0, np.random.default_rng(1))[0].record().dtype == healthy.record().dtype


def test_torque_less_friction_accelerates_the_inertias():
    """After the start: τ r2/r1 = J2 α2 + load, with frictionless flanks."""
    made = machine(mu=0.0, off_centre=0.0, run_out=0.0)
    n, m = made.numbers, measure_motion(recorded(made))
    rows = slice(300, int(800 * made.drawing.on_s))
    torque = np.mean(m.torque_nm[rows] - n["j_pinion"] * m.driver_acceleration_rad_s2[rows]) * n["rb2"] / n["rb1"]
    whole = n["j_wheel"] + n["j_load"]
    load = n["load_level"] + n["load_viscous"] * np.mean(m.driven_speed_rad_s[rows])
    assert torque == pytest.approx(whole * np.mean(m.driven_acceleration_rad_s2[rows]) + load, rel=0.02)


def test_half_the_step_changes_the_motion_little():
    made = machine()
    found = []
    for step in (5e-5, 2.5e-5):
        y = np.zeros(N_STATES)
        found.append(march(made.record(), y, *made.errors, 600, 1e-3, step))
    angle, speed = np.max(np.abs(found[0] - found[1])[:, :2], axis=0) / np.std(found[0][:, :2], axis=0)
    assert angle < 1e-4
    assert speed < 5e-3


def test_flanks_lie_a_play_apart():
    """Between driving and braking, the compression changes by the play and what both flanks yield."""
    healthy, wide = machine(), changed(machine(), "backlash", 200.0, np.random.default_rng(1))[0]
    spans = []
    for made in (healthy, wide):
        q = 1e6 * measure_motion(recorded(made)).compression_m
        spans.append(np.quantile(q, 0.9) - np.quantile(q, 0.02))
    assert spans[1] - spans[0] == pytest.approx(200.0, rel=0.1)
    assert spans[0] > 2e6 * healthy.numbers["half_play"]


@pytest.mark.parametrize("name", [*CATALOGUE, *OUTSIDE])
def test_everything_that_can_be_wrong_shows(name):
    healthy = machine()
    made, _ = changed(healthy, name, (CATALOGUE | OUTSIDE)[name].high, np.random.default_rng(2))
    ours, theirs = recorded(made).samples, recorded(healthy).samples
    assert np.max(np.abs(ours[:3] - theirs[:3]) / np.std(theirs[:3], axis=1)[:, None]) > 1e-4


def test_a_recording_says_nothing_of_what_is_wrong():
    case = draw_case(np.random.default_rng(3), "development", kind="single", effect="root_crack", level=0.9)
    made = record_case(case)
    assert not made.recording.truth
    assert made.reference is not None
    assert made.recording.rig is not None
    assert made.recording.rig.contact.half_backlash_um == case.machine.drawing.half_backlash_um
    assert label_of(case)["place"]["tooth"] <= case.machine.drawing.z1
