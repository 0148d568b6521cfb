"""The baseline that asks the forests only: nothing is tried on the rig's twin."""

from __future__ import annotations

from app.benchmark.bare_report import bare_report
from app.benchmark.seen import Seen
from gearsig.gap.types import GapReport


def diagnose(seen: Seen) -> GapReport:
    """Return the calibrated probabilities of the forests, what may be said of them, and the shaft that shows it."""
    from app.gap.prepare import conditions_of
    from app.gap.weigh import weigh
    from gearsig.gap.which_shaft import told_options
    from sims.registry import gap_simulator

    simulator = gap_simulator("cracked")
    twin = simulator.twin_of(seen.rigs[0])
    conditions, _ = conditions_of(
        seen.recordings, seen.rigs, seen.references, seen.reference_rigs, twin, seen.names, lambda *_: None
    )
    weighed = weigh(conditions, simulator.gap_effects(), (), twin, None, lambda *_: None, most_tried=0)
    probabilities = weighed.probabilities()
    changes, teeth = [condition.over_floors for condition in conditions], conditions[0].now.frame.teeth
    shafts = {name: told_options(name, changes, teeth) for name in probabilities}
    return bare_report("forest", probabilities, shafts, weighed.calibration.outcome(probabilities))
