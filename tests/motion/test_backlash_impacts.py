"""Backlash from reversals and impacts from motion, against what the simulation knows."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.motion import (
    Impact,
    dependence,
    estimate_backlash,
    examine_start_stop,
    find_bursts,
    find_impacts,
    fit_flight,
    measure_motion,
    reduced_mass_kg,
)
from gearsig.recording import Recording
from sims import simulate
from tests.motion.recordings import continuous, start_stop, without

PRESETS = ("manipulator_formula", "manipulator_table")


def contacts(recording: Recording) -> np.ndarray:
    """Start, flank, speed, pitch, angle, end, speed after, …"""
    assert recording.truth is not None
    rows = recording.truth["contacts"]["rows"]
    return np.array([[np.nan if v is None else v for v in row] for row in rows])


def impacts(recording: Recording) -> tuple[Impact, ...]:
    motion = measure_motion(recording)
    play = estimate_backlash(motion)
    return find_impacts(motion, play.datum_m, half_backlash_m=0.5e-6 * play.backlash_um)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(("counts", "noise_urad"), [(2**20, 1.0), (2**16, 30.0), (8192, 0.0), (4096, 0.0)])
def test_backlash_from_a_noisy_encoder_within_a_tenth(preset: str, counts: int, noise_urad: float) -> None:
    """Down to encoders of 4096 counts, whose step is 360 µm at the wheel's base circle: more than the play."""
    parameters = {"encoder_counts": counts, "angle_noise_urad": noise_urad}
    for seed in range(2):
        recording = simulate(
            "forging", preset=preset, parameters=parameters, duration_s=12.0, sampling_rate_hz=1000.0, seed=seed
        )
        found = estimate_backlash(measure_motion(recording))
        assert found.backlash_um == pytest.approx(300.0, rel=0.1)
        assert abs(found.backlash_um - 300.0) < max(4.0 * found.uncertainty_um, 0.01 * 300.0)
        assert min(found.n_drive, found.n_back) > 200


def test_worn_flanks_show_and_stiffness_comes_out_with_it() -> None:
    found = estimate_backlash(measure_motion(start_stop(wear_um=80.0)))
    assert found.backlash_um == pytest.approx(380.0, rel=0.01)
    assert found.stiffness_n_per_m_lambda == pytest.approx(1.8366e10, rel=0.05)


def test_without_torque_it_is_the_lost_motion() -> None:
    """Backlash and the deflection of both flanks: 23 µm on each under 2 kN on one pair."""
    found = estimate_backlash(measure_motion(without(start_stop(), "torque")))
    assert 300.0 < found.backlash_um < 350.0
    assert "lost motion" in found.method


def test_one_flank_alone_has_no_play() -> None:
    for recording in (continuous(), without(continuous(), "torque")):
        with pytest.raises(RefusalError, match=r"flank"):
            estimate_backlash(measure_motion(recording))


def test_dependence_of_white_and_of_smooth_noise() -> None:
    white = np.random.default_rng(0).standard_normal(20_000)
    assert dependence(white) == pytest.approx(1.0, abs=0.1)
    rho = 0.8
    smooth = np.zeros(20_000)
    for i in range(1, len(smooth)):
        smooth[i] = rho * smooth[i - 1] + white[i]
    assert dependence(smooth) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.2)
    assert dependence(np.ones(10)) == 1.0


@pytest.mark.parametrize(("rate_hz", "min_found"), [(1000.0, 0.7), (4000.0, 1.0), (10_000.0, 1.0)])
@pytest.mark.parametrize("preset", PRESETS)
def test_impacts_are_found_with_time_tooth_and_energy(preset: str, rate_hz: float, min_found: float) -> None:
    recording = start_stop(preset, rate_hz)
    found, true = impacts(recording), contacts(recording)
    hard = true[true[:, 2] > 0.02]
    pairs = [
        (row, impact)
        for row in hard
        for impact in found
        if abs(impact.time_s - row[0]) < 5e-4 and impact.flank == row[1]
    ]
    assert len(pairs) >= min_found * len(hard)
    assert all(min(abs(true[:, 0] - impact.time_s)) < 1e-3 for impact in found)
    mass = reduced_mass_kg(measure_motion(recording))
    assert recording.truth is not None
    assert mass == pytest.approx(recording.truth["reduced_mass_kg"], rel=1e-9)
    times = [abs(impact.time_s - row[0]) for row, impact in pairs]
    energies = [impact.energy_j / (0.5 * mass * row[2] ** 2) - 1.0 for row, impact in pairs]
    assert np.median(times) < 2e-5
    assert np.median(np.abs(energies)) < 0.05
    assert np.quantile(np.abs(energies), 0.9) < 0.2
    bounced = [(row, i) for row, i in pairs if not np.isnan(i.restitution)]
    assert len(bounced) >= 0.5 * len(pairs)
    assert np.median([abs(i.restitution - row[6] / row[2]) for row, i in bounced]) < 0.04
    for row, impact in pairs:
        assert impact.driver_tooth == int(row[3]) % 20 + 1
        assert impact.driven_tooth == int(row[3]) % 100 + 1


def test_derived_speeds_find_the_same_impacts_less_exactly() -> None:
    bare = without(
        start_stop(rate_hz=10_000.0), "pinion speed", "wheel speed", "pinion acceleration", "wheel acceleration"
    )
    full, derived = impacts(start_stop(rate_hz=10_000.0)), impacts(bare)
    assert abs(len(full) - len(derived)) <= 0.3 * len(full)
    hardest = max(full, key=lambda i: i.speed_mps)
    same = min(derived, key=lambda i: abs(i.time_s - hardest.time_s))
    assert same.time_s == pytest.approx(hardest.time_s, abs=2e-4)
    assert same.speed_mps == pytest.approx(hardest.speed_mps, rel=0.15)


def test_a_flight_at_constant_acceleration_is_exact() -> None:
    t = np.arange(40) / 4000.0
    q, rate = 1e-5 + 0.02 * t - 3.0 * t**2, 0.02 - 6.0 * t
    for rates in (rate, None):
        fit = fit_flight(q, rates, 5, 30, 4000.0, (1e-7, 1e-4), at_end=True)
        level = 1e-5 + 0.02 * 0.00748 - 3.0 * 0.00748**2
        assert fit.crossing(level, 0.00725, 0.0075) == pytest.approx(0.00748, rel=1e-6)
        assert fit.rate(0.00748) == pytest.approx(0.02 - 6.0 * 0.00748, rel=1e-6)


def test_a_play_drowned_in_noise_is_refused() -> None:
    recording = start_stop(angle_noise_urad=1000.0)
    motion = measure_motion(recording)
    with pytest.raises(RefusalError, match="it hides flights"):
        find_impacts(motion, 0.0)


def test_without_a_known_play_the_rest_is_told_all_the_same() -> None:
    motion = measure_motion(continuous())
    examined = examine_start_stop(replace(motion, contact=replace(motion.contact, half_backlash_um=0.0)))
    assert any("half_backlash_um" in text for text in examined.refusals)
    assert examined.portrait is not None
    assert examined.loop is not None


def test_energy_is_not_defined_without_an_inertia() -> None:
    motion = measure_motion(start_stop())
    unknown = replace(motion, contact=replace(motion.contact, driven_inertia_kg_m2=None))
    found = find_impacts(unknown, 0.0)
    assert found
    assert all(np.isnan(impact.energy_j) for impact in found)
    assert all(impact.speed_mps > 0.0 for impact in found)


@pytest.mark.parametrize(("preset", "most_false"), [("manipulator_formula", 0.0), ("manipulator_table", 0.3)])
def test_blows_in_the_vibration_are_the_first_impacts_of_each_series(preset: str, most_false: float) -> None:
    """Rebounds drown in the ringing; what begins a series does not. Soft teeth strike where pairs take up load."""
    recording = start_stop(preset, 10_000.0)
    blows = find_bursts(recording.values("vibration"), 10_000.0)
    true = contacts(recording)
    hard = true[true[:, 2] > 0.06]
    first = hard[np.append(True, np.diff(hard[:, 0]) > 0.05)]
    times = np.array([blow.time_s for blow in blows])
    assert len(first) >= 3
    assert all(np.min(np.abs(times - time)) < 5e-4 for time in first[:, 0])
    assert sum(np.min(np.abs(true[:, 0] - time)) > 1.5e-3 for time in times) <= most_false * len(times)


def test_no_blows_in_noise() -> None:
    noise = np.random.default_rng(1).standard_normal(100_000)
    assert find_bursts(noise, 10_000.0) == ()
