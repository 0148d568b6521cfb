"""Effect: a drive that hunts about its speed."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np

from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Textbook
from sims.machine import Machine, SpeedSwing, log_uniform


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with a further fluctuation of the set speed."""
    swing = SpeedSwing(severity / 100.0, float(options["frequency_hz"]), float(rng.uniform(0.0, 2.0 * pi)))
    return replace(machine, drive=replace(machine.drive, swings=(*machine.drive.swings, swing)))


EFFECT = Effect(
    name="speed_fluctuation",
    group="drive and load",
    title="hunting of the speed",
    severity=Severity("amplitude_percent", "%", 0.0, 20.0, 2.0, "amplitude relative to the mean speed"),
    changes="The set speed is multiplied by 1 + severity·sin(2πft + φ), φ drawn; the drive follows it.",
    signature="The speed itself fluctuates at the given frequency, which does not change with the speed. In a "
    "frequency spectrum every line is smeared or gets sidebands at that spacing, the wider the higher the line; in the "
    "order domain the lines are sharp again, with a slow change of level.",
    shows_in=("speed", "mesh_sidebands"),
    change=change,
    options=(Option("frequency_hz", 1.0, "of the fluctuation", "Hz", 0.01, 50.0),),
    plausible=PlausibleRange(
        0.2,
        5.0,
        "percent: a controlled drive holds 0.1, a hunting one fluctuates by several",
        choices=lambda _machine: [{"frequency_hz": 1.0}],
        drawn=lambda _machine, rng: {"frequency_hz": log_uniform(rng, 0.3, 8.0)},
    ),
    textbook=Textbook(
        (("speed.swing", UP), ("speed.drift", UP)),
        "the speed wanders",
    ),
)
