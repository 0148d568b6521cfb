"""Signs and sizes of single forces: friction, damping, late entry, bearings. Each fails if its sign is turned."""

from dataclasses import replace
from math import log, pi, sqrt

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.rig import Bearing
from sims.cracked import (
    CrackedPair,
    contact_forces,
    eigenfrequencies_hz,
    late_entry,
    matrices,
    mean_stiffness_n_per_m,
    mesh_mass_kg,
    prepare,
    respond,
)
from sims.gear_pair import (
    COORDINATES,
    DEFLECTIONS,
    bearing_fields,
    bearing_loads_n,
    contact_n_per_m15,
    element_loads_n,
    foot,
    shaft_place_m,
    stiffness_under_load_n_per_m,
)
from sims.machine import BearingSupport, Lubrication, Machine, Operation, RaceDefect, Roughness
from sims.simulator import SimulationSetup
from tests.sims.cracked.machines import conservative, frictionless
from tests.sims.machines import spur_pair_machine

STEADY = Operation.steady(500.0, 110.0)
OMEGA_1 = 500.0 * np.pi / 30.0
OMEGA_2 = OMEGA_1 * 55 / 75


def forces(machine: Machine, cycles: float, *, delta: float = 1e-5, rate: float = 0.0, late: float = 0.0) -> np.ndarray:
    """(ΣN, torque −∂U/∂c, Σf, Σfρ1, Σfρ2) at rolling speed without vibration."""
    arguments = prepare(machine, STEADY, np.random.default_rng(0)).constants.arguments
    cycle_rate = 55 * 500 / 60
    return np.array(contact_forces(*arguments, delta, rate, late, cycles, cycle_rate, OMEGA_1, OMEGA_2, 0.0, 0.0, 0.0))


# --- friction ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("cycles", "sign"), [(0.80, 1.0), (0.97, -1.0)])
def test_friction_turns_over_at_the_pitch_point(cycles: float, sign: float) -> None:
    """One pair in contact, before and after its pitch point (at 0.91): on the driver, +f in approach acts along −x."""
    machine = replace(spur_pair_machine(), roughness=Roughness(0.45, "none"))
    found = forces(machine, cycles)
    assert np.sign(found[2]) == sign


@pytest.mark.parametrize("cycles", np.linspace(0.05, 0.95, 10))
def test_friction_takes_power(cycles: float) -> None:
    """Σf v_s > 0 with v_s = ω2ρ2 − ω1ρ1: what the torques ω1Σfρ1 − ω2Σfρ2 bring is negative."""
    _, _, _, moment_1, moment_2 = forces(replace(spur_pair_machine(), roughness=Roughness(0.45, "none")), cycles)
    assert OMEGA_1 * moment_1 - OMEGA_2 * moment_2 < 0.0


def test_friction_costs_drive_torque() -> None:
    """The drive must give what friction takes: efficiency of the mesh just below 1, as any spur pair's."""
    machine = replace(spur_pair_machine(), roughness=Roughness(0.84, "none"))
    run = respond(
        machine,
        STEADY,
        duration_s=1.2,
        start_s=-0.6,
        rng=np.random.default_rng(0),
        signals=("input rotor angle", "driver angle", "output rotor angle", "driven angle"),
    )
    settled = run.time_s > 0.0
    k1 = machine.shafts[0].torsional_stiffness_nm_per_rad
    given = k1 * (run["input rotor angle"] - run["driver angle"])[settled].mean()
    assert 1e-3 < given / 110.0 - 1.0 < 0.03


def test_driver_and_driven_gear_feel_opposite_friction() -> None:
    """At x: the driver is pushed one way and the driven gear the other, by the same mean force through each shaft."""
    machine = replace(spur_pair_machine(), roughness=Roughness(1.4, "none"), gravity_mps2=0.0)
    run = respond(
        machine,
        STEADY,
        duration_s=0.8,
        start_s=-0.4,
        rng=np.random.default_rng(0),
        signals=("driver x", "driven x", "friction_n"),
    )
    settled = run.time_s > 0.0
    carried = -run["friction_n"][settled].mean()
    stiffness = 1.0 / (1.0 / 2e8 + 1.0 / 4e8)  # shaft, then two bearings side by side
    assert run["driver x"][settled].mean() == pytest.approx(carried / stiffness, rel=0.02)
    assert run["driven x"][settled].mean() == pytest.approx(-carried / stiffness, rel=0.02)


# --- damping ----------------------------------------------------------------------------------------------------------


def test_mesh_damping_ratio_is_the_one_given() -> None:
    """The mesh mode with everything else held: 2ζ√(k m) of damping for the mean stiffness and the mass of the pair."""
    machine = replace(frictionless(spur_pair_machine()), mesh_damping_ratio=0.06)
    k, m = mean_stiffness_n_per_m(machine, 2128.0), mesh_mass_kg(machine)
    cycles, rate = np.arange(0.0, 1.0, 0.01) + 0.005, 0.02
    at_rest = np.array([forces(machine, c)[0] for c in cycles])
    moving = np.array([forces(machine, c, rate=rate)[0] for c in cycles])
    damping = np.mean(moving - at_rest) / rate
    assert damping == pytest.approx(2 * 0.06 * np.sqrt(k * m), rel=0.01)


def test_a_mode_dies_out_at_its_modal_damping() -> None:
    """Free decay of the highest torsional motion against the damping matrix of the linear model."""
    base = conservative(spur_pair_machine())
    machine = replace(base, mesh_damping_ratio=0.06)
    force = 110.0 / 51.683e-3
    m, k, _ = matrices(machine, force)
    from scipy.linalg import eigh

    _, modes = eigh(k, m)
    mesh = np.zeros(16)
    mesh[[1, 2, 5, 7]] = 51.683e-3, -70.477e-3, 1.0, -1.0
    beta = 2 * 0.06 * np.sqrt(mesh_mass_kg(machine) / mean_stiffness_n_per_m(machine, force))
    # Stiffness-proportional: c = β k of the mesh spring, so a mode loses β k (mesh·φ)² per unit of modal mass.
    rates = np.array(
        [0.5 * beta * mean_stiffness_n_per_m(machine, force) * (mesh @ modes[:, i]) ** 2 for i in range(16)]
    )
    place = int(np.argmax(rates))
    f = eigenfrequencies_hz(machine, force)[place]
    slow = Operation.steady(1.0, 110.0)  # stands in double contact all the while
    kicked, still = (_energy_of_mesh(machine, slow, modes[:, place] * kick) for kick in (1e-4, 0.0))
    swing = np.abs(kicked - still)
    n = round(1.0 / f / 4e-6)
    peaks = swing[: len(swing) // n * n].reshape(-1, n).max(axis=1)
    decay = np.log(peaks[1] / peaks[5]) / (4 * n * 4e-6)
    assert decay == pytest.approx(rates[place], rel=0.15)  # double contact is 10 % stiffer than the mean


def _energy_of_mesh(machine: Machine, operation: Operation, velocity: np.ndarray) -> np.ndarray:
    from sims.cracked import SIGNALS, integrate

    ready = prepare(machine, operation, np.random.default_rng(0))
    q, v = ready.q.copy(), ready.v.copy()
    q[1] += 0.4 / ready.constants.record["cycles_per_rad"]
    q[2] += 0.4 / ready.constants.record["cycles_per_rad"] * 55 / 75
    q[0] += 0.4 / ready.constants.record["cycles_per_rad"]
    q[3] += 0.4 / ready.constants.record["cycles_per_rad"] * 55 / 75
    v += velocity
    found = np.empty((1000, 1))
    select = np.array([SIGNALS.index("compression_m")])
    phasors = ready.roughness.phasors(2e-6)
    arguments = ready.constants.arguments
    integrate(
        *arguments,
        q,
        v,
        q[:1].copy(),
        0.0,
        4e-6,
        1000,
        1,
        ready.speed,
        ready.torque,
        phasors,
        select,
        found,
        np.empty(0),
    )
    return found[:, 0]


# --- entry ------------------------------------------------------------------------------------------------------------


def test_gears_apart_make_a_pair_enter_late_and_all_contacts_shift() -> None:
    """Against exact geometry: entry moves by −0.2685 and exit by +0.1969 base pitches per mm of x between the gears."""
    record = prepare(spur_pair_machine(), STEADY, np.random.default_rng(0)).constants.record
    pair = spur_pair_machine().mesh.pair
    apart = 1e-5  # the driver moves towards −x, away from the driven gear
    late = late_entry(record, -apart, 0.0)
    shift = -record["turn_x"] * apart  # of the entry and the exit over the driver's angle
    alpha, a = pair.working_pressure_angle_rad, pair.centre_distance * 1e-3
    assert late == pytest.approx(apart / np.tan(alpha) / (pair.base_pitch_mm * 1e-3), rel=1e-9)
    assert (late + shift) / apart == pytest.approx(268.5, rel=1e-3)
    assert -shift / apart == pytest.approx(196.9, rel=1e-3)
    assert shift == pytest.approx(-51.683e-3 * apart / (a * np.sin(alpha)) / (pair.base_pitch_mm * 1e-3), rel=1e-4)


def test_a_late_pair_carries_nothing_before_it_enters() -> None:
    machine = frictionless(spur_pair_machine())
    single = forces(machine, 0.95)[0]
    assert forces(machine, 1.04)[0] > 1.5 * single  # the next pair has entered
    assert forces(machine, 1.04, late=0.1)[0] == pytest.approx(single, rel=0.03)


# --- bearings ---------------------------------------------------------------------------------------------------------


def outer_race(length_mm: float, race: str = "outer") -> Machine:
    machine = spur_pair_machine()
    first = replace(machine.bearings[0], defect=RaceDefect(race, length_mm, spacing_jitter=0.0, slip=0.0))
    return replace(machine, bearings=(first, *machine.bearings[1:]))


def sinking_m(machine: Machine, load_scale: float = 1.0, row: int = 0) -> np.ndarray:
    """Distance that the foot of bearing `row`'s spring moves over a revolution."""
    loads = bearing_loads_n(machine, 2128.0) * load_scale
    record = prepare(machine, STEADY, np.random.default_rng(0)).constants.record
    x, y = loads[row] / machine.bearings[row].stiffness_n_per_m
    return np.array([np.hypot(*foot(record, row, t, x, y)) for t in np.linspace(0, 2 * np.pi, 4001)])


def test_a_race_defect_unloads_one_element() -> None:
    """A long spall in the middle of the load zone: the shaft sinks by Q/k, Q = 4.37/n of the bearing's load."""
    machine = outer_race(3.0)
    load = np.hypot(*bearing_loads_n(machine, 2128.0)[0])
    most = sinking_m(machine).max()
    assert most == pytest.approx(4.37 / 9 * load / 2e8, rel=1e-3)
    assert sinking_m(machine, 0.2).max() == pytest.approx(0.2 * most, rel=1e-3)  # as much less as it carries less


def test_a_short_spall_sinks_by_its_depth() -> None:
    """Half way between edges 0.4 mm apart an element of 7.94 mm would be 5.0 µm deep; 2.6 µm can be had."""
    sink = sinking_m(outer_race(0.4)).max()
    most = sinking_m(outer_race(3.0)).max()
    assert sink == pytest.approx(most * (1.0 - np.exp(-(0.2e-3**2) / 2 / 3.97e-3 / most)), rel=0.03)
    grown = [sinking_m(outer_race(length)).max() for length in (0.05, 0.1, 0.2, 0.4, 0.8)]
    assert np.all(np.diff(grown) > 0.0)


def test_passings_per_revolution() -> None:
    for race, order in (("outer", 3.584785), ("inner", 5.415215)):
        swing = sinking_m(outer_race(1.0, race))
        rises = int(np.sum((swing[1:] > 1e-7) & (swing[:-1] <= 1e-7)))
        assert rises == pytest.approx(order, abs=1.0 if race == "outer" else order)
        assert rises > 0


def test_inner_defects_turn_with_their_own_shaft() -> None:
    """Driver counter-clockwise, driven clockwise: the direction of the sinking turns with the shaft on either."""
    machine = spur_pair_machine()
    for row, sense in ((0, 1.0), (2, -1.0)):
        defect = RaceDefect("inner", 3.0, spacing_jitter=0.0, slip=0.0)
        bearings = tuple(replace(b, defect=defect) if i == row else b for i, b in enumerate(machine.bearings))
        record = prepare(replace(machine, bearings=bearings), STEADY, np.random.default_rng(0)).constants.record
        place = bearing_loads_n(machine, 2128.0)[row] / 2e8
        theta = np.linspace(0, 2 * np.pi, 20001)
        feet = np.array([foot(record, row, t, *place) for t in theta])
        active = np.hypot(feet[:, 0], feet[:, 1]) > 1e-8
        direction = np.unwrap(np.arctan2(feet[active, 1], feet[active, 0]), period=2 * np.pi)
        turned = np.angle(np.exp(1j * (direction - sense * theta[active])))
        assert np.ptp(turned) < 1e-6


def test_sway_with_clearance_is_in_balance() -> None:
    """Little load and much play: the shaft hangs between two elements, and swings from side to side by geometry."""
    machine = spur_pair_machine()
    loose = replace(machine.bearings[0], clearance_um=200.0)
    machine = replace(machine, bearings=(loose, *machine.bearings[1:]), gravity_mps2=0.0)
    fields = bearing_fields(machine, 50.0, np.random.default_rng(0))
    sway = fields["sway"][0]
    phase = np.linspace(0, 2 * np.pi, 400)
    x = sum(sway[0, n, 0] * np.cos((n + 1) * phase) + sway[0, n, 1] * np.sin((n + 1) * phase) for n in range(4))
    # Two elements 40° apart carry: the corner between them lies at c/cos 20°, 20° to either side as they pass.
    assert np.ptp(x) == pytest.approx(2 * 200e-6 * np.tan(np.radians(20.0)), rel=0.25)


def test_lubrication_off_means_no_friction() -> None:
    machine = replace(spur_pair_machine(), lubrication=Lubrication(friction=False))
    np.testing.assert_array_equal(forces(machine, 0.3)[2:], 0.0)


@pytest.mark.parametrize(
    "rolling", [{"clearance_um": 30.0}, {"defect": RaceDefect("outer", 2.0)}, {"clearance_um": 5.0, "law": "hertzian"}]
)
def test_yields_are_the_forces_that_a_side_gives_to_its_housing(
    rolling: dict[str, float | str | RaceDefect],
) -> None:
    """Σ m a of gear and bearings = mesh force − Σ (k yield + c v), but for a weight that stays."""
    machine = frictionless(spur_pair_machine())
    loose = replace(machine, bearings=(replace(machine.bearings[0], **rolling), *machine.bearings[1:]))
    force = STEADY.torque_nm.at(0.0) / (1e-3 * machine.mesh.pair.driver.base_radius_mm)
    stiffness = bearing_fields(loose, force, np.random.default_rng(0))["bearing_stiffness"]
    moving = [name for name in COORDINATES if name.endswith(" y")]
    names = (
        "mesh_force_n",
        *DEFLECTIONS,
        *(f"{name}{what}" for name in moving for what in (" velocity", " acceleration")),
    )
    run = respond(loose, STEADY, duration_s=0.3, rng=np.random.default_rng(0), signals=names, start_s=-0.2)
    given = -run["mesh_force_n"]
    shaken = loose.wheels[0].mass_kg * run["driver y acceleration"]
    for i, bearing in enumerate(loose.bearings[:2], 1):
        given = given - stiffness[i - 1] * run[f"bearing {i} y yield"]
        given = given - bearing.damping_n_s_per_m * run[f"bearing {i} y velocity"]
        shaken = shaken + bearing.mass_kg * run[f"bearing {i} y acceleration"]
    left = given - shaken
    assert np.ptp(left) < 1e-6 * np.ptp(run["mesh_force_n"])


# Bearings whose balls carry one by one: load distribution, stiffness and ball passage against closed forms.

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
