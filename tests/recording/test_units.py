"""Units of a file against those of the rig file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.rig import PulseTimes, Rig, Sensor


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
    with pytest.raises(InputError, match="no sample lies from 2 to 3 s"):
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
