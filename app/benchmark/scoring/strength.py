"""How strong a case's fault is, measured by its twin: the same run from the same seeds without the fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from app.benchmark.make import Truth
from gearsig.errors import InputError
from gearsig.gap.floors import StructuralFloor, soft_size

STRONG = 3.0
"""Structural floors from which on a fault should be found."""

FEWEST_HEALTHY = 8
"""Healthy cases of which a floor can be made."""

Floors = Mapping[bool, StructuralFloor | None]
"""With a reference (True) and without (False); None: not known."""


def known_floors(truths: Sequence[Truth]) -> Floors:
    """Return the floors that the diagnosis itself uses, or the batch's own where none come with this version."""
    from gearsig.gap.population import load_population

    try:
        population = load_population()
        return {with_reference: population.floor(with_reference=with_reference) for with_reference in (False, True)}
    except InputError:
        return batch_floors(truths)


def batch_floors(truths: Sequence[Truth]) -> dict[bool, StructuralFloor | None]:
    """Return floors from how the batch's own healthy cases scatter.

    Without a reference that is the scatter among machines, which is more than between a machine and its simulation:
    the strengths come out low.
    """
    alone = [t.healthy for t in truths if t.healthy]
    changes = [t.healthy_change for t in truths if t.healthy_change]
    return {False: _floor(alone), True: _floor(changes)}


def _floor(rows: Sequence[Mapping[str, float]]) -> StructuralFloor | None:
    if len(rows) < FEWEST_HEALTHY:
        return None
    names = tuple(rows[0])
    return StructuralFloor.of_healthy(names, np.array([[row[name] for name in names] for row in rows]))


def strength(truth: Truth, floors: Floors) -> float:
    """Return the size of the change that the fault alone makes, in structural floors; nan where it cannot be said.

    It is measured like the whole gap, see `gearsig.gap.floors.gap_size`; of two conditions the larger counts.
    """
    floor = floors[bool(truth.labels["has_reference"])]
    if floor is None:
        return float("nan")
    known = [name for name in floor.names if all(name in change for change in truth.fault_changes)]
    own = floor.of(known)
    sizes = [
        soft_size(known, np.array([change[name] for name in known]) / own) / floor.whole_of(known)
        for change in truth.fault_changes
        if change
    ]
    return max(sizes, default=float("nan"))
