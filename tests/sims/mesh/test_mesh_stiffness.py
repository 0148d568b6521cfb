"""The mesh: published numbers, load sharing, transmission error, deviations, table."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    FlankDeviation,
    GearGeometry,
    GearMesh,
    Material,
    PairGeometry,
    RootCrack,
    ToothFaults,
    engagement_and_slope,
    mesh_stiffness,
    mesh_table,
    out_of_place,
    pair_force,
    pair_states,
    share_torque,
)


def steel_mesh(
    z1: int,
    z2: int,
    m: float,
    bore: float | None,
    e_gpa: float = 206.0,
    b: float = 20.0,
    law: str = "linear",
    **more: object,
) -> GearMesh:
    gears = (GearGeometry(z, m, face_width_mm=b, bore_radius_mm=bore) for z in (z1, z2))
    return GearMesh(PairGeometry(*gears), Material(e_gpa), Material(e_gpa), law, **more)  # type: ignore[arg-type]


CRACKED_PAIR = steel_mesh(55, 75, 2.0, 17.5)
CYCLES = np.linspace(0.0, 3.0, 301)


@pytest.mark.parametrize(
    ("mesh", "linear", "at_2_kn"),
    [
        (steel_mesh(50, 50, 3.0, 20.0), 3.76e8, 3.32e8),
        (steel_mesh(55, 75, 2.0, 17.5), 3.79e8, 3.35e8),
        # Bores not on record: the radius is chosen for the first value, so that only the second is a check.
        (steel_mesh(25, 30, 2.0, 7.0, 200.0), 3.32e8, 2.94e8),
        (steel_mesh(19, 48, 3.175, 20.0, 206.8, 16.0), 3.14e8, 2.76e8),
    ],
)
def test_mean_stiffness_against_the_trial_program(mesh: GearMesh, linear: float, at_2_kn: float) -> None:
    assert mesh_stiffness(mesh).mean_n_per_m == pytest.approx(linear, rel=0.015)
    loaded = mesh_stiffness(replace(mesh, contact_law="load-dependent"), force_n=2000.0)
    assert loaded.mean_n_per_m == pytest.approx(at_2_kn, rel=0.015)


def test_single_pair_minimum_and_crack_ratios_of_the_literature() -> None:
    """1.52e8 N/m (±8 %), and 0.967 and 0.908 of it (±2 %).

    Bore and crack sizes are not on record. The bore radius of 4.45 mm is chosen to give the first value, so that only
    the ratios are a check; they hold for cracks of 1 and 2 mm at 70°, assumed. With the default bore the minimum is
    2.47e8.
    """
    single = np.linspace(0.70, 0.95, 101)
    mesh = steel_mesh(30, 25, 2.0, 4.45, 200.0)
    lowest = mesh_stiffness(mesh, single).total_n_per_m.min()
    assert lowest == pytest.approx(1.52e8, rel=0.08)
    for depth, ratio in ((1.0, 0.967), (2.0, 0.908)):
        cracked = replace(mesh, cracks_1=(RootCrack(depth, 70.0),))
        assert mesh_stiffness(cracked, single).total_n_per_m.min() / lowest == pytest.approx(ratio, rel=0.02)


def test_drop_of_the_cracked_tooth_grows_with_depth_and_stays_on_it() -> None:
    """1 to 4 mm at 45°, as in the paper: only while tooth 0 touches, and in single contact most."""
    healthy = mesh_stiffness(CRACKED_PAIR, CYCLES).total_n_per_m
    single = (CYCLES > 0.80) & (CYCLES < 0.97)
    last = np.zeros_like(healthy)
    for depth in (1.0, 2.0, 3.0, 4.0):
        loss = healthy - mesh_stiffness(replace(CRACKED_PAIR, cracks_1=(RootCrack(depth),)), CYCLES).total_n_per_m
        assert loss[CRACKED_PAIR.pair.contact_ratio + 0.026 < CYCLES].max() == 0.0
        assert np.all(loss[single] > last[single])
        assert (loss / healthy)[single].max() > 1.5 * (loss / healthy)[CYCLES < 0.75].max()
        last = loss
    # The tooth comes round once per revolution.
    cracked = replace(CRACKED_PAIR, cracks_1=(RootCrack(4.0, tooth=7),))
    for turn in (0, 55, 110):
        at = mesh_stiffness(cracked, CYCLES + 7 + turn).total_n_per_m
        assert healthy - at == pytest.approx(last, abs=1e-3)


@given(
    st.integers(25, 80),
    st.integers(25, 80),
    st.floats(2.0, 60.0),
    st.floats(1.1, 4.0),
    st.floats(1.1, 3.0),
)
@settings(max_examples=30)
def test_linear_stiffness_is_proportional_to_the_width_and_knows_no_module(
    z1: int, z2: int, width: float, wider: float, larger: float
) -> None:
    first = mesh_stiffness(steel_mesh(z1, z2, 2.0, None, b=width)).total_n_per_m
    assert mesh_stiffness(steel_mesh(z1, z2, 2.0, None, b=width * wider)).total_n_per_m == pytest.approx(
        first * wider, rel=1e-9
    )
    assert mesh_stiffness(steel_mesh(z1, z2, 2.0 * larger, None, b=width)).total_n_per_m == pytest.approx(
        first, rel=1e-8
    )


@given(st.integers(25, 80), st.integers(25, 80), st.floats(0.01, 0.99))
@settings(max_examples=40)
def test_stiffness_is_symmetric_when_the_driven_gear_drives(z1: int, z2: int, cycles: float) -> None:
    """Run backwards, the pair at ζ is the pair at ε − ζ with the gears exchanged."""
    forth, back = steel_mesh(z1, z2, 2.0, None), steel_mesh(z2, z1, 2.0, None)
    ratio = forth.pair.contact_ratio
    one = mesh_stiffness(forth, np.array([cycles])).total_n_per_m
    two = mesh_stiffness(back, np.array([ratio - cycles])).total_n_per_m
    assert two == pytest.approx(one, rel=1e-8)


meshes = st.builds(
    lambda law, relief, pitch, depth, ramp: replace(
        CRACKED_PAIR,
        contact_law=law,
        ramp=ramp,
        flank_1=FlankDeviation(relief, 2.0, pitch_um=tuple(pitch * np.cos(np.arange(55)))),
        flank_2=FlankDeviation(relief, 1.0),
        cracks_1=(RootCrack(depth, tooth=1),),
    ),
    st.sampled_from(["linear", "load-dependent"]),
    st.floats(0.0, 30.0),
    st.floats(0.0, 8.0),
    st.floats(0.2, 4.0),
    st.sampled_from([0.0, 0.05, 0.1]),
)


@pytest.mark.slow
@given(meshes, st.floats(0.5, 400.0))
@settings(max_examples=60)
def test_pairs_share_exactly_the_load(mesh: GearMesh, torque_nm: float) -> None:
    """ΣN = T1/r_b1, no tension, and each force follows from its own approach: no pair carries through a gap."""
    shared = share_torque(mesh, torque_nm, CYCLES)
    force = torque_nm / (mesh.pair.driver.base_radius_mm * 1e-3)
    assert shared.pair_forces_n.sum(axis=1) == pytest.approx(force, rel=1e-11)
    assert shared.pair_forces_n.min() >= 0.0
    compliance, separation, weight = pair_states(mesh_table(mesh), CYCLES)
    own = shared.pair_forces_n / np.where(weight > 0, weight, 1.0)
    exponent = 0.9 if mesh.contact_law == "load-dependent" else 1.0
    approach = separation + compliance * own + mesh.contact_coefficient * own**exponent
    carrying = shared.pair_forces_n > 0.0
    delta = np.broadcast_to(shared.transmission_error_m[:, None], approach.shape)
    assert approach[carrying] == pytest.approx(delta[carrying], rel=1e-9, abs=1e-15)
    assert np.all(delta[~carrying & (weight > 0)] <= separation[~carrying & (weight > 0)] + 1e-15)


def test_static_force_and_error_of_the_cracked_pair() -> None:
    """110 N m at module 2: 2128 N; without deviations the error is force over stiffness, peaking in single contact."""
    shared = share_torque(CRACKED_PAIR, 110.0)
    assert shared.pair_forces_n.sum(axis=1) == pytest.approx(2128.0, abs=0.5)
    stiffness = mesh_stiffness(CRACKED_PAIR).total_n_per_m
    assert shared.transmission_error_m * stiffness == pytest.approx(110.0 / 51.683094e-3, rel=1e-7)
    assert shared.stiffness_n_per_m == pytest.approx(stiffness, rel=1e-9)
    peak = shared.mesh_cycles[np.argmax(shared.transmission_error_m)]
    assert 0.75 < peak < 1.0


def test_tangent_stiffness_is_the_slope_of_load_over_error() -> None:
    mesh = replace(CRACKED_PAIR, contact_law="load-dependent", flank_1=FlankDeviation(10.0, 1.5))
    step = 0.01
    low, high = (share_torque(mesh, 110.0 + s, CYCLES).transmission_error_m for s in (-step, step))
    slope = 2 * step / (mesh.pair.driver.base_radius_mm * 1e-3) / (high - low)
    middle = share_torque(mesh, 110.0, CYCLES)
    assert middle.stiffness_n_per_m == pytest.approx(slope, rel=1e-4)
    force = 110.0 / (mesh.pair.driver.base_radius_mm * 1e-3)
    assert mesh_stiffness(mesh, CYCLES, force).total_n_per_m == pytest.approx(middle.stiffness_n_per_m, rel=1e-9)


def test_load_dependent_contact_stiffens() -> None:
    mesh = replace(CRACKED_PAIR, contact_law="load-dependent")
    means = [mesh_stiffness(mesh, force_n=f).mean_n_per_m for f in (10.0, 100.0, 1000.0, 10000.0)]
    assert np.all(np.diff(means) > 0)
    with pytest.raises(InputError, match="force_n"):
        mesh_stiffness(mesh)


def test_tip_relief_unloads_the_ends_of_the_path() -> None:
    """A relief larger than the deflection keeps the entering pair out of contact until the relief has passed."""
    relieved = replace(CRACKED_PAIR, flank_1=FlankDeviation(60.0, 1.0), flank_2=FlankDeviation(60.0, 1.0))
    plain, relief = (share_torque(mesh, 110.0) for mesh in (CRACKED_PAIR, relieved))
    entering = (plain.mesh_cycles > 0.03) & (plain.mesh_cycles < 0.05)
    assert plain.pair_forces_n[entering, 0].min() > 500.0
    assert relief.pair_forces_n[entering, 0].max() == 0.0


def test_pitch_deviation_shifts_the_error_of_its_tooth() -> None:
    """In single contact the error rises by the whole deviation, and falls by it if the tooth is too far forward."""
    single = np.array([0.85, 1.85, 2.85])
    plain = share_torque(CRACKED_PAIR, 110.0, single).transmission_error_m
    pitch = (0.0,) * 1 + (5.0,) + (0.0,) * 53
    moved = share_torque(replace(CRACKED_PAIR, flank_1=FlankDeviation(pitch_um=pitch)), 110.0, single)
    assert moved.transmission_error_m - plain == pytest.approx([0.0, 5e-6, 0.0], abs=1e-12)


def test_ramp_keeps_the_mean_and_is_smooth() -> None:
    """Half the ramp lies before the ideal end, half after: the area under the weight stays the contact ratio."""
    places = np.linspace(-0.1, 2.0, 210001)
    for ramp in (0.02, 0.05, 0.1):
        weight = np.array([engagement_and_slope(p, 0.0, 1.7, ramp)[0] for p in places])
        assert np.trapezoid(weight, places) == pytest.approx(1.7, abs=1e-6)
        assert np.abs(np.diff(weight, 2)).max() < 6.0 / ramp**2 * 1e-10
    hard, soft = (mesh_stiffness(replace(CRACKED_PAIR, ramp=r)).mean_n_per_m for r in (0.0, 0.05))
    assert soft == pytest.approx(hard, rel=2e-3)


@given(st.floats(1e-9, 1e-3), st.floats(1e-10, 1e-7), st.floats(1e-10, 1e-6), st.floats(0.01, 1.0))
def test_force_of_a_pair_solves_its_law(penetration: float, compliance: float, contact: float, weight: float) -> None:
    force, slope = pair_force(penetration, compliance, contact, True, weight)
    own = force / weight
    assert compliance * own + contact * own**0.9 == pytest.approx(penetration, rel=1e-10)
    assert slope == pytest.approx(weight / (compliance + 0.9 * contact * own**-0.1), rel=1e-9)
    assert pair_force(-penetration, compliance, contact, True, weight) == (0.0, 0.0)


def test_three_pairs_touch_at_a_contact_ratio_above_two() -> None:
    gears = [GearGeometry(z, 2.0, addendum=1.3, dedendum=1.5, tool_tip_radius=0.2) for z in (60, 70)]
    mesh = GearMesh(PairGeometry(*gears))
    assert mesh.pair.contact_ratio > 2.05
    numbers = np.sum(share_torque(mesh, 100.0).pair_forces_n > 0.0, axis=1)
    assert set(numbers) == {2, 3}


def test_table_gives_what_the_formulas_give() -> None:
    mesh = replace(CRACKED_PAIR, cracks_2=(RootCrack(3.0, 60.0, tooth=74),))
    cycles = np.array([-0.6, 0.013, 0.49, 0.85])  # pair −1 is on tooth 54 of the driver and tooth 74 of the driven gear
    compliance, _, weight = pair_states(mesh_table(mesh), cycles)
    for row, c in enumerate(cycles):
        for j in range(mesh.n_slots):
            k = int(np.floor(c + mesh.ramp / 2)) - j
            if weight[row, j] > 0.0:
                faults = ToothFaults(crack=mesh.cracks_2[0] if k % 75 == 74 else None)
                direct = mesh.gear_compliance(1, np.array([c - k])) + mesh.gear_compliance(2, np.array([c - k]), faults)
                assert compliance[row, j] == pytest.approx(direct[0], rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"contact_law": "hard"}, "contact_law"),
        ({"ramp": 0.5}, "ramp"),
        ({"cracks_1": (RootCrack(40.0),)}, "past the tooth"),
        ({"cracks_1": (RootCrack(1.0), RootCrack(2.0))}, "two cracks"),
        ({"flank_1": FlankDeviation(10.0, 30.0)}, "tip_relief_length_mm"),
        ({"flank_2": FlankDeviation(pitch_um=(1.0, 2.0))}, "pitch_um"),
    ],
)
def test_meshes_that_cannot_be(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(CRACKED_PAIR, **change)  # type: ignore[arg-type]  # wrong on purpose


def test_loads_that_cannot_be() -> None:
    for torque in (0.0, -5.0, float("nan")):
        with pytest.raises(InputError, match="torque_nm"):
            share_torque(CRACKED_PAIR, torque)
    with pytest.raises(InputError, match="mesh_cycles"):
        share_torque(CRACKED_PAIR, 10.0, np.array([[0.0]]))


def test_where_a_pair_stands_passes_smoothly_from_tooth_to_tooth():
    teeth, pitch = np.array([3, 4]), np.array([[1.0, 2.0, 4.0, 0.0], [0.5, 0.0, -0.5, 0.0]])
    middle = 0.8
    at = [out_of_place(middle + k + 1e-12, middle, teeth, pitch) for k in (0, 1, 2, 13, -1)]
    assert [round(value, 12) for value, _ in at] == [1.5, 2.0, 3.5, 2.0, 4.0]  # pair k: teeth k mod 3 and k mod 4
    assert np.abs([slope for _, slope in at]).max() < 1e-20
    half = out_of_place(middle + 0.5, middle, teeth, pitch)
    assert half[0] == pytest.approx(1.75)
    step = 1e-6
    before, after = (out_of_place(middle + 0.3 + h, middle, teeth, pitch)[0] for h in (-step, step))
    assert out_of_place(middle + 0.3, middle, teeth, pitch)[1] == pytest.approx(
        (after - before) / (2.0 * step), rel=1e-5
    )
    for lost in (np.nan, np.inf, -1e30):
        assert np.isnan(out_of_place(lost, middle, teeth, pitch)).all()
