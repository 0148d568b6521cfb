"""Reduced gears that come with the product: `python -m sims.reduced_fe.ready` makes their files again.

Their cracks are in a file of their own, see `sims.reduced_fe.crack_table`.
"""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType

from gearsig.checks import one_of
from sims.mesh.geometry import GearGeometry
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.gear_file import read_gear, write_gear
from sims.reduced_fe.mesh_size import MeshSize
from sims.reduced_fe.reduce import ReductionPlan, reduce_gear
from sims.reduced_fe.reduced_gear import ReducedGear

FOLDER = Path(__file__).parent / "gears"

PLAN = ReductionPlan(MeshSize(n_across=3, n_gap=1, n_up=8, n_rim=2, n_body=3, n_along=4))
"""300 000 degrees of freedom for 50 teeth, about as many as the published pair; teeth as fine for the others."""

READY = MappingProxyType(
    {
        "z50_m3": GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0)),
        "z55_m2": GearBlank(GearGeometry(55, 2.0, bore_radius_mm=17.5)),
        "z75_m2": GearBlank(GearGeometry(75, 2.0, bore_radius_mm=17.5)),
    }
)
"""Steel, 20°, face width 20 mm, full discs: the 50-tooth gear of the flexible pair, and the two of the 16-DOF pair."""


def ready_gear(name: str) -> ReducedGear:
    """Return a ready-made reduced gear.

    Parameters
    ----------
    name : str
        One of `READY`.
    """
    return read_gear(FOLDER / f"{one_of(name, 'name', READY)}.npz")


def make_ready_gears() -> None:
    """Reduce all ready-made gears and write their files."""
    FOLDER.mkdir(exist_ok=True)
    for name, blank in READY.items():
        write_gear(FOLDER / f"{name}.npz", reduce_gear(blank, PLAN))


if __name__ == "__main__":
    make_ready_gears()
