"""Effect: a crack in a tooth root."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sims.effects._effect import GEAR_OPTION, TOOTH_OPTION, Effect, Option, OptionValue, Severity
from sims.effects._shared import gear_index, part_of_width_mm, tooth_number, with_tooth_fault
from sims.machine import Machine
from sims.mesh import RootCrack


def change(machine: Machine, severity: float, options: Mapping[str, OptionValue], rng: np.random.Generator) -> Machine:
    """Return the machine with the crack."""
    del rng  # nothing is drawn
    tooth, width_mm = tooth_number(machine, options), part_of_width_mm(machine, options)
    crack = RootCrack(severity, float(options["angle_deg"]), tooth, width_mm)
    return with_tooth_fault(machine, "cracks", gear_index(options), crack)


EFFECT = Effect(
    name="root_crack",
    group="tooth-local",
    title="crack in a tooth root",
    severity=Severity("depth_mm", "mm", 0.0, 10.0, 2.0, "length of the crack in the cross-section, from mid-fillet"),
    changes="One tooth loses bending, shear and axial stiffness where sections lie behind the crack; the mean force "
    "stays, so the tooth yields more while it carries.",
    signature="One burst per revolution of the gear's shaft, at the tooth's angle and about a mesh period long, which "
    "rings on at the natural frequencies; a family of low, wide sidebands of that shaft about the mesh harmonics and "
    "the resonances. In the shaft's synchronous average the residual's kurtosis rises; a phase lag at the tooth. It "
    "grows faster than the depth, and with the load.",
    shows_in=("tooth_window", "mesh_sidebands", "envelope_orders"),
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("angle_deg", 45.0, "between the crack and the tooth's centre line", "deg", 15.0, 90.0),
        Option("width_percent", 100.0, "part of the face width it reaches over, from one end", "%", 1.0, 100.0),
    ),
)
