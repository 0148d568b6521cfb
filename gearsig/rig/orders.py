"""The orders a rig implies: shafts, meshes, sidebands, hunting tooth, bearings."""

from __future__ import annotations

from dataclasses import dataclass
from math import lcm
from typing import Literal

from gearsig.rig.types import GearPair, Rig

OrderKind = Literal["shaft", "mesh", "sideband", "hunting", "bearing"]


@dataclass(frozen=True)
class OrderLine:
    """One expected line.

    Parameters
    ----------
    order : float
        Cycles per revolution of the shaft that was asked for.
    kind : str
        "shaft", "mesh", "sideband", "hunting" or "bearing".
    label : str
        As shown in tables and at cursors, e.g. "2× mesh stage 1".
    element : str
        Name of the shaft, pair or bearing it belongs to.
    harmonic : int
        1 for the fundamental; for a sideband the harmonic of its mesh line.
    modulating_shaft : str
        For a sideband: the shaft at whose order the mesh is modulated.
    """

    order: float
    kind: OrderKind
    label: str
    element: str
    harmonic: int = 1
    modulating_shaft: str = ""


def order_lines(
    rig: Rig, shaft: str = "", *, n_mesh_harmonics: int = 3, n_shaft_harmonics: int = 3, n_sidebands: int = 2
) -> tuple[OrderLine, ...]:
    """Return all lines that follow from what is known of `rig`, by rising order.

    Parameters
    ----------
    rig : Rig
    shaft : str
        Orders are cycles per revolution of this shaft; default: the rig's reference shaft.
    n_mesh_harmonics, n_shaft_harmonics, n_sidebands : int
        How many of each; sidebands are counted on either side of each mesh harmonic and for each of the two shafts.

    Returns
    -------
    tuple of OrderLine
        Lines of shafts whose ratio to `shaft` is not known are left out.

    Examples
    --------
    >>> from gearsig.rig.types import GearPair, Shaft
    >>> rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 20, 41),))
    >>> [line.label for line in order_lines(rig, n_mesh_harmonics=1, n_shaft_harmonics=1, n_sidebands=0)]
    ['hunting tooth p', '1× out', '1× in', '1× mesh p']
    """
    shaft = shaft or rig.reference_shaft
    lines = [
        OrderLine(k * ratio, "shaft", f"{k}× {name}", name, k)
        for name in rig.shaft_names
        if (ratio := rig.ratio(name, to=shaft)) is not None
        for k in range(1, n_shaft_harmonics + 1)
    ]
    for pair in rig.pairs:
        lines += _pair_lines(rig, pair, shaft, n_mesh_harmonics, n_sidebands)
    for bearing in rig.bearings:
        ratio = rig.ratio(bearing.shaft, to=shaft)
        if ratio is not None:
            lines += [
                OrderLine(order * ratio, "bearing", f"{name} {bearing.name}", bearing.name)
                for name, order in bearing.orders().items()
            ]
    return tuple(sorted(lines, key=lambda line: line.order))


def hunting_tooth_order(rig: Rig, pair: GearPair, shaft: str = "") -> float | None:
    """Return the order at which the same two teeth meet again, None if not known: mesh order over lcm(z1, z2).

    Source: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed. (2021), ch. 2.
    """
    mesh = rig.mesh_order(pair, shaft)
    if mesh is None or pair.driver_teeth is None or pair.driven_teeth is None:
        return None
    return mesh / lcm(pair.driver_teeth, pair.driven_teeth)


def _pair_lines(rig: Rig, pair: GearPair, shaft: str, n_harmonics: int, n_sidebands: int) -> list[OrderLine]:
    mesh = rig.mesh_order(pair, shaft)
    if mesh is None:
        return []
    lines = [OrderLine(h * mesh, "mesh", f"{h}× mesh {pair.name}", pair.name, h) for h in range(1, n_harmonics + 1)]
    hunting = hunting_tooth_order(rig, pair, shaft)
    if hunting is not None:
        lines.append(OrderLine(hunting, "hunting", f"hunting tooth {pair.name}", pair.name))
    for modulating in (pair.driver, pair.driven):
        ratio = rig.ratio(modulating, to=shaft)
        if ratio is None:
            continue
        for h in range(1, n_harmonics + 1):
            for k in (k for k in range(-n_sidebands, n_sidebands + 1) if k):
                label = f"{h}× mesh {pair.name} {'+' if k > 0 else '−'} {abs(k)}× {modulating}"
                lines.append(OrderLine(h * mesh + k * ratio, "sideband", label, pair.name, h, modulating))
    return lines
