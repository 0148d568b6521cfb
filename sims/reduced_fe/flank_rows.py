"""Flank points: which nodes share a force at a place on a flank, and whose motion counts there (RBE3)."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count
from sims.mesh.geometry import GearGeometry
from sims.mesh.profile import involute_outline
from sims.reduced_fe.line_weights import line_weights, parabolic_weights
from sims.reduced_fe.reduced_gear import FlankGrid
from sims.reduced_fe.sector_mesh import SectorMesh
from sims.reduced_fe.sector_plane import IntArray
from sims.reduced_fe.tooth_side import flank_place, row_places, side_curve

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
