"""Effect: flanks that have worn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sims.effects._effect import GEAR_OPTION, Effect, OptionValue, Severity
from sims.effects._shared import gear_index, mesh_field, with_mesh_field
from sims.machine import Machine
from sims.mesh import FlankDeviation


def change(machine: Machine, severity: float, options: Mapping[str, OptionValue], rng: np.random.Generator) -> Machine:
    """Return the machine with wear added on every tooth of one gear."""
    del rng
    index = gear_index(options)
    flank: FlankDeviation = mesh_field(machine, "flank", index)
    return with_mesh_field(machine, "flank", index, replace(flank, wear_um=flank.wear_um + severity))


EFFECT = Effect(
    name="tooth_wear",
    group="flank",
    title="worn flanks",
    severity=Severity("depth_um", "um", 0.0, 200.0, 15.0, "greatest depth of wear on the flank; adds to wear there is"),
    changes="Every flank of one gear loses metal where it slides: nothing at the pitch point, most towards root and "
    "tip, by Archard's law.",
    signature="Mesh harmonics, alike on every tooth: no sidebands and no pulse, the same shape in every mesh period. "
    "On teeth without relief the first micrometres act as one and quieten the mesh; beyond, every harmonic grows. "
    "Strongest at light load, where deflection no longer covers the worn shape. A path that passes other frequencies "
    "better looks alike: ratios at another load tell.",
    shows_in=("mesh_harmonics",),
    change=change,
    options=(GEAR_OPTION,),
)
