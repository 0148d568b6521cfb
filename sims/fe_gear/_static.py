"""A gear under a static load: displacement and stress, comparison with a finer mesh, files for other programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError, not_written
from sims.fe_gear._blank import mesh_size_for, one_thread
from sims.fe_gear._cyclic import ComplexArray, CyclicGear, CyclicModes, Held, cyclic_modes, mode_field
from sims.fe_gear._mesh import IntArray, SectorMesh, cell_gradients_at_nodes, lame_pa, sector_mesh
from sims.fe_gear._reduced_gear import FlankGrid, Spread, flank_rows

# One tooth under a static force: displacement and von Mises stress of the gear.


@dataclass(frozen=True)
class ToothLoad:
    """A gear with fixed bore and a force on one flank of tooth 0.

    Parameters
    ----------
    mesh : SectorMesh
        Of every sector.
    force_n : float
    roll_rad : float
        Roll angle of the loaded point.
    displacement_m : array, (n_teeth, n_nodes, 3)
        x, y, z in the axes of each sector (x through the middle of its tooth).
    push_m : float
        Motion of the flank point along the force.
    """

    mesh: SectorMesh
    force_n: float
    roll_rad: float
    displacement_m: FloatArray = field(repr=False)
    push_m: float

    def von_mises_pa(self, tooth: int = 0) -> FloatArray:
        """Von Mises stress at the nodes of a sector, (n_nodes,): mean over adjacent cells."""
        return von_mises_pa(self.mesh, self.displacement_m[tooth])


def load_tooth(
    mesh: SectorMesh, force_n: float, roll_rad: float | None = None, *, flank: int = 0, spread: Spread = "patch"
) -> ToothLoad:
    """Load a tooth normal to its flank, uniformly over the face width, with all nodes of the bore fixed.

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
        Distribution of the force; see `ReducedGear`. With a "patch" the stress near the contact is only approximate, as
        the strip is wider than a Hertzian contact.
    """
    g = mesh.blank.geometry
    force = positive(force_n, "force_n", "N")
    roll = (g.form_roll_rad + g.tip_roll_rad) / 2.0 if roll_rad is None else roll_rad
    within(roll, "roll_rad", g.form_roll_rad, g.tip_roll_rad, "rad", remedy="take a point on the involute")
    within(flank, "flank", 0, 1)
    gear = CyclicGear(mesh)
    grid = FlankGrid(np.array([roll]), np.array([0.0]))
    row = flank_rows(mesh, grid, spread, gear.own_places, 3 * len(gear.own_nodes))[int(flank)]
    with one_thread():
        waves: ComplexArray = np.array(
            [gear.solver(n, "bore")(force * row) for n in gear.diameters], dtype=np.complex128
        )
        field_of_sectors = np.fft.irfft(waves, n=gear.n_sectors, axis=0)
    return ToothLoad(mesh, force, float(roll), gear.sector_fields(field_of_sectors), float(field_of_sectors[0] @ row))


def stress_pa(mesh: SectorMesh, displacement_m: FloatArray) -> FloatArray:
    """Stress tensor at the nodes, σ = λ tr(ε) 1 + 2μ ε, mean over adjacent cells.

    Parameters
    ----------
    mesh : SectorMesh
    displacement_m : array, (n_nodes, 3)
        Cartesian.

    Returns
    -------
    array, (n_nodes, 3, 3)
        Pa, in the axes of the sector. Stresses are evaluated at the nodes of each cell and averaged there; those of
        eight-node cells omit the contribution of their incompatible modes.
    """
    lam, mu = lame_pa(mesh.blank.material)
    nodes = mesh.cells.reshape(len(mesh.cells), -1)
    gradient = np.einsum("cqia,caj->cqij", cell_gradients_at_nodes(mesh.points_m, mesh.cells), displacement_m[nodes])
    strain = (gradient + gradient.transpose(0, 1, 3, 2)) / 2.0
    stress = 2.0 * mu * strain + lam * np.trace(strain, axis1=2, axis2=3)[..., None, None] * np.eye(3)
    total, shared = np.zeros((mesh.n_nodes, 3, 3)), np.zeros(mesh.n_nodes)
    np.add.at(total, nodes, stress)
    np.add.at(shared, nodes, 1.0)
    return total / shared[:, None, None]


def von_mises_pa(mesh: SectorMesh, displacement_m: FloatArray) -> FloatArray:
    """Von Mises stress at the nodes, √(3/2 s:s), s the deviator of `stress_pa`; (n_nodes,), Pa."""
    return _von_mises(stress_pa(mesh, displacement_m))


def _von_mises(stress: FloatArray) -> FloatArray:
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
    result: FloatArray = np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))
    return result


def polar_stress_pa(mesh: SectorMesh, displacement_m: FloatArray) -> dict[str, FloatArray]:
    """Radial, tangential and shear stress about the gear's axis, and von Mises stress, each (n_nodes,), Pa."""
    stress = stress_pa(mesh, displacement_m)
    angle = np.arctan2(mesh.points_m[:, 1], mesh.points_m[:, 0])
    out = np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), axis=1)
    around = np.stack((-np.sin(angle), np.cos(angle), np.zeros_like(angle)), axis=1)
    components = {"radial": (out, out), "tangential": (around, around), "shear": (out, around)}
    by_component = {name: np.einsum("ni,nij,nj->n", a, stress, b) for name, (a, b) in components.items()}
    return {**by_component, "von Mises": _von_mises(stress)}


def modal_load(gear: CyclicGear, modes: CyclicModes, load: ToothLoad) -> FloatArray:
    """Displacement under a force on a tooth from modes alone, u = Σ φ (φᵀ f)/ω², at all nodes, (n_teeth, n_nodes, 3).

    This is the result of a reduction to the lowest modes without static residual, for comparison with `load_tooth`.

    Parameters
    ----------
    gear : CyclicGear
    modes : CyclicModes
        With fixed bore, as in `load`.
    load : ToothLoad
        Over a patch.
    """
    grid = FlankGrid(np.array([load.roll_rad]), np.array([0.0]))
    row = flank_rows(gear.mesh, grid, "patch", gear.own_places, 3 * len(gear.own_nodes))[0]
    total = np.zeros((gear.n_sectors, gear.mesh.n_nodes, 3))
    pairs = modes.multiplicity(gear.n_sectors)
    for mode, hertz in enumerate(modes.frequencies_hz):
        for sine in (False, True)[: int(pairs[mode])]:
            shape = modes.shapes[:, mode].imag if sine else modes.shapes[:, mode].real
            share = load.force_n * float(row @ shape) / (2.0 * np.pi * hertz) ** 2
            total += share * mode_field(gear, modes, mode, sine=sine)
    return total


# Discretisation error against a finer mesh: natural frequencies and the compliance of a tooth.

FINER_DOF = 150_000
"""Degrees of freedom of the finer mesh; its first frequency is 0.2 % above that with a million."""


class DiscretisationError(NamedTuple):
    """Errors of a mesh relative to a finer one.

    Attributes
    ----------
    finer_dof : int
    frequency : array, (n,)
        Relative error of each frequency; modes are matched by nodal diameter and rank.
    compliance : float
        Relative error of the tooth's compliance under the same force.
    """

    finer_dof: int
    frequency: FloatArray
    compliance: float


def discretisation_error(
    gear: CyclicGear, modes: CyclicModes, load: ToothLoad, held: Held = "free", *, elastic: bool = True
) -> DiscretisationError:
    """Solve modes and load again on a mesh of `FINER_DOF`.

    Parameters
    ----------
    gear : CyclicGear
        With a coarser mesh.
    modes : CyclicModes
        Its modes from `cyclic_modes` with `held` and `elastic`.
    load : ToothLoad
    held : str
    elastic : bool
    """
    blank = gear.mesh.blank
    mesh = sector_mesh(blank, mesh_size_for(blank, FINER_DOF))
    n_modes = int(modes.multiplicity(gear.n_sectors).sum())
    with one_thread():
        finer = cyclic_modes(CyclicGear(mesh, gear.hub_stiffness), n_modes + 8, held, elastic=elastic)
    coarse, theirs = _by_diameter(modes), _by_diameter(finer)
    ratio = [coarse[name] / theirs[name] - 1.0 for name in coarse if name in theirs]
    again = load_tooth(mesh, load.force_n, load.roll_rad)
    return DiscretisationError(mesh.n_dof, np.array(ratio), load.push_m / again.push_m - 1.0)


def _by_diameter(modes: CyclicModes) -> dict[tuple[int, int], float]:
    """Frequencies by nodal diameter and rank within it, without rigid motions."""
    counts: Counter[int] = Counter()
    frequencies = {}
    for hertz, n in zip(modes.frequencies_hz, modes.nodal_diameters, strict=True):
        counts[int(n)] += 1
        if hertz > 1.0:
            frequencies[int(n), counts[int(n)]] = float(hertz)
    return frequencies


# Meshes, modes and stresses for other finite-element programs, through meshio.

SUFFIXES = (".vtu", ".vtk")
"""Formats that support 27-node cells."""

_CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]])
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_FACES = np.array([[0, 1, 1], [2, 1, 1], [1, 0, 1], [1, 2, 1], [1, 1, 0], [1, 1, 2]])


def write_vtk(path: str | Path, mesh: SectorMesh, values: Mapping[str, FloatArray] | None = None) -> Path:
    """Write a gear, with values at its nodes, as hexahedra of 27 nodes (VTK type 29) or eight (12).

    Parameters
    ----------
    path : path
        With the extension .vtu or .vtk.
    mesh : SectorMesh
    values : mapping or None
        Name → array of (n_teeth, n_nodes) or (n_teeth, n_nodes, 3), e.g. displacement in m, stress in Pa; vectors in
        the axes of each sector, rotated here. Nodes shared by two sectors are written once.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the name has another extension, an array has another shape, or the file cannot be written.
    """
    import meshio
    from scipy.spatial.transform import Rotation

    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise InputError(f"extension {target.suffix or '(none)'!r}", where=target.name, allowed=" ".join(SUFFIXES))
    gear, n = CyclicGear(mesh), mesh.blank.n_teeth
    # The high side of a sector is the low side of the next one.
    sector = (np.arange(n)[:, None] + np.isin(np.arange(mesh.n_nodes), mesh.high_side)) % n
    number = gear.own_places + len(gear.own_nodes) * sector
    turns = Rotation.from_euler("z", mesh.blank.pitch_angle_rad * np.arange(n)[:, None]).as_matrix()
    points = _merged(np.einsum("kij,aj->kai", turns, mesh.points_m), number)
    kind, order = ("hexahedron27", _vtk_order()) if mesh.size.order == 2 else ("hexahedron", _CORNERS // 2 @ [4, 2, 1])
    cells = number[:, mesh.cells.reshape(len(mesh.cells), -1)[:, order]].reshape(-1, len(order))
    point_data = {name: _merged(_turned(name, v, turns, mesh), number) for name, v in (values or {}).items()}
    try:
        meshio.Mesh(points, [(kind, cells)], point_data=point_data).write(target)
    except OSError as error:
        raise not_written(error, target) from None
    return target


def _vtk_order() -> IntArray:
    """Indices in the raveled `SectorMesh.cells` of VTK's nodes: corners, edges, faces, middle."""
    edges = np.array([(_CORNERS[a] + _CORNERS[b]) // 2 for a, b in _EDGES])
    order: IntArray = np.vstack((_CORNERS, edges, _FACES, [[1, 1, 1]])) @ np.array([9, 3, 1])
    return order


def _turned(name: str, values: FloatArray, turns: FloatArray, mesh: SectorMesh) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape[:2] != (len(turns), mesh.n_nodes) or array.shape[2:] not in ((), (3,)):
        raise InputError(
            f"{name} has shape {np.shape(values)}",
            allowed=f"({len(turns)}, {mesh.n_nodes}) or ({len(turns)}, {mesh.n_nodes}, 3)",
        )
    return np.einsum("kij,kaj->kai", turns, array) if array.ndim == 3 else array


def _merged(values: FloatArray, number: IntArray) -> FloatArray:
    merged = np.empty((int(number.max()) + 1, *values.shape[2:]))
    merged[number.ravel()] = values.reshape(-1, *values.shape[2:])
    return merged
