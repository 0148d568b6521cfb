"""The comb of orders that a gear train puts into a spectrum: mesh harmonics, sidebands, shaft harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.rig.ratios import shaft_ratios
from gearsig.rig.types import Rig

N_MESH_HARMONICS = 5
N_SIDEBANDS = 2
N_SHAFT_HARMONICS = 3
Stages = tuple[tuple[float, tuple[float, ...]], ...]

_SAME = 0.02  # orders closer than this are one line


@dataclass(frozen=True)
class CombLines:
    """Orders of the reference shaft at which a gear train speaks.

    Parameters
    ----------
    orders : array, (n_lines,)
    is_mesh : array of bool, (n_lines,)
        Mesh harmonics; the others are sidebands and shaft harmonics, which tell the scale of the speed.
    stages : tuple of (float, tuple of float)
        Mesh order and orders of the shafts in mesh, per stage.
    """

    orders: FloatArray
    is_mesh: FloatArray
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
    mesh = [k * m for m, _ in stages for k in range(1, N_MESH_HARMONICS + 1)]
    side = [
        k * m + sign * j * shaft
        for m, shafts in stages
        for k in range(1, N_MESH_HARMONICS)
        for shaft in shafts
        for j in range(1, N_SIDEBANDS + 1)
        for sign in (-1, 1)
    ]
    turning = {round(s, 9) for _, shafts in stages for s in shafts}
    side += [k * s for s in turning for k in range(1, N_SHAFT_HARMONICS + 1)]
    mesh = _distinct(mesh, [])
    side = _distinct([order for order in side if order > 0.05], mesh)
    return CombLines(np.array(mesh + side), np.arange(len(mesh) + len(side)) < len(mesh), stages)


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


def _distinct(orders: list[float], taken: list[float]) -> list[float]:
    found: list[float] = []
    for order in sorted(orders):
        if all(abs(order - other) > _SAME for other in found[-1:]) and all(abs(order - t) > _SAME for t in taken):
            found.append(order)
    return found
