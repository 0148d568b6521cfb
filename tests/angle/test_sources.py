"""Encoder, speed channel, constant speed, and the choice among them."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.angle import constant_speed_angle, encoder_angle, find_shaft_angle, speed_channel_angle
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording
from gearsig.rig import (
    ConstantSpeed,
    EncoderChannel,
    GearPair,
    OperatingPoint,
    PulseTimes,
    Rig,
    Shaft,
    SpeedChannel,
    SpeedSource,
    TachometerChannel,
)

RATE = 10_000.0
T = np.arange(50_000) / RATE
THETA = 20 * T + 0.3 * np.sin(2 * np.pi * T)
SPEED = 20 + 0.6 * np.pi * np.cos(2 * np.pi * T)


def with_source(source: SpeedSource | None, *rows: np.ndarray, rig: Rig | None = None) -> Recording:
    samples = np.array([np.cos(2 * np.pi * 10 * THETA), *rows])
    channels = (Channel("a", "acceleration"), *(Channel(f"c{i}", "tachometer") for i in range(len(rows))))
    return Recording(samples, RATE, channels, speed=source, rig=rig)


@pytest.mark.parametrize(
    ("values", "units", "wraps", "worst"),
    [
        (THETA % 1 * 360, 360.0, True, 1e-7),
        (THETA, 1.0, False, 1e-7),
        (-THETA * 2 * np.pi, 2 * np.pi, False, 1e-7),
        (np.floor(THETA * 1024) % 1024, 1024.0, True, 0.04),
        (THETA * 360 + 0.05 * np.random.default_rng(0).normal(size=len(T)), 360.0, False, 0.015),
    ],
)
def test_encoder_speed(values: np.ndarray, units: float, wraps: bool, worst: float) -> None:
    angle = encoder_angle(values, RATE, units, wraps=wraps)
    assert np.abs(angle.speed_rpm_at(T) / 60 / SPEED - 1)[50:-50].max() < worst
    assert angle.n_revolutions == pytest.approx(THETA[-1] - THETA[0], abs=2e-3)


def test_encoder_refusals() -> None:
    with pytest.raises(RefusalError, match="at rest"):
        encoder_angle(np.full(1000, 12.0), RATE)
    with pytest.raises(RefusalError, match="turns back"):
        encoder_angle(np.concatenate([np.arange(600.0), np.arange(600.0, 300.0, -1)]), RATE, wraps=False)


def test_speed_channel_integrates_to_the_angle() -> None:
    rpm = np.round(SPEED * 60 / 0.15) * 0.15  # as from 16 bits over 4900 rpm
    angle = speed_channel_angle(rpm, RATE)
    assert np.abs(angle.revolutions_at(T) - THETA).max() < 2e-3
    assert np.abs(angle.speed_rpm_at(T) / 60 / SPEED - 1)[1000:-1000].max() < 1e-2
    backwards = speed_channel_angle(-rpm / 60, RATE, 60.0)
    np.testing.assert_allclose(backwards.revolutions, angle.revolutions)


def test_speed_channel_refusals() -> None:
    with pytest.raises(RefusalError, match="at rest"):
        speed_channel_angle(np.full(1000, 0.001), RATE)
    with pytest.raises(RefusalError, match="reverses"):
        speed_channel_angle(np.linspace(1000.0, -1000.0, 5000), RATE)


@pytest.mark.parametrize(
    "source",
    [
        PulseTimes(np.interp(np.arange(100), THETA, T)),
        TachometerChannel("c0"),
        EncoderChannel("c1"),
        SpeedChannel("c2"),
    ],
)
def test_every_source_tells_the_same_speed(source: SpeedSource) -> None:
    recording = with_source(source, np.sin(2 * np.pi * THETA), THETA % 1 * 360, SPEED * 60)
    angle = find_shaft_angle(recording)
    inside = (angle.start_s + 0.1 < T) & (angle.end_s - 0.1 > T)
    assert np.abs(angle.speed_rpm_at(T[inside]) / 60 / SPEED[inside] - 1).max() < 0.01


def test_speed_of_another_shaft_is_converted() -> None:
    rig = Rig(
        shafts=(Shaft("in"), Shaft("out")),
        pairs=(GearPair("p", "in", "out", 20, 50),),
        operating_point=OperatingPoint("in", 3000.0),
    )
    angle = find_shaft_angle(with_source(ConstantSpeed(1200.0, "out"), rig=rig))
    assert angle.shaft == "in"
    assert angle.mean_speed_rpm == pytest.approx(3000.0)
    assert "converted from shaft 'out'" in angle.notes[-1]


def test_the_rigs_source_counts_where_the_recording_has_none() -> None:
    rig = Rig(shafts=(Shaft("in"),), speed=ConstantSpeed(900.0, "in"))
    assert find_shaft_angle(with_source(None), rig).mean_speed_rpm == pytest.approx(900.0)


def test_refusals_and_malformed_sources() -> None:
    with pytest.raises(RefusalError, match="at rest"):
        find_shaft_angle(with_source(ConstantSpeed(0.0)))
    with pytest.raises(RefusalError, match="no speed source"):
        find_shaft_angle(with_source(None))
    with pytest.raises(InputError, match="c9"):
        find_shaft_angle(with_source(SpeedChannel("c9")))
    with pytest.raises(InputError, match="only one pulse"):
        find_shaft_angle(with_source(PulseTimes(np.array([1.0]))))
    one_pulse = np.where(np.abs(T - 2) < 0.05, 5.0, 0.0)
    with pytest.raises(InputError, match="1 pulse"):
        find_shaft_angle(with_source(TachometerChannel("c0"), one_pulse))
    unknown = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 20, None),))
    with pytest.raises(InputError, match="ratio"):
        find_shaft_angle(with_source(ConstantSpeed(1200.0, "out"), rig=unknown))


def test_the_part_between_two_times_is_the_same_angle() -> None:
    whole = constant_speed_angle(600.0, 10.0).of_shaft("x", 1.5)
    part = whole.between(2.0, 3.5)
    t = np.linspace(2.0, 3.5, 50)
    assert part.n_revolutions == pytest.approx(22.5)
    assert part.revolutions_at(t) == pytest.approx(whole.revolutions_at(t))
    assert whole.between(-5.0, 100.0) is whole
    with pytest.raises(RefusalError, match="known from 0 to 10 s"):
        whole.between(20.0, 30.0)
