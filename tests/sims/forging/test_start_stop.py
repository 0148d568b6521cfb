"""The drive at work: start, stop, back-impact, press, stick and slip, the energy balance of all of it."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.forging import Cycle, DriveResponse, respond, schedule
from sims.machine import Profile
from tests.sims.forging.drives import drive, driven_by, largest

CYCLE = Cycle(brake_nm=60.0, press_nm=1500.0)


def run(
    duration_s: float = 3.0, cycle: Cycle = CYCLE, interval_s: float = 1e-3, tolerance: float = 1e-6
) -> DriveResponse:
    profiles = schedule(cycle, Profile.constant(95.0), duration_s)
    return respond(drive(), profiles, duration_s=duration_s, interval_s=interval_s, tolerance=tolerance)


def back_impact(found: DriveResponse, after_s: float) -> np.ndarray:
    return found.contacts[(found.contact("flank") < 0.0) & (found.contact("start_s") > after_s)][0]


def test_energy_balance_of_a_whole_cycle() -> None:
    """Kinetic and stored energy = work put in − lost in contact − lost in friction, through starts, stops, a blow."""
    found = run()
    balance = found["energy"] - found["work put in"] + found["lost in contact"] + found["lost in friction"]
    assert found["work put in"].max() > 400.0
    assert largest(balance) < 1e-4
    # flanks push, never pull: forwards on the drive flank, backwards on the back flank
    assert np.all(found["interaction force"] * np.sign(found["compression"]) >= 0.0)
    assert np.all(np.diff(found["lost in contact"]) >= -1e-9)


def test_the_wheel_strikes_back_after_the_torque_is_removed() -> None:
    """The pinion is braked, the heavy wheel runs on and meets the back flank, after the play at their rates."""
    found = run()
    assert found["interaction force"][900] > 500.0
    struck = back_impact(found, 1.0)
    parted = found.contact("end_s")[found.contact("start_s") < 1.0][-1]
    assert 1.0 < parted < struck[0] < 1.1
    assert found["interaction force"].min() < -1000.0
    # Between parting and striking nothing but friction and brake acts: the play is what their motion adds up to.
    fine = run(1.5, replace(CYCLE, off_s=1.2, press_nm=0.0), interval_s=2e-5)
    parted = fine.contact("end_s")[fine.contact("start_s") < 1.0][-1]
    struck_s = back_impact(fine, 1.0)[0]
    flight = (fine.time_s >= parted) & (fine.time_s <= struck_s)
    play = np.trapezoid(-fine["compression rate"][flight], fine.time_s[flight])
    assert play == pytest.approx(300e-6, rel=5e-3)


def test_time_and_energy_of_the_back_impact_converge() -> None:
    """Against a run of a hundred-thousandth of the tolerance; a tenth of it brings both nearer."""
    struck = [
        back_impact(run(1.5, replace(CYCLE, off_s=1.4, press_nm=0.0), tolerance=t), 1.0)
        for t in (1e-5, 1e-6, 1e-7, 1e-11)
    ]
    times = [abs(s[0] - struck[-1][0]) for s in struck[:-1]]
    energies = [abs(s[2] ** 2 / struck[-1][2] ** 2 - 1.0) for s in struck[:-1]]
    assert times[1] < 2e-6
    assert energies[1] < 1e-3
    assert times[2] < times[0]
    assert energies[2] < energies[0]


def test_it_stands_while_it_is_stopped_and_the_press_rattles_it() -> None:
    found = run()
    standing = (found.time_s > 1.6) & (found.time_s < 1.99)
    assert largest(found["wheel speed"][standing]) < 1e-3
    blow = (found.time_s > 2.0) & (found.time_s < 2.1)
    assert largest(found["wheel speed"][blow]) > 0.05
    assert np.any(found.contact("start_s")[(found.contact("start_s") > 2.0)] < 2.1)
    calm = run(cycle=replace(CYCLE, press_nm=0.0))
    assert largest(calm["wheel speed"][blow]) < 1e-3


@pytest.mark.parametrize("torque_nm", [60.0, 95.0])
def test_breakaway_torque_is_that_of_static_friction(torque_nm: float) -> None:
    """Slowly rising torque: all sticks (bristles bend a little) until static friction of both shafts is overcome."""
    made = drive(0.0, friction_coefficient=0.0, load_friction_nm=4.0 * torque_nm, press_nm=0.0, half_backlash_um=1.0)
    profiles = driven_by(0.0)
    slope = 0.2 * torque_nm  # N m per s
    profiles = replace(profiles, torque_nm=Profile.of([0.0, 8.0], [0.0, 8.0 * slope]))
    found = respond(made, profiles, duration_s=8.0)
    expected = 1.3 * (4.0 * torque_nm / 5.0 + 5.0)
    slips = found.time_s[np.argmax(found["wheel speed"] > 0.03)]
    assert slips * slope == pytest.approx(expected, rel=0.03)
    stuck = found.time_s < 0.9 * expected / slope
    assert largest(found["wheel angle"][stuck]) < 10.0 * 2e-4
    # Static friction gone: the load runs away with the difference to sliding friction.
    later = found["wheel speed"][int((slips + 0.1) * 1000)]
    assert later > 0.05 * 2.0


def test_held_by_friction_it_creeps_no_more_than_its_bristles_bend() -> None:
    made = drive(0.0)
    found = respond(made, driven_by(60.0), duration_s=5.0)  # 300 N m at the wheel, below 390 of static friction
    late = found.time_s > 1.0
    assert np.ptp(found["wheel angle"][late]) < 1e-4
    assert found["torque"][-1] == pytest.approx(found["interaction force"][-1] * made.path.base_radii_m[0], rel=0.02)


def test_without_a_brake_it_runs_down_by_its_own_friction() -> None:
    """ω̇ = −(T_c + c ω)/J at the wheel, with 25 times the pinion's inertia and drag, without friction of the teeth."""
    made = drive(0.0, friction_coefficient=0.0)
    cycle = Cycle(off_s=1.9, press_nm=0.0)
    found = respond(made, schedule(cycle, Profile.constant(95.0), 2.0), duration_s=2.0)
    inertia = 42.0 + 0.5 * 290.0 * 0.15**2 + 25.0 * 0.06
    level, viscous = 300.0 + 5.0 * 5.0, 20.0 + 25.0 * 0.2
    start = np.searchsorted(found.time_s, 1.1)
    span = found.time_s[start : start + 100] - found.time_s[start]
    speed = (found["wheel speed"][start] + level / viscous) * np.exp(-viscous / inertia * span) - level / viscous
    assert found["wheel speed"][start] > 1.0
    assert found["wheel speed"][start : start + 100] == pytest.approx(speed, abs=0.01)


def test_torque_sensor_feels_the_pinion_and_not_the_motor() -> None:
    """τ = rb1 F + J_p α1 where the teeth do not rub."""
    made = drive(friction_coefficient=0.0)
    found = respond(made, schedule(CYCLE, Profile.constant(95.0), 3.0), duration_s=3.0)
    turn = made.contact.driver_inertia_kg_m2 * found["pinion acceleration"]
    mesh = made.path.base_radii_m[0] * found["interaction force"]
    touching = found["interaction force"] != 0.0
    # what is left is the work of the pairs that come and go on the rotation
    single = touching & (np.abs(found["pairs in contact"] % 1.0) < 1e-12)
    assert found["torque"][single] == pytest.approx((turn + mesh)[single], abs=1e-6)
    assert largest((found["torque"] - turn - mesh)[touching]) < 0.02 * largest(mesh)


def test_friction_of_the_flanks_turns_round_at_the_pitch_point() -> None:
    """τ/rb1 against F is 1 ∓ μ tan α_k: within ±0.018 near the pitch point, not 1 + μ cot α = 1.137."""
    made = drive(mesh_ramp=0.01, flank_presliding_um=0.5, flank_static_ratio=1.0)
    found = respond(made, driven_by(95.0), duration_s=2.0, interval_s=1e-4)
    turn = made.contact.driver_inertia_kg_m2 * found["pinion acceleration"]
    mesh = made.path.base_radii_m[0] * found["interaction force"]
    place = found["pinion angle"] * 20.0 / (2.0 * np.pi) % 1.0 - made.path.pitch_point
    steady = (found.time_s > 1.5) & (found["pairs in contact"] == 1.0)
    share = np.where(steady, found["torque"] - turn, 1.0) / np.where(steady, mesh, 1.0)
    for side in (-1.0, 1.0):
        near = steady & (side * place > 0.03) & (side * place < 0.1)
        lever = made.path.driver_lever_m(made.path.pitch_point + place[near])
        assert np.count_nonzero(near) > 20
        assert share[near] == pytest.approx(1.0 + side * 0.05 * lever / made.path.base_radii_m[0], abs=5e-4)
        assert np.mean(share[near]) == pytest.approx(1.0 + side * 0.018, abs=1.5e-3)


def test_flanks_hold_more_than_they_slide_with() -> None:
    """Bristles of the flanks: μN in sliding, up to 1.2 μN where they slide slowly, as near the pitch point."""
    found = run(1.0, Cycle(mode="continuous"), interval_s=1e-4)
    loaded = (found["pairs in contact"] == 1.0) & (found["interaction force"] > 200.0)
    share = np.abs(found["tooth friction"][loaded]) / found["interaction force"][loaded]
    assert 1.1 * 0.05 < share.max() <= 1.2 * 0.05 * (1.0 + 1e-6)
    path = drive().path
    place = found["pinion angle"][loaded] * 20.0 / (2.0 * np.pi) % 1.0 - path.pitch_point
    sliding = (np.abs(place) > 0.1) & (found["pinion speed"][loaded] > 5.0)
    assert np.count_nonzero(sliding) > 20
    assert np.median(share[sliding]) == pytest.approx(0.05, abs=1e-3)


def test_wear_widens_the_play() -> None:
    assert drive(wear_um=100.0).contact.half_backlash_um == pytest.approx(200.0)


def test_a_piece_off_centre_swings() -> None:
    """Little friction: the piece hangs below in the end, whatever flank carries it."""
    made = drive(0.0, piece_offset_mm=50.0, piece_angle_deg=60.0, load_friction_nm=1.0, drag_nm=0.1,
                 load_viscous_nm_s_per_rad=40.0)  # fmt: skip
    found = respond(made, driven_by(0.0), duration_s=20.0, interval_s=1e-2)
    assert found["wheel angle"][-1] + np.radians(60.0) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"off_s": 5.0}, "longer than the record"),
        ({"press_delay_s": 3.0}, "press blow"),
        ({"on_s": -1.0}, "on_s"),
        ({"mode": "sometimes"}, "mode"),
        ({"rise_s": 1.5}, "rise_s"),
        ({"brake_delay_s": 1.99}, "brake_delay_s"),
    ],
)
def test_cycles_that_cannot_be(changes: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        schedule(replace(CYCLE, **changes), Profile.constant(95.0), 4.0)  # type: ignore[arg-type]  # as named
