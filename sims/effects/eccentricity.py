"""Effect: a gear that sits off its axis."""

from __future__ import annotations

from dataclasses import replace
from math import radians, sin

import numpy as np

from sims.effects import _parts as parts
from sims.effects._effect import GEAR_OPTION, Effect, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, draw_side, modulated
from sims.machine import Machine, runout_tolerance_um


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with run-out and the resulting unbalance."""
    index, angle = parts.gear_index(options), parts.angle_or_drawn_deg(options, rng)
    wheel = machine.wheels[index]
    runout, runout_angle = parts.vector_sum(wheel.runout_um, wheel.runout_angle_deg, severity, angle)
    # The body is concentric with the pitch circle, so its centre of mass moves along: 1 kg µm = 1 g mm.
    unbalance, unbalance_angle = parts.vector_sum(
        wheel.unbalance_g_mm, wheel.unbalance_angle_deg, wheel.mass_kg * severity, angle
    )
    wheels = parts.replaced_item(
        machine.wheels,
        index,
        runout_um=runout,
        runout_angle_deg=runout_angle,
        unbalance_g_mm=unbalance,
        unbalance_angle_deg=unbalance_angle,
    )
    return replace(machine, wheels=wheels)


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Run-out: amplitude and phase modulation of the mesh once per revolution, and possibly shaft orders 1 and 2.

    The gear's mass is off the axis as well, so order 1 may be as large as with unbalance; the mesh distinguishes them.
    """
    order = scene.shaft_orders[draw_side(rng)]
    gain, late = 10.0 ** (-rng.uniform(0.0, 0.9, 2))
    first = float(rng.choice((0.0, 1.0, 1.0))) * 10.0 ** rng.uniform(-1.0, 0.5)
    second = first * rng.uniform(0.0, 0.2)
    return modulated(scene, order, (gain * size, late * size), (size * first, size * second), rng)


MAX_PLAY_SHARE = 0.9
"""Maximum share of the backlash that run-out may take: beyond it, tolerances and load make the pair jam."""


def largest_um(play_um: float, pressure_angle_deg: float, share: float = MAX_PLAY_SHARE) -> float:
    """Return the run-out that takes a share s of the backlash j, e = s j/(2 sin α), in µm.

    Axes closer by e reduce the backlash by 2 e sin α. From j/(2 sin α) on both flanks of a tooth touch and the pair
    jams: the whole machine rattles, and nobody runs it.
    """
    return share * play_um / (2.0 * sin(radians(pressure_angle_deg)))


EFFECT = Effect(
    name="eccentricity",
    group="shaft",
    title="gear off its axis",
    severity=Severity(
        "runout_um", "um", 0.0, 200.0, 20.0, "distance of the pitch circle's centre from the axis: half the run-out"
    ),
    changes="The pitch circle of one gear turns about a point off its centre, and the centre of mass moves with it "
    "(mass times run-out is added to the unbalance). Both add as vectors to existing run-out and unbalance.",
    signature="Order 1 of that gear's shaft in transmission error, as large as the run-out, at every speed and load; "
    "in vibration, order 1, and first sidebands of that shaft about the mesh harmonics (z ± 1, 2z ± 1, …), far above "
    "those further out: a smooth modulation over the whole revolution, no pulse. Weak while the torque is steady.",
    shows_in=("shaft_orders", "mesh_sidebands"),
    change=change,
    options=(GEAR_OPTION, parts.ANGLE_OPTION),
    plausible=PlausibleRange(
        1.0,
        8.0,
        "half of the run-out over F_r of class 5: gears of class 7 to 13, or a bent shaft",
        parts.tolerance_of(runout_tolerance_um),
        parts.either_gear,
        parts.any_gear,
        lambda machine, _options: largest_um(machine.play_um, machine.nominal.pressure_angle_deg),
    ),
    textbook=Textbook(
        (("sideband.{side}.1", UP), ("shaft.{side}.1", UP)),
        "first sidebands of the shaft about the mesh, and its first order",
        textbook_signature,
    ),
)
