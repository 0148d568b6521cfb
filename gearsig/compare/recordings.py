"""A simulation beside a recording: the plain comparison, which names no cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gearsig.checks import one_of
from gearsig.compare.alignment import align
from gearsig.compare.averages import HalvedLines, halved_lines
from gearsig.compare.channels import check_live, pair_channels
from gearsig.compare.machine import common_machine, teeth_on, usable_speed
from gearsig.compare.one_channel import Material, compare_channel, halved_spectra
from gearsig.compare.remarks import remarks
from gearsig.compare.side import Side, make_side
from gearsig.compare.types import Alignment, Comparison, RecordFacts
from gearsig.compare.verdict import findings_of, verdict_of
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

MOST_REVOLUTIONS_PER_BLOCK = 64
"""Of the order spectra: lines 1/64 of an order apart tell slow shafts and bearings from the shaft's own orders."""

ALIGN = ("auto", "marks", "correlation")


def compare_recordings(
    simulated: Recording,
    recorded: Recording,
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
    simulated, recorded : Recording
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
    pairs = pair_channels(simulated, recorded, channels)
    check_live(simulated, [p.simulated for p in pairs], "simulation")
    check_live(recorded, [p.recorded for p in pairs], "recording")
    machine = common_machine(simulated, recorded, rig)
    ratios = _ratios(machine.recorded)
    own = make_side(
        simulated,
        np.stack([simulated.values(p.simulated) * p.factor for p in pairs]),
        [p.simulated for p in pairs],
        replace(machine.simulated, speed=usable_speed(machine.simulated, simulated)),
        machine.names,
        ratios,
        "simulation",
    )
    other = make_side(
        recorded,
        np.stack([recorded.values(p.recorded) for p in pairs]),
        [p.recorded for p in pairs],
        machine.recorded,
        {},
        ratios,
        "recording",
    )
    lines = _lines(own, other, ratios)
    alignments = tuple(_align(shaft, own, other, lines, machine.recorded, align_by) for shaft in lines)
    turned = {a.shaft: (lines[a.shaft][0].turned(a.shift_deg / 360.0), lines[a.shaft][1]) for a in alignments}
    reference = next(iter(ratios))
    material = Material(
        machine.recorded,
        reference,
        {shaft: ratios[shaft] for shaft in turned},
        turned,
        _block(own, other, reference),
        min(float(side.signals[reference][0].highest_order) for side in (own, other)),
    )
    spectra = tuple(halved_spectra(side.signals[reference], material) for side in (own, other))
    found = tuple(compare_channel(i, p, own, other, spectra, material) for i, p in enumerate(pairs))
    return Comparison(
        simulated=_facts(simulated, own),
        recorded=_facts(recorded, other),
        machine=machine.recorded.name,
        reference_shaft=reference,
        mesh_orders=tuple(m for p in machine.recorded.pairs if (m := machine.recorded.mesh_order(p)) is not None),
        highest_order=material.highest_order,
        alignments=alignments,
        channels=found,
        notes=(*machine.notes, *remarks(own, other, alignments, found, ratios)),
        verdict=verdict_of(found),
        findings=findings_of(found),
    )


def _ratios(rig: Rig) -> dict[str, float]:
    """Return revolutions of each shaft per revolution of the reference shaft, which comes first."""
    reference = rig.reference_shaft
    known = {name: ratio for name in rig.shaft_names if (ratio := rig.ratio(name)) is not None}
    return {reference: 1.0} | known


def _lines(own: Side, other: Side, ratios: Mapping[str, float]) -> dict[str, tuple[HalvedLines, HalvedLines]]:
    """Return the averages' lines of each shaft that both records know, up to the same order."""
    found = {}
    for shaft in ratios:
        if shaft in own.signals and shaft in other.signals:
            pair = tuple(halved_lines(side.signals[shaft]) for side in (own, other))
            highest = min(lines.first.shape[1] for lines in pair) - 1
            if highest >= 1:
                found[shaft] = (pair[0].up_to(highest), pair[1].up_to(highest))
    if next(iter(ratios)) not in found:
        raise RefusalError(
            "not even the first order of the reference shaft is within both sampling rates",
            remedy="check speed and sampling rates",
        )
    return found


def _align(
    shaft: str,
    own: Side,
    other: Side,
    lines: Mapping[str, tuple[HalvedLines, HalvedLines]],
    rig: Rig,
    align_by: str,
) -> Alignment:
    marked = shaft in own.marked and shaft in other.marked
    if align_by == "marks" and not any(s in own.marked and s in other.marked for s in lines):
        raise RefusalError(
            "no shaft has a mark (one tachometer pulse per revolution) in both records", remedy="align by correlation"
        )
    by_marks = marked and align_by != "correlation"
    return align(shaft, *lines[shaft], teeth_on(rig, shaft), by_marks=by_marks)


def _block(own: Side, other: Side, reference: str) -> int:
    """Revolutions per block of the order spectra: as many as the shortest half holds, at most 64."""
    shortest = min(
        half.samples.shape[1] // half.samples_per_revolution
        for side in (own, other)
        for half in side.signals[reference]
    )
    return int(min(shortest, MOST_REVOLUTIONS_PER_BLOCK))


def _facts(recording: Recording, side: Side) -> RecordFacts:
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
