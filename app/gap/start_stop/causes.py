"""The causes that a start–stop gap may have, and what each does to the simulated drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gearsig.gap.simulator import GapEffect
from sims.effects import EffectSetting, effect
from sims.forging.effects import WITH_MEANING

LOAD_INERTIA, LOAD_FRICTION, TORQUE_GAIN = "load_inertia", "load_friction", "torque_gain"


@dataclass(frozen=True)
class Tried:
    """Severities that are simulated.

    Parameters
    ----------
    severities : tuple of float
        Rising, in the effect's unit.
    shows_in : tuple of str
        Changes (`gearsig.gap.start_stop.told.NAMES`) that it is expected in: what it moves of the others is the
        simulated run's own chance.
    may_move : tuple of str
        Changes that it moves on real teeth and not in the simulated drive: they speak neither for nor against it.
    direct : tuple of str
        Changes that measure the severity itself.
    needs : str
        Channel without which it cannot be told: "torque", or empty.
    needs_reference : bool
        Whether the sound value stands in no drawing.
    """

    severities: tuple[float, ...]
    shows_in: tuple[str, ...]
    may_move: tuple[str, ...] = ()
    needs: str = ""
    needs_reference: bool = False
    direct: tuple[str, ...] = ()


_ROUGH = ("contact_scatter", "load_scatter")
TRIED: Mapping[str, Tried] = {
    "backlash": Tried((60.0, 180.0, 500.0), ("play", "impact"), direct=("play",)),
    "tooth_wear": Tried(
        (12.0, 25.0, 50.0, 100.0, 200.0), ("play", "curve"), ("deflection", "flank_friction", "impact", *_ROUGH)
    ),
    "sliding_friction": Tried((0.03, 0.09, 0.2), ("flank_friction",), ("curve", *_ROUGH), "torque"),
    LOAD_FRICTION: Tried(
        (8.0, 20.0, 45.0), ("load_friction",), (), "torque", needs_reference=True, direct=("load_friction",)
    ),
    "root_crack": Tried((1.0, 2.0, 4.0, 6.0, 8.0, 10.0), ("tooth",), (), "torque"),
    LOAD_INERTIA: Tried((-50.0, -25.0, 40.0, 120.0), ("inertia",), ("load_scatter",), "torque", direct=("inertia",)),
    TORQUE_GAIN: Tried(
        (-40.0, -20.0, 25.0, 60.0), ("inertia", "load_friction", "deflection"), ("flank_friction", *_ROUGH), "torque"
    ),
    "torque_ripple": Tried((1.5, 5.0, 15.0), ("ripple",), ("next_ripple", *_ROUGH), "torque"),
}
"""Of each cause."""

OF_PARAMETERS = {
    LOAD_INERTIA: GapEffect(
        LOAD_INERTIA,
        "drive and load",
        "another inertia of the load",
        "added_percent",
        "%",
        "torque against acceleration of the driven gear, in starts and stops",
        TRIED[LOAD_INERTIA].shows_in,
    ),
    LOAD_FRICTION: GapEffect(
        LOAD_FRICTION,
        "drive and load",
        "more friction of the load's bearings",
        "added_percent",
        "%",
        "torque that turns the load without accelerating it",
        TRIED[LOAD_FRICTION].shows_in,
    ),
    TORQUE_GAIN: GapEffect(
        TORQUE_GAIN,
        "measurement",
        "a torque sensor that reads too much or too little",
        "added_percent",
        "%",
        "inertia and friction of the load seem to change alike",
        TRIED[TORQUE_GAIN].shows_in,
    ),
}
"""What no effect of the catalogue is: parameters of the drive or of its sensors that may be wrong."""


def drive_effects() -> dict[str, GapEffect]:
    """Return every cause as the diagnosis sees it."""
    found = {name: _of_catalogue(name) for name in TRIED if name in WITH_MEANING}
    return {name: found.get(name) or OF_PARAMETERS[name] for name in TRIED}


def parameters_with(name: str, severity: float, parameters: Mapping[str, float | str]) -> dict[str, float | str]:
    """Return a drive's parameters with a cause that is a parameter's wrong value; others leave them as they are."""
    factor = 1.0 + 0.01 * severity
    if name == LOAD_INERTIA:
        return {**parameters, "wheel_inertia_kg_m2": float(parameters["wheel_inertia_kg_m2"]) * factor}
    if name == LOAD_FRICTION:
        both = ("load_friction_nm", "load_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) * factor for key in both}}
    if name == TORQUE_GAIN:  # what was read off the recording was misread as well
        read = ("brake_nm", "drag_nm", "drag_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) / factor for key in read}, "torque_gain": factor}
    return dict(parameters)


def setting_of(name: str, severity: float, options: Mapping[str, float | str]) -> tuple[EffectSetting, ...]:
    """Return the catalogue's setting of a cause; none where it is a parameter's value."""
    return () if name in OF_PARAMETERS else (EffectSetting(name, severity, dict(options)),)


def _of_catalogue(name: str) -> GapEffect:
    found = effect(name)
    return GapEffect(
        found.name, found.group, found.title, found.severity.name, found.severity.unit, "", TRIED[name].shows_in
    )
