"""Levels that are counted relative to the mesh harmonics, and what of their change is their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray


def beyond_the_mesh(names: Sequence[str], distances: FloatArray) -> FloatArray:
    """Return changes of levels as far as they hold both relative to the mesh harmonics and by themselves.

    If the mesh alone falls by 6 dB, all that is counted relative to it rises by as much, and none of it has changed; if
    a sensor's gain rises, everything does but the ratios. The smaller of both changes counts, none where signs differ.

    Parameters
    ----------
    names : sequence of str
    distances : array, (…, n)
        dB.
    """
    if "mesh.total" not in names:
        return distances
    mesh = distances[..., [list(names).index("mesh.total")]]
    sign = counted_from_the_mesh(names)
    another = distances + sign * mesh
    smaller = np.sign(distances) * np.minimum(np.abs(distances), np.abs(another))
    held: FloatArray = np.where(sign == 0.0, distances, np.where(distances * another > 0.0, smaller, 0.0))
    return held


def counted_from_the_mesh(names: Sequence[str]) -> FloatArray:
    """Return +1 for levels relative to the mesh, which added to them gives a level; −1 for levels; 0 for all else."""
    return np.array([1.0 if _is_relative(name) else -1.0 if _is_shaft_level(name) else 0.0 for name in names])


def _is_relative(name: str) -> bool:
    """Whether a feature is a level relative to the mesh harmonics."""
    family, _, rest = name.partition(".")
    last = rest.rpartition(".")[2]
    if family == "sideband":
        return last != "strongest"
    if family in ("tooth", "change"):
        return last in ("level", "elsewhere", "peak")
    return family == "shaft" and last in ("to_mesh", "low")


def _is_shaft_level(name: str) -> bool:
    return name.startswith("shaft.") and name.rpartition(".")[2].isdigit()
