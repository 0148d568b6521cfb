"""Levels of mesh harmonics and their sidebands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearsig.checks import count, positive
from gearsig.errors import RefusalError
from gearsig.indicators.lines import Line, LineSource, find_line, lobe_lines, ratio_db
from gearsig.indicators.types import Indicator
from gearsig.orders.types import SynchronousAverage
from gearsig.rig.types import GearPair, Rig


def mesh_level(
    source: LineSource, mesh_order: float, harmonic: int = 1, *, speed_rev_per_s: float | None = None
) -> float:
    """Peak amplitude of one mesh harmonic, in the source's unit; nan where it lies above its end.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    mesh_order : float
        Mesh cycles per revolution of the source's shaft.
    harmonic : int
    speed_rev_per_s : float or None
        Of that shaft, for a spectrum over frequency.
    """
    order = positive(mesh_order, "mesh_order") * count(harmonic, "harmonic")
    return find_line(source, order, speed_rev_per_s=speed_rev_per_s).amplitude


def sideband_levels(
    source: LineSource,
    mesh_order: float,
    spacing_orders: float,
    *,
    harmonic: int = 1,
    n_sidebands: int = 1,
    speed_rev_per_s: float | None = None,
) -> tuple[tuple[float, float], ...]:
    """Peak amplitudes of the lower and upper sidebands 1, 2, … of a mesh harmonic.

    A carrier A with amplitude modulation m cos and phase modulation b sin (small b) at the spacing has first-order
    sidebands A |m - h b|/2 (lower) and A |m + h b|/2 (upper): equal for either alone, unequal for both.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    mesh_order, spacing_orders : float
        Mesh order and the modulating shaft's order, per revolution of the source's shaft.
    harmonic, n_sidebands : int
    speed_rev_per_s : float or None

    Returns
    -------
    tuple of (lower, upper)
    """
    carrier = positive(mesh_order, "mesh_order") * count(harmonic, "harmonic")
    step = positive(spacing_orders, "spacing_orders")
    return tuple(
        (
            find_line(source, carrier - k * step, speed_rev_per_s=speed_rev_per_s).amplitude,
            find_line(source, carrier + k * step, speed_rev_per_s=speed_rev_per_s).amplitude,
        )
        for k in range(1, count(n_sidebands, "n_sidebands") + 1)
    )


def sideband_to_carrier_db(
    source: LineSource,
    mesh_order: float,
    spacing_orders: float,
    *,
    harmonic: int = 1,
    speed_rev_per_s: float | None = None,
) -> float:
    """Mean of the two first-order sidebands over their carrier, 20 lg; m/2 for amplitude modulation m alone."""
    ((lower, upper),) = sideband_levels(
        source, mesh_order, spacing_orders, harmonic=harmonic, speed_rev_per_s=speed_rev_per_s
    )
    return ratio_db(0.5 * (lower + upper), mesh_level(source, mesh_order, harmonic, speed_rev_per_s=speed_rev_per_s))


def mesh_indicators(
    source: LineSource,
    rig: Rig,
    pair: GearPair,
    *,
    shaft: str = "",
    channel: str = "",
    n_harmonics: int = 3,
    n_sidebands: int = 2,
    speed_rev_per_s: float | None = None,
) -> tuple[Indicator, ...]:
    """Return levels of a pair's mesh harmonics, sidebands per shaft, and sideband-to-carrier ratios.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
        An average holds only sidebands of its own shaft; those of the other shaft are left out.
    rig : Rig
    pair : GearPair
    shaft : str
        Shaft that the source's orders are counted on; default: the source's own, else the rig's reference shaft.
    channel : str
        Default: the average's.
    n_harmonics, n_sidebands : int
    speed_rev_per_s : float or None
        Of `shaft`, for a spectrum over frequency.

    Returns
    -------
    tuple of Indicator
        "mesh level h×", "sideband level h×-k" and "h×+k", "sideband ratio h×" in dB. nan with a note where an order is
        not in the source, or a spectrum does not resolve the sidebands.

    Raises
    ------
    RefusalError
        If the mesh order does not follow from the rig.
    """
    shaft = shaft or source.shaft or rig.reference_shaft
    mesh_order = rig.mesh_order(pair, shaft)
    if mesh_order is None:
        raise RefusalError(
            f"the mesh order of pair {pair.name!r} is not known", remedy="give the teeth in the rig file"
        )
    own_shaft = source.shaft if isinstance(source, SynchronousAverage) else None
    channel = channel or (source.channel if isinstance(source, SynchronousAverage) else "")
    on = "synchronous average" if isinstance(source, SynchronousAverage) else f"{source.axis} spectrum"
    found: list[Indicator] = []
    for h in range(1, count(n_harmonics, "n_harmonics") + 1):
        carrier = find_line(source, h * mesh_order, speed_rev_per_s=speed_rev_per_s)
        found.append(
            Indicator(
                f"mesh level {h}×",
                carrier.amplitude,
                source.unit,
                channel,
                on,
                gear=pair.name,
                band=_order(carrier),
                note=carrier.note,
            )
        )
        for modulating in (pair.driver, pair.driven):
            spacing = rig.ratio(modulating, to=shaft)
            if spacing is not None and own_shaft in (None, modulating):
                gear = f"{pair.name}/{modulating}"
                for name, value, unit, band, note in _sidebands(
                    source, h, carrier, h * mesh_order, spacing, n_sidebands, speed_rev_per_s
                ):
                    found.append(Indicator(name, value, unit, channel, on, modulating, gear, band, note))
    return tuple(found)


def _sidebands(
    source: LineSource,
    harmonic: int,
    carrier: Line,
    carrier_order: float,
    spacing: float,
    n_sidebands: int,
    speed_rev_per_s: float | None,
) -> Iterator[tuple[str, float, str, str, str]]:
    blurred = _unresolved(source, spacing, speed_rev_per_s)
    first: list[float] = []
    for k in range(1, n_sidebands + 1):
        for sign, side in ((-1, "-"), (1, "+")):
            line = find_line(source, carrier_order + sign * k * spacing, speed_rev_per_s=speed_rev_per_s)
            value = float("nan") if blurred else line.amplitude
            first += [value] if k == 1 else []
            yield f"sideband level {harmonic}×{side}{k}", value, source.unit, _order(line), blurred or line.note
    ratio = ratio_db(float(np.mean(first)), carrier.amplitude) if first else float("nan")
    note = blurred or ("undefined: a line is missing or zero" if np.isnan(ratio) else "")
    yield f"sideband ratio {harmonic}×", ratio, "dB", _order(carrier), note


def _unresolved(source: LineSource, spacing: float, speed_rev_per_s: float | None) -> str:
    """Why the sidebands cannot be told from their carrier, or nothing."""
    if isinstance(source, SynchronousAverage):
        return ""
    per_order = 1.0 if source.axis == "order" or speed_rev_per_s is None else speed_rev_per_s
    needed = (2 * lobe_lines(source) + 1) * source.resolution
    if spacing * per_order >= needed:
        return ""
    return f"not resolved: sidebands {spacing * per_order:.4g} apart need a resolution below {needed:.4g}"


def _order(line: Line) -> str:
    return f"order {line.order:.5g}"
