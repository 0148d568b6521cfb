"""Craig–Bampton reduction of a whole gear to hub, contact patches, auxiliary nodes and fixed-interface modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from sims.fe_gear._blank import (
    check_memory,
    craig_bampton_bytes,
    one_thread,
)
from sims.fe_gear._cyclic import (
    ComplexArray,
    CyclicGear,
    CyclicModes,
    cyclic_modes,
    hub_sum,
    lowest_with_static,
    real_values,
)
from sims.fe_gear._mesh import IntArray, SectorMesh
from sims.fe_gear._reduced_gear import (
    N_HUB,
    flank_grid,
    height_nodes,
    plane_row,
    point_and_push,
    slice_weights,
)

# Master degrees of freedom of a Craig–Bampton reduction: hub, contact patches, and auxiliary nodes.


class Masters(NamedTuple):
    """Masters in addition to the six of the hub, which always come first.

    Attributes
    ----------
    rows : array, (n_rows, n_own_dof)
        Distinct rows over a sector's own degrees of freedom.
    row_of : array of int, (n,)
        Row of each master.
    tooth_of : array of int, (n,)
        Sector of each master.
    """

    rows: FloatArray
    row_of: IntArray
    tooth_of: IntArray

    @property
    def n_masters(self) -> int:
        """Number of masters, including those of the hub."""
        return N_HUB + len(self.row_of)


def contact_masters(gear: CyclicGear, teeth: Sequence[int] = (0, 1, 2, 3), n_slices: int = 5) -> Masters:
    """Contact patches in the middle of some teeth's flanks: for each slice the motion along the push, the flank and z.

    Parameters
    ----------
    gear : CyclicGear
    teeth : sequence of int
    n_slices : int
        At most the number of node layers along the face: more could not move independently.

    Raises
    ------
    InputError
        If there are more slices than layers.
    """
    n_layers = gear.mesh.tooth.shape[2]
    if n_slices > n_layers:
        raise InputError(
            f"n_slices is {n_slices}",
            allowed=f"at most {n_layers}, the layers of nodes along the face",
            remedy="take fewer slices, or more cells along the face",
        )
    mesh, n_dof = gear.mesh, 3 * len(gear.own_nodes)
    roll = float(np.mean(flank_grid(mesh.blank.geometry, 2, 1).roll_rad))
    point, push = point_and_push(mesh.blank.geometry, roll, 1.0)
    nodes = height_nodes(mesh, roll, "patch", 0)
    along_flank = np.array([-push[1], push[0]])
    axial = np.column_stack((np.zeros((len(nodes.weights), 2)), nodes.weights))
    planes = (plane_row(mesh, nodes, point, push), plane_row(mesh, nodes, point, along_flank), axial)
    dof = 3 * gear.own_places[nodes.nodes][..., None] + np.arange(3)
    rows = np.zeros((n_slices, 3, n_dof))
    for k, z in enumerate(flank_grid(mesh.blank.geometry, 2, n_slices).z_m):
        weights = slice_weights(mesh, float(z), n_slices, "patch")
        for component, plane in enumerate(planes):
            np.add.at(rows[k, component], dof, plane[:, None, :] * weights[None, :, None])
    n = 3 * n_slices
    row_of, tooth_of = np.tile(np.arange(n), len(teeth)), np.repeat(np.asarray(teeth, dtype=np.int64), n)
    return Masters(rows.reshape(n, n_dof), row_of, tooth_of)


def with_auxiliary(gear: CyclicGear, masters: Masters, modes: CyclicModes, n_nodes: int) -> Masters:
    """Add the nodes of the whole gear that best distinguish its modes, with three degrees of freedom each.

    Each node in turn is the one that most increases det(Q), Q = Σ over masters of aᵀa, where a is a master's motion in
    the modes (each scaled to its maximum).

    Source: D. C. Kammer, Sensor placement for on-orbit modal identification and correlation of large space structures,
    Journal of Guidance, Control, and Dynamics 14 (1991), for the determinant as the criterion.
    """
    if not n_nodes:
        return masters
    at_nodes = _real_motion(gear, modes)  # (sector, node, 3, mode)
    scale = np.abs(at_nodes).max(axis=(0, 1, 2))
    at_nodes = at_nodes / scale
    at_masters = motion_at(masters, gear, modes)[N_HUB:] / scale
    information = at_masters.T @ at_masters + 1e-6 * np.eye(len(scale))
    flat = at_nodes.reshape(-1, 3, len(scale))
    chosen: list[int] = []
    for _ in range(n_nodes):
        small = np.eye(3) + flat @ np.linalg.inv(information) @ flat.transpose(0, 2, 1)
        gain = np.linalg.det(small)
        gain[chosen] = 0.0
        best = int(np.argmax(gain))
        chosen.append(best)
        information += flat[best].T @ flat[best]
    return _with_nodes(masters, np.array(chosen), len(gear.own_nodes))


def phased_rows(masters: Masters, gear: CyclicGear, n: int) -> tuple[ComplexArray, ComplexArray]:
    """Rows for nodal diameter n, and the matrix that gives the masters from them.

    Returns
    -------
    rows : array, (n_rows + 6, n_own_dof)
        Hub first.
    turn : array, (n_masters, n_rows + 6)
        Master = turn · rows · U; a force on it acts as the conjugate transpose, divided by z.
    """
    z, n_rows = gear.n_sectors, len(masters.rows)
    hub = hub_sum(n, z) @ gear.hub if n <= 1 else np.zeros((N_HUB, masters.rows.shape[1]))
    turn = np.zeros((masters.n_masters, N_HUB + n_rows), dtype=np.complex128)
    turn[:N_HUB, :N_HUB] = np.eye(N_HUB)
    place = np.arange(N_HUB, masters.n_masters)
    turn[place, N_HUB + masters.row_of] = np.exp(1j * gear.phase_rad(n) * masters.tooth_of)
    return np.vstack((hub, masters.rows)).astype(np.complex128), turn


def _with_nodes(masters: Masters, chosen: IntArray, n_nodes: int) -> Masters:
    sectors, nodes = np.divmod(chosen, n_nodes)
    rows = np.zeros((3 * len(chosen), 3 * n_nodes))
    for k, node in enumerate(nodes):
        rows[3 * k + np.arange(3), 3 * node + np.arange(3)] = 1.0
    return Masters(
        np.vstack((masters.rows, rows)),
        np.concatenate((masters.row_of, len(masters.rows) + np.arange(len(rows)))),
        np.concatenate((masters.tooth_of, np.repeat(sectors, 3))),
    )


def _real_motion(gear: CyclicGear, modes: CyclicModes) -> FloatArray:
    """Motion of all nodes in the real modes (sector, node, component, mode)."""
    phase = 2.0 * np.pi * modes.nodal_diameters / gear.n_sectors
    waves = np.exp(1j * phase * np.arange(gear.n_sectors)[:, None])[:, None] * modes.shapes
    motion = real_values(waves, modes.multiplicity(gear.n_sectors))
    return motion.reshape(gear.n_sectors, -1, 3, motion.shape[-1])


def motion_at(masters: Masters, gear: CyclicGear, modes: CyclicModes) -> FloatArray:
    """Motion of the masters in the real modes, (n_masters, n_modes)."""
    columns = []
    for k, n in enumerate(modes.nodal_diameters):
        rows, turn = phased_rows(masters, gear, int(n))
        columns.append(turn @ (rows @ modes.shapes[:, k]))
    return real_values(np.column_stack(columns), modes.multiplicity(gear.n_sectors))


# Accuracy of a reduced gear's modes against the full model.

SAME_HZ = 1e-3
"""Relative distance within which modes of the full model form one subspace; errors of this size rotate its vectors."""


@dataclass(frozen=True)
class ReductionAccuracy:
    """Elastic modes of the full and of the reduced model, side by side.

    Parameters
    ----------
    full_hz, reduced_hz : array, (n,)
    subspace_mac : array, (n,)
        Minimum squared cosine, weighted by mass, between the full mode's subspace of equal frequencies (to 0.1 %) and
        the reduced modes of that frequency: 1 if the reduced model contains it.
    rigid_hz : array, (6,)
        Of the reduced model; 0 for a free gear.
    """

    full_hz: FloatArray
    reduced_hz: FloatArray
    subspace_mac: FloatArray
    rigid_hz: FloatArray

    @property
    def errors(self) -> FloatArray:
        """Relative errors of the frequencies."""
        return self.reduced_hz / self.full_hz - 1.0

    @property
    def worst_error(self) -> float:
        """Maximum absolute error."""
        return float(np.abs(self.errors).max())

    @property
    def minimum_mac(self) -> float:
        """Minimum over all compared modes."""
        return float(self.subspace_mac.min())

    def table(self) -> str:
        """Return the comparison as text, a line for each mode."""
        head = f"{'full Hz':>12} {'reduced Hz':>12} {'error %':>10} {'subspace MAC':>14}"
        rows = zip(self.full_hz, self.reduced_hz, 100.0 * self.errors, self.subspace_mac, strict=True)
        return "\n".join([head, *(f"{f:12.3f} {r:12.3f} {e:10.5f} {m:14.9f}" for f, r, e, m in rows)])


def matched(
    full_hz: FloatArray, reduced_hz: FloatArray, products: FloatArray, *, rigid_hz: FloatArray
) -> ReductionAccuracy:
    """Compare full and reduced modes in order of frequency.

    Parameters
    ----------
    full_hz : array, (n,)
        Ascending.
    reduced_hz : array, (m,)
        Elastic ones, ascending, m ≥ n.
    products : array, (n, m)
        Mass products of full and reduced modes, both mass-normalised.
    rigid_hz : array

    Source: R. J. Allemang, The modal assurance criterion – twenty years of use and abuse, Sound and Vibration (2003),
    for the criterion; for subspaces, the squared cosines of their principal angles.
    """
    n = len(full_hz)
    mac = np.empty(n)
    start = 0
    while start < n:
        end = start + 1
        while end < n and full_hz[end] <= full_hz[start] * (1.0 + SAME_HZ):
            end += 1
        near = np.abs(reduced_hz / np.mean(full_hz[start:end]) - 1.0) < SAME_HZ
        near[start:end] = True
        cosines = np.linalg.svd(products[start:end, near], compute_uv=False)
        mac[start:end] = cosines[-1] ** 2
        start = end
    return ReductionAccuracy(full_hz, reduced_hz[:n], mac, rigid_hz)


# Craig–Bampton reduction of a whole gear with selected masters, by cyclic symmetry.

N_COMPARED = 20
"""Number of elastic modes in the table of errors."""


@dataclass(frozen=True)
class CraigBamptonPlan:
    """Size of a Craig–Bampton reduction.

    Parameters
    ----------
    n_dof : int
        Of the reduced gear: masters and fixed-interface modes.
    n_teeth, n_slices : int
        Contact patches, three degrees of freedom each; four teeth and five slices give 60, with the hub 66 masters.
    n_auxiliary : int
        Auxiliary nodes, three degrees of freedom each.
    n_shapes : int
        Shapes for each nodal diameter from which the fixed-interface modes are built; z times as many in all.
    """

    n_dof: int = 229
    n_teeth: int = 4
    n_slices: int = 5
    n_auxiliary: int = 4
    n_shapes: int = 12

    def __post_init__(self) -> None:
        count(self.n_teeth, "n_teeth")
        count(self.n_slices, "n_slices")
        count(self.n_auxiliary, "n_auxiliary", minimum=0)
        count(self.n_shapes, "n_shapes", minimum=2)
        count(self.n_dof, "n_dof", minimum=self.n_masters + 1, remedy="keep more, or take fewer masters")

    @property
    def n_masters(self) -> int:
        """Masters of hub, contact patches and auxiliary nodes."""
        return N_HUB + 3 * (self.n_teeth * self.n_slices + self.n_auxiliary)


@dataclass(frozen=True)
class CraigBamptonGear:
    """A free, undamped gear reduced to master degrees of freedom and fixed-interface modes.

    Parameters
    ----------
    stiffness, mass : array, (n_dof, n_dof)
        Masters first (six of the hub: m, rad; then contact patches, auxiliary nodes: m), then modal coordinates.
    masters : Masters
    accuracy : ReductionAccuracy
        Against the full model.
    """

    stiffness: FloatArray = field(repr=False)
    mass: FloatArray = field(repr=False)
    masters: Masters = field(repr=False)
    accuracy: ReductionAccuracy


class _Space(NamedTuple):
    """Modes φ of the whole gear on hub springs, and static responses to forces on the masters.

    Attributes
    ----------
    squares : array, (p,)
        ω² of the real modes.
    at_masters : array, (m, p)
        Bφ.
    compliance : array, (m, m)
        B K⁻¹ Bᵀ.
    inertia : array, (m, m)
        B K⁻¹ M K⁻¹ Bᵀ, the mass matrix of the static responses.
    with_modes, with_static : arrays, (r, p) and (r, m)
        Mass products of the full model's reference modes with φ and with the static responses.
    """

    squares: FloatArray
    at_masters: FloatArray
    compliance: FloatArray
    inertia: FloatArray
    with_modes: FloatArray
    with_static: FloatArray


class _Targets(NamedTuple):
    """Elastic modes of the free gear that the reduction must keep: frequencies, and motion of the masters (m, r)."""

    frequencies_hz: FloatArray
    at_masters: FloatArray

    @property
    def squares(self) -> FloatArray:
        """ω², (r,)."""
        return (2.0 * np.pi * self.frequencies_hz) ** 2


def craig_bampton(
    mesh: SectorMesh, plan: CraigBamptonPlan | None = None, n_compared: int = N_COMPARED
) -> CraigBamptonGear:
    """Reduce a gear to masters and fixed-interface modes, and compare its first elastic modes with the full model.

    u = Ψ u_m + Y η;  Ψ: static responses to unit motions of the masters, Y: modes with the masters fixed.

    Everything follows from solutions of one sector. Ψ is exact. The fixed-interface modes are those of the full model
    within the space of its lowest z·n_shapes modes (hub on springs, which are removed afterwards) and Ψ. The modes kept
    are those that the first elastic modes of the gear need most, not those of lowest frequency, many of which are modes
    of single teeth that do not contribute.

    Parameters
    ----------
    mesh : SectorMesh
    plan : CraigBamptonPlan or None
        None: 229 degrees of freedom.
    n_compared : int
        Elastic modes compared.

    Raises
    ------
    InputError
        If there are more slices than node layers, or memory is insufficient.

    Source: R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968).
    """
    used = CraigBamptonPlan() if plan is None else plan
    check_memory(craig_bampton_bytes(mesh.blank, mesh.size, n_compared))
    with one_thread():
        free = CyclicGear(mesh)
        reference = cyclic_modes(free, n_compared, elastic=True)
        teeth = tuple(range(used.n_teeth))
        contact = contact_masters(free, teeth, used.n_slices)
        masters = with_auxiliary(free, contact, reference, used.n_auxiliary)
        springs = _hub_springs(mesh)
        space = _space(CyclicGear(mesh, springs), masters, reference, used.n_shapes)
        targets = _Targets(
            np.repeat(reference.frequencies_hz, reference.multiplicity(free.n_sectors)),
            motion_at(masters, free, reference),
        )
        return _reduced(space, masters, springs, targets, used.n_dof)


def _hub_springs(mesh: SectorMesh) -> FloatArray:
    """Hub springs about as stiff as the body, which only make the matrices definite."""
    b = mesh.blank
    stiffness = 0.1 * b.material.youngs_modulus_pa * b.geometry.face_width_mm * 1e-3
    turning = stiffness * (b.geometry.bore_mm * 1e-3) ** 2
    return np.array([stiffness] * 3 + [turning] * 3)


def _space(gear: CyclicGear, masters: Masters, reference: CyclicModes, n_shapes: int) -> _Space:
    z, m = gear.n_sectors, masters.n_masters
    squares: list[FloatArray] = []
    at_masters: list[FloatArray] = []
    products: list[tuple[int, int, FloatArray]] = []
    compliance, inertia = np.zeros((m, m)), np.zeros((m, m))
    with_static = np.zeros((int(reference.multiplicity(z).sum()), m))
    for n in gear.diameters:
        weight = (1.0 if n == 0 or 2 * n == z else 2.0) / z
        rows, turn = phased_rows(masters, gear, n)
        frequencies, shapes, static = lowest_with_static(gear, n, n_shapes, rows.conj().T)
        mass = gear.mass.at(gear.phase_rad(n))
        moved = np.asarray(mass @ static)
        compliance += weight * np.real(turn @ (rows @ static) @ turn.conj().T)
        inertia += weight * np.real(turn @ (static.conj().T @ moved) @ turn.conj().T)
        pair = 0 < 2 * n < z
        multiplicity = np.full(n_shapes, 2 if pair else 1)
        squares.append(np.repeat((2.0 * np.pi * frequencies) ** 2, multiplicity))
        at_masters.append(real_values(turn @ (rows @ shapes), multiplicity))
        for place, shape in _references(reference, n, z):
            _add_products(with_static, place, shape, moved @ turn.conj().T, pair)
            products.append((place, n, _mode_products(shape, np.asarray(mass @ shapes), z, pair)))
    widths = np.cumsum([0, *(len(s) for s in squares)])
    with_modes = np.zeros((len(with_static), widths[-1]))
    for place, n, block in products:
        with_modes[place : place + len(block), widths[n] : widths[n + 1]] = block
    return _Space(np.concatenate(squares), np.hstack(at_masters), compliance, inertia, with_modes, with_static)


def _reduced(space: _Space, masters: Masters, springs: FloatArray, targets: _Targets, n_dof: int) -> CraigBamptonGear:
    """Matrices in (u_m, η); y = φ − Ψ Bφ are motions with the masters fixed."""
    from scipy.linalg import eigh

    c = space.at_masters
    held = np.linalg.inv(space.compliance)
    held = (held + held.T) / 2.0
    static_mass = held @ space.inertia @ held
    mode_static = (c.T / space.squares[:, None]) @ held
    inner_k = np.diag(space.squares) - c.T @ held @ c
    crossed = mode_static @ c
    inner_m = np.eye(len(space.squares)) - crossed - crossed.T + c.T @ static_mass @ c
    values, turn = _definite_modes(inner_k, inner_m)
    coupled = turn.T @ (mode_static - c.T @ static_mass)
    kept = _needed(values, coupled, targets, n_dof - masters.n_masters)
    values, turn, coupled = values[kept], turn[:, kept], coupled[kept]
    m = masters.n_masters
    stiffness, mass = np.zeros((m + len(values),) * 2), np.eye(m + len(values))
    stiffness[:m, :m] = held
    stiffness[range(N_HUB), range(N_HUB)] -= springs
    stiffness[range(m, m + len(values)), range(m, m + len(values))] = values
    mass[:m, :m], mass[m:, :m], mass[:m, m:] = static_mass, coupled, coupled.T
    squares, vectors = eigh(stiffness, mass)
    on_masters = space.with_static @ held
    products = np.hstack((on_masters, (space.with_modes - on_masters @ c) @ turn)) @ vectors
    frequencies = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
    accuracy = matched(targets.frequencies_hz, frequencies[N_HUB:], products[:, N_HUB:], rigid_hz=frequencies[:N_HUB])
    return CraigBamptonGear(stiffness, mass, masters, accuracy)


def _needed(squares: FloatArray, coupled: FloatArray, targets: _Targets, n_modes: int) -> IntArray:
    """Indices of the fixed-interface modes whose absence would cause the largest errors of targets, ascending.

    Without mode i, coupled to the masters by c_i, the error of target j's squared frequency is about
    ω_j⁴ (c_iᵀ x_j)²/|λ_i − ω_j²|, with x_j the masters' motion in it.
    """
    away = np.abs(squares[:, None] - targets.squares)
    missed = (coupled @ targets.at_masters) ** 2 * targets.squares / away
    return np.sort(np.argsort(-missed.max(axis=1), kind="stable")[:n_modes])


def _definite_modes(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All modes in the subspace where the mass is well above rounding."""
    from scipy.linalg import eigh

    weights, axes = eigh(mass)
    kept = weights > 1e-9 * weights[-1]
    white = axes[:, kept] / np.sqrt(weights[kept])
    values, turn = eigh(white.T @ stiffness @ white)
    return values, white @ turn


def _references(modes: CyclicModes, n: int, z: int) -> list[tuple[int, ComplexArray]]:
    """Index among the real reference modes, and shape, of those with nodal diameter n."""
    starts = np.concatenate(([0], np.cumsum(modes.multiplicity(z))))
    return [(int(starts[k]), modes.shapes[:, k]) for k in np.flatnonzero(modes.nodal_diameters == n)]


def _add_products(into: FloatArray, place: int, shape: ComplexArray, moved: ComplexArray, pair: bool) -> None:
    """Mass products with static responses, whose n-th wave is U/z: Re(VᴴMU) and −Im(VᴴMU)."""
    product = shape.conj() @ moved
    into[place] = product.real
    if pair:
        into[place + 1] = -product.imag


def _mode_products(shape: ComplexArray, moved: ComplexArray, z: int, pair: bool) -> FloatArray:
    """Mass products of a reference mode (both of a pair) with the real modes of the same nodal diameter."""
    product = z * (shape.conj() @ moved)
    if not pair:
        return product.real[None]
    block = np.empty((2, 2 * len(product)))
    block[0, ::2], block[0, 1::2] = product.real / 2.0, product.imag / 2.0
    block[1, ::2], block[1, 1::2] = -product.imag / 2.0, product.real / 2.0
    return block
