"""A reduced gear: what contact and dynamics need to know of a finite-element gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Literal, NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, one_of, positive
from gearsig.errors import InputError
from sims.mesh import GearGeometry, involute_outline
from sims.reduced_fe._blank import GearBlank, flank_place, row_places, side_curve
from sims.reduced_fe._mesh import IntArray, SectorMesh, line_weights, parabolic_weights

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
        radius: FloatArray = self.blank.geometry.base_radius_mm * 1e-3 * np.hypot(1.0, self.grid.roll_rad)
        return radius

    @property
    def rigid_masses(self) -> FloatArray:
        """(m, m, m, J_d, J_d, J_p) in kg and kg m², (6,)."""
        m, j = self.mass_kg, self.diametral_inertia_kg_m2
        return np.array([m, m, m, j, j, self.polar_inertia_kg_m2])

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
        held: FloatArray = blocks - hub.T @ rigid - rigid.T @ hub + rigid.T @ self.hub_compliance @ rigid
        return held

    def residual_compliance_m_per_n(self, teeth: Sequence[int], n_modes: int | None = None) -> FloatArray:
        """Free compliance less that of the first `n_modes` elastic modes (None: all at hand), shaped as the former.

        C − Σ φφᵀ/ω². Cut `n_modes` between pairs, not within one: the rest would depend on the tooth.
        """
        n = self.n_modes if n_modes is None else count(n_modes, "n_modes", minimum=0)
        modes = np.hstack([self.modes_at(t)[:n] for t in teeth]) / self.angular_frequencies_rad_s[:n, None]
        rest: FloatArray = self.compliance_m_per_n(teeth) - modes.T @ modes
        return rest

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


# --------------------
# Flank points: which nodes share a force at a place on a flank, and whose motion counts there (RBE3).
# --------------------


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
    weights: FloatArray = w[:, None] * np.column_stack((-offset[:, 1], offset[:, 0])) / square
    return weights


def _turn(lever: FloatArray, push: FloatArray) -> float:
    """What a unit rotation moves a point along the push."""
    return float(push[1] * lever[0] - push[0] * lever[1])


def _polar(mesh: SectorMesh, nodes: SectionNodes, row: FloatArray) -> FloatArray:
    """Weights along the radius, around and along the axis, from those along x and y."""
    x = mesh.points_m[nodes.nodes[:, 0], :2]
    radius = np.hypot(x[:, 0], x[:, 1])
    radial, around = x / radius[:, None], np.column_stack((-x[:, 1], x[:, 0])) / radius[:, None]
    return np.column_stack((np.sum(row * radial, axis=1), np.sum(row * around, axis=1), np.zeros(len(x))))
