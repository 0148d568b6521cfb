"""Shares of the kinds of case; apart from the plan, since a diagnoser may know them: they are public."""

SHARES = {"single": 0.60, "none": 0.15, "unknown": 0.15, "pair": 0.10}
"""Of all cases; "single" is shared evenly by the catalogue's effects, "unknown" by those outside it."""
