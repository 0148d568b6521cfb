"""Lines of the mains: named as such where the speed says that no shaft makes them."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Analysis, Kind, analyze
from gearsig.prepared import magnetic_pull_near
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, Rig, Shaft
from tests.diagnosis.machines import codes, finding

RATE_HZ = 2048.0


def with_lines(hertz: float, *, seconds: float = 10.0, speed: ConstantSpeed | None = None) -> Analysis:
    """Analyse three multiples of a frequency in noise, and where a speed is given a shaft that turns at it."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    x = 0.1 * np.random.default_rng(0).normal(size=len(t))
    x += sum(np.cos(2 * np.pi * k * hertz * t) / k for k in (1, 2, 3))
    recording = Recording(x[None], RATE_HZ, (Channel("a1"),))
    if speed is not None:
        x += np.cos(2 * np.pi * speed.speed_rpm / 60 * t)
        recording = replace(recording, samples=x[None], speed=speed, rig=Rig(shafts=(Shaft("in"),)))
    return analyze(recording)


@pytest.mark.parametrize(("hertz", "text"), [(60.044, "60 Hz mains, or a shaft at 3603 rpm"), (50.0, "3000 rpm")])
def test_without_a_speed_a_shaft_may_be_what_looks_like_the_mains(hertz: float, text: str) -> None:
    found = finding(with_lines(hertz), "mains-hum")
    assert text in found.title
    assert found.confidence <= 0.5
    assert "Give the speed" in found.surer


def test_with_a_speed_that_explains_them_not_they_are_the_mains() -> None:
    found = finding(with_lines(50.02, speed=ConstantSpeed(1320.0, "in")), "mains-hum")
    assert found.title == "Lines of the 50 Hz mains stand in channel a1."
    assert found.kind is Kind.NOTICE
    assert found.confidence == pytest.approx(0.8)


@pytest.mark.parametrize(("hertz", "seconds"), [(60.12, 2.0), (49.9, 10.0), (50.4, 3.0)])
def test_a_line_beyond_what_supplies_wander_is_not_the_mains(hertz: float, seconds: float) -> None:
    assert "mains-hum" not in codes(with_lines(hertz, seconds=seconds))


@pytest.mark.parametrize(
    ("hertz", "pull"),
    [(100.1, (50.0, 100.0)), (719.0, (60.0, 720.0)), (110.0, None), (2885.6, None), (5497.1, None)],
)
def test_only_the_first_multiples_of_twice_a_supply_s_frequency_are_its_pull(
    hertz: float, pull: tuple[float, float] | None
) -> None:
    """At 2885.6 Hz the tolerance and both supplies cover a fifth of all places."""
    assert magnetic_pull_near(hertz) == pull
