"""What a forest sees of a change: sizes, directions, and which of two places changed more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.gear_lines import N_MESH_HARMONICS, SIDES

_OF_A_SHAFT = (
    ("shaft.{}.2", "shaft.{}.1"),
    ("shaft.{}.3", "shaft.{}.2"),
    ("shaft.{}.strongest.to_mesh", "shaft.{}.1"),
    ("shaft.{}.strongest.to_mesh", "shaft.{}.2"),
    ("shaft.{}.1", "sideband.{}.1"),
    ("shaft.{}.2", "sideband.{}.2"),
    ("sideband.{}.2", "sideband.{}.1"),
    ("sideband.{}.3to5", "sideband.{}.1"),
    ("sideband.{}.6to12", "sideband.{}.1"),
    ("tooth.{}.level", "sideband.{}.1"),
    ("tooth.{}.peak", "tooth.{}.level"),
    ("tooth.{}.prominence", "tooth.{}.level"),
)
_OF_A_DIFFERENCE = (
    ("surprise.{}.level", "sideband.{}.1"),
    ("surprise.{}.peak", "surprise.{}.level"),
    ("surprise.{}.kurtosis", "surprise.{}.level"),
    ("surprise.{}.second", "surprise.{}.prominence"),
)
_BETWEEN_SHAFTS = ("sideband.{}.1", "sideband.{}.6to12", "shaft.{}.1", "shaft.{}.2", "tooth.{}.level")
_OF_ALL = (
    ("envelope.outer", "envelope.inner"),
    ("envelope.outer", "envelope.ball"),
    ("envelope.inner", "envelope.ball"),
    ("envelope.inner", "envelope.strange"),
    ("envelope.outer", "envelope.strange"),
    ("line.outer", "envelope.outer"),
    ("floor.total", "mesh.total"),
    ("floor.band.4", "floor.band.1"),
    ("floor.kurtosis.4", "floor.band.4"),
    ("raw.near_the_extreme", "raw.kurtosis"),
)


def seen_rows(names: Sequence[str], distances: FloatArray) -> FloatArray:
    """Return part of the rows that a forest is fitted to.

    Simulators and machines agree on which lines an effect moves and in which direction, not on how far: beside the
    compressed sizes stand shares of the largest change, and differences of what tells one effect from another.

    Parameters
    ----------
    names : sequence of str
        Of changes, see `gearsig.gap.change` or `gearsig.gap.features`.
    distances : array, (n_rows, n)
        Changes in units that healthy machines reach.

    Returns
    -------
    array, (n_rows, m)
    """
    size = np.sign(distances) * np.log1p(np.abs(distances))
    largest = np.maximum(np.abs(size).max(axis=1, keepdims=True), 1e-9)
    place = {name: i for i, name in enumerate(names)}
    apart = [size[:, place[a]] - size[:, place[b]] for a, b in _pairs(place)]
    mesh = np.stack(
        [size[:, place[f"mesh.share.{k}"]] + size[:, place["mesh.total"]] for k in range(1, N_MESH_HARMONICS + 1)]
    )
    rows: FloatArray = np.column_stack([size, size / largest, *apart, mesh.min(axis=0), mesh.max(axis=0)])
    return rows


def _pairs(place: dict[str, int]) -> list[tuple[str, str]]:
    of_a_shaft = _OF_A_SHAFT + _OF_A_DIFFERENCE
    found = [(a.format(side), b.format(side)) for side in SIDES for a, b in of_a_shaft]
    found += [(name.format(SIDES[0]), name.format(SIDES[1])) for name in _BETWEEN_SHAFTS]
    return [pair for pair in (*found, *_OF_ALL) if pair[0] in place and pair[1] in place]


def mirrored(names: Sequence[str]) -> np.ndarray:
    """Return the places of the features with driver and driven gear exchanged.

    What a fault of the driver does to the driver's features, one of the driven gear does to that gear's.
    """
    place = {name: i for i, name in enumerate(names)}
    first, second = SIDES
    return np.array([place[name.replace(first, "\0").replace(second, first).replace("\0", second)] for name in names])
