"""The load of the teeth: force over width, unknown where the rig does not say."""

from __future__ import annotations

from dataclasses import replace
from math import cos, isnan, radians

import pytest

from gearsig.gap import tooth_load_n_per_mm
from gearsig.rig import GearPair

PAIR = GearPair("stage", "in", "out", 50, 50, 3.0, 20.0, 20.0)


def test_force_on_the_base_circle_over_the_face_width() -> None:
    assert tooth_load_n_per_mm(PAIR, 340.0) == pytest.approx(340.0 / (0.075 * cos(radians(20.0))) / 20.0)
    assert tooth_load_n_per_mm(PAIR, -340.0) == tooth_load_n_per_mm(PAIR, 340.0)


@pytest.mark.parametrize("missing", ["driver_teeth", "module_mm", "face_width_mm"])
def test_what_the_rig_does_not_say_is_not_guessed(missing: str) -> None:
    assert isnan(tooth_load_n_per_mm(replace(PAIR, **{missing: None}), 340.0))
