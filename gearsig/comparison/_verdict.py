"""What a comparison comes to, in a few sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearsig.comparison._differences import (
    BETTER_TURNED,
    MIN_REPEATED,
    WITHIN_DB,
    common_gain_db,
    comparable_averages,
    differing_average,
    differing_lines,
    differing_tooth,
    further_lines,
    is_hidden,
    mesh_lines,
    power_difference,
)
from gearsig.comparison._sides import MIN_REVOLUTIONS, ComparedSide
from gearsig.comparison._types import BEYOND, Alignment, ChannelComparison, LineLevel
from gearsig.formatting import counted, enumerated, percent, plus_minus, signed, with_minus

_WHERE = {"mesh": "mesh harmonics", "shaft": "shaft orders"}


def missing_words(line: LineLevel) -> str:
    """Say which record lacks a line, or would hide it in its own scatter; empty where both show it.

    The level of a line that is not seen is that of the noise: where that is no lower, the line may well be there.
    """
    if line.simulated_is_seen and line.recorded_is_seen:
        return ""
    record = "recording" if line.simulated_is_seen else "simulation"
    return f"hidden by the {record}'s scatter" if is_hidden(line) else f"not in the {record}"


def verdict_of(channels: Sequence[ChannelComparison], alignments: Sequence[Alignment]) -> str:
    """Return per channel what differs most beyond scatter, the largest first.

    One sentence is on the mesh harmonics, or else the shaft orders; one on the line or the tooth beside them that
    differs most, or on the averages' correlation, where one does. Of both the first is on the larger difference of
    power, unless what the mesh harmonics differ by is called agreement.
    """
    return " ".join(_headline(channel, channels) + _verdict_text(channel, alignments) for channel in channels)


def findings_of(channels: Sequence[ChannelComparison]) -> tuple[str, ...]:
    """Return sentences on the lines that only one side has, the averages' shapes, and the energy that is locked."""
    texts = []
    for channel in channels:
        if mesh_lines(channel):
            texts += [
                _headline(channel, channels) + text for text in (*_missing_texts(channel), *_shape_texts(channel))
            ]
    return tuple(texts)


def _headline(channel: ChannelComparison, channels: Sequence[ChannelComparison]) -> str:
    return f"{channel.name}: " if len(channels) > 1 else ""


def _verdict_text(channel: ChannelComparison, alignments: Sequence[Alignment]) -> str:
    elsewhere, power = _elsewhere_text(channel, alignments)
    if not elsewhere:
        return _levels_text(channel, alignments)
    texts = elsewhere, _levels_text(channel)
    gain_db = 0.0 if channel.levels_compare else common_gain_db(channel)
    apart = (
        line.level
        for line in mesh_lines(channel)
        if line.level.is_beyond and abs(line.level.difference_db - gain_db) > WITHIN_DB
    )
    mesh_first = max((power_difference(level, gain_db) for level in apart), default=0.0) > power
    return " ".join(reversed(texts) if mesh_first else texts)


def _elsewhere_text(channel: ChannelComparison, alignments: Sequence[Alignment]) -> tuple[str, float]:
    """Return a sentence on what differs most beside the mesh harmonics, and its power; empty where nothing does."""
    tooth = differing_tooth(channel, alignments)
    lines, gain_db = differing_lines(channel), common_gain_db(channel)
    line_powers = [power_difference(line.level, gain_db) for line in lines]
    if tooth is not None and tooth.power >= max(line_powers, default=0.0):
        off = plus_minus(abs(tooth.off_db), BEYOND * tooth.level.repeatability_db)
        others = " against the other teeth" if tooth.is_beside_others else ""
        where = f"at {tooth.place}, where the simulation is too {_word(tooth.off_db)} by {off} dB{others}"
        return f"The averages over angle differ most {where}.", tooth.power
    if lines:
        return f"{_most_text(channel, lines[0], gain_db)}.", line_powers[0]
    average = differing_average(channel)
    if average is None:
        return "", 0.0
    of = f" of {average.shaft}" if average.shaft else ""
    figure = plus_minus(average.correlation.value, BEYOND * average.correlation.repeatability, 3)
    possible = f"{average.best_correlation:.3f} is possible"
    return f"The synchronous averages{of} differ: their correlation is {figure} where {possible}.", 0.0


def _most_text(channel: ChannelComparison, line: LineLevel, gain_db: float) -> str:
    beside = next((f"Beside the {_WHERE[main.kind]}, " for main in mesh_lines(channel)), "")
    off_db, scatter = line.level.difference_db - gain_db, BEYOND * line.level.repeatability_db
    after = f" after a common gain of {signed(-gain_db)} dB" if gain_db else ""
    if words := missing_words(line):
        text = f"{line.label} differs most{after}: it is {words}, by {abs(off_db):.1f} dB or more"
    else:
        by = plus_minus(abs(off_db), scatter)
        text = f"{line.label} differs most{after}: there the simulation is too {_word(off_db)} by {by} dB"
    return f"{beside}{text}" if beside else f"{text[:1].upper()}{text[1:]}"


def _word(off_db: float) -> str:
    return "weak" if off_db < 0 else "strong"


def _levels_text(channel: ChannelComparison, alignments: Sequence[Alignment] | None = None) -> str:
    """Say how far the mesh harmonics are apart; with alignments also that nothing else is, where nothing is at all."""
    lines = mesh_lines(channel)
    if not lines:
        return "No line of the recording stands above its own noise: only the floors can be compared."
    where = _WHERE[lines[0].kind]
    comparable = [line for line in lines if line.simulated_is_seen or not is_hidden(line)]
    hidden = len(lines) - len(comparable)
    if not comparable:
        return f"The simulation's own scatter hides all {where} of the recording: they cannot be compared."
    further = () if alignments is None else _further_places(channel, alignments)
    text = _lines_text(comparable, where, further, levels_compare=channel.levels_compare)
    return f"{text} {hidden} more are hidden by the simulation's own scatter." if hidden else text


def _further_places(channel: ChannelComparison, alignments: Sequence[Alignment]) -> tuple[str, ...]:
    """Name what was compared besides the mesh harmonics."""
    n = len(further_lines(channel))
    by_tooth = any(shaft.tooth_levels for shaft in comparable_averages(channel, alignments))
    return (*((f"{counted(n, 'other line')}",) if n else ()), *(("tooth by tooth",) if by_tooth else ()))


def _lines_text(lines: Sequence[LineLevel], where: str, further: Sequence[str] = (), *, levels_compare: bool) -> str:
    differences = np.array([line.level.difference_db for line in lines])
    gain = float(np.median(differences))
    n = f"{len(lines)} {where}" if len(lines) > 1 else f"one {where[:-1]}"
    worst = lines[int(np.argmax(np.abs(differences - (gain if not levels_compare else 0.0))))]
    if not levels_compare:
        spread = float(np.max(np.abs(differences - gain)))
        verb = "agree within" if spread <= WITHIN_DB else "differ by up to"
        return (
            f"The unit of one side is not known; after a common gain of {signed(-gain)} dB, simulation and recording "
            f"{verb} {spread:.1f} dB at {n}{_line_text(worst, gain) if spread > WITHIN_DB else ''}."
        )
    largest = float(np.max(np.abs(differences)))
    if not any(line.level.is_beyond for line in lines):
        where = enumerated([n, *further])
        return f"At {where}, simulation and recording do not differ by more than the records' own scatter."
    if largest <= WITHIN_DB:
        return f"Simulation and recording agree within {largest:.1f} dB at {n}."
    spread = float(np.max(np.abs(differences - gain)))
    text = f"Simulation and recording differ by up to {largest:.1f} dB at {n}{_line_text(worst, 0.0)}"
    # A common gain beyond 3 dB is named on its own: it is the path's or the sensor's, not the gears'.
    if len(lines) > 1 and abs(gain) > 3.0 and spread < largest:
        text += f"; a common gain of {signed(-gain)} dB would bring them within {spread:.1f} dB"
    return f"{text}."


def _line_text(line: LineLevel, gain: float) -> str:
    off = line.level.difference_db - gain
    return f", most at {line.label}, where the simulation is too {_word(off)}"


def _missing_texts(channel: ChannelComparison) -> list[str]:
    """Name the strongest lines that only one of the two shows."""
    texts = []
    for seen_field, lacking_field, words in (
        ("recorded_is_seen", "simulated_is_seen", "The simulation lacks"),
        ("simulated_is_seen", "recorded_is_seen", "Only the simulation has"),
    ):
        missing = [
            line
            for line in (*channel.lines, *channel.other_lines)
            if getattr(line, seen_field) and not getattr(line, lacking_field) and not is_hidden(line)
        ]
        side = "recorded_db" if seen_field.startswith("recorded") else "simulated_db"
        strongest = max(getattr(line.level, side) for line in (*channel.lines, *channel.other_lines))
        # A line that one record lacks is named if it is within 40 dB of the other's strongest.
        missing = [line for line in missing if getattr(line.level, side) > strongest - 40.0]
        missing.sort(key=lambda line: -float(getattr(line.level, side)))
        if missing:
            texts.append(f"{words} {', '.join(line.label for line in missing[:3])}{_more(len(missing) - 3)}.")
    return texts


def _more(n: int) -> str:
    return f" and {n} more lines" if n > 1 else " and one more line" if n == 1 else ""


def _shape_texts(channel: ChannelComparison) -> list[str]:
    parts, loose = [], []
    for shaft in channel.shafts:
        name = f" of {shaft.shaft}" if shaft.shaft else ""
        if shaft.best_correlation < MIN_REPEATED:
            loose.append(name)
        else:
            figure = plus_minus(shaft.correlation.value, BEYOND * shaft.correlation.repeatability, 3)
            parts.append(f"{figure}{name and f' for {shaft.shaft}'} ({shaft.best_correlation:.3f} is possible)")
    texts = [f"The correlation of the synchronous averages is {enumerated(parts)}."] if parts else []
    if loose:
        texts.append(
            f"How alike the synchronous averages{' and'.join(loose)} are cannot be told: in one of the records "
            "the halves do not repeat each other."
        )
    locked = channel.locked
    return [
        *texts,
        (
            f"{percent(locked.recorded.value)} of the recording's energy repeats with the shafts' revolutions, "
            f"{percent(locked.simulated.value)} of the simulation's."
        ),
    ]


SAME_SPEED, OTHER_SPEED = 0.03, 0.10
"""Relative differences of speed: not worth a word; and so large that resonances meet other orders."""

STEADY = 0.03
"""Relative range of speed within one record up to which one average stands for all of it."""


def notes_of(
    simulated_side: ComparedSide,
    recorded_side: ComparedSide,
    alignments: Sequence[Alignment],
    channels: Sequence[ChannelComparison],
    ratios: Mapping[str, float],
) -> tuple[str, ...]:
    """Return remarks on speeds, shafts left out, alignment and units."""
    texts = _speed_texts(simulated_side, recorded_side)
    left_out = [shaft for shaft in ratios if shaft not in {a.shaft for a in alignments}]
    if left_out:
        texts.append(
            f"Shaft {', '.join(left_out)} makes fewer than {MIN_REVOLUTIONS} revolutions in one of the records: its "
            "average and its lines are left out."
        )
    comparable = {s.shaft for channel in channels for s in channel.shafts if s.best_correlation >= MIN_REPEATED}
    texts += _alignment_texts([alignment for alignment in alignments if alignment.shaft in comparable])
    unknown = [channel.name for channel in channels if not channel.levels_compare]
    if unknown:
        texts.append(
            f"The unit of {', '.join(unknown)} is not known on one side: compare shapes and differences of levels "
            "between lines, not levels."
        )
    return tuple(texts)


def _speed_texts(simulated_side: ComparedSide, recorded_side: ComparedSide) -> list[str]:
    """Return one text on both speeds: a run-up has no speed of its own that could be compared with another."""
    if not (simulated_side.angle.is_steady(STEADY) and recorded_side.angle.is_steady(STEADY)):
        unsteady = [
            name
            for side, name in ((simulated_side, "simulation"), (recorded_side, "recording"))
            if not side.angle.is_steady(STEADY)
        ]
        text = (
            f"{_speed_words(simulated_side, 'The simulation')}, {_speed_words(recorded_side, 'the recording')}: levels "
            "of the "
            f"{' and of the '.join(unsteady)} are means over all speeds. At each of them orders meet other resonances, "
            "and an average need not repeat: parts at one speed compare better."
        )
        return [text]
    simulated, recorded = simulated_side.angle.mean_speed_rpm, recorded_side.angle.mean_speed_rpm
    off = simulated / recorded - 1.0
    if abs(off) > OTHER_SPEED:
        text = (
            f"The simulation turns at {simulated:.5g} rpm, the recording at {recorded:.5g} rpm "
            f"({signed(100 * off, 0)} %): orders are compared all the same, but each meets other resonances, "
            "and forces change with the speed."
        )
        return [text]
    if abs(off) > SAME_SPEED:
        text = (
            f"The simulation turns {abs(100 * off):.1f} % {'faster' if off > 0 else 'slower'} than the recording: "
            "compared by order; levels near resonances differ for that alone."
        )
        return [text]
    return []


def _speed_words(side: ComparedSide, name: str) -> str:
    if side.angle.is_steady(STEADY):
        return f"{name} turns at {side.angle.mean_speed_rpm:.5g} rpm"
    low, high = side.angle.speed_range_rpm
    return f"{name} runs between {low:.5g} and {high:.5g} rpm"


def _alignment_texts(alignments: Sequence[Alignment]) -> list[str]:
    texts = []
    for alignment in alignments:
        if alignment.method == "marks" and alignment.gain > BETTER_TURNED:
            turned = with_minus(f"{alignment.best_shift_deg:+.4g}°")
            texts.append(
                f"The averages{_of([alignment])} are aligned by their marks; with the simulation turned by {turned} "
                f"they would correlate better by {alignment.gain:.2f}. A simulation's mark need not sit where the "
                "rig's does: align by correlation then."
            )
    loose = [
        alignment for alignment in alignments if alignment.method != "marks" and alignment.tooth_is_certain is False
    ]
    if loose:
        texts.append(
            f"Which tooth{_of(loose)} in the simulation is which in the recording cannot be told: none stands out "
            "alike in both. The simulation's average is aligned to a whole number of teeth, and differences from tooth "
            "to tooth mean nothing."
        )
    return texts


def _of(alignments: Sequence[Alignment]) -> str:
    names = [alignment.shaft for alignment in alignments if alignment.shaft]
    return f" of shaft {' or '.join(names)}" if names else ""
