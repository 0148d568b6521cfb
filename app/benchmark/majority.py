"""The baseline that looks at nothing: it always answers with the shares of the kinds of case."""

from __future__ import annotations

from app.benchmark.bare_report import bare_report
from app.benchmark.seen import Seen
from app.benchmark.shares import SHARES
from gearsig.gap.types import NONE, UNKNOWN, GapReport
from sims.effects import effects


def diagnose(seen: Seen) -> GapReport:  # noqa: ARG001 - that is the point of it
    """Return the shares; the likeliest is "none"."""
    of_each = (SHARES["single"] + SHARES["pair"]) / len(effects())
    return bare_report(
        "majority", {NONE: SHARES["none"], UNKNOWN: SHARES["unknown"], **dict.fromkeys(effects(), of_each)}
    )
