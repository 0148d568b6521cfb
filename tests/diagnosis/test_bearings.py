"""Bearings are named where nothing else explains their lines, and called good only where damage would have shown."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import (
    BandEnvelope,
    Kind,
    analyze,
    smallest_depth,
    stands_out_from_neighbours,
    underlying_impulse_train,
)
from gearsig.errors import RefusalError
from gearsig.prepared import LinesOverFloor, best_comb, lines_over_noise_floor, refined_angle
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft, SpeedChannel
from gearsig.spectra import amplitude_spectrum
from sims.measure import ColouredNoise
from tests.diagnosis.machines import GOOD, MOTOR_HZ, RIG, SAMPLING_RATE_HZ, codes, finding, motor, record
from tests.kinematic.model import BearingFault, KinematicModel, SensorChannel
from tests.kinematic.speed import ConstantProfile

SECONDS = 8.0
ONE_SHAFT = Rig(shafts=(Shaft("in"),), bearings=RIG.bearings)
NAMED = {"bearing-outer-race", "bearing-inner-race", "bearing-rolling-element", "bearing-cage"}


def with_impacts(recording: Recording, rate_hz: float, peak: float = 12.0) -> Recording:
    """Add a machine nearby, whose impacts ring at 2.5 kHz."""
    t = np.arange(recording.n_samples) / SAMPLING_RATE_HZ
    impacts = np.zeros_like(t)
    impacts[np.round(np.arange(0.01, t[-1], 1 / rate_hz) * SAMPLING_RATE_HZ).astype(int)] = peak
    ringing = np.exp(-2 * np.pi * 0.05 * 2500 * t[:500]) * np.sin(2 * np.pi * 2500 * t[:500])
    samples = np.array(recording.samples)
    samples[0] += np.convolve(impacts, ringing)[: len(t)]
    return replace(recording, samples=samples)


def steady(**changes: object) -> Recording:
    return record(replace(GOOD, speed=ConstantProfile(1320.0), **changes), seconds=SECONDS)  # type: ignore[arg-type]


def _title_without_rig(recording: Recording) -> str:
    bare = replace(recording.select(["a1"]), rig=None, speed=ConstantSpeed(1320.0))
    return finding(analyze(bare), "non-synchronous-impacts").title


@pytest.mark.parametrize("order", [0.151, 0.41, 0.7])
def test_slow_impacts_are_no_bearings(order: float) -> None:
    analysis = analyze(with_impacts(steady(), 22.0 * order))
    assert not NAMED & set(codes(analysis))
    found = finding(analysis, "non-synchronous-impacts")
    assert found.where.order == pytest.approx(order, rel=2e-3)  # their rate, not a multiple of it
    assert found.title.endswith("which no shaft, gear or bearing of the rig explains.")
    assert "which the shaft does not explain" in _title_without_rig(with_impacts(steady(), 22.0 * order))


@pytest.mark.parametrize(("gain", "noise"), [(0.02, 0.15), (0.1, 0.2)])
def test_impacts_are_placed_where_they_stand_out_most(gain: float, noise: float) -> None:
    # Modulated at several slow rates, they fill the spectrum of the near sensor with lines that noise hides far away.
    rng, n = np.random.default_rng(0), round(SECONDS * SAMPLING_RATE_HZ)
    t = np.arange(n) / SAMPLING_RATE_HZ
    turning = Recording(np.cos(2 * np.pi * 22.0 * t)[None], SAMPLING_RATE_HZ, (Channel("near"),), rig=ONE_SHAFT)
    struck = with_impacts(turning, 107.6).samples[0] - turning.samples[0]
    struck *= 1 + 0.25 * np.sum(np.cos(2 * np.pi * np.array([5.1, 7.7, 9.3, 11.9])[:, None] * t), axis=0)
    near, far = (a * struck + turning.samples[0] + b * rng.normal(size=n) for a, b in ((1.0, gain), (0.1, noise)))
    both = (Channel("near"), Channel("far"))
    speed = ConstantSpeed(1320.0, "in")
    recording = Recording(np.stack([near, far]), SAMPLING_RATE_HZ, both, speed, rig=replace(ONE_SHAFT, bearings=()))
    found = finding(analyze(recording), "non-synchronous-impacts")
    assert found.where.channels == ("near",)
    assert found.where.order == pytest.approx(107.6 / 22, rel=1e-3)


def _on_a_slow_shaft(rate_order: float) -> Recording:
    """Return impacts beside noise that the fast shaft modulates; like bearings stand on both shafts, three to one."""
    shafts, pair = (Shaft("in"), Shaft("out")), GearPair("stage", "in", "out", 16, 48)
    bearings = tuple(Bearing(name, shaft, bpfo_order=3.05) for name, shaft in (("front", "in"), ("rear", "out")))
    rng, n = np.random.default_rng(0), round(4.0 * SAMPLING_RATE_HZ)
    turn = 2 * np.pi * 22.0 * np.arange(n) / SAMPLING_RATE_HZ
    x = (1 + 0.4 * np.cos(turn) + 0.2 * np.cos(2 * turn) + 0.1 * np.cos(3 * turn)) * rng.normal(size=n)
    x += 5.0 * np.cos(16 * turn) + np.cos(turn)
    machine = Rig(shafts=shafts, pairs=(pair,), bearings=bearings)
    quiet = Recording(x[None], SAMPLING_RATE_HZ, (Channel("a1"),), ConstantSpeed(1320.0, "in"), rig=machine)
    return with_impacts(quiet, 22.0 * rate_order, 12.0) if rate_order else quiet


def test_a_part_of_a_slow_shaft_is_named_where_its_lines_are_those_of_the_fast_ones() -> None:
    """In 4 s its first multiples run into those of its shaft, and every third is the like bearing's."""
    analysis = analyze(_on_a_slow_shaft(3.02 / 3))
    assert "non-synchronous-impacts" not in codes(analysis)
    assert finding(analysis, "bearing-outer-race").where.shaft == "out"


def test_a_turn_of_the_fast_shaft_is_no_race_of_the_slow_ones() -> None:
    assert not any("times a turn" in f.title for f in analyze(_on_a_slow_shaft(0.0)).findings)


def test_a_damaged_race_beside_slow_impacts_is_named() -> None:
    faulty = steady(bearing_faults=(BearingFault("front", "outer", 8.0, resonance_hz=3200.0),))
    analysis = analyze(with_impacts(faulty, 22.0 * 0.41, 6.0))
    assert "bearing-outer-race" in codes(analysis, Kind.FAULT)
    assert not {"bearing-inner-race", "bearing-rolling-element"} & set(codes(analysis))


def test_more_than_two_parts_at_once_are_a_suspicion() -> None:
    rig = replace(RIG, bearings=(*RIG.bearings, Bearing("rear", "out", 11, 7.94, 47.3)))
    faults = (("front", "outer", 2900.0), ("front", "inner", 3500.0), ("rear", "outer", 4200.0))
    model = replace(GOOD, bearing_faults=tuple(BearingFault(b, race, 12.0, resonance_hz=f) for b, race, f in faults))
    analysis = analyze(record(model, seconds=SECONDS, rig=rig))
    named = [f for f in analysis.findings if f.code in NAMED]
    assert {(f.where.bearing, f.code) for f in named} >= {(b, f"bearing-{race}-race") for b, race, _ in faults}
    assert {f.kind for f in named} == {Kind.SUSPICION}
    assert all(any("parts show at once" in text for text in f.evidence) for f in named)


def test_one_hidden_part_has_one_order() -> None:
    rig = replace(RIG, bearings=(Bearing("b", RIG.shafts[0].name, bpfo_order=3.37, ftf_order=0.4),))
    analysis = analyze(replace(steady(), rig=rig).between(0.0, 1.7))
    hidden = finding(analysis, "bearing-part-hidden")
    title = "No damage shows in the bearings (b), of which not every cage could be examined."
    assert finding(analysis, "no-bearing-damage").title == title
    assert hidden.title.startswith("Not examined: cage of b. Its order falls on")


def test_impacts_at_the_cages_order_are_at_most_a_suspicion() -> None:
    cage = RIG.bearings[0].orders()["FTF"]
    found = finding(analyze(with_impacts(steady(), 22.0 * cage)), "bearing-cage")
    assert found.kind in (Kind.NOTICE, Kind.SUSPICION)
    assert found.confidence <= 0.5
    assert any("Belts" in text for text in found.evidence)


def test_a_good_bearing_comes_with_what_would_have_shown() -> None:
    found = finding(analyze(record(seconds=SECONDS)), "no-bearing-damage")
    assert any("would have shown" in text for text in found.evidence)


def test_noise_instead_of_vibration_shows_no_good_bearing() -> None:
    recording = record(seconds=SECONDS)
    samples = np.array(recording.samples)
    samples[0] = np.random.default_rng(5).normal(size=samples.shape[1])
    analysis = analyze(replace(recording, samples=samples))
    assert "no-bearing-damage" not in codes(analysis)
    assert "where the speed puts it" in finding(analysis, "bearings-undecided").title


def test_a_short_record_shows_no_good_bearing() -> None:
    analysis = analyze(record(seconds=0.9))
    assert "no-bearing-damage" not in codes(analysis)
    assert "would not have stood out" in finding(analysis, "bearings-undecided").title


@pytest.mark.slow
def test_a_race_whose_order_is_a_multiple_of_the_shaft_within_slip_is_not_called_good() -> None:
    rig = replace(ONE_SHAFT, bearings=(Bearing("front", "in", 9, 7.94, 67.7),), speed=ConstantSpeed(1320.0, "in"))
    assert rig.bearings[0].orders()["BPFI"] == pytest.approx(5.03, abs=0.01)
    quiet = replace(steady().select(["a1"]), speed=None, rig=rig)
    noise = 0.5 * np.random.default_rng(3).normal(size=quiet.samples.shape)
    t = np.arange(quiet.n_samples) / SAMPLING_RATE_HZ
    turning = replace(quiet, samples=noise + np.cos(2 * np.pi * 22.0 * t))
    assert "no-bearing-damage" in codes(analyze(turning))
    struck = analyze(with_impacts(turning, 5 * 22.0))
    assert "5 times per turn" in finding(struck, "bearings-undecided").title


def test_a_bearing_that_cannot_be_examined_is_not_called_good() -> None:
    recording = record(seconds=SECONDS)
    bearings = (*RIG.bearings, Bearing("nameless", "out"))
    analysis = analyze(replace(recording, rig=replace(RIG, bearings=bearings)))
    assert "nameless" not in finding(analysis, "no-bearing-damage").title
    assert "nameless" in finding(analysis, "bearings-undecided").title


def humming(recording: Recording, rng: np.random.Generator) -> Recording:
    """Add noise that is modulated by a supply of 50 Hz."""
    t = np.arange(recording.n_samples) / SAMPLING_RATE_HZ
    depth = 1 + sum(a * np.cos(2 * np.pi * 50 * k * t) for k, a in enumerate((0.5, 0.4, 0.3, 0.2), 1))
    return replace(recording, samples=recording.samples + 0.8 * depth * rng.normal(size=len(t)))


def stated(rpm: float, true_rpm: float, rng: np.random.Generator) -> Recording:
    """Return a bearing with a damaged outer race, without gears, its speed not measured."""
    model = KinematicModel(
        speed=ConstantProfile(true_rpm),
        bearing_faults=(BearingFault("front", "outer", 4.0, resonance_hz=3200.0),),
        channels=(SensorChannel("a1", noise=ColouredNoise(0.8)),),
    )
    recording = record(model, seconds=SECONDS, rig=ONE_SHAFT)
    return humming(replace(recording, speed=ConstantSpeed(rpm, "in")), rng)


def test_a_stated_speed_is_not_taken_from_the_mains() -> None:
    recording = stated(2950.0, 2916.0, np.random.default_rng(0))
    angle = refined_angle(recording, ONE_SHAFT)
    assert angle.mean_speed_rpm == pytest.approx(2950.0)
    assert angle.quality <= 0.5
    found = finding(analyze(recording), "bearing-outer-race")
    assert found.confidence < 0.9
    assert any("no line of a shaft or mesh confirms" in text for text in found.evidence)


def test_a_stated_speed_is_not_replaced_by_a_third_of_a_bearings_tone() -> None:
    rng, t = np.random.default_rng(4), np.arange(51_200) / 5120.0
    tone = (1 + 0.5 * np.cos(2 * np.pi * 184.2 * t)) * np.cos(2 * np.pi * 1400 * t)
    shaft = sum(a * np.cos(2 * np.pi * 59.7 * k * t) for k, a in enumerate((1.0, 0.1), 1))
    samples = (0.3 * tone + shaft + 0.3 * rng.normal(size=len(t)))[None, :]
    recording = Recording(samples, 5120.0, (Channel("a1", "acceleration"),), speed=ConstantSpeed(3600.0, "in"))
    assert refined_angle(recording, ONE_SHAFT).mean_speed_rpm == pytest.approx(3600.0, rel=0.006)


def test_twice_the_mains_beside_a_harmonic_does_not_pull_a_stated_speed() -> None:
    """A motor of 1485 rpm, four turns of which take nearly as long as the pull of its supply, for a second only."""
    t = np.arange(48_000) / 48_000.0
    samples = 0.25 * np.random.default_rng(8).normal(size=len(t)) + 0.1 * np.cos(2 * np.pi * 100.0 * t)
    for harmonic, size in ((1, 0.3), (2, 0.15), (5, 0.2)):
        samples += size * np.cos(2 * np.pi * harmonic * 24.75 * t + harmonic)
    recording = Recording(samples[None], 48_000.0, (Channel("a1", "acceleration"),), speed=ConstantSpeed(1485.0, "in"))
    assert refined_angle(recording, ONE_SHAFT).mean_speed_rpm == pytest.approx(1485.0, rel=1e-3)


def test_a_family_beyond_slip_of_a_stated_speed_may_be_the_part() -> None:
    found = finding(analyze(stated(2950.0, 2850.0, np.random.default_rng(1))), "bearing-outer-race")
    assert found.kind is Kind.SUSPICION
    assert found.confidence <= 0.5
    assert found.title.startswith("May be the outer race")
    assert "not confirmed" in found.title


@pytest.mark.slow
@pytest.mark.parametrize(("multiples", "is_sure"), [((2, 3), True), ((6,), True), ((2, 4, 6), False)])
def test_a_part_is_unsure_where_a_shaft_of_twice_the_speed_has_the_same_lines(
    multiples: tuple[int, ...], is_sure: bool
) -> None:
    analysis = analyze(motor("BPFO", 3, multiples))
    (found,) = [f for f in analysis.findings if f.code.startswith("bearing")]
    assert (found.kind, found.confidence > 0.5) == ((Kind.FAULT, True) if is_sure else (Kind.SUSPICION, False))
    if not is_sure:
        sound = analyze(motor("", 3, multiples))
        assert codes(sound, Kind.CANNOT_TELL)[0] == "bearings-undecided"
        assert "2 times" in sound.verdict


@pytest.mark.parametrize("scale", [1.0005, 1.02])
def test_a_speed_channel_of_wrong_scale_is_set_right_by_the_mesh(scale: float) -> None:
    recording = steady()
    rpm = np.full((1, recording.n_samples), 1320.0 * scale)
    measured = replace(
        recording,
        samples=np.vstack([recording.samples[:1], rpm]),
        channels=(recording.channels[0], Channel("rpm", "rotational_speed", "rpm")),
        speed=SpeedChannel("rpm", shaft="in"),
    )
    angle = refined_angle(measured, RIG)
    assert angle.mean_speed_rpm == pytest.approx(1320.0, rel=5e-5)
    (note,) = (note for note in angle.notes if "speed channel says" in note)
    assert ("(−" if scale > 1 else "(+") in note


def test_a_speed_beyond_the_sampling_rate_is_refused() -> None:
    recording = Recording(
        np.random.default_rng(3).normal(size=(1, 5000)),
        1000.0,
        (Channel("a1", "acceleration"),),
        speed=ConstantSpeed(1e7),
    )
    with pytest.raises(RefusalError, match="above half the sampling rate"):
        refined_angle(recording, RIG)
    assert "no-bearing-damage" not in codes(analyze(recording, RIG))


RATE_HZ = 1000.0


def lines(frequencies_hz: list[float], rng: np.random.Generator, amplitude: float = 0.3) -> LinesOverFloor:
    t = np.arange(20_000) / RATE_HZ
    tones = sum(amplitude * np.cos(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in frequencies_hz)
    return lines_over_noise_floor(amplitude_spectrum(rng.normal(size=len(t)) + tones, RATE_HZ))


@pytest.mark.parametrize(("multiple", "divisor"), [(4, 1), (13, 1), (5, 2)])
def test_a_family_on_lines_of_a_slower_train_is_the_trains(multiple: int, divisor: int) -> None:
    rng = np.random.default_rng(multiple)
    true_hz = 50.0 * divisor / multiple
    excess = lines([true_hz * k for k in range(1, int(310 / true_hz))], rng)
    comb = best_comb(excess, 49.5, 50.5)
    assert comb is not None
    train = underlying_impulse_train(excess, comb)
    assert train is not None
    assert train.fundamental == pytest.approx(true_hz, rel=1e-3)


def test_a_family_with_sidebands_stands_alone() -> None:
    rng = np.random.default_rng(6)
    places = [50.0 * k + side * 9.27 for k in range(1, 7) for side in (-2, -1, 0, 1, 2)]
    excess = lines(places, rng)
    comb = best_comb(excess, 49.0, 51.0)
    assert comb is not None
    assert underlying_impulse_train(excess, comb) is None
    assert stands_out_from_neighbours(excess, comb, 0.02, ())


def test_sidebands_of_a_shaft_near_a_fifth_of_the_family_are_no_train() -> None:
    rng = np.random.default_rng(9)
    shaft_hz = 10.0  # the family is 4.98 times that: its sidebands lie near multiples of a fifth of it
    places = [4.98 * shaft_hz * k + side * shaft_hz for k in range(1, 7) for side in (-2, -1, 0, 1, 2)]
    excess = lines(places, rng).without_multiples(shaft_hz)
    comb = best_comb(excess, 49.0, 50.6)
    assert comb is not None
    assert underlying_impulse_train(excess, comb, (shaft_hz,)) is None


def test_a_train_three_times_as_slow_as_a_shaft_is_one() -> None:
    rng = np.random.default_rng(10)
    shaft_hz, true_hz = 10.0, 3.31  # three of the train's lines make nearly a shaft's order
    excess = lines([true_hz * k for k in range(1, 30)], rng).without_multiples(shaft_hz)
    comb = best_comb(excess, 13.0, 13.5)
    assert comb is not None
    train = underlying_impulse_train(excess, comb, (shaft_hz,))
    assert train is not None
    assert train.fundamental == pytest.approx(true_hz, rel=1e-3)


@pytest.mark.parametrize(("fall", "level"), [(0.0, 0.06), (0.7, 0.1)])
def test_a_train_weaker_than_the_family_on_its_lines_explains_nothing(fall: float, level: float) -> None:
    """As of a race whose fifth multiple nearly is the eighteenth of the shaft: all sums and differences are a fifth.

    The family's own higher lines may be as weak, where elements come unevenly: then the first ones tell.
    """
    rng = np.random.default_rng(11)
    t = np.arange(20_000) / RATE_HZ
    tones = sum(np.exp(fall * (1 - k)) * np.cos(2 * np.pi * 36.0 * k * t + rng.uniform(0, 6.28)) for k in range(1, 7))
    tones = tones + sum(level * np.cos(2 * np.pi * 2.0 * k * t + rng.uniform(0, 6.28)) for k in range(1, 108))
    excess = lines_over_noise_floor(amplitude_spectrum(rng.normal(size=len(t)) + tones, RATE_HZ))
    comb = best_comb(excess, 35.5, 36.5)
    assert comb is not None
    assert underlying_impulse_train(excess, comb) is None


def at_sensors(
    order: float,
    heights: tuple[float, ...],
    *,
    seed: int = 0,
    odd: float = 1.0,
    uneven: float = 0.003,
    seconds: float = SECONDS,
    turning: bool = False,
    unbalance: float = 0.0,
) -> Recording:
    """Return a motor's drive and fan end, with impacts at an order of its shaft, every second `odd` times as high.

    Distances of the impacts scatter by `uneven` of their mean; a part that is `turning` passes the load with the shaft,
    and a share `unbalance` of the load turns.
    """
    rng, fs_hz, shaft_hz = np.random.default_rng(seed), 12_000.0, 29.0
    n = int(seconds * fs_hz)
    turns = shaft_hz * np.arange(n) / fs_hz
    hits = np.searchsorted(turns, np.cumsum((1 + uneven * rng.standard_normal(int(turns[-1] * order) - 20)) / order))
    impacts, k = np.zeros(n), np.arange(200)
    impacts[hits] = np.where(np.arange(len(hits)) % 2, odd, 1.0)
    if turning:
        impacts *= np.clip(np.cos(2 * np.pi * turns), 0.0, None) ** 1.5
    impacts *= np.clip(1 + unbalance * np.cos(2 * np.pi * turns), 0.0, None)
    ring = np.convolve(impacts, np.exp(-k / 25) * np.sin(1.6 * k))[:n]
    shaft = sum(0.5 / h * np.cos(2 * np.pi * h * turns + rng.uniform(0, 6.28)) for h in range(1, 9))
    samples = np.stack([height * ring + shaft + rng.standard_normal(n) for height in heights])
    names = ("X1_DE_time", "X1_FE_time")[: len(heights)]
    rig = Rig(
        shafts=(Shaft("motor"),),
        bearings=(Bearing("drive end", "motor", 9, 7.94, 39.04), Bearing("fan end", "motor", 8, 6.746, 28.5)),
        speed=ConstantSpeed(60 * shaft_hz, "motor"),
    )
    return Recording(samples, fs_hz, tuple(Channel(name, "acceleration", "g") for name in names), rig=rig)


@pytest.mark.parametrize(
    ("bearing", "part", "code"),
    [
        (0, "BPFO", "bearing-outer-race"),
        (0, "BPFI", "bearing-inner-race"),
        (1, "BPFI", "bearing-inner-race"),
        (1, "BPFO", "bearing-outer-race"),
    ],
)
def test_the_part_of_the_right_one_of_two_bearings_is_named(bearing: int, part: str, code: str) -> None:
    heights = (6.0, 2.0) if bearing == 0 else (2.0, 6.0)
    recording = at_sensors(1.003, heights)
    assert recording.rig is not None
    damaged = recording.rig.bearings[bearing]
    analysis = analyze(at_sensors(1.003 * damaged.orders()[part], heights, seed=bearing))
    likely = [(f.code, f.where.bearing) for f in analysis.findings if f.code in NAMED and f.confidence > 0.5]
    assert likely == [(code, damaged.name)]


def test_an_element_that_strikes_the_races_unequally_is_no_slower_train() -> None:
    spin = 2 * 2.3568 * 1.002  # of the drive end's elements
    assert codes(analyze(at_sensors(spin, (6.0, 2.0), odd=0.4)), Kind.FAULT) == ["bearing-rolling-element"]


def test_impacts_at_twice_a_parts_order_are_not_the_parts() -> None:
    analysis = analyze(at_sensors(2 * 3.5848 * 1.002, (6.0, 2.0)))
    assert not NAMED & set(codes(analysis, Kind.FAULT))
    assert all(f.confidence < 0.5 for f in analysis.findings if f.code in NAMED)


def test_a_part_of_twice_the_rate_is_no_rival_where_odd_lines_are_as_high() -> None:
    recording = at_sensors(1.7597, (6.0, 2.0))  # twice that is 1.8 % from the drive end's outer race
    assert recording.rig is not None
    slow = Bearing("slow", recording.rig.shafts[0].name, bpfi_order=1.7597)
    analysis = analyze(replace(recording, rig=replace(recording.rig, bearings=(*recording.rig.bearings, slow))))
    found = finding(analysis, "bearing-inner-race")
    assert found.where.bearing == "slow"
    assert found.confidence > 0.9


def outer_race_at(order: float, n: int, name: str) -> Bearing:
    """Return a bearing of n balls whose outer race strikes at an order."""
    return Bearing(name, "motor", n, 40.0 * (1 - 2 * order / n), 40.0)


def with_bearings(recording: Recording, *bearings: Bearing) -> Recording:
    assert recording.rig is not None
    return replace(recording, rig=replace(recording.rig, bearings=bearings))


@pytest.mark.parametrize(("numbers", "is_of_the_teeth"), [(2.0, True), (2.3, False)])
def test_impacts_as_often_as_two_teeth_meet_again_are_the_teeths(numbers: float, is_of_the_teeth: bool) -> None:
    """A damaged tooth strikes each of the other gear's teeth in turn, and they are not alike."""
    recording = record(seconds=25.0)
    rings = np.exp(-900 * np.arange(400) / SAMPLING_RATE_HZ) * np.sin(
        2 * np.pi * 3000 * np.arange(400) / SAMPLING_RATE_HZ
    )
    turns = refined_angle(recording, RIG).revolutions_at(np.arange(recording.n_samples) / SAMPLING_RATE_HZ)
    struck = np.diff(np.floor(turns * numbers / 43), prepend=0) > 0
    samples = np.array(recording.samples)
    samples[recording.channel_names.index("a1")] += 40 * np.convolve(struck, rings)[: recording.n_samples]
    found = finding(analyze(replace(recording, samples=samples)), "non-synchronous-impacts")
    assert ("hunting-tooth order" in found.title) == is_of_the_teeth


def test_loose_parts_that_strike_every_other_turn_are_no_race() -> None:
    loose = with_bearings(at_sensors(0.5, (20.0, 6.0)), outer_race_at(2.51, 7, "drive end"))
    assert all(f.confidence < 0.5 for f in analyze(loose).findings if f.code in NAMED)


def test_noise_that_the_supplys_pull_modulates_is_no_race() -> None:
    quiet = at_sensors(1.003, (0.0, 0.0))
    t = np.arange(quiet.n_samples) / quiet.sampling_rate_hz
    pull = np.prod([1 + 0.3 / k * np.cos(2 * np.pi * 120.0 * k * t + k) for k in (1, 2, 3)], axis=0)
    hum = with_bearings(replace(quiet, samples=quiet.samples * pull), outer_race_at(1.003 * 120 / 29, 10, "drive end"))
    found = finding(analyze(hum), "bearing-outer-race")
    assert found.confidence < 0.5
    assert found.kind is not Kind.FAULT


@pytest.mark.parametrize(
    ("course", "is_named"),
    [
        ("impacts", True),
        ("slow impacts", True),
        ("one sine", False),
        ("passing elements", False),
        ("dips", False),
        ("impacts turned round", False),
    ],
)
def test_only_what_rises_and_rings_down_at_a_races_order_is_called_damage(course: str, is_named: bool) -> None:
    """Noise of the same depth, modulated as damage does it, or play, waviness and elements that pass the load."""
    quiet = motor("", seed=3)
    since = np.arange(quiet.n_samples) / quiet.sampling_rate_hz * 3.585 * 0.997 * MOTOR_HZ % 1  # in intervals
    courses = {
        "impacts": np.exp(-since / 0.15),
        "slow impacts": np.exp(-since / 1.5),
        "one sine": np.cos(2 * np.pi * since),
        "passing elements": np.abs(np.cos(np.pi * since)),
        "dips": -np.exp(-np.minimum(since, 1 - since) / 0.15),
        "impacts turned round": -np.exp(-since / 0.15),
    }
    modulation = (courses[course] - courses[course].mean()) / courses[course].std()
    carrier = 3 * np.random.default_rng(4).standard_normal(quiet.n_samples)
    analysis = analyze(replace(quiet, samples=quiet.samples + np.maximum(1 + 0.45 * modulation, 0) * carrier))
    found = [f.kind for f in analysis.findings if f.code == "bearing-outer-race"]
    assert found == [Kind.FAULT] if is_named else found in ([], [Kind.NOTICE])


def test_a_race_behind_the_clicks_of_a_supply_is_named() -> None:
    def clicking(heights: tuple[float, float]) -> Recording:
        quiet = at_sensors(5.4152 * 1.003, heights)
        samples, clicks_s = np.array(quiet.samples), np.arange(0.003, quiet.duration_s, 1 / 100.0)
        samples[:, np.round(clicks_s * quiet.sampling_rate_hz).astype(int)] += 8.0
        return replace(quiet, samples=samples)

    damaged, sound = (analyze(clicking(heights)) for heights in ((0.85, 0.255), (0.0, 0.0)))
    assert finding(damaged, "bearing-inner-race").is_claim
    assert finding(damaged, "non-synchronous-impacts").kind is Kind.NOTICE
    assert not NAMED & set(codes(sound))
    assert finding(sound, "non-synchronous-impacts").kind is Kind.NOTICE


def test_beats_of_steady_tones_are_no_race() -> None:
    """Of slots and of a supply, as far apart as a race's order: in the envelope they make all of its lines."""
    quiet = at_sensors(1.003, (0.0,), seconds=3.0)
    t = np.arange(quiet.n_samples) / quiet.sampling_rate_hz
    tones = sum(0.5 * np.cos(2 * np.pi * (1500.3 + k * 3.596 * 29.0) * t + k * k) for k in range(5))
    found = finding(analyze(replace(quiet, samples=quiet.samples + tones)), "bearing-outer-race")
    assert found.kind is Kind.NOTICE
    assert any("beats of steady tones" in text for text in found.evidence)


def test_a_race_beside_a_supplys_pull_that_is_stronger_is_named() -> None:
    """The pull lies within the slip of the other race, and its lines are far above those of the damage."""
    recording = at_sensors(3.24, (1.0,), seconds=4.0)
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    pull = np.prod([1 + 1 / k * np.cos(2 * np.pi * 120.0 * k * t + k) for k in (1, 2, 3)], axis=0)
    hum = pull * np.random.default_rng(9).standard_normal(recording.n_samples)
    bearing = Bearing("drive end", "motor", bpfo_order=3.25, bpfi_order=1.004 * 120 / 29)
    analysis = analyze(with_bearings(replace(recording, samples=recording.samples + hum), bearing))
    assert finding(analysis, "bearing-outer-race").kind is Kind.SUSPICION
    assert "bearing-inner-race" not in codes(analysis)


def test_a_race_in_a_short_record_is_not_hidden_by_its_own_sidebands() -> None:
    recording = at_sensors(5.431, (4.0,), seconds=1.5, uneven=0.01, turning=True)
    assert finding(analyze(recording), "bearing-inner-race").kind is Kind.FAULT


def test_a_shaft_that_explains_the_first_line_alone_explains_no_race() -> None:
    """Its line lies 0.6 % beside the race's, as strong; the race's others are nowhere near."""
    recording = at_sensors(4.97, (1.5,))
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    noise = np.random.default_rng(5).standard_normal(recording.n_samples)
    passing = recording.samples + noise * (1 + 0.6 * np.cos(2 * np.pi * 5 * 29.0 * t))
    inner = Bearing("drive end", "motor", bpfo_order=3.03, bpfi_order=4.98)
    assert finding(analyze(with_bearings(replace(recording, samples=passing), inner)), "bearing-inner-race").is_claim


def test_sidebands_of_an_inner_race_are_no_second_part() -> None:
    """Its first line is near one of the shaft's, and so weaker than the sideband that is at the element's order."""
    recording = at_sensors(4.97, (4.0,), uneven=0.01, seconds=3.0, turning=True)
    bearing = Bearing("drive end", "motor", bpfo_order=3.05, bpfi_order=4.99, bsf_order=1.989)
    assert NAMED & set(codes(analyze(with_bearings(recording, bearing)))) == {"bearing-inner-race"}


def test_an_outer_race_under_a_load_that_turns_is_not_explained_away_by_its_own_sidebands() -> None:
    """They fall on the inner race's order, as eight balls strike the races together nearly eight times a turn."""
    recording = at_sensors(3.02, (8.0,), seconds=4.0, unbalance=1.0)
    assert recording.rig is not None
    analysis = analyze(with_bearings(recording, recording.rig.bearings[1]))
    assert NAMED & set(codes(analysis, Kind.FAULT, Kind.SUSPICION)) == {"bearing-outer-race"}


def test_two_races_do_not_explain_each_other_away() -> None:
    """Tones of an inverter, 2.02 turns apart, beat at 3.03: there an outer race has a family, two turns below 5.03."""
    recording = at_sensors(5.03, (2.0,), turning=True, uneven=0.008, seconds=5.0)
    t = np.arange(recording.n_samples) / recording.sampling_rate_hz
    tones = sum(2.0 * np.cos(2 * np.pi * (4000 + k * 2.02 * 29.0) * t + k**2) for k in (-2, -1, 1, 2))
    bearing = Bearing("drive end", "motor", 8, 7.145, 28.519)
    analysis = analyze(with_bearings(replace(recording, samples=recording.samples + tones), bearing))
    assert NAMED & set(codes(analysis, Kind.FAULT, Kind.SUSPICION)) == {"bearing-inner-race"}


@pytest.mark.parametrize(("strikes", "is_race"), [(4.982, True), (5.0, False)])
def test_a_race_whose_only_lines_are_beside_those_of_its_shaft_is_not_called_sound(
    strikes: float, *, is_race: bool
) -> None:
    """It rings longer than from impact to impact, and passes the load once a turn."""
    recording = at_sensors(3.3, (0.0,))
    turns = 29.0 * np.arange(recording.n_samples) / recording.sampling_rate_hz
    ringing = np.random.default_rng(9).standard_normal(len(turns)) * (1 + np.cos(2 * np.pi * strikes * turns))
    samples = recording.samples + 0.6 * ringing * np.clip(np.cos(2 * np.pi * turns), 0.0, None)
    assert recording.rig is not None
    analysis = analyze(with_bearings(replace(recording, samples=samples), recording.rig.bearings[1]))
    why = "lines stand beside 5 times per turn of shaft motor, all on one side"
    assert any(why in f.title for f in analysis.findings) is is_race


def test_a_race_that_chance_hardly_explains_is_not_called_sound() -> None:
    undecided = finding(analyze(at_sensors(3.57, (1.0,), uneven=0.03, seconds=3.0)), "bearings-undecided")
    assert "lines stand at the order of the outer race of drive end, and the chance" in undecided.title


def test_a_race_that_shows_in_no_envelope_but_in_the_vibration_itself_is_not_called_sound() -> None:
    """Its slip takes the first multiples to those of a slow shaft, of which only the further ones part."""
    rig = replace(RIG, pairs=(GearPair("stage", "in", "out", 20, 58),))
    order = 10 * 20 / 58 + 0.3 / 176  # at 22 Hz for 8 s the spectrum has a line each 1/176
    rig = replace(rig, bearings=(replace(outer_race_at(order * 1.006, 9, "front"), shaft="in"),))
    quiet = replace(GOOD, speed=ConstantProfile(1320.0), channels=(SensorChannel("a1", noise=ColouredNoise(0.1)),))
    sound = record(quiet, seconds=SECONDS, rig=rig)
    turns = 22.0 * np.arange(sound.n_samples) / SAMPLING_RATE_HZ
    phases = np.random.default_rng(5).uniform(0, 2 * np.pi, 24)
    train = sum(np.cos(2 * np.pi * k * order * turns + phase) for k, phase in enumerate(phases, 1))
    analysis = analyze(replace(sound, samples=sound.samples + 0.1 * train))
    assert "multiples of the order of the outer race of front" in finding(analysis, "bearings-undecided").title


def test_of_two_like_bearings_the_one_at_the_loudest_sensor_is_named() -> None:
    recording = at_sensors(3.5848, (2.0, 6.0))
    samples = np.array(recording.samples)
    samples[1] += 8.0 * np.random.default_rng(4).standard_normal(samples.shape[1])  # and it is not the clearest
    like = (outer_race_at(3.596, 9, "drive end"), outer_race_at(3.5848, 9, "fan end"))
    analysis = analyze(with_bearings(replace(recording, samples=samples), *like))
    assert finding(analysis, "bearing-outer-race").where.bearing == "fan end"
    assert finding(analysis, "bearing-outer-race").confidence > 0.5


def test_a_stated_speed_that_is_right_is_not_moved_to_a_races_sidebands() -> None:
    rng, shaft_hz, fs_hz = np.random.default_rng(3), 30.857, 12_000.0
    turns = shaft_hz * np.arange(int(SECONDS * fs_hz)) / fs_hz
    angles = np.cumsum((1 + 0.003 * rng.standard_normal(int(turns[-1] * 5.977) - 20)) / 5.977)
    impacts, k = np.zeros(len(turns)), np.arange(200)
    impacts[np.searchsorted(turns, angles)] = 1 + 0.9 * np.cos(2 * np.pi * angles)
    x = 30 * np.convolve(impacts, np.exp(-k / 25) * np.sin(1.6 * k))[: len(turns)] + rng.standard_normal(len(turns))
    x += sum(a * np.cos(2 * np.pi * h * turns + h) for h, a in ((1, 0.7), (2, 0.5), (3, 0.5)))
    rig = Rig(shafts=(Shaft("motor"),), speed=ConstantSpeed(60 * shaft_hz, "motor"))
    recording = Recording(x[None, :], fs_hz, (Channel("a1", "acceleration", "g"),), rig=rig)
    assert refined_angle(recording, rig).mean_speed_rpm == pytest.approx(60 * shaft_hz, rel=5e-4)


def test_a_family_among_others_as_clear_does_not_stand_out() -> None:
    rng = np.random.default_rng(7)
    excess = lines([1.3 * k for k in range(1, 250)], rng)  # any order has a multiple of 1.3 Hz near it
    comb = best_comb(excess, 49.0, 51.0)
    assert comb is not None
    assert not stands_out_from_neighbours(excess, comb, 0.02, ())


@pytest.mark.parametrize(("factor", "is_found"), [(0.4, False), (1.8, True)])
def test_the_smallest_depth_is_where_families_begin_to_show(factor: float, is_found: bool) -> None:
    rng = np.random.default_rng(8)

    def envelope(amplitude: float) -> BandEnvelope:
        return BandEnvelope("a1", (300.0, 450.0), lines([50.2 * k for k in range(1, 7)], rng, amplitude), 2.0)

    depth = smallest_depth([envelope(0.0)], 50.0, 0.02, 1e-4)
    found = 0
    for _ in range(20):
        comb = best_comb(envelope(factor * depth * 2.0).excess, 49.0, 51.0)
        found += comb is not None and comb.p_value <= 1e-4
    assert found >= 19 if is_found else found <= 1
