"""Effect: a spall on the inner race of a bearing."""

from __future__ import annotations

from functools import partial

import numpy as np

from sims.effects import _parts as parts
from sims.effects._effect import Effect
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, race_impacts


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Impacts when elements pass the defect, louder in the load zone, so once per revolution."""
    return race_impacts(scene, size, rng, "BPFI")


EFFECT = Effect(
    name="bearing_inner_race",
    group="bearing",
    title="spall on an inner race",
    severity=parts.RACE_SEVERITY,
    changes="Rolling elements sink into a gap in the rotating race and strike its far edge, hardest in the load zone.",
    signature="Impacts at n(1 + d cos α/D)/2 per revolution of the bearing's shaft, a little more with slip, strong "
    "while the defect passes through the load zone and weak outside it: envelope lines at that order and its multiples "
    "with sidebands of one shaft order, and order 1 itself. Slightly random, so that a synchronous average removes it.",
    shows_in=parts.RACE_SHOWS_IN,
    change=partial(parts.with_race_defect, "inner"),
    options=parts.RACE_OPTIONS,
    plausible=parts.race_range("inner", "as on the outer race"),
    textbook=Textbook(
        (("envelope.inner", UP),),
        "envelope lines at the ball pass order of the inner race",
        textbook_signature,
        source="P. D. McFadden, J. D. Smith, Model for the vibration produced by a single point defect in a rolling "
        "element bearing, J. Sound Vib. 96 (1984)",
    ),
)
