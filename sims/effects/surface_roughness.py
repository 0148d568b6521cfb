"""Effect: rougher flanks."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np

from gearsig.errors import InputError
from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.machine import Machine, Roughness

_AS_IT_IS = "as it is"


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with rougher flanks."""
    del rng  # the profile is drawn by the simulator
    locked_to = _locked_to(machine.roughness, str(options["locked_to"]))
    rms_um = hypot(machine.roughness.rms_um, severity)
    return replace(machine, roughness=replace(machine.roughness, rms_um=rms_um, locked_to=locked_to))


def _locked_to(now: Roughness, wanted: str) -> str:
    if wanted in (_AS_IT_IS, now.locked_to):
        return now.locked_to
    # Otherwise a vanishing severity would change the profile that is already there.
    if now.rms_um > 0:
        raise InputError(
            f"the flanks already have {now.rms_um:g} µm, locked to {now.locked_to!r}, and {wanted!r} was asked for",
            where="locked_to of surface_roughness",
            allowed=f"{_AS_IT_IS!r} or {now.locked_to!r}",
            remedy="change the model's own roughness",
        )
    return wanted


EFFECT = Effect(
    name="surface_roughness",
    group="flank",
    title="rougher flanks",
    severity=Severity(
        "added_rms_um", "um", 0.0, 3.0, 0.8, "rms roughness that is added; independent finishes add in squares"
    ),
    changes="The composite rms roughness becomes √(R² + severity²): the fractal profile that opens and closes the "
    "contact grows with it, and so does the friction coefficient.",
    signature="Broadband: fractal lines and a raised floor between mesh harmonics, strongest about the resonances; "
    "mesh harmonics by friction, above all across the line of action. Locked to the flank the lines are orders of "
    "both shafts and return with the hunting period; locked to time they stand at fixed frequencies and no average "
    "holds them. Above about 0.8 µm friction rises steeply.",
    shows_in=("broadband", "mesh_harmonics", "shaft_orders"),
    change=change,
    options=(
        Option(
            "locked_to",
            _AS_IT_IS,
            "what the profile returns with; 'none': only friction knows the roughness",
            choices=(_AS_IT_IS, "time", "flank", "none"),
        ),
    ),
    plausible=PlausibleRange(
        0.3, 2.5, "um: ground flanks have 0.4, hobbed or run-out ones 1 to 3; it does not grow with the gear"
    ),
)
