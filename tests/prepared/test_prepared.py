"""A prepared recording computes each result once, bounded in memory, and says the same as the single functions."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle, resample_to_angle
from gearsig.errors import RefusalError
from gearsig.orders import synchronous_average
from gearsig.prepared import PreparedRecording, prepare, sliding_mean, strongest_window
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, GearPair, PulseTimes, Rig, Shaft

RATE_HZ, SPEED_HZ = 2000.0, 10.0
RIG = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("stage", "in", "out", 20, 40),))


@pytest.fixture
def recording() -> Recording:
    time_s = np.arange(20_000) / RATE_HZ
    noise = np.random.default_rng(1).normal(size=(3, len(time_s)))
    samples = noise + 5.0 * np.cos(2 * np.pi * 20 * SPEED_HZ * time_s)
    channels = tuple(Channel(name, "acceleration", "m/s^2") for name in ("a1", "a2", "a3"))
    pulses = PulseTimes(np.arange(0.0, 10.0, 1 / SPEED_HZ), shaft="in")
    return Recording(samples, RATE_HZ, channels, speed=pulses, rig=RIG)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    made: list[tuple[str, ...]] = []

    def counted(*args, **options):  # type: ignore[no-untyped-def]
        made.append(tuple(options["channels"]))
        return resample_to_angle(*args, **options)

    monkeypatch.setattr(sys.modules[PreparedRecording.__module__], "resample_to_angle", counted)
    return made


def test_values_are_those_of_the_single_functions(recording: Recording) -> None:
    prepared = PreparedRecording(recording)
    angle = find_shaft_angle(recording, RIG).between(0.0, recording.duration_s)
    expected = synchronous_average(resample_to_angle(recording, angle.of_shaft("out", 0.5)), "a2")
    assert np.array_equal(prepared.average("out", "a2").values, expected.values)
    assert prepared.average("out", "a2").shaft == "out"
    assert prepared.has_mark("in")
    assert not prepared.has_mark("out")


def test_a_channel_is_resampled_once_for_each_shaft(recording: Recording, calls: list[tuple[str, ...]]) -> None:
    prepared = PreparedRecording(recording)
    whole = prepared.over_angle()
    part = prepared.over_angle("in", ["a2", "a3"])
    assert np.shares_memory(whole.samples, part.samples)
    assert np.array_equal(prepared.over_angle("in", ["a3", "a1"]).samples, whole.samples[[2, 0]])
    prepared.over_angle("in", ["a1"], followed=True)  # pulses: there is nothing to follow
    for name in ("a1", "a2", "a3"):
        prepared.average("", name), prepared.order_lines(name), prepared.order_map(name)
    assert calls == [("a1", "a2", "a3")]
    prepared.over_angle("out", ["a1"])
    assert len(calls) == 2


def test_memory_is_bounded_and_what_was_forgotten_comes_again(
    recording: Recording, calls: list[tuple[str, ...]]
) -> None:
    prepared = PreparedRecording(recording, memory_limit_mb=0.6)
    first = prepared.over_angle("in")
    prepared.over_angle("out")
    assert prepared.kept_bytes <= 0.6e6
    assert np.array_equal(prepared.over_angle("in").samples, first.samples)
    assert len(calls) == 3


def test_a_refusal_is_kept(recording: Recording) -> None:
    prepared = PreparedRecording(replace(recording, speed=ConstantSpeed(0.0)))
    tried: list[int] = []
    for _ in range(2):
        with pytest.raises(RefusalError, match="at rest"):
            prepared.keep("attempt", lambda: (tried.append(1), prepared.shaft_angle))
    assert tried == [1]


def test_a_prepared_recording_is_passed_on_unless_it_lacks_the_rig(recording: Recording) -> None:
    prepared = prepare(recording)
    assert prepare(prepared, RIG) is prepared
    assert prepared.with_rig(RIG) is prepared
    assert prepare(PreparedRecording(replace(recording, rig=None)), RIG).rig == RIG


def test_windows_go_around_the_revolution() -> None:
    energies = np.array([4.0, 0.0, 1.0, 1.0, 1.0, 6.0])
    means = sliding_mean(energies, 2)
    assert means == pytest.approx([2.0, 0.5, 1.0, 1.0, 3.5, 5.0])
    assert strongest_window(means) == (5, pytest.approx(5.0 / 1.5))
