"""Small gears for tests of the finite elements."""

from functools import cache

from sims.mesh import GearGeometry
from sims.reduced_fe import CyclicGear, GearBlank, MeshSize, ReducedGear, ReductionPlan, reduce_gear, sector_mesh

SMALL = GearBlank(GearGeometry(12, 3.0, profile_shift=0.4, face_width_mm=12.0, bore_radius_mm=6.0))
COARSE = MeshSize(2, 1, 3, 1, 1, 1)
PAPER = GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0))
"""The 50-tooth gear of the published pair."""


@cache
def small_cyclic() -> CyclicGear:
    return CyclicGear(sector_mesh(SMALL, COARSE))


@cache
def small_reduced() -> ReducedGear:
    return reduce_gear(SMALL, ReductionPlan(COARSE, n_modes=24, n_heights=4, n_slices=3, n_offsets=3))
