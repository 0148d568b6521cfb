"""Effect: a spall on the outer race of a bearing."""

from __future__ import annotations

from functools import partial

import numpy as np

from sims.effects import _parts as parts
from sims.effects._effect import Effect
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, race_impacts


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Knocks when elements pass the defect, all alike."""
    return race_impacts(scene, size, rng, "BPFO")


EFFECT = Effect(
    name="bearing_outer_race",
    group="bearing",
    title="spall on an outer race",
    severity=parts.RACE_SEVERITY,
    changes="Rolling elements sink into a gap of the standing race and strike its far edge. From about 0.5 mm on they "
    "carry nothing there, and the knocks grow no more; they last longer.",
    signature="A knock for every element that passes, n(1 − d cos α/D)/2 per revolution of the bearing's shaft less "
    "slip: lines of that order and its multiples in the envelope about a resonance, all nearly as strong as the load "
    "zone does not move; not a multiple of any shaft order, and slightly random, so that a synchronous average takes "
    "it away.",
    shows_in=parts.RACE_SHOWS_IN,
    change=partial(parts.with_race_defect, "outer"),
    options=parts.RACE_OPTIONS,
    plausible=parts.race_range(
        "outer", "of the rolling element's diameter; beyond half a millimetre or so the knocks grow no more"
    ),
    textbook=Textbook(
        (("envelope.outer", UP),),
        "envelope lines at the ball pass order of the outer race",
        textbook_signature,
        source="P. D. McFadden, J. D. Smith, Model for the vibration produced by a single point defect in a rolling "
        "element bearing, J. Sound Vib. 96 (1984)",
    ),
)
