"""The motion of every node in a mode, for figures and files."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.reduced_fe.cyclic import CyclicGear
from sims.reduced_fe.cyclic_modes import CyclicModes

MOSTLY = 0.9
"""Part of a mode's kinetic energy from which on the gear moves as a whole."""
RIGID = (("moves along the shaft", "turns about the shaft"), ("moves across the shaft", "tilts"))
"""Motions of `CyclicGear.rigid` with 0 and with 1 nodal diameter."""


def rigid_part(gear: CyclicGear, modes: CyclicModes, which: int) -> str:
    """How the gear moves as a whole in a mode, where nine tenths of the kinetic energy are of one such motion."""
    n = int(modes.nodal_diameters[which])
    if n > 1:
        return ""
    moving = np.asarray(gear.mass.at(gear.phase_rad(n)) @ modes.shapes[:, which])
    energy = float(np.vdot(modes.shapes[:, which], moving).real)
    part = np.abs(gear.rigid(n).conj().T @ moving) ** 2 / energy
    most = int(np.argmax(part))
    return RIGID[n][most] if part[most] > MOSTLY else ""


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
