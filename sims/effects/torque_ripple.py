"""Effect: a drive whose torque ripples with its angle."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from sims.effects._effect import DriveEffect, DriveParameters, Effect, Option, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, balance, draw_side, modulated
from sims.machine import Machine, TorqueRipple, log_uniform


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with a further torque ripple."""
    ripple = TorqueRipple(float(options["order"]), severity / 100.0, float(rng.uniform(0.0, 2.0 * pi)))
    return replace(machine, drive=replace(machine.drive, ripples=(*machine.drive.ripples, ripple)))


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Set amplitude and order of the motor's ripple."""
    del drive
    return DriveEffect({"torque_ripple": severity / 100.0, "torque_ripple_order": float(options["order"])})


def _any_order(rng: np.random.Generator) -> float:
    """Draw an integer order of a motor or pump, or, half as often, any order of a geared or belted part."""
    if rng.uniform() < 2.0 / 3.0:
        return float(rng.choice((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)))
    return float(rng.uniform(1.5, 16.0))


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """The drive torque pulses n times per revolution: a line at that order, and mesh sidebands at that spacing."""
    shaft = scene.shaft_orders[draw_side(rng)]
    pulls = log_uniform(rng, 1.5, 15.0)  # two to six pulses are more common than fifteen in motors and engines
    order = shaft * (float(round(pulls)) if rng.uniform() < 0.75 else pulls)
    gain, late, line = balance(rng, 3)
    return modulated(scene, order, (gain * size, late * size), (size * max(line, 0.2),), rng)


EFFECT = Effect(
    name="torque_ripple",
    group="drive and load",
    title="ripple of the drive's torque",
    severity=Severity("amplitude_percent", "%", 0.0, 50.0, 5.0, "amplitude relative to the torque"),
    changes="The drive torque is multiplied by 1 + severity·cos(order·θ + φ), θ the angle of the input rotor and φ "
    "drawn.",
    signature="One line at the ripple's order of the input shaft, in torque, speed and vibration, and weak sidebands "
    "at that spacing about the mesh harmonics. Proportional to the torque; at the same order at every speed, highest "
    "where that order meets a torsional resonance.",
    shows_in=("shaft_orders", "mesh_sidebands", "speed"),
    change=change,
    options=(
        Option(
            "order",
            6.0,
            "cycles per revolution of the input rotor; 6 per pole pair for a motor on a three-phase inverter",
            low=0.1,
            high=200.0,
        ),
    ),
    plausible=PlausibleRange(
        2.0,
        30.0,
        "percent: inverters cause 1 to 5, piston engines and pumps tens",
        choices=lambda _machine: [{"order": order} for order in (1.0, 2.0, 3.0, 4.0, 6.0)],
        drawn=lambda _machine, rng: {"order": _any_order(rng)},
    ),
    on_drive=on_drive,
    textbook=Textbook(
        (("sideband.{side}.strongest", UP), ("shaft.{side}.strongest", UP)),
        "a single pair of sidebands, a single order of the shaft",
        textbook_signature,
    ),
)
