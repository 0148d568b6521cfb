"""What the source study shows of sweeps over speed; the whole sweep of six million steps runs on demand."""

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.machine import Operation
from sims.reduced_fe import speed_sweep, torsional_mode
from tests.sims.reduced_fe.flexible_pairs import pair_of


@pytest.mark.slow
def test_torsional_peak_and_superharmonics_with_the_source_damping():
    """900 to 4100 rpm, 750 to 3417 Hz: the peak at ω_n, and those where the second and third mesh harmonic meet it."""
    pair = pair_of()
    sweep = speed_sweep(pair, 340.0, 900.0, 4100.0, 3.0, n_parts=120)
    natural = torsional_mode(pair, Operation.steady(2000.0, 340.0)).frequency_hz
    peak = sweep.peak_hz(2000.0, 3400.0)
    assert 2650.0 < peak < 2700.0
    assert sweep.peak_hz(1150.0, 1600.0) == pytest.approx(natural / 2.0, rel=0.03)
    assert sweep.peak_hz(760.0, 1050.0) == pytest.approx(natural / 3.0, rel=0.03)
    valleys = [sweep.rms_m[(sweep.mesh_hz > a) & (sweep.mesh_hz < b)].min() for a, b in ((950, 1250), (1500, 2300))]
    assert sweep.rms_m.max() > 2.0 * max(valleys)
    assert sweep.lost_part.max() == 0.0  # at 8 % damping perfect flanks stay in contact
    with pytest.raises(InputError, match="no part"):
        sweep.peak_hz(1.0, 2.0)


@pytest.fixture(scope="module")
def light_sweeps():
    pair = pair_of("light_damping_50_50")
    return (
        speed_sweep(pair, 170.0, 1900.0, 3500.0, 4.0, n_parts=100),
        speed_sweep(pair, 170.0, 3500.0, 1900.0, 4.0, n_parts=100),
    )


@pytest.mark.slow
def test_light_damping_loses_contact_and_jumps_with_hysteresis(light_sweeps):
    up, down = light_sweeps
    for sweep in light_sweeps:
        assert sweep.lost_part.max() > 0.02
        assert sweep.minimum_force_n.min() == 0.0
    jump_up, jump_down = up.jump_hz(1700.0, 2800.0), down.jump_hz(1700.0, 2800.0)
    assert jump_up is not None
    assert jump_down is not None
    # Softening by contact loss: the great motion holds on to lower speeds than those at which it is first reached.
    assert jump_down < jump_up - 200.0
    between = np.linspace(jump_down + 50.0, jump_up - 50.0, 5)
    from_above = np.interp(between, down.mesh_hz[::-1], down.rms_m[::-1])
    assert np.all(from_above > 1.7 * np.interp(between, up.mesh_hz, up.rms_m))


@pytest.mark.slow
def test_outside_the_hysteresis_both_ways_agree(light_sweeps):
    up, down = light_sweeps
    high = np.linspace(2750.0, 2850.0, 5)
    first, second = np.interp(high, up.mesh_hz, up.rms_m), np.interp(high, down.mesh_hz[::-1], down.rms_m[::-1])
    assert first == pytest.approx(second, rel=0.12)


@pytest.mark.slow
def test_damping_of_the_source_leaves_no_jump():
    sweep = speed_sweep(pair_of(), 170.0, 1900.0, 3500.0, 2.0, n_parts=100)
    assert sweep.jump_hz(1700.0, 2900.0) is None


@pytest.mark.slow
def test_relieved_tips_lose_contact_and_jump_with_the_source_damping():
    """20 µm of tip relief, 8 % damping: the flanks part, and the sweep down keeps the great motion longer."""
    pair = pair_of(tip_relief_um=20.0)
    up, down = (speed_sweep(pair, 85.0, *ends, 2.0, n_parts=100) for ends in ((1900.0, 3500.0), (3500.0, 1900.0)))
    assert min(sweep.lost_part.max() for sweep in (up, down)) > 0.2
    jumps = [sweep.jump_hz(1700.0, 2700.0) for sweep in (up, down)]
    assert jumps[0] is not None
    assert jumps[1] is not None
    assert jumps[1] < jumps[0] - 60.0


@pytest.mark.study
def test_six_million_steps_have_converged():
    """Rms at 5 µs against half the step, over the whole sweep with contact loss on, both ways."""
    pair = pair_of("light_damping_50_50")
    for first, last in ((900.0, 4100.0), (4100.0, 900.0)):
        coarse = speed_sweep(pair, 170.0, first, last, 15.0)
        fine = speed_sweep(pair, 170.0, first, last, 15.0, step_s=2.5e-6)
        assert coarse.n_steps == 3_000_000
        off = np.abs(coarse.rms_m / fine.rms_m - 1.0)
        # Where a jump falls into a part, its place within the part decides.
        assert np.quantile(off, 0.95) < 0.01
        assert np.count_nonzero(off > 0.05) <= 4
