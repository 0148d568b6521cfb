"""Where the meshes are, and whether they are where the rig and the speed put them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._speed import N_HARMONICS, ConfirmingLine, clearest_line
from gearsig.diagnosis._types import Finding, Kind, Strength, Where
from gearsig.prepared import LineExcess
from gearsig.rig import GearPair

MAX_TEETH_WRONG = 3
CONTRADICTED_DB = 10.0
"""By so much the true mesh lines exceed the stated ones: more than sidebands exceed their carriers in several harmonics
at once, always on the same side."""

CONTRADICTED_BY_ONE_DB = 20.0
"""The same where the first harmonic alone is to be seen."""

LINE_DB = 12.0
WITHIN_LINES = 1.5
AROUND_LINES = 6.0
APART_LINES = 3.0


def teeth_are_contradicted(signals: AnalysisSignals, pair: GearPair) -> float | None:
    """Return the order at which the mesh lines of `pair` really are, None where nothing contradicts the stated teeth.

    With d teeth more than stated on the shaft that the mesh is reckoned from, the lines stand at h·(mesh + d·shaft)
    instead of h·mesh. Those at the stated place are then mere sidebands, and all that is put down to teeth is wrong.

    Parameters
    ----------
    signals : Signals
    pair : GearPair

    Returns
    -------
    float or None
        In cycles per revolution of the reference shaft.
    """
    mesh = signals.rig.mesh_order(pair)
    if mesh is None or not signals.order_excess:
        return None
    shifts = [d for d in range(-MAX_TEETH_WRONG, MAX_TEETH_WRONG + 1) if d]
    best: tuple[float, float] | None = None
    for step in _reckoned_from(signals, pair):
        for order in (mesh + d * step for d in shifts):
            if order <= step or _is_other_mesh(signals, order, mesh):
                continue
            margins = [_margin_db(excess, mesh, order) for excess in signals.order_excess.values()]
            seen = [margin for margin in margins if margin is not None]
            if seen and (best is None or float(np.median(seen)) > best[0]):
                best = (float(np.median(seen)), order)
    return best[1] if best is not None and best[0] > 0 else None


def detect_mesh(signals: AnalysisSignals) -> list[Finding]:
    """Report each pair's mesh, or that it is not where it should be."""
    if signals.angle is None:
        return []
    return [finding for pair in signals.rig.pairs if (finding := _one_pair(signals, pair)) is not None]


def _one_pair(signals: AnalysisSignals, pair: GearPair) -> Finding | None:
    mesh = signals.rig.mesh_order(pair)
    if mesh is None:
        return Finding(
            "mesh-order-unknown",
            Kind.CANNOT_TELL,
            f"The mesh order of {pair.name} is not known.",
            Where(gear=pair.name),
            surer="Give the teeth of one of its gears and of all gears between it and the speed's shaft.",
        )
    hertz = mesh * signals.frequency_per_order_hz
    nyquist = signals.recording.sampling_rate_hz / 2
    if hertz >= nyquist:
        return Finding(
            "mesh-above-sampling",
            Kind.CANNOT_TELL,
            f"The mesh of {pair.name} would be at {hertz:.5g} Hz, above half the sampling rate ({nyquist:.5g} Hz).",
            Where(gear=pair.name, order=mesh, order_shaft=signals.rig.reference_shaft, frequency_hz=hertz),
            evidence=("Sampling rate, speed and teeth cannot all be right, or the recording was made too slowly.",),
            surer="Check the sampling rate and the teeth; record at three times the mesh frequency or more.",
        )
    order = teeth_are_contradicted(signals, pair)
    if order is not None:
        return _disagree(signals, pair, mesh, order)
    line = clearest_line(signals, mesh)
    if line is None:
        return None
    return _found(signals, pair, line) if line.is_clear else _absent(signals, pair, line, mesh)


def _found(signals: AnalysisSignals, pair: GearPair, line: ConfirmingLine) -> Finding:
    hertz = line.order * signals.frequency_per_order_hz
    return Finding(
        "mesh-found",
        Kind.INFORMATION,
        f"The mesh of {pair.name} shows at order {line.order:.6g} ({hertz:.6g} Hz, harmonic {line.harmonic}).",
        Where(
            (line.channel,),
            gear=pair.name,
            order=line.order,
            order_shaft=signals.rig.reference_shaft,
            frequency_hz=hertz,
        ),
        Strength(line.amplitude, line.unit, line.floor, "noise floor of the order spectrum", line.ratio_db),
        confidence=0.99,
        confidence_basis="height over the noise floor",
    )


def _disagree(signals: AnalysisSignals, pair: GearPair, mesh: float, order: float) -> Finding:
    hertz = order * signals.frequency_per_order_hz
    above = (
        f"The lines there are {CONTRADICTED_DB:.0f} dB or more above those at {mesh:.6g}, at every harmonic that shows."
    )
    way = "lower" if order < mesh else "higher"
    speed = f"A speed that is {100 * abs(order / mesh - 1):.2f} % {way} would do the same."
    return Finding(
        "teeth-disagree",
        Kind.CANNOT_TELL,
        f"The mesh lines of {pair.name} are at order {order:.6g}, the rig says {mesh:.6g}: check the teeth.",
        Where(gear=pair.name, order=order, order_shaft=signals.rig.reference_shaft, frequency_hz=hertz),
        evidence=(above, speed),
        surer="Count the teeth, and check pulses per revolution and the shaft that the speed belongs to.",
    )


def _reckoned_from(signals: AnalysisSignals, pair: GearPair) -> list[float]:
    """Return the orders of the pair's shafts that are known without this pair's own teeth."""
    others = tuple(p for p in signals.rig.pairs if p is not pair)
    without = replace(signals.rig, pairs=others, contact=None)  # the contact may be this pair's
    reference = signals.rig.reference_shaft
    orders = [without.ratio(shaft, to=reference) for shaft in (pair.driver, pair.driven)]
    return [order for order in orders if order is not None]


def _is_other_mesh(signals: AnalysisSignals, order: float, mesh: float) -> bool:
    """Whether another pair's mesh, or its second or third harmonic, explains lines at `order`."""
    near = max(APART_LINES * e.spectrum.resolution for e in signals.order_excess.values())
    others = [signals.rig.mesh_order(pair) for pair in signals.rig.pairs]
    return any(
        abs(h * other - order) <= near
        for other in others
        if other is not None and abs(other - mesh) > near
        for h in range(1, N_HARMONICS + 1)
    )


def _margin_db(excess: LineExcess, mesh: float, order: float) -> float | None:
    """Return by how much the lines at multiples of `order` contradict those of `mesh` in the worst harmonic.

    Positive: they do. Each is compared with the stated line and with the one as far on its other side, as a
    modulation has sidebands on both. None if no harmonic shows in either place, or only a higher one.
    """
    margins: dict[int, float] = {}
    for h in range(1, N_HARMONICS + 1):
        if h * max(order, 2 * mesh - order) > excess.spectrum.positions[-1]:
            break
        true, true_stands = _level_db(excess, h * order)
        stated, stated_stands = _level_db(excess, h * mesh)
        mirrored = _level_db(excess, h * (2 * mesh - order))[0]
        if true_stands or stated_stands:
            margins[h] = true - max(stated, mirrored) if true_stands else -CONTRADICTED_DB
    if not margins or set(margins) in ({2}, {3}):
        return None  # a single line of a higher multiple is where a wrong speed puts any mesh by chance
    return min(margins.values()) - (CONTRADICTED_DB if len(margins) > 1 else CONTRADICTED_BY_ONE_DB)


def _level_db(excess: LineExcess, order: float) -> tuple[float, bool]:
    """Return the level at `order`, and whether a line stands there: over the floor, highest of its surroundings."""
    spectrum = excess.spectrum
    found, amplitude = spectrum.largest_near(order, WITHIN_LINES * spectrum.resolution)
    around = spectrum.largest_near(order, AROUND_LINES * spectrum.resolution)[1]
    floor = float(excess.floor[spectrum.index_of(found)])
    level = 20 * float(np.log10(max(amplitude, 1e-300)))
    return level, amplitude >= around and level - 20 * float(np.log10(max(floor, 1e-300))) >= LINE_DB


def _absent(signals: AnalysisSignals, pair: GearPair, line: ConfirmingLine, mesh: float) -> Finding:
    hertz = mesh * signals.frequency_per_order_hz
    return Finding(
        "mesh-absent",
        Kind.CANNOT_TELL,
        f"No mesh line of {pair.name} where speed and teeth put it (order {mesh:.6g}, {hertz:.6g} Hz).",
        Where(gear=pair.name, order=mesh, order_shaft=signals.rig.reference_shaft, frequency_hz=hertz),
        Strength(line.amplitude, line.unit, line.floor, "noise floor of the order spectrum", line.ratio_db),
        evidence=(
            *_where_instead(signals),
            _how_near(line),
        ),
        surer="Check sampling rate, speed source (pulses per revolution, shaft) and teeth; or the gears carry no load.",
    )


def _how_near(line: ConfirmingLine) -> str:
    if line.on_place:
        return f"The best of {N_HARMONICS} harmonics is {line.ratio_db:.1f} dB over the floor."
    return (
        f"Near harmonic {line.harmonic} a line stands beside its place: the speed may be off by little, "
        "and small errors smear all averages."
    )


def _where_instead(signals: AnalysisSignals) -> tuple[str, ...]:
    """Say at which multiple of the stated speed the mesh lines do lie, if anywhere."""
    from gearsig.angle import comb_evidence

    stated = signals.frequency_per_order_hz * 60
    evidence = comb_evidence(signals.recording, signals.rig, stated)
    return (evidence,) if evidence else ()
