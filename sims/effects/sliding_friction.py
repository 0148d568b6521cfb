"""Effect: more friction between the flanks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sims.effects.effect import Effect, OptionValue, Severity
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Mapping[str, OptionValue], rng: np.random.Generator) -> Machine:
    """Return the machine with friction added."""
    del options, rng
    oil = machine.lubrication
    # A machine without friction has factor 0 of the regression, whatever its field says.
    now = oil.factor if oil.friction else 0.0
    return replace(machine, lubrication=replace(oil, friction=True, factor=now + severity / 100.0))


EFFECT = Effect(
    name="sliding_friction",
    group="flank",
    title="more sliding friction",
    severity=Severity(
        "added_percent",
        "%",
        0.0,
        1000.0,
        100.0,
        "friction that is added, in percent of the coefficient of well lubricated flanks",
    ),
    changes="The friction coefficient of every contact, by the regression of Xu and Kahraman, is multiplied by a "
    "factor that grows by severity/100; a model without friction starts at factor 0. Starved, thinned or aged oil.",
    signature="Mesh harmonics, above all across the line of action, where friction is the only force: it turns over "
    "at the pitch point and jumps where pairs come and go, so the second and higher harmonics gain. No sidebands, "
    "nothing at one tooth. The drive gives a little more torque at the same load: more power is lost. It grows with "
    "the load.",
    shows_in=("mesh_harmonics",),
    change=change,
)
