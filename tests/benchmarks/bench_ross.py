"""ROSS's gear element and this package on the same pairs, side by side: mesh stiffness, contact ratio, speed.

`python tests/benchmarks/bench_ross.py` prints the table. It needs `ross-rotordynamics` 2.3 with `plotly<6` in an
environment of its own, whose interpreter is given as ROSS_PYTHON: ROSS asks for other versions of libraries than
gearsig, and no part of gearsig imports it. Seconds are those of the processor.
"""

import json
import os
import subprocess
import sys
import time

import numpy as np

from sims.mesh import GearMesh, Lead, Material, PairGeometry, mesh_stiffness, mesh_table, transverse_section

PAIRS = ((55, 75, 0.0), (29, 47, 0.0), (50, 50, 0.0), (29, 47, 15.0))
"""Teeth and helix angle; module 2 mm, 20°, width 20 mm, bore radius 10 mm."""
N_POINTS = 200
MODULE_MM, WIDTH_MM, BORE_MM = 2.0, 20.0, 10.0
SIZES_M = (1e-3 * WIDTH_MM, 2e-3 * BORE_MM, 1e-3 * MODULE_MM)

IN_ROSS = """
import json, sys, time, warnings
warnings.filterwarnings("ignore")
import ross as rs
from ross.gear_element import GearElementTVMS, Mesh
z1, z2, beta, n, width, bore, module = json.loads(sys.argv[1])
steel = rs.Material(name="steel206", rho=7850, E=206e9, Poisson=0.3)
used = time.process_time()
size = {"width": width, "bore_diameter": bore, "module": module, "helix_angle": beta}
gears = [GearElementTVMS(n=0, material=steel, n_teeth=z, **size)
         for z in (z1, z2)]
mesh = Mesh(*gears)
made = time.process_time() - used
used = time.process_time()
out = mesh.get_stiffness_for_mesh_period(1, n)
took = time.process_time() - used
values = [float(v) for v in out[1]]
print(json.dumps({"stiffness": values, "ratio": float(mesh.contact_ratio), "made": made, "took": took}))
"""


def of_ross(teeth_1: int, teeth_2: int, helix_deg: float) -> dict[str, object]:
    """Mesh stiffness over one period by ROSS, in its own interpreter."""
    asked = json.dumps([teeth_1, teeth_2, float(np.radians(helix_deg)), N_POINTS, *SIZES_M])
    command = [os.environ["ROSS_PYTHON"], "-c", IN_ROSS, asked]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: dict[str, object] = json.loads(said[said.index('{"stiffness"') :].splitlines()[0])  # libraries print, too
    return found


def own(teeth_1: int, teeth_2: int, helix_deg: float, body: str) -> dict[str, object]:
    """Do the same here, the table made anew."""
    used = time.process_time()
    gears = [
        transverse_section(z, MODULE_MM, 20.0, helix_deg, face_width_mm=WIDTH_MM, bore_radius_mm=BORE_MM)
        for z in (teeth_1, teeth_2)
    ]
    steel = Material(206.0, 0.3)
    lead = Lead(helix_deg, n_slices=16 if helix_deg else 1)
    mesh = GearMesh(PairGeometry(*gears), steel, steel, body=body, lead=lead)
    table = mesh_table(mesh)
    made = time.process_time() - used
    used = time.process_time()
    values = mesh_stiffness(mesh, (np.arange(N_POINTS) + 0.5) / N_POINTS, table=table).total_n_per_m
    return {"stiffness": values, "ratio": mesh.pair.contact_ratio, "made": made, "took": time.process_time() - used}


def main() -> None:
    if "ROSS_PYTHON" not in os.environ:
        sys.exit("set ROSS_PYTHON to an interpreter that has ross-rotordynamics")
    own(29, 47, 0.0, "separate")  # compiles
    print("pair, helix: by                     ratio    least     mean     most  1e8 N/m   made ms  period ms")
    for pair in PAIRS:
        rows = {"ROSS": of_ross(*pair)} | {
            f"gearsig, {body} body": own(*pair, body) for body in ("separate", "coupled")
        }
        for name, found in rows.items():
            k = np.asarray(found["stiffness"]) * 1e-8
            print(
                f"{pair[0]}/{pair[1]} {pair[2]:4.0f}°: {name:<22} {found['ratio']:8.4f} {k.min():8.3f} {k.mean():8.3f} "
                f"{k.max():8.3f} {'':8} {1e3 * float(found['made']):9.1f} {1e3 * float(found['took']):9.2f}"  # type: ignore[arg-type]
            )


if __name__ == "__main__":
    main()
