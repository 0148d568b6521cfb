"""Compliance of a tooth and of the body behind it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims import simulate
from sims.fe_gear import compare_crack_laws, ready_gear
from sims.mesh import (
    GearGeometry,
    GearMesh,
    Material,
    PairGeometry,
    RootCrack,
    arc_compliance,
    body_compliance,
    crack_mouth_mm,
    crack_percent,
    crack_tip_mm,
    cracked_tooth_compliance,
    deepest_crack_mm,
    effective_flank_mm,
    foundation_compliance,
    foundation_factors,
    foundation_notes,
    involute_outline,
    linear_contact_compliance,
    load_dependent_contact_coefficient,
    mesh_stiffness,
    share_torque,
    tooth_compliance,
)
from sims.reduced_fe import mesh_maps
from tests.sims.mesh.meshes import tooth_outline_mm

STEEL_200 = Material(200.0)
PINION = GearGeometry(55, 2.0, bore_radius_mm=17.5)


def rolls(gear: GearGeometry, n: int = 9) -> np.ndarray:
    return np.linspace(gear.form_roll_rad, gear.tip_roll_rad, n)


def brute_force(gear: GearGeometry, roll: float, crack: tuple[float, float] | None) -> np.ndarray:
    """Bending, shear, axial by a fine sum over x, moments from force and lever arms about each section's centroid."""
    contact = involute_outline(gear, np.array([roll]))
    xc, yc = float(contact.x_mm[0]), float(contact.y_mm[0])
    load = roll - gear.base_half_angle_rad
    outline_x, outline_y = tooth_outline_mm(gear, 20000)
    edges = np.linspace(outline_x[0], xc, 200001)
    x = (edges[1:] + edges[:-1]) / 2
    dx = np.diff(edges)
    back = np.interp(x, outline_x, outline_y)
    front = back if crack is None else effective_flank_mm(gear, *crack, x, back)
    height, centroid = front + back, (front - back) / 2
    moment = np.cos(load) * (xc - x) - np.sin(load) * (yc - centroid)
    e, g = 200e9, 200e9 / 2.6
    return np.array(
        [
            np.sum(12 * moment**2 / height**3 * dx) / e,
            np.sum(1.2 * np.cos(load) ** 2 / height * dx) / g,
            np.sum(np.sin(load) ** 2 / height * dx) / e,
        ]
    )


@pytest.mark.parametrize("teeth", [20, 30, 55, 100])
@pytest.mark.parametrize("crack", [None, (1.0, 45.0), (2.0, 70.0), (1.0, 90.0)])
def test_energies_against_brute_force(teeth: int, crack: tuple[float, float] | None) -> None:
    gear = GearGeometry(teeth, 2.0)
    for roll in rolls(gear, 4)[1:]:
        own = np.array(tooth_compliance(gear, STEEL_200, np.array([roll]), crack))[:, 0]
        assert own == pytest.approx(brute_force(gear, roll, crack), rel=2e-4)


@given(st.integers(20, 120), st.floats(0.5, 8.0), st.floats(1.5, 4.0), st.floats(50.0, 400.0))
def test_compliance_knows_no_size_and_falls_with_the_modulus(teeth: int, m: float, factor: float, e_gpa: float) -> None:
    """A tooth of the same width and another module is as stiff; twice E halves the compliance."""
    one, two = GearGeometry(teeth, m), GearGeometry(teeth, m * factor)
    first, second = (tooth_compliance(g, Material(e_gpa), rolls(g)).total for g in (one, two))
    assert second == pytest.approx(first, rel=1e-9)
    half = tooth_compliance(one, Material(2 * e_gpa), rolls(one)).total
    assert half == pytest.approx(first / 2, rel=1e-12)
    load = rolls(one) - one.base_half_angle_rad
    body = [foundation_compliance(g, Material(e_gpa), load) for g in (one, two)]
    assert body[1] == pytest.approx(body[0], rel=1e-9)


def test_tooth_is_softer_towards_its_tip() -> None:
    for teeth in (20, 41, 42, 100):
        gear = GearGeometry(teeth, 2.0)
        compliance = tooth_compliance(gear, STEEL_200, rolls(gear, 50)).total
        assert np.all(np.diff(compliance) > 0)


def test_nothing_jumps_where_the_root_circle_passes_the_base_circle() -> None:
    """Between 41 and 42 teeth the classical formulas change; the tooth does not."""
    series = [
        tooth_compliance(g, STEEL_200, np.array([0.36])).total[0] for g in (GearGeometry(z, 2.0) for z in range(38, 47))
    ]
    assert np.abs(np.diff(series, 2)).max() < 0.1 * np.abs(np.diff(series)).max()


def test_foundation_factors_by_hand() -> None:
    """At h = 2, θ = 0.1: e.g. P* = −0.050952 + 0.742 + 0.0001076 + 0.533 + 0.579 + 0.9236."""
    by_hand = (6.8882306, 1.139793, 2.7267556, 0.4962556)
    assert foundation_factors(2.0, 0.1) == pytest.approx(by_hand, abs=1e-7)


def test_foundation_says_where_it_is_extrapolated() -> None:
    assert foundation_notes(PINION) == ()
    assert "root half angle" in foundation_notes(GearGeometry(19, 2.0))[0]
    assert "bore radius" in foundation_notes(GearGeometry(55, 2.0, bore_radius_mm=5.0))[0]


def test_contact_laws() -> None:
    """1/k = 4(1 − ν²)/(πEb) for equal gears, and Palmgren's line contact: δ = 1.275 F^0.9/(E^0.9 b^0.8)."""
    assert linear_contact_compliance(STEEL_200, STEEL_200, 0.02) == pytest.approx(4 * 0.91 / (np.pi * 200e9 * 0.02))
    b = load_dependent_contact_coefficient(STEEL_200, STEEL_200, 0.02)
    assert b * 2000**0.9 / 2000 == pytest.approx(1 / 1.087e9, rel=1e-3)


def test_a_crack_of_no_depth_takes_nothing() -> None:
    for angle in (20.0, 45.0, 90.0):
        healthy = tooth_compliance(PINION, STEEL_200, rolls(PINION)).total
        assert tooth_compliance(PINION, STEEL_200, rolls(PINION), (1e-9, angle)).total == pytest.approx(
            healthy, rel=1e-8
        )


@given(st.floats(15.0, 90.0), st.floats(0.02, 0.95), st.floats(1.02, 1.05))
def test_a_deeper_crack_is_softer(angle: float, part: float, more: float) -> None:
    depth = part * deepest_crack_mm(PINION, angle)
    one, two = (tooth_compliance(PINION, STEEL_200, rolls(PINION), (d, angle)).total for d in (depth, depth * more))
    assert np.all(two > one)
    assert np.all(one > tooth_compliance(PINION, STEEL_200, rolls(PINION)).total)


def test_section_behind_a_crack() -> None:
    """At the tip of the crack it ends there, at the tooth's tip nothing is lost, below the crack's tip neither."""
    x_end, y_end = crack_tip_mm(PINION, 1.0, 90.0)
    x_mouth, y_mouth = crack_mouth_mm(PINION)
    assert (x_end, y_end) == pytest.approx((x_mouth, y_mouth - 1.0))
    x, y = tooth_outline_mm(PINION)
    left = effective_flank_mm(PINION, 1.0, 90.0, x, y)
    assert left[-1] == pytest.approx(y[-1])
    assert left[x < x_end] == pytest.approx(y[x < x_end])
    at = float(effective_flank_mm(PINION, 1.0, 90.0, np.array([x_mouth]), np.array([y_mouth]))[0])
    assert at == pytest.approx(y_end)


def test_crack_over_part_of_the_width() -> None:
    width = 0.02
    healthy = width / tooth_compliance(PINION, STEEL_200, rolls(PINION)).total

    def stiffness(**changes: object) -> np.ndarray:
        crack = RootCrack(2.0, **changes)  # type: ignore[arg-type]  # keyword values of several types
        return 1 / cracked_tooth_compliance(PINION, STEEL_200, rolls(PINION), crack, width)

    through = stiffness()
    assert stiffness(width_mm=5.0) == pytest.approx(0.75 * healthy + 0.25 * through, rel=1e-12)
    assert stiffness(width_mm=20.0) == pytest.approx(through, rel=1e-12)


def test_depth_in_percent_of_the_root() -> None:
    half = 50.0 / crack_percent(PINION, 1.0)
    assert crack_tip_mm(PINION, half, 45.0)[1] == pytest.approx(0.0, abs=1e-12)  # 50 % reaches the centre line
    assert crack_percent(PINION, 4.0, 45.0) > 50.0  # as noted: 4 mm at 45° crosses it at module 2


def test_depths_at_an_angle_that_cannot_be() -> None:
    for angle in (0.0, 120.0):
        with pytest.raises(InputError, match="angle_deg"):
            deepest_crack_mm(PINION, angle)
        with pytest.raises(InputError, match="angle_deg"):
            crack_percent(PINION, 2.0, angle)


@pytest.mark.parametrize("angle", [15.0, 45.0, 90.0])
def test_a_crack_past_the_tooth_is_refused(angle: float) -> None:
    deepest = deepest_crack_mm(PINION, angle)
    cracked_tooth_compliance(PINION, STEEL_200, rolls(PINION), RootCrack(deepest, angle), 0.02)
    with pytest.raises(InputError, match="past the tooth") as caught:
        cracked_tooth_compliance(PINION, STEEL_200, rolls(PINION), RootCrack(deepest * 1.01, angle), 0.02)
    assert f"{deepest:.3g} mm" in str(caught.value)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"depth_mm": 0.0}, "depth_mm"),
        ({"depth_mm": 1.0, "angle_deg": 5.0}, "angle_deg"),
        ({"depth_mm": 1.0, "tooth": -1}, "tooth"),
        ({"depth_mm": 1.0, "width_mm": 0.0}, "width_mm"),
    ],
)
def test_cracks_that_cannot_be(values: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        RootCrack(**values)  # type: ignore[arg-type]  # wrong on purpose


def test_a_crack_must_fit_its_gear() -> None:
    for crack, words in ((RootCrack(1.0, tooth=55), "tooth"), (RootCrack(1.0, width_mm=21.0), "width_mm")):
        with pytest.raises(InputError, match=words):
            cracked_tooth_compliance(PINION, STEEL_200, rolls(PINION), crack, 0.02)


def test_a_modulus_in_pascals_is_refused_with_the_value_in_gpa() -> None:
    with pytest.raises(InputError, match=r"in GPa: for 2.06e\+11 Pa give 206"):
        Material(206e9)


# Neighbouring teeth through the gear body, against closed forms, the published polynomial and finite elements.

NAMES = ("z50_m3", "z55_m2", "z75_m2")


@pytest.mark.parametrize("radius_ratio", [1.5, 3.0, 6.0])
def test_a_rim_loaded_all_round_is_a_thick_ring(radius_ratio: float) -> None:
    """Evenly, an annulus held at its bore: Lamé's solution for the pressure, and torsion of a thick disc."""
    nu, b = 0.3, 1.0 / radius_ratio
    c = arc_compliance(radius_ratio, np.pi, 0.0, nu)
    stress = 1.0 / (2.0 * np.pi)
    lame = stress * (1.0 - nu**2) * (1.0 - b**2) / (1.0 + nu + (1.0 - nu) * b**2)
    assert c[0, 0] == pytest.approx(lame, rel=1e-9)
    assert c[1, 1] == pytest.approx(stress * (1.0 + nu) * (1.0 / b**2 - 1.0), rel=1e-9)


def test_what_a_tooth_does_to_another_it_does_to_it() -> None:
    one, other = (arc_compliance(3.0, 0.055, side * 2.0 * np.pi / 55, 0.3) for side in (1.0, -1.0))
    assert one == pytest.approx(other.T, rel=1e-9, abs=1e-12)
    assert np.all(np.linalg.eigvalsh(arc_compliance(3.0, 0.055, 0.0, 0.3)) > 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_own_tooth_as_published_and_neighbours_as_finite_elements(name: str) -> None:
    gear = ready_gear(name)
    g, material = gear.blank.geometry, gear.blank.material
    angle = gear.grid.roll_rad - g.base_half_angle_rad
    own = body_compliance(g, material, angle, angle, 0)
    assert own == pytest.approx(foundation_compliance(g, material, angle), rel=0.11)
    _, n_heights, n_slices = gear.grid.shape
    shape = (-1, 2, n_heights, n_slices, 2, n_heights, n_slices)
    # An even force over the face at one height, the mean motion at another one.
    fe = gear.clamped_compliance_m_per_n.reshape(shape)[:, 0, :, :, 0].mean(axis=(2, 4)) * g.face_width_mm * 1e-3
    # Teeth that carry together never both carry at their tips.
    i, j = (k.ravel() for k in np.indices((n_heights - 1, n_heights - 1)))
    ahead, behind = (body_compliance(g, material, angle[i], angle[j], side) for side in (1, -1))
    assert ahead == pytest.approx(fe[-1][i, j], rel=0.16)
    assert behind == pytest.approx(fe[1][i, j], rel=0.16)
    both = (fe[1] + fe[-1])[i, j]
    assert np.mean(np.abs((ahead + behind) / both - 1.0)) < 0.06
    assert ahead + behind == pytest.approx(both, rel=0.14)


@pytest.mark.parametrize(("names", "torque_nm"), [(("z50_m3", "z50_m3"), 170.0), (("z55_m2", "z75_m2"), 110.0)])
def test_a_coupled_mesh_is_as_stiff_as_finite_elements(names: tuple[str, str], torque_nm: float) -> None:
    driver, driven = (ready_gear(n) for n in names)
    pair = PairGeometry(driver.blank.geometry, driven.blank.geometry)
    cycles = np.arange(40) / 40.0
    law = {"contact_law": "load-dependent"}
    fe = mesh_maps((driver, driven), GearMesh(pair, **law), np.array([torque_nm]), cycles, support="bore_clamped")
    error = fe.transmission_error_m[:, 0]
    found = {
        body: share_torque(GearMesh(pair, body=body, **law), torque_nm, cycles).transmission_error_m
        for body in ("separate", "coupled")
    }
    # The least transmission error is that of double contact; at its ends corners take part, which only elements know.
    assert np.min(found["coupled"]) == pytest.approx(np.min(error), rel=0.02)
    assert np.mean(found["coupled"]) == pytest.approx(np.mean(error), rel=0.07)
    assert np.min(error) / np.min(found["separate"]) > 1.3
    assert np.max(found["coupled"]) == pytest.approx(np.max(found["separate"]), rel=1e-3)  # one pair has no neighbour


def test_the_cracked_pair_runs_on_a_coupled_body() -> None:
    def mesh_frequency_level(body: str) -> float:
        recording = simulate("cracked", parameters={"gear_body": body}, duration_s=0.3, seed=1)
        return float(np.std(recording.values("a1")))

    levels = [mesh_frequency_level(body) for body in ("separate", "coupled")]
    assert 0.2 < levels[1] / levels[0] < 0.9  # the step between one and two pairs is smaller


def test_body_leaves_single_contact_and_softens_double_contact() -> None:
    gear = ready_gear("z50_m3").blank.geometry
    stiff, soft = (mesh_stiffness(GearMesh(PairGeometry(gear, gear), body=b)) for b in ("separate", "coupled"))
    assert np.min(soft.total_n_per_m) == pytest.approx(np.min(stiff.total_n_per_m), rel=1e-3)
    assert soft.mean_n_per_m / stiff.mean_n_per_m == pytest.approx(0.79, abs=0.03)


def test_lines_behind_a_crack_add_half_of_what_finite_elements_do_halfway_up_the_flank() -> None:
    """Cells taken out of a plane grid of 0.06 mm add 2.75, 6.91, 11.1 and 14.9e-10 m/N; a slot is longer and wider."""
    laws = compare_crack_laws(ready_gear("z55_m2"), np.array([1.0, 2.0, 3.0, 4.0]))
    middle = len(laws.roll_rad) // 2
    fe, grid = laws.added_m_per_n["finite elements"][:, middle], np.array([2.75, 6.91, 11.1, 14.9]) * 1e-10
    assert np.all((fe > 0.7 * grid) & (fe < grid))
    for law in ("two lines", "limiting line"):
        share = laws.added_m_per_n[law][:, middle] / fe
        assert np.all((share > 0.4) & (share < 0.62))
    assert np.all(np.diff(laws.added_m_per_n["parallel line"][:, middle]) > 0.0)
