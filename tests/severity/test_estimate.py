"""Crack severity on a simulated gearbox without noise: monotone, placed, bounded, or refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.plot import figure_of_refusal
from gearsig.recording import Recording, read_recording
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft, read_rig
from gearsig.severity import CrackEstimate, NoCrackSeen, estimate_crack
from tests.severity.gearbox import SPEED_RPM, Record

DEPTHS_MM = (1.2, 2.0, 3.0)
"""A crack of 1 mm is at the margin of what stands out here."""
Answers = dict[float, CrackEstimate | NoCrackSeen]


@pytest.fixture(scope="module")
def answers(record: Record, healthy: Recording) -> Answers:
    """What is said of cracks of several depths."""
    return {depth: estimate_crack(record(depth), reference=healthy) for depth in (0.0, 0.5, *DEPTHS_MM, 4.0)}


def crack(answer: CrackEstimate | NoCrackSeen) -> CrackEstimate:
    assert isinstance(answer, CrackEstimate), answer
    return answer


def with_pair(recording: Recording, **changes: object) -> Recording:
    assert recording.rig is not None
    pair = replace(recording.rig.pairs[0], **changes)  # type: ignore[arg-type]  # names of fields
    return replace(recording, rig=replace(recording.rig, pairs=(pair,)))


@pytest.mark.slow
def test_estimates_rise_with_the_depth(answers: Answers) -> None:
    found = [crack(answers[depth]) for depth in DEPTHS_MM]
    depths = [f.depth_mm for f in found]
    assert depths == sorted(depths)
    assert len(set(depths)) == len(depths)
    rises = [f.squeezed_rise_db for f in found]
    assert rises == sorted(rises)
    for depth, answer in zip(DEPTHS_MM, found, strict=True):
        assert answer.interval_mm[0] <= depth <= answer.interval_mm[1]
        assert answer.depth_percent / answer.depth_mm == pytest.approx(found[0].depth_percent / found[0].depth_mm)


@pytest.mark.slow
def test_neither_estimate_nor_bound_falls_from_half_a_millimetre_on(answers: Answers) -> None:
    deeper = [answers[depth] for depth in (0.5, *DEPTHS_MM, 4.0)]
    sizes = [(a.depth_mm, a.interval_mm[1]) if isinstance(a, CrackEstimate) else (0.0, 0.0) for a in deeper]
    assert [size for size, _ in sizes] == sorted(size for size, _ in sizes)
    assert [bound for _, bound in sizes] == sorted(bound for _, bound in sizes)
    assert sum(isinstance(answer, CrackEstimate) for answer in deeper) >= 4


def test_knowing_the_tip_relief_changes_depth_not_place(record: Record, healthy: Recording, answers: Answers) -> None:
    unknown, known = crack(answers[2.0]), crack(estimate_crack(record(2.0), reference=healthy, tip_relief_um=12.0))
    assert known.tooth == unknown.tooth
    assert known.features["relief_share"] > 0 == unknown.features["relief_share"]
    assert known.depth_mm != unknown.depth_mm
    with pytest.raises(InputError, match="tip_relief_um"):
        estimate_crack(record(2.0), reference=healthy, tip_relief_um=-1.0)


def test_gear_and_tooth_are_named(answers: Answers) -> None:
    answer = crack(answers[2.0])
    assert (answer.gear, answer.tooth, answer.gear_is_certain) == ("stage 1/input", 12, True)
    assert int(answer.angle_deg / 360 * 29) == 11
    assert "tooth 12 of stage 1/input" in answer.text
    assert answer.p_value < 0.05


def test_driven_gear_has_an_angle_but_no_tooth(record: Record, healthy: Recording) -> None:
    answer = crack(estimate_crack(record(2.5, gear="driven"), reference=healthy))
    assert (answer.shaft, answer.tooth) == ("output", None)
    assert any("no mark on this shaft" in reason for reason in answer.reasons)


def test_healthy_gears_are_bounded(answers: Answers) -> None:
    answer = answers[0.0]
    assert isinstance(answer, NoCrackSeen)
    assert 0 < answer.below_mm < 3
    assert "No crack seen: below" in answer.text


def test_float32_and_another_length_say_the_same(record: Record, healthy: Recording, answers: Answers) -> None:
    whole, expected = record(2.0), crack(answers[2.0])
    single = replace(whole, samples=whole.samples.astype(np.float32))
    shorter = replace(whole, samples=whole.samples[:, :-1])
    for other in (single, shorter):
        answer = crack(estimate_crack(other, reference=healthy))
        assert answer.depth_mm == pytest.approx(expected.depth_mm, rel=1e-3)
        assert answer.tooth == expected.tooth


def test_gain_does_not_matter(record: Record, healthy: Recording) -> None:
    def louder(recording: Recording) -> Recording:
        samples = np.array(recording.samples)
        samples[:2] *= 7.0
        return replace(recording, samples=samples)

    expected = crack(estimate_crack(record(2.0), reference=healthy))
    answer = crack(estimate_crack(louder(record(2.0)), reference=louder(healthy)))
    assert answer.depth_mm == pytest.approx(expected.depth_mm, rel=1e-6)


def test_a_sensor_that_reads_the_other_way_round_than_the_reference_s_changes_no_depth(
    record: Record, healthy: Recording
) -> None:
    samples = np.array(healthy.samples)
    samples[1] *= -1.0
    other_way = replace(healthy, samples=samples)
    expected, answer = (crack(estimate_crack(record(2.0), reference=r)) for r in (healthy, other_way))
    assert answer.depth_mm == pytest.approx(expected.depth_mm, rel=1e-9)
    assert f"{healthy.channel_names[1]} reads the other way round" in " ".join(answer.reasons)
    assert [reason for reason in answer.reasons if "the other way round" not in reason] == [*expected.reasons]


@pytest.mark.parametrize("gain", [0.5, 2.0, 1 / 9.81])
def test_a_reference_with_another_gain_is_refused_and_makes_no_crack(
    record: Record, healthy: Recording, gain: float
) -> None:
    samples = np.array(healthy.samples)
    samples[1] *= gain
    side = "above" if gain < 1 else "below"
    with pytest.raises(RefusalError, match=f"dB {side} that of the reference in channel '{healthy.channel_names[1]}'"):
        estimate_crack(record(0.0), reference=replace(healthy, samples=samples))


def test_a_deep_crack_in_the_reference_is_refused(record: Record, healthy: Recording) -> None:
    with pytest.raises(RefusalError, match="in the reference, not in the recording"):
        estimate_crack(healthy, reference=record(4.0))


def test_a_small_crack_in_the_reference_makes_none(record: Record, healthy: Recording) -> None:
    with pytest.raises(RefusalError, match="no crack stands out"):
        estimate_crack(healthy, reference=record(1.0))


def test_a_reference_of_another_machine_or_load_is_named_first(record: Record, healthy: Recording) -> None:
    assert healthy.rig is not None
    with pytest.raises(RefusalError, match=r"another machine: its teeth are 20/47.*29/47"):
        estimate_crack(record(2.0), reference=with_pair(healthy, driver_teeth=20))
    point = healthy.rig.operating_point
    other = replace(point, torque_nm=1.2 * (point.torque_nm or 0.0))
    with pytest.raises(RefusalError, match="N m, the recording at"):
        estimate_crack(record(2.0), reference=replace(healthy, rig=replace(healthy.rig, operating_point=other)))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"module_mm": None}, "module_mm"),
        ({"face_width_mm": None}, "face_width_mm"),
        ({"module_mm": 30.0, "face_width_mm": 2.0}, "not calibrated for"),
        ({"face_width_mm": 500.0}, "face width and module in MPa is"),
        ({"pressure_angle_deg": 25.0}, "pressure angle"),
    ],
)
def test_rigs_beyond_the_calibration_are_refused(record: Record, changes: dict[str, float], reason: str) -> None:
    with pytest.raises(RefusalError, match=reason):
        estimate_crack(with_pair(record(2.0), **changes))


def test_a_missing_torque_is_asked_for_and_may_be_given(record: Record, healthy: Recording) -> None:
    recording = record(2.0)
    assert recording.rig is not None
    bare = replace(recording, rig=replace(recording.rig, operating_point=OperatingPoint("input", SPEED_RPM)))
    with pytest.raises(RefusalError, match="torque_nm"):
        estimate_crack(bare)
    torque = recording.rig.operating_point.torque_nm
    assert estimate_crack(bare, reference=healthy, torque_nm=torque) == estimate_crack(recording, reference=healthy)


def test_short_slow_and_other_recordings_are_refused(record: Record) -> None:
    recording = record(2.0)
    short = replace(recording, samples=recording.samples[:, : recording.n_samples // 2])
    with pytest.raises(RefusalError, match="13 are needed"):
        estimate_crack(short)
    fast = record(0.0, speed_rpm=SPEED_RPM / 0.95)
    with pytest.raises(RefusalError, match=r"speed 5\.0 % off"):
        estimate_crack(recording, reference=fast)
    two_stages = Rig(
        shafts=(Shaft("input"), Shaft("output"), Shaft("last")),
        pairs=(GearPair("a", "input", "output", 29, 47), GearPair("b", "output", "last", 20, 60)),
    )
    with pytest.raises(RefusalError, match="2 gear pairs"):
        estimate_crack(replace(recording, rig=two_stages))


def test_the_recording_itself_is_no_reference(record: Record) -> None:
    with pytest.raises(RefusalError, match="same samples"):
        estimate_crack(record(2.0), reference=record(2.0))


def test_a_clipped_channel_is_told_of_either_record(record: Record, healthy: Recording) -> None:
    def cut(recording: Recording) -> Recording:
        limit = float(np.quantile(np.abs(recording.values("a1")), 0.98))
        return replace(recording, samples=np.clip(recording.samples, -limit, limit))

    cracked = record(3.0)
    for now, then in ((cut(cracked), healthy), (cracked, cut(healthy))):
        reasons = estimate_crack(now, reference=then).reasons
        assert sum("a1 is clipped" in reason for reason in reasons) == 1
    assert not any("clipped" in reason for reason in estimate_crack(cracked, reference=healthy).reasons)


def test_a_dead_channel_is_refused(record: Record) -> None:
    samples = np.array(record(2.0).samples)
    samples[1] = 0.0
    with pytest.raises(RefusalError, match="is dead"):
        estimate_crack(replace(record(2.0), samples=samples))


def test_a_bound_above_half_of_the_root_is_no_answer(record: Record) -> None:
    with pytest.raises(RefusalError, match=r"one of up to .* % of the root\) might hide.*give a reference"):
        estimate_crack(record(0.0))


@pytest.mark.parametrize("options", [{"torque_nm": 0.0}, {"torque_nm": -50.0}, {"tip_relief_um": 15e3}])
def test_impossible_torques_and_reliefs_are_named(record: Record, options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        estimate_crack(record(0.0), **options)  # type: ignore[arg-type]  # names of parameters


def test_without_a_rig_it_says_what_is_needed(record: Record) -> None:
    with pytest.raises(RefusalError, match="no rig file describes a gear pair: teeth, module"):
        estimate_crack(replace(record(0.0), rig=None))


def test_a_channel_that_is_not_there_is_named(record: Record) -> None:
    with pytest.raises(InputError, match="tacho"):
        estimate_crack(record(2.0), channels=("tacho",))


def test_what_was_looked_at_lies_below_the_threshold_where_nothing_is_seen(record: Record, healthy: Recording) -> None:
    answer = estimate_crack(record(0.0), reference=healthy)
    assert isinstance(answer, NoCrackSeen)
    assert len({search.shaft for search in answer.searched}) == 2
    for search in answer.searched:
        assert search.level_db.max() < search.threshold_db
        assert np.all(np.diff(search.angle_deg) >= 0)
        assert np.median(search.level_db) == pytest.approx(0.0, abs=0.1)


def test_what_was_looked_at_of_a_refusal_shows_the_event_above_its_threshold() -> None:
    """A spall: unlike a crack, so that no depth is told."""
    rig = read_rig("sample_data/damaged_tooth.toml")
    files = ("sample_data/damaged_tooth.csv.gz", "sample_data/healthy.h5")
    now, healthy = (read_recording(file, rig=rig) for file in files)
    with pytest.raises(RefusalError, match="unlike the calibration's cracks") as refused:
        estimate_crack(now, reference=healthy)
    clearest, mate = refused.value.looked_at
    assert clearest.level_db.max() > clearest.threshold_db
    assert mate.level_db.max() < mate.threshold_db
    at_deg = clearest.angle_deg[clearest.level_db.argmax()]
    assert int(at_deg / 360.0 * clearest.teeth) + 1 == 12  # as the sample has it
    figure = figure_of_refusal(refused.value)
    assert figure is not None
    assert len(figure.axes) == 2
