"""The comb of orders that a gear train puts into a spectrum: mesh harmonics, sidebands, shaft harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.rig.ratios import shaft_ratios
from gearsig.rig.types import Rig

N_MESH_HARMONICS = 5
N_SIDEBANDS = 2
N_SHAFT_HARMONICS = 3
IntArray = NDArray[np.integer[Any]]
BoolArray = NDArray[np.bool_]
Stages = tuple[tuple[float, tuple[float, ...]], ...]

# Odds that a line of the comb is there at all. They tell a speed from its half: low harmonics and near sidebands are
# likelier.
PRESENCE = (0.8, 0.6, 0.4, 0.25)
_MESH_CLASSES = (0, 1, 2, 2, 3)
_SIDEBAND_CLASSES = (1, 3)
_SHAFT_CLASSES = (1, 2, 3)

_SAME = 0.02  # orders closer than this are one line


@dataclass(frozen=True)
class CombLines:
    """Orders of the reference shaft at which a gear train speaks.

    Parameters
    ----------
    orders : array, (n_lines,)
    presence : array of int, (n_lines,)
        How likely each line is there, index into `PRESENCE`.
    is_mesh : array of bool, (n_lines,)
        Mesh harmonics; the others are sidebands and shaft harmonics, which tell the scale of the speed.
    stages : tuple of (float, tuple of float)
        Mesh order and orders of the shafts in mesh, per stage.
    """

    orders: FloatArray
    presence: IntArray
    is_mesh: BoolArray
    stages: Stages

    @property
    def meshes(self) -> tuple[float, ...]:
        """Fundamental mesh orders, lowest first."""
        return tuple(sorted({m for m, _ in self.stages}))

    @property
    def highest(self) -> float:
        """Highest order of all."""
        return float(self.orders.max())


def comb_of_rig(rig: Rig) -> CombLines | None:
    """Return the comb of a rig, None if no mesh order is known.

    Each mesh that can be related to the reference shaft takes part, with sidebands of the shafts whose ratio is known.
    """
    ratios = shaft_ratios(rig)
    known = [(p, m) for p in rig.pairs if (m := rig.mesh_order(p)) is not None]
    if not known:
        return None
    stages = [(m, tuple(ratios[s] for s in (p.driver, p.driven) if s in ratios)) for p, m in known]
    return comb_of_stages(tuple(stages))


def comb_of_stages(stages: Stages) -> CombLines:
    """Return the comb of (mesh order, shaft orders) per stage."""
    turning = {round(s, 9) for _, shafts in stages for s in shafts}
    lines = [(k * m, _MESH_CLASSES[k - 1]) for m, _ in stages for k in range(1, N_MESH_HARMONICS + 1)]
    n_mesh = len(lines)
    lines += [(k * s, _SHAFT_CLASSES[k - 1]) for s in turning for k in range(1, N_SHAFT_HARMONICS + 1)]
    lines += [
        (k * m + sign * j * shaft, _SIDEBAND_CLASSES[j - 1])
        for m, shafts in stages
        for k in range(1, N_MESH_HARMONICS)
        for shaft in shafts
        for j in range(1, N_SIDEBANDS + 1)
        for sign in (-1, 1)
    ]
    orders: list[float] = []
    classes: list[int] = []
    is_mesh: list[bool] = []
    # Where two lines fall together, the likelier one counts: mesh before the rest, then by class.
    ranked = sorted(enumerate(lines), key=lambda item: (item[0] >= n_mesh, item[1][1], item[1][0]))
    for place, (order, presence) in ranked:
        if order > 0.05 and all(abs(order - other) > _SAME for other in orders):
            orders.append(order)
            classes.append(presence)
            is_mesh.append(place < n_mesh)
    return CombLines(np.array(orders), np.array(classes), np.array(is_mesh), stages)


def with_other_teeth(comb: CombLines) -> list[CombLines]:
    """Return the combs of the same shafts with one to four teeth more or less on each stage's first gear.

    A series of harmonics that has no mesh in it, such as a bearing's, fits them all alike.
    """
    others = []
    for change in (-4, -3, -2, -1, 1, 2, 3, 4):
        stages = tuple((m + change * (shafts[0] if shafts else 1.0), shafts) for m, shafts in comb.stages)
        if all(m > 0 for m, _ in stages):
            others.append(comb_of_stages(stages))
    return others
