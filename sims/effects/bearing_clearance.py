"""Effect: a bearing with too much play."""

from __future__ import annotations

import numpy as np

from sims.effects._effect import Effect, Options, PlausibleRange, Severity
from sims.effects._shared import BEARING_OPTION, any_bearing, chosen_bearing, each_bearing, module_mm, with_bearing
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with clearance added to one bearing."""
    del rng
    index = chosen_bearing(machine, options)
    return with_bearing(machine, index, clearance_um=machine.bearings[index].clearance_um + severity)


EFFECT = Effect(
    name="bearing_clearance",
    group="bearing",
    title="clearance in a bearing",
    severity=Severity(
        "added_um", "um", 0.0, 200.0, 30.0, "radial distance from the middle until it carries: half the play; added"
    ),
    changes="The shaft moves that far before rolling elements carry; fewer of them do, so the support is softer and "
    "its stiffness changes as they pass.",
    signature="Lines at the order at which elements pass a point, n(1 − d cos α/D)/2 of the bearing's shaft, and its "
    "multiples, with sums and differences to the mesh; no knocks. Other mesh harmonics, as the support is softer. "
    "Under a turning load, harmonics of the shaft; impacts and a raised floor where the load lets the shaft lift.",
    shows_in=("shaft_orders", "envelope_orders", "resonances", "low_load"),
    change=change,
    options=(BEARING_OPTION,),
    plausible=PlausibleRange(
        3.0,
        40.0,
        "um per mm of module: clearance classes C3 to C5 of a bearing of the machine's size, to a worn-out one",
        module_mm,
        each_bearing,
        any_bearing,
    ),
)
