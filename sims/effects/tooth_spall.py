"""Effect: a spall on a flank."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sims.effects.effect import GEAR_OPTION, TOOTH_OPTION, Effect, Option, OptionValue, Severity
from sims.effects.gear_side import gear_index, loaded_width_mm, tooth_number, with_tooth_fault
from sims.machine import Machine
from sims.mesh import ToothSpall


def change(machine: Machine, severity: float, options: Mapping[str, OptionValue], rng: np.random.Generator) -> Machine:
    """Return the machine with the spall, about the pitch point."""
    del rng
    width_mm, depth_um = loaded_width_mm(machine, options), float(options["depth_um"])
    spall = ToothSpall(severity, width_mm, depth_um, tooth_number(machine, options))
    return with_tooth_fault(machine, "spalls", gear_index(options), spall)


# The severity is the length and not the width: a spall of no length is bridged whatever its width is, a longer one is
# felt for a longer part of the mesh, and standards and inspectors state it. By width, one that reaches all across would
# be another mechanism (the mate sinks in) and a jump.
EFFECT = Effect(
    name="tooth_spall",
    group="tooth-local",
    title="spall on a tooth's flank",
    severity=Severity("length_mm", "mm", 0.0, 10.0, 1.5, "along the profile, its middle at the pitch point"),
    changes="Metal is missing on one flank about the pitch point. Over part of the face, the flank beside it carries "
    "alone, and the contact is softer; over the whole face, the mate sinks in as far as its curvature lets it.",
    signature="A short burst per revolution of the gear's shaft, at the tooth's angle and while the pitch point is in "
    "mesh: shorter than a crack's, so its low, wide sidebands reach to higher frequencies, and it rings the "
    "resonances; envelope lines at multiples of the shaft's order. It begins and ends within one mesh period. Longer "
    "spalls give a longer burst, wider ones a stronger one.",
    shows_in=("tooth_window", "envelope_orders", "mesh_sidebands", "resonances"),
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("width_percent", 60.0, "part of the loaded face, up to 90, or 100", "%", 1.0, 100.0),
        Option("depth_um", 100.0, "depth of the spall", "um", 1.0, 2000.0),
    ),
)
