"""A sampling rate that is stated wrongly is told, with the factor that fits; one that is right is never doubted."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gearsig.diagnosis import analyze
from gearsig.recording import Channel, Recording, read_recording
from gearsig.rig import Bearing, ConstantSpeed, OperatingPoint, Rig, Shaft, TachometerChannel
from tests.diagnosis.machines import GOOD, codes, finding, record
from tests.kinematic.speed import ConstantProfile

DATA = Path(__file__).parents[3] / "shared" / "data"
CODE = "sampling-rate-doubtful"
FS_HZ, SHAFT_HZ = 12_000.0, 29.95
MOTOR = Rig(
    shafts=(Shaft("motor"),),
    bearings=(Bearing("drive end", "motor", 9, 7.94, 39.04),),
    speed=ConstantSpeed(60 * SHAFT_HZ, "motor"),
)


@cache
def motor(race: str, seed: int) -> Recording:
    """A motor with its shaft's lines in noise, and a damaged race or element whose impacts ring at 2.8 kHz."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(6.0 * FS_HZ)) / FS_HZ
    x = rng.standard_normal(len(t))
    for k in range(1, 7):
        x += rng.uniform(0.1, 0.5) * np.cos(2 * np.pi * k * SHAFT_HZ * t + rng.uniform(0, 6))
    if race:
        rate_hz = {"BPFO": 3.585, "BPFI": 5.415, "BSF": 2 * 2.357}[race] * 0.997 * SHAFT_HZ
        hits = np.arange(0.01, t[-1], 1 / rate_hz)
        impacts = np.zeros_like(t)
        modulation_hz = {"BPFO": 0.0, "BPFI": SHAFT_HZ, "BSF": 0.3983 * SHAFT_HZ}[race]
        load = 1 + 0.8 * np.cos(2 * np.pi * modulation_hz * hits) if modulation_hz else 1.0
        impacts[np.round(hits * FS_HZ).astype(int)] = 8.0 * load
        x += np.convolve(impacts, np.exp(-900 * t[:400]) * np.sin(2 * np.pi * 2800 * t[:400]))[: len(t)]
    return Recording(x[None, :], FS_HZ, (Channel("a1", "acceleration", "m/s^2"),), rig=MOTOR)


@pytest.mark.parametrize(("race", "times"), [("BPFO", 0.1), ("BPFI", 0.25), ("BPFI", 4.0), ("BPFI", 12.8 / 12)])
def test_of_a_motor(race: str, times: float) -> None:
    analysis = analyze(replace(motor(race, 1), sampling_rate_hz=FS_HZ * times))
    assert f"{FS_HZ:g} Hz" in finding(analysis, CODE).title
    assert analysis.verdict.startswith(finding(analysis, CODE).title)
    assert not any(code.startswith("bearing") for code in codes(analysis))


@pytest.mark.parametrize("race", ["", "BPFO", "BPFI", "BSF"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_that_is_right(race: str, seed: int) -> None:
    assert CODE not in codes(analyze(motor(race, seed)))


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


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
@pytest.mark.parametrize(
    ("name", "right_hz", "stated_hz"),
    [
        pytest.param("normal_0", 48_000, 12_000, marks=pytest.mark.slow),
        pytest.param("IR021_0", 12_000, 48_000, marks=pytest.mark.slow),
        ("OR007@6_0", 12_000, 25_600),
    ],
)
def test_of_a_measured_motor(name: str, right_hz: int, stated_hz: int) -> None:
    rig = replace(MOTOR, bearings=(*MOTOR.bearings, Bearing("fan end", "motor", 8, 6.746, 28.5)), speed=None)
    recording = read_recording(DATA / f"bearing_cwru/{name}.mat", rig=rig, sampling_rate_hz=right_hz)
    right, wrong = (analyze(replace(recording, sampling_rate_hz=rate_hz)) for rate_hz in (right_hz, stated_hz))
    assert CODE not in codes(right)
    assert f"{right_hz} Hz" in finding(wrong, CODE).title
