"""The motion of every node in a mode, for figures and files."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.reduced_fe.cyclic import CyclicGear
from sims.reduced_fe.cyclic_modes import CyclicModes


def mode_field(gear: CyclicGear, modes: CyclicModes, which: int, *, sine: bool = False) -> FloatArray:
    """Return a real mode at all nodes, (n_teeth, n_nodes, 3), x, y, z in the axes of each sector; modal mass 1 kg.

    Parameters
    ----------
    gear : CyclicGear
    modes : CyclicModes
    which : int
        Place among the shapes.
    sine : bool
        The second mode of a pair.

    Raises
    ------
    InputError
        If there is no such mode.
    """
    if not 0 <= which < len(modes.frequencies_hz):
        raise InputError(f"which is {which}", allowed=f"0 to {len(modes.frequencies_hz) - 1}")
    n = int(modes.nodal_diameters[which])
    if sine and modes.multiplicity(gear.n_sectors)[which] == 1:
        raise InputError(f"mode {which} has {n} nodal diameters and is single", remedy="leave out sine")
    waves = np.exp(1j * gear.phase_rad(n) * np.arange(gear.n_sectors))[:, None] * modes.shapes[:, which]
    return gear.sector_fields(waves.imag if sine else waves.real)
