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
        Evidence(
            feature_words(fit.path.names[i], frame),
            float(predicted[i]),
            float(clearest.distances[i]),
            float(clearest.floors[i]),
            _agrees(float(predicted[i]), float(clearest.distances[i]), float(clearest.floors[i])),
        )
        for i in telling[:MOST]
    )


def _agrees(predicted_db: float, observed_db: float, floor_db: float) -> bool:
    """Whether both are clear, of one sign and of one size; or differ by less than the floor."""
    if abs(predicted_db) < CLEAR * floor_db:
        return False  # it was observed, and this effect does not explain it
    if abs(predicted_db - observed_db) <= floor_db:
        return True
    return AGREES <= observed_db / predicted_db <= 1.0 / AGREES
