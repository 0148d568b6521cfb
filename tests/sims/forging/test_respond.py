"""The forging drive's motion: friction, impacts, starts and stops, pairs of teeth."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gearsig.errors import InputError
from gearsig.rig import DAMPING_LAWS, ToothContact, damping_ratio_s_per_m, standard_path
from sims.forging import Cycle, DriveResponse, FirstState, Schedule, bristle, drive_numbers, respond, schedule
from sims.machine import Profile
from sims.mesh import GearGeometry, PairGeometry
from tests.sims.forging.drives import AT_REST, NOTHING, drive, driven_by, free_bodies, impact, largest


def test_a_mass_dragged_by_a_spring_sticks_and_slips_again_and_again() -> None:
    """The example of Canudas de Wit, Olsson, Åström and Lischinsky (1995), figure 4, with our bristle.

    1 kg on a spring of 2 N/m whose end moves at 0.1 m/s; friction 1 N sliding, 1.5 N static. The spring's force climbs
    with 0.2 N/s to 1.5 N, then falls while the mass slips.
    """
    stiffness, pull, sliding, static, stribeck, viscous, sigma = 2.0, 0.1, 1.0, 1.5, 1e-3, 0.4, 1e5
    time_s = np.sqrt(sigma) / sigma

    def rates(t: float, state: np.ndarray) -> list[float]:
        x, v, z = state
        share, rate = bristle(v, z, static / sliding, stribeck, sliding / sigma, time_s)
        return [v, stiffness * (pull * t - x) - sliding * share - viscous * v, rate]

    t = np.linspace(0.0, 80.0, 16_001)
    run = solve_ivp(rates, (0.0, 80.0), np.zeros(3), method="LSODA", t_eval=t, rtol=1e-6, atol=1e-9, max_step=0.02)
    spring = stiffness * (pull * t - run.y[0])
    slipping = run.y[1] > 0.02
    begins = np.flatnonzero(slipping[1:] & ~slipping[:-1])
    ends = np.flatnonzero(~slipping[1:] & slipping[:-1])
    assert len(begins) >= 8
    assert np.median(spring[begins]) == pytest.approx(static, rel=0.02)
    assert np.ptp(np.diff(t[begins][1:])) < 0.05
    slip_s, fall = slip_of_a_dragged_mass(stiffness, pull, sliding, static, viscous)
    assert np.median(t[ends] - t[begins][: len(ends)]) == pytest.approx(slip_s, rel=0.1)
    assert np.median(spring[begins][: len(ends)] - spring[ends]) == pytest.approx(fall, rel=0.05)
    assert np.median(np.diff(t[begins])) == pytest.approx(slip_s + fall / (stiffness * pull), rel=0.03)
    still = run.y[1][(t > t[ends[0]] + 0.3) & (t < t[begins[1]] - 0.3)]
    assert largest(still) < 1e-3


def slip_of_a_dragged_mass(k: float, pull: float, sliding: float, static: float, c: float) -> tuple[float, float]:
    """Duration of a slip of 1 kg and the fall of the spring's force, from ÿ + c ẏ + k y = F_c + c v for its length y.

    It begins and ends with ẏ = v, the mass at rest; static friction is gone at once.
    """
    middle, decay = (sliding + c * pull) / k, 0.5 * c
    w = np.sqrt(k - decay**2)
    a = static / k - middle
    b = (pull + decay * a) / w

    def length(t: float) -> float:
        return middle + float(np.exp(-decay * t) * (a * np.cos(w * t) + b * np.sin(w * t)))

    def speed(t: float) -> float:
        turn = (w * b - decay * a) * np.cos(w * t) - (w * a + decay * b) * np.sin(w * t)
        return float(np.exp(-decay * t) * turn) - pull

    end = float(brentq(speed, 0.5 * np.pi / w, 1.5 * np.pi / w))
    return end, static - k * length(end)


def test_the_drive_sticks_and_breaks_away_at_the_same_torque_each_time() -> None:
    """Five slow rises of the torque, each taken away once the load runs: five rests, five breakaways."""
    made = drive(0.0, friction_coefficient=0.0, half_backlash_um=1.0)
    expected = 1.3 * (300.0 / 5.0 + 5.0)
    slope, top, period = 60.0, 1.1 * expected, 4.0
    rise = top / slope
    corners = [(0.0, 0.0), (rise, top), (rise + 0.02, 0.0), (period - 0.01, 0.0)]
    times = np.concatenate([[k * period + t for t, _ in corners] for k in range(5)])
    torque = Profile.of(times, np.tile([value for _, value in corners], 5))
    found = respond(made, Schedule(torque, NOTHING, NOTHING), duration_s=5.0 * period)
    for k in range(5):
        within = (found.time_s >= k * period) & (found.time_s < (k + 1) * period)
        speed, time = found["wheel speed"][within], found.time_s[within] - k * period
        assert time[np.argmax(speed > 0.03)] * slope == pytest.approx(expected, rel=0.03)
        assert np.ptp(found["wheel angle"][within][time < 0.9 * expected / slope]) < 5.0 * 2e-4
        assert largest(speed[time > period - 0.3]) < 1e-3


@pytest.mark.parametrize("flank", [1.0, -1.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_friction_work_of_each_flank_is_that_of_the_loss_factor(flank: float, direction: float) -> None:
    """μ H_V of the power, H_V = π (1/z1 + 1/z2)(1 − ε + ε1² + ε2²), whatever flank carries, whatever way it turns.

    Source: H. Ohlendorf, Verlustleistung und Erwärmung von Stirnrädern, Munich, 1958; pairs share the load in halves.
    """
    made = free_bodies({"restitution": 0.5, "friction_coefficient": 0.05, "half_backlash_um": 5.0})
    made = replace(made, flanks=replace(made.flanks, static_ratio=1.0, presliding=5e-7))
    path = made.path
    torque = 50.0 * flank
    load = -torque * path.base_radii_m[1] / path.base_radii_m[0]
    profiles = Schedule(Profile.constant(torque), NOTHING, Profile.constant(load))
    start = FirstState(0.0, 40.0 * direction, 2e-5 * flank, 0.0)
    span = 2.0 * np.pi / 40.0  # some revolution of the pinion
    run = respond(made, profiles, duration_s=0.2 + 1.5 * span, interval_s=span / 20_000, first=start)
    angle, lost = np.abs(run["pinion angle"]), run["lost in friction"]
    first = np.searchsorted(run.time_s, 0.2)
    last = np.searchsorted(angle, angle[first] + 2.0 * np.pi)
    assert last < len(angle)
    assert np.all(run["interaction force"][first:last] * flank > 0.0)
    recess, approach = path.contact_ratio - path.pitch_point, path.pitch_point
    geometry = 1.0 - path.contact_ratio + recess**2 + approach**2
    factor = np.pi * (1.0 / path.teeth[0] + 1.0 / path.teeth[1]) * geometry
    # what the flanks really carried: friction shares in the torque
    carried = np.trapezoid(np.abs(run["interaction force"][first:last]), angle[first:last]) * path.base_radii_m[0]
    assert (lost[last] - lost[first]) / carried == pytest.approx(0.05 * factor, rel=0.02)
    # bristles give back what they were bent by when the sliding turns round, and no more
    given_back = np.minimum(np.diff(lost[first:last]), 0.0).sum()
    assert -1e-3 * (lost[last] - lost[first]) < given_back <= 0.0


def test_without_friction_of_the_flanks_nothing_is_lost_there() -> None:
    made = free_bodies({"restitution": 1.0})
    run = respond(made, driven_by(50.0), duration_s=0.3)
    assert largest(run["lost in friction"]) == 0.0


# Impact of two free gears: energy, restitution, the moment of touching.

PUBLISHED = {
    "lankarani": {0.95: 0.954, 0.8: 0.847, 0.5: 0.725, 0.2: 0.672},
    "hunt-crossley": {0.95: 0.952, 0.8: 0.833, 0.5: 0.663, 0.2: 0.547},
    "flores": {0.95: 0.947, 0.8: 0.789, 0.5: 0.470, 0.2: 0.156},
}
"""Restitution that each law really gives, for the one it was made for."""


def closed_form(law: str, restitution: float) -> float:
    """βv − ln(1 + βv) = −βv' − ln(1 − βv'), from ∫ ġ dġ/(1 + β ġ) = −(k/m) ∫ g^λ dg over a whole contact."""
    bv = damping_ratio_s_per_m(law, restitution, 1.0)
    top = min(1.0, (1.0 - 1e-12) / bv)
    return brentq(lambda x: bv - np.log1p(bv) + bv * x + np.log1p(-bv * x), 1e-9, top)


@pytest.mark.parametrize("law", DAMPING_LAWS)
@pytest.mark.parametrize("restitution", [0.95, 0.8, 0.5, 0.2])
def test_restitution(law: str, restitution: float) -> None:
    made = free_bodies({"restitution": restitution, "damping_law": law, "impact_speed_floor_mps": 1e-3})
    run = impact(made, 0.2)
    before, after = run.contact("start_speed_mps")[0], run.contact("end_speed_mps")[0]
    assert before == pytest.approx(0.2, rel=1e-9)
    assert after / before == pytest.approx(closed_form(law, restitution), abs=2e-5)
    assert after / before == pytest.approx(PUBLISHED[law][restitution], abs=6e-4)
    if law == "flores" and restitution >= 0.5:
        assert after / before == pytest.approx(restitution, abs=0.01 if restitution == 0.95 else 0.03)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_restitution_depends_neither_on_exponent_nor_on_speed(exponent: float) -> None:
    made = free_bodies({"restitution": 0.5, "exponent": exponent, "impact_speed_floor_mps": 1e-3})
    ratios = [run.contact("end_speed_mps")[0] / run.contact("start_speed_mps")[0] for run in (
        impact(made, 0.05), impact(made, 0.5))]  # fmt: skip
    assert ratios == pytest.approx([closed_form("flores", 0.5)] * 2, abs=5e-5)


def test_below_the_floor_the_damping_is_that_of_the_floor() -> None:
    """A contact that closes at a tenth of the floor is damped by a tenth of what its own speed would ask for."""
    made = free_bodies({"restitution": 0.5, "impact_speed_floor_mps": 0.1, "half_backlash_um": 20.0})
    run = impact(made, 0.01)
    bv = damping_ratio_s_per_m("flores", 0.5, 0.1) * 0.01
    expected = brentq(lambda x: bv - np.log1p(bv) + bv * x + np.log1p(-bv * x), 1e-6, 1.0)
    assert run.contact("end_speed_mps")[0] / 0.01 == pytest.approx(expected, abs=1e-3)
    assert run.contact("is_latched_at_floor")[0] == 1.0


def test_energy_is_conserved_without_damping_and_friction() -> None:
    """Several impacts to and fro across the backlash: nothing lost, nothing gained."""
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 50.0})
    run = impact(made, 0.3, tolerance=1e-10)
    assert len(run.contacts) >= 5
    assert {-1.0, 1.0} == set(run.contact("flank"))
    assert largest(run["energy"] / run["energy"][0] - 1.0) < 1e-7


def test_energy_is_conserved_while_pairs_come_and_go() -> None:
    """Turning loaded by their own spin: the changing number of pairs works on the rotation, not on the balance."""
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 5.0})
    made = replace(made, contact=replace(made.contact, driven_inertia_kg_m2=0.5))
    start = FirstState(0.0, 20.0, 3e-5, 0.0)
    run = respond(made, AT_REST, duration_s=0.2, interval_s=1e-4, first=start, tolerance=1e-10)
    pairs = run["pairs in contact"]
    assert pairs.max() == pytest.approx(2.0)
    assert largest(run["energy"] / run["energy"][0] - 1.0) < 1e-7


def test_the_energy_error_falls_with_the_tolerance() -> None:
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 50.0})
    drifts = [largest(np.diff(impact(made, 0.3, tolerance=t)["energy"])) for t in (1e-4, 1e-6, 1e-8)]
    assert drifts[0] > 5.0 * drifts[1] > 25.0 * drifts[2]


def test_the_moment_of_touching_is_exact() -> None:
    """Free flight at constant speed meets the flank at a/v; the force just begins, so that time is all there is."""
    made = free_bodies()
    run = impact(made, 0.2)
    assert run.contact("start_s")[0] == pytest.approx(150e-6 / 0.2, rel=1e-9)


def test_an_event_costs_less_than_a_hundredth_of_its_step() -> None:
    """Energy that the run loses against one of a thousandth of the tolerance, over the energy that a step moves."""
    made = free_bodies({"restitution": 0.8})
    ours, exact = impact(made, 0.2), impact(made, 0.2, tolerance=1e-9)
    lost = [run["energy"][0] - run["energy"][-1] for run in (ours, exact)]
    moved_in_a_step = np.max(np.abs(np.diff(exact["energy"])))  # in 10 µs, shorter than a step of the solver
    assert abs(lost[0] - lost[1]) < 0.01 * moved_in_a_step
    assert abs(ours.contact("end_s")[0] - exact.contact("end_s")[0]) < 1e-8


def test_inverse_formula_recovers_the_force_of_free_bodies() -> None:
    """m2 q̈ + γ f = −f with γ = m2/m1: what the source prints as a force model is the third law for two free bodies."""
    made = free_bodies({"restitution": 0.8})
    run = impact(made, 0.2)
    r1, r2 = made.path.base_radii_m
    m1 = made.pinion_side_inertia_kg_m2 / r1**2
    m2 = (made.contact.driven_inertia_kg_m2 or 0.0) / r2**2
    force = run["interaction force"]
    q_2dot = r1 * run["pinion acceleration"] - r2 * run["wheel acceleration"]
    assert force.max() > 1000.0
    assert largest(m2 * q_2dot + m2 / m1 * force + force) < 1e-6 * m2 / m1 * force.max()


@pytest.mark.parametrize(
    "changes",
    [
        {"restitution": 1.2},
        {"driver_inertia_kg_m2": -1.0},
        {"driven_inertia_kg_m2": -5.0},
        {"damping_law": "newton"},
        {"exponent": 3.0},
        {"half_backlash_um": -1.0},
    ],
)
def test_bad_contacts_are_named(changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(changes))):
        ToothContact(**({"stiffness_n_per_m_lambda": 1e10} | changes))  # type: ignore[arg-type]  # wrong on purpose


def test_a_drive_without_inertia_is_refused() -> None:
    with pytest.raises(InputError, match="wheel_inertia"):
        drive(wheel_inertia_kg_m2=-3.0)


def test_flores_is_the_damping_unless_another_is_chosen() -> None:
    assert ToothContact(1e10).damping_law == "flores"
    assert drive().contact.damping_law == "flores"
    assert drive(damping_law="lankarani").contact.damping_law == "lankarani"


# Tooth pairs in contact: by angle, forwards, backwards, on the back flank.

STANDARD = standard_path((20, 100), 5e-3, np.radians(20.0))


def test_standard_teeth_have_the_known_contact_ratio() -> None:
    """1.705 of 20/100 teeth; and the same path as the involute geometry of the other simulators."""
    pair = PairGeometry(GearGeometry(20, 5.0, 20.0), GearGeometry(100, 5.0, 20.0))
    assert STANDARD.contact_ratio == pytest.approx(1.705, abs=5e-4)
    assert STANDARD.contact_ratio == pytest.approx(pair.contact_ratio, rel=1e-9)
    assert STANDARD.start_m == pytest.approx(pair.start_radius_mm * 1e-3, rel=1e-9)
    assert STANDARD.length_m == pytest.approx(pair.action_length_mm * 1e-3, rel=1e-9)


@given(angle=st.floats(-50.0, 50.0), flank=st.sampled_from([1.0, -1.0]))
def test_model_and_rig_count_the_same_pairs(angle: float, flank: float) -> None:
    """The model's pairs come and go over a twentieth of a pitch, the rig's at once: alike away from there."""
    from sims.forging import later_pair, position, weight

    k = drive_numbers(drive())
    p, _ = position(k, angle, flank, later_pair(k, angle, flank))
    smooth = weight(k, p)[0] + weight(k, p + 1.0)[0]
    u = float(STANDARD.position(np.array(angle), flank))
    if min(abs(u - edge) for edge in (0.0, STANDARD.contact_ratio - 1.0, 1.0)) > 0.026:
        assert smooth == pytest.approx(float(STANDARD.n_pairs(np.array(angle), flank)), abs=1e-12)
    assert 1.0 - 1e-12 <= smooth <= 2.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_two_pairs_carry_for_the_part_epsilon_minus_one(direction: float) -> None:
    """Loaded gears that turn over many pitches, forwards and in reverse; time average of the pairs that carry."""
    made = free_bodies({"restitution": 0.5, "half_backlash_um": 5.0, "impact_speed_floor_mps": 1e-3})
    r1, r2 = made.path.base_radii_m
    torque = 50.0
    profiles = type(AT_REST)(
        AT_REST.torque_nm.constant(torque), AT_REST.brake_nm, AT_REST.press_nm.constant(-torque * r2 / r1)
    )
    start = FirstState(0.0, direction * 40.0, 2e-5, 0.0)
    # 40 pitches after the start has died out
    span = 40.0 * 2.0 * np.pi / 20.0 / 40.0
    run = respond(made, profiles, duration_s=0.2 + span, interval_s=span / 40_000, first=start)
    turning = run["pinion speed"][run.time_s >= 0.2]
    assert np.all(turning * direction > 30.0)
    angle = run["pinion angle"][run.time_s >= 0.2]
    two = run["pairs in contact"][run.time_s >= 0.2] > 1.5
    weight = np.abs(np.gradient(angle))
    assert np.all(run["interaction force"][run.time_s >= 0.2] > 0.0)
    assert np.sum(two * weight) / np.sum(weight) == pytest.approx(made.path.contact_ratio - 1.0, abs=0.01)


def test_a_flank_that_turns_back_meets_the_same_pairs() -> None:
    """The count belongs to the angle: a film run backwards shows the same."""
    angles = np.linspace(0.0, 3.0, 4001)
    assert np.array_equal(STANDARD.n_pairs(angles)[::-1], STANDARD.n_pairs(angles[::-1]))
    assert np.mean(STANDARD.n_pairs(np.linspace(0.0, 2.0 * np.pi, 200_001)) == 2.0) == pytest.approx(
        STANDARD.contact_ratio - 1.0, abs=1e-3
    )


def test_back_flanks_pass_the_pitch_point_half_a_pitch_later() -> None:
    at_pitch_point = STANDARD.pitch_point * 2.0 * np.pi / 20.0
    later = at_pitch_point + np.pi / 20.0
    assert float(STANDARD.position(np.array(at_pitch_point))) == pytest.approx(STANDARD.pitch_point % 1.0)
    assert float(STANDARD.position(np.array(later), -1.0)) == pytest.approx(STANDARD.pitch_point % 1.0)


@pytest.mark.parametrize(("pinion", "largest_wheel"), [(13, 16), (14, 26), (15, 45), (16, 101), (17, 1309)])
def test_teeth_that_interfere_are_refused(pinion: int, largest_wheel: int) -> None:
    """Largest wheels for full-depth teeth at 20°: Shigley's Mechanical Engineering Design, 11th ed., section 13-7."""
    standard_path((pinion, largest_wheel), 5e-3, np.radians(20.0))
    with pytest.raises(InputError, match="interfere"):
        standard_path((pinion, largest_wheel + 1), 5e-3, np.radians(20.0))


# The drive at work: start, stop, back-impact, press, stick and slip, the energy balance of all of it.

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
        ({"rise_s": 1.5}, "rise_s"),
        ({"brake_delay_s": 1.99}, "brake_delay_s"),
    ],
)
def test_cycles_that_cannot_be(changes: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        schedule(replace(CYCLE, **changes), Profile.constant(95.0), 4.0)  # type: ignore[arg-type]  # as named
