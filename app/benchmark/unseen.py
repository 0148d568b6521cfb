"""The diagnosis as it is of machines like none that it knows: nothing of the independent rig is in its population."""

from __future__ import annotations

from app.benchmark import diagnosers, forest
from app.benchmark.seen import Seen
from gearsig.gap.population import INDEPENDENT, without_machines_of
from gearsig.gap.types import GapReport


def diagnose(seen: Seen) -> GapReport:
    """Diagnose a case with the product, but for what was learned from the independent rig's development gears."""
    with without_machines_of(INDEPENDENT):
        return diagnosers.diagnose(seen)


def recognise(seen: Seen) -> GapReport:
    """Return what the forests say of a case without what was learned from those gears."""
    with without_machines_of(INDEPENDENT):
        return forest.diagnose(seen)
