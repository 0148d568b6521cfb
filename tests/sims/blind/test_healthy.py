"""Healthy recordings look like a healthy gear pair's."""

from dataclasses import replace

import numpy as np
import pytest

from sims.blind import BlindRig, RunCondition, coloured_noise, draw_rig, measure, path_response, run, scene_of
from tests.sims.blind.order_domain import by_angle, order_power, pulse_times_s

SEEDS = range(5)


def steady(rig: BlindRig, rpm: float = 1300.0, share: float = 0.6, duration_s: float = 2.0) -> RunCondition:
    nm = share * rig.rated_nm
    return RunCondition(rpm, nm, rpm, nm, duration_s, 11, 12)


@pytest.fixture(scope="module")
def healthy() -> list:
    made = []
    for seed in SEEDS:
        rig = draw_rig(np.random.default_rng(seed), "evaluation")
        scene = scene_of(rig, steady(rig))
        motion = run(scene)
        made.append((rig, motion, measure(scene, motion)))
    return made


@pytest.mark.slow
def test_transmission_error_is_some_um(healthy: list) -> None:
    for rig, motion, _ in healthy:
        x_um = 1e6 * (motion.squeeze_m - motion.squeeze_m.mean())
        assert 1 < np.ptp(x_um) < 80
        deflection_um = 1e6 * motion.mesh_n.mean() / rig.mesh_stiffness_n_per_m()
        assert 0.5 * deflection_um < 1e6 * motion.squeeze_m.mean() < 2.5 * deflection_um + 5


def test_levels_are_those_of_a_test_bed(healthy: list) -> None:
    rms = [float(r.values("a1").std()) for _, _, r in healthy]
    assert all(0.05 < x < 150 for x in rms)
    assert 0.5 < np.median(rms) < 20


def test_mesh_lines_dominate(healthy: list) -> None:
    """The mesh harmonics are the strongest lines in most rigs, and near the strongest in all."""
    places = []
    for rig, _, recording in healthy:
        orders, power = order_power(recording)
        mesh = np.arange(1, 256 // rig.pair.z1 + 1) * rig.pair.z1
        loudest = max(power[np.abs(orders - k) <= 0.25].max() for k in mesh)
        others = power[np.abs(orders[:, None] - mesh).min(axis=1) > 0.5]
        places.append(float(10 * np.log10(loudest / others.max())))
    assert np.median(places) > 3
    assert min(places) > -25


def test_speed_from_the_tachometer(healthy: list) -> None:
    """The motor holds the mean speed; pulses come once a turn with a jitter of microseconds."""
    for _, _, recording in healthy:
        turns_hz = 1 / np.diff(pulse_times_s(recording))
        assert 60 * turns_hz.mean() == pytest.approx(1300, rel=0.01)
        assert turns_hz.std() < 0.01 * turns_hz.mean()


def test_the_same_turn_comes_back(healthy: list) -> None:
    """What the input shaft carries repeats: the mean turn holds far more than a mean of noise would."""
    for _, _, recording in healthy:
        turns = by_angle(recording)
        n = len(turns)
        share = turns.mean(axis=0).var() / turns.var()
        assert share > 3 / n


def test_load_and_speed_matter() -> None:
    rig = draw_rig(np.random.default_rng(2), "development")
    force, accel = [], []
    for rpm, share in ((900.0, 0.3), (900.0, 0.9), (1800.0, 0.9)):
        scene = scene_of(rig, steady(rig, rpm, share, 1.0))
        motion = run(scene)
        force.append(motion.mesh_n.mean())
        accel.append(float(motion.casing[:2].std()))
    assert force[1] == pytest.approx(3 * force[0], rel=0.02)
    assert force[2] == pytest.approx(force[1], rel=0.02)
    assert accel[2] > accel[1]


def test_path_is_an_oscillator() -> None:
    """At resonance the response is 1/(2ζ m), far above it 1/m."""
    rig = draw_rig(np.random.default_rng(0), "development")
    mode = replace(rig.chains[0].path[0], frequency_hz=2000.0, damping_ratio=0.02, mass_kg=5.0)
    t = np.arange(40000) / 40000.0
    for frequency_hz, expected in ((2000.0, 1 / (2 * 0.02 * 5.0)), (15000.0, 0.2 / (1 - (2000 / 15000) ** 2))):
        out = path_response(np.sin(2 * np.pi * frequency_hz * t), 40000.0, [mode])[20000:]
        assert np.sqrt(2) * out.std() == pytest.approx(expected, rel=0.12)


def test_noise_has_its_colour() -> None:
    x = coloured_noise(np.random.default_rng(0), 200_001, 20000.0, 1.0)
    assert x.std() == pytest.approx(1.0)
    power = np.abs(np.fft.rfft(x)) ** 2
    f = np.fft.rfftfreq(len(x), 1 / 20000.0)
    low, high = (power[(f > a) & (f < 2 * a)].mean() for a in (100, 1600))
    assert low / high == pytest.approx(16, rel=0.2)
