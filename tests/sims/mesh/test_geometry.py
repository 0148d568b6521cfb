"""Geometry of a gear and of a pair."""

from math import acos, cos, degrees, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import (
    GearGeometry,
    PairGeometry,
    disc_inertia_kg_m2,
    disc_mass_kg,
    fillet_outline,
    inverse_involute,
    involute,
    involute_outline,
    root_half_angle_rad,
)
from tests.sims.mesh.meshes import tooth_outline_mm

gears = st.builds(
    GearGeometry,
    teeth=st.integers(20, 150),
    module_mm=st.floats(0.5, 10.0),
    profile_shift=st.floats(0.0, 0.3),
    tool_tip_radius=st.floats(0.2, 0.4),
)


def test_radii_of_the_fifty_tooth_gear() -> None:
    gear = GearGeometry(50, 3.0)
    assert (gear.tip_radius_mm, gear.root_radius_mm) == (78.0, 71.25)
    assert gear.base_radius_mm == pytest.approx(70.477, abs=5e-4)
    assert gear.root_radius_mm > gear.base_radius_mm  # more than 41 teeth
    assert GearGeometry(41, 3.0).root_radius_mm < GearGeometry(41, 3.0).base_radius_mm


@given(st.floats(0.01, 1.4))
def test_inverse_involute_inverts(angle: float) -> None:
    assert inverse_involute(float(involute(angle))) == pytest.approx(angle, abs=1e-9)


def test_involute_of_twenty_degrees() -> None:
    assert float(involute(radians(20.0))) == pytest.approx(0.014904, abs=5e-7)  # handbook tables


@given(gears)
def test_thickness_on_pitch_and_base_circle(gear: GearGeometry) -> None:
    m, x, alpha = gear.module_mm, gear.profile_shift, gear.pressure_angle_rad
    on_pitch = m * (pi / 2 + 2 * x * tan(alpha))
    assert float(gear.tooth_thickness_mm(gear.pitch_radius_mm)) == pytest.approx(on_pitch, rel=1e-12)
    on_base = cos(alpha) * (on_pitch + 2 * gear.pitch_radius_mm * float(involute(alpha)))
    assert float(gear.tooth_thickness_mm(gear.base_radius_mm)) == pytest.approx(on_base, rel=1e-12)


@given(gears)
def test_flank_is_the_end_of_a_string_from_the_base_circle(gear: GearGeometry) -> None:
    """Its normal touches the base circle, the length to it is the arc unrolled, and its polar angle is ψ_b − inv α."""
    roll = np.linspace(gear.form_roll_rad + 1e-3, gear.tip_roll_rad, 7)
    x, y, dx = involute_outline(gear, roll)
    radius, rb = np.hypot(x, y), gear.base_radius_mm
    assert radius == pytest.approx(rb * np.hypot(1.0, roll), rel=1e-12)
    assert np.arctan2(y, x) == pytest.approx(gear.base_half_angle_rad - involute(np.arctan(roll)), abs=1e-12)
    load = roll - gear.base_half_angle_rad
    assert x * np.cos(load) - y * np.sin(load) == pytest.approx(rb, rel=1e-12)  # lever of the normal force
    step = 1e-6
    slope = (involute_outline(gear, roll + step).x_mm - involute_outline(gear, roll - step).x_mm) / (2 * step)
    assert dx == pytest.approx(slope, rel=1e-6, abs=1e-7 * gear.module_mm)


@given(gears)
def test_fillet_joins_root_circle_and_flank_without_a_kink(gear: GearGeometry) -> None:
    ends = fillet_outline(gear, np.array([pi / 2, gear.pressure_angle_rad]))
    flank = involute_outline(gear, np.array([gear.form_roll_rad]))
    scale = gear.pitch_radius_mm
    assert np.hypot(ends.x_mm[0], ends.y_mm[0]) == pytest.approx(gear.root_radius_mm, rel=1e-12)
    assert ends.x_mm[1] == pytest.approx(flank.x_mm[0], abs=1e-9 * scale)
    assert ends.y_mm[1] == pytest.approx(flank.y_mm[0], abs=1e-9 * scale)
    assert np.arctan2(ends.y_mm[0], ends.x_mm[0]) == pytest.approx(root_half_angle_rad(gear), abs=1e-12)
    assert root_half_angle_rad(gear) <= pi / gear.teeth  # neighbours leave room for the tool
    before = fillet_outline(gear, np.array([gear.pressure_angle_rad + 1e-5]))
    along = np.arctan2(ends.y_mm[1] - before.y_mm[0], ends.x_mm[1] - before.x_mm[0])
    # The flank's tangent is its normal's perpendicular: it stands at −α_m to the centre line.
    assert along == pytest.approx(-(gear.form_roll_rad - gear.base_half_angle_rad), abs=1e-3)


@given(gears)
def test_fillet_is_what_the_tools_round_leaves(gear: GearGeometry) -> None:
    """Independent of the formula: over the roll, the round's centre comes as near as ρ to each point, not nearer."""
    m, r, alpha = gear.module_mm, gear.pitch_radius_mm, gear.pressure_angle_rad
    rho, deep = gear.tool_tip_radius * m, gear.dedendum * m - gear.tool_tip_radius * m
    # Rack space centred on the tooth: its tooth's flank stands πm/4 from the centre at the reference line.
    offset = pi * m / 4 + deep * tan(alpha) + rho / cos(alpha)
    roll = np.linspace(-6 * m, 6 * m, 40001) + offset
    across, along = roll - offset, r - deep + gear.profile_shift * m
    turn = roll / r
    centre_x = along * np.cos(turn) + across * np.sin(turn)
    centre_y = along * np.sin(turn) - across * np.cos(turn)
    gamma = np.linspace(alpha + 0.02, pi / 2 - 0.02, 5)
    x, y, dx = fillet_outline(gear, gamma)
    for px, py in zip(x, y, strict=True):
        assert np.hypot(centre_x - px, centre_y - py).min() == pytest.approx(rho, rel=1e-5)
    step = 1e-6
    slope = (fillet_outline(gear, gamma + step).x_mm - fillet_outline(gear, gamma - step).x_mm) / (2 * step)
    assert dx == pytest.approx(slope, rel=1e-5, abs=1e-7 * m)


@pytest.mark.slow
@given(gears, st.floats(1.5, 4.0))
def test_shape_scales_with_the_module(gear: GearGeometry, factor: float) -> None:
    other = GearGeometry(
        gear.teeth,
        gear.module_mm * factor,
        profile_shift=gear.profile_shift,
        tool_tip_radius=gear.tool_tip_radius,
    )
    for one, two in zip(tooth_outline_mm(gear), tooth_outline_mm(other), strict=True):
        assert two == pytest.approx(one * factor, rel=1e-9)


def test_mass_and_inertia_of_the_cracked_pair() -> None:
    pinion, wheel = (GearGeometry(z, 2.0, bore_radius_mm=17.5) for z in (55, 75))
    assert (disc_mass_kg(pinion), disc_mass_kg(wheel)) == pytest.approx((1.341, 2.623), abs=1e-3)
    assert (disc_inertia_kg_m2(pinion), disc_inertia_kg_m2(wheel)) == pytest.approx((2.234e-3, 7.780e-3), abs=2e-6)


def test_limit_of_undercut() -> None:
    """The standard rack's straight flank reaches one module deep: z ≥ 2/sin²α = 17.1, or a shift of 1 − z sin²α/2."""
    tip = {"tool_tip_radius": 0.25 / (1 - sin(radians(20)))}
    GearGeometry(18, 2.0, **tip)
    with pytest.raises(InputError, match="undercuts a gear of 17 teeth") as caught:
        GearGeometry(17, 2.0, **tip)
    least = 1 - 17 * sin(radians(20)) ** 2 / 2
    assert f"{least:.3g}" in str(caught.value)
    GearGeometry(17, 2.0, profile_shift=least + 1e-9, **tip)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"addendum": 2.0, "teeth": 20, "profile_shift": 0.3}, "pointed"),
        ({"tool_tip_radius": 0.6}, "tool_tip_radius"),
        ({"dedendum": 2.3}, "ends in a point"),
        ({"profile_shift": 0.95, "dedendum": 1.2}, "pitch circle"),
        ({"bore_radius_mm": 60.0}, "bore_radius_mm"),
        ({"teeth": 20.5}, "teeth"),
        ({"module_mm": float("nan")}, "module_mm"),
        ({"face_width_mm": -1.0}, "face_width_mm"),
    ],
)
def test_shapes_that_cannot_be(change: dict[str, float], words: str) -> None:
    values: dict[str, float] = {"teeth": 50, "module_mm": 2.0} | change
    with pytest.raises(InputError, match=words):
        GearGeometry(**values)  # type: ignore[arg-type]  # wrong on purpose


def test_thickness_below_the_base_circle_is_refused() -> None:
    with pytest.raises(InputError, match="base radius"):
        GearGeometry(20, 2.0).tooth_thickness_mm(10.0)


# Two gears: contact ratio, line of action, backlash, sliding, and pairs that cannot run.


def standard_pair(z1: int, z2: int, module_mm: float = 2.0) -> PairGeometry:
    return PairGeometry(GearGeometry(z1, module_mm), GearGeometry(z2, module_mm))


pairs = st.builds(standard_pair, st.integers(18, 100), st.integers(18, 100), st.floats(0.5, 8.0))


def test_contact_ratios_on_record() -> None:
    assert standard_pair(50, 50, 3.0).contact_ratio == pytest.approx(1.755, abs=5e-4)
    assert standard_pair(20, 100, 5.0).contact_ratio == pytest.approx(1.705, abs=5e-4)
    assert standard_pair(50, 50, 3.0).centre_distance == pytest.approx(150.0, rel=1e-12)


@given(pairs)
def test_contact_ratio_by_the_handbook_formula(pair: PairGeometry) -> None:
    """ε = [z1 (tan α_a1 − tan α_w) + z2 (tan α_a2 − tan α_w)]/2π."""
    total = 0.0
    for gear in (pair.driver, pair.driven):
        at_tip = acos(gear.base_radius_mm / gear.tip_radius_mm)
        total += gear.teeth * (tan(at_tip) - tan(radians(20.0)))
    assert pair.contact_ratio == pytest.approx(total / (2 * pi), rel=1e-10)


@given(pairs, st.floats(-3.0, 3.0))
def test_contact_lies_on_both_flanks_and_moves_with_both_base_circles(pair: PairGeometry, cycles: float) -> None:
    rho_1, rho_2 = pair.contact_radii_mm(cycles)
    assert float(rho_1 + rho_2) == pytest.approx(pair.centre_distance * sin(radians(20.0)), rel=1e-12)
    # One mesh cycle turns the driver by one tooth, and the contact by r_b1 θ1 = r_b2 θ2 = one base pitch.
    moved = float(pair.contact_radii_mm(cycles + 0.3)[0] - rho_1)
    for gear in (pair.driver, pair.driven):
        assert moved == pytest.approx(gear.base_radius_mm * 0.3 * 2 * pi / gear.teeth, rel=1e-8)


@given(pairs, st.floats(10.0, 3000.0))
def test_sliding_changes_sign_at_the_pitch_point(pair: PairGeometry, speed_rpm: float) -> None:
    at_pitch = (pair.pitch_point_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm
    assert 0.0 < at_pitch < pair.contact_ratio
    before, on, after = pair.sliding_speed_m_s(np.array([at_pitch - 0.1, at_pitch, at_pitch + 0.1]), speed_rpm)
    omega = speed_rpm * pi / 30 * (1 + pair.driver.teeth / pair.driven.teeth)
    assert before == pytest.approx(omega * 0.1 * pair.base_pitch_mm * 1e-3, rel=1e-6)
    assert on == pytest.approx(0.0, abs=1e-9 * before)
    assert after == pytest.approx(-before, rel=1e-6)


def test_wider_centre_distance_shortens_contact() -> None:
    tight = PairGeometry(GearGeometry(30, 2.0, profile_shift=0.2), GearGeometry(40, 2.0))
    wide = PairGeometry(tight.driver, tight.driven, centre_distance_mm=tight.centre_distance + 0.1)
    assert wide.contact_ratio < tight.contact_ratio


def test_profile_shift_opens_the_working_angle() -> None:
    """Shifts that cancel leave angle and distance alone; a positive sum widens both, by less than the sum of shifts."""
    cancel = PairGeometry(GearGeometry(30, 2.0, profile_shift=0.3), GearGeometry(40, 2.0, profile_shift=-0.3))
    assert degrees(cancel.working_pressure_angle_rad) == pytest.approx(20.0, abs=1e-9)
    shifted = PairGeometry(GearGeometry(30, 2.0, profile_shift=0.3), GearGeometry(40, 2.0, profile_shift=0.2))
    assert 70.0 < shifted.centre_distance < 70.0 + 2.0 * 0.5


@pytest.mark.parametrize(
    ("one", "two", "distance_mm", "words"),
    [
        (GearGeometry(30, 2.0), GearGeometry(30, 2.5), None, "module_mm"),
        (GearGeometry(30, 2.0), GearGeometry(30, 2.0, 25.0, tool_tip_radius=0.3), None, "pressure_angle_deg"),
        (GearGeometry(30, 2.0), GearGeometry(40, 2.0), 69.0, "jam"),
        (GearGeometry(30, 2.0), GearGeometry(40, 2.0), 73.0, "contact ratio"),
        (GearGeometry(19, 2.0), GearGeometry(100, 2.0, addendum=1.2, dedendum=1.3), None, "interference"),
        (
            GearGeometry(60, 2.0, dedendum=1.0, tool_tip_radius=0.0),
            GearGeometry(60, 2.0, addendum=1.0),
            None,
            "clearance",
        ),
    ],
)
def test_pairs_that_cannot_run(one: GearGeometry, two: GearGeometry, distance_mm: float | None, words: str) -> None:
    with pytest.raises(InputError, match=words):
        PairGeometry(one, two, distance_mm)
