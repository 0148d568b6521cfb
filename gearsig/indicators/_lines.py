"""Levels of mesh harmonics, sidebands, shaft orders and bearing orders, read from spectra and synchronous averages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, exp, isnan, log, log10, sqrt

import numpy as np

from gearsig.checks import count, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.indicators._gear import line_amplitude
from gearsig.indicators._signal import Indicator
from gearsig.orders import SynchronousAverage
from gearsig.rig import Bearing, GearPair, Rig
from gearsig.spectra import Spectrum

LineSource = Spectrum | SynchronousAverage
"""Source from which an order's amplitude can be read: an order spectrum, or the lines of an average."""

_PEAK_PER = {"amplitude peak": 1.0, "amplitude rms": sqrt(2.0)}


@dataclass(frozen=True)
class MeasuredLine:
    """The line found for an order.

    Parameters
    ----------
    order : float
        Order of the largest line; in an average, the requested order.
    amplitude : float
        Peak amplitude; if nan, `note` says why.
    largest : float
        Height of the largest line itself, for comparison with a floor of single lines; up to the window's scalloping
        loss (Hann: 1.4 dB) below `amplitude`.
    n_lines : int
        Number of lines among which the largest was taken.
    note : str
    """

    order: float
    amplitude: float
    largest: float = float("nan")
    n_lines: int = 1
    note: str = ""

    @property
    def place(self) -> str:
        """Text of the order."""
        return order_text(self.order)


def order_text(order: float) -> str:
    """Return the text of an order; that of the expected order, not of the one found, identifies an indicator."""
    return f"order {order:.5g}"


def over_orders(spectrum: Spectrum, speed_rev_per_s: float) -> Spectrum:
    """Convert a spectrum over frequency to orders of a shaft at constant speed, order = frequency/speed.

    Parameters
    ----------
    spectrum : Spectrum
    speed_rev_per_s : float
    """
    speed = positive(speed_rev_per_s, "speed_rev_per_s", "rev/s")
    return replace(
        spectrum,
        axis="order",
        positions=spectrum.positions / speed,
        resolution=spectrum.resolution / speed,
        noise_bandwidth=spectrum.noise_bandwidth / speed,
    )


def find_line(source: LineSource, order: float, *, search_orders: float = 0.0) -> MeasuredLine:
    """Return the largest line within `search_orders` of `order`, with its peak amplitude.

    In a spectrum, a sine spreads over the window's main lobe; A = √(Σ A_i² Δ/B) over the lobe, with Δ the line spacing
    and B the noise bandwidth, is its amplitude at any position between the lines.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    order : float
        Cycles per revolution of the shaft to which the source's orders refer.
    search_orders : float
        Half width of the search; in an average the order must be whole, and there is no search.

    Raises
    ------
    InputError
        On a power spectrum, a cepstrum, or a spectrum over frequency (see `over_orders`).
    """
    if isinstance(source, SynchronousAverage):
        return _line_of_average(source, order)
    to_peak, half = _to_peak(source), max(search_orders, 0.5 * source.resolution)
    top = float(source.positions[-1])
    if order + half > top:
        return MeasuredLine(order, float("nan"), note=f"order {order:.4g} lies above the spectrum's end, {top:.4g}")
    low, high = source.index_of(order - half), source.index_of(order + half)
    best = low + int(np.argmax(source.values[low : high + 1]))
    lobe = slice(max(best - lobe_lines(source), 0), best + lobe_lines(source) + 1)
    energy = float(np.sum(np.square(source.values[lobe], dtype=np.float64)))
    amplitude = sqrt(energy * source.resolution / source.noise_bandwidth) * to_peak
    largest = float(source.values[best]) * to_peak
    return MeasuredLine(float(source.positions[best]), amplitude, largest, high - low + 1)


def _line_of_average(average: SynchronousAverage, order: float) -> MeasuredLine:
    whole = round(order)
    amplitude, note = line_amplitude(average, whole), ""
    if abs(order - whole) > 1e-6 * max(order, 1.0):
        amplitude, note = float("nan"), f"order {order:.6g} is not whole: it is not in the average of {average.shaft!r}"
    elif isnan(amplitude):
        note = f"order {whole} lies above the average's end, {average.highest_order:.4g}"
    return MeasuredLine(order if note else float(whole), amplitude, amplitude, note=note)


def floor_near(source: Spectrum, order: float, half_width_orders: float, *, leave_out_orders: float) -> float:
    """Return the median peak amplitude of the lines around an order, without those next to it; nan below 8 lines."""
    distance = np.abs(source.positions - order)
    lobe = lobe_lines(source) * source.resolution
    # Lines near zero contain the mean of the signal, or its remainder.
    near = (distance <= half_width_orders) & (distance > max(leave_out_orders, lobe)) & (source.positions > lobe)
    return float(np.median(source.values[near])) * _to_peak(source) if np.count_nonzero(near) >= 8 else float("nan")


def noise_reaches(n_lines: int, probability: float = 0.05) -> float:
    """Return the ratio to the median that the largest of `n_lines` noise lines exceeds with `probability`.

    Noise lines have Rayleigh amplitudes: P(a > x m) = 2^(-x²), with m the median. Neighbouring lines share noise
    because of the window, and averaged spectra scatter less, so the true probability is lower.
    """
    each = 1 - exp(log(1 - probability) / max(n_lines, 1))
    return sqrt(-log(each) / log(2))


def lobe_lines(source: Spectrum) -> int:
    """Return the half width of the main lobe in lines, from the noise bandwidth: 2 for Hann, 5 for flat top."""
    return max(2, ceil(1.3 * source.noise_bandwidth / source.resolution))


def _to_peak(source: Spectrum) -> float:
    """Return the factor from the spectrum's scaling to peak amplitudes; raise unless it holds amplitudes of orders."""
    if source.scaling not in _PEAK_PER:
        remedy = "compute it with an amplitude scaling"
        raise InputError(f"the spectrum is scaled as {source.scaling!r}", allowed=", ".join(_PEAK_PER), remedy=remedy)
    if source.axis != "order":
        remedy = "give `over_orders` a spectrum over frequency and the speed"
        raise InputError(f"orders cannot be placed on a {source.axis} axis", allowed="an order spectrum", remedy=remedy)
    return _PEAK_PER[source.scaling]


def _ratio_db(value: float, reference: float) -> float:
    return 20 * log10(value / reference) if value > 0 and reference > 0 else float("nan")


def _origin(source: LineSource, channel: str) -> tuple[str, str]:
    """Return the channel and the kind of signal on which an indicator is computed."""
    if isinstance(source, SynchronousAverage):
        return channel or source.channel, "synchronous average"
    return channel, f"{source.axis} spectrum"


def mesh_indicators(
    source: LineSource,
    rig: Rig,
    pair: GearPair,
    *,
    shaft: str = "",
    channel: str = "",
    n_harmonics: int = 3,
    n_sidebands: int = 2,
) -> tuple[Indicator, ...]:
    """Return the levels of a pair's mesh harmonics, its sidebands per shaft, and sideband-to-carrier ratios.

    A carrier A with amplitude modulation m cos and phase modulation b sin (small b) has first-order sidebands
    A |m - h b|/2 (lower) and A |m + h b|/2 (upper): equal for either alone, unequal for both. The ratio is 20 lg of
    their mean over the carrier.

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
        An average contains only sidebands of its own shaft; those of the other shaft are left out.
    rig : Rig
    pair : GearPair
    shaft : str
        Shaft to which the source's orders refer; default: the source's shaft, else the rig's reference shaft.
    channel : str
        Default: the average's.
    n_harmonics, n_sidebands : int

    Returns
    -------
    tuple of Indicator
        "mesh level h×", "sideband level h× − k" and "h× + k", "sideband ratio h×" in dB. nan with a note if an order is
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
    in_source = {source.shaft} if isinstance(source, SynchronousAverage) else {pair.driver, pair.driven}
    spacings = {s: rig.ratio(s, to=shaft) for s in (pair.driver, pair.driven) if s in in_source}
    channel, on = _origin(source, channel)
    indicators: list[Indicator] = []
    for h in range(1, count(n_harmonics, "n_harmonics") + 1):
        carrier = find_line(source, h * mesh_order)
        name, note, band = f"mesh level {h}×", carrier.note, order_text(h * mesh_order)
        indicators.append(
            Indicator(name, carrier.amplitude, source.unit, channel, on, gear=pair.name, band=band, note=note)
        )
        for modulating, spacing in spacings.items():
            if spacing is not None:
                gear = f"{pair.name}/{modulating}"
                indicators += [
                    Indicator(name, value, unit, channel, on, modulating, gear, band, note)
                    for name, value, unit, band, note in _sidebands(
                        source, h, carrier, mesh_order, spacing, n_sidebands
                    )
                ]
    return tuple(indicators)


def _sidebands(
    source: LineSource, harmonic: int, carrier: MeasuredLine, mesh_order: float, spacing: float, n_sidebands: int
) -> Iterator[tuple[str, float, str, str, str]]:
    blurred = ""
    if isinstance(source, Spectrum) and spacing < (needed := (2 * lobe_lines(source) + 1) * source.resolution):
        blurred = f"not resolved: sidebands {spacing:.4g} apart need a resolution below {needed:.4g}"
    first: list[float] = []
    for k in range(1, n_sidebands + 1):
        for sign, side in ((-1, "−"), (1, "+")):
            order = harmonic * mesh_order + sign * k * spacing
            line = find_line(source, order)
            value = float("nan") if blurred else line.amplitude
            first += [value] if k == 1 else []
            yield f"sideband level {harmonic}× {side} {k}", value, source.unit, order_text(order), blurred or line.note
    ratio = _ratio_db(float(np.mean(first)), carrier.amplitude) if first else float("nan")
    note = blurred or ("undefined: a line is missing or zero" if isnan(ratio) else "")
    yield f"sideband ratio {harmonic}×", ratio, "dB", order_text(harmonic * mesh_order), note


def shaft_indicators(
    source: LineSource, shaft: str, *, shaft_ratio: float = 1.0, channel: str = "", n_harmonics: int = 3
) -> tuple[Indicator, ...]:
    """Return the peak amplitudes at 1×, 2×, … of a shaft: unbalance (1×), misalignment (2×), looseness etc. (3×).

    Parameters
    ----------
    source : Spectrum or SynchronousAverage
    shaft : str
    shaft_ratio : float
        Revolutions of the shaft per revolution of the source's shaft; 1 for an average of its own shaft.
    channel : str
        Default: the average's.
    n_harmonics : int

    Returns
    -------
    tuple of Indicator
        nan with a note if an order is not in the source.
    """
    positive(shaft_ratio, "shaft_ratio")
    channel, on = _origin(source, channel)
    low = isinstance(source, Spectrum) and shaft_ratio / source.resolution < 2 * lobe_lines(source)
    leak = "so close to zero that the signal's mean leaks in" if low else ""
    harmonics = range(1, count(n_harmonics, "n_harmonics") + 1)
    lines = [(h, find_line(source, h * shaft_ratio), leak if h == 1 else "") for h in harmonics]
    return tuple(
        Indicator(
            f"shaft order {h}×",
            line.amplitude,
            source.unit,
            channel,
            on,
            shaft,
            band=order_text(h * shaft_ratio),
            note=line.note or note,
        )
        for h, line, note in lines
    )


def defect_orders(bearing: Bearing) -> dict[str, float]:
    """Return the orders of the impacts from a defect, per revolution of the bearing's shaft: BPFO, BPFI, 2×BSF, FTF.

    A rolling element's defect strikes both races in one spin, hence twice the BSF.
    """
    names = {"BSF": ("2×BSF", 2)}
    orders = bearing.orders()
    return {names.get(key, (key, 1))[0]: names.get(key, (key, 1))[1] * order for key, order in orders.items()}


def bearing_indicators(
    envelope_spectrum: Spectrum,
    bearing: Bearing,
    *,
    shaft_ratio: float = 1.0,
    channel: str = "",
    n_harmonics: int = 3,
    slip_fraction: float = 0.015,
    band: str = "",
) -> tuple[Indicator, ...]:
    """Return the envelope levels at a bearing's orders and their harmonics, and their heights above the floor.

    The level is that of the largest line within the slip; the floor is the median of the lines within half the order,
    at most two orders, on either side. In one search of twenty, noise alone exceeds it by `noise_reaches(n_lines)`, 6
    to 11 dB.

    Parameters
    ----------
    envelope_spectrum : Spectrum
        Amplitude-scaled, over order.
    bearing : Bearing
    shaft_ratio : float
        Revolutions of the bearing's shaft per revolution of the shaft to which the spectrum's orders refer.
    channel : str
    n_harmonics : int
    slip_fraction : float
        Half width of the search relative to the order, 0 to 0.1: rolling elements slip by one or two per cent.
    band : str
        The demodulated band, stored with the indicators.

    Returns
    -------
    tuple of Indicator
        "BPFO envelope level h×" and "BPFO over floor h×" (dB) for each order name. `gear` is empty, `shaft` is the
        bearing's; the note states the order found.

    Raises
    ------
    RefusalError
        If neither the geometry nor the orders of the bearing are known.

    References
    ----------
    R. B. Randall and J. Antoni, "Rolling element bearing diagnostics – a tutorial", 2011.
    """
    slip = within(slip_fraction, "slip_fraction", 0.0, 0.1)
    orders = defect_orders(bearing)
    if not orders:
        raise RefusalError(
            f"no order of bearing {bearing.name!r} is known", remedy="give its geometry or orders in the rig file"
        )
    harmonics = range(1, count(n_harmonics, "n_harmonics") + 1)
    rows = (
        row
        for name, order in orders.items()
        for h in harmonics
        for row in _envelope_levels(envelope_spectrum, name, h, order * shaft_ratio * h, slip)
    )
    return tuple(
        Indicator(name, value, unit, channel, "envelope", bearing.shaft, "", band, note, bearing.name)
        for name, value, unit, note in rows
    )


def _envelope_levels(
    spectrum: Spectrum, name: str, harmonic: int, order: float, slip: float
) -> Iterator[tuple[str, float, str, str]]:
    line = find_line(spectrum, order, search_orders=slip * order)
    where = line.note or f"{line.place}, expected {order:.5g}"
    yield f"{name} envelope level {harmonic}×", line.amplitude, spectrum.unit, where
    # Half the order on either side excludes the neighbouring harmonic; high orders do not need such a wide range.
    over = _ratio_db(line.largest, floor_near(spectrum, order, 0.5 * min(order, 4.0), leave_out_orders=slip * order))
    chance = f"noise alone reaches {_ratio_db(noise_reaches(line.n_lines), 1.0):.1f} dB in 1 of 20"
    if isnan(over):
        chance = "undefined: too few lines around it for a floor, or nothing there"
    yield f"{name} over floor {harmonic}×", over, "dB", line.note or f"{where}; {chance}"
