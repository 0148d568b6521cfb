"""How finely a gear is meshed: numbers of cells, and the numbers for a wanted count of degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

from gearsig.checks import count, within
from gearsig.errors import InputError
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.tooth_side import fillet_split, outline_error_mm

LEAST_DOF, MOST_DOF = 5_000, 1_100_000
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

MOST_OUTLINE_ERROR = 0.01
"""In modules: how far the cells' edges may lie off the true outline."""

MOST_STRAIGHT_ERROR = 0.04
"""The same of a mesh of first order that is to be reduced: with more, a tooth's compliance is a fifth off."""


def check_fillet(blank: GearBlank, size: MeshSize) -> None:
    """Refuse a mesh whose edges leave the outline by more than 1 % of a module; it is the fillet that they leave.

    A mesh of first order is not refused: who asks for one knows that it is coarse, see `MeshQuality.outline_error_mm`.
    """
    if size.order == 1:
        return
    error = outline_error_mm(blank.geometry, size.n_gap, size.n_up)
    most = MOST_OUTLINE_ERROR * blank.geometry.module_mm
    if error > most:
        raise InputError(
            f"the mesh is too coarse for the fillet: its edges lie up to {error:.3g} mm off it",
            allowed=f"at most {most:.3g} mm",
            remedy=f"ask for more degrees of freedom (cells: more than n_up = {size.n_up}, n_gap = {size.n_gap}), or a "
            "rounder tool",
        )


def check_reducible(blank: GearBlank, size: MeshSize) -> None:
    """Refuse a mesh of first order that follows the fillet too coarsely for the teeth of a reduced gear.

    Its modes may be looked at all the same: they hardly depend on the fillet.
    """
    most = MOST_STRAIGHT_ERROR * blank.geometry.module_mm

    def error_mm(wanted: MeshSize) -> float:
        return outline_error_mm(blank.geometry, wanted.n_gap, wanted.n_up, wanted.order)

    if size.order == 1 and error_mm(size) > most:
        enough = next((n_dof_of(blank, finer) for finer in COARSE if error_mm(finer) <= most), None)
        raise InputError(
            f"the mesh is too coarse for the fillet: its straight edges lie up to {error_mm(size):.2g} mm off it",
            allowed=f"at most {most:.2g} mm in a gear that is to be reduced",
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
    wanted = count(n_dof, "n_dof", minimum=LEAST_DOF)
    if wanted > MOST_DOF:
        raise InputError(f"n_dof is {wanted}", allowed=f"{LEAST_DOF} to {MOST_DOF}", remedy="take fewer")
    sizes = [_size(blank, blank.geometry.module_mm * 2.5 * 0.97**k) for k in range(110)]
    sizes += [replace(size, n_up=size.n_up - 1) for size in sizes if size.n_up > _least_cells(blank)[1]]
    best = min(sizes, key=lambda size: abs(n_dof_of(blank, size) - wanted))
    if n_dof_of(blank, best) > 1.2 * wanted:
        best = min(COARSE, key=lambda size: abs(n_dof_of(blank, size) - wanted))
    if n_dof_of(blank, best) > 1.5 * wanted:
        raise InputError(
            f"n_dof is {wanted}: too few for {blank.n_teeth} teeth",
            allowed=f"at least {n_dof_of(blank, best)}",
            remedy="ask for more degrees of freedom",
        )
    return best


@lru_cache(maxsize=16)
def _least_cells(blank: GearBlank) -> tuple[int, int]:
    """Fewest cells in the gap, and rows of the tooth, that follow the fillet."""
    g, most = blank.geometry, MOST_OUTLINE_ERROR * blank.geometry.module_mm
    gap = next((n for n in range(1, 4) if outline_error_mm(g, n, 12) <= most), 4)
    return gap, next((n for n in range(1, 12) if outline_error_mm(g, 4, n) <= most), 12)


def _size(blank: GearBlank, cell_mm: float) -> MeshSize:
    """Cells about `cell_mm` wide in the teeth, lower there (where loads act), longer where the motion varies less."""
    g, split = blank.geometry, fillet_split(blank.geometry)
    across, gap, up = 2.0 * split.y_mm, split.gap_length_mm, split.side_length_mm
    least_gap, least_up = _least_cells(blank)
    return MeshSize(
        n_across=max(2, round(across / cell_mm)),
        n_gap=max(least_gap, round(gap / cell_mm)),
        n_up=max(least_up, round(2.7 * up / cell_mm)),
        n_rim=max(1, round((g.root_radius_mm - blank.rim_radius_mm) / (2.0 * cell_mm))),
        n_body=max(1, round((blank.rim_radius_mm - g.bore_mm) / (6.0 * cell_mm))),
        n_along=max(1, round(g.face_width_mm / (2.5 * cell_mm))),
    )
