"""Craig–Bampton reduction of a whole gear with selected masters, by cyclic symmetry."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count
from sims.reduced_fe.accuracy import ReductionAccuracy, matched
from sims.reduced_fe.cyclic import CyclicGear
from sims.reduced_fe.cyclic_modes import CyclicModes, cyclic_modes, lowest_with_static
from sims.reduced_fe.hub import ComplexArray
from sims.reduced_fe.memory import check_memory, craig_bampton_bytes
from sims.reduced_fe.one_thread import one_thread
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray
from sims.reduced_fe.selected_masters import N_HUB, Masters, contact_masters, motion_at, phased_rows, with_auxiliary

N_COMPARED = 20
"""Elastic modes in the table of errors."""


@dataclass(frozen=True)
class CraigBamptonPlan:
    """What is kept.

    Parameters
    ----------
    n_dof : int
        Of the reduced gear: masters and fixed-interface modes.
    n_teeth, n_slices : int
        Contact patches, three degrees of freedom each; four teeth and five slices make 60, with the hub 66 masters.
    n_auxiliary : int
        Auxiliary nodes, three degrees of freedom each.
    n_shapes : int
        Shapes of each nodal diameter, from which the fixed-interface modes are built; z times as many in all.
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
        """Hub, contact patches, auxiliary nodes."""
        return N_HUB + 3 * (self.n_teeth * self.n_slices + self.n_auxiliary)


@dataclass(frozen=True)
class CraigBamptonGear:
    """A gear reduced to master degrees of freedom and fixed-interface modes; free, without damping.

    Parameters
    ----------
    stiffness, mass : array, (n_dof, n_dof)
        Masters first (six of the hub: m, rad; then contact patches, auxiliary nodes: m), then modal coordinates.
    masters : Masters
    fixed_frequencies_hz : array
        Of the fixed-interface modes.
    accuracy : ReductionAccuracy
        Against the full model.
    """

    stiffness: FloatArray = field(repr=False)
    mass: FloatArray = field(repr=False)
    masters: Masters = field(repr=False)
    fixed_frequencies_hz: FloatArray
    accuracy: ReductionAccuracy


class _Space(NamedTuple):
    """What the whole gear, sprung at its hub, tells of its modes φ and of static answers s_b to forces on the masters.

    Attributes
    ----------
    squares : array, (p,)
        ω² of the real modes.
    at_masters : array, (m, p)
        Bφ.
    compliance : array, (m, m)
        B K⁻¹ Bᵀ.
    inertia : array, (m, m)
        B K⁻¹ M K⁻¹ Bᵀ, the mass matrix of the static answers.
    with_modes, with_static : arrays, (r, p) and (r, m)
        Mass products of the full model's reference modes with φ and with the static answers.
    """

    squares: FloatArray
    at_masters: FloatArray
    compliance: FloatArray
    inertia: FloatArray
    with_modes: FloatArray
    with_static: FloatArray


class _Targets(NamedTuple):
    """Elastic modes of the free gear that the reduction has to keep: frequencies, and motion of the masters (m, r)."""

    frequencies_hz: FloatArray
    at_masters: FloatArray

    @property
    def squares(self) -> FloatArray:
        """ω², (r,)."""
        squares: FloatArray = (2.0 * np.pi * self.frequencies_hz) ** 2
        return squares


def craig_bampton(
    mesh: SectorMesh, plan: CraigBamptonPlan | None = None, n_compared: int = N_COMPARED
) -> CraigBamptonGear:
    """Reduce a gear to masters and fixed-interface modes, and compare its first elastic modes with the full model.

    u = Ψ u_m + Y η;  Ψ: static answers to unit motions of the masters, Y: modes with the masters held.

    Everything follows from solutions of one sector. Ψ is exact. The fixed-interface modes are those of the full model
    within the space of its lowest z·n_shapes modes (hub on springs, which are taken off afterwards) and Ψ. Those are
    kept that the first elastic modes of the gear need most, not those of lowest frequency: tooth by tooth there are
    many of these that do not take part.

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
        If there are more slices than layers of nodes, or the memory does not suffice.

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
    """Springs about as stiff as the body: they only make the matrices definite."""
    b = mesh.blank
    stiffness = 0.1 * b.material.youngs_modulus_pa * b.geometry.face_width_mm * 1e-3
    turning = stiffness * (b.geometry.bore_mm * 1e-3) ** 2
    return np.array([stiffness] * 3 + [turning] * 3)


def _space(gear: CyclicGear, masters: Masters, reference: CyclicModes, n_shapes: int) -> _Space:
    z, m = gear.n_sectors, masters.n_masters
    squares: list[FloatArray] = []
    at_masters: list[FloatArray] = []
    products: list[tuple[int, FloatArray]] = []
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
        squares.append(np.repeat((2.0 * np.pi * frequencies) ** 2, 2 if pair else 1))
        at_masters.append(_real_columns(turn @ (rows @ shapes), pair))
        for place, shape in _references(reference, n, z):
            _add_products(with_static, place, shape, moved @ turn.conj().T, pair)
            products.append((place, _mode_products(shape, np.asarray(mass @ shapes), z, pair)))
    widths = np.cumsum([0, *(len(s) for s in squares)])
    with_modes = np.zeros((len(with_static), widths[-1]))
    for place, block in products:
        n = int(_diameter_of(reference, place, z))
        with_modes[place : place + len(block), widths[n] : widths[n + 1]] = block
    return _Space(np.concatenate(squares), np.hstack(at_masters), compliance, inertia, with_modes, with_static)


def _reduced(space: _Space, masters: Masters, springs: FloatArray, targets: _Targets, n_dof: int) -> CraigBamptonGear:
    """Matrices in (u_m, η); y = φ − Ψ Bφ are motions with the masters held."""
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
    return CraigBamptonGear(stiffness, mass, masters, np.sqrt(values) / (2.0 * np.pi), accuracy)


def _needed(squares: FloatArray, coupled: FloatArray, targets: _Targets, n_modes: int) -> IntArray:
    """Places of the fixed-interface modes without which a target would be missed most, ascending.

    Without mode i, coupled to the masters by c_i, the square of target j's frequency is off by about
    ω_j⁴ (c_iᵀ x_j)²/|λ_i − ω_j²|, x_j the masters' motion in it.
    """
    away = np.abs(squares[:, None] - targets.squares)
    missed = (coupled @ targets.at_masters) ** 2 * targets.squares / away
    return np.sort(np.argsort(-missed.max(axis=1), kind="stable")[:n_modes])


def _definite_modes(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All modes in the part of the space where the mass is well above rounding."""
    from scipy.linalg import eigh

    weights, axes = eigh(mass)
    kept = weights > 1e-9 * weights[-1]
    white = axes[:, kept] / np.sqrt(weights[kept])
    values, turn = eigh(white.T @ stiffness @ white)
    return values, white @ turn


def _real_columns(columns: ComplexArray, pair: bool) -> FloatArray:
    """Cosine and sine modes side by side."""
    if not pair:
        return columns.real
    return np.stack((columns.real, columns.imag), axis=-1).reshape(len(columns), -1)


def _references(modes: CyclicModes, n: int, z: int) -> list[tuple[int, ComplexArray]]:
    """Place among the real reference modes, and shape, of those of nodal diameter n."""
    starts = np.concatenate(([0], np.cumsum(modes.multiplicity(z))))
    return [(int(starts[k]), modes.shapes[:, k]) for k in np.flatnonzero(modes.nodal_diameters == n)]


def _diameter_of(modes: CyclicModes, place: int, z: int) -> int:
    starts = np.cumsum(modes.multiplicity(z))
    return int(modes.nodal_diameters[int(np.searchsorted(starts, place, side="right"))])


def _add_products(into: FloatArray, place: int, shape: ComplexArray, moved: ComplexArray, pair: bool) -> None:
    """Mass products with static answers, whose n-th wave is U/z: Re(VᴴMU) and −Im(VᴴMU)."""
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
