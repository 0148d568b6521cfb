"""Two gears: contact ratio, line of action, backlash, sliding, and pairs that cannot run."""

from math import acos, degrees, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import GearGeometry, PairGeometry


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
