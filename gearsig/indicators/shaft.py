"""Amplitudes of the low shaft orders: unbalance (1×), misalignment (2×), looseness and others (3×)."""

from __future__ import annotations

from gearsig.checks import count, positive
from gearsig.indicators.lines import LineSource, axis_per_order, find_line, lobe_lines
from gearsig.indicators.types import Indicator
from gearsig.orders.types import SynchronousAverage


def shaft_order_level(
    source: LineSource, harmonic: int = 1, *, shaft_ratio: float = 1.0, speed_rev_per_s: float | None = None
) -> float:
    """Peak amplitude at `harmonic` times a shaft's order, in the source's unit.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    harmonic : int
    shaft_ratio : float
        Revolutions of the shaft in question per revolution of the source's shaft; 1 for an average of its own shaft.
    speed_rev_per_s : float or None
        Of the source's shaft, for a spectrum over frequency.
    """
    order = positive(shaft_ratio, "shaft_ratio") * count(harmonic, "harmonic")
    return find_line(source, order, speed_rev_per_s=speed_rev_per_s).amplitude


def shaft_indicators(
    source: LineSource,
    shaft: str,
    *,
    shaft_ratio: float = 1.0,
    channel: str = "",
    n_harmonics: int = 3,
    speed_rev_per_s: float | None = None,
) -> tuple[Indicator, ...]:
    """Return the amplitudes at 1×, 2×, … of a shaft.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    shaft : str
    shaft_ratio, speed_rev_per_s : float
        As in `shaft_order_level`.
    channel : str
        Default: the average's.
    n_harmonics : int

    Returns
    -------
    tuple of Indicator
        nan with a note where an order is not in the source.
    """
    positive(shaft_ratio, "shaft_ratio")
    on = "synchronous average" if isinstance(source, SynchronousAverage) else f"{source.axis} spectrum"
    channel = channel or (source.channel if isinstance(source, SynchronousAverage) else "")
    lines = [
        (h, find_line(source, h * shaft_ratio, speed_rev_per_s=speed_rev_per_s))
        for h in range(1, count(n_harmonics, "n_harmonics") + 1)
    ]
    low = _too_low(source, shaft_ratio, speed_rev_per_s)
    return tuple(
        Indicator(
            f"shaft order {h}×",
            line.amplitude,
            source.unit,
            channel,
            on,
            shaft,
            band=f"order {line.order:.5g}",
            note=line.note or (low if h == 1 else ""),
        )
        for h, line in lines
    )


def _too_low(source: LineSource, shaft_ratio: float, speed_rev_per_s: float | None) -> str:
    """Whether 1× runs into the lines at zero."""
    if isinstance(source, SynchronousAverage):
        return ""
    lines_from_zero = shaft_ratio * axis_per_order(source, speed_rev_per_s) / source.resolution
    return "so close to zero that the signal's mean leaks in" if lines_from_zero < 2 * lobe_lines(source) else ""
