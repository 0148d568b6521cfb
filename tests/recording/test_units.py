"""Units of a file against those of the rig file."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, read_recording
from gearsig.rig import QUANTITIES, SI_FACTORS, PulseTimes, Rig, Sensor, TachometerChannel, si_factor


def recording(unit: str) -> Recording:
    return Recording(np.ones((1, 8)), 100.0, (Channel("a1", "acceleration", unit),))


def rig(**sensor: float | str) -> Rig:
    return Rig(name="rig", sensors=(Sensor("a1", "acceleration", "m/s^2", **sensor),))  # type: ignore[arg-type]  # by name


def test_another_unit_without_a_scale_is_told() -> None:
    (warning,) = recording("g").with_rig(rig()).warnings
    assert "the file says g" in warning
    assert "m/s^2 without a scale" in warning


@pytest.mark.parametrize("unit", ["m/s^2", "m/s²", "m/s2", "m/s/s", "M/S**2", ""])
def test_the_same_unit_or_none_is_no_contradiction(unit: str) -> None:
    assert recording(unit).with_rig(rig()).warnings == ()


@pytest.mark.parametrize(("sensor", "is_said"), [("a1", False), ("a11", True), ("tacho", False)])
def test_a_sensor_of_no_channel_beside_a_channel_of_no_sensor_is_told(sensor: str, *, is_said: bool) -> None:
    """Of a1 and of the tachometer, which [speed] names, there is nothing to say; a11 is misspelt."""
    described = Rig(sensors=(Sensor(sensor),), speed=TachometerChannel("tacho"))
    whole = Recording(np.ones((2, 8)), 100.0, (Channel("a1"), Channel("tacho")))
    warnings = whole.with_rig(described).warnings
    assert [("'a11'" in text, "'a1'" in text) for text in warnings] == [(True, True)] * is_said


def test_a_scale_converts_and_says_nothing() -> None:
    found = recording("g").with_rig(rig(scale=9.81))
    assert found.warnings == ()
    assert found.values("a1") == pytest.approx(9.81 * np.ones(8))


def test_a_part_keeps_its_pulses_in_its_own_time() -> None:
    whole = Recording(np.arange(10.0)[None], 10.0, (Channel("a"),), PulseTimes(np.array([0.1, 0.35, 0.6, 0.85])))
    part = whole.between(0.3, 0.7)
    assert part.values("a") == pytest.approx([3.0, 4.0, 5.0, 6.0])
    assert isinstance(part.speed, PulseTimes)
    assert part.speed.times_s == pytest.approx([0.05, 0.3])
    with pytest.raises(InputError, match="there is no sample from 2 to 3 s"):
        whole.between(2.0, 3.0)


def test_a_recording_is_a_table_with_times():
    frame = Recording(np.arange(8.0).reshape(2, 4), 4.0, (Channel("a"), Channel("b"))).to_frame()
    assert list(frame.columns) == ["a", "b"]
    assert frame["b"].loc[0.5] == 6.0


def test_sensors_are_applied_once_whatever_else_of_the_rig_changes() -> None:
    scaled = recording("g").with_rig(rig(scale=9.81))
    for other in (replace(rig(scale=9.81), name="other"), Rig(name="other")):
        found = scaled.with_rig(other)
        assert found.values("a1") == pytest.approx(9.81 * np.ones(8))
        assert (found.rig.name, found.rig.sensors) == ("other", rig(scale=9.81).sensors)
    with pytest.raises(InputError, match="other sensors"):
        scaled.with_rig(rig(scale=2.0))


# Every spelling that a reader knows, with the unit in full.
SPELLINGS = {
    "acceleration": ("m/s^2", "m/s2", "m/s²", "m/s**2", "ms-2", "mm/s^2", "mm/s²", "g", "gn", "g_n", "mg", "G", "G-s"),
    "velocity": ("m/s", "mm/s", "in/s", "ips", "IPS"),
    "displacement": ("mm", "µm", "μm", "um", "mil"),
    "sound_pressure": ("Pa",),
    "force": ("N", "kN"),
    "torque": ("Nm", "N*m", "N·m", "N m"),
    "rotational_speed": ("rpm", "r/min", "tr/min", "u/min", "1/min", "min^-1", "rad/s", "deg/s", "rev/s"),
    "angle": ("rad", "mrad", "deg", "°", "rev"),
    "angular_acceleration": ("rad/s^2", "rad/s2", "rad/s²", "deg/s²"),
    "temperature": ("°C", "degC"),
    "voltage": ("V", "mV"),
    "current": ("A", "mA"),
}


@pytest.mark.parametrize(("quantity", "unit"), [(q, unit) for q, units in SPELLINGS.items() for unit in units])
def test_every_unit_that_a_reader_knows_has_its_factor(quantity: str, unit: str, tmp_path: Path) -> None:
    rows = "".join(f"{i / 100},{i % 7}\n" for i in range(100))
    (tmp_path / "x.csv").write_text(f"time (s),x ({unit})\n{rows}", encoding="utf-8")
    (channel,) = read_recording(tmp_path / "x.csv").channels
    assert (channel.quantity, channel.unit) == (quantity, unit)
    assert si_factor(quantity, unit) is not None


@pytest.mark.parametrize(
    ("unit", "sensor", "said"),
    [
        ("furlong", {}, "'furlong' of channel 'a1'"),
        ("mm", {"quantity": "acceleration"}, "'mm' of channel 'a1' (acceleration)"),
        ("furlong", {"quantity": "displacement", "unit": "m", "scale": 201.168}, ""),
        ("counts", {"quantity": "encoder"}, ""),
    ],
)
def test_a_unit_that_is_not_known_is_said(unit: str, sensor: dict[str, Any], said: str, tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(f"time [s],a1 [{unit}]\n" + "".join(f"{i / 100},{i % 7}\n" for i in range(100)))
    recording = read_recording(tmp_path / "x.csv", rig=Rig(sensors=(Sensor("a1", **sensor),)))
    told = [text for text in recording.warnings if text.startswith("not known as a unit: ")]
    assert [text.partition(": ")[2].partition(";")[0] for text in told] == ([said] if said else [])


def test_every_quantity_with_a_unit_has_its_units() -> None:
    assert set(SI_FACTORS) == set(QUANTITIES) - {"tachometer", "encoder", "unknown"}
    assert set(SPELLINGS) == set(SI_FACTORS) - {"transmission_error"}


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [
        ("acceleration", "mg", 9.80665e-3),
        ("acceleration", "gn", 9.80665),
        ("velocity", "ips", 0.0254),
        ("displacement", "mil", 25.4e-6),
        ("transmission_error", "um", 1e-6),
        ("rotational_speed", "1/min", 2 * pi / 60),
    ],
)
def test_factors_are_those_of_the_units(quantity: str, unit: str, factor: float) -> None:
    assert si_factor(quantity, unit) == pytest.approx(factor)
