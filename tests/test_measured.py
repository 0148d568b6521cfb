"""The main job on real recordings, used in place; skipped where they are absent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.diagnosis import Analysis, CannotTell, Finding, Kind, analyze
from gearsig.prepared import refined_angle
from gearsig.recording import Recording, read_recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, OperatingPoint, Rig, Shaft

DATA = Path(__file__).parents[2] / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")

PINION = Rig(
    name="one gear pair, wheel not described",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 23),),
    operating_point=OperatingPoint("input", 2000.0),
)
BEARING = Rig(
    name="bearing test rig",
    shafts=(Shaft("shaft"),),
    # The set's own figures: 8 balls of 0.235 in on a pitch diameter of 1.245 in (BPFO 81.125 Hz at 25 Hz).
    bearings=(Bearing("test bearing", "shaft", 8, 5.969, 31.623),),
    speed=ConstantSpeed(1500.0, "shaft"),
)
MOTOR = Rig(
    name="motor test bench",
    shafts=(Shaft("motor"),),
    bearings=(Bearing("drive end", "motor", 9, 7.94, 39.04), Bearing("fan end", "motor", 8, 6.746, 28.5)),
)
TWO_STAGES = Rig(
    name="fault simulator",
    shafts=(Shaft("input"), Shaft("middle"), Shaft("output")),
    pairs=(GearPair("first", "input", "middle", 32, 96), GearPair("second", "middle", "output", 32, 80)),
    operating_point=OperatingPoint("input", 1800.0),
    sampling_rate_hz=4266.7,
    assumed=("sampling rate", "teeth"),
)


RATES_HZ = {"OR007@6_0.mat": 12e3, "IR021_0.mat": 12e3, "B007_0.mat": 12e3, "normal_0.mat": 48e3}


def found(analysis: Analysis, code: str) -> Finding:
    return next(f for f in analysis.findings if f.code == code)


def claims(analysis: Analysis, *kinds: Kind) -> set[str]:
    return {f.code for f in analysis.findings if f.kind in (kinds or (Kind.FAULT, Kind.SUSPICION))}


@pytest.mark.parametrize("nominal", [True, False], ids=["nominal speed given", "no speed given"])
@pytest.mark.parametrize("channel", [12, 14])
def test_gear_pair_without_tachometer(channel: int, nominal: bool) -> None:
    rig = PINION if nominal else replace(PINION, operating_point=OperatingPoint())
    analysis = analyze(read_recording(DATA / "gear_pair_23_46" / f"3027_217_Data_Chan{channel}.mat", rig=rig))
    assert not isinstance(analysis.shaft_angle, CannotTell)
    assert analysis.shaft_angle.mean_speed_rpm == pytest.approx(1999.76, rel=5e-4)
    spectrum = analysis.channels[0].spectrum
    assert spectrum.largest_near(766.6, 5.0)[0] == pytest.approx(766.6, abs=0.1)
    wheel = found(analysis, "sidebands-of-unknown-shaft")
    assert wheel.where.order == pytest.approx(0.5, abs=0.003)
    assert any("46 teeth" in text for text in wheel.evidence)
    # A family that is no multiple of a shaft is there, and is not put down to the gears.
    assert found(analysis, "non-synchronous-impacts").where.order == pytest.approx(5.15, abs=0.02)
    assert claims(analysis) <= {"non-synchronous-impacts"}


@pytest.mark.parametrize(
    ("file", "code", "hertz"),
    [
        ("InnerRaceFault_vload_3.mat", "bearing-inner-race", 118.875),
        ("OuterRaceFault_vload_4.mat", "bearing-outer-race", 81.125),
    ],
)
def test_bearing_files(file: str, code: str, hertz: float) -> None:
    analysis = analyze(read_recording(DATA / "bearing_races" / file, rig=BEARING))
    assert claims(analysis) == {code}
    assert found(analysis, code).kind is Kind.FAULT
    assert found(analysis, code).where.frequency_hz == pytest.approx(hertz, rel=0.02)
    # The kurtogram's own band is searched like the fixed ones, and shows the race by itself.
    assert any("own band" in text and "dB over its floor" in text for text in found(analysis, code).evidence)
    assert analysis.channels[0].kurtogram_band is not None


def motor_bench(file: str, *, part: slice = slice(None), stated_rpm: float = 1797.0) -> Recording:
    """Return a recording of the motor test bench, or a part of it, with the speed that is stated for it."""
    recording = read_recording(DATA / "bearing_cwru" / file, rig=replace(MOTOR, sampling_rate_hz=RATES_HZ[file]))
    recording = recording.select(recording.vibration_names())
    return replace(recording, samples=recording.samples[:, part], speed=ConstantSpeed(stated_rpm, "motor"))


@pytest.mark.parametrize("file", ["OR007@6_0.mat", "IR021_0.mat", "B007_0.mat", "normal_0.mat"])
def test_a_stated_speed_is_set_right_alike_from_either_half(file: str) -> None:
    half = motor_bench(file).n_samples // 2
    for part, rpm in ((slice(half), 1797.0), (slice(half, None), 1770.0)):
        angle = refined_angle(motor_bench(file, part=part, stated_rpm=rpm), MOTOR)
        assert angle.mean_speed_rpm == pytest.approx(1796.0, rel=6e-4)


@pytest.mark.parametrize("file", ["InnerRaceFault_vload_3.mat", "OuterRaceFault_vload_4.mat"])
def test_bearing_files_with_gears_in_the_rig_claim_no_gear_fault(file: str) -> None:
    rig = replace(PINION, operating_point=OperatingPoint(), speed=ConstantSpeed(1500.0, "input"))
    analysis = analyze(read_recording(DATA / "bearing_races" / file, rig=rig))
    assert not claims(analysis) & {"tooth-local-damage", "mesh-modulated"}


@pytest.mark.parametrize("file", ["h30hz50.csv.gz", "b30hz50.csv.gz"])
def test_two_stage_gearbox_is_left_undecided(file: str) -> None:
    analysis = analyze(read_recording(DATA / "two_stage_gearbox" / file, rig=TWO_STAGES))
    assert not claims(analysis, Kind.FAULT)
    assert "tooth-local-damage" not in claims(analysis)
    assert analysis.verdict.startswith("Cannot tell")
    assert "assumed" in found(analysis, "tooth-damage-undecided").title


def test_car_run_up_reads_its_own_speed_channel() -> None:
    analysis = analyze(read_recording(DATA / "car_run_up" / "accel_with_rpm.wav"))
    assert not isinstance(analysis.shaft_angle, CannotTell)
    low, high = analysis.shaft_angle.speed_range_rpm
    assert low == pytest.approx(974, abs=5)
    assert high == pytest.approx(4821, abs=5)
    assert analysis.channels[0].order_map is not None
    assert not claims(analysis)
    levels = {level.order: level for level in analysis.channels[0].order_levels}
    assert {2.0, 4.0} <= set(levels)
    table = np.loadtxt(DATA / "car_run_up" / "reference_order_levels.txt", skiprows=1)  # another vendor's
    for order, column in ((2.0, 1), (4.0, 2)):
        level = levels[order]
        known = (table[:, 0] > level.speed_rpm[0]) & (table[:, 0] < level.speed_rpm[-1])
        power = np.interp(table[known, 0], level.speed_rpm, level.amplitude**2)
        difference = 10 * np.log10(power / 2 / 20e-6**2) - table[known, column]
        assert np.median(np.abs(difference)) < 1.5  # in dB; no smoothing alike was sought
        assert abs(np.median(difference)) < 0.5
