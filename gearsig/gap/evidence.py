"""What speaks for an effect and what against it: predicted changes beside observed ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.gap.families import family_members
from gearsig.gap.frame import GearFrame
from gearsig.gap.prediction import Fit, Observed
from gearsig.gap.types import Evidence
from gearsig.gap.words import feature_words

MOST, MOST_OF_A_FAMILY = 10, 3
CLEAR = 1.0
"""Floors from which a change, predicted or observed, says something."""

SMALLEST = 0.3
"""Floors from which the sign of a prediction says something."""

OWN_COUNTS = 2.0

AGREES = 0.5
"""Observed over predicted, from here to its inverse, speaks for the effect."""


def evidence_of(fit: Fit, observed: Sequence[Observed], frame: GearFrame) -> tuple[Evidence, ...]:
    """Return the most telling features of each family, clearest first; of the condition that shows most.

    What the effect would change counts twice as much as what it would not: its own features must be among them.

    Parameters
    ----------
    fit : Fit
    observed : sequence of Observed
        One per condition.
    frame : GearFrame
    """
    clearest = max(observed, key=lambda one: float(np.abs(one.normalised).max()))
    predicted = fit.at(clearest.condition)
    sizes = np.maximum(OWN_COUNTS * np.abs(predicted), np.abs(clearest.distances)) / clearest.floors
    clear = np.maximum(np.abs(predicted), np.abs(clearest.distances)) >= CLEAR * clearest.floors
    best = [
        int(i)
        for rows in family_members(fit.path.names).values()
        for i in rows[np.argsort(-sizes[rows], kind="stable")][:MOST_OF_A_FAMILY]
    ]
    telling = sorted((i for i in best if clear[i]), key=lambda i: -sizes[i])
    return tuple(
        weighed_evidence(
            feature_words(fit.path.names[i], frame),
            float(predicted[i]),
            float(clearest.distances[i]),
            float(clearest.floors[i]),
        )
        for i in telling[:MOST]
    )


def weighed_evidence(
    feature: str, predicted_db: float, observed_db: float, floor_db: float, *, least: float = CLEAR
) -> Evidence:
    """Return a predicted change beside the observed one, with what it says of the effect.

    It speaks for the effect where both are of one sign and one size; or, where the prediction is beyond the floor,
    differ by less than that. What moved the predicted way and further is no evidence against it where the prediction is
    beyond the floor, or what it leaves is within: the simulator's size of the effect is uncertain, and something else
    may have moved it, too. What was not predicted, did not come, or moved the other way is.

    Parameters
    ----------
    feature : str
        In words.
    predicted_db, observed_db, floor_db : float
    least : float
        Floors from which a prediction of the right size speaks for the effect.
    """
    size, left = abs(predicted_db), abs(predicted_db - observed_db)
    if size == 0.0 or size < SMALLEST * floor_db:
        return Evidence(feature, predicted_db, observed_db, floor_db, speaks_for=False)
    ratio, is_clear = observed_db / predicted_db, size >= CLEAR * floor_db
    alike = size >= least * floor_db and AGREES <= ratio <= 1.0 / AGREES
    agrees = alike or (is_clear and left <= floor_db)
    further = not agrees and ratio > 1.0 and (is_clear or left <= floor_db)
    return Evidence(feature, predicted_db, observed_db, floor_db, agrees, further)
