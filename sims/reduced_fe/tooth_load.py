"""One tooth pushed by a static force: displacement and von Mises stress of the gear."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, positive, within
from sims.reduced_fe.cyclic import CyclicGear
from sims.reduced_fe.elements import cell_gradients_at_nodes, lame_pa
from sims.reduced_fe.flank_rows import Spread, flank_rows
from sims.reduced_fe.hub import ComplexArray
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.reduced_gear import FlankGrid
from sims.reduced_fe.sector_mesh import SectorMesh


@dataclass(frozen=True)
class ToothLoad:
    """A gear, its bore held, with a force on one flank of tooth 0.

    Parameters
    ----------
    mesh : SectorMesh
        Of every sector.
    force_n : float
    roll_rad : float
        Where on the flank.
    displacement_m : array, (n_teeth, n_nodes, 3)
        x, y, z in the axes of each sector (x through its tooth's middle).
    push_m : float
        Motion of the flank point along the force.
    """

    mesh: SectorMesh
    force_n: float
    roll_rad: float
    displacement_m: FloatArray = field(repr=False)
    push_m: float

    def von_mises_pa(self, tooth: int = 0) -> FloatArray:
        """Von Mises stress at the nodes of a sector, (n_nodes,): mean over the cells that meet there."""
        return von_mises_pa(self.mesh, self.displacement_m[tooth])


def load_tooth(
    mesh: SectorMesh, force_n: float, roll_rad: float | None = None, *, flank: int = 0, spread: Spread = "patch"
) -> ToothLoad:
    """Push a tooth along its flank's normal, evenly over the face width, with every node of the bore held.

    Parameters
    ----------
    mesh : SectorMesh
    force_n : float
        Above 0.
    roll_rad : float or None
        Roll angle of the point; None: the middle of the flank by roll.
    flank : int
        0 or 1.
    spread : str
        What the force acts on; see `ReducedGear`. A "patch" shows the stress near the contact only roughly: the strip
        is wider than a Hertzian contact.
    """
    g = mesh.blank.geometry
    force = positive(force_n, "force_n", "N")
    roll = (g.form_roll_rad + g.tip_roll_rad) / 2.0 if roll_rad is None else roll_rad
    within(roll, "roll_rad", g.form_roll_rad, g.tip_roll_rad, "rad", remedy="take a point of the involute")
    within(flank, "flank", 0, 1)
    gear = CyclicGear(mesh)
    grid = FlankGrid(np.array([roll]), np.array([0.0]))
    row = flank_rows(mesh, grid, spread, gear.own_places, 3 * len(gear.own_nodes))[int(flank)]
    with one_thread():
        own = _static_field(gear, force * row)
    return ToothLoad(mesh, force, float(roll), gear.sector_fields(own), float(own[0] @ row))


def von_mises_pa(mesh: SectorMesh, displacement_m: FloatArray) -> FloatArray:
    """Von Mises stress at the nodes, √(3/2 s:s), s the deviator of λ tr(ε) 1 + 2μ ε.

    Parameters
    ----------
    mesh : SectorMesh
    displacement_m : array, (n_nodes, 3)
        Cartesian.

    Returns
    -------
    array, (n_nodes,)
        Pa. Stresses are taken at the nodes of each cell and averaged there; those of eight-node cells leave out what
        their incompatible modes add.
    """
    _, mu = lame_pa(mesh.blank.material)
    nodes = mesh.cells.reshape(len(mesh.cells), -1)
    gradient = np.einsum("cqia,caj->cqij", cell_gradients_at_nodes(mesh.points_m, mesh.cells), displacement_m[nodes])
    strain = (gradient + gradient.transpose(0, 1, 3, 2)) / 2.0
    deviator = strain - np.trace(strain, axis1=2, axis2=3)[..., None, None] * np.eye(3) / 3.0
    total, shared = np.zeros((mesh.n_nodes, 3, 3)), np.zeros(mesh.n_nodes)
    np.add.at(total, nodes, deviator)
    np.add.at(shared, nodes, 1.0)
    mean = 2.0 * mu * total / shared[:, None, None]
    stress: FloatArray = np.sqrt(1.5 * np.sum(mean**2, axis=(1, 2)))
    return stress


def _static_field(gear: CyclicGear, load: FloatArray) -> FloatArray:
    """Displacement (n_sectors, n_own_dof) for a load on sector 0, the bore held."""
    z = gear.n_sectors
    waves: ComplexArray = np.zeros((z // 2 + 1, len(load)), dtype=np.complex128)
    for n in gear.diameters:
        waves[n] = gear.solver(n, "bore")(load)
    moved: FloatArray = np.fft.irfft(waves, n=z, axis=0)
    return moved
