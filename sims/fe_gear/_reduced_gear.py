"""A reduced gear: modes and static compliance at flanks and hub, by cyclic symmetry, and kept on disk."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from hashlib import sha256
from math import cos, pi, sin
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np

from gearsig.cache import FRESH, OtherVersionError, cache_folder, modules_digest, read_arrays, write_whole
from gearsig.checks import FloatArray, count, frozen_array, one_of, positive
from gearsig.errors import InputError
from sims.fe_gear._blank import (
    GearBlank,
    MeshSize,
    check_memory,
    check_reducible,
    flank_place,
    mesh_size_for,
    one_thread,
    row_places,
    sector_bytes,
    side_curve,
)
from sims.fe_gear._cyclic import (
    ComplexArray,
    CyclicGear,
    CyclicModes,
    Held,
    cyclic_modes,
    hub_sum,
    real_values,
)
from sims.fe_gear._mesh import IntArray, SectorMesh, line_weights, mesh_quality, parabolic_weights, sector_mesh
from sims.mesh import GearGeometry, involute_outline

Support = Literal["free", "hub_held", "bore_clamped"]
"""How the body is held while a flank is pushed; see `ReducedGear.compliance_m_per_n`."""

N_HUB = 6
"""Motions of the hub: along x, y, z (m), about x, y, z (rad)."""


class FlankGrid(NamedTuple):
    """Points of a tooth where forces act: two flanks × heights × slices of the face width.

    All arrays over points have the shape (…, n_points) with n_points = 2 · n_heights · n_slices, in the order of
    `np.ravel` of (flank, height, slice). Flank 0 is the one at the positive angle (y > 0): a driver that turns ccw
    pushes with it. Flank 1 is its mirror image.

    Attributes
    ----------
    roll_rad : array, (n_heights,)
        τ = tan α at the point, ascending from the end of the fillet to the tip.
    z_m : array, (n_slices,)
        Middles of the slices from the middle plane of the face, ascending; the slices are equally wide.
    """

    roll_rad: FloatArray
    z_m: FloatArray

    @property
    def shape(self) -> tuple[int, int, int]:
        """(2, n_heights, n_slices)."""
        return 2, len(self.roll_rad), len(self.z_m)

    @property
    def n_points(self) -> int:
        """Of one tooth."""
        return 2 * len(self.roll_rad) * len(self.z_m)


@dataclass(frozen=True)
class ReducedGear:
    """Modes and static compliance of a gear at its flanks and hub, in the frame that turns with the gear.

    Axes: z along the shaft, x through the middle of tooth 0, origin in the middle of the bore; tooth k lies at the
    angle +k·2π/z (ccw about +z). *Push* at a flank point is displacement or force along the normal **into the
    tooth**, in the transverse plane, so that a contact force N ≥ 0 is a push of +N and the compliance of a point to
    itself is positive. About +z a push of 1 N gives the torque −r_b on flank 0 and +r_b on flank 1.

    Any motion of the gear is rigid motion p (6) + elastic modes q + the quasi-static rest:

        u_flank(k) = rigid_at(k)ᵀ p + modes_at(k)ᵀ q + Σ_j residual(k, j) N_j,
        q̈ + 2ζωq̇ + ω²q = Σ_j modes_at(j) N_j + hub_modes · F_hub,
        diag(m, m, m, J_d, J_d, J_p) p̈ = Σ_j rigid_at(j) N_j + F_hub

    Modes of nodal diameter 0 < n < z/2 stand in pairs (cosine, sine), one after the other, with the same frequency. By
    one tooth they turn as a pair by the angle 2πn/z: `modes_at` uses this, nothing is lost by it.

    Parameters
    ----------
    blank : GearBlank
        What was meshed.
    key : str
        Digest of all that made this gear: blank, mesh, modes, flank points, and the state of the code.
    n_dof : int
        Degrees of freedom of the full gear's finite-element model.
    spread : str
        What a flank point stands for: "section" (force and motion of the tooth's whole cross-section at that height,
        weighted like the shear stress of a beam; no local indentation in it: add Hertz), "patch" (RBE3 over flank nodes
        around the point: contains the indentation by a uniform strip as wide as the patch) or "node" (one line of
        nodes: local indentation depends on the mesh).
    mass_kg, polar_inertia_kg_m2, diametral_inertia_kg_m2 : float
        Of the finite-element body, about its centre.
    grid : FlankGrid
    frequencies_hz : array, (n_modes,)
        Elastic modes of the free gear, ascending, without the six rigid ones.
    nodal_diameters : array of int, (n_modes,)
        n of each mode.
    flank_modes : array, (n_modes, n_points)
        Push displacement of tooth 0 in each mode; modes are mass-normalised: 1/√kg.
    hub_modes : array, (n_modes, 6)
        Mean motion of the bore (RBE3) in each mode; 1/√kg and rad/(m√kg). Only n = 0 and 1 move it.
    free_compliance_m_per_n : array, (n_offsets, n_points, n_points)
        Elastic compliance of the free gear (all its elastic modes, the body accelerating as a rigid one):
        [o, i, j] is the push displacement of point i of tooth o for a unit push at point j of tooth 0, o = 0, 1, …
    clamped_compliance_m_per_n : array, (n_offsets, n_points, n_points)
        The same with every node of the bore held.
    hub_flank_compliance : array, (6, n_points)
        Elastic motion of the hub for a unit push at tooth 0, free gear; m/N and rad/N.
    hub_compliance : array, (6, 6)
        Elastic motion of the hub for unit forces (N, N m) on the hub, free gear.

    Notes
    -----
    Linear: no contact, no large rotation, no gyroscopic or centrifugal terms. All teeth are alike.
    """

    blank: GearBlank
    key: str
    n_dof: int
    spread: str
    mass_kg: float
    polar_inertia_kg_m2: float
    diametral_inertia_kg_m2: float
    grid: FlankGrid
    frequencies_hz: FloatArray
    nodal_diameters: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    flank_modes: FloatArray
    hub_modes: FloatArray
    free_compliance_m_per_n: FloatArray
    clamped_compliance_m_per_n: FloatArray
    hub_flank_compliance: FloatArray
    hub_compliance: FloatArray

    def __post_init__(self) -> None:
        one_of(self.spread, "spread", ("section", "patch", "node"))
        for name in ("mass_kg", "polar_inertia_kg_m2", "diametral_inertia_kg_m2"):
            positive(getattr(self, name), name)
        n, points = len(self.frequencies_hz), self.grid.n_points
        offsets = len(self.free_compliance_m_per_n)
        for name, shape in (
            ("frequencies_hz", (n,)),
            ("flank_modes", (n, points)),
            ("hub_modes", (n, N_HUB)),
            ("free_compliance_m_per_n", (offsets, points, points)),
            ("clamped_compliance_m_per_n", (offsets, points, points)),
            ("hub_flank_compliance", (N_HUB, points)),
            ("hub_compliance", (N_HUB, N_HUB)),
        ):
            self._freeze(name, shape)
        if self.nodal_diameters.shape != (n,):
            raise InputError(f"nodal_diameters has shape {self.nodal_diameters.shape}", allowed=f"({n},)")
        self.nodal_diameters.flags.writeable = False

    @property
    def n_modes(self) -> int:
        """Elastic modes at hand."""
        return len(self.frequencies_hz)

    @property
    def n_offsets(self) -> int:
        """Compliance is known between teeth up to n_offsets − 1 apart."""
        return len(self.free_compliance_m_per_n)

    @property
    def angular_frequencies_rad_s(self) -> FloatArray:
        """2πf."""
        return 2.0 * pi * self.frequencies_hz

    @property
    def radius_m(self) -> FloatArray:
        """Distance of the heights from the axis, (n_heights,)."""
        return self.blank.geometry.base_radius_mm * 1e-3 * np.hypot(1.0, self.grid.roll_rad)

    def modes_at(self, tooth: int) -> FloatArray:
        """Push displacement of a tooth's points in each elastic mode, (n_modes, n_points), 1/√kg.

        Cosine and sine mode of a pair turn by ψ = 2πn·tooth/z: c' = c cos ψ − s sin ψ, s' = c sin ψ + s cos ψ.
        """
        return self._turned(self.flank_modes, tooth)

    def rigid_at(self, tooth: int) -> FloatArray:
        """Push displacement of a tooth's points for unit rigid motion of the gear about its centre, (6, n_points).

        With the push d = (d_x, d_y, 0) at (x, y, z): d_x, d_y, 0, −z d_y, z d_x, x d_y − y d_x.
        """
        direction, position = self._flank_vectors(tooth)
        (dx, dy), (x, y) = direction, position
        z = np.broadcast_to(self.grid.z_m, self.grid.shape)
        rows = (dx, dy, np.zeros_like(dx), -z * dy, z * dx, x * dy - y * dx)
        return np.array([np.broadcast_to(row, self.grid.shape).ravel() for row in rows])

    def hub_flank_at(self, tooth: int) -> FloatArray:
        """Elastic motion of the hub for unit pushes at a tooth, (6, n_points); free gear."""
        angle = tooth * self.blank.pitch_angle_rad
        turn = np.array([[cos(angle), -sin(angle), 0.0], [sin(angle), cos(angle), 0.0], [0.0, 0.0, 1.0]])
        return np.vstack((turn @ self.hub_flank_compliance[:3], turn @ self.hub_flank_compliance[3:]))

    def compliance_m_per_n(self, teeth: Sequence[int], support: Support = "free") -> FloatArray:
        """Static compliance between all flank points of some teeth.

        Parameters
        ----------
        teeth : sequence of int
            Teeth, at most n_offsets − 1 apart.
        support : str
            "free": elastic part only, the body accelerates; "hub_held": the mean motion of the bore is held at zero
            (its surface may deform); "bore_clamped": every node of the bore is held.

        Returns
        -------
        array, (n_teeth · n_points, n_teeth · n_points)
            Symmetric; teeth in the order given.
        """
        one_of(support, "support", ("free", "hub_held", "bore_clamped"))
        stored = self.clamped_compliance_m_per_n if support == "bore_clamped" else self.free_compliance_m_per_n
        blocks = np.block([[self._block(stored, a - b) for b in teeth] for a in teeth])
        if support != "hub_held":
            return blocks
        # Holding the hub: reactions −Φᵀ on the hub, and the rigid motion that brings the hub back.
        rigid = np.hstack([self.rigid_at(t) for t in teeth])
        hub = np.hstack([self.hub_flank_at(t) for t in teeth])
        return blocks - hub.T @ rigid - rigid.T @ hub + rigid.T @ self.hub_compliance @ rigid

    def _block(self, stored: FloatArray, offset: int) -> FloatArray:
        z = self.blank.n_teeth
        around = (offset + z // 2) % z - z // 2
        if abs(around) >= self.n_offsets:
            raise InputError(
                f"teeth {around} apart",
                allowed=f"at most {self.n_offsets - 1} apart",
                remedy="reduce with more offsets",
            )
        block: FloatArray = stored[around] if around >= 0 else stored[-around].T
        return block

    def _turned(self, modes: FloatArray, tooth: int) -> FloatArray:
        psi = self.nodal_diameters * (tooth * self.blank.pitch_angle_rad)
        turned: FloatArray = modes * np.cos(psi)[:, None]
        paired = (self.nodal_diameters > 0) & (2 * self.nodal_diameters < self.blank.n_teeth)
        first = np.flatnonzero(paired)[::2]
        sine = np.sin(psi[first])[:, None]
        turned[first] -= modes[first + 1] * sine
        turned[first + 1] += modes[first] * sine
        return turned

    def _flank_vectors(self, tooth: int) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Push directions and places in the transverse plane, each (2, n_heights, 1); m."""
        tau, rb = self.grid.roll_rad, self.blank.geometry.base_radius_mm * 1e-3
        angle = tooth * self.blank.pitch_angle_rad
        load = tau - self.blank.geometry.base_half_angle_rad
        x, y = rb * (np.cos(load) + tau * np.sin(load)), rb * (tau * np.cos(load) - np.sin(load))
        dx, dy = -np.sin(load), -np.cos(load)
        sign = np.array([1.0, -1.0])[:, None, None]
        across = [(dx[None, :, None] + 0.0 * sign, dy[None, :, None] * sign)]
        across.append((x[None, :, None] + 0.0 * sign, y[None, :, None] * sign))
        c, s = cos(angle), sin(angle)
        direction, position = ((c * a - s * b, s * a + c * b) for a, b in across)
        return direction, position

    def _freeze(self, name: str, shape: tuple[int, ...]) -> None:
        array = frozen_array(getattr(self, name), name, ndim=len(shape))
        if array.shape != shape:
            raise InputError(f"{name} has shape {array.shape}", allowed=str(shape))
        object.__setattr__(self, name, array)


# Flank points: which nodes share a force at a place on a flank, and whose motion counts there (RBE3).

Spread = Literal["section", "patch", "node"]
"""What a force at a flank point acts on; see `ReducedGear.spread`."""

PATCH_HALF_WIDTH = 0.1
"""Of a patch along the flank, in modules."""


class SectionNodes(NamedTuple):
    """Nodes of one tooth section in the plane and the weights of their mean; weights add up to 1."""

    nodes: IntArray
    weights: FloatArray


def flank_grid(gear: GearGeometry, n_heights: int = 9, n_slices: int = 5) -> FlankGrid:
    """Return even heights (by roll angle) over the whole involute, and the middles of equal slices of the face."""
    heights, slices = count(n_heights, "n_heights", minimum=2), count(n_slices, "n_slices")
    roll = np.linspace(gear.form_roll_rad, gear.tip_roll_rad, heights)
    middles = ((np.arange(slices) + 0.5) / slices - 0.5) * gear.face_width_mm * 1e-3
    return FlankGrid(roll, middles)


def flank_rows(mesh: SectorMesh, grid: FlankGrid, spread: Spread, places: IntArray, n_dof: int) -> FloatArray:
    """Return rows (n_points, n_dof) that give the push displacement of each flank point; forces act by the transpose.

    The rigid motion in the plane closest to that of the nodes (weights w), carried to the flank point p:

        d·(ū + θ ẑ×(p − c)),  ū = Σ w u,  c = Σ w x,  θ = Σ w [(x − c)×(u − ū)]_z / Σ w |x − c|²

    "section": nodes across the whole tooth at that height, weighted like the shear stress of a beam. "patch": nodes of
    the flank around the point. "node": the flank at that height only, in the middle of the slice. A patch that would
    cross the tip's edge is moved down; θ is then that of the section, as the few nodes of a patch would carry the lever
    by forces that grow without bound at the edge.

    Parameters
    ----------
    mesh : SectorMesh
    grid : FlankGrid
    spread : str
    places : array of int
        Place of each of the sector's nodes among those of the degrees of freedom.
    n_dof : int
    """
    gear = mesh.blank.geometry
    rows = np.zeros((*grid.shape, n_dof))
    for flank, sign in enumerate((1.0, -1.0)):
        for height, roll in enumerate(grid.roll_rad):
            point, push = point_and_push(gear, float(roll), sign)
            parts = _plane_parts(mesh, float(roll), spread, flank, point, push)
            for k, z in enumerate(grid.z_m):
                along = slice_weights(mesh, float(z), len(grid.z_m), spread)
                for nodes, plane in parts:
                    dof = 3 * places[nodes][..., None] + np.arange(3)
                    np.add.at(rows[flank, height, k], dof, plane[:, None, :] * along[None, :, None])
    return rows.reshape(grid.n_points, n_dof)


def point_and_push(gear: GearGeometry, roll: float, sign: float) -> tuple[FloatArray, FloatArray]:
    """Flank point (m) and the direction into the tooth."""
    at, load = involute_outline(gear, np.array([roll])), roll - gear.base_half_angle_rad
    point = np.array([at.x_mm[0], sign * at.y_mm[0]]) * 1e-3
    return point, np.array([-np.sin(load), -sign * np.cos(load)])


def height_nodes(
    mesh: SectorMesh, roll: float, spread: Spread, flank: int, half_width: float | None = None
) -> SectionNodes:
    """Nodes (n, n_layers) of the tooth that stand for a height, and the weights (n,) in the plane.

    `half_width`: up and down the flank, in modules; None: `PATCH_HALF_WIDTH` of a patch, else 0.
    """
    gear, n_up = mesh.blank.geometry, mesh.size.n_up
    place = float(flank_place(gear, np.array([roll]))[0])
    if half_width is None:
        half_width = PATCH_HALF_WIDTH if spread == "patch" else 0.0
    reach = half_width * gear.module_mm / side_curve(gear)[1]
    order = mesh.size.order
    rows = row_places(gear, n_up)[:: 3 - order]
    low = min(place - reach, 1.0 - 2.0 * reach)  # near the tip the patch stays on the flank, as wide as elsewhere
    up = line_weights(rows, low, low + 2.0 * reach, order)
    if spread == "section":
        across = parabolic_weights(mesh.tooth.shape[1], order)
    else:
        across = np.zeros(mesh.tooth.shape[1])
        across[-1 if flank == 0 else 0] = 1.0
    weights = np.outer(up, across).ravel()
    used = weights != 0.0
    return SectionNodes(mesh.tooth.reshape(-1, mesh.tooth.shape[2])[used], weights[used])


def slice_weights(mesh: SectorMesh, z: float, n_slices: int, spread: Spread) -> FloatArray:
    """Weights of the layers of nodes for the mean over a slice, or for its middle."""
    layers = mesh.points_m[mesh.tooth[0, 0], 2]
    half = 0.0 if spread == "node" else (layers[-1] - layers[0]) / (2.0 * n_slices)
    return line_weights(layers, z - half, z + half, mesh.size.order)


def _plane_parts(
    mesh: SectorMesh, roll: float, spread: Spread, flank: int, point: FloatArray, push: FloatArray
) -> list[tuple[IntArray, FloatArray]]:
    """Nodes and their weights as of `plane_row`; of a patch apart for its mean motion and for the section's turning."""
    nodes = height_nodes(mesh, roll, spread, flank)
    if spread != "patch":
        return [(nodes.nodes, plane_row(mesh, nodes, point, push))]
    section = height_nodes(mesh, roll, "section", flank, PATCH_HALF_WIDTH)
    centre = nodes.weights @ mesh.points_m[nodes.nodes[:, 0], :2]
    lever = _turn(point - centre, push) * turning_weights(mesh, section)
    return [
        (nodes.nodes, _polar(mesh, nodes, nodes.weights[:, None] * push)),
        (section.nodes, _polar(mesh, section, lever)),
    ]


def plane_row(mesh: SectorMesh, nodes: SectionNodes, point: FloatArray, push: FloatArray) -> FloatArray:
    """Weights (n, 3) of the radial, tangential and axial motion of the nodes (any layer: all have the same x and y)."""
    w = nodes.weights
    lever = point - w @ mesh.points_m[nodes.nodes[:, 0], :2]
    return _polar(mesh, nodes, w[:, None] * push + _turn(lever, push) * turning_weights(mesh, nodes))


def turning_weights(mesh: SectorMesh, nodes: SectionNodes) -> FloatArray:
    """Weights (n, 2) of the motion along x and y for θ, how far the nodes turn; 0 for nodes at one place."""
    x, w = mesh.points_m[nodes.nodes[:, 0], :2], nodes.weights
    offset = x - w @ x
    square = float(w @ np.sum(offset**2, axis=1))
    if square <= 1e-12:
        return np.zeros_like(offset)
    return w[:, None] * np.column_stack((-offset[:, 1], offset[:, 0])) / square


def _turn(lever: FloatArray, push: FloatArray) -> float:
    """What a unit rotation moves a point along the push."""
    return float(push[1] * lever[0] - push[0] * lever[1])


def _polar(mesh: SectorMesh, nodes: SectionNodes, row: FloatArray) -> FloatArray:
    """Weights along the radius, around and along the axis, from those along x and y."""
    x = mesh.points_m[nodes.nodes[:, 0], :2]
    radius = np.hypot(x[:, 0], x[:, 1])
    radial, around = x / radius[:, None], np.column_stack((-x[:, 1], x[:, 0])) / radius[:, None]
    return np.column_stack((np.sum(row * radial, axis=1), np.sum(row * around, axis=1), np.zeros(len(x))))


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


def plan_for(blank: GearBlank, n_dof: int, **settings: int | Spread) -> ReductionPlan:
    """Return a plan with a mesh of about `n_dof` degrees of freedom."""
    return ReductionPlan(mesh_size_for(blank, n_dof), **settings)  # type: ignore[arg-type]  # checked by the plan


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
    solved = _solved_points(grid)
    for n in gear.diameters:
        weight = (1.0 if n == 0 or 2 * n == z else 2.0) / z
        shares = hub_sum(n, z) @ gear.hub if n <= 1 else np.zeros((0, rows.shape[1]))
        loads = np.hstack((rows[solved].T, shares.conj().T))
        moved = _response(gear, n, loads, held)
        at_flanks = _mirrored((rows @ moved[:, : len(solved)]).astype(np.complex128), grid, solved)
        for offset in range(n_offsets):
            flanks[offset] += weight * np.real(at_flanks * np.exp(1j * gear.phase_rad(n) * offset))
        if n <= 1:
            hub += weight * np.real(shares @ moved[:, len(solved) :])
            hub_flank += weight * np.real(moved[:, len(solved) :].conj().T @ rows.T)
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


def _mirrored(part: ComplexArray, grid: FlankGrid, solved: IntArray) -> ComplexArray:
    """H of all points from its columns of some.

    H is the same seen from the other end of the shaft, and a mirror at the middle of the tooth makes n to −n, which is
    the complex conjugate.
    """
    index = np.arange(grid.n_points).reshape(grid.shape)
    end, flank = index[:, :, ::-1].ravel(), index[::-1].ravel()
    whole = np.zeros((grid.n_points, grid.n_points), dtype=np.complex128)
    whole[:, solved] = part
    whole[:, end[solved]] = part[end]
    first = index[0].ravel()
    whole[:, flank[first]] = whole[flank][:, first].conj()
    return whole


def _real_modes(
    gear: CyclicGear, modes: CyclicModes, rows: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """Cosine and sine modes at the flank points of tooth 0 and at the hub."""
    z, shares, multiplicity = gear.n_sectors, gear.hub @ modes.shapes, modes.multiplicity(gear.n_sectors)
    at_hub = [hub_sum(int(n), z) @ share for n, share in zip(modes.nodal_diameters, shares.T, strict=True)]
    return (
        np.repeat(modes.frequencies_hz, multiplicity),
        np.repeat(modes.nodal_diameters, multiplicity),
        real_values(rows @ modes.shapes, multiplicity).T,
        real_values(np.column_stack(at_hub), multiplicity).T,
    )


# Reduced gears on disk, under the key of what made them: arrays without pickles, whole or not at all.

FORMAT = 1
"""Of the file and of what its numbers mean; raised when either changes."""
_SOURCES = (
    *(f"sims.fe_gear.{name}" for name in ("_blank", "_mesh", "_cyclic", "_reduced_gear")),
    "sims.mesh._geometry",
)
"""Modules whose code changes a reduced gear; the last makes the outline."""
_NUMBERS = ("mass_kg", "polar_inertia_kg_m2", "diametral_inertia_kg_m2")
_ARRAYS = tuple(f.name for f in fields(ReducedGear))[8:]  # all that follow the grid
MAX_BYTES = 200_000_000
"""Of a file's arrays; a usual one has half a million."""


def gear_name(blank: GearBlank, plan: ReductionPlan) -> str:
    """Return a digest of what is asked of a reduced gear, the same for every state of the code."""
    made_of = json.dumps({"blank": asdict(blank), "plan": asdict(plan)}, sort_keys=True)
    return sha256(made_of.encode()).hexdigest()[:32]


def gear_key(blank: GearBlank, plan: ReductionPlan) -> str:
    """Return what tells reduced gears apart: digests of what is asked for and of the code that makes it."""
    return f"{gear_name(blank, plan)}-{code_digest()}"


@cache
def code_digest() -> str:
    """Return a digest of the code that meshes and reduces."""
    return modules_digest(_SOURCES)


def write_gear(path: str | Path, gear: ReducedGear) -> None:
    """Write a reduced gear beside its place and move it there.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    about = {"format": FORMAT, "key": gear.key, "blank": gear.blank.as_text(), "spread": gear.spread}
    about |= {name: getattr(gear, name) for name in ("n_dof", *_NUMBERS)}
    arrays: dict[str, Any] = {name: getattr(gear, name) for name in _ARRAYS} | gear.grid._asdict()
    write_whole(Path(path), lambda file: np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays))


def read_gear(path: str | Path) -> ReducedGear:
    """Read a reduced gear.

    Raises
    ------
    InputError
        If the file is missing, damaged, not a reduced gear, or (`OtherVersionError`) of another version of this format.
    """
    source = Path(path)
    if not source.exists():
        raise InputError("no such file", where=str(source))
    try:
        data = read_arrays(source, MAX_BYTES)
        if data is None:
            raise ValueError(f"no archive of at most {MAX_BYTES:.0e} bytes")  # noqa: TRY301 - one message for all damage
        about = json.loads(str(data["about"]))
        if about["format"] != FORMAT:
            raise OtherVersionError(
                f"is of format {about['format']!r}: another version of gearsig wrote it",
                where=str(source),
                allowed=f"format {FORMAT}",
                remedy=FRESH,
            )
        values: dict[str, Any] = {name: float(about[name]) for name in _NUMBERS} | {
            name: data[name] for name in _ARRAYS
        }
        return ReducedGear(
            blank=GearBlank.from_text(about["blank"]),
            key=str(about["key"]),
            n_dof=int(about["n_dof"]),
            spread=str(about["spread"]),
            grid=FlankGrid(data["roll_rad"], data["z_m"]),
            **values,
        )
    except InputError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"is not a reduced gear, or is damaged ({error})", where=str(source), remedy="make it again"
        ) from error


def cached_gear(blank: GearBlank, plan: ReductionPlan) -> ReducedGear:
    """Return a reduced gear from the cache, or reduce it and keep it there.

    A file that is damaged is made again: it holds nothing that cannot be. One that another version of the code made is
    left for the user to decide about.

    Parameters
    ----------
    blank : GearBlank
    plan : ReductionPlan

    Raises
    ------
    OtherVersionError
        If another version of the code kept this gear.
    InputError
        If the gear cannot be reduced.
    """
    path = cache_folder("gears") / f"{gear_name(blank, plan)}.npz"
    try:
        kept = read_gear(path)
    except OtherVersionError:
        raise
    except InputError:  # not there, or damaged
        gear = reduce_gear(blank, plan)
        with suppress(InputError):  # the cache folder cannot be written: the next process reduces it again
            write_gear(path, gear)
        return gear
    if kept.key != gear_key(blank, plan):
        raise OtherVersionError(
            "this reduced gear was made by another version of gearsig", where=str(path), remedy=FRESH
        )
    return kept


def is_of_this_code(path: Path) -> bool:
    """Whether a file is whole and holds a gear that the present state of the code made."""
    try:
        return read_gear(path).key.endswith(f"-{code_digest()}")
    except InputError:
        return False


# Reduced gears that come with the product: `python -m sims.fe_gear._reduced_gear` makes their files again. Their
# cracks are in a file of their own.

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


if __name__ == "__main__":
    for name, blank in READY.items():
        write_gear(FOLDER / f"{name}.npz", reduce_gear(blank, PLAN))
