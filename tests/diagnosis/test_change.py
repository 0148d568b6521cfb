"""What changed since the reference comes first, against the scatter of either recording, and what it may mean."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, resample_poly, sosfilt

from gearsig.diagnosis import Analysis, Kind, LevelChange, Outcome, analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, PulseTimes, Rig, Shaft
from tests.diagnosis.machines import MOTOR_RATE_HZ, codes, finding, motor

ROTOR = Rig(shafts=(Shaft("rotor"),), bearings=(Bearing("front", "rotor", 9, 7.94, 39.04),))
HEALTHY = {1.0: 0.1, 2.0: 0.02, 3.0: 0.01}
SAMPLING_RATE_HZ, SECONDS = 2048.0, 6.0


def rotor(lines: Mapping[float, float], *, seed: int, speed_rpm: float = 1500.0, noise: float = 0.02) -> Recording:
    """Return an acceleration with lines (order → amplitude) in white noise."""
    rng = np.random.default_rng(seed)
    turns = np.arange(int(SECONDS * SAMPLING_RATE_HZ)) / SAMPLING_RATE_HZ * speed_rpm / 60.0
    x = noise * rng.standard_normal(len(turns))
    for order, amplitude in lines.items():
        x += amplitude * np.cos(2 * np.pi * (order * turns + rng.uniform()))
    rig = replace(ROTOR, speed=ConstantSpeed(speed_rpm, "rotor"))
    return Recording(x[None, :], SAMPLING_RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),), rig=rig)


def beside_healthy(lines: Mapping[float, float], **options: float) -> Analysis:
    return analyze(rotor(lines, seed=1, **options), reference=rotor(HEALTHY, seed=2))  # type: ignore[arg-type]


def level(analysis: Analysis, label: str) -> LevelChange:
    return next(c for c in analysis.level_changes if c.label == label)


@pytest.mark.parametrize(
    ("lines", "cause"),
    [
        (HEALTHY | {1.0: 0.5, 2.0: 0.2}, "bent-shaft"),
        (HEALTHY | {2.0: 0.3}, "misalignment"),
        (HEALTHY | {k / 2: 0.2 for k in range(1, 17)}, "looseness"),
    ],
)
def test_what_changed_is_the_first_finding_and_its_likeliest_cause_the_second(
    lines: Mapping[float, float], cause: str
) -> None:
    analysis = beside_healthy(lines)
    assert codes(analysis, Kind.FAULT, Kind.SUSPICION)[:2] == ["changed-since-reference", cause]
    assert analysis.verdict.startswith(analysis.findings[0].title)
    assert finding(analysis, cause).surer
    assert analysis.outcome is Outcome.SUSPICION


def test_an_axial_sensor_tells_a_bent_shaft_from_an_unbalance() -> None:
    """Of a radial one alone 1× may be either, and is said to be."""
    of_radial = beside_healthy(HEALTHY | {1.0: 0.5})
    assert finding(of_radial, "unbalance").title == "Perhaps unbalance or a bent shaft of rotor."
    axial = Channel("a2", "acceleration", "m/s^2", "front bearing, axial")
    for share, cause, title in ((1.0, "bent-shaft", "a bent shaft"), (0.2, "unbalance", "unbalance")):
        now, healthy = (
            replace(one, samples=np.vstack([one.samples, share * one.samples]), channels=(*one.channels, axial))
            for one in (rotor(HEALTHY | {1.0: 0.5}, seed=1), rotor(HEALTHY, seed=2))
        )
        analysis = analyze(now, reference=healthy)
        assert codes(analysis, Kind.SUSPICION) == ["changed-since-reference", cause]
        assert finding(analysis, cause).title == f"Perhaps {title} of rotor."


def test_multiples_that_rise_together_are_no_matter_of_another_speed() -> None:
    """By 1.3 % of speed one of them may meet a resonance. It takes eight to say that something is loose."""
    healthy = rotor(HEALTHY | dict.fromkeys(range(4, 11), 0.01), seed=2, speed_rpm=1520.0)
    for n_risen, is_said in ((1, False), (8, True)):
        lines = HEALTHY | dict.fromkeys(range(4, 11), 0.01) | dict.fromkeys(range(3, 3 + n_risen), 0.05)
        analysis = analyze(rotor(lines, seed=1), reference=healthy)
        assert ("looseness" in codes(analysis, Kind.SUSPICION)) is is_said


def test_a_weak_family_of_a_bearing_is_new_where_the_reference_has_none() -> None:
    """Lines that the segments of a comparison are too short to show."""
    rng = np.random.default_rng(5)
    order = ROTOR.bearings[0].orders()["BPFO"]
    turns = 25.0 * np.arange(20 * 8192) / 8192.0
    noise, healthy, other = rng.standard_normal((3, len(turns)))
    depth = 1.0 + sum(0.05 * np.cos(2 * np.pi * k * order * turns) for k in (1, 2, 3))
    rig = replace(ROTOR, speed=PulseTimes(np.arange(1, 500) / 25.0, 1, "rotor"))
    now, healthy, as_now = (
        Recording(x[None, :], 8192.0, (Channel("a1", "acceleration", "m/s^2"),), rig=rig)
        for x in (depth * noise, healthy, depth * other)
    )
    assert codes(analyze(now, reference=healthy), Kind.SUSPICION) == ["bearing-outer-race"]
    assert not codes(analyze(now, reference=as_now), Kind.FAULT, Kind.SUSPICION)


def test_what_rests_on_a_line_that_the_mains_make_as_well_is_half_as_sure() -> None:
    """2 × 1500 rpm are 50 Hz, 2 × 1560 rpm are not. That it has changed stays as sure."""
    confidences = {}
    for speed_rpm in (1500.0, 1560.0):
        healthy = rotor(HEALTHY, seed=2, speed_rpm=speed_rpm)
        analysis = analyze(rotor(HEALTHY | {2.0: 0.3}, seed=1, speed_rpm=speed_rpm), reference=healthy)
        assert ("line-of-mains-or-shaft" in codes(analysis)) == (speed_rpm == 1500.0)
        found = [finding(analysis, code) for code in ("changed-since-reference", "misalignment")]
        confidences[speed_rpm] = [f.confidence for f in found]
    assert confidences[1500.0] == pytest.approx(np.array([1.0, 0.5]) * confidences[1560.0], rel=0.05)


@pytest.mark.slow
def test_the_only_channels_of_both_are_compared_whatever_they_are_called() -> None:
    now, healthy = rotor(HEALTHY | {1.0: 0.5}, seed=1), rotor(HEALTHY, seed=2)
    as_named = analyze(now, reference=healthy)
    renamed = replace(healthy, channels=tuple(replace(c, name="ch1") for c in healthy.channels))
    analysis = analyze(now, reference=renamed)
    assert analysis.level_changes == as_named.level_changes
    assert codes(analysis) == [*codes(as_named), "reference-channel-renamed"]
    assert "ch1" in analysis.findings[-1].title


def test_levels_change_by_the_ratio_of_amplitudes() -> None:
    analysis = beside_healthy(HEALTHY | {1.0: 0.5})
    once = level(analysis, "1× rotor")
    assert once.change_db == pytest.approx(20 * np.log10(5), abs=0.2)
    assert once.level_db == pytest.approx(20 * np.log10(0.5 / np.sqrt(2)), abs=0.2)
    assert once.is_change
    assert [c.label for c in analysis.level_changes if c.is_change] == ["1× rotor"]


@pytest.mark.parametrize("seed", range(3, 8))
def test_another_recording_of_the_same_state_changes_nothing(seed: int) -> None:
    analysis = analyze(rotor(HEALTHY, seed=seed), reference=rotor(HEALTHY, seed=2))
    assert not any(c.is_change for c in analysis.level_changes)
    assert "unchanged-since-reference" in codes(analysis)
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)


def test_a_level_that_wanders_within_either_recording_has_not_changed() -> None:
    """1× is four times as large in the second third of one recording as in the rest: that is its scatter."""
    record = rotor(HEALTHY, seed=1)
    envelope = np.ones(record.n_samples)
    envelope[record.n_samples // 3 : 2 * record.n_samples // 3] = 4.0
    wandering = replace(record, samples=record.samples * envelope)
    analysis = analyze(wandering, reference=rotor(HEALTHY, seed=2))
    assert not level(analysis, "1× rotor").is_change
    assert level(analysis, "1× rotor").repeatability_db > 0.0


def test_another_gain_is_no_other_machine() -> None:
    record = rotor(HEALTHY, seed=1)
    analysis = analyze(replace(record, samples=5.0 * record.samples), reference=rotor(HEALTHY, seed=2))
    assert finding(analysis, "levels-scaled").kind is Kind.DATA_PROBLEM
    assert "changed-since-reference" not in codes(analysis)


@pytest.mark.parametrize("is_loose", [True, False])
def test_where_one_channel_alone_has_lost_its_noise_its_mounting_is_to_be_checked(*, is_loose: bool) -> None:
    """A loose sensor loses what is above its new resonance; where all lose it, the machine has become quieter."""
    channels = tuple(Channel(name, "acceleration", "m/s^2") for name in ("a1", "a2", "a3"))

    def recording(first_seed: int) -> Recording:
        seeds = range(first_seed, first_seed + 3)
        lines = HEALTHY | dict.fromkeys((4.0, 5.0, 6.0, 7.0, 8.0), 0.02)
        samples = np.vstack([rotor(lines, seed=seed).samples for seed in seeds])
        return replace(rotor(HEALTHY, seed=0), samples=samples, channels=channels)

    now, healthy = recording(10), recording(20)
    muffled = now.samples.copy()
    lost = slice(0, 1) if is_loose else slice(None)
    muffled[lost] = sosfilt(butter(2, 60.0, fs=SAMPLING_RATE_HZ, output="sos"), muffled[lost])
    analysis = analyze(replace(now, samples=muffled), reference=healthy)
    assert ("channel-faded" in codes(analysis, Kind.DATA_PROBLEM)) is is_loose
    assert ("changed-since-reference" in codes(analysis)) is not is_loose
    if is_loose:
        title = finding(analysis, "channel-faded").title
        assert title.endswith("in channel a1 alone, noise included: check its mounting, cable and range.")
        assert finding(analysis, "channel-faded").where.channels == ("a1",)


@pytest.mark.parametrize(
    ("speed_rpm", "once", "means"), [(1800.0, 0.5, False), (1560.0, 0.5, False), (1560.0, 2.0, True)]
)
def test_at_another_speed_a_change_means_what_a_resonance_that_one_of_both_meets_does_not_make(
    speed_rpm: float, once: float, *, means: bool
) -> None:
    """Of 1 % damping: 4 % of speed make 12.5 dB at most, and 0.7 dB by the square; a change is 6 dB more."""
    analysis = beside_healthy(HEALTHY | {1.0: once}, speed_rpm=speed_rpm)
    assert finding(analysis, "changed-since-reference").kind is (Kind.SUSPICION if means else Kind.NOTICE)
    assert ("unbalance" in codes(analysis)) == means
    assert ("change-at-another-speed" in codes(analysis)) == (not means)
    assert analysis.outcome is (Outcome.SUSPICION if means else Outcome.CANNOT_TELL)


def test_a_line_of_the_mains_beside_a_multiple_of_the_shaft_is_named_as_theirs_and_is_no_fault() -> None:
    """2 × 1480 rpm are 49.33 Hz, and a segment tells lines apart from 1.4 Hz on; all of it told a misalignment."""
    healthy = rotor(HEALTHY, seed=2, speed_rpm=1480.0)
    analysis = analyze(rotor(HEALTHY | {3000 / 1480: 0.3}, seed=1, speed_rpm=1480.0), reference=healthy)
    assert [c.label for c in analysis.level_changes if c.is_change] == ["50 Hz of the mains"]
    assert finding(analysis, "changed-since-reference").kind is Kind.NOTICE
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)
    humming = rotor(HEALTHY | {3000 / 1480: 0.03}, seed=2, speed_rpm=1480.0)  # then the shaft's line is hidden
    analysis = analyze(rotor(HEALTHY | {2.0: 0.3}, seed=1, speed_rpm=1480.0), reference=humming)
    assert "misalignment" in codes(analysis, Kind.SUSPICION)


def test_nobody_asks_for_a_crack_of_a_rotor_whose_channels_hum() -> None:
    analysis = beside_healthy(HEALTHY | {3000 / 1480: 5.0}, speed_rpm=1480.0)
    assert "channel-hum" in codes(analysis)
    assert "crack-depth-unknown" not in codes(analysis)


@pytest.mark.parametrize(("share", "faster", "once"), [(0.0055, 1.0, 0.5), (0.1, 1.0, 0.5), (0.012, 1.035, 2.0)])
def test_records_that_run_through_nearly_the_same_speeds_are_compared(share: float, faster: float, once: float) -> None:
    """Of alike ones what changed means as much as at a steady speed: forces that grow with its square are in both."""
    t = np.arange(int(SECONDS * SAMPLING_RATE_HZ)) / SAMPLING_RATE_HZ

    def wandering(once: float, seed: int, hertz: float = 25.0) -> Recording:
        turns = hertz * (t - share / np.pi * np.cos(np.pi * t))
        pulses = PulseTimes(np.interp(np.arange(np.ceil(turns[0]), turns[-1]), turns, t), shaft="rotor")
        x = 0.02 * np.random.default_rng(seed).standard_normal(len(t)) + once * np.cos(2 * np.pi * turns)
        return Recording(x[None, :], SAMPLING_RATE_HZ, (Channel("a1", "acceleration"),), pulses, rig=ROTOR)

    analysis = analyze(wandering(once, 1), reference=wandering(0.1, 2, 25.0 * faster))
    assert "unbalance" in codes(analysis, Kind.SUSPICION)
    if share < 0.01:  # through the mains' frequency it is the shaft's line still
        analysis = analyze(wandering(once, 1, 50.04), reference=wandering(0.1, 2, 50.04))
        assert "unbalance" in codes(analysis, Kind.SUSPICION)


def test_a_smaller_level_is_told_and_no_suspicion() -> None:
    analysis = beside_healthy(HEALTHY | {1.0: 0.01})
    assert analysis.findings[0].code == "changed-since-reference"
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)


def test_a_record_too_short_to_compare_says_so() -> None:
    short = rotor(HEALTHY, seed=1)
    short = replace(short, samples=short.samples[:, : int(0.5 * SAMPLING_RATE_HZ)])
    assert "change-not-examined" in codes(analyze(short, reference=rotor(HEALTHY, seed=2)))


def test_of_records_too_short_for_orders_the_overall_level_is_compared() -> None:
    short, healthy = (rotor(HEALTHY, seed=seed).between(0.0, 0.5) for seed in (1, 2))
    assert "changed-since-reference" not in codes(analyze(short, reference=healthy))
    louder = analyze(replace(short, samples=4.0 * short.samples), reference=healthy)
    assert louder.findings[0].code == "changed-since-reference"
    assert "overall level +1" in louder.findings[0].title
    assert "change-not-examined" in codes(louder)


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
def test_a_damaged_race_is_what_changed_also_from_a_reference_at_another_rate(times: int) -> None:
    """The healthy motor is recorded at the same rate or at twice: bands up to the lower one's are compared."""
    healthy = motor("", 2)
    if times == 2:
        samples = resample_poly(healthy.samples, 2, 1, axis=-1)
        healthy = replace(healthy, samples=samples, sampling_rate_hz=2 * MOTOR_RATE_HZ)
    analysis = analyze(motor("BPFO", 1), reference=healthy)
    assert [f.code for f in analysis.findings[:2]] == ["bearing-outer-race", "changed-since-reference"]
    assert analysis.findings[1].title.startswith("Changed since the reference: outer race of drive end +")
    assert finding(analysis, "bearing-outer-race").kind is Kind.FAULT


def test_a_damaged_race_that_the_reference_shows_as_strong_is_not_new() -> None:
    record = motor("BPFO", 1)
    analysis = analyze(record.between(3.0, 6.0), reference=record.between(0.0, 3.0))
    assert finding(analysis, "bearing-outer-race").kind is Kind.SUSPICION
    assert analysis.outcome is Outcome.SUSPICION
    assert "unchanged-since-reference" in codes(analysis)
