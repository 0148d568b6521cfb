"""The orders a rig implies: shafts, meshes, sidebands, hunting tooth, bearings."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd, lcm
from typing import Literal

from gearsig.errors import RefusalError
from gearsig.rig._types import GearPair, Rig, path_of_contact

OrderKind = Literal["shaft", "mesh", "sideband", "hunting", "bearing"]


@dataclass(frozen=True)
class OrderLine:
    """One expected line.

    Parameters
    ----------
    order : float
        Cycles per revolution of the requested shaft.
    kind : str
        "shaft", "mesh", "sideband", "hunting" or "bearing".
    label : str
        As shown in tables and plots, e.g. "2× mesh stage 1".
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
    """Return all lines that follow from what is known of `rig`, in ascending order.

    Parameters
    ----------
    rig : Rig
    shaft : str
        Orders are cycles per revolution of this shaft; default: the rig's reference shaft.
    n_mesh_harmonics, n_shaft_harmonics, n_sidebands : int
        Number of each; sidebands are counted on each side of a mesh harmonic and for each of the two shafts.

    Returns
    -------
    tuple of OrderLine
        Lines of shafts whose ratio to `shaft` is not known are left out.

    Examples
    --------
    >>> from gearsig.rig import GearPair, Shaft
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


# --------------------
# What a rig implies, as text for `gearsig rig check`.
# --------------------


def describe_rig(rig: Rig) -> str:
    """Return the orders that follow from what is known of the rig, with frequencies where a nominal speed is given."""
    reference = rig.reference_shaft
    speed = rig.nominal_speed_rpm(reference)
    lines = [f"Rig: {rig.name or '(no name)'}"]
    if reference:
        at = f", nominal {speed:g} rpm" if speed else ""
        lines.append(f"Orders are cycles per revolution of shaft '{reference}'{at}.")
    if rig.machine is not None:
        lines.append(
            f"Group of ISO 20816-3: {rig.machine.group or 'none'}, mounting {rig.machine.mounting or 'not stated'}."
        )
    lines += _shaft_text(rig) + _pair_text(rig) + _bearing_text(rig) + _contact_text(rig)
    marked = order_lines(rig, n_mesh_harmonics=2, n_shaft_harmonics=2, n_sidebands=1)
    if marked:
        lines += ["", "Expected lines" + (" (frequency at nominal speed)" if speed else "")]
        for line in marked:
            hertz = f"{line.order * speed / 60:12.3f} Hz" if speed else ""
            lines.append(f"  {line.order:12.5f} {hertz}  {line.kind:<9} {line.label}")
    if rig.assumed:
        lines += ["", "Assumed, not known: " + ", ".join(rig.assumed) + ". Results that rest on it are less certain."]
    missing = _missing(rig)
    if missing:
        lines += ["", "Not given:", *(f"  - {text}" for text in missing)]
    return "\n".join(lines)


def _shaft_text(rig: Rig) -> list[str]:
    lines = ["", "Shafts"] if rig.shafts else ["", "No shafts: only spectra over frequency are possible."]
    for name in rig.shaft_names:
        ratio, speed = rig.ratio(name), rig.nominal_speed_rpm(name)
        text = f"order {ratio:.6g}" if ratio is not None else "order not known: a tooth count on the path is missing"
        lines.append(f"  {name}: {text}" + (f", {speed:.6g} rpm" if speed else ""))
    return lines


def _pair_text(rig: Rig) -> list[str]:
    lines = ["", "Gear pairs"] if rig.pairs else []
    for pair in rig.pairs:
        z1, z2 = pair.driver_teeth, pair.driven_teeth
        mesh, hunting = rig.mesh_order(pair), hunting_tooth_order(rig, pair)
        text = f"  {pair.name}: {z1 or '?'} teeth ({pair.driver}) drives {z2 or '?'} teeth ({pair.driven}), "
        text += f"mesh order {mesh:.6g}" if mesh is not None else "mesh order not known"
        if hunting is not None and z1 is not None and z2 is not None:
            text += f", hunting tooth order {hunting:.6g}, common factor {gcd(z1, z2)}"
        lines.append(text)
    return lines


def _bearing_text(rig: Rig) -> list[str]:
    lines = ["", "Bearings (orders of their own shaft)"] if rig.bearings else []
    for bearing in rig.bearings:
        orders = ", ".join(f"{name} {order:.5g}" for name, order in bearing.orders().items())
        by_name = f" ({bearing.bearing})" if bearing.bearing else ""
        lines.append(f"  {bearing.name}{by_name} on {bearing.shaft}: {orders or 'no geometry and no orders given'}")
    return lines


def _contact_text(rig: Rig) -> list[str]:
    """Describe the tooth contact and the resulting path of contact, if the rig has one."""
    contact = rig.contact
    if contact is None:
        return []
    stiffness = f"stiffness {contact.stiffness_n_per_m_lambda:.4g} N/m^{contact.exponent:g}"
    backlash = f"backlash {2.0 * contact.half_backlash_um:g} um"
    restitution = f"restitution {contact.restitution:g} ({contact.damping_law})"
    lines = ["", "Contact of the teeth", f"  {stiffness}, {backlash}, {restitution}"]
    try:
        path = path_of_contact(rig)
    except RefusalError as refusal:
        return [*lines, f"  {refusal}"]
    r1, r2 = (1e3 * r for r in path.base_radii_m)
    return [*lines, f"  contact ratio {path.contact_ratio:.4g}, base radii {r1:.5g} and {r2:.5g} mm"]


def _missing(rig: Rig) -> list[str]:
    texts = []
    if not rig.pairs:
        texts.append("gear pairs: no mesh orders, no tooth pictures")
    if any(p.driver_teeth is None or p.driven_teeth is None for p in rig.pairs):
        texts.append("some tooth counts: shafts behind them have no known order")
    if not rig.bearings:
        texts.append("bearings: a bearing can only be suspected, not named by race")
    if rig.speed_source is None and not rig.pairs:
        texts.append("a speed source, [speed]: without gears the speed cannot be found, and there are no orders")
    elif rig.operating_point.speed_rpm is None and rig.speed is None:
        texts.append("a nominal speed or a speed source: the speed must be found from the mesh lines alone")
    return texts
