"""One tooth: strain energy against brute force, foundation, contact, cracks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    GearGeometry,
    Material,
    RootCrack,
    crack_depth_mm,
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
    tooth_compliance,
)
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
    parabolic = stiffness(front="parabolic")
    assert np.all((through < parabolic) & (parabolic < healthy))
    # Slices against a fine sum over the width.
    w = (np.arange(2000) + 0.5) / 2000
    fine = np.mean(
        [1 / tooth_compliance(PINION, STEEL_200, rolls(PINION), (2.0 * np.sqrt(1 - p), 45.0)).total for p in w[::10]],
        axis=0,
    )
    assert parabolic == pytest.approx(fine * width, rel=2e-3)


def test_depth_in_percent_of_the_root() -> None:
    assert crack_percent(PINION, crack_depth_mm(PINION, 37.0, 60.0), 60.0) == pytest.approx(37.0)
    half = crack_depth_mm(PINION, 50.0, 45.0)
    assert crack_tip_mm(PINION, half, 45.0)[1] == pytest.approx(0.0, abs=1e-12)  # 50 % reaches the centre line
    assert crack_percent(PINION, 4.0, 45.0) > 50.0  # as noted: 4 mm at 45° crosses it at module 2


def test_depths_at_an_angle_that_cannot_be() -> None:
    for angle in (0.0, 120.0):
        with pytest.raises(InputError, match="angle_deg"):
            deepest_crack_mm(PINION, angle)
        with pytest.raises(InputError, match="angle_deg"):
            crack_depth_mm(PINION, 50.0, angle)


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
        ({"depth_mm": 1.0, "front": "curved"}, "front"),
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
