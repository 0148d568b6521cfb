"""A simulation beside a recording: the plain comparison, which names no cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import AngleSignal
from gearsig.checks import FloatArray, one_of
from gearsig.comparison._averages import (
    HalvedLines,
    agreement,
    align,
    correlation,
    halved_lines,
    reliability,
    repeated,
    tooth_levels,
    waveform,
)
from gearsig.comparison._lines import (
    band_powers,
    line_levels,
    order_band_limits,
    order_bands,
    other_lines,
    third_octaves,
)
from gearsig.comparison._sides import (
    ChannelPair,
    ComparedSide,
    check_live,
    common_machine,
    make_side,
    pair_channels,
    teeth_on,
    time_halves,
    usable_speed,
)
from gearsig.comparison._types import (
    Alignment,
    ChannelComparison,
    Comparison,
    Locked,
    RecordFacts,
    Repeated,
    ShaftComparison,
    power_levels,
)
from gearsig.comparison._verdict import findings_of, notes_of, verdict_of
from gearsig.errors import RefusalError
from gearsig.orders import SynchronousAverage, order_spectrum
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.rig import Rig
from gearsig.spectra import Spectrum

# --------------------
# One channel of the simulation beside one of the recording.
# --------------------


ERROR_WINDOW_REV = 1.0 / 64.0
"""Angle over which the scatter of an average is taken from its two halves."""

HalvedSpectra = Mapping[str, tuple[Spectrum, Spectrum]]
"""Mean square per line over order, by channel: of the first and of the second half."""


@dataclass(frozen=True)
class ChannelContext:
    """What all channels share.

    Parameters
    ----------
    rig : Rig
    reference : str
    ratios : dict
        Shaft → revolutions per revolution of the reference shaft, which comes first.
    lines : dict
        Shaft → aligned lines of the simulation and of the recording.
    revolutions_per_block : int
    highest_order : float
    """

    rig: Rig
    reference: str
    ratios: dict[str, float]
    lines: dict[str, tuple[HalvedLines, HalvedLines]]
    revolutions_per_block: int
    highest_order: float

    @property
    def mesh(self) -> tuple[float | None, str]:
        """Order and name of the first pair whose teeth are known and whose mesh both records hold."""
        for pair in self.rig.pairs:
            order = self.rig.mesh_order(pair, self.reference)
            if order is not None and 1.5 * order <= self.highest_order:
                return order, pair.name if len(self.rig.pairs) > 1 else ""
        return None, ""


def halved_spectra(halves: tuple[AngleSignal, AngleSignal], material: ChannelContext) -> HalvedSpectra:
    """Return the order spectra of both halves, by channel, up to the order that both records hold."""
    spectra_of = {}
    for name in halves[0].channel_names:
        spectra = [
            order_spectrum(half, name, scaling="power", revolutions_per_block=material.revolutions_per_block)
            for half in halves
        ]
        n = int(material.highest_order * material.revolutions_per_block) + 1
        first, second = (replace(s, values=s.values[:n], positions=s.positions[:n]) for s in spectra)
        spectra_of[name] = (first, second)
    return spectra_of


def compare_channel(
    i: int,
    pair: ChannelPair,
    simulated_side: ComparedSide,
    recorded_side: ComparedSide,
    spectra: Sequence[HalvedSpectra],
    material: ChannelContext,
) -> ChannelComparison:
    """Compare one pair of channels, the i-th of both sides."""
    simulated, recorded = spectra[0][pair.simulated], spectra[1][pair.recorded]
    densities = [tuple(_density(half) for half in halves) for halves in (simulated, recorded)]
    mesh, mesh_name = material.mesh
    limits = order_band_limits(mesh, mesh_name, material.highest_order)
    whole = [(0.5, material.highest_order)]
    totals = [np.stack([band_powers(half, whole) for half in halves]) for halves in densities]
    averages = material.lines
    return ChannelComparison(
        simulated_name=pair.simulated,
        recorded_name=pair.recorded,
        quantity=pair.quantity,
        unit=pair.unit,
        levels_compare=pair.levels_compare,
        simulated_spectrum=_amplitudes(simulated, pair.simulated, pair.unit),
        recorded_spectrum=_amplitudes(recorded, pair.recorded, pair.unit),
        lines=line_levels(
            material.rig,
            material.reference,
            {shaft: lines[0] for shaft, lines in averages.items()},
            {shaft: lines[1] for shaft, lines in averages.items()},
            i,
        ),
        other_lines=other_lines(
            simulated, recorded, tuple(material.ratios.values()), _meshes(material), material.highest_order
        ),
        order_bands=order_bands(limits, densities[0], densities[1], averages[material.reference], i),
        third_octaves=third_octaves(
            time_halves(simulated_side.recording, i),
            simulated_side.recording.sampling_rate_hz,
            time_halves(recorded_side.recording, i),
            recorded_side.recording.sampling_rate_hz,
        ),
        shafts=tuple(_shaft(shaft, i, pair, material) for shaft in averages),
        overall=power_levels(totals[0], totals[1])[0],
        locked=Locked(*(_locked(side, i, totals[side][:, 0], material) for side in (0, 1))),
    )


def _meshes(material: ChannelContext) -> tuple[float, ...]:
    orders = (material.rig.mesh_order(pair, material.reference) for pair in material.rig.pairs)
    return tuple(order for order in orders if order is not None)


def _density(power: Spectrum) -> Spectrum:
    """Return mean squares per line as a density over order, whose integral is the mean square."""
    return replace(power, values=power.values / power.noise_bandwidth, scaling="power density")


def _amplitudes(halves: tuple[Spectrum, Spectrum], name: str, unit: str) -> Spectrum:
    mean = 0.5 * (halves[0].values + halves[1].values)
    return replace(halves[0], values=np.sqrt(mean), scaling="amplitude rms", unit=unit, source=name)


def _shaft(shaft: str, i: int, pair: ChannelPair, material: ChannelContext) -> ShaftComparison:
    simulated, recorded = material.lines[shaft]
    every = slice(1, simulated.first.shape[1])
    teeth = teeth_on(material.rig, shaft)
    n_angles = _n_angles(simulated.first.shape[1])
    resolved = teeth is not None and simulated.first.shape[1] > teeth
    return ShaftComparison(
        shaft=shaft,
        n_teeth=teeth,
        simulated=_average(simulated, i, n_angles, shaft, pair.simulated, pair.unit),
        recorded=_average(recorded, i, n_angles, shaft, pair.recorded, pair.unit),
        correlation=repeated(correlation, simulated, recorded, i, every),
        simulated_reliability=reliability(simulated, i),
        recorded_reliability=reliability(recorded, i),
        agreement=agreement(simulated, recorded, i, every),
        tooth_levels=tooth_levels(simulated, recorded, i, teeth, n_angles) if teeth is not None and resolved else (),
    )


def _n_angles(n_lines: int) -> int:
    """Angles of an average: enough for its highest order, and some more, so that its peaks are drawn as they are."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(max(4 * n_lines, 360), real=True) // 2 * 2)


def _average(lines: HalvedLines, i: int, n_angles: int, shaft: str, channel: str, unit: str) -> SynchronousAverage:
    difference = waveform(0.5 * (lines.first[i] - lines.second[i]), n_angles)
    return SynchronousAverage(
        values=waveform(lines.whole[i], n_angles),
        standard_error=_running_rms(difference, max(1, round(ERROR_WINDOW_REV * n_angles))),
        n_revolutions=lines.n_revolutions,
        shaft=shaft,
        channel=channel,
        unit=unit,
        kind="average",
        highest_order=float(lines.first.shape[1] - 1),
    )


def _running_rms(values: FloatArray, n: int) -> FloatArray:
    """Rms over n neighbours around the circle."""
    around = np.concatenate([values[-n:], values, values[:n]]) ** 2
    smooth = np.convolve(around, np.ones(n) / n, mode="same")[n : n + len(values)]
    result: FloatArray = np.sqrt(np.maximum(smooth, 0.0))
    return result


def _locked(side: int, i: int, totals: FloatArray, material: ChannelContext) -> Repeated:
    """Return the share of energy that both halves have in common, line by line: Σ Re(a b*) over the mean square.

    The noise of one half has nothing to do with that of the other, and adds nothing. An order of several shafts
    counts once.
    """
    counted: set[float] = set()
    powers = np.zeros(3)
    for shaft, pair in material.lines.items():
        lines, ratio = pair[side], material.ratios[shaft]
        n = np.arange(1, lines.first.shape[1])
        orders = np.round(n * ratio, 6)
        fresh = n[[order not in counted and order <= material.highest_order for order in orders]]
        counted |= set(orders.tolist())
        a, b = lines.first[i, fresh], lines.second[i, fresh]
        powers += [np.sum(np.real(a * np.conj(b))), np.sum(np.abs(a) ** 2), np.sum(np.abs(b) ** 2)]
    mean = float(totals.mean())
    if mean <= 0:
        return Repeated(0.0, 0.0)
    shares = np.clip(powers[1:] / np.maximum(totals, 1e-300), 0.0, 1.0)
    return Repeated(float(np.clip(powers[0] / mean, 0.0, 1.0)), float(abs(shares[0] - shares[1])) / 2.0)


MAX_REVOLUTIONS_PER_BLOCK = 64
"""Of the order spectra: lines 1/64 of an order apart tell slow shafts and bearings from the shaft's own orders."""

ALIGN = ("auto", "marks", "correlation")


def compare(
    simulated: Recording | PreparedRecording,
    recorded: Recording | PreparedRecording,
    rig: Rig | None = None,
    *,
    channels: Sequence[tuple[str, str]] = (),
    align_by: str = "auto",
) -> Comparison:
    """Compare a simulation with a recording by order, band and angle, without looking for the cause of what differs.

    Both are sampled over the angle of each shaft, so that they may differ in speed, sampling rate and length. Each
    figure comes with its repeatability, from both halves of either record: what is smaller is noise.

    Parameters
    ----------
    simulated, recorded : Recording or PreparedRecording
        With at least 8 revolutions of the reference shaft each. Two recordings, or two simulations, will do as well.
    rig : Rig or None
        The machine; default: the recording's own, else the simulation's.
    channels : sequence of (str, str)
        (simulated, recorded) names; default: equal names, or the only vibration channel of each.
    align_by : str
        "marks": angle 0 is the same tooth in both; "correlation": the simulation's averages are turned to where they
        fit best; "auto": by marks for shafts that have one in both records.

    Returns
    -------
    Comparison
        Levels in dB re one unit (rms).

    Raises
    ------
    InputError
        If the channels cannot be paired, measure different things, or the gears differ.
    RefusalError
        If a channel is dead, a speed cannot be known, a record is too short, or marks are asked for where there are
        none.

    Notes
    -----
    Not a diagnosis: a difference has a size here, but no cause. Levels by frequency (third octaves) of records at
    different speeds are levels of different orders; compare by order then.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions", 1996.
    """
    one_of(align_by, "align_by", ALIGN)
    sides = prepare(simulated), prepare(recorded)
    simulated, recorded = (side.recording for side in sides)
    pairs = pair_channels(simulated, recorded, channels)
    check_live(simulated, [p.simulated for p in pairs], "simulation")
    check_live(recorded, [p.recorded for p in pairs], "recording")
    machine = common_machine(simulated, recorded, rig)
    ratios = _ratios(machine.recorded)
    simulated_rig = replace(machine.simulated, speed=usable_speed(machine.simulated, simulated))
    simulated_side = make_side(
        sides[0].with_rig(simulated_rig), {p.simulated: p.factor for p in pairs}, machine.names, ratios, "simulation"
    )
    recorded_side = make_side(
        sides[1].with_rig(machine.recorded), {p.recorded: 1.0 for p in pairs}, {}, ratios, "recording"
    )
    lines = _lines(simulated_side, recorded_side, ratios)
    alignments = tuple(
        _align(shaft, simulated_side, recorded_side, lines, machine.recorded, align_by) for shaft in lines
    )
    turned = {a.shaft: (lines[a.shaft][0].turned(a.shift_deg / 360.0), lines[a.shaft][1]) for a in alignments}
    reference = next(iter(ratios))
    material = ChannelContext(
        machine.recorded,
        reference,
        {shaft: ratios[shaft] for shaft in turned},
        turned,
        _block(simulated_side, recorded_side, reference),
        min(float(side.signals[reference][0].highest_order) for side in (simulated_side, recorded_side)),
    )
    spectra = tuple(halved_spectra(side.signals[reference], material) for side in (simulated_side, recorded_side))
    compared = tuple(
        compare_channel(i, p, simulated_side, recorded_side, spectra, material) for i, p in enumerate(pairs)
    )
    return Comparison(
        simulated=_facts(simulated, simulated_side),
        recorded=_facts(recorded, recorded_side),
        machine=machine.recorded.name,
        reference_shaft=reference,
        mesh_orders=tuple(m for p in machine.recorded.pairs if (m := machine.recorded.mesh_order(p)) is not None),
        highest_order=material.highest_order,
        alignments=alignments,
        channels=compared,
        notes=(*machine.notes, *notes_of(simulated_side, recorded_side, alignments, compared, ratios)),
        verdict=verdict_of(compared),
        findings=findings_of(compared),
    )


def _ratios(rig: Rig) -> dict[str, float]:
    """Return revolutions of each shaft per revolution of the reference shaft, which comes first."""
    reference = rig.reference_shaft
    known = {name: ratio for name in rig.shaft_names if (ratio := rig.ratio(name)) is not None}
    return {reference: 1.0} | known


def _lines(
    simulated_side: ComparedSide, recorded_side: ComparedSide, ratios: Mapping[str, float]
) -> dict[str, tuple[HalvedLines, HalvedLines]]:
    """Return the averages' lines of each shaft that both records know, up to the same order."""
    lines_of = {}
    for shaft in ratios:
        if shaft in simulated_side.signals and shaft in recorded_side.signals:
            pair = tuple(halved_lines(side.signals[shaft]) for side in (simulated_side, recorded_side))
            highest = min(lines.first.shape[1] for lines in pair) - 1
            if highest >= 1:
                lines_of[shaft] = (pair[0].up_to(highest), pair[1].up_to(highest))
    if next(iter(ratios)) not in lines_of:
        raise RefusalError(
            "not even the first order of the reference shaft is within both sampling rates",
            remedy="check speed and sampling rates",
        )
    return lines_of


def _align(
    shaft: str,
    simulated_side: ComparedSide,
    recorded_side: ComparedSide,
    lines: Mapping[str, tuple[HalvedLines, HalvedLines]],
    rig: Rig,
    align_by: str,
) -> Alignment:
    marked = shaft in simulated_side.marked and shaft in recorded_side.marked
    if align_by == "marks" and not any(s in simulated_side.marked and s in recorded_side.marked for s in lines):
        raise RefusalError(
            "no shaft has a mark (one tachometer pulse per revolution) in both records", remedy="align by correlation"
        )
    by_marks = marked and align_by != "correlation"
    return align(shaft, *lines[shaft], teeth_on(rig, shaft), by_marks=by_marks)


def _block(simulated_side: ComparedSide, recorded_side: ComparedSide, reference: str) -> int:
    """Revolutions per block of the order spectra: as many as the shortest half holds, at most 64."""
    shortest = min(
        half.samples.shape[1] // half.samples_per_revolution
        for side in (simulated_side, recorded_side)
        for half in side.signals[reference]
    )
    return int(min(shortest, MAX_REVOLUTIONS_PER_BLOCK))


def _facts(recording: Recording, side: ComparedSide) -> RecordFacts:
    angle, provenance = side.angle, recording.provenance
    return RecordFacts(
        source=provenance.source or "made in memory",
        sha256=provenance.sha256,
        duration_s=recording.duration_s,
        sampling_rate_hz=recording.sampling_rate_hz,
        mean_speed_rpm=angle.mean_speed_rpm,
        speed_range_rpm=angle.speed_range_rpm,
        n_revolutions=angle.n_revolutions,
        speed_method=angle.method,
        notes=(*recording.warnings, *angle.notes),
    )
