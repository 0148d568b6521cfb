"""Effects on bearings: which bearing, how long a defect may be, one defect per bearing."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.rig import Bearing
from sims.effects import effect, with_bearing
from sims.machine import Machine
from tests.sims.machines import spur_pair_machine


def apply(machine: Machine, name: str, severity: float, **options: float | str) -> Machine:
    return effect(name).apply(machine, severity, options, np.random.default_rng(0))


@pytest.mark.parametrize("race", ["outer", "inner"])
def test_a_defect_lies_on_its_race_of_the_chosen_bearing(race: str) -> None:
    name = f"bearing_{race}_race"
    machine = apply(spur_pair_machine(), name, 1.5, bearing="bearing 3", angle_deg=20.0, slip_percent=2.0)
    defects = [b.defect for b in machine.bearings]
    assert [d is not None for d in defects] == [False, False, True, False]
    defect = defects[2]
    assert defect is not None
    assert (defect.race, defect.length_mm, defect.angle_deg, defect.slip) == (race, 1.5, 20.0, 0.02)
    assert apply(spur_pair_machine(), name, 1.5).bearings[0].defect is not None  # the first where none is named


def test_one_defect_per_bearing() -> None:
    machine = apply(spur_pair_machine(), "bearing_outer_race", 1.0, bearing="bearing 2")
    with pytest.raises(InputError, match="'bearing 2' already has a defect on its outer race"):
        apply(machine, "bearing_inner_race", 1.0, bearing="bearing 2")
    assert apply(machine, "bearing_inner_race", 1.0, bearing="bearing 1").bearings[0].defect is not None


def test_a_bearing_that_is_not_there() -> None:
    with pytest.raises(InputError, match=r"no bearing 'baring 1'.*did you mean bearing 1"):
        apply(spur_pair_machine(), "bearing_clearance", 10.0, bearing="baring 1")


def test_spacing_of_the_elements_on_either_race() -> None:
    support = spur_pair_machine().bearings[0]
    assert support.element_spacing_mm("outer") == pytest.approx(pi * 46.98 / 9)
    assert support.element_spacing_mm("inner") == pytest.approx(pi * 31.10 / 9)


def test_a_defect_is_no_longer_than_the_spacing() -> None:
    small = Bearing("bearing 1", "input", 16, 2.5, 18.0)
    machine = with_bearing(spur_pair_machine(), 0, bearing=small)
    with pytest.raises(InputError, match=r"inner race of 'bearing 1' is 3.5 mm \(allowed: 0 to 3.04342 mm\)"):
        apply(machine, "bearing_inner_race", 3.5)
    assert apply(machine, "bearing_outer_race", 3.5).bearings[0].defect is not None


@pytest.mark.parametrize("name", ["bearing_outer_race", "bearing_inner_race", "bearing_clearance"])
def test_a_bearing_without_geometry_is_refused(name: str) -> None:
    machine = with_bearing(spur_pair_machine(), 0, bearing=Bearing("bearing 1", "input"))
    with pytest.raises(InputError, match="give the bearing's geometry"):
        apply(machine, name, 1.0)


def test_clearance_adds() -> None:
    machine = spur_pair_machine()
    loose = replace(machine, bearings=tuple(replace(b, clearance_um=5.0) for b in machine.bearings))
    changed = apply(loose, "bearing_clearance", 30.0, bearing="bearing 4")
    assert [b.clearance_um for b in changed.bearings] == [5.0, 5.0, 5.0, 35.0]
