"""Mesh a gear, find its modes, push a tooth, and reduce it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gearsig.checks import FloatArray, count, within
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.craig_bampton import N_COMPARED, CraigBamptonGear, CraigBamptonPlan, craig_bampton
from sims.reduced_fe.cyclic import CyclicGear, Held
from sims.reduced_fe.cyclic_modes import CyclicModes, cyclic_modes
from sims.reduced_fe.discretisation import FINER_DOF, DiscretisationError, discretisation_error
from sims.reduced_fe.gear_cache import cached_gear
from sims.reduced_fe.memory import check_memory, craig_bampton_bytes, sector_bytes
from sims.reduced_fe.mesh_quality import MeshQuality, mesh_quality
from sims.reduced_fe.mesh_size import check_reducible, mesh_size_for
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.reduce import ReductionPlan
from sims.reduced_fe.reduced_gear import ReducedGear
from sims.reduced_fe.sector_mesh import SectorMesh, sector_mesh
from sims.reduced_fe.tooth_load import ToothLoad, load_tooth

MOST_MODES = 300
"""Beyond, the search takes many minutes, and teeth alone move."""
N_SLICES = 5
"""Contact patches along the face, where the mesh has layers enough."""


@dataclass(frozen=True)
class GearBodyStudy:
    """What was found of one gear.

    Parameters
    ----------
    mesh : SectorMesh
    quality : MeshQuality
    gear : CyclicGear
        As it is held for its modes.
    held : str
        "free", "bore" or "springs".
    modes : CyclicModes
        Elastic ones; of a gear on springs also those in which it moves as a whole.
    load : ToothLoad
        A tooth pushed in the middle of its flank, bore held.
    discretisation : DiscretisationError or None
        Of a mesh that is much coarser than what it is compared with.
    reduced : ReducedGear or None
    craig_bampton : CraigBamptonGear or None
    """

    mesh: SectorMesh
    quality: MeshQuality
    gear: CyclicGear
    held: str
    modes: CyclicModes
    load: ToothLoad
    discretisation: DiscretisationError | None
    reduced: ReducedGear | None
    craig_bampton: CraigBamptonGear | None


def study_gear(
    blank: GearBlank,
    n_dof: int,
    *,
    n_modes: int = 20,
    held: Held = "free",
    springs: FloatArray | None = None,
    force_n: float = 1000.0,
    reduce: bool = False,
    on_progress: Callable[[str, float], None] = lambda _what, _done: None,
) -> GearBodyStudy:
    """Study one gear.

    Parameters
    ----------
    blank : GearBlank
    n_dof : int
        Of the whole gear, about.
    n_modes : int
        Elastic modes, at least; up to 300.
    held : str
        "free" or "bore".
    springs : array (6,) or None
        That hold the hub for the modes, see `CyclicGear`; with "free" only.
    force_n : float
        On the tooth.
    reduce : bool
        Also reduce the gear both ways. The free-interface reduction is kept where the model `reduced-fe` finds it.
    on_progress : callable
        Told what is done and how much, 0 to 1.
    """
    within(count(n_modes, "n_modes"), "n_modes", 1, MOST_MODES)
    on_progress("mesh", 0.0)
    size = mesh_size_for(blank, n_dof)
    if reduce:
        check_reducible(blank, size)
    check_memory(craig_bampton_bytes(blank, size, N_COMPARED) if reduce else sector_bytes(blank, size))
    mesh = sector_mesh(blank, size)
    gear = CyclicGear(mesh, springs)
    on_progress("modes", 0.05)
    elastic = held == "free" and springs is None
    with one_thread():
        modes = cyclic_modes(gear, n_modes, held, elastic=elastic)
    on_progress("stress", 0.25 if reduce else 0.6)
    load = load_tooth(mesh, force_n)
    error = None
    if mesh.n_dof < FINER_DOF / 2:
        on_progress("finer mesh", 0.3)
        error = discretisation_error(gear, modes, load, held, elastic=elastic)
    reduced = both = None
    if reduce:
        on_progress("free-interface reduction", 0.35)
        reduced = cached_gear(blank, ReductionPlan(size))
        on_progress("Craig–Bampton reduction", 0.7)
        both = craig_bampton(mesh, CraigBamptonPlan(n_slices=min(N_SLICES, mesh.tooth.shape[2])))
    on_progress("done", 1.0)
    return GearBodyStudy(
        mesh, mesh_quality(mesh), gear, held if springs is None else "springs", modes, load, error, reduced, both
    )
