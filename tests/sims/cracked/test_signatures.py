"""Each effect shows where theory says it does, and the healthy machine does not show it there.

Without noise the healthy machine is periodic in the mesh: its other lines are the integrator's rounding. So "shows"
means orders of magnitude, and amplitudes are compared with closed forms where there are any.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from math import pi, radians

import numpy as np
import pytest
from scipy.signal import hilbert

from gearsig.checks import FloatArray
from gearsig.recording import Recording
from sims.cracked import respond, simulate_with_motion
from sims.effects import EffectSetting, with_effects
from sims.gear_pair import MeasuredRun
from sims.machine import Machine, Operation
from tests.sims.machines import TEETH, spur_pair_machine

Z = TEETH[0]
SPEED_RPM, TORQUE_NM = 1000.0, 110.0
OMEGA = SPEED_RPM * pi / 30.0
ERROR, FORCE = "transmission_error_m", "mesh_force_n"
ACCELERATION = "bearing 1 y acceleration"
CONTACT_RATIO = spur_pair_machine().mesh.pair.contact_ratio
BPFO, BPFI = (9 / 2 * (1 - 7.94 / 39.04), 9 / 2 * (1 + 7.94 / 39.04))
TOOTH_LOCAL = [("root_crack", 3.0), ("tooth_spall", 60.0), ("chipped_tooth", 1.5)]
TOOTH = 20  # from 0, as rows of teeth are; effects count from 1
FLOOR = 1e-5
"""m/s², above the healthy machine's lines off the mesh harmonics."""
OUTPUT_ORDER = TEETH[0] / TEETH[1]
"""Revolutions of the output shaft per revolution of the input shaft."""
HUNTING = 15
"""Revolutions of the driver after which the same teeth meet again: 15 · 55 = 11 · 75."""
POINTS_PER_MESH = 64
SIGNALS = (
    "driver angle",
    "driver angle velocity",
    "transmission_error_m",
    "mesh_force_n",
    "driver x",
    *(f"bearing {b} {axis} acceleration" for b in (1, 3) for axis in "xy"),
)


@dataclass(frozen=True)
class Run:
    """Signals at the integrator's steps over a hunting period; tooth 0 of both gears enters at its start.

    Parameters
    ----------
    revolutions : array
        Of the driver, since that start.
    signals : mapping
    """

    revolutions: FloatArray
    signals: dict[str, FloatArray]

    def line(self, signal: str, order: float) -> float:
        """Amplitude at any order of the driver, by a Hann window over the angle.

        Taken from the integrator's own steps: coarser ones would fold mesh harmonics onto low orders. Over a hunting
        period, lines 2/15 of an order away do not count.
        """
        x, u = self.signals[signal], self.revolutions
        # Even in time: weights by angle would turn the mesh's own wiggle of the speed into lines at low orders.
        weight = 1.0 - np.cos(2 * np.pi * u / np.round(u[-1]))
        weight /= weight.sum()
        return float(2 * abs(np.sum((x - np.sum(x * weight)) * weight * np.exp(-2j * np.pi * order * u))))

    def lines(self, signal: str, orders: Iterable[float]) -> FloatArray:
        """Amplitudes at several orders."""
        return np.array([self.line(signal, order) for order in orders])

    def residual_over_teeth(self, signal: str, teeth: int) -> FloatArray:
        """Synchronous average of a gear with `teeth`, less what all teeth share: (teeth, POINTS_PER_MESH).

        Row k holds the mesh cycle that begins when tooth k enters. For smooth signals.
        """
        n = round(self.revolutions[-1]) * TEETH[0]
        mesh_cycles = np.arange(n * POINTS_PER_MESH) / POINTS_PER_MESH
        x = np.interp(mesh_cycles / TEETH[0], self.revolutions, self.signals[signal])
        over_teeth = x.reshape(-1, teeth, POINTS_PER_MESH).mean(axis=0)
        residual: FloatArray = over_teeth - over_teeth.mean(axis=0)
        return residual


def run(*settings: EffectSetting, speed_rpm: float = SPEED_RPM, torque_nm: float = TORQUE_NM) -> Run:
    """Run the machine with effects; the start has died out."""
    return run_machine(with_effects(spur_pair_machine(), settings, np.random.default_rng(0)), speed_rpm, torque_nm)


def run_machine(machine: Machine, speed_rpm: float = SPEED_RPM, torque_nm: float = TORQUE_NM) -> Run:
    """Run a machine over the second hunting period."""
    response = respond(
        machine,
        Operation.steady(speed_rpm, torque_nm),
        duration_s=2.1 * HUNTING * 60.0 / speed_rpm + 0.05,
        rng=np.random.default_rng(1),
        signals=SIGNALS,
    )
    revolutions = response["driver angle"] / (2 * np.pi) - HUNTING
    inside = (revolutions >= 0.0) & (revolutions < HUNTING)
    assert revolutions[-1] > HUNTING
    return Run(revolutions[inside], {name: response[name][inside] for name in SIGNALS})


@cache
def healthy(speed_rpm: float = SPEED_RPM) -> Run:
    """Run the machine without any effect."""
    return run(speed_rpm=speed_rpm)


@lru_cache(maxsize=8)  # a run keeps some 16 MB
def faulty(name: str, severity: float, **options: float | str) -> Run:
    return run(EffectSetting(name, severity, options))


def kurtosis(x: FloatArray) -> float:
    return float(np.mean((x - x.mean()) ** 4) / x.var() ** 2)


def test_the_healthy_machine_has_mesh_harmonics_and_nothing_else() -> None:
    baseline = healthy()
    assert baseline.lines(ACCELERATION, [Z, 2 * Z, 3 * Z]).min() > 1.0
    others = [1, 2, 6, OUTPUT_ORDER, 2 * OUTPUT_ORDER, BPFO, BPFI, Z - 1, Z + 1, Z - OUTPUT_ORDER, 2.4]
    assert baseline.lines(ACCELERATION, others).max() < FLOOR


@pytest.mark.parametrize(("name", "severity"), TOOTH_LOCAL)
@pytest.mark.parametrize("gear", ["driver", "driven"])
def test_a_tooth_shows_as_a_burst_at_its_angle(name: str, severity: float, gear: str) -> None:
    teeth = TEETH[gear == "driven"]
    ill = faulty(name, severity, gear=gear, tooth=TOOTH + 1)
    residual = ill.residual_over_teeth(ERROR, teeth)
    row, column = np.unravel_index(np.abs(residual).argmax(), residual.shape)
    in_mesh = row - TOOTH + column / residual.shape[1]
    assert -0.1 < in_mesh < CONTACT_RATIO + 0.1
    assert kurtosis(residual.ravel()) > 20.0
    assert np.abs(healthy().residual_over_teeth(ERROR, teeth)).max() < 0.01 * np.abs(residual).max()


@pytest.mark.parametrize(("name", "severity"), TOOTH_LOCAL)
@pytest.mark.parametrize("gear", ["driver", "driven"])
def test_a_tooth_makes_low_wide_sidebands_of_its_own_shaft(name: str, severity: float, gear: str) -> None:
    ill = faulty(name, severity, gear=gear, tooth=TOOTH + 1)
    own, other = (1.0, OUTPUT_ORDER) if gear == "driver" else (OUTPUT_ORDER, 1.0)
    low = ill.lines(ERROR, own * np.arange(1, 11))
    assert low.max() < 1.2 * low.min()  # a pulse has a flat spectrum far below one over its duration
    assert ill.lines(ACCELERATION, Z + own * np.array([-3, -2, -1, 1, 2, 3])).min() > 300 * FLOOR
    assert ill.lines(ACCELERATION, Z + other * np.array([-2, -1, 1, 2])).max() < 30 * FLOOR


@pytest.mark.slow
@pytest.mark.parametrize(("name", "severities"), [(n, (0.4 * s, 0.7 * s, s)) for n, s in TOOTH_LOCAL])
def test_a_tooth_s_burst_grows_with_the_damage(name: str, severities: tuple[float, ...]) -> None:
    energy = [faulty(name, s).residual_over_teeth(ERROR, Z).std() for s in severities]
    assert energy[0] < energy[1] < energy[2]


def test_a_chip_shows_in_recess_on_the_driver_and_in_approach_on_the_driven_gear() -> None:
    """The driver's tip is in mesh as the pair leaves, the driven gear's as it enters."""
    change = {}
    for gear, teeth in zip(("driver", "driven"), TEETH, strict=True):
        residual = np.abs(faulty("chipped_tooth", 1.5, gear=gear).residual_over_teeth(ERROR, teeth)).ravel()
        cycles = np.arange(len(residual)) / residual.size * teeth
        near = cycles < CONTACT_RATIO
        change[gear] = np.sum(cycles[near] * residual[near]) / np.sum(residual[near])
    assert change["driver"] > CONTACT_RATIO / 2 > change["driven"]


def test_wear_changes_mesh_harmonics_alone() -> None:
    ill = faulty("tooth_wear", 50.0)
    assert ill.line(ERROR, Z) > 3 * healthy().line(ERROR, Z)
    assert ill.lines(ACCELERATION, [1, OUTPUT_ORDER, Z - 1, Z + 1, Z - OUTPUT_ORDER]).max() < 10 * FLOOR


def test_little_wear_acts_as_a_relief() -> None:
    assert faulty("tooth_wear", 10.0).line(ERROR, Z) < 0.8 * healthy().line(ERROR, Z)


def test_pitch_errors_show_at_all_orders_of_their_shaft_and_at_no_tooth() -> None:
    ill = faulty("pitch_error", 5.0)
    own, other = ill.lines(ERROR, range(1, 11)), ill.lines(ERROR, OUTPUT_ORDER * np.array([1, 2, 5]))
    assert np.median(own) > 0.2e-6
    assert other.max() < 1e-3 * own.min()
    assert kurtosis(ill.residual_over_teeth(ERROR, Z).ravel()) < 4.0
    assert ill.lines(ACCELERATION, [Z - 2, Z - 1, Z + 1, Z + 2]).min() > 0.05


def test_flank_roughness_shows_at_orders_of_both_shafts() -> None:
    ill = faulty("surface_roughness", 0.8, locked_to="flank")
    neither = ill.lines(ERROR, [2.4, 6.4, 9.4]).max()
    for order in (1.0, OUTPUT_ORDER):
        assert np.median(ill.lines(ERROR, order * np.arange(1, 11))) > 1000 * neither
    assert kurtosis(ill.residual_over_teeth(ERROR, Z).ravel()) < 4.0


def test_time_locked_roughness_shows_at_its_fixed_frequencies() -> None:
    ill = faulty("surface_roughness", 0.8, locked_to="time")
    fixed_hz = 1.0312 * 1.5 ** np.arange(9, 13)
    assert ill.lines(ERROR, fixed_hz / (SPEED_RPM / 60.0)).min() > 30 * ill.lines(ERROR, [2.2, 4.9, 6.6]).max()


@pytest.mark.parametrize("added", [0.05, 0.2])
def test_friction_shows_across_the_line_of_action_in_proportion(added: float) -> None:
    """Coulomb's force changes by twice its size at the pitch point: harmonics that the film's hardly has."""
    ill, half, baseline = faulty("sliding_friction", added), faulty("sliding_friction", added / 2.0), healthy()
    orders = [Z, 2 * Z, 3 * Z]
    across = [run.lines("driver x", orders) for run in (ill, half, baseline)]
    assert across[0][1:].min() > 3.0 * across[2][1:].max()
    assert across[0][1:] == pytest.approx(2.0 * across[1][1:], rel=0.25)
    assert ill.lines(ACCELERATION, [1, Z - 1, Z + 1]).max() < FLOOR


@pytest.mark.parametrize(("gear", "order"), [("driver", 1.0), ("driven", OUTPUT_ORDER)])
def test_eccentricity_is_transmission_error_at_its_shaft_s_order(gear: str, order: float) -> None:
    ill = faulty("eccentricity", 20.0, gear=gear)
    assert ill.line(ERROR, order) == pytest.approx(20e-6, rel=0.01)
    first = ill.lines(ACCELERATION, [Z - order, Z + order])
    assert first.min() > 300 * FLOOR
    assert ill.lines(ACCELERATION, [Z - 2 * order, Z + 2 * order]).max() < 0.05 * first.min()
    other = OUTPUT_ORDER if gear == "driver" else 1.0
    assert ill.lines(ACCELERATION, [other, Z - other, Z + other]).max() < 10 * FLOOR


@pytest.mark.slow
@pytest.mark.parametrize("speed_rpm", [1000.0, 2000.0])
def test_unbalance_pushes_the_bearings_with_the_square_of_the_speed(speed_rpm: float) -> None:
    """Far below resonance: half of u ω² on either bearing's spring, so an acceleration of u ω⁴/(2k)."""
    ill = run(EffectSetting("unbalance", 500.0), speed_rpm=speed_rpm)
    omega = speed_rpm * pi / 30.0
    expected = 500e-6 * omega**4 / (2 * 2e8)
    for axis in "xy":
        assert ill.line(f"bearing 1 {axis} acceleration", 1.0) == pytest.approx(expected, rel=0.15)
    assert healthy(speed_rpm).line(ACCELERATION, 1.0) < 0.01 * expected
    assert ill.line(ERROR, 1.0) < 0.1 * faulty("eccentricity", 20.0).line(ERROR, 1.0)


@pytest.mark.parametrize("angle_deg", [0.5, 2.0])
def test_misalignment_bends_the_shaft_at_its_second_order(angle_deg: float) -> None:
    """β T/(2 L) at order 2 on either bearing."""
    ill = faulty("misalignment", angle_deg)
    force = radians(angle_deg) * TORQUE_NM / (2 * 0.1)
    expected = (2 * OMEGA) ** 2 * force / 2e8
    assert ill.line(ACCELERATION, 2.0) == pytest.approx(expected, rel=0.05)
    assert ill.lines(ACCELERATION, [1, 3]).max() < 0.01 * expected


def test_a_stiff_coupling_bends_the_shaft_beyond_what_torque_does() -> None:
    """β K/(2 L) at order 2 as well, a quarter of a period from the torque's: the two add as squares."""
    healthy, bends = spur_pair_machine(), 200.0
    stiff = replace(healthy.shafts[0], coupling_bending_nm_per_rad=bends)
    setting = EffectSetting("misalignment", 1.0, {})
    machine = with_effects(replace(healthy, shafts=(stiff, healthy.shafts[1])), [setting], np.random.default_rng(0))
    force = radians(1.0) * np.hypot(TORQUE_NM, bends) / (2 * 0.1)
    found = run_machine(machine).line(ACCELERATION, 2.0)
    assert found == pytest.approx((2 * OMEGA) ** 2 * force / 2e8, rel=0.05)


@pytest.mark.slow
def test_misalignment_twists_with_the_square_of_the_angle() -> None:
    single, double = (faulty("misalignment", angle, shaft="driven") for angle in (1.0, 2.0))
    order = 2 * OUTPUT_ORDER
    assert double.line(FORCE, order) == pytest.approx(4 * single.line(FORCE, order), rel=0.02)
    assert single.line(FORCE, order) > 100 * max(healthy().line(FORCE, order), single.line(FORCE, OUTPUT_ORDER))


@pytest.mark.slow
@pytest.mark.parametrize("order", [6.0, 2.4])
def test_torque_ripple_is_a_line_of_the_mesh_force_at_its_order(order: float) -> None:
    """The mesh passes on what the inertias behind it leave: J₂*/(J₁ + J₂*) of the ripple, J₂* seen from the driver."""
    ill, machine = faulty("torque_ripple", 5.0, order=order), spur_pair_machine()
    before = machine.shafts[0].rotor_inertia_kg_m2 + machine.wheels[0].inertia_kg_m2
    behind = (machine.shafts[1].rotor_inertia_kg_m2 + machine.wheels[1].inertia_kg_m2) / machine.ratio**2
    static = 0.05 * TORQUE_NM / (machine.mesh.pair.driver.base_radius_mm * 1e-3)
    assert ill.line(FORCE, order) == pytest.approx(static * behind / (before + behind), rel=0.05)
    assert ill.lines(FORCE, [order - 1, order + 1]).max() < 0.01 * ill.line(FORCE, order)
    assert ill.lines(ACCELERATION, [Z - order, Z + order]).min() > 300 * FLOOR


def test_speed_fluctuation_swings_the_speed_by_its_amount() -> None:
    ill, order = faulty("speed_fluctuation", 2.0, frequency_hz=10.0), 10.0 / (SPEED_RPM / 60.0)
    swing = ill.line("driver angle velocity", order)
    assert swing == pytest.approx(0.02 * OMEGA, rel=0.03)
    assert healthy().line("driver angle velocity", order) < 1e-5 * swing


@pytest.mark.slow
def test_backlash_shows_only_where_teeth_separate() -> None:
    """Loaded, the run is the same to the last bit; without torque, teeth rattle from flank to flank."""
    loaded = faulty("backlash", 100.0)
    np.testing.assert_array_equal(loaded.signals[FORCE], healthy().signals[FORCE])
    swing = EffectSetting("speed_fluctuation", 5.0, {"frequency_hz": 20.0})
    tight, loose = (run(swing, EffectSetting("backlash", added), torque_nm=0.0) for added in (0.0, 100.0))
    play_um = [1e6 * np.ptp(r.signals[ERROR]) for r in (tight, loose)]
    # 2b and what flanks, shafts and bearings give under the impacts.
    assert 40.0 < play_um[0] < 55.0
    assert 140.0 < play_um[1] < 170.0


def envelope_lines(ill: Run, orders: FloatArray) -> FloatArray:
    """Lines of the squared envelope of what the defect adds to the healthy machine."""
    n = min(len(ill.revolutions), len(healthy().revolutions))
    added = ill.signals[ACCELERATION][:n] - np.interp(
        ill.revolutions[:n], healthy().revolutions, healthy().signals[ACCELERATION]
    )
    return Run(ill.revolutions[:n], {"envelope": np.abs(hilbert(added)) ** 2}).lines("envelope", orders)


@pytest.mark.slow
@pytest.mark.parametrize(("race", "order"), [("outer", BPFO), ("inner", BPFI)])
def test_a_race_defect_knocks_at_its_passing_order(race: str, order: float) -> None:
    ill = faulty(f"bearing_{race}_race", 2.0, jitter_percent=0.0, slip_percent=0.0)
    assert ill.lines(ACCELERATION, order * np.arange(1, 5)).min() > 0.05
    assert healthy().lines(ACCELERATION, order * np.arange(1, 5)).max() < FLOOR
    scan = np.arange(2.0, 8.0, 0.05)
    strongest = scan[envelope_lines(ill, scan).argmax()]
    assert strongest == pytest.approx(order, abs=0.1)


@pytest.mark.slow
def test_only_the_inner_race_is_modulated_by_its_shaft() -> None:
    """It turns through the load zone once per revolution; the outer race stands in it."""
    ratio = {}
    for race, order in (("outer", BPFO), ("inner", BPFI)):
        ill = faulty(f"bearing_{race}_race", 2.0, jitter_percent=0.0, slip_percent=0.0)
        middle, below, above = envelope_lines(ill, np.array([order, order - 1, order + 1]))
        ratio[race] = (below + above) / middle
    assert ratio["inner"] > 0.5
    assert ratio["outer"] < 0.05


@pytest.mark.slow
def test_slip_and_jitter_move_and_smear_the_passing_order() -> None:
    ill = faulty("bearing_outer_race", 2.0, jitter_percent=0.0, slip_percent=3.0)
    assert ill.line(ACCELERATION, 4 * 0.97 * BPFO) > 30 * ill.line(ACCELERATION, 4 * BPFO)
    sharp, smeared = (
        faulty("bearing_outer_race", 2.0, jitter_percent=jitter, slip_percent=0.0).line(ACCELERATION, 8 * BPFO)
        for jitter in (0.0, 5.0)
    )
    assert smeared < 0.5 * sharp


@pytest.mark.slow
def test_clearance_shows_at_the_elements_passing_and_beside_the_mesh() -> None:
    little, middle, much = (faulty("bearing_clearance", added) for added in (10.0, 30.0, 60.0))
    orders = BPFO * np.arange(1, 5)
    # In both directions together: the path of the shaft's centre turns with the clearance.
    size = [
        np.hypot(*(r.lines(f"bearing 1 {axis} acceleration", orders) for axis in "xy")) for r in (little, middle, much)
    ]
    assert np.all(1.5 * size[0] < size[1])
    assert np.all(1.5 * size[1] < size[2])
    assert size[0].min() > 1000 * FLOOR
    assert middle.lines(ACCELERATION, [Z - BPFO, Z + BPFO]).min() > 100 * FLOOR


def recorded(*settings: EffectSetting, speed_rpm: float = 1200.0) -> Recording:
    """One second; at 1200 rpm the mesh harmonics stand at multiples of 1100 Hz."""
    machine = with_effects(spur_pair_machine(), settings, np.random.default_rng(0))
    run = MeasuredRun(np.random.default_rng(0), 20480.0, 1.0)
    return simulate_with_motion(machine, Operation.steady(speed_rpm, TORQUE_NM), run)[0]


def spectrum(recording: Recording) -> FloatArray:
    """Amplitudes at whole hertz, by a Hann window."""
    x = recording.samples[0]
    window = np.hanning(len(x) + 1)[:-1]
    result: FloatArray = 4 * np.abs(np.fft.rfft(window * (x - x.mean()))) / len(x)
    return result


@pytest.mark.slow
def test_a_path_mode_raises_what_lies_in_its_band() -> None:
    """|1 + 2ζA/(1 − r² + 2jζr)| at every mesh harmonic."""
    added = EffectSetting("transfer_path", 8.0, {"frequency_hz": 3300.0, "damping_ratio": 0.05})
    harmonics = np.arange(1, 6) * 1100
    ratio = spectrum(recorded(added))[harmonics] / spectrum(recorded())[harmonics]
    r = harmonics / 3300.0
    assert ratio == pytest.approx(np.abs(1 + 0.8 / (1 - r**2 + 0.1j * r)), rel=0.02)


@pytest.mark.slow
def test_hum_stands_at_its_frequency_whatever_the_speed() -> None:
    hum = EffectSetting("mains_hum", 0.5)
    for speed_rpm in (1200.0, 1500.0):
        assert spectrum(recorded(hum, speed_rpm=speed_rpm))[[50, 100, 150]] == pytest.approx(
            [0.5, 0.125, 0.125], rel=0.01
        )
        assert spectrum(recorded(speed_rpm=speed_rpm))[[50, 100, 150]].max() < 1e-3


@pytest.mark.slow
def test_clipping_cuts_the_tail_of_the_amplitudes() -> None:
    healthy, clipped = (recorded(*s).samples[0] for s in ((), (EffectSetting("clipping", 10.0),)))
    level = np.quantile(np.abs(healthy), 0.9)
    beyond = [np.mean(np.abs(x) > 1.1 * level) for x in (healthy, clipped)]
    assert 0.03 < beyond[0] < 0.1
    assert beyond[1] < beyond[0] / 4  # what is left is the anti-alias filter's overshoot
    assert kurtosis(clipped) < kurtosis(healthy)
