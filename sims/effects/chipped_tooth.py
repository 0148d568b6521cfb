"""Effect: a piece broken off a tooth's tip."""

from __future__ import annotations

import numpy as np

from sims.effects._effect import GEAR_OPTION, TOOTH_OPTION, Effect, Option, Options, PlausibleRange, Severity
from sims.effects._shared import (
    any_tooth,
    first_teeth,
    gear_index,
    loaded_width_mm,
    module_mm,
    tooth_number,
    with_tooth_fault,
)
from sims.machine import Machine
from sims.mesh import ToothChip


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the chip."""
    del rng
    chip = ToothChip(severity, loaded_width_mm(machine, options), tooth_number(machine, options))
    return with_tooth_fault(machine, "chips", gear_index(options), chip)


EFFECT = Effect(
    name="chipped_tooth",
    group="tooth-local",
    title="piece broken off a tooth's tip",
    severity=Severity("height_mm", "mm", 0.0, 10.0, 1.0, "radially, from the tip down to the edge of the break"),
    changes="The outer part of one tooth carries less, or, over the whole face, nothing: its pair lets go early (on "
    "the driver) or takes up late (on the driven gear), and the neighbours carry instead.",
    signature="One burst per revolution of the gear's shaft, at the tooth's angle and where its tip is in mesh: in "
    "recess for the driver, in approach for the driven gear. A shock when the next pair takes the load over: wide "
    "sidebands of that shaft, ringing resonances, envelope lines at multiples of its order. Small chips lie in double "
    "contact and show little.",
    shows_in=("tooth_window", "envelope_orders", "mesh_sidebands", "resonances"),
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("width_percent", 50.0, "part of the loaded face, up to 90, or 100", "%", 1.0, 100.0),
    ),
    plausible=PlausibleRange(
        0.2,
        0.9,
        "of the module: a broken corner to half of the tooth's height; smaller chips lie in double contact",
        module_mm,
        lambda machine: first_teeth(machine, width_percent=85.0),
        lambda machine, rng: {
            **any_tooth(machine, rng),
            "width_percent": float(rng.choice((30.0, 60.0, 85.0, 100.0))),
        },
    ),
)
