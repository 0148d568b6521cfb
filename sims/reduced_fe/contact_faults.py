"""What faulty teeth add to the compliance between the slices of a tooth pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from sims.mesh.gear_mesh import SOUND, GearMesh
from sims.reduced_fe.contact_path import over_height, rolls_rad
from sims.reduced_fe.crack_table import crack_added_m_per_n
from sims.reduced_fe.reduced_gear import ReducedGear


def fault_compliance_rows(
    gear: ReducedGear, mesh: GearMesh, side: int, progress: FloatArray
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Added compliance over ζ, (n_variants, n, n_slices, n_slices) in m/N, and the row of each tooth.

    Row 0 belongs to sound teeth. A crack adds what finite elements of the cracked tooth yield more than those of the
    sound one, see `sims.reduced_fe.cracked_tooth`. A spall or chip adds as in `sims.mesh.GearMesh`, alike in every
    slice.

    Notes
    -----
    A crack leaves the gear's modes as they are: one tooth in fifty hardly changes them.
    """
    own, n_slices = mesh.side(side), len(gear.grid.z_m)
    variant = np.zeros(own.gear.teeth, dtype=np.int64)
    rows = [np.zeros((len(progress), n_slices, n_slices))]
    sound = mesh.gear_compliance(side, progress)
    roll = rolls_rad(mesh.pair, progress)[side - 1]
    for row, tooth in enumerate(own.faulty_teeth, start=1):
        faults = own.faults_of(tooth)
        lost = mesh.gear_compliance(side, progress, faults._replace(crack=SOUND.crack)) - sound
        added = n_slices * lost[:, None, None] * np.eye(n_slices)
        if faults.crack is not None:
            added = added + over_height(gear.grid.roll_rad, crack_added_m_per_n(gear, faults.crack), roll)
        rows.append(added)
        variant[tooth] = row
    return np.array(rows), variant
