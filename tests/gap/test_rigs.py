"""What is diagnosed of a machine: one pair of several, gears of which only the teeth are known, and their load."""

from __future__ import annotations

from dataclasses import replace
from math import cos, isnan, radians

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.gap import feature_values, gear_frame, reduce_recording, tooth_load_n_per_mm, twin_rig, with_stage
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Shaft
from sims.registry import gap_simulator
from tests.gap.synthetic import RIG, TEETH, record

SECOND = GearPair("second", "out", "slow", 19, 61, 3.0)
TRAIN = replace(
    RIG,
    shafts=(*RIG.shafts, Shaft("slow")),
    pairs=(SECOND, *RIG.pairs),
    bearings=(*RIG.bearings, Bearing("b3", "slow", 8, 9.5, 46.0)),
    operating_point=OperatingPoint("slow", 100.0, torque_nm=400.0),
)


def test_of_several_pairs_one_must_be_asked_for() -> None:
    with pytest.raises(RefusalError, match="second, stage"):
        with_stage(TRAIN)
    assert with_stage(RIG) is RIG
    assert with_stage(TRAIN, "stage").pairs[0] == RIG.pairs[0]
    assert with_stage(TRAIN, "in").pairs[0] == RIG.pairs[0]
    assert with_stage(TRAIN, "slow").pairs[0] == SECOND
    for wrong in ("third", "out"):
        with pytest.raises(InputError) as error:
            with_stage(TRAIN, wrong)
        assert error.value.where == "stage"


def test_the_twin_has_one_pair_at_its_own_speed_and_torque() -> None:
    train = with_stage(TRAIN, "stage")
    alone, notes = twin_rig(train)
    assert [pair.name for pair in alone.pairs] == ["stage"]
    assert [bearing.name for bearing in alone.bearings] == ["b1", "b2"]
    ratio = (37 / 23) * (61 / 19)
    assert alone.nominal_speed_rpm("in") == pytest.approx(100.0 * ratio)
    assert alone.nominal_torque_nm("in") == pytest.approx(400.0 / ratio)
    assert len(notes) == 1
    gap_simulator("cracked").twin_of(alone)
    assert twin_rig(RIG) == (RIG, [])


def test_teeth_alone_are_enough_and_a_stated_torque_says_how_large_the_gears_are() -> None:
    bare = Rig(shafts=RIG.shafts, pairs=(GearPair("stage", "in", "out", *TEETH),))
    heavy = replace(bare, operating_point=OperatingPoint("in", torque_nm=2000.0))
    light = replace(bare, operating_point=OperatingPoint("in", torque_nm=2.0))
    modules = []
    for rig in (light, bare, heavy):
        alone, notes = twin_rig(rig)
        assert len(notes) == 1
        assert "module_mm" in alone.assumed
        gap_simulator("cracked").twin_of(alone)
        modules.append(alone.pairs[0].module_mm)
    assert modules == sorted(modules)
    assert modules[2] / modules[0] == pytest.approx(10.0, rel=0.1)  # the torque grows with the cube of the module


@pytest.mark.slow
def test_lines_of_the_other_pair_are_background() -> None:
    train = with_stage(TRAIN, "stage")
    mesh = 19 * TEETH[0] / TEETH[1]
    lines = gear_frame(train).background
    assert gear_frame(RIG).background == ()
    slow = mesh / 61
    for order in (mesh, 3 * mesh, mesh + 2 * slow, mesh - TEETH[0] / TEETH[1], slow):
        assert min(abs(order - line) for line in lines) < 1e-6

    def heard(_time: np.ndarray, revolutions: np.ndarray) -> np.ndarray:
        swing = 1.0 + 0.3 * np.cos(2 * np.pi * slow * revolutions)
        return sum(swing * 2.0 * np.cos(2 * np.pi * k * mesh * revolutions) for k in (1, 2, 3))

    def features(recording, rig):
        names, values = feature_values(reduce_recording(recording.with_rig(rig), rig))
        return dict(zip(names, values, strict=True))

    quiet, loud = features(record(), RIG), record(heard)
    as_one, as_stage = features(loud, RIG), features(loud, train)
    changed = [name for name in quiet if abs(as_one[name] - quiet[name]) > 6.0]
    assert {"line.strange", "tooth.driven.level"} <= set(changed)
    for name in [name for name in changed if not name.startswith("sideband.driven")]:  # 38 on the shaft of 37 teeth
        assert abs(as_stage[name] - quiet[name]) < 2.0 + 0.1 * abs(as_one[name] - quiet[name]), name


# --------------------
# The load of the teeth: force over width, unknown where the rig does not say.
# --------------------


PAIR = GearPair("stage", "in", "out", 50, 50, 3.0, 20.0, 20.0)


def test_force_on_the_base_circle_over_the_face_width() -> None:
    assert tooth_load_n_per_mm(PAIR, 340.0) == pytest.approx(340.0 / (0.075 * cos(radians(20.0))) / 20.0)
    assert tooth_load_n_per_mm(PAIR, -340.0) == tooth_load_n_per_mm(PAIR, 340.0)


@pytest.mark.parametrize("missing", ["driver_teeth", "module_mm", "face_width_mm"])
def test_what_the_rig_does_not_say_is_not_guessed(missing: str) -> None:
    assert isnan(tooth_load_n_per_mm(replace(PAIR, **{missing: None}), 340.0))
