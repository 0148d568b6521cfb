"""The main job on real recordings, used in place; skipped where they are absent."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import resample_poly

from gearsig.comparison import compare
from gearsig.diagnosis import Analysis, CannotTell, Finding, Kind, Outcome, analyze
from gearsig.prepared import refined_angle
from gearsig.recording import Recording, read_recording
from gearsig.rig import ConstantSpeed, OperatingPoint
from gearsig.severity import CrackEstimate, NoCrackSeen, estimate_crack
from tests.marks import further
from tests.measured import (
    BEARING,
    BY_NAME,
    CWRU_RATES_HZ,
    DATA,
    MOTOR,
    PARTS,
    PINION,
    RECORDINGS,
    TWO_STAGES,
    at_speed,
    halves,
    needs_data,
    with_assumed_gears,
)

pytestmark = needs_data


def found(analysis: Analysis, code: str) -> Finding:
    return next(f for f in analysis.findings if f.code == code)


def claims(analysis: Analysis, *kinds: Kind) -> set[str]:
    return {f.code for f in analysis.findings if f.kind in (kinds or (Kind.FAULT, Kind.SUSPICION))}


@pytest.mark.slow
@pytest.mark.parametrize("nominal", [True, False], ids=["nominal speed given", "no speed given"])
@pytest.mark.parametrize("channel", [12, further(14)])
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
    recording = read_recording(DATA / "bearing_cwru" / file, rig=replace(MOTOR, sampling_rate_hz=CWRU_RATES_HZ[file]))
    recording = recording.select(recording.vibration_names())
    return replace(recording, samples=recording.samples[:, part], speed=ConstantSpeed(stated_rpm, "motor"))


@pytest.mark.parametrize("file", ["OR007@6_0.mat", "IR021_0.mat", "B007_0.mat", "normal_0.mat"])
def test_a_stated_speed_is_set_right_alike_from_either_half(file: str) -> None:
    half = motor_bench(file).n_samples // 2
    for part, rpm in ((slice(half), 1797.0), (slice(half, None), 1770.0)):
        angle = refined_angle(motor_bench(file, part=part, stated_rpm=rpm), MOTOR)
        assert angle.mean_speed_rpm == pytest.approx(1796.0, rel=6e-4)


@pytest.mark.slow
@pytest.mark.parametrize("file", ["InnerRaceFault_vload_3.mat", "OuterRaceFault_vload_4.mat"])
def test_bearing_files_with_gears_in_the_rig_claim_no_gear_fault(file: str) -> None:
    rig = replace(PINION, operating_point=OperatingPoint(), speed=ConstantSpeed(1500.0, "input"))
    analysis = analyze(read_recording(DATA / "bearing_races" / file, rig=rig))
    assert not claims(analysis) & {"tooth-local-damage", "mesh-modulated"}


@pytest.mark.slow
@pytest.mark.parametrize("file", ["h30hz50.csv.gz", "b30hz50.csv.gz"])
def test_two_stage_gearbox_is_left_undecided(file: str) -> None:
    analysis = analyze(read_recording(DATA / "two_stage_gearbox" / file, rig=TWO_STAGES))
    assert not claims(analysis, Kind.FAULT)
    assert "tooth-local-damage" not in claims(analysis)
    assert analysis.verdict.startswith("Cannot tell")
    assert "assumed" in found(analysis, "tooth-damage-undecided").title


@pytest.mark.slow
def test_of_two_recordings_of_the_two_stage_gearbox_one_sensor_differs() -> None:
    now, reference = (BY_NAME[f"two_stage_gearbox/{file}"].read() for file in ("b30hz50.csv.gz", "h30hz50.csv.gz"))
    analysis = analyze(now, reference=reference)
    assert found(analysis, "channel-faded").where.channels == ("a1",)
    assert claims(analysis) == {"changed-since-reference"}
    assert any(text.startswith("Against it: 5× mesh second in a2") for text in found(analysis, "mesh-risen").evidence)


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("file", ["OR007@6_0.mat", further("IR021_0.mat")])
def test_impacts_of_an_unknown_bearing_are_placed_at_the_drive_end(file: str) -> None:
    recording = read_recording(DATA / "bearing_cwru" / file, sampling_rate_hz=CWRU_RATES_HZ[file])
    (channel,) = found(analyze(recording), "non-synchronous-impacts").where.channels
    assert channel.endswith("DE_time")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "code"),
    [
        ("OR007@6_0.mat", "bearing-outer-race"),
        ("IR021_0.mat", "bearing-inner-race"),
        ("B007_0.mat", ""),  # published studies call it not diagnosable by its envelope
        ("normal_0.mat", ""),
    ],
)
def test_motor_bench_names_the_right_part_of_the_right_bearing_or_none(file: str, code: str) -> None:
    analysis = analyze(BY_NAME[f"bearing_cwru/{file}"].read())
    likely = [(f.code, f.where.bearing) for f in analysis.findings if f.code in PARTS and f.confidence > 0.5]
    assert likely == ([(code, "drive end")] if code else [])
    if file == "normal_0.mat":
        assert not claims(analysis)
        assert analysis.outcome is Outcome.NO_FAULT


@pytest.mark.parametrize(("file", "race"), [("OR007@6_0.mat", "outer-race"), ("IR021_0.mat", "inner-race")])
def test_one_second_of_one_sensor_names_the_same_race(file: str, race: str) -> None:
    # Beats of tones at the cage's order, a ninth of the outer race's, take nothing from that; of a second the race's
    # own further lines are a tenth of all.
    recording = BY_NAME[f"bearing_cwru/{file}"].read()
    drive_end = next(name for name in recording.vibration_names() if "_DE_" in name)
    part = recording.select([drive_end]).between(4.5, 5.5)
    race_finding = found(analyze(part), f"bearing-{race}")
    assert race_finding.kind is Kind.FAULT
    assert race_finding.where.bearing == "drive end"


@pytest.mark.slow
def test_a_race_that_nobody_described_makes_no_rate_doubtful() -> None:
    # Its order, 18 fifths of the shaft's, would be that of a shaft that turns five times slower as well.
    recording = BY_NAME["bearing_cwru/OR007@6_0.mat"].read()
    analysis = analyze(replace(recording, rig=replace(MOTOR, bearings=MOTOR.bearings[1:])))
    assert claims(analysis) == {"non-synchronous-impacts"}
    assert found(analysis, "non-synchronous-impacts").where.order == pytest.approx(3.597, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.95, further(1.05)])
def test_a_stated_speed_is_set_right_where_two_sensors_show_the_shaft(factor: float) -> None:
    recording = at_speed(BY_NAME["bearing_cwru/IR021_0.mat"].read(), factor)
    assert refined_angle(recording, MOTOR).mean_speed_rpm == pytest.approx(1796.3, abs=0.5)
    assert found(analyze(recording), "bearing-inner-race").where.bearing == "drive end"
    # One sensor alone leaves it open, and names no part of another bearing.
    alone = analyze(recording.select(["X209_FE_time"]))
    assert all(f.confidence <= 0.5 for f in alone.findings if f.code in PARTS)


@pytest.mark.slow
def test_a_wrong_stated_speed_is_told_as_exactly_as_the_shaft_s_lines() -> None:
    recording = at_speed(BY_NAME["bearing_cwru/IR021_0.mat"].read().select(["X209_DE_time"]), 0.94)
    (speed_rpm,) = re.findall(r"([\d.]+) rpm instead", found(analyze(recording), "sampling-rate-doubtful").title)
    assert float(speed_rpm) == pytest.approx(1796.3, abs=2.0)


@pytest.mark.slow
def test_a_weak_race_is_no_slower_train_s_whose_lines_are_its_sums_with_the_shaft() -> None:
    damaged, healthy = (BY_NAME[f"bearing_cwru/{file}"].read() for file in ("OR007@6_0.mat", "normal_0.mat"))
    background = resample_poly(np.asarray(healthy.samples[0], np.float64), 1, 4)
    for share in (1.0, 0.25):
        mixed = background + share * damaged.values("X130_DE_time")[: len(background)]
        alone = replace(damaged.select(["X130_DE_time"]), samples=mixed[None, :])
        assert found(analyze(alone), "bearing-outer-race").confidence > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "part"),
    [("OR007@6_0.mat", "outer race"), further("IR021_0.mat", "inner race")],
)
def test_a_damaged_race_is_the_first_that_has_changed_since_the_motor_was_healthy(file: str, part: str) -> None:
    analysis = analyze(BY_NAME[f"bearing_cwru/{file}"].read(), reference=BY_NAME["bearing_cwru/normal_0.mat"].read())
    assert analysis.verdict.startswith(f"Changed since the reference: {part} of drive end +")
    assert found(analysis, f"bearing-{part.replace(' ', '-')}").kind is Kind.FAULT


@pytest.mark.slow
def test_a_rotor_with_more_unbalance_has_changed_first_of_all() -> None:
    before = BY_NAME["unbalance_rotor/unbalance.mat#1"].read()
    # Speeds: the peak at 1× of a spectrum padded to 2²² values; that at 2× says the same to 0.5 rpm.
    for condition, rise_db, speed_rpm in ((2, 18.8, 3602.5), (3, 22.7, 3606.7)):
        analysis = analyze(BY_NAME[f"unbalance_rotor/unbalance.mat#{condition}"].read(), reference=before)
        assert [f.code for f in analysis.findings[:2]] == ["changed-since-reference", "unbalance"]
        once = next(c for c in analysis.level_changes if c.label == "1× rotor")
        assert once.change_db == pytest.approx(rise_db, abs=0.5)
        assert all(f.confidence < 0.5 for f in analysis.findings if f.code in PARTS)
        assert analysis.shaft_angle.mean_speed_rpm == pytest.approx(speed_rpm, abs=1.5)  # type: ignore[union-attr]


@pytest.mark.study
@pytest.mark.parametrize("name", [one.name for one in RECORDINGS])
def test_the_halves_of_a_recording_are_alike(name: str) -> None:
    first, second = halves(BY_NAME[name].read())
    analysis = analyze(second, reference=first)
    assert not any(c.is_change for c in analysis.level_changes)
    assert "changed-since-reference" not in {f.code for f in analysis.findings}
    assert not isinstance(analysis.crack, CrackEstimate)


@pytest.mark.slow
@pytest.mark.parametrize("channel", [12, 14])
def test_parts_of_a_recording_of_one_gear_pair_differ_by_no_crack(channel: int) -> None:
    recording = with_assumed_gears(BY_NAME[f"gear_pair_23_46/3027_217_Data_Chan{channel}.mat"].read())
    quarter_s = recording.duration_s / 4
    quarters = [recording.between(i * quarter_s, (i + 1) * quarter_s) for i in range(4)]
    first, second = halves(recording)
    for reference, part in ((first, second), (second, first), (quarters[0], quarters[1]), (quarters[0], quarters[3])):
        assert isinstance(estimate_crack(part, reference=reference), NoCrackSeen)


@pytest.mark.slow
@pytest.mark.parametrize("name", [one.name for one in RECORDINGS])
def test_the_halves_of_a_recording_compare_alike(name: str) -> None:
    """No line that both halves show is 6 dB apart beyond its scatter; a run-up's halves run at other speeds."""
    comparison = compare(*halves(BY_NAME[name].read()))
    for channel in comparison.channels:
        assert abs(channel.overall.difference_db) < 1.0
        apart = [
            line.label
            for line in channel.lines
            if line.simulated_is_seen and line.recorded_is_seen and line.level.is_beyond
            if abs(line.level.difference_db) >= 6.0
        ]
        assert not apart
