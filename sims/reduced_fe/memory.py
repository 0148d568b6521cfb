"""Memory that a computation will need, estimated before it starts."""

from __future__ import annotations

from gearsig.errors import InputError
from gearsig.recording.free_memory import free_memory_bytes
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.mesh_size import MeshSize, n_dof_of

BASE_BYTES = 250e6
"""Interpreter and libraries."""

MOST_PART = 0.9
"""Of the free memory that may be taken."""


def sector_bytes(blank: GearBlank, size: MeshSize) -> float:
    """Peak of a cyclic reduction: matrices and factors of one sector, which fill about as n^1.4.

    Measured, whole gear of 50 teeth: 0.29 GB at 300 000 and 0.36 GB at 510 000 degrees of freedom.
    """
    n = n_dof_of(blank, size) / blank.n_teeth
    return float(BASE_BYTES + 16.0 * (900.0 * n + 14.0 * n**1.4))


def craig_bampton_bytes(blank: GearBlank, size: MeshSize, n_compared: int) -> float:
    """Peak of a Craig–Bampton reduction, where the auxiliary nodes are chosen among all: about 13 fields of each mode.

    Measured: 0.89 GB at 300 000 degrees of freedom and 20 modes.
    """
    return sector_bytes(blank, size) + 13.0 * 8.0 * n_compared * n_dof_of(blank, size)


def full_bytes(n_dof: int) -> float:
    """Peak of a direct solution of the whole gear: matrices and factors, which fill about as n^1.25.

    Measured: 0.35 GB at 31 500 and 0.85 GB at 72 000 degrees of freedom.
    """
    return float(BASE_BYTES + 12.0 * (150.0 * n_dof + 38.0 * n_dof**1.25))


def check_memory(needed_bytes: float, free_bytes: float | None = None) -> None:
    """Refuse a computation that will not fit.

    Parameters
    ----------
    needed_bytes : float
    free_bytes : float or None
        None: what the system has free now; where it cannot tell, nothing is refused.

    Raises
    ------
    InputError
        With both numbers.
    """
    free = free_memory_bytes() if free_bytes is None else free_bytes
    if free is not None and needed_bytes > MOST_PART * free:
        raise InputError(
            f"about {needed_bytes / 1e9:.2g} GB of memory are needed, {free / 1e9:.2g} GB are free",
            allowed=f"at most {MOST_PART:.0%} of the free memory",
            remedy="take a coarser mesh, or close other programs",
        )
