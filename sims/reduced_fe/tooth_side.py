"""The outline of half a tooth and half a space as curves by arc length, cut in the middle of the fillet."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import pi
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from sims.mesh.geometry import GearGeometry
from sims.mesh.profile import Outline, fillet_outline, involute_outline, root_half_angle_rad

N_SAMPLES = 2000
"""Points by which arc length is measured along each curve; places stay on the exact curve."""

Curve = Callable[[FloatArray], FloatArray]
"""From arc length over total length, 0 to 1, to points (2, n) in mm: x outwards, y to the flank."""


class FilletSplit(NamedTuple):
    """Where the mesh of the tooth ends: the middle of the fillet."""

    x_mm: float
    y_mm: float
    gap_length_mm: float
    side_length_mm: float


def gap_curve(gear: GearGeometry) -> tuple[Curve, float]:
    """From the middle of the space along the root circle and up half of the fillet; the curve and its length in mm."""
    start, foot = pi / gear.teeth, root_half_angle_rad(gear)

    def land(angle: FloatArray) -> FloatArray:
        return gear.root_radius_mm * np.array([np.cos(angle), np.sin(angle)])

    def fillet(gamma: FloatArray) -> FloatArray:
        return _xy(fillet_outline(gear, gamma))

    return _joined(((land, start, foot), (fillet, pi / 2.0, _middle(gear))))


def side_curve(gear: GearGeometry) -> tuple[Curve, float]:
    """From the middle of the fillet to the tip; the curve and its length in mm."""

    def fillet(gamma: FloatArray) -> FloatArray:
        return _xy(fillet_outline(gear, gamma))

    def flank(roll: FloatArray) -> FloatArray:
        return _xy(involute_outline(gear, roll))

    return _joined(
        ((fillet, _middle(gear), gear.pressure_angle_rad), (flank, gear.form_roll_rad, gear.tip_roll_rad)),
    )


@lru_cache(maxsize=16)
def fillet_split(gear: GearGeometry) -> FilletSplit:
    """Return the middle of the fillet and the lengths of outline on both sides of it."""
    point = fillet_outline(gear, np.array([_middle(gear)]))
    return FilletSplit(float(point.x_mm[0]), float(point.y_mm[0]), gap_curve(gear)[1], side_curve(gear)[1])


def flank_place(gear: GearGeometry, roll_rad: FloatArray) -> FloatArray:
    """Arc length over total length of `side_curve` at roll angles of the involute, 0 to 1."""
    total = side_curve(gear)[1]
    length_to_tip = gear.base_radius_mm * (gear.tip_roll_rad**2 - np.asarray(roll_rad) ** 2) / 2.0
    place: FloatArray = 1.0 - length_to_tip / total
    return place


@lru_cache(maxsize=64)
def row_places(gear: GearGeometry, n_up: int) -> FloatArray:
    """Places of the tooth's rows of nodes on `side_curve`, (2 n_up + 1,): closer where the outline turns.

    Half of the rows by arc length, half by the angle that the outline turns; middles of cells lie halfway.
    """
    curve, _ = side_curve(gear)
    place = np.linspace(0.0, 1.0, N_SAMPLES)
    heading = np.unwrap(np.arctan2(*np.diff(curve(place), axis=1)[::-1]))
    turned = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(heading))), [np.nan]))
    turned[-1] = turned[-2]
    corners = np.interp(np.arange(n_up + 1) / n_up, (place + turned / turned[-1]) / 2.0, place)
    return with_middles(corners)


def with_middles(corners: FloatArray) -> FloatArray:
    """Corners of cells and the middles between them, (2n + 1,)."""
    nodes = np.empty(2 * len(corners) - 1)
    nodes[::2], nodes[1::2] = corners, (corners[1:] + corners[:-1]) / 2.0
    return nodes


def outline_error_mm(gear: GearGeometry, n_gap: int, n_up: int, order: int = 2) -> float:
    """Largest distance between the cells' edges, parabolic or (order 1) straight, and the true outline."""
    gap = _edge_error_mm(gap_curve(gear)[0], np.linspace(0.0, 1.0, 2 * n_gap + 1), order)
    return max(gap, _edge_error_mm(side_curve(gear)[0], row_places(gear, n_up), order))


def _edge_error_mm(curve: Curve, places: FloatArray, order: int) -> float:
    nodes, t, worst = curve(places), np.linspace(0.0, 1.0, 41)[:, None], 0.0
    for k in range(0, len(places) - 1, 2):
        a, c = nodes[:, k], nodes[:, k + 2]
        b = nodes[:, k + 1] if order == 2 else (a + c) / 2.0
        edge = (1 - t) * (1 - 2 * t) * a + 4 * t * (1 - t) * b + t * (2 * t - 1) * c
        own = curve(np.linspace(places[k], places[k + 2], 400))
        distance = np.hypot(edge[:, :1] - own[0], edge[:, 1:] - own[1]).min(axis=1)
        worst = max(worst, float(distance.max()))
    return worst


def _middle(gear: GearGeometry) -> float:
    """γ in the middle of the fillet."""
    return (pi / 2.0 + gear.pressure_angle_rad) / 2.0


def _xy(outline: Outline) -> FloatArray:
    return np.array([outline.x_mm, outline.y_mm])


def _joined(pieces: tuple[tuple[Curve, float, float], ...]) -> tuple[Curve, float]:
    """One curve by arc length from pieces by their own parameters."""
    tables = []
    for curve, low, high in pieces:
        parameter = np.linspace(low, high, N_SAMPLES)
        steps = np.hypot(*np.diff(curve(parameter), axis=1))
        tables.append((parameter, np.concatenate(([0.0], np.cumsum(steps)))))
    ends = np.cumsum([0.0, *(length[-1] for _, length in tables)])

    def joined(place: FloatArray) -> FloatArray:
        s = np.atleast_1d(place) * ends[-1]
        points = np.empty((2, len(s)))
        which = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(pieces) - 1)
        for k, (curve, _, _) in enumerate(pieces):
            own = which == k
            points[:, own] = curve(np.interp(s[own] - ends[k], tables[k][1], tables[k][0]))
        return points

    return joined, float(ends[-1])
