"""Effect: a spall on the inner race of a bearing."""

from __future__ import annotations

import numpy as np

from sims.effects import _shared as shared
from sims.effects._effect import Effect, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, race_impacts
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the defect; the angle counts from tooth 1 at time 0."""
    del rng  # the places of the rolling elements are drawn by the simulator
    return shared.with_race_defect(machine, "inner", severity, options)


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Knocks when elements pass the defect, louder in the load zone, that is once per turn."""
    return race_impacts(scene, size, rng, "BPFI")


EFFECT = Effect(
    name="bearing_inner_race",
    group="bearing",
    title="spall on an inner race",
    severity=Severity("length_mm", "mm", 0.0, 4.0, 0.3, "along the raceway; no longer than the elements' spacing"),
    changes="Rolling elements sink into a gap of the turning race and strike its far edge, hardest in the load zone.",
    signature="Knocks at n(1 + d cos α/D)/2 per revolution of the bearing's shaft, a little more with slip, strong "
    "while the defect turns through the load zone and weak outside: envelope lines of that order and its multiples "
    "with sidebands of one shaft order, and order 1 itself. Slightly random, so that a synchronous average takes it "
    "away.",
    shows_in=("envelope_orders", "resonances", "broadband"),
    change=change,
    options=shared.RACE_OPTIONS,
    plausible=PlausibleRange(
        0.01,
        0.15,
        "as on the outer race",
        shared.rolling_element_mm,
        shared.each_bearing,
        shared.any_race,
        shared.longest_defect_mm("inner"),
    ),
    textbook=Textbook(
        (("envelope.inner", UP),),
        "envelope lines at the ball pass order of the inner race",
        textbook_signature,
    ),
)
