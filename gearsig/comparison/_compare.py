"""A simulation compared with a recording, without identifying causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, one_of
from gearsig.comparison._lines import (
    HalvedLines,
    agreement,
    align,
    band_powers,
    correlation,
    halved_lines,
    line_levels,
    order_band_limits,
    order_bands,
    other_lines,
    reliability,
    repeated,
    third_octaves,
    tooth_levels,
    waveform,
)
from gearsig.comparison._sides import (
    ChannelPair,
    ComparedSide,
    check_live,
    common_machine,
    make_side,
    pair_channels,
    time_halves,
    usable_speed,
)
from gearsig.comparison._types import (
    ChannelComparison,
    Comparison,
    Locked,
    RecordFacts,
    RepeatableValue,
    ShaftComparison,
    power_levels,
)
from gearsig.comparison._verdict import findings_of, notes_of, verdict_of
from gearsig.errors import RefusalError
from gearsig.orders import SynchronousAverage, order_spectrum
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import Rig, check_rig
from gearsig.spectra import Spectrum

Sides = tuple[ComparedSide, ComparedSide]
"""Simulation and recording."""
HalvedSpectra = Mapping[str, tuple[Spectrum, Spectrum]]
"""Mean square per line over order, by channel: of the first and of the second half."""


@dataclass(frozen=True)
class _Shared:
    """What all channels share; pairs and lists are ordered simulation, recording."""

    rig: Rig
    ratios: dict[str, float]
    sides: Sides
    lines: dict[str, tuple[HalvedLines, HalvedLines]]
    spectra: list[HalvedSpectra]
    highest_order: float

    @property
    def mesh_orders(self) -> tuple[float, ...]:
        """Of the pairs whose teeth are known."""
        orders = (self.rig.mesh_order(pair, next(iter(self.ratios))) for pair in self.rig.pairs)
        return tuple(order for order in orders if order is not None)


ALIGN = ("auto", "marks", "correlation")


def compare(
    simulated: Recording | PreparedRecording,
    recorded: Recording | PreparedRecording,
    rig: Rig | None = None,
    *,
    channels: Sequence[tuple[str, str]] = (),
    align_by: str = "auto",
) -> Comparison:
    """Compare a simulation with a recording by order, band and angle, without looking for causes of differences.

    Both are sampled over the angle of each shaft, so they may differ in speed, sampling rate and length. Each figure
    comes with its repeatability, from the two halves of each record: smaller differences are noise.

    Parameters
    ----------
    simulated, recorded : Recording or PreparedRecording
        Each with at least 8 revolutions of the reference shaft. Two recordings, or two simulations, work as well.
    rig : Rig or None
        The machine; default: the recording's, else the simulation's.
    channels : sequence of (str, str)
        (simulated, recorded) names; default: equal names, or the only vibration channel of each.
    align_by : str
        "marks": angle 0 is the same tooth in both; "correlation": the simulation's averages are turned to the best fit;
        "auto": by marks for shafts that have one in both records.

    Returns
    -------
    Comparison
        Levels in dB re one unit (rms).

    Raises
    ------
    InputError
        If the channels cannot be paired, measure different quantities, or the gears differ.
    RefusalError
        If a channel is dead, a speed cannot be determined, a record is too short, or marks are requested but missing.

    Notes
    -----
    This is not a diagnosis: differences have a size, but no cause. At different speeds, levels by frequency (third
    octaves) are levels of different orders; compare by order then.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions", 1996.
    """
    one_of(align_by, "align_by", ALIGN)
    prepared = prepare(simulated, name="simulated"), prepare(recorded, name="recorded")
    check_rig(rig)
    simulated, recorded = (side.recording for side in prepared)
    pairs = pair_channels(simulated, recorded, channels)
    problems = (
        *check_live(prepared[0], [p.simulated for p in pairs], "simulation"),
        *check_live(prepared[1], [p.recorded for p in pairs], "recording"),
    )
    simulated_rig, rig, names, machine_notes = common_machine(simulated, recorded, rig)
    reference = rig.reference_shaft
    # Revolutions of each shaft per revolution of the reference shaft, which comes first.
    ratios = {reference: 1.0} | {name: ratio for name in rig.shaft_names if (ratio := rig.ratio(name)) is not None}
    simulated_rig = replace(simulated_rig, speed=usable_speed(simulated_rig, simulated))
    factors = {p.simulated: p.factor for p in pairs}
    sides = (
        make_side(prepared[0].with_rig(simulated_rig), factors, names, ratios, "simulation"),
        make_side(prepared[1].with_rig(rig), {p.recorded: 1.0 for p in pairs}, {}, ratios, "recording"),
    )
    lines = _common_lines(sides, ratios)
    marked = sides[0].marked & sides[1].marked & set(lines)
    if align_by == "marks" and not marked:
        raise RefusalError(
            "no shaft has a mark (one tachometer pulse per revolution) in both records", remedy="align by correlation"
        )
    alignments = tuple(
        align(shaft, *pair, rig.teeth_on(shaft), by_marks=shaft in marked and align_by != "correlation")
        for shaft, pair in lines.items()
    )
    turned = {a.shaft: (lines[a.shaft][0].turned(a.shift_deg / 360.0), lines[a.shaft][1]) for a in alignments}
    halves = [side.signals[reference] for side in sides]
    highest = min(float(first.highest_order) for first, _ in halves)
    shared = _Shared(
        rig, {shaft: ratios[shaft] for shaft in turned}, sides, turned, _order_spectra(halves, highest), highest
    )
    compared = tuple(_compare_channel(shared, i, pair) for i, pair in enumerate(pairs))
    return Comparison(
        simulated=_facts(simulated, sides[0].angle),
        recorded=_facts(recorded, sides[1].angle),
        machine=rig.name,
        reference_shaft=reference,
        mesh_orders=shared.mesh_orders,
        highest_order=highest,
        alignments=alignments,
        channels=compared,
        notes=(*machine_notes, *problems, *notes_of(*sides, alignments, compared, ratios)),
        verdict=verdict_of(compared, alignments),
        findings=findings_of(compared),
    )


def _common_lines(sides: Sides, ratios: Mapping[str, float]) -> dict[str, tuple[HalvedLines, HalvedLines]]:
    """Return the averages' lines of each shaft that both records know, up to the same order."""
    result = {}
    for shaft in ratios:
        if all(shaft in side.signals for side in sides):
            simulated, recorded = (halved_lines(side.signals[shaft]) for side in sides)
            highest = min(simulated.first.shape[1], recorded.first.shape[1]) - 1
            if highest >= 1:
                result[shaft] = (simulated.up_to(highest), recorded.up_to(highest))
    if next(iter(ratios)) not in result:
        raise RefusalError(
            "not even the first order of the reference shaft is within both sampling rates",
            remedy="check speed and sampling rates",
        )
    return result


def _order_spectra(halves: Sequence[tuple[AngleSignal, AngleSignal]], highest: float) -> list[HalvedSpectra]:
    """Return the order spectra of the halves of both sides, by channel, from blocks of equally many revolutions."""
    # As many as the shortest half holds; lines 1/64 of an order apart separate slow shafts from the shaft's own orders.
    block = int(min(64, *(half.samples.shape[1] // half.samples_per_revolution for pair in halves for half in pair)))
    n = int(highest * block) + 1

    def spectrum(half: AngleSignal, name: str) -> Spectrum:
        return order_spectrum(half, name, scaling="power", revolutions_per_block=block).head(n)

    return [
        {name: (spectrum(first, name), spectrum(second, name)) for name in first.channel_names}
        for first, second in halves
    ]


def _facts(recording: Recording, angle: ShaftAngle) -> RecordFacts:
    return RecordFacts(
        source=recording.provenance.source or "made in memory",
        sha256=recording.provenance.sha256,
        duration_s=recording.duration_s,
        sampling_rate_hz=recording.sampling_rate_hz,
        mean_speed_rpm=angle.mean_speed_rpm,
        speed_range_rpm=angle.speed_range_rpm,
        n_revolutions=angle.n_revolutions,
        speed_method=angle.method,
        notes=(*recording.warnings, *angle.notes),
    )


def _compare_channel(shared: _Shared, i: int, pair: ChannelPair) -> ChannelComparison:
    """Compare one pair of channels, the i-th of both sides."""
    rig, reference, highest = shared.rig, next(iter(shared.ratios)), shared.highest_order
    simulated, recorded = shared.spectra[0][pair.simulated], shared.spectra[1][pair.recorded]
    # Mean squares per line as a density over order, whose integral is the mean square.
    densities = [
        [replace(half, values=half.values / half.noise_bandwidth, scaling="power density") for half in halves]
        for halves in (simulated, recorded)
    ]
    totals = [np.stack([band_powers(half, [(0.5, highest)]) for half in halves]) for halves in densities]
    meshes = ((rig.mesh_order(p, reference), p.name if len(rig.pairs) > 1 else "") for p in rig.pairs)
    mesh, name = next((m for m in meshes if m[0] is not None and 1.5 * m[0] <= highest), (None, ""))
    limits = order_band_limits(mesh, name, highest)
    third = [(time_halves(side.recording, i), side.recording.sampling_rate_hz) for side in shared.sides]
    return ChannelComparison(
        simulated_name=pair.simulated,
        recorded_name=pair.recorded,
        quantity=pair.quantity,
        unit=pair.unit,
        levels_compare=pair.levels_compare,
        simulated_spectrum=_amplitudes(simulated, pair.simulated, pair.unit),
        recorded_spectrum=_amplitudes(recorded, pair.recorded, pair.unit),
        lines=line_levels(rig, reference, shared.lines, i),
        other_lines=other_lines(simulated, recorded, tuple(shared.ratios.values()), shared.mesh_orders, highest),
        order_bands=order_bands(limits, densities[0], densities[1], shared.lines[reference], i),
        third_octaves=third_octaves(*third[0], *third[1]),
        shafts=tuple(_compare_shaft(rig, shaft, i, pair, lines) for shaft, lines in shared.lines.items()),
        overall=power_levels(totals[0], totals[1])[0],
        locked=Locked(*(_coherent_share(shared, side, i, totals[side][:, 0]) for side in (0, 1))),
    )


def _amplitudes(halves: tuple[Spectrum, Spectrum], name: str, unit: str) -> Spectrum:
    mean = 0.5 * (halves[0].values + halves[1].values)
    return replace(halves[0], values=np.sqrt(mean), scaling="amplitude rms", unit=unit, source=name)


def _compare_shaft(
    rig: Rig, shaft: str, i: int, pair: ChannelPair, lines: tuple[HalvedLines, HalvedLines]
) -> ShaftComparison:
    simulated, recorded = lines
    n_lines, teeth = simulated.first.shape[1], rig.teeth_on(shaft)
    every = slice(1, n_lines)
    # Enough angles for the highest order, and some more, so that the average's peaks are drawn correctly.
    n_angles = int(next_fast_len(max(4 * n_lines, 360), real=True) // 2 * 2)
    return ShaftComparison(
        shaft=shaft,
        n_teeth=teeth,
        simulated=_average(simulated, i, n_angles, shaft, pair.simulated, pair.unit),
        recorded=_average(recorded, i, n_angles, shaft, pair.recorded, pair.unit),
        correlation=repeated(correlation, simulated, recorded, i, every),
        simulated_reliability=reliability(simulated, i),
        recorded_reliability=reliability(recorded, i),
        agreement=agreement(simulated, recorded, i, every),
        tooth_levels=tooth_levels(simulated, recorded, i, teeth, n_angles) if teeth and n_lines > teeth else (),
    )


def _average(lines: HalvedLines, i: int, n_angles: int, shaft: str, channel: str, unit: str) -> SynchronousAverage:
    difference = waveform(0.5 * (lines.first[i] - lines.second[i]), n_angles)
    n = max(1, round(n_angles / 64.0))  # the scatter is taken over 1/64 of a revolution
    around = np.concatenate([difference[-n:], difference, difference[:n]]) ** 2
    power = np.convolve(around, np.ones(n) / n, mode="same")[n : n + n_angles]
    return SynchronousAverage(
        values=waveform(lines.whole[i], n_angles),
        standard_error=np.sqrt(np.maximum(power, 0.0)),
        n_revolutions=lines.n_revolutions,
        shaft=shaft,
        channel=channel,
        unit=unit,
        kind="average",
        highest_order=float(lines.first.shape[1] - 1),
    )


def _coherent_share(shared: _Shared, side: int, i: int, totals: FloatArray) -> RepeatableValue:
    """Return the share of energy common to both halves, line by line: Σ Re(a b*) over the mean square.

    The noise of one half is independent of the other's, and adds nothing. An order shared by several shafts counts
    once.
    """
    counted: set[float] = set()
    powers = np.zeros(3)
    for shaft, pair in shared.lines.items():
        n = np.arange(1, pair[side].first.shape[1])
        orders = np.round(n * shared.ratios[shaft], 6)
        fresh = n[[order not in counted and order <= shared.highest_order for order in orders]]
        counted |= set(orders.tolist())
        a, b = pair[side].first[i, fresh], pair[side].second[i, fresh]
        powers += [np.sum(np.real(a * np.conj(b))), np.sum(np.abs(a) ** 2), np.sum(np.abs(b) ** 2)]
    mean = float(totals.mean())
    if mean <= 0:
        return RepeatableValue(0.0, 0.0)
    shares = np.clip(powers[1:] / np.maximum(totals, 1e-300), 0.0, 1.0)
    return RepeatableValue(float(np.clip(powers[0] / mean, 0.0, 1.0)), float(abs(shares[0] - shares[1])) / 2.0)
