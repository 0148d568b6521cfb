"""Effect: pick-up from the electric supply."""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from math import pi

import numpy as np

from gearsig.errors import InputError
from gearsig.recording import MAINS_HZ
from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects._parts import with_each_channel
from sims.effects.textbook import UP, Textbook
from sims.machine import Machine
from sims.measure import MainsHum, MeasuredChannel


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with hum in every channel, in phase with any existing hum."""
    second = severity * float(options["harmonics_percent"]) / 100.0
    added = MainsHum((severity, second, second), float(options["frequency_hz"]), float(rng.uniform(0.0, 2.0 * pi)))

    def with_hum(channel: MeasuredChannel) -> MeasuredChannel:
        return replace(channel, hum=_sum(channel.hum, added))

    return with_each_channel(machine, with_hum)


def _sum(now: MainsHum, added: MainsHum) -> MainsHum:
    if not any(now.amplitudes_mps2):
        return added
    if now.frequency_hz != added.frequency_hz:
        raise InputError(
            f"the chain already has hum of {now.frequency_hz:g} Hz, and {added.frequency_hz:g} Hz was asked for",
            where="frequency_hz of mains_hum",
            allowed="one mains frequency",
            remedy=f"give frequency_hz={now.frequency_hz:g}",
        )
    pairs = zip_longest(now.amplitudes_mps2, added.amplitudes_mps2, fillvalue=0.0)
    return replace(now, amplitudes_mps2=tuple(a + b for a, b in pairs))


EFFECT = Effect(
    name="mains_hum",
    group="measurement chain",
    title="mains hum",
    severity=Severity("amplitude_mps2", "m/s^2", 0.0, 100.0, 1.0, "peak amplitude of the first harmonic, as read"),
    changes="A sine of the mains frequency with its second and third harmonic is added to every acceleration channel, "
    "after the sensor; the machine's motion is unchanged. Its phase is drawn, or that of existing hum.",
    signature="Sharp lines at 50 (or 60) Hz and multiples, at the same frequency whatever the speed: in the order "
    "domain they smear and move, and an average over revolutions removes them. They stay when the machine is stopped.",
    shows_in=("mains_lines",),
    change=change,
    options=(
        Option("frequency_hz", 50.0, "of the supply", "Hz", 10.0, 400.0),
        Option("harmonics_percent", 25.0, "second and third harmonic over the first", "%", 0.0, 200.0),
    ),
    plausible=PlausibleRange(
        0.03,
        1.0,
        "of the healthy machine's vibration",
        lambda machine, _options: machine.vibration_mps2,
        lambda _machine: [{"frequency_hz": 50.0}],
        lambda _machine, rng: {
            "frequency_hz": float(rng.choice(MAINS_HZ)),
            "harmonics_percent": float(rng.uniform(0.0, 80.0)),
        },
    ),
    textbook=Textbook(
        (("hum", UP),),
        "lines at the supply's frequency",
    ),
)
