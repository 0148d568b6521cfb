"""Healthy recordings look like a healthy gear pair's, on any day."""

from dataclasses import replace
from functools import cache
from math import gcd, lcm

import numpy as np
import pytest

from sims.blind import (
    EVERY,
    BlindMotion,
    BlindRig,
    RunCondition,
    Scene,
    accelerations,
    coloured_noise,
    draw_rig,
    measure,
    path_response,
    run,
    scene_of,
)
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


# Two recordings of one rig, begun wherever it stood: what is fixed to a gear turns with that gear.

PER_TOOTH = 16
RIG_SEEDS = (31, 32, 33)
"""Of conditions: another start, another pair of teeth that meet first."""


def drawn(divisor: int) -> BlindRig:
    """A rig whose tooth numbers have this largest common divisor and do not take long to meet in all pairs."""
    rigs = (draw_rig(np.random.default_rng([9, i]), "development") for i in range(1000))
    return next(r for r in rigs if gcd(r.pair.z1, r.pair.z2) == divisor and r.pair.z2 < 45 * divisor)


COPRIME, FIVES, SIXES = drawn(1), drawn(5), drawn(6)


def begun(rig: BlindRig, seed: int, *, duration_s: float = 1.5) -> Scene:
    """The rig in good order at a steady speed, the sensors mounted once."""
    nm = 0.6 * rig.rated_nm
    scene = scene_of(rig, RunCondition(2000.0, nm, 2000.0, nm, duration_s, seed, 5))
    scene.speed = np.column_stack([np.full(len(scene.speed), scene.omega[0]), np.zeros(len(scene.speed))])
    return scene


def mean_turns(rig: BlindRig, motion: BlindMotion, x: np.ndarray) -> list[np.ndarray]:
    """Spectra of the mean turns of both shafts, the tachometer's pulse first, over whole rounds of all tooth pairs."""
    pair, theta = rig.pair, motion.theta[0] / (2 * np.pi)
    first = np.ceil(theta[0])
    around = pair.z2 // gcd(pair.z1, pair.z2)
    turns = int((theta[-1] - first) // around) * around
    assert turns > 0
    spectra = []
    for z in (pair.z1, pair.z2):
        n, points = turns * pair.z1 // z, PER_TOOTH * z
        at = first + np.arange(n * points) / points * z / pair.z1
        spectra.append(np.fft.rfft(np.interp(at, theta, x).reshape(n, points).mean(axis=0)) / points)
    return spectra


def turned(spectrum: np.ndarray, z: int, teeth: int) -> np.ndarray:
    return np.asarray(spectrum * np.exp(2j * np.pi * np.arange(len(spectrum)) * teeth / z))


def likeness(a: np.ndarray, b: np.ndarray, z: int, nearest: int, farthest: int) -> float:
    """Correlation of the lines that lie so many orders from a mesh harmonic."""
    k = np.arange(len(a))
    away = np.minimum(k % z, z - k % z)
    at = (k > 0) & (k < 5 * z) & (away >= nearest) & (away <= farthest)
    return float(np.vdot(a[at], b[at]).real / np.linalg.norm(a[at]) / np.linalg.norm(b[at]))


@pytest.mark.parametrize("rig", [COPRIME, FIVES, SIXES], ids=["coprime", "fives", "sixes"])
def test_each_gear_is_the_same_another_day(rig: BlindRig) -> None:
    """Mean turns agree tooth to tooth, in run-out and brake, all after one and the same turn in whole teeth."""
    z1, z2 = rig.pair.z1, rig.pair.z2
    days = []
    for seed in RIG_SEEDS:
        scene = begun(rig, seed)
        motion = run(scene)
        days.append(mean_turns(rig, motion, accelerations(scene, motion)[0]))
    steps = range(0, z2, gcd(z1, z2))
    found = []
    for driver, driven in days[1:]:
        assert min(likeness(days[0][0], driver, z1, *k) for k in ((0, 0), (1, 1), (2, 2), (3, z1))) > 0.99
        best = max(steps, key=lambda s, x=driven: likeness(days[0][1], turned(x, z2, s), z2, 3, z2))  # type: ignore[misc]
        same = turned(driven, z2, best)
        assert min(likeness(days[0][1], same, z2, *k) for k in ((0, 0), (1, 1), (2, 2), (3, z2))) > 0.99
        found.append(best)
    assert any(found)


@pytest.mark.parametrize("rig", [COPRIME, FIVES, SIXES], ids=["coprime", "fives", "sixes"])
def test_teeth_keep_their_partners(rig: BlindRig) -> None:
    """Only what turning reaches is drawn, and all of it."""
    first = {begun(rig, seed, duration_s=0.1).offsets for seed in range(1000)}
    assert first == {(0, tooth) for tooth in range(0, rig.pair.z2, gcd(rig.pair.z1, rig.pair.z2))}


def test_angles_tell_which_teeth_meet() -> None:
    pair = COPRIME.pair
    for seed in RIG_SEEDS:
        scene = begun(COPRIME, seed, duration_s=0.1)
        theta = run(scene).theta
        between = (theta[1] * pair.z2 - theta[0] * pair.z1) / (2 * np.pi)
        np.testing.assert_allclose(between, scene.offsets[1], atol=0.2)


@cache
def healthy_motion(seed: int) -> BlindMotion:
    return run(begun(COPRIME, seed))


@pytest.mark.parametrize("gear", [0, 1])
def test_a_bad_tooth_is_bad_on_any_day(gear: int) -> None:
    """The change lies at the tooth that is named, counted on either gear, the driver's from the tachometer's pulse."""
    pair, name = COPRIME.pair, "chipped_tooth"
    z = (pair.z1, pair.z2)[gear]
    for seed in RIG_SEEDS[:2]:
        chipped = begun(COPRIME, seed)
        choice = next(
            i
            for i in range(100)
            if EVERY[name].apply(begun(COPRIME, seed), 1.0, np.random.default_rng(i))["gear"]
            == ("pinion", "wheel")[gear]
        )
        place = EVERY[name].apply(chipped, EVERY[name].severity(COPRIME, 1.0), np.random.default_rng(choice))
        turns = []
        for motion in (healthy_motion(seed), run(chipped)):
            angle = motion.theta[gear] / (2 * np.pi)
            at = np.ceil(angle[0]) + np.arange(int(angle[-1] - angle[0] - 1) * 40 * z) / (40 * z)
            turns.append(np.interp(at, angle, motion.squeeze_m).reshape(-1, 40 * z).mean(axis=0))
        delta = turns[1] - turns[0]
        worst = np.argmax(np.abs(delta - np.median(delta))) / 40
        expected = int(place["tooth"]) + pair.contact_ratio / 2
        assert abs((worst - expected + z / 2) % z - z / 2) < 1.5
        if gear == 0:
            assert float(place["angle_deg"]) == pytest.approx(360 * expected / z % 360, abs=0.01)


@pytest.mark.parametrize("rig", [COPRIME, FIVES, SIXES], ids=["coprime", "fives", "sixes"])
def test_marked_teeth_stay_marked(rig: BlindRig) -> None:
    """The pairs that meet at the blows are the same in every recording."""
    z1, z2 = rig.pair.z1, rig.pair.z2
    around = lcm(z1, z2)
    days = []
    for seed in range(12):
        scene = begun(rig, seed, duration_s=10.0)
        EVERY["hunting_stain"].apply(scene, 1.0, np.random.default_rng(4))
        mesh = scene.trains[0].angle * z1 / (2 * np.pi)
        mesh = mesh[: np.count_nonzero(mesh < mesh[0] + around - 1e-6)]
        on_2 = mesh + scene.offsets[1]
        days.append(sorted((round(a % z1, 3), round(b % z2, 3)) for a, b in zip(mesh, on_2, strict=True)))
    for day in days[1:]:
        np.testing.assert_allclose(day, days[0], atol=2e-3)


def test_a_recording_begins_in_full_swing() -> None:
    """No ring of the sensors' paths where a recording was cut out of a steady run."""
    for i in range(5):
        rig = draw_rig(np.random.default_rng([77, i]), "development")
        scene = begun(rig, 40 + i, duration_s=0.5)
        motion = run(scene)
        signal = accelerations(scene, motion)
        n = motion.lead_n.shape[1]
        cut = replace(
            motion,
            lead_n=motion.bearing_n[:, :n],
            bearing_n=motion.bearing_n[:, n:],
            casing=motion.casing[:, n:],
        )
        np.testing.assert_allclose(accelerations(scene, cut), signal[:, n:], atol=0.02 * np.abs(signal).max())
