"""Tooth pairs in contact: by angle, forwards, backwards, on the back flank."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.rig import standard_path
from sims.forging import FirstState, drive_numbers, respond
from sims.mesh import GearGeometry, PairGeometry
from tests.sims.forging.drives import AT_REST, drive, free_bodies

STANDARD = standard_path((20, 100), 5e-3, np.radians(20.0))


def test_standard_teeth_have_the_known_contact_ratio() -> None:
    """1.705 of 20/100 teeth; and the same path as the involute geometry of the other simulators."""
    pair = PairGeometry(GearGeometry(20, 5.0, 20.0), GearGeometry(100, 5.0, 20.0))
    assert STANDARD.contact_ratio == pytest.approx(1.705, abs=5e-4)
    assert STANDARD.contact_ratio == pytest.approx(pair.contact_ratio, rel=1e-9)
    assert STANDARD.start_m == pytest.approx(pair.start_radius_mm * 1e-3, rel=1e-9)
    assert STANDARD.length_m == pytest.approx(pair.action_length_mm * 1e-3, rel=1e-9)


@given(angle=st.floats(-50.0, 50.0), flank=st.sampled_from([1.0, -1.0]))
def test_model_and_rig_count_the_same_pairs(angle: float, flank: float) -> None:
    """The model's pairs come and go over a twentieth of a pitch, the rig's at once: alike away from there."""
    from sims.forging import position, weight, younger_pair

    k = drive_numbers(drive())
    p, _ = position(k, angle, flank, younger_pair(k, angle, flank))
    smooth = weight(k, p)[0] + weight(k, p + 1.0)[0]
    u = float(STANDARD.position(np.array(angle), flank))
    if min(abs(u - edge) for edge in (0.0, STANDARD.contact_ratio - 1.0, 1.0)) > 0.026:
        assert smooth == pytest.approx(float(STANDARD.n_pairs(np.array(angle), flank)), abs=1e-12)
    assert 1.0 - 1e-12 <= smooth <= 2.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_two_pairs_carry_for_the_part_epsilon_minus_one(direction: float) -> None:
    """Loaded gears that turn over many pitches, forwards and in reverse; time average of the pairs that carry."""
    made = free_bodies({"restitution": 0.5, "half_backlash_um": 5.0, "impact_speed_floor_mps": 1e-3})
    r1, r2 = made.path.base_radii_m
    torque = 50.0
    profiles = type(AT_REST)(
        AT_REST.torque_nm.constant(torque), AT_REST.brake_nm, AT_REST.press_nm.constant(-torque * r2 / r1)
    )
    start = FirstState(0.0, direction * 40.0, 2e-5, 0.0)
    # 40 pitches after the start has died out
    span = 40.0 * 2.0 * np.pi / 20.0 / 40.0
    run = respond(made, profiles, duration_s=0.2 + span, interval_s=span / 40_000, first=start)
    turning = run["pinion speed"][run.time_s >= 0.2]
    assert np.all(turning * direction > 30.0)
    angle = run["pinion angle"][run.time_s >= 0.2]
    two = run["pairs in contact"][run.time_s >= 0.2] > 1.5
    weight = np.abs(np.gradient(angle))
    assert np.all(run["interaction force"][run.time_s >= 0.2] > 0.0)
    assert np.sum(two * weight) / np.sum(weight) == pytest.approx(made.path.contact_ratio - 1.0, abs=0.01)


def test_a_flank_that_turns_back_meets_the_same_pairs() -> None:
    """The count belongs to the angle: a film run backwards shows the same."""
    angles = np.linspace(0.0, 3.0, 4001)
    assert np.array_equal(STANDARD.n_pairs(angles)[::-1], STANDARD.n_pairs(angles[::-1]))
    assert np.mean(STANDARD.n_pairs(np.linspace(0.0, 2.0 * np.pi, 200_001)) == 2.0) == pytest.approx(
        STANDARD.contact_ratio - 1.0, abs=1e-3
    )


def test_back_flanks_pass_the_pitch_point_half_a_pitch_later() -> None:
    at_pitch_point = STANDARD.pitch_point * 2.0 * np.pi / 20.0
    later = at_pitch_point + np.pi / 20.0
    assert float(STANDARD.position(np.array(at_pitch_point))) == pytest.approx(STANDARD.pitch_point % 1.0)
    assert float(STANDARD.position(np.array(later), -1.0)) == pytest.approx(STANDARD.pitch_point % 1.0)


@pytest.mark.parametrize(("pinion", "largest_wheel"), [(13, 16), (14, 26), (15, 45), (16, 101), (17, 1309)])
def test_teeth_that_interfere_are_refused(pinion: int, largest_wheel: int) -> None:
    """Largest wheels for full-depth teeth at 20°: Shigley's Mechanical Engineering Design, 11th ed., section 13-7."""
    standard_path((pinion, largest_wheel), 5e-3, np.radians(20.0))
    with pytest.raises(InputError, match="interfere"):
        standard_path((pinion, largest_wheel + 1), 5e-3, np.radians(20.0))
