"""How many coefficients may be held at once."""

from __future__ import annotations

from gearsig.errors import InputError

MOST_COEFFICIENTS = 1 << 28
"""Complex coefficients that are held at once: 2 GB."""


def check_size(n_lines: int, n_columns: int) -> None:
    """Raise if the coefficients would take more than 2 GB."""
    if n_lines * n_columns > MOST_COEFFICIENTS:
        raise InputError(
            f"{n_lines} lines × {n_columns} columns make {8e-9 * n_lines * n_columns:.3g} GB of coefficients",
            where="step",
            allowed=f"at most {8e-9 * MOST_COEFFICIENTS:.2g} GB",
            remedy=f"set step to {-(-n_lines * n_columns // MOST_COEFFICIENTS)} times as much, or take the map",
        )
