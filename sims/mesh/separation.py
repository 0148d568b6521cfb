"""Metal missing on the flanks of each tooth, over the path of contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from sims.mesh.chip import chip_separation_m
from sims.mesh.deviation import flank_separation_m
from sims.mesh.flank import arc_length_mm, contact_ends_mm
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.roughness import FlankRoughness
from sims.mesh.spall import spall_separation_m
from sims.mesh.wear import wear_profile


def separation_rows(mesh: GearMesh, number: int, progress: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Rows of separation of one gear over ζ, in m, and the row of each tooth.

    Row 0 is an ordinary tooth; each faulty tooth has a row of its own. With roughness, row i is tooth i.
    """
    side, rho = mesh.side(number), mesh.roll_length_mm(number, progress)
    ordinary = _ordinary(mesh, number, progress)
    n_teeth = side.gear.teeth
    if side.roughness is None:
        teeth = side.faulty_teeth
        rows = np.tile(ordinary, (1 + len(teeth), 1))
        surface = np.zeros(n_teeth, dtype=np.int64)
        surface[list(teeth)] = np.arange(1, 1 + len(teeth))
    else:
        rows = ordinary - roughness_heights_m(mesh, number, side.roughness, rho)
        surface = np.arange(n_teeth)
    for tooth in side.faulty_teeth:
        _, spall, chip = side.faults_of(tooth)
        if spall is not None:
            rows[surface[tooth]] += spall_separation_m(mesh.pair, number, spall, rho)
        if chip is not None:
            rows[surface[tooth]] += chip_separation_m(mesh.pair, number, chip, rho)
    return rows, surface


def roughness_heights_m(
    mesh: GearMesh, number: int, roughness: FlankRoughness, roll_length_mm: FloatArray
) -> FloatArray:
    """Heights of all teeth of a gear, (z, n), above 0 into the gap.

    The position on a flank is the arc length from the root end of its contact: a profile is fixed to the metal, over
    which the contact moves slower than along the line of action, and faster towards the tip.
    """
    gear = mesh.side(number).gear
    origin = arc_length_mm(gear, contact_ends_mm(mesh.pair, number)[0])
    place_m = (arc_length_mm(gear, roll_length_mm) - origin) * 1e-3
    return roughness.height_m(np.arange(gear.teeth)[:, None], place_m)


def _ordinary(mesh: GearMesh, number: int, progress: FloatArray) -> FloatArray:
    side, rho = mesh.side(number), mesh.pair.contact_radii_mm(progress)[number - 1]
    worn = side.flank.wear_um * 1e-6 * wear_profile(mesh.pair, number, rho)
    result: FloatArray = flank_separation_m(side.gear, side.flank, rho) + worn
    return result
