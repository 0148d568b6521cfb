"""Slices that mirror each other carry alike where nothing tells the ends of the face apart: then one stands for two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.contact_table import ContactTable

ALIKE = 1e-5
"""Relative difference up to which the two halves of the face count as alike: that of the finite elements' solver."""


def mirror_groups(n_slices: int) -> FloatArray:
    """Which group each slice belongs to, from the middle plane's ends inwards, (n_slices, n_groups) of 0 and 1.

    Examples
    --------
    >>> mirror_groups(3).tolist()
    [[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
    """
    n_groups = (n_slices + 1) // 2
    groups = np.zeros((n_slices, n_groups))
    places = np.arange(n_slices)
    groups[places, np.minimum(places, n_slices - 1 - places)] = 1.0
    return groups


def mirrors(table: ContactTable) -> bool:
    """Whether both halves of the face are alike: compliance, faults, and no misalignment."""
    if np.any(table.lead_m != 0.0) or table.n_slices < 2:
        return False
    return all(
        bool(np.max(np.abs(c - c[..., ::-1, ::-1])) <= ALIKE * np.max(np.abs(table.own)))
        for c in (table.own, table.cross, table.extra_1, table.extra_2)
    )


def folded(table: ContactTable) -> ContactTable:
    """Return the table of groups of slices: the force of a group is the sum of its slices'.

    N_s = F_g/|g| gives D_g = Σ_h mean_gh(R) F_h + B |g|^-0.9 F_g^0.9: nothing is lost.
    """
    groups = mirror_groups(table.n_slices)
    size = groups.sum(axis=0)
    mean = groups / size

    def grouped(compliance: FloatArray) -> FloatArray:
        return np.ascontiguousarray(np.einsum("sg,...st,th->...gh", mean, compliance, mean))

    return replace(
        table,
        own=grouped(table.own),
        cross=grouped(table.cross),
        extra_1=grouped(table.extra_1),
        extra_2=grouped(table.extra_2),
        lead_m=np.zeros(len(size)),
        hertz=table.hertz @ mean * size**-0.9,
    )
