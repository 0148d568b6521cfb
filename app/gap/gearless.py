"""The gap of a rig with bearings and no gear pair: no simulator can be set to it, so only what stands out is named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from app.gap.gearless_causes import causes_of
from app.gap.prepare import Stage
from app.gap.standing_out import (
    LINE,
    PARTS,
    RACES,
    Examined,
    Standing,
    analysed,
    examined,
    shafts_of_unknown_speed,
    surest,
)
from app.gap.standing_places import NAN, standing_place
from gearsig.diagnosis.types import Kind
from gearsig.formatting import named
from gearsig.gap.curve_types import SpectrumCurves
from gearsig.gap.simulator import GapEffect, Point
from gearsig.gap.spots import band_words
from gearsig.gap.types import (
    ConditionFacts,
    GapReport,
    Interval,
    group_probabilities,
)
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from gearsig.spectra.floor import noise_floor

NOT_SIMULATED = (
    "The rig has no gear pair, so that no simulator could be set to it: nothing was simulated, and no effect of gears "
    "is weighed. How large the gap is, how severe its cause and how far it shrinks cannot be told; there is no twin. "
    "Damaged races of the bearings were looked for; unbalance, misalignment, clearance, drive and load were not."
)
HOW_SURE = (
    "The probabilities are not the calibrated ones of rigs with a gear pair. A race has the confidence of the bearing "
    "search: an upper limit, from how rarely noise makes such lines and how well other parts or a wrong speed explain "
    "them. What is left over is shared between unknown and none."
)
NO_REFERENCE = "No healthy reference: what stands out may have been there when the machine was sound."
N_SHOWN = 6.5
"""Multiples of the found order that a spectrum is shown for."""


def diagnose_gearless(
    recordings: Sequence[Recording],
    rigs: Sequence[Rig],
    references: Sequence[Recording],
    reference_rigs: Sequence[Rig],
    names: Sequence[str],
    reference_names: Sequence[str],
    effects: Mapping[str, GapEffect],
    tell: Stage,
) -> GapReport:
    """Name the damaged race, or say that it is unknown what stands out, or that nothing does.

    Parameters
    ----------
    recordings, rigs, references, reference_rigs, names, reference_names
        As of `app.gap.diagnose.diagnose_gap`.
    effects : mapping
        Those that may be named; of them only damaged races can be.
    tell : callable
        Is told what is being done, and which share of the whole is complete.

    Returns
    -------
    GapReport
        Without simulator, sizes, steps and twin.

    Raises
    ------
    RefusalError
        If there is no speed, no live channel, or too few revolutions.
    """
    tell("analysing the references", 0.05)
    healthy = [analysed(*one) for one in zip(references, reference_rigs, reference_names, strict=True)]
    every = []
    for i, (recording, rig) in enumerate(zip(recordings, rigs, strict=True)):
        name = names[i] if names else f"recording {i + 1}"
        tell(f"analysing {name}", 0.2 + 0.7 * i / len(recordings))
        every.append(examined(name, analysed(recording, rig, name), healthy))
    hint = () if references else (NO_REFERENCE,)
    standing = surest(every)
    causes, outcome = causes_of(standing, every, rigs[0], effects)
    return GapReport(
        rig=rigs[0].name,
        simulator="",
        conditions=tuple(_facts(one, rig) for one, rig in zip(every, rigs, strict=True)),
        references=tuple(reference_names) if any(e.reference for e in every) else (),
        outcome=outcome,
        size=Interval(NAN, NAN, NAN),
        repeatability=NAN,
        places=tuple(standing_place(one, rigs[0], name=one.recording if len(every) > 1 else "") for one in standing),
        causes=causes,
        groups=group_probabilities(causes),
        spectra=_spectra(standing, every),
        notices=(
            NOT_SIMULATED,
            HOW_SURE,
            *hint,
            *_loose_shafts(rigs[0]),
            *_limits(standing, every),
            *(text for one in every for text in one.notices),
        ),
    )


def _loose_shafts(rig: Rig) -> list[str]:
    """Say which shafts' orders, and those of their bearings, are not known."""
    loose = shafts_of_unknown_speed(rig)
    if not loose:
        return []
    remark = (
        f"The rig file does not tell the speed of {loose}, as it names no gear pair: what turns with it is taken for "
        "something strange, and its bearings were not looked for. Give the teeth of the pair."
    )
    return [remark]


def _limits(standing: Sequence[Standing], every: Sequence[Examined]) -> list[str]:
    """Say where several races, or several recordings, do not agree on one answer."""
    faults = [one for one in standing if one.finding.kind is Kind.FAULT]
    texts = []
    if len({one.finding.code for one in faults if one.finding.code in RACES}) > 1:
        texts.append("Both races stand out and may both be damaged: the probabilities, of one cause each, are shared.")
    for fault in faults:
        key = (fault.finding.code, fault.finding.where.bearing)
        others = [
            one.name for one in every if key not in [(s.finding.code, s.finding.where.bearing) for s in one.standing]
        ]
        if others:
            texts.append(
                f"{', '.join(others)}: no lines of the {PARTS[key[0]][0]} of {named('bearing', key[1])} stand out."
            )
    return texts


def _facts(one: Examined, rig: Rig) -> ConditionFacts:
    torque, recording = rig.nominal_torque_nm(), one.analysis.recording
    return ConditionFacts(
        one.name,
        Point(one.angle.mean_speed_rpm, NAN if torque is None else torque),
        one.angle.n_revolutions,
        recording.duration_s,
        recording.sampling_rate_hz,
    )


def _spectra(standing: Sequence[Standing], every: Sequence[Examined]) -> tuple[SpectrumCurves, ...]:
    """Return the envelope spectrum that shows the first family; of the first channel where there is none."""
    families = [one for one in standing if one.finding.code != LINE]
    name = families[0].recording if families else every[0].name
    channels = next(one for one in every if one.name == name).analysis.channels
    wanted = families[0].finding.where.channels if families else ()
    channel = next((c for c in channels if c.channel in wanted), channels[0])
    spectrum, band = channel.envelope_spectrum, channel.envelope_band_hz
    if spectrum is None or band is None:
        return ()
    highest = N_SHOWN * (families[0].finding.where.order or NAN) if families else NAN
    kept = spectrum.positions <= (highest if np.isfinite(highest) else spectrum.positions[-1])
    label = f"envelope of {channel.channel}, {band_words(band)}" + (f", {name}" if len(every) > 1 else "")
    nothing = np.zeros(0)
    return (
        SpectrumCurves(
            label,
            spectrum.unit,
            spectrum.positions[kept],
            spectrum.values[kept],
            nothing,
            nothing,
            noise_floor(spectrum).values[kept],
        ),
    )
