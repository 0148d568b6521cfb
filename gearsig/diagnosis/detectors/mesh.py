"""Where the meshes are, and whether they are where the rig and the speed put them."""

from __future__ import annotations

from gearsig.diagnosis.confirmation import N_HARMONICS, ConfirmingLine, clearest_line
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where
from gearsig.rig.types import GearPair


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
    line = clearest_line(signals, mesh)
    if line is None:
        return None
    return _found(signals, pair, line) if line.is_clear else _absent(signals, pair, line, mesh)


def _found(signals: Signals, pair: GearPair, line: ConfirmingLine) -> Finding:
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


def _absent(signals: Signals, pair: GearPair, line: ConfirmingLine, mesh: float) -> Finding:
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


def _how_near(line: ConfirmingLine) -> str:
    if line.on_place:
        return f"The best of {N_HARMONICS} harmonics is {line.ratio_db:.1f} dB over the floor."
    return (
        f"Near harmonic {line.harmonic} a line stands beside its place: the speed may be off by little, "
        "and small errors smear all averages."
    )


def _where_instead(signals: Signals) -> tuple[str, ...]:
    """Say at which multiple of the stated speed the mesh lines do lie, if anywhere."""
    from gearsig.angle.tachless import comb_evidence

    stated = signals.frequency_per_order_hz * 60
    evidence = comb_evidence(signals.recording, signals.rig, stated)
    return (evidence,) if evidence else ()
