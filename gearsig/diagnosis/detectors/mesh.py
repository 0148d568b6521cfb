"""Where the meshes are, and whether they are where the rig and the speed put them."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where
from gearsig.rig.types import GearPair

N_HARMONICS = 3
CLEAR_DB = 12.0
"""A line that noise alone exceeds once in 10⁷: power over mean floor is exponential, exp(-15.8) (12 dB)."""


@dataclass(frozen=True)
class MeshLine:
    """The clearest of a pair's mesh lines."""

    channel: str
    harmonic: int
    order: float
    amplitude: float
    floor: float
    ratio_db: float
    unit: str


def strongest_mesh_line(signals: Signals, pair: GearPair) -> MeshLine | None:
    """Return the mesh harmonic of `pair` that stands out most over all channels; None if none is in the spectrum."""
    mesh = signals.rig.mesh_order(pair)
    best: MeshLine | None = None
    if mesh is None:
        return None
    for channel, excess in signals.order_excess.items():
        spectrum = excess.spectrum
        for h in range(1, N_HARMONICS + 1):
            if h * mesh > spectrum.positions[-1]:
                continue
            order, amplitude = spectrum.largest_near(h * mesh, 1.5 * spectrum.resolution)
            floor = float(excess.floor[spectrum.index_of(order)])
            ratio = _decibel(amplitude, floor)
            if best is None or ratio > best.ratio_db:
                best = MeshLine(channel, h, order, amplitude, floor, ratio, spectrum.unit)
    return best


def detect_mesh(signals: Signals) -> list[Finding]:
    """Report each pair's mesh, or that it is not where it should be."""
    if signals.angle is None:
        return []
    return [finding for pair in signals.rig.pairs if (finding := _one_pair(signals, pair)) is not None]


def _one_pair(signals: Signals, pair: GearPair) -> Finding | None:
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
    line = strongest_mesh_line(signals, pair)
    if line is None:
        return None
    return _found(signals, pair, line) if line.ratio_db >= CLEAR_DB else _absent(signals, pair, line, mesh)


def _found(signals: Signals, pair: GearPair, line: MeshLine) -> Finding:
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


def _absent(signals: Signals, pair: GearPair, line: MeshLine, mesh: float) -> Finding:
    hertz = mesh * signals.frequency_per_order_hz
    return Finding(
        "mesh-absent",
        Kind.CANNOT_TELL,
        f"No mesh line of {pair.name} where speed and teeth put it (order {mesh:.6g}, {hertz:.6g} Hz).",
        Where(gear=pair.name, order=mesh, order_shaft=signals.rig.reference_shaft, frequency_hz=hertz),
        Strength(line.amplitude, line.unit, line.floor, "noise floor of the order spectrum", line.ratio_db),
        evidence=(
            *_where_instead(signals),
            f"The best of {N_HARMONICS} harmonics is {line.ratio_db:.1f} dB over the floor.",
        ),
        surer="Check sampling rate, speed source (pulses per revolution, shaft) and teeth; or the gears carry no load.",
    )


def _where_instead(signals: Signals) -> tuple[str, ...]:
    """Say at which multiple of the stated speed the mesh lines do lie, if anywhere."""
    from gearsig.angle.tachless import comb_evidence

    stated = signals.frequency_per_order_hz * 60
    evidence = comb_evidence(signals.recording, signals.rig, stated)
    return (evidence,) if evidence else ()


def _decibel(amplitude: float, floor: float) -> float:
    from math import log10

    return 20 * log10(max(amplitude, 1e-300) / max(floor, 1e-300))
