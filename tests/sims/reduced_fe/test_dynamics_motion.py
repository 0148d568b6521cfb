"""The moving pair: balance, energy, order of the integrators, contact loss, backlash, restitution."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.effects import EffectSetting
from sims.machine import Operation, Profile
from sims.presets import preset
from sims.reduced_fe import (
    NAME,
    TRANSMISSION_ERROR,
    ReducedPair,
    check_convergence,
    constants,
    respond,
    start_state,
    torsional_mode,
)
from sims.simulator import SimulationSetup
from tests.sims.reduced_fe.flexible_pairs import pair_of, synthetic_pair

STEADY = Operation.steady(2000.0, 170.0)
STANDING = Operation.steady(0.0, 170.0)
UNDAMPED = {
    "mesh_damping_ratio": 0.0,
    "body_damping_ratio": 0.0,
    "torsional_damping_nm_s_per_rad": 0.0,
    "bending_damping_n_s_per_m": 0.0,
    "bearing_damping_n_s_per_m": 0.0,
}
RB_M = 0.0704769


def coasting(pair, *, moving_force=True, omega=120.0):
    """Constants without the drive's governor and a start with everything turning evenly: energy is conserved."""
    own = constants(pair, STANDING, moving_force=moving_force)
    own.record["governor"] = own.record["governor_spring"] = 0.0
    start = start_state(pair, own, STANDING, 0.0)
    v = np.array([-side.inputs[-1] * omega for side in own.sides])
    return own, replace(start, v=v)


def drift(pair, step_s, method, *, duration_s=0.004, **kinds):
    own, start = coasting(pair, **kinds)
    run = respond(
        pair,
        STANDING,
        duration_s=duration_s,
        signals=("mesh_cycles", "mesh_force_n"),
        step_s=step_s,
        method=method,
        with_energy=True,
        first=start,
        ready=own,
    )
    return run, float(np.max(np.abs(run.energy_j - run.energy_j[0])))


CONTACT_J = 0.5 * 170.0 / RB_M * 9e-6
"""Energy that the loaded flanks hold, about."""


@pytest.mark.slow
@pytest.mark.parametrize("method", ["exponential", "newmark"])
def test_moving_contact_conserves_energy(method):
    pair = synthetic_pair(**UNDAMPED)
    run, coarse = drift(pair, 5e-6, method)
    _, fine = drift(pair, 1.25e-6, method)
    assert np.ptp(run["mesh_cycles"]) > 3.0  # pairs came and went
    assert coarse < 0.02 * CONTACT_J
    assert fine < 0.4 * coarse
    assert fine < 2e-3 * CONTACT_J


def test_without_the_torque_of_moving_stiffness_energy_appears_from_nowhere():
    pair = synthetic_pair(**UNDAMPED)
    with_it = drift(pair, 2.5e-6, "exponential")[1]
    without = drift(pair, 2.5e-6, "exponential", moving_force=False)[1]
    assert without > 50.0 * with_it


def test_standing_contact_conserves_energy_at_second_order():
    """Rotors let go of their balance by a step of torque; the contact's place all but stands."""
    pair = synthetic_pair(**UNDAMPED)
    drifts = []
    for step in (4e-6, 2e-6):
        own, start = coasting(pair, omega=0.0)
        rng = np.random.default_rng(3)
        start = replace(start, v=1e-3 * rng.standard_normal(start.v.shape))
        run = respond(
            pair,
            STANDING,
            duration_s=0.003,
            signals=("mesh_force_n",),
            step_s=step,
            with_energy=True,
            first=start,
            ready=own,
        )
        assert run["mesh_force_n"].min() > 0.0
        drifts.append(np.max(np.abs(run.energy_j - run.energy_j[0])))
    assert 2.3 < drifts[0] / drifts[1] < 6.0


@pytest.mark.parametrize("method", ["exponential", "newmark"])
def test_both_integrators_converge_at_second_order_to_the_same_motion(method):
    pair = synthetic_pair()
    own = constants(pair, STEADY)

    def run(step, way, stride):
        found = respond(pair, STEADY, duration_s=0.004, step_s=step, stride=stride, method=way, ready=own)
        return found[TRANSMISSION_ERROR]

    fine = run(1.25e-6 / 4.0, "newmark", 32)
    errors = [np.sqrt(np.mean((run(1e-5 / n, method, n) - fine) ** 2)) for n in (2, 4)]
    assert errors[0] / fine.std() < 0.01
    assert 2.5 < errors[0] / errors[1] < 7.0


def test_mean_force_is_torque_over_base_radius_and_the_error_is_that_of_the_hubs():
    pair = pair_of()
    names = ("mesh_force_n", TRANSMISSION_ERROR, "driver angle", "driven angle")
    run = respond(pair, STEADY, duration_s=0.3, signals=names, stride=4)
    whole = slice(-int(0.15 / run.interval_s), None)  # five revolutions
    assert run["mesh_force_n"][whole].mean() == pytest.approx(170.0 / RB_M, rel=2e-3)
    error = RB_M * (run["driver angle"] - run["driven angle"])
    assert run[TRANSMISSION_ERROR] == pytest.approx(error, abs=2e-8)


def test_turned_slowly_the_pair_follows_its_static_map():
    """Rigid shafts and bearings: what is left is the map's transmission error, at the hubs."""
    pair = pair_of(bending_stiffness_n_per_m=1e12, bearing_stiffness_n_per_m=1e12, torsional_damping_nm_s_per_rad=20.0)
    slow = Operation.steady(60.0, 170.0)
    run = respond(pair, slow, duration_s=0.06, signals=(TRANSMISSION_ERROR, "mesh_cycles"), step_s=1e-5, stride=5)
    late = run["mesh_cycles"] > 1.0
    cycles, error = run["mesh_cycles"][late], run[TRANSMISSION_ERROR][late]
    static = pair.maps(np.array([170.0]), np.ascontiguousarray(cycles)).transmission_error_m[:, 0]
    assert len(cycles) > 200
    assert error.mean() == pytest.approx(static.mean(), rel=0.02)
    assert np.sqrt(np.mean((error - static - np.mean(error - static)) ** 2)) < 0.08 * np.std(static)


@pytest.mark.parametrize("ratio", [0.03, 0.08])
def test_free_decay_has_the_logarithmic_decrement_of_the_damping_ratio(ratio):
    """δ = 2πζ/√(1 − ζ²): 0.504 at 8 %."""
    pair = pair_of("light_damping_50_50", mesh_damping_ratio=ratio)
    own = constants(pair, STANDING)
    mode = torsional_mode(pair, STANDING, ready=own)
    start = start_state(pair, own, STANDING, 0.0)
    kicked = replace(start, v=1e-4 * own.stacked("rigid"))
    runs = [
        respond(pair, STANDING, duration_s=0.004, step_s=1e-6, first=first, ready=own)[TRANSMISSION_ERROR]
        for first in (kicked, start)
    ]
    ringing = runs[0] - runs[1]
    ringing -= np.convolve(ringing, np.ones(369) / 369.0, "same")  # rotors on their couplings
    spectrum_s = 1.0 / mode.frequency_hz
    peaks = [i for i in range(250, 2600) if ringing[i] > 0 and ringing[i] == ringing[max(i - 150, 0) : i + 150].max()]
    assert np.diff(peaks).mean() * 1e-6 == pytest.approx(spectrum_s, rel=0.05)
    decrement = np.log(ringing[peaks[0]] / ringing[peaks[3]]) / 3.0
    assert decrement == pytest.approx(2.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2), rel=0.12)


def test_reversed_torque_is_carried_by_the_flanks_behind_across_the_backlash():
    pair = pair_of(half_backlash_um=40.0)
    turned = Operation(Profile.constant(600.0), Profile.of([0.0, 0.01, 0.02, 1.0], [170.0, 170.0, 0.0, 0.0]))
    own = constants(pair, turned)
    names = ("mesh_force_n", "back_force_n", TRANSMISSION_ERROR)
    first = respond(pair, turned, duration_s=0.01, signals=names, ready=own)
    # The load's inertia drives back: the governor brakes the input.
    braking = Operation(Profile.of([0.0, 0.2], [600.0, 300.0]), Profile.constant(0.0))
    coast = respond(pair, braking, duration_s=0.2, signals=names, ready=constants(pair, braking), first=first.last)
    back = coast["back_force_n"] > 0.0
    drive = coast["mesh_force_n"] > 0.0
    assert not np.any(back & drive)
    assert np.any(back)
    depth = -coast[TRANSMISSION_ERROR][back]
    assert depth.min() > 75e-6  # 80 µm of play, less what shafts yield


@pytest.mark.parametrize(("runout_um", "is_wedged"), [(100.0, False), (170.0, True)])
def test_runout_takes_up_the_play_by_twice_the_sine_of_what_it_brings_the_gears_nearer(runout_um, is_wedged):
    pair = pair_of(half_backlash_um=40.0, runout_driver_um=runout_um)  # 2 sin 20° e: 68 and 116 of 80 µm
    slow = Operation.steady(600.0, 170.0)
    run = respond(pair, slow, duration_s=0.12, step_s=8e-6, signals=("back_force_n",), ready=constants(pair, slow))
    assert np.any(run["back_force_n"] > 0.0) == is_wedged


def test_uneven_pitch_takes_up_no_play_for_both_flanks_of_a_tooth_are_out_of_place():
    pair = pair_of(half_backlash_um=40.0)
    late_um = 60.0 * np.sin(2.0 * np.pi * np.arange(50) / 50)  # neighbours differ by 7.5 µm, teeth across by 120 µm
    mesh = pair.machine.mesh
    flank = replace(mesh.flank_1, pitch_um=tuple(late_um.tolist()))
    uneven = replace(pair, machine=replace(pair.machine, mesh=replace(mesh, flank_1=flank)))
    slow, names = Operation.steady(600.0, 170.0), ("back_force_n", TRANSMISSION_ERROR)
    run = respond(uneven, slow, duration_s=0.12, step_s=8e-6, signals=names, ready=constants(uneven, slow))
    assert np.ptp(run[TRANSMISSION_ERROR]) > 100e-6
    assert not np.any(run["back_force_n"] > 0.0)


def test_runs_go_on_where_others_ended():
    pair = synthetic_pair()
    whole = respond(pair, STEADY, duration_s=0.004)[TRANSMISSION_ERROR]
    first = respond(pair, STEADY, duration_s=0.002)
    second = respond(pair, STEADY, duration_s=0.002, start_s=0.002, first=first.last)
    joined = np.concatenate((first[TRANSMISSION_ERROR], second[TRANSMISSION_ERROR]))
    assert joined == pytest.approx(whole, abs=1e-12)
    assert respond(pair, STEADY, duration_s=0.004, steps_per_call=150)[TRANSMISSION_ERROR] == pytest.approx(
        whole, abs=1e-12
    )


def test_restitution_turns_the_closing_speed_round():
    """Gears thrown at each other across open play: at contact the closing speed turns round by e."""
    pair = synthetic_pair(**UNDAMPED, restitution=0.5)
    empty = Operation.steady(0.0, 0.0)
    own = constants(pair, empty)
    own.record["governor"] = own.record["governor_spring"] = 0.0
    start = start_state(pair, own, empty, 0.0)
    rows = own.stacked("rigid")
    start = replace(start, v=0.05 * rows / np.sum(rows**2), q=-1e-6 * rows / np.sum(rows**2))
    step = 1e-7

    def run(n_steps):
        return respond(
            pair, empty, duration_s=n_steps * step, signals=("mesh_force_n",), step_s=step, first=start, ready=own
        )

    onset = int(np.argmax(run(500)["mesh_force_n"] > 0.0))
    assert onset > 10
    before, after = (float(np.sum(rows * run(n).last.v)) for n in (onset - 1, onset))
    assert before > 0.01
    assert after == pytest.approx(-0.5 * before, rel=0.03)
    with pytest.raises(InputError, match="restitution"):
        replace(pair, restitution=1.5)


@pytest.mark.slow
def test_all_slices_give_the_motion_of_mirrored_ones():
    """A misalignment of a femtometre keeps all five slices apart."""
    halves, whole = pair_of(), pair_of(lead_error_um=1e-9)
    own, all_of = constants(halves, STEADY), constants(whole, STEADY)
    assert (own.table.n_slices, all_of.table.n_slices) == (3, 5)
    first = respond(halves, STEADY, duration_s=0.02, ready=own, step_s=2e-6, method="newmark")
    second = respond(whole, STEADY, duration_s=0.02, ready=all_of, step_s=2e-6, method="newmark")
    off = first[TRANSMISSION_ERROR] - second[TRANSMISSION_ERROR]
    assert np.sqrt(np.mean(off**2)) < 2e-3 * first[TRANSMISSION_ERROR].std()


@pytest.mark.slow
def test_convergence_of_the_preset_is_stated():
    found = check_convergence(pair_of(), STEADY, 5e-6, 0.02)
    assert found.converged
    assert check_convergence(pair_of(), STEADY, 2e-5, 0.01).steps_s[0] < 2e-5  # what a simulation would take


def test_unknown_signals_are_refused():
    with pytest.raises(InputError, match="did you mean mesh_force_n"):
        respond(pair_of(), STEADY, duration_s=1e-3, signals=("mesh_force",))


def test_a_run_starts_on_a_tooth_that_stands_ahead_of_its_place():
    """At next to no load a tooth ahead carries before the others would touch: the balance lies below their contact."""
    chosen, operation = preset(NAME, "flexible_50_50"), Operation.steady(2000.0, 1.0)
    for seed in range(4):
        setting = EffectSetting("pitch_error", 50.0, {})
        pair = (
            ReducedPair().prepare(SimulationSetup(chosen, {}, (setting,), operation), np.random.default_rng(seed)).pair
        )
        response = respond(pair, operation, duration_s=1e-4)
        assert response["mesh_force_n"][0] == pytest.approx(1.0 / RB_M, rel=0.3)
