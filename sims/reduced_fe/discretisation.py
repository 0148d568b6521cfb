"""How far a mesh is from a finer one: natural frequencies and the compliance of a tooth."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.reduced_fe.cyclic import CyclicGear, Held
from sims.reduced_fe.cyclic_modes import CyclicModes, cyclic_modes
from sims.reduced_fe.mesh_size import mesh_size_for
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.sector_mesh import sector_mesh
from sims.reduced_fe.tooth_load import ToothLoad, load_tooth

FINER_DOF = 150_000
"""Of the mesh that coarser ones are compared with; its own first frequency is 0.2 % above that of a million."""


class DiscretisationError(NamedTuple):
    """A mesh against a finer one.

    Attributes
    ----------
    finer_dof : int
    frequency : array, (n,)
        Relative error of each frequency, of modes with the same nodal diameters in the same order.
    compliance : float
        Relative error of the tooth's compliance under the same force.
    """

    finer_dof: int
    frequency: FloatArray
    compliance: float


def discretisation_error(
    gear: CyclicGear, modes: CyclicModes, load: ToothLoad, held: Held = "free", *, elastic: bool = True
) -> DiscretisationError:
    """Solve modes and load again on a mesh of `FINER_DOF`.

    Parameters
    ----------
    gear : CyclicGear
        Coarser than that.
    modes : CyclicModes
        Of it, as `cyclic_modes` found them with `held` and `elastic`.
    load : ToothLoad
    held : str
    elastic : bool
    """
    blank = gear.mesh.blank
    mesh = sector_mesh(blank, mesh_size_for(blank, FINER_DOF))
    wanted = int(modes.multiplicity(gear.n_sectors).sum())
    with one_thread():
        finer = cyclic_modes(CyclicGear(mesh, gear.hub_stiffness), wanted + 8, held, elastic=elastic)
    own, theirs = _by_diameter(modes), _by_diameter(finer)
    ratio = [own[name] / theirs[name] - 1.0 for name in own if name in theirs]
    again = load_tooth(mesh, load.force_n, load.roll_rad)
    return DiscretisationError(mesh.n_dof, np.array(ratio), load.push_m / again.push_m - 1.0)


def _by_diameter(modes: CyclicModes) -> dict[tuple[int, int], float]:
    """Frequencies by nodal diameters and rank among those with as many; rigid motions left out."""
    seen: Counter[int] = Counter()
    found = {}
    for hertz, n in zip(modes.frequencies_hz, modes.nodal_diameters, strict=True):
        seen[int(n)] += 1
        if hertz > 1.0:
            found[int(n), seen[int(n)]] = float(hertz)
    return found
