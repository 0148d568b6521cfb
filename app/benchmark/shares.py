"""Shares of the kinds of case; apart from the plan, since a diagnoser may know them: they are public."""

from __future__ import annotations

from collections.abc import Mapping

SHARES = {"single": 0.60, "none": 0.15, "unknown": 0.15, "pair": 0.10}
"""Of all cases; "single" is shared evenly by the catalogue's effects, "unknown" by those outside it."""


def counts_of(shares: Mapping[str, float], n_cases: int) -> dict[str, int]:
    """Return whole numbers of cases in these shares, by largest remainder: together they are `n_cases`."""
    exact = {kind: share * n_cases for kind, share in shares.items()}
    counts = {kind: int(value) for kind, value in exact.items()}
    missing = n_cases - sum(counts.values())
    for kind in sorted(exact, key=lambda k: counts[k] - exact[k])[:missing]:
        counts[kind] += 1
    return counts
