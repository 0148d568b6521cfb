"""Cyclic symmetry: the gear as one sector, a Hermitian problem for each nodal diameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError
from gearsig.results import Result
from sims.fe_gear._mesh import IntArray, SectorMesh, sector_matrices, whole_weights

# A sector is its own mirror image: in the right coordinates its Hermitian matrices are real.


class RealFolded(NamedTuple):
    """A sector's matrix in real coordinates: K₀ + cos(φ/2) K₁ + sin(φ/2) K₂."""

    constant: sparse.csc_array
    cosine: sparse.csc_array
    sine: sparse.csc_array

    def at(self, phase_rad: float) -> sparse.csc_array:
        """Return the matrix for a phase from sector to sector."""
        half = phase_rad / 2.0
        return sparse.csc_array(self.constant + cos(half) * self.cosine + sin(half) * self.sine)


class SectorMirror:
    """Coordinates in which the matrices of every nodal diameter are real and symmetric.

    A mirror at the middle of the tooth turns a motion U of nodal diameter n into one of −n, whose conjugate is one of n
    again: A U = conj(mirror U). K and M commute with A, so that they are real in a basis of motions with A U = U:

    - two nodes that are each other's image: (1, s)/√2 and (i, −is)/√2,
    - a node in the middle plane: 1 for s = 1, i for s = −1,
    - a node on the low side, whose image on the high side moves by e^{iφ} of it: the same times e^{−iφ/2},

    with s = 1 for radial and axial, −1 for tangential motion. Real factors take a third of the time of complex ones.

    Parameters
    ----------
    points_m : array, (n_own, 3)
        Own nodes of the sector.
    low_side : array of int
        Which of them lie on the low side.

    Raises
    ------
    InputError
        If a node has no image: the sector is not symmetric.
    """

    def __init__(self, points_m: FloatArray, low_side: IntArray) -> None:
        self._n = len(points_m)
        self._on_low = np.zeros(self._n, dtype=bool)
        self._on_low[low_side] = True
        nearest = cKDTree(points_m).query(points_m * np.array([1.0, -1.0, 1.0]))
        distance, image = np.array(nearest[0], dtype=np.float64), np.array(nearest[1], dtype=np.int64)
        image[self._on_low] = np.flatnonzero(self._on_low)
        distance[self._on_low] = 0.0
        if distance.max() > 1e-9 or np.any(image[image] != np.arange(self._n)):
            raise InputError("the sector's mesh is not symmetric about the middle of its tooth")
        self._image = image

    @cached_property
    def plain(self) -> sparse.csc_array:
        """T₀: the basis without the phase of the low side."""
        rows, columns, values = [], [], []
        nodes = np.arange(self._n)
        alone = self._image == nodes
        first, second = nodes[nodes < self._image], self._image[nodes < self._image]
        half = np.sqrt(0.5)
        for component, s in enumerate((1.0, -1.0, 1.0)):
            a, b, c = 3 * first + component, 3 * second + component, 3 * nodes[alone] + component
            for row, column, value in (
                (a, a, half),
                (b, a, s * half),
                (a, b, 1j * half),
                (b, b, -1j * s * half),
                (c, c, 1.0 if s > 0.0 else 1j),
            ):
                rows.append(row)
                columns.append(column)
                values.append(np.full(len(row), value, dtype=np.complex128))
        places, size = (np.concatenate(rows), np.concatenate(columns)), 3 * self._n
        return sparse.csc_array(sparse.coo_array((np.concatenate(values), places), shape=(size, size)))

    def basis(self, phase_rad: float) -> sparse.csc_array:
        """T, unitary: U = T x, and Tᴴ K T is real; column k stands for degree of freedom k or its pair."""
        on_low = np.repeat(self._on_low.astype(np.float64), 3)
        return sparse.csc_array(sparse.diags_array(np.exp(-0.5j * phase_rad * on_low)) @ self.plain)

    def real(self, own: sparse.csr_array, following: sparse.csr_array) -> RealFolded:
        """Tᴴ K T of K = A + e^{iφ} B + e^{−iφ} Bᵀ, for all φ at once.

        In the basis, what couples the low side to its own sector gets e^{−iφ/2}, what couples it to the sector before
        e^{iφ/2}, the rest no phase: K̃ = K₀ + cos(φ/2) K₁ + sin(φ/2) K₂.
        """
        low = np.repeat(self._on_low.astype(np.float64), 3)
        on_low, inside = sparse.diags_array(low), sparse.diags_array(1.0 - low)
        to_own, to_previous = inside @ own @ on_low, inside @ following @ on_low
        rest = inside @ own @ inside + on_low @ own @ on_low
        both, apart = to_own + to_previous, 1j * (to_previous - to_own)
        return RealFolded(self._turned(rest), self._turned(both + both.T), self._turned(apart + apart.conj().T))

    def _turned(self, matrix: sparse.csr_array) -> sparse.csc_array:
        turned = sparse.csc_array(self.plain.conj().T @ matrix @ self.plain)
        data = np.ascontiguousarray(turned.data.real)
        data[np.abs(data) < 1e-15 * np.abs(data).max()] = 0.0
        real = sparse.csc_array((data, turned.indices, turned.indptr), shape=turned.shape)
        real.eliminate_zeros()
        return real


# Mean motion of the bore: one node at the hub, spread over the bore's surface (RBE3).

ComplexArray = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


def hub_rows(mesh: SectorMesh, n_dof: int, places: IntArray) -> FloatArray:
    """Return a sector's share of the bore's mean motion, (6, n_dof), from cylindrical components.

    The rigid motion closest to that of the bore's surface, weighted by area:

        t = Σ w u / Σ w,   θ_x = Σ w (y u_z − z u_y)/Σ w (y² + z²),  …,  θ_z = Σ w r u_θ/Σ w r²

    (over the whole bore the first moments vanish, so that the six are independent). Forces at the hub are spread by the
    transpose: nothing is stiffened.

    Parameters
    ----------
    mesh : SectorMesh
    n_dof : int
    places : array of int
        Place of each of the sector's nodes among those of the degrees of freedom.
    """
    nodes = mesh.bore[:-1]  # the high side belongs to the next sector
    weight = _surface_weights(mesh) / mesh.blank.n_teeth
    points = mesh.points_m[nodes.ravel()]
    x, y, z = points.T
    radius = np.hypot(x, y)
    radial, around = np.column_stack((x, y, 0 * x)) / radius[:, None], np.column_stack((-y, x, 0 * x)) / radius[:, None]
    axes = np.stack((radial, around, np.broadcast_to([0.0, 0.0, 1.0], points.shape)), axis=1)  # (node, component, xyz)
    about = np.cross(points[:, None, :], axes)  # moment of each component's unit force
    square = np.array([np.sum(weight * (radius**2 / 2.0 + z**2))] * 2 + [np.sum(weight * radius**2)])
    square *= mesh.blank.n_teeth
    share = np.concatenate((axes, about / square), axis=2) * weight[:, None, None]
    rows = np.zeros((6, n_dof))
    dof = 3 * places[nodes.ravel()][:, None] + np.arange(3)
    for motion in range(6):
        np.add.at(rows[motion], dof, share[:, :, motion])
    return rows


def hub_sum(n: int, n_sectors: int) -> ComplexArray:
    """Σ_k R(2πk/z) e^{2πink/z}, (6, 6): what the shares of all sectors add up to; 0 unless n is 0 or 1."""
    total = np.zeros((6, 6), dtype=np.complex128)
    for k in range(n_sectors):
        angle = 2.0 * pi * k / n_sectors
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        total += np.kron(np.eye(2), turn) * np.exp(1j * n * angle)
    total[np.abs(total) < 1e-9 * n_sectors] = 0.0
    return total


def _surface_weights(mesh: SectorMesh) -> FloatArray:
    """Part of the sector's bore area that belongs to each own node, raveled; they add up to 1."""
    around = whole_weights(np.linspace(0.0, 1.0, mesh.bore.shape[0]), mesh.size.order)
    around[0] += around[-1]
    along = whole_weights(mesh.points_m[mesh.bore[0], 2], mesh.size.order)
    return np.outer(around[:-1], along).ravel()


Held = Literal["free", "bore"]
"""The bore is free, but for springs at the hub if there are any, or every node of it is held."""

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

    def __post_init__(self) -> None:
        if self.hub_stiffness is None:
            return
        springs = frozen_array(self.hub_stiffness, "hub_stiffness", ndim=1)
        if springs.shape != (6,) or springs.min() <= 0.0 or springs[0] != springs[1] or springs[3] != springs[4]:
            raise InputError(
                f"hub_stiffness is {springs.tolist()}",
                allowed="six numbers above 0, the first two equal, and the fourth and fifth",
            )
        object.__setattr__(self, "hub_stiffness", springs)

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
        return np.setdiff1d(np.arange(self.mesh.n_nodes), self.mesh.high_side)

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
        return hub_rows(self.mesh, 3 * len(self.own_nodes), self.own_places)

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
        if n > 1 or self.hub_stiffness is not None:
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


# Natural frequencies and modes of a gear by cyclic symmetry.

RIGID_HZ = 10.0
"""Below it a mode of the free gear is rigid; those computed lie below 0.1 Hz, elastic ones far above."""


@dataclass(frozen=True)
class CyclicModes(Result):
    """Modes of a gear, ascending in frequency; those with 0 < n < z/2 stand once here and are pairs.

    Parameters
    ----------
    frequencies_hz : array, (n_shapes,)
    nodal_diameters : array of int, (n_shapes,)
    shapes : array, (n_own_dof, n_shapes)
        Complex U of sector 0, in cylindrical components: the motion of sector k is Re or Im of U e^{2πink/z}. The modal
        mass of each real mode over the whole gear is 1 kg.
    """

    frequencies_hz: FloatArray
    nodal_diameters: IntArray
    shapes: ComplexArray

    def multiplicity(self, n_sectors: int) -> IntArray:
        """2 for pairs, 1 for single modes."""
        single = (self.nodal_diameters == 0) | (2 * self.nodal_diameters == n_sectors)
        return np.where(single, 1, 2)


def real_values(values: ComplexArray, multiplicity: IntArray) -> FloatArray:
    """Values of the real modes, from those of the shapes along the last axis: real parts, of pairs Im as well."""
    parts = np.stack((values.real, values.imag), axis=-1)
    return parts[..., np.arange(2) < multiplicity[:, None]]


def cyclic_modes(gear: CyclicGear, n_modes: int = 20, held: Held = "free", *, elastic: bool = False) -> CyclicModes:
    """Return the lowest modes; a pair counts as two, and is never cut.

    Nodal diameters are taken in turn until two running have nothing below the highest frequency kept.

    Parameters
    ----------
    gear : CyclicGear
    n_modes : int
        At least so many are returned.
    held : str
        "free" or "bore".
    elastic : bool
        Leave out the rigid motions of a free gear.

    Source: D. L. Thomas, Dynamics of rotationally periodic structures, International Journal for Numerical Methods in
    Engineering 14 (1979).
    """
    n_asked = count(n_modes, "n_modes")
    modes: list[tuple[float, int, ComplexArray]] = []
    empty = 0
    for n in gear.diameters:
        # With too few yet, as many as are wanted are looked for: the limit comes down with each nodal diameter.
        limit = _limit(modes, n_asked, gear.n_sectors)
        new = _below(gear, n, held, n_asked, limit, elastic)
        modes += new
        empty = 0 if new else empty + 1
        if empty == 2 and np.isfinite(limit):
            break
    modes.sort(key=lambda mode: mode[:2])
    kept, total = 0, 0
    while kept < len(modes) and total < n_asked:
        total += _multiplicity(modes[kept][1], gear.n_sectors)
        kept += 1
    chosen = modes[:kept]
    shapes = np.column_stack([shape for *_, shape in chosen])
    return CyclicModes(np.array([m[0] for m in chosen]), np.array([m[1] for m in chosen]), shapes)


def modes_of_diameter(gear: CyclicGear, n: int, n_shapes: int, held: Held = "free") -> tuple[FloatArray, ComplexArray]:
    """Lowest `n_shapes` frequencies (Hz) and shapes of one nodal diameter, with unit modal mass over the whole gear.

    Shift-and-invert Lanczos in real coordinates, then a Rayleigh–Ritz step, which sharpens the vectors.
    """
    return _lowest(_problem(gear, n, held), n_shapes)


def lowest_with_static(
    gear: CyclicGear, n: int, n_shapes: int, loads: ComplexArray
) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Frequencies and shapes as `modes_of_diameter`, of a gear on springs, and its static answers to loads."""
    problem = _problem(gear, n, "free")
    frequencies, shapes = _lowest(problem, n_shapes)
    return frequencies, shapes, problem.static(loads)


class _Problem(NamedTuple):
    """Real matrices of one nodal diameter, factorised for shift-and-invert."""

    stiffness: sparse.csc_array
    mass: sparse.csc_array
    kept: IntArray
    n_own: int
    shift: float
    solve: Solver
    basis: sparse.csc_array
    scale: float

    def static(self, loads: ComplexArray) -> ComplexArray:
        """K⁻¹ loads; without a shift and with nothing held only."""
        return self.basis @ self.solve(np.asarray(self.basis.conj().T @ loads))


def _problem(gear: CyclicGear, n: int, held: Held) -> _Problem:
    stiffness, mass, basis = gear.system(n)
    n_own = stiffness.shape[0]
    kept = np.arange(n_own)
    if held == "bore":
        kept = np.setdiff1d(kept, gear.bore_dof)
        stiffness, mass = stiffness[kept][:, kept], mass[kept][:, kept]
    # A shift below zero makes the matrix definite where the gear floats; it costs a few more steps elsewhere.
    floats = held == "free" and gear.hub_stiffness is None and n <= 1
    shift = -((2.0 * pi * 300.0) ** 2) if floats else 0.0
    solve = factorised(sparse.csc_array(stiffness - shift * mass) if shift else stiffness)
    scale = _multiplicity(n, gear.n_sectors) / gear.n_sectors
    return _Problem(stiffness, mass, kept, n_own, shift, solve, basis, scale)


def _lowest(problem: _Problem, n_shapes: int) -> tuple[FloatArray, ComplexArray]:
    from scipy.linalg import eigh
    from scipy.sparse.linalg import LinearOperator, eigsh

    stiffness, mass = problem.stiffness, problem.mass
    inverse = LinearOperator(stiffness.shape, matvec=problem.solve, dtype=stiffness.dtype)
    start = np.random.default_rng(1).standard_normal(len(problem.kept)).astype(stiffness.dtype)
    _, vectors = eigsh(stiffness, n_shapes, M=mass, sigma=problem.shift, OPinv=inverse, v0=start, tol=1e-11)
    small_k, small_m = (vectors.conj().T @ (matrix @ vectors) for matrix in (stiffness, mass))
    values, turn = eigh(small_k, small_m)
    full = np.zeros((problem.n_own, n_shapes), dtype=np.complex128)
    full[problem.kept] = vectors @ turn * np.sqrt(problem.scale)
    return np.sqrt(np.maximum(values, 0.0)) / (2.0 * pi), _phased(np.asarray(problem.basis @ full))


def _below(
    gear: CyclicGear, n: int, held: Held, n_modes: int, limit_hz: float, elastic: bool
) -> list[tuple[float, int, ComplexArray]]:
    """Modes of one nodal diameter below a limit."""
    problem = _problem(gear, n, held)
    n_shapes = min(6, 2 + n_modes // 2) if n < 2 else 3
    while True:
        frequencies, shapes = _lowest(problem, n_shapes)
        # Without a limit, more shapes than are wanted in all cannot be needed.
        if frequencies[-1] > limit_hz or n_shapes >= n_modes + 2 or n_shapes > shapes.shape[0] // 4:
            break
        n_shapes = 2 * n_shapes
    indices = range(len(frequencies))
    above_hz = RIGID_HZ if elastic else -1.0
    return [(float(frequencies[k]), n, shapes[:, k]) for k in indices if above_hz < frequencies[k] <= limit_hz]


def _limit(modes: list[tuple[float, int, ComplexArray]], n_modes: int, n_sectors: int) -> float:
    """Frequency of the last wanted mode so far; infinite while there are too few."""
    repeated = sorted(f for f, n, _ in modes for _ in range(_multiplicity(n, n_sectors)))
    return repeated[n_modes - 1] if len(repeated) >= n_modes else np.inf


def _multiplicity(n: int, n_sectors: int) -> int:
    return 1 if n == 0 or 2 * n == n_sectors else 2


def _phased(shapes: ComplexArray) -> ComplexArray:
    """Turn each shape so that its largest component is real and positive: the same gear gives the same numbers."""
    top = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(shapes.shape[1])]
    phased: ComplexArray = shapes * (np.abs(top) / top)
    return phased


# The motion of every node in a mode, for figures and files.

MOSTLY = 0.9
"""Part of a mode's kinetic energy from which on the gear moves as a whole."""
RIGID = (("moves along the shaft", "turns about the shaft"), ("moves across the shaft", "tilts"))
"""Motions of `CyclicGear.rigid` with 0 and with 1 nodal diameter."""


def rigid_part(gear: CyclicGear, modes: CyclicModes, which: int) -> str:
    """How the gear moves as a whole in a mode, where nine tenths of the kinetic energy are of one such motion."""
    n = int(modes.nodal_diameters[which])
    if n > 1:
        return ""
    moving = np.asarray(gear.mass.at(gear.phase_rad(n)) @ modes.shapes[:, which])
    energy = float(np.vdot(modes.shapes[:, which], moving).real)
    part = np.abs(gear.rigid(n).conj().T @ moving) ** 2 / energy
    largest = int(np.argmax(part))
    return RIGID[n][largest] if part[largest] > MOSTLY else ""


def mode_field(gear: CyclicGear, modes: CyclicModes, which: int, *, sine: bool = False) -> FloatArray:
    """Return a real mode at all nodes, (n_teeth, n_nodes, 3), x, y, z in the axes of each sector; modal mass 1 kg.

    Parameters
    ----------
    gear : CyclicGear
    modes : CyclicModes
    which : int
        Place among the shapes.
    sine : bool
        The second mode of a pair.

    Raises
    ------
    InputError
        If there is no such mode.
    """
    if not 0 <= which < len(modes.frequencies_hz):
        raise InputError(f"which is {which}", allowed=f"0 to {len(modes.frequencies_hz) - 1}")
    n = int(modes.nodal_diameters[which])
    if sine and modes.multiplicity(gear.n_sectors)[which] == 1:
        raise InputError(f"mode {which} has {n} nodal diameters and is single", remedy="leave out sine")
    waves = np.exp(1j * gear.phase_rad(n) * np.arange(gear.n_sectors))[:, None] * modes.shapes[:, which]
    return gear.sector_fields(waves.imag if sine else waves.real)
