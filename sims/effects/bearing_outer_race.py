"""Effect: a spall on the outer race of a bearing."""

from __future__ import annotations

from functools import partial

import numpy as np

from sims.effects import _parts as parts
from sims.effects._effect import Effect
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, race_impacts


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Impacts of equal size when elements pass the defect."""
    return race_impacts(scene, size, rng, "BPFO")


EFFECT = Effect(
    name="bearing_outer_race",
    group="bearing",
    title="spall on an outer race",
    severity=parts.RACE_SEVERITY,
    changes="Rolling elements sink into a gap in the stationary race and strike its far edge. From about 0.5 mm on "
    "they carry no load there, and the impacts no longer grow but last longer.",
    signature="An impact for every element that passes, n(1 − d cos α/D)/2 per revolution of the bearing's shaft less "
    "slip: lines at that order and its multiples in the envelope about a resonance, nearly equal in strength as the "
    "load zone does not move; not a multiple of any shaft order, and slightly random, so that a synchronous average "
    "removes it.",
    shows_in=parts.RACE_SHOWS_IN,
    change=partial(parts.with_race_defect, "outer"),
    options=parts.RACE_OPTIONS,
    plausible=parts.race_range(
        "outer", "of the rolling element's diameter; beyond about half a millimetre the impacts no longer grow"
    ),
    textbook=Textbook(
        (("envelope.outer", UP),),
        "envelope lines at the ball pass order of the outer race",
        textbook_signature,
        source="P. D. McFadden, J. D. Smith, Model for the vibration produced by a single point defect in a rolling "
        "element bearing, J. Sound Vib. 96 (1984)",
    ),
)
