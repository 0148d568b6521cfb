"""What the effects on a bearing share: which one, and a defect on one of its races."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import cos, pi, radians

from gearsig.checks import within
from gearsig.errors import InputError
from sims.effects.catalogue import replaced_item
from sims.effects.effect import Option, OptionValue
from sims.machine import BearingSupport, Machine, RaceDefect, bearing_index

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
