"""What the cracked pair must show: published and derived numbers, convergence, drive, cracks, roughness."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gearsig.errors import InputError, RefusalError
from sims.cracked import Response, check_convergence, default_step_s, derivative, eigenfrequencies_hz, prepare, respond
from sims.machine import Drive, Lubrication, Machine, Operation, Profile, Roughness, SpeedSwing
from sims.mesh import FractalSurface, RootCrack, mesh_stiffness
from tests.sims.cracked.machines import cracked, frictionless
from tests.sims.machines import spur_pair_machine

MESH_HZ = 55 * 500 / 60
STEADY = Operation.steady(500.0, 110.0)
FRACTAL_LINES_HZ = 1.0312 * 1.5 ** np.arange(7, 19)


def run(
    machine: Machine, signals: tuple[str, ...], duration_s: float = 0.6, settle_s: float = 0.4, **more: float
) -> Response:
    """Return a settled run: the first `settle_s` lie before time 0 and are cut off."""
    operation = Operation.steady(more.get("speed_rpm", 500.0), more.get("torque_nm", 110.0))
    response = respond(
        machine,
        operation,
        duration_s=duration_s + settle_s,
        rng=np.random.default_rng(1),
        signals=signals,
        start_s=-settle_s,
    )
    keep = response.time_s >= 0.0
    cut = {name: values[keep] for name, values in response.signals.items()}
    return Response(0.0, response.interval_s, cut, response.step_s, response.energy_j)


def by_angle(response: Response, name: str, per_cycle: int = 100) -> NDArray[np.float64]:
    """Return a signal at even mesh cycles from the first whole driver revolution on."""
    cycles = 55 * response["driver angle"] / (2 * np.pi)
    first = 55 * np.ceil(cycles[0] / 55)
    grid = np.arange(first, cycles[-1], 1 / per_cycle)
    return np.interp(grid, cycles, response[name])


def lines(response: Response, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies and peak amplitudes, Hann window."""
    x = response[name]
    window = np.hanning(len(x))
    spectrum = 2 * np.abs(np.fft.rfft((x - x.mean()) * window)) / window.sum()
    return np.fft.rfftfreq(len(x), response.interval_s), spectrum


def level(response: Response, name: str, frequency_hz: float) -> float:
    f, amplitude = lines(response, name)
    return float(amplitude[np.abs(f - frequency_hz) <= 3 * f[1]].max())


# --- numbers on record ------------------------------------------------------------------------------------------------


def test_mean_mesh_force() -> None:
    """110 N m over r_b1 = 51.68 mm is 2128 N, without friction."""
    response = run(frictionless(spur_pair_machine()), ("mesh_force_n",))
    assert response["mesh_force_n"].mean() == pytest.approx(2128.0, abs=2.0)


def test_eigenfrequencies() -> None:
    """393 to 5599 Hz on record for a mesh stiffness that is not; with 3.78e8 N/m they lie within 1 %."""
    f = eigenfrequencies_hz(spur_pair_machine())
    assert f[0] == pytest.approx(0.0, abs=1e-3)
    assert f[1] == pytest.approx(393.0, rel=0.01)
    assert f[-1] == pytest.approx(5599.0, rel=0.01)


def test_step_limit_of_stability() -> None:
    """RK4 is stable to ωh = 2.78, 79 µs here; a longer step is refused when the solution bursts."""
    machine, operation = frictionless(spur_pair_machine()), Operation.steady(10.0, 110.0)
    rng = np.random.default_rng
    stable = respond(machine, operation, duration_s=0.05, rng=rng(1), step_s=70e-6)
    assert np.abs(stable["driver y"]).max() < 1e-3
    with pytest.raises(RefusalError, match="the solution diverges"):
        respond(machine, operation, duration_s=0.5, rng=rng(1), step_s=95e-6)


@pytest.mark.parametrize(
    ("speed_rpm", "torque_nm", "roughness"),
    [(500.0, 110.0, Roughness(0.45, "time")), (1500.0, 50.0, Roughness(0.84, "flank")), (3000.0, 110.0, Roughness())],
)
def test_default_step_has_converged(speed_rpm: float, torque_nm: float, roughness: Roughness) -> None:
    """Rms transmission error within 1e-4 of that at a quarter of the step."""
    machine = cracked(replace(spur_pair_machine(), roughness=roughness), 2.0)
    found = check_convergence(machine, Operation.steady(speed_rpm, torque_nm), np.random.default_rng(3), duration_s=0.2)
    assert found.error < 1e-4
    assert found.converged
    assert "converged" in found.text


def test_a_long_step_has_not_converged() -> None:
    found = check_convergence(
        spur_pair_machine(), Operation.steady(3000.0, 110.0), np.random.default_rng(3), duration_s=0.1, step_s=4e-5
    )
    assert not found.converged
    assert "NOT converged" in found.text


def test_step_follows_the_stiffness() -> None:
    """Four times stiffer bearings and shafts shorten the step; so does a faster tooth passage."""
    machine = spur_pair_machine()
    stiff = replace(machine, bearings=tuple(replace(b, stiffness_n_per_m=3.2e9) for b in machine.bearings))
    slow, fast = Operation.steady(300.0, 110.0), Operation.steady(6000.0, 110.0)
    assert default_step_s(stiff, slow) < 0.5 * default_step_s(machine, slow)
    assert default_step_s(machine, fast) < 0.5 * default_step_s(machine, slow)


def test_step_follows_heavy_dampers() -> None:
    """A damper of 1e6 N s/m on 0.3 kg is as stiff as a spring: the run stands it."""
    base = spur_pair_machine()
    machine = replace(base, bearings=tuple(replace(b, damping_n_s_per_m=1e6) for b in base.bearings))
    assert default_step_s(machine, STEADY) < 0.1 * default_step_s(base, STEADY)
    assert np.isfinite(respond(machine, STEADY, duration_s=0.005, rng=np.random.default_rng(1))["driver y"]).all()


def test_the_same_as_an_adaptive_integrator() -> None:
    """DOP853 on the same equations at 1e-10: the same motion over 5 ms of tooth passages with friction."""
    from scipy.integrate import solve_ivp

    machine = cracked(replace(spur_pair_machine(), roughness=Roughness(0.45, "time")), 2.0)
    ready = prepare(machine, STEADY, np.random.default_rng(1))
    surface, omega = ready.roughness.surface, 2 * np.pi * ready.roughness.frequencies_hz
    rough = (surface.amplitudes_m, omega, ready.roughness.phases_rad)
    rate = np.empty(32)

    def slope(t: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        derivative(*ready.constants.arguments, t, state, ready.speed, ready.torque, ready.q[0], rough, rate)
        return rate.copy()  # SciPy keeps a reference

    exact = solve_ivp(
        slope, (0.0, 5e-3), np.concatenate((ready.q, ready.v)), "DOP853", rtol=1e-10, atol=1e-13, max_step=1e-5
    )
    step = 5e-3 / 1250
    ours = respond(
        machine, STEADY, duration_s=5e-3 + step, rng=np.random.default_rng(1), signals=("driver y",), step_s=step
    )
    assert ours["driver y"][-1] == pytest.approx(exact.y[5, -1], rel=1e-5)


# --- crack ------------------------------------------------------------------------------------------------------------


def change_per_cycle(machine: Machine, depth_mm: float, name: str) -> NDArray[np.float64]:
    """Greatest change that a crack in the driver's tooth 0 makes, in each of the 55 mesh cycles of a revolution."""
    healthy, faulty = (
        by_angle(run(m, (name, "driver angle"), 0.5), name) for m in (machine, cracked(machine, depth_mm))
    )
    n = min(len(healthy), len(faulty)) // 5500 * 5500
    change = (faulty[:n] - healthy[:n]).reshape(-1, 55, 100)
    return np.abs(change - np.median(change)).max(axis=(0, 2)) / np.ptp(healthy)


@pytest.mark.slow
def test_crack_strikes_once_per_revolution_and_harder_with_depth() -> None:
    """The change lies where tooth 0 carries, c = 0 … ε and shortly after, and grows with depth."""
    peaks = []
    for depth in (1.0, 2.0, 3.0, 4.0):
        change = change_per_cycle(spur_pair_machine(), depth, "driver y acceleration")
        assert set(np.argsort(change)[-2:]) == {0, 1}
        assert change[8:].max() < 0.1 * change.max()
        peaks.append(change.max())
    assert np.all(np.diff(peaks) > 0.3 * peaks[0])


@pytest.mark.slow
def test_reach_of_the_crack_grows_with_its_depth() -> None:
    """Mesh cycles in which more than 1 % of the healthy transmission error's swing changes: about 3, later 7
    (published: 3, later 9). It rests on the torsional damping, which is not published: 0.4 N m s/rad here."""
    base = spur_pair_machine()
    machine = replace(base, shafts=tuple(replace(s, torsional_damping_nm_s_per_rad=0.4) for s in base.shafts))
    reach = [int((change_per_cycle(machine, q, "transmission_error_m") > 0.01).sum()) for q in (1.0, 2.0, 3.0, 4.0)]
    assert reach == sorted(reach)
    assert 2 <= reach[0] <= 4
    assert 6 <= reach[-1] <= 10


def test_crack_of_one_tooth_leaves_the_other_gear_alone() -> None:
    """A crack in the driven gear strikes once per its revolution: every 75 mesh cycles."""
    machine = spur_pair_machine()
    faulty = replace(machine, mesh=replace(machine.mesh, cracks_2=(RootCrack(3.0),)))
    signals = ("driver y acceleration", "driver angle")
    healthy, struck = (by_angle(run(m, signals, 0.8), signals[0]) for m in (machine, faulty))
    n = min(len(healthy), len(struck)) // 7500 * 7500
    first = int(np.ceil(55 * run(machine, ("driver angle",), 0.01)["driver angle"][0] / (2 * np.pi) / 55)) * 55
    change = np.roll((struck[:n] - healthy[:n]).reshape(-1, 75, 100), first, axis=1)
    peaks = np.abs(change).max(axis=(0, 2))
    assert set(np.argsort(peaks)[-2:]) == {0, 1}


def test_stiffness_of_the_cracked_tooth_drops_in_the_kernel_too() -> None:
    """Static limit: at a crawl the mesh force over the compression is the table's stiffness."""
    machine = frictionless(cracked(spur_pair_machine(), 3.0))
    response = run(machine, ("compression_m", "mesh_force_n", "driver angle"), 0.5, 0.3, speed_rpm=20.0)
    cycles = 55 * response["driver angle"] / (2 * np.pi)
    expected = mesh_stiffness(machine.mesh, cycles).total_n_per_m
    ratio = response["mesh_force_n"] / response["compression_m"] / expected
    assert np.median(np.abs(ratio - 1.0)) < 2e-3


# --- roughness --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rough_runs() -> dict[float, Response]:
    """Settled runs at the four published roughnesses; as published, the smooth one has no friction."""
    signals = ("driver y", "driver y velocity", "driver angle", "backlash_change_m", "friction_n", "mesh_force_n")
    found = {}
    for rms in (0.0, 0.45, 0.84, 1.40):
        machine = replace(
            spur_pair_machine(), roughness=Roughness(rms, "time"), lubrication=Lubrication(friction=rms > 0.0)
        )
        found[rms] = run(machine, signals, 4.0)
    return found


@pytest.mark.slow
def test_fractal_lines_show_and_grow_with_roughness(rough_runs: dict[float, Response]) -> None:
    """The twelve published lines, 10 times over what the smooth pair has there, each higher with more roughness."""
    # 451 Hz lies beside the mesh frequency: its line is compared among rough pairs only.
    for line in FRACTAL_LINES_HZ:
        heights = [level(r, "driver y", line) for r in rough_runs.values()]
        if abs(line - MESH_HZ) > 20.0:
            assert heights[1] > 10.0 * heights[0]
            assert heights[1] < heights[2] < heights[3]


@pytest.mark.slow
def test_backlash_has_the_roughness_it_is_given(rough_runs: dict[float, Response]) -> None:
    for rms, response in rough_runs.items():
        assert np.std(response["backlash_change_m"]) == pytest.approx(1e-6 * rms, rel=0.05, abs=1e-12)
    assert FractalSurface.of_roughness(0.84).rms_m == pytest.approx(0.84e-6)


@pytest.mark.slow
def test_sidebands_round_the_mesh_frequency_grow_with_roughness(rough_runs: dict[float, Response]) -> None:
    """Friction multiplies roughness into the mesh: f_m ± the lowest fractal lines, which a smooth pair has not."""
    offsets = FRACTAL_LINES_HZ[:4]
    heights = [
        sum(level(r, "driver y", MESH_HZ * 3 + sign * o) for o in offsets for sign in (-1, 1))
        for r in rough_runs.values()
    ]
    assert heights[1] > 5.0 * heights[0]
    assert heights[1] < heights[2] < heights[3]


@pytest.mark.slow
def test_poincare_section_scatters_with_roughness(rough_runs: dict[float, Response]) -> None:
    """Once per mesh cycle: one point for the smooth pair (a closed curve), a growing cloud for rough ones."""
    spread = []
    for response in rough_runs.values():
        x, v = (by_angle(response, name, per_cycle=1) for name in ("driver y", "driver y velocity"))
        spread.append(
            np.hypot(np.std(x) / np.std(response["driver y"]), np.std(v) / np.std(response["driver y velocity"]))
        )
    assert spread[0] < 0.01
    assert spread[1] > 10 * spread[0]
    assert spread[1] < spread[2] < spread[3]


@pytest.mark.slow
def test_friction_over_normal_force_surges_with_roughness(rough_runs: dict[float, Response]) -> None:
    """Σf/ΣN cannot pass the greatest coefficient, 0.031, 0.050, 0.147 at the three roughnesses; it comes to a third of
    it, since the ends of the path, where sliding is fast, are shared by two pairs that slide in opposite directions."""
    for rms, limit in ((0.45, 0.031), (0.84, 0.050), (1.40, 0.147)):
        response = rough_runs[rms]
        ratio = np.abs(response["friction_n"] / response["mesh_force_n"]).max()
        assert 0.25 * limit < ratio < limit


# --- bad input --------------------------------------------------------------------------------------------------------


def test_unknown_signal_is_named() -> None:
    with pytest.raises(InputError, match="did you mean driver y"):
        respond(spur_pair_machine(), STEADY, duration_s=0.1, rng=np.random.default_rng(1), signals=("drivr y",))


def test_endless_runs_are_refused() -> None:
    with pytest.raises(InputError, match="simulate a shorter time"):
        respond(spur_pair_machine(), STEADY, duration_s=1e6, rng=np.random.default_rng(1))


@pytest.mark.parametrize("torque_nm", [1e5, 1e12])
def test_a_solution_that_bursts_is_refused(torque_nm: float) -> None:
    """Not a number must not be taken for a tooth's number: that once read beyond the tables."""
    with pytest.raises(RefusalError, match="the solution diverges"):
        respond(
            spur_pair_machine(),
            Operation.steady(500.0, torque_nm),
            duration_s=0.2,
            rng=np.random.default_rng(1),
            step_s=2e-5,
        )


def test_a_run_in_parts_is_the_same_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled code returns now and then; roughness, set angle and output go on where they were."""
    machine = replace(spur_pair_machine(), roughness=Roughness(0.84, "time"))
    whole = _short_run(machine)
    monkeypatch.setattr("sims.cracked._respond.STEPS_PER_CALL", 700)
    parts = _short_run(machine)
    np.testing.assert_allclose(parts["driver y"], whole["driver y"], rtol=1e-9)
    np.testing.assert_array_equal(parts.time_s, whole.time_s)


def _short_run(machine: Machine) -> Response:
    rng = np.random.default_rng(2)
    return respond(machine, STEADY, duration_s=0.05, rng=rng, signals=("driver y",), stride=3)


# The drive of the cracked pair: speed, torque, run-ups; teeth that part and rattle.

# --- drive ------------------------------------------------------------------------------------------------------------


def test_speed_holds_in_spite_of_friction() -> None:
    response = run(spur_pair_machine(), ("driver angle",), 0.6, 0.6)
    turned = np.diff(response["driver angle"][[0, -1]])[0] / (response.interval_s * (len(response["driver angle"]) - 1))
    assert turned * 30 / np.pi == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize(("first", "last"), [(300.0, 900.0), (900.0, 300.0)])
def test_run_up_and_coast_down_follow_the_course(first: float, last: float) -> None:
    machine = spur_pair_machine()
    operation = Operation(Profile.of([0.0, 1.0], [first, last]), Profile.constant(50.0))
    response = respond(
        machine,
        operation,
        duration_s=1.4,
        start_s=-0.4,
        rng=np.random.default_rng(1),
        signals=("input rotor angle velocity", "mesh_force_n"),
        stride=4,
    )
    t = response.time_s
    smooth = np.convolve(response["input rotor angle velocity"], np.ones(400) / 400, "same")
    inside = (t > 0.2) & (t < 0.95)
    wanted = operation.speed_rpm.at(t[inside]) * np.pi / 30
    np.testing.assert_allclose(smooth[inside], wanted, rtol=5e-3)
    # Half of the drive's own inertia's torque goes through the mesh: more force in a run-up, less in a coast-down.
    far = machine.wheels[1].inertia_kg_m2 + machine.shafts[1].rotor_inertia_kg_m2
    acceleration = (last - first) * np.pi / 30
    r1 = machine.mesh.pair.driver.base_radius_mm * 1e-3
    expected = (50.0 + far / machine.ratio**2 * acceleration) / r1
    assert response["mesh_force_n"][inside].mean() == pytest.approx(expected, rel=5e-3)


def test_torque_course_sets_the_mesh_force() -> None:
    operation = Operation(Profile.constant(600.0), Profile.of([0.0, 0.5], [20.0, 120.0]))
    response = respond(
        frictionless(spur_pair_machine()),
        operation,
        duration_s=0.8,
        start_s=-0.2,
        rng=np.random.default_rng(1),
        signals=("mesh_force_n",),
    )
    t, r1 = response.time_s, 51.683e-3
    for centre in (0.1, 0.3, 0.5):
        near = np.abs(t - centre) < 0.05
        wanted = float(np.mean(operation.torque_nm.at(t[near]))) / r1
        assert response["mesh_force_n"][near].mean() == pytest.approx(wanted, rel=0.02)


def test_speed_swing_is_followed() -> None:
    machine = replace(spur_pair_machine(), drive=Drive(swings=(SpeedSwing(0.03, 4.0),)))
    response = run(machine, ("input rotor angle velocity",), 1.0, 0.5)
    speed = response["input rotor angle velocity"]
    swing = 2 * np.abs(np.mean(speed * np.exp(-2j * np.pi * 4.0 * response.time_s)))
    assert swing / speed.mean() == pytest.approx(0.03, rel=0.02)


# --- contact loss and the flanks behind -------------------------------------------------------------------------------


def test_unloaded_gears_rattle_between_both_flanks() -> None:
    """A swinging speed without load: the driver strikes the flank ahead and the one behind, 2b apart."""
    base = replace(spur_pair_machine(), half_backlash_um=30.0, lubrication=Lubrication(friction=False))
    machine = replace(base, drive=Drive(swings=(SpeedSwing(0.05, 25.0),)))
    response = run(machine, ("mesh_force_n", "compression_m"), torque_nm=0.0)
    force, compression = response["mesh_force_n"], response["compression_m"]
    assert force.max() > 10.0
    assert force.min() < -10.0
    assert np.mean(force == 0.0) > 0.05
    assert np.ptp(compression) == pytest.approx(60e-6, rel=0.15)


def test_loaded_flanks_stay_in_touch() -> None:
    response = run(spur_pair_machine(), ("mesh_force_n",))
    assert response["mesh_force_n"].min() > 0.0
