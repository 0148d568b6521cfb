"""Local events: on the right gear at any ratio, and not taken for a tooth where they are something else."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Kind, Outcome, analyze
from gearsig.recording import Recording
from gearsig.rig import SpeedChannel, TachometerChannel
from sims.measure import ColouredNoise
from tests.diagnosis.machines import GOOD, RIG, SAMPLING_RATE_HZ, codes, finding, record, teeth
from tests.kinematic.model import SensorChannel, ToothDamage, ToothVariation
from tests.kinematic.speed import ConstantProfile

DAMAGE = ToothDamage("stage", "in", 0.4, impulse_mps2=10.0, resonance_hz=3000.0, mesh_dip_fraction=0.2)
SHAFT_HZ = 22.0
STEADY = replace(GOOD, speed=ConstantProfile(60 * SHAFT_HZ))


def with_knocks(recording: Recording, times_s: np.ndarray, size: float | np.ndarray = 10.0) -> Recording:
    """Add ring-downs that no gear makes, all of one size or each of its own."""
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    samples = np.array(recording.samples)
    for start, own in zip(times_s, np.broadcast_to(size, len(times_s)), strict=True):
        after = slice(*np.searchsorted(t, [start, start + 0.05]))
        decay = np.exp(-400 * (t[after] - start))
        samples[0, after] += own * decay * np.sin(2 * np.pi * 3000 * (t[after] - start))
    return replace(recording, samples=samples)


@pytest.mark.parametrize(
    ("ratio", "damaged"),
    [((20, 60), "in"), ((20, 60), "out"), ((20, 30), "out"), ((24, 36), "in"), ((20, 40), "out"), ((27, 43), "in")],
)
def test_the_right_gear_is_named_at_whole_and_simple_ratios(ratio: tuple[int, int], damaged: str) -> None:
    rig = teeth(*ratio)
    analysis = analyze(record(replace(GOOD, tooth_damages=(replace(DAMAGE, shaft=damaged),)), rig=rig, seconds=8.0))
    claims = [f for f in analysis.findings if f.code == "tooth-local-damage"]
    assert [f.where.shaft for f in claims] == [damaged]
    assert (claims[0].where.tooth is None) == (damaged == "out")  # only the input shaft has a mark


def test_equal_gears_cannot_be_told_apart_and_are_both_named() -> None:
    analysis = analyze(record(replace(GOOD, tooth_damages=(DAMAGE,)), rig=teeth(20, 20)))
    claims = [f for f in analysis.findings if f.code == "tooth-local-damage"]
    assert len(claims) == 1
    assert "in or out" in claims[0].title


def test_beside_an_event_that_chance_hardly_explains_no_tooth_is_called_sound() -> None:
    """Each tooth impacts, the largest twice as hard as usual; where all others are still, it is a suspicion."""
    sizes = 0.5 * np.exp(0.4 * np.random.default_rng(3).standard_normal(27))
    sizes[3] = 0.95
    times = np.arange(0.01, 4.95, 1 / 27 / SHAFT_HZ)
    analysis = analyze(with_knocks(record(STEADY), times, np.resize(sizes, len(times))))
    assert "one stands out by" in finding(analysis, "tooth-damage-undecided").title
    assert analysis.outcome is Outcome.CANNOT_TELL
    alone = finding(analyze(with_knocks(record(STEADY), times[::27], size=0.95)), "tooth-local-damage")
    assert alone.kind is Kind.SUSPICION
    assert alone.confidence < 0.5


def test_a_single_shock_is_told_as_one() -> None:
    analysis = analyze(with_knocks(record(STEADY), np.array([2.345]), size=3000.0))
    found = finding(analysis, "single-shock")
    assert found.where.time_s is not None
    assert found.where.time_s[0] == pytest.approx(2.345, abs=1 / SHAFT_HZ)
    assert not codes(analysis, Kind.FAULT)
    assert analysis.outcome is Outcome.CANNOT_TELL


def test_an_event_of_every_second_revolution_is_no_tooth() -> None:
    analysis = analyze(with_knocks(record(STEADY), np.arange(0.01, 5.0, 2 / SHAFT_HZ)))
    assert "event-in-some-revolutions" in codes(analysis, Kind.CANNOT_TELL)
    # A tooth's mates take its load over unequally: it impacts less in the revolutions between, and is damaged as well.
    impacts = np.arange(0.01, 5.0, 1 / SHAFT_HZ)
    unequal = with_knocks(with_knocks(record(STEADY), impacts[::2], size=60.0), impacts[1::2], size=25.0)
    assert "tooth-local-damage" in codes(analyze(unequal))
    assert "tooth-local-damage" not in codes(analysis)
    assert "no-tooth-local-damage" not in codes(analysis)


def test_pulses_per_revolution_stated_too_low_are_noticed() -> None:
    two = replace(GOOD.tachometer, pulses_per_revolution=2)  # type: ignore[type-var]
    recording = record(replace(GOOD, tachometer=two, tooth_damages=(DAMAGE,)))
    analysis = analyze(replace(recording, speed=TachometerChannel("tacho", shaft="in")))
    assert "tooth-local-damage" not in codes(analysis)
    assert "no-tooth-local-damage" not in codes(analysis)
    assert analysis.outcome is not Outcome.NO_FAULT


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3])
def test_several_equal_events_are_no_tooth(n: int) -> None:
    analysis = analyze(with_knocks(record(STEADY), np.arange(0.01, 5.0, 1 / (n * SHAFT_HZ))))
    assert "several-events-per-revolution" in codes(analysis, Kind.NOTICE)
    assert "tooth-local-damage" not in codes(analysis)


def test_a_tooth_that_is_a_little_weaker_is_no_damage() -> None:
    even = (ToothVariation("stage", "in", 0.002), ToothVariation("stage", "out", 0.002))
    slight = ToothDamage("stage", "in", 0.4, mesh_dip_fraction=0.03)
    analysis = analyze(record(replace(GOOD, tooth_variations=even, tooth_damages=(slight,)), seconds=8.0))
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)


def test_a_perfect_machine_is_not_accused_of_the_ends_of_its_record() -> None:
    perfect = replace(STEADY, modulations=(), tooth_variations=(), channels=(SensorChannel("a1"),))
    assert not codes(analyze(record(perfect)), Kind.FAULT, Kind.SUSPICION)


@pytest.mark.slow
def test_noise_that_would_hide_damage_leaves_the_teeth_undecided() -> None:
    loud = replace(GOOD, channels=(SensorChannel("a1", noise=ColouredNoise(25.0)),), tooth_damages=(DAMAGE,))
    analysis = analyze(record(loud))
    assert "no-tooth-local-damage" not in codes(analysis)
    assert analysis.outcome is Outcome.CANNOT_TELL


def test_a_sensor_that_is_off_is_not_a_good_machine() -> None:
    recording = record()
    samples = np.array(recording.samples)
    samples[0] = np.random.default_rng(1).normal(size=recording.n_samples)
    analysis = analyze(replace(recording, samples=samples))
    assert analysis.outcome is Outcome.CANNOT_TELL
    assert "no-tooth-local-damage" not in codes(analysis)


def test_a_speed_channel_that_is_a_little_off_leaves_the_teeth_undecided() -> None:
    recording = record(replace(STEADY, tooth_damages=(DAMAGE,)))
    rpm = np.full(recording.n_samples, 60 * SHAFT_HZ * 1.002)
    samples = np.vstack([recording.samples[0], rpm])
    channel = replace(recording.channels[1], quantity="rotational_speed", unit="rpm")
    wrong = replace(recording, samples=samples, channels=(recording.channels[0], channel), speed=SpeedChannel("tacho"))
    analysis = analyze(wrong)
    assert "no-tooth-local-damage" not in codes(analysis)
    assert analysis.outcome is not Outcome.NO_FAULT


def test_revolutions_count_within_the_record_only() -> None:
    from gearsig.rig import PulseTimes

    recording = record(STEADY, seconds=0.4)
    pulses = PulseTimes(np.arange(0.01, 20.0, 1 / SHAFT_HZ), shaft="in")
    analysis = analyze(replace(recording, speed=pulses))
    assert "8.58 of its revolutions" in finding(analysis, "tooth-not-examined").title


def test_a_wrong_tooth_count_is_contradicted_by_the_mesh() -> None:
    recording = record(replace(GOOD, tooth_damages=(DAMAGE,)), seconds=8.0)
    wrong = replace(RIG, pairs=(replace(RIG.pairs[0], driver_teeth=26),), bearings=())
    analysis = analyze(replace(recording, rig=wrong))
    assert "tooth-local-damage" not in codes(analysis)
    assert "teeth-disagree" in codes(analysis)


@pytest.mark.slow
def test_an_event_that_does_not_come_back_from_turn_to_turn_is_withheld_and_that_is_said() -> None:
    """Bursts at one angle whose sign is drawn anew in each revolution: something is there, but it is no tooth's."""
    recording = record(replace(GOOD, speed=ConstantProfile(1320.0)))
    rng, samples = np.random.default_rng(3), np.array(recording.samples)
    k = np.arange(60)
    burst = np.exp(-k / 12) * np.sin(1.8 * k)
    for start in (np.arange(0.3, 109.0) / 22.0 * SAMPLING_RATE_HZ).astype(int):
        samples[0, start : start + 60] += 25.0 * rng.choice([-1.0, 1.0]) * burst
    analysis = analyze(replace(recording, samples=samples))
    assert "tooth-local-damage" not in codes(analysis, Kind.FAULT)
    said = finding(analysis, "tooth-damage-undecided")
    assert "turn to turn" in said.title
    assert not said.title.startswith("Nothing shows")


def knocking_teeth(sizes: np.ndarray, *, seed: int = 0, sign: float = 1.0) -> Recording:
    """Return the gearbox with an impact of its own size at each tooth of the input gear."""
    times = np.arange(0.01, 4.95, 1 / 27 / SHAFT_HZ)
    recording = with_knocks(record(STEADY, seed=seed), times, np.resize(sizes, len(times)))
    return replace(recording, samples=recording.samples * np.array([[sign], [1.0]]))


UNEQUAL = 2.0 * np.exp(0.6 * np.random.default_rng(8).standard_normal(27))
DAMAGED = UNEQUAL + 2.0 * (np.arange(27) == 11)
PLACE_DEG = 360.0 * ((0.01 * SHAFT_HZ + 11 / 27) % 1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_beside_a_reference_a_tooth_is_told_that_is_one_of_many_unequal_ones(sign: float) -> None:
    recording, reference = knocking_teeth(DAMAGED), knocking_teeth(UNEQUAL, seed=1, sign=sign)
    assert "tooth-local-damage" not in codes(analyze(recording))
    beside = analyze(recording, reference=reference)
    told = finding(beside, "tooth-local-damage")
    assert (told.kind, told.where.shaft) == (Kind.FAULT, "in")
    assert told.where.angle_deg == pytest.approx(PLACE_DEG, abs=360 / 27)
    change = beside.channels[0].averages["in", "change"]
    largest_deg = 360.0 * change.revolutions[np.argmax(np.abs(change.values))]
    assert largest_deg == pytest.approx(PLACE_DEG, abs=360 / 27)


def test_unequal_teeth_that_are_as_they_were_are_no_damage() -> None:
    analysis = analyze(knocking_teeth(UNEQUAL), reference=knocking_teeth(UNEQUAL, seed=1))
    assert "tooth-local-damage" not in codes(analysis)
    assert "in" in finding(analysis, "no-tooth-local-damage").title


@pytest.mark.parametrize("size", [0.85, 1.15])
def test_a_tooth_that_was_odd_and_knocks_a_little_harder_or_less_is_no_damage(size: float) -> None:
    odd = 1.0 + 5.0 * (np.arange(27) == 11)
    now = np.where(np.arange(27) == 11, size * odd, odd)
    analysis = analyze(knocking_teeth(now), reference=knocking_teeth(odd, seed=1))
    assert not [f for f in analysis.findings if f.is_claim and "not new" not in f.title]


def test_a_reference_at_another_speed_leaves_the_teeth_to_the_recording_alone() -> None:
    slower = record(replace(GOOD, speed=ConstantProfile(0.95 * 60 * SHAFT_HZ)))
    analysis = analyze(record(replace(STEADY, tooth_damages=(DAMAGE,))), reference=slower)
    told = finding(analysis, "tooth-local-damage")
    assert "The averages were turned" not in " ".join(told.evidence)


def thinned(recording: Recording) -> Recording:
    """Return every fourth sample, below half of whose rate the gears' vibration lies in part."""
    return replace(recording, samples=recording.samples[:, ::4], sampling_rate_hz=recording.sampling_rate_hz / 4)


def in_g(recording: Recording) -> Recording:
    """Return the recording with its vibration in another unit."""
    channels = (replace(recording.channels[0], unit="g"), *recording.channels[1:])
    return replace(recording, samples=recording.samples / np.array([[9.81], [1.0]]), channels=channels)


@pytest.mark.parametrize("otherwise", [thinned, in_g])
def test_a_reference_recorded_otherwise_makes_no_tooth_of_the_difference(otherwise) -> None:
    analysis = analyze(knocking_teeth(UNEQUAL), reference=otherwise(knocking_teeth(UNEQUAL, seed=1)))
    assert "tooth-local-damage" not in codes(analysis)
