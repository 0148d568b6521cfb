"""Cyclic symmetry: the gear as one sector, a Hermitian problem for each nodal diameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray
from sims.reduced_fe.elements import sector_matrices
from sims.reduced_fe.hub import hub_rows, hub_sum
from sims.reduced_fe.mirror import RealFolded, SectorMirror
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray

Held = Literal["free", "bore", "sprung"]
"""The gear floats, every node of its bore is held, or springs at the hub hold it."""

Solver = Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]


class Folded(NamedTuple):
    """A sector's matrix with its high side folded onto the next sector's low side: A + e^{iφ} B + e^{−iφ} Bᵀ."""

    own: sparse.csr_array
    next: sparse.csr_array

    def at(self, phase_rad: float) -> sparse.csc_array:
        """Return the matrix for a phase of φ = 2πn/z from sector to sector; real where it is."""
        if abs(sin(phase_rad)) < 1e-12:
            real = self.own + cos(phase_rad) * (self.next + self.next.T)
            return sparse.csc_array(real)
        turn = complex(cos(phase_rad), sin(phase_rad))
        return sparse.csc_array(self.own + turn * self.next + turn.conjugate() * self.next.T)


class RealSystem(NamedTuple):
    """Stiffness and mass of one nodal diameter, real and symmetric: K(n) = T stiffness Tᴴ."""

    stiffness: sparse.csc_array
    mass: sparse.csc_array
    basis: sparse.csc_array


@dataclass(frozen=True)
class CyclicGear:
    """A gear of equal sectors.

    A motion of nodal diameter n is u(k) = Re(U e^{iφk}) in sector k, φ = 2πn/z, in cylindrical components. U holds the
    sector's nodes without its high side; there it is U(low side) e^{iφ}.

    Parameters
    ----------
    mesh : SectorMesh
    hub_stiffness : array (6,) or None
        Springs that hold the mean motion of the bore, along and about x, y, z, N/m and N m/rad; those of x and y must
        be equal (a shaft and bearings alike in all directions). None: none.

    Notes
    -----
    Teeth must be alike: a cracked tooth is for `cracked_tooth`. Springs that differ between x and y couple nodal
    diameters and cannot be treated this way.
    """

    mesh: SectorMesh
    hub_stiffness: FloatArray | None = None

    @property
    def n_sectors(self) -> int:
        """Number of teeth."""
        return self.mesh.blank.n_teeth

    @property
    def diameters(self) -> range:
        """0 to z/2."""
        return range(self.n_sectors // 2 + 1)

    @cached_property
    def _sector(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        return sector_matrices(self.mesh)

    @cached_property
    def own_nodes(self) -> IntArray:
        """Nodes of the sector without its high side."""
        own: IntArray = np.setdiff1d(np.arange(self.mesh.n_nodes), self.mesh.high_side)
        return own

    @cached_property
    def _fold(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """S0, S1: sector = (S0 + e^{iφ} S1) own."""
        own = self.own_nodes
        number = np.full(self.mesh.n_nodes, -1)
        number[own] = np.arange(len(own))
        return (
            _node_selection(own, np.arange(len(own)), self.mesh.n_nodes, len(own)),
            _node_selection(self.mesh.high_side, number[self.mesh.low_side], self.mesh.n_nodes, len(own)),
        )

    @cached_property
    def _mirror(self) -> SectorMirror:
        return SectorMirror(self.mesh.points_m[self.own_nodes], self.own_places[self.mesh.low_side])

    @cached_property
    def _real(self) -> tuple[RealFolded, RealFolded]:
        return self._mirror.real(*self.stiffness), self._mirror.real(*self.mass)

    @cached_property
    def stiffness(self) -> Folded:
        """K of the own nodes."""
        return self._folded(self._sector[0])

    @cached_property
    def mass(self) -> Folded:
        """M of the own nodes."""
        return self._folded(self._sector[1])

    @cached_property
    def hub(self) -> FloatArray:
        """Rows (6, n_own) that give a sector's share of the bore's mean motion, in the axes of that sector."""
        rows: FloatArray = hub_rows(self.mesh, 3 * len(self.own_nodes), self.own_places)
        return rows

    @cached_property
    def own_places(self) -> IntArray:
        """Place of each of the sector's nodes among the own ones; high-side nodes have that of the low side."""
        number = np.full(self.mesh.n_nodes, -1)
        number[self.own_nodes] = np.arange(len(self.own_nodes))
        number[self.mesh.high_side] = number[self.mesh.low_side]
        return number

    @cached_property
    def bore_dof(self) -> IntArray:
        """Own degrees of freedom of the bore's nodes."""
        places = np.unique(self.own_places[self.mesh.bore])
        return (3 * places[:, None] + np.arange(3)).ravel()

    def phase_rad(self, n: int) -> float:
        """φ of nodal diameter n."""
        return 2.0 * pi * n / self.n_sectors

    def system(self, n: int) -> RealSystem:
        """K (with the springs at the hub) and M of nodal diameter n, real and symmetric, and the basis they are in."""
        phase = self.phase_rad(n)
        if n == 0 or 2 * n == self.n_sectors:  # real as they are
            basis = sparse.csc_array(sparse.eye_array(3 * len(self.own_nodes)))
            stiffness, mass = self.stiffness.at(phase), self.mass.at(phase)
        else:
            basis = self._mirror.basis(phase)
            stiffness, mass = (real.at(phase) for real in self._real)
        if self.hub_stiffness is not None and n <= 1:
            # Springs on the mean motion of the bore: the sum over sectors of the shares, squared.
            rows = np.asarray(hub_sum(n, self.n_sectors) @ self.hub @ basis)
            spring = (rows.conj().T * self.hub_stiffness) @ rows / self.n_sectors
            stiffness = sparse.csc_array(stiffness + sparse.csc_array(spring.real))
        return RealSystem(stiffness, mass, basis)

    def solver(self, n: int, held: Held = "free") -> Solver:
        """Return a function that solves K(n) U = F for one or more columns.

        The free gear has rigid motions for n = 0 and 1: two components of one node are held, which is a solution for
        loads in balance, up to a rigid motion.
        """
        stiffness, _, basis = self.system(n)
        kept = np.setdiff1d(np.arange(stiffness.shape[0]), self._fixed(n, held))
        inner = factorised(sparse.csc_array(stiffness[kept][:, kept]))

        def solve(loads: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
            turned = np.asarray(basis.conj().T @ loads)
            solution = np.zeros(turned.shape, dtype=np.complex128)
            solution[kept] = inner(turned[kept])
            return np.asarray(basis @ solution)

        return solve

    def rigid(self, n: int) -> np.ndarray[Any, Any]:
        """Rigid motions of nodal diameter n as columns, mass-normalised over the sector; none above n = 1."""
        if n > 1:
            return np.empty((3 * len(self.own_nodes), 0))
        points = self.mesh.points_m[self.own_nodes]
        r, angle, z = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0]), points[:, 2]
        zero, one = np.zeros_like(r), np.ones_like(r)
        if n == 0:
            motions = [(zero, zero, one), (zero, r, zero)]
        else:
            turn = np.exp(1j * angle)
            motions = [(turn, 1j * turn, zero), (z * turn, 1j * z * turn, -r * turn)]
        columns = np.array([np.column_stack(m).ravel() for m in motions]).T
        weight = np.einsum("ia,ia->a", columns.conj(), self.mass.at(self.phase_rad(n)) @ columns).real
        normal: np.ndarray[Any, Any] = columns / np.sqrt(weight)
        return normal

    def sector_fields(self, own: FloatArray) -> FloatArray:
        """Return all nodes of every sector, (z, n_nodes, 3), x, y, z in its own axes, from (z, n_own_dof) cylindrical.

        A sector's high side is the next one's low side.
        """
        mesh = self.mesh
        by_node = own.reshape(self.n_sectors, -1, 3)
        fields = by_node[:, self.own_places]
        fields[:, mesh.high_side] = np.roll(by_node, -1, axis=0)[:, self.own_places[mesh.high_side]]
        c, s = np.cos(mesh.angles_rad), np.sin(mesh.angles_rad)
        radial, around = fields[..., 0], fields[..., 1]
        return np.stack((c * radial - s * around, s * radial + c * around, fields[..., 2]), axis=-1)

    def _fixed(self, n: int, held: Held) -> IntArray:
        if held == "bore":
            return self.bore_dof
        if n > 1 or held == "sprung":
            return np.empty(0, dtype=np.int64)
        node = int(self.own_places[self.mesh.bore[0, 0]])
        return np.array([3 * node + 1, 3 * node + 2])

    def _folded(self, matrix: sparse.csr_array) -> Folded:
        s0, s1 = self._fold
        return Folded(sparse.csr_array(s0.T @ matrix @ s0 + s1.T @ matrix @ s1), sparse.csr_array(s0.T @ matrix @ s1))


def factorised(matrix: sparse.csc_array) -> Solver:
    """Return a direct solver of a real symmetric positive definite matrix, for real or complex columns."""
    from scipy.sparse.linalg import splu

    # Ordering and pivoting for symmetric definite matrices: twice as fast, and half the memory, of the defaults.
    options = {"SymmetricMode": True}
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def solve(loads: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        real = np.asarray(factor.solve(np.ascontiguousarray(loads.real)))
        return real + 1j * factor.solve(np.ascontiguousarray(loads.imag)) if np.iscomplexobj(loads) else real

    return solve


def _node_selection(nodes: IntArray, places: IntArray, n_nodes: int, n_own: int) -> sparse.csr_array:
    rows = (3 * nodes[:, None] + np.arange(3)).ravel()
    columns = (3 * places[:, None] + np.arange(3)).ravel()
    shape = (3 * n_nodes, 3 * n_own)
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
