"""All changes by name."""

from __future__ import annotations

from sims.blind.changes import bearing, chain, drive, flank, outside, shaft, tooth
from sims.blind.changes.change import Change

CATALOGUE: dict[str, Change] = {
    change.name: change for family in (tooth, flank, shaft, drive, bearing, chain) for change in family.CHANGES
}
"""The 19 effects that have a name on the diagnosing side."""
OUTSIDE: dict[str, Change] = {change.name: change for change in outside.CHANGES}
"""What has none."""
CHAIN_GROUP = "measurement chain"
MECHANICAL: tuple[str, ...] = tuple(name for name, change in CATALOGUE.items() if change.group != CHAIN_GROUP)
"""The 16 effects of the machine itself."""
EVERY: dict[str, Change] = CATALOGUE | OUTSIDE
