"""A sample machine with a damaged tooth whose recording was spoiled on its way: noticed, said, and never as sure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.samples import sample_folder
from gearsig import analyze
from gearsig.diagnosis import Kind, Outcome
from gearsig.recording import Recording, find_problems, read_recording
from gearsig.rig import ConstantSpeed, OperatingPoint, Rig, Shaft, read_rig
from sims.blind import draw_case, record_case
from tests.diagnosis.machines import GOOD, record
from tests.kinematic.speed import ConstantProfile
from tests.measured import BY_NAME, DATA, MOTOR, RECORDINGS, needs_data

FOLDER = Path(sample_folder())
RIG = read_rig(FOLDER / "damaged_tooth.toml")
TRUE = read_recording(FOLDER / "damaged_tooth.csv.gz", rig=RIG)
RATE = TRUE.sampling_rate_hz
SHAKE, PULSES = (TRUE.values(name).astype(float) for name in ("a1", "tacho"))
TURN = 60 / 1497 * RATE


def spoiled(shake=SHAKE, pulses=PULSES, rate=RATE, speed=None):
    return Recording(np.stack([shake, pulses]).astype(np.float32), rate, TRUE.channels, speed=speed, rig=RIG)


def clipped(share):
    limit = np.quantile(np.abs(SHAKE), 1 - share)
    return np.clip(SHAKE, -limit, limit)


def wrapped():
    counts = np.round(SHAKE / np.quantile(np.abs(SHAKE), 0.97) * 32768).astype(np.int64)
    return (counts + 32768) % 65536 - 32768


def half_the_pulses():
    kept, base = PULSES.copy(), np.median(PULSES)
    high = (PULSES.max() + PULSES.min()) / 2 < PULSES
    for start in (np.flatnonzero(high[1:] & ~high[:-1]) + 1)[1::2]:
        kept[max(0, start - 20) : start + int(TURN / 3)] = base
    return kept


def with_hum():
    time_s = np.arange(len(SHAKE)) / RATE
    return SHAKE + 20 * np.sqrt(2) * SHAKE.std() * np.sin(2 * np.pi * 50 * time_s)


def through_zero(x):
    """The same with a speed that falls to zero and rises again."""
    time = np.linspace(0, 1, len(x))
    return np.interp(2 * (time - time**2) * len(x), np.arange(len(x)), x)


CASES = {
    "rate ten times too high": (spoiled(rate=10 * RATE), {"sampling-rate-doubtful"}),
    "rate ten times too low": (spoiled(rate=RATE / 10), {"sampling-rate-doubtful"}),
    "rate a fifth too high": (spoiled(rate=1.2 * RATE), {"speed-off-nominal"}),
    "stated speed a tenth too high": (spoiled(speed=ConstantSpeed(1650.0, "input")), {"speed-off-nominal"}),
    "rate too low for the stated speed": (
        spoiled(rate=RATE / 10, speed=ConstantSpeed(1500.0, "input")),
        {"mesh-above-sampling"},
    ),
    "two pulses": (spoiled(pulses=np.maximum(PULSES, np.roll(PULSES, round(TURN / 2)))), {"sampling-rate-doubtful"}),
    "half the pulses": (spoiled(pulses=half_the_pulses()), {"sampling-rate-doubtful"}),
    "reversed": (spoiled(SHAKE[::-1], PULSES[::-1]), {"channel-reversed"}),
    "clipped at 30 %": (spoiled(clipped(0.3)), {"channel-clipped"}),
    "clipped at 5 %": (spoiled(clipped(0.05)), {"channel-clipped"}),
    "wrapped": (spoiled(wrapped()), {"channel-wrapped"}),
    "gain step": (spoiled(np.where(np.arange(len(SHAKE)) < len(SHAKE) // 2, 1, 3) * SHAKE), {"channel-stepped"}),
    "hum": (spoiled(with_hum()), {"channel-hum"}),
    "through zero": (spoiled(through_zero(SHAKE), through_zero(PULSES)), {"speed-near-zero"}),
}


def test_the_true_recording_has_no_such_problem():
    found = analyze(TRUE)
    assert not find_problems(TRUE)
    assert not [f for f in found.findings if f.kind is Kind.DATA_PROBLEM]
    assert max(f.confidence for f in found.findings if f.kind is Kind.FAULT) > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_spoiled_is_noticed_said_and_lowered(name):
    recording, codes = CASES[name]
    found = analyze(recording)
    seen = {f.code: f for f in found.findings}
    assert codes <= set(seen)
    assert not [f for f in found.findings if f.kind is Kind.FAULT]
    assert found.crack is None
    problems = {f.code for f in found.findings if f.kind is Kind.DATA_PROBLEM}
    assert problems <= codes | {"sampling-rate-doubtful", "channel-stuck"}
    assert any(seen[code].title in found.verdict for code in problems) or not problems


def test_a_rate_given_although_the_file_states_another_is_one_problem_with_one_remedy():
    given = read_recording(FOLDER / "damaged_tooth.csv.gz", rig=RIG, sampling_rate_hz=2 * RATE)
    (problem,) = [f for f in analyze(given).findings if f.kind is Kind.DATA_PROBLEM]
    assert problem.code == "sampling-rate-doubtful"
    assert problem.surer.startswith("Leave out the sampling rate given (--fs)")


@pytest.mark.parametrize("has_nominal", [True, False])
def test_a_speed_of_no_machine_is_said(has_nominal):
    point = TRUE.rig.operating_point if has_nominal else OperatingPoint()
    fast = replace(TRUE, sampling_rate_hz=1000 * RATE, rig=replace(TRUE.rig, operating_point=point))
    found = analyze(fast)
    assert [f.code for f in found.findings if f.kind is Kind.DATA_PROBLEM].count("speed-off-nominal") == 1
    assert not [f for f in found.findings if f.kind is Kind.FAULT]


@pytest.mark.parametrize("rpm", [0.0015, 1.5, 25.0, 60.0])
def test_a_speed_stated_far_too_low_is_said_and_no_error(rpm):
    """As of rev/s that are called rpm, or of pulse times in milliseconds: the record holds a turn or less."""
    found = analyze(replace(TRUE, speed=ConstantSpeed(rpm, "input")))
    assert "speed-off-nominal" in {f.code for f in found.findings}
    assert not [f for f in found.findings if f.kind is Kind.FAULT]


@pytest.mark.slow
def test_a_stop_or_a_reversal_is_noticed_without_a_tachometer():
    """A stated speed, and one that most of the record shows, know nothing of it."""
    steady = record(replace(GOOD, speed=ConstantProfile(1320.0)), seconds=6.0).select(["a1"])
    steady = replace(steady, speed=None, rig=replace(steady.rig, operating_point=OperatingPoint("in", 1320.0)))
    assert "speed-near-zero" not in {f.code for f in analyze(steady).findings}
    time, noise = np.linspace(0, 1, steady.n_samples), np.random.default_rng(0).standard_normal(steady.n_samples)
    stops = np.clip(np.maximum(0.4 - time, time - 0.65) * 20, 0, 1)
    for course, speed in ((stops, ConstantSpeed(1320.0, "in")), (np.clip((0.5 - time) * 40, -1, 1), None)):
        turned = np.cumsum(course) - np.cumsum(course).min()
        x = np.interp(turned, np.arange(steady.n_samples), steady.values("a1")) + 0.02 * noise
        found = analyze(replace(steady, samples=x[None].astype(np.float32), speed=speed))
        (problem,) = [f for f in found.findings if f.code == "speed-near-zero"]
        start_s, end_s = problem.where.time_s
        assert start_s < 3.0 < end_s
        assert end_s - start_s < 2.4
        assert problem.title in found.verdict
        assert found.outcome is Outcome.CANNOT_TELL


def test_noise_tones_and_pulse_trains_have_no_such_problem():
    rng = np.random.default_rng(0)
    n = 1 << 15
    time_s = np.arange(n) / 12800
    channel = TRUE.channels[0]
    for x in (
        rng.standard_normal(n),
        np.sin(2 * np.pi * 6300 * time_s) + 0.01 * rng.standard_normal(n),
        np.sign(np.sin(2 * np.pi * 110 * time_s)) + 0.01 * rng.standard_normal(n),
        rng.uniform(-1, 1, n),
        np.clip(rng.standard_normal(n), -2, 2) + 1e-3 * rng.standard_normal(n),
        rng.standard_normal(n) * (1 + time_s),
        rng.standard_normal(n) * np.exp(-0.5 * np.sin(2 * np.pi * 3 * time_s)),
    ):
        kinds = {p.kind for p in find_problems(Recording(x[None], 12800.0, (channel,)))}
        assert not kinds & {"wrapped", "stepped", "reversed", "hum"}


@pytest.mark.parametrize("share", [0.01, 0.03, 0.1])
def test_noise_of_a_wide_band_that_wraps_is_told_from_noise(share):
    x = np.random.default_rng(0).standard_normal(1 << 15)
    counts = np.round(x / np.quantile(np.abs(x), 1 - share) * 32768).astype(np.int64)
    recording = Recording(((counts + 32768) % 65536 - 32768.0)[None], 12800.0, (TRUE.channels[0],))
    assert {p.kind for p in find_problems(recording)} == {"wrapped"}


@pytest.mark.parametrize("n", [3, 12, 41, 144])
@pytest.mark.parametrize("name", ["damaged_tooth.csv.gz", "run_up.h5", "root_crack_0mm.h5"])
def test_a_few_samples_that_overflowed_are_noticed(name, n):
    """A gain a little too high: n samples of some 100,000 lie beyond the range of 16 bits."""
    recording = read_recording(FOLDER / name)
    x = recording.values("a1").astype(float)
    counts = np.round((x - x.mean()) / np.partition(np.abs(x - x.mean()), -n - 1)[-n - 1] * 32767.0)
    for sent, is_wrapped in (((counts + 32768) % 65536 - 32768, True), (np.clip(counts, -32768, 32767), False)):
        problems = find_problems(Recording(sent[None], recording.sampling_rate_hz, recording.channels[:1]))
        assert ("wrapped" in {p.kind for p in problems}) == is_wrapped


@pytest.mark.parametrize("tones_hz", [(6300.0, 7900.0), (6830.0, 7400.0, 8100.0), (6500.0, 7000.0)])
def test_tones_of_three_samples_per_cycle_are_no_overflow(tones_hz):
    time_s, rng = np.arange(1 << 16) / 20480, np.random.default_rng(1)
    tones = sum(
        np.sin(2 * np.pi * hz * time_s + i) * (1 + 0.3 * np.sin(2 * np.pi * 30 * time_s))
        for i, hz in enumerate(tones_hz)
    )
    x = tones + 0.01 * rng.standard_normal(len(time_s))
    assert "wrapped" not in {p.kind for p in find_problems(Recording(x[None], 20480.0, (TRUE.channels[0],)))}


def test_steps_that_fall_short_of_what_is_expected_are_no_overflow():
    """Tones below half the sampling rate, as of finite-element gears; overflowed samples go further than expected."""
    rng, t = np.random.default_rng(2901), np.arange(30_000)
    n = rng.integers(3, 8)
    frequency, size, phase = rng.uniform(0.2, 0.45, n), rng.uniform(0.2, 1.0, n), rng.uniform(0.0, 6.28, n)
    x = np.sum(size * np.cos(2.0 * np.pi * frequency * t[:, None] + phase), axis=1)
    x = x + rng.uniform(0.0, 0.6) * rng.standard_normal(len(t))
    x = x + rng.uniform(0.0, 0.15) * x**2
    assert "wrapped" not in {p.kind for p in find_problems(Recording(x[None], 20480.0, (TRUE.channels[0],)))}


@pytest.mark.parametrize("ring_hz", [900.0, 3000.0, 5900.0])
def test_impacts_and_clicks_are_no_overflow(ring_hz):
    rng, time_s = np.random.default_rng(0), np.arange(1 << 15) / 12800
    impacts = np.where(np.arange(len(time_s)) % 512, 0, rng.lognormal(0, 1, len(time_s)))
    ringing = np.convolve(impacts, np.sin(2 * np.pi * ring_hz * time_s[:256]) * np.exp(-800 * time_s[:256]))
    clicks = 0.1 * np.sin(2 * np.pi * 110 * time_s) + np.where(np.arange(len(time_s)) % 1009, 0, 5)
    noise = 1e-3 * rng.standard_normal(len(time_s))
    for x in (ringing[: len(time_s)] + noise, clicks + noise):
        assert "wrapped" not in {p.kind for p in find_problems(Recording(x[None], 12800.0, (TRUE.channels[0],)))}


@pytest.mark.parametrize(("speed_rpm", "is_hum"), [(1500.0, False), (2001.0, True)])
def test_a_shaft_excuses_hum_at_its_own_frequency_only(speed_rpm, is_hum):
    rig = Rig(shafts=(Shaft("motor"),), speed=ConstantSpeed(speed_rpm, "motor"))  # 3 × 2001 rpm are 100.05 Hz
    time_s = np.arange(1 << 16) / 12800
    x = np.random.default_rng(0).standard_normal(1 << 16) + 20 * np.sin(2 * np.pi * 50 * time_s)
    codes = {f.code for f in analyze(Recording(x[None], 12800.0, (TRUE.channels[0],), rig=rig)).findings}
    assert ("channel-hum" in codes) == is_hum
    assert ("line-of-mains-or-shaft" in codes) == (not is_hum)


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda x, _: np.clip(x, *(np.quantile(np.abs(x), 0.7) * np.array([-1, 1]))), "channel-clipped"),
        (lambda x, _: (np.round(x / np.quantile(np.abs(x), 0.97) * 32768) + 32768) % 65536 - 32768, "channel-wrapped"),
        (lambda x, _: np.where(np.arange(len(x)) < len(x) // 2, 1, 3) * x, "channel-stepped"),
        (lambda x, t: x + 20 * np.sqrt(2) * x.std() * np.sin(2 * np.pi * 50 * t), "channel-hum"),
        (lambda x, _: x[::-1], "channel-reversed"),
    ],
    ids=["clipped", "wrapped", "gain step", "hum", "reversed"],
)
def test_a_measured_recording_that_is_spoiled(spoil, code):
    rig = replace(MOTOR, speed=ConstantSpeed(1797.0, "motor"))
    true = read_recording(DATA / "bearing_cwru" / "OR007@6_0.mat", rig=rig, sampling_rate_hz=12e3)
    x = true.values("X130_DE_time").astype(float)
    sent = spoil(x, np.arange(len(x)) / 12e3).astype(np.float32)
    found = analyze(Recording(sent[None], 12e3, true.channels[:1], speed=true.speed, rig=rig))
    assert code in {f.code for f in found.findings}
    assert not [f for f in found.findings if f.kind is Kind.FAULT]


@needs_data
@pytest.mark.parametrize("name", [one.name for one in RECORDINGS])
def test_time_runs_forward_in_every_measured_recording(name):
    """Turned round it is noticed where impacts are strong, and never in a recording that runs forward."""
    recording = BY_NAME[name].read()
    assert not [p for p in find_problems(recording) if p.kind == "reversed"]
    turned = find_problems(replace(recording, samples=np.ascontiguousarray(recording.samples[:, ::-1])))
    if name.startswith(("bearing_cwru/OR007", "bearing_cwru/IR021")):
        said = {p.channel for p in turned if p.kind == "reversed"}
        assert {name for name in recording.vibration_names() if "_FE_" not in name} <= said


@pytest.mark.slow
def test_teeth_that_separate_and_strike_again_do_not_run_backwards():
    """A chip through which teeth separate: more energy comes before the peak of the second strike than after it."""
    case = draw_case(
        np.random.default_rng(7014),
        role="development",
        kind="single",
        effect="chipped_tooth",
        level=1.0,
        n_conditions=1,
        with_reference=True,
    )
    assert "reversed" not in {p.kind for p in find_problems(record_case(case).conditions[0])}


@pytest.mark.parametrize("damping", [0.01, 0.05])
def test_strikes_in_noise_show_the_direction_of_time(damping):
    """Of a struck mode; its envelope turned round is no struck one's."""
    rng, n, rate_hz = np.random.default_rng(3), 1 << 16, 12800.0
    t = np.arange(400) / rate_hz
    ring = np.exp(-damping * 2 * np.pi * 2500 * t) * np.sin(2 * np.pi * 2500 * t)
    struck = np.zeros(n)
    struck[np.arange(200, n - 500, 160) + rng.integers(0, 20, len(range(200, n - 500, 160)))] = 6.0
    x = np.convolve(struck, ring)[:n] + 0.5 * rng.standard_normal(n)
    for values, expected in ((x, set()), (x[::-1], {"reversed"})):
        recording = Recording(values[None].copy(), rate_hz, (TRUE.channels[0],))
        assert {p.kind for p in find_problems(recording)} & {"reversed"} == expected
