"""Effect: a measuring range that is too small."""

from __future__ import annotations

from dataclasses import replace
from math import log10

import numpy as np

from sims.effects._effect import Effect, Options, PlausibleRange, Severity
from sims.effects._parts import with_each_channel
from sims.effects.textbook import DOWN, SIZES, UP, Signature, SyntheticScene, Textbook
from sims.machine import Machine
from sims.measure import MeasuredChannel


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with sensors that clip."""
    del options, rng

    def with_clipping(channel: MeasuredChannel) -> MeasuredChannel:
        # Of two limits, only the lower one is reached.
        percent = max(channel.accelerometer.clip_percent, severity)
        return replace(channel, accelerometer=replace(channel.accelerometer, clip_percent=percent))

    return with_each_channel(machine, with_clipping)


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Clipped peaks: a thousandth to a third of the samples."""
    del scene, rng
    return Signature(cut_share=1e-3 * (size / SIZES[0]) ** (2.5 / log10(SIZES[1] / SIZES[0])))


EFFECT = Effect(
    name="clipping",
    group="measurement chain",
    title="clipped signal",
    severity=Severity(
        "clipped_percent", "%", 0.0, 50.0, 2.0, "part of the time that the sensor is at its limit, per recording"
    ),
    changes="Every accelerometer is limited to the level that its reading exceeds for that part of the time. The level "
    "follows from each recording's own signal, so it differs between speeds and loads. For one fixed range, set the "
    "accelerometer's range instead.",
    signature="The amplitude distribution is cut off: crest factor and kurtosis fall, extreme values pile up at one "
    "level on both sides, smeared by the anti-alias filter behind the sensor. Odd harmonics and sums of the strongest "
    "lines appear as far as the filter passes them; impulses lose most, so that a local fault looks smaller.",
    shows_in=("amplitude_tail", "mesh_harmonics", "broadband"),
    change=change,
    plausible=PlausibleRange(0.3, 12.0, "percent of the time: rare peaks to a grossly wrong range"),
    textbook=Textbook(
        (("raw.near_the_extreme", UP), ("raw.kurtosis", DOWN)),
        "flat tops",
        textbook_signature,
    ),
)
