"""What faulty teeth add to the compliance of each slice of a tooth pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from sims.mesh.crack import RootCrack, check_crack
from sims.mesh.gear_mesh import SOUND, GearMesh
from sims.mesh.stiffness_tooth import tooth_compliance


def fault_compliance_rows(
    mesh: GearMesh, side: int, progress: FloatArray, n_slices: int
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Added compliance of a slice over ζ, (n_variants, n, n_slices) in m/N, and the row of each tooth.

    Row 0 belongs to sound teeth. A crack makes the slices it reaches more compliant by what the potential energy of a
    cracked tooth exceeds that of a sound one; its slices hang together through the sound gear's compliance. A spall or
    chip adds as in `sims.mesh.GearMesh`, alike in every slice.

    Notes
    -----
    A crack leaves the gear's modes as they are: one tooth in fifty hardly changes them.
    """
    own = mesh.side(side)
    variant = np.zeros(own.gear.teeth, dtype=np.int64)
    rows = [np.zeros((len(progress), n_slices))]
    sound = mesh.gear_compliance(side, progress)
    for row, tooth in enumerate(own.faulty_teeth, start=1):
        faults = own.faults_of(tooth)
        lost = mesh.gear_compliance(side, progress, faults._replace(crack=SOUND.crack)) - sound
        added = np.repeat(n_slices * lost[:, None], n_slices, axis=1)
        if faults.crack is not None:
            added = added + crack_compliance(mesh, side, faults.crack, progress, n_slices)
        rows.append(added)
        variant[tooth] = row
    return np.array(rows), variant


def crack_compliance(mesh: GearMesh, side: int, crack: RootCrack, progress: FloatArray, n_slices: int) -> FloatArray:
    """What a crack adds to the compliance of each slice, (n, n_slices) in m/N.

    A slice of which the crack covers the part f has the compliance 1/(f/c_cracked + (1 − f)/c_sound), c for its width.
    """
    own = mesh.side(side)
    check_crack(own.gear, crack)
    roll = mesh.roll_length_mm(side, progress) / own.gear.base_radius_mm
    width = mesh.face_width_m / n_slices
    sound = tooth_compliance(own.gear, own.material, roll).total / width
    reach = mesh.face_width_m if crack.width_mm is None else min(crack.width_mm * 1e-3, mesh.face_width_m)
    added = np.zeros((len(roll), n_slices))
    for s in range(n_slices):
        part = float(np.clip(reach / width - s, 0.0, 1.0))
        if part > 0.0:
            middle = (s + 0.5 * part) * width / reach
            depth = crack.depth_mm * (float(np.sqrt(1.0 - middle)) if crack.front == "parabolic" else 1.0)
            cracked = tooth_compliance(own.gear, own.material, roll, (depth, crack.angle_deg)).total / width
            added[:, s] = 1.0 / (part / cracked + (1.0 - part) / sound) - sound
    return added
