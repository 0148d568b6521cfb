"""Levels of an envelope spectrum at the orders of a rolling bearing."""

from __future__ import annotations

from collections.abc import Iterator
from math import isnan

from gearsig.checks import count, within
from gearsig.errors import RefusalError
from gearsig.indicators.lines import Line, find_line, floor_near, noise_reaches, ratio_db
from gearsig.indicators.types import Indicator
from gearsig.rig.types import Bearing
from gearsig.spectra.types import Spectrum

DEFAULT_SLIP_FRACTION = 0.015
"""Rolling elements slip: measured orders lie up to one or two per cent beside the kinematic ones."""


def defect_orders(bearing: Bearing) -> dict[str, float]:
    """Orders at which a defect knocks, per revolution of the bearing's shaft: BPFO, BPFI, 2×BSF, FTF.

    A rolling element's defect strikes both races in one spin, hence twice the BSF.
    """
    orders = bearing.orders()
    return {
        name: factor * orders[key]
        for name, key, factor in (("BPFO", "BPFO", 1), ("BPFI", "BPFI", 1), ("2×BSF", "BSF", 2), ("FTF", "FTF", 1))
        if key in orders
    }


def envelope_level(
    envelope_spectrum: Spectrum,
    order: float,
    *,
    slip_fraction: float = DEFAULT_SLIP_FRACTION,
    speed_rev_per_s: float | None = None,
) -> Line:
    """Peak amplitude of the largest line within the slip of a defect order, and where it is.

    Parameters
    ----------
    envelope_spectrum : Spectrum
        Amplitude-scaled, over order or frequency.
    order : float
        Per revolution of the shaft that the spectrum counts on.
    slip_fraction : float
        Half width of the search over `order`, 0 to 0.1.
    speed_rev_per_s : float or None
        Of that shaft, for a spectrum over frequency.
    """
    width = within(slip_fraction, "slip_fraction", 0.0, 0.1) * order
    return find_line(envelope_spectrum, order, search_orders=width, speed_rev_per_s=speed_rev_per_s)


def envelope_level_over_floor_db(
    envelope_spectrum: Spectrum,
    order: float,
    *,
    slip_fraction: float = DEFAULT_SLIP_FRACTION,
    speed_rev_per_s: float | None = None,
) -> float:
    """The largest line within the slip over the median of the lines within half the order on either side, 20 lg.

    Noise alone reaches `noise_reaches(n_lines)` in one search of twenty, 6 to 11 dB; nan with fewer than 8 lines.
    """
    line = envelope_level(envelope_spectrum, order, slip_fraction=slip_fraction, speed_rev_per_s=speed_rev_per_s)
    return ratio_db(line.largest, _floor(envelope_spectrum, order, slip_fraction, speed_rev_per_s))


def bearing_indicators(
    envelope_spectrum: Spectrum,
    bearing: Bearing,
    *,
    shaft_ratio: float = 1.0,
    channel: str = "",
    n_harmonics: int = 3,
    slip_fraction: float = DEFAULT_SLIP_FRACTION,
    speed_rev_per_s: float | None = None,
    band: str = "",
) -> tuple[Indicator, ...]:
    """Return the envelope levels at a bearing's orders and their harmonics, and how far they stand above the floor.

    Parameters
    ----------
    envelope_spectrum : Spectrum
        Amplitude-scaled, over order or frequency.
    bearing : Bearing
    shaft_ratio : float
        Revolutions of the bearing's shaft per revolution of the shaft that the spectrum counts on.
    channel : str
    n_harmonics : int
    slip_fraction : float
    speed_rev_per_s : float or None
        Of the shaft the spectrum counts on, where the spectrum is over frequency.
    band : str
        The demodulated band, for the record.

    Returns
    -------
    tuple of Indicator
        "BPFO envelope level h×" and "BPFO over floor h×" (dB) for each order name. `gear` is empty, `shaft` the
        bearing's; the note names the order found.

    Raises
    ------
    RefusalError
        If neither geometry nor orders of the bearing are known.

    References
    ----------
    R. B. Randall and J. Antoni, "Rolling element bearing diagnostics – a tutorial", 2011.
    """
    orders = defect_orders(bearing)
    if not orders:
        raise RefusalError(
            f"no order of bearing {bearing.name!r} is known", remedy="give its geometry or orders in the rig file"
        )
    rows = (
        row
        for name, order in orders.items()
        for h in range(1, count(n_harmonics, "n_harmonics") + 1)
        for row in _rows(envelope_spectrum, name, h, order * shaft_ratio * h, slip_fraction, speed_rev_per_s)
    )
    return tuple(
        Indicator(
            name,
            value,
            unit or envelope_spectrum.unit,
            channel,
            "envelope",
            bearing.shaft,
            band=band,
            note=note,
            bearing=bearing.name,
        )
        for name, value, unit, note in rows
    )


def _rows(
    spectrum: Spectrum, name: str, harmonic: int, order: float, slip: float, speed_rev_per_s: float | None
) -> Iterator[tuple[str, float, str, str]]:
    line = envelope_level(spectrum, order, slip_fraction=slip, speed_rev_per_s=speed_rev_per_s)
    where = line.note or f"order {line.order:.5g}, expected {order:.5g}"
    yield f"{name} envelope level {harmonic}×", line.amplitude, "", where
    over = ratio_db(line.largest, _floor(spectrum, order, slip, speed_rev_per_s))
    chance = f"noise alone reaches {ratio_db(noise_reaches(line.n_lines), 1.0):.1f} dB in 1 of 20"
    if isnan(over):
        chance = "undefined: too few lines around it for a floor, or nothing there"
    yield f"{name} over floor {harmonic}×", over, "dB", line.note or f"{where}; {chance}"


def _floor(spectrum: Spectrum, order: float, slip: float, speed_rev_per_s: float | None) -> float:
    # Half the order to either side keeps the neighbouring harmonic out; harmonics of high orders need not see as far.
    return floor_near(
        spectrum, order, 0.5 * min(order, 4.0), leave_out_orders=slip * order, speed_rev_per_s=speed_rev_per_s
    )
