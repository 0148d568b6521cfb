"""Rotors without gears: halves and thirds of orders, oil whirl, and what a speed that wanders makes of the lines."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Kind, Outcome, analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, OperatingPoint, PulseTimes, Rig, Shaft
from tests.diagnosis.machines import codes, finding

PLAIN = Rig(shafts=(Shaft("rotor"),))
ROLLING = replace(PLAIN, bearings=(Bearing("front", "rotor", 9, 7.94, 39.04),))
HEALTHY = {1.0: 0.1, 2.0: 0.02, 3.0: 0.01}
HALVES = {k + 0.5: 0.03 for k in range(6)}
TURNS_HZ = 27.7
CLAIMS = (Kind.FAULT, Kind.SUSPICION)


def record(
    lines: Mapping[float, float], rig: Rig = PLAIN, *, wander: float = 0.0, impacts: float = 0.0, seed: int = 1
) -> Recording:
    """Return an acceleration with lines (order → amplitude), and impacts at an order, in white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(6.0 * 2048)) / 2048.0
    turns = TURNS_HZ * (t - wander * np.cos(2 * np.pi * 0.25 * t) / (2 * np.pi * 0.25))
    x = 0.02 * rng.standard_normal(len(t))
    if impacts:
        x += 0.3 * rng.standard_normal(len(t)) * np.cos(np.pi * impacts * turns) ** 24
    for order, amplitude in lines.items():
        x += amplitude * np.cos(2 * np.pi * (order * turns + rng.uniform()))
    speed = ConstantSpeed(60 * TURNS_HZ, "rotor")
    return Recording(x[None, :], 2048.0, (Channel("a1", "acceleration", "m/s^2"),), speed, rig)


@pytest.mark.parametrize(
    ("lines", "rig", "claims"),
    [
        (HEALTHY, ROLLING, []),
        (HEALTHY | HALVES, ROLLING, ["half-orders"]),
        (HEALTHY | HALVES, PLAIN, ["half-orders"]),
        (HEALTHY | {k / 3: 0.03 for k in range(1, 20) if k % 3}, ROLLING, ["half-orders"]),
        (HEALTHY | {k / 6: 0.03 for k in range(1, 40)}, ROLLING, []),  # a shaft at a sixth of the speed
        (HEALTHY | {0.28 * k: 0.03 for k in range(1, 20)}, PLAIN, []),  # a belt
        (HEALTHY | HALVES | {k / 4: 0.03 for k in range(1, 24)}, PLAIN, []),  # a shaft at a quarter of the speed
        (HEALTHY | {0.44: 0.05}, PLAIN, ["oil-whirl"]),
        (HEALTHY | {0.44: 0.05}, ROLLING, []),  # no oil film there; a cage's order is nearly the same
        (HEALTHY | {0.44 * k: 0.05 / k for k in (1, 2, 3)}, PLAIN, []),  # a belt
        (HEALTHY | {0.44: 0.05}, Rig(), []),  # a machine of which nothing is known
    ],
)
def test_parts_of_orders_and_oil_whirl_are_suspected_and_belts_are_not(
    lines: Mapping[float, float], rig: Rig, claims: list[str]
) -> None:
    assert codes(analyze(record(lines, rig)), *CLAIMS) == claims


def test_a_rotor_that_turns_half_as_fast_as_stated_is_not_called_loose_alone_nor_its_bearings_sound() -> None:
    analysis = analyze(record({k / 2: 0.1 / k for k in range(1, 10)}, ROLLING))
    assert finding(analysis, "half-orders").title.startswith("Perhaps a wrong speed or sampling rate, else looseness")
    assert "half of the order of shaft rotor exceeds" in finding(analysis, "bearings-undecided").title
    # Of a speed that is measured it can only be the rotor.
    measured = record({k / 2: 0.1 / k for k in range(1, 10)}, ROLLING)
    analysis = analyze(replace(measured, speed=PulseTimes(np.arange(1, 160) / TURNS_HZ, shaft="rotor")))
    assert finding(analysis, "half-orders").title.startswith("Perhaps looseness or a rub")


@pytest.mark.parametrize(("tolerance_percent", "is_known"), [(2.0, True), (20.0, False)])
def test_a_good_nominal_speed_stands_for_a_stated_one(tolerance_percent: float, *, is_known: bool) -> None:
    """No source and no gear tells the speed. The lines say that it is 1 % more."""
    point = OperatingPoint("rotor", 60 * TURNS_HZ / 1.01, tolerance_percent)
    recording = replace(record(HEALTHY, replace(ROLLING, operating_point=point)), speed=None)
    analysis = analyze(recording)
    if is_known:
        assert "1662.18 ± 2.5 rpm" in finding(analysis, "speed").title
        assert "the nominal speed is taken" in finding(analysis, "speed").evidence[0]
    else:
        assert "the nominal speed may be 20 % off" in finding(analysis, "speed-unknown").evidence[0]


@pytest.mark.parametrize("drift", [0.0, 0.04])
def test_a_constant_speed_is_refused_where_the_shaft_s_line_runs_through_a_range(drift: float) -> None:
    """Smeared lines of a damaged race show nothing, which is not said of a sound bearing."""
    rng, seconds, rate_hz = np.random.default_rng(3), 20.0, 4096.0
    time_s = np.arange(int(seconds * rate_hz)) / rate_hz
    turns = 25.0 * (time_s + drift * (time_s**2 / seconds - time_s))
    depth = 1.0 + sum(0.3 * np.cos(2 * np.pi * k * 3.58 * turns) for k in (1, 2, 3))
    x = 0.5 * np.cos(2 * np.pi * turns) + depth * rng.standard_normal(len(turns))
    recording = Recording(
        x[None], rate_hz, (Channel("a1", "acceleration", "m/s^2"),), ConstantSpeed(1500.0, "rotor"), ROLLING
    )
    analysis = analyze(recording)
    if drift:
        assert "runs from 14" in finding(analysis, "speed-unknown").evidence[0]
    else:
        assert codes(analysis, *CLAIMS) == ["bearing-outer-race"]


def test_lines_of_the_mains_are_no_half_orders() -> None:
    """Of a shaft at a third of 100 Hz, 1.5, 4.5 and 7.5 times its speed are multiples of 50 Hz."""
    hum = record(HEALTHY | {k + 0.5: 0.03 for k in (1, 4, 7)})
    at = 60 * 100 / 3
    hum = replace(hum, sampling_rate_hz=2048.0 * at / (60 * TURNS_HZ), speed=ConstantSpeed(at, "rotor"))
    assert not codes(analyze(hum), *CLAIMS)


def test_oil_whirl_is_what_has_changed_and_is_said_once() -> None:
    analysis = analyze(record(HEALTHY | {0.44: 0.05}), reference=record(HEALTHY, seed=2))
    assert codes(analysis, *CLAIMS) == ["changed-since-reference", "oil-whirl"]
    analysis = analyze(record(HEALTHY | HALVES), reference=record(HEALTHY, seed=2))
    assert "half-orders" not in codes(analysis)
    assert finding(analysis, "looseness").title == "Perhaps looseness or a rub of rotor."
    assert "rub" not in codes(analysis)  # nothing tells them apart: no noise has come with the halves


def inner_race(strikes: float, turns_hz: float, *, stated: bool, seed: int) -> Recording:
    """Return a race that is struck nearly five times a turn, through the load; the speed wanders by 0.2 %."""
    rng, rate_hz = np.random.default_rng(seed), 8192.0
    t = np.arange(int(5.0 * rate_hz)) / rate_hz
    turns = turns_hz * (t - 0.001 * np.cos(2 * np.pi * 0.2 * t) / (2 * np.pi * 0.2))
    x = 0.05 * rng.standard_normal(len(t))
    struck = np.cos(np.pi * strikes * turns) ** 24 * np.clip(np.cos(2 * np.pi * turns), 0.05, None)
    x += 0.5 * rng.standard_normal(len(t)) * struck
    x += sum(a * np.cos(2 * np.pi * k * turns + k) for k, a in ((1, 0.5), (2, 0.04), (3, 0.03), (4, 0.02), (5, 0.02)))
    rig = replace(PLAIN, bearings=(Bearing("front", "rotor", 8, 7.145, 28.519),))
    pulses = PulseTimes(np.interp(np.arange(np.ceil(turns[0]), turns[-1]), turns, t), shaft="rotor")
    speed = ConstantSpeed(60 * turns_hz * 1.005, "rotor") if stated else pulses
    return Recording(x[None, :], rate_hz, (Channel("a1", "acceleration", "m/s^2"),), speed, rig)


@pytest.mark.parametrize(("strikes", "turns_hz"), [(5.018, 28.0), (5.0245, 32.4)])
def test_lines_that_a_race_s_sidebands_explain_as_well_are_no_other_race_and_no_stranger(
    strikes: float, turns_hz: float
) -> None:
    """Its sidebands are near the multiples of a fifth of its order, and near those of the outer race's, 2.998."""
    analysis = analyze(inner_race(strikes, turns_hz, stated=False, seed=1))
    assert codes(analysis, *CLAIMS) == ["bearing-inner-race"]


def test_beats_of_tones_that_a_supply_s_frequency_shifts_change_no_bearing() -> None:
    rng, rate_hz = np.random.default_rng(4), 8192.0
    t = np.arange(int(6.0 * rate_hz)) / rate_hz

    def beating(apart_hz: float) -> Recording:
        x = 0.02 * rng.standard_normal(len(t)) + 0.1 * np.cos(2 * np.pi * TURNS_HZ * t)
        x += sum(0.05 * np.cos(2 * np.pi * (1500.0 + k * apart_hz) * t + k) for k in range(4))
        speed = ConstantSpeed(60 * TURNS_HZ, "rotor")
        return Recording(x[None, :], rate_hz, (Channel("a1", "acceleration", "m/s^2"),), speed, ROLLING)

    race_hz = ROLLING.bearings[0].orders()["BPFO"] * TURNS_HZ
    analysis = analyze(beating(race_hz), reference=beating(1.3 * race_hz))
    assert not codes(analysis, *CLAIMS)


def test_blades_of_an_unbalanced_wheel_are_no_wrong_speed_and_no_strangers() -> None:
    """Eight put the strongest lines on multiples of eight; what moves most as velocity still turns once."""
    rng, rate_hz = np.random.default_rng(1), 4096.0
    t = np.arange(int(6.0 * rate_hz)) / rate_hz
    turns = TURNS_HZ * (t - 0.002 * np.cos(2 * np.pi * 0.25 * t) / (2 * np.pi * 0.25))
    x = 0.05 * rng.standard_normal(len(t)) + np.cos(2 * np.pi * turns)
    x += sum(0.5 / k * np.cos(2 * np.pi * 8 * k * turns + k) for k in range(1, 8))
    bearings = tuple(Bearing(name, "rotor", 8, 15.081, 65.0) for name in ("front", "rear"))
    speed, channel = ConstantSpeed(60 * TURNS_HZ, "rotor"), Channel("a1", "acceleration", "m/s^2")
    for rig in (replace(PLAIN, bearings=bearings), ROLLING):
        analysis = analyze(Recording(x[None, :], rate_hz, (channel,), speed, rig))
        assert "sampling-rate-doubtful" not in codes(analysis)
        assert not codes(analysis, *CLAIMS)


def test_impacts_beside_a_multiple_of_a_speed_that_is_only_stated_are_no_strangers() -> None:
    """With its sidebands, a race that is struck 5.03 times a turn has lines at a fifth of that."""
    analysis = analyze(inner_race(5.03, 50.9, stated=True, seed=1))
    assert finding(analysis, "non-synchronous-impacts").kind is Kind.NOTICE
    assert analysis.outcome is Outcome.CANNOT_TELL
