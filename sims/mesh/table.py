"""The mesh as arrays over its progress, which compiled code reads while it integrates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count
from sims.mesh.deviation import pitch_separation_m
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.separation import separation_rows


@dataclass(frozen=True)
class MeshTable:
    """Compliance and separation of a tooth pair over ζ, base pitches since its ideal entry.

    A pair made of tooth i of the driver and tooth j of the driven gear has the compliance
    compliance_1[variant_1[i]] + compliance_2[variant_2[j]] + that of the contact, and the separation
    separation_1_m[surface_1[i]] + separation_2_m[surface_2[j]] + pitch_1_m[i] + pitch_2_m[j].

    Parameters
    ----------
    start, step : float
        ζ of the first column and between columns; one column lies beyond either end, for cubic interpolation. All
        rows share the columns: n = `n_points` + 2.
    compliance_1, compliance_2 : arrays, (n_variants, n)
        Tooth and foundation of either gear, m/N. Row 0 is a sound tooth, each further row a faulty one.
    variant_1, variant_2 : int arrays, (z,)
        Row of `compliance_1`, `compliance_2` for each tooth.
    separation_1_m, separation_2_m : arrays, (n_surfaces, n)
        Metal missing on the flank of either gear along the line of action, below 0 where metal stands out. Row 0 is an
        ordinary tooth of the gear: tip relief, profile deviation, wear. Further rows belong to teeth whose flank is
        damaged. A gear with roughness of its own has a row for each tooth, row 0 being that of tooth 0.
    surface_1, surface_2 : int arrays, (z,)
        Row of `separation_1_m`, `separation_2_m` for each tooth.
    pitch_1_m, pitch_2_m : arrays, (z,)
        Cumulative pitch deviation of each tooth; not in the rows above.
    contact_coefficient : float
        m/N, or m/N^0.9 if `load_dependent`.
    load_dependent : bool
        Whether the approach grows with the 0.9th power of the force.
    contact_ratio : float
        ε.
    ramp : float
        Base pitches over which a pair takes up and gives up its stiffness, centred on ζ = 0 and ζ = ε.
    n_slots : int
        Most pairs that carry load at once.
    """

    start: float
    step: float
    compliance_1: FloatArray
    compliance_2: FloatArray
    variant_1: NDArray[np.int64]
    variant_2: NDArray[np.int64]
    separation_1_m: FloatArray
    separation_2_m: FloatArray
    surface_1: NDArray[np.int64]
    surface_2: NDArray[np.int64]
    pitch_1_m: FloatArray
    pitch_2_m: FloatArray
    contact_coefficient: float
    load_dependent: bool
    contact_ratio: float
    ramp: float
    n_slots: int


def mesh_table(mesh: GearMesh, n_points: int = 512) -> MeshTable:
    """Tabulate a mesh.

    Parameters
    ----------
    mesh : GearMesh
    n_points : int
        Columns over the path of contact, ramps included. With 512 the interpolated compliance is right to 1e-9
        and the height of roughness to 1e-4 of its rms. At the edges of spalls and chips and at the pitch point of worn
        flanks the interpolation rounds over one or two columns.
    """
    n = count(n_points, "n_points", minimum=16)
    low, high = -mesh.ramp / 2.0, mesh.pair.contact_ratio + mesh.ramp / 2.0
    step = (high - low) / (n - 1)
    progress = low + step * np.arange(-1, n + 1)
    rows_1, variant_1 = _compliance_rows(mesh, 1, progress)
    rows_2, variant_2 = _compliance_rows(mesh, 2, progress)
    flanks_1, surface_1 = separation_rows(mesh, 1, progress)
    flanks_2, surface_2 = separation_rows(mesh, 2, progress)
    return MeshTable(
        start=low - step,
        step=step,
        compliance_1=rows_1,
        compliance_2=rows_2,
        variant_1=variant_1,
        variant_2=variant_2,
        separation_1_m=flanks_1,
        separation_2_m=flanks_2,
        surface_1=surface_1,
        surface_2=surface_2,
        pitch_1_m=pitch_separation_m(mesh.pair.driver, mesh.flank_1),
        pitch_2_m=pitch_separation_m(mesh.pair.driven, mesh.flank_2),
        contact_coefficient=mesh.contact_coefficient,
        load_dependent=mesh.contact_law == "load-dependent",
        contact_ratio=mesh.pair.contact_ratio,
        ramp=mesh.ramp,
        n_slots=mesh.n_slots,
    )


def _compliance_rows(mesh: GearMesh, number: int, progress: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Row 0 for sound teeth, one row for each faulty one, and the row of each tooth."""
    side = mesh.side(number)
    rows = [mesh.gear_compliance(number, progress)]
    variant = np.zeros(side.gear.teeth, dtype=np.int64)
    for row, tooth in enumerate(side.faulty_teeth, start=1):
        rows.append(mesh.gear_compliance(number, progress, side.faults_of(tooth)))
        variant[tooth] = row
    return np.array(rows), variant
