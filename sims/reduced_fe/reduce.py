"""Free-interface reduction by cyclic symmetry: elastic modes and static compliance at the flanks and the hub."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count, one_of
from gearsig.errors import InputError
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.cyclic import CyclicGear, Held
from sims.reduced_fe.cyclic_modes import CyclicModes, cyclic_modes
from sims.reduced_fe.flank_rows import Spread, flank_grid, flank_rows
from sims.reduced_fe.hub import ComplexArray, hub_sum
from sims.reduced_fe.mesh_quality import mesh_quality
from sims.reduced_fe.mesh_size import MeshSize, check_reducible, mesh_size_for
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.reduced_gear import FlankGrid, ReducedGear
from sims.reduced_fe.sector_mesh import sector_mesh
from sims.reduced_fe.sector_plane import IntArray

AnyArray = np.ndarray[Any, Any]


@dataclass(frozen=True)
class ReductionPlan:
    """What a gear is reduced to.

    Parameters
    ----------
    size : MeshSize
    n_modes : int
        Elastic modes kept, at least; a pair is never cut.
    n_heights, n_slices : int
        Flank points of a tooth: heights over the involute, slices of the face width.
    n_offsets : int
        Compliance between teeth up to n_offsets − 1 apart.
    spread : str
        "section", "patch" or "node"; see `ReducedGear`.
    """

    size: MeshSize = field(default_factory=MeshSize)
    n_modes: int = 40
    n_heights: int = 9
    n_slices: int = 5
    n_offsets: int = 3
    spread: Spread = "section"

    def __post_init__(self) -> None:
        count(self.n_modes, "n_modes")
        count(self.n_heights, "n_heights", minimum=2)
        count(self.n_slices, "n_slices")
        count(self.n_offsets, "n_offsets")
        one_of(self.spread, "spread", ("section", "patch", "node"))


class StaticCompliance(NamedTuple):
    """Static response at the points of a gear; see the fields of `ReducedGear`."""

    flanks: FloatArray
    hub_flank: FloatArray
    hub: FloatArray


def plan_for(blank: GearBlank, n_dof: int, **wanted: int | Spread) -> ReductionPlan:
    """Return a plan with a mesh of about `n_dof` degrees of freedom."""
    return ReductionPlan(mesh_size_for(blank, n_dof), **wanted)  # type: ignore[arg-type]  # checked by the plan


def reduce_gear(blank: GearBlank, plan: ReductionPlan) -> ReducedGear:
    """Mesh a gear and reduce it: its lowest elastic modes, and the exact static compliance at flanks and hub.

    The modes are those of the whole free gear; all the others together act as if without mass, which the static
    compliance accounts for: C − Σ φφᵀ/ω² (residual attachment modes). Frequencies of the reduced gear are therefore
    those of the full model, and its static answer too.

    Parameters
    ----------
    blank : GearBlank
    plan : ReductionPlan

    Raises
    ------
    InputError
        If the mesh is too coarse for the fillet, or the memory does not suffice (estimated before starting).

    Source: R. R. Craig, A. J. Kurdila, *Fundamentals of Structural Dynamics*, 2nd ed. (2006), ch. 17, for residual
    attachment modes; D. L. Thomas, International Journal for Numerical Methods in Engineering 14 (1979), for cyclic
    symmetry.
    """
    from sims.reduced_fe.gear_key import gear_key
    from sims.reduced_fe.memory import check_memory, sector_bytes

    if plan.n_offsets > blank.n_teeth // 2:
        raise InputError(f"n_offsets is {plan.n_offsets}", allowed=f"at most {blank.n_teeth // 2}, half of the teeth")
    check_reducible(blank, plan.size)
    check_memory(sector_bytes(blank, plan.size))
    mesh = sector_mesh(blank, plan.size)
    quality, gear = mesh_quality(mesh), CyclicGear(mesh)
    grid = flank_grid(blank.geometry, plan.n_heights, plan.n_slices)
    with one_thread():
        rows = flank_rows(mesh, grid, plan.spread, gear.own_places, 3 * len(gear.own_nodes))
        modes = cyclic_modes(gear, plan.n_modes, elastic=True)
        free = static_compliance(gear, rows, grid, plan.n_offsets)
        clamped = static_compliance(gear, rows, grid, plan.n_offsets, "bore")
    frequencies, diameters, at_flanks, at_hub = _real_modes(gear, modes, rows)
    return ReducedGear(
        blank=blank,
        key=gear_key(blank, plan),
        n_dof=mesh.n_dof,
        spread=plan.spread,
        mass_kg=quality.mass_kg,
        polar_inertia_kg_m2=quality.polar_inertia_kg_m2,
        diametral_inertia_kg_m2=quality.diametral_inertia_kg_m2,
        grid=grid,
        frequencies_hz=frequencies,
        nodal_diameters=diameters,
        flank_modes=at_flanks,
        hub_modes=at_hub,
        free_compliance_m_per_n=free.flanks,
        clamped_compliance_m_per_n=clamped.flanks,
        hub_flank_compliance=free.hub_flank,
        hub_compliance=free.hub,
    )


def static_compliance(
    gear: CyclicGear, rows: FloatArray, grid: FlankGrid, n_offsets: int, held: Held = "free"
) -> StaticCompliance:
    """Compliance between flank points and hub, from one solution per nodal diameter.

    A unit push at tooth 0 alone is the sum over all nodal diameters of 1/z of a push that travels round; with the
    response H(n) of one sector, C_o = (1/z) Σ_n H(n) e^{2πino/z}.

    Parameters
    ----------
    gear : CyclicGear
    rows : array, (n_points, n_own_dof)
        Of the flank points.
    grid : FlankGrid
    n_offsets : int
    held : str
        "free": the response of the free gear without its rigid motion; "bore": every node of the bore held.
    """
    z, points = gear.n_sectors, grid.n_points
    flanks = np.zeros((n_offsets, points, points))
    hub_flank, hub = np.zeros((6, points)), np.zeros((6, 6))
    own = _solved_points(grid)
    for n in gear.diameters:
        weight = (1.0 if n == 0 or 2 * n == z else 2.0) / z
        shares = hub_sum(n, z) @ gear.hub if n <= 1 else np.zeros((0, rows.shape[1]))
        loads = np.hstack((rows[own].T, shares.conj().T))
        moved = _response(gear, n, loads, held)
        at_flanks = _mirrored((rows @ moved[:, : len(own)]).astype(np.complex128), grid, own)
        for offset in range(n_offsets):
            flanks[offset] += weight * np.real(at_flanks * np.exp(1j * gear.phase_rad(n) * offset))
        if n <= 1:
            hub += weight * np.real(shares @ moved[:, len(own) :])
            hub_flank += weight * np.real(moved[:, len(own) :].conj().T @ rows.T)
    return StaticCompliance(flanks, hub_flank, hub)


def _response(gear: CyclicGear, n: int, loads: AnyArray, held: Held) -> AnyArray:
    """Displacements for loads of one nodal diameter; of a free gear, what is left beside its rigid motion."""
    solve = gear.solver(n, held)
    rigid = gear.rigid(n)
    if held == "bore" or gear.hub_stiffness is not None or not rigid.shape[1]:
        return solve(loads)
    inertia = gear.mass.at(gear.phase_rad(n)) @ rigid
    balanced = loads - inertia @ (rigid.conj().T @ loads)
    moved = solve(balanced)
    elastic: AnyArray = moved - rigid @ (inertia.conj().T @ moved)
    return elastic


def _solved_points(grid: FlankGrid) -> IntArray:
    """Points on flank 0 in one half of the face, with its middle: the others follow by mirrors."""
    index = np.arange(grid.n_points).reshape(grid.shape)
    return index[0, :, : (grid.shape[2] + 1) // 2].ravel()


def _mirrored(part: ComplexArray, grid: FlankGrid, own: IntArray) -> ComplexArray:
    """H of all points from its columns of some.

    H is the same seen from the other end of the shaft, and a mirror at the middle of the tooth makes n to −n, which is
    the complex conjugate.
    """
    index = np.arange(grid.n_points).reshape(grid.shape)
    end, flank = index[:, :, ::-1].ravel(), index[::-1].ravel()
    whole = np.zeros((grid.n_points, grid.n_points), dtype=np.complex128)
    whole[:, own] = part
    whole[:, end[own]] = part[end]
    first = index[0].ravel()
    whole[:, flank[first]] = whole[flank][:, first].conj()
    return whole


def _real_modes(
    gear: CyclicGear, modes: CyclicModes, rows: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """Cosine and sine modes at the flank points of tooth 0 and at the hub."""
    frequencies, diameters, at_flanks, at_hub = [], [], [], []
    for k, n in enumerate(modes.nodal_diameters):
        flank = rows @ modes.shapes[:, k]
        hub = hub_sum(int(n), gear.n_sectors) @ (gear.hub @ modes.shapes[:, k])
        parts = (np.real, np.imag) if 0 < 2 * n < gear.n_sectors else (np.real,)
        for part in parts:
            frequencies.append(modes.frequencies_hz[k])
            diameters.append(n)
            at_flanks.append(part(flank))
            at_hub.append(part(hub))
    return np.array(frequencies), np.array(diameters), np.array(at_flanks), np.array(at_hub)
