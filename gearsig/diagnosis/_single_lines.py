"""Single lines: the shafts' own, the mains', and the strongest that belongs to nothing known."""

from __future__ import annotations

import numpy as np

from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import Finding, Kind, Strength, Where
from gearsig.prepared import MAINS_HZ, RUN_UP_FOOT_ORDERS, LineExcess, floor_of, levels_beside, over_floor_db

CLEAR_DB = 15.0
"""Power over mean floor that noise exceeds in one line of 10¹³: also over a million lines, a chance of 10⁻⁷."""

SKIRT = 5e-4
"""Relative width of a line's foot where the speed wanders by as little as that."""


def detect_lines(signals: AnalysisSignals) -> list[Finding]:
    """Report mains hum and the strongest unexplained line."""
    findings = []
    mains = _mains(signals)
    if mains is not None:
        findings.append(mains)
    if signals.order_excess:
        unexplained = _unexplained(signals)
        if unexplained is not None:
            findings.append(unexplained)
    else:
        findings += _strongest(signals)
    return findings


def _mains(signals: AnalysisSignals) -> Finding | None:
    """Look for lines at the mains frequency and its second harmonic that no shaft explains."""
    for name, spectrum in signals.spectra.items():
        excess = floor_of(spectrum)
        if spectrum.resolution > 0.5:
            continue  # a mains line is then not told from a shaft's
        for mains in MAINS_HZ:
            lines = [_ratio_db(excess, k * mains, 0.1) for k in (1, 2, 3)]
            if sum(ratio > CLEAR_DB for ratio in lines) >= 2 and not _is_synchronous(signals, mains):
                amplitude = spectrum.largest_near(mains, 0.1)[1]
                floor = float(excess.floor[spectrum.index_of(mains)])
                return Finding(
                    "mains-hum",
                    Kind.NOTICE,
                    f"Lines of the {mains:.0f} Hz mains stand in channel {name}.",
                    Where((name,), frequency_hz=mains),
                    Strength(amplitude, spectrum.unit, floor, "noise floor of the spectrum", lines[0]),
                    confidence=0.8,
                    confidence_basis="two of the first three multiples within 0.1 Hz",
                    surer="Switch the machine off and record again: hum stays.",
                )
    return None


def _is_synchronous(signals: AnalysisSignals, hertz: float) -> bool:
    if signals.angle is None:
        return False
    order = hertz / signals.frequency_per_order_hz
    # Also a half and a third of each: wheels that are not described often turn at those.
    candidates = [o / part for o in signals.known_shaft_orders.values() for part in (1, 2, 3)]
    return any(abs(order / o - round(order / o)) * o < 0.01 for o in candidates)


def _unexplained(signals: AnalysisSignals) -> Finding | None:
    """Return the strongest order line that is no multiple of a known shaft's order."""
    best: tuple[float, str, int] | None = None
    foot = RUN_UP_FOOT_ORDERS if signals.speed_varies else 0.0
    for name, excess in signals.order_excess.items():
        for order in signals.known_shaft_orders.values():
            wide = foot if order >= 4 * foot else 0.0  # closer lines are masked at least themselves
            excess = excess.without_multiples(order, half_width=wide, skirt=SKIRT)  # noqa: PLW2901
        if signals.rig.bearings:
            excess = _without_bearings(signals, excess)  # noqa: PLW2901
        with np.errstate(divide="ignore", invalid="ignore"):
            height = np.where(excess.masked, 0.0, excess.spectrum.values)
            clear = 20 * np.log10(excess.spectrum.values / excess.floor) > CLEAR_DB
        if signals.speed_varies:
            # Skirts of lines that pass a resonance are far above the floor, but not above what lies beside them.
            clear &= excess.spectrum.values > levels_beside(excess.spectrum) * 10 ** (CLEAR_DB / 20)
        height = np.where(clear & (excess.spectrum.positions > 0.2), height, 0.0)
        i = int(np.argmax(height))
        if height[i] > 0 and (best is None or height[i] > best[0]):
            best = (float(height[i]), name, i)
    if best is None:
        return None
    amplitude, name, i = best
    spectrum = signals.order_excess[name].spectrum
    floor = float(signals.order_excess[name].floor[i])
    order = float(spectrum.positions[i])
    hertz = order * signals.frequency_per_order_hz
    ratio_db = 20 * float(np.log10(amplitude / floor))
    return Finding(
        "unexplained-line",
        Kind.NOTICE,
        f"The strongest line of no known shaft or mesh is at order {order:.4f} ({hertz:.5g} Hz).",
        Where((name,), order=order, order_shaft=spectrum.shaft, frequency_hz=hertz),
        Strength(amplitude, spectrum.unit, floor, "noise floor", ratio_db),
        confidence=0.95,
        confidence_basis="height over the noise floor; what causes it is not known",
        surer="A run-up: a line of fixed frequency is a resonance or electrical, one of fixed order a shaft's.",
    )


def _without_bearings(signals: AnalysisSignals, excess: LineExcess) -> LineExcess:
    for bearing in signals.rig.bearings:
        ratio = signals.rig.ratio(bearing.shaft)
        for order in bearing.orders().values() if ratio is not None else ():
            excess = excess.without_multiples(order * (ratio or 1.0), half_width=0.02 * order)
    return excess


def _strongest(signals: AnalysisSignals) -> list[Finding]:
    """Without speed: the strongest line of the spectrum, as a start."""
    best: tuple[float, str, float, float, str] | None = None
    for name, spectrum in signals.spectra.items():
        excess = floor_of(spectrum)
        start = spectrum.index_of(2.0) + 1
        i = start + int(np.argmax(spectrum.values[start:]))
        value, floor = float(spectrum.values[i]), float(excess.floor[i])
        if value > floor * 10 ** (CLEAR_DB / 20) and (best is None or value > best[0]):
            best = (value, name, float(spectrum.positions[i]), floor, spectrum.unit)
    if best is None:
        return []
    value, name, hertz, floor, unit = best
    return [
        Finding(
            "strongest-line",
            Kind.INFORMATION,
            f"The strongest line of the spectrum is at {hertz:.6g} Hz in channel {name}.",
            Where((name,), frequency_hz=hertz),
            Strength(value, unit, floor, "noise floor of the spectrum", 20 * float(np.log10(value / floor))),
            confidence=0.95,
            confidence_basis="height over the noise floor; what causes it is not known",
        )
    ]


def _ratio_db(excess: LineExcess, position: float, half_width: float) -> float:
    spectrum = excess.spectrum
    if position > spectrum.positions[-1]:
        return 0.0
    found, amplitude = spectrum.largest_near(position, half_width)
    if abs(found - position) > half_width:
        return 0.0
    return over_floor_db(amplitude, float(excess.floor[spectrum.index_of(found)]))
