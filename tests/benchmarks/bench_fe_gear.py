"""Modes by cyclic symmetry beside those of the whole gear, and the two reductions of a 277 000-DoF gear.

Processor seconds of one thread, which other work on the machine does not stretch. Run as
`python tests/benchmarks/bench_fe_gear.py`, `--whole` adds the whole matrices at that size (4 GB, minutes).
"""

import sys
from collections.abc import Callable
from time import process_time

from interleaved import peak_mb

from sims.fe_gear import (
    READY,
    CyclicGear,
    MeshSize,
    SectorMesh,
    craig_bampton,
    cyclic_modes,
    mesh_size_for,
    one_thread,
    plan_for,
    reduce_gear,
    sector_mesh,
)
from tests.sims.fe_gear.fe_gears import full_modes

GEAR = READY["z50_m3"]
WANTED = 277_200


def seconds(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return process_time() - start


def compare_modes(mesh: SectorMesh) -> None:
    cyclic = min(seconds(lambda: cyclic_modes(CyclicGear(mesh), 20)) for _ in range(2))
    whole = seconds(lambda: full_modes(CyclicGear(mesh), 20))
    print(f"20 modes of {mesh.n_dof:7d} DoF: cyclic {cyclic:7.2f} s, whole {whole:7.2f} s, ratio {whole / cyclic:5.1f}")


def main() -> None:
    with one_thread():
        for size in (MeshSize(2, 1, 3, 1, 1, 1), MeshSize(2, 1, 4, 1, 2, 2)):
            compare_modes(sector_mesh(GEAR, size))
        mesh = sector_mesh(GEAR, mesh_size_for(GEAR, WANTED))
        took = seconds(lambda: cyclic_modes(CyclicGear(mesh), 20))
        print(f"20 modes of {mesh.n_dof:7d} DoF: cyclic {took:7.2f} s")
        plan = plan_for(GEAR, WANTED)
        print(
            f"free-interface reduction {seconds(lambda: reduce_gear(GEAR, plan)):7.2f} s, peak {peak_mb() / 1e3:.2f} GB"
        )
        start = process_time()
        accuracy = craig_bampton(mesh).accuracy
        print(
            f"Craig–Bampton to 229 {process_time() - start:7.2f} s, peak {peak_mb() / 1e3:.2f} GB, "
            f"worst of 20 frequencies {100 * accuracy.worst_error:.4f} %, least subspace MAC {accuracy.minimum_mac:.6f}"
        )
        if "--whole" in sys.argv:
            compare_modes(mesh)
            print(f"peak {peak_mb() / 1e3:.2f} GB")


if __name__ == "__main__":
    main()
