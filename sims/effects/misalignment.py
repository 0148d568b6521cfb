"""Effect: a coupling that joins two axes at an angle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import within
from sims.effects import textbook as book
from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects._parts import GEARS, gear_index, replaced_item
from sims.machine import Machine

_MAX_DEG = 5.0  # of a ShaftLine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the angle added, in the plane of the existing one."""
    del rng
    index = gear_index(options, "shaft")
    now = machine.shafts[index].coupling_angle_deg
    within(severity, f"angle_deg of misalignment, beside the {now:g}° there are,", 0.0, _MAX_DEG - now, "deg")
    shafts = replaced_item(machine.shafts, index, coupling_angle_deg=now + severity)
    return replace(machine, shafts=shafts)


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """Two stiffness cycles per revolution, or a load that moves along the teeth.

    Shaft order 2, mesh harmonics from the second on, first and second sidebands: any of them may dominate. The contact
    moves along the teeth, which differ along their width; coupling forces reach some sensors more than others.
    """
    order = scene.shaft_orders[book.draw_side(rng)]
    lines, bands, mesh = book.balance(rng, 3)
    first, third = rng.uniform(0.0, 0.7, 2)
    line = size * max(lines, 0.2) * 10.0 ** rng.uniform(0.0, 0.5)
    waves = sum(
        (w * book.tone(n * order, scene, rng) for n, w in ((1.0, first), (2.0, 1.0), (3.0, third))),
        np.zeros(len(scene.time_s)),
    )
    once, twice = book.balance(rng, 2)
    swings = book.swing(scene, 2.0 * order, bands * twice * size, rng)
    swings = swings * book.swing(scene, order, bands * once * size, rng)
    higher = np.exp(2.0 * mesh * min(size, 1.0) * np.abs(rng.standard_normal(book.N_MESH_HARMONICS - 1)))
    return book.Signature(
        swings,
        None,
        (line * waves,),
        (1.0, *higher.tolist()),
        paths_scatter=0.7 * min(size, 1.0) * book.partly(rng),
        around=book.partly(rng),
        uneven=book.partly(rng) * book.uneven(scene, rng),
    )


EFFECT = Effect(
    name="misalignment",
    group="shaft",
    title="misaligned coupling",
    severity=Severity("angle_deg", "deg", 0.0, _MAX_DEG, 1.0, "between rotor axis and shaft axis in the coupling"),
    changes="Rotor and shaft turn as through a universal joint: the twist between them has a component at twice the "
    "shaft speed, and the torque bends the shaft, which loads its bearings.",
    signature="Order 2 of that shaft in the vibration of its bearings, from the bending moment, in proportion to angle "
    "and torque; order 2 in mesh force and speed, from the twist of β²/4, which quadruples when the angle doubles; "
    "weak sidebands z ± 2 about the mesh harmonics. Order 1 hardly changes.",
    shows_in=("shaft_orders", "mesh_sidebands"),
    change=change,
    options=(Option("shaft", "driver", "whose coupling", choices=GEARS),),
    plausible=PlausibleRange(
        0.4,
        4.0,
        "degrees: elastic couplings tolerate 1, universal joints more; the model allows up to 5",
        choices=lambda _machine: [{"shaft": side} for side in GEARS],
        drawn=lambda _machine, rng: {"shaft": str(rng.choice(GEARS))},
    ),
    textbook=book.Textbook(
        (("shaft.{side}.2", book.UP), ("sideband.{side}.2", book.UP)),
        "the shaft's second order, second sidebands",
        textbook_signature,
        source="J. E. Berry, Illustrated Vibration Diagnostic Chart, 1994: higher mesh harmonics with sidebands at "
        "running speed",
    ),
)
