"""How deep a crack in finite-element teeth is that changes the transmission error as one in the calibration's teeth.

`python tests/benchmarks/cracked_teeth.py` shares static loads between teeth of both kinds, cracked to depths that take
13 to 76 % of the root. For each depth in the calibration's teeth it prints the equivalent one in finite-element teeth,
`gearsig.severity.FINITE_ELEMENT_DEPTHS`, and its spread over gears and loads. Some two minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import typer

from app.studies.gap.tooth_errors import CORNERS, element_gear, table_with_corners
from gearsig.checks import FloatArray
from gearsig.severity import event_rms_um, percent_per_mm
from sims.fe_gear import ReducedGear
from sims.mesh import FlankDeviation, GearMesh, PairGeometry, RootCrack, deepest_crack_mm, share_torque
from sims.reduced_fe import mesh_maps, static_table

PAIRS = ((19, 31), (22, 44), (31, 52), (44, 62), (62, 74))
LOADS_N_PER_MM = (40.0, 80.0, 200.0)
PARTS_OF_DEEPEST = np.linspace(0.12, 0.85, 13)
STEPS = 32
DEPTHS_PERCENT = (15, 20, 30, 40, 50, 60, 70)


def changes_um(
    gears: tuple[ReducedGear, ReducedGear], load_n_per_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Depths in percent of the root, and the change with the calibration's teeth and with finite elements."""
    driver, driven = (gear.blank.geometry for gear in gears)
    flank = FlankDeviation(tip_relief_um=0.8 * load_n_per_mm / 14.0, tip_relief_length_mm=driver.module_mm)
    healthy = GearMesh(PairGeometry(driver, driven), flank_1=flank, flank_2=flank, contact_law="load-dependent")
    torque = load_n_per_mm * healthy.pair.face_width_mm * healthy.pair.driver.base_radius_mm * 1e-3
    cycles = (np.arange(driver.teeth * STEPS) + 0.5) / STEPS

    def errors_um(mesh: GearMesh) -> tuple[FloatArray, FloatArray]:
        shared = share_torque(mesh, torque, cycles + CORNERS, table=table_with_corners(mesh)).transmission_error_m
        maps = mesh_maps(gears, mesh, np.array([torque]), cycles, table=static_table(gears, mesh))
        return 1e6 * shared, 1e6 * maps.transmission_error_m[:, 0]

    before, rows = errors_um(healthy), []
    depths = PARTS_OF_DEEPEST * deepest_crack_mm(driver)
    for depth in depths:
        after = errors_um(replace(healthy, cracks_1=(RootCrack(float(depth), tooth=5),)))
        rows.append([event_rms_um((a - b).reshape(-1, STEPS)) for a, b in zip(after, before, strict=True)])
    columns = np.array(rows).T
    return depths * percent_per_mm(driver.teeth, driver.module_mm), columns[0], columns[1]


def main() -> None:
    """Print the equivalent depths."""
    equivalent = []
    for teeth in PAIRS:
        gears = element_gear(teeth[0]), element_gear(teeth[1])
        for load in LOADS_N_PER_MM:
            percent, calibration_um, elements_um = changes_um(gears, load)
            change_um = np.interp(DEPTHS_PERCENT, percent, calibration_um)
            equivalent.append(np.interp(np.log(change_um), np.log(elements_um), percent, left=np.nan, right=np.nan))
    table = np.array(equivalent)
    for at, column in zip(DEPTHS_PERCENT, table.T, strict=True):
        known = column[np.isfinite(column)]
        if len(known):
            typer.echo(
                f"{at} %: {known.mean():.1f} % ({known.min():.1f} to {known.max():.1f}), {len(known)} of {len(column)}"
            )


if __name__ == "__main__":
    typer.run(main)
