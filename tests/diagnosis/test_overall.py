"""Zones of ISO 20816-3: given where the rig file says what the machine is, with the reason where they do not apply."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Outcome, analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, MachineSize, Rig, Shaft
from tests.diagnosis.machines import codes, finding

FS_HZ = 5120.0
MOTOR = Rig(
    shafts=(Shaft("motor"),), speed=ConstantSpeed(1480.0), machine=MachineSize(shaft_height_mm=225.0, mounting="rigid")
)


def motor(velocity_mm_per_s: float, rig: Rig = MOTOR, unit: str = "m/s^2") -> Recording:
    t = np.arange(round(4 * FS_HZ)) / FS_HZ
    hertz = 1480.0 / 60
    x = 2 * np.pi * hertz * 1e-3 * velocity_mm_per_s * np.sqrt(2) * np.cos(2 * np.pi * hertz * t)
    x += 0.01 * np.random.default_rng(0).standard_normal(len(t))
    return Recording(x[None, :], FS_HZ, (Channel("a1", "acceleration", unit),), rig=rig)


@pytest.mark.parametrize(("velocity", "zone"), [(1.0, "A"), (2.0, "B"), (4.0, "C"), (6.0, "D")])
def test_zone(velocity: float, zone: str) -> None:
    analysis = analyze(motor(velocity))
    stated = finding(analysis, "vibration-zone")
    assert (stated.title in analysis.verdict) is (zone in "CD")
    assert f"zone {zone} of ISO 20816-3" in stated.title
    assert stated.strength is not None
    assert stated.strength.value == pytest.approx(velocity, rel=0.01)


@pytest.mark.parametrize(
    ("machine", "speed_rpm", "unit"),
    [
        (MachineSize(), 1480.0, "m/s^2"),
        (MachineSize(power_kw=1.5, mounting="rigid"), 1480.0, "m/s^2"),
        (MachineSize(power_kw=55.0), 1480.0, "m/s^2"),
        (MachineSize(power_kw=55.0, mounting="rigid"), 60.0, "m/s^2"),
        (MachineSize(power_kw=55.0, mounting="rigid"), 1480.0, ""),
    ],
)
def test_not_applicable(machine: MachineSize, speed_rpm: float, unit: str) -> None:
    rig = replace(MOTOR, machine=machine, speed=ConstantSpeed(speed_rpm))
    said = codes(analyze(motor(3.0, rig, unit)))
    assert "vibration-zone-not-applicable" in said
    assert "vibration-zone" not in said


@pytest.mark.parametrize(("order", "said"), [(1.0, "1 × shaft motor"), (2.0, "2 × shaft motor"), (3.7, "")])
def test_what_makes_most_of_the_velocity_is_said(order: float, said: str) -> None:
    at_once = motor(6.0)
    t = np.arange(at_once.n_samples) / FS_HZ
    hertz = order * 1480.0 / 60
    x = 2 * np.pi * hertz * 8e-3 * np.sqrt(2) * np.cos(2 * np.pi * hertz * t) + 0.01 * np.random.default_rng(0).normal(
        size=len(t)
    )
    stated = finding(analyze(replace(at_once, samples=x[None, :])), "vibration-zone")
    assert (f"100 % of its power is at {said}." in stated.title) is bool(said)
    assert any(
        "resonance can do that" in text or "a motor's field can do that" in text for text in stated.evidence
    ) is (bool(said))


def test_no_single_source_is_named_where_two_share_the_velocity() -> None:
    both = motor(6.0)
    t = np.arange(both.n_samples) / FS_HZ
    hertz = 2 * 1480.0 / 60
    x = both.samples + 2 * np.pi * hertz * 6e-3 * np.sqrt(2) * np.cos(2 * np.pi * hertz * t)
    assert "of its power" not in finding(analyze(replace(both, samples=x)), "vibration-zone").title


def test_of_machines_that_are_not_described_only_what_makes_most_of_it_is_said() -> None:
    for mm_per_s, loud in ((4.0, ""), (9.0, ", which is zone D of ISO 20816-3 for some machines")):
        analysis = analyze(motor(mm_per_s, replace(MOTOR, machine=None)))
        assert not any("vibration-zone" in code for code in codes(analysis))
        stated = finding(analysis, "overall-velocity")
        assert stated.title == (
            f"Overall vibration {mm_per_s:g} mm/s rms in channel a1, 10 to 1000 Hz{loud}; "
            "100 % of its power is at 1 × shaft motor."
        )
        assert (stated.title in analysis.verdict) is bool(loud)


def test_a_machine_in_zone_d_is_suspicious_where_the_rest_cannot_be_told() -> None:
    short = motor(9.0).between(0.0, 1.0)
    analysis = analyze(replace(short, rig=replace(MOTOR, bearings=(Bearing("front", "motor", 9, 7.94, 39.04),))))
    assert "bearings-undecided" in codes(analysis)
    assert analysis.outcome is Outcome.SUSPICION
    assert analysis.verdict.startswith("Overall vibration 9 mm/s rms in channel a1: zone D")
    assert "cannot be told" in analysis.verdict


@pytest.mark.parametrize(
    ("size", "group"),
    [({"power_kw": 500}, 1), ({"power_kw": 300}, 2), ({"power_kw": 15}, None), ({"shaft_height_mm": 315}, 1)],
)
def test_groups(size: dict[str, float], group: int | None) -> None:
    assert MachineSize(**size).group == group


def test_no_machine_in_zone_d_is_said_to_have_no_fault() -> None:
    rig = replace(MOTOR, bearings=(Bearing("front", "motor", bearing="6205"),))
    analysis = analyze(motor(6.0, rig))
    assert analysis.verdict.startswith(finding(analysis, "vibration-zone").title)
    assert "No fault" not in analysis.verdict
    assert next(text for text in finding(analysis, "vibration-zone").evidence if "unbalance" in text.lower()) in (
        analysis.verdict
    )
