"""Effect: one more resonance between the bearings and the sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects._parts import with_each_channel
from sims.effects.textbook import EITHER, Textbook
from sims.machine import Machine, log_uniform
from sims.measure import MeasuredChannel, ModalPath, PathMode


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with a further mode in the path of every channel."""
    del rng
    frequency_hz, damping_ratio = float(options["frequency_hz"]), float(options["damping_ratio"])

    def with_mode(channel: MeasuredChannel) -> MeasuredChannel:
        # A mode of static gain g reaches g/(2ζ) at its frequency.
        gains = {
            position: 2.0 * damping_ratio * severity * gain for position, gain in static_gains(channel.path).items()
        }
        mode = PathMode(frequency_hz, damping_ratio, gains)
        return replace(channel, path=replace(channel.path, modes=(*channel.path.modes, mode)))

    return with_each_channel(machine, with_mode)


def static_gains(path: ModalPath) -> dict[str, float]:
    """Return the gain of a path well below its modes, d + Σ g, by position."""
    total = dict(path.direct)
    for mode in path.modes:
        for position, gain in mode.gains.items():
            total[position] = total.get(position, 0.0) + gain
    return total


EFFECT = Effect(
    name="transfer_path",
    group="measurement chain",
    title="resonance of housing or sensor",
    severity=Severity(
        "amplification", "", 0.0, 50.0, 5.0, "what the mode adds at its frequency, in multiples of the gain far below"
    ),
    changes="The path from bearings to sensor has one more mode, the same in every channel. As modes add up, it also "
    "adds 2ζ times the severity to the gain below its frequency.",
    signature="Everything in the band about its frequency is raised, at the same frequency whatever the speed: a "
    "vertical ridge over several speeds. Mesh harmonics and floor rise alike, and ratios of neighbouring lines hardly "
    "change; no new order, no change of a tooth's share. Levels change where a gear fault would change orders.",
    shows_in=("resonances", "broadband", "mesh_harmonics"),
    change=change,
    options=(
        Option("frequency_hz", 3000.0, "of the mode", "Hz", 10.0, 100e3),
        Option("damping_ratio", 0.03, "of the mode", low=1e-3, high=0.5),
    ),
    plausible=PlausibleRange(
        2.0,
        20.0,
        "amplification: from a well-damped to a sharp resonance",
        choices=lambda _machine: [{"frequency_hz": frequency_hz} for frequency_hz in (1200.0, 3500.0)],
        drawn=lambda _machine, rng: {
            "frequency_hz": log_uniform(rng, 400.0, 7000.0),
            "damping_ratio": log_uniform(rng, 0.01, 0.08),
        },
    ),
    textbook=Textbook(
        (("floor.band.2", EITHER), ("floor.band.3", EITHER), ("raw.level", EITHER)),
        "levels of whole bands change, lines and noise alike",
        source="R. B. Randall, Vibration-based Condition Monitoring, 2nd ed., 2021, chapter 3 (separation of force and "
        "path)",
    ),
)
