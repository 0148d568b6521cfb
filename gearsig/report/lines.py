"""Which lines of a spectrum a page marks, and which stretch of it is shown."""

from __future__ import annotations

from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis, Kind
from gearsig.orders.types import OrderMap
from gearsig.plot.cursors import Cursor, order_cursors
from gearsig.spectra.types import Spectrum

CONSTANT_SPEED = 0.01
"""Relative range of speed up to which lines over frequency may be marked."""
MOST_PAIRS = 3
WITHOUT_MESH = 50.0  # highest order shown where no mesh is known
N_MESH_HARMONICS = 3


def speed_is_constant(analysis: Analysis) -> bool:
    """Whether the speed is known and changes so little that its lines stay sharp over frequency."""
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle) or angle.mean_speed_rpm == 0:
        return False
    low, high = angle.speed_range_rpm
    return high - low <= CONSTANT_SPEED * angle.mean_speed_rpm


def line_cursors(analysis: Analysis, spectrum: Spectrum | OrderMap, *, n_sidebands: int = 2) -> tuple[Cursor, ...]:
    """Return the lines that the rig implies on a spectrum's axis; without a rig the shaft's first three."""
    scale = _per_order(analysis, spectrum)
    if scale is None:
        return ()
    if analysis.rig is None or not analysis.rig.shafts:
        return tuple(Cursor(k * scale, "shaft", f"{k}× shaft", k) for k in (1, 2, 3))
    from gearsig.rig.orders import order_lines

    shaft = spectrum.shaft if spectrum.shaft in analysis.rig.shaft_names else _reference(analysis)
    return order_cursors(order_lines(analysis.rig, shaft, n_sidebands=n_sidebands), scale)


def bearing_cursors(analysis: Analysis, spectrum: Spectrum) -> tuple[Cursor, ...]:
    """Return shaft lines and three harmonics of each bearing line."""
    result = []
    for cursor in line_cursors(analysis, spectrum, n_sidebands=0):
        if cursor.kind == "shaft":
            result.append(cursor)
        elif cursor.kind == "bearing":
            labels = (cursor.label, f"2× {cursor.label}", f"3× {cursor.label}")
            result += [Cursor(k * cursor.position, "bearing", label, k) for k, label in enumerate(labels, start=1)]
    return tuple(result)


def highest_order_of_interest(analysis: Analysis, spectrum: Spectrum | OrderMap) -> float:
    """Return where an order spectrum may end: past the third harmonic of the fastest mesh, at 50 if none is known."""
    end = float(spectrum.positions[-1])
    meshes = [cursor.position for cursor in line_cursors(analysis, spectrum) if cursor.kind == "mesh"]
    highest = 1.12 * max(meshes) if meshes else WITHOUT_MESH
    return min(end, highest) if spectrum.resolution < highest else end


def mesh_windows(analysis: Analysis, spectrum: Spectrum) -> list[tuple[str, float, float]]:
    """Return (pair, low, high) around the mesh of each pair, wide enough for four sidebands of its faster shaft."""
    if analysis.rig is None or _per_order(analysis, spectrum) is None:
        return []
    result = []
    for pair in analysis.rig.pairs[:MOST_PAIRS]:
        mesh = analysis.rig.mesh_order(pair, spectrum.shaft)
        ratios = [analysis.rig.ratio(shaft, to=spectrum.shaft) for shaft in (pair.driver, pair.driven)]
        known = [ratio for ratio in ratios if ratio is not None]
        if mesh is None or not known or mesh + max(known) > float(spectrum.positions[-1]):
            continue
        half = 4.5 * max(known)
        result.append((pair.name, max(0.0, mesh - half), min(float(spectrum.positions[-1]), mesh + half)))
    return result


def marked_positions(
    analysis: Analysis, spectrum: Spectrum, channel: str, *, of_bearings: bool = False
) -> tuple[float, ...]:
    """Return where faults and suspicions of a channel lie on a spectrum's axis.

    Bearing findings live in the envelope spectrum, all others in the spectrum itself.
    """
    found = []
    for finding in analysis.findings:
        where = finding.where
        if finding.kind not in (Kind.FAULT, Kind.SUSPICION) or bool(where.bearing) != of_bearings:
            continue
        if where.channels and channel not in where.channels:
            continue
        position = _position(analysis, spectrum, where.order, where.order_shaft, where.frequency_hz)
        if position is not None:
            found.append(position)
    return tuple(found)


def _position(
    analysis: Analysis, spectrum: Spectrum, order: float | None, order_shaft: str, frequency_hz: float | None
) -> float | None:
    if spectrum.axis == "frequency" and frequency_hz is not None:
        return frequency_hz
    scale = _per_order(analysis, spectrum)
    if order is None or scale is None:
        return None
    if spectrum.axis == "frequency" and not speed_is_constant(analysis):
        return None
    base = spectrum.shaft or _reference(analysis)
    if not order_shaft or order_shaft == base:
        return order * scale
    if analysis.rig is None or not {order_shaft, base} <= set(analysis.rig.shaft_names):
        return None
    ratio = analysis.rig.ratio(order_shaft, to=base)
    return None if ratio is None else order * ratio * scale


def _per_order(analysis: Analysis, spectrum: Spectrum | OrderMap) -> float | None:
    """Return units of the spectrum's axis per order of the shaft that orders are counted on."""
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle):
        return None
    return angle.mean_speed_rpm / 60 if spectrum.axis == "frequency" else 1.0


def _reference(analysis: Analysis) -> str:
    return analysis.shaft_angle.shaft if isinstance(analysis.shaft_angle, ShaftAngle) else ""
