"""Overall velocity against closed forms, and the zones of ISO 20816-3 against its table."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.indicators import overall_indicators, overall_velocity_mm_per_s, vibration_zone
from gearsig.recording import Channel

FS_HZ = 6400.0
T = np.arange(round(5 * FS_HZ)) / FS_HZ
ACCELERATION = Channel("a1", "acceleration", "m/s^2")


def tone(hertz: float, velocity_mm_per_s: float) -> np.ndarray:
    """Acceleration of a sine of that rms velocity, in m/s²."""
    return 2 * np.pi * hertz * 1e-3 * velocity_mm_per_s * np.sqrt(2) * np.cos(2 * np.pi * hertz * T + 0.3)


@pytest.mark.parametrize("hertz", [12.0, 25.3, 160.0, 990.0])
@pytest.mark.parametrize(
    ("unit", "factor"), [("m/s**2", 1.0), ("g", 1 / 9.80665), ("mg", 1e3 / 9.80665), ("mm/s^2", 1e3)]
)
def test_of_a_tone(hertz: float, unit: str, factor: float) -> None:
    velocity = overall_velocity_mm_per_s(factor * tone(hertz, 3.0), FS_HZ, Channel("a1", "acceleration", unit))
    assert velocity == pytest.approx(3.0, rel=2e-3)


def test_of_a_velocity_and_of_what_lies_outside_the_band() -> None:
    velocity = 2.0 * np.sqrt(2) * np.sin(2 * np.pi * 50.0 * T)
    channel = Channel("v1", "velocity", "mm/s")
    assert overall_velocity_mm_per_s(velocity, FS_HZ, channel) == pytest.approx(2.0, rel=2e-3)
    inches = Channel("v1", "velocity", "in/s")
    assert overall_velocity_mm_per_s(velocity / 25.4, FS_HZ, inches) == pytest.approx(2.0, rel=2e-3)
    outside = tone(3.0, 50.0) + tone(2000.0, 50.0) + 7.0  # slow sway, a mesh, the sensor's offset
    assert overall_velocity_mm_per_s(outside, FS_HZ, ACCELERATION) < 0.05


def test_powers_add() -> None:
    both = overall_velocity_mm_per_s(tone(30.0, 3.0) + tone(240.0, 4.0), FS_HZ, ACCELERATION)
    assert both == pytest.approx(5.0, rel=2e-3)


def test_of_noise_against_its_density() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(round(60 * FS_HZ))  # a density of 2/fs (m/s²)²/Hz
    expected = np.sqrt(2 / FS_HZ * (1 / 10 - 1 / 1000) / (2 * np.pi) ** 2)
    assert overall_velocity_mm_per_s(x, FS_HZ, ACCELERATION) == pytest.approx(1e3 * expected, rel=0.1)


@pytest.mark.parametrize(
    ("channel", "rate_hz", "n"),
    [
        (Channel("a1", "acceleration", ""), FS_HZ, 32000),
        (Channel("m1", "sound_pressure", "Pa"), FS_HZ, 32000),
        (ACCELERATION, 2000.0, 32000),
        (ACCELERATION, FS_HZ, 6000),
    ],
)
def test_what_gives_none(channel: Channel, rate_hz: float, n: int) -> None:
    with pytest.raises(InputError):
        overall_velocity_mm_per_s(np.ones(n), rate_hz, channel)
    assert "overall velocity" not in {i.name for i in overall_indicators(np.ones(n), rate_hz, channel)}


def test_slow_machines_are_judged_from_2_hz() -> None:
    slow, fast = (
        next(i for i in overall_indicators(tone(5.0, 3.0), FS_HZ, ACCELERATION, rpm) if i.name == "overall velocity")
        for rpm in (300.0, 1500.0)
    )
    assert slow.value == pytest.approx(3.0, rel=2e-3)
    assert fast.value < 0.1


def test_high_frequencies_show_impacts() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(len(T))
    impacts = noise.copy()
    impacts[:: round(FS_HZ / 40)] += 20.0
    quiet, loud = (
        {i.name: i.value for i in overall_indicators(x, FS_HZ, ACCELERATION)} for x in (noise + tone(25, 100), impacts)
    )
    assert quiet["high-frequency kurtosis"] == pytest.approx(3.0, abs=0.1)
    assert loud["high-frequency kurtosis"] > 6.0
    assert loud["high-frequency crest factor"] > 1.5 * quiet["high-frequency crest factor"]


@pytest.mark.parametrize("drift", ["ramp", "decay", "hum"])
def test_a_slow_signal_whose_ends_do_not_meet_is_no_impact(drift: str) -> None:
    """A sine has the kurtosis 3/2 and the rms 1/√2, whatever slow signal, a thousand times as strong, it rides on."""
    time_s = np.arange(100_000) / FS_HZ
    slow = {"ramp": time_s / time_s[-1], "decay": np.exp(-time_s), "hum": np.sin(2 * np.pi * 50.13 * time_s + 0.3)}
    x = np.sin(2 * np.pi * 2000.0 * time_s) + 1e3 * slow[drift]
    values = {i.name: i.value for i in overall_indicators(x, FS_HZ, ACCELERATION)}
    assert values["high-frequency kurtosis"] == pytest.approx(1.5, abs=1e-3)
    assert values["high-frequency rms"] == pytest.approx(0.5**0.5, rel=1e-3)
    assert values["high-frequency crest factor"] < 3.0


@pytest.mark.parametrize(
    ("group", "mounting", "boundaries"),
    [
        (1, "rigid", (2.3, 4.5, 7.1)),
        (1, "flexible", (3.5, 7.1, 11.0)),
        (2, "rigid", (1.4, 2.8, 4.5)),
        (2, "flexible", (2.3, 4.5, 7.1)),
    ],
)
def test_zones(group: int, mounting: str, boundaries: tuple[float, ...]) -> None:
    zones = "".join(vibration_zone(factor * b, group, mounting) for b in boundaries for factor in (0.99, 1.01))
    assert zones == "ABBCCD"


def test_zones_of_other_machines() -> None:
    with pytest.raises(InputError, match="group"):
        vibration_zone(1.0, 3, "rigid")
