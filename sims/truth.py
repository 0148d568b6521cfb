"""What was put into a simulation, as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sims.effects import EffectSetting, effect
from sims.machine.operation import Course, Operation
from sims.values import Values


def truth_of(
    model: str, preset_name: str, values: Values, settings: Sequence[EffectSetting], operation: Operation
) -> dict[str, Any]:
    """Return what was put into a simulation as plain values, for `Recording.truth`."""
    return {
        "model": model,
        "preset": preset_name,
        "parameters": dict(values),
        "effects": [
            {"name": s.name, "severity": s.severity, "unit": effect(s.name).severity.unit, "options": dict(s.options)}
            for s in settings
        ],
        "operation": {"speed_rpm": _plain(operation.speed_rpm), "torque_nm": _plain(operation.torque_nm)},
    }


def _plain(course: Course) -> dict[str, list[float]]:
    return {"times_s": course.times_s.tolist(), "values": course.values.tolist()}
