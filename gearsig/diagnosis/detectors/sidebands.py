"""Modulation of the mesh: sidebands of known shafts, and families whose shaft is not known."""

from __future__ import annotations

import numpy as np

from gearsig.diagnosis.comb import Comb, LineExcess, best_comb
from gearsig.diagnosis.confidence import WITH_ASSUMED_DATA, from_p_value, p_text
from gearsig.diagnosis.confirmation import mesh_is_confirmed
from gearsig.diagnosis.detectors.mesh import teeth_are_contradicted
from gearsig.diagnosis.modulation import (
    N_CARRIERS,
    NOTABLE_DB,
    STRONG_DB,
    Modulation,
    mesh_modulation,
    sideband_distance,
)
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.surroundings import RUN_UP_FOOT_ORDERS, level_beside
from gearsig.diagnosis.types import Finding, Kind, Strength, Where
from gearsig.rig.types import GearPair

TIMES = {1: "once", 2: "twice"}

FEWEST_LINES = 3
"""Of a family whose shaft is not known."""

LINE_OVER_SURROUNDINGS_DB = 6.0
"""Of a family's line over what lies beside it: the foot of a mesh line is above the floor and no family."""

WIDEST_PULSE_ERROR = 4
"""Pulses per revolution are mistaken by factors up to this: the marks of a coupling, of a four-hole disc."""


def detect_sidebands(signals: Signals) -> list[Finding]:
    """Report strong modulation by known shafts, and sideband families of shafts that the rig does not know."""
    findings: list[Finding] = []
    for pair in signals.rig.pairs:
        if not mesh_is_confirmed(signals, pair) or teeth_are_contradicted(signals, pair) is not None:
            continue  # without a carrier there are no sidebands of it
        findings += _known_shafts(signals, pair)
        findings += _unknown_family(signals, pair)
    return findings


def _known_shafts(signals: Signals, pair: GearPair) -> list[Finding]:
    findings = []
    for shaft in (pair.driver, pair.driven):
        by_channel = mesh_modulation(signals, pair, shaft)
        if not by_channel:
            continue
        median = float(np.median([m.level_db for m in by_channel.values()]))
        if median >= NOTABLE_DB:
            findings.append(_modulated(signals, pair, shaft, by_channel, median))
    return findings


def _modulated(
    signals: Signals, pair: GearPair, shaft: str, by_channel: dict[str, Modulation], median: float
) -> Finding:
    channel = max(by_channel, key=lambda name: by_channel[name].level_db)
    strongest = by_channel[channel]
    times = TIMES.get(strongest.times, f"{strongest.times} times")
    suspect = median >= STRONG_DB and not signals.rig.assumed
    how = "strongly modulated" if median >= STRONG_DB else "modulated"
    basis = "how much modulation is usual depends on the machine and the sensor's place"
    return Finding(
        "mesh-modulated",
        Kind.SUSPICION if suspect else Kind.NOTICE,
        f"The mesh of {pair.name} is {how} {times} per revolution of shaft {shaft}.",
        Where(
            (channel,),
            shaft=shaft,
            gear=f"{pair.name}/{shaft}",
            order=strongest.spacing,
            order_shaft=signals.rig.reference_shaft,
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
            f"Sidebands against mesh harmonics: {median:.1f} dB (median), {strongest.level_db:.1f} dB in {channel}.",
            _usual_causes(strongest.times),
            *_same_speed(signals, pair),
        ),
        surer="Look for it at another load."
        if signals.has_reference
        else "Compare with a recording of the same gearbox known to be good, or look for it at another load.",
    )


def _usual_causes(times: int) -> str:
    if times <= 2:
        return "An eccentric gear, a bent shaft, misalignment and a fluctuating load all do this."
    return f"{times} planets that pass, a coupling of {times} jaws or a gear clamped out of round all do this."


def _same_speed(signals: Signals, pair: GearPair) -> tuple[str, ...]:
    driver, driven = signals.rig.ratio(pair.driver), signals.rig.ratio(pair.driven)
    if driver is None or driver != driven:
        return ()
    return (f"Shafts {pair.driver} and {pair.driven} turn equally fast: which of them it is cannot be told.",)


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
    if p_value > signals.settings.false_alarm_probability or _is_known(signals, comb):
        return []
    if not _is_family(signals.order_excess[channel], comb, mesh):
        return []
    return [_unknown(signals, pair, mesh, comb, channel, p_value)]


def _family(signals: Signals, excess: LineExcess, mesh: float) -> Comb | None:
    foot = RUN_UP_FOOT_ORDERS if signals.speed_varies else 0.0
    meshes = {mesh} | {m for pair in signals.rig.pairs if (m := signals.rig.mesh_order(pair)) is not None}
    for other in meshes:
        excess = excess.without_multiples(other, half_width=foot)
    for order in signals.known_shaft_orders.values():
        wide = foot if order >= 4 * foot else 0.0
        excess = excess.without_multiples(order, half_width=wide)
        excess = excess.without_multiples(order, start=mesh, half_width=wide)
    centres = mesh * np.arange(1, N_CARRIERS + 1)
    centres = centres[centres + 2 < excess.spectrum.positions[-1]]
    if len(centres) == 0:
        return None
    lowest = max(0.05, sideband_distance(excess.spectrum), 3 * foot)
    return best_comb(excess, lowest, 1.9, offsets=np.array([-3, -2, -1, 1, 2, 3]), centres=centres)


def _is_family(excess: LineExcess, comb: Comb, mesh: float) -> bool:
    """Whether enough of the lines stand out of what lies beside them, two of them on either side of one carrier."""
    own_reach = comb.fundamental / excess.spectrum.resolution - 3
    places = []
    for position in comb.positions:
        level = level_beside(excess.spectrum, position, own_reach)
        amplitude = excess.spectrum.largest_near(position, excess.spectrum.resolution)[1]
        if level is None or amplitude >= level * 10 ** (LINE_OVER_SURROUNDINGS_DB / 20):
            h = max(1, round(position / mesh))
            places.append((h, round((position - h * mesh) / comb.fundamental)))
    return len(places) >= FEWEST_LINES and any((h, -k) in places for h, k in places)


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
    spectrum = signals.order_excess[channel].spectrum
    evidence += _pulses_doubted(signals, comb, spectrum.resolution)
    return Finding(
        "sidebands-of-unknown-shaft",
        Kind.NOTICE,
        f"The mesh of {pair.name} has sidebands spaced by order {comb.fundamental:.4f} of {reference} "
        f"({comb.fundamental * signals.frequency_per_order_hz:.4g} Hz), which no known shaft explains.",
        Where((channel,), gear=pair.name, order=comb.fundamental, order_shaft=reference),
        Strength(
            comb.amplitude,
            spectrum.unit,
            comb.floor,
            "noise floor of the order spectrum",
            max(comb.ratios_db, default=None),
        ),
        confidence=from_p_value(p_value, prior=0.3, limit=0.99),
        confidence_basis=(
            f"at most this; chance that noise makes such a family: {p_text(p_value)}, "
            "over all spacings and channels tried"
        ),
        evidence=tuple(evidence),
        surer=surer,
    )


def _pulses_doubted(signals: Signals, comb: Comb, resolution: float) -> list[str]:
    """Say so where the shaft that the pulses come from would turn at a whole fraction of the speed found."""
    if signals.angle is None or signals.angle.method != "pulses":
        return []
    for n in range(2, WIDEST_PULSE_ERROR + 1):
        if abs(comb.fundamental - 1 / n) <= resolution:
            return [
                f"The spacing is 1/{n} of the speed found from the pulses: pulses_per_revolution may be wrong by {n}."
            ]
    return []
