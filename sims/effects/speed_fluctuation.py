"""Effect: a drive that hunts about its speed."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Textbook
from sims.machine import Machine, SpeedSwing, log_uniform


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with one more swing of the set speed."""
    swing = SpeedSwing(severity / 100.0, float(options["frequency_hz"]), float(rng.uniform(0.0, 2.0 * pi)))
    return replace(machine, drive=replace(machine.drive, swings=(*machine.drive.swings, swing)))


EFFECT = Effect(
    name="speed_fluctuation",
    group="drive and load",
    title="hunting of the speed",
    severity=Severity("amplitude_percent", "%", 0.0, 20.0, 2.0, "amplitude of the swing over the mean speed"),
    changes="The set speed is multiplied by 1 + severity·sin(2πft + φ), φ drawn; the drive follows it.",
    signature="The speed itself swings at the given frequency, in hertz and whatever the speed. In a spectrum over "
    "frequency every line is smeared or gets sidebands of that distance, the wider the higher the line; in the order "
    "domain the lines are sharp again, with a slow change of level.",
    shows_in=("speed", "mesh_sidebands"),
    change=change,
    options=(Option("frequency_hz", 1.0, "of the swing", "Hz", 0.01, 50.0),),
    plausible=PlausibleRange(
        0.2,
        5.0,
        "percent: a controlled drive holds 0.1, a hunting one swings by several",
        choices=lambda _machine: [{"frequency_hz": 1.0}],
        drawn=lambda _machine, rng: {"frequency_hz": log_uniform(rng, 0.3, 8.0)},
    ),
    textbook=Textbook(
        (("speed.swing", UP), ("speed.drift", UP)),
        "the speed wanders",
    ),
)
