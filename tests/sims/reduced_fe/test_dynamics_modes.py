"""A side's modes, and the linear pair: what they must keep of the finite elements and of the machine."""

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.fe_gear import ready_gear
from sims.machine import Operation
from sims.reduced_fe import (
    constants,
    eigenfrequencies_hz,
    followed_step_s,
    growth,
    kept_modes,
    mirror_groups,
    residual_compliance,
    respond,
    spreading_check,
    step_coefficients,
    torsional_mode,
)
from tests.sims.reduced_fe.flexible_pairs import pair_of

OPERATION = Operation.steady(2000.0, 170.0)


@pytest.fixture(scope="module")
def pair():
    return pair_of()


@pytest.fixture(scope="module")
def ready(pair):
    return constants(pair, OPERATION)


def test_kept_modes_and_the_rest_make_up_the_static_compliance():
    gear = ready_gear("z50_m3")
    kept = kept_modes(gear, 20000.0, mirror_groups(5))
    modes = np.hstack([gear.modes_at(t)[kept.all] for t in (0, 1)])
    whole = residual_compliance(gear, [0, 1], kept.all)
    whole = whole + modes.T @ (modes / gear.angular_frequencies_rad_s[kept.all, None] ** 2)
    assert whole == pytest.approx(gear.compliance_m_per_n([0, 1]), abs=1e-18)
    assert np.linalg.eigvalsh(residual_compliance(gear, [0, 1], kept.all)).min() > 0.0
    n = gear.nodal_diameters[kept.pairs]
    assert np.all(n[:, 0] == n[:, 1])


def test_a_side_turns_as_a_whole_with_all_of_its_inertia(pair, ready):
    for index, side in enumerate(ready.sides):
        rigid = np.flatnonzero(side.omega_rad_s == 0.0)
        turning = rigid[np.abs(side.shapes[0, rigid]) > 0.0]
        assert len(turning) == 1
        shape = side.shapes[:, turning[0]]
        assert shape[[1, 10]] == pytest.approx(shape[0])  # gear and hub as the rotor
        inertia = pair.machine.wheels[index].inertia_kg_m2 + pair.machine.shafts[index].rotor_inertia_kg_m2
        assert 1.0 / shape[0] ** 2 == pytest.approx(inertia, rel=1e-9)
        # Modal forces of even acceleration belong to rigid turning alone.
        assert np.abs(np.delete(side.inputs[-1], turning)).max() < 1e-6 * np.abs(side.inputs[-1]).max()


def test_contact_moves_the_rigid_gear_by_its_base_radius(pair, ready):
    for sign, side, gear in zip((1.0, -1.0), ready.sides, (pair.machine.mesh.pair.driver,) * 2, strict=True):
        turned = side.inputs[1]  # modal coordinates' share in the gear's rotation
        rigid = side.rigid
        rotation = np.linalg.lstsq(side.shapes[:4].T, rigid, rcond=None)[0]
        assert rotation[1] == pytest.approx(sign * gear.base_radius_mm * 1e-3, rel=1e-6)
        assert turned == pytest.approx(side.shapes[1])


def test_torsional_mode_lies_where_the_source_has_it_with_the_stated_hub_inertia(pair):
    assert pair.machine.wheels[0].inertia_kg_m2 == pytest.approx(0.0120, abs=1e-4)
    light, *found = [torsional_mode(pair, Operation.steady(2000.0, t)).frequency_hz for t in (85.0, 170.0, 340.0)]
    assert min(found) > 2650.0
    assert max(found) < 2700.0
    assert light == pytest.approx(2604.0, abs=5.0)  # contact softens under less load
    bare = pair_of(hub_inertia_driver_kg_m2=0.0, hub_inertia_driven_kg_m2=0.0)
    assert 3300.0 < torsional_mode(bare, OPERATION).frequency_hz < 3700.0


def test_the_torsional_mode_is_that_of_two_inertias_on_the_mesh_spring():
    """ω_n = √(k r_b² (1/J1 + 1/J2)) where hubs are heavy and supports stiff, so that the bodies are springs alone."""
    heavy = {f"hub_inertia_{side}_kg_m2": 0.2 for side in ("driver", "driven")}
    pair = pair_of(bending_stiffness_n_per_m=1e12, bearing_stiffness_n_per_m=1e12, **heavy)
    k = pair.maps(np.array([170.0])).tangent_stiffness_n_per_m[:, 0]
    rb, inertia = pair.machine.mesh.pair.driver.base_radius_mm * 1e-3, pair.machine.wheels[0].inertia_kg_m2
    expected = np.mean(rb * np.sqrt(2.0 * k / inertia)) / (2.0 * np.pi)
    assert torsional_mode(pair, OPERATION).frequency_hz == pytest.approx(expected, rel=0.03)


@pytest.mark.study
def test_patches_smooth_the_pair_that_single_nodes_make_drop(pair):
    """Beside the section, which nodes hardly touch: at lines of nodes the mode drops and ripples, at patches not.

    All but a small part of a mesh cycle, tips included; what is left of the cycle is the true dip of single contact.
    """
    check = spreading_check(pair, OPERATION, np.concatenate((np.linspace(0.0, 0.82, 83), np.linspace(0.94, 1.0, 7))))
    section = check.frequency_hz["section"]
    beside = {spread: hertz / section for spread, hertz in check.frequency_hz.items()}
    assert section.min() > 0.975 * section.max()
    assert np.ptp(beside["patch"]) < 0.01
    assert np.ptp(beside["node"]) > 4.0 * np.ptp(beside["patch"])
    assert check.frequency_hz["patch"].min() > 0.975 * check.frequency_hz["patch"].max()
    assert check.frequency_hz["node"].min() < 0.955 * check.frequency_hz["node"].max()
    assert check.ripple["node"] > 4.0 * check.ripple["patch"]


def test_natural_frequencies_dip_where_one_pair_carries(pair):
    cycles = np.array([0.4, 0.88])
    frequencies = eigenfrequencies_hz(pair, Operation.steady(2000.0, 20.0), cycles)
    mode = int(np.argmin(np.abs(frequencies[0] - 2600.0)))
    assert frequencies[1, mode] < 0.95 * frequencies[0, mode]
    rigid, rotors = frequencies[:, 0], frequencies[:, 1:3]
    assert np.all(rigid < 0.1)
    assert np.all((rotors > 10.0) & (rotors < 200.0))


@pytest.mark.parametrize("ratio", [0.02, 0.08])
def test_contact_damping_makes_up_the_wanted_damping_ratio(ratio):
    pair = pair_of("light_damping_50_50", mesh_damping_ratio=ratio)
    own = constants(pair, OPERATION)
    mode = torsional_mode(pair, OPERATION, ready=own)
    omega = 2.0 * np.pi * mode.frequency_hz
    total = mode.other_damping_ratio + 0.5 * own.record["damping_time"] * omega * mode.contact_part
    assert total == pytest.approx(ratio)


def test_a_hub_lighter_than_the_toothed_body_is_refused(pair):
    from dataclasses import replace

    wheels = tuple(replace(w, inertia_kg_m2=0.005) for w in pair.machine.wheels)
    thin = replace(pair, machine=replace(pair.machine, wheels=wheels))
    with pytest.raises(InputError, match="toothed body"):
        constants(thin, OPERATION)


def heavy_hubs(inertia_kg_m2):
    return pair_of(**{f"hub_inertia_{side}_kg_m2": inertia_kg_m2 for side in ("driver", "driven")})


def test_damping_is_followed_up_to_where_it_is_refused():
    """A hub 6.5 times as heavy as its teeth lies just below the limit: the fast way is the reference's."""
    one, two = (respond(heavy_hubs(0.05), OPERATION, duration_s=0.1, method=m) for m in ("exponential", "newmark"))
    fast, reference = (np.std(response["mesh_force_n"][2000:]) for response in (one, two))
    assert fast == pytest.approx(reference, rel=0.01)


def test_what_others_left_in_memory_changes_nothing(monkeypatch):
    """Forces of a pair that comes near in a later pass of the reference's step start from numbers of this run."""
    pair = heavy_hubs(0.05)
    clean = respond(pair, OPERATION, duration_s=1e-3, method="newmark")["mesh_force_n"]

    def spoilt(shape, dtype=float, **_):
        return np.full(shape, 1e300 if dtype is float else 0, dtype)

    monkeypatch.setattr(np, "empty", spoilt)
    assert np.array_equal(respond(pair, OPERATION, duration_s=1e-3, method="newmark")["mesh_force_n"], clean)


@pytest.mark.parametrize(("method", "inertia"), [("exponential", 0.1), ("newmark", 1.0)])
def test_damping_that_light_bodies_behind_heavy_hubs_cannot_follow_is_refused(method, inertia):
    with pytest.raises(InputError, match=r"hub_inertia_driver_kg_m2: the contact is too stiff or too strongly damped"):
        respond(heavy_hubs(inertia), OPERATION, duration_s=1e-3, method=method)
    with pytest.raises(InputError, match=r"mesh_damping_ratio: .* 0\.56 and 0\.56 times the inertia"):
        respond(pair_of(mesh_damping_ratio=0.3), OPERATION, duration_s=1e-3)


def test_a_step_is_shortened_to_what_the_contact_can_be_followed_with(pair, ready):
    """Steps that a healthy pair is not followed with: its forces are many times those of shorter ones."""
    assert followed_step_s(pair, ready, OPERATION, 5e-6) == 5e-6
    step = followed_step_s(pair, ready, OPERATION, 40e-6)
    assert step < 40e-6
    coefficients = np.array([step_coefficients(s.omega_rad_s, s.damping_rate, 40e-6) for s in ready.sides])
    assert growth(pair, ready, OPERATION, coefficients) > 0.01
    found = [np.std(respond(pair, OPERATION, duration_s=0.1, step_s=h)["mesh_force_n"][-2000:]) for h in (step, 2e-6)]
    assert found[0] == pytest.approx(found[1], rel=0.1)


@pytest.mark.parametrize("method", ["exponential", "newmark"])
def test_coefficients_of_a_rigid_mode_are_those_of_free_flight(method):
    h = 1e-3
    a_qq, a_qv, a_vq, a_vv, b_q0, b_q1, b_v0, b_v1 = step_coefficients(np.zeros(1), np.zeros(1), h, method)[:, 0]
    assert (a_qq, a_vv, a_vq) == (1.0, 1.0, 0.0)
    assert a_qv == pytest.approx(h)
    assert b_q0 + b_q1 == pytest.approx(h * h / 2.0)
    assert (b_v0, b_v1) == (pytest.approx(h / 2.0), pytest.approx(h / 2.0))


def test_exponential_steps_are_exact_for_a_force_that_runs_straight():
    omega, ratio, h, n = 2.0 * np.pi * 900.0, 0.05, 1e-4, 40
    c = step_coefficients(np.array([omega]), np.array([2.0 * ratio * omega]), h)[:, 0]
    slope, q, v = 3.0, 1e-3, 0.2
    first = (q, v)
    for i in range(n):
        f0, f1 = slope * i * h, slope * (i + 1) * h
        q, v = c[0] * q + c[1] * v + c[4] * f0 + c[5] * f1, c[2] * q + c[3] * v + c[6] * f0 + c[7] * f1
    # q = slope (t − 2ζ/ω)/ω² and a decaying vibration.
    t, damped = n * h, omega * np.sqrt(1.0 - ratio**2)
    at = slope / omega**2
    q0, v0 = first[0] + 2.0 * ratio / omega * at, first[1] - at
    wave = q0 * np.cos(damped * t) + (v0 + ratio * omega * q0) / damped * np.sin(damped * t)
    expected = at * (t - 2.0 * ratio / omega) + np.exp(-ratio * omega * t) * wave
    assert q == pytest.approx(expected, rel=1e-10)
