"""Amplitude of one order in a spectrum or a synchronous average, and the floor around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, exp, isnan, log, sqrt

import numpy as np

from gearsig.checks import count, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.indicators._amplitude import Indicator
from gearsig.indicators._gear import line_amplitude
from gearsig.orders import SynchronousAverage
from gearsig.rig import Bearing, GearPair, Rig
from gearsig.spectra import Spectrum

LineSource = Spectrum | SynchronousAverage
"""Where an order's amplitude can be read: a spectrum, or the lines of an average."""

_PEAK_PER = {"amplitude peak": 1.0, "amplitude rms": sqrt(2.0)}
_WHOLE = 1e-6  # an order this close to a whole number is that line of an average


@dataclass(frozen=True)
class MeasuredLine:
    """One order as it was found.

    Parameters
    ----------
    order : float
        Where the largest line was; the order asked for in an average.
    amplitude : float
        Peak amplitude; nan where `note` says why.
    largest : float
        Height of the largest line itself, to be compared with a floor of single lines; up to the window's scalloping
        (Hann: 1.4 dB) below `amplitude`.
    n_lines : int
        Lines among which the largest was taken.
    note : str
    """

    order: float
    amplitude: float
    largest: float = float("nan")
    n_lines: int = 1
    note: str = ""


def find_line(
    source: LineSource, order: float, *, search_orders: float = 0.0, speed_rev_per_s: float | None = None
) -> MeasuredLine:
    """Return the peak amplitude of the largest line within `search_orders` of `order`.

    In a spectrum a sine spreads over the window's main lobe; A = √(Σ A_i² Δ/B) over the lobe, Δ the line spacing and B
    the noise bandwidth, is its amplitude wherever it lies between the lines.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    order : float
        Cycles per revolution of the shaft that the source's orders are counted on.
    search_orders : float
        Half width of the search; in an average the order must be whole and is not searched.
    speed_rev_per_s : float or None
        Of that shaft, for a spectrum over frequency.

    Returns
    -------
    Line

    Raises
    ------
    InputError
        On a spectrum of power or of quefrencies, or over frequency without a speed.
    """
    if isinstance(source, SynchronousAverage):
        return _line_of_average(source, order)
    unit = axis_per_order(source, speed_rev_per_s)
    position, half = order * unit, max(search_orders * unit, 0.5 * source.resolution)
    if position + half > float(source.positions[-1]):
        top = float(source.positions[-1]) / unit
        return MeasuredLine(order, float("nan"), note=f"order {order:.4g} lies above the spectrum's end, {top:.4g}")
    low, high = source.index_of(position - half), source.index_of(position + half)
    best = low + int(np.argmax(source.values[low : high + 1]))
    lobe = lobe_lines(source)
    first, last = max(best - lobe, 0), min(best + lobe, len(source.values) - 1)
    energy = float(np.sum(np.square(source.values[first : last + 1], dtype=np.float64)))
    amplitude = sqrt(energy * source.resolution / source.noise_bandwidth) * _PEAK_PER[source.scaling]
    largest = float(source.values[best]) * _PEAK_PER[source.scaling]
    return MeasuredLine(float(source.positions[best]) / unit, amplitude, largest, high - low + 1)


def floor_near(
    source: Spectrum, order: float, half_width_orders: float, *, leave_out_orders: float, speed_rev_per_s: float | None
) -> float:
    """Median peak amplitude of the lines around an order, the order's own surroundings left out; nan below 8 lines."""
    unit = axis_per_order(source, speed_rev_per_s)
    distance = np.abs(source.positions - order * unit)
    inner = max(leave_out_orders * unit, lobe_lines(source) * source.resolution)
    # Lines at zero hold the mean of the signal, or what is left of it.
    near = (distance <= half_width_orders * unit) & (distance > inner)
    near &= source.positions > lobe_lines(source) * source.resolution
    if np.count_nonzero(near) < 8:
        return float("nan")
    return float(np.median(source.values[near])) * _PEAK_PER[source.scaling]


def noise_reaches(n_lines: int, probability: float = 0.05) -> float:
    """Ratio to the median that the largest of `n_lines` lines of noise exceeds with `probability`.

    Lines of noise have Rayleigh amplitudes: P(a > x m) = 2^(-x²), m the median. Neighbouring lines of a window share
    noise and averaged spectra scatter less, so that the true probability is lower.
    """
    each = 1 - exp(log(1 - probability) / max(n_lines, 1))
    return sqrt(-log(each) / log(2))


def axis_per_order(source: Spectrum, speed_rev_per_s: float | None) -> float:
    """Axis units per order: 1 on an order axis, the speed on a frequency axis."""
    if source.scaling not in _PEAK_PER:
        raise InputError(
            f"the spectrum is scaled as {source.scaling!r}",
            allowed=", ".join(_PEAK_PER),
            remedy="compute it with an amplitude scaling",
        )
    if source.axis == "order":
        return 1.0
    if source.axis != "frequency" or speed_rev_per_s is None:
        raise InputError(
            f"orders cannot be placed on a {source.axis} axis",
            allowed="an order spectrum, or a frequency spectrum together with speed_rev_per_s",
        )
    return positive(speed_rev_per_s, "speed_rev_per_s", "rev/s")


def lobe_lines(source: Spectrum) -> int:
    """Half width of the window's main lobe in lines, from its noise bandwidth: 2 for Hann, 5 for flat-top."""
    return max(2, ceil(1.3 * source.noise_bandwidth / source.resolution))


def ratio_db(value: float, reference: float) -> float:
    """20 lg(value/reference); nan where either is not above zero."""
    if not (value > 0 and reference > 0):
        return float("nan")
    return 20 * float(np.log10(value / reference))


def _line_of_average(average: SynchronousAverage, order: float) -> MeasuredLine:
    whole = round(order)
    if abs(order - whole) > _WHOLE * max(order, 1.0):
        return MeasuredLine(
            order, float("nan"), note=f"order {order:.6g} is not whole: it is not in the average of {average.shaft!r}"
        )
    amplitude = line_amplitude(average, whole)
    if np.isnan(amplitude):
        return MeasuredLine(
            order, amplitude, note=f"order {whole} lies above the average's end, {average.highest_order:.4g}"
        )
    return MeasuredLine(float(whole), amplitude, amplitude)


# Levels of mesh harmonics and their sidebands.


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
    carrier: MeasuredLine,
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


def _order(line: MeasuredLine) -> str:
    return f"order {line.order:.5g}"


# Amplitudes of the low shaft orders: unbalance (1×), misalignment (2×), looseness and others (3×).


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


# Levels of an envelope spectrum at the orders of a rolling bearing.


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
) -> MeasuredLine:
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
