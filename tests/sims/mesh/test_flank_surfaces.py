"""Whole flanks: wear by sliding, roughness that returns with its tooth, rows of the table."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gearsig.errors import InputError
from sims.mesh import (
    FlankDeviation,
    FlankRoughness,
    FractalSurface,
    GearGeometry,
    GearMesh,
    PairGeometry,
    ToothSpall,
    mesh_table,
    pair_states,
    share_torque,
    wear_profile,
)
from tests.sims.mesh.meshes import MESH, PAIR, PITCH_POINT, SINGLE, own_separation, own_stretch

SURFACE = FractalSurface.of_roughness(0.84)


def rough(seed: int = 0) -> GearMesh:
    rng = np.random.default_rng(seed)
    return replace(
        MESH,
        roughness_1=FlankRoughness.draw(SURFACE, 55, rng),
        roughness_2=FlankRoughness.draw(SURFACE, 75, rng),
    )


pairs = st.builds(
    lambda z1, z2, m: PairGeometry(GearGeometry(z1, m), GearGeometry(z2, m)),
    st.integers(18, 90),
    st.integers(18, 90),
    st.floats(0.5, 8.0),
)


@given(pairs, st.sampled_from([1, 2]))
def test_wear_is_zero_at_the_pitch_point_and_greatest_at_an_end(pair: PairGeometry, side: int) -> None:
    progress = np.linspace(0.0, pair.contact_ratio, 401)
    depth = wear_profile(pair, side, pair.contact_radii_mm(progress)[side - 1])
    at_pitch = (pair.pitch_point_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm
    on = wear_profile(pair, side, np.atleast_1d(pair.contact_radii_mm(at_pitch)[side - 1]))
    assert on[0] == pytest.approx(0.0, abs=1e-9)
    assert depth.max() == pytest.approx(1.0)
    assert np.argmax(depth) in (0, 400)
    # In modules below a tenth the sliding is held; elsewhere it rises from the pitch point to both ends.
    before, after = depth[progress < at_pitch], depth[progress > at_pitch]
    assert np.all(np.diff(before) <= 1e-12)
    assert np.all(np.diff(after) >= -1e-12)


def test_wear_is_the_distance_slid_while_the_contact_passes() -> None:
    """∫|v_s| dt while a zone 2a wide passes each point, at a constant pressure and line load."""
    omega, half = 50.0, 0.1

    def slid(progress: float) -> float:
        rho_1, rho_2 = (float(r) for r in PAIR.contact_radii_mm(progress))
        sliding = abs(omega * rho_1 - omega * 55 / 75 * rho_2)
        return quad(lambda _: sliding, 0.0, 2 * half / (omega * rho_1))[0]

    progress = np.linspace(0.0, PAIR.contact_ratio, 23)
    distance = np.array([slid(p) for p in progress])
    assert wear_profile(PAIR, 1, PAIR.contact_radii_mm(progress)[0]) == pytest.approx(distance / distance.max())


def test_roots_wear_more_than_tips() -> None:
    for side in (1, 2):
        ends = np.sort(PAIR.contact_radii_mm(own_stretch(MESH)[[0, -1]])[side - 1])
        root, tip = wear_profile(PAIR, side, ends)
        assert root == 1.0
        assert tip < 0.8


def test_worn_flanks_in_the_table() -> None:
    """All teeth share one row; the depth adds to relief, and none leaves the table as it is."""
    relief = FlankDeviation(10.0, 2.0)
    worn = replace(MESH, flank_1=replace(relief, wear_um=25.0), flank_2=FlankDeviation(wear_um=8.0))
    table, plain = mesh_table(worn), mesh_table(replace(MESH, flank_1=relief))
    assert table.separation.gear(1).shape[0] == table.separation.gear(2).shape[0] == 1
    stretch = own_stretch(MESH)[2:-2]  # at the very ends the interpolation rounds the profile off
    rho_1, rho_2 = PAIR.contact_radii_mm(stretch)
    expected = 25e-6 * wear_profile(PAIR, 1, rho_1) + 8e-6 * wear_profile(PAIR, 2, rho_2)
    extra = own_separation(table, stretch, pair=3) - own_separation(plain, stretch, pair=3)
    assert extra == pytest.approx(expected, abs=3e-8)
    assert own_separation(table, np.array([PITCH_POINT])) == pytest.approx(0.0, abs=4e-8)
    none = mesh_table(replace(MESH, flank_1=replace(relief, wear_um=0.0)))
    np.testing.assert_array_equal(none.separation.gear(1), plain.separation.gear(1))


def test_wear_shows_in_the_transmission_error() -> None:
    """A little wear unloads the ends as a relief does and evens the error out; much of it makes it greater."""
    errors = [
        share_torque(replace(MESH, flank_1=FlankDeviation(wear_um=w)), 110.0).transmission_error_m
        for w in (0.0, 10.0, 30.0, 60.0)
    ]
    assert np.all(np.diff([np.mean(e) for e in errors]) > 1e-6)
    new, little, much, most = (np.ptp(e) for e in errors)
    assert little < new < much < most
    with pytest.raises(InputError, match="wear_um"):
        FlankDeviation(wear_um=-1.0)


@given(st.integers(-300, 300), st.floats(0.0, 1.79), st.integers(0, 5))
@settings(max_examples=40, deadline=None)  # kernels compile in the first example
def test_table_reads_the_heights_of_both_teeth_where_they_touch(pair: int, progress: float, seed: int) -> None:
    """−z1 − z2 at the arc length from the root end of each flank's contact; metal in the gap brings flanks nearer."""
    mesh = rough(seed)
    assert mesh.roughness_1 is not None
    assert mesh.roughness_2 is not None

    def arc(gear: GearGeometry, low: float, high: float) -> float:
        return quad(lambda rho: rho / gear.base_radius_mm, low, high)[0] * 1e-3

    rho_1, rho_2 = (float(r) for r in PAIR.contact_radii_mm(progress))
    low_2 = float(PAIR.contact_radii_mm(PAIR.contact_ratio)[1])
    place_1, place_2 = arc(PAIR.driver, PAIR.start_radius_mm, rho_1), arc(PAIR.driven, low_2, rho_2)
    expected = -(mesh.roughness_1.height_m(pair, place_1) + mesh.roughness_2.height_m(pair, place_2))
    found = own_separation(mesh_table(mesh), np.array([progress]), pair=pair)
    assert found == pytest.approx(float(expected), abs=1e-4 * 0.84e-6)


def test_roughness_returns_with_the_pair_of_teeth() -> None:
    """Teeth 55 and 75 meet again after 825 pairs, and one gear's own part after one of its turns."""
    mesh = rough(3)
    stretch, table = own_stretch(MESH, 60), mesh_table(mesh)
    assert table.separation.gear(1).shape[0] == 55
    assert table.separation.gear(2).shape[0] == 75
    first = own_separation(table, stretch, pair=0)
    assert own_separation(table, stretch, pair=825) == pytest.approx(first, abs=1e-15)
    assert np.abs(own_separation(table, stretch, pair=55) - first).max() > 0.2e-6
    alone = mesh_table(replace(mesh, roughness_2=None))
    assert own_separation(alone, stretch, pair=55) == pytest.approx(own_separation(alone, stretch), abs=1e-15)
    assert np.abs(own_separation(alone, stretch, pair=1) - own_separation(alone, stretch, pair=0)).max() > 0.2e-6


def test_rms_of_the_separations_is_that_of_both_surfaces() -> None:
    """√2 · 0.84 µm over all teeth of both gears. The lines are independent, so that variances add."""
    table = mesh_table(rough(7))
    together = np.mean(table.separation.gear(1) ** 2) + np.mean(table.separation.gear(2) ** 2)
    assert np.sqrt(together) == pytest.approx(np.sqrt(2) * 0.84e-6, rel=0.1)


def test_smooth_profiles_change_nothing() -> None:
    flat = FlankRoughness.draw(FractalSurface.of_roughness(0.0), 55, np.random.default_rng(0))
    table = mesh_table(replace(MESH, roughness_1=flat))
    assert np.all(table.separation.gear(1) == 0.0)


def test_roughness_moves_the_error_in_single_contact_by_its_height() -> None:
    mesh = rough(1)
    moved = (
        share_torque(mesh, 110.0, SINGLE).transmission_error_m - share_torque(MESH, 110.0, SINGLE).transmission_error_m
    )
    assert moved == pytest.approx(own_separation(mesh_table(mesh), SINGLE), abs=1e-12)


def test_rough_gear_with_a_spall_keeps_a_row_per_tooth() -> None:
    spall = ToothSpall(2.0, 20.0, 20.0, tooth=11)
    mesh = rough(2)
    pitted = replace(mesh, spalls_1=(spall,))
    only = replace(MESH, spalls_1=(spall,))
    stretch = own_stretch(MESH)
    for pair in (10, 11, 12):
        extra = own_separation(mesh_table(pitted), stretch, pair=pair)
        extra -= own_separation(mesh_table(mesh), stretch, pair=pair)
        assert extra == pytest.approx(own_separation(mesh_table(only), stretch, pair=pair), abs=1e-12)
    assert mesh_table(pitted).separation.gear(1).shape[0] == 55
    assert mesh_table(only).separation.gear(1).shape[0] == 2


def test_pitch_stays_apart_from_the_rows() -> None:
    pitch = tuple(float(i % 7) for i in range(55))
    mesh = replace(rough(4), flank_1=FlankDeviation(pitch_um=pitch))
    with_pitch, without = mesh_table(mesh), mesh_table(rough(4))
    np.testing.assert_array_equal(with_pitch.separation.gear(1), without.separation.gear(1))
    _, separation, _ = pair_states(with_pitch, np.array([3.5]))
    _, plain, _ = pair_states(without, np.array([3.5]))
    assert separation - plain == pytest.approx(np.array([[3e-6, 2e-6]]), abs=1e-15)


def test_roughness_needs_a_profile_for_each_tooth() -> None:
    profiles = FlankRoughness.draw(SURFACE, 54, np.random.default_rng(0))
    with pytest.raises(InputError, match="one per tooth, 55"):
        replace(MESH, roughness_1=profiles)
    with pytest.raises(InputError, match="one per tooth, 75"):
        replace(MESH, roughness_2=profiles)
    assert rough(0) != rough(0)  # compares without looking at arrays
