"""The gear body to be meshed: teeth, bore, hub, web and rim, and what it is made of."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from math import pi
from typing import Any, NamedTuple

import numpy as np

from gearsig.checks import FloatArray, count, positive, within
from gearsig.errors import InputError
from gearsig.recording import check_memory as check_part_of_memory
from gearsig.recording import free_memory_bytes
from sims.mesh import STEEL, GearGeometry, Material, Outline, fillet_outline, involute_outline, root_half_angle_rad

MIN_RIM = 1.0
"""Least thickness of rim and hub in modules: thinner ones crack through the rim, which this model does not follow."""


@dataclass(frozen=True)
class GearBlank:
    """A spur gear as a solid body.

    From the bore outwards: a hub as wide as the face, a web in its middle plane, a rim as wide as the face, the teeth.
    Without a web the body is one full disc.

    Parameters
    ----------
    geometry : GearGeometry
        Teeth, module, pressure angle, profile shift, face width, fillet (by the tool's tip radius) and bore. It refuses
        undercut and pointed teeth and a fillet that does not fit.
    web_thickness_mm : float or None
        Along the axis, above 0 and at most the face width. None: full disc.
    rim_thickness_mm : float or None
        Radially below the root circle; at least 1 module. None: 3 modules. Only with a web.
    hub_thickness_mm : float or None
        Radially outside the bore; at least 1 module. None: 3 modules. Only with a web.
    material : Material

    Raises
    ------
    InputError
        If the web is thicker than the face, hub and rim meet, or the bore leaves less than 1 module below the root
        circle.

    Notes
    -----
    Left out: keyways, holes in the web, chamfers, crowning and tip relief, rounds between web and rim.

    Examples
    --------
    >>> blank = GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0))
    >>> blank.web_thickness_mm is None, blank.material.youngs_modulus_gpa
    (True, 206.0)
    """

    geometry: GearGeometry
    web_thickness_mm: float | None = None
    rim_thickness_mm: float | None = None
    hub_thickness_mm: float | None = None
    material: Material = field(default=STEEL)

    def __post_init__(self) -> None:
        self._check_bore()
        if self.web_thickness_mm is not None:
            self._check_web()
            return
        for name in ("rim_thickness_mm", "hub_thickness_mm"):
            value = getattr(self, name)
            if value is not None:
                raise InputError(f"{name} is {value:g} mm, but a full disc has none", remedy="give web_thickness_mm")

    @property
    def n_teeth(self) -> int:
        """Number of teeth, and of equal sectors."""
        return self.geometry.teeth

    @property
    def pitch_angle_rad(self) -> float:
        """2π/z, the angle of one sector."""
        return 2.0 * pi / self.geometry.teeth

    @property
    def rim_radius_mm(self) -> float:
        """Inner radius of the rim; of a full disc, the radius where the fine mesh below the teeth ends."""
        thickness = 3.0 * self.geometry.module_mm if self.rim_thickness_mm is None else self.rim_thickness_mm
        radius = self.geometry.root_radius_mm - thickness
        if self.web_thickness_mm is not None:
            return radius
        return max(radius, (self.geometry.root_radius_mm + self.geometry.bore_mm) / 2.0)

    @property
    def hub_radius_mm(self) -> float:
        """Outer radius of the hub; of a full disc the bore radius."""
        if self.web_thickness_mm is None:
            return self.geometry.bore_mm
        thickness = 3.0 * self.geometry.module_mm if self.hub_thickness_mm is None else self.hub_thickness_mm
        return self.geometry.bore_mm + thickness

    def as_text(self) -> str:
        """Return the blank as JSON, from which `from_text` makes it again; equal blanks give equal texts."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_text(cls, text: str) -> GearBlank:
        """Return the blank that `as_text` wrote; it is checked again."""
        values: dict[str, Any] = json.loads(text)
        values |= {"geometry": GearGeometry(**values["geometry"]), "material": Material(**values["material"])}
        return cls(**values)

    def _check_bore(self) -> None:
        g = self.geometry
        largest = g.root_radius_mm - MIN_RIM * g.module_mm
        if g.bore_mm > largest:
            raise InputError(
                f"bore_radius_mm is {g.bore_mm:g} mm: it leaves {g.root_radius_mm - g.bore_mm:.3g} mm below the teeth",
                allowed=f"at most {largest:.4g} mm, 1 module below the root circle",
                remedy="take a smaller bore",
            )

    def _check_web(self) -> None:
        g = self.geometry
        web = positive(self.web_thickness_mm or 0.0, "web_thickness_mm", "mm")
        if web > g.face_width_mm:
            raise InputError(
                f"web_thickness_mm is {web:g} mm, thicker than the face",
                allowed=f"at most the face width, {g.face_width_mm:g} mm",
                remedy="take a thinner web, or leave it out for a full disc",
            )
        space = g.root_radius_mm - g.bore_mm
        min_mm = MIN_RIM * g.module_mm
        for name in ("rim_thickness_mm", "hub_thickness_mm"):
            if getattr(self, name) is not None:
                within(getattr(self, name), name, min_mm, space, "mm")
        if self.rim_radius_mm - self.hub_radius_mm < 0.5 * g.module_mm:
            raise InputError(
                f"hub and rim leave {self.rim_radius_mm - self.hub_radius_mm:.3g} mm for the web",
                allowed=f"at least half a module, {0.5 * g.module_mm:g} mm",
                remedy="take a smaller bore, a thinner hub or rim, or a full disc",
            )


# The outline of half a tooth and half a space as curves by arc length, cut in the middle of the fillet.

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
    return 1.0 - length_to_tip / total


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
        on_curve = curve(np.linspace(places[k], places[k + 2], 400))
        distance = np.hypot(edge[:, :1] - on_curve[0], edge[:, 1:] - on_curve[1]).min(axis=1)
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
            on_piece = which == k
            points[:, on_piece] = curve(np.interp(s[on_piece] - ends[k], tables[k][1], tables[k][0]))
        return points

    return joined, float(ends[-1])


# How finely a gear is meshed: numbers of cells, and the numbers for a wanted count of degrees of freedom.

MIN_DOF, MAX_DOF = 5_000, 1_100_000
"""Range in which a size is chosen; explicit numbers of cells may leave it."""


@dataclass(frozen=True)
class MeshSize:
    """Numbers of hexahedra in one sector.

    Parameters
    ----------
    n_across : int
        Over the tooth's thickness.
    n_gap : int
        From the middle of each fillet to the middle of the space.
    n_up : int
        From the middle of the fillet to the tip.
    n_rim : int
        Radially below the teeth, down to the inner radius of the rim.
    n_body : int
        Radially between rim and bore (web and hub).
    n_along : int
        Along the face.
    order : int
        2: 27-node hexahedra, exact to second order. 1: eight-node ones with incompatible modes, for meshes too coarse
        to follow a fillet; their edges are straight.
    """

    n_across: int = 3
    n_gap: int = 1
    n_up: int = 5
    n_rim: int = 2
    n_body: int = 3
    n_along: int = 4
    order: int = 2

    def __post_init__(self) -> None:
        for name in ("n_across", "n_gap", "n_up", "n_rim", "n_body", "n_along"):
            count(getattr(self, name), name)
        within(self.order, "order", 1, 2)


COARSE = tuple(
    MeshSize(n_across, 1, n_up, n_rim, n_body, n_along, order=1)
    for n_across, n_up, n_rim, n_body, n_along in (
        (1, 1, 1, 1, 1),
        (1, 2, 1, 1, 1),
        (1, 2, 1, 2, 1),
        (2, 2, 1, 2, 1),
        (2, 3, 1, 2, 1),
        (2, 3, 1, 2, 2),
        (2, 4, 2, 2, 2),
        (3, 5, 2, 3, 2),
        (4, 6, 2, 3, 3),
    )
)
"""Meshes of first order, from the coarsest on: 54 to some 1 000 degrees of freedom per tooth."""

MAX_OUTLINE_ERROR = 0.01
"""In modules: how far the cells' edges may lie off the true outline."""

MAX_STRAIGHT_ERROR = 0.04
"""The same of a mesh of first order that is to be reduced: with more, a tooth's compliance is a fifth off."""


def check_fillet(blank: GearBlank, size: MeshSize) -> None:
    """Refuse a mesh whose edges leave the outline by more than 1 % of a module; it is the fillet that they leave.

    A mesh of first order is not refused: who asks for one knows that it is coarse, see `MeshQuality.outline_error_mm`.
    """
    if size.order == 1:
        return
    error = outline_error_mm(blank.geometry, size.n_gap, size.n_up)
    max_error_mm = MAX_OUTLINE_ERROR * blank.geometry.module_mm
    if error > max_error_mm:
        raise InputError(
            f"the mesh is too coarse for the fillet: its edges lie up to {error:.3g} mm off it",
            allowed=f"at most {max_error_mm:.3g} mm",
            remedy=f"ask for more degrees of freedom (cells: more than n_up = {size.n_up}, n_gap = {size.n_gap}), or a "
            "rounder tool",
        )


def check_reducible(blank: GearBlank, size: MeshSize) -> None:
    """Refuse a mesh of first order that follows the fillet too coarsely for the teeth of a reduced gear.

    Its modes may be looked at all the same: they hardly depend on the fillet.
    """
    max_error_mm = MAX_STRAIGHT_ERROR * blank.geometry.module_mm

    def error_mm(candidate: MeshSize) -> float:
        return outline_error_mm(blank.geometry, candidate.n_gap, candidate.n_up, candidate.order)

    if size.order == 1 and error_mm(size) > max_error_mm:
        enough = next((n_dof_of(blank, finer) for finer in COARSE if error_mm(finer) <= max_error_mm), None)
        raise InputError(
            f"the mesh is too coarse for the fillet: its straight edges lie up to {error_mm(size):.2g} mm off it",
            allowed=f"at most {max_error_mm:.2g} mm in a gear that is to be reduced",
            remedy=f"ask for {'more' if enough is None else f'at least {enough}'} degrees of freedom",
        )


def body_cells(blank: GearBlank, n_body: int) -> tuple[int, int]:
    """Radial cells of hub and web; a full disc has only a web, as thick as the face."""
    hub, web = blank.hub_radius_mm - blank.geometry.bore_mm, blank.rim_radius_mm - blank.hub_radius_mm
    if blank.web_thickness_mm is None:
        return 0, n_body
    in_hub = max(1, round(n_body * hub / (hub + web)))
    return in_hub, max(1, n_body - in_hub)


def along_cells(blank: GearBlank, n_along: int) -> tuple[int, int]:
    """Cells along the face beside the web (each side) and in the web."""
    if blank.web_thickness_mm is None or blank.web_thickness_mm == blank.geometry.face_width_mm:
        return 0, n_along
    beside = (blank.geometry.face_width_mm - blank.web_thickness_mm) / 2.0
    in_web = max(1, round(n_along * blank.web_thickness_mm / blank.geometry.face_width_mm))
    return max(1, round(in_web * beside / blank.web_thickness_mm), (n_along - in_web + 1) // 2), in_web


def n_dof_of(blank: GearBlank, size: MeshSize) -> int:
    """Degrees of freedom of the whole gear."""
    hub, web = body_cells(blank, size.n_body)
    beside, inside = along_cells(blank, size.n_along)
    k = size.order
    columns = k * (size.n_across + 2 * size.n_gap)
    layers, web_layers = k * (2 * beside + inside) + 1, k * inside + 1
    tooth = k * size.n_up * (k * size.n_across + 1)
    full = tooth + columns * (k * size.n_rim + 1)
    hub_rows, web_rows = (k * hub + 1, k * web - 1) if hub else (0, k * web)
    nodes = (full + columns * hub_rows) * layers + columns * web_rows * web_layers
    return 3 * nodes * blank.n_teeth


def mesh_size_for(blank: GearBlank, n_dof: int) -> MeshSize:
    """Return the cells whose degrees of freedom come closest to a wanted number, about as long as wide.

    Parameters
    ----------
    blank : GearBlank
    n_dof : int
        Of the whole gear, 5 000 to 1 100 000. Where the coarsest mesh of second order that follows the fillet has more,
        one of first order is chosen.

    Raises
    ------
    InputError
        If even the coarsest has more.
    """
    target = count(n_dof, "n_dof", minimum=MIN_DOF)
    if target > MAX_DOF:
        raise InputError(f"n_dof is {target}", allowed=f"{MIN_DOF} to {MAX_DOF}", remedy="take fewer")
    sizes = [_size(blank, blank.geometry.module_mm * 2.5 * 0.97**k) for k in range(110)]
    sizes += [replace(size, n_up=size.n_up - 1) for size in sizes if size.n_up > _minimum_cells(blank)[1]]
    best = min(sizes, key=lambda size: abs(n_dof_of(blank, size) - target))
    if n_dof_of(blank, best) > 1.2 * target:
        best = min(COARSE, key=lambda size: abs(n_dof_of(blank, size) - target))
    if n_dof_of(blank, best) > 1.5 * target:
        raise InputError(
            f"n_dof is {target}: too few for {blank.n_teeth} teeth",
            allowed=f"at least {n_dof_of(blank, best)}",
            remedy="ask for more degrees of freedom",
        )
    return best


@lru_cache(maxsize=16)
def _minimum_cells(blank: GearBlank) -> tuple[int, int]:
    """Fewest cells in the gap, and rows of the tooth, that follow the fillet."""
    g, max_error_mm = blank.geometry, MAX_OUTLINE_ERROR * blank.geometry.module_mm
    gap = next((n for n in range(1, 4) if outline_error_mm(g, n, 12) <= max_error_mm), 4)
    return gap, next((n for n in range(1, 12) if outline_error_mm(g, 4, n) <= max_error_mm), 12)


def _size(blank: GearBlank, cell_mm: float) -> MeshSize:
    """Cells about `cell_mm` wide in the teeth, lower there (where loads act), longer where the motion varies less."""
    g, split = blank.geometry, fillet_split(blank.geometry)
    across, gap, up = 2.0 * split.y_mm, split.gap_length_mm, split.side_length_mm
    min_gap, min_up = _minimum_cells(blank)
    return MeshSize(
        n_across=max(2, round(across / cell_mm)),
        n_gap=max(min_gap, round(gap / cell_mm)),
        n_up=max(min_up, round(2.7 * up / cell_mm)),
        n_rim=max(1, round((g.root_radius_mm - blank.rim_radius_mm) / (2.0 * cell_mm))),
        n_body=max(1, round((blank.rim_radius_mm - g.bore_mm) / (6.0 * cell_mm))),
        n_along=max(1, round(g.face_width_mm / (2.5 * cell_mm))),
    )


# Memory that a computation will need, estimated before it starts.

BASE_BYTES = 250e6
"""Interpreter and libraries."""

MAX_PART = 0.9
"""Of the free memory that may be taken."""


def sector_bytes(blank: GearBlank, size: MeshSize) -> float:
    """Peak of a cyclic reduction: matrices and factors of one sector, which fill about as n^1.4.

    Measured, whole gear of 50 teeth: 0.29 GB at 300 000 and 0.36 GB at 510 000 degrees of freedom.
    """
    n = n_dof_of(blank, size) / blank.n_teeth
    return float(BASE_BYTES + 16.0 * (900.0 * n + 14.0 * n**1.4))


def craig_bampton_bytes(blank: GearBlank, size: MeshSize, n_compared: int) -> float:
    """Peak of a Craig–Bampton reduction, where the auxiliary nodes are chosen among all: about 13 fields of each mode.

    Measured: 0.89 GB at 300 000 degrees of freedom and 20 modes.
    """
    return sector_bytes(blank, size) + 13.0 * 8.0 * n_compared * n_dof_of(blank, size)


def check_memory(needed_bytes: float, free_bytes: float | None = None) -> None:
    """Refuse a computation that will not fit into `MAX_PART` of the free memory.

    Parameters
    ----------
    needed_bytes : float
    free_bytes : float or None
        None: what the system has free now; where it cannot tell, nothing is refused.

    Raises
    ------
    InputError
        See `gearsig.recording.check_memory`.
    """
    free = free_memory_bytes() if free_bytes is None else free_bytes
    if free is not None:
        remedy = "take a coarser mesh, or close other programs"
        check_part_of_memory(needed_bytes, "mesh", free, part=MAX_PART, remedy=remedy)


# One thread for linear algebra on small matrices, where more threads wait for each other longer than they work.


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS to one thread within the block; up to twenty times faster with small dense matrices."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
