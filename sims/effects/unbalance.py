"""Effect: a gear whose centre of mass lies off its axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import within
from sims.effects import _parts as parts
from sims.effects._effect import GEAR_OPTION, Effect, MachineFacts, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, draw_side, modulated, partly
from sims.machine import Machine, usual_mass_kg

_LARGEST_OFFSET = 0.1
"""Maximum offset of the centre of mass, in pitch radii; beyond it, the gear must have lost a piece."""


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the unbalance added."""
    index, angle = parts.gear_index(options), parts.angle_or_drawn_deg(options, rng)
    wheel = machine.wheels[index]
    length, direction = parts.vector_sum(wheel.unbalance_g_mm, wheel.unbalance_angle_deg, severity, angle)
    largest = _LARGEST_OFFSET * parts.gear_geometry(machine, index).pitch_radius_mm * wheel.mass_kg * 1e3
    within(length, f"unbalance_g_mm of the {parts.GEARS[index]} gear", 0.0, largest, "g mm")
    wheels = parts.replaced_item(machine.wheels, index, unbalance_g_mm=length, unbalance_angle_deg=direction)
    return replace(machine, wheels=wheels)


def _mesh_force_g_mm(machine: MachineFacts, options: Options) -> float:
    """Unbalance whose force at the nominal speed equals the static mesh force."""
    omega = machine.nominal.speed_rpm * np.pi / 30.0
    if parts.gear_index(options) == 1:
        omega *= machine.nominal.teeth[0] / machine.nominal.teeth[1]
    return float(machine.nominal.mesh_force_n / omega**2 * 1e6)


def _largest_g_mm(machine: MachineFacts, options: Options) -> float:
    side = parts.gear_index(options)
    radius = 0.5 * machine.diameter_mm(side)
    return 0.8 * _LARGEST_OFFSET * radius * usual_mass_kg(machine.nominal, side) * 1e3


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """A force rotating with the shaft: order 1 and hardly any sideband; a large one deflects the supports."""
    order = scene.shaft_orders[draw_side(rng)]
    force = size * 10.0 ** rng.uniform(0.0, 0.8)
    lines = force * np.array([1.5, 0.15 * partly(rng), 0.15 * partly(rng)])
    gain, late = 0.03 * force * rng.uniform(0.0, 1.0, 2)
    return modulated(scene, order, (gain, late), lines.tolist(), rng)


EFFECT = Effect(
    name="unbalance",
    group="shaft",
    title="unbalance",
    severity=Severity(
        "unbalance_g_mm", "g mm", 0.0, 1e5, 500.0, "mass times distance of the centre of mass from the axis"
    ),
    changes="A force of unbalance times speed squared rotates with the gear; the unbalance adds as a vector to any "
    "existing one.",
    signature="Order 1 of that gear's shaft, equal in both directions across the shaft; its force grows with the "
    "square of the speed (the acceleration below resonance with the fourth power) and not with the load. Hardly any "
    "transmission error, which distinguishes it from eccentricity; weak sidebands z ± 1, as the mesh force acts off "
    "the centre of mass. Faint at low speed.",
    shows_in=("shaft_orders",),
    change=change,
    options=(GEAR_OPTION, parts.ANGLE_OPTION),
    plausible=PlausibleRange(
        0.01,
        0.15,
        "its force at the nominal speed over the static mesh force; less is hidden by the mesh",
        _mesh_force_g_mm,
        parts.either_gear,
        parts.any_gear,
        _largest_g_mm,
    ),
    textbook=Textbook(
        (("shaft.{side}.1", UP), ("shaft.{side}.1.to_mesh", UP)),
        "the shaft's first order",
        textbook_signature,
    ),
    turns_with_shaft=True,
)
