"""Selecting and changing parts of a machine in effects, and the option sets to try on each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import atan2, degrees, radians
from typing import Any

import numpy as np

from gearsig.checks import known_name, within
from gearsig.errors import InputError
from sims.effects._effect import MachineFacts, Option, Options, OptionValue, PlausibleRange, Scale, Severity
from sims.machine import RACE_EDGE_MM, BearingSupport, Machine, RaceDefect
from sims.measure import MeasuredChannel
from sims.mesh import GearGeometry, RootCrack, ToothChip, ToothSpall


def replaced_item(items: tuple, index: int, **changes: object) -> tuple:  # type: ignore[type-arg]  # any dataclasses
    """Return the tuple of dataclasses with fields of one item changed."""
    return tuple(replace(item, **changes) if i == index else item for i, item in enumerate(items))


# --------------------
# Bearings: which one, and a defect on one of its races.
# --------------------


BEARING_OPTION = Option("bearing", "", "name of the bearing; empty: the first of the driver's shaft")
RACE_OPTIONS = (
    BEARING_OPTION,
    Option("angle_deg", 0.0, "angle of the defect, see the race", "deg", -360.0, 360.0),
    Option("jitter_percent", 1.0, "scatter of the rolling elements' positions over their spacing", "%", 0.0, 10.0),
    Option("slip_percent", 1.0, "part of the cage rotation that is lost", "%", 0.0, 5.0),
)


def chosen_bearing(machine: Machine, options: Options) -> int:
    """Index of the chosen bearing in the machine."""
    name = str(options["bearing"])
    names = [support.bearing.name for support in machine.bearings]
    return names.index(known_name(name, names, f"there is no bearing {name!r}")) if name else 0


def with_bearing(machine: Machine, index: int, **changes: object) -> Machine:
    """Return the machine with fields of one bearing changed."""
    bearings = replaced_item(machine.bearings, index, **changes)
    return replace(machine, bearings=bearings)


RACE_SEVERITY = Severity("length_mm", "mm", 0.0, 4.0, 0.3, "along the raceway; no longer than the elements' spacing")
RACE_SHOWS_IN = ("envelope_orders", "resonances", "broadband")


def with_race_defect(
    race: str, machine: Machine, length_mm: float, options: Options, rng: np.random.Generator
) -> Machine:
    """Return the machine with a race defect in a bearing that has none; it must not exceed the element spacing.

    Its angle is measured from the middle of the load zone on the outer race, from tooth 1 at time 0 on the inner one.
    """
    del rng  # the positions of the rolling elements are drawn by the simulator
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
    spacing = support.element_spacing_mm(race)
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


def race_range(race: str, why: str) -> PlausibleRange:
    """Plausible lengths of a race defect, relative to the rolling-element diameter."""
    return PlausibleRange(0.01, 0.15, why, _rolling_element_mm, each_bearing, _any_race, _longest_defect_mm(race))


def each_bearing(machine: MachineFacts) -> Sequence[Options]:
    """One option set per bearing of the machine, for `PlausibleRange.choices`."""
    return [{"bearing": b.name} for b in machine.bearings]


def any_bearing(machine: MachineFacts, rng: np.random.Generator) -> Options:
    """A random bearing, for `PlausibleRange.drawn`."""
    return {"bearing": str(rng.choice([b.name for b in machine.bearings]))}


def _any_race(machine: MachineFacts, rng: np.random.Generator) -> Options:
    """A random bearing with a little cage slip."""
    return {**any_bearing(machine, rng), "slip_percent": float(rng.uniform(0.0, 1.5))}


def _rolling_element_mm(machine: MachineFacts, options: Options) -> float:
    """Diameter of the chosen bearing's rolling elements."""
    return machine.bearing(options).rolling_element_diameter_mm or 1.0


def _longest_defect_mm(race: str) -> Scale:
    """80 % of the longest defect that never holds two elements at the same time, at 1 % jitter."""

    def longest(machine: MachineFacts, options: Options) -> float:
        spacing = BearingSupport(machine.bearing(options), 1.0, 1.0, 0.0).element_spacing_mm(race) or 1.0
        return 0.8 * (spacing * (1.0 - 6.0 * 0.01) - 2.0 * RACE_EDGE_MM)

    return longest


# --------------------
# Common to effects on the measurement chain: the same change to each acceleration channel.
# --------------------


def with_each_channel(machine: Machine, change: Callable[[MeasuredChannel], MeasuredChannel]) -> Machine:
    """Return the machine with every acceleration channel changed."""
    channels = tuple(change(channel) for channel in machine.chain.channels)
    return replace(machine, chain=replace(machine.chain, channels=channels))


# --------------------
# Common to effects on one gear: which gear, which tooth, and where its faults are stored.
# --------------------


GEARS = ("driver", "driven")


def gear_index(options: Options, option: str = "gear") -> int:
    """Index of the chosen side: 0 for the driver, 1 for the driven side."""
    return GEARS.index(str(options[option]))


def gear_geometry(machine: Machine, index: int) -> GearGeometry:
    """Geometry of the driver (0) or the driven gear (1)."""
    return (machine.mesh.pair.driver, machine.mesh.pair.driven)[index]


def tooth_number(machine: Machine, options: Options) -> int:
    """Return the chosen tooth, counted from 0, checked against the number of teeth; the option counts from 1."""
    index = gear_index(options)
    teeth = gear_geometry(machine, index).teeth
    return int(within(float(options["tooth"]), f"tooth of the {GEARS[index]} gear", 1, teeth)) - 1


def part_of_width_mm(machine: Machine, options: Options) -> float | None:
    """Return the width given by `width_percent` of the gear's face, None for the whole face."""
    percent = float(options["width_percent"])
    return None if percent == 100.0 else percent / 100.0 * gear_geometry(machine, gear_index(options)).face_width_mm


def loaded_width_mm(machine: Machine, options: Options) -> float:
    """Return the width given by `width_percent` of the face over which the teeth are in contact."""
    return float(options["width_percent"]) / 100.0 * machine.mesh.pair.face_width_mm


def mesh_field(machine: Machine, name: str, index: int) -> Any:
    """Return a per-gear field of the mesh, by its name without the gear number: `cracks`, `flank`."""
    return getattr(machine.mesh, f"{name}_{index + 1}")


def with_mesh_field(machine: Machine, name: str, index: int, value: object) -> Machine:
    """Return the machine with that field replaced."""
    fields: dict[str, Any] = {f"{name}_{index + 1}": value}
    return replace(machine, mesh=replace(machine.mesh, **fields))


def with_tooth_fault(machine: Machine, faults: str, index: int, fault: RootCrack | ToothSpall | ToothChip) -> Machine:
    """Return the machine with one more of the mesh's `faults` ("cracks", …) on a gear, at most one per tooth."""
    present: tuple[RootCrack | ToothSpall | ToothChip, ...] = mesh_field(machine, faults, index)
    if any(present_fault.tooth == fault.tooth for present_fault in present):
        word = faults.removesuffix("s")
        raise InputError(
            f"tooth {fault.tooth + 1} of the {GEARS[index]} gear already has a {word}",
            allowed=f"one {word} per tooth",
            remedy="choose another tooth, or remove the one given by the model's parameters",
        )
    return with_mesh_field(machine, faults, index, (*present, fault))


def either_gear(_machine: MachineFacts) -> Sequence[Options]:
    """Both gears, for `PlausibleRange.choices`."""
    return [{"gear": gear} for gear in GEARS]


def any_gear(_machine: MachineFacts, rng: np.random.Generator) -> Options:
    """A random gear, for `PlausibleRange.drawn`."""
    return {"gear": str(rng.choice(GEARS))}


def first_teeth(_machine: MachineFacts, **further: OptionValue) -> Sequence[Options]:
    """The first tooth of both gears, with further options."""
    return [{"gear": gear, "tooth": 1.0, **further} for gear in GEARS]


def any_tooth(machine: MachineFacts, rng: np.random.Generator) -> Options:
    """A random tooth of a random gear."""
    options = any_gear(machine, rng)
    return {**options, "tooth": float(rng.integers(machine.nominal.teeth[gear_index(options)]) + 1)}


def module_mm(machine: MachineFacts, _options: Options) -> float:
    """Module of the gears, for `PlausibleRange.scale`."""
    return machine.nominal.module_mm


def tolerance_of(tolerance_um: Callable[[float, float], float]) -> Scale:
    """Tolerance of the chosen gear in class 5 of ISO 1328; `tolerance_um` takes module and diameter in mm."""
    return lambda machine, options: tolerance_um(machine.nominal.module_mm, machine.diameter_mm(gear_index(options)))


# --------------------
# Sum of two vectors that rotate with a shaft: run-outs, unbalances.
# --------------------


ANGLE_OPTION = Option(
    "angle_deg", None, "its angle from the middle of tooth 1 in the direction of rotation", "deg", -360.0, 360.0
)
"""Drawn if not given."""


def angle_or_drawn_deg(options: Options, rng: np.random.Generator) -> float:
    """Return `angle_deg`, or else an angle drawn uniformly from the circle."""
    drawn = float(rng.uniform(0.0, 360.0))
    return float(options.get("angle_deg", drawn))


def vector_sum(length: float, angle_deg: float, second_length: float, second_angle_deg: float) -> tuple[float, float]:
    """Length and angle of the sum of two vectors; the angle from 0 to 360°.

    Examples
    --------
    >>> [round(x, 9) for x in vector_sum(3.0, 0.0, 4.0, 90.0)]
    [5.0, 53.130102354]
    """
    total = _vector(length, angle_deg) + _vector(second_length, second_angle_deg)
    return abs(total), degrees(atan2(total.imag, total.real)) % 360.0


def _vector(length: float, angle_deg: float) -> complex:
    return complex(length * np.exp(1j * radians(angle_deg)))
