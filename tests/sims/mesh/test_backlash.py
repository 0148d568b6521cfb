"""Contact with backlash: branches, energy, no tension, moving flanks, compiled against plain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.mesh import FlankContact, dead_zone_m
from sims.mesh import _backlash as kernel

B = 2e-5
depths = st.floats(-1e-4, 1e-4)
rates = st.floats(-0.5, 0.5)
gaps = st.floats(0.0, 5e-5)


def test_drive_flank_gap_and_back_flank():
    contact = FlankContact(3e8, 2e8)
    force = contact.force_n([B + 1e-5, B, 0.0, -B, -B - 1e-5], 0.0, half_backlash_m=B)
    np.testing.assert_allclose(force, [3000.0, 0.0, 0.0, 0.0, -2000.0], rtol=1e-9)


def test_flanks_lie_the_whole_backlash_apart():
    contact = FlankContact(1e8, 1e8)
    delta = np.linspace(-1e-4, 1e-4, 200001)
    free = delta[contact.force_n(delta, 0.0, half_backlash_m=B) == 0.0]
    assert free.max() - free.min() == pytest.approx(2 * B, abs=2e-9)


def test_damping_counts_the_speed_of_the_flanks_towards_each_other():
    contact = FlankContact(1e8, 1e8, damping_n_s_per_m=1000.0)
    # A gap that widens as fast as the teeth approach: nothing is pressed faster.
    kept = contact.force_n([B + 1e-5, -B - 1e-5], [0.2, -0.2], half_backlash_m=B, half_backlash_rate_mps=0.2)
    np.testing.assert_allclose(kept, [1000.0, -1000.0], rtol=1e-9)
    moving = contact.force_n([B + 1e-5, -B - 1e-5], [0.2, -0.2], half_backlash_m=B, half_backlash_rate_mps=0.05)
    np.testing.assert_allclose(moving, [1150.0, -1150.0], rtol=1e-9)


def test_no_damping_in_the_gap_and_no_tension_at_separation():
    contact = FlankContact(1e8, 1e8, damping_n_s_per_m=1e4)
    assert contact.force_n(0.5 * B, 0.3, half_backlash_m=B) == 0.0
    assert contact.force_n(B + 1e-6, -0.3, half_backlash_m=B) == 0.0
    assert contact.force_n(-B - 1e-6, 0.3, half_backlash_m=B) == 0.0


def test_ramp_takes_the_jump_out_of_touching_at_speed():
    hard, soft = (FlankContact(1e8, 1e8, 1000.0, ramp) for ramp in (0.0, 1e-6))
    just = B + 1e-12
    assert hard.force_n(just, 0.1, half_backlash_m=B) == pytest.approx(100.0, rel=1e-3)
    assert soft.force_n(just, 0.1, half_backlash_m=B) == pytest.approx(0.0, abs=1e-3)
    deep = B + 2e-6
    assert soft.force_n(deep, 0.1, half_backlash_m=B) == hard.force_n(deep, 0.1, half_backlash_m=B)


@settings(deadline=None)  # kernels compile in the first example
@given(depths, rates, gaps, rates, st.sampled_from([0.0, 1e-6, 2e-5]))
def test_kernel_agrees_with_the_formula_and_never_pulls(delta, rate, b, b_rate, ramp):
    contact = FlankContact(3e8, 2e8, 1500.0, ramp)
    plain = float(contact.force_n(delta, rate, half_backlash_m=b, half_backlash_rate_mps=b_rate))
    compiled = kernel.contact_force_n(delta, rate, b, b_rate, 3e8, 2e8, 1500.0, ramp)
    assert compiled == pytest.approx(plain, rel=1e-9, abs=1e-9)
    assert compiled * delta >= 0.0
    assert kernel.penetration_m(delta, b) == pytest.approx(float(dead_zone_m(delta, b)), abs=1e-18)


@settings(deadline=None)  # kernels compile in the first example
@given(depths, rates, gaps)
def test_both_flanks_are_mirror_images(delta, rate, b):
    contact = FlankContact(2e8, 2e8, 1500.0, 1e-6)
    forward = contact.force_n(delta, rate, half_backlash_m=b, half_backlash_rate_mps=0.01)
    assert contact.force_n(-delta, -rate, half_backlash_m=b, half_backlash_rate_mps=0.01) == -forward


@settings(deadline=None)  # kernels compile in the first example
@given(depths, rates, gaps)
def test_damping_only_takes_energy_out(delta, rate, b):
    damped, spring = (FlankContact(2e8, 2e8, c, 1e-6) for c in (1500.0, 0.0))
    extra = damped.force_n(delta, rate, half_backlash_m=b) - spring.force_n(delta, rate, half_backlash_m=b)
    assert extra * rate >= -1e-12


def test_force_is_the_slope_of_the_energy():
    contact = FlankContact(3e8, 2e8)
    delta = np.linspace(-1e-4, 1e-4, 2001)
    h = 1e-9
    slope = (contact.energy_j(delta + h, half_backlash_m=B) - contact.energy_j(delta - h, half_backlash_m=B)) / (2 * h)
    np.testing.assert_allclose(slope, contact.force_n(delta, 0.0, half_backlash_m=B), atol=0.2)


def test_free_rattle_keeps_its_energy():
    """A mass thrown to and fro between the flanks; the drift falls fast with the step."""
    mass, v0 = 1.0, 0.05

    def drift(n_steps):
        h, x, v = 8e-3 / n_steps, 0.0, v0

        def acceleration(at):
            return -kernel.contact_force_n(at, 0.0, B, 0.0, 3e8, 2e8, 0.0, 0.0) / mass

        for _ in range(n_steps):
            v += 0.5 * h * acceleration(x)
            x += h * v
            v += 0.5 * h * acceleration(x)
        energy = 0.5 * mass * v * v + float(FlankContact(3e8, 2e8).energy_j(x, half_backlash_m=B))
        return abs(energy / (0.5 * mass * v0 * v0) - 1)

    assert drift(32000) < 1e-5


def test_roughness_deeper_than_the_backlash_is_refused():
    with pytest.raises(InputError, match="raise the backlash"):
        FlankContact(1e8, 1e8).force_n(0.0, 0.0, half_backlash_m=[1e-6, -1e-7])
    with pytest.raises(InputError, match="drive_stiffness"):
        FlankContact(0.0, 1e8)
