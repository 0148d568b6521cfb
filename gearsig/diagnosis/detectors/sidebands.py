"""Modulation of the mesh: sidebands of known shafts, and families whose shaft is not known."""

from __future__ import annotations

from math import log10

import numpy as np

from gearsig.diagnosis.comb import Comb, LineExcess, best_comb
from gearsig.diagnosis.confidence import WITH_ASSUMED_DATA, from_p_value
from gearsig.diagnosis.confirmation import mesh_is_confirmed
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where
from gearsig.rig.types import GearPair

STRONG_DB = -10.0
"""Sidebands over carrier, in power: an amplitude modulation of 45 %, or a third together with some phase modulation."""

NOTABLE_DB = -16.0
"""An amplitude modulation of 22 %: worth a look, common on sound machines."""

N_SIDEBANDS = 2
N_CARRIERS = 3


def detect_sidebands(signals: Signals) -> list[Finding]:
    """Report strong modulation by known shafts, and sideband families of shafts that the rig does not know."""
    findings: list[Finding] = []
    for pair in signals.rig.pairs:
        if not mesh_is_confirmed(signals, pair):
            continue  # without a carrier there are no sidebands of it
        findings += _known_shafts(signals, pair)
        findings += _unknown_family(signals, pair)
    return findings


def sideband_ratio_db(excess: LineExcess, mesh: float, shaft_order: float) -> float | None:
    """Return the power of the first sidebands of the first mesh harmonics over that of the harmonics, in dB.

    Powers are taken over the floor; summed over harmonics, so that one weak carrier does not make the ratio large.
    """
    carriers = sidebands = 0.0
    for h in range(1, N_CARRIERS + 1):
        if h * mesh + N_SIDEBANDS * shaft_order > excess.spectrum.positions[-1]:
            break
        carriers += _power(excess, h * mesh)
        sidebands += sum(_power(excess, h * mesh + k * shaft_order) for k in range(-N_SIDEBANDS, N_SIDEBANDS + 1) if k)
    if carriers <= 0 or sidebands <= 0:
        return None
    return 10 * log10(sidebands / carriers)


def _known_shafts(signals: Signals, pair: GearPair) -> list[Finding]:
    mesh = signals.rig.mesh_order(pair)
    findings = []
    for shaft in (pair.driver, pair.driven):
        order = signals.rig.ratio(shaft)
        if mesh is None or order is None:
            continue
        levels = {name: sideband_ratio_db(excess, mesh, order) for name, excess in signals.order_excess.items()}
        known = {name: level for name, level in levels.items() if level is not None}
        if not known:
            continue
        channel = max(known, key=lambda name: known[name])
        median = float(np.median(list(known.values())))
        if median >= NOTABLE_DB:
            findings.append(_modulated(signals, pair, shaft, channel, known, median))
    return findings


def _modulated(
    signals: Signals, pair: GearPair, shaft: str, channel: str, levels: dict[str, float], median: float
) -> Finding:
    order = signals.rig.ratio(shaft)
    suspect = median >= STRONG_DB and not signals.rig.assumed
    how = "strongly modulated" if median >= STRONG_DB else "modulated"
    basis = "how much modulation is usual depends on the machine and the sensor's place"
    return Finding(
        "mesh-modulated",
        Kind.SUSPICION if suspect else Kind.NOTICE,
        f"The mesh of {pair.name} is {how} once per revolution of shaft {shaft}.",
        Where(
            (channel,), shaft=shaft, gear=f"{pair.name}/{shaft}", order=order, order_shaft=signals.rig.reference_shaft
        ),
        Strength(
            10 ** (median / 20),
            "sideband/carrier",
            10 ** (NOTABLE_DB / 20),
            "common on sound machines",
            median - NOTABLE_DB,
        ),
        confidence=0.5 if suspect else 0.95 * (WITH_ASSUMED_DATA if signals.rig.assumed else 1.0),
        confidence_basis=f"that it is a fault: {basis}" if suspect else f"that it is there; {basis}",
        evidence=(
            f"Sidebands against mesh harmonics: {median:.1f} dB (median), {levels[channel]:.1f} dB in {channel}.",
            "An eccentric gear, a bent shaft, misalignment and a fluctuating load all do this.",
        ),
        surer="Compare with a recording of the same gearbox known to be good, or look for it at another load.",
    )


def _unknown_family(signals: Signals, pair: GearPair) -> list[Finding]:
    """Find sidebands whose spacing is no known shaft's: that is how a wheel shows whose teeth are not given."""
    mesh = signals.rig.mesh_order(pair)
    if mesh is None:
        return []
    best: tuple[Comb, str] | None = None
    for name, excess in signals.order_excess.items():
        comb = _family(signals, excess, mesh)
        if comb is not None and (best is None or comb.p_value < best[0].p_value):
            best = (comb, name)
    if best is None:
        return []
    comb, channel = best
    p_value = min(1.0, comb.p_value * len(signals.order_excess))
    if p_value > signals.settings.false_alarm_probability or len(comb.positions) < 3 or _is_known(signals, comb):
        return []
    return [_unknown(signals, pair, mesh, comb, channel, p_value)]


def _family(signals: Signals, excess: LineExcess, mesh: float) -> Comb | None:
    orders = signals.known_shaft_orders
    for order in orders.values():
        excess = excess.without_multiples(order).without_multiples(order, start=mesh)
    centres = mesh * np.arange(1, N_CARRIERS + 1)
    centres = centres[centres + 2 < excess.spectrum.positions[-1]]
    if len(centres) == 0:
        return None
    return best_comb(excess, 0.05, 1.9, offsets=np.array([-3, -2, -1, 1, 2, 3]), centres=centres)


def _is_known(signals: Signals, comb: Comb) -> bool:
    """Whether the spacing is a known shaft's after all: skirts of its lines, where the speed is not exactly known."""
    return any(
        abs(k * order / comb.fundamental - 1) < 0.01 for order in signals.known_shaft_orders.values() for k in (1, 2)
    )


def _unknown(signals: Signals, pair: GearPair, mesh: float, comb: Comb, channel: str, p_value: float) -> Finding:
    reference = signals.rig.reference_shaft
    evidence = [f"{len(comb.positions)} of the sidebands stand 6 dB or more over the floor."]
    surer = "Give the teeth of all gears: a shaft of that order would explain it."
    unknown_teeth = pair.driver_teeth is None or pair.driven_teeth is None
    teeth = mesh / comb.fundamental
    if unknown_teeth and abs(teeth - round(teeth)) <= 0.1:
        other = pair.driven if pair.driven_teeth is None else pair.driver
        evidence.append(f"A gear with {round(teeth)} teeth on shaft {other} would modulate the mesh just so.")
        surer = f"Count the teeth on shaft {other}; with them in the rig file that gear is examined as well."
    return Finding(
        "sidebands-of-unknown-shaft",
        Kind.NOTICE,
        f"The mesh of {pair.name} has sidebands spaced by order {comb.fundamental:.4f} of {reference} "
        f"({comb.fundamental * signals.frequency_per_order_hz:.4g} Hz), which no known shaft explains.",
        Where((channel,), gear=pair.name, order=comb.fundamental, order_shaft=reference),
        Strength(
            comb.amplitude, "", comb.floor, "noise floor of the order spectrum", max(comb.ratios_db, default=None)
        ),
        confidence=from_p_value(p_value, prior=0.3, limit=0.99),
        confidence_basis=f"chance that noise makes such a family: {p_value:.1e}, over all spacings and channels tried",
        evidence=tuple(evidence),
        surer=surer,
    )


def _power(excess: LineExcess, position: float) -> float:
    spectrum = excess.spectrum
    found, amplitude = spectrum.largest_near(position, 1.5 * spectrum.resolution)
    floor = float(excess.floor[spectrum.index_of(found)])
    return max(0.0, amplitude**2 - floor**2)
