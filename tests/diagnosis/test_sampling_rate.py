"""A sampling rate that is stated wrongly is told, with the factor that fits; one that is right is never doubted."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gearsig.diagnosis import analyze
from gearsig.recording import Recording, read_recording
from gearsig.rig import Bearing, ConstantSpeed, OperatingPoint, TachometerChannel
from tests.diagnosis.machines import GOOD, MOTOR, MOTOR_HZ, MOTOR_RATE_HZ, codes, finding, motor, record
from tests.kinematic.speed import ConstantProfile
from tests.marks import further
from tests.measured import BY_NAME, DATA, needs_data

CODE = "sampling-rate-doubtful"


@pytest.mark.parametrize(("race", "times"), [("BPFO", 0.1), ("BPFI", 0.25), ("BPFI", 4.0), ("BPFI", 12.8 / 12)])
def test_of_a_motor(race: str, times: float) -> None:
    analysis = analyze(replace(motor(race, 1), sampling_rate_hz=MOTOR_RATE_HZ * times))
    doubt = finding(analysis, CODE)
    assert f"{MOTOR_RATE_HZ:g} Hz" in doubt.title
    assert f" Hz instead of the stated {times * MOTOR_RATE_HZ:.6g} Hz" in doubt.title
    assert re.search(r"a probability of 10⁻[⁰¹²³⁴⁵⁶⁷⁸⁹]+, were the spectra independent", doubt.evidence[0])
    assert analysis.verdict.startswith(finding(analysis, CODE).title)
    assert not any(code.startswith("bearing") for code in codes(analysis))


@pytest.mark.slow
@pytest.mark.parametrize("race", ["", "BPFO", "BPFI", "BSF"])
@pytest.mark.parametrize("seed", [1, further(2), further(3)])
def test_that_is_right(race: str, seed: int) -> None:
    assert CODE not in codes(analyze(motor(race, seed)))


@pytest.mark.slow
def test_that_is_right_in_a_short_record_whose_race_is_nearly_a_fraction_of_the_shaft() -> None:
    """5 BPFI is 27 turns within the resolution: all lines of the race are those of a shaft at a fifth of the rate."""
    rig = replace(MOTOR, bearings=(*MOTOR.bearings, Bearing("fan end", "motor", 8, 6.746, 28.5)))
    assert CODE not in codes(analyze(replace(motor("BPFI", 1).between(0.0, 2.5), rig=rig)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_race_that_nobody_described_is_no_wrong_rate(seed: int) -> None:
    """Its order is near 27/5: at five times the rate all its lines would be multiples of the shaft's order."""
    recording = replace(motor("BPFI", seed), rig=replace(MOTOR, bearings=()))
    assert CODE not in codes(analyze(recording))


def test_one_element_at_the_stated_rate_asks_for_no_mistake() -> None:
    """In 1.3 s its lines are near those of shafts and races at a rate 2.56 times as high."""
    rng, d, pitch = np.random.default_rng(0), 5.969, 31.623
    t = np.arange(15_360) / MOTOR_RATE_HZ
    x = rng.standard_normal(len(t))
    for k in range(1, 5):
        x += rng.uniform(0.1, 0.5) * np.cos(2 * np.pi * k * MOTOR_HZ * t + rng.uniform(0, 6))
    rate_hz = 0.996 * MOTOR_HZ * (pitch / d - d / pitch)
    hits = np.cumsum((1 + 0.003 * rng.standard_normal(int(rate_hz * t[-1]) - 10)) / rate_hz)
    impacts = np.zeros_like(t)
    impacts[np.searchsorted(t, hits)] = 8 * np.clip(np.cos(np.pi * (1 - d / pitch) * MOTOR_HZ * hits), 0.1, None)
    x += np.convolve(impacts, np.exp(-900 * t[:400]) * np.sin(2 * np.pi * 2800 * t[:400]))[: len(t)]
    rig = replace(MOTOR, bearings=(Bearing("test bearing", "motor", 8, d, pitch),))
    assert CODE not in codes(analyze(replace(motor("", 1), samples=x[None, :], rig=rig)))


@pytest.mark.slow
def test_a_wrong_speed_is_as_likely_as_a_wrong_rate_but_for_the_mains() -> None:
    recording = replace(motor("BPFI", 1), sampling_rate_hz=1.1 * MOTOR_RATE_HZ)  # 33 Hz: no multiple is near 50 Hz
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    hum = sum(0.5 * np.cos(2 * np.pi * k * 50.0 * t) for k in (1, 2, 3))
    turns_rpm, rate_hz = 1.1 * 60.0 * MOTOR_HZ, recording.sampling_rate_hz
    rate, speed = f"{rate_hz:g} Hz", f"{int(turns_rpm)}"
    for x in (0.0, hum):
        recording = replace(recording, samples=recording.samples + x, speed=ConstantSpeed(turns_rpm, "motor"))
        slow = finding(analyze(replace(recording, sampling_rate_hz=rate_hz / 4)), CODE).title
        fast = finding(analyze(replace(recording, speed=ConstantSpeed(4 * turns_rpm, "motor"))), CODE).title
        assert rate in slow
        assert speed in fast
        assert ("rpm" in slow, " Hz" in fast) == ((True, True) if x is not hum else (False, False))


@pytest.mark.parametrize("times", [0.5, 10.0])
def test_of_gears_with_a_nominal_speed(times: float) -> None:
    recording = record(replace(GOOD, speed=ConstantProfile(1320.0)))
    rig = replace(recording.rig, operating_point=OperatingPoint("in", 1320.0))
    without = replace(recording.select(["a1"]), speed=None, rig=rig)
    doubted = analyze(replace(without, sampling_rate_hz=recording.sampling_rate_hz * times))
    assert f"{recording.sampling_rate_hz:g} Hz" in finding(doubted, CODE).title
    assert CODE not in codes(analyze(without))


def test_by_a_tachometer() -> None:
    recording = record()
    assert isinstance(recording.speed, TachometerChannel)
    rig = replace(recording.rig, operating_point=OperatingPoint("in", 1320.0))
    doubted = analyze(replace(recording, rig=rig, sampling_rate_hz=10 * recording.sampling_rate_hz))
    assert f"{recording.sampling_rate_hz:g} Hz" in finding(doubted, CODE).title
    assert "mesh-found" in codes(doubted)  # orders are right
    assert CODE not in codes(analyze(replace(recording, rig=rig)))


@needs_data
@pytest.mark.parametrize("race", ["InnerRaceFault_vload_3", "OuterRaceFault_vload_4"])
def test_of_a_measured_race_that_nobody_described(race: str) -> None:
    speed = ConstantSpeed(1500.0)
    assert CODE not in codes(analyze(read_recording(DATA / f"bearing_races/{race}.mat", speed=speed)))


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("bearing_races/OuterRaceFault_vload_4.mat", 0.1),
        further("bearing_races/OuterRaceFault_vload_4.mat", 0.2),
        ("bearing_races/InnerRaceFault_vload_3.mat", 0.25),
        further("bearing_cwru/OR007@6_0.mat", 0.1),
        further("bearing_cwru/OR007@6_0.mat", 0.2),
        ("bearing_cwru/B007_0.mat", 0.1),
    ],
)
def test_of_a_measured_race_at_a_rate_that_is_too_low(name: str, times: float) -> None:
    """The factor that fits is named first: no common rate, of which there are many, and no half of it."""
    recording = BY_NAME[name].read()
    stated = analyze(replace(recording, sampling_rate_hz=recording.sampling_rate_hz * times))
    assert f"{recording.sampling_rate_hz:g} Hz" in finding(stated, CODE).title.split("would fit best")[0]


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("bearing_cwru/OR007@6_0.mat", 2.0),
        further("bearing_cwru/OR007@6_0.mat", 8.0),
        further("bearing_cwru/IR021_0.mat", 2.0),
        further("bearing_cwru/IR021_0.mat", 10.0),
        ("bearing_races/InnerRaceFault_vload_3.mat", 5.0),
    ],
)
def test_of_a_measured_race_at_a_rate_that_is_too_high(name: str, times: float) -> None:
    """Multiples of k orders are multiples of one as well: what is missing between them tells."""
    recording = BY_NAME[name].read()
    stated = analyze(replace(recording, sampling_rate_hz=recording.sampling_rate_hz * times))
    assert f"{recording.sampling_rate_hz:g} Hz" in finding(stated, CODE).title.split("would fit best")[0]
    assert not any(code.startswith("bearing") for code in codes(stated))


@pytest.mark.parametrize("blades", [4, 5, 8])
def test_blades_are_no_wrong_rate(blades: int) -> None:
    """Their multiples stand far over the shaft's own, and a race is damaged: at one over the blades is no machine."""
    recording = motor("BPFI", 2)
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    passing = sum(3.0 * np.cos(2 * np.pi * k * blades * MOTOR_HZ * t) for k in range(1, 9))
    assert CODE not in codes(analyze(replace(recording, samples=recording.samples + passing)))


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("name", "right_hz", "stated_hz"),
    [
        ("normal_0", 48_000, 12_000),
        further("IR021_0", 12_000, 48_000),
        ("OR007@6_0", 12_000, 25_600),
        further("OR007@6_0", 12_000, 30_720),
        further("IR021_0", 12_000, 30_720),
        further("normal_0", 48_000, 4_800),
    ],
)
def test_of_a_measured_motor(name: str, right_hz: int, stated_hz: int) -> None:
    recording, right_codes = measured_motor(name, right_hz)
    assert CODE not in right_codes
    wrong = analyze(replace(recording, sampling_rate_hz=stated_hz))
    assert f"{right_hz} Hz" in finding(wrong, CODE).title


@cache
def measured_motor(name: str, right_hz: int) -> tuple[Recording, list[str]]:
    """Return a recording at its right rate, and the codes of what is found in it."""
    rig = replace(MOTOR, bearings=(*MOTOR.bearings, Bearing("fan end", "motor", 8, 6.746, 28.5)), speed=None)
    recording = read_recording(DATA / f"bearing_cwru/{name}.mat", rig=rig, sampling_rate_hz=right_hz)
    return recording, codes(analyze(recording))
