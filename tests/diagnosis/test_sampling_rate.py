"""A sampling rate that is stated wrongly is told, with the factor that fits; one that is right is never doubted."""

from dataclasses import replace
from pathlib import Path

import pytest

from gearsig.diagnosis import analyze
from gearsig.recording import read_recording
from gearsig.rig import Bearing, OperatingPoint, TachometerChannel
from tests.diagnosis.machines import GOOD, MOTOR, MOTOR_RATE_HZ, codes, finding, motor, record
from tests.kinematic.speed import ConstantProfile

DATA = Path(__file__).parents[3] / "shared" / "data"
CODE = "sampling-rate-doubtful"


@pytest.mark.parametrize(("race", "times"), [("BPFO", 0.1), ("BPFI", 0.25), ("BPFI", 4.0), ("BPFI", 12.8 / 12)])
def test_of_a_motor(race: str, times: float) -> None:
    analysis = analyze(replace(motor(race, 1), sampling_rate_hz=MOTOR_RATE_HZ * times))
    assert f"{MOTOR_RATE_HZ:g} Hz" in finding(analysis, CODE).title
    assert analysis.verdict.startswith(finding(analysis, CODE).title)
    assert not any(code.startswith("bearing") for code in codes(analysis))


@pytest.mark.parametrize("race", ["", "BPFO", "BPFI", "BSF"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_that_is_right(race: str, seed: int) -> None:
    assert CODE not in codes(analyze(motor(race, seed)))


def test_that_is_right_in_a_short_record_whose_race_is_nearly_a_fraction_of_the_shaft() -> None:
    """5 BPFI is 27 turns within the resolution: all lines of the race are those of a shaft at a fifth of the rate."""
    rig = replace(MOTOR, bearings=(*MOTOR.bearings, Bearing("fan end", "motor", 8, 6.746, 28.5)))
    assert CODE not in codes(analyze(replace(motor("BPFI", 1).between(0.0, 2.5), rig=rig)))


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
        pytest.param("OR007@6_0", 12_000, 30_720, marks=pytest.mark.slow),
        pytest.param("IR021_0", 12_000, 30_720, marks=pytest.mark.slow),
        pytest.param("normal_0", 48_000, 4_800, marks=pytest.mark.slow),
    ],
)
def test_of_a_measured_motor(name: str, right_hz: int, stated_hz: int) -> None:
    rig = replace(MOTOR, bearings=(*MOTOR.bearings, Bearing("fan end", "motor", 8, 6.746, 28.5)), speed=None)
    recording = read_recording(DATA / f"bearing_cwru/{name}.mat", rig=rig, sampling_rate_hz=right_hz)
    right, wrong = (analyze(replace(recording, sampling_rate_hz=rate_hz)) for rate_hz in (right_hz, stated_hz))
    assert CODE not in codes(right)
    assert f"{right_hz} Hz" in finding(wrong, CODE).title
