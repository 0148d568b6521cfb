"""Bearings whose balls carry one by one: load distribution, stiffness and ball passage against closed forms."""

from math import log, pi, sqrt

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.rig import Bearing
from sims.cracked import CrackedPair, respond
from sims.gear_pair import contact_n_per_m15, element_loads_n, shaft_place_m, stiffness_under_load_n_per_m
from sims.machine import BearingSupport
from sims.simulator import SimulationSetup

BALLS = Bearing("6205", "input", 9, 7.94, 39.04)


def support(clearance_um: float = 0.0, n: int = 9, ball_mm: float = 7.94) -> BearingSupport:
    return BearingSupport(Bearing("b", "input", n, ball_mm, 39.04), 0.3, 1e8, 0.0, clearance_um, law="hertzian")


def test_the_heaviest_ball_carries_as_stribeck_says() -> None:
    """Q_max = F/(n J), J = mean of cos^2.5 over the loaded half = 1/4.37, where there is no clearance."""
    load = np.array([300.0, -800.0])
    most = element_loads_n(support(n=200, ball_mm=0.5), load).max() * 200 / np.hypot(*load)
    psi = np.linspace(-pi / 2.0, pi / 2.0, 20001)
    assert most == pytest.approx(2.0 * pi / np.trapezoid(np.cos(psi) ** 2.5, psi), rel=1e-3)
    assert most == pytest.approx(4.37, abs=0.01)


def test_usual_clearance_brings_the_factor_to_five() -> None:
    """Stribeck's 5 stands for bearings with ordinary clearance; more clearance only makes it greater."""
    load, n = np.array([0.0, -1000.0]), 9
    places = 2.0 * pi / n * np.arange(16) / 16
    factor = [
        max(element_loads_n(support(c), load, p).max() for p in places) * n / 1000.0 for c in (0.0, 5.0, 10.0, 40.0)
    ]
    assert np.all(np.diff(factor) > 0.0)
    assert 4.2 < factor[0] < 4.6
    assert 4.6 < factor[1] < 5.4


def test_forces_of_the_balls_balance_the_load() -> None:
    load, cage = np.array([250.0, -700.0]), 0.3
    angles = cage + 2.0 * pi * np.arange(9) / 9
    found = element_loads_n(support(8.0), load, cage)
    assert np.array([np.cos(angles), np.sin(angles)]) @ found == pytest.approx(load, rel=1e-5)


def test_palmgren_is_hertz_for_usual_grooves() -> None:
    """Two elliptical contacts by the Hamrock–Brewe fit, grooves of 0.52 ball diameters: within 6 % in stiffness."""
    d, pitch, groove, modulus = 7.94e-3, 39.04e-3, 0.52, 206e9 / (1.0 - 0.3**2)
    compliance = 0.0
    for race in (2.0 / (pitch - d), -2.0 / (pitch + d)):
        rx, ry = 1.0 / (2.0 / d + race), 1.0 / (2.0 / d - 1.0 / (groove * d))
        ratio, second, first = 1.0339 * (ry / rx) ** 0.636, 1.0003 + 0.5968 * rx / ry, 1.5277 + 0.6023 * log(ry / rx)
        radius = 1.0 / (1.0 / rx + 1.0 / ry)
        compliance += (pi * ratio * modulus * sqrt(radius * second / (4.5 * first**3))) ** (-2.0 / 3.0)
    assert contact_n_per_m15(BALLS) == pytest.approx(compliance**-1.5, rel=0.06)


def test_stiffness_grows_with_the_cube_root_of_the_load() -> None:
    one, eight = (stiffness_under_load_n_per_m(support(), np.array([0.0, -f])) for f in (100.0, 800.0))
    assert eight / one == pytest.approx(2.0, rel=1e-3)


def test_the_shaft_moves_as_the_balls_pass() -> None:
    """Slow passing is quasi-static: the line at BPFO has the amplitude of the static places over one spacing."""
    values = {"bearing_law": "hertzian", "bearing_clearance_um": 10.0, "friction": "off", "roughness_um": 0.0}
    ready = CrackedPair().prepare(SimulationSetup("published_55_75", values), np.random.default_rng(0))
    bearing = ready.machine.bearings[0]
    turns = 30.0 / bearing.bearing.orders()["BPFO"] * 2.0  # whole passings
    found = respond(
        ready.machine,
        ready.operation,
        duration_s=0.2 + turns * 60.0 / 500.0,
        rng=np.random.default_rng(0),
        signals=("bearing 1 x", "bearing 1 y", "input rotor angle"),
        stride=20,
    )
    turned = found["input rotor angle"] / (2.0 * pi)
    kept = turned > turned[-1] - turns
    passed = np.exp(-2j * pi * bearing.bearing.orders()["BPFO"] * turned[kept])
    lines = [2.0 * abs(np.mean((found[f"bearing 1 {axis}"][kept]) * passed)) for axis in "xy"]
    force = 110.0 / (ready.machine.mesh.pair.driver.base_radius_mm * 1e-3)
    beta = np.radians(ready.machine.line_of_action_deg)
    down = -9.81 * np.array([np.sin(beta), np.cos(beta)])
    load = 0.5 * (np.array([0.0, -force]) + ready.machine.wheels[0].mass_kg * down) + bearing.mass_kg * down
    places = np.array([shaft_place_m(bearing, load, 2.0 * pi / 9 * i / 32) for i in range(32)])
    static = 2.0 * np.abs(np.fft.fft(places, axis=0)[1]) / 32
    assert np.hypot(*lines) == pytest.approx(np.hypot(*static), rel=0.1)
    assert np.hypot(*lines) > 1e-7


def test_contacts_need_the_bearings_geometry() -> None:
    with pytest.raises(InputError, match="geometry"):
        BearingSupport(Bearing("b", "input"), 0.3, 1e8, 0.0, law="hertzian")
    with pytest.raises(InputError, match="bearing_law"):
        BearingSupport(BALLS, 0.3, 1e8, 0.0, law="cubic")
