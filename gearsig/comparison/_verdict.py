"""The verdict of a comparison: differences beyond the scatter of both records, largest first, in a few sentences.

Lines and teeth are ranked by one measure, the part of the vibration's mean square by which they differ: the mean square
of a revolution is the sum over its lines, and also over its teeth.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.comparison._sides import MIN_REVOLUTIONS, ComparedSide
from gearsig.comparison._types import BEYOND, Alignment, ChannelComparison, LevelPair, LineLevel, ShaftComparison
from gearsig.formatting import counted, enumerated, percent, plus_minus, signed

MIN_REPEATED = 0.3
"""Correlation that two averages could reach, below which they cannot be compared because their halves differ."""

WITHIN_DB = 3.0
"""Levels this close are called agreement: a factor of √2."""

CHANCE = 0.05
"""Probability that any one of the lines, or of the teeth, exceeds its scatter by accident."""

FREEDOM = 16
"""Degrees of freedom of a scatter: of two halves over nine lines, in two quadratures that are not quite independent."""

WORTH_DB = 0.5
"""Smaller differences are not reported: one record of a machine against another at 6 % more load."""

WORTH_CORRELATION = 0.01


@dataclass(frozen=True)
class ToothDifference:
    """The tooth at which two averages differ most.

    Parameters
    ----------
    shaft : str
    tooth : int
        From 1 at angle 0.
    angle_deg : float
        Of its centre.
    level : LevelPair
    off_db : float
        Its difference, minus the median of all teeth if that is worth reporting.
    is_beside_others : bool
        Whether the median is subtracted.
    is_marked : bool
        Whether angle 0 is a mark of both records.
    power : float
        The tooth's part of the difference between the averages' mean squares over the revolution.
    """

    shaft: str
    tooth: int
    angle_deg: float
    level: LevelPair
    off_db: float
    is_beside_others: bool
    is_marked: bool
    power: float

    @property
    def place(self) -> str:
        """Shaft, angle and, if it counts from a mark, number of the tooth, in words."""
        of = f" of {self.shaft}" if self.shaft else ""
        return f"tooth {self.tooth}{of} ({self.angle_deg:.0f}°)" if self.is_marked else f"{self.angle_deg:.0f}°{of}"


def times_scatter(n: int) -> float:
    """Return by how many standard errors one of `n` figures must differ not to be an accident.

    Quantile of Student's t at `CHANCE` / n (Bonferroni), but at least `BEYOND`.

    Examples
    --------
    >>> round(times_scatter(10), 1), round(times_scatter(140), 1)
    (3.3, 4.5)
    """
    from scipy.stats import t

    return max(BEYOND, float(t.isf(CHANCE / 2 / max(n, 1), FREEDOM)))


def is_hidden(line: LineLevel) -> bool:
    """Return whether the record that does not show a line could not show it even if it were there."""
    difference_db = line.level.difference_db
    # 6 dB: a line half as large would be seen above the other record's noise.
    return (difference_db if line.simulated_is_seen else -difference_db) <= 6.0


def mesh_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the mesh harmonics that the recording shows, or the shaft orders if it shows none."""
    for kind in ("mesh", "shaft"):
        lines = tuple(line for line in channel.lines if line.kind == kind and line.recorded_is_seen)
        if lines:
            return lines
    return ()


def further_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the comparable lines beside the mesh harmonics: at least one record shows them, and none hides them."""
    mesh = mesh_lines(channel)
    lines = (line for line in (*channel.lines, *channel.other_lines) if line.is_seen and line not in mesh)
    return tuple(line for line in lines if (line.simulated_is_seen and line.recorded_is_seen) or not is_hidden(line))


def differing_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the further lines whose difference is neither an accident nor the mesh harmonics' own, largest first."""
    lines, gain_db = further_lines(channel), common_gain_db(channel)
    needed = times_scatter(len(lines))
    differing = [
        line
        for line in lines
        if abs(line.level.difference_db - gain_db) > max(WORTH_DB, needed * line.level.repeatability_db)
    ]
    return tuple(sorted(differing, key=lambda line: -power_difference(line.level, gain_db)))


def common_gain_db(channel: ChannelComparison) -> float:
    """Return the mesh harmonics' median difference in dB if it is no agreement; else 0.

    If levels do not compare, that of the lines that both records show, mesh harmonics if there are any; else the
    overall levels' difference.
    """
    if not channel.levels_compare:
        lines = _shown_by_both(mesh_lines(channel)) or _shown_by_both(further_lines(channel))
        return float(np.median([line.level.difference_db for line in lines] or [channel.overall.difference_db]))
    gain_db = float(np.median([line.level.difference_db for line in mesh_lines(channel)] or [0.0]))
    return gain_db if abs(gain_db) > WITHIN_DB else 0.0


def _shown_by_both(lines: Iterable[LineLevel]) -> tuple[LineLevel, ...]:
    return tuple(line for line in lines if line.simulated_is_seen and line.recorded_is_seen)


def power_difference(level: LevelPair, gain_db: float = 0.0) -> float:
    """Return the difference of the mean squares, with a gain removed from the simulation's."""
    return float(abs(10.0 ** ((level.simulated_db - gain_db) / 10.0) - 10.0 ** (level.recorded_db / 10.0)))


def differing_tooth(channel: ChannelComparison, alignments: Sequence[Alignment]) -> ToothDifference | None:
    """Return the tooth whose difference stands out most from the others', beyond scatter; None if there is none."""
    aligned = {alignment.shaft: alignment for alignment in alignments}
    teeth = [
        tooth
        for shaft in comparable_averages(channel, alignments)
        if shaft.tooth_levels and (tooth := _tooth(shaft, is_marked=aligned[shaft.shaft].method == "marks")) is not None
    ]
    return max(teeth, key=lambda tooth: tooth.power, default=None)


def _tooth(shaft: ShaftComparison, *, is_marked: bool) -> ToothDifference | None:
    levels, n = shaft.tooth_levels, len(shaft.tooth_levels)
    differences = np.array([level.difference_db for level in levels])
    median_db = float(np.median(differences))
    gain_db = median_db if abs(median_db) > WORTH_DB else 0.0
    apart = differences - gain_db
    errors = np.array([level.repeatability_db for level in levels])
    clear = np.flatnonzero(np.abs(apart) > np.maximum(WORTH_DB, times_scatter(n) * errors))
    if not len(clear):
        return None
    i = int(max(clear, key=lambda tooth: power_difference(levels[tooth], gain_db)))
    power = power_difference(levels[i], gain_db) / n
    angle_deg, is_beside_others = 360.0 * (i + 0.5) / n, gain_db != 0.0
    return ToothDifference(
        shaft.shaft, i + 1, angle_deg, levels[i], float(apart[i]), is_beside_others, is_marked, power
    )


def comparable_averages(channel: ChannelComparison, alignments: Sequence[Alignment]) -> tuple[ShaftComparison, ...]:
    """Return the averages whose halves repeat and that are aligned to the tooth."""
    uncertain = {alignment.shaft for alignment in alignments if alignment.is_doubted}
    return tuple(
        shaft for shaft in channel.shafts if shaft.best_correlation >= MIN_REPEATED and shaft.shaft not in uncertain
    )


def differing_average(channel: ChannelComparison) -> ShaftComparison | None:
    """Return the average whose correlation is furthest below what is possible, beyond scatter; None if none is."""

    def lack(shaft: ShaftComparison) -> float:
        return shaft.best_correlation - shaft.correlation.value

    shafts = [shaft for shaft in channel.shafts if shaft.best_correlation >= MIN_REPEATED]
    needed = times_scatter(len(shafts))
    lacking = [s for s in shafts if lack(s) > max(WORTH_CORRELATION, needed * s.correlation.repeatability)]
    return max(lacking, key=lack, default=None)


# --------------------
# The sentences.
# --------------------


_WHERE = {"mesh": "mesh harmonics", "shaft": "shaft orders"}


def missing_line_text(line: LineLevel) -> str:
    """Return which record lacks a line, or would hide it in its own scatter, in words; empty if both show it.

    The level of a line that is not seen is that of the noise: if that is no lower, the line may well be there.
    """
    if line.simulated_is_seen and line.recorded_is_seen:
        return ""
    record = "recording" if line.simulated_is_seen else "simulation"
    return f"hidden by the {record}'s scatter" if is_hidden(line) else f"not in the {record}"


def verdict_of(channels: Sequence[ChannelComparison], alignments: Sequence[Alignment]) -> str:
    """Return per channel the largest differences beyond scatter.

    One sentence is about the mesh harmonics, or else the shaft orders; one about the line or tooth beside them that
    differs most, or the averages' correlation, if any differs. The one with the larger difference of power comes first,
    unless the mesh harmonics' difference is called agreement.
    """
    return " ".join(_headline(channel, channels) + _verdict_text(channel, alignments) for channel in channels)


def findings_of(channels: Sequence[ChannelComparison]) -> tuple[str, ...]:
    """Return sentences on lines that only one side has, the averages' shapes, and the energy locked to the shafts."""
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
    if not mesh_lines(channel):
        return elsewhere if channel.levels_compare else f"The unit of one side is not known. {elsewhere}"
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
    """Return a sentence on the largest difference beside the mesh harmonics, and its power; empty if there is none."""
    tooth = differing_tooth(channel, alignments)
    lines, gain_db = differing_lines(channel), common_gain_db(channel)
    line_powers = [power_difference(line.level, gain_db) for line in lines]
    if tooth is not None and tooth.power >= max(line_powers, default=0.0):
        off = plus_minus(abs(tooth.off_db), BEYOND * tooth.level.repeatability_db)
        beside = " against the other teeth" if tooth.is_beside_others else ""
        where = f"at {tooth.place}, where the simulation is too {_word(tooth.off_db)} by {off} dB{beside}"
        return f"The averages over angle differ most {where}.", tooth.power
    if lines:
        return f"{_most_text(channel, lines[0], gain_db)}.", line_powers[0]
    average = differing_average(channel)
    if average is None:
        return "", 0.0
    of = f" of {average.shaft}" if average.shaft else ""
    figure = plus_minus(average.correlation.value, BEYOND * average.correlation.repeatability, 3)
    possible = f"{average.best_correlation:.3f} is possible"
    text = f"The synchronous averages{of} differ: their correlation is {figure} where {possible}."
    if average.correlation.value <= TURNED_ABOUT:
        text += " One reads the other way round: a sensor mounted on the other side or wired the other way does."
    return text, 0.0


TURNED_ABOUT = -0.5
"""Correlation below which one average is the other with reversed sign."""


def _most_text(channel: ChannelComparison, line: LineLevel, gain_db: float) -> str:
    beside = next((f"Beside the {_WHERE[main.kind]}, " for main in mesh_lines(channel) if main.kind != line.kind), "")
    off_db, scatter = line.level.difference_db - gain_db, BEYOND * line.level.repeatability_db
    after = f" after a common gain of {signed(-gain_db)} dB" if gain_db else ""
    if words := missing_line_text(line):
        text = f"{line.label} differs most{after}: it is {words}, by {abs(off_db):.1f} dB or more"
    else:
        by = plus_minus(abs(off_db), scatter)
        text = f"{line.label} differs most{after}: there the simulation is too {_word(off_db)} by {by} dB"
    return f"{beside}{text}" if beside else f"{text[:1].upper()}{text[1:]}"


def _word(off_db: float) -> str:
    return "weak" if off_db < 0 else "strong"


def _levels_text(channel: ChannelComparison, alignments: Sequence[Alignment] | None = None) -> str:
    """Return how far apart the mesh harmonics are; with alignments also that nothing else differs, if so."""
    lines = mesh_lines(channel) or (() if channel.levels_compare else _shown_by_both(further_lines(channel)))
    if not lines:
        return "No line of the recording stands above its own noise: only the floors can be compared."
    where = _WHERE.get(lines[0].kind, "lines")
    comparable = [line for line in lines if line.simulated_is_seen or not is_hidden(line)]
    hidden = len(lines) - len(comparable)
    if not comparable:
        return f"The simulation's own scatter hides all {where} of the recording: they cannot be compared."
    further = () if alignments is None else _further_places(channel, alignments)
    unknown_gain_db = None if channel.levels_compare else common_gain_db(channel)
    text = _lines_text(comparable, where, further, unknown_gain_db)
    return f"{text} {hidden} more are hidden by the simulation's own scatter." if hidden else text


def _further_places(channel: ChannelComparison, alignments: Sequence[Alignment]) -> tuple[str, ...]:
    """Return the names of what was compared besides the mesh harmonics."""
    n = len(further_lines(channel))
    by_tooth = any(shaft.tooth_levels for shaft in comparable_averages(channel, alignments))
    return (*((f"{counted(n, 'other line')}",) if n else ()), *(("tooth by tooth",) if by_tooth else ()))


def _lines_text(lines: Sequence[LineLevel], where: str, further: Sequence[str], unknown_gain_db: float | None) -> str:
    differences = np.array([line.level.difference_db for line in lines])
    gain = float(np.median(differences)) if unknown_gain_db is None else unknown_gain_db
    n = f"{len(lines)} {where}" if len(lines) > 1 else f"one {where[:-1]}"
    worst = lines[int(np.argmax(np.abs(differences - (unknown_gain_db or 0.0))))]
    if unknown_gain_db is not None:
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
    # A common gain beyond 3 dB is reported separately: it belongs to the path or the sensor, not to the gears.
    if len(lines) > 1 and abs(gain) > 3.0 and spread < largest:
        text += f"; a common gain of {signed(-gain)} dB would bring them within {spread:.1f} dB"
    return f"{text}."


def _line_text(line: LineLevel, gain: float) -> str:
    off = line.level.difference_db - gain
    return f", most at {line.label}, where the simulation is too {_word(off)}"


def _missing_texts(channel: ChannelComparison) -> list[str]:
    """Return texts on the strongest lines that only one of the two shows."""
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
        # A line that one record lacks is reported if it is within 40 dB of the other's strongest.
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
"""Relative differences of speed: the first is not worth reporting; from the second, resonances meet other orders."""

STEADY = 0.03
"""Relative range of speed within one record up to which one average represents all of it."""


def notes_of(
    simulated_side: ComparedSide,
    recorded_side: ComparedSide,
    alignments: Sequence[Alignment],
    channels: Sequence[ChannelComparison],
    ratios: Mapping[str, float],
) -> tuple[str, ...]:
    """Return notes on speeds, shafts left out, alignment and units."""
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
    """Return one text on both speeds; a run-up has no single speed that could be compared with another."""
    if not (simulated_side.angle.is_steady(STEADY) and recorded_side.angle.is_steady(STEADY)):
        unsteady = [
            name
            for side, name in ((simulated_side, "simulation"), (recorded_side, "recording"))
            if not side.angle.is_steady(STEADY)
        ]
        text = (
            f"{_speed_text(simulated_side, 'The simulation')}, {_speed_text(recorded_side, 'the recording')}: levels "
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
            f"({signed(100 * off, 0)} %): orders are compared nevertheless, but each meets other resonances, "
            "and forces change with the speed."
        )
        return [text]
    if abs(off) > SAME_SPEED:
        text = (
            f"The simulation turns {abs(100 * off):.1f} % {'faster' if off > 0 else 'slower'} than the recording: "
            "compared by order; levels near resonances differ for this reason alone."
        )
        return [text]
    return []


def _speed_text(side: ComparedSide, name: str) -> str:
    if side.angle.is_steady(STEADY):
        return f"{name} turns at {side.angle.mean_speed_rpm:.5g} rpm"
    low, high = side.angle.speed_range_rpm
    return f"{name} runs between {low:.5g} and {high:.5g} rpm"


def _alignment_texts(alignments: Sequence[Alignment]) -> list[str]:
    texts = []
    for alignment in alignments:
        if alignment.method == "marks" and alignment.is_doubted:
            turned = f"{signed(alignment.best_shift_deg)}°"
            texts.append(
                f"The averages{_of([alignment])} are aligned by their marks; with the simulation turned by {turned} "
                f"they would correlate better by {alignment.gain:.2f}. A simulation's mark need not sit where the "
                "rig's does: align by correlation then."
            )
    loose = [alignment for alignment in alignments if alignment.method != "marks" and alignment.is_doubted]
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
