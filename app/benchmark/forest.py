"""The baseline that asks the forests only: nothing is tried on the rig's twin."""

from __future__ import annotations

from app.benchmark.bare_report import bare_report
from app.benchmark.seen import Seen
from gearsig.gap.types import GapReport


def diagnose(seen: Seen) -> GapReport:
    """Return the calibrated probabilities of the forests, and what may be said of them."""
    from app.gap.prepare import conditions_of
    from app.gap.weigh import weigh
    from sims.registry import gap_simulator

    simulator = gap_simulator("cracked")
    twin = simulator.twin_of(seen.rigs[0])
    conditions, _ = conditions_of(
        seen.recordings, seen.rigs, seen.references, seen.reference_rigs, twin, seen.names, lambda *_: None
    )
    weighed = weigh(conditions, simulator.gap_effects(), (), twin, None, lambda *_: None, most_tried=0)
    probabilities = weighed.probabilities()
    return bare_report("forest", probabilities, outcome=weighed.calibration.outcome(probabilities))
