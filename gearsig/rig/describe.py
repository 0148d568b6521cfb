"""What a rig implies, as text for `gearsig rig check`."""

from __future__ import annotations

from math import gcd

from gearsig.errors import RefusalError
from gearsig.rig.orders import hunting_tooth_order, order_lines
from gearsig.rig.tooth_pairs import path_of_contact
from gearsig.rig.types import Rig


def describe_rig(rig: Rig) -> str:
    """Return the orders that follow from what is known of the rig, with frequencies where a nominal speed is given."""
    reference = rig.reference_shaft
    speed = rig.nominal_speed_rpm(reference)
    lines = [f"Rig: {rig.name or '(no name)'}"]
    if reference:
        at = f", nominal {speed:g} rpm" if speed else ""
        lines.append(f"Orders are cycles per revolution of shaft '{reference}'{at}.")
    lines += _shaft_text(rig) + _pair_text(rig) + _bearing_text(rig) + _contact_text(rig)
    marked = order_lines(rig, n_mesh_harmonics=2, n_shaft_harmonics=2, n_sidebands=1)
    if marked:
        lines += ["", "Expected lines" + (" (frequency at nominal speed)" if speed else "")]
        for line in marked:
            hertz = f"{line.order * speed / 60:12.3f} Hz" if speed else ""
            lines.append(f"  {line.order:12.5f} {hertz}  {line.kind:<9} {line.label}")
    if rig.assumed:
        lines += ["", "Assumed, not known: " + ", ".join(rig.assumed) + ". What rests on it is worth less."]
    missing = _missing(rig)
    if missing:
        lines += ["", "Not given:", *(f"  - {text}" for text in missing)]
    return "\n".join(lines)


def _shaft_text(rig: Rig) -> list[str]:
    lines = ["", "Shafts"] if rig.shafts else ["", "No shafts: only spectra over frequency are possible."]
    for name in rig.shaft_names:
        ratio, speed = rig.ratio(name), rig.nominal_speed_rpm(name)
        text = f"order {ratio:.6g}" if ratio is not None else "order not known: a tooth count on the way is missing"
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
        lines.append(f"  {bearing.name} on {bearing.shaft}: {orders or 'no geometry and no orders given'}")
    return lines


def _contact_text(rig: Rig) -> list[str]:
    """Return how the teeth touch, with what follows from it, where the rig says so."""
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
    if rig.operating_point.speed_rpm is None and rig.speed is None:
        texts.append("a nominal speed or a speed source: the speed must be found from the mesh lines alone")
    return texts
