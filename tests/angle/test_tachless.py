"""Speed from vibration alone: closed-form gears, refusals, and measured recordings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from gearsig.angle import estimate_shaft_angle, find_offset_comb
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.recording import Channel, Recording
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft
from tests.measured import BY_NAME, car_run_up, needs_data

RATE_HZ = 12_800.0
CHECK = np.linspace(0.5, 7.5, 400)


@dataclass(frozen=True)
class Motion:
    """Speed in rev/s: start + ramp·t, times (1 + depth·sin(2π·rate·t))."""

    start: float
    ramp: float = 0.0
    depth: float = 0.0
    rate: float = 0.5

    def revolutions(self, t: FloatArray) -> FloatArray:
        w = 2 * np.pi * self.rate
        # ∫ (a + b t)(1 + d sin wt) dt in closed form.
        steady = self.start * t + 0.5 * self.ramp * t**2
        wander = -self.start * np.cos(w * t) / w + self.ramp * (np.sin(w * t) / w**2 - t * np.cos(w * t) / w)
        return steady + self.depth * (wander + self.start / w)

    def speed(self, t: FloatArray) -> FloatArray:
        return (self.start + self.ramp * t) * (1 + self.depth * np.sin(2 * np.pi * self.rate * t))


def rig_of(*teeth: tuple[int, int | None], nominal_rpm: float | None = None, tolerance: float = 5.0) -> Rig:
    """Return a rig of pairs in a row, shaft names s0, s1, …"""
    shafts = tuple(Shaft(f"s{i}") for i in range(len(teeth) + 1))
    pairs = tuple(GearPair(f"p{i}", f"s{i}", f"s{i + 1}", a, b) for i, (a, b) in enumerate(teeth))
    return Rig(shafts=shafts, pairs=pairs, operating_point=OperatingPoint("s0", nominal_rpm, tolerance))


def gear_recording(motion: Motion, teeth: tuple[tuple[int, int], ...], rng: np.random.Generator) -> Recording:
    """Return mesh harmonics, each amplitude-modulated once per turn of both gears, shaft harmonics, and white noise.

    Two channels, which differ by phases and gains; noise of standard deviation 1 where the strongest mesh harmonic has
    amplitude 1.
    """
    t = np.arange(round(8.0 * RATE_HZ)) / RATE_HZ
    angle, speed = 2 * np.pi * motion.revolutions(t), motion.speed(t)

    def turning(order: float) -> FloatArray:
        return np.cos(order * angle + rng.uniform(0, 6.28))

    samples = np.zeros((2, len(t)))
    for row in range(2):
        ratio = 1.0
        for z1, z2 in teeth:
            driver, driven = ratio, ratio * z1 / z2
            envelope = (1 + 0.3 * turning(driver)) * (1 + 0.7 * 0.3 * turning(driven))
            for k, amplitude in enumerate((1.0, 0.6, 0.4, 0.2), 1):
                inside = k * z1 * driver * speed < 0.45 * RATE_HZ  # what the recorder's filter would let through
                samples[row] += inside * amplitude * rng.uniform(0.5, 1.0) * envelope * turning(k * z1 * driver)
            samples[row] += 0.5 * 0.3 * turning(driver)
            ratio = driven
    samples += rng.normal(size=samples.shape)
    return Recording(samples, RATE_HZ, (Channel("a0", "acceleration", "m/s^2"), Channel("a1", "acceleration", "m/s^2")))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("teeth", "motion", "nominal", "tolerance", "worst"),
    [
        (((23, 46),), Motion(27.31), True, 5.0, 2e-5),
        (((23, 46),), Motion(27.31), False, 5.0, 2e-5),
        (((17, 61),), Motion(31.7, depth=0.01), True, 5.0, 1e-3),
        (((17, 61),), Motion(31.7, depth=0.03, rate=0.3), True, 8.0, 2e-3),
        (((32, 96), (32, 80)), Motion(21.4, depth=0.01), False, 5.0, 1e-3),
        (((32, 96), (32, 80)), Motion(18.0, ramp=1.2), True, 30.0, 2e-3),
    ],
)
def test_speed_of_gears(
    teeth: tuple[tuple[int, int], ...], motion: Motion, nominal: bool, tolerance: float, worst: float
) -> None:
    recording = gear_recording(motion, teeth, np.random.default_rng(7))
    mean = float(motion.speed(CHECK).mean())
    rig = rig_of(*teeth, nominal_rpm=60 * mean * 1.01 if nominal else None, tolerance=tolerance)
    angle = estimate_shaft_angle(recording, rig)
    error = angle.speed_rpm_at(CHECK) / 60 / motion.speed(CHECK) - 1
    assert np.sqrt(np.mean(error**2)) < worst
    assert angle.quality > 0.6
    # The angle itself, but for its zero: good enough to average over.
    assert np.std(angle.revolutions_at(CHECK) - motion.revolutions(CHECK)) < 0.01
    assert angle.shaft == "s0"
    assert angle.method == "tachless"


def test_only_the_drivers_teeth_are_known() -> None:
    motion = Motion(33.0)
    recording = gear_recording(motion, ((23, 46),), np.random.default_rng(1))
    angle = estimate_shaft_angle(recording, rig_of((23, None), nominal_rpm=2000.0))
    assert angle.mean_speed_rpm == pytest.approx(1980.0, rel=2e-5)


@pytest.mark.parametrize(("seed", "nominal"), [(0, None), (1, 2000.0), (2, 2000.0)])
def test_noise_is_refused(seed: int, nominal: float | None) -> None:
    samples = np.random.default_rng(seed).normal(size=(2, 60_000))
    noise = Recording(samples, 12_800.0, (Channel("a"), Channel("b")))
    with pytest.raises(RefusalError, match="no comb"):
        estimate_shaft_angle(noise, rig_of((23, 46), nominal_rpm=nominal))


@pytest.mark.parametrize("nominal", [None, 1500.0])
def test_a_bearing_alone_is_refused(nominal: float | None) -> None:
    rng = np.random.default_rng(4)
    rate = 24_000.0
    t = np.arange(int(4 * rate)) / rate
    # Impacts at 4.755 per turn, excite 3 kHz, load zone once per turn.
    strikes = np.zeros_like(t)
    times = np.arange(0, 3.95, 1 / (4.755 * 25)) + rng.normal(0, 1e-4, len(np.arange(0, 3.95, 1 / (4.755 * 25))))
    strikes[np.clip((times * rate).astype(int), 0, len(t) - 1)] = 1 + 0.5 * np.cos(2 * np.pi * 25 * times)
    ring = np.exp(-800 * t[:200]) * np.sin(2 * np.pi * 3000 * t[:200])
    x = np.convolve(strikes, ring)[: len(t)] + 0.05 * rng.normal(size=len(t))
    with pytest.raises(RefusalError):
        estimate_shaft_angle(Recording(x[None], rate, (Channel("a"),)), rig_of((31, 45), nominal_rpm=nominal))


def test_a_plain_harmonic_series_is_no_gear() -> None:
    t = np.arange(60_000) / 12_800.0
    x = sum(np.cos(2 * np.pi * 30.3 * k * t + k) for k in range(1, 180))
    recording = Recording(np.array([x]) + np.random.default_rng(0).normal(size=(1, len(t))), 12_800.0, (Channel("a"),))
    for nominal in (None, 30.3 * 60):
        with pytest.raises(RefusalError, match="other teeth"):
            estimate_shaft_angle(recording, rig_of((23, 46), nominal_rpm=nominal))


def test_wrong_teeth_and_wrong_rate_are_refused_with_evidence() -> None:
    recording = gear_recording(Motion(33.0), ((23, 46),), np.random.default_rng(1))
    with pytest.raises(RefusalError):
        estimate_shaft_angle(recording, rig_of((29, None), nominal_rpm=1980.0))
    slow = Recording(recording.samples, 10_000.0, recording.channels)
    rig = rig_of((23, 46), nominal_rpm=1980.0)
    with pytest.raises(RefusalError, match=r"0\.7812"):
        estimate_shaft_angle(slow, rig)
    elsewhere = find_offset_comb(slow, rig, 1980.0)
    assert elsewhere is not None
    assert elsewhere.factor == pytest.approx(0.7812, rel=1e-3)
    assert find_offset_comb(recording, rig, 1980.0) is None


def test_no_teeth_no_motion_no_time() -> None:
    recording = gear_recording(Motion(33.0), ((23, 46),), np.random.default_rng(1))
    with pytest.raises(RefusalError, match="no mesh order"):
        estimate_shaft_angle(recording, rig_of((None, None)))  # type: ignore[arg-type]
    with pytest.raises(RefusalError, match="at rest"):
        estimate_shaft_angle(recording, rig_of((23, 46), nominal_rpm=0.0))
    dead = Recording(np.zeros((1, 50_000)), 12_800.0, (Channel("a"),))
    with pytest.raises(RefusalError, match="all vibration channels are constant"):
        estimate_shaft_angle(dead, rig_of((23, 46)))
    short = Recording(recording.samples[:, :2000], 12_800.0, recording.channels)
    with pytest.raises(RefusalError, match="fewer than"):
        estimate_shaft_angle(short, rig_of((23, 46), nominal_rpm=1980.0))


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize("nominal", [2000.0, None])
def test_measured_gear_pair(nominal: float | None) -> None:
    first, second = (BY_NAME[f"gear_pair_23_46/3027_217_Data_Chan{number}.mat"].read() for number in (12, 14))
    both = Recording(
        np.vstack([first.samples[:1], second.samples[:1]]),
        25_600.0,
        (Channel("a12", "acceleration"), Channel("a14", "acceleration")),
    )
    angle = estimate_shaft_angle(both, rig_of((23, None), nominal_rpm=nominal))
    assert angle.mean_speed_rpm == pytest.approx(1999.76, rel=5e-4)
    assert angle.quality > 0.6


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("name", "nominal", "teeth"),
    [
        ("InnerRaceFault_vload_3", 1500.0, (31, 20)),
        ("InnerRaceFault_vload_3", None, (23,)),
        ("OuterRaceFault_vload_4", 1500.0, (23, 31)),
        ("OuterRaceFault_vload_4", None, (20,)),
    ],
)
def test_measured_bearings_are_no_gears(name: str, nominal: float | None, teeth: tuple[int, ...]) -> None:
    recording = BY_NAME[f"bearing_races/{name}.mat"].read()
    for number in teeth:
        with pytest.raises(RefusalError):
            estimate_shaft_angle(recording, rig_of((number, None), nominal_rpm=nominal))


@pytest.mark.slow
@needs_data
def test_measured_two_stage_gearbox() -> None:
    recording = BY_NAME["two_stage_gearbox/h30hz50.csv.gz"].read()
    angle = estimate_shaft_angle(recording, rig_of((32, 96), (32, 80)))
    assert angle.mean_speed_rpm == pytest.approx(29.68 * 60, rel=1e-3)


@pytest.mark.slow
@needs_data
def test_measured_car_is_not_claimed_wrongly() -> None:
    with pytest.raises(RefusalError):
        estimate_shaft_angle(car_run_up()[0], rig_of((23, None)))
