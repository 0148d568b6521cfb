"""Effect: a spall on the outer race of a bearing."""

from __future__ import annotations

import numpy as np

from sims.effects import _shared as shared
from sims.effects._effect import Effect, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, race_impacts
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the defect; the angle counts from the middle of the load zone."""
    del rng  # the places of the rolling elements are drawn by the simulator
    return shared.with_race_defect(machine, "outer", severity, options)


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Knocks when elements pass the defect, all alike."""
    return race_impacts(scene, size, rng, "BPFO")


EFFECT = Effect(
    name="bearing_outer_race",
    group="bearing",
    title="spall on an outer race",
    severity=Severity("length_mm", "mm", 0.0, 4.0, 0.3, "along the raceway; no longer than the elements' spacing"),
    changes="Rolling elements sink into a gap of the standing race and strike its far edge. From about 0.5 mm on they "
    "carry nothing there, and the knocks grow no more; they last longer.",
    signature="A knock for every element that passes, n(1 − d cos α/D)/2 per revolution of the bearing's shaft less "
    "slip: lines of that order and its multiples in the envelope about a resonance, all nearly as strong as the load "
    "zone does not move; not a multiple of any shaft order, and slightly random, so that a synchronous average takes "
    "it away.",
    shows_in=("envelope_orders", "resonances", "broadband"),
    change=change,
    options=shared.RACE_OPTIONS,
    plausible=PlausibleRange(
        0.01,
        0.15,
        "of the rolling element's diameter; beyond half a millimetre or so the knocks grow no more",
        shared.rolling_element_mm,
        shared.each_bearing,
        shared.any_race,
        shared.longest_defect_mm("outer"),
    ),
    textbook=Textbook(
        (("envelope.outer", UP),),
        "envelope lines at the ball pass order of the outer race",
        textbook_signature,
    ),
)
