"""What the effects on one gear share: which gear, which tooth, and where its faults are kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gearsig.checks import within
from gearsig.errors import InputError
from sims.effects.effect import OptionValue
from sims.machine import Machine
from sims.mesh import GearGeometry, RootCrack, ToothChip, ToothSpall

GEARS = ("driver", "driven")


def gear_index(options: Mapping[str, OptionValue], option: str = "gear") -> int:
    """0 for the driver, 1 for the driven side."""
    return GEARS.index(str(options[option]))


def gear_geometry(machine: Machine, index: int) -> GearGeometry:
    """Geometry of the driver (0) or the driven gear (1)."""
    return (machine.mesh.pair.driver, machine.mesh.pair.driven)[index]


def tooth_number(machine: Machine, options: Mapping[str, OptionValue]) -> int:
    """Return the chosen tooth, checked against the number of teeth; people count from 1, the model from 0."""
    index = gear_index(options)
    teeth = gear_geometry(machine, index).teeth
    return int(within(float(options["tooth"]), f"tooth of the {GEARS[index]} gear", 1, teeth)) - 1


def part_of_width_mm(machine: Machine, options: Mapping[str, OptionValue]) -> float | None:
    """Return the width that `width_percent` stands for, None for the whole face."""
    percent = float(options["width_percent"])
    return None if percent == 100.0 else percent / 100.0 * gear_geometry(machine, gear_index(options)).face_width_mm


def loaded_width_mm(machine: Machine, options: Mapping[str, OptionValue]) -> float:
    """Return the width that `width_percent` stands for of the face on which the teeth touch."""
    return float(options["width_percent"]) / 100.0 * machine.mesh.pair.face_width_mm


def mesh_field(machine: Machine, name: str, index: int) -> Any:
    """Return a field that the mesh has once per gear, by its name without number: `cracks`, `flank`."""
    return getattr(machine.mesh, f"{name}_{index + 1}")


def with_mesh_field(machine: Machine, name: str, index: int, value: object) -> Machine:
    """Return the machine with that field replaced."""
    fields: dict[str, Any] = {f"{name}_{index + 1}": value}
    return replace(machine, mesh=replace(machine.mesh, **fields))


def with_tooth_fault(machine: Machine, faults: str, index: int, fault: RootCrack | ToothSpall | ToothChip) -> Machine:
    """Return the machine with one more of the mesh's `faults` ("cracks", …) on a gear; a tooth has one of a kind."""
    present: tuple[RootCrack | ToothSpall | ToothChip, ...] = mesh_field(machine, faults, index)
    if any(other.tooth == fault.tooth for other in present):
        word = faults.removesuffix("s")
        raise InputError(
            f"tooth {fault.tooth + 1} of the {GEARS[index]} gear already has a {word}",
            allowed=f"one {word} per tooth",
            remedy="choose another tooth, or take away what the model's own parameters give",
        )
    return with_mesh_field(machine, faults, index, (*present, fault))
