"""What the effects on a bearing share: which one, and a defect on one of its races."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import atan2, cos, degrees, pi, radians
from typing import Any

import numpy as np

from gearsig.checks import within
from gearsig.errors import InputError
from sims.effects._catalogue import replaced_item
from sims.effects._effect import Option, OptionValue
from sims.machine import BearingSupport, Machine, RaceDefect, bearing_index
from sims.measure import MeasuredChannel
from sims.mesh import GearGeometry, RootCrack, ToothChip, ToothSpall

BEARING_OPTION = Option("bearing", "", "name of the bearing; empty: the first of the driver's shaft")
RACE_OPTIONS = (
    BEARING_OPTION,
    Option("angle_deg", 0.0, "where the defect lies, see the race", "deg", -360.0, 360.0),
    Option("jitter_percent", 1.0, "scatter of the rolling elements' places, of their spacing", "%", 0.0, 10.0),
    Option("slip_percent", 1.0, "part of the cage's turning that is lost", "%", 0.0, 5.0),
)


def chosen_bearing(machine: Machine, options: Mapping[str, OptionValue]) -> int:
    """Place of the chosen bearing in the machine."""
    name = str(options["bearing"])
    return bearing_index(machine, name) if name else 0


def with_bearing(machine: Machine, index: int, **changes: object) -> Machine:
    """Return the machine with fields of one bearing changed."""
    bearings = replaced_item(machine.bearings, index, **changes)
    return replace(machine, bearings=bearings)


def with_race_defect(machine: Machine, race: str, length_mm: float, options: Mapping[str, OptionValue]) -> Machine:
    """Return the machine with a defect on a race, which must be free of one and longer than the defect."""
    index = chosen_bearing(machine, options)
    support = machine.bearings[index]
    name = support.bearing.name
    if support.defect is not None:
        raise InputError(
            f"{name!r} already has a defect on its {support.defect.race} race",
            where=f"bearing_{race}_race",
            allowed="one defect per bearing",
            remedy="choose another one with the option bearing",
        )
    spacing = element_spacing_mm(support, race)
    if spacing is not None:
        within(length_mm, f"length_mm of a defect on the {race} race of {name!r}", 0.0, spacing, "mm")
    defect = RaceDefect(
        race,
        length_mm,
        float(options["angle_deg"]),
        float(options["jitter_percent"]) / 100.0,
        float(options["slip_percent"]) / 100.0,
    )
    return with_bearing(machine, index, defect=defect)


def element_spacing_mm(support: BearingSupport, race: str) -> float | None:
    """Distance between rolling elements along a race, π (D ± d cos α)/n; a longer defect would hold two at once.

    None if the bearing's geometry is not known.
    """
    b = support.bearing
    if b.n_rolling_elements is None or b.pitch_diameter_mm is None or b.rolling_element_diameter_mm is None:
        return None
    across = b.rolling_element_diameter_mm * cos(radians(b.contact_angle_deg))
    diameter = b.pitch_diameter_mm + across if race == "outer" else b.pitch_diameter_mm - across
    return pi * diameter / b.n_rolling_elements


# --------------------
# What the effects on the measurement chain share: the same change to each acceleration channel.
# --------------------


def with_each_channel(machine: Machine, change: Callable[[MeasuredChannel], MeasuredChannel]) -> Machine:
    """Return the machine with every acceleration channel changed."""
    channels = tuple(change(channel) for channel in machine.chain.channels)
    return replace(machine, chain=replace(machine.chain, channels=channels))


# --------------------
# What the effects on one gear share: which gear, which tooth, and where its faults are kept.
# --------------------


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


# --------------------
# Sum of two vectors that turn with a shaft: run-outs, unbalances.
# --------------------


ANGLE_OPTION = Option(
    "angle_deg", None, "where it lies, from the middle of tooth 1 the way the gear turns", "deg", -360.0, 360.0
)
"""Drawn where it is not given."""


def angle_or_drawn_deg(options: Mapping[str, OptionValue], rng: np.random.Generator) -> float:
    """Return `angle_deg`, or one drawn evenly from the circle."""
    drawn = float(rng.uniform(0.0, 360.0))
    return float(options.get("angle_deg", drawn))


def vector_sum(length: float, angle_deg: float, other_length: float, other_angle_deg: float) -> tuple[float, float]:
    """Length and angle of the sum; the angle from 0 to 360°.

    Examples
    --------
    >>> [round(x, 9) for x in vector_sum(3.0, 0.0, 4.0, 90.0)]
    [5.0, 53.130102354]
    """
    total = _vector(length, angle_deg) + _vector(other_length, other_angle_deg)
    return abs(total), degrees(atan2(total.imag, total.real)) % 360.0


def _vector(length: float, angle_deg: float) -> complex:
    return complex(length * np.exp(1j * radians(angle_deg)))
