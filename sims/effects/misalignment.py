"""Effect: a coupling that joins two axes at an angle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import within
from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects._shared import GEARS, gear_index, replaced_item
from sims.machine import Machine

_MAX_DEG = 5.0  # of a ShaftLine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the angle added in the plane of the one there is."""
    del rng
    index = gear_index(options, "shaft")
    now = machine.shafts[index].coupling_angle_deg
    within(severity, f"angle_deg of misalignment, beside the {now:g}° there are,", 0.0, _MAX_DEG - now, "deg")
    shafts = replaced_item(machine.shafts, index, coupling_angle_deg=now + severity)
    return replace(machine, shafts=shafts)


EFFECT = Effect(
    name="misalignment",
    group="shaft",
    title="misaligned coupling",
    severity=Severity("angle_deg", "deg", 0.0, _MAX_DEG, 1.0, "between rotor axis and shaft axis in the coupling"),
    changes="Rotor and shaft turn as through a universal joint: the twist between them has a part at twice the "
    "turning speed, and the torque bends the shaft, which loads its bearings.",
    signature="Order 2 of that shaft in the vibration of its bearings, from the bending moment, in proportion to angle "
    "and torque; order 2 in mesh force and speed, from the twist of β²/4, which a doubled angle shows fourfold; weak "
    "sidebands z ± 2 about the mesh harmonics. Order 1 hardly changes.",
    shows_in=("shaft_orders", "mesh_sidebands"),
    change=change,
    options=(Option("shaft", "driver", "whose coupling", choices=GEARS),),
    plausible=PlausibleRange(
        0.4,
        4.0,
        "degrees: elastic couplings bear 1, universal joints more; the model goes to 5",
        choices=lambda _machine: [{"shaft": side} for side in GEARS],
        drawn=lambda _machine, rng: {"shaft": str(rng.choice(GEARS))},
    ),
)
