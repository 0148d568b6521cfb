"""What recordings at several operating conditions say together."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from gearsig.gap.tooth_load import LIGHT_LOAD_N_PER_MM
from gearsig.gap.types import NONE

NOT_SEEN = 0.4
"""Probability that an effect is too weak to be seen at one of several conditions."""

NOT_SEEN_LOADED = {"backlash": 0.9}
"""The same at a condition whose load keeps the flanks together, where another one lets them part."""


def joint_probabilities(
    found: Sequence[Mapping[str, float]], loads_n_per_mm: Sequence[float], allowed: Collection[str]
) -> dict[str, float]:
    """Return the joint probabilities of several conditions, which are independent of each other.

    At one of several conditions an effect may not show, q: p(x|e) = (1 − q) p_forest(x|e) + q p_forest(x|none).

    Parameters
    ----------
    found : sequence of mapping
        Cause → probability, of each condition.
    loads_n_per_mm : sequence of float
        Of the teeth, at each; nan where it is not known.
    allowed : collection of str
        Causes, those of no effect among them.
    """
    parts_somewhere = any(load <= LIGHT_LOAD_N_PER_MM for load in loads_n_per_mm)
    joint = dict.fromkeys(sorted(allowed), 1.0)
    for at, load in zip(found, loads_n_per_mm, strict=True):
        loaded = parts_somewhere and load > LIGHT_LOAD_N_PER_MM
        for name in joint:
            unseen = 0.0 if len(found) == 1 else NOT_SEEN_LOADED.get(name, NOT_SEEN) if loaded else NOT_SEEN
            joint[name] *= (1.0 - unseen) * at[name] + unseen * at[NONE]
    total = sum(joint.values())
    return {name: p / total for name, p in joint.items()}
