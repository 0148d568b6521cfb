"""What the cycles of a start–stop recording tell: against what was simulated, and against changes put in by hand."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.gap.start_stop import (
    NAMES,
    PHASES,
    LocatedDriveChange,
    PreparedCycles,
    change_of,
    cut_cycles,
    prediction_errors,
    robust_least_squares,
    spot_of,
    thin,
)
from gearsig.motion import measure_motion
from sims import simulate

SHAPE = np.linspace(-1.0, 1.0, 20)
ONE_FLANK = {"brake_nm": 0.0, "drag_nm": 0.0}


@cache
def motion(effect: str = "", severity: float = 0.0, duration_s: float = 12.0, mode: str = "start-stop"):
    effects = {effect: severity} if effect else None
    made = simulate(
        "forging",
        effects=effects,
        parameters={"mode": mode},
        duration_s=duration_s,
        sampling_rate_hz=1000.0,
        seed=4,
    )
    return measure_motion(made)


@cache
def examined(effect: str = "", severity: float = 0.0) -> PreparedCycles:
    return cut_cycles(motion(effect, severity))


def told(one: PreparedCycles):
    return one.features()


def change(name: str, now: PreparedCycles, other: PreparedCycles, at: LocatedDriveChange | None = None) -> float:
    return float(change_of(told(now), told(other), SHAPE, at)[NAMES.index(name)])


def test_a_recording_has_its_cycles_and_phases():
    cycles = examined()
    assert cycles.n_cycles == 4
    assert cycles.halves == ((0, 2), (1, 3))
    running = cycles.motion.driver_speed_rad_s[cycles.phase == PHASES.index("run")]
    assert np.median(running) > 0.8 * np.max(cycles.motion.driver_speed_rad_s)


def test_knocks_of_the_back_flank_are_not_all_left_out_where_the_drive_flank_scatters_by_nanometres():
    rng = np.random.default_rng(0)
    drive = np.arange(400) < 360
    levels = np.where(drive, 150e-6, -150e-6) + np.where(drive, 1e-9, 5e-6) * rng.standard_normal(400)
    design, usable = np.stack([drive, ~drive], axis=1).astype(float), np.ones(400, dtype=bool)
    found, keep = robust_least_squares(design, levels, usable, (drive, ~drive))
    assert np.sum(keep & ~drive) > 30
    assert found == pytest.approx([150e-6, -150e-6], abs=3e-6)


def test_what_goes_on_turning_is_refused():
    with pytest.raises(RefusalError, match="turns all the time"):
        cut_cycles(motion(mode="continuous"))


def test_one_start_is_too_few():
    with pytest.raises(RefusalError, match="1 start"):
        cut_cycles(motion(duration_s=2.9))


def test_fast_recordings_are_thinned_to_instants():
    fast = replace(motion(), sampling_rate_hz=8000.0)
    assert np.array_equal(thin(fast).driver_angle_rad, fast.driver_angle_rad[::4])


def test_the_healthy_drive_tells_its_own_numbers():
    found = told(examined())
    assert found.play_um == pytest.approx(300.0, rel=0.01)
    assert found.inertia_kg_m2 == pytest.approx(45.2625, rel=0.01)
    assert found.friction_nm == pytest.approx(310.0, rel=0.05)
    assert found.deflection_um == pytest.approx((2020.0 / 1.8366e10) ** (2 / 3) * 1e6, rel=0.15)


def test_nothing_changes_against_itself():
    found = told(examined())
    assert np.nanmax(np.abs(change_of(found, found, SHAPE))) == 0.0


@pytest.mark.parametrize(
    ("effect", "severity", "name", "expected_db"),
    [("backlash", 120.0, "play", 20 * np.log10(420 / 300)), ("torque_ripple", 4.0, "ripple", 7.0)],
)
def test_an_effect_changes_what_it_should(effect, severity, name, expected_db):
    assert change(name, examined(effect, severity), examined()) == pytest.approx(expected_db, rel=0.15)


def test_the_order_of_a_ripple_is_found():
    now = examined("torque_ripple", 4.0)
    assert now.orders[spot_of(told(now), told(examined())).order] == 6


def test_a_tooth_that_gives_way_is_found_by_its_place():
    """3 µm more compression whenever tooth 8 carries."""
    healthy = examined()
    m = healthy.motion
    extra = np.where(healthy.flanks.tooth == 7, 3e-6, 0.0)
    moved = replace(m, driven_angle_rad=m.driven_angle_rad - extra / m.path.base_radii_m[1])
    now = replace(healthy, motion=moved)
    assert spot_of(told(now), told(healthy)).tooth == 7
    assert told(now).teeth_um[7] == pytest.approx(3.0, abs=0.4)
    elsewhere = replace(spot_of(told(now), told(healthy)), tooth=12)
    assert change("tooth", now, healthy) > change("tooth", now, healthy, elsewhere) + 6.0


def test_without_torque_the_play_is_told_and_the_load_is_not():
    now = replace(examined(), motion=replace(examined().motion, torque_nm=None))
    found = told(now)
    assert found.play_um == pytest.approx(300.0, rel=0.25)
    assert np.isnan(found.inertia_kg_m2)
    assert np.isnan(found.ripple).all()


def test_more_play_is_mispredicted_on_the_back_flank():
    errors = prediction_errors(examined("backlash", 120.0), told(examined()))
    assert errors["compression", "stop", "back"] == pytest.approx(120.0, rel=0.1)
    assert errors["compression", "run", "drive"] < 5.0
