"""Two recordings of one rig, begun wherever it stood: what is fixed to a gear turns with that gear."""

from dataclasses import replace
from functools import cache
from math import gcd, lcm

import numpy as np
import pytest

from sims.blind import EVERY, BlindMotion, BlindRig, RunCondition, Scene, accelerations, draw_rig, run, scene_of

PER_TOOTH = 16
SEEDS = (31, 32, 33)
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
    for seed in SEEDS:
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
    for seed in SEEDS:
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
    for seed in SEEDS[:2]:
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
