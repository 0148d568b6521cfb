"""Friction by bristles: repeated sticking and slipping, and the work of the flanks' friction."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sims.forging import FirstState, Schedule, bristle, respond
from sims.machine import Profile
from tests.sims.forging.drives import NOTHING, drive, driven_by, free_bodies, largest


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
